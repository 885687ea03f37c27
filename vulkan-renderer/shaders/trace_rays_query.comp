#version 460
#extension GL_GOOGLE_include_directive : require
#define FRONT_QUERY

#include "launch.glsl"
#include "trace_rays.glsl"

layout(local_size_x = 64) in;

void main() {
    uint i = gl_GlobalInvocationID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x + gl_GlobalInvocationID.x;
    if (i < launch.count) {
        trace_ray_number(i);
    }
}

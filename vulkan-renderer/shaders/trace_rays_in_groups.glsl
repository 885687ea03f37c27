// The main function of compute shaders that trace rays from a table: one invocation a ray.
#ifndef TRACE_RAYS_IN_GROUPS_GLSL
#define TRACE_RAYS_IN_GROUPS_GLSL

#include "launch.glsl"
#include "trace_rays.glsl"

layout(local_size_x = 64) in;

void main() {
    uint i = gl_GlobalInvocationID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x + gl_GlobalInvocationID.x;
    if (i < launch.count) {
        trace_ray_number(i);
    }
}

#endif

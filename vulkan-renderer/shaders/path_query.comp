#version 460
#extension GL_GOOGLE_include_directive : require
#define FRONT_QUERY

#include "launch.glsl"
#include "path.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
    add_samples(gl_GlobalInvocationID.xy);
}

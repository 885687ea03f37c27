#version 460
#extension GL_GOOGLE_include_directive : require

#include "launch.glsl"
#include "resolve.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
    resolve_item(gl_GlobalInvocationID.xy);
}

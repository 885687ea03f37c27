// Radiance of single samples, for the tests that compare them with the CPU's. It is a shader of its own, because a driver inlines all that
// a shader may call before it drops what a constant excludes: beside the path, the functions of probe.comp took minutes and gigabytes.
#version 460
#extension GL_GOOGLE_include_directive : require

#define FRONT_BVH

#include "launch.glsl"
#include "path.glsl"
#include "probe_words.glsl"

layout(local_size_x = 64) in;

// A row is a pixel's x and y and the number of the sample.
void main() {
    uint row = gl_GlobalInvocationID.x;
    if (row >= launch.count) {
        return;
    }
    begin(row, 3u, 3u);
    uint x = take(), y = take();
    put_vec3(sample_of_pixel(SceneRef(launch.scene), uvec2(x, y), take()).total);
}

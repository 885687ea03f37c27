// Smooth normals of triangles: twin of transport/src/geometry/mesh_normals.rs, which explains it, and of core/src/octahedral.rs, which
// documents the words.
#ifndef MESH_NORMALS_GLSL
#define MESH_NORMALS_GLSL

#include "dvec3.glsl"

// Stands for the surface's own normal.
const uint FLAT = 0x80008000u;

// Decodes a word to a direction, of a length from 1/√3 to 1.
vec3 decode(uint word) {
    ivec2 parts = ivec2(int(word << 16) >> 16, int(word) >> 16);
    vec2 xy = vec2(parts) / 32767.0;
    float z = 1.0 - abs(xy.x) - abs(xy.y);
    // In the lower half, the outer parts are folded back.
    float missing = max(-z, 0.0);
    return vec3(xy.x >= 0.0 ? xy.x - missing : xy.x + missing, xy.y >= 0.0 ? xy.y - missing : xy.y + missing, z);
}

// Interpolated normal at p, of any length above 0, in the space of the corners; false where the triangle's own normal is meant.
bool blended_normal(DVec3 corners[3], uint normals[3], DVec3 p, out vec3 normal) {
    normal = vec3(0.0);
    if (normals[0] == FLAT && normals[1] == FLAT && normals[2] == FLAT) {
        return false;
    }
    vec3 own = cross(dvec3_to_vec3(dvec3_sub(corners[1], corners[0])), dvec3_to_vec3(dvec3_sub(corners[2], corners[0])));
    vec3 from_p[3];
    [[dont_unroll]] for (uint i = 0u; i < 3u; i++) {
        from_p[i] = dvec3_to_vec3(dvec3_sub(corners[i], p));
    }
    vec3 sum = vec3(0.0);
    [[dont_unroll]] for (uint i = 0u; i < 3u; i++) {
        // Twice the area of the triangle between the point and the other two corners, times twice the whole's.
        float weight = max(dot(cross(from_p[(i + 1u) % 3u], from_p[(i + 2u) % 3u]), own), 0.0);
        vec3 corner = normals[i] == FLAT ? own : decode(normals[i]);
        sum += corner * (weight / sqrt(dot(corner, corner)));
    }
    // Normals of the corners may be opposite, and a triangle may have no area.
    float largest = max(max(abs(sum.x), abs(sum.y)), abs(sum.z));
    if (!(largest > 0.0) || isinf(largest)) {
        return false;
    }
    normal = sum / largest;
    return true;
}

#endif

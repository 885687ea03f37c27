// Traversal of the hierarchy of compute shaders: twin of transport/src/geometry/bvh.rs, which explains nodes and order. GLSL has no
// closures: `along_ray` and `at_voxel` call `bvh_visit`, which the file that includes this one defines.
#ifndef BVH_GLSL
#define BVH_GLSL

#include "layout.glsl"

struct BvhRay {
    vec3 origin;
    vec3 inverse;
    float pad;
};

const uint MAX_DEPTH = 64u;

const float TWO_POW_60 = 1152921504606846976.0;

uint byte_of(uint words[2], uint c) {
    return (words[c >> 2] >> ((c & 3u) << 3)) & 0xFFu;
}

// Moves bit c of `mask` to bit c ^ octant: each bit of the octant swaps neighbours, pairs or halves.
uint in_order(uint octant, uint mask) {
    if ((octant & 1u) != 0u) {
        mask = ((mask & 0x55u) << 1) | ((mask >> 1) & 0x55u);
    }
    if ((octant & 2u) != 0u) {
        mask = ((mask & 0x33u) << 2) | ((mask >> 2) & 0x33u);
    }
    if ((octant & 4u) != 0u) {
        mask = ((mask & 0x0Fu) << 4) | ((mask >> 4) & 0x0Fu);
    }
    return mask;
}

// Mask of the children that the ray meets: bit c for child c. Not `precise`: the pad covers the different rounding of a fused product, and
// the result only selects which boxes are tested.
uint children_along(BvhNode node, BvhRay ray, float limit) {
    float near[8], far[8];
    for (uint c = 0u; c < 8u; c++) {
        near[c] = 0.0;
        far[c] = limit;
    }
    for (uint a = 0u; a < 3u; a++) {
        float inverse_a = ray.inverse[a];
        uint exponent = (node.exponents_and_inner >> (8u * a)) & 0xFFu;
        float scale = uintBitsToFloat((127u + exponent) << 23) * inverse_a;
        float at_origin = (node.origin[a] - ray.origin[a]) * inverse_a;
        float pad = ray.pad * abs(inverse_a);
        float at_near = at_origin - pad, at_far = at_origin + pad;
        bool down = inverse_a < 0.0;
        for (uint c = 0u; c < 8u; c++) {
            float lo = float(byte_of(node.lo[a], c)), hi = float(byte_of(node.hi[a], c));
            near[c] = max(near[c], (down ? hi : lo) * scale + at_near);
            far[c] = min(far[c], (down ? lo : hi) * scale + at_far);
        }
    }
    uint hit = 0u;
    for (uint c = 0u; c < 8u; c++) {
        hit |= near[c] <= far[c] ? 1u << c : 0u;
    }
    return hit;
}

// Whether child c's bounds may hold the voxel.
bool child_may_hold(BvhNode node, uint c, uvec3 voxel) {
    for (uint a = 0u; a < 3u; a++) {
        uint exponent = (node.exponents_and_inner >> (8u * a)) & 0xFFu;
        uint origin = uint(node.origin[a]);
        if (voxel[a] < origin + (byte_of(node.lo[a], c) << exponent)
            || voxel[a] >= origin + (byte_of(node.hi[a], c) << exponent)) {
            return false;
        }
    }
    return true;
}

#endif

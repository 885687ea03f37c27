// Hundreds of lamps: twin of transport/src/lamp/lamp_tree.rs, and of LightTree::near in transport/src/light_tree/mod.rs.
#ifndef LAMP_TREE_GLSL
#define LAMP_TREE_GLSL

#include "light_tree.glsl"
#include "emitters.glsl"

// Part of squared distances that rounding may add up to: 64 roundings.
const float LAMP_ROUNDINGS = 64.0 / 8388608.0;

// About the irradiance that all lamps of the tree give to a receiver, for an importance of 1 `irradiance`; 0 only where they give none.
float lamp_tree_irradiance_at(LightTree tree, float irradiance, Receiver from) {
    float all = importance(tree, 0u, seen_from(tree, from));
    return all > 0.0 ? max(all * irradiance, LEAST_IRRADIANCE) : 0.0;
}

// A search in progress: the ray's origin in the tree's units, and the ranges of lamps that wait, with their nodes. A tree of fewer than 2³¹
// lamps has at most 32 levels.
struct LampSearch {
    vec3 origin;
    uvec3 waiting[32];
    uint depth;
};

LampSearch begin_lamp_search(LightTree tree, DVec3 from) {
    LampSearch search;
    DVec3 way = dvec3_sub(from, dvec3_from_bits(tree.middle));
    search.origin = dvec3_to_vec3(dvec3_scale(way, f64_from_bits(tree.scale)));
    search.waiting[0] = uvec3(0u, 0u, tree.count);
    search.depth = 1u;
    return search;
}

// The next lamp whose bounds the ray may meet, in order; NONE after the last.
uint next_lamp(LightTree tree, inout LampSearch search, vec3 direction) {
    while (search.depth > 0u) {
        search.depth -= 1u;
        uvec3 at = search.waiting[search.depth];
        uint node = at.x, first = at.y, count = at.z;
        while (true) {
            LightNode n = LightNodes(tree.nodes).at[node];
            vec3 lo = vec3_of(n.lo), hi = vec3_of(n.hi);
            vec3 half_extent = (hi - lo) * 0.5;
            vec3 way = (lo + hi) * 0.5 - search.origin;
            float squared = dot(way, way), along = dot(way, direction);
            // The squared distance from the whole line; behind the start, that from the start.
            float beside = squared - (along > 0.0 ? along * along : 0.0);
            float reach = dot(half_extent, half_extent);
            if (beside > reach + (reach + squared) * LAMP_ROUNDINGS) {
                break;
            }
            if (count == 1u) {
                return first;
            }
            uint left = left_of(count);
            search.waiting[search.depth] = uvec3(node + 2u * left, first + left, count - left);
            search.depth += 1u;
            node += 1u;
            count = left;
        }
    }
    return NONE;
}

#endif

// A tree that chooses among lights: twin of transport/src/light_tree/mod.rs, which draws it; transport/src/lamp/lamp_tree.rs uses it for lamps.
#ifndef LIGHT_TREE_GLSL
#define LIGHT_TREE_GLSL

#include "layout.glsl"
#include "dvec3.glsl"
#include "lamp_ball.glsl"
#include "light_cone.glsl"
#include "needs.glsl"

const uint LEVELS_A_NUMBER = 12u;
const float FARTHEST_RECEIVER = 1e4;
const float LEAST_SQUARED = 1e-20;
const float BELOW_ONE = 1.0 - 1.0 / 16777216.0;

// The receiver in the tree's coordinates.
struct SeenFrom {
    vec3 point;
    vec3 normal;
    bool both_sides;
};

// How many of `count` emitters are in the left half.
uint left_of(uint count) {
    return (count + 1u) / 2u;
}

// Importance of the emitters below a node for a receiver.
float importance(LightTree tree, uint number, SeenFrom from) {
    LightNode node = LightNodes(tree.nodes).at[number];
    vec3 lo = vec3_of(node.lo), hi = vec3_of(node.hi);
    vec3 half_extent = (hi - lo) * 0.5;
    vec3 way = (lo + hi) * 0.5 - from.point;
    float squared = max(max(dot(way, way), dot(half_extent, half_extent)), LEAST_SQUARED);
    float power = node.power;
    if (NEEDS_LAMP_TREE != 0u && tree.cones != 0u) {
        power *= cone_towards(Cones(tree.cones).at[number], way, dot(half_extent, half_extent));
    }
    if (from.both_sides) {
        return power / squared;
    }
    // For the corner that is highest above the receiver.
    float height = dot(way, from.normal) + dot(half_extent, abs(from.normal));
    return height <= 0.0 ? 0.0 : power * min(height / sqrt(squared), 1.0) / squared;
}

// Transforms a receiver to the tree's coordinates.
SeenFrom seen_from(LightTree tree, Receiver from) {
    DVec3 way = dvec3_sub(from.point, dvec3_from_bits(tree.middle));
    vec3 point = dvec3_to_vec3(dvec3_scale(way, f64_from_bits(tree.scale)));
    point = clamp(point, vec3(-1e30), vec3(1e30));
    float away = max(max(abs(point.x), abs(point.y)), abs(point.z));
    if (away > FARTHEST_RECEIVER) {
        point *= FARTHEST_RECEIVER / away;
    }
    return SeenFrom(point, from.normal, from.both_sides);
}

// Probability of the left half of a node; below 0 where neither half matters.
float probability_left(LightTree tree, uint node, uint left, SeenFrom from) {
    float a = importance(tree, node + 1u, from);
    float b = importance(tree, node + 2u * left, from);
    float both = a + b;
    return both > 0.0 ? a / both : -1.0;
}

// Chooses an emitter, with its probability; probability 0 where none matters.
uint tree_choose(LightTree tree, SeenFrom from, vec2 numbers, out float probability) {
    uint node = 0u, first = 0u, count = tree.count, level = 0u;
    float u = numbers.x;
    probability = 1.0;
    while (count > 1u) {
        if (level == LEVELS_A_NUMBER) {
            u = numbers.y;
        }
        level += 1u;
        uint left = left_of(count);
        float part = probability_left(tree, node, left, from);
        if (part < 0.0) {
            probability = 0.0;
            return 0u;
        }
        if (u < part) {
            u /= part;
            probability *= part;
            node += 1u;
            count = left;
        } else {
            u = (u - part) / (1.0 - part);
            probability *= 1.0 - part;
            node += 2u * left;
            first += left;
            count -= left;
        }
        u = min(u, BELOW_ONE);
    }
    return first;
}

// The probability with which tree_choose returns this emitter.
float tree_probability(LightTree tree, SeenFrom from, uint emitter) {
    uint node = 0u, first = 0u, count = tree.count;
    float probability = 1.0;
    while (count > 1u) {
        uint left = left_of(count);
        float part = probability_left(tree, node, left, from);
        if (part < 0.0) {
            return 0.0;
        }
        if (emitter < first + left) {
            probability *= part;
            node += 1u;
            count = left;
        } else {
            probability *= 1.0 - part;
            node += 2u * left;
            first += left;
            count -= left;
        }
    }
    return probability;
}

#endif

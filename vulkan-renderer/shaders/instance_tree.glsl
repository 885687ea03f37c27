// The hierarchy over instances: twin of transport/src/geometry/instance_tree.rs, which explains it. All three front ends traverse this tree
// in shader code, because hardware would transform rays to an instance's space with floats.
//
// GLSL has no closures: the traversal is a structure that `instance_tree_next` advances to the next instance.
#ifndef INSTANCE_TREE_GLSL
#define INSTANCE_TREE_GLSL

#include "bvh.glsl"
#include "index_ray.glsl"

const uint INSTANCE_TREE_MAX_DEPTH = 32u;

struct InstanceWalk {
    BvhRay ray;
    // Scaled t at which the ray enters the grid, and scaled t per t of the world's ray.
    f64 enter;
    f64 scale;
    uint octant;
    // The current node; which of its leaves remain, in order, and which items of the current leaf; which of its child nodes remain.
    uint node;
    uint leaves;
    uint item;
    uint item_end;
    uint base;
    uint pending;
    uint inner;
    // First child of a node, and masks of its pending and inner children.
    uint height;
    uvec2 stack[INSTANCE_TREE_MAX_DEPTH];
};

// The ray transformed to the grid; false where it misses all instances, or is not a valid ray.
bool grid_ray(InstanceTree tree, RayInWorld ray, f64 t_max, out InstanceWalk walk) {
    DVec3 direction;
    int k;
    if (!scaled(ray.direction, direction, k)) {
        return false;
    }
    f64 cells_a_unit = f64_from_bits(tree.cells_a_unit);
    DVec3 origin = dvec3_scale(dvec3_sub(ray.origin, dvec3_from_bits(tree.translation)), cells_a_unit);
    if (!dvec3_is_finite(origin)) {
        return false;
    }
    f64 from_origin = f64_max(f64_max(f64_abs(ray.origin.at[0]), f64_abs(ray.origin.at[1])), f64_abs(ray.origin.at[2]));
    f64 pad = f64_add(f64_mul(f64_from_bits(tree.slack_a_unit), from_origin), f64_from_bits(tree.slack));
    f64 enter = F64_ZERO, leave = F64_INFINITY;
    f64 inverse[3];
    ROLLED for (uint a = 0u; a < 3u; a++) {
        f64 d = direction.at[a];
        inverse[a] = f64_div(F64_ONE, f64_copysign(f64_max(f64_abs(d), SMALLEST), d));
        f64 lo = f64_sub(f64_from_u32(tree.lo[a]), pad), hi = f64_add(f64_from_u32(tree.hi[a]), pad);
        bool down = f64_is_negative(inverse[a]);
        f64 t_near = f64_mul(f64_sub(down ? hi : lo, origin.at[a]), inverse[a]);
        f64 t_far = f64_mul(f64_sub(down ? lo : hi, origin.at[a]), inverse[a]);
        enter = f64_lt(enter, t_near) ? t_near : enter;
        leave = f64_lt(t_far, leave) ? t_far : leave;
    }
    walk.scale = f64_mul(f64_exp2(k), cells_a_unit);
    walk.enter = enter;
    if (f64_lt(leave, enter) || f64_lt(f64_mul(t_max, walk.scale), enter)) {
        return false;
    }
    f64 beside = f64_min(pad, f64_exp2(40));
    ROLLED for (uint a = 0u; a < 3u; a++) {
        f64 at = f64_add(origin.at[a], f64_mul(enter, direction.at[a]));
        f64 lo = f64_sub(f64_from_u32(tree.lo[a]), beside), hi = f64_add(f64_from_u32(tree.hi[a]), beside);
        walk.ray.origin[a] = f64_to_f32(f64_clamp(at, lo, hi));
        walk.ray.inverse[a] = clamp(f64_to_f32(inverse[a]), -TWO_POW_60, TWO_POW_60);
    }
    walk.ray.pad = tree.pad + f64_to_f32(f64_mul(beside, f64_exp2(1)));
    return true;
}

// Distance beyond which the hierarchy need not be searched, in its ray's t.
float instance_walk_limit(InstanceWalk walk, f64 t) {
    return f64_to_f32(f64_sub(f64_mul(t, walk.scale), walk.enter)) * 1.000001 + walk.ray.pad;
}

// Enters a node: finds which of its leaves and child nodes the ray meets.
void instance_walk_to(InstanceTree tree, inout InstanceWalk walk, uint number, float limit) {
    BvhNode node = BvhNodes(tree.nodes).at[number];
    uint hit = children_along(node, walk.ray, limit);
    walk.node = number;
    walk.inner = node.exponents_and_inner >> 24;
    walk.leaves = in_order(walk.octant, hit & ~walk.inner);
    walk.pending = in_order(walk.octant, hit & walk.inner);
    walk.base = node.first_child;
}

// Begins the traversal; false where the ray can meet nothing.
bool instance_tree_along_ray(InstanceTree tree, RayInWorld ray, f64 t_max, out InstanceWalk walk) {
    if (!grid_ray(tree, ray, t_max, walk)) {
        return false;
    }
    vec3 inverse = walk.ray.inverse;
    walk.octant = (inverse.x < 0.0 ? 0u : 4u) | (inverse.y < 0.0 ? 0u : 2u) | (inverse.z < 0.0 ? 0u : 1u);
    walk.item = 0u;
    walk.item_end = 0u;
    walk.height = 0u;
    instance_walk_to(tree, walk, 0u, instance_walk_limit(walk, t_max));
    return true;
}

// The next instance that the ray may meet before t, or NONE. The instances of a node come first, then the nearest of its child nodes.
uint instance_tree_next(InstanceTree tree, inout InstanceWalk walk, f64 t) {
    while (true) {
        if (walk.item < walk.item_end) {
            walk.item += 1u;
            return Words(tree.items).at[walk.item - 1u];
        }
        if (walk.leaves != 0u) {
            uint highest = uint(findMSB(walk.leaves));
            walk.leaves &= ~(1u << highest);
            BvhNode node = BvhNodes(tree.nodes).at[walk.node];
            uint meta = byte_of(node.meta, highest ^ walk.octant);
            walk.item = node.first_item + (meta & 31u);
            walk.item_end = walk.item + (meta >> 5);
            continue;
        }
        if (walk.pending == 0u) {
            if (walk.height == 0u) {
                return NONE;
            }
            walk.height -= 1u;
            walk.base = walk.stack[walk.height].x;
            walk.pending = walk.stack[walk.height].y & 0xFFu;
            walk.inner = walk.stack[walk.height].y >> 8;
        }
        uint highest = uint(findMSB(walk.pending));
        walk.pending &= ~(1u << highest);
        if (walk.pending != 0u) {
            walk.stack[walk.height] = uvec2(walk.base, walk.pending | (walk.inner << 8));
            walk.height += 1u;
        }
        uint slot = highest ^ walk.octant;
        uint below = uint(bitCount(walk.inner & ((1u << slot) - 1u)));
        instance_walk_to(tree, walk, walk.base + below, instance_walk_limit(walk, t));
    }
    return NONE;
}

#endif

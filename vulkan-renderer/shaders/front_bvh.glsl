// Finds boxes with our own hierarchy: the loops of transport/src/geometry/bvh.rs, with `visit` for its closures.
#ifndef FRONT_BVH_GLSL
#define FRONT_BVH_GLSL

// Visits each box whose bounds the ray meets within the search's limit, roughly front to back.
void along_ray(InstanceRef instance, BvhRay ray, inout Search search) {
    if (instance.it.box_count == 0u) {
        return;
    }
    BvhNodes nodes = BvhNodes(instance.it.bvh_nodes);
    Words items = Words(instance.it.bvh_items);
    BvhNode node = nodes.at[0];
    uint octant = (ray.inverse.x < 0.0 ? 0u : 4u) | (ray.inverse.y < 0.0 ? 0u : 2u) | (ray.inverse.z < 0.0 ? 0u : 1u);
    // First child of a node, and masks of its pending and inner children.
    uvec2 stack[MAX_DEPTH];
    uint height = 0u;
    float limit = search_limit(search);
    while (true) {
        uint hit = children_along(node, ray, limit);
        uint inner = node.exponents_and_inner >> 24;
        // Boxes first: they may lower the limit.
        uint leaves = in_order(octant, hit & ~inner);
        while (leaves != 0u) {
            uint highest = uint(findMSB(leaves));
            leaves &= ~(1u << highest);
            uint meta = byte_of(node.meta, highest ^ octant);
            uint first = node.first_item + (meta & 31u);
            for (uint i = first; i < first + (meta >> 5); i++) {
                if (visit(instance, search, items.at[i])) {
                    return;
                }
            }
            limit = search_limit(search);
        }
        // Then the nearest remaining node.
        uint base = node.first_child;
        uint pending = in_order(octant, hit & inner);
        if (pending == 0u) {
            if (height == 0u) {
                return;
            }
            height -= 1u;
            base = stack[height].x;
            pending = stack[height].y & 0xFFu;
            inner = stack[height].y >> 8;
        }
        uint highest = uint(findMSB(pending));
        pending &= ~(1u << highest);
        if (pending != 0u) {
            stack[height] = uvec2(base, pending | (inner << 8));
            height += 1u;
        }
        uint slot = highest ^ octant;
        node = nodes.at[base + uint(bitCount(inner & ((1u << slot) - 1u)))];
    }
}

// Visits the boxes whose bounds may hold the voxel. Going on to a sibling reads nine words of the node again; in return the stack, which
// holds nodes with their remaining children, is no deeper than the hierarchy.
void at_voxel(InstanceRef instance, uvec3 voxel, inout Search search) {
    if (instance.it.box_count == 0u) {
        return;
    }
    BvhNodes nodes = BvhNodes(instance.it.bvh_nodes);
    Words items = Words(instance.it.bvh_items);
    // A node, and the first of its children that was not visited.
    uvec2 stack[MAX_DEPTH + 1u];
    stack[0] = uvec2(0u);
    uint height = 1u;
    while (height > 0u) {
        uvec2 top = stack[height - 1u];
        if (top.y == 8u) {
            height -= 1u;
            continue;
        }
        stack[height - 1u].y = top.y + 1u;
        BvhNode node = nodes.at[top.x];
        uint c = top.y;
        if (!child_may_hold(node, c, voxel)) {
            continue;
        }
        uint inner = node.exponents_and_inner >> 24;
        if (((inner >> c) & 1u) != 0u) {
            stack[height] = uvec2(node.first_child + uint(bitCount(inner & ((1u << c) - 1u))), 0u);
            height += 1u;
            continue;
        }
        uint meta = byte_of(node.meta, c);
        uint first = node.first_item + (meta & 31u);
        for (uint i = first; i < first + (meta >> 5); i++) {
            if (visit_holder(instance, search, items.at[i])) {
                return;
            }
        }
    }
}

#endif

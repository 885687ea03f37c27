// Unpacks box records: twin of core/src/volume.rs and box_record.rs, over the drawn boxes.
#ifndef VOLUME_GLSL
#define VOLUME_GLSL

#include "node.glsl"
#include "pages.glsl"
#include "lod.glsl"

struct BoxView {
    uvec3 origin;
    uvec3 extent;
    NodeRef node;
    // Level of detail; the twin computes it where it needs it.
    uint level;
};

uint chunk_of_box(Chunks chunks, uint count, uint index) {
    uint low = 0u, high = count;
    while (low < high) {
        uint middle = (low + high) >> 1;
        if (chunks.at[middle].first_box <= index) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low - 1u;
}

// Everything but the node, whose reading costs the most.
struct BoxPlace {
    uvec3 origin;
    uvec3 extent;
    uint64_t node_word;
    // Leaves of its chunk.
    Address leaves;
    uint level;
};

BoxPlace box_place(InstanceRef instance, uint index) {
    Chunks chunks = Chunks(instance.it.chunks);
    uint c;
    uint64_t record;
    if (is_paged(instance)) {
        PagedBox paged = PagedBoxes(instance.it.boxes).at[index];
        c = paged.page;
        record = paged.record;
    } else {
        c = chunk_of_box(chunks, instance.it.chunk_count, index);
        record = Longs(instance.it.boxes).at[index];
    }
    uint high = uint(record >> 32);
    BoxPlace p;
    p.origin = uvec3(chunks.at[c].origin[0], chunks.at[c].origin[1], chunks.at[c].origin[2])
        + 4u * uvec3((high >> 8) & 255u, (high >> 16) & 255u, high >> 24);
    p.extent = 4u * (uvec3(high & 3u, (high >> 2) & 3u, (high >> 4) & 3u) + 1u);
    p.node_word = chunks.at[c].node_base + uint64_t(uint(record));
    p.leaves = instance.it.leaves + chunks.at[c].leaves;
    p.level = lod_level(instance, p.origin, p.extent);
    return p;
}

BoxView box_view(InstanceRef instance, BoxPlace p) {
    return BoxView(p.origin, p.extent, node_read(instance.it.nodes, p.node_word, p.leaves), p.level);
}

BoxView get_box(InstanceRef instance, uint index) {
    return box_view(instance, box_place(instance, index));
}

uint label_of_box(InstanceRef instance, uint index) {
    if (is_paged(instance)) {
        return PagedBoxes(instance.it.boxes).at[index].label;
    }
    return Words(instance.it.labels).at[index];
}

#endif

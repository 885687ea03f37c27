// The drawn voxels of a volume, all labels together: twin of transport/src/geometry/bricks.rs, which explains it.
#ifndef BRICKS_GLSL
#define BRICKS_GLSL

#include "volume.glsl"
#include "pages.glsl"

const uint BLOCK_SHIFT = 6u;
const uint BRICK_SHIFT = 4u;
const uint CELL_SHIFT = 2u;

// (Where a scene has nothing else, it is known without a look, and the search through a hierarchy is not compiled.)
bool has_bricks(InstanceRef instance) {
    return NEEDS_BRICKS != 0u && ((NEEDS_BOXES | NEEDS_MESHES) == 0u || instance.it.blocks != 0UL);
}

// Index of the last block along each axis.
uvec3 last_block(InstanceRef instance) {
    return (uvec3(instance.it.dims[0], instance.it.dims[1], instance.it.dims[2]) - 1u) >> BLOCK_SHIFT;
}

// Within the mask of a larger part, the bit of its sub-part of side 2^shift that holds the voxel.
uint place_in(uvec3 voxel, uint shift) {
    uvec3 part = (voxel >> shift) & 3u;
    return part.x | (part.y << 2) | (part.z << 4);
}

// The block that holds the voxel.
BrickBlock block_at(InstanceRef instance, uvec3 voxel) {
    uvec3 along = last_block(instance) + 1u, at = voxel >> BLOCK_SHIFT;
    return BrickBlocks(instance.it.blocks).at[at.x + along.x * (at.y + along.y * at.z)];
}

// The number of the brick at an occupied place of a block.
uint block_brick(BrickBlock block, uint place) {
    return block.first_brick + count_ones64(block.occupied & below64(place));
}

Brick brick_at(InstanceRef instance, uint number) {
    return Bricks(instance.it.bricks).at[number];
}

// The voxel mask of an occupied cell of a brick.
uint64_t brick_field(InstanceRef instance, Brick brick, uint cell) {
    uint64_t partial = brick.occupied & ~brick.full;
    if (!bit64(partial, cell)) {
        return 0xFFFFFFFFFFFFFFFFUL;
    }
    return Longs(instance.it.brick_fields).at[brick.first_field + count_ones64(partial & below64(cell))];
}

#endif

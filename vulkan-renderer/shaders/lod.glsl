// Level of detail of a box: twin of transport/src/geometry/lod.rs.
#ifndef LOD_GLSL
#define LOD_GLSL

#include "layout.glsl"

const uint LEVEL_VOXELS = 0u;
const uint LEVEL_CELLS = 1u;
const uint LEVEL_BOXES = 2u;

// The level of one box. Products and sums are in the twin's order, so the result is the same bit for bit.
uint lod_level(InstanceRef instance, uvec3 origin, uvec3 extent) {
    uint lod = instance.it.lod;
    if (lod != LOD_BY_DISTANCE) {
        return lod;
    }
    precise float away[3];
    for (uint a = 0u; a < 3u; a++) {
        float eye = instance.it.eye_in_index[a];
        away[a] = eye - clamp(eye, float(origin[a]), float(origin[a] + extent[a]));
    }
    precise float along[3];
    for (uint r = 0u; r < 3u; r++) {
        along[r] = instance.it.edges_from_index[0][r] * away[0] + instance.it.edges_from_index[1][r] * away[1]
            + instance.it.edges_from_index[2][r] * away[2];
    }
    precise float distance_squared = along[0] * along[0] + along[1] * along[1] + along[2] * along[2];
    return distance_squared >= instance.it.coarser_from_squared[1] ? LEVEL_BOXES
        : distance_squared >= instance.it.coarser_from_squared[0]  ? LEVEL_CELLS
                                                                    : LEVEL_VOXELS;
}

#endif

// Smooth normals of voxels: twin of transport/src/geometry/voxel_normals.rs, which explains it.
#ifndef VOXEL_NORMALS_GLSL
#define VOXEL_NORMALS_GLSL

#include "volume.glsl"
#include "dvec3.glsl"

const uint REACH = 3u;
const int WIDTH = 6;

// Convolution of two intervals of lengths 2 and 3.
float trapezium(float x) {
    return clamp(2.5 - abs(x), 0.0, 2.0);
}

// Its integral from 0.
float trapezium_up_to(float x) {
    float a = min(abs(x), 2.5);
    float area = a <= 0.5 ? 2.0 * a : (2.5 - 0.5 * a) * a - 0.125;
    return x < 0.0 ? -area : area;
}

// Weights about a point: the lowest voxel, and the distance of the point from the upper face of the third.
struct Weights {
    ivec3 first;
    vec3 from_middle;
};

Weights weights_new(DVec3 at) {
    Weights about;
    ROLLED for (uint a = 0u; a < 3u; a++) {
        f64 middle = f64_floor(f64_add(at.at[a], F64_HALF));
        about.from_middle[a] = f64_to_f32(f64_sub(at.at[a], middle));
        about.first[a] = int(f64_to_u32(middle)) - int(REACH);
    }
    return about;
}

// Weight and slope of the voxel with this number along an axis.
vec2 weights_at(Weights about, uint axis, int number) {
    float x = about.from_middle[axis] + (2.5 - float(number));
    return vec2(trapezium_up_to(x + 0.5) - trapezium_up_to(x - 0.5), trapezium(x - 0.5) - trapezium(x + 0.5));
}

// The voxel mask of a cell at a level of detail.
uint64_t voxels_of(BoxView b, uint cell) {
    if (b.level == LEVEL_VOXELS) {
        return node_field(b.node, cell);
    }
    return b.level == LEVEL_BOXES || bit64(b.node.occupied, cell) ? 0xFFFFFFFFFFFFFFFFUL : 0UL;
}

// The contribution of the voxels of one cell from `from` to `to`. Both count from the box's origin, which is `shift` above the lowest
// weight.
vec3 part_of_cell(Weights about, uint64_t voxels, ivec3 from, ivec3 to, ivec3 shift) {
    vec3 sum = vec3(0.0);
    [[dont_unroll]] for (int z = from.z; z < to.z; z++) {
        vec2 along_z = weights_at(about, 2u, z + shift.z);
        [[dont_unroll]] for (int y = from.y; y < to.y; y++) {
            vec2 along_y = weights_at(about, 1u, y + shift.y);
            uint row = uint(voxels >> uint(4 * (y & 3) + 16 * (z & 3)));
            vec2 along_x = vec2(0.0);
            [[dont_unroll]] for (int x = from.x; x < to.x; x++) {
                if (((row >> uint(x & 3)) & 1u) != 0u) {
                    along_x += weights_at(about, 0u, x + shift.x);
                }
            }
            sum += vec3(along_x.y * along_y.x * along_z.x, along_x.x * along_y.y * along_z.x, along_x.x * along_y.x * along_z.y);
        }
    }
    return sum;
}

// −∇f at a point of a face of the box `item`, of any length; 0 where f falls off to no side.
vec3 falling_off(InstanceRef instance, uint item, DVec3 p_in_index) {
    Weights about = weights_new(p_in_index);
    vec3 sum = vec3(0.0);
    Words ends = Words(instance.it.neighbors);
    uint first_box = item == 0u ? 0u : ends.at[item - 1u];
    uint end_box = ends.at[item];
    [[dont_unroll]] for (uint i = first_box; i < end_box; i++) {
        BoxView b = get_box(instance, ends.at[instance.it.box_count + i]);
        ivec3 origin = ivec3(b.origin);
        ivec3 end = ivec3(min(b.origin + b.extent, uvec3(instance.it.dims[0], instance.it.dims[1], instance.it.dims[2])));
        // The part of the neighbourhood that lies in this box, relative to its origin.
        ivec3 lo = max(about.first - origin, ivec3(0));
        ivec3 hi = min(about.first + WIDTH, end) - origin;
        if (any(greaterThanEqual(lo, hi))) {
            continue;
        }
        ivec3 shift = origin - about.first;
        [[dont_unroll]] for (int cell_z = lo.z >> 2; cell_z <= (hi.z - 1) >> 2; cell_z++) {
            [[dont_unroll]] for (int cell_y = lo.y >> 2; cell_y <= (hi.y - 1) >> 2; cell_y++) {
                [[dont_unroll]] for (int cell_x = lo.x >> 2; cell_x <= (hi.x - 1) >> 2; cell_x++) {
                    ivec3 cell = ivec3(cell_x, cell_y, cell_z);
                    uint64_t voxels = voxels_of(b, uint(cell_x | (cell_y << 2) | (cell_z << 4)));
                    if (voxels != 0UL) {
                        sum += part_of_cell(about, voxels, max(lo, 4 * cell), min(hi, 4 * cell + 4), shift);
                    }
                }
            }
        }
    }
    return sum;
}

#endif

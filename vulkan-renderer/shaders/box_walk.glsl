// The walk through the voxels of one box: twin of cpu-renderer/src/traverse/box_walk.rs, which explains it.
//
// Every value that a decision depends on is `precise`: fusing a product and a sum into one rounding would change the order of planes.
#ifndef BOX_WALK_GLSL
#define BOX_WALK_GLSL

#include "volume.glsl"
#include "index_ray.glsl"

struct Step {
    f64 t;
    uint axis;
    uint plane;
    uvec3 voxel;
    uint tied;
};

uvec3 voxel_before(Step step, IndexRay ray) {
    uvec3 v = step.voxel;
    for (uint a = 0u; a < 3u; a++) {
        if (((step.tied >> a) & 1u) != 0u) {
            v[a] += is_down(ray, a) ? 1u : 0xFFFFFFFFu;
        }
    }
    return v;
}

// Planes of a voxel that the ray meets within this distance of each other may tie: 2·16·3·2^−24.

// The same step, entering the voxel through the plane of another axis.
Step through(Step step, uint axis, IndexRay ray) {
    uint plane = step.voxel[axis] + (is_down(ray, axis) ? 1u : 0u);
    return Step(t_of(ray, axis, plane), axis, plane, step.voxel, step.tied);
}

// Whether the ray came into the voxel through another plane at about the same time.
bool is_near_edge(Step step, IndexRay ray) {
    f64 least = f64_sub(step.t, TIE);
    bool near = false;
    ROLLED for (uint a = 0u; a < 3u; a++) {
        near = near || (a != step.axis && f64_le(least, through(step, a, ray).t));
    }
    return near;
}

const uint FOUND_NOTHING = 0u;
const uint FOUND_INSIDE = 1u;
const uint FOUND_FACE = 2u;

struct Found {
    uint kind;
    // For FOUND_INSIDE, the voxel is that of the step.
    Step step;
};

struct Walk {
    uvec3 lo;
    uvec3 mirror;
    uint flip;
    uvec3 m;
    uvec3 m0;
    uvec3 end;
    vec3 first;
    vec3 width;
    uint axis;
    uint tied;
};

const float FAR = 1e30;

float clamp_far(f64 t) {
    float far = f64_to_f32(t);
    return far > FAR ? FAR : far;
}

// Scaled t at which the ray meets mirrored plane j of axis a.
f64 mirrored_t(IndexRay ray, uint a, bool down, uint lo, uint j) {
    return t_of(ray, a, down ? lo + 16u - j : lo + j);
}

// Begins the walk at scaled t = enter, within the box lo..hi; with `known`, in that voxel.
Walk walk_begin_in(IndexRay ray, uvec3 lo, uvec3 hi, f64 enter, bool known, uvec3 voxel) {
    Walk walk;
    walk.lo = lo;
    walk.flip = 0u;
    walk.tied = 0u;
    ROLLED for (uint a = 0u; a < 3u; a++) {
        bool down = is_down(ray, a);
        walk.mirror[a] = down ? 15u : 0u;
        walk.flip |= down ? 3u << (2u * a) : 0u;
        walk.end[a] = down ? 16u : hi[a] - lo[a];
        // First a guess, then the rule: plane j is crossed when T(j) ≤ enter. The rule does not depend on the guess, so the guess may be
        // coarser than the CPU's.
        f64 place = f64_add(f64_sub(ray.origin[a], f64_from_u32(lo[a])), f64_mul(enter, ray.direction[a]));
        float at = f64_to_f32(place);
        uint m = uint(clamp(down ? 16.0 - at : at, 0.0, 15.0));
        f64 behind = mirrored_t(ray, a, down, lo[a], m);
        while (m > 0u && f64_lt(enter, behind)) {
            m -= 1u;
            behind = mirrored_t(ray, a, down, lo[a], m);
        }
        f64 ahead = mirrored_t(ray, a, down, lo[a], m + 1u);
        while (m < 15u && f64_le(ahead, enter)) {
            m += 1u;
            behind = ahead;
            ahead = mirrored_t(ray, a, down, lo[a], m + 1u);
        }
        if (known) {
            m = (voxel[a] - lo[a]) ^ walk.mirror[a];
            behind = mirrored_t(ray, a, down, lo[a], m);
            ahead = f64_max(mirrored_t(ray, a, down, lo[a], m + 1u), enter);
        }
        walk.m[a] = m;
        walk.first[a] = clamp_far(f64_sub(ahead, enter));
        walk.width[a] = clamp_far(f64_abs(ray.inverse[a]));
        // The axis of entry is the one whose plane lies exactly at the entry.
        if (f64_eq(behind, enter) && !f64_eq(ray.direction[a], F64_ZERO)) {
            walk.tied |= 1u << a;
        }
    }
    walk.m0 = walk.m;
    walk.axis = walk.tied == 0u ? 3u : uint(findLSB(walk.tied));
    return walk;
}

Walk walk_begin(IndexRay ray, uvec3 lo, uvec3 hi, f64 enter) {
    return walk_begin_in(ray, lo, hi, enter, false, uvec3(0u));
}

float walk_plane_t(Walk walk, uint a, uint j) {
    precise float steps = float(int(j - walk.m0[a] - 1u)) * walk.width[a];
    precise float t = walk.first[a] + steps;
    return t;
}

// Steps to the next multiple of 2^shift: crosses the nearest of the three planes and all that tie with it. Returns its distance.
float walk_step(inout Walk walk, uint shift) {
    uvec3 next = ((walk.m >> shift) + 1u) << shift;
    if (shift != 0u) {
        next = min(next, walk.end);
    }
    vec3 t = vec3(walk_plane_t(walk, 0u, next.x), walk_plane_t(walk, 1u, next.y), walk_plane_t(walk, 2u, next.z));
    float nearest = t.x < t.y ? t.x : t.y;
    nearest = t.z < nearest ? t.z : nearest;
    walk.tied = 0u;
    for (uint a = 0u; a < 3u; a++) {
        if (t[a] == nearest) {
            walk.m[a] = next[a];
            walk.tied |= 1u << a;
        }
    }
    walk.axis = uint(findLSB(walk.tied));
    return nearest;
}

// After a step of 4 voxels to t: moves the axes that were not crossed to the voxel where the ray is.
void walk_refine(inout Walk walk, float t) {
    for (uint a = 0u; a < 3u; a++) {
        if (((walk.tied >> a) & 1u) == 0u) {
            uint end = (walk.m[a] | 3u) + 1u;
            while (walk.m[a] + 1u < end && walk_plane_t(walk, a, walk.m[a] + 1u) <= t) {
                walk.m[a] += 1u;
            }
        }
    }
}

bool walk_left(Walk walk) {
    return any(greaterThanEqual(walk.m, walk.end));
}

uint walk_cell(Walk walk) {
    uvec3 c = walk.m >> 2u;
    return (c.x | (c.y << 2) | (c.z << 4)) ^ walk.flip;
}

uint walk_voxel_in_cell(Walk walk) {
    uvec3 v = walk.m & 3u;
    return (v.x | (v.y << 2) | (v.z << 4)) ^ walk.flip;
}

// The voxel where the walk is. It is one outside of the box once the walk has left the box.
uvec3 walk_voxel(Walk walk) {
    uvec3 v;
    for (uint a = 0u; a < 3u; a++) {
        v[a] = walk.mirror[a] != 0u ? walk.lo[a] + 15u - walk.m[a] : walk.lo[a] + walk.m[a];
    }
    return v;
}

// The face through which the walk came to its voxel.
Step walk_face(Walk walk, IndexRay ray) {
    uint a = walk.axis;
    uint plane = walk.mirror[a] != 0u ? walk.lo[a] + 16u - walk.m[a] : walk.lo[a] + walk.m[a];
    return Step(t_of(ray, a, plane), a, plane, walk_voxel(walk), walk.tied);
}

Found found_nothing() {
    return Found(FOUND_NOTHING, Step(F64_ZERO, 0u, 0u, uvec3(0u), 0u));
}

// Whether the walk is where it began and the ray began there too, instead of entering through a face.
Found walk_found(Walk walk, IndexRay ray, bool began_inside) {
    if (walk.axis == 3u || (began_inside && walk.m == walk.m0)) {
        return Found(FOUND_INSIDE, Step(F64_ZERO, 0u, 0u, walk_voxel(walk), 0u));
    }
    return Found(FOUND_FACE, walk_face(walk, ray));
}

// The first element of the box's level that holds a voxel.
Found walk_first_solid(Walk walk, IndexRay ray, BoxView b, bool began_inside) {
    if (b.level == LEVEL_BOXES) {
        return walk_found(walk, ray, began_inside);
    }
    while (true) {
        uint cell = walk_cell(walk);
        if (bit64(b.node.occupied, cell)) {
            if (b.level == LEVEL_CELLS) {
                return walk_found(walk, ray, began_inside);
            }
            uint flip;
            uint64_t field = node_flipped_field(b.node, cell, flip);
            while (true) {
                if (bit64(field, walk_voxel_in_cell(walk) ^ flip)) {
                    return walk_found(walk, ray, began_inside);
                }
                uvec3 before = walk.m;
                walk_step(walk, 0u);
                if (any(notEqual((walk.m ^ before) & ~3u, uvec3(0u)))) {
                    break;
                }
            }
        } else {
            float t = walk_step(walk, 2u);
            walk_refine(walk, t);
        }
        if (walk_left(walk)) {
            return found_nothing();
        }
    }
    return found_nothing();
}

// Continues while the elements of the box's level hold voxels. Returns the face through which the ray leaves them, and whether it also left
// the box there.
Step walk_last_solid(Walk walk, IndexRay ray, BoxView b, out bool left_box) {
    while (true) {
        if (b.level == LEVEL_VOXELS) {
            walk_step(walk, 0u);
        } else {
            float t = walk_step(walk, 2u);
            walk_refine(walk, t);
        }
        if (walk_left(walk)) {
            left_box = true;
            break;
        }
        uint cell = walk_cell(walk);
        bool solid = b.level == LEVEL_BOXES ? true
            : b.level == LEVEL_CELLS ? bit64(b.node.occupied, cell)
                                     : node_has(b.node, cell, walk_voxel_in_cell(walk));
        if (!solid) {
            left_box = false;
            break;
        }
    }
    return walk_face(walk, ray);
}

#endif

// Traversal of bricks: twin of cpu-renderer/src/traverse/brick_walk.rs, which says what is exact.
//
// The twin has the mask of all parts that a ray passes through and takes the first occupied one. Here a ray steps from part to part: CPUs
// mispredict the branches of such a walk, while GPUs do not predict branches. Both decide by the planes' t in doubles, cross planes with
// the same t in one step, and so meet the same parts.
//
//     shift 6   blocks of 64³ voxels ─┐ occupied: the shift falls by 2, to the part of that size where the ray is
//     shift 4   bricks                │ empty: on to the next part; on leaving the larger part around it, the ray
//     shift 2   cells                 │ continues from that part
//     shift 0   voxels               ◄┘
#ifndef BRICK_WALK_GLSL
#define BRICK_WALK_GLSL

#include "bricks.glsl"
#include "box_walk.glsl"

struct BrickWalk {
    // Side of the part where the ray is, as a power of 2.
    uint shift;
    // Its lowest corner.
    uvec3 corner;
    // Scaled t at which the ray entered the part, and at which it meets the planes ahead.
    f64 t;
    f64 ahead[3];
};

f64 plane_ahead(BrickWalk walk, IndexRay ray, uint a) {
    return t_of(ray, a, walk.corner[a] + (is_down(ray, a) ? 0u : 1u << walk.shift));
}

// Starts in the block where the ray is at scaled t = enter; planes with t ≤ enter are behind.
BrickWalk brick_walk_begin(InstanceRef instance, IndexRay ray, f64 enter) {
    BrickWalk walk;
    walk.shift = BLOCK_SHIFT;
    walk.t = enter;
    uvec3 last = last_block(instance);
    ROLLED for (uint a = 0u; a < 3u; a++) {
        bool down = is_down(ray, a);
        f64 guess = f64_add(ray.origin[a], f64_mul(enter, ray.direction[a]));
        uint at = f64_to_u32(f64_clamp(guess, F64_ZERO, f64_from_u32(last[a] << BLOCK_SHIFT))) >> BLOCK_SHIFT;
        f64 behind = t_of(ray, a, (down ? at + 1u : at) << BLOCK_SHIFT);
        while (at != (down ? last[a] : 0u) && f64_lt(enter, behind)) {
            at += down ? 1u : 0xFFFFFFFFu;
            behind = t_of(ray, a, (down ? at + 1u : at) << BLOCK_SHIFT);
        }
        walk.ahead[a] = t_of(ray, a, (down ? at : at + 1u) << BLOCK_SHIFT);
        while (at != (down ? 0u : last[a]) && f64_le(walk.ahead[a], enter)) {
            at += down ? 0xFFFFFFFFu : 1u;
            walk.ahead[a] = t_of(ray, a, (down ? at : at + 1u) << BLOCK_SHIFT);
        }
        walk.corner[a] = at << BLOCK_SHIFT;
    }
    return walk;
}

// Descends into the part of a quarter of the side where the ray is: two of the three planes between four parts decide.
void brick_walk_descend(inout BrickWalk walk, IndexRay ray) {
    walk.shift -= 2u;
    ROLLED for (uint a = 0u; a < 3u; a++) {
        bool down = is_down(ray, a);
        f64 middle = t_of(ray, a, walk.corner[a] + (2u << walk.shift));
        bool far_half = f64_le(middle, walk.t);
        // The first of the half's two parts, in the ray's direction.
        uint first = far_half ? 2u : 0u;
        f64 between = t_of(ray, a, walk.corner[a] + ((down ? 3u - first : first + 1u) << walk.shift));
        bool second = f64_le(between, walk.t);
        if (!second) {
            walk.ahead[a] = between;
        } else if (!far_half) {
            walk.ahead[a] = middle;
        }
        uint number = second ? first + 1u : first;
        walk.corner[a] += (down ? 3u - number : number) << walk.shift;
    }
}

// Steps to the next part, unless that does not begin before `end`. When it leaves larger parts, it continues with the largest one left.
bool brick_walk_step(inout BrickWalk walk, InstanceRef instance, IndexRay ray, f64 end) {
    f64 t = f64_lt(walk.ahead[0], walk.ahead[1]) ? walk.ahead[0] : walk.ahead[1];
    t = f64_lt(walk.ahead[2], t) ? walk.ahead[2] : t;
    if (f64_le(end, t)) {
        return false;
    }
    walk.t = t;
    uint tied = 0u;
    uint changed = 0u;
    for (uint a = 0u; a < 3u; a++) {
        if (f64_eq(walk.ahead[a], t)) {
            uint before = walk.corner[a];
            uint side = 1u << walk.shift;
            walk.corner[a] = is_down(ray, a) ? before - side : before + side;
            changed |= walk.corner[a] ^ before;
            tied |= 1u << a;
        }
    }
    while (walk.shift < BLOCK_SHIFT && (changed >> (walk.shift + 2u)) != 0u) {
        walk.shift += 2u;
        tied = 7u;
    }
    if (walk.shift == BLOCK_SHIFT && any(greaterThan(walk.corner >> BLOCK_SHIFT, last_block(instance)))) {
        return false;
    }
    walk.corner &= ~((1u << walk.shift) - 1u);
    ROLLED for (uint a = 0u; a < 3u; a++) {
        if (((tied >> a) & 1u) != 0u) {
            walk.ahead[a] = plane_ahead(walk, ray, a);
        }
    }
    return true;
}

// The face through which a ray enters a voxel.
Found face_of(IndexRay ray, uvec3 voxel, f64 start) {
    f64 t[3];
    f64 last;
    ROLLED for (uint a = 0u; a < 3u; a++) {
        t[a] = t_of(ray, a, voxel[a] + (is_down(ray, a) ? 1u : 0u));
        last = a == 0u || f64_lt(last, t[a]) ? t[a] : last;
    }
    uint tied = 0u;
    for (uint a = 0u; a < 3u; a++) {
        tied |= f64_eq(t[a], last) ? 1u << a : 0u;
    }
    uint axis = uint(findLSB(tied));
    uint plane = voxel[axis] + (is_down(ray, axis) ? 1u : 0u);
    return Found(f64_le(last, start) ? FOUND_INSIDE : FOUND_FACE, Step(last, axis, plane, voxel, tied));
}

// The first voxel before `end` from where a walk begins, within parts of at most `largest`; and its brick, which is `number` at first.
Found first_of_walk(BrickWalk walk, InstanceRef instance, IndexRay ray, uint largest, f64 start, f64 end, inout uint number) {
    BrickBlock block = BrickBlock(0UL, 0u, 0u);
    Brick brick = Brick(0UL, 0UL, 0u, 0u);
    uint64_t field = 0UL;
    if (largest < BLOCK_SHIFT) {
        brick = brick_at(instance, number);
    }
    while (walk.shift <= largest) {
        bool there = true;
        if (walk.shift == BLOCK_SHIFT) {
            block = block_at(instance, walk.corner);
            there = block.occupied != 0UL;
        } else {
            uint place = place_in(walk.corner, walk.shift);
            if (walk.shift == BRICK_SHIFT) {
                there = bit64(block.occupied, place);
                if (there && !is_here(instance, block)) {
                    return found_nothing();
                }
                if (there) {
                    number = block_brick(block, place);
                    brick = brick_at(instance, number);
                }
            } else if (walk.shift == CELL_SHIFT) {
                there = bit64(brick.occupied, place);
                if (there) {
                    field = brick_field(instance, brick, place);
                }
            } else {
                there = bit64(field, place);
                if (there) {
                    return face_of(ray, walk.corner, start);
                }
            }
        }
        if (there) {
            brick_walk_descend(walk, ray);
        } else if (!brick_walk_step(walk, instance, ray, end)) {
            return found_nothing();
        }
    }
    return found_nothing();
}

// The first voxel with scaled t in (start, t_max), or at `start`, and its brick.
Found first_voxel(InstanceRef instance, IndexRay ray, f64 start, f64 t_max, out uint number) {
    uvec3 lo = uvec3(instance.it.lo[0], instance.it.lo[1], instance.it.lo[2]);
    uvec3 hi = uvec3(instance.it.hi[0], instance.it.hi[1], instance.it.hi[2]);
    f64 enter, leave;
    number = NONE;
    clip(ray, lo, hi, start, enter, leave);
    if (f64_le(leave, enter) || f64_le(t_max, enter)) {
        return found_nothing();
    }
    return first_of_walk(brick_walk_begin(instance, ray, enter), instance, ray, BLOCK_SHIFT, start, f64_min(leave, t_max), number);
}

#endif

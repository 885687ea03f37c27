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
//
// **Floats that know their error.** Doubles are slow on cards: a GeForce has one unit for them to 64 for floats. So the walk compares floats,
// and computes doubles only where floats cannot tell. The float of plane p of an axis is its distance in t from `enter`, at which the walk began:
//
//     τ = ((p − whole) − part) · inverse         whole + part is where the ray is at `enter`
//
// Doubles would say t − enter. The difference is at most |τ| / 2²¹ + slack, where
//
//     |τ| / 2²¹                         has four roundings, of p − whole, of the difference, of `inverse` and of the product: each is at most
//                                       2⁻²³, since Vulkan leaves it to a device whether it rounds to nearest or towards zero,
//     |inverse| / 2²²                   has those of `part`, which is below a voxel, and of that voxel within p − whole,
//     (|o · inverse| + |enter|) / 2⁴⁸   those of doubles: of o + enter · d, and of t, each some 2⁻⁵²,
//
// and slack is the sum of the last two. The code takes twice the first, for the roundings of the comparison. Values that are further apart than
// their errors together are in the order of the doubles. Where a ray is almost parallel to a plane, 1 over its direction exceeds floats, and
// `inverse` is cut off at 10³⁰. Then |τ| is too small, but either within its error of what doubles say, or beyond each t of the ray within the
// volume, since a direction has one component of at least 1. What is not finite decides nothing.
#ifndef BRICK_WALK_GLSL
#define BRICK_WALK_GLSL

#include "bricks.glsl"
#include "box_walk.glsl"

// Whether floats are compared before doubles. A processor that runs shaders computes both sides of a branch, so there it costs time.
layout(constant_id = 22) const uint FLOATS_FIRST = 1u;

struct BrickWalk {
    // Side of the part where the ray is, as a power of 2.
    uint shift;
    // Its lowest corner.
    uvec3 corner;
    // Scaled t at which the walk began, where the ray was then, 1 over its direction, and slack.
    f64 enter;
    uvec3 whole;
    vec3 part;
    vec3 inverse;
    vec3 slack;
    // The end of the walk is at least at this τ.
    float limit;
    // τ at which the ray entered the part and its error; the plane and its axis, which is 3 where the walk began there.
    float t;
    float error;
    uint axis;
    uint plane;
    // τ at which it meets the planes ahead.
    vec3 ahead;
};

const float MOST_INVERSE = 1e30;
// 2⁻²⁰, 2⁻²² and 2⁻⁴⁸.
const float OF_FLOATS = 9.5367431640625e-7;
const float OF_PART = 2.384185791015625e-7;
const float OF_DOUBLES = 3.552713678800501e-15;

// A walk from scaled t = enter to t = end. Its corner and shift are not set.
BrickWalk brick_walk_from(IndexRay ray, f64 enter, f64 end) {
    BrickWalk walk;
    walk.enter = enter;
    walk.t = 0.0;
    walk.error = 0.0;
    walk.axis = 3u;
    walk.plane = 0u;
    float far = abs(f64_to_f32(enter));
    float ahead = min(f64_to_f32(f64_sub(end, enter)), MOST_INVERSE);
    walk.limit = ahead - (abs(ahead) * OF_FLOATS + far * OF_DOUBLES);
    ROLLED for (uint a = 0u; a < 3u; a++) {
        f64 place = f64_add(ray.origin[a], f64_mul(enter, ray.direction[a]));
        // (Of a place below 0, which only rounding gives, `part` has all; the error of doubles is as large.)
        walk.whole[a] = f64_to_u32(place);
        walk.part[a] = f64_to_f32(f64_sub(place, f64_from_u32(walk.whole[a])));
        walk.inverse[a] = clamp(f64_to_f32(ray.inverse[a]), -MOST_INVERSE, MOST_INVERSE);
        float steep = abs(walk.inverse[a]);
        walk.slack[a] = steep * OF_PART + (steep * abs(f64_to_f32(ray.origin[a])) + far) * OF_DOUBLES;
    }
    return walk;
}

// τ of a plane.
float near_t(BrickWalk walk, uint a, uint plane) {
    return (float(int(plane - walk.whole[a])) - walk.part[a]) * walk.inverse[a];
}

float error_of(BrickWalk walk, uint a, float t) {
    return abs(t) * OF_FLOATS + walk.slack[a];
}

// The t at which the ray entered the part.
f64 exact_t(BrickWalk walk, IndexRay ray) {
    return walk.axis > 2u ? walk.enter : t_of(ray, walk.axis, walk.plane);
}

uint plane_ahead(BrickWalk walk, IndexRay ray, uint a) {
    return walk.corner[a] + (is_down(ray, a) ? 0u : 1u << walk.shift);
}

// Whether the ray has met a plane where it entered the part.
bool is_behind(BrickWalk walk, IndexRay ray, uint a, uint plane) {
    float t = near_t(walk, a, plane);
    float error = error_of(walk, a, t) + walk.error;
    if (FLOATS_FIRST != 0u && abs(t - walk.t) > error) {
        return t < walk.t;
    }
    return f64_le(t_of(ray, a, plane), exact_t(walk, ray));
}

// Starts in the block where the ray is at scaled t = enter; planes with t ≤ enter are behind.
BrickWalk brick_walk_begin(InstanceRef instance, IndexRay ray, f64 enter, f64 end) {
    BrickWalk walk = brick_walk_from(ray, enter, end);
    walk.shift = BLOCK_SHIFT;
    uvec3 last = last_block(instance);
    ROLLED for (uint a = 0u; a < 3u; a++) {
        bool down = is_down(ray, a);
        uint at = min(walk.whole[a] >> BLOCK_SHIFT, last[a]);
        while (at != (down ? last[a] : 0u) && !is_behind(walk, ray, a, (down ? at + 1u : at) << BLOCK_SHIFT)) {
            at += down ? 1u : 0xFFFFFFFFu;
        }
        while (at != (down ? 0u : last[a]) && is_behind(walk, ray, a, (down ? at : at + 1u) << BLOCK_SHIFT)) {
            at += down ? 0xFFFFFFFFu : 1u;
        }
        walk.corner[a] = at << BLOCK_SHIFT;
        walk.ahead[a] = near_t(walk, a, plane_ahead(walk, ray, a));
    }
    return walk;
}

// Descends into the part of a quarter of the side where the ray is: two of the three planes between four parts decide.
void brick_walk_descend(inout BrickWalk walk, IndexRay ray) {
    walk.shift -= 2u;
    ROLLED for (uint a = 0u; a < 3u; a++) {
        bool down = is_down(ray, a);
        // The first of the half's two parts, in the ray's direction.
        uint number = is_behind(walk, ray, a, walk.corner[a] + (2u << walk.shift)) ? 2u : 0u;
        number += is_behind(walk, ray, a, walk.corner[a] + ((down ? 3u - number : number + 1u) << walk.shift)) ? 1u : 0u;
        walk.corner[a] += (down ? 3u - number : number) << walk.shift;
        walk.ahead[a] = near_t(walk, a, plane_ahead(walk, ray, a));
    }
}

// The axes whose planes the ray meets next, all at the same t; none where that is not before `end`.
uint brick_walk_next(BrickWalk walk, IndexRay ray, f64 end) {
    float t = min(min(walk.ahead.x, walk.ahead.y), walk.ahead.z);
    vec3 errors = abs(walk.ahead) * OF_FLOATS + walk.slack;
    vec3 least = walk.ahead - errors;
    uint first = t == walk.ahead.x ? 0u : (t == walk.ahead.y ? 1u : 2u);
    float most = t + errors[first];
    bool alone = FLOATS_FIRST != 0u && most < walk.limit;
    for (uint a = 0u; a < 3u; a++) {
        alone = alone && (a == first || most < least[a]);
    }
    if (alone) {
        return 1u << first;
    }
    f64 exact[3];
    ROLLED for (uint a = 0u; a < 3u; a++) {
        exact[a] = t_of(ray, a, plane_ahead(walk, ray, a));
    }
    f64 next = f64_lt(exact[0], exact[1]) ? exact[0] : exact[1];
    next = f64_lt(exact[2], next) ? exact[2] : next;
    uint tied = 0u;
    for (uint a = 0u; a < 3u; a++) {
        tied |= f64_eq(exact[a], next) ? 1u << a : 0u;
    }
    return f64_le(end, next) ? 0u : tied;
}

// Steps to the next part, unless that does not begin before `end`. When it leaves larger parts, it continues with the largest one left.
bool brick_walk_step(inout BrickWalk walk, InstanceRef instance, IndexRay ray, f64 end) {
    uint tied = brick_walk_next(walk, ray, end);
    if (tied == 0u) {
        return false;
    }
    walk.axis = uint(findLSB(tied));
    walk.plane = plane_ahead(walk, ray, walk.axis);
    walk.t = walk.ahead[walk.axis];
    walk.error = error_of(walk, walk.axis, walk.t);
    uint changed = 0u;
    for (uint a = 0u; a < 3u; a++) {
        if (((tied >> a) & 1u) != 0u) {
            uint before = walk.corner[a];
            uint side = 1u << walk.shift;
            walk.corner[a] = is_down(ray, a) ? before - side : before + side;
            changed |= walk.corner[a] ^ before;
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
            walk.ahead[a] = near_t(walk, a, plane_ahead(walk, ray, a));
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
    f64 end = f64_min(leave, t_max);
    return first_of_walk(brick_walk_begin(instance, ray, enter, end), instance, ray, BLOCK_SHIFT, start, end, number);
}

#endif

// A ray in a volume's index space: twin of cpu-renderer/src/traverse/index_ray.rs,
// transport/src/geometry/placement.rs and power_of_two.rs.
#ifndef INDEX_RAY_GLSL
#define INDEX_RAY_GLSL

#include "trace.glsl"

// Smallest normal double, and 1 over it.
#define SMALLEST f64_exp2(-1022)
#define ONE_OVER_SMALLEST f64_exp2(1022)

// Planes of a voxel that the ray meets within this distance of each other may tie: box_walk.glsl.
#define TIE f64_from_bits(0x3ED8000000000000UL)

struct IndexRay {
    f64 origin[3];
    f64 direction[3];
    f64 inverse[3];
    f64 scaled_from_world;
};

struct Placement {
    DVec3 translation;
    DVec3 adjugate[3];
    f64 determinant;
};

Placement placement_of(InstanceRef instance) {
    Placement p;
    p.translation = dvec3_from_bits(instance.it.translation);
    for (int a = 0; a < 3; a++) {
        p.adjugate[a] = dvec3_from_bits(instance.it.adjugate[a]);
    }
    p.determinant = f64_from_bits(instance.it.determinant);
    return p;
}

DVec3 index_from_world(Placement p, DVec3 v) {
    DVec3 result;
    ROLLED for (int a = 0; a < 3; a++) {
        result.at[a] = f64_div(dvec3_dot(p.adjugate[a], v), p.determinant);
    }
    return result;
}

// The vector times 2^−k with its largest component in [1, 2), and k. False for zero and for vectors that are not finite.
bool scaled(DVec3 v, out DVec3 result, out int k) {
    f64 largest = f64_max(f64_max(f64_abs(v.at[0]), f64_abs(v.at[1])), f64_abs(v.at[2]));
    result = v;
    k = 0;
    if (!dvec3_is_finite(v) || f64_eq(largest, F64_ZERO)) {
        return false;
    }
    int lift = 0;
    if (f64_lt(largest, SMALLEST)) {
        v = dvec3_scale(v, f64_exp2(600));
        largest = f64_mul(largest, f64_exp2(600));
        lift = 600;
    }
    k = int(uint(f64_bits(largest) >> 52)) - 1023;
    // In two steps, because 2^−k itself may not be representable. `half` is a reserved word.
    int halved = k / 2;
    result = dvec3_scale(dvec3_scale(v, f64_exp2(-halved)), f64_exp2(halved - k));
    k -= lift;
    return true;
}

// Moves the origin onto the surface's plane, and turns a direction that rounding turned inward along the plane.
void start_on_face(Placement p, inout DVec3 origin, inout DVec3 direction, DVec3 d_world, int k1, Surface surface, uvec3 upper) {
    int axis = int(min(surface.axis, 2u));
    ROLLED for (int a = 0; a < 3; a++) {
        if (a != axis) {
            f64 inset = f64_exp2(-28);
            origin.at[a] = f64_clamp(origin.at[a], f64_add(f64_from_u32(surface.voxel[a]), inset),
                f64_sub(f64_from_u32(upper[a]), inset));
        }
    }
    origin.at[axis] = f64_from_u32(surface.plane);
    f64 outward = surface.positive ? direction.at[axis] : f64_neg(direction.at[axis]);
    if (f64_le(outward, F64_ZERO)) {
        f64 row = f64_mul(f64_div(dvec3_dot(dvec3_abs(p.adjugate[axis]), dvec3_abs(d_world)), p.determinant), f64_exp2(-k1));
        // ε·4, where the ε of a double is 2^−52.
        if (f64_le(f64_neg(outward), f64_mul(f64_mul(row, f64_exp2(-52)), f64_exp2(2)))) {
            direction.at[axis] = F64_ZERO;
            if (!surface.positive) {
                origin.at[axis] = f64_sub(origin.at[axis], F64_HALF);
            }
        }
    }
}

// Unit normal in the world for a surface with this normal in index space.
DVec3 normal_of(Placement p, DVec3 normal) {
    DVec3 n = normal;
    // Normalise the index-space normal first, then the world normal.
    [[dont_unroll]] for (int turn = 0; turn < 2; turn++) {
        f64 largest = f64_max(f64_max(f64_abs(n.at[0]), f64_abs(n.at[1])), f64_abs(n.at[2]));
        ROLLED for (int a = 0; a < 3; a++) {
            n.at[a] = f64_div(n.at[a], largest);
        }
        if (turn == 0) {
            n = dvec3_add(dvec3_add(dvec3_scale(p.adjugate[0], n.at[0]), dvec3_scale(p.adjugate[1], n.at[1])),
                dvec3_scale(p.adjugate[2], n.at[2]));
        }
    }
    return dvec3_normalize(n);
}

// The ray in index space, its direction scaled; false when it is not finite or has no direction.
bool placement_moved(Placement p, RayInWorld ray, out DVec3 o, out DVec3 d, out DVec3 d_world, out int k0, out int k1) {
    // 1. Scale in the world first.
    if (!scaled(ray.direction, d_world, k0) || !scaled(index_from_world(p, d_world), d, k1)) {
        return false;
    }
    // 2. Subtract the translation before the product.
    o = index_from_world(p, dvec3_sub(ray.origin, p.translation));
    return dvec3_is_finite(o);
}

// The ray in index space; false when it is not finite or has no direction. `from` belongs to this instance or is no surface; for a cap,
// `from.axis` is the axis across which its plane lies at `plane`, or 3. In the grid of a mesh (`to_mesh`) the origin is used as it is,
// because it belongs to no cell.
bool index_ray_new(Placement p, RayInWorld ray, Surface from, uvec3 upper, f64 plane, bool to_mesh, out IndexRay result) {
    DVec3 o, d, d_world;
    int k0, k1;
    if (!placement_moved(p, ray, o, d, d_world, k0, k1)) {
        return false;
    }
    if (from.instance != NONE && from.kind == SURFACE_FACE) {
        start_on_face(p, o, d, d_world, k1, from, upper);
    } else if (from.instance != NONE && from.axis < 3u) {
        o.at[from.axis] = plane;
    }
    // Directions that are 0, or so small that 1/d overflows.
    ROLLED for (int a = 0; a < 3; a++) {
        if (!to_mesh && f64_eq(d.at[a], F64_ZERO)) {
            d.at[a] = F64_ZERO;
            o.at[a] = f64_eq(f64_floor(o.at[a]), o.at[a]) ? f64_add(o.at[a], F64_HALF) : o.at[a];
            result.inverse[a] = ONE_OVER_SMALLEST;
        } else {
            result.inverse[a] = f64_div(F64_ONE, f64_copysign(f64_max(f64_abs(d.at[a]), SMALLEST), d.at[a]));
        }
        result.origin[a] = o.at[a];
        result.direction[a] = d.at[a];
    }
    result.scaled_from_world = f64_mul(f64_exp2(k0), f64_exp2(k1));
    return true;
}

f64 t_of(IndexRay ray, uint a, uint p) {
    return f64_mul(f64_sub(f64_from_u32(p), ray.origin[a]), ray.inverse[a]);
}

f64 world_t(IndexRay ray, uint a, uint p) {
    return f64_div(f64_div(f64_sub(f64_from_u32(p), ray.origin[a]), ray.direction[a]), ray.scaled_from_world);
}

f64 scaled_t(IndexRay ray, f64 world_t) {
    return f64_mul(world_t, ray.scaled_from_world);
}

// The scaled t below which hits matter, when a hit at `best` in the world's t is known.
f64 reach(IndexRay ray, f64 t_max, f64 best) {
    best = scaled_t(ray, best);
    // ε·16, where the ε of a double is 2^−52.
    f64 limit = f64_add(f64_add(best, f64_mul(best, f64_exp2(-48))), f64_mul(f64_exp2(1), TIE));
    t_max = scaled_t(ray, t_max);
    return f64_lt(limit, t_max) ? limit : t_max;
}

bool is_down(IndexRay ray, uint a) {
    return f64_is_negative(ray.inverse[a]);
}

// The part of the ray within lo ≤ x < hi and t ≥ start: empty unless enter < leave.
void clip(IndexRay ray, uvec3 lo, uvec3 hi, f64 start, out f64 enter, out f64 leave) {
    enter = start;
    leave = F64_INFINITY;
    ROLLED for (uint a = 0u; a < 3u; a++) {
        bool down = is_down(ray, a);
        f64 t_near = t_of(ray, a, down ? hi[a] : lo[a]);
        f64 t_far = t_of(ray, a, down ? lo[a] : hi[a]);
        enter = f64_lt(enter, t_near) ? t_near : enter;
        leave = f64_lt(t_far, leave) ? t_far : leave;
    }
}

#endif

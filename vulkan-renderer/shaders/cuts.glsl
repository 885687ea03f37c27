// The parts of a ray that cuts leave: twin of cpu-renderer/src/traverse/cut_ray.rs and transport/src/geometry/cuts.rs.
#ifndef CUTS_GLSL
#define CUTS_GLSL

#include "index_ray.glsl"

#define MINUS_INFINITY f64_neg(F64_INFINITY)

f64 dot_of(f64 a[3], f64 b[3]) {
    f64 sum = f64_mul(a[0], b[0]);
    ROLLED for (int i = 1; i < 3; i++) {
        sum = f64_add(sum, f64_mul(a[i], b[i]));
    }
    return sum;
}

// The plane's coordinate along the axis across which it lies.
f64 cut_plane_across_axis(CutPlane plane) {
    bool up = plane.axis < 3u && !f64_is_negative(f64_from_bits(plane.normal[plane.axis]));
    f64 offset = f64_from_bits(plane.offset);
    return up ? offset : f64_neg(offset);
}

// The scaled t at which the ray crosses the plane, and whether it enters the side that is cut away.
f64 cut_plane_crossing(CutPlane plane, IndexRay ray, out bool rises) {
    if (plane.axis < 3u) {
        uint a = plane.axis;
        bool up = !f64_is_negative(f64_from_bits(plane.normal[a]));
        rises = is_down(ray, a) != up;
        return f64_mul(f64_sub(cut_plane_across_axis(plane), ray.origin[a]), ray.inverse[a]);
    }
    f64 normal[3];
    ROLLED for (int a = 0; a < 3; a++) {
        normal[a] = f64_from_bits(plane.normal[a]);
    }
    f64 rate = dot_of(normal, ray.direction);
    f64 height = f64_sub(f64_from_bits(plane.offset), dot_of(normal, ray.origin));
    if (f64_eq(rate, F64_ZERO)) {
        // Parallel to the plane: always inside, or never.
        rises = true;
        return f64_lt(height, F64_ZERO) ? MINUS_INFINITY : F64_INFINITY;
    }
    rises = f64_lt(F64_ZERO, rate);
    return f64_div(height, rate);
}

// A ray that is intersected with cuts. `from` is the plane on which it starts, or NONE; `outward`, whether it goes to the side that this
// plane cuts away.
struct CutRay {
    Address planes;
    uint count;
    IndexRay ray;
    uint from;
    bool outward;
};

// The interval in which a ray is inside a part, and the planes at its ends. Empty unless enter < leave.
struct Within {
    f64 enter;
    f64 leave;
    uint enter_plane;
    uint leave_plane;
};

// The interval for the part that begins with plane `next`. Then `next` is the first plane of the part after it.
Within cut_ray_within(CutRay cut, inout uint next) {
    Within within = Within(MINUS_INFINITY, F64_INFINITY, 0u, 0u);
    bool ends_part = false;
    while (!ends_part) {
        uint i = next;
        CutPlane plane = CutPlanes(cut.planes).at[i];
        next += 1u;
        bool rises;
        f64 t = cut_plane_crossing(plane, cut.ray, rises);
        if (cut.from == i) {
            t = F64_ZERO;
            rises = cut.outward;
        }
        if (rises && f64_lt(within.enter, t)) {
            within.enter = t;
            within.enter_plane = i;
        } else if (!rises && f64_lt(t, within.leave)) {
            within.leave = t;
            within.leave_plane = i;
        }
        ends_part = plane.ends_part != 0u;
    }
    return within;
}

// The least t from `t` on that is not cut away; `plane` is the plane through which the ray comes to it, NONE where it starts there.
f64 cut_ray_kept_from(CutRay cut, f64 t, out uint plane) {
    plane = NONE;
    bool moved = true;
    while (moved) {
        moved = false;
        uint next = 0u;
        while (next < cut.count) {
            Within within = cut_ray_within(cut, next);
            if (f64_le(within.enter, t) && f64_lt(t, within.leave)) {
                t = within.leave;
                plane = within.leave_plane;
                moved = true;
            }
        }
    }
    return t;
}

// The end of the interval around `t` that is not cut away, and the plane through which the ray leaves it; infinite where there is none.
f64 cut_ray_kept_to(CutRay cut, f64 t, out uint plane) {
    f64 end = F64_INFINITY;
    plane = 0u;
    uint next = 0u;
    while (next < cut.count) {
        Within within = cut_ray_within(cut, next);
        if (f64_lt(within.enter, within.leave) && f64_lt(t, within.enter) && f64_lt(within.enter, end)) {
            end = within.enter;
            plane = within.enter_plane;
        }
    }
    return end;
}

#endif

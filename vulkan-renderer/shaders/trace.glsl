// The geometry queries of the integrator: twin of transport/src/trace.rs.
#ifndef TRACE_GLSL
#define TRACE_GLSL

#include "layout.glsl"
#include "dvec3.glsl"

struct RayInWorld {
    DVec3 origin;
    DVec3 direction;
};

const uint SURFACE_FACE = 0u;
const uint SURFACE_CAP = 1u;
const uint SURFACE_TRIANGLE = 2u;

// `instance` NONE: there is no surface, because a path starts in free space or a ray met nothing. Unlike its twin, a surface has the number
// of its box, so that a path that leaves it need not search for the box.
struct Surface {
    uint instance;
    uint kind;
    uvec3 voxel;
    uint axis;
    bool positive;
    uint plane;
    uint label;
    uint box_number;
};

struct Hit {
    f64 t;
    Surface surface;
    DVec3 normal_in_world;
    bool from_inside;
};

Surface no_surface() {
    return Surface(NONE, SURFACE_FACE, uvec3(0u), 0u, false, 0u, 0u, NONE);
}

Hit no_hit() {
    return Hit(F64_INFINITY, no_surface(), dvec3_of(F64_ZERO, F64_ZERO, F64_ZERO), false);
}

bool is_hit(Hit hit) {
    return hit.surface.instance != NONE;
}

// Whether the ray started inside something solid and sees it from inside.
bool is_seen_from_within(Hit hit) {
    return hit.from_inside && hit.surface.kind != SURFACE_TRIANGLE;
}

// The unit normal on the side that the ray came from; the outward normal where the ray was inside.
DVec3 normal_towards_ray(Hit hit) {
    bool back = hit.from_inside && hit.surface.kind == SURFACE_TRIANGLE;
    return back ? dvec3_neg(hit.normal_in_world) : hit.normal_in_world;
}

// `smooth_one`, flipped to the side of `normal`.
DVec3 on_side_of(Hit hit, DVec3 normal, DVec3 smooth_one) {
    return f64_lt(dvec3_dot(normal, hit.normal_in_world), F64_ZERO) ? dvec3_neg(smooth_one) : smooth_one;
}

Surface surface_from_record(SurfaceRecord r) {
    return Surface(r.instance, r.face >> 3, uvec3(r.voxel[0], r.voxel[1], r.voxel[2]), r.face & 3u, (r.face & 4u) != 0u, r.plane,
        r.label, r.box_number);
}

SurfaceRecord record_of_surface(Surface s) {
    SurfaceRecord r;
    r.instance = s.instance;
    r.voxel[0] = s.voxel.x;
    r.voxel[1] = s.voxel.y;
    r.voxel[2] = s.voxel.z;
    r.face = s.axis | (s.positive ? 4u : 0u) | (s.kind << 3);
    r.plane = s.plane;
    r.label = s.label;
    r.box_number = s.box_number;
    return r;
}

HitRecord record_of_hit(Hit hit) {
    HitRecord r;
    r.t = f64_bits(hit.t);
    for (int a = 0; a < 3; a++) {
        r.normal[a] = f64_bits(hit.normal_in_world.at[a]);
    }
    r.surface = record_of_surface(hit.surface);
    r.from_inside = hit.from_inside ? 1u : 0u;
    r.reserved = 0u;
    return r;
}

#endif

// Paths through surfaces: twin of cpu-renderer/src/crossing.rs, which explains it. A function there that traces a ray is a state of the
// loop in path.glsl here.
#ifndef CROSSING_GLSL
#define CROSSING_GLSL

#include "trace.glsl"

const uint MAX_TRANSPARENT_SURFACES = 1024u;

// The front of the label whose back is `back`, where it touches the face that was left.
Hit front_of(Hit back, Hit left) {
    Hit front = back;
    front.surface.voxel = left.surface.voxel;
    front.surface.voxel[left.surface.axis] =
        left.surface.positive ? left.surface.plane : max(left.surface.plane, 1u) - 1u;
    front.surface.kind = left.surface.kind;
    front.surface.axis = left.surface.axis;
    front.surface.positive = !left.surface.positive;
    front.surface.plane = left.surface.plane;
    // The box that holds its voxel is unknown: the back may belong to another box of the label.
    front.surface.box_number = NONE;
    front.t = F64_ZERO;
    front.normal_in_world = dvec3_neg(left.normal_in_world);
    front.from_inside = false;
    return front;
}

// Whether a ray goes outward from the surface that it leaves.
bool goes_outward(DVec3 direction, Hit left) {
    return f64_lt(F64_ZERO, dvec3_dot(direction, left.normal_in_world));
}

// Whether a ray that continues from the surface `left` may be inside another label at once: it goes outward from the back of a label, or
// from a front that touches such a back (whose t is 0, which no tracer returns).
bool may_touch(DVec3 direction, Hit left) {
    return is_hit(left) && (left.from_inside || f64_eq(left.t, F64_ZERO)) && left.surface.kind == SURFACE_FACE &&
        goes_outward(direction, left);
}

// `hit` is what a ray from the surface `left` met first. The ray was traced without a limit where it may touch another label, else to
// t_max.
Hit next_hit(Hit hit, DVec3 direction, Hit left, f64 t_max) {
    if (is_hit(hit) && may_touch(direction, left)) {
        if (is_seen_from_within(hit) && hit.surface.instance == left.surface.instance) {
            hit = front_of(hit, left);
        } else if (!f64_lt(hit.t, t_max)) {
            hit = no_hit();
        }
    }
    return hit;
}

#endif

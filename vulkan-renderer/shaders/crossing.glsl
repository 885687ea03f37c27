// Paths through surfaces: twin of cpu-renderer/src/crossing.rs, which explains it. What follows a ray to a light there is a state of the
// loop in path.glsl here.
#ifndef CROSSING_GLSL
#define CROSSING_GLSL

#include "needs.glsl"
#include "scene_tracer.glsl"

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

// Whether a ray that continues from the surface `left` leaves a label: outward from its back, or from a front that touches such a back
// (whose t is 0, which no tracer returns).
bool leaves_label(DVec3 direction, Hit left) {
    return is_hit(left) && (left.from_inside || f64_eq(left.t, F64_ZERO)) && left.surface.kind != SURFACE_TRIANGLE &&
        goes_outward(direction, left);
}

// Whether a ray that continues from the surface `left` may be inside another label of the same instance at once.
bool may_touch(DVec3 direction, Hit left) {
    return left.surface.kind == SURFACE_FACE && leaves_label(direction, left);
}

// `hit` is what a ray from the surface `left` met first. The ray was traced without a limit where it may touch another label, else to
// t_max.
Hit next_hit_alone(Hit hit, DVec3 direction, Hit left, f64 t_max) {
    if (is_hit(hit) && may_touch(direction, left)) {
        if (is_seen_from_within(hit) && hit.surface.instance == left.surface.instance) {
            hit = front_of(hit, left);
        } else if (!f64_lt(hit.t, t_max)) {
            hit = no_hit();
        }
    }
    return hit;
}

// The first surface along a ray that starts on the surface `left` (or, where that is none, from a free point), with t below `t_max`; with
// `any`, some surface where one suffices. The twin's functions that trace are one loop here, because shaders inline what they call: a
// state says whether the ray is traced itself, or a short one through the place where a label ends (see the twin).
Hit next_hit(SceneRef scene, RayInWorld ray, Hit left, f64 t_max, bool any, bool among_catchers) {
    bool crosses = (NEEDS_TRANSPARENT | NEEDS_GLASS) != 0u && !any;
    bool in_contact = crosses && scene.it.contact_distance != 0UL;
    f64 near = F64_ZERO;
    if (in_contact) {
        near = f64_div(f64_from_bits(scene.it.contact_distance), dvec3_length(ray.direction));
    }
    f64 gone = F64_ZERO;
    // The back that the ray has reached, while it is asked what begins there.
    Hit back = no_hit();
    bool looks = in_contact && leaves_label(ray.direction, left);
    // (The limit ends rays that pass from part to part along an edge without coming forward.)
    [[dont_unroll]] for (uint i = 0u; i < 2u * MAX_TRANSPARENT_SURFACES; i++) {
        RayInWorld asked = ray;
        Surface from = left.surface;
        f64 limit = f64_sub(t_max, gone);
        f64 reach = crosses && may_touch(ray.direction, left) ? F64_INFINITY : limit;
        uint besides = NONE;
        if (looks) {
            asked.origin = dvec3_sub(asked.origin, dvec3_scale(ray.direction, near));
            besides = is_hit(back) ? back.surface.instance : left.surface.instance;
            from = no_surface();
            reach = f64_mul(near, f64_exp2(1));
        }
        Hit hit = scene_ask(scene, asked, from, reach, any, NONE, besides, among_catchers);
        if (looks) {
            looks = false;
            bool is_front = is_hit(hit) && !hit.from_inside;
            hit.t = F64_ZERO;
            if (!is_hit(back)) {
                if (is_front) {
                    return hit;
                }
            } else if (is_front && are_one(scene, hit.surface, back.surface)) {
                // Straight on where another part of the same body begins.
                left = hit;
                back = no_hit();
            } else {
                return back;
            }
            continue;
        }
        if (crosses) {
            hit = next_hit_alone(hit, ray.direction, left, limit);
        }
        if (!in_contact || !is_hit(hit)) {
            return hit;
        }
        ray.origin = dvec3_add(ray.origin, dvec3_scale(ray.direction, hit.t));
        gone = f64_add(gone, hit.t);
        hit.t = gone;
        if (!is_seen_from_within(hit)) {
            return hit;
        }
        back = hit;
        looks = true;
    }
    return no_hit();
}

#endif

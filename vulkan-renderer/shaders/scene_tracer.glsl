// All instances and meshes of a scene: twin of cpu-renderer/src/traverse/scene_tracer.rs.
#ifndef SCENE_TRACER_GLSL
#define SCENE_TRACER_GLSL

#include "volume_tracer.glsl"
#include "instance_tree.glsl"
#include "material_table.glsl"

InstanceRef instance_at(SceneRef scene, uint number) {
    return InstanceRef(scene.it.instances + uint64_t(number) * INSTANCE_BYTES);
}

// Whether two surfaces belong to one label of one body.
bool are_one(SceneRef scene, Surface a, Surface b) {
    return a.label == b.label && instance_at(scene, a.instance).it.body == instance_at(scene, b.instance).it.body;
}

// Whether a hit of instance `number` is a back in the place of another instance's face, which the path leaves.
bool was_passed(uint number, Hit hit, Surface left, f64 near) {
    return is_hit(hit) && f64_le(hit.t, near) && is_seen_from_within(hit) && left.instance != NONE &&
        left.kind != SURFACE_TRIANGLE && left.instance != number;
}

// Whether a hit comes before the nearest one so far. `near` is the difference in t up to which the back of a label comes before the front
// of another; 0 where there are no contacts.
bool comes_before(Hit found, Hit other, f64 near) {
    if (f64_lt(F64_ZERO, near) && is_hit(other) && is_seen_from_within(found) != is_seen_from_within(other) &&
        found.surface.kind != SURFACE_TRIANGLE && other.surface.kind != SURFACE_TRIANGLE) {
        return found.from_inside ? f64_le(found.t, f64_add(other.t, near)) : f64_lt(f64_add(found.t, near), other.t);
    }
    return f64_lt(found.t, other.t) || (f64_eq(found.t, other.t) && found.surface.instance < other.surface.instance);
}

// One function for the queries of the twin (see volume_ask): `first_hit`; with `any`, `occluded`; with `only` a label, `next_boundary` of
// that label in instance `only_instance`; without a label but with such an instance, `first_volume_besides` it.
//
// With `catchers` it tests shadow catchers alone, for which the twin has a separate tracer.
//
// It takes the nearest of the hits in each instance, and of equally near ones that of the lowest instance number, so the order of the tests
// does not matter. (There is one call of volume_ask, because shaders inline what they call. The next instance is chosen before the call.)
Hit scene_ask(SceneRef scene, RayInWorld ray, Surface from, f64 t_max, bool any, uint only, uint only_instance,
    bool catchers) {
    Hit best = no_hit();
    bool besides = only == NONE && only_instance != NONE;
    // The distance of contacts in the ray's t.
    f64 near = F64_ZERO;
    if ((NEEDS_TRANSPARENT | NEEDS_GLASS) != 0u && only == NONE && !besides && !any && scene.it.contact_distance != 0UL) {
        near = f64_div(f64_from_bits(scene.it.contact_distance), dvec3_length(ray.direction));
    }
    // The instance that is asked again, for what comes behind a back that was passed.
    uint again = NONE;
    uint count = scene.it.instance_count;
    bool by_tree = NEEDS_INSTANCE_TREE != 0u && scene.it.instance_tree.nodes != 0UL && only == NONE;
    InstanceTree tree;
    InstanceWalk walk;
    if (by_tree) {
        tree = scene.it.instance_tree;
        by_tree = instance_tree_along_ray(tree, ray, t_max, walk);
        count = 0u;
    }
    // Instances are tested in turn from `next` to `count`. With a hierarchy, the first is the instance that the path leaves, then those
    // that the hierarchy finds.
    uint next = 0u;
    if (only != NONE) {
        next = only_instance;
        count = min(count, only_instance + 1u);
    } else if (NEEDS_INSTANCE_TREE != 0u && count == 0u && from.instance < scene.it.instance_count) {
        next = from.instance;
        count = next + 1u;
    }
    while (true) {
        uint number = next;
        if (again != NONE) {
            number = again;
        } else if (next < count) {
            next += 1u;
        } else {
            number = by_tree ? instance_tree_next(tree, walk, f64_min(best.t, t_max)) : NONE;
            if (number == NONE) {
                break;
            }
            if (number == from.instance) {
                continue;
            }
        }
        if (NEEDS_CATCHER != 0u && catchers && !material_table_catches(instance_at(scene, number))) {
            continue;
        }
        if (besides && (number == only_instance || is_mesh(instance_at(scene, number)))) {
            continue;
        }
        RayInWorld asked = ray;
        Surface asked_from = from;
        f64 ahead = F64_ZERO;
        if (again != NONE) {
            ahead = f64_mul(near, f64_exp2(1));
            asked.origin = dvec3_add(ray.origin, dvec3_scale(ray.direction, ahead));
            asked_from = no_surface();
        }
        Hit hit = volume_ask(instance_at(scene, number), number, asked, asked_from, t_max, best.t, only, any);
        if (again == NONE && f64_lt(F64_ZERO, near) && was_passed(number, hit, from, near)) {
            again = number;
            continue;
        }
        again = NONE;
        if (!is_hit(hit)) {
            continue;
        }
        if (f64_lt(F64_ZERO, ahead)) {
            hit.t = f64_add(hit.t, ahead);
        }
        bool first = comes_before(hit, best, near);
        if (any || only != NONE || (first && f64_lt(hit.t, t_max))) {
            best = hit;
            if (any) {
                break;
            }
        }
    }
    return best;
}

// The shading normal of a surface at a point; false where it is the geometric normal.
bool scene_smooth_normal(SceneRef scene, Surface surface, DVec3 point, out DVec3 normal) {
    InstanceRef instance = instance_at(scene, surface.instance);
    normal = point;
    return is_mesh(instance) ? mesh_smooth_normal(instance, surface.plane, point, normal)
                             : volume_smooth_normal(instance, surface, point, normal);
}

// The shading normal of a surface at a point, on the side of its geometric `normal`. False where the two are the same; the result is
// `normal` then.
bool shading_normal(SceneRef scene, Hit hit, DVec3 point, inout DVec3 normal) {
    DVec3 smooth_one;
    if (NEEDS_SMOOTH == 0u || !scene_smooth_normal(scene, hit.surface, point, smooth_one)) {
        return false;
    }
    normal = on_side_of(hit, normal, smooth_one);
    return true;
}

#endif

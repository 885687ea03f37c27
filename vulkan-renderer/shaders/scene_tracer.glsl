// All instances and meshes of a scene: twin of cpu-renderer/src/traverse/scene_tracer.rs.
#ifndef SCENE_TRACER_GLSL
#define SCENE_TRACER_GLSL

#include "volume_tracer.glsl"
#include "instance_tree.glsl"
#include "material_table.glsl"

InstanceRef instance_at(SceneRef scene, uint number) {
    return InstanceRef(scene.it.instances + uint64_t(number) * INSTANCE_BYTES);
}

// One function for the three queries of the twin (see volume_ask): `first_hit`; with `any`, `occluded`; with `only` a label,
// `next_boundary` of that label in instance `only_instance`.
//
// With `catchers` it tests shadow catchers alone, for which the twin has a separate tracer.
//
// It takes the nearest of the hits in each instance, and of equally near ones that of the lowest instance number, so the order of the tests
// does not matter. (There is one call of volume_ask, because shaders inline what they call. The next instance is chosen before the call.)
Hit scene_ask(SceneRef scene, RayInWorld ray, Surface from, f64 t_max, bool any, uint only, uint only_instance,
    bool catchers) {
    Hit best = no_hit();
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
        if (next < count) {
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
        Hit hit = volume_ask(instance_at(scene, number), number, ray, from, t_max, best.t, only, any);
        if (!is_hit(hit)) {
            continue;
        }
        bool first = f64_lt(hit.t, best.t) || (f64_eq(hit.t, best.t) && number < best.surface.instance);
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

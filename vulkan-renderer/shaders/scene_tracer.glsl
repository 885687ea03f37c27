// All instances and meshes of a scene: twin of cpu-renderer/src/traverse/scene_tracer.rs.
#ifndef SCENE_TRACER_GLSL
#define SCENE_TRACER_GLSL

#include "volume_tracer.glsl"
#include "instance_tree.glsl"
#include "material_table.glsl"

InstanceRef instance_at(SceneRef scene, uint number) {
    return InstanceRef(scene.it.instances + uint64_t(number) * INSTANCE_BYTES);
}

// One function for the three questions of the twin (see volume_ask): `first_hit`; with `any`, `occluded`; with `only` a label,
// `next_boundary` of it in instance `only_instance`.
//
// With `catchers`, they are asked of shadow catchers alone, for which the twin has a tracer of their own.
//
// The nearest of what each meets by itself, that of the lowest number where several are as near, in whatever order they are asked. (One
// call of volume_ask, because shaders inline what they call: what is asked next is chosen before it.)
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
    // In turn from `next` to `count`; where there is a hierarchy, the one that the path goes on from, and then as that finds them.
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

// The normal that a surface is shaded by at a point; false where that is its own.
bool scene_smooth_normal(SceneRef scene, Surface surface, DVec3 point, out DVec3 normal) {
    InstanceRef instance = instance_at(scene, surface.instance);
    normal = point;
    return is_mesh(instance) ? mesh_smooth_normal(instance, surface.plane, point, normal)
                             : volume_smooth_normal(instance, surface, point, normal);
}

// The normal that a surface is shaded by at a point of it, on the side of its own `normal`; that one where it is it, and false.
bool shading_normal(SceneRef scene, Hit hit, DVec3 point, inout DVec3 normal) {
    DVec3 smooth_one;
    if (NEEDS_SMOOTH == 0u || !scene_smooth_normal(scene, hit.surface, point, smooth_one)) {
        return false;
    }
    normal = on_side_of(hit, normal, smooth_one);
    return true;
}

#endif

// All instances and meshes of a scene: twin of cpu-renderer/src/traverse/scene_tracer.rs.
#ifndef SCENE_TRACER_GLSL
#define SCENE_TRACER_GLSL

#include "volume_tracer.glsl"

InstanceRef instance_at(SceneRef scene, uint number) {
    return InstanceRef(scene.it.instances + uint64_t(number) * INSTANCE_BYTES);
}

// One function for the three questions of the twin (see volume_ask): `first_hit`; with `any`, `occluded`; with `only` a label,
// `next_boundary` of it in instance `only_instance`.
//
// In order of instances, volumes then meshes, each within what the others left: at equal t the lowest instance stays.
Hit scene_ask(SceneRef scene, RayInWorld ray, Surface from, f64 t_max, bool any, uint only, uint only_instance) {
    Hit best = no_hit();
    f64 limit = t_max;
    for (uint i = 0u; i < scene.it.instance_count; i++) {
        if (only != NONE && i != only_instance) {
            continue;
        }
        Hit hit = volume_ask(instance_at(scene, i), i, ray, from, limit, only, any);
        if (is_hit(hit) && (any || only != NONE || f64_lt(hit.t, limit))) {
            best = hit;
            limit = hit.t;
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

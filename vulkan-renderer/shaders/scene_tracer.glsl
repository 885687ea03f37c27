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

#endif

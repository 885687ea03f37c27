// All instances of a scene: twin of cpu-renderer/src/traverse/scene_tracer.rs.
#ifndef SCENE_TRACER_GLSL
#define SCENE_TRACER_GLSL

#include "volume_tracer.glsl"

InstanceRef instance_at(SceneRef scene, uint number) {
    // 312 bytes a record: layout.rs asserts it.
    return InstanceRef(scene.it.instances + uint64_t(number) * 312UL);
}

// In order of instances, each within what the others left: at equal t the lowest instance stays.
Hit first_hit(SceneRef scene, RayInWorld ray, Surface from, f64 t_max) {
    Hit best = no_hit();
    f64 limit = t_max;
    for (uint i = 0u; i < scene.it.instance_count; i++) {
        Hit hit = volume_first_hit(instance_at(scene, i), i, ray, from, limit);
        if (is_hit(hit) && f64_lt(hit.t, limit)) {
            best = hit;
            limit = hit.t;
        }
    }
    return best;
}

bool occluded(SceneRef scene, RayInWorld ray, Surface from, f64 t_max) {
    for (uint i = 0u; i < scene.it.instance_count; i++) {
        if (volume_occluded(instance_at(scene, i), i, ray, from, t_max)) {
            return true;
        }
    }
    return false;
}

Hit next_boundary(SceneRef scene, RayInWorld ray, uint instance, uint label, Surface from, f64 t_max) {
    if (instance >= scene.it.instance_count) {
        return no_hit();
    }
    return volume_next_boundary(instance_at(scene, instance), instance, ray, label, from, t_max);
}

#endif

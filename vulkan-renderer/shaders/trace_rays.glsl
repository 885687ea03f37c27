// Rays in, hits out: what the exactness tests run. Included by one entry point for each front end.
#ifndef TRACE_RAYS_GLSL
#define TRACE_RAYS_GLSL

#include "scene_tracer.glsl"

void trace_ray_number(uint i) {
    SceneRef scene = SceneRef(launch.scene);
    RayRecord r = RayRecords(launch.source).at[i];
    RayInWorld ray = RayInWorld(dvec3_from_bits(r.origin), dvec3_from_bits(r.direction));
    Surface from = surface_from_record(r.from);
    f64 t_max = f64_from_bits(r.t_max);
    Hit hit = no_hit();
    if (r.question == QUESTION_OCCLUDED) {
        // Only whether something is there can be told.
        hit.surface.instance = occluded(scene, ray, from, t_max) ? 0u : NONE;
    } else if (r.question == QUESTION_NEXT_BOUNDARY) {
        hit = next_boundary(scene, ray, r.only_instance, r.only, from, t_max);
    } else {
        hit = first_hit(scene, ray, from, t_max);
    }
    HitRecords(launch.target).at[i] = record_of_hit(hit);
}

#endif

// Traces rays from a table and writes the hits, for the exactness tests. Each front end has an entry point that includes this file.
#ifndef TRACE_RAYS_GLSL
#define TRACE_RAYS_GLSL

#include "scene_tracer.glsl"

void trace_ray_number(uint i) {
    SceneRef scene = SceneRef(launch.scene);
    RayRecord r = RayRecords(launch.source).at[i];
    RayInWorld ray = RayInWorld(dvec3_from_bits(r.origin), dvec3_from_bits(r.direction));
    Surface from = surface_from_record(r.from);
    bool any = r.question == QUESTION_OCCLUDED;
    uint only = r.question == QUESTION_NEXT_BOUNDARY ? r.only : NONE;
    uint only_instance = only != NONE ? r.only_instance : NONE;
    Hit hit = scene_ask(scene, ray, from, f64_from_bits(r.t_max), any, only, only_instance, false);
    HitRecord record = record_of_hit(hit);
#ifdef COUNTS_F64
    record.reserved = f64_operations;
#endif
    HitRecords(launch.target).at[i] = record;
}

#endif

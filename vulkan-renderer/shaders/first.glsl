// The first surface through the centre of each pixel: twin of `first` and `pick` in cpu-renderer/src/path_tracer.rs.
#ifndef FIRST_GLSL
#define FIRST_GLSL

#include "scene_tracer.glsl"
#include "camera_rays.glsl"
#include "material_table.glsl"

void first_of_pixel(uvec2 in_tile) {
    if (in_tile.x >= launch.tile_width || in_tile.y >= launch.tile_height) {
        return;
    }
    SceneRef scene = SceneRef(launch.scene);
    uvec2 pixel = uvec2(launch.tile_x, launch.tile_y) + in_tile;
    uint row = in_tile.y * launch.tile_width + in_tile.x;
    f64 t_max;
    RayInWorld ray = camera_ray(scene.it.camera, f64_add(f64_from_u32(pixel.x), F64_HALF),
        f64_add(f64_from_u32(pixel.y), F64_HALF), t_max);
    Hit hit = scene_ask(scene, ray, no_surface(), t_max, false, NONE, NONE, false);
    if (lacks_a_page()) {
        count_for_pages(launch.page_requests, PAGES_LACKED, 1u);
        return;
    }
    DVec3 position = dvec3_add(ray.origin, dvec3_scale(ray.direction, hit.t));
    // Distance from the camera along the view axis.
    hit.t = f64_add(hit.t, f64_from_bits(scene.it.camera.clip[0]));
    if (launch.wanted != 0u) {
        HitRecords(launch.target).at[row] = record_of_hit(hit);
        return;
    }
    FirstRecord first = FirstRecord(uintBitsToFloat(0x7F800000u), 0u, 0u, float[3](0.0, 0.0, 0.0), float[3](0.0, 0.0, 0.0),
        float[3](0.0, 0.0, 0.0));
    if (is_hit(hit)) {
        first.depth = f64_to_f32(hit.t);
        bool is_labelled = hit.surface.kind != SURFACE_TRIANGLE;
        first.label = is_labelled ? hit.surface.label + 1u : 0u;
        first.instance = is_labelled ? hit.surface.instance : 0u;
        first.albedo = material_of(instance_at(scene, hit.surface.instance), hit.surface.label).base_color;
        DVec3 seen = hit.from_inside ? dvec3_neg(hit.normal_in_world) : hit.normal_in_world;
        shading_normal(scene, hit, position, seen);
        vec3 normal = dvec3_to_vec3(seen);
        first.normal = float[3](normal.x, normal.y, normal.z);
        vec3 p = dvec3_to_vec3(position);
        first.position = float[3](p.x, p.y, p.z);
    }
    FirstRecords(launch.target).at[row] = first;
}

#endif

// Rays of the camera: twin of cpu-renderer/src/camera_rays.rs.
#ifndef CAMERA_RAYS_GLSL
#define CAMERA_RAYS_GLSL

#include "trace.glsl"

// The ray through a point of the picture, in pixels from its upper left corner, and the largest t at which it sees.
RayInWorld camera_ray(CameraRecord camera, f64 x, f64 y, out f64 t_max) {
    f64 width = f64_from_bits(camera.size[0]), height = f64_from_bits(camera.size[1]);
    f64 half_extent = f64_from_bits(camera.half_extent);
    f64 longer = f64_max(width, height);
    f64 place[2];
    place[0] = f64_sub(f64_mul(F64_TWO, x), width);
    place[1] = f64_sub(height, f64_mul(F64_TWO, y));
    ROLLED for (int i = 0; i < 2; i++) {
        f64 shift = f64_mul(F64_TWO, f64_from_bits(camera.shift[i]));
        place[i] = f64_mul(f64_add(f64_div(place[i], longer), shift), half_extent);
    }
    DVec3 aside = dvec3_add(
        dvec3_scale(dvec3_from_bits(camera.right), place[0]), dvec3_scale(dvec3_from_bits(camera.up), place[1]));
    DVec3 position = dvec3_from_bits(camera.position), forward = dvec3_from_bits(camera.forward);
    DVec3 origin = position, direction = forward;
    if (camera.orthographic != 0u) {
        origin = dvec3_add(position, aside);
    } else {
        direction = dvec3_add(forward, aside);
    }
    f64 near = f64_from_bits(camera.clip[0]);
    t_max = f64_sub(f64_from_bits(camera.clip[1]), near);
    return RayInWorld(dvec3_add(origin, dvec3_scale(direction, near)), direction);
}

#endif

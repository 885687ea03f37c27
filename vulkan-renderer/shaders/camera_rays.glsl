// Rays of the camera: twin of transport/src/camera_rays.rs.
#ifndef CAMERA_RAYS_GLSL
#define CAMERA_RAYS_GLSL

#include "trace.glsl"
#include "lens.glsl"

// Offset of a point of the picture from the view axis.
DVec3 camera_aside(CameraRecord camera, f64 x, f64 y) {
    f64 width = f64_from_bits(camera.size[0]), height = f64_from_bits(camera.size[1]);
    f64 half_extent = f64_from_bits(camera.half_extent);
    f64 fitted = f64_from_bits(camera.fitted);
    f64 place[2];
    place[0] = f64_mul(f64_sub(f64_mul(F64_TWO, x), width), f64_from_bits(camera.pixel_aspect));
    place[1] = f64_sub(height, f64_mul(F64_TWO, y));
    ROLLED for (int i = 0; i < 2; i++) {
        f64 shift = f64_mul(F64_TWO, f64_from_bits(camera.shift[i]));
        place[i] = f64_mul(f64_add(f64_div(place[i], fitted), shift), half_extent);
    }
    return dvec3_add(
        dvec3_scale(dvec3_from_bits(camera.right), place[0]), dvec3_scale(dvec3_from_bits(camera.up), place[1]));
}

// The ray from the centre of the lens through a point of the picture, given in pixels from the upper left corner, and the largest t at
// which the ray sees.
RayInWorld camera_ray(CameraRecord camera, f64 x, f64 y, out f64 t_max) {
    DVec3 aside = camera_aside(camera, x, y);
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

// The ray from point u of the lens aperture instead, through the same point in focus.
RayInWorld camera_lens_ray(CameraRecord camera, f64 x, f64 y, vec2 u, out f64 t_max) {
    DVec3 aside = camera_aside(camera, x, y);
    DVec3 position = dvec3_from_bits(camera.position), forward = dvec3_from_bits(camera.forward);
    f64 along, above;
    lens_sample(camera, u, along, above);
    DVec3 off = dvec3_add(
        dvec3_scale(dvec3_from_bits(camera.right), along), dvec3_scale(dvec3_from_bits(camera.up), above));
    bool orthographic = camera.orthographic != 0u;
    DVec3 middle = forward, origin = position;
    if (orthographic) {
        origin = dvec3_add(position, aside);
    } else {
        middle = dvec3_add(forward, aside);
    }
    DVec3 through = dvec3_sub(middle, dvec3_scale(off, f64_from_bits(camera.lens_inverse_focus)));
    f64 stretch = f64_sqrt(f64_div(dvec3_dot(middle, middle), dvec3_dot(through, through)));
    DVec3 direction = dvec3_scale(through, stretch);
    DVec3 onward = direction;
    if (orthographic) {
        onward = through;
    }
    f64 near = f64_from_bits(camera.clip[0]);
    t_max = f64_sub(f64_from_bits(camera.clip[1]), near);
    return RayInWorld(dvec3_add(dvec3_add(origin, off), dvec3_scale(onward, near)), direction);
}

#endif

// Balls with soft falloff, disks that always face the receiver: twin of transport/src/lamp/disk.rs.
#ifndef LAMP_DISK_GLSL
#define LAMP_DISK_GLSL

#include "lamp_ball.glsl"

// A sample of the light along a direction that meets the disk.
LampSample disk_along(Lamp lamp, vec3 to_middle, vec3 direction, float distance_to) {
    LampSample s;
    float cosine = dot(to_middle, direction) / length(to_middle);
    s.direction = direction;
    s.distance_to = distance_to;
    s.radiance = vec3_of(lamp.radiance) * through_cone(lamp, direction);
    s.pdf = distance_to * distance_to / (cosine * PI * lamp.half_extent[0] * lamp.half_extent[0]);
    s.found = greatest(s.radiance) > 0.0 && s.pdf > 0.0 && !isinf(s.pdf);
    return s;
}

LampSample sample_disk(Lamp lamp, vec3 to_middle, vec2 u) {
    if (lamp.half_extent[0] * lamp.half_extent[0] < LEAST_SIN_SQUARED * dot(to_middle, to_middle)) {
        return sample_point(lamp, to_middle);
    }
    vec3 tangent, bitangent;
    frame_around_f32(normalize(to_middle), tangent, bitangent);
    float r = lamp.half_extent[0] * sqrt(u.x);
    vec2 sc = sin_cos(2.0 * PI * u.y);
    vec3 way = to_middle + tangent * (r * sc.y) + bitangent * (r * sc.x);
    float distance_to = length(way);
    return disk_along(lamp, to_middle, way / distance_to, distance_to);
}

LampSample meet_disk(Lamp lamp, vec3 to_middle, vec3 direction) {
    float d2 = dot(to_middle, to_middle), r2 = lamp.half_extent[0] * lamp.half_extent[0];
    float along = dot(to_middle, direction);
    if (along <= 0.0 || r2 < LEAST_SIN_SQUARED * d2) {
        return no_lamp_sample();
    }
    float distance_to = d2 / along;
    vec3 place = direction * distance_to - to_middle;
    if (dot(place, place) > r2) {
        return no_lamp_sample();
    }
    return disk_along(lamp, to_middle, direction, distance_to);
}

#endif

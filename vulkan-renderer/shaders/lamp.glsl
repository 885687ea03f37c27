// A lamp in the scene: twin of transport/src/lamp/mod.rs.
#ifndef LAMP_GLSL
#define LAMP_GLSL

#include "lamp_area.glsl"
#include "lamp_disk.glsl"

const float WIDEST_TAN = 1e18;
const float LEAST_LAMP_COSINE = 1e-3;

vec3 to_middle_of(Lamp lamp, Receiver from) {
    return dvec3_to_vec3(dvec3_sub(dvec3_from_bits(lamp.position), from.point));
}

// About the irradiance of a receiver, for choosing among lights.
float lamp_irradiance_at(Lamp lamp, Receiver from) {
    vec3 way = to_middle_of(lamp, from);
    float height = -dot(way, vec3_of(lamp.axis));
    bool is_flat = lamp.kind > LAMP_SPOT;
    if (is_flat && height <= 0.0) {
        return 0.0;
    }
    float u = lamp.half_extent[0], v = lamp.half_extent[1];
    float radius = is_flat ? sqrt(u * u + v * v) : u;
    vec2 share = vec2(1.0);
    if (lamp.kind == LAMP_SPOT) {
        share.x = about_through_cone(lamp, way);
    } else if (is_flat && lamp.tan_half_spread < WIDEST_TAN) {
        LitPart lit = lit_part(lamp, way);
        if (!lit.found) {
            return 0.0;
        }
        way = lit.way;
        radius = lit.radius;
        share = lit.share;
    }
    float squared = max(max(dot(way, way), radius * radius), LEAST_SQUARED_TO_LAMP);
    float distance_to = sqrt(squared);
    float cosine = 1.0;
    if (!from.both_sides) {
        cosine = clamp((dot(way, from.normal) + radius) / distance_to + HORIZON, 0.0, 1.0);
    }
    if (!is_flat) {
        return lamp.intensity * (share.x / squared) * cosine;
    }
    if (lamp.tan_half_spread == 0.0) {
        return lamp.intensity * cosine;
    }
    // One share after the other, so that a small one of a wide lamp does not underflow.
    float lamp_cosine = max(height / distance_to, LEAST_LAMP_COSINE);
    return lamp.intensity * (share.x / distance_to) * (share.y / distance_to) * lamp_cosine * cosine;
}

// Samples a direction towards it.
LampSample lamp_sample(Lamp lamp, Receiver from, vec2 u) {
    vec3 to_middle = to_middle_of(lamp, from);
    if (lamp.kind <= LAMP_SPOT) {
        if (lamp.soft != 0u) {
            return sample_disk(lamp, to_middle, u);
        }
        return sample_ball(lamp, to_middle, from, u);
    }
    return sample_area(lamp, to_middle, u);
}

// The light of the lamp that a ray in a (unit) direction finds.
LampSample lamp_meet(Lamp lamp, Receiver from, vec3 direction) {
    vec3 to_middle = to_middle_of(lamp, from);
    if (lamp.kind <= LAMP_SPOT) {
        if (lamp.soft != 0u) {
            return meet_disk(lamp, to_middle, direction);
        }
        return meet_ball(lamp, to_middle, from, direction);
    }
    return meet_area(lamp, to_middle, direction);
}

#endif

// Balls, that is point and spot lamps: twin of transport/src/lamp/ball.rs, with the functions of mod.rs that it needs.
#ifndef LAMP_BALL_GLSL
#define LAMP_BALL_GLSL

#include "layout.glsl"
#include "sun.glsl"
#include "receiver.glsl"

const uint LAMP_BALL = 0u;
const uint LAMP_SPOT = 1u;
const uint LAMP_RECTANGLE = 2u;
const uint LAMP_ELLIPSE = 3u;

const float LEAST_SIN_SQUARED = 1e-13;
const float LEAST_SQUARED_TO_LAMP = 1e-30;
const float PART_OF_MOST = 0.2;

// Light from a lamp along one direction. Where `pdf` is 0 it is the only direction, and `radiance` is irradiance.
struct LampSample {
    bool found;
    vec3 direction;
    float distance_to;
    vec3 radiance;
    float pdf;
};

LampSample no_lamp_sample() {
    return LampSample(false, vec3(0.0), 0.0, vec3(0.0), 0.0);
}

float greatest(vec3 v) {
    return max(max(v.x, v.y), v.z);
}

// Whether the lamp emits at all.
bool lamp_is_lit(Lamp lamp) {
    return greatest(vec3_of(lamp.radiance)) > 0.0
        && (lamp.kind != LAMP_SPOT || lamp.one_minus_cos_half_angle > 0.0);
}

// Two unit vectors that form a right-handed frame with a unit normal.
void frame_around_f32(vec3 n, out vec3 tangent, out vec3 bitangent) {
    float sgn = n.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (sgn + n.z);
    float b = n.x * n.y * a;
    tangent = vec3(1.0 + sgn * n.x * n.x * a, sgn * b, -sgn * n.x);
    bitangent = vec3(b, sgn + n.y * n.y * a, -n.y);
}

// The direction whose cosine with `axis` is 1 − w, turned about it by `turn` of a turn.
vec3 around(vec3 axis, float w, float turn) {
    vec3 tangent, bitangent;
    frame_around_f32(axis, tangent, bitangent);
    float sine = sqrt(max(w * (2.0 - w), 0.0));
    vec2 sc = sin_cos(2.0 * PI * turn);
    return tangent * (sine * sc.y) + bitangent * (sine * sc.x) + axis * (1.0 - w);
}

// 3x² − 2x³ between 0 and 1.
float smoothstep_of(float x) {
    x = clamp(x, 0.0, 1.0);
    return x * x * (3.0 - 2.0 * x);
}

// About what a spot's cone lets through to a receiver, for choosing among lights.
float about_through_cone(Lamp lamp, vec3 way) {
    float squared = dot(way, way);
    float radius = lamp.half_extent[0];
    if (squared <= radius * radius) {
        return 1.0;
    }
    float distance_to = sqrt(max(squared, LEAST_SQUARED_TO_LAMP));
    vec3 off = way / distance_to + vec3_of(lamp.axis);
    float apart = sqrt(0.5 * dot(off, off));
    float least = max(apart - radius / distance_to - HORIZON, 0.0);
    float middle = smoothstep_of((lamp.one_minus_cos_half_angle - apart * apart) * lamp.inverse_blend);
    float most = smoothstep_of((lamp.one_minus_cos_half_angle - least * least) * lamp.inverse_blend);
    return max(middle, PART_OF_MOST * most);
}

// Fraction of the light that a spot's cone lets through along a ray towards it.
float through_cone(Lamp lamp, vec3 direction) {
    if (lamp.kind != LAMP_SPOT) {
        return 1.0;
    }
    vec3 apart = direction + vec3_of(lamp.axis);
    float one_minus_cos = 0.5 * dot(apart, apart);
    return smoothstep_of((lamp.one_minus_cos_half_angle - one_minus_cos) * lamp.inverse_blend);
}

// Whether a spot's own cone is sampled instead of the cone that the ball subtends.
bool by_own_cone(Lamp lamp, float one_minus_cos) {
    return lamp.kind == LAMP_SPOT && lamp.one_minus_cos_half_angle < one_minus_cos;
}

// Samples a direction for a receiver inside a ball: proportional to the cosine, or over the sphere.
vec3 within(Receiver from, vec2 u) {
    if (from.both_sides) {
        return around(from.normal, 2.0 * u.x, u.y);
    }
    return around(from.normal, u.x / (1.0 + sqrt(1.0 - u.x)), u.y);
}

// Density of `within`.
float pdf_within(Receiver from, vec3 direction) {
    if (from.both_sides) {
        return 0.25 * FRAC_1_PI;
    }
    return max(dot(from.normal, direction), 0.0) * FRAC_1_PI;
}

LampSample meet_ball(Lamp lamp, vec3 to_middle, Receiver from, vec3 direction) {
    float d2 = dot(to_middle, to_middle), r2 = lamp.half_extent[0] * lamp.half_extent[0];
    float along = dot(to_middle, direction);
    // The point nearest to the centre first, then half of the chord.
    vec3 nearest = to_middle - direction * along;
    float chord2 = r2 - dot(nearest, nearest);
    LampSample s = no_lamp_sample();
    s.direction = direction;
    s.radiance = vec3_of(lamp.radiance);
    if (d2 <= r2) {
        s.distance_to = along + sqrt(max(chord2, 0.0));
        s.pdf = pdf_within(from, direction);
        s.found = s.pdf > 0.0 && lamp_is_lit(lamp);
        return s;
    }
    float sin2 = r2 / d2;
    if (sin2 < LEAST_SIN_SQUARED || along <= 0.0 || chord2 <= 0.0) {
        return s;
    }
    s.radiance *= through_cone(lamp, direction);
    float one_minus_cos = sin2 / (1.0 + sqrt(max(1.0 - sin2, 0.0)));
    float cone = by_own_cone(lamp, one_minus_cos) ? lamp.one_minus_cos_half_angle : one_minus_cos;
    s.distance_to = along - sqrt(chord2);
    s.pdf = 1.0 / (2.0 * PI * cone);
    s.found = greatest(s.radiance) > 0.0;
    return s;
}

// A lamp so small that it is a single direction.
LampSample sample_point(Lamp lamp, vec3 to_middle) {
    float d2 = dot(to_middle, to_middle), r2 = lamp.half_extent[0] * lamp.half_extent[0];
    LampSample s = no_lamp_sample();
    s.distance_to = sqrt(d2);
    s.direction = to_middle / s.distance_to;
    // For a ball, radiance times the solid angle that it subtends.
    float seen = r2 == 0.0 ? 1.0 / d2 : PI * (r2 / d2);
    s.radiance = vec3_of(lamp.radiance) * (seen * through_cone(lamp, s.direction));
    s.found = greatest(s.radiance) > 0.0 && !any(isinf(s.radiance));
    return s;
}

LampSample sample_ball(Lamp lamp, vec3 to_middle, Receiver from, vec2 u) {
    float d2 = dot(to_middle, to_middle), r2 = lamp.half_extent[0] * lamp.half_extent[0];
    float sin2 = r2 / d2;
    if (sin2 < LEAST_SIN_SQUARED) {
        return sample_point(lamp, to_middle);
    }
    float one_minus_cos = sin2 / (1.0 + sqrt(max(1.0 - sin2, 0.0)));
    if (d2 <= r2 || by_own_cone(lamp, one_minus_cos)) {
        vec3 direction = d2 <= r2 ? within(from, u)
                                  : around(-vec3_of(lamp.axis), u.x * lamp.one_minus_cos_half_angle, u.y);
        return meet_ball(lamp, to_middle, from, direction);
    }
    LampSample s;
    float to = sqrt(d2);
    float w = u.x * one_minus_cos;
    s.direction = around(to_middle / to, w, u.y);
    s.radiance = vec3_of(lamp.radiance) * through_cone(lamp, s.direction);
    s.distance_to = to * (1.0 - w) - sqrt(max(r2 - d2 * (w * (2.0 - w)), 0.0));
    s.pdf = 1.0 / (2.0 * PI * one_minus_cos);
    s.found = greatest(s.radiance) > 0.0;
    return s;
}

#endif

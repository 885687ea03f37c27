// The directions in which lights shine: twin of transport/src/light_tree/cone.rs, which explains it.
#ifndef LIGHT_CONE_GLSL
#define LIGHT_CONE_GLSL

#include "layout.glsl"
#include "dvec3.glsl"

// Part of a cosine by which rounding may make an emitter look turned away.
const float CONE_SLACK = 1e-3;

// The sine of an angle from 0 to π, from its cosine.
float sine(float cosine) {
    return sqrt(max(1.0 - cosine * cosine, 0.0));
}

// Cosine and sine of one angle less another, or of 0 where the other is larger; both from 0 to π.
vec2 less(vec2 a, vec2 b) {
    return a.x >= b.x ? vec2(1.0, 0.0) : vec2(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y);
}

// Bound of the cosine between an emitter's axis and the way from it to a receiver; 0 where none of the emitters can shine there. `way` goes
// from the receiver to the middle of a ball around all emitters with this squared radius.
float cone_towards(Cone cone, vec3 way, float squared_radius) {
    float squared = dot(way, way);
    if (cone.cos_spread <= -1.0 || squared <= squared_radius) {
        return 1.0;
    }
    float cosine = clamp(-dot(way, vec3_of(cone.axis)) / sqrt(squared), -1.0, 1.0);
    vec2 from_middle = less(vec2(cosine, sine(cosine)), vec2(cone.cos_spread, sine(cone.cos_spread)));
    float subtended = squared_radius / squared;
    cosine = less(from_middle, vec2(sqrt(1.0 - subtended), sqrt(subtended))).x;
    return cosine <= cone.cos_reach - CONE_SLACK ? 0.0 : max(cosine, CONE_SLACK);
}

#endif

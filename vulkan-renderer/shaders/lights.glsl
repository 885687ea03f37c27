// What lights the scene: twin of transport/src/lights.rs.
#ifndef LIGHTS_GLSL
#define LIGHTS_GLSL

#include "environment.glsl"
#include "lamp.glsl"
#include "emitters.glsl"
#include "needs.glsl"

const uint FINDING_BOTH = 0u;
const uint FINDING_AIMED = 1u;
const uint FINDING_SCATTERED = 2u;

// `pdf` 0: a single direction; `found` false: no sample; `instance`: whose surface it is, NONE where it is none.
struct LightSample {
    bool found;
    DVec3 direction;
    vec3 radiance_over_pdf;
    float pdf;
    f64 distance_to;
    uint instance;
};

// Veach 1997, eq. 9.13 with β = 2. Ratios first: squares of peaked densities overflow.
float power_heuristic(float a, float b) {
    if (a <= 0.0) {
        return 0.0;
    }
    float r = b / a;
    return 1.0 / (1.0 + r * r);
}

// Whether any light is aimed at.
bool any_aimed(Lights lights) {
    return (lights.end_count != 0u || lights.emitters_chance > 0.0) && lights.finding != FINDING_SCATTERED;
}

float light_chance(Lights lights, uint light) {
    if (light >= lights.end_count) {
        return 0.0;
    }
    Floats ends = Floats(lights.ends);
    return (ends.at[light] - (light == 0u ? 0.0 : ends.at[light - 1u])) * (1.0 - lights.emitters_chance);
}

// A light that is no surface, and a direction towards it.
LightSample lights_sample(Lights lights, Environment sky, Receiver from, float choice, vec2 u) {
    LightSample result;
    result.found = false;
    result.distance_to = F64_INFINITY;
    result.instance = NONE;
    Floats ends = Floats(lights.ends);
    uint light = 0u;
    while (light < lights.end_count && ends.at[light] <= choice) {
        light += 1u;
    }
    float chance = light_chance(lights, light);
    SunSample s;
    if (light == 0u) {
        if (sky.width == 0u) {
            return result;
        }
        s = environment_sample(sky, u);
        if (s.pdf <= 0.0) {
            return result;
        }
    } else if (light <= lights.sun_count) {
        s = sun_sample(Suns(lights.suns).at[light - 1u], u);
    } else {
        uint lamp = light - 1u - lights.sun_count;
        if (NEEDS_LAMPS == 0u || lamp >= lights.lamp_count) {
            return result;
        }
        LampSample l = lamp_sample(Lamps(lights.lamps).at[lamp], from, u);
        if (!l.found) {
            return result;
        }
        result.distance_to = f64_mul(f64_from_f32(l.distance_to), f64_from_f32(TOUCHING));
        s = SunSample(dvec3_of(f64_from_f32(l.direction.x), f64_from_f32(l.direction.y), f64_from_f32(l.direction.z)),
            l.radiance, l.pdf);
    }
    result.pdf = s.pdf * chance;
    float over = s.pdf > 0.0 ? result.pdf : chance;
    result.found = over > 0.0;
    result.direction = s.direction;
    result.radiance_over_pdf = s.radiance / over;
    return result;
}

// A light and a direction towards it; `further` numbers are for one of many surfaces.
LightSample lights_aim(SceneRef scene, Lights lights, Environment sky, Receiver from, float choice, vec2 u, vec2 further) {
    if (NEEDS_EMITTERS != 0u && choice < lights.emitters_chance) {
        EmitterSample s = emitters_sample(scene, from, choice / lights.emitters_chance, further, u);
        LightSample result;
        result.found = s.found;
        result.direction = s.direction;
        result.pdf = s.pdf * lights.emitters_chance;
        result.radiance_over_pdf = s.radiance / result.pdf;
        result.distance_to = s.distance_to;
        result.instance = s.instance;
        return result;
    }
    if (NEEDS_EMITTERS != 0u && lights.emitters_chance > 0.0) {
        choice = (choice - lights.emitters_chance) / (1.0 - lights.emitters_chance);
    }
    return lights_sample(lights, sky, from, choice, u);
}

// Weight of light that was aimed at, where scattering would have found it with density `other`.
float aimed_weight(Lights lights, float pdf, float other) {
    return pdf > 0.0 && lights.finding == FINDING_BOTH ? power_heuristic(pdf, other) : 1.0;
}

float scattered_weight(Lights lights, float pdf, float light) {
    if (lights.finding == FINDING_BOTH) {
        return power_heuristic(pdf, light);
    }
    return lights.finding == FINDING_AIMED && light > 0.0 ? 0.0 : 1.0;
}

// Weight of light that a surface was met to send out, by a ray scattered at `from` with density pdf after it had gone `far`.
float emission_weight(SceneRef scene, Lights lights, Receiver from, Hit hit, f64 far, float pdf) {
    if (is_seen_from_within(hit) || f64_eq(hit.t, F64_ZERO)) {
        return 1.0;
    }
    float aimed = emitters_pdf(scene, from, hit.surface, far) * lights.emitters_chance;
    return scattered_weight(lights, pdf, aimed);
}

// Light that a scattered ray (unit direction, drawn with density pdf) finds at infinity.
vec3 lights_found(Lights lights, Environment sky, DVec3 direction, float pdf) {
    vec3 light;
    if (sky.width == 0u) {
        light = vec3_of(lights.sky);
    } else {
        vec3 d = dvec3_to_vec3(direction);
        float sky_pdf = environment_pdf(sky, d) * light_chance(lights, 0u);
        light = environment_eval(sky, d) * scattered_weight(lights, pdf, sky_pdf);
    }
    for (uint i = 0u; i < lights.sun_count; i++) {
        Sun sun = Suns(lights.suns).at[i];
        if (sun.cone_pdf > 0.0 && sun_eval(sun, direction)) {
            float sun_pdf = sun.cone_pdf * light_chance(lights, i + 1u);
            light += vec3_of(sun.radiance) * scattered_weight(lights, pdf, sun_pdf);
        }
    }
    return light;
}

// Light of all lamps that a ray (unit direction) passes through before it has gone `limit`: one that was scattered at `from` with
// density `pdf`, or one of the camera's, which has none.
vec3 lamps_found(Lights lights, Receiver from, DVec3 direction, f64 limit, float pdf, bool of_camera) {
    vec3 d = dvec3_to_vec3(direction);
    vec3 light = vec3(0.0);
    for (uint i = 0u; i < lights.lamp_count; i++) {
        Lamp lamp = Lamps(lights.lamps).at[i];
        if (of_camera && lamp.visible_to_camera == 0u) {
            continue;
        }
        LampSample met = lamp_meet(lamp, from, d);
        if (met.found && f64_lt(f64_mul(f64_from_f32(met.distance_to), f64_from_f32(TOUCHING)), limit)) {
            float chance = light_chance(lights, 1u + lights.sun_count + i);
            light += met.radiance * (of_camera ? 1.0 : scattered_weight(lights, pdf, met.pdf * chance));
        }
    }
    return light;
}

// What a camera ray sees where it meets nothing; `down` is 0 at the top of the picture and 1 at the bottom.
vec3 lights_behind(Lights lights, Environment sky, DVec3 direction, float down) {
    if (lights.has_backdrop != 0u) {
        return mix(vec3_of(lights.backdrop[1]), vec3_of(lights.backdrop[0]), clamp(down, 0.0, 1.0));
    }
    if (sky.width == 0u) {
        return vec3_of(lights.sky);
    }
    return environment_eval(sky, dvec3_to_vec3(dvec3_normalize(direction)));
}

#endif

// The lights of a scene: twin of transport/src/lights.rs.
#ifndef LIGHTS_GLSL
#define LIGHTS_GLSL

#include "environment.glsl"
#include "lamp.glsl"
#include "emitters.glsl"
#include "needs.glsl"

const uint STRATEGY_MIS = 0u;
const uint STRATEGY_LIGHTS_ONLY = 1u;
const uint STRATEGY_BSDF_ONLY = 2u;

// `pdf` 0: a single direction. `found` false: no sample. `instance`: the instance of an emissive surface, NONE for other lights.
struct LightSample {
    bool found;
    DVec3 direction;
    vec3 radiance_over_pdf;
    float pdf;
    f64 distance_to;
    uint instance;
};

// Power heuristic, Veach 1997, eq. 9.13 with β = 2. Ratios first: squares of peaked densities overflow.
float power_heuristic(float a, float b) {
    if (a <= 0.0) {
        return 0.0;
    }
    float r = b / a;
    return 1.0 / (1.0 + r * r);
}

// Whether any light is sampled.
bool samples_lights(Lights lights) {
    return (lights.light_count != 0u || lights.emitters_probability > 0.0) && lights.strategy != STRATEGY_BSDF_ONLY;
}

float light_probability(Lights lights, uint light) {
    if (light >= lights.light_count) {
        return 0.0;
    }
    Floats cdf = Floats(lights.cdf);
    return (cdf.at[light] - (light == 0u ? 0.0 : cdf.at[light - 1u])) * (1.0 - lights.emitters_probability);
}

// Samples a light that is no surface, and a direction towards it.
LightSample sample_infinite_or_lamp(Lights lights, Environment sky, Receiver from, float choice, vec2 u) {
    LightSample result;
    result.found = false;
    result.distance_to = F64_INFINITY;
    result.instance = NONE;
    Floats cdf = Floats(lights.cdf);
    uint light = 0u;
    while (light < lights.light_count && cdf.at[light] <= choice) {
        light += 1u;
    }
    float probability = light_probability(lights, light);
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
    result.pdf = s.pdf * probability;
    float over = s.pdf > 0.0 ? result.pdf : probability;
    result.found = over > 0.0;
    result.direction = s.direction;
    result.radiance_over_pdf = s.radiance / over;
    return result;
}

// Samples a light and a direction towards it; the numbers `further` are for emissive surfaces.
LightSample sample_light(SceneRef scene, Lights lights, Environment sky, Receiver from, float choice, vec2 u, vec2 further) {
    if (NEEDS_EMITTERS != 0u && choice < lights.emitters_probability) {
        EmitterSample s = emitters_sample(scene, from, choice / lights.emitters_probability, further, u);
        LightSample result;
        result.found = s.found;
        result.direction = s.direction;
        result.pdf = s.pdf * lights.emitters_probability;
        result.radiance_over_pdf = s.radiance / result.pdf;
        result.distance_to = s.distance_to;
        result.instance = s.instance;
        return result;
    }
    if (NEEDS_EMITTERS != 0u && lights.emitters_probability > 0.0) {
        choice = (choice - lights.emitters_probability) / (1.0 - lights.emitters_probability);
    }
    return sample_infinite_or_lamp(lights, sky, from, choice, u);
}

// MIS weight of a light sample, where scattering would have found the direction with density `other`.
float light_mis_weight(Lights lights, float pdf, float other) {
    return pdf > 0.0 && lights.strategy == STRATEGY_MIS ? power_heuristic(pdf, other) : 1.0;
}

float bsdf_mis_weight(Lights lights, float pdf, float light) {
    if (lights.strategy == STRATEGY_MIS) {
        return power_heuristic(pdf, light);
    }
    return lights.strategy == STRATEGY_LIGHTS_ONLY && light > 0.0 ? 0.0 : 1.0;
}

// MIS weight of the emission of a surface that a ray met, which was scattered at `from` with density pdf and has gone `far`.
float emission_weight(SceneRef scene, Lights lights, Receiver from, Hit hit, f64 far, float pdf) {
    if (is_seen_from_within(hit) || f64_eq(hit.t, F64_ZERO)) {
        return 1.0;
    }
    float aimed = emitters_pdf(scene, from, hit.surface, far) * lights.emitters_probability;
    return bsdf_mis_weight(lights, pdf, aimed);
}

// Light at infinity that a scattered ray (unit direction, drawn with density pdf) finds.
vec3 infinite_emission(Lights lights, Environment sky, DVec3 direction, float pdf) {
    vec3 light;
    if (sky.width == 0u) {
        light = vec3_of(lights.sky);
    } else {
        vec3 d = dvec3_to_vec3(direction);
        float sky_pdf = environment_pdf(sky, d) * light_probability(lights, 0u);
        light = environment_eval(sky, d) * bsdf_mis_weight(lights, pdf, sky_pdf);
    }
    for (uint i = 0u; i < lights.sun_count; i++) {
        Sun sun = Suns(lights.suns).at[i];
        if (sun.cone_pdf > 0.0 && sun_eval(sun, direction)) {
            float sun_pdf = sun.cone_pdf * light_probability(lights, i + 1u);
            light += vec3_of(sun.radiance) * bsdf_mis_weight(lights, pdf, sun_pdf);
        }
    }
    return light;
}

// Light of all lamps that a ray (unit direction) passes through before it has gone `limit`: a ray that was scattered at `from` with density
// `pdf`, or a camera ray, which has no density.
vec3 lamp_emission(Lights lights, Receiver from, DVec3 direction, f64 limit, float pdf, bool of_camera) {
    vec3 d = dvec3_to_vec3(direction);
    vec3 light = vec3(0.0);
    for (uint i = 0u; i < lights.lamp_count; i++) {
        Lamp lamp = Lamps(lights.lamps).at[i];
        if (of_camera && lamp.visible_to_camera == 0u) {
            continue;
        }
        LampSample met = lamp_meet(lamp, from, d);
        if (met.found && f64_lt(f64_mul(f64_from_f32(met.distance_to), f64_from_f32(TOUCHING)), limit)) {
            float probability = light_probability(lights, 1u + lights.sun_count + i);
            light += met.radiance * (of_camera ? 1.0 : bsdf_mis_weight(lights, pdf, met.pdf * probability));
        }
    }
    return light;
}

// What a camera ray sees where it meets nothing; `down` is 0 at the top of the picture and 1 at the bottom.
vec3 lights_background(Lights lights, Environment sky, DVec3 direction, float down) {
    if (lights.has_backdrop != 0u) {
        return mix(vec3_of(lights.backdrop[1]), vec3_of(lights.backdrop[0]), clamp(down, 0.0, 1.0));
    }
    if (sky.width == 0u) {
        return vec3_of(lights.sky);
    }
    return environment_eval(sky, dvec3_to_vec3(dvec3_normalize(direction)));
}

#endif

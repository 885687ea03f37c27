// The lights of a scene: twin of transport/src/lights.rs.
#ifndef LIGHTS_GLSL
#define LIGHTS_GLSL

#include "environment.glsl"
#include "sky_irradiance.glsl"
#include "lamp.glsl"
#include "lamp_tree.glsl"
#include "emitters.glsl"
#include "needs.glsl"

const float EVENLY = 0.1;
const float MOST_IRRADIANCE = 1e30;

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
    return lights.is_sampled != 0u && lights.strategy != STRATEGY_BSDF_ONLY;
}

// Whether a tree chooses among the lamps, which are then one light.
bool has_lamp_tree(Lights lights) {
    return NEEDS_LAMP_TREE != 0u && lights.lamp_tree.count > 0u;
}

// Number of lights that the lamps are.
uint lamp_lights(Lights lights) {
    return has_lamp_tree(lights) ? 1u : lights.lamp_count;
}

// The sky is light 0, then come suns, lamps, and all emissive surfaces together.
uint light_count(Lights lights) {
    return lights.sun_count + lamp_lights(lights) + 2u;
}

// About the irradiance that a light can give to a receiver; 0 only where it gives none.
float light_weight(SceneRef scene, Lights lights, uint light, Receiver from) {
    float weight;
    if (light == 0u) {
        weight = sky_irradiance_at(lights, from);
    } else if (light <= lights.sun_count) {
        weight = sun_irradiance_at(Suns(lights.suns).at[light - 1u], from);
    } else if (has_lamp_tree(lights) && light == lights.sun_count + 1u) {
        weight = lamp_tree_irradiance_at(lights.lamp_tree, lights.lamp_tree_irradiance, from);
    } else if (light <= lights.sun_count + lamp_lights(lights)) {
        weight = lamp_irradiance_at(Lamps(lights.lamps).at[light - 1u - lights.sun_count], from);
    } else {
        weight = NEEDS_EMITTERS == 0u || lights.emitters_irradiance == 0.0
            ? 0.0
            : emitters_irradiance_at(scene.it.emitters, lights.emitters_irradiance, from);
    }
    return min(weight, MOST_IRRADIANCE);
}

// What the probabilities of lights at a receiver are relative to: the sum of the weights, and the number of those above 0.
struct LightOdds {
    float total;
    float lit;
};

LightOdds light_odds(SceneRef scene, Lights lights, Receiver from) {
    LightOdds odds = LightOdds(0.0, 0.0);
    for (uint light = 0u; light < light_count(lights); light++) {
        float weight = light_weight(scene, lights, light, from);
        odds.total += weight;
        odds.lit += weight > 0.0 ? 1.0 : 0.0;
    }
    return odds;
}

// Probability of sampling a light at a receiver with these odds.
float light_probability(SceneRef scene, Lights lights, uint light, Receiver from, LightOdds odds) {
    float weight = light_weight(scene, lights, light, from);
    return weight > 0.0 ? EVENLY / odds.lit + (1.0 - EVENLY) * (weight / odds.total) : 0.0;
}

// Chooses a light. `within`: the part of its probability at which it was chosen.
uint choose_light(SceneRef scene, Lights lights, Receiver from, LightOdds odds, float choice, out float chance, out float within) {
    uint chosen = NONE;
    chance = 0.0;
    for (uint light = 0u; light < light_count(lights); light++) {
        float probability = light_probability(scene, lights, light, from, odds);
        if (probability > 0.0) {
            choice -= chance;
            chosen = light;
            chance = probability;
            if (choice < probability) {
                break;
            }
        }
    }
    within = clamp(choice / chance, 0.0, BELOW_ONE);
    return chosen;
}

// Whether a chosen light is many, of which sample_light chooses one by further numbers.
bool needs_further(Lights lights, uint light) {
    bool is_emitters = NEEDS_EMITTERS != 0u && light + 1u == light_count(lights);
    return is_emitters || (has_lamp_tree(lights) && light == lights.sun_count + 1u);
}

// Samples a direction towards a light that was chosen with this probability (see choose_light); the numbers `further` are for lights that
// are many (see needs_further).
LightSample sample_light(
    SceneRef scene, Lights lights, Environment sky, Receiver from, uint light, float chance, float within, vec2 u, vec2 further) {
    LightSample result;
    result.found = false;
    result.distance_to = F64_INFINITY;
    result.instance = NONE;
    SunSample s;
    if (light == NONE) {
        return result;
    }
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
    } else if (NEEDS_LAMPS != 0u && light <= lights.sun_count + lamp_lights(lights)) {
        uint number = light - 1u - lights.sun_count;
        if (has_lamp_tree(lights)) {
            float part;
            number = tree_choose(lights.lamp_tree, seen_from(lights.lamp_tree, from), vec2(within, further.x), part);
            if (part <= 0.0) {
                return result;
            }
            chance *= part;
        }
        LampSample l = lamp_sample(Lamps(lights.lamps).at[number], from, u);
        if (!l.found) {
            return result;
        }
        result.distance_to = f64_mul(f64_from_f32(l.distance_to), f64_from_f32(TOUCHING));
        s = SunSample(dvec3_of(f64_from_f32(l.direction.x), f64_from_f32(l.direction.y), f64_from_f32(l.direction.z)),
            l.radiance, l.pdf);
    } else if (NEEDS_EMITTERS != 0u) {
        EmitterSample e = emitters_sample(scene, from, within, further, u);
        if (!e.found) {
            return result;
        }
        result.distance_to = e.distance_to;
        result.instance = e.instance;
        s = SunSample(e.direction, e.radiance, e.pdf);
    } else {
        return result;
    }
    result.pdf = s.pdf * chance;
    float over = s.pdf > 0.0 ? result.pdf : chance;
    result.found = over > 0.0;
    result.direction = s.direction;
    result.radiance_over_pdf = s.radiance / over;
    return result;
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
float emission_weight(SceneRef scene, Lights lights, Receiver from, LightOdds odds, Hit hit, f64 far, float pdf) {
    if (is_seen_from_within(hit) || f64_eq(hit.t, F64_ZERO)) {
        return 1.0;
    }
    float aimed = emitters_pdf(scene, from, hit.surface, far) *
        light_probability(scene, lights, light_count(lights) - 1u, from, odds);
    return bsdf_mis_weight(lights, pdf, aimed);
}

// Light at infinity that a ray (unit direction) finds which was scattered at `from` with density pdf.
vec3 infinite_emission(SceneRef scene, Lights lights, Environment sky, Receiver from, LightOdds odds, DVec3 direction, float pdf) {
    vec3 light;
    if (sky.width == 0u) {
        light = vec3_of(lights.sky);
    } else {
        vec3 d = dvec3_to_vec3(direction);
        float sky_pdf = environment_pdf(sky, d) * light_probability(scene, lights, 0u, from, odds);
        light = environment_eval(sky, d) * bsdf_mis_weight(lights, pdf, sky_pdf);
    }
    for (uint i = 0u; i < lights.sun_count; i++) {
        Sun sun = Suns(lights.suns).at[i];
        if (sun.cone_pdf > 0.0 && sun_eval(sun, direction)) {
            float sun_pdf = sun.cone_pdf * light_probability(scene, lights, i + 1u, from, odds);
            light += vec3_of(sun.radiance) * bsdf_mis_weight(lights, pdf, sun_pdf);
        }
    }
    return light;
}

// Light of a lamp that a ray in a direction passes through before it has gone `limit`, as lamp_emission.
vec3 lamp_emission_of(
    SceneRef scene, Lights lights, uint number, Receiver from, LightOdds odds, vec3 d, f64 limit, float pdf, bool of_camera) {
    Lamp lamp = Lamps(lights.lamps).at[number];
    if (of_camera && lamp.visible_to_camera == 0u) {
        return vec3(0.0);
    }
    LampSample met = lamp_meet(lamp, from, d);
    if (!met.found || !f64_lt(f64_mul(f64_from_f32(met.distance_to), f64_from_f32(TOUCHING)), limit)) {
        return vec3(0.0);
    }
    if (of_camera) {
        return met.radiance;
    }
    float probability;
    if (has_lamp_tree(lights)) {
        probability = light_probability(scene, lights, 1u + lights.sun_count, from, odds) *
            tree_probability(lights.lamp_tree, seen_from(lights.lamp_tree, from), number);
    } else {
        probability = light_probability(scene, lights, 1u + lights.sun_count + number, from, odds);
    }
    return met.radiance * bsdf_mis_weight(lights, pdf, met.pdf * probability);
}

// Light of all lamps that a ray (unit direction) passes through before it has gone `limit`: a ray that was scattered at `from` with density
// `pdf`, or a camera ray, which has no density.
vec3 lamp_emission(SceneRef scene, Lights lights, Receiver from, LightOdds odds, DVec3 direction, f64 limit, float pdf, bool of_camera) {
    vec3 d = dvec3_to_vec3(direction);
    vec3 light = vec3(0.0);
    if (has_lamp_tree(lights)) {
        LampSearch search = begin_lamp_search(lights.lamp_tree, from.point);
        uint lamp;
        while ((lamp = next_lamp(lights.lamp_tree, search, d)) != NONE) {
            light += lamp_emission_of(scene, lights, lamp, from, odds, d, limit, pdf, of_camera);
        }
        return light;
    }
    for (uint i = 0u; i < lights.lamp_count; i++) {
        light += lamp_emission_of(scene, lights, i, from, odds, d, limit, pdf, of_camera);
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

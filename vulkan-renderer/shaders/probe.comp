// Runs one function on rows of words, for the tests that compare it with its twin. Function numbers are those in tests/twins.
#version 460
#extension GL_GOOGLE_include_directive : require

#define FRONT_BVH

#include "launch.glsl"
#include "path.glsl"
#include "probe_words.glsl"

layout(constant_id = 0) const uint FUNCTION = 0u;

layout(local_size_x = 64) in;

void probe_f64(uint row) {
    begin(row, 5u, 23u);
    f64 a = take_f64(), b = take_f64();
    uint c = take();
    put_f64(f64_add(a, b));
    put_f64(f64_sub(a, b));
    put_f64(f64_mul(a, b));
    put_f64(f64_div(a, b));
    put_f64(f64_sqrt(a));
    put_f64(f64_floor(a));
    put_f64(f64_from_u32(c));
    put_f64(f64_from_f32(uintBitsToFloat(c)));
    put_f64(f64_max(a, b));
    put_float(f64_to_f32(a));
    put(f64_to_u32(a));
    put(f64_lt(a, b) ? 1u : 0u);
    put(f64_le(a, b) ? 1u : 0u);
    put(f64_eq(a, b) ? 1u : 0u);
}

void probe_sampler(uint row) {
    begin(row, 7u, 7u);
    uint64_t seed = take64();
    uint x = take(), y = take();
    PixelSampler points = sampler_new(seed, uvec2(x, y), take());
    uint bounce = take();
    vec3 u = sampler_bounce(points, bounce, take());
    vec2 film = sampler_film(points);
    put_vec3(u);
    put_float(film.x);
    put_float(film.y);
    vec2 lens = sampler_lens(points);
    put_float(lens.x);
    put_float(lens.y);
}

void probe_filter(uint row) {
    begin(row, 1u, 1u);
    put_float(filter_sample(SceneRef(launch.scene).it.film_filter, take_float()));
}

void probe_trigonometry(uint row) {
    begin(row, 3u, 3u);
    vec2 sc = sin_cos(take_float());
    float y = take_float();
    put_float(sc.x);
    put_float(sc.y);
    put_float(atan2_of(y, take_float()));
}

void probe_camera(uint row) {
    begin(row, 6u, 28u);
    f64 x = take_f64(), y = take_f64(), t_max;
    RayInWorld ray = camera_ray(SceneRef(launch.scene).it.camera, x, y, t_max);
    put_dvec3(ray.origin);
    put_dvec3(ray.direction);
    put_f64(t_max);
    ray = camera_lens_ray(SceneRef(launch.scene).it.camera, x, y, take_vec2(), t_max);
    put_dvec3(ray.origin);
    put_dvec3(ray.direction);
    put_f64(t_max);
}

void probe_frame(uint row) {
    begin(row, 6u, 12u);
    DVec3 tangent, bitangent;
    frame_around(take_dvec3(), tangent, bitangent);
    put_dvec3(tangent);
    put_dvec3(bitangent);
}

void probe_sun(uint row) {
    begin(row, 8u, 11u);
    Sun sun = Suns(SceneRef(launch.scene).it.lights.suns).at[0];
    SunSample s = sun_sample(sun, take_vec2());
    put_dvec3(s.direction);
    put_vec3(s.radiance);
    put_float(s.pdf);
    put(sun_eval(sun, take_dvec3()) ? 1u : 0u);
}

void probe_environment(uint row) {
    begin(row, 8u, 14u);
    Environment table = SceneRef(launch.scene).it.environment;
    SunSample s = environment_sample(table, take_vec2());
    put_dvec3(s.direction);
    put_vec3(s.radiance);
    put_float(s.pdf);
    vec3 direction = dvec3_to_vec3(take_dvec3());
    put_vec3(environment_eval(table, direction));
    put_float(environment_pdf(table, direction));
}

Receiver take_receiver() {
    DVec3 point = take_dvec3();
    vec3 normal = take_vec3();
    return Receiver(point, normal, take() != 0u);
}

void put_lamp_sample(LampSample s) {
    put(s.found ? 1u : 0u);
    put_vec3(s.direction);
    put_float(s.distance_to);
    put_vec3(s.radiance);
    put_float(s.pdf);
}

void probe_lamp(uint row) {
    begin(row, 16u, 18u);
    Lamp lamp = Lamps(SceneRef(launch.scene).it.lights.lamps).at[take()];
    Receiver from = take_receiver();
    vec2 u = take_vec2();
    put_lamp_sample(lamp_sample(lamp, from, u));
    put_lamp_sample(lamp_meet(lamp, from, take_vec3()));
}

void probe_emitters(uint row) {
    begin(row, 28u, 19u);
    SceneRef scene = SceneRef(launch.scene);
    Emitters emitters = scene.it.emitters;
    Receiver from = take_receiver();
    float choice = take_float();
    vec2 further = take_vec2(), u = take_vec2();
    Surface surface = no_surface();
    surface.instance = take();
    surface.kind = take();
    surface.voxel.x = take();
    surface.voxel.y = take();
    surface.voxel.z = take();
    surface.axis = take();
    surface.positive = take() != 0u;
    surface.plane = take();
    surface.label = take();
    surface.box_number = take();
    f64 far = take_f64();
    uint emitter = take();
    float probability;
    put(tree_choose(emitters.tree, seen_from(emitters.tree, from), vec2(choice, further.x), probability));
    put_float(probability);
    put_float(tree_probability(emitters.tree, seen_from(emitters.tree, from), emitter));
    EmitterSample s = emitters_sample(scene, from, choice, further, u);
    put(s.found ? 1u : 0u);
    put_dvec3(s.direction);
    put_f64(s.distance_to);
    put_vec3(s.radiance);
    put_float(s.pdf);
    put_float(emitters_pdf(scene, from, surface, far));
    Hit hit = no_hit();
    hit.surface = surface;
    hit.t = F64_ONE;
    LightOdds odds = light_odds(scene, scene.it.lights, from);
    put_float(emission_weight(scene, scene.it.lights, from, odds, hit, far, choice));
    float chance, within;
    uint chosen = choose_light(scene, scene.it.lights, from, odds, choice, chance, within);
    LightSample light =
        sample_light(scene, scene.it.lights, scene.it.environment, from, chosen, chance, within, u, further);
    put_float(light.found ? light.pdf : 0.0);
}

void probe_lights(uint row) {
    begin(row, 23u, 22u);
    SceneRef scene = SceneRef(launch.scene);
    Lights lights = scene.it.lights;
    Environment sky = scene.it.environment;
    float choice = take_float();
    vec2 u = take_vec2();
    DVec3 direction = take_dvec3();
    float pdf = take_float(), down = take_float();
    Receiver from = take_receiver();
    f64 limit = take_f64();
    LightOdds odds = light_odds(scene, lights, from);
    float chance, within;
    uint chosen = choose_light(scene, lights, from, odds, choice, chance, within);
    LightSample s = sample_light(scene, lights, sky, from, chosen, chance, within, u, vec2(0.0));
    put(s.found ? 1u : 0u);
    put_dvec3(s.direction);
    put_vec3(s.radiance_over_pdf);
    put_float(s.pdf);
    put_f64(s.distance_to);
    put_vec3(lamp_emission(scene, lights, from, odds, direction, limit, pdf, false));
    put_vec3(infinite_emission(scene, lights, sky, from, odds, direction, pdf));
    put_vec3(lights_background(lights, sky, direction, down));
}

void probe_bsdf(uint row) {
    begin(row, 36u, 29u);
    Material m;
    vec3 base = take_vec3(), tint = take_vec3(), coat_tint = take_vec3(), emission = take_vec3();
    vec3 sheen_tint = take_vec3();
    m.base_color = float[3](base.x, base.y, base.z);
    m.specular_tint = float[3](tint.x, tint.y, tint.z);
    m.coat_tint = float[3](coat_tint.x, coat_tint.y, coat_tint.z);
    m.emission = float[3](emission.x, emission.y, emission.z);
    m.sheen_tint = float[3](sheen_tint.x, sheen_tint.y, sheen_tint.z);
    m.metallic = take_float();
    m.roughness = take_float();
    m.specular = take_float();
    m.ior = take_float();
    m.transmission = take_float();
    m.coat = take_float();
    m.coat_roughness = take_float();
    m.coat_ior = take_float();
    m.sheen = take_float();
    m.sheen_roughness = take_float();
    m.alpha = 1.0;
    m.multiscatter = take();
    bool from_inside = take() != 0u;
    vec3 wi = take_vec3(), wo = take_vec3();
    vec2 u = take_vec2();
    float choice = take_float();
    Address tables = SceneRef(launch.scene).it.tables;
    Bsdf b = bsdf_new(tables, m, wi, from_inside);
    float pdf;
    vec3 f = bsdf_eval(b, wo, pdf);
    put_vec3(f);
    put_float(pdf);
    BsdfSample s = bsdf_sample(b, u, choice);
    put_vec3(s.wo);
    put_vec3(s.weight);
    put_float(s.pdf);
    put_vec3(sample_cosine(u));
    put_vec3(emitted(tables, m, wi.z));
    put_vec3(diffuse_share(b, wo, f));
    vec3 colors[3];
    bsdf_colors(b, tables, m, colors);
    for (uint i = 0u; i < 3u; i++) {
        put_vec3(colors[i]);
    }
}

void probe_box(uint row) {
    begin(row, 2u, 10u);
    InstanceRef instance = instance_at(SceneRef(launch.scene), 0u);
    uint number = take();
    BoxView b = get_box(instance, number);
    for (uint a = 0u; a < 3u; a++) {
        put(b.origin[a]);
    }
    for (uint a = 0u; a < 3u; a++) {
        put(b.extent[a]);
    }
    put(b.level);
    put(label_of_box(instance, number));
    put64(node_field(b.node, take()));
}

void probe_holder(uint row) {
    begin(row, 4u, 1u);
    InstanceRef instance = instance_at(SceneRef(launch.scene), 0u);
    uint label = take(), x = take(), y = take();
    put(item_with(instance, label, uvec3(x, y, take())));
}

void probe_index_ray(uint row) {
    begin(row, 23u, 21u);
    InstanceRef instance = instance_at(SceneRef(launch.scene), 0u);
    DVec3 origin = take_dvec3();
    RayInWorld ray = RayInWorld(origin, take_dvec3());
    SurfaceRecord r;
    r.instance = take();
    for (uint a = 0u; a < 3u; a++) {
        r.voxel[a] = take();
    }
    r.face = take();
    r.plane = take();
    r.label = take();
    r.box_number = NONE;
    uvec3 upper;
    for (uint a = 0u; a < 3u; a++) {
        upper[a] = take();
    }
    IndexRay result;
    bool usable = index_ray_new(placement_of(instance), ray, surface_from_record(r), upper, F64_ZERO, false, result);
    put(usable ? 1u : 0u);
    for (uint a = 0u; a < 3u; a++) {
        put_f64(result.origin[a]);
        put_f64(result.direction[a]);
        put_f64(result.inverse[a]);
    }
    put_f64(result.scaled_from_world);
}

void main() {
    uint row = gl_GlobalInvocationID.x;
    if (row >= launch.count) {
        return;
    }
    // (Not a switch: of conditional branches a known one is removed before a driver sees the other functions.)
    if (FUNCTION == 0u) {
        probe_f64(row);
    } else if (FUNCTION == 1u) {
        probe_sampler(row);
    } else if (FUNCTION == 2u) {
        probe_filter(row);
    } else if (FUNCTION == 3u) {
        probe_trigonometry(row);
    } else if (FUNCTION == 4u) {
        probe_camera(row);
    } else if (FUNCTION == 5u) {
        probe_frame(row);
    } else if (FUNCTION == 6u) {
        probe_sun(row);
    } else if (FUNCTION == 7u) {
        probe_environment(row);
    } else if (FUNCTION == 8u) {
        probe_lights(row);
    } else if (FUNCTION == 9u) {
        probe_bsdf(row);
    } else if (FUNCTION == 10u) {
        probe_box(row);
    } else if (FUNCTION == 11u) {
        probe_holder(row);
    } else if (FUNCTION == 12u) {
        probe_index_ray(row);
    } else if (FUNCTION == 20u) {
        probe_lamp(row);
    } else if (FUNCTION == 21u) {
        probe_emitters(row);
    }
}

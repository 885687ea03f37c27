// One path, from the camera to its end: twin of cpu-renderer/src/path.rs, with the sample loop of path_tracer.rs around it, and with the
// work of crossing.rs on the way to a light.
//
// The twin traces rays in three places. Here there is one place, in a loop with a state that says what the ray is for: shaders inline what
// they call, and threads of a group that trace at different places would wait for each other.
#ifndef PATH_GLSL
#define PATH_GLSL

#include "needs.glsl"
#include "scene_tracer.glsl"
#include "crossing.glsl"
#include "sampler.glsl"
#include "filter.glsl"
#include "film.glsl"
#include "camera_rays.glsl"
#include "material_table.glsl"
#include "bsdf.glsl"
#include "lights.glsl"
#include "film_sample.glsl"

const uint FIRST_ROULETTE = 2u;
const float ROULETTE_THROUGHPUT = 0.25;
const float LEAST_SURVIVAL = 0.05;

const uint MODE_PATH = 0u;
const uint MODE_ONE_BOUNCE = 1u;
const uint MODE_AMBIENT_OCCLUSION = 2u;

// Orthonormal frame on a face: z is its normal.
struct Frame {
    DVec3 tangent;
    DVec3 bitangent;
    DVec3 normal;
};

Frame frame_new(DVec3 normal) {
    Frame frame;
    frame.normal = normal;
    frame_around(normal, frame.tangent, frame.bitangent);
    return frame;
}

vec3 frame_local(Frame frame, DVec3 w) {
    return vec3(f64_to_f32(dvec3_dot(w, frame.tangent)), f64_to_f32(dvec3_dot(w, frame.bitangent)),
        f64_to_f32(dvec3_dot(w, frame.normal)));
}

DVec3 frame_world(Frame frame, vec3 w) {
    return dvec3_add(
        dvec3_add(dvec3_scale(frame.tangent, f64_from_f32(w.x)), dvec3_scale(frame.bitangent, f64_from_f32(w.y))),
        dvec3_scale(frame.normal, f64_from_f32(w.z)));
}

// The purpose of the ray in flight.
const uint FLIGHT_CAMERA = 0u;
const uint FLIGHT_SHADOW = 1u;
const uint FLIGHT_SCATTERED = 2u;
const uint FLIGHT_AMBIENT = 3u;

// Light along a camera ray that sees up to t_max, added to a film sample; `down` is the position in the picture, 0 at the top to 1 at the
// bottom.
void follow(SceneRef scene, PixelSampler points, RayInWorld ray, f64 t_max, float down, inout FilmSample film_sample) {
    Lights lights = scene.it.lights;
    Environment sky = scene.it.environment;
    if (NEEDS_PICTURE == 0u) {
        sky.width = 0u;
    }
    uint mode = scene.it.settings.mode;
    uint bounces = mode == MODE_PATH ? scene.it.settings.bounces : 0u;
    bool sample_lights = NEEDS_LIGHT_SAMPLING != 0u && samples_lights(lights);
    vec3 throughput = vec3(1.0);
    // Number of surfaces that scattered, and of surfaces that were passed straight through.
    uint vertex = 0u, passed = 0u;
    uint flight = FLIGHT_CAMERA;
    // The surface that the ray in flight starts from.
    Hit left = no_hit();
    // Of the light ray in flight: what it adds, and how many surfaces it has passed; and where the path continues after it.
    vec3 add = vec3(0.0);
    uint light_passed = 0u;
    bool goes_on = false;
    Hit at = left;
    DVec3 onward_origin = ray.origin;
    DVec3 onward = ray.direction;
    float onward_pdf = 0.0;
    // Where the straight part of the path began, and how far it has come through transparent surfaces, in world units.
    Receiver receiver = Receiver(ray.origin, vec3(0.0, 0.0, 1.0), true);
    LightOdds odds = LightOdds(0.0, 0.0);
    f64 gone = F64_ZERO;
    while (true) {
        bool any = (flight == FLIGHT_SHADOW && NEEDS_TRANSPARENT == 0u) || flight == FLIGHT_AMBIENT;
        bool among_catchers = NEEDS_CATCHER != 0u && film_sample.sink == SINK_ALONE;
        Hit hit = next_hit(scene, ray, left, t_max, any, among_catchers);
        if (lacks_a_page()) {
            return;
        }
        if (flight == FLIGHT_AMBIENT) {
            film_sample_add_direct_light(film_sample, is_hit(hit) ? vec3(0.0) : vec3(1.0), 0u);
            return;
        }
        if (flight == FLIGHT_SHADOW) {
            // A transparent surface lets some of the light through.
            if (NEEDS_TRANSPARENT != 0u && is_hit(hit) && light_passed < MAX_TRANSPARENT_SURFACES) {
                float alpha = material_of(instance_at(scene, hit.surface.instance), hit.surface.label).alpha;
                if (alpha < 1.0) {
                    add *= 1.0 - alpha;
                    light_passed += 1u;
                    ray.origin = dvec3_add(ray.origin, dvec3_scale(ray.direction, hit.t));
                    t_max = f64_sub(t_max, hit.t);
                    left = hit;
                    continue;
                }
            }
            // The light is visible or not; the path continues from its last surface.
            if (!is_hit(hit)) {
                film_sample_add_direct_light(film_sample, add, vertex);
            }
            if (!goes_on) {
                return;
            }
            ray.direction = onward;
            t_max = F64_INFINITY;
            if (NEEDS_TRANSPARENT != 0u) {
                ray.origin = onward_origin;
                left = at;
            }
            flight = FLIGHT_SCATTERED;
            vertex += 1u;
            continue;
        }
        if (NEEDS_LAMPS != 0u && mode != MODE_AMBIENT_OCCLUSION) {
            f64 limit = is_hit(hit) ? hit.t : t_max;
            DVec3 d = dvec3_normalize(ray.direction);
            limit = f64_add(gone, f64_mul(limit, dvec3_length(ray.direction)));
            vec3 light = lamp_emission(scene, lights, receiver, odds, d, limit, onward_pdf, flight == FLIGHT_CAMERA);
            if (NEEDS_TRANSPARENT != 0u && f64_lt(F64_ZERO, gone)) {
                light -= lamp_emission(scene, lights, receiver, odds, d, gone, onward_pdf, flight == FLIGHT_CAMERA);
            }
            film_sample_add_emission(film_sample, throughput * light, vertex);
        }
        if (!is_hit(hit)) {
            if (flight == FLIGHT_CAMERA) {
                film_sample_add_background(film_sample, lights_background(lights, sky, ray.direction, down), 0u);
            } else {
                vec3 light = infinite_emission(scene, lights, sky, receiver, odds, dvec3_normalize(ray.direction), onward_pdf);
                film_sample_add_background(film_sample, throughput * light, vertex);
            }
            return;
        }
        ray.origin = dvec3_add(ray.origin, dvec3_scale(ray.direction, hit.t));
        // Whether a path outside of all labels of an instance started within the coarse element of another label there. (A mesh or another
        // instance may well be inside a label.)
        bool buried = is_seen_from_within(hit) && flight == FLIGHT_SCATTERED && goes_outward(ray.direction, left) &&
            left.surface.instance == hit.surface.instance && !may_touch(ray.direction, left);
        left = hit;

        // The camera ray's first shadow catcher: the twin continues twice from here. Here the whole sample is traced twice. The second time
        // it gets here with the same random numbers and continues among catchers alone, so no state need be stored in between.
        if (vertex == 0u && film_sample_catches(film_sample) && material_table_catches(instance_at(scene, hit.surface.instance))) {
            if (film_sample.sink == SINK_NOTHING) {
                film_sample_among_catchers(film_sample);
            } else {
                film_sample_caught(film_sample, lights_background(lights, sky, ray.direction, down));
            }
        }

        Material material = material_of(instance_at(scene, hit.surface.instance), hit.surface.label);
        uint number = vertex + passed;

        // Straight through, with probability 1 − alpha.
        if (NEEDS_TRANSPARENT != 0u && mode != MODE_AMBIENT_OCCLUSION && material.alpha < 1.0 &&
            sampler_bounce(points, number, SET_SURVIVAL).y >= material.alpha) {
            passed += 1u;
            if (passed > MAX_TRANSPARENT_SURFACES) {
                return;
            }
            t_max = f64_sub(t_max, hit.t);
            gone = f64_add(gone, f64_mul(hit.t, dvec3_length(ray.direction)));
            continue;
        }

        // The normal on the visible side. (Ambient occlusion ends at a surface that is seen from inside a label, and shows its outward normal.)
        DVec3 normal = hit.from_inside ? dvec3_neg(hit.normal_in_world) : hit.normal_in_world;
        if (mode == MODE_AMBIENT_OCCLUSION) {
            normal = normal_towards_ray(hit);
        }
        DVec3 shading = normal;
        bool is_smooth = shading_normal(scene, hit, ray.origin, shading);
        Frame frame = frame_new(shading);

        // 1 where a cosine-distributed ray meets nothing within reach, else 0.
        if (mode == MODE_AMBIENT_OCCLUSION) {
            if (NEEDS_MATTES != 0u) {
                film_sample_write_ids(film_sample, 0u, material_table_ids_of(instance_at(scene, hit.surface.instance), hit.surface.label));
            }
            film_sample_write_aovs(film_sample, 0u, vec3[3](vec3(1.0), vec3(0.0), vec3(0.0)), dvec3_to_vec3(frame.normal));
            film_sample.direct_weights = PassWeights(vec3(1.0), false);
            ray.direction = frame_world(frame, sample_cosine(sampler_bounce(points, 0u, SET_SCATTER).xy));
            if (is_seen_from_within(hit) || f64_le(dvec3_dot(ray.direction, normal), F64_ZERO)) {
                return;
            }
            t_max = f64_from_bits(scene.it.settings.ao_distance);
            flight = FLIGHT_AMBIENT;
            continue;
        }

        vec3 wi = frame_local(frame, dvec3_neg(dvec3_normalize(ray.direction)));
        // Emission uses the geometric normal, as light sampling does.
        vec3 own = is_smooth ? frame_local(frame, normal) : vec3(0.0, 0.0, 1.0);
        float cosine = max(is_smooth ? dot(wi, own) : wi.z, LEAST_VIEW);
        vec3 emission = emitted(scene.it.tables, material, cosine);
        if (NEEDS_EMITTERS != 0u && flight == FLIGHT_SCATTERED && lights.emitters_irradiance > 0.0 && emission != vec3(0.0)) {
            f64 far = f64_add(gone, f64_mul(hit.t, dvec3_length(ray.direction)));
            emission *= emission_weight(scene, lights, receiver, odds, hit, far, onward_pdf);
        }
        film_sample_add_emission(film_sample, throughput * emission, vertex);
        t_max = F64_INFINITY;
        gone = F64_ZERO;
        if (vertex > bounces || buried) {
            return;
        }
        Bsdf bsdf;
        if (is_smooth) {
            bsdf = bsdf_with_specular_normal(scene.it.tables, material, wi, specular_normal_new(own, wi), hit.from_inside);
        } else {
            wi.z = cosine;
            bsdf = bsdf_new(scene.it.tables, material, wi, hit.from_inside);
        }
        if (NEEDS_MATTES != 0u && vertex == 0u) {
            film_sample_write_ids(film_sample, 0u, material_table_ids_of(instance_at(scene, hit.surface.instance), hit.surface.label));
        }
        if (NEEDS_SORTED != 0u && vertex == 0u) {
            vec3 colors[3];
            bsdf_colors(bsdf, scene.it.tables, material, colors);
            film_sample_write_aovs(film_sample, 0u, colors, dvec3_to_vec3(frame.normal));
        }
        receiver = Receiver(ray.origin, dvec3_to_vec3(frame.normal), bsdf_transmits(bsdf));

        // Sample a light.
        bool light_in_flight = false;
        DVec3 towards_light = ray.direction;
        f64 light_distance = F64_INFINITY;
        if (sample_lights) {
            vec3 towards = sampler_bounce(points, number, SET_LIGHT);
            odds = light_odds(scene, lights, receiver);
            float chance, within;
            uint chosen = choose_light(scene, lights, receiver, odds, towards.z, chance, within);
            vec2 further = vec2(0.0);
            if (needs_further(lights, chosen)) {
                further = sampler_bounce(points, number, SET_EMITTER).xy;
            }
            LightSample light = sample_light(scene, lights, sky, receiver, chosen, chance, within, towards.xy, further);
            if (NEEDS_CATCHER != 0u && film_sample.sink == SINK_ALONE && light.found && light.instance != NONE) {
                light.found = material_table_catches(instance_at(scene, light.instance));
            }
            if (light.found && (bsdf_transmits(bsdf) || f64_lt(F64_ZERO, dvec3_dot(light.direction, frame.normal)))) {
                float pdf;
                vec3 wo = frame_local(frame, light.direction);
                vec3 f_cos = bsdf_eval(bsdf, wo, pdf);
                if (NEEDS_SORTED != 0u && vertex == 0u) {
                    film_sample.direct_weights = PassWeights(diffuse_share(bsdf, wo, f_cos), wo.z < 0.0);
                }
                add = throughput * f_cos * light.radiance_over_pdf * light_mis_weight(lights, light.pdf, pdf);
                light_in_flight = max_element(add) > 0.0;
                towards_light = light.direction;
                light_distance = light.distance_to;
            }
        }

        // Scatter.
        vec3 scatter = sampler_bounce(points, number, SET_SCATTER);
        BsdfSample scattered = bsdf_sample(bsdf, scatter.xy, scatter.z);
        goes_on = scattered.pdf > 0.0;
        if (goes_on) {
            throughput *= scattered.weight;
            if (NEEDS_SORTED != 0u && vertex == 0u) {
                // The only direction of a mirror belongs to the mirror lobe alone.
                vec3 diffuse = vec3(0.0);
                if (!isinf(scattered.pdf)) {
                    diffuse = diffuse_share(bsdf, scattered.wo, scattered.weight * scattered.pdf);
                }
                film_sample_scatter(film_sample, 0u, PassWeights(diffuse, scattered.through));
            }
            onward = frame_world(frame, scattered.wo);
            onward_pdf = scattered.pdf;
            float most = max_element(throughput);
            // Valid only on the side of the geometric surface for which it was sampled.
            f64 above = dvec3_dot(onward, normal);
            goes_on = most > 0.0 && (scattered.through ? f64_lt(above, F64_ZERO) : f64_lt(F64_ZERO, above));

            // End by Russian roulette; the weight of surviving paths accounts for the ended ones.
            if (goes_on && scene.it.settings.russian_roulette != 0u && vertex >= FIRST_ROULETTE
                && most < ROULETTE_THROUGHPUT) {
                float survival = max(most * (1.0 / ROULETTE_THROUGHPUT), LEAST_SURVIVAL);
                goes_on = sampler_bounce(points, number, SET_SURVIVAL).x < survival;
                throughput /= survival;
            }
        }
        if (light_in_flight) {
            at = hit;
            onward_origin = ray.origin;
            light_passed = 0u;
            ray.direction = towards_light;
            t_max = light_distance;
            flight = FLIGHT_SHADOW;
        } else if (goes_on) {
            ray.direction = onward;
            flight = FLIGHT_SCATTERED;
            vertex += 1u;
        } else {
            return;
        }
    }
}

// One sample of one pixel.
FilmSample sample_of_pixel(SceneRef scene, uvec2 pixel, uint number) {
    PixelSampler points = sampler_new(scene.it.settings.seed, pixel, number);
    vec2 u = sampler_film(points);
    f64 px = f64_add(f64_add(f64_from_u32(pixel.x), F64_HALF), f64_from_f32(filter_sample(scene.it.film_filter, u.x)));
    f64 py = f64_add(f64_add(f64_from_u32(pixel.y), F64_HALF), f64_from_f32(filter_sample(scene.it.film_filter, u.y)));
    f64 t_max;
    RayInWorld ray;
    if (NEEDS_LENS != 0u && f64_lt(F64_ZERO, f64_from_bits(scene.it.camera.lens_radius))) {
        ray = camera_lens_ray(scene.it.camera, px, py, sampler_lens(points), t_max);
    } else {
        ray = camera_ray(scene.it.camera, px, py, t_max);
    }
    float down = f64_to_f32(f64_div(py, f64_from_bits(scene.it.camera.size[1])));
    FilmSample film_sample = film_sample_new(scene.it.settings);
    // A second time among catchers, where one was met.
    for (uint round = 0u; round < (NEEDS_CATCHER == 0u ? 1u : 2u); round++) {
        follow(scene, points, ray, t_max, down, film_sample);
        if (lacks_a_page() || film_sample.sink != SINK_CAUGHT) {
            break;
        }
        film_sample.sink = SINK_NOTHING;
    }
    return film_sample;
}

// Adds the launch's samples to one pixel of its tile. With pages, a pixel begins where the launch before it came to, and ends before the
// sample that lacks a page.
void add_samples(uvec2 in_tile) {
    if (in_tile.x >= launch.tile_width || in_tile.y >= launch.tile_height) {
        return;
    }
    SceneRef scene = SceneRef(launch.scene);
    uvec2 pixel = uvec2(launch.tile_x, launch.tile_y) + in_tile;
    uint64_t place = uint64_t(pixel.y) * uint64_t(scene.it.film_width) + uint64_t(pixel.x);
    if (launch.resting != 0UL && Words(launch.resting + place * 4UL).at[0] != 0u) {
        return;
    }
    uint first = launch.first_sample, end = launch.first_sample + launch.samples;
    bool in_pages = NEEDS_PAGES != 0u && launch.samples_done != 0UL;
    if (in_pages) {
        first = max(first, Words(launch.samples_done + place * 4UL).at[0]);
    }
    uint number = first;
    for (; number < end; number++) {
        FilmSample film_sample = sample_of_pixel(scene, pixel, number);
        if (lacks_a_page()) {
            break;
        }
        film_add(launch.target, scene.it.film_width, pixel, number, film_sample.total);
        if (NEEDS_SORTED != 0u && film_sample.kept != 0u) {
            film_sample_add_to(film_sample, launch.source, scene.it.film_width, pixel, number);
        }
    }
    if (in_pages) {
        Words(launch.samples_done + place * 4UL).at[0] = number;
        count_for_pages(launch.page_requests, PAGES_LACKED, number < end ? 1u : 0u);
        count_for_pages(launch.page_requests, PAGES_SAMPLES, max(number, first) - first);
    }
}

#endif

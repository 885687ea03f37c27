// Divides the light that a path meets into the film's sums: twin of cpu-renderer/src/film_sample.rs, which explains it. Where nothing is
// divided, the sum of all light is all there is.
#ifndef FILM_SAMPLE_GLSL
#define FILM_SAMPLE_GLSL

#include "layout.glsl"
#include "needs.glsl"
#include "sampler.glsl"

const uint LIGHT_KINDS = 8u;
const uint COLOR_KINDS = 3u;

// Kinds of light: for each, direct and, one further, indirect.
const uint DIFFUSE = 0u;
const uint GLOSSY = 2u;
const uint TRANSMISSION = 4u;
const uint EMISSION = 6u;
const uint ENVIRONMENT = 7u;

// Groups of sums that a film keeps: PassSums of picture/src/passes.rs.
const uint KEPT_ALPHA = 1u;
const uint KEPT_FEATURES = 2u;
const uint KEPT_LIGHT = 4u;
const uint KEPT_LABELS = 8u;
const uint KEPT_TYPES = 16u;
const uint KEPT_CAUGHT = 32u;
const uint KEPT_BACKGROUND = 64u;
// From this bit on: number of Cryptomatte slots.
const uint KEPT_SLOTS = 8u;

// The sum that light goes to: the picture's; a shadow catcher's among all objects, and among catchers alone; none, on the second way to a
// catcher.
const uint SINK_MATTE = 0u;
const uint SINK_CAUGHT = 1u;
const uint SINK_ALONE = 2u;
const uint SINK_NOTHING = 3u;

// How scattered light is divided among kinds.
struct PassWeights {
    vec3 diffuse;
    bool through;
};

struct FilmSample {
    vec3 total;
    float alpha;
    vec3 light[LIGHT_KINDS];
    vec3 colors[COLOR_KINDS];
    vec3 normal;
    // Cryptomatte ids of the first surface, by label and by type; 0 where there is none.
    vec2 ids;
    PassWeights scatter_weights;
    // Weights of the light ray in flight.
    PassWeights direct_weights;
    uint kept;
    vec2 limits;
    // A shadow catcher's light among all objects, and among catchers alone; light behind everything; whether something else was met.
    vec3 caught;
    vec3 alone;
    vec3 background;
    bool covered;
    uint sink;
};

FilmSample film_sample_new(Settings settings) {
    FilmSample t;
    t.total = vec3(0.0);
    if (NEEDS_SORTED != 0u) {
        t.alpha = 1.0;
        for (uint i = 0u; i < LIGHT_KINDS; i++) {
            t.light[i] = vec3(0.0);
        }
        for (uint i = 0u; i < COLOR_KINDS; i++) {
            t.colors[i] = vec3(0.0);
        }
        t.normal = vec3(0.0);
        t.ids = vec2(0.0);
        t.scatter_weights = PassWeights(vec3(0.0), false);
        t.direct_weights = t.scatter_weights;
        t.kept = settings.kept;
        float none = uintBitsToFloat(0x7F800000u);
        t.limits.x = settings.clamp_direct == 0.0 ? none : 3.0 * settings.clamp_direct;
        t.limits.y = settings.clamp_indirect == 0.0 ? none : 3.0 * settings.clamp_indirect;
    }
    t.sink = SINK_MATTE;
    if (NEEDS_CATCHER != 0u) {
        t.caught = vec3(0.0);
        t.alone = vec3(0.0);
        t.background = vec3(0.0);
        t.covered = true;
    }
    return t;
}

// Whether light of shadow catchers is kept apart, and none was met yet.
bool film_sample_catches(FilmSample t) {
    if (NEEDS_CATCHER == 0u || NEEDS_SORTED == 0u) {
        return false;
    }
    return (t.kept & KEPT_CAUGHT) != 0u && (t.sink == SINK_MATTE || t.sink == SINK_NOTHING);
}

// Adds light to the sum of its sink.
void film_sample_put(inout FilmSample t, vec3 light) {
    if (NEEDS_CATCHER == 0u || t.sink == SINK_MATTE) {
        t.total += light;
    } else if (t.sink == SINK_CAUGHT) {
        t.caught += light;
    } else if (t.sink == SINK_ALONE) {
        t.alone += light;
    }
}

// Light, reduced to the clamp where it exceeds it.
vec3 film_sample_clamped(FilmSample t, vec3 light, bool indirect) {
    float limit = indirect ? t.limits.y : t.limits.x;
    float sum = abs(light.x) + abs(light.y) + abs(light.z);
    return sum > limit ? light * (limit / sum) : light;
}

// Divides light among the kinds of the surface that scattered it first.
void film_sample_deal(inout FilmSample t, vec3 light, PassWeights weights, bool indirect) {
    if ((t.kept & KEPT_LIGHT) != 0u) {
        vec3 diffuse = light * weights.diffuse;
        uint further = indirect ? 1u : 0u;
        t.light[DIFFUSE + further] += diffuse;
        t.light[(weights.through ? TRANSMISSION : GLOSSY) + further] += light - diffuse;
    }
}

// Adds light that a ray met on its way or at its end.
void film_sample_add_emission(inout FilmSample t, vec3 light, uint vertex) {
    if (NEEDS_SORTED == 0u) {
        t.total += light;
        return;
    }
    light = film_sample_clamped(t, light, vertex > 1u);
    film_sample_put(t, light);
    if (NEEDS_CATCHER != 0u && t.sink != SINK_MATTE) {
        return;
    }
    if (vertex == 0u) {
        t.light[EMISSION] += light;
    } else {
        film_sample_deal(t, light, t.scatter_weights, vertex > 1u);
    }
}

// Adds light from behind everything.
void film_sample_add_background(inout FilmSample t, vec3 light, uint vertex) {
    if (NEEDS_SORTED == 0u || vertex > 0u) {
        film_sample_add_emission(t, light, vertex);
        return;
    }
    light = film_sample_clamped(t, light, false);
    bool transparent = (t.kept & KEPT_ALPHA) != 0u;
    if (NEEDS_CATCHER == 0u || t.sink == SINK_MATTE) {
        t.light[ENVIRONMENT] += light;
        if (NEEDS_CATCHER != 0u) {
            t.background += light;
            t.covered = !transparent;
        }
    }
    if (!transparent) {
        film_sample_put(t, light);
    } else if (NEEDS_CATCHER == 0u || t.sink != SINK_ALONE) {
        t.alpha = 0.0;
    }
}

// The path has met its first shadow catcher, with this light behind everything.
void film_sample_caught(inout FilmSample t, vec3 background) {
    t.sink = SINK_CAUGHT;
    t.covered = false;
    if ((t.kept & KEPT_BACKGROUND) != 0u) {
        vec3 light = film_sample_clamped(t, background, false);
        t.background += light;
        t.light[ENVIRONMENT] += light;
    }
}

// From here on the path is traced among catchers alone.
void film_sample_among_catchers(inout FilmSample t) {
    t.sink = SINK_ALONE;
}

// Adds light that the surface in front of the path receives by light sampling. At the first surface, t.direct_weights divides it among the
// kinds.
void film_sample_add_direct_light(inout FilmSample t, vec3 light, uint vertex) {
    if (NEEDS_SORTED == 0u) {
        t.total += light;
        return;
    }
    light = film_sample_clamped(t, light, vertex > 0u);
    film_sample_put(t, light);
    if (NEEDS_CATCHER != 0u && t.sink != SINK_MATTE) {
        return;
    }
    PassWeights weights = t.scatter_weights;
    if (vertex == 0u) {
        weights = t.direct_weights;
    }
    film_sample_deal(t, light, weights, vertex > 0u);
}

// The path continues.
void film_sample_scatter(inout FilmSample t, uint vertex, PassWeights weights) {
    if (NEEDS_SORTED != 0u && vertex == 0u) {
        t.scatter_weights = weights;
    }
}

// The path has come to a surface.
void film_sample_write_aovs(inout FilmSample t, uint vertex, vec3 colors[COLOR_KINDS], vec3 normal) {
    if (NEEDS_SORTED != 0u && vertex == 0u && t.sink != SINK_ALONE) {
        t.colors = colors;
        t.normal = normal;
    }
}

// Records which surface it is.
void film_sample_write_ids(inout FilmSample t, uint vertex, vec2 ids) {
    if (NEEDS_MATTES != 0u && vertex == 0u && t.sink != SINK_ALONE) {
        t.ids = ids;
    }
}

// Counts an id in a pixel's slots: in its own slot, else in a free one, else in the one with the least count, whose count it continues.
void matte_add(Floats sums, uint first, uint slots, float id) {
    float least = uintBitsToFloat(0x7F800000u);
    uint place = first;
    for (uint at = first; at < first + 2u * slots; at += 2u) {
        if (sums.at[at] == id || sums.at[at] == 0.0) {
            place = at;
            break;
        }
        if (sums.at[at + 1u] < least) {
            least = sums.at[at + 1u];
            place = at;
        }
    }
    sums.at[place] = id;
    sums.at[place + 1u] += 1.0;
}

void put_sum(Floats sums, inout uint at, vec3 v) {
    sums.at[at] += v.x;
    sums.at[at + 1u] += v.y;
    sums.at[at + 2u] += v.z;
    at += 3u;
}

// Adds the sample with this number to a pixel's sums.
void film_sample_add_to(FilmSample t, Address all_sums, uint film_width, uvec2 pixel, uint number) {
    bool features = (t.kept & KEPT_FEATURES) != 0u, light = (t.kept & KEPT_LIGHT) != 0u;
    bool alpha = (t.kept & KEPT_ALPHA) != 0u;
    uint stride = (alpha ? 1u : 0u) + (features ? 6u : 0u) + (light ? 3u * (LIGHT_KINDS + COLOR_KINDS) : 0u);
    uint slots = t.kept >> KEPT_SLOTS;
    bool background = (t.kept & KEPT_BACKGROUND) != 0u;
    uint caught_floats = background ? 11u : 8u;
    if (NEEDS_CATCHER != 0u && (t.kept & KEPT_CAUGHT) != 0u) {
        stride += CLASSES * caught_floats;
    }
    if (NEEDS_MATTES != 0u) {
        stride += 2u * slots * bitCount(t.kept & (KEPT_LABELS | KEPT_TYPES));
    }
    // 64 bits: a large film has more than 2^32 bytes.
    uint64_t place = (uint64_t(pixel.y) * uint64_t(film_width) + uint64_t(pixel.x)) * uint64_t(stride);
    Floats sums = Floats(all_sums + place * 4UL);
    uint at = 0u;
    if (alpha) {
        sums.at[0] += t.alpha;
        at = 1u;
    }
    if (features) {
        put_sum(sums, at, t.colors[0] + t.colors[1] + t.colors[2]);
        put_sum(sums, at, t.normal);
    }
    if (light) {
        for (uint i = 0u; i < LIGHT_KINDS; i++) {
            put_sum(sums, at, t.light[i]);
        }
        for (uint i = 0u; i < COLOR_KINDS; i++) {
            put_sum(sums, at, t.colors[i]);
        }
    }
    if (NEEDS_CATCHER != 0u && (t.kept & KEPT_CAUGHT) != 0u) {
        uint here = at + caught_floats * (number % CLASSES);
        at += CLASSES * caught_floats;
        put_sum(sums, here, t.caught);
        put_sum(sums, here, t.alone);
        sums.at[here] += t.covered ? 1.0 : 0.0;
        sums.at[here + 1u] += t.alpha == 0.0 ? 1.0 : 0.0;
        here += 2u;
        if (background) {
            put_sum(sums, here, t.background);
        }
    }
    if (NEEDS_MATTES != 0u && t.ids.x != 0.0) {
        if ((t.kept & KEPT_LABELS) != 0u) {
            matte_add(sums, at, slots, t.ids.x);
            at += 2u * slots;
        }
        if ((t.kept & KEPT_TYPES) != 0u) {
            matte_add(sums, at, slots, t.ids.y);
        }
    }
}

#endif

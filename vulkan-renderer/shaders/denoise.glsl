// Denoises a picture by averaging pixels that a statistical test cannot tell apart: twin of picture/src/denoise/mod.rs, guides.rs, light.rs,
// welch.rs, windows.rs and shrink.rs. An invocation does for one pixel what the host does for several side by side, in the same order, so that the bits are the
// same where quotients are rounded correctly.
//
// Whether a float is a number is told by its bits, because a device may take it for granted.
#ifndef DENOISE_GLSL
#define DENOISE_GLSL

#include "layout.glsl"
#include "launch.glsl"
#include "moments.glsl"

const int RADIUS = 2;
const float OVERLAP = 2.6896;
const float FEWEST = 1.5;
const float ALBEDO_FLOOR = 0.01;
const float NORMAL = 4.0;
const float ALBEDO = 0.01;
const float MOST_LIGHT = 1e18;
const float UNKNOWN = 1e18;
const float LEAST = 1e-30;
const float NOISIER = 8.0;
const int REACH = 4;
const float FLOOR = 0.01;

// The largest finite float.
const uint MOST_FINITE_BITS = 0x7F7FFFFFu;

// What is compared of pixels beside each other.
struct Compared {
    vec3 mean;
    vec3 variance;
    vec3 normal;
    vec3 albedo;
    uint label;
    uint instance;
};

// Mean of a window, and the variance of that mean.
struct Mean {
    vec3 mean;
    vec3 variance;
};

// Whether the absolute value of a float is at most that of these bits; false for what is no number.
bool is_at_most(float value, uint bits) {
    return (floatBitsToUint(value) & 0x7FFFFFFFu) <= bits;
}

vec3 vec3_of(float v[3]) {
    return vec3(v[0], v[1], v[2]);
}

uint64_t pixel_number(uint width, uvec2 pixel) {
    return uint64_t(pixel.y) * uint64_t(width) + uint64_t(pixel.x);
}

Floats channels_of(Address image, uint64_t pixel) {
    return Floats(image + pixel * 12UL);
}

Guide guide_at(Denoise picture, uint64_t pixel) {
    return Guides(picture.guides + pixel * 36UL).at[0];
}

PixelLights light_at(Denoise picture, uint64_t pixel) {
    return PixelLights(picture.light + pixel * 16UL);
}

bool takes_part(Denoise picture, uint64_t pixel) {
    return light_at(picture, pixel).at[0].takes_part != 0u;
}

// What light is divided by.
float divisor(float albedo) {
    precise float d = albedo + ALBEDO_FLOOR;
    return d;
}

// The guide that a first surface is.
Guide guides_of(FirstRecord first) {
    bool is_surface = is_at_most(first.depth, MOST_FINITE_BITS);
    for (uint c = 0u; c < 3u; c++) {
        is_surface = is_surface && is_at_most(first.normal[c], MOST_FINITE_BITS);
        is_surface = is_surface && is_at_most(first.albedo[c], MOST_FINITE_BITS) && first.albedo[c] >= 0.0;
    }
    Guide guide = Guide(float[3](0.0, 0.0, 0.0), float[3](0.0, 0.0, 0.0), first.label, first.instance, is_surface ? 1u : 0u);
    if (is_surface) {
        guide.normal = first.normal;
        guide.albedo = first.albedo;
    }
    return guide;
}

// Puts mean and variance of the film's sums in place of the picture and its variance.
void take_film(Denoise picture, uint64_t pixel) {
    Floats mean = channels_of(picture.image, pixel);
    Floats variance = channels_of(picture.variance, pixel);
    uint n = film_samples_of(picture.resting, pixel, picture.samples);
    for (uint c = 0u; c < 3u; c++) {
        mean.at[c] = 0.0;
        variance.at[c] = 0.0;
        if (n > 0u) {
            Moments moments = film_moments(picture.sums, pixel, c, n);
            mean.at[c] = f64_to_f32(moments.mean);
            variance.at[c] = f64_to_f32(moments.variance);
        }
    }
}

// The light of a pixel and its own variance.
void light_of(Denoise picture, uint64_t pixel) {
    Guide guide = guide_at(picture, pixel);
    Floats image = channels_of(picture.image, pixel);
    Floats variance = channels_of(picture.variance, pixel);
    Floats light_variance = channels_of(picture.light_variance, pixel);
    bool is_part = guide.is_surface != 0u;
    for (uint c = 0u; c < 3u; c++) {
        is_part = is_part && is_at_most(image.at[c], floatBitsToUint(MOST_LIGHT));
    }
    PixelLight light = PixelLight(float[3](0.0, 0.0, 0.0), is_part ? 1u : 0u);
    for (uint c = 0u; c < 3u; c++) {
        precise float own = UNKNOWN;
        if (is_part) {
            precise float d = divisor(guide.albedo[c]);
            precise float mean = image.at[c] / d;
            light.mean[c] = mean;
            if (picture.is_variance_known != 0u) {
                precise float of = variance.at[c] / (d * d);
                bool is_known = is_at_most(of, floatBitsToUint(UNKNOWN)) && of >= 0.0 && of < UNKNOWN;
                // Negative, infinite or no number: as if it were not known.
                own = is_known ? of : UNKNOWN;
            }
        }
        light_variance.at[c] = own;
    }
    light_at(picture, pixel).at[0] = light;
}

// The greater of a pixel's own variance and the mean of those that are known of its label among the 3 × 3 pixels around it.
void pooled(Denoise picture, uvec2 at) {
    uint64_t pixel = pixel_number(picture.width, at);
    if (!takes_part(picture, pixel)) {
        return;
    }
    Guide guide = guide_at(picture, pixel);
    precise vec3 sum = vec3(0.0);
    precise vec3 count = vec3(0.0);
    for (uint y = at.y == 0u ? 0u : at.y - 1u; y < min(at.y + 2u, picture.height); y++) {
        for (uint x = at.x == 0u ? 0u : at.x - 1u; x < min(at.x + 2u, picture.width); x++) {
            uint64_t other = pixel_number(picture.width, uvec2(x, y));
            Guide of = guide_at(picture, other);
            bool is_of_label = of.label == guide.label && of.instance == guide.instance;
            if (!is_of_label || !takes_part(picture, other)) {
                continue;
            }
            Floats variance = channels_of(picture.light_variance, other);
            for (uint c = 0u; c < 3u; c++) {
                if (variance.at[c] < UNKNOWN) {
                    sum[c] += variance.at[c];
                    count[c] += 1.0;
                }
            }
        }
    }
    Floats alone = channels_of(picture.light_variance, pixel);
    Floats result = channels_of(picture.pooled_variance, pixel);
    for (uint c = 0u; c < 3u; c++) {
        precise float mean = sum[c] / max(count[c], 1.0);
        result.at[c] = max(alone.at[c], mean);
    }
}

// The weight of a pixel whose mean differs by `d`, with `for_noise` less for a much noisier one. `own` and `other` are their variances, finite and
// not negative.
float welch_test_weight(float t_squared[3], float d, float own, float other, bool for_noise) {
    precise float sum = own + other;
    precise float inverse = 1.0 / (sum + LEAST);
    precise float r = (own * own + other * other) * inverse * inverse;
    precise float share = for_noise ? min((NOISIER * own + LEAST) * inverse, 1.0) : 1.0;
    precise float bar = (t_squared[0] + r * (t_squared[1] + r * t_squared[2])) * sum;
    precise float squared = d * d;
    return squared <= bar ? share : 0.0;
}

// How alike two surfaces are, from the squared differences of their normals and base colours.
float likeness(float normal, float albedo) {
    precise float y = max(1.0 - (normal * (1.0 / NORMAL) + albedo * (1.0 / ALBEDO)), 0.0);
    precise float result = (y * y) * (y * y);
    return result;
}

Compared compared(vec3 mean, Floats variance, Guide guide) {
    return Compared(mean, vec3(variance.at[0], variance.at[1], variance.at[2]), vec3_of(guide.normal), vec3_of(guide.albedo), guide.label,
        guide.instance);
}

// The weight of a pixel that takes part for another.
float weights(float t_squared[3], Compared p, Compared q, bool for_noise) {
    if (p.label != q.label || p.instance != q.instance) {
        return 0.0;
    }
    precise float normal = 0.0;
    precise float albedo = 0.0;
    float weight = 1.0;
    for (uint c = 0u; c < 3u; c++) {
        precise float of_normal = q.normal[c] - p.normal[c];
        normal += of_normal * of_normal;
        precise float of_albedo = q.albedo[c] - p.albedo[c];
        albedo += of_albedo * of_albedo;
        precise float d = q.mean[c] - p.mean[c];
        weight = min(weight, welch_test_weight(t_squared, d, p.variance[c], q.variance[c], for_noise));
    }
    precise float weighted = weight * likeness(normal, albedo);
    return weighted;
}

Compared first_window_compared(Denoise picture, uint64_t pixel) {
    vec3 mean = vec3_of(light_at(picture, pixel).at[0].mean);
    return compared(mean, channels_of(picture.pooled_variance, pixel), guide_at(picture, pixel));
}

Mean first_window_mean_of(Denoise picture, uvec2 at) {
    Compared own = first_window_compared(picture, pixel_number(picture.width, at));
    precise float weight = 0.0;
    precise float squared_weight = 0.0;
    precise vec3 light = vec3(0.0);
    precise vec3 spread = vec3(0.0);
    ivec2 size = ivec2(picture.width, picture.height);
    ivec2 lowest = max(ivec2(at) - RADIUS, ivec2(0));
    ivec2 end = min(ivec2(at) + RADIUS + 1, size);
    bool is_variance_known = picture.is_variance_known != 0u;
    for (int y = lowest.y; y < end.y; y++) {
        for (int x = lowest.x; x < end.x; x++) {
            uint64_t other = pixel_number(picture.width, uvec2(x, y));
            if (!takes_part(picture, other)) {
                continue;
            }
            Compared of = first_window_compared(picture, other);
            precise float of_weight = weights(picture.t_squared, own, of, true);
            weight += of_weight;
            squared_weight += of_weight * of_weight;
            precise vec3 d = of.mean - own.mean;
            light += of_weight * d;
            precise vec3 of_known = of_weight * of_weight * of.variance;
            precise vec3 of_unknown = of_weight * d * d;
            spread += is_variance_known ? of_known : of_unknown;
        }
    }
    precise vec3 mean = own.mean;
    precise vec3 variance = vec3(UNKNOWN);
    precise float count = weight * weight / squared_weight;
    for (uint c = 0u; c < 3u; c++) {
        precise float shift = light[c] / weight;
        mean[c] += shift;
        if (is_variance_known) {
            precise float of_mean = spread[c] / (weight * weight);
            variance[c] = of_mean;
        } else if (count >= FEWEST) {
            precise float of_pixel = max(spread[c] / weight - shift * shift, 0.0);
            precise float of_mean = min(of_pixel / (count - 1.0), UNKNOWN);
            variance[c] = of_mean;
        }
    }
    return Mean(mean, variance);
}

// Writes the mean of a pixel that takes part.
void first_window_means(Denoise picture, uvec2 at) {
    uint64_t pixel = pixel_number(picture.width, at);
    if (!takes_part(picture, pixel)) {
        return;
    }
    Mean found = first_window_mean_of(picture, at);
    Floats mean = channels_of(picture.smooth_mean, pixel);
    Floats variance = channels_of(picture.light_variance, pixel);
    for (uint c = 0u; c < 3u; c++) {
        mean.at[c] = found.mean[c];
        variance.at[c] = found.variance[c];
    }
}

// The means of the second window lie in place of the light, as their variances do.
Compared wide_window_compared(Denoise picture, uint64_t pixel, bool is_third) {
    if (is_third) {
        return first_window_compared(picture, pixel);
    }
    Floats mean = channels_of(picture.smooth_mean, pixel);
    vec3 of_mean = vec3(mean.at[0], mean.at[1], mean.at[2]);
    return compared(of_mean, channels_of(picture.light_variance, pixel), guide_at(picture, pixel));
}

Mean wide_window_mean_of(Denoise picture, uvec2 at, bool is_third) {
    Compared own = wide_window_compared(picture, pixel_number(picture.width, at), is_third);
    precise vec3 light = vec3(0.0);
    precise vec3 spread = vec3(0.0);
    precise float weight = 0.0;
    ivec2 size = ivec2(picture.width, picture.height);
    int wide_step = int(picture.wide_steps[is_third ? 1 : 0]);
    for (int row = -RADIUS; row <= RADIUS; row++) {
        for (int column = -RADIUS; column <= RADIUS; column++) {
            ivec2 place = ivec2(at) + wide_step * ivec2(column, row);
            if (any(lessThan(place, ivec2(0))) || any(greaterThanEqual(place, size))) {
                continue;
            }
            uint64_t other = pixel_number(picture.width, uvec2(place));
            if (!takes_part(picture, other)) {
                continue;
            }
            Compared of = wide_window_compared(picture, other, is_third);
            precise float of_weight = weights(picture.wide_t_squared, own, of, false);
            weight += of_weight;
            light += of_weight * (of.mean - own.mean);
            spread += of_weight * of_weight * of.variance;
        }
    }
    precise vec3 mean = own.mean + light / weight;
    precise vec3 variance = min(OVERLAP * spread / (weight * weight), vec3(UNKNOWN));
    return Mean(mean, variance);
}

// Puts the mean of a pixel that takes part in place of its light.
void wide_window_means(Denoise picture, uvec2 at) {
    uint64_t pixel = pixel_number(picture.width, at);
    if (!takes_part(picture, pixel)) {
        return;
    }
    Mean found = wide_window_mean_of(picture, at, false);
    PixelLights light = light_at(picture, pixel);
    Floats variance = channels_of(picture.pooled_variance, pixel);
    for (uint c = 0u; c < 3u; c++) {
        light.at[0].mean[c] = found.mean[c];
        variance.at[c] = found.variance[c];
    }
}

// Relative variance and relative squared change of a pixel that takes part, summed over its channels; 0 where a variance is not known.
vec2 noise_and_change(float noisy[3], float variance[3], float filtered[3]) {
    precise float noise = 0.0;
    precise float change = 0.0;
    bool is_known = true;
    for (uint c = 0u; c < 3u; c++) {
        precise float weight = 1.0 / (filtered[c] * filtered[c] + FLOOR);
        precise float d = noisy[c] - filtered[c];
        noise += weight * variance[c];
        change += weight * (d * d);
        // Negative, infinite or no number: as if it were not known.
        is_known = is_known && is_at_most(variance[c], floatBitsToUint(UNKNOWN)) && variance[c] >= 0.0 && variance[c] < UNKNOWN;
    }
    return is_known ? vec2(noise, change) : vec2(0.0);
}

// Replaces the colour of a pixel that takes part. Where variances are known, it keeps the noisy one and what tells its share.
void wide_window_fill(Denoise picture, uvec2 at) {
    uint64_t pixel = pixel_number(picture.width, at);
    Floats told = channels_of(picture.light_variance, pixel);
    if (!takes_part(picture, pixel)) {
        told.at[0] = 0.0;
        told.at[1] = 0.0;
        return;
    }
    Mean found = wide_window_mean_of(picture, at, true);
    Guide guide = guide_at(picture, pixel);
    Floats image = channels_of(picture.image, pixel);
    float noisy[3];
    float filtered[3];
    for (uint c = 0u; c < 3u; c++) {
        noisy[c] = image.at[c];
        precise float d = divisor(guide.albedo[c]);
        precise float result = noisy[c] + d * (found.mean[c] - noisy[c] / d);
        filtered[c] = result;
        image.at[c] = result;
    }
    if (picture.is_variance_known != 0u) {
        Floats variance = channels_of(picture.variance, pixel);
        vec2 of_pixel = noise_and_change(noisy, float[3](variance.at[0], variance.at[1], variance.at[2]), filtered);
        told.at[0] = of_pixel.x;
        told.at[1] = of_pixel.y;
        Floats kept = channels_of(picture.smooth_mean, pixel);
        for (uint c = 0u; c < 3u; c++) {
            kept.at[c] = noisy[c];
        }
    }
}

// 1 - a of a pixel, as picture/src/denoise/shrink.rs says.
float share_of_noisy(Denoise picture, uvec2 at) {
    Guide guide = guide_at(picture, pixel_number(picture.width, at));
    precise float noise = 0.0;
    precise float change = 0.0;
    ivec2 lowest = max(ivec2(at) - REACH, ivec2(0));
    ivec2 end = min(ivec2(at) + REACH + 1, ivec2(picture.width, picture.height));
    for (int y = lowest.y; y < end.y; y++) {
        for (int x = lowest.x; x < end.x; x++) {
            uint64_t other = pixel_number(picture.width, uvec2(x, y));
            Guide of = guide_at(picture, other);
            if (of.label == guide.label && of.instance == guide.instance) {
                Floats told = channels_of(picture.light_variance, other);
                noise += told.at[0];
                change += told.at[1];
            }
        }
    }
    precise float share = noise < change ? 1.0 - noise / change : 0.0;
    return share;
}

// Gives a filtered pixel that takes part its share of the noisy one.
void shrink(Denoise picture, uvec2 at) {
    uint64_t pixel = pixel_number(picture.width, at);
    if (!takes_part(picture, pixel)) {
        return;
    }
    float share = share_of_noisy(picture, at);
    Floats image = channels_of(picture.image, pixel);
    Floats noisy = channels_of(picture.smooth_mean, pixel);
    for (uint c = 0u; c < 3u; c++) {
        precise float result = image.at[c] + share * (noisy.at[c] - image.at[c]);
        image.at[c] = result;
    }
}

// One step for a pixel of the launch's tile.
void denoise_pixel(uvec2 in_tile) {
    if (in_tile.x >= launch.tile_width || in_tile.y >= launch.tile_height) {
        return;
    }
    Denoise picture = DenoiseRef(launch.source).it;
    uvec2 at = uvec2(launch.tile_x, launch.tile_y) + in_tile;
    uint64_t pixel = pixel_number(picture.width, at);
    if (launch.wanted == DENOISE_GUIDES) {
        uint64_t row = pixel_number(launch.tile_width, in_tile);
        FirstRecord first = FirstRecords(picture.surfaces + row * 48UL).at[0];
        Guides(picture.guides + pixel * 36UL).at[0] = guides_of(first);
    } else if (launch.wanted == DENOISE_LIGHT) {
        if (picture.sums != 0UL) {
            take_film(picture, pixel);
        }
        light_of(picture, pixel);
    } else if (launch.wanted == DENOISE_POOLED) {
        pooled(picture, at);
    } else if (launch.wanted == DENOISE_FIRST_WINDOW) {
        first_window_means(picture, at);
    } else if (launch.wanted == DENOISE_SECOND_WINDOW) {
        wide_window_means(picture, at);
    } else if (launch.wanted == DENOISE_THIRD_WINDOW) {
        wide_window_fill(picture, at);
    } else if (launch.wanted == DENOISE_SHRINK) {
        shrink(picture, at);
    }
}

#endif

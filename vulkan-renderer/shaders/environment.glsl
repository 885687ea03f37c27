// An environment map: twin of transport/src/environment.rs. Angles are floats here, doubles there: a position in an image of 4,096 pixels
// is off by up to 2^−10 pixels.
#ifndef ENVIRONMENT_GLSL
#define ENVIRONMENT_GLSL

#include "sun.glsl"

vec3 environment_pixel(Environment table, uint x, uint y) {
    Floats pixels = Floats(table.pixels);
    uint at = 3u * (y * table.width + x);
    return vec3(pixels.at[at], pixels.at[at + 1u], pixels.at[at + 2u]);
}

// Position of a unit direction in the image: pixels from the left and from the top.
vec2 environment_place(Environment table, vec3 direction) {
    float azimuth = atan2_of(direction.y, direction.x) - f64_to_f32(f64_from_bits(table.rotation_rad));
    float u = 0.5 - azimuth / (2.0 * PI);
    u -= floor(u);
    // Not the arccosine of z: near the poles z determines the angle poorly, x and y determine it well.
    float v = atan2_of(length(direction.xy), direction.z) / PI;
    return vec2(u * float(table.width), v * float(table.height));
}

// Linear interpolation between pixel centres, wrapping horizontally, clamped at the poles.
vec3 environment_between(Environment table, vec2 place) {
    float x = place.x - 0.5, y = clamp(place.y - 0.5, 0.0, float(table.height - 1u));
    float x0 = floor(x), y0 = floor(y);
    float fx = x - x0, fy = y - y0;
    uint left = uint(int(x0) + int(table.width)) % table.width;
    uint right = (left + 1u) % table.width;
    uint top = uint(y0), bottom = min(top + 1u, table.height - 1u);
    vec3 upper = mix(environment_pixel(table, left, top), environment_pixel(table, right, top), fx);
    vec3 lower = mix(environment_pixel(table, left, bottom), environment_pixel(table, right, bottom), fx);
    return mix(upper, lower, fy) * table.strength;
}

// Radiance from a unit direction.
vec3 environment_eval(Environment table, vec3 direction) {
    return environment_between(table, environment_place(table, direction));
}

// Probability density per solid angle of a unit direction in environment_sample.
float environment_pdf(Environment table, vec3 direction) {
    vec2 place = environment_place(table, direction);
    uint x = min(uint(place.x), table.width - 1u), y = min(uint(place.y), table.height - 1u);
    return Floats(table.density).at[y * table.width + x];
}

// How many of the values 1 to count − 1 of a cdf, counted from `first`, are at most u.
uint cdf_index_f64(Longs cdf, uint count, f64 u) {
    uint low = 0u, high = count - 1u;
    while (low < high) {
        uint middle = (low + high) >> 1;
        if (f64_le(f64_from_bits(cdf.at[middle + 1u]), u)) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

uint cdf_index(Floats cdf, uint first, uint count, float u) {
    uint low = 0u, high = count - 1u;
    while (low < high) {
        uint middle = (low + high) >> 1;
        if (cdf.at[first + middle + 1u] <= u) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

// Samples a unit direction, with its radiance and its density per solid angle.
SunSample environment_sample(Environment table, vec2 u) {
    Longs row_cdf = Longs(table.row_cdf);
    f64 v = f64_from_f32(u.y);
    uint y = cdf_index_f64(row_cdf, table.height, v);
    f64 row_start = f64_from_bits(row_cdf.at[y]), row_end = f64_from_bits(row_cdf.at[y + 1u]);
    float in_row = clamp(f64_to_f32(f64_div(f64_sub(v, row_start), f64_sub(row_end, row_start))), 0.0, 1.0);
    Floats cdf = Floats(table.column_cdf);
    uint first = y * (table.width + 1u);
    uint x = cdf_index(cdf, first, table.width, u.x);
    float start = cdf.at[first + x], end = cdf.at[first + x + 1u];
    float in_column = clamp((u.x - start) / (end - start), 0.0, 1.0);
    // Uniform in z, measured from the nearer pole by 1 − |z| = 2 sin²(θ/2), so that nothing cancels where the rows are small.
    bool north = 2u * y < table.height;
    float above = float(north ? y : table.height - y), below = float(north ? y + 1u : table.height - y - 1u);
    float to_half_angle = 0.5 * PI / float(table.height);
    float sine_above = sin_cos(above * to_half_angle).x, sine_below = sin_cos(below * to_half_angle).x;
    float from_pole = 2.0 * mix(sine_above * sine_above, sine_below * sine_below, in_row);
    float z = north ? 1.0 - from_pole : from_pole - 1.0;
    float sine = sqrt(max(from_pole * (2.0 - from_pole), 0.0));
    float place_x = float(x) + in_column;
    float azimuth =
        (0.5 - place_x / float(table.width)) * 2.0 * PI + f64_to_f32(f64_from_bits(table.rotation_rad));
    vec2 sc = sin_cos(azimuth);
    SunSample result;
    result.direction =
        dvec3_of(f64_from_f32(sine * sc.y), f64_from_f32(sine * sc.x), f64_from_f32(z));
    float place_y = atan2_of(sine, z) / PI * float(table.height);
    result.radiance = environment_between(table, vec2(place_x, place_y));
    result.pdf = Floats(table.density).at[y * table.width + x];
    return result;
}

#endif

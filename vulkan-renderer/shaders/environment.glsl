// An environment map: twin of transport/src/environment.rs. Angles are floats here, doubles there: a position in an image of 4,096 pixels
// is off by up to 2^−10 pixels.
#ifndef ENVIRONMENT_GLSL
#define ENVIRONMENT_GLSL

#include "sun.glsl"

const float LEAST_SINE = 1e-6;

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

// The pixels around a place in the picture: upper left, upper right, lower left, lower right; and the place among them, from 0 to 1.
vec2 environment_around(Environment table, vec2 place, out vec3 pixels[4]) {
    float x = place.x - 0.5, y = clamp(place.y - 0.5, 0.0, float(table.height - 1u));
    float x0 = floor(x), y0 = floor(y);
    uint left = uint(int(x0) + int(table.width)) % table.width;
    uint right = (left + 1u) % table.width;
    uint top = uint(y0), bottom = min(top + 1u, table.height - 1u);
    pixels[0] = environment_pixel(table, left, top);
    pixels[1] = environment_pixel(table, right, top);
    pixels[2] = environment_pixel(table, left, bottom);
    pixels[3] = environment_pixel(table, right, bottom);
    return vec2(x - x0, y - y0);
}

vec3 bilinear(vec3 pixels[4], vec2 place) {
    vec3 upper = pixels[0] + (pixels[1] - pixels[0]) * place.x, lower = pixels[2] + (pixels[3] - pixels[2]) * place.x;
    return upper + (lower - upper) * place.y;
}

// Linear interpolation between pixel centres, wrapping horizontally, clamped at the poles.
vec3 environment_between(Environment table, vec2 place) {
    vec3 pixels[4];
    place = environment_around(table, place, pixels);
    return bilinear(pixels, place) * table.strength;
}

// Radiance from a unit direction.
vec3 environment_eval(Environment table, vec3 direction) {
    return environment_between(table, environment_place(table, direction));
}

// Brightness of a pixel above the floor.
float environment_excess(Environment table, vec3 pixel) {
    return max(max(max(pixel.x, pixel.y), pixel.z) - table.floor, 0.0);
}

// Density in a row of cells, where the interpolated excess of four pixels is this and the polar angle has this sine.
float environment_density(Environment table, vec3 pixels[4], vec2 place, uint row, float sine) {
    float a = environment_excess(table, pixels[0]), b = environment_excess(table, pixels[1]);
    float c = environment_excess(table, pixels[2]), d = environment_excess(table, pixels[3]);
    float upper = a + (b - a) * place.x, lower = c + (d - c) * place.x;
    return (upper + (lower - upper) * place.y) * Floats(table.row_density).at[row] / max(sine, LEAST_SINE);
}

// Probability density per solid angle of a unit direction in environment_sample.
float environment_pdf(Environment table, vec3 direction) {
    vec2 place = environment_place(table, direction);
    uint row = min(uint(place.y + 0.5), table.height);
    vec3 pixels[4];
    vec2 among = environment_around(table, place, pixels);
    return environment_density(table, pixels, among, row, length(direction.xy));
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

// Inverts the cdf of a density on [0, 1] that goes linearly from `from` to `to`.
float sample_linear(float from, float to, float u) {
    float root = sqrt(max(from * from + (to * to - from * from) * u, 0.0));
    float both = from + root;
    return both > 0.0 ? clamp(u * (from + to) / both, 0.0, 1.0) : u;
}

// Samples a unit direction, with its radiance and its density per solid angle.
SunSample environment_sample(Environment table, vec2 u) {
    Longs row_cdf = Longs(table.row_cdf);
    f64 v = f64_from_f32(u.y);
    uint row = cdf_index_f64(row_cdf, table.height + 1u, v);
    f64 row_start = f64_from_bits(row_cdf.at[row]), row_end = f64_from_bits(row_cdf.at[row + 1u]);
    float in_row = clamp(f64_to_f32(f64_div(f64_sub(v, row_start), f64_sub(row_end, row_start))), 0.0, 1.0);
    Floats cdf = Floats(table.column_cdf);
    uint first = row * (table.width + 1u);
    uint left = cdf_index(cdf, first, table.width, u.x);
    float start = cdf.at[first + left], end = cdf.at[first + left + 1u];
    float in_column = clamp((u.x - start) / (end - start), 0.0, 1.0);
    uint top = row == 0u ? 0u : row - 1u, bottom = min(row, table.height - 1u), right = (left + 1u) % table.width;
    vec3 pixels[4];
    pixels[0] = environment_pixel(table, left, top);
    pixels[1] = environment_pixel(table, right, top);
    pixels[2] = environment_pixel(table, left, bottom);
    pixels[3] = environment_pixel(table, right, bottom);
    float a = environment_excess(table, pixels[0]), b = environment_excess(table, pixels[1]);
    float c = environment_excess(table, pixels[2]), d = environment_excess(table, pixels[3]);
    float fy = sample_linear(a + b, c + d, in_row);
    float fx = sample_linear(a + (c - a) * fy, b + (d - b) * fy, in_column);
    // The polar angle from the nearer pole, so that nothing cancels where the rows are small.
    bool north = 2u * row < table.height;
    float above = max(float(row) - 0.5, 0.0), below = min(float(row) + 0.5, float(table.height));
    float place_y = above + (below - above) * fy;
    float from_pole = north ? place_y : (float(table.height) - below) + (below - above) * (1.0 - fy);
    vec2 polar = sin_cos(from_pole * (PI / float(table.height)));
    float sine = polar.x, z = north ? polar.y : -polar.y;
    float place_x = float(left) + 0.5 + fx;
    float azimuth =
        (0.5 - place_x / float(table.width)) * 2.0 * PI + f64_to_f32(f64_from_bits(table.rotation_rad));
    vec2 sc = sin_cos(azimuth);
    SunSample result;
    result.direction =
        dvec3_of(f64_from_f32(sine * sc.y), f64_from_f32(sine * sc.x), f64_from_f32(z));
    vec2 among = vec2(fx, fy);
    result.radiance = bilinear(pixels, among) * table.strength;
    result.pdf = environment_density(table, pixels, among, row, sine);
    return result;
}

#endif

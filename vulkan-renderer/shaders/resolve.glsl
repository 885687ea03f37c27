// Resolves the film: mean and alpha of a pixel, and a strip's part of the estimated error. Twin of picture/src/film.rs, whose doubles are added
// in the same order, so that the bits are the same.
#ifndef RESOLVE_GLSL
#define RESOLVE_GLSL

#include "layout.glsl"
#include "launch.glsl"
#include "moments.glsl"

const uint STRIP_ROWS = 32u;

#define FLOOR f64_from_bits(0x3F847AE147AE147BUL)
#define SIXTEEN f64_from_bits(0x4030000000000000UL)

uint64_t resolve_pixel(Resolve film, uint x, uint y) {
    return uint64_t(y) * uint64_t(film.width) + uint64_t(x);
}

// Mean and variance of one channel of a pixel.
Moments resolve_moments(Resolve film, uint64_t pixel, uint channel) {
    return film_moments(film.sums, pixel, channel, film_samples_of(film.resting, pixel, film.samples));
}

// The mean of a pixel's samples.
void film_mean(Resolve film, uint64_t pixel) {
    Floats result = Floats(film.result + pixel * 12UL);
    bool has_samples = film_samples_of(film.resting, pixel, film.samples) > 0u;
    ROLLED for (uint c = 0u; c < 3u; c++) {
        result.at[c] = has_samples ? f64_to_f32(resolve_moments(film, pixel, c).mean) : 0.0;
    }
}

// The share of a pixel's samples that hit a surface. Its quotient is found in doubles, which round to the one in floats.
void film_alpha(Resolve film, uint64_t pixel) {
    float samples = float(max(film_samples_of(film.resting, pixel, film.samples), 1u));
    float sum = Floats(film.pass_sums + pixel * uint64_t(film.pass_stride) * 4UL).at[0];
    Floats(film.result + pixel * 4UL).at[0] = f64_to_f32(f64_div(f64_from_f32(sum), f64_from_f32(samples)));
}

// Means of one channel of a pixel and of those beside it.
struct MeansInRow {
    f64 left;
    f64 own;
    f64 right;
};

MeansInRow means_in_row(Resolve film, uint x, uint y, uint channel) {
    MeansInRow row = MeansInRow(F64_ZERO, F64_ZERO, F64_ZERO);
    ROLLED for (uint at = x == 0u ? 0u : x - 1u; at < min(x + 2u, film.width); at++) {
        f64 mean = resolve_moments(film, resolve_pixel(film, at, y), channel).mean;
        if (at < x) {
            row.left = mean;
        } else if (at == x) {
            row.own = mean;
        } else {
            row.right = mean;
        }
    }
    return row;
}

// The sum of var / (μ² + floor) over the channels and pixels of a strip: one column of a block of rows.
f64 film_squared_errors_of(Resolve film, uint x, uint block) {
    uint first = block * STRIP_ROWS;
    uint end = min(first + STRIP_ROWS, film.height);
    bool has_left = x > 0u, has_right = x + 1u < film.width;
    f64 sum = F64_ZERO;
    ROLLED for (uint channel = 0u; channel < 3u; channel++) {
        // The rows above, of the pixel, and below, which move down with it. What is added for a pixel that is not there is nothing.
        MeansInRow none = MeansInRow(F64_ZERO, F64_ZERO, F64_ZERO);
        MeansInRow above = none, row = none, below = none;
        ROLLED for (uint next = first == 0u ? 0u : first - 1u; next <= end; next++) {
            above = row;
            row = below;
            below = none;
            if (next < film.height) {
                below = means_in_row(film, x, next, channel);
            }
            if (next <= first) {
                continue;
            }
            uint y = next - 1u;
            f64 var = resolve_moments(film, resolve_pixel(film, x, y), channel).variance;
            if (f64_eq(var, F64_ZERO)) {
                continue;
            }
            bool has_above = y > 0u, has_below = y + 1u < film.height;
            uint columns = 1u + (has_left ? 1u : 0u) + (has_right ? 1u : 0u);
            uint n = columns * (1u + (has_above ? 1u : 0u) + (has_below ? 1u : 0u)) - 1u;
            f64 around = f64_add(f64_add(f64_add(F64_ZERO, above.left), above.own), above.right);
            around = f64_add(f64_add(around, row.left), row.right);
            around = f64_add(f64_add(f64_add(around, below.left), below.own), below.right);
            around = f64_div(around, f64_from_u32(max(n, 1u)));
            f64 known = f64_max(f64_sub(f64_mul(row.own, row.own), var), F64_ZERO);
            f64 certain = f64_div(known, f64_add(known, f64_mul(SIXTEEN, var)));
            f64 rest = f64_mul(f64_mul(f64_sub(F64_ONE, certain), around), around);
            f64 square = f64_add(f64_mul(certain, known), rest);
            sum = f64_add(sum, f64_div(var, f64_add(square, FLOOR)));
        }
    }
    return sum;
}

// One step for a pixel of the launch's tile, or for a strip.
void resolve_item(uvec2 in_tile) {
    if (in_tile.x >= launch.tile_width || in_tile.y >= launch.tile_height) {
        return;
    }
    Resolve film = ResolveRef(launch.source).it;
    uvec2 at = uvec2(launch.tile_x, launch.tile_y) + in_tile;
    uint64_t item = resolve_pixel(film, at.x, at.y);
    if (launch.wanted == RESOLVE_COLOR) {
        film_mean(film, item);
    } else if (launch.wanted == RESOLVE_ALPHA) {
        film_alpha(film, item);
    } else if (launch.wanted == RESOLVE_SQUARED_ERRORS) {
        uint64_t bits = f64_bits(film_squared_errors_of(film, at.x, at.y));
        Words result = Words(film.result + item * 8UL);
        result.at[0] = uint(bits);
        result.at[1] = uint(bits >> 32);
    }
}

#endif

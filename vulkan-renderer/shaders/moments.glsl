// Mean and variance of a pixel from the sums of its classes: twin of picture/src/film.rs.
#ifndef MOMENTS_GLSL
#define MOMENTS_GLSL

#include "f64.glsl"
#include "film.glsl"

// Mean of one channel of a pixel, and the variance of that mean.
struct Moments {
    f64 mean;
    f64 variance;
};

// Samples of a pixel, by its number from the upper left. `samples` are those of a pixel that does not rest.
uint film_samples_of(Address resting, uint64_t pixel, uint samples) {
    if (resting == 0UL) {
        return samples;
    }
    uint rested = Words(resting + pixel * 4UL).at[0];
    return rested == 0u ? samples : min(samples, rested);
}

// Sums of a pixel.
Floats film_sums_of(Address sums, uint64_t pixel) {
    return Floats(sums + pixel * uint64_t(4u * STRIDE));
}

// Mean and variance of the mean of one channel of a pixel with `n` samples.
Moments film_moments(Address film_sums, uint64_t pixel, uint channel, uint n) {
    Floats sums = film_sums_of(film_sums, pixel);
    f64 total = f64_from_u32(n);
    f64 sum = F64_ZERO;
    for (uint r = 0u; r < CLASSES; r++) {
        sum = f64_add(sum, f64_from_f32(sums.at[3u * r + channel]));
    }
    f64 mean = f64_div(sum, total);
    f64 spread = F64_ZERO;
    for (uint r = 0u; r < CLASSES; r++) {
        f64 n_of = f64_from_u32((n + CLASSES - 1u - r) / CLASSES);
        f64 d = f64_div(f64_sub(f64_from_f32(sums.at[3u * r + channel]), f64_mul(n_of, mean)), total);
        spread = f64_add(spread, f64_mul(d, d));
    }
    if (n < CLASSES) {
        return Moments(mean, F64_INFINITY);
    }
    return Moments(mean, f64_div(f64_mul(spread, f64_from_u32(CLASSES)), f64_from_u32(CLASSES - 1u)));
}

#endif

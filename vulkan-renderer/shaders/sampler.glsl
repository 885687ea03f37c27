// Sample points: twin of transport/src/sampler.rs.
#ifndef SAMPLER_GLSL
#define SAMPLER_GLSL

#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

const uint REPLICATES = 4u;

// Dimension
const uint DIMENSION_FILM = 0u;
const uint DIMENSION_BOUNCE = 1u;
const uint DIMENSION_LENS = 0xFFFFFFFFu;

// BouncePair
const uint PAIR_LIGHT = 0u;
const uint PAIR_SCATTER = 1u;
const uint PAIR_CHOICE = 2u;
const uint PAIR_ROULETTE = 3u;

const uint PAIRS_A_BOUNCE = 4u;

// Pairs whose first points are distributed over the picture: those below this.
const uint SPREAD = 1u + 2u * PAIRS_A_BOUNCE;

const uint64_t SHARED_BY_PIXELS = 0x8000000000000000UL;

struct PixelSampler {
    uint64_t base;
    uint index;
    // Key that all pixels of a replicate share.
    uint64_t shared_key;
    // The pixel's number along a Z-order curve through the picture.
    uint place;
};

// The 24 high bits as a number in [0, 1).
float unit(uint bits) {
    return float(bits >> 8) * (1.0 / 16777216.0);
}

// Second dimension of the Sobol sequence.
uint sobol_second(uint index) {
    uint x = index;
    x ^= x >> 16;
    x ^= (x >> 8) & 0x00FF00FFu;
    x ^= (x >> 4) & 0x0F0F0F0Fu;
    x ^= (x >> 2) & 0x33333333u;
    x ^= (x >> 1) & 0x55555555u;
    return bitfieldReverse(x);
}

// Nested uniform scramble.
uint owen_scramble(uint value, uint seed) {
    uint x = bitfieldReverse(value);
    x = x + seed;
    x ^= x * 0x6C50B47Cu;
    x ^= x * 0xB82F1E52u;
    x ^= x * 0xC7AFE638u;
    x ^= x * 0x8D22F6E6u;
    return bitfieldReverse(x);
}

// SplitMix64's finaliser.
uint64_t mix64(uint64_t x) {
    x ^= x >> 30;
    x = x * 0xBF58476D1CE4E5B9UL;
    x ^= x >> 27;
    x = x * 0x94D049BB133111EBUL;
    return x ^ (x >> 31);
}

uint z_order_part(uint v) {
    v = v & 0xFFFFu;
    v = (v | (v << 8)) & 0x00FF00FFu;
    v = (v | (v << 4)) & 0x0F0F0F0Fu;
    v = (v | (v << 2)) & 0x33333333u;
    return (v | (v << 1)) & 0x55555555u;
}

// Interleaves the bits of x and y.
uint z_order(uvec2 pixel) {
    return z_order_part(pixel.x) | (z_order_part(pixel.y) << 1);
}

PixelSampler sampler_new(uint64_t seed, uvec2 pixel, uint number) {
    uint64_t replicate = uint64_t(number % REPLICATES) << 34;
    uint64_t word = uint64_t(pixel.x) | (uint64_t(pixel.y) << 17) | replicate;
    uint64_t mixed = mix64(seed);
    uint64_t shared_key = mix64(mixed ^ (replicate | SHARED_BY_PIXELS));
    return PixelSampler(mix64(mixed ^ word), number / REPLICATES, shared_key, z_order(pixel));
}

// Key of one dimension's scramble.
uint64_t key_of(uint64_t base, uint dimension) {
    return mix64(base + uint64_t(dimension) * 0x9E3779B97F4A7C15UL);
}

// Point `index` of the sequence, its order and its digits scrambled by `key`.
uvec2 scrambled_point(uint index, uint64_t key) {
    uint low = uint(key), high = uint(key >> 32);
    index = owen_scramble(index, low);
    uint x = owen_scramble(bitfieldReverse(index), high);
    uint y = owen_scramble(sobol_second(index), ((low << 16) | (low >> 16)) ^ (high * 0x85EBCA6Bu));
    return uvec2(x, y);
}

vec2 sampler_pair(PixelSampler points, uint dimension) {
    uint64_t key = key_of(points.base, dimension);
    uvec2 point = scrambled_point(points.index, key);
    if (dimension < SPREAD) {
        // Moves the first point to its place among the points of the picture.
        point ^= scrambled_point(0u, key) ^ scrambled_point(points.place, key_of(points.shared_key, dimension));
    }
    return vec2(unit(point.x), unit(point.y));
}

// Numbers in [0, 1) for pair `pair` of bounce `bounce`.
vec2 sampler_bounce(PixelSampler points, uint bounce, uint pair) {
    return sampler_pair(points, DIMENSION_BOUNCE + bounce * PAIRS_A_BOUNCE + pair);
}

// Numbers for the position within the film's filter.
vec2 sampler_film(PixelSampler points) {
    return sampler_pair(points, DIMENSION_FILM);
}

// Numbers for the point on the lens aperture.
vec2 sampler_lens(PixelSampler points) {
    return sampler_pair(points, DIMENSION_LENS);
}

#endif

// Sample points: twin of render/src/sampler.rs.
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

struct PixelSampler {
    uint64_t base;
    uint index;
};

// 24 high bits as a number in [0, 1).
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

PixelSampler sampler_new(uint64_t seed, uvec2 pixel, uint number) {
    uint64_t word = uint64_t(pixel.x) | (uint64_t(pixel.y) << 17) | (uint64_t(number % REPLICATES) << 34);
    return PixelSampler(mix64(mix64(seed) ^ word), number / REPLICATES);
}

vec2 sampler_pair(PixelSampler points, uint dimension) {
    uint64_t key = mix64(points.base + uint64_t(dimension) * 0x9E3779B97F4A7C15UL);
    uint low = uint(key), high = uint(key >> 32);
    uint index = owen_scramble(points.index, low);
    uint x = owen_scramble(bitfieldReverse(index), high);
    uint y = owen_scramble(sobol_second(index), ((low << 16) | (low >> 16)) ^ (high * 0x85EBCA6Bu));
    return vec2(unit(x), unit(y));
}

// The pair for `pair` of bounce `bounce`, each number in [0, 1).
vec2 sampler_bounce(PixelSampler points, uint bounce, uint pair) {
    return sampler_pair(points, DIMENSION_BOUNCE + bounce * PAIRS_A_BOUNCE + pair);
}

// The pair for the film.
vec2 sampler_film(PixelSampler points) {
    return sampler_pair(points, DIMENSION_FILM);
}

// The pair for the camera's opening.
vec2 sampler_lens(PixelSampler points) {
    return sampler_pair(points, DIMENSION_LENS);
}

#endif

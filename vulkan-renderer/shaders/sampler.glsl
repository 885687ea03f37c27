// Sample points: twin of transport/src/sampler.rs.
#ifndef SAMPLER_GLSL
#define SAMPLER_GLSL

#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

const uint CLASSES = 4u;

// Dimensions
const uint DIMENSIONS_FILM = 0u;
const uint DIMENSIONS_BOUNCE = 1u;
const uint DIMENSIONS_LENS = 0xFFFFFFFFu;

// BounceSet
const uint SET_LIGHT = 0u;
const uint SET_SCATTER = 1u;
const uint SET_SURVIVAL = 2u;
const uint SET_EMITTER = 3u;

const uint SETS_A_BOUNCE = 4u;

// Sets whose first points are distributed over the picture: those below this.
const uint SPREAD = 1u + 2u * SETS_A_BOUNCE;

// Digits in which the first four points of all pixels differ alike.
const uint SHARED_DIGITS = 0xC0000000u;

const uint64_t SHARED_BY_PIXELS = 0x8000000000000000UL;

struct PixelSampler {
    uint64_t base;
    uint number;
    // Key that all pixels share.
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

// Fourth dimension of the Sobol sequence.
uint sobol_fourth(uint index) {
    uint x = index;
    x ^= (x >> 24) & 0x000000FFu;
    x ^= (x >> 16) & 0x0000FF00u;
    x ^= (x >> 8) & 0x0000F000u;
    x ^= (x >> 12) & 0x00000FFFu;
    x ^= (x >> 8) & 0x00000FF0u;
    x ^= (x >> 4) & 0x000C00C0u;
    x ^= (x >> 6) & 0x3F03F03Fu;
    x ^= (x >> 4) & 0x3C03C03Cu;
    x ^= (x >> 2) & 0x08208208u;
    x ^= (x >> 3) & 0x071C71C7u;
    x ^= (x >> 2) & 0x06186186u;
    x ^= (x >> 1) & 0x49249249u;
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
    uint64_t word = uint64_t(pixel.x) | (uint64_t(pixel.y) << 17);
    uint64_t mixed = mix64(seed);
    return PixelSampler(mix64(mixed ^ word), number, mix64(mixed ^ SHARED_BY_PIXELS), z_order(pixel));
}

// Key of one set's scramble.
uint64_t key_of(uint64_t base, uint set) {
    return mix64(base + uint64_t(set) * 0x9E3779B97F4A7C15UL);
}

// A class times 1, ω or ω², by the key.
uint turned(uint which, uint64_t key) {
    uint low = which & 1u, high = which >> 1;
    uint turns = uint(key >> 32) % 3u;
    return turns == 0u ? which : turns == 1u ? ((low ^ high) << 1) | high : (low << 1) | (low ^ high);
}

// Class of the first of the four points of a block.
uint class_of_block(uint block) {
    uint ones = uint(bitCount(block & 0xDB6DB6DBu)) & 1u;
    uint omegas = uint(bitCount(block & 0x6DB6DB6Du)) & 1u;
    return (omegas << 1) | ones;
}

// Index in the sequence of sample `number`.
uint shuffled(uint number, uint key, uint64_t turn) {
    uint block = owen_scramble(number / CLASSES, key);
    return (block << 2) | (turned(number % CLASSES, turn) ^ class_of_block(block));
}

// Point of sample `number`: its order and its digits scrambled by `key`, but for the digits `kept`; `turn` orders the classes.
uvec3 scrambled_point(uint number, uint64_t key, uint64_t turn, uint kept) {
    uint low = uint(key), high = uint(key >> 32);
    uint index = shuffled(number, low, turn);
    uvec3 point = uvec3(bitfieldReverse(index), sobol_second(index), sobol_fourth(index));
    uint second = ((low << 16) | (low >> 16)) ^ (high * 0x85EBCA6Bu);
    uint third = ((high << 16) | (high >> 16)) ^ (low * 0xC2B2AE35u);
    uvec3 scrambled = uvec3(owen_scramble(point.x, high), owen_scramble(point.y, second), owen_scramble(point.z, third));
    return (point & kept) | (scrambled & ~kept);
}

vec3 sampler_set(PixelSampler points, uint set) {
    uint64_t key = key_of(points.base, set);
    uvec3 point;
    if (set < SPREAD) {
        // Moves the first point to its place among the points of the picture.
        uint64_t of_all = key_of(points.shared_key, set);
        point = scrambled_point(points.number, key, of_all, SHARED_DIGITS);
        point ^= scrambled_point(0u, key, of_all, SHARED_DIGITS) ^ scrambled_point(points.place, of_all, of_all, 0u);
    } else {
        point = scrambled_point(points.number, key, key, 0u);
    }
    return vec3(unit(point.x), unit(point.y), unit(point.z));
}

// Numbers in [0, 1) for set `set` of bounce `bounce`.
vec3 sampler_bounce(PixelSampler points, uint bounce, uint set) {
    return sampler_set(points, DIMENSIONS_BOUNCE + bounce * SETS_A_BOUNCE + set);
}

// Numbers for the position within the film's filter.
vec2 sampler_film(PixelSampler points) {
    return sampler_set(points, DIMENSIONS_FILM).xy;
}

// Numbers for the point on the lens aperture.
vec2 sampler_lens(PixelSampler points) {
    return sampler_set(points, DIMENSIONS_LENS).xy;
}

#endif

// Runs one function on rows of words, for the tests that compare it with its twin. The numbers are those of tests/twins.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "launch.glsl"
#include "f64.glsl"
#include "sampler.glsl"
#include "filter.glsl"

layout(constant_id = 0) const uint FUNCTION = 0u;

layout(local_size_x = 64) in;

// Places of the next word to read and to write.
uint in_at;
uint out_at;

uint take() {
    uint word = Words(launch.source).at[in_at];
    in_at += 1u;
    return word;
}

uint64_t take64() {
    uint low = take();
    return uint64_t(low) | (uint64_t(take()) << 32);
}

float take_float() {
    return uintBitsToFloat(take());
}

f64 take_f64() {
    return f64_from_bits(take64());
}

void put(uint word) {
    Words(launch.target).at[out_at] = word;
    out_at += 1u;
}

void put64(uint64_t v) {
    put(uint(v));
    put(uint(v >> 32));
}

void put_float(float v) {
    put(floatBitsToUint(v));
}

void put_f64(f64 v) {
    put64(f64_bits(v));
}

void begin(uint row, uint words_in, uint words_out) {
    in_at = row * words_in;
    out_at = row * words_out;
}

void probe_f64(uint row) {
    begin(row, 5u, 23u);
    f64 a = take_f64(), b = take_f64();
    uint c = take();
    put_f64(f64_add(a, b));
    put_f64(f64_sub(a, b));
    put_f64(f64_mul(a, b));
    put_f64(f64_div(a, b));
    put_f64(f64_sqrt(a));
    put_f64(f64_floor(a));
    put_f64(f64_from_u32(c));
    put_f64(f64_from_f32(uintBitsToFloat(c)));
    put_f64(f64_max(a, b));
    put_float(f64_to_f32(a));
    put(f64_to_u32(a));
    put(f64_lt(a, b) ? 1u : 0u);
    put(f64_le(a, b) ? 1u : 0u);
    put(f64_eq(a, b) ? 1u : 0u);
}

void probe_sampler(uint row) {
    begin(row, 7u, 4u);
    uint64_t seed = take64();
    uint x = take(), y = take();
    PixelSampler points = sampler_new(seed, uvec2(x, y), take());
    uint bounce = take();
    vec2 u = sampler_bounce(points, bounce, take());
    vec2 film = sampler_film(points);
    put_float(u.x);
    put_float(u.y);
    put_float(film.x);
    put_float(film.y);
}

void probe_filter(uint row) {
    begin(row, 1u, 1u);
    put_float(filter_sample(SceneRef(launch.scene).it.film_filter, take_float()));
}

void main() {
    uint row = gl_GlobalInvocationID.x;
    if (row >= launch.count) {
        return;
    }
    switch (FUNCTION) {
    case 0u:
        probe_f64(row);
        break;
    case 1u:
        probe_sampler(row);
        break;
    case 2u:
        probe_filter(row);
        break;
    }
}

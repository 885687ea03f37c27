// Reads a row of words and writes one, for the tests that compare functions with their twins.
#ifndef PROBE_WORDS_GLSL
#define PROBE_WORDS_GLSL

#include "dvec3.glsl"
#include "launch.glsl"

// Positions of the next word to read and of the next word to write.
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

DVec3 take_dvec3() {
    f64 x = take_f64(), y = take_f64();
    return dvec3_of(x, y, take_f64());
}

vec2 take_vec2() {
    float x = take_float();
    return vec2(x, take_float());
}

vec3 take_vec3() {
    vec2 xy = take_vec2();
    return vec3(xy, take_float());
}

void put_dvec3(DVec3 v) {
    put_f64(v.at[0]);
    put_f64(v.at[1]);
    put_f64(v.at[2]);
}

void put_vec3(vec3 v) {
    put_float(v.x);
    put_float(v.y);
    put_float(v.z);
}

#endif

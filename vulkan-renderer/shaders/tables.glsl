// Albedo of GGX surfaces: twin of transport/src/bsdf/tables.rs, which says what each table is.
#ifndef TABLES_GLSL
#define TABLES_GLSL

#include "layout.glsl"

const uint REFLECTION = 0u;
const uint REFLECTION_AVERAGE = 1024u;
const uint FRESNEL_SHARE = 1056u;
const uint GLASS = 5152u;
const uint GLASS_AVERAGE = 9248u;
const uint INSIDE = 4352u;
const uint SHEEN = 13856u;
const uint SHEEN_ENTRIES = 1024u;

float table_1d(Address tables, uint at, uint n, float x) {
    x = clamp(x, 0.0, 1.0) * float(n - 1u);
    uint i = min(uint(x), n - 2u);
    float t = x - float(i);
    Floats all = Floats(tables);
    return all.at[at + i] * (1.0 - t) + all.at[at + i + 1u] * t;
}

float table_2d(Address tables, uint at, uint n, float x, float y) {
    y = clamp(y, 0.0, 1.0) * float(n - 1u);
    uint i = min(uint(y), n - 2u);
    float t = y - float(i);
    return table_1d(tables, at + i * n, n, x) * (1.0 - t) + table_1d(tables, at + (i + 1u) * n, n, x) * t;
}

float table_3d(Address tables, uint at, uint n, float x, float y, float z) {
    z = clamp(z, 0.0, 1.0) * float(n - 1u);
    uint i = min(uint(z), n - 2u);
    float t = z - float(i);
    return table_2d(tables, at + i * n * n, n, x, y) * (1.0 - t) + table_2d(tables, at + (i + 1u) * n * n, n, x, y) * t;
}

// Table coordinate of a refractive index.
float index_place(float eta) {
    return sqrt(abs(eta - 1.0) / (eta + 1.0));
}

// Ratio of the light that a rough surface reflects by all scatterings to that of the first alone.
vec3 gain(vec3 once, float kept, float kept_average) {
    vec3 further = once * kept_average / (vec3(1.0) - once * (1.0 - kept_average));
    return vec3(1.0) + further * ((1.0 - kept) / kept);
}

#endif

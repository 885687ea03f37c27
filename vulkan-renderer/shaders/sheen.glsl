// Sheen, fibres that stand on a surface: twin of transport/src/bsdf/sheen.rs, which explains it.
#ifndef SHEEN_GLSL
#define SHEEN_GLSL

#include "layout.glsl"
#include "tables.glsl"
#include "trigonometry.glsl"

const float LEAST_ENTRY = 1e-5;
const float LEAST_ROUGHNESS = 1e-3;

struct Sheen {
    vec3 albedo;
    float a;
    float b;
};

// For a surface without sheen.
Sheen no_sheen() {
    return Sheen(vec3(0.0), 1.0, 0.0);
}

// The sheen of m seen at this cosine; `left` is the fraction of light that remains for everything below it.
Sheen sheen_new(Address tables, Material m, float cosine, out float left) {
    float roughness = max(m.sheen_roughness, LEAST_ROUGHNESS);
    float a = table_2d(tables, SHEEN, 32u, cosine, roughness);
    float b = table_2d(tables, SHEEN + SHEEN_ENTRIES, 32u, cosine, roughness);
    float reflected = table_2d(tables, SHEEN + 2u * SHEEN_ENTRIES, 32u, cosine, roughness);
    left = 1.0;
    if (a < LEAST_ENTRY || reflected < LEAST_ENTRY) {
        return no_sheen();
    }
    vec3 albedo = m.sheen * reflected * vec3(m.sheen_tint[0], m.sheen_tint[1], m.sheen_tint[2]);
    left = clamp(1.0 - max(max(albedo.x, albedo.y), albedo.z), 0.0, 1.0);
    return Sheen(albedo, a, b);
}

// Direction of the viewer along the surface; arbitrary where the viewer is straight above.
vec2 viewer_side(vec3 wi) {
    float r = sqrt(wi.x * wi.x + wi.y * wi.y);
    return r > 0.0 ? wi.xy / r : vec2(1.0, 0.0);
}

// Density of sheen_sample above the surface; the reflected light is the albedo times that.
float sheen_pdf(Sheen sheen, vec3 wi, vec3 wo) {
    vec2 side = viewer_side(wi);
    float x = wo.x * side.x + wo.y * side.y, y = wo.y * side.x - wo.x * side.y;
    x = sheen.a * x + sheen.b * wo.z;
    y = sheen.a * y;
    float factor = sheen.a / (x * x + y * y + wo.z * wo.z);
    return FRAC_1_PI * wo.z * (factor * factor);
}

// Samples a direction, given one with density cos / π.
vec3 sheen_sample(Sheen sheen, vec3 wi, vec3 cosine) {
    vec2 side = viewer_side(wi);
    float x = cosine.x - sheen.b * cosine.z, y = cosine.y;
    return normalized(vec3(x * side.x - y * side.y, x * side.y + y * side.x, sheen.a * cosine.z));
}

#endif

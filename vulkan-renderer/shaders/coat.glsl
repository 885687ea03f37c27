// Coat and sheen on top of a surface: twin of transport/src/bsdf/coat.rs, which explains it.
#ifndef COAT_GLSL
#define COAT_GLSL

#include "layout.glsl"
#include "needs.glsl"
#include "fresnel.glsl"
#include "ggx.glsl"
#include "tables.glsl"
#include "sheen.glsl"

// Lobes with a smaller α² are mirrors.
const float LEAST_ALPHA_SQUARED = 2e-10;

struct Coat {
    float weight;
    float alpha;
    float eta;
    float albedo;
};

// The coat of m seen at this cosine; `below` is the fraction of light that remains for everything below it.
Coat coat_new(Address tables, Material m, float cosine, out vec3 below) {
    float eta = m.coat_ior, f0 = f0_from_ior(m.coat_ior);
    float kept = table_2d(tables, REFLECTION, 32u, m.coat_roughness, cosine);
    float average = table_1d(tables, REFLECTION_AVERAGE, 32u, m.coat_roughness);
    float more = gain(vec3(fresnel_dielectric_average(eta)), kept, average).x;
    float share = table_3d(tables, FRESNEL_SHARE, 16u, m.coat_roughness, cosine, index_place(eta));
    float layer = eta > 1.0 ? m.coat * more * kept * (f0 + (1.0 - f0) * share) : 0.0;
    Coat coat = Coat(eta > 1.0 ? m.coat * more : 0.0, m.coat_roughness * m.coat_roughness, eta, layer);
    float cos_t = sqrt(max(1.0 - (1.0 - cosine * cosine) / (eta * eta), 1e-6));
    vec3 tint = vec3(m.coat_tint[0], m.coat_tint[1], m.coat_tint[2]);
    below = (vec3(1.0) + m.coat * (pow(tint, vec3(1.0 / cos_t)) - vec3(1.0))) * clamp(1.0 - layer, 0.0, 1.0);
    return coat;
}

Coat no_coat() {
    return Coat(0.0, 0.0, 1.0, 0.0);
}

bool coat_is_mirror(Coat coat) {
    return coat.alpha * coat.alpha <= LEAST_ALPHA_SQUARED;
}

// What a microfacet reflects at the cosine of wi with it.
vec3 coat_reflectance(Coat coat, float cosine) {
    return vec3(coat.weight * fresnel_dielectric(cosine, coat.eta));
}

// f · cos and the density of coat_sample.
vec3 coat_eval(Coat coat, vec3 wi, vec3 wo, out float pdf) {
    vec3 h = normalized(wi + wo);
    float d = ggx_d(h, coat.alpha), lambda_i = lambda(wi, coat.alpha), lambda_o = lambda(wo, coat.alpha);
    float common_part = d / (4.0 * wi.z);
    pdf = common_part / (1.0 + lambda_i);
    return coat_reflectance(coat, dot(wi, h)) * (common_part / (1.0 + lambda_i + lambda_o));
}

// Samples a reflected direction; a z below 0 marks failure.
vec3 coat_sample(Coat coat, vec3 wi, vec2 u) {
    vec3 h = sample_visible_normal(wi, coat.alpha, u);
    return 2.0 * dot(wi, h) * h - wi;
}

// The sheen of m seen at the first cosine, its coat at the second, and the fraction of light that remains below both.
void coat_and_sheen(Address tables, Material m, float cosine, float coat_cosine, out Sheen sheen, out Coat coat, out vec3 below) {
    float left = 1.0;
    sheen = no_sheen();
    if (NEEDS_SHEEN != 0u && m.sheen > 0.0) {
        sheen = sheen_new(tables, m, cosine, left);
    }
    coat = no_coat();
    below = vec3(1.0);
    if (NEEDS_COAT != 0u && m.coat > 0.0) {
        coat = coat_new(tables, m, coat_cosine, below);
    }
    coat.weight *= left;
    coat.albedo *= left;
    below *= left;
}

// Light that a surface emits at this cosine, reduced by coat and sheen.
vec3 emitted(Address tables, Material m, float cosine) {
    vec3 light = vec3(m.emission[0], m.emission[1], m.emission[2]);
    bool covered = (NEEDS_COAT != 0u && m.coat > 0.0) || (NEEDS_SHEEN != 0u && m.sheen > 0.0);
    if (covered && light != vec3(0.0)) {
        Sheen sheen;
        Coat coat;
        vec3 below;
        coat_and_sheen(tables, m, cosine, cosine, sheen, coat, below);
        light *= below;
    }
    return light;
}

#endif

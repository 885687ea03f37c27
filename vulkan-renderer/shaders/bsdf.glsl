// How a surface scatters: twin of cpu-renderer/src/bsdf.rs, which explains it.
#ifndef BSDF_GLSL
#define BSDF_GLSL

#include "layout.glsl"
#include "needs.glsl"
#include "trigonometry.glsl"

const float LEAST_ALPHA = 1e-4;

struct Bsdf {
    vec3 wi;
    float alpha;
    vec3 diffuse;
    vec3 metal_f0;
    float metallic;
    float dielectric_f0;
    float specular_chance;
};

// Density 0: the sampled microfacet sends light below the surface.
struct BsdfSample {
    vec3 wo;
    vec3 weight;
    float pdf;
};

// Rec. 709 luminance.
float luminance(vec3 c) {
    return dot(c, vec3(0.2126, 0.7152, 0.0722));
}

float pow5(float x) {
    float x2 = x * x;
    return x2 * x2 * x;
}

// Not GLSL's normalize: it may be wrong by several units in the last place, and of a vector whose squares are tiny it may be 0.
vec3 normalized(vec3 v) {
    return v * (1.0 / sqrt(dot(v, v)));
}

const uint ALBEDO_TABLE = 32u;

float albedo_at(Address table, uint r, uint c, float f0) {
    Floats t = Floats(table);
    uint at = 2u * (r * ALBEDO_TABLE + c);
    return f0 * t.at[at] + t.at[at + 1u];
}

// Albedo of the GGX layer with Schlick's Fresnel.
float albedo_get(Address table, float cosine, float roughness, float f0) {
    float place_c = clamp(cosine, 0.0, 1.0) * float(ALBEDO_TABLE - 1u);
    float place_r = clamp(roughness, 0.0, 1.0) * float(ALBEDO_TABLE - 1u);
    uint c = min(uint(place_c), ALBEDO_TABLE - 2u), r = min(uint(place_r), ALBEDO_TABLE - 2u);
    float fc = place_c - float(c), fr = place_r - float(r);
    float low = albedo_at(table, r, c, f0) * (1.0 - fc) + albedo_at(table, r, c + 1u, f0) * fc;
    float high = albedo_at(table, r + 1u, c, f0) * (1.0 - fc) + albedo_at(table, r + 1u, c + 1u, f0) * fc;
    return low * (1.0 - fr) + high * fr;
}

// The surface m seen from wi (local, z > 0).
Bsdf bsdf_new(Address albedo, Material m, vec3 wi) {
    Bsdf b;
    vec3 base = vec3(m.base_color[0], m.base_color[1], m.base_color[2]);
    float ratio = (m.ior - 1.0) / (m.ior + 1.0);
    b.wi = wi;
    b.alpha = max(m.roughness * m.roughness, LEAST_ALPHA);
    b.dielectric_f0 = min(ratio * ratio * 2.0 * m.specular, 1.0);
    float layer_albedo = NEEDS_LOBES != 0u && b.dielectric_f0 > 0.0 ? albedo_get(albedo, wi.z, m.roughness, b.dielectric_f0) : 0.0;
    b.diffuse = base * ((1.0 - m.metallic) * (1.0 - layer_albedo));
    b.metal_f0 = base;
    b.metallic = m.metallic;
    float specular = m.metallic * luminance(base) + (1.0 - m.metallic) * layer_albedo;
    float total = specular + luminance(b.diffuse);
    b.specular_chance = specular <= 0.0 ? 0.0 : clamp(specular / total, 0.1, 1.0);
    return b;
}

// Whether a sampled direction depends on the choice of a lobe.
bool has_two_lobes(Bsdf b) {
    return b.specular_chance > 0.0 && b.specular_chance < 1.0;
}

float ggx_d(vec3 h, float alpha) {
    float a2 = alpha * alpha;
    float t = h.x * h.x + h.y * h.y + a2 * h.z * h.z;
    return a2 / (PI * t * t);
}

// Smith's Λ.
float lambda(vec3 w, float alpha) {
    float tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
    return (sqrt(1.0 + alpha * alpha * tan2) - 1.0) / 2.0;
}

// Schlick 1994 for both layers.
vec3 fresnel(Bsdf b, float cosine) {
    float s = pow5(1.0 - clamp(cosine, 0.0, 1.0));
    vec3 f = (b.metal_f0 + (vec3(1.0) - b.metal_f0) * s) * b.metallic;
    if (b.dielectric_f0 > 0.0) {
        f += (b.dielectric_f0 + (1.0 - b.dielectric_f0) * s) * (1.0 - b.metallic);
    }
    return f;
}

// f · cos and the density of bsdf_sample, for a direction on the side of wi; zero below.
vec3 bsdf_eval(Bsdf b, vec3 wo, out float pdf) {
    pdf = 0.0;
    if (wo.z <= 0.0 || b.wi.z <= 0.0) {
        return vec3(0.0);
    }
    vec3 f = b.diffuse * (wo.z * FRAC_1_PI);
    pdf = (1.0 - b.specular_chance) * wo.z * FRAC_1_PI;
    if (NEEDS_LOBES != 0u && b.specular_chance > 0.0) {
        vec3 h = normalized(b.wi + wo);
        float d = ggx_d(h, b.alpha), lambda_i = lambda(b.wi, b.alpha), lambda_o = lambda(wo, b.alpha);
        float d_g = d / (4.0 * b.wi.z * (1.0 + lambda_i + lambda_o));
        f += fresnel(b, dot(b.wi, h)) * d_g;
        pdf += b.specular_chance * d / (4.0 * b.wi.z * (1.0 + lambda_i));
    }
    return f;
}

// Cosine-distributed direction (Malley), disk by concentric map.
vec3 sample_cosine(vec2 u) {
    float x = 2.0 * u.x - 1.0, y = 2.0 * u.y - 1.0;
    if (x == 0.0 && y == 0.0) {
        return vec3(0.0, 0.0, 1.0);
    }
    bool wide = abs(x) > abs(y);
    float r = wide ? x : y;
    float angle = wide ? PI / 4.0 * (y / x) : PI / 2.0 - PI / 4.0 * (x / y);
    vec2 sc = sin_cos(angle);
    return vec3(r * sc.y, r * sc.x, sqrt(max(1.0 - r * r, 0.0)));
}

vec3 sample_visible_normal(vec3 wi, float alpha, vec2 u) {
    vec3 v = normalized(vec3(alpha * wi.x, alpha * wi.y, wi.z));
    float len2 = v.x * v.x + v.y * v.y;
    vec3 t1 = len2 > 0.0 ? vec3(-v.y, v.x, 0.0) / sqrt(len2) : vec3(1.0, 0.0, 0.0);
    vec3 t2 = cross(v, t1);
    float r = sqrt(u.x);
    vec2 sc = sin_cos(2.0 * PI * u.y);
    float p1 = r * sc.y;
    float s = 0.5 * (1.0 + v.z);
    float p2 = (1.0 - s) * sqrt(max(1.0 - p1 * p1, 0.0)) + s * r * sc.x;
    vec3 n = t1 * p1 + t2 * p2 + v * sqrt(max(1.0 - p1 * p1 - p2 * p2, 0.0));
    return normalized(vec3(alpha * n.x, alpha * n.y, max(n.z, 0.0)));
}

// A direction with density as bsdf_eval says.
BsdfSample bsdf_sample(Bsdf b, vec2 u, float choice) {
    vec3 wo;
    if (NEEDS_LOBES != 0u && choice < b.specular_chance) {
        vec3 h = sample_visible_normal(b.wi, b.alpha, u);
        wo = 2.0 * dot(b.wi, h) * h - b.wi;
    } else {
        wo = sample_cosine(u);
    }
    float pdf;
    vec3 f = bsdf_eval(b, wo, pdf);
    if (!(pdf > 0.0) || isinf(pdf)) {
        return BsdfSample(wo, vec3(0.0), 0.0);
    }
    return BsdfSample(wo, f / pdf, pdf);
}

#endif

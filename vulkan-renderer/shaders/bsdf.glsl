// How a surface scatters: twin of transport/src/bsdf.rs, which explains it.
#ifndef BSDF_GLSL
#define BSDF_GLSL

#include "layout.glsl"
#include "needs.glsl"
#include "trigonometry.glsl"
#include "fresnel.glsl"
#include "ggx.glsl"
#include "tables.glsl"
#include "coat.glsl"
#include "specular_normal.glsl"

const float LEAST_BEND = 1e-4;
const float LEAST_VIEW = 1e-6;
const float LEAST_SHARE = 0.1;

// Density of the only direction of a mirror.
const float MIRROR_PDF = 1.0 / 0.0;

struct Bsdf {
    vec3 wi;
    vec3 shading_wi;
    SpecularNormal specular_normal;
    float alpha;
    vec3 diffuse;
    vec3 metal;
    vec3 metal_f0;
    vec3 metal_b;
    vec3 specular;
    vec3 specular_f0;
    float specular_eta;
    vec3 glass;
    vec3 glass_f0;
    vec3 glass_tint;
    float glass_eta;
    Coat coat;
    Sheen sheen;
    float microfacet_probability;
    float coat_probability;
    float sheen_probability;
    float diffuse_probability;
};

// A density of 0 marks a failed sample: the sampled microfacet sends light to the wrong side.
struct BsdfSample {
    vec3 wo;
    bool through;
    vec3 weight;
    float pdf;
};

// Rec. 709 luminance.
float luminance(vec3 c) {
    return dot(c, vec3(0.2126, 0.7152, 0.0722));
}

float max_element(vec3 v) {
    return max(max(v.x, v.y), v.z);
}

// Interpolates from f0 towards white.
vec3 share_to_white(vec3 f0, float share) {
    return f0 + (vec3(1.0) - f0) * share;
}

// Average of fresnel_share over the cosine-weighted hemisphere.
float average_share(float eta) {
    float f0 = f0_from_ior(eta);
    return clamp((fresnel_dielectric_average(eta) - f0) / (1.0 - f0), 0.0, 1.0);
}

// Probability of reflection where a microfacet both reflects and transmits.
float share_reflected(vec3 reflected, vec3 passed) {
    float below = luminance(passed);
    return below > 0.0 ? luminance(reflected) / (luminance(reflected) + below) : 1.0;
}

Bsdf bsdf_nothing(vec3 wi, float alpha) {
    Bsdf b;
    b.wi = wi;
    b.shading_wi = wi;
    b.specular_normal = no_specular_normal();
    b.alpha = alpha;
    b.diffuse = vec3(0.0);
    b.metal = vec3(0.0);
    b.metal_f0 = vec3(0.0);
    b.metal_b = vec3(0.0);
    b.specular = vec3(0.0);
    b.specular_f0 = vec3(0.0);
    b.specular_eta = 1.0;
    b.glass = vec3(0.0);
    b.glass_f0 = vec3(0.0);
    b.glass_tint = vec3(0.0);
    b.glass_eta = 1.0;
    b.coat = no_coat();
    b.sheen = no_sheen();
    b.microfacet_probability = 0.0;
    b.coat_probability = 0.0;
    b.sheen_probability = 0.0;
    b.diffuse_probability = 0.0;
    return b;
}

// Whether light passes through the surface.
bool bsdf_transmits(Bsdf b) {
    return NEEDS_GLASS != 0u && b.glass != vec3(0.0);
}

bool bsdf_is_mirror(Bsdf b) {
    return b.alpha * b.alpha <= LEAST_ALPHA_SQUARED;
}

// Adds glass of this weight.
void set_glass(inout Bsdf b, Address tables, Material m, vec3 base, vec3 tint, vec3 weight, bool from_inside) {
    b.glass_eta = from_inside ? 1.0 / m.ior : m.ior;
    b.glass_f0 = min(f0_from_ior(m.ior) * tint, vec3(1.0));
    b.glass_tint = sqrt(base);
    b.glass = weight;
    if (m.multiscatter != 0u) {
        uint side = from_inside ? INSIDE : 0u;
        float place = index_place(m.ior);
        float kept = table_3d(tables, GLASS + side, 16u, m.roughness, b.wi.z, place);
        float average = table_2d(tables, GLASS_AVERAGE + side, 16u, m.roughness, place);
        vec3 once =
            b.glass_tint == vec3(0.0) ? share_to_white(b.glass_f0, average_share(b.glass_eta)) : b.glass_tint;
        b.glass *= gain(once, kept, average);
    }
}

// Sets the probability of each lobe, proportional to what it reflects.
void choose(inout Bsdf b, float microfacets) {
    float coat = b.coat.albedo, sheen = luminance(b.sheen.albedo), diffuse = luminance(b.diffuse);
    float least = LEAST_SHARE * (microfacets + coat + sheen + diffuse);
    microfacets = microfacets > 0.0 ? max(microfacets, least) : 0.0;
    coat = coat > 0.0 ? max(coat, least) : 0.0;
    sheen = sheen > 0.0 ? max(sheen, least) : 0.0;
    float total = microfacets + coat + sheen + diffuse;
    if (total > 0.0) {
        b.microfacet_probability = microfacets / total;
        b.coat_probability = coat / total;
        b.sheen_probability = sheen / total;
        b.diffuse_probability = diffuse / total;
    }
}

Bsdf bsdf_made(Address tables, Material m, vec3 wi, vec3 shading_wi, bool from_inside) {
    Bsdf b = bsdf_nothing(wi, m.roughness * m.roughness);
    b.shading_wi = shading_wi;
    vec3 base = vec3(m.base_color[0], m.base_color[1], m.base_color[2]);
    vec3 tint = vec3(m.specular_tint[0], m.specular_tint[1], m.specular_tint[2]);
    vec3 weight;
    // Coat and sheen lie on top.
    coat_and_sheen(tables, m, shading_wi.z, wi.z, b.sheen, b.coat, weight);
    if (NEEDS_LOBES == 0u) {
        b.diffuse = weight * base;
        choose(b, 0.0);
        return b;
    }
    float kept = 1.0, kept_average = 1.0;
    if (m.multiscatter != 0u) {
        kept = table_2d(tables, REFLECTION, 32u, m.roughness, wi.z);
        kept_average = table_1d(tables, REFLECTION_AVERAGE, 32u, m.roughness);
    }
    float shine = 0.0, gloss = 0.0;

    // Metal.
    if (m.metallic > 0.0) {
        b.metal_f0 = base;
        b.metal_b = f82_b(base, tint);
        vec3 reflected = fresnel_f82_average(base, b.metal_b);
        b.metal = weight * m.metallic * gain(reflected, kept, kept_average);
        gloss += luminance(b.metal * reflected);
        weight *= 1.0 - m.metallic;
    }

    // Glass.
    if (NEEDS_GLASS != 0u && m.transmission > 0.0) {
        set_glass(b, tables, m, base, tint, weight * m.transmission, from_inside);
        gloss += luminance(b.glass);
        weight *= 1.0 - m.transmission;
    }

    // The dielectric layer, and the light that passes it.
    float f0 = f0_from_ior(m.ior);
    float eta = m.ior;
    if (m.specular != 0.5) {
        f0 *= 2.0 * m.specular;
        eta = ior_from_f0(f0);
    }
    if (eta != 1.0 && max_element(weight) > 0.0) {
        b.specular_f0 = min(f0 * tint, vec3(1.0));
        b.specular_eta = eta;
        vec3 reflected = share_to_white(b.specular_f0, average_share(eta));
        vec3 more = gain(reflected, kept, kept_average);
        float share = table_3d(tables, FRESNEL_SHARE, 16u, m.roughness, wi.z, index_place(eta));
        vec3 layer = more * kept * share_to_white(b.specular_f0, share);
        b.specular = weight * more;
        shine = luminance(weight * layer);
        weight *= clamp(1.0 - max_element(layer), 0.0, 1.0);
    }
    b.diffuse = weight * base;
    choose(b, gloss + shine);
    return b;
}

// The surface m seen from wi (local, z > 0); from_inside says that this is the side where the material is.
Bsdf bsdf_new(Address tables, Material m, vec3 wi, bool from_inside) {
    return bsdf_made(tables, m, wi, wi, from_inside);
}

// As bsdf_new, with a shading normal other than the geometric one: wi, of any z, and tilt are in the shading normal's frame.
Bsdf bsdf_with_specular_normal(Address tables, Material m, vec3 wi, SpecularNormal specular_normal, bool from_inside) {
    vec3 to = to_microfacets(specular_normal, wi);
    bool is_seen = to.z > 0.0;
    to.z = max(to.z, LEAST_VIEW);
    wi.z = max(wi.z, LEAST_VIEW);
    Bsdf b = bsdf_made(tables, m, to, wi, from_inside);
    b.specular_normal = specular_normal;
    if (is_seen) {
        return b;
    }
    // The shading normal is on the far side of the surface, so specular reflection is not seen.
    b.metal = b.specular = b.glass = vec3(0.0);
    b.coat = no_coat();
    b.microfacet_probability = b.coat_probability = 0.0;
    choose(b, 0.0);
    return b;
}

// Fraction of f, the value of bsdf_eval for wo, that is diffuse: Lambert's and the sheen's. 0 where f is 0.
vec3 diffuse_share(Bsdf b, vec3 wo, vec3 f) {
    if (wo.z <= 0.0) {
        return vec3(0.0);
    }
    vec3 diffuse = b.diffuse * (wo.z * FRAC_1_PI);
    if (NEEDS_SHEEN != 0u && b.sheen_probability > 0.0) {
        diffuse += b.sheen.albedo * sheen_pdf(b.sheen, b.shading_wi, wo);
    }
    return vec3(f.x > 0.0 ? min(diffuse.x / f.x, 1.0) : 0.0, f.y > 0.0 ? min(diffuse.y / f.y, 1.0) : 0.0,
        f.z > 0.0 ? min(diffuse.z / f.z, 1.0) : 0.0);
}

// Approximate fraction of uniform light that the lobes of m scatter: diffuse, glossy, transmission. Above 0 wherever such light can occur.
void bsdf_colors(Bsdf b, Address tables, Material m, out vec3 colors[3]) {
    vec3 glossy = vec3(b.coat.albedo), transmission = vec3(0.0);
    if (NEEDS_LOBES != 0u) {
        float kept = m.multiscatter != 0u ? table_2d(tables, REFLECTION, 32u, m.roughness, b.wi.z) : 1.0;
        glossy += b.metal * fresnel_f82_average(b.metal_f0, b.metal_b) * kept;
        if (b.specular != vec3(0.0)) {
            glossy += b.specular * share_to_white(b.specular_f0, average_share(b.specular_eta)) * kept;
        }
    }
    if (bsdf_transmits(b)) {
        uint side = b.glass_eta < 1.0 ? INSIDE : 0u;
        float kept =
            m.multiscatter != 0u ? table_3d(tables, GLASS + side, 16u, m.roughness, b.wi.z, index_place(m.ior)) : 1.0;
        vec3 reflected = share_to_white(b.glass_f0, average_share(b.glass_eta));
        glossy += b.glass * reflected * kept;
        transmission = b.glass * (vec3(1.0) - reflected) * b.glass_tint * kept;
    }
    colors = vec3[3](b.diffuse + b.sheen.albedo, glossy, transmission);
}

// What a microfacet reflects, and what it transmits, at the cosine of wi with it.
vec3 bsdf_reflectance(Bsdf b, float cosine, out vec3 passed) {
    vec3 reflected = b.metal * fresnel_f82(cosine, b.metal_f0, b.metal_b);
    if (b.specular != vec3(0.0)) {
        float share = fresnel_share(cosine, b.specular_eta, f0_from_ior(b.specular_eta));
        reflected += b.specular * share_to_white(b.specular_f0, share);
    }
    passed = vec3(0.0);
    if (bsdf_transmits(b)) {
        float share = fresnel_share(cosine, b.glass_eta, f0_from_ior(b.glass_eta));
        vec3 glass = share_to_white(b.glass_f0, share);
        reflected += b.glass * glass;
        passed = b.glass * (vec3(1.0) - glass) * b.glass_tint;
    }
    return reflected;
}

// f · |cos| of the microfacets and their part of the density, where h is the half vector that sends light from wi to wo.
vec3 microfacets(Bsdf b, vec3 h, vec3 wo, out float pdf) {
    float cosine = dot(b.wi, h);
    vec3 passed;
    vec3 f = bsdf_reflectance(b, cosine, passed);
    float probability = share_reflected(f, passed);
    float d = ggx_d(h, b.alpha), lambda_i = lambda(b.wi, b.alpha), lambda_o = lambda(wo, b.alpha);
    float per_normal = 0.25;
    if (NEEDS_GLASS != 0u && wo.z <= 0.0) {
        float cos_o = dot(wo, h);
        float x = cosine / b.glass_eta + cos_o;
        f = passed;
        probability = 1.0 - probability;
        per_normal = abs(cosine * cos_o) / (x * x);
    }
    float common_part = d * per_normal / b.wi.z;
    pdf = b.microfacet_probability * probability * common_part / (1.0 + lambda_i);
    return f * (common_part / (1.0 + lambda_i + lambda_o));
}

// Adds the lobes without microfacets, and the coat, for wo above the surface; `to` is that direction for the coat.
void add_others(Bsdf b, vec3 wo, vec3 to, inout vec3 f, inout float pdf) {
    if (wo.z <= 0.0) {
        return;
    }
    f += b.diffuse * (wo.z * FRAC_1_PI);
    pdf += b.diffuse_probability * wo.z * FRAC_1_PI;
    if (NEEDS_COAT != 0u && b.coat_probability > 0.0 && !coat_is_mirror(b.coat) && to.z > 0.0) {
        float coat_pdf;
        f += coat_eval(b.coat, b.wi, to, coat_pdf);
        pdf += b.coat_probability * coat_pdf;
    }
    if (NEEDS_SHEEN != 0u && b.sheen_probability > 0.0) {
        float density = sheen_pdf(b.sheen, b.shading_wi, wo);
        f += b.sheen.albedo * density;
        pdf += b.sheen_probability * density;
    }
}

// bsdf_eval for a direction through the surface.
vec3 eval_below(Bsdf b, vec3 wo, out float pdf) {
    pdf = 0.0;
    if (bsdf_is_mirror(b) || abs(b.glass_eta - 1.0) < LEAST_BEND) {
        return vec3(0.0);
    }
    vec3 h = -normalized(b.wi + b.glass_eta * wo);
    h = h.z < 0.0 ? -h : h;
    // No microfacet that is visible from both sides refracts one direction into the other.
    if (dot(b.wi, h) <= 0.0 || dot(wo, h) >= 0.0) {
        return vec3(0.0);
    }
    return microfacets(b, h, wo, pdf);
}

// f · |cos| and the density of bsdf_sample, for any direction; zero below a surface that does not transmit.
vec3 bsdf_eval(Bsdf b, vec3 wo, out float pdf) {
    pdf = 0.0;
    if (b.wi.z <= 0.0 || wo.z == 0.0) {
        return vec3(0.0);
    }
    vec3 to = to_microfacets(b.specular_normal, wo);
    if (wo.z < 0.0) {
        if (bsdf_transmits(b) && to.z < 0.0) {
            return eval_below(b, to, pdf);
        }
        return vec3(0.0);
    }
    vec3 f = vec3(0.0);
    if (NEEDS_LOBES != 0u && b.microfacet_probability > 0.0 && !bsdf_is_mirror(b) && to.z > 0.0) {
        f = microfacets(b, normalized(b.wi + to), to, pdf);
    }
    add_others(b, wo, to, f, pdf);
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

// The mirror direction.
BsdfSample mirrored(Bsdf b, vec3 weight) {
    return BsdfSample(from_microfacets(b.specular_normal, vec3(-b.wi.x, -b.wi.y, b.wi.z)), false, weight, MIRROR_PDF);
}

BsdfSample no_sample(vec3 wo) {
    return BsdfSample(wo, false, vec3(0.0), 0.0);
}

// A sample with this density; a failed one where the density is 0.
BsdfSample sampled(vec3 wo, bool through, vec3 f, float pdf) {
    if (!(pdf > 0.0) || isinf(pdf)) {
        return no_sample(wo);
    }
    return BsdfSample(wo, through, f / pdf, pdf);
}

BsdfSample sample_microfacets(Bsdf b, vec2 u, float choice) {
    bool is_mirror = bsdf_is_mirror(b);
    vec3 h = is_mirror ? vec3(0.0, 0.0, 1.0) : sample_visible_normal(b.wi, b.alpha, u);
    float cosine = dot(b.wi, h);
    vec3 passed;
    vec3 reflected = bsdf_reflectance(b, cosine, passed);
    float share = share_reflected(reflected, passed);
    vec3 to, wo, f;
    float pdf;
    bool through = !(choice < share);
    if (!through) {
        if (is_mirror) {
            return mirrored(b, reflected / (share * b.microfacet_probability));
        }
        to = 2.0 * cosine * h - b.wi;
        wo = from_microfacets(b.specular_normal, to);
        if (to.z <= 0.0) {
            return no_sample(wo);
        }
        f = microfacets(b, h, to, pdf);
        add_others(b, wo, to, f, pdf);
    } else {
        float cos_t = sqrt(max(1.0 - (1.0 - cosine * cosine) / (b.glass_eta * b.glass_eta), 0.0));
        to = normalized((cosine / b.glass_eta - cos_t) * h - b.wi / b.glass_eta);
        wo = from_microfacets(b.specular_normal, to);
        if (to.z >= 0.0) {
            return no_sample(wo);
        }
        if (is_mirror || abs(b.glass_eta - 1.0) < LEAST_BEND) {
            return BsdfSample(wo, true, passed / ((1.0 - share) * b.microfacet_probability), MIRROR_PDF);
        }
        f = microfacets(b, h, to, pdf);
    }
    return sampled(wo, through, f, pdf);
}

// Samples a direction with the density that bsdf_eval returns.
BsdfSample bsdf_sample(Bsdf b, vec2 u, float choice) {
    if (NEEDS_LOBES != 0u && choice < b.microfacet_probability) {
        return sample_microfacets(b, u, choice / b.microfacet_probability);
    }
    bool in_coat = NEEDS_COAT != 0u && choice < b.microfacet_probability + b.coat_probability;
    if (in_coat && coat_is_mirror(b.coat)) {
        return mirrored(b, coat_reflectance(b.coat, b.wi.z) / b.coat_probability);
    }
    bool in_sheen = NEEDS_SHEEN != 0u && choice < b.microfacet_probability + b.coat_probability + b.sheen_probability;
    bool is_above = true;
    vec3 wo;
    vec3 f = vec3(0.0);
    float pdf = 0.0;
    if (in_coat) {
        vec3 to = coat_sample(b.coat, b.wi, u);
        wo = from_microfacets(b.specular_normal, to);
        is_above = to.z > 0.0;
        if (NEEDS_SMOOTH != 0u && is_above && wo.z <= 0.0) {
            f = coat_eval(b.coat, b.wi, to, pdf);
            return sampled(wo, false, f, b.coat_probability * pdf);
        }
    } else if (in_sheen) {
        wo = sheen_sample(b.sheen, b.shading_wi, sample_cosine(u));
    } else {
        wo = sample_cosine(u);
    }
    if (is_above && wo.z > 0.0) {
        f = bsdf_eval(b, wo, pdf);
    }
    return sampled(wo, false, f, pdf);
}

#endif

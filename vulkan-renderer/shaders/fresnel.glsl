// Reflectance of a smooth surface: twin of transport/src/bsdf/fresnel.rs, which has the sources.
#ifndef FRESNEL_GLSL
#define FRESNEL_GLSL

float fresnel_dielectric(float cosine, float eta) {
    float g2 = eta * eta - 1.0 + cosine * cosine;
    if (g2 <= 0.0) {
        return 1.0;
    }
    float g = sqrt(g2);
    float s = (cosine - g) / (cosine + g), p = (eta * eta * cosine - g) / (eta * eta * cosine + g);
    return 0.5 * (s * s + p * p);
}

// Reflectance at normal incidence.
float f0_from_ior(float ior) {
    float ratio = (ior - 1.0) / (ior + 1.0);
    return ratio * ratio;
}

float ior_from_f0(float f0) {
    float root = sqrt(clamp(f0, 0.0, 0.99));
    return (1.0 + root) / (1.0 - root);
}

// Position of the reflectance between that at normal incidence, f0, and 1, as a fraction.
float fresnel_share(float cosine, float eta, float f0) {
    return clamp((fresnel_dielectric(cosine, eta) - f0) / (1.0 - f0), 0.0, 1.0);
}

float fresnel_dielectric_average(float eta) {
    if (eta < 1.0) {
        return 0.997118 + eta * (0.1014 - eta * (0.965241 + eta * 0.130607));
    }
    return (eta - 1.0) / (4.08567 + 1.00071 * eta);
}

vec3 f82_b(vec3 f0, vec3 tint) {
    const float F = 6.0 / 7.0;
    const float F5 = F * F * F * F * F;
    return (f0 + (vec3(1.0) - f0) * F5) * (7.0 / (F5 * F)) * (vec3(1.0) - tint);
}

vec3 fresnel_f82(float cosine, vec3 f0, vec3 b) {
    float s = clamp(1.0 - cosine, 0.0, 1.0);
    float s5 = s * s * s * s * s;
    return clamp(f0 + (vec3(1.0) - f0) * s5 - b * (cosine * s5 * s), vec3(0.0), vec3(1.0));
}

vec3 fresnel_f82_average(vec3 f0, vec3 b) {
    return f0 + (vec3(1.0) - f0) * (1.0 / 21.0) - b * (1.0 / 126.0);
}

#endif

// Microfacets: twin of transport/src/bsdf/ggx.rs, which has the sources.
#ifndef GGX_GLSL
#define GGX_GLSL

#include "trigonometry.glsl"

// Not GLSL's normalize: it may be wrong by several units in the last place, and it may return 0 for a vector whose squares are tiny.
vec3 normalized(vec3 v) {
    return v * (1.0 / sqrt(dot(v, v)));
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

#endif

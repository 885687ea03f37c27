// Surfaces whose shading normal differs from their geometric normal: twin of transport/src/bsdf/specular_normal.rs, which explains it.
#ifndef SPECULAR_NORMAL_GLSL
#define SPECULAR_NORMAL_GLSL

#include "needs.glsl"
#include "trigonometry.glsl"

const float LEAST_HEIGHT = 0.01;
const float PART_OF_HEIGHT = 0.9;
const float LEAST_COSINE = 1e-6;

struct SpecularNormal {
    vec3 normal;
};

// For a surface whose normals are the same.
SpecularNormal no_specular_normal() {
    return SpecularNormal(vec3(0.0, 0.0, 1.0));
}

// For a surface with this geometric normal, seen from wi on its side; both are in the frame of the shading normal.
SpecularNormal specular_normal_new(vec3 geometric, vec3 wi) {
    float height = max(dot(wi, geometric), LEAST_COSINE);
    float least = min(LEAST_HEIGHT, PART_OF_HEIGHT * height);
    vec3 mirrored_wi = vec3(-wi.x, -wi.y, wi.z);
    if (dot(mirrored_wi, geometric) >= least) {
        return no_specular_normal();
    }
    vec3 across = vec3(0.0, 0.0, 1.0) - geometric.z * geometric;
    float across_length = sqrt(dot(across, across));
    if (across_length < LEAST_COSINE) {
        return no_specular_normal();
    }
    across /= across_length;
    float ix = dot(wi, across);
    float a = ix * ix + height * height;
    float b = 2.0 * (a + height * least);
    float c = (least + height) * (least + height);
    float root = sqrt(max(b * b - 4.0 * a * c, 0.0));
    float nz2 = 0.25 * (ix < 0.0 ? b + root : b - root) / a;
    float nx = sqrt(max(1.0 - nz2, 0.0)), nz = sqrt(max(nz2, 0.0));
    return SpecularNormal(normalized(nx * across + nz * geometric));
}

bool specular_normal_is_none(SpecularNormal specular_normal) {
    return NEEDS_SMOOTH == 0u || specular_normal.normal == vec3(0.0, 0.0, 1.0);
}

// Transforms a direction into the frame of the microfacets.
vec3 to_microfacets(SpecularNormal specular_normal, vec3 w) {
    if (specular_normal_is_none(specular_normal)) {
        return w;
    }
    vec3 n = specular_normal.normal;
    float cosine = dot(n, w);
    float part = (cosine + w.z) / max(1.0 + n.z, LEAST_COSINE);
    return vec3(w.x - n.x * part, w.y - n.y * part, cosine);
}

// Transforms a direction out of the frame of the microfacets.
vec3 from_microfacets(SpecularNormal specular_normal, vec3 w) {
    if (specular_normal_is_none(specular_normal)) {
        return w;
    }
    vec3 n = specular_normal.normal;
    float part = (dot(n, w) + w.z) / max(1.0 + n.z, LEAST_COSINE);
    return w - (n + vec3(0.0, 0.0, 1.0)) * part + n * (2.0 * w.z);
}

#endif

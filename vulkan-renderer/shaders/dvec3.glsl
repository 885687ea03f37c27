// Vectors of three doubles: twin of glam's DVec3, in its order of operations.
#ifndef DVEC3_GLSL
#define DVEC3_GLSL

#include "f64.glsl"

struct DVec3 {
    f64 at[3];
};

DVec3 dvec3_of(f64 x, f64 y, f64 z) {
    DVec3 v;
    v.at[0] = x;
    v.at[1] = y;
    v.at[2] = z;
    return v;
}

DVec3 dvec3_from_bits(uint64_t bits[3]) {
    return dvec3_of(f64_from_bits(bits[0]), f64_from_bits(bits[1]), f64_from_bits(bits[2]));
}

DVec3 dvec3_add(DVec3 a, DVec3 b) {
    ROLLED for (int i = 0; i < 3; i++) {
        a.at[i] = f64_add(a.at[i], b.at[i]);
    }
    return a;
}

DVec3 dvec3_sub(DVec3 a, DVec3 b) {
    ROLLED for (int i = 0; i < 3; i++) {
        a.at[i] = f64_sub(a.at[i], b.at[i]);
    }
    return a;
}

DVec3 dvec3_scale(DVec3 a, f64 by) {
    ROLLED for (int i = 0; i < 3; i++) {
        a.at[i] = f64_mul(a.at[i], by);
    }
    return a;
}

DVec3 dvec3_neg(DVec3 a) {
    return dvec3_of(f64_neg(a.at[0]), f64_neg(a.at[1]), f64_neg(a.at[2]));
}

DVec3 dvec3_abs(DVec3 a) {
    return dvec3_of(f64_abs(a.at[0]), f64_abs(a.at[1]), f64_abs(a.at[2]));
}

f64 dvec3_dot(DVec3 a, DVec3 b) {
    f64 sum = f64_mul(a.at[0], b.at[0]);
    ROLLED for (int i = 1; i < 3; i++) {
        sum = f64_add(sum, f64_mul(a.at[i], b.at[i]));
    }
    return sum;
}

DVec3 dvec3_cross(DVec3 a, DVec3 b) {
    DVec3 result;
    ROLLED for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        result.at[i] = f64_sub(f64_mul(a.at[j], b.at[k]), f64_mul(b.at[j], a.at[k]));
    }
    return result;
}

f64 dvec3_length(DVec3 a) {
    return f64_sqrt(dvec3_dot(a, a));
}

DVec3 dvec3_normalize(DVec3 a) {
    return dvec3_scale(a, f64_div(F64_ONE, dvec3_length(a)));
}

bool dvec3_is_finite(DVec3 a) {
    return f64_is_finite(a.at[0]) && f64_is_finite(a.at[1]) && f64_is_finite(a.at[2]);
}

vec3 dvec3_to_vec3(DVec3 a) {
    return vec3(f64_to_f32(a.at[0]), f64_to_f32(a.at[1]), f64_to_f32(a.at[2]));
}

#endif

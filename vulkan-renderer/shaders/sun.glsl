// A sun, prepared for sampling: twin of transport/src/sun.rs. Directions are doubles as there. The sine and cosine of a sampled azimuth are
// floats, which shifts the direction within the sun by up to 2^−22 of its radius.
#ifndef SUN_GLSL
#define SUN_GLSL

#include "layout.glsl"
#include "dvec3.glsl"
#include "trigonometry.glsl"
#include "receiver.glsl"

// Two unit vectors that form a right-handed frame with a unit normal.
void frame_around(DVec3 n, out DVec3 tangent, out DVec3 bitangent) {
    f64 nx = n.at[0], ny = n.at[1], nz = n.at[2];
    f64 sign = f64_copysign(F64_ONE, nz);
    f64 a = f64_div(f64_neg(F64_ONE), f64_add(sign, nz));
    f64 b = f64_mul(f64_mul(nx, ny), a);
    f64 sign_nx = f64_mul(sign, nx);
    tangent = dvec3_of(f64_add(F64_ONE, f64_mul(f64_mul(sign_nx, nx), a)), f64_mul(sign, b), f64_neg(sign_nx));
    bitangent = dvec3_of(b, f64_add(sign, f64_mul(f64_mul(ny, ny), a)), f64_neg(ny));
}

// A direction towards the sun with its radiance. A density of 0 marks a single direction, and `radiance` is irradiance then.
struct SunSample {
    DVec3 direction;
    vec3 radiance;
    float pdf;
};

vec3 vec3_of(float v[3]) {
    return vec3(v[0], v[1], v[2]);
}

SunSample sun_sample(Sun sun, vec2 u) {
    SunSample result;
    result.radiance = vec3_of(sun.radiance);
    result.pdf = sun.cone_pdf;
    result.direction = dvec3_from_bits(sun.towards);
    if (sun.cone_pdf == 0.0) {
        return result;
    }
    f64 w = f64_mul(f64_from_f32(u.x), f64_from_bits(sun.one_minus_cos_half_angle));
    f64 sine = f64_sqrt(f64_max(f64_mul(w, f64_sub(F64_TWO, w)), F64_ZERO));
    vec2 sc = sin_cos(2.0 * PI * u.y);
    DVec3 across = dvec3_scale(dvec3_from_bits(sun.tangent), f64_mul(sine, f64_from_f32(sc.y)));
    DVec3 along = dvec3_scale(dvec3_from_bits(sun.bitangent), f64_mul(sine, f64_from_f32(sc.x)));
    DVec3 middle = dvec3_scale(result.direction, f64_sub(F64_ONE, w));
    result.direction = dvec3_add(dvec3_add(across, along), middle);
    return result;
}

// About the largest irradiance of a receiver, for choosing among lights.
float sun_irradiance_at(Sun sun, Receiver from) {
    float cosine = dot(dvec3_to_vec3(dvec3_from_bits(sun.towards)), from.normal);
    cosine = from.both_sides ? abs(cosine) : cosine;
    return sun.irradiance * clamp(cosine + sun.sin_half_angle + HORIZON, 0.0, 1.0);
}

// Whether a unit direction is within the sun's cone; its radiance and density are the sun's then.
bool sun_eval(Sun sun, DVec3 direction) {
    DVec3 d = dvec3_sub(direction, dvec3_from_bits(sun.towards));
    f64 one_minus_cos = f64_mul(F64_HALF, dvec3_dot(d, d));
    return f64_lt(one_minus_cos, f64_from_bits(sun.one_minus_cos_half_angle));
}

#endif

// About the irradiance of a sky by the normal: twin of transport/src/sky_irradiance.rs.
#ifndef SKY_IRRADIANCE_GLSL
#define SKY_IRRADIANCE_GLSL

#include "layout.glsl"
#include "receiver.glsl"

const float LEAST_OF_MEAN = 0.1;

// For choosing among lights.
float sky_irradiance_at(Lights lights, Receiver from) {
    vec3 n = from.normal;
    float s[6] = lights.sky_squared;
    float even = lights.sky_constant
        + (s[0] * n.x * n.x + s[1] * n.y * n.y + s[2] * n.z * n.z)
        + (s[3] * n.x * n.y + s[4] * n.y * n.z + s[5] * n.z * n.x);
    float irradiance = from.both_sides ? 2.0 * even : even + dot(vec3_of(lights.sky_linear), n);
    return max(irradiance, LEAST_OF_MEAN * lights.sky_mean);
}

#endif

// Points of the camera's opening: twin of transport/src/lens.rs.
#ifndef LENS_GLSL
#define LENS_GLSL

#include "layout.glsl"
#include "f64.glsl"
#include "trigonometry.glsl"

// A uniformly distributed point of the unit disk.
vec2 sample_disk(vec2 u) {
    precise float a = 2.0 * u.x - 1.0;
    precise float b = 2.0 * u.y - 1.0;
    if (a == 0.0 && b == 0.0) {
        return vec2(0.0);
    }
    bool first = abs(a) > abs(b);
    float r = first ? a : b;
    float phi = first ? 0.25 * PI * (b / a) : 0.5 * PI - 0.25 * PI * (a / b);
    vec2 sc = sin_cos(phi);
    return vec2(r * sc.y, r * sc.x);
}

// A uniformly distributed point of the regular polygon in the unit circle.
vec2 sample_polygon(uint corners, float rotation_rad, vec2 u) {
    precise float scaled = u.x * float(corners);
    float corner = floor(scaled);
    float from_centre = sqrt(scaled - corner);
    float a = 1.0 - from_centre, b = u.y * from_centre;
    vec2 sc = sin_cos(PI / float(corners));
    float x = (1.0 - a) * sc.y, y = (1.0 - a - 2.0 * b) * sc.x;
    sc = sin_cos(rotation_rad + corner * (2.0 * PI / float(corners)));
    return vec2(sc.y * x - sc.x * y, sc.x * x + sc.y * y);
}

// A point of the lens aperture, in world units along the picture's x and y.
void lens_sample(CameraRecord camera, vec2 u, out f64 along, out f64 above) {
    vec2 p = camera.lens_blades == 0u ? sample_disk(u) : sample_polygon(camera.lens_blades, camera.lens_rotation_rad, u);
    f64 radius = f64_from_bits(camera.lens_radius);
    along = f64_mul(f64_from_f32(p.x * camera.lens_inverse_ratio), radius);
    above = f64_mul(f64_from_f32(p.y), radius);
}

#endif

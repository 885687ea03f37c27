// Uniform sampling of directions to a rectangle by solid angle: twin of transport/src/lamp/spherical_rectangle.rs.
#ifndef SPHERICAL_RECTANGLE_GLSL
#define SPHERICAL_RECTANGLE_GLSL

#include "trigonometry.glsl"

struct SphericalRectangle {
    vec2 lo;
    vec2 hi;
    float height;
    float b[2];
    float start;
    float solid_angle;
};

// Arcsine, computed through the arctangent.
float arcsine(float x) {
    x = clamp(x, -1.0, 1.0);
    return atan2_of(x, sqrt((1.0 - x) * (1.0 + x)));
}

// The rectangle between two corners in the plane at distance `height` (above 0).
SphericalRectangle spherical_rectangle_new(vec2 lo, vec2 hi, float height) {
    float h2 = height * height;
    float below = -lo.y / sqrt(lo.y * lo.y + h2);
    float right = hi.x / sqrt(hi.x * hi.x + h2);
    float above = hi.y / sqrt(hi.y * hi.y + h2);
    float left = -lo.x / sqrt(lo.x * lo.x + h2);
    float start = -(arcsine(above * left) + arcsine(left * below));
    float solid_angle = arcsine(below * right) + arcsine(right * above) - start;
    return SphericalRectangle(lo, hi, height, float[2](below, above), start, solid_angle);
}

// The point (x, y) of the rectangle for two numbers in [0, 1).
vec2 spherical_rectangle_sample(SphericalRectangle r, vec2 u) {
    // x by the solid angle to its left.
    vec2 sc = sin_cos(u.x * r.solid_angle + r.start);
    float x = 0.0;
    if (sc.x != 0.0) {
        float f = (sc.y * r.b[0] + r.b[1]) / sc.x;
        float c = min(1.0 / sqrt(f * f + r.b[0] * r.b[0]), 1.0);
        c = f < 0.0 ? -c : c;
        x = c * r.height / max(sqrt((1.0 - c) * (1.0 + c)), 1e-7);
    }
    x = clamp(x, r.lo.x, r.hi.x);
    // y by the sines of the angles to both sides.
    float d2 = x * x + r.height * r.height;
    float low = r.lo.y / sqrt(d2 + r.lo.y * r.lo.y);
    float high = r.hi.y / sqrt(d2 + r.hi.y * r.hi.y);
    float s = low + u.y * (high - low);
    float y = s * sqrt(d2 / max((1.0 - s) * (1.0 + s), 1e-12));
    return vec2(x, clamp(y, r.lo.y, r.hi.y));
}

#endif

// The point at which light arrives: twin of `Receiver` in transport/src/lamp/mod.rs.
#ifndef RECEIVER_GLSL
#define RECEIVER_GLSL

#include "dvec3.glsl"

// Added to cosines by which lights are chosen, so that rounding hides no light that touches the horizon.
const float HORIZON = 1e-6;

// The point that receives light.
struct Receiver {
    DVec3 point;
    vec3 normal;
    bool both_sides;
};

#endif

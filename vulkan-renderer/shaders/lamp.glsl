// A lamp in the scene: twin of transport/src/lamp/mod.rs.
#ifndef LAMP_GLSL
#define LAMP_GLSL

#include "lamp_area.glsl"
#include "lamp_disk.glsl"

vec3 to_middle_of(Lamp lamp, Receiver from) {
    return dvec3_to_vec3(dvec3_sub(dvec3_from_bits(lamp.position), from.point));
}

// Samples a direction towards it.
LampSample lamp_sample(Lamp lamp, Receiver from, vec2 u) {
    vec3 to_middle = to_middle_of(lamp, from);
    if (lamp.kind <= LAMP_SPOT) {
        if (lamp.soft != 0u) {
            return sample_disk(lamp, to_middle, u);
        }
        return sample_ball(lamp, to_middle, from, u);
    }
    return sample_area(lamp, to_middle, u);
}

// The light of the lamp that a ray in a (unit) direction finds.
LampSample lamp_meet(Lamp lamp, Receiver from, vec3 direction) {
    vec3 to_middle = to_middle_of(lamp, from);
    if (lamp.kind <= LAMP_SPOT) {
        if (lamp.soft != 0u) {
            return meet_disk(lamp, to_middle, direction);
        }
        return meet_ball(lamp, to_middle, from, direction);
    }
    return meet_area(lamp, to_middle, direction);
}

#endif

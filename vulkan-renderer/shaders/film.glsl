// The sums of the film while samples are added: twin of picture/src/film.rs.
#ifndef FILM_GLSL
#define FILM_GLSL

#include "layout.glsl"
#include "sampler.glsl"

// Floats a pixel.
const uint STRIDE = 3u * CLASSES;

// Adds one sample of a pixel to its class's sums.
void film_add(Address sums, uint film_width, uvec2 pixel, uint number, vec3 color) {
    // 64 bits: a large film has more than 2^32 bytes.
    uint64_t place = (uint64_t(pixel.y) * uint64_t(film_width) + uint64_t(pixel.x)) * uint64_t(STRIDE)
        + uint64_t(3u * (number % CLASSES));
    Floats at = Floats(sums + place * 4UL);
    at.at[0] += color.x;
    at.at[1] += color.y;
    at.at[2] += color.z;
}

#endif

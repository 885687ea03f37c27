// A ray for hardware's hierarchies: in index space, moved to the bounds of all boxes, in floats. The boxes in the hierarchy are larger than
// the real ones (pack.rs) by more than the rounding errors of all this.
#ifndef HARDWARE_RAY_GLSL
#define HARDWARE_RAY_GLSL

struct HardwareRay {
    vec3 origin;
    vec3 direction;
    float t_max;
};

const float LEAST_DIRECTION = 1.0 / TWO_POW_60;
const float FARTHEST = 1e30;

// A component of 0 is replaced by one that moves the ray by less than 2^−36 voxels within the largest volume, because some hierarchies
// divide by it.
HardwareRay hardware_ray(BvhRay moved, Search search) {
    vec3 direction;
    for (uint a = 0u; a < 3u; a++) {
        float d = f64_to_f32(search.ray.direction[a]);
        direction[a] = abs(d) < LEAST_DIRECTION ? (moved.inverse[a] < 0.0 ? -LEAST_DIRECTION : LEAST_DIRECTION) : d;
    }
    return HardwareRay(moved.origin, direction, clamp(search_limit(search), 0.0, FARTHEST));
}

// A ray that stays at the centre of a voxel.
HardwareRay hardware_point(uvec3 voxel) {
    return HardwareRay(vec3(voxel) + 0.5, vec3(1.0, LEAST_DIRECTION, LEAST_DIRECTION), 0.25);
}

#endif

// Intersection of a ray with a triangle, without cracks along shared edges: twin of cpu-renderer/src/traverse/triangle.rs, which explains
// it.
//
// Every value that a decision depends on is `precise`: with fused operations, swapping the ends of an edge would change more than the sign.
#ifndef TRIANGLE_GLSL
#define TRIANGLE_GLSL

#include "dvec3.glsl"

struct TriangleRay {
    DVec3 origin;
    DVec3 direction;
    // Axes: two across the ray, and the one along which the ray's direction is longest.
    uvec3 axes;
    vec2 shear;
};

TriangleRay triangle_ray_new(DVec3 origin, DVec3 direction) {
    DVec3 size = dvec3_abs(direction);
    uint z = f64_le(size.at[1], size.at[0]) && f64_le(size.at[2], size.at[0]) ? 0u : f64_le(size.at[2], size.at[1]) ? 1u : 2u;
    uvec3 axes = uvec3((z + 1u) % 3u, (z + 2u) % 3u, z);
    f64 along = direction.at[z];
    if (f64_lt(along, F64_ZERO)) {
        axes = axes.yxz;
    }
    TriangleRay ray = TriangleRay(origin, direction, axes, vec2(0.0));
    ROLLED for (uint i = 0u; i < 2u; i++) {
        ray.shear[i] = f64_to_f32(f64_div(direction.at[axes[i]], along));
    }
    return ray;
}

// A corner, translated and sheared: its position beside the ray.
vec2 beside(TriangleRay ray, DVec3 from_origin) {
    float along = f64_to_f32(from_origin.at[ray.axes.z]);
    precise float x = f64_to_f32(from_origin.at[ray.axes.x]) - ray.shear.x * along;
    precise float y = f64_to_f32(from_origin.at[ray.axes.y]) - ray.shear.y * along;
    return vec2(x, y);
}

// Twice the area of the triangle of p, q and the ray; only its sign is right where a float cannot hold it.
float edge(vec2 p, vec2 q) {
    precise float area = p.x * q.y - p.y * q.x;
    if (area != 0.0) {
        return area;
    }
    f64 more = f64_mul(f64_from_f32(p.x), f64_from_f32(q.y));
    f64 less = f64_mul(f64_from_f32(p.y), f64_from_f32(q.x));
    return f64_lt(less, more) ? 1.0 : f64_lt(more, less) ? -1.0 : 0.0;
}

// Whether the ray, taken as an infinite line, meets the triangle, and at which t.
bool triangle_ray_meet(TriangleRay ray, DVec3 corners[3], out f64 t) {
    vec2 flat_corners[3];
    [[dont_unroll]] for (uint i = 0u; i < 3u; i++) {
        corners[i] = dvec3_sub(corners[i], ray.origin);
        flat_corners[i] = beside(ray, corners[i]);
    }
    bool any_below = false, any_above = false;
    [[dont_unroll]] for (uint i = 0u; i < 3u; i++) {
        float area = edge(flat_corners[(i + 2u) % 3u], flat_corners[(i + 1u) % 3u]);
        any_below = any_below || area < 0.0;
        any_above = any_above || area > 0.0;
    }
    t = F64_ZERO;
    // Edges on both sides: the ray passes beside the triangle. All 0: the ray sees the triangle edge-on.
    if (any_below == any_above) {
        return false;
    }
    DVec3 normal = dvec3_cross(dvec3_sub(corners[1], corners[0]), dvec3_sub(corners[2], corners[0]));
    t = f64_div(dvec3_dot(normal, corners[0]), dvec3_dot(normal, ray.direction));
    uint z = ray.axes.z;
    f64 least = f64_min(f64_min(corners[0].at[z], corners[1].at[z]), corners[2].at[z]);
    f64 most = f64_max(f64_max(corners[0].at[z], corners[1].at[z]), corners[2].at[z]);
    f64 along = ray.direction.at[z];
    bool down = f64_lt(along, F64_ZERO);
    f64 first = f64_div(down ? most : least, along);
    f64 last = f64_div(down ? least : most, along);
    t = f64_lt(first, t) ? (f64_lt(t, last) ? t : last) : first;
    return true;
}

#endif

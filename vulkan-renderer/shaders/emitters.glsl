// Emissive labels and meshes, sampled as lights: twin of transport/src/emitters/mod.rs, which explains it.
#ifndef EMITTERS_GLSL
#define EMITTERS_GLSL

#include "light_tree.glsl"
#include "index_ray.glsl"
#include "volume.glsl"
#include "material_table.glsl"
#include "coat.glsl"

// Least f32 that is not denormal.
const float LEAST_IRRADIANCE = 1.17549435e-38;

// Marks an instance without emitters.
const uint NOT_EMISSIVE = 0xFFFFFFFFu;

// A surface that touches a lamp or an emissive surface, within this fraction of its distance, does not hide it.
const float TOUCHING = 1.0 - 1.0 / 1048576.0;

struct EmitterSample {
    bool found;
    DVec3 direction;
    f64 distance_to;
    vec3 radiance;
    float pdf;
    uint instance;
};

// The vector from a receiver to a point of an emitter.
struct WayTo {
    bool found;
    DVec3 way;
    f64 across;
    float share;
    float area;
};

InstanceRef instance_of_emissive(SceneRef scene, EmissiveInstance emissive) {
    return InstanceRef(scene.it.instances + uint64_t(emissive.instance) * INSTANCE_BYTES);
}

// The receiver in index space.
DVec3 emissive_instance_point(SceneRef scene, EmissiveInstance emissive, Receiver from) {
    Placement placement = placement_of(instance_of_emissive(scene, emissive));
    return index_from_world(placement, dvec3_sub(from.point, placement.translation));
}

// End of a direction's faces, counted from the emitter's first face.
uint end_of_direction(Emitter emitter, uint direction) {
    return (emitter.ends[direction >> 1] >> (16u * (direction & 1u))) & 0xFFFFu;
}

// First face and end of a direction's list.
uvec2 emitter_list(Emitter emitter, uint direction) {
    uint start = direction == 0u ? 0u : end_of_direction(emitter, direction - 1u);
    return emitter.first + uvec2(start, end_of_direction(emitter, direction));
}

// For each direction, the visible amount of the emitter's faces from an index-space point, up to a common factor; and the sum.
float emitter_seen(Emitter emitter, DVec3 point, out float seen[6]) {
    float sum = 0.0;
    for (uint direction = 0u; direction < 6u; direction++) {
        uint axis = direction / 2u;
        float at = clamp(f64_to_f32(f64_sub(point.at[axis], f64_from_u32(emitter.origin[axis]))), -1e30, 1e30);
        float plane = float((emitter.planes >> (5u * direction)) & 31u);
        float height = direction % 2u == 1u ? at - plane : plane - at;
        uvec2 list = emitter_list(emitter, direction);
        seen[direction] = float(list.y - list.x) * max(height, 0.0);
        sum += seen[direction];
    }
    return sum;
}

DVec3 dvec3_from_floats(float v[3]) {
    return dvec3_of(f64_from_f32(v[0]), f64_from_f32(v[1]), f64_from_f32(v[2]));
}

// Corners of a triangle, and its area as a vector, in the grid.
DVec3 triangle_shape(EmissiveTriangle triangle, out DVec3 corners[3]) {
    for (int i = 0; i < 3; i++) {
        corners[i] = dvec3_from_floats(triangle.corners[i]);
    }
    return dvec3_scale(dvec3_cross(dvec3_sub(corners[1], corners[0]), dvec3_sub(corners[2], corners[0])), F64_HALF);
}

// Code of a face.
uint face_code(Emitters emitters, uint number) {
    return (Words(emitters.faces).at[number >> 1] >> (16u * (number & 1u))) & 0xFFFFu;
}

// Density per solid angle at a distance of `units`, where the face has the projected area `across`; 0 where a float cannot hold it.
float density(float share, float units, float across) {
    float pdf = share * (units / across) * units * units;
    return isinf(pdf) || isnan(pdf) ? 0.0 : pdf;
}

WayTo sample_box(Emitters emitters, Emitter emitter, EmissiveInstance emissive, DVec3 point, float which, vec2 u) {
    WayTo to;
    to.found = false;
    float seen[6];
    float sum = emitter_seen(emitter, point, seen);
    if (sum <= 0.0) {
        return to;
    }
    // The direction whose part of the sum contains the number.
    uint direction = 6u;
    float end = 0.0, part = 0.0;
    for (uint d = 0u; d < 6u; d++) {
        if (seen[d] > 0.0 && (direction == 6u || which * sum >= end)) {
            direction = d;
            part = seen[d];
        }
        end += seen[d];
    }
    uint axis = direction / 2u;
    bool positive = direction % 2u == 1u;
    uvec2 list = emitter_list(emitter, direction);
    uint count = list.y - list.x;
    float place_in_list = u.x * float(count);
    uint index = min(uint(place_in_list), count - 1u);
    uint code = face_code(emitters, list.x + index);
    vec2 within = vec2(place_in_list - float(index), u.y);
    // The two other axes lie across the face, in their order.
    uint next = 0u;
    to.way = point;
    for (uint a = 0u; a < 3u; a++) {
        f64 at = f64_from_u32(emitter.origin[a] + ((code >> (4u * a)) & 15u));
        if (a != axis) {
            at = f64_add(at, f64_from_f32(within[next]));
            next += 1u;
        } else if (positive) {
            at = f64_add(at, F64_ONE);
        }
        to.way.at[a] = f64_sub(at, point.at[a]);
        if (a == axis) {
            to.across = to.way.at[a];
        }
    }
    to.found = positive ? f64_lt(to.across, F64_ZERO) : f64_lt(F64_ZERO, to.across);
    to.share = part / sum / float(count);
    to.area = emissive.areas[axis];
    return to;
}

WayTo sample_triangle(Emitters emitters, Emitter emitter, DVec3 point, vec2 u) {
    EmissiveTriangle triangle = EmissiveTriangles(emitters.triangles).at[emitter.first];
    DVec3 corners[3];
    DVec3 normal = triangle_shape(triangle, corners);
    float root = sqrt(u.x);
    f64 v = f64_from_f32(root * (1.0 - u.y)), w = f64_from_f32(root * u.y);
    DVec3 from_point = dvec3_sub(corners[0], point);
    DVec3 way = dvec3_add(from_point, dvec3_scale(dvec3_sub(corners[1], corners[0]), v));
    way = dvec3_add(way, dvec3_scale(dvec3_sub(corners[2], corners[0]), w));
    return WayTo(true, way, dvec3_dot(normal, from_point), 1.0, triangle.area);
}

// Samples a point of an emitter: `choice` is for the tree, `further` for the tree and the direction, u for the face and its point.
EmitterSample emitters_sample(SceneRef scene, Receiver from, float choice, vec2 further, vec2 u) {
    Emitters emitters = scene.it.emitters;
    EmitterSample result;
    result.found = false;
    float probability;
    uint number = tree_choose(emitters.tree, seen_from(emitters.tree, from), vec2(choice, further.x), probability);
    if (probability <= 0.0) {
        return result;
    }
    Emitter emitter = EmitterRecords(emitters.emitters).at[number];
    EmissiveInstance emissive = EmissiveInstances(emitters.emissive_instances).at[emitter.emissive_instance];
    result.instance = emissive.instance;
    DVec3 point = emissive_instance_point(scene, emissive, from);
    WayTo to;
    if (NEEDS_MESHES != 0u && emissive.is_mesh != 0u) {
        to = sample_triangle(emitters, emitter, point, u);
    } else {
        to = sample_box(emitters, emitter, emissive, point, further.y, u);
    }
    if (!to.found) {
        return result;
    }
    DVec3 way = dvec3_scale(dvec3_from_bits(emissive.world_from_index[0]), to.way.at[0]);
    way = dvec3_add(way, dvec3_scale(dvec3_from_bits(emissive.world_from_index[1]), to.way.at[1]));
    way = dvec3_add(way, dvec3_scale(dvec3_from_bits(emissive.world_from_index[2]), to.way.at[2]));
    f64 far = dvec3_length(way);
    float units = f64_to_f32(f64_mul(far, f64_from_bits(emissive.units_per_world)));
    float across = abs(f64_to_f32(to.across));
    result.pdf = density(probability * to.share, units, across);
    Material material = material_of(instance_of_emissive(scene, emissive), emitter.label);
    float cosine = clamp(across / (to.area * units), 1e-6, 1.0);
    result.radiance = emitted(scene.it.tables, material, cosine) * material.alpha;
    result.found = result.pdf > 0.0;
    result.direction = dvec3_scale(way, f64_div(F64_ONE, far));
    DVec3 p = dvec3_abs(from.point);
    f64 largest = f64_max(f64_max(p.at[0], p.at[1]), p.at[2]);
    // Rounding of a world position, doubled: 2 · 2^-52.
    result.distance_to = f64_sub(f64_mul(far, f64_from_f32(TOUCHING)), f64_mul(largest, f64_exp2(-51)));
    return result;
}

// Whether the key (label, z, y, x) of an emitter precedes this one.
bool key_is_before(Emitter emitter, uint label, uvec3 origin) {
    if (emitter.label != label) {
        return emitter.label < label;
    }
    for (int a = 2; a > 0; a--) {
        if (emitter.origin[a] != origin[a]) {
            return emitter.origin[a] < origin[a];
        }
    }
    return emitter.origin[0] < origin.x;
}

// The emitter with that key, or NONE.
uint emitters_find(Emitters emitters, EmissiveInstance emissive, uint label, uvec3 origin) {
    Words by_key = Words(emitters.by_key);
    EmitterRecords records = EmitterRecords(emitters.emitters);
    uint low = emissive.keys[0], high = emissive.keys[1];
    while (low < high) {
        uint middle = (low + high) >> 1;
        if (key_is_before(records.at[by_key.at[middle]], label, origin)) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    if (low == emissive.keys[1]) {
        return NONE;
    }
    uint number = by_key.at[low];
    Emitter found = records.at[number];
    bool same = found.label == label && uvec3(found.origin[0], found.origin[1], found.origin[2]) == origin;
    return same ? number : NONE;
}

// Whether a face is in a sorted list.
bool face_is_listed(Emitters emitters, uvec2 list, uint code) {
    uint low = list.x, high = list.y;
    while (low < high) {
        uint middle = (low + high) >> 1;
        if (face_code(emitters, middle) < code) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low < list.y && face_code(emitters, low) == code;
}

// About the irradiance of a receiver, for choosing among lights; `around` is that of the ball around them.
float emitters_irradiance_at(Emitters emitters, float around, Receiver from) {
    DVec3 way = dvec3_sub(from.point, dvec3_from_bits(emitters.tree.middle));
    vec3 radii = dvec3_to_vec3(dvec3_scale(way, f64_div(F64_ONE, f64_from_bits(emitters.radius))));
    return max(around / max(dot(radii, radii), 1.0), LEAST_IRRADIANCE);
}

// Density with which emitters_sample gives a direction to this surface (seen from outside, or from a triangle's side), `distance_to` away
// in the world; 0 where the surface is not sampled.
float emitters_pdf(SceneRef scene, Receiver from, Surface surface, f64 distance_to) {
    Emitters emitters = scene.it.emitters;
    uint emissive_number = surface.instance < emitters.emissive_instance_of_count ? Words(emitters.emissive_instance_of).at[surface.instance] : NOT_EMISSIVE;
    if (emissive_number == NOT_EMISSIVE || surface.kind == SURFACE_CAP) {
        return 0.0;
    }
    EmissiveInstance emissive = EmissiveInstances(emitters.emissive_instances).at[emissive_number];
    uvec3 origin = uvec3(surface.plane, 0u, 0u);
    if (emissive.is_mesh == 0u) {
        if (surface.box_number == NONE) {
            return 0.0;
        }
        origin = box_place(instance_of_emissive(scene, emissive), surface.box_number).origin;
    }
    uint number = emitters_find(emitters, emissive, surface.label, origin);
    if (number == NONE) {
        return 0.0;
    }
    Emitter emitter = EmitterRecords(emitters.emitters).at[number];
    DVec3 point = emissive_instance_point(scene, emissive, from);
    float share = 1.0;
    f64 across;
    if (NEEDS_MESHES != 0u && emissive.is_mesh != 0u) {
        DVec3 corners[3];
        DVec3 normal = triangle_shape(EmissiveTriangles(emitters.triangles).at[emitter.first], corners);
        across = dvec3_dot(normal, dvec3_sub(corners[0], point));
    } else {
        uint direction = 2u * surface.axis + (surface.positive ? 1u : 0u);
        uvec2 list = emitter_list(emitter, direction);
        uvec3 at = surface.voxel - origin;
        if (!face_is_listed(emitters, list, (at.x | (at.y << 4) | (at.z << 8)) & 0xFFFFu)) {
            return 0.0;
        }
        float seen[6];
        float sum = emitter_seen(emitter, point, seen);
        across = f64_sub(f64_from_u32(surface.plane), point.at[surface.axis]);
        bool faces = surface.positive ? f64_lt(across, F64_ZERO) : f64_lt(F64_ZERO, across);
        if (sum <= 0.0 || !faces) {
            return 0.0;
        }
        share = seen[direction] / sum / float(list.y - list.x);
    }
    float probability = tree_probability(emitters.tree, seen_from(emitters.tree, from), number);
    float units = f64_to_f32(f64_mul(distance_to, f64_from_bits(emissive.units_per_world)));
    return density(probability * share, units, abs(f64_to_f32(across)));
}

#endif

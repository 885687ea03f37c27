// Triangles of one mesh: twin of cpu-renderer/src/traverse/mesh_tracer.rs, which explains it. A mesh is an instance whose items are
// triangles; the searches of volume_tracer.glsl, which includes this file, find them as they find boxes.
#ifndef MESH_TRACER_GLSL
#define MESH_TRACER_GLSL

#include "mesh_normals.glsl"

bool is_mesh(InstanceRef instance) {
    return NEEDS_MESHES != 0u && instance.it.lod >= LOD_TRIANGLES;
}

void mesh_corners(InstanceRef instance, uint triangle, out DVec3 corners[3]) {
    Words of_triangle = Words(instance.it.boxes + uint64_t(triangle) * 12UL);
    [[dont_unroll]] for (uint i = 0u; i < 3u; i++) {
        Floats corner = Floats(instance.it.nodes + uint64_t(of_triangle.at[i]) * 12UL);
        [[dont_unroll]] for (uint a = 0u; a < 3u; a++) {
            corners[i].at[a] = f64_from_f32(corner.at[a]);
        }
    }
}

f64 length_along_axes(DVec3 d) {
    return f64_add(f64_add(f64_abs(d.at[0]), f64_abs(d.at[1])), f64_abs(d.at[2]));
}

// The triangle that a path leaves.
struct Leaving {
    DVec3 point;
    DVec3 normal;
    f64 size;
};

Leaving mesh_leaving(InstanceRef instance, uint triangle, DVec3 direction) {
    DVec3 corners[3];
    mesh_corners(instance, triangle, corners);
    DVec3 one = dvec3_sub(corners[1], corners[0]), other = dvec3_sub(corners[2], corners[0]);
    DVec3 normal = dvec3_cross(one, other);
    bool goes_back = f64_lt(dvec3_dot(normal, direction), F64_ZERO);
    f64 size = f64_mul(length_along_axes(one), length_along_axes(other));
    return Leaving(corners[0], goes_back ? dvec3_neg(normal) : normal, size);
}

// Whether a ray from there cannot meet a triangle with these corners.
bool is_out_of_reach(Leaving leaving, DVec3 corners[3]) {
    bool reaches = false;
    [[dont_unroll]] for (uint i = 0u; i < 3u; i++) {
        DVec3 d = dvec3_sub(corners[i], leaving.point);
        f64 size = f64_mul(leaving.size, length_along_axes(d));
        // ε·8, where the ε of a double is 2^−52.
        reaches = reaches || !f64_le(dvec3_dot(leaving.normal, d), f64_mul(size, f64_exp2(-49)));
    }
    return !reaches;
}

// Starts a search in a mesh where the ray enters the mesh's grid.
void start_in_grid(inout Search search) {
    ROLLED for (uint a = 0u; a < 3u; a++) {
        search.ray.origin[a] = f64_add(search.ray.origin[a], f64_mul(search.ray.direction[a], search.enter_all));
    }
    DVec3 direction = dvec3_of(search.ray.direction[0], search.ray.direction[1], search.ray.direction[2]);
    TriangleRay ray = triangle_ray_new(direction, direction);
    search.axes = ray.axes.x | (ray.axes.y << 2) | (ray.axes.z << 4);
    search.shear = ray.shear;
}

// Tests one triangle. Returns true when the search is complete.
bool visit_triangle(InstanceRef instance, inout Search search, uint triangle) {
    TriangleRay ray;
    ray.origin = dvec3_of(search.ray.origin[0], search.ray.origin[1], search.ray.origin[2]);
    ray.direction = dvec3_of(search.ray.direction[0], search.ray.direction[1], search.ray.direction[2]);
    ray.axes = (uvec3(search.axes) >> uvec3(0u, 2u, 4u)) & 3u;
    ray.shear = search.shear;
    DVec3 corners[3];
    mesh_corners(instance, triangle, corners);
    f64 t;
    if (!triangle_ray_meet(ray, corners, t)) {
        return false;
    }
    t = f64_add(search.enter_all, t);
    bool first = f64_lt(t, search.best_t)
        || (f64_eq(t, search.best_t) && search.kind == NEAREST_TRIANGLE && triangle < search.box_number);
    if (!first || !f64_lt(F64_ZERO, t) || search.leaving == triangle) {
        return false;
    }
    if (search.leaving != NONE && is_out_of_reach(mesh_leaving(instance, search.leaving, ray.direction), corners)) {
        return false;
    }
    search.best_t = t;
    search.kind = NEAREST_TRIANGLE;
    search.box_number = triangle;
    return search.seek == SEEK_ANY;
}

#ifndef ONLY_VISITS

Hit mesh_hit(InstanceRef instance, uint instance_number, IndexRay ray, f64 t, uint triangle) {
    DVec3 corners[3];
    mesh_corners(instance, triangle, corners);
    DVec3 normal = dvec3_cross(dvec3_sub(corners[1], corners[0]), dvec3_sub(corners[2], corners[0]));
    DVec3 direction = dvec3_of(ray.direction[0], ray.direction[1], ray.direction[2]);
    uint material = Words(instance.it.labels + uint64_t(triangle) * 4UL).at[0];
    return Hit(f64_div(t, ray.scaled_from_world),
        Surface(instance_number, SURFACE_TRIANGLE, uvec3(0u), 0u, false, triangle, material, triangle),
        normal_of(placement_of(instance), normal), f64_lt(F64_ZERO, dvec3_dot(normal, direction)));
}

// The shading normal of a triangle at a point; false where it is the geometric normal.
bool mesh_smooth_normal(InstanceRef instance, uint triangle, DVec3 point, out DVec3 normal) {
    normal = point;
    if (instance.it.leaves == 0UL) {
        return false;
    }
    Words of_triangle = Words(instance.it.leaves + uint64_t(triangle) * 12UL);
    DVec3 corners[3];
    mesh_corners(instance, triangle, corners);
    Placement placement = placement_of(instance);
    DVec3 in_grid = index_from_world(placement, dvec3_sub(point, placement.translation));
    vec3 blended;
    if (!blended_normal(corners, uint[3](of_triangle.at[0], of_triangle.at[1], of_triangle.at[2]), in_grid, blended)) {
        return false;
    }
    normal = normal_of(placement, dvec3_of(f64_from_f32(blended.x), f64_from_f32(blended.y), f64_from_f32(blended.z)));
    return true;
}

#endif

#endif

// One instance and the queries of rays: twin of cpu-renderer/src/traverse/volume_tracer.rs, volume_tracer/search.rs and
// surfaces.rs beside it, and of transport/src/geometry/bricks.rs where a brick says which box holds a voxel.
//
// The twin passes closures to its hierarchy. Here a search is a structure, `visit` tests one box, and one of three front ends finds the
// boxes. A definition selects it:
//
//     FRONT_BVH        front_bvh.glsl        our own hierarchy, in compute
//     FRONT_QUERY      front_query.glsl      hardware's hierarchy through a ray query, in compute
//     FRONT_PIPELINE   front_pipeline.glsl   hardware's hierarchy, `visit` in an intersection shader
//
// The result of a search does not depend on the order of its visits, and hardware's own notion of the nearest hit is used only to skip
// boxes. So all three find the same, bit for bit.
#ifndef VOLUME_TRACER_GLSL
#define VOLUME_TRACER_GLSL

#include "box_walk.glsl"
#include "brick_walk.glsl"
#include "bvh.glsl"
#include "cuts.glsl"
#include "needs.glsl"
#include "triangle.glsl"
#include "voxel_normals.glsl"

const uint NEAREST_NOTHING = 0u;
const uint NEAREST_INSIDE = 1u;
const uint NEAREST_FACE = 2u;
const uint NEAREST_TRIANGLE = 3u;

// What visits search for.
const uint SEEK_NEAREST = 0u;
const uint SEEK_ANY = 1u;
// The box of label `only` (NONE: of any) that has an element at `step.voxel`.
const uint SEEK_HOLDER = 2u;

struct Search {
    IndexRay ray;
    // Scaled t at which the search begins.
    f64 start;
    f64 t_max;
    // Scaled t at which the ray enters the bounds of all boxes.
    f64 enter_all;
    f64 best_t;
    float pad;
    // The label, or NONE for all labels.
    uint only;
    uint seek;
    // Nearest hit so far.
    uint kind;
    uint label;
    // Number of a box or of a triangle.
    uint box_number;
    Step step;
    // In a mesh: the triangle that a path leaves, or NONE; axes (two bits each) and shear of the TriangleRay.
    uint leaving;
    uint axes;
    vec2 shear;
};

uint number_in(uvec3 origin, uvec3 voxel, uint shift) {
    uvec3 part = ((voxel - origin) >> shift) & 3u;
    return part.x | (part.y << 2) | (part.z << 4);
}

uvec3 dims_of(InstanceRef instance) {
    return uvec3(instance.it.dims[0], instance.it.dims[1], instance.it.dims[2]);
}

uvec3 clipped_end(InstanceRef instance, uvec3 origin, uvec3 extent) {
    return min(origin + extent, dims_of(instance));
}

// Distance beyond which the hierarchy need not be searched, in its ray's t.
float search_limit(Search search) {
    return f64_to_f32(f64_sub(search.best_t, search.enter_all)) * 1.000001 + search.pad;
}

bool holds(InstanceRef instance, BoxPlace p, uvec3 voxel) {
    uvec3 hi = clipped_end(instance, p.origin, p.extent);
    if (any(lessThan(voxel, p.origin)) || any(greaterThanEqual(voxel, hi))) {
        return false;
    }
    if (p.level == LEVEL_BOXES) {
        return true;
    }
    BoxView b = box_view(instance, p);
    uint cell = number_in(p.origin, voxel, 2u);
    return p.level == LEVEL_CELLS ? bit64(b.node.occupied, cell)
                                  : node_has(b.node, cell, number_in(p.origin, voxel, 0u));
}

// Whether (label, voxel) of a precedes that of b; voxels are ordered by number.
bool comes_first(uint label_a, uvec3 a, uint label_b, uvec3 b) {
    if (label_a != label_b) {
        return label_a < label_b;
    }
    if (a.x != b.x) {
        return a.x < b.x;
    }
    return a.y != b.y ? a.y < b.y : a.z < b.z;
}

// Tests one box in a search for the box that holds a voxel. Returns true when the search is complete.
bool visit_holder(InstanceRef instance, inout Search search, uint item) {
    bool wanted = search.only == NONE || label_of_box(instance, item) == search.only;
    if (wanted && holds(instance, box_place(instance, item), search.step.voxel)) {
        search.box_number = item;
        return true;
    }
    return false;
}

// Tests one box in a search along a ray. Returns true when the search is complete.
bool visit_box(InstanceRef instance, inout Search search, uint item) {
    BoxPlace p = box_place(instance, item);
    uvec3 hi = clipped_end(instance, p.origin, p.extent);
    f64 enter, leave;
    clip(search.ray, p.origin, hi, search.start, enter, leave);
    if (f64_le(leave, enter) || f64_lt(search.best_t, enter)) {
        return false;
    }
    BoxView b = box_view(instance, p);
    Walk walk = walk_begin(search.ray, p.origin, hi, enter);
    Found found = walk_first_solid(walk, search.ray, b, f64_eq(enter, search.start));
    if (found.kind == FOUND_NOTHING) {
        return false;
    }
    bool face = found.kind == FOUND_FACE;
    if (face && (f64_le(search.t_max, found.step.t) || f64_lt(search.best_t, found.step.t))) {
        return false;
    }
    uint label = label_of_box(instance, item);
    if (search.only != NONE && search.only != label) {
        return false;
    }
    if (!face) {
        if (!(search.kind == NEAREST_INSIDE && search.label <= label)) {
            search.kind = NEAREST_INSIDE;
            search.label = label;
            search.box_number = item;
            search.step = found.step;
        }
        // The face is computed with `any` too, or the result would depend on which of the two came first.
        if (search.seek != SEEK_ANY) {
            search.best_t = search.start;
        }
        return false;
    }
    bool wins = search.kind == NEAREST_NOTHING || (search.kind == NEAREST_INSIDE && search.seek == SEEK_ANY)
        || (search.kind == NEAREST_FACE
            && (f64_lt(found.step.t, search.step.t)
                || comes_first(label, found.step.voxel, search.label, search.step.voxel)));
    if (wins) {
        search.best_t = found.step.t;
        search.kind = NEAREST_FACE;
        search.label = label;
        search.box_number = item;
        search.step = found.step;
        return search.seek == SEEK_ANY;
    }
    return false;
}

#include "mesh_tracer.glsl"

// The box that holds a voxel of a brick, of label `only` or of any (NONE). At coarser levels, where labels overlap, it is that of the
// lowest label. With NONE, some box must hold the voxel.
uint brick_part(InstanceRef instance, uint brick, uvec3 voxel, uint only) {
    BrickParts parts = BrickParts(instance.it.brick_parts);
    uint cell = place_in(voxel, CELL_SHIFT);
    uint end = brick_at(instance, brick + 1u).first_part;
    uint candidate = NONE, label = NONE;
    [[dont_unroll]] for (uint i = brick_at(instance, brick).first_part; i <= end; i++) {
        BrickPart part = BrickPart(0UL, NONE, NONE);
        if (i < end) {
            part = parts.at[i];
            if (!bit64(part.cells, cell) || (only != NONE && part.label != only)) {
                continue;
            }
        }
        // Of voxels, several boxes may hold this one, and their nodes decide: the candidate's, once another follows. At coarser levels labels
        // overlap, and the lowest that holds the voxel is the candidate. (A box with all its voxels may have a cell in which it does not.)
        bool coarse = instance.it.lod != LEVEL_VOXELS;
        if (coarse ? part.label >= label : candidate == NONE) {
            candidate = coarse ? candidate : part.box_number;
            continue;
        }
        bool holds_it = coarse ? instance.it.lod != LOD_BY_DISTANCE : i == end && only == NONE;
        if (!holds_it) {
            holds_it = holds(instance, box_place(instance, coarse ? part.box_number : candidate), voxel);
        }
        if (holds_it && !coarse) {
            return candidate;
        }
        if (holds_it || !coarse) {
            candidate = part.box_number;
            label = part.label;
        }
    }
    return candidate;
}

// `item_with` for instances with bricks; `voxel` is within the bounds of all boxes.
uint item_in_bricks(InstanceRef instance, uint label, uvec3 voxel) {
    BrickBlock block = block_at(instance, voxel);
    uint place = place_in(voxel, BRICK_SHIFT), cell = place_in(voxel, CELL_SHIFT);
    if (!bit64(block.occupied, place) || !is_here(instance, block)) {
        return NONE;
    }
    uint number = block_brick(block, place);
    Brick brick = brick_at(instance, number);
    if (!bit64(brick.occupied, cell) || !bit64(brick_field(instance, brick, cell), place_in(voxel, 0u))) {
        return NONE;
    }
    return brick_part(instance, number, voxel, label);
}

// Records the result of a walk through bricks; the brick's number stands in the box's place.
void found_in_brick(inout Search search, Found found, uint brick) {
    if (found.kind == FOUND_INSIDE) {
        search.kind = NEAREST_INSIDE;
        search.best_t = search.start;
    } else if (found.kind == FOUND_FACE && f64_lt(found.step.t, search.best_t)) {
        search.kind = NEAREST_FACE;
        search.best_t = found.step.t;
    } else {
        return;
    }
    search.step = found.step;
    search.box_number = brick;
}

#ifndef FRONT_BVH

// Tests one brick, where hardware finds bricks.
bool visit_brick(InstanceRef instance, inout Search search, uint number) {
    if (search.only != NONE) {
        // The boxes of one label. A box that reaches into several bricks is tested again, with the same result.
        uint end = brick_at(instance, number + 1u).first_part;
        for (uint i = brick_at(instance, number).first_part; i < end; i++) {
            BrickPart part = BrickParts(instance.it.brick_parts).at[i];
            if (part.label == search.only && visit_box(instance, search, part.box_number)) {
                return true;
            }
        }
        return false;
    }
    Words corners = Words(instance.it.brick_corners);
    uvec3 corner = uvec3(corners.at[3u * number], corners.at[3u * number + 1u], corners.at[3u * number + 2u]);
    f64 enter, leave;
    clip(search.ray, corner, corner + (1u << BRICK_SHIFT), search.start, enter, leave);
    if (f64_le(leave, enter) || f64_le(search.best_t, enter)) {
        return false;
    }
    f64 end = f64_min(leave, search.best_t);
    BrickWalk walk = brick_walk_from(search.ray, enter, end);
    walk.shift = BRICK_SHIFT;
    walk.corner = corner;
    brick_walk_descend(walk, search.ray);
    Found found = first_of_walk(walk, instance, search.ray, CELL_SHIFT, search.start, end, number);
    found_in_brick(search, found, number);
    return false;
}

#endif

// Tests an item of any kind in a search along a ray.
bool visit(InstanceRef instance, inout Search search, uint item) {
    if (is_mesh(instance)) {
        return visit_triangle(instance, search, item);
    }
#ifndef FRONT_BVH
    if (has_bricks(instance)) {
        return visit_brick(instance, search, item);
    }
#endif
    return NEEDS_BOXES != 0u && visit_box(instance, search, item);
}

#if defined(FRONT_BVH)
#include "front_bvh.glsl"
#elif defined(FRONT_QUERY)
#include "front_query.glsl"
#elif defined(FRONT_PIPELINE)
#include "front_pipeline.glsl"
#endif

#ifndef ONLY_VISITS

// The ray moved to the bounds of all boxes; false where it misses them.
bool bvh_ray(InstanceRef instance, IndexRay ray, f64 start, f64 t_max, out BvhRay moved, out f64 enter_all) {
    uvec3 lo = uvec3(instance.it.lo[0], instance.it.lo[1], instance.it.lo[2]);
    uvec3 hi = uvec3(instance.it.hi[0], instance.it.hi[1], instance.it.hi[2]);
    if (lo.x >= hi.x) {
        return false;
    }
    f64 leave;
    clip(ray, lo, hi, start, enter_all, leave);
    if (f64_le(leave, enter_all) || f64_le(t_max, enter_all)) {
        return false;
    }
    f64 far = enter_all;
    ROLLED for (uint a = 0u; a < 3u; a++) {
        far = f64_max(far, f64_abs(ray.origin[a]));
        f64 at = f64_add(ray.origin[a], f64_mul(enter_all, ray.direction[a]));
        moved.origin[a] = f64_to_f32(f64_clamp(at, f64_from_u32(lo[a]), f64_from_u32(hi[a])));
        moved.inverse[a] = clamp(f64_to_f32(ray.inverse[a]), -TWO_POW_60, TWO_POW_60);
    }
    // Three roundings of doubles in the move.
    moved.pad = instance.it.pad + f64_to_f32(f64_mul(f64_mul(far, f64_exp2(2)), f64_exp2(-52)));
    return true;
}

// The nearest face with scaled t in (start, t_max), or what is at `start`, or the nearest triangle. With `any`, the first one found
// suffices.
Search nearest(InstanceRef instance, IndexRay ray, uint leaving, f64 start, f64 t_max, uint only, bool any) {
    Search search;
    search.ray = ray;
    search.start = start;
    search.t_max = t_max;
    search.best_t = t_max;
    search.enter_all = F64_ZERO;
    search.pad = 0.0;
    search.only = only;
    search.seek = any ? SEEK_ANY : SEEK_NEAREST;
    search.kind = NEAREST_NOTHING;
    search.label = NONE;
    search.box_number = NONE;
    search.step = Step(F64_ZERO, 0u, 0u, uvec3(0u), 0u);
    search.leaving = leaving;
    search.axes = 0u;
    search.shear = vec2(0.0);
    bool by_bricks = has_bricks(instance) && only == NONE;
    if (by_bricks) {
        // Searches the nearest even where any hit suffices: for a ray that starts within a label, what is at its start decides.
        search.seek = SEEK_NEAREST;
    }
#ifdef FRONT_BVH
    bool by_walk = by_bricks;
#else
    // Hardware has no hierarchy over pages, which come and go.
    bool by_walk = by_bricks && is_paged(instance);
#endif
    if (by_walk) {
        uint brick;
        Found found = first_voxel(instance, ray, start, t_max, brick);
        found_in_brick(search, found, brick);
    }
    BvhRay moved;
    if (!by_walk && bvh_ray(instance, ray, start, t_max, moved, search.enter_all)) {
        search.pad = moved.pad;
        if (is_mesh(instance)) {
            start_in_grid(search);
        }
        along_ray(instance, moved, search);
    }
    if (by_bricks && search.kind != NEAREST_NOTHING) {
        // Only now is the box of the voxel determined.
        search.box_number = brick_part(instance, search.box_number, search.step.voxel, NONE);
        search.label = label_of_box(instance, search.box_number);
    }
    return search;
}

// The box of `label` (NONE: of any) that has an element at `voxel`, or NONE.
uint item_with(InstanceRef instance, uint label, uvec3 voxel) {
    for (uint a = 0u; a < 3u; a++) {
        if (voxel[a] < instance.it.lo[a] || voxel[a] >= instance.it.hi[a]) {
            return NONE;
        }
    }
    if (has_bricks(instance)) {
        return item_in_bricks(instance, label, voxel);
    }
    if (NEEDS_BOXES == 0u) {
        return NONE;
    }
    Search search;
    search.ray.scaled_from_world = F64_ONE;
    for (uint a = 0u; a < 3u; a++) {
        search.ray.origin[a] = F64_ZERO;
        search.ray.direction[a] = F64_ONE;
        search.ray.inverse[a] = F64_ONE;
    }
    search.start = F64_ZERO;
    search.t_max = F64_ONE;
    search.enter_all = F64_ZERO;
    search.best_t = F64_ONE;
    search.pad = 0.0;
    search.only = label;
    search.seek = SEEK_HOLDER;
    search.kind = NEAREST_NOTHING;
    search.label = NONE;
    search.box_number = NONE;
    search.step = Step(F64_ZERO, 0u, 0u, voxel, 0u);
    search.leaving = NONE;
    search.axes = 0u;
    search.shear = vec2(0.0);
    at_voxel(instance, voxel, search);
    return search.box_number;
}

Hit hit_of(InstanceRef instance, uint instance_number, IndexRay ray, Step step, uint item, bool from_inside) {
    uint axis = step.axis;
    bool positive = is_down(ray, axis) != from_inside;
    uvec3 voxel = from_inside ? voxel_before(step, ray) : step.voxel;
    uvec3 element = voxel;
    if (instance.it.lod == LEVEL_CELLS) {
        element = voxel & ~3u;
    } else if (instance.it.lod != LEVEL_VOXELS) {
        BoxPlace p = box_place(instance, item);
        element = p.level == LEVEL_VOXELS ? voxel : p.level == LEVEL_CELLS ? voxel & ~3u : p.origin;
    }
    DVec3 normal = dvec3_from_bits(instance.it.normals[axis]);
    return Hit(world_t(ray, axis, step.plane),
        Surface(instance_number, SURFACE_FACE, element, axis, positive, step.plane, label_of_box(instance, item), item),
        positive ? normal : dvec3_neg(normal), from_inside);
}

// Near an edge of the entered voxel: the face that was found if nothing that the ray may hit stands before it, else the first face that is
// open in this way, if any. `only` NONE: every drawn label counts.
Step open_face(InstanceRef instance, IndexRay ray, Step step, f64 t_max, uint only) {
    f64 least = f64_sub(step.t, TIE);
    [[dont_unroll]] for (uint i = 0u; i < 4u; i++) {
        Step face = step;
        if (i > 0u) {
            face = through(step, i - 1u, ray);
            if (!(f64_le(least, face.t) && f64_lt(F64_ZERO, face.t) && f64_lt(face.t, t_max))) {
                continue;
            }
        }
        uvec3 before = step.voxel;
        before[face.axis] += is_down(ray, face.axis) ? 1u : 0xFFFFFFFFu;
        if (item_with(instance, only, before) == NONE) {
            return face;
        }
    }
    return step;
}

// The end of a ray's way through one box of `label`: the label's box in which it goes on, or NONE where it leaves the label. It leaves
// through `step.axis` or, where it crosses several faces in this step, through the first that has something else behind it. The twin asks
// these two questions in `leave` and `face_out`; here they are one loop, because shaders inline the search that answers them.
uint box_behind(InstanceRef instance, IndexRay ray, inout Step step, bool left_box, uint label) {
    uvec3 last = voxel_before(step, ray);
    uint faces = bitCount(step.tied) > 1 ? step.tied : 0u;
    // Bit 0 is the voxel where the ray goes on, bit a + 1 the one behind the face of axis a.
    uint voxels = (faces << 1) | (left_box ? 1u : 0u);
    while (voxels != 0u) {
        uint number = uint(findLSB(voxels));
        voxels &= ~(1u << number);
        uvec3 voxel = step.voxel;
        if (number > 0u) {
            voxel = last;
            voxel[number - 1u] = step.voxel[number - 1u];
        }
        uint item = item_with(instance, label, voxel);
        if (number == 0u && item != NONE) {
            return item;
        }
        if (number > 0u && item == NONE) {
            step = through(step, number - 1u, ray);
            return NONE;
        }
    }
    return NONE;
}

// The face through which a ray that starts in `voxel` of `label` leaves the label. `within`: the ray does not leave it before t_max.
Hit leave(InstanceRef instance, uint instance_number, IndexRay ray, uint label, uvec3 voxel, uint item, f64 t_max, out bool within) {
    f64 t = F64_ZERO;
    within = false;
    while (true) {
        BoxView b = get_box(instance, item);
        uvec3 hi = clipped_end(instance, b.origin, b.extent);
        Walk walk = walk_begin_in(ray, b.origin, hi, t, true, voxel);
        bool left_box;
        Step step = walk_last_solid(walk, ray, b, left_box);
        if (f64_le(t_max, step.t)) {
            within = true;
            return no_hit();
        }
        uint next = box_behind(instance, ray, step, left_box, label);
        if (next == NONE) {
            if (f64_lt(F64_ZERO, step.t) && f64_lt(step.t, t_max)) {
                return hit_of(instance, instance_number, ray, step, item, true);
            }
            within = f64_lt(F64_ZERO, step.t);
            return no_hit();
        }
        item = next;
        voxel = step.voxel;
        t = f64_max(t, step.t);
    }
    return no_hit();
}

CutPlane cut_plane_at(InstanceRef instance, uint number) {
    return CutPlanes(instance.it.cut_planes).at[number];
}

// The cap at scaled t in a plane of the cuts.
Hit cap(InstanceRef instance, uint instance_number, IndexRay ray, f64 t, uint plane, uint label, uvec3 voxel, bool from_inside) {
    return Hit(f64_div(t, ray.scaled_from_world),
        Surface(instance_number, SURFACE_CAP, voxel, 0u, false, plane, label, NONE),
        dvec3_from_bits(cut_plane_at(instance, plane).normal_in_world), from_inside);
}

// The voxel where the ray is at scaled t.
uvec3 voxel_at(InstanceRef instance, IndexRay ray, f64 t) {
    uvec3 voxel;
    ROLLED for (int a = 0; a < 3; a++) {
        f64 at = f64_floor(f64_add(ray.origin[a], f64_mul(t, ray.direction[a])));
        voxel[a] = f64_to_u32(f64_clamp(at, F64_ZERO, f64_from_u32(instance.it.dims[a] - 1u)));
    }
    return voxel;
}

// One past the highest voxel of a voxel's cell, but at most `end`.
uvec3 cell_end(uvec3 voxel, uvec3 end) {
    return min((voxel | 3u) + 1u, end);
}

// One past the highest voxel of a surface's element.
uvec3 element_end(InstanceRef instance, Surface surface) {
    uvec3 voxel_end = surface.voxel + 1u;
    if (instance.it.lod == LEVEL_VOXELS) {
        return voxel_end;
    }
    if (instance.it.lod == LEVEL_CELLS) {
        return cell_end(surface.voxel, dims_of(instance));
    }
    uint item = surface.box_number != NONE ? surface.box_number : item_with(instance, surface.label, surface.voxel);
    if (item == NONE) {
        return voxel_end;
    }
    BoxPlace p = box_place(instance, item);
    uvec3 hi = clipped_end(instance, p.origin, p.extent);
    return p.level == LEVEL_VOXELS ? voxel_end : p.level == LEVEL_CELLS ? cell_end(surface.voxel, hi) : hi;
}

bool index_ray(InstanceRef instance, uint instance_number, RayInWorld ray, Surface from, out IndexRay result) {
    uvec3 upper = uvec3(0u);
    f64 plane = F64_ZERO;
    bool to_mesh = is_mesh(instance);
    if (from.instance != instance_number || to_mesh) {
        from.instance = NONE;
    } else if (from.kind == SURFACE_FACE) {
        upper = element_end(instance, from);
    } else if (from.plane < instance.it.cut_plane_count) {
        CutPlane cut = cut_plane_at(instance, from.plane);
        from.axis = cut.axis;
        plane = cut_plane_across_axis(cut);
    } else {
        from.instance = NONE;
    }
    return index_ray_new(placement_of(instance), ray, from, upper, plane, to_mesh, result);
}

// The ray, for the cuts. (The world-space ray decides to which side of a cap it goes, because the integrator used that one.)
CutRay cut_ray(InstanceRef instance, uint instance_number, IndexRay ray, RayInWorld in_world, Surface from) {
    CutRay cut = CutRay(instance.it.cut_planes, instance.it.cut_plane_count, ray, NONE, false);
    if (from.instance == instance_number && from.kind == SURFACE_CAP && from.plane < cut.count) {
        DVec3 normal = dvec3_from_bits(cut_plane_at(instance, from.plane).normal_in_world);
        cut.from = from.plane;
        cut.outward = f64_le(F64_ZERO, dvec3_dot(normal, in_world.direction));
    }
    return cut;
}

// The first hit, or with `any` some hit where one suffices, or with `only` the next boundary of that label. It is one function for the
// queries of the twin, because shaders inline what they call. Cuts divide a ray into pieces, which are traced one by one; without cuts
// there is one piece.
//
// Hits farther than `best` do not matter.
Hit volume_ask(
    InstanceRef instance, uint instance_number, RayInWorld ray, Surface from, f64 t_max, f64 best, uint only, bool any) {
    IndexRay r;
    // Not from a free point or a mesh: within a label, a seam between two of its boxes would be found first.
    any = any
        && (is_mesh(instance)
            || (from.instance != NONE && from.kind != SURFACE_TRIANGLE && instance.it.lod != LOD_BY_DISTANCE));
    if (!index_ray(instance, instance_number, ray, from, r)) {
        return no_hit();
    }
    bool is_cut = NEEDS_CUTS != 0u && instance.it.cut_plane_count > 0u;
    CutRay cut;
    if (is_cut) {
        cut = cut_ray(instance, instance_number, r, ray, from);
    }
    uint leaving = is_mesh(instance) && from.instance == instance_number ? from.plane : NONE;
    t_max = reach(r, t_max, best);
    f64 start = F64_ZERO;
    while (true) {
        f64 end = F64_INFINITY;
        uint entry = NONE, exit = NONE;
        if (is_cut) {
            start = cut_ray_kept_from(cut, start, entry);
            if (f64_le(t_max, start)) {
                return no_hit();
            }
            end = cut_ray_kept_to(cut, start, exit);
        }
        f64 limit = f64_min(end, t_max);
        Search found = nearest(instance, r, leaving, start, limit, only, any);
        if (NEEDS_MESHES != 0u && found.kind == NEAREST_TRIANGLE) {
            return mesh_hit(instance, instance_number, r, found.best_t, found.box_number);
        }
        if (found.kind == NEAREST_FACE) {
            Step step = found.step;
            // Where any hit suffices, its face is not used.
            if (!any && is_near_edge(step, r)) {
                step = open_face(instance, r, step, limit, only);
            }
            return hit_of(instance, instance_number, r, step, found.box_number, false);
        }
        if (found.kind == NEAREST_INSIDE && entry != NONE) {
            return cap(instance, instance_number, r, start, entry, found.label, found.step.voxel, false);
        }
        if (found.kind == NEAREST_INSIDE) {
            bool within;
            Hit hit = leave(instance, instance_number, r, found.label, found.step.voxel, found.box_number, limit, within);
            if (!within || f64_le(t_max, end)) {
                return hit;
            }
            return cap(instance, instance_number, r, end, exit, found.label, voxel_at(instance, r, end), true);
        }
        if (f64_le(t_max, end)) {
            return no_hit();
        }
        start = end;
    }
    return no_hit();
}

// The shading normal of a face at a point; false where it is the geometric normal, as for caps and coarse elements.
bool volume_smooth_normal(InstanceRef instance, Surface surface, DVec3 point, out DVec3 normal) {
    normal = point;
    if (instance.it.neighbors == 0UL || surface.kind != SURFACE_FACE) {
        return false;
    }
    uint item = surface.box_number != NONE ? surface.box_number : item_with(instance, surface.label, surface.voxel);
    if (item == NONE || box_place(instance, item).level != LEVEL_VOXELS) {
        return false;
    }
    Placement placement = placement_of(instance);
    DVec3 p = index_from_world(placement, dvec3_sub(point, placement.translation));
    p.at[min(surface.axis, 2u)] = f64_from_u32(surface.plane);
    vec3 outward = falling_off(instance, item, p);
    float largest = max(max(abs(outward.x), abs(outward.y)), abs(outward.z));
    if (largest <= 0.0) {
        return false;
    }
    // In a hollow the gradient may point to the other side of the face.
    outward /= largest;
    normal = normal_of(placement, dvec3_of(f64_from_f32(outward.x), f64_from_f32(outward.y), f64_from_f32(outward.z)));
    f64 own = dvec3_dot(normal, dvec3_from_bits(instance.it.normals[min(surface.axis, 2u)]));
    return f64_lt(F64_ZERO, surface.positive ? own : f64_neg(own));
}

#endif

#endif

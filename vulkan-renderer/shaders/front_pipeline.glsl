// Finds boxes with hardware's hierarchy in a ray tracing pipeline. Rays carry floats alone, so the search state lies in scratch memory, one
// for each ray of the launch, where ray generation and intersection shader both reach it. There is no payload, no attributes and no
// closest-hit shader.
#ifndef FRONT_PIPELINE_GLSL
#define FRONT_PIPELINE_GLSL

#include "hardware_ray.glsl"

// Volatile: what the intersection shader wrote must be read again after the trace. (The compiler emits nothing for `shadercallcoherent`
// where a block is read as a whole, and a driver then gave the ray generation shader the old search state.)
layout(buffer_reference, scalar, buffer_reference_align = 8) volatile buffer SearchRef { Search it; };

// The search state of this ray of the launch.
SearchRef search_of_launch(Address scratch) {
    uint index = (gl_LaunchIDEXT.z * gl_LaunchSizeEXT.y + gl_LaunchIDEXT.y) * gl_LaunchSizeEXT.x + gl_LaunchIDEXT.x;
    return SearchRef(scratch + uint64_t(index) * uint64_t(SCRATCH_BYTES));
}

#ifdef ONLY_VISITS

// The intersection shader: tests one box, and reduces hardware's range to the search's limit.
void visit_in_pipeline(InstanceRef instance, Address scratch, uint item) {
    SearchRef shared_search = search_of_launch(scratch);
    Search search = shared_search.it;
    f64 t_before = search.best_t;
    uint kind_before = search.kind, number_before = search.box_number;
    bool over = search.seek == SEEK_HOLDER ? visit_holder(instance, search, item) : visit(instance, search, item);
    // Most visits find nothing nearer, and write nothing.
    if (search.kind != kind_before || search.box_number != number_before || !f64_eq(search.best_t, t_before)) {
        shared_search.it.best_t = search.best_t;
        shared_search.it.kind = search.kind;
        shared_search.it.label = search.label;
        shared_search.it.box_number = search.box_number;
        shared_search.it.step = search.step;
    }
    float limit = max(search_limit(search), 0.0);
    if (over) {
        reportIntersectionEXT(0.0, 0u);
    } else if (search.seek == SEEK_NEAREST && limit < gl_RayTmaxEXT) {
        reportIntersectionEXT(limit, 0u);
    }
}

#else

void trace_boxes(InstanceRef instance, HardwareRay ray, inout Search search) {
    if (instance.it.box_count == 0u) {
        return;
    }
    SearchRef shared_search = search_of_launch(launch.scratch);
    shared_search.it = search;
    uint flags = gl_RayFlagsSkipClosestHitShaderEXT | gl_RayFlagsOpaqueEXT;
    if (search.seek != SEEK_NEAREST) {
        flags |= gl_RayFlagsTerminateOnFirstHitEXT;
    }
    traceRayEXT(accelerationStructureEXT(instance.it.acceleration), flags, 0xFFu, 0u, 0u, 0u, ray.origin, 0.0, ray.direction,
        ray.t_max, 0);
    search = shared_search.it;
}

void along_ray(InstanceRef instance, BvhRay moved, inout Search search) {
    trace_boxes(instance, hardware_ray(moved, search), search);
}

void at_voxel(InstanceRef instance, uvec3 voxel, inout Search search) {
    trace_boxes(instance, hardware_point(voxel), search);
}

#endif

#endif

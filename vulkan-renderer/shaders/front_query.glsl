// Finds boxes with hardware's hierarchy through a ray query. A candidate is committed only to reduce the query's range to the search's
// limit. The committed hit is never read (on some drivers reading it after a miss is fatal).
#ifndef FRONT_QUERY_GLSL
#define FRONT_QUERY_GLSL

#extension GL_EXT_ray_query : require

#include "hardware_ray.glsl"

void query_boxes(InstanceRef instance, HardwareRay ray, bool of_voxel, inout Search search) {
    if (instance.it.box_count == 0u) {
        return;
    }
    rayQueryEXT query;
    rayQueryInitializeEXT(query, accelerationStructureEXT(instance.it.acceleration), gl_RayFlagsNoneEXT, 0xFFu, ray.origin, 0.0,
        ray.direction, ray.t_max);
    float reach = ray.t_max;
    while (rayQueryProceedEXT(query)) {
        if (rayQueryGetIntersectionTypeEXT(query, false) != gl_RayQueryCandidateIntersectionAABBEXT) {
            continue;
        }
        uint item = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false));
        if (of_voxel ? visit_holder(instance, search, item) : visit(instance, search, item)) {
            rayQueryTerminateEXT(query);
            return;
        }
        float limit = max(search_limit(search), 0.0);
        if (!of_voxel && limit < reach) {
            reach = limit;
            rayQueryGenerateIntersectionEXT(query, limit);
        }
    }
}

void along_ray(InstanceRef instance, BvhRay moved, inout Search search) {
    query_boxes(instance, hardware_ray(moved, search), false, search);
}

void at_voxel(InstanceRef instance, uvec3 voxel, inout Search search) {
    query_boxes(instance, hardware_point(voxel), true, search);
}

#endif

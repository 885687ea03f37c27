#version 460
// As trace_rays_query.comp, with the number of operations on doubles in each record, for measurements.
#extension GL_GOOGLE_include_directive : require
#define COUNTS_F64
#define FRONT_QUERY

#include "trace_rays_in_groups.glsl"

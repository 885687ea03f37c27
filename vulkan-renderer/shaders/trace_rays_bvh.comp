#version 460
#extension GL_GOOGLE_include_directive : require
#define FRONT_BVH

#include "trace_rays_in_groups.glsl"

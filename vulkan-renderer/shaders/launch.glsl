// The push constants of every entry point.
#ifndef LAUNCH_GLSL
#define LAUNCH_GLSL

#include "layout.glsl"

layout(push_constant, scalar) uniform PushConstants { Launch launch; };

#endif

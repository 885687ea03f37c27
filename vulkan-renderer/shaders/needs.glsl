// What a scene needs, as specialisation constants: what it does not is not compiled. Twin of pack/needs.rs. (Constant 0 is the
// number of the probe's function.)
#ifndef NEEDS_GLSL
#define NEEDS_GLSL

// Some label has a specular layer or is metal.
layout(constant_id = 1) const uint NEEDS_LOBES = 1u;
// A picture surrounds the scene.
layout(constant_id = 2) const uint NEEDS_PICTURE = 1u;
// Some light is aimed at.
layout(constant_id = 3) const uint NEEDS_AIM = 1u;

#endif

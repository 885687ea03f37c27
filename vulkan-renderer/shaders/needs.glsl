// What a scene needs, as specialisation constants: what it does not is not compiled. Twin of pack/needs.rs. (Constant 0 is the
// number of the probe's function.)
#ifndef NEEDS_GLSL
#define NEEDS_GLSL

// Some label has microfacets: metal, glass, a dielectric layer.
layout(constant_id = 1) const uint NEEDS_LOBES = 1u;
// A picture surrounds the scene.
layout(constant_id = 2) const uint NEEDS_PICTURE = 1u;
// Some light is aimed at.
layout(constant_id = 3) const uint NEEDS_LIGHT_SAMPLING = 1u;
// The camera's opening has a size.
layout(constant_id = 4) const uint NEEDS_LENS = 1u;
// Lamps stand in the scene.
layout(constant_id = 5) const uint NEEDS_LAMPS = 1u;
// Some label has a clear coat.
layout(constant_id = 6) const uint NEEDS_COAT = 1u;
// Some label is glass, wholly or in part.
layout(constant_id = 7) const uint NEEDS_GLASS = 1u;
// Some label is not wholly there.
layout(constant_id = 8) const uint NEEDS_TRANSPARENT = 1u;
// Something is cut away.
layout(constant_id = 9) const uint NEEDS_CUTS = 1u;
// There are triangle meshes.
layout(constant_id = 10) const uint NEEDS_MESHES = 1u;
// Light is clamped, or sorted for passes or a transparent film.
layout(constant_id = 11) const uint NEEDS_SORTED = 1u;
// Some label has sheen.
layout(constant_id = 12) const uint NEEDS_SHEEN = 1u;
// Surfaces that shine are aimed at.
layout(constant_id = 13) const uint NEEDS_EMITTERS = 1u;
// Pixels keep which labels they see, by name.
layout(constant_id = 14) const uint NEEDS_MATTES = 1u;
// Some surface is shaded by another normal than its own.
layout(constant_id = 15) const uint NEEDS_SMOOTH = 1u;
// Some mesh is a shadow catcher.
layout(constant_id = 16) const uint NEEDS_CATCHER = 1u;
// There are so many instances that a hierarchy over them pays.
layout(constant_id = 17) const uint NEEDS_INSTANCE_TREE = 1u;
// Some volume is drawn by bricks.
layout(constant_id = 18) const uint NEEDS_BRICKS = 1u;
// Some volume is drawn by boxes.
layout(constant_id = 19) const uint NEEDS_BOXES = 1u;

#endif

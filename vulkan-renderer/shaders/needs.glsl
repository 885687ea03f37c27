// What a scene needs, as specialisation constants, so that nothing else is compiled. Twin of pack/needs.rs. (Constant 0 is the number of
// the probe's function.)
#ifndef NEEDS_GLSL
#define NEEDS_GLSL

// Some label has microfacets: metal, glass, a dielectric layer.
layout(constant_id = 1) const uint NEEDS_LOBES = 1u;
// The sky is an environment map.
layout(constant_id = 2) const uint NEEDS_PICTURE = 1u;
// Some light is sampled.
layout(constant_id = 3) const uint NEEDS_LIGHT_SAMPLING = 1u;
// The lens aperture has a size (depth of field).
layout(constant_id = 4) const uint NEEDS_LENS = 1u;
// There are lamps in the scene.
layout(constant_id = 5) const uint NEEDS_LAMPS = 1u;
// Some label has a clear coat.
layout(constant_id = 6) const uint NEEDS_COAT = 1u;
// Some label transmits light, wholly or in part.
layout(constant_id = 7) const uint NEEDS_GLASS = 1u;
// Some label has an alpha below 1.
layout(constant_id = 8) const uint NEEDS_TRANSPARENT = 1u;
// Some instance has cuts.
layout(constant_id = 9) const uint NEEDS_CUTS = 1u;
// There are triangle meshes.
layout(constant_id = 10) const uint NEEDS_MESHES = 1u;
// Light is clamped, or divided into sums for render passes or a transparent film.
layout(constant_id = 11) const uint NEEDS_SORTED = 1u;
// Some label has sheen.
layout(constant_id = 12) const uint NEEDS_SHEEN = 1u;
// Emissive surfaces are sampled as lights.
layout(constant_id = 13) const uint NEEDS_EMITTERS = 1u;
// Pixels count the Cryptomatte ids that they see.
layout(constant_id = 14) const uint NEEDS_MATTES = 1u;
// Some surface has a shading normal other than its geometric one.
layout(constant_id = 15) const uint NEEDS_SMOOTH = 1u;
// Some mesh is a shadow catcher.
layout(constant_id = 16) const uint NEEDS_CATCHER = 1u;
// There are enough instances for a hierarchy over them to pay.
layout(constant_id = 17) const uint NEEDS_INSTANCE_TREE = 1u;
// Some volume is drawn by bricks.
layout(constant_id = 18) const uint NEEDS_BRICKS = 1u;
// Some volume is drawn by boxes.
layout(constant_id = 19) const uint NEEDS_BOXES = 1u;
// There are so many lamps that a tree chooses among them.
layout(constant_id = 20) const uint NEEDS_LAMP_TREE = 1u;
// Some volume is drawn in pages, of which some are on the device.
layout(constant_id = 21) const uint NEEDS_PAGES = 1u;

#endif

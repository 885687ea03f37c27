//! What a scene needs of the shaders. Specialisation constants carry it, so the driver compiles nothing that the scene does not need.

use pumice_scene::{Part, PartSet};

/// The part of a renderer that each specialisation constant enables, by the constant's number. Number 0 belongs to the probe.
const PARTS: [(usize, Part); 18] = [
    (1, Part::Microfacets),
    (2, Part::SkyPicture),
    (3, Part::LightSampling),
    (4, Part::Lens),
    (5, Part::Lamps),
    (6, Part::Coats),
    (7, Part::Glass),
    (8, Part::Transparent),
    (9, Part::Cuts),
    (10, Part::Meshes),
    (11, Part::Sorting),
    (12, Part::Sheen),
    (13, Part::Emitters),
    (14, Part::Mattes),
    (15, Part::SmoothNormals),
    (16, Part::Catchers),
    (INSTANCE_TREE, Part::InstanceTree),
    (20, Part::LampTree),
];
const INSTANCE_TREE: usize = 17;
const BRICKS: usize = 18;
const BOXES: usize = 19;
const PAGES: usize = 21;

/// Number of specialisation constants that tell what a scene needs.
pub const CONSTANTS: usize = 22;
/// Number of the constant after them: whether the walk through bricks compares floats before doubles.
pub const FLOATS_FIRST: usize = CONSTANTS;

/// Parts that are left out on a device where a scene does not need them, in the compiled code or in memory.
pub const LEAVES_OUT: PartSet = {
    let (mut all, mut i) = (PartSet::NONE.with(Part::HiddenLabels).with(Part::Levels), 0);
    while i < PARTS.len() {
        all = all.with(PARTS[i].1);
        i += 1;
    }
    all
};

/// Parts that decide which surface a ray meets and how it is turned. A ray for render passes of the surface needs no others. (Where light
/// passes through volumes that touch, the back of a label comes before the front of another.)
const OF_SURFACES: PartSet = PartSet::NONE
    .with(Part::Cuts)
    .with(Part::Meshes)
    .with(Part::SmoothNormals)
    .with(Part::InstanceTree)
    .with(Part::Glass)
    .with(Part::Transparent);

/// Twin of `shaders/needs.glsl`: what the scene needs, and in which form it lies on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ShaderNeeds {
    /// Parts that the scene needs.
    pub parts: PartSet,
    /// There is a hierarchy over instances. None is built where no instance draws anything.
    pub instance_tree: bool,
    /// Some volume is drawn by bricks.
    pub bricks: bool,
    /// Some volume is drawn by boxes.
    pub boxes: bool,
    /// Some volume is drawn in pages.
    pub pages: bool,
}

impl ShaderNeeds {
    /// What first surfaces need: nothing of what is only needed for light.
    #[must_use]
    pub fn of_surfaces(self) -> Self {
        Self { parts: self.parts.and(OF_SURFACES), ..self }
    }

    /// Specialisation constants, indexed by their numbers.
    pub fn constants(&self) -> [u32; CONSTANTS] {
        let mut constants = [0; CONSTANTS];
        for (number, part) in PARTS {
            constants[number] = u32::from(self.parts.has(part));
        }
        constants[INSTANCE_TREE] = u32::from(self.instance_tree);
        constants[BRICKS] = u32::from(self.bricks);
        constants[BOXES] = u32::from(self.boxes);
        constants[PAGES] = u32::from(self.pages);
        constants
    }
}

//! What a scene needs of its shaders: specialisation constants, so that what it does not need is not compiled.

use pumice_scene::{Part, PartSet};

/// What each specialisation constant compiles, by its number; number 0 is the probe's.
const PARTS: [(usize, Part); 17] = [
    (1, Part::Microfacets),
    (2, Part::SkyPicture),
    (3, Part::Aiming),
    (4, Part::Lens),
    (5, Part::Lamps),
    (6, Part::Coats),
    (7, Part::Glass),
    (8, Part::Clear),
    (9, Part::Cuts),
    (10, Part::Meshes),
    (11, Part::Sorting),
    (12, Part::Sheen),
    (13, Part::Emitters),
    (14, Part::Mattes),
    (15, Part::SmoothNormals),
    (16, Part::Catchers),
    (INSTANCE_TREE, Part::InstanceTree),
];
const INSTANCE_TREE: usize = 17;
const BRICKS: usize = 18;
const BOXES: usize = 19;

/// What is left out on a device where a scene does not need it: what constants compile, and what lies there.
pub const LEAVES_OUT: PartSet = {
    let (mut all, mut i) = (PartSet::NONE.with(Part::HiddenLabels).with(Part::Levels), 0);
    while i < PARTS.len() {
        all = all.with(PARTS[i].1);
        i += 1;
    }
    all
};

/// Twin of `shaders/needs.glsl`: what the scene needs, and how it lies on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ShaderNeeds {
    /// What the scene needs.
    pub parts: PartSet,
    /// There is a hierarchy over instances: none is made of instances that draw nothing.
    pub instance_tree: bool,
    /// Some volume is drawn by bricks.
    pub bricks: bool,
    /// Some volume is drawn by boxes.
    pub boxes: bool,
}

impl ShaderNeeds {
    /// Specialisation constants by their numbers.
    pub fn constants(&self) -> [u32; 20] {
        let mut constants = [0; 20];
        for (number, part) in PARTS {
            constants[number] = u32::from(self.parts.has(part));
        }
        constants[INSTANCE_TREE] = u32::from(self.instance_tree);
        constants[BRICKS] = u32::from(self.bricks);
        constants[BOXES] = u32::from(self.boxes);
        constants
    }
}

//! What a scene needs of its shaders: specialisation constants, so that what it does not need is not compiled.

use pumice_cpu::{Lights, Sky};

use super::PackedLooks;

/// Twin of `shaders/needs.glsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ShaderNeeds {
    /// Some label has a specular layer or is metal.
    pub lobes: bool,
    /// A picture surrounds the scene.
    pub picture: bool,
    /// Some light is aimed at.
    pub aim: bool,
}

impl ShaderNeeds {
    /// What these lights and these looks of all instances need.
    pub fn new<'a>(lights: &Lights, looks: impl IntoIterator<Item = &'a PackedLooks>) -> Self {
        Self {
            lobes: looks
                .into_iter()
                .flat_map(|l| &l.materials)
                .any(|m| m.metallic > 0.0 || (m.specular > 0.0 && m.ior != 1.0)),
            picture: matches!(lights.sky(), Sky::Image(_)),
            aim: lights.any_aimed(),
        }
    }

    /// Specialisation constants by their numbers; number 0 is the probe's.
    pub fn constants(&self) -> [u32; 4] {
        [0, u32::from(self.lobes), u32::from(self.picture), u32::from(self.aim)]
    }
}

//! The scene: instances of volumes with the materials of their labels, meshes, camera, lights and settings.

use std::path::PathBuf;

use glam::DAffine3;
use serde::{Deserialize, Serialize};

use crate::{
    Camera, Cut, CutShape, Film, LabelGroups, LabelMaterials, Light, Material, Mesh, Reading, Settings, Show,
    Sun, World,
};

/// Version of the JSON form that this code writes and reads.
pub const SCENE_VERSION: u32 = 1;

/// How the labels of a volume look: one common material, materials of groups, and materials of single labels by id.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LabelStyle {
    /// Which labels are drawn.
    pub show: Show,
    /// Common material of the labels that are in no group and have none of their own; `auto_color` replaces its base colour.
    pub material: Material,
    /// Whether labels with the common material get colours that differ between neighbours.
    pub auto_color: bool,
    /// Groups of labels with a common material.
    pub groups: LabelGroups,
    /// Materials of single labels, by original id; they take precedence over the groups'.
    pub materials: LabelMaterials,
}

impl LabelStyle {
    /// Whether light passes through labels of some material: it then reaches the faces between labels that touch.
    pub fn lets_light_through(&self) -> bool {
        let of_groups = self.groups.iter().map(|group| &group.material);
        let mut all = self.materials.values().chain(of_groups).chain([&self.material]);
        all.any(|m| m.alpha < 1.0 || m.transmission > 0.0)
    }
}

/// A volume placed in the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Instance {
    /// Id that edits refer to; stays the same across edits and is unique among the instances.
    pub id: u32,
    /// A `.pumice` file or any label volume; relative paths are relative to the scene file.
    pub source: PathBuf,
    /// How the source is read where the file alone does not decide it.
    #[serde(default, skip_serializing_if = "Reading::is_empty")]
    pub reading: Reading,
    /// Maps the volume's index space to the world. Mirrored and sheared matrices are allowed, singular ones are not.
    pub world_from_index: DAffine3,
    /// Which labels are drawn, and their materials.
    #[serde(default)]
    pub style: LabelStyle,
}

/// Everything that a renderer needs to know to draw a picture, except the data of volumes, meshes and skies, which are files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Version of the JSON form; must be [`SCENE_VERSION`].
    pub version: u32,
    /// Volumes placed in the world.
    pub instances: Vec<Instance>,
    /// The camera.
    pub camera: Camera,
    /// Size, filter and passes of the picture.
    pub film: Film,
    /// Sky and backdrop.
    pub world: World,
    /// Sun lights.
    #[serde(default)]
    pub suns: Vec<Sun>,
    /// Lamps.
    #[serde(default)]
    pub lights: Vec<Light>,
    /// Triangle meshes.
    #[serde(default)]
    pub meshes: Vec<Mesh>,
    /// Parts of space that are removed from volumes.
    #[serde(default)]
    pub cuts: Vec<Cut>,
    /// Settings of the integrator, level of detail and random seed.
    #[serde(default)]
    pub settings: Settings,
}

impl Scene {
    /// The shapes of the cuts that apply to the instance with this id.
    pub fn cuts_of(&self, instance: u32) -> impl Iterator<Item = &CutShape> {
        self.cuts.iter().filter(move |cut| cut.takes_from(instance)).map(|cut| &cut.shape)
    }
}

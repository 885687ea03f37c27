//! The scene: instances of volumes, their labels' looks, camera, light, settings.

use std::path::PathBuf;

use glam::DAffine3;
use serde::{Deserialize, Serialize};

use crate::{Camera, Cut, CutShape, Film, LabelMaterials, Light, Material, Mesh, Settings, Show, Sun, World};

/// Version of the JSON form that this code writes and reads.
pub const SCENE_VERSION: u32 = 1;

/// How the labels of a volume look: one material for all, and exceptions by id.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LabelStyle {
    /// Which labels are drawn.
    pub show: Show,
    /// Material of labels that have none of their own; its base colour is replaced where `auto_color` is set.
    pub material: Material,
    /// Gives each label a colour unlike its neighbours'.
    pub auto_color: bool,
    /// Materials by original id.
    pub materials: LabelMaterials,
}

/// A volume placed in the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Instance {
    /// Stable across edits: hits and passes name it.
    pub id: u32,
    /// A `.pumice` file or any label volume; relative paths are relative to the scene file.
    pub source: PathBuf,
    /// Maps the volume's index space to the world. Mirrored and sheared matrices are allowed, singular ones are not.
    pub world_from_index: DAffine3,
    /// Its labels' looks.
    #[serde(default)]
    pub style: LabelStyle,
}

/// Everything that is to be drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// [`SCENE_VERSION`].
    pub version: u32,
    /// Volumes.
    pub instances: Vec<Instance>,
    /// The camera.
    pub camera: Camera,
    /// The picture.
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
    /// What is cut away from the volumes.
    #[serde(default)]
    pub cuts: Vec<Cut>,
    /// How it is computed.
    #[serde(default)]
    pub settings: Settings,
}

impl Scene {
    /// What is taken away from the instance with this id.
    pub fn cuts_of(&self, instance: u32) -> impl Iterator<Item = &CutShape> {
        self.cuts.iter().filter(move |cut| cut.takes_from(instance)).map(|cut| &cut.shape)
    }
}

//! Ordinary triangle meshes beside the volumes: a floor, a scale bar, a mould.

use std::path::PathBuf;

use glam::DAffine3;
use serde::{Deserialize, Serialize};

use crate::Material;

/// A triangle mesh placed in the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// Stable across edits, and each once among the meshes.
    pub id: u32,
    /// A mesh file (`docs/formats.md` lists which); relative paths are relative to the scene file.
    pub source: PathBuf,
    /// Maps the mesh's own space to the world. Mirrored and sheared matrices are allowed, singular ones are not.
    pub world_from_mesh: DAffine3,
    /// By the material index of each triangle; at least one. Triangles past its end have the last.
    pub materials: Vec<Material>,
    /// Left out of the picture but for the shadows that it receives, as Cycles' *Shadow Catcher*.
    #[serde(default)]
    pub shadow_catcher: bool,
}

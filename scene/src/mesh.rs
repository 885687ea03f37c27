//! Ordinary triangle meshes beside the volumes: a floor, a scale bar, a mould.

use std::path::PathBuf;

use glam::DAffine3;
use serde::{Deserialize, Serialize};

use crate::Material;

/// A triangle mesh placed in the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// Id that edits refer to; stays the same across edits and is unique among the meshes.
    pub id: u32,
    /// A mesh file (`docs/formats.md` lists which), or [`Mesh::PLANE`]; relative paths are relative to the scene file.
    pub source: PathBuf,
    /// Maps the mesh's own space to the world. Mirrored and sheared matrices are allowed, singular ones are not.
    pub world_from_mesh: DAffine3,
    /// Materials, indexed by the material index of each triangle; at least one. A triangle whose index is past the end has the last.
    pub materials: Vec<Material>,
    /// Whether only the shadows that fall on the mesh are drawn, not the mesh itself: Cycles' *Shadow Catcher*.
    #[serde(default)]
    pub shadow_catcher: bool,
}

impl Mesh {
    /// Source of the built-in square from (−1, −1, 0) to (1, 1, 0), whose outside is up: a floor needs no file.
    pub const PLANE: &str = "builtin:plane";

    /// Whether the source is built in, and no file.
    pub fn is_built_in(&self) -> bool {
        self.source.as_os_str() == Self::PLANE
    }
}

//! Cuts: planes and boxes that remove parts of volumes so that the inside shows. The cut faces (caps) show the labels.

use glam::DAffine3;
use serde::{Deserialize, Serialize};

/// A part of space in which volumes are not drawn. Several cuts remove the union of their shapes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// The part of space that is removed.
    pub shape: CutShape,
    /// Ids of the instances that are cut; without a list all are cut. Meshes are never cut.
    #[serde(default)]
    pub instances: Option<Vec<u32>>,
}

impl Cut {
    /// Whether this cut applies to the instance with this id.
    pub fn takes_from(&self, instance: u32) -> bool {
        self.instances.as_ref().is_none_or(|ids| ids.contains(&instance))
    }
}

/// The shape of a cut.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum CutShape {
    /// The side of a plane that its normal points to.
    Plane {
        /// Any point of the plane, world space.
        point: [f64; 3],
        /// Normal in world space; any length above 0. The side that it points to is removed.
        normal: [f64; 3],
    },
    /// The inside of a box: the cube [−1, 1]³ under a matrix (the size of Blender's default cube and empty).
    Box {
        /// Box to world; must be invertible.
        world_from_box: DAffine3,
    },
}

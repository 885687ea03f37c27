//! What is cut away, so that one sees inside: planes and boxes. What is left ends in a cap that shows the labels.

use glam::DAffine3;
use serde::{Deserialize, Serialize};

/// A part of space in which volumes are not drawn. Several cuts take away all that any of them takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// What is taken away.
    pub shape: CutShape,
    /// Ids of the instances that are cut; none named: all of them. Meshes are never cut.
    #[serde(default)]
    pub instances: Option<Vec<u32>>,
}

impl Cut {
    /// Whether it takes away from the instance with this id.
    pub fn takes_from(&self, instance: u32) -> bool {
        self.instances.as_ref().is_none_or(|ids| ids.contains(&instance))
    }
}

/// Parts of space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum CutShape {
    /// The side of a plane that its normal points to.
    Plane {
        /// Any point of the plane, world space.
        point: [f64; 3],
        /// World space; any length above 0.
        normal: [f64; 3],
    },
    /// The inside of a box: the cube [−1, 1]³ under a matrix (the size of Blender's default cube and empty).
    Box {
        /// Box to world; must be invertible.
        world_from_box: DAffine3,
    },
}

//! Which detail each box is drawn at (paper §4.3): 16, 4 or 1 voxels, for all boxes or by distance.

use glam::{DAffine3, DVec3};
use pumice_core::BoxView;
use pumice_scene::{Camera, Film, Lod, Projection};

use super::box_walk::Level;

/// How a box's level is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LodChoice {
    /// Every voxel: exact.
    Voxels,
    /// Cells of 4³ voxels that hold any; where several labels do, the lowest dense index.
    Cells,
    /// Whole boxes, 4-voxel granular, clipped to the volume; where several overlap, the lowest dense index.
    Boxes,
    /// Per box, by its least distance D from `eye_in_world`: the coarsest level whose element (its longest edge in the world) is
    /// at most `world_constant + world_per_distance·D`. By the box, not by the ray: every ray sees the same geometry.
    Distance {
        /// The camera.
        eye_in_world: DVec3,
        /// Allowed element edge per distance (perspective).
        world_per_distance: f64,
        /// Allowed element edge whatever the distance (orthographic).
        world_constant: f64,
    },
}

impl LodChoice {
    /// The choice that the scene's settings ask for.
    pub fn new(lod: Lod, camera: &Camera, film: &Film) -> Self {
        let pixels_long = f64::from(film.width.max(film.height).max(1));
        match lod {
            Lod::Voxels => Self::Voxels,
            Lod::Cells => Self::Cells,
            Lod::Boxes => Self::Boxes,
            Lod::Distance { pixels } => {
                let (per_distance, constant) = match camera.projection {
                    Projection::Perspective { fov_rad } => (2.0 * (fov_rad / 2.0).tan() / pixels_long, 0.0),
                    Projection::Orthographic { scale } => (0.0, scale / pixels_long),
                };
                Self::Distance {
                    eye_in_world: camera.world_from_camera.translation,
                    world_per_distance: per_distance * f64::from(pixels),
                    world_constant: constant * f64::from(pixels),
                }
            }
        }
    }

    /// The level of one box.
    pub(crate) fn level(&self, b: &BoxView, world_from_index: &DAffine3) -> Level {
        match *self {
            Self::Voxels => Level::Voxels,
            Self::Cells => Level::Cells,
            Self::Boxes => Level::Boxes,
            Self::Distance { eye_in_world, world_per_distance, world_constant } => {
                // Nearest point in index space: the nearest in the world too when the axes are orthogonal, as they are but for
                // sheared matrices, where the level may be one too coarse.
                let eye = world_from_index.inverse().transform_point3(eye_in_world);
                let lo = DVec3::from(b.origin.map(f64::from));
                let hi = lo + DVec3::from(b.extent.map(f64::from));
                let distance = world_from_index.transform_vector3(eye - eye.clamp(lo, hi)).length();
                let m = world_from_index.matrix3;
                let edge = m.x_axis.length().max(m.y_axis.length()).max(m.z_axis.length());
                let allowed = world_constant + world_per_distance * distance;
                if 16.0 * edge <= allowed {
                    Level::Boxes
                } else if 4.0 * edge <= allowed {
                    Level::Cells
                } else {
                    Level::Voxels
                }
            }
        }
    }
}

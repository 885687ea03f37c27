//! Which detail each box is drawn at (paper §4.3): 16, 4 or 1 voxels, for all boxes or by distance.
//!
//! The choice is no part of the hierarchy: a box's level is found when a ray meets the box, from the placement and the choice alone,
//! so that a camera moves without anything being built.

use glam::{DAffine3, DMat3, DVec3};
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

    /// The choice, made ready for boxes of one placement.
    pub(crate) fn placed(&self, world_from_index: &DAffine3) -> Detail {
        match *self {
            Self::Voxels => Detail::Same(Level::Voxels),
            Self::Cells => Detail::Same(Level::Cells),
            Self::Boxes => Detail::Same(Level::Boxes),
            Self::Distance { eye_in_world, world_per_distance, world_constant } => {
                let m = world_from_index.matrix3;
                let edge = m.x_axis.length().max(m.y_axis.length()).max(m.z_axis.length());
                // constant + per_distance·D ≥ side·edge, solved for D².
                let from_squared = |side: f64| {
                    let missing = (side * edge - world_constant).max(0.0);
                    if missing == 0.0 { 0.0 } else { (missing / world_per_distance.max(0.0)).powi(2) }
                };
                Detail::ByDistance(ByDistance {
                    eye_in_index: world_from_index.inverse().transform_point3(eye_in_world),
                    world_from_index: m,
                    cells_from_squared: from_squared(4.0),
                    boxes_from_squared: from_squared(16.0),
                })
            }
        }
    }
}

/// See [`LodChoice::placed`].
#[derive(Clone, Copy, Debug)]
pub(crate) enum Detail {
    /// All boxes alike.
    Same(Level),
    /// See [`LodChoice::Distance`].
    ByDistance(ByDistance),
}

/// Squared distances in the world from which boxes are coarser.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ByDistance {
    eye_in_index: DVec3,
    world_from_index: DMat3,
    cells_from_squared: f64,
    boxes_from_squared: f64,
}

impl Detail {
    /// The level of one box.
    #[inline(always)]
    pub(crate) fn level(&self, b: &BoxView) -> Level {
        match self {
            Self::Same(level) => *level,
            Self::ByDistance(by) => by.level(b),
        }
    }
}

impl ByDistance {
    #[inline]
    fn level(&self, b: &BoxView) -> Level {
        // Nearest point in index space: the nearest in the world too when the axes are orthogonal, as they are but for sheared
        // matrices, where the level may be one too coarse.
        let lo = DVec3::from(b.origin.map(f64::from));
        let hi = lo + DVec3::from(b.extent.map(f64::from));
        let away = self.eye_in_index - self.eye_in_index.clamp(lo, hi);
        let distance_squared = (self.world_from_index * away).length_squared();
        if distance_squared >= self.boxes_from_squared {
            Level::Boxes
        } else if distance_squared >= self.cells_from_squared {
            Level::Cells
        } else {
            Level::Voxels
        }
    }
}

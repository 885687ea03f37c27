//! The level of detail that each box is drawn at (paper §4.3): elements of 16, 4 or 1 voxels, for all boxes or by distance.
//!
//! The choice is not part of the hierarchy: the level of a box is computed when a ray meets it, from the placement and the choice alone, so
//! a camera moves without rebuilding anything.

use crate::BoxBounds;
use glam::{DAffine3, DVec3};
use pumice_scene::{Camera, Film, Lod, Projection};

use super::each_axis;
use crate::camera_rays::fitted_side;

/// Level of detail at which the walk through a box stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DetailLevel {
    /// Every voxel.
    Voxels = 0,
    /// Whole cells of 4³ voxels that hold a voxel.
    Cells = 1,
    /// The whole box.
    Boxes = 2,
}

/// How a box's level is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LodChoice {
    /// Every voxel: exact.
    Voxels,
    /// Whole cells of 4³ voxels that hold any voxel; where cells of several labels coincide, the lowest dense index wins.
    Cells,
    /// Whole boxes, in multiples of 4 voxels, clipped to the volume; where several overlap, the lowest dense index wins.
    Boxes,
    /// Per box, by its least distance D from `eye_in_world`: the coarsest level whose element's longest edge in the world is at most
    /// `world_constant + world_per_distance·D`. The level depends on the box and not on the ray, so every ray sees the same geometry.
    Distance {
        /// Position of the camera in the world.
        eye_in_world: DVec3,
        /// Allowed element edge for each unit of distance (perspective).
        world_per_distance: f64,
        /// Allowed element edge at any distance (orthographic).
        world_constant: f64,
    },
}

impl LodChoice {
    /// The choice that the scene's settings ask for.
    pub fn new(lod: Lod, camera: &Camera, film: &Film) -> Self {
        // Pixels need not be square: the shorter side counts.
        let pixels_long = fitted_side(camera.fit, film) / film.pixel_aspect.min(1.0);
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

    /// The same levels, but chosen box by box: `Voxels` becomes a distance that no box lies beyond.
    #[must_use]
    pub fn with_level_bounds(self) -> Self {
        match self {
            Self::Voxels => {
                Self::Distance { eye_in_world: DVec3::ZERO, world_per_distance: 0.0, world_constant: 0.0 }
            }
            other => other,
        }
    }

    /// Prepares the choice for the boxes of one placement.
    pub fn placed(&self, world_from_index: &DAffine3) -> Detail {
        match *self {
            Self::Voxels => Detail::Same(DetailLevel::Voxels),
            Self::Cells => Detail::Same(DetailLevel::Cells),
            Self::Boxes => Detail::Same(DetailLevel::Boxes),
            Self::Distance { eye_in_world, world_per_distance, world_constant } => {
                let m = world_from_index.matrix3;
                let edge = m.x_axis.length().max(m.y_axis.length()).max(m.z_axis.length());
                // constant + per_distance·D ≥ side·edge, solved for (D / edge)².
                let from_squared = |side: f64| {
                    let missing = (side - world_constant / edge).max(0.0);
                    if missing == 0.0 { 0.0 } else { (missing / world_per_distance.max(0.0)).powi(2) as f32 }
                };
                let eye = world_from_index.inverse().transform_point3(eye_in_world).to_array();
                Detail::ByDistance(ByDistance {
                    eye_in_index: eye.map(|e| (e as f32).clamp(-FARTHEST_EYE, FARTHEST_EYE)),
                    edges_from_index: (m * edge.recip()).to_cols_array_2d().map(|c| c.map(|v| v as f32)),
                    cells_from_squared: from_squared(4.0),
                    boxes_from_squared: from_squared(16.0),
                })
            }
        }
    }
}

/// Voxels by which a box may extend beyond the volume.
const MOST_BEYOND: u32 = 15;

/// Squares of distances up to this are finite in f32; an eye farther away is moved to this distance.
const FARTHEST_EYE: f32 = 1e18;

/// A choice prepared for one placement; see [`LodChoice::placed`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Detail {
    /// All boxes have this level.
    Same(DetailLevel),
    /// The level depends on the distance; see [`LodChoice::Distance`].
    ByDistance(ByDistance),
}

/// Squared distances from which boxes become coarser, in units of a voxel's longest edge in the world. In f32, with products and sums in a
/// fixed order, so that a shader computes the same levels, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ByDistance {
    /// Position of the camera in index space.
    pub eye_in_index: [f32; 3],
    /// Columns of the placement's matrix, divided by the longest edge.
    pub edges_from_index: [[f32; 3]; 3],
    /// Squared distance from which cells are drawn.
    pub cells_from_squared: f32,
    /// Squared distance from which whole boxes are drawn.
    pub boxes_from_squared: f32,
}

impl Detail {
    /// The level of one box.
    #[inline(always)]
    pub fn level(&self, origin: [u32; 3], extent: [u32; 3]) -> DetailLevel {
        match self {
            Self::Same(level) => *level,
            Self::ByDistance(by) => by.level(origin, extent),
        }
    }

    /// The common level of all boxes within `bounds`, where there certainly is one: the fixed choice, or the level that the nearest and the
    /// farthest point share. `None` otherwise.
    pub fn everywhere(&self, bounds: &BoxBounds) -> Option<DetailLevel> {
        match self {
            Self::Same(level) => Some(*level),
            Self::ByDistance(by) => {
                let corners = (0..8u32).map(|c| {
                    let at = |a: usize| if c >> a & 1 == 0 { bounds.lo[a] } else { bounds.hi[a] };
                    by.distance_squared(each_axis(|a| by.eye_in_index[a] - at(a) as f32))
                });
                // Distances grow towards the corners, and eight roundings amount to far less than this factor.
                let farthest = corners.fold(0.0, f32::max) * 1.000_01;
                // (Boxes may extend beyond the volume, while their bounds end there.)
                let end = bounds.hi.map(|hi| hi.saturating_add(MOST_BEYOND));
                let nearest = by.level(bounds.lo, each_axis(|a| end[a] - bounds.lo[a]));
                match nearest {
                    _ if farthest < by.cells_from_squared => Some(DetailLevel::Voxels),
                    // Where the axes are parallel to the world's, each coordinate distance of a box is at most that of the bounds, and sums
                    // and products in f32 keep that order.
                    DetailLevel::Boxes if by.is_aligned() => Some(DetailLevel::Boxes),
                    DetailLevel::Cells if by.is_aligned() && farthest < by.boxes_from_squared => {
                        Some(DetailLevel::Cells)
                    }
                    _ => None,
                }
            }
        }
    }
}

impl ByDistance {
    /// The level of the box with this origin and extent.
    #[inline]
    pub fn level(&self, origin: [u32; 3], extent: [u32; 3]) -> DetailLevel {
        // Nearest point in index space. It is the nearest in the world too if the axes are orthogonal; for sheared matrices the level may
        // be one too coarse.
        let away = each_axis(|a| {
            let (lo, hi) = (origin[a] as f32, (origin[a] + extent[a]) as f32);
            self.eye_in_index[a] - self.eye_in_index[a].clamp(lo, hi)
        });
        let distance_squared = self.distance_squared(away);
        if distance_squared >= self.boxes_from_squared {
            DetailLevel::Boxes
        } else if distance_squared >= self.cells_from_squared {
            DetailLevel::Cells
        } else {
            DetailLevel::Voxels
        }
    }

    /// Whether each axis of index space is parallel to an axis of the world.
    fn is_aligned(&self) -> bool {
        let others = |r: usize| (0..3).filter(|&c| self.edges_from_index[c][r] != 0.0).count();
        (0..3).all(|r| others(r) == 1)
    }

    #[inline(always)]
    fn distance_squared(&self, away: [f32; 3]) -> f32 {
        let m = &self.edges_from_index;
        let [x, y, z] = each_axis(|r| m[0][r] * away[0] + m[1][r] * away[1] + m[2][r] * away[2]);
        x * x + y * y + z * z
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    /// Where `everywhere` gives a level for bounds, each box within them has that level: for placements aligned with the world's axes and
    /// oblique ones, eyes inside and far away, and boxes that extend beyond the bounds. Each level occurs, and so does `None`.
    #[test]
    fn a_level_everywhere_is_that_of_each_box() {
        let mut s = 7u64;
        let mut below = |n: u32| {
            s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((u64::from(n) * (s >> 33)) >> 31) as u32
        };
        let mut told = [0; 4];
        for i in 0..4000 {
            let mut coordinate = |most: u32| f64::from(below(most)) - f64::from(most) / 2.0;
            let matrix = match i % 3 {
                0 => DMat3::from_diagonal(DVec3::new(16.0, -16.0, 40.0)),
                1 => DMat3::from_cols(DVec3::Y * 0.3, DVec3::Z * -1.1, DVec3::X * 0.7),
                _ => DMat3::from_cols(
                    DVec3::new(3.0, coordinate(3), 0.0),
                    DVec3::new(-1.0, 5.0, coordinate(5)),
                    DVec3::new(coordinate(7), 0.0, -11.0),
                ),
            };
            let world_from_index = DAffine3::from_mat3_translation(matrix, DVec3::splat(100.0));
            let reach = [300, 3000, 30000][i / 3 % 3];
            let eye = DVec3::new(coordinate(reach), coordinate(reach), coordinate(reach));
            let choice = LodChoice::Distance {
                eye_in_world: world_from_index.transform_point3(eye),
                world_per_distance: [0.001, 0.01, 0.1][below(3) as usize],
                world_constant: 0.0,
            };
            let detail = choice.placed(&world_from_index);
            let lo = each_axis(|_| 4 * below(20));
            let hi = each_axis(|a| lo[a] + 1 + below(150));
            let level = detail.everywhere(&BoxBounds { lo, hi });
            told[level.map_or(3, |level| level as usize)] += 1;
            for _ in 0..40 {
                let origin = each_axis(|a| lo[a] + below((hi[a] - lo[a]).div_ceil(4)) * 4);
                let extent = each_axis(|_| 4 * (1 + below(4)));
                if let Some(level) = level {
                    assert_eq!(detail.level(origin, extent), level, "{origin:?} {extent:?} by {detail:?}");
                }
            }
        }
        assert!(told.iter().all(|&n| n > 200), "{told:?}");
    }
}

//! Which detail each box is drawn at (paper §4.3): 16, 4 or 1 voxels, for all boxes or by distance.
//!
//! The choice is no part of the hierarchy: a box's level is found when a ray meets the box, from the placement and the choice alone,
//! so that a camera moves without anything being built.

use crate::BoxBounds;
use glam::{DAffine3, DVec3};
use pumice_scene::{Camera, Film, Lod, Projection};

use super::each_axis;
use crate::camera_rays::fitted_side;

/// Detail at which the walk through a box stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DetailLevel {
    /// Voxels.
    Voxels = 0,
    /// Cells with a voxel.
    Cells = 1,
    /// The whole box.
    Boxes = 2,
}

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
        // Pixels that are not square: the shorter of their sides counts.
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

    /// The same levels, chosen box by box among all: by a distance that no box is beyond.
    #[must_use]
    pub fn with_level_bounds(self) -> Self {
        match self {
            Self::Voxels => {
                Self::Distance { eye_in_world: DVec3::ZERO, world_per_distance: 0.0, world_constant: 0.0 }
            }
            other => other,
        }
    }

    /// The choice, made ready for boxes of one placement.
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

/// Voxels by which a box may end beyond the volume.
const MOST_BEYOND: u32 = 15;

/// Squares of distances up to here are finite in f32; an eye beyond is put here.
const FARTHEST_EYE: f32 = 1e18;

/// See [`LodChoice::placed`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Detail {
    /// All boxes alike.
    Same(DetailLevel),
    /// See [`LodChoice::Distance`].
    ByDistance(ByDistance),
}

/// Squared distances from which boxes are coarser, in units of a voxel's longest edge in the world. In f32, products and sums in a
/// fixed order: a shader comes to the same levels, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ByDistance {
    /// The camera.
    pub eye_in_index: [f32; 3],
    /// Columns of the placement's matrix, over that edge.
    pub edges_from_index: [[f32; 3]; 3],
    /// From here on cells are drawn.
    pub cells_from_squared: f32,
    /// From here on whole boxes are.
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

    /// The level of all boxes within `bounds` where it is one for certain: the one that was chosen, or the one that the nearest and the
    /// farthest point share.
    pub fn everywhere(&self, bounds: &BoxBounds) -> Option<DetailLevel> {
        match self {
            Self::Same(level) => Some(*level),
            Self::ByDistance(by) => {
                let corners = (0..8u32).map(|c| {
                    let at = |a: usize| if c >> a & 1 == 0 { bounds.lo[a] } else { bounds.hi[a] };
                    by.distance_squared(each_axis(|a| by.eye_in_index[a] - at(a) as f32))
                });
                // Distances grow towards corners, and eight roundings are far less than this.
                let farthest = corners.fold(0.0, f32::max) * 1.000_01;
                // (Boxes may reach beyond the volume, where their bounds end.)
                let end = bounds.hi.map(|hi| hi.saturating_add(MOST_BEYOND));
                let nearest = by.level(bounds.lo, each_axis(|a| end[a] - bounds.lo[a]));
                match nearest {
                    _ if farthest < by.cells_from_squared => Some(DetailLevel::Voxels),
                    // Coordinates along axes that are parallel to the world's: each is no farther for a box than for what is around all,
                    // and sums and products in f32 keep that order.
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
    /// The level of the box of that origin and extent.
    #[inline]
    pub fn level(&self, origin: [u32; 3], extent: [u32; 3]) -> DetailLevel {
        // Nearest point in index space: the nearest in the world too when the axes are orthogonal, as they are but for sheared
        // matrices, where the level may be one too coarse.
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

    /// Whether each axis of index space lies along one of the world's.
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

    /// Wherever a level is told for all boxes within bounds, each box has it: placements along the world's axes and askew, eyes within and
    /// far off, boxes that end beyond the bounds. Each level is told, and some choices are not one level.
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

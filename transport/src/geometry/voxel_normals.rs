//! Smooth normals of voxels: the direction in which a label's occupancy falls off around a point of one of its faces.
//!
//! ```text
//! f(p) = Σ  o(v) · w(p₀ − v₀ − ½) · w(p₁ − v₁ − ½) · w(p₂ − v₂ − ½)      o: 1 in voxels of the label; 6 × 6 × 6 voxels around p
//!        v
//! w = boxes of lengths 1, 2 and 3, convolved                             normal: −∇f, transformed to the world as a covector
//! ```
//! f has a continuous gradient everywhere, so there are no facets, neither within a voxel's face nor between neighbouring faces. It depends
//! on the label alone, not on what lies beside it. For a half space that is not voxelised the gradient of any such mean is exact, whatever
//! the spacing. What remains is the error of the voxel steps: 3° on average for the normals of a ball, where faces are off by 39°. Kernels
//! of radius 2 (4³ voxels) leave 7°; kernels of radius 4 leave 1.6° at twice the cost, and they round off thin structures. The weights of
//! all voxels along an axis add up to the same everywhere, because a box of length 1 is among the convolved ones, so a label that is flat
//! along its voxels is not bent. (A smooth bump without that, (1 − x²/9)², bent such faces by up to 1.5° and was no better elsewhere.)

use glam::{DVec3, Vec3};
use pumice_core::BoxView;

use super::each_axis;
use super::lod::DetailLevel;
use super::neighbors::REACH;

/// Voxels along each axis.
const WIDTH: usize = 2 * REACH as usize;

/// Boxes of lengths 2 and 3, convolved.
#[inline]
fn trapezium(x: f32) -> f32 {
    (2.5 - x.abs()).clamp(0.0, 2.0)
}

/// Integral of [`trapezium`] from 0 to `x`.
#[inline]
fn trapezium_up_to(x: f32) -> f32 {
    let a = x.abs().min(2.5);
    let area = if a <= 0.5 { 2.0 * a } else { (2.5 - 0.5 * a) * a - 0.125 };
    area.copysign(x)
}

/// Weights of the voxels along one axis, and their derivatives.
#[derive(Clone, Copy)]
struct Weights {
    /// Coordinate of the lowest voxel.
    first: i32,
    weight: [f32; WIDTH],
    slope: [f32; WIDTH],
}

impl Weights {
    /// Weights around a coordinate.
    #[inline]
    fn new(at: f64) -> Self {
        let middle = (at + 0.5).floor();
        let from_middle = (at - middle) as f32;
        let (mut weight, mut slope) = ([0.0; WIDTH], [0.0; WIDTH]);
        for i in 0..WIDTH {
            let x = from_middle + (2.5 - i as f32);
            weight[i] = trapezium_up_to(x + 0.5) - trapezium_up_to(x - 0.5);
            slope[i] = trapezium(x - 0.5) - trapezium(x + 0.5);
        }
        Self { first: middle as i32 - REACH as i32, weight, slope }
    }
}

/// −∇f at `p_in_index`, of any length, where `boxes` hold the label around that point; (0, 0, 0) where the gradient vanishes.
pub fn falling_off<'a>(
    boxes: impl Iterator<Item = (BoxView<'a>, DetailLevel, [u32; 3])>,
    p_in_index: DVec3,
) -> Vec3 {
    let about = each_axis(|a| Weights::new(p_in_index[a]));
    let mut sum = Vec3::ZERO;
    for (b, level, end) in boxes {
        // The part of the surroundings in this box, relative to its origin.
        let lo = each_axis(|a| (about[a].first - b.origin[a] as i32).max(0));
        let hi = each_axis(|a| (about[a].first + WIDTH as i32).min(end[a] as i32) - b.origin[a] as i32);
        if (0..3).any(|a| lo[a] >= hi[a]) {
            continue;
        }
        let shift = each_axis(|a| b.origin[a] as i32 - about[a].first);
        for cell_z in lo[2] >> 2..=(hi[2] - 1) >> 2 {
            for cell_y in lo[1] >> 2..=(hi[1] - 1) >> 2 {
                for cell_x in lo[0] >> 2..=(hi[0] - 1) >> 2 {
                    let cell = [cell_x, cell_y, cell_z];
                    let number = (cell_x | cell_y << 2 | cell_z << 4) as u32;
                    let voxels = voxels_of(&b, level, number);
                    if voxels != 0 {
                        let from = each_axis(|a| lo[a].max(4 * cell[a]));
                        let to = each_axis(|a| hi[a].min(4 * cell[a] + 4));
                        sum += part_of_cell(&about, voxels, from, to, shift);
                    }
                }
            }
        }
    }
    sum
}

/// The voxel mask of a cell at a level of detail.
#[inline]
fn voxels_of(b: &BoxView, level: DetailLevel, cell: u32) -> u64 {
    match level {
        DetailLevel::Voxels => b.node.field(cell),
        DetailLevel::Cells => 0u64.wrapping_sub(b.node.occupied >> cell & 1),
        DetailLevel::Boxes => u64::MAX,
    }
}

/// The contribution to the gradient of one cell's voxels from `from` to `to`. Both are relative to the box's origin, which is `shift` above
/// the lowest weight.
#[inline]
fn part_of_cell(about: &[Weights; 3], voxels: u64, from: [i32; 3], to: [i32; 3], shift: [i32; 3]) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for z in from[2]..to[2] {
        let (weight_z, slope_z) = about[2].at(z + shift[2]);
        for y in from[1]..to[1] {
            let (weight_y, slope_y) = about[1].at(y + shift[1]);
            let row = voxels >> (4 * (y & 3) + 16 * (z & 3));
            let (mut weight, mut slope) = (0.0, 0.0);
            for x in from[0]..to[0] {
                if row >> (x & 3) & 1 != 0 {
                    let (weight_x, slope_x) = about[0].at(x + shift[0]);
                    weight += weight_x;
                    slope += slope_x;
                }
            }
            sum += Vec3::new(
                slope * weight_y * weight_z,
                weight * slope_y * weight_z,
                weight * weight_y * slope_z,
            );
        }
    }
    sum
}

impl Weights {
    /// Weight and slope of the voxel at this index.
    #[inline]
    fn at(&self, number: i32) -> (f32, f32) {
        let i = (number.max(0) as usize).min(WIDTH - 1);
        (self.weight[i], self.slope[i])
    }
}

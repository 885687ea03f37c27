//! A triangle mesh in a grid of its own, in which the hierarchy of the volumes holds triangles.
//!
//! ```text
//!  mesh space  p          any place, any unit
//!      │  (p − lowest corner) · 2ᵏ + 2        k so that the longest side has 2¹⁹ to 2²⁰ cells
//!      ▼
//!  grid        corners in f32, bounds of triangles in whole cells
//! ```
//! The power of two rounds nothing, so corners lose what f32 loses at the mesh's own size: 2⁻²⁵ of its longest side. That is what
//! Blender's corners have to begin with, and wherever the mesh lies in the world, that is how it stays. A side that is parallel to an
//! axis stays so exactly.
//!
//! Bounds reach a whole cell beyond the triangle on each side: `cpu-renderer/src/traverse/triangle.rs` computes in f32 from distances of less than
//! 2²¹ cells, and decides as if the ray passed by less than half a cell from where it does.

use crate::{BoxBounds, RenderError};
use glam::{DAffine3, DVec3};
use pumice_core::MeshData;

use super::placement::Placement;

/// Cells from the grid's lowest plane to the mesh: room for the bounds' margin.
const MARGIN: f64 = 2.0;

/// See the module.
#[derive(Clone, Debug)]
pub struct MeshGrid {
    /// The mesh's corners in the grid.
    pub corners: Vec<[f32; 3]>,
    /// Grid to the mesh's own space.
    pub mesh_from_grid: DAffine3,
}

impl MeshGrid {
    /// The grid of the mesh at a place of the scene.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the mesh that is larger or smaller than doubles can tell apart.
    pub fn new(place: u32, mesh: &MeshData) -> Result<Self, RenderError> {
        let places = || mesh.positions().iter().map(|&p| DVec3::from(p));
        let lo = places().reduce(DVec3::min).unwrap_or_default();
        let hi = places().reduce(DVec3::max).unwrap_or_default();
        let side = (hi - lo).max_element();
        // 2ᵏ and its inverse are normal numbers with room for products.
        if side != 0.0 && !(1e-270..1e270).contains(&side) {
            return Err(RenderError::Scene(format!(
                "meshes[{place}]: expected a longest side from 1e-270 to 1e270, got {side:e}"
            )));
        }
        let exponent = if side == 0.0 { 0 } else { (side.to_bits() >> 52) as i32 - 1023 };
        let cells_a_unit = 2f64.powi(19 - exponent);
        let corners = places().map(|p| ((p - lo) * cells_a_unit + MARGIN).as_vec3().to_array()).collect();
        let unit = 1.0 / cells_a_unit;
        let mesh_from_grid = DAffine3::from_scale_rotation_translation(
            DVec3::splat(unit),
            glam::DQuat::IDENTITY,
            lo - MARGIN * unit,
        );
        Ok(Self { corners, mesh_from_grid })
    }

    /// Bounds and number of each triangle: what hierarchies are built over.
    pub fn bounds(&self, mesh: &MeshData) -> Vec<(BoxBounds, u32)> {
        let bounds = |&corners: &[u32; 3]| {
            let cells = corners.map(|c| self.corners[c as usize].map(|v| v as u32));
            let whole = cells.iter().fold(BoxBounds::EMPTY, |b, &c| b.union(BoxBounds { lo: c, hi: c }));
            BoxBounds { lo: whole.lo.map(|v| v - 1), hi: whole.hi.map(|v| v + 2) }
        };
        mesh.triangles().iter().map(bounds).zip(0..).collect()
    }

    /// Heap bytes.
    pub fn bytes(&self) -> u64 {
        (self.corners.capacity() * size_of::<[f32; 3]>()) as u64
    }
}

/// Where a mesh of the scene is, as the place of its grid.
///
/// # Errors
/// [`RenderError::Scene`] names the mesh whose matrix is singular.
pub fn mesh_placement(
    place: u32,
    mesh_from_grid: DAffine3,
    world_from_mesh: DAffine3,
) -> Result<Placement, RenderError> {
    Placement::new(world_from_mesh * mesh_from_grid).ok_or_else(|| {
        RenderError::Scene(format!(
            "meshes[{place}]: world_from_mesh cannot be inverted at the mesh's size: {:?}",
            world_from_mesh.to_cols_array()
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: &[[f64; 3]]) -> MeshData {
        MeshData::new(positions.to_vec(), vec![[0, 1, 2]], Vec::new()).unwrap()
    }

    #[test]
    fn corners_come_back_and_bounds_hold_them() {
        // Far from the origin, where f32 alone would keep nothing of the shape.
        for (at, side) in [(0.0, 1.0), (1e9, 3.0), (-7e5, 1e-3), (0.0, 5e6)] {
            let data = mesh(&[[at, at, at], [at + side, at, at + side / 3.0], [at, at + side / 7.0, at]]);
            let grid = MeshGrid::new(0, &data).unwrap();
            for (p, g) in data.positions().iter().zip(&grid.corners) {
                let back = grid.mesh_from_grid.transform_point3(glam::Vec3::from(*g).as_dvec3());
                let error = (back - DVec3::from(*p)).abs().max_element();
                // f32 of the grid, and doubles at the place of the mesh.
                let bound = side / (1u64 << 24) as f64 + at.abs() * 4.0 * f64::EPSILON;
                assert!(error <= bound, "{error} > {bound} at {at}");
            }
            let [(bounds, 0)] = grid.bounds(&data)[..] else { panic!("one triangle") };
            for g in &grid.corners {
                let within =
                    |a: usize| bounds.lo[a] as f32 + 1.0 <= g[a] && g[a] + 1.0 <= bounds.hi[a] as f32;
                assert!((0..3).all(within), "{g:?} in {bounds:?}");
            }
            assert!((0..3).all(|a| bounds.hi[a] <= (1 << 20) + 4));
        }
    }

    #[test]
    fn what_doubles_cannot_span_is_refused() {
        let line = |side: f64| MeshGrid::new(3, &mesh(&[[0.0; 3], [side, 0.0, 0.0], [0.0; 3]]));
        assert!(line(0.0).is_ok());
        for side in [1e-280, 1e280] {
            let told = line(side).unwrap_err().to_string();
            assert!(told.starts_with("meshes[3]: expected a longest side"), "{told}");
        }
    }
}

//! A triangle mesh in an integer grid of its own, so that the same hierarchy as for volumes can hold its triangles.
//!
//! ```text
//! mesh space  p          any position, any unit
//!     │  (p − lowest corner) · 2ᵏ + 2        k such that the longest side has 2¹⁹ to 2²⁰ cells
//!     ▼
//! grid        corners in f32, bounds of triangles in whole cells
//! ```
//! The power of two rounds nothing, so corners lose only f32's precision at the mesh's own size, 2⁻²⁵ of its longest side, wherever the
//! mesh lies in the world. Blender's corners have that precision to begin with. A side parallel to an axis stays exactly parallel.
//!
//! Bounds reach a whole cell beyond the triangle on each side, because `cpu-renderer/src/traverse/triangle.rs` computes in f32 from
//! distances of less than 2²¹ cells, and its result is that of a ray less than half a cell away.

use crate::{BoxBounds, RenderError};
use glam::{DAffine3, DVec3};
use pumice_core::reserve::collected;
use pumice_core::{MeshData, NoMemory};

use super::placement::Placement;

/// Cells from the grid's lowest plane to the mesh, which leaves room for the margin of the bounds.
const MARGIN: f64 = 2.0;

/// The corners of a mesh in its grid (see the module).
#[derive(Clone, Debug)]
pub struct MeshGrid {
    /// Corners of the mesh in grid coordinates.
    pub corners: Vec<[f32; 3]>,
    /// Transform from the grid to mesh space.
    pub mesh_from_grid: DAffine3,
}

impl MeshGrid {
    /// The grid of `mesh`, which is number `place` of the scene's meshes.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the mesh if its longest side is outside 1e-270 to 1e270; [`RenderError::Memory`].
    pub fn new(place: u32, mesh: &MeshData) -> Result<Self, RenderError> {
        let places = || mesh.positions().iter().map(|&p| DVec3::from(p));
        let lo = places().reduce(DVec3::min).unwrap_or_default();
        let hi = places().reduce(DVec3::max).unwrap_or_default();
        let side = (hi - lo).max_element();
        // 2ᵏ and its inverse are normal numbers, with room for products.
        if side != 0.0 && !(1e-270..1e270).contains(&side) {
            return Err(RenderError::Scene(format!(
                "meshes[{place}]: expected a longest side from 1e-270 to 1e270, got {side:e}"
            )));
        }
        let exponent = if side == 0.0 { 0 } else { (side.to_bits() >> 52) as i32 - 1023 };
        let cells_a_unit = 2f64.powi(19 - exponent);
        let corners = places().map(|p| ((p - lo) * cells_a_unit + MARGIN).as_vec3().to_array());
        let corners = collected(mesh.positions().len(), corners, "the corners of a mesh")?;
        let unit = 1.0 / cells_a_unit;
        let mesh_from_grid = DAffine3::from_scale_rotation_translation(
            DVec3::splat(unit),
            glam::DQuat::IDENTITY,
            lo - MARGIN * unit,
        );
        Ok(Self { corners, mesh_from_grid })
    }

    /// Bounds and index of each triangle, for building a hierarchy.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn bounds(&self, mesh: &MeshData) -> Result<Vec<(BoxBounds, u32)>, NoMemory> {
        let bounds = |&corners: &[u32; 3]| {
            let cells = corners.map(|c| self.corners[c as usize].map(|v| v as u32));
            let whole = cells.iter().fold(BoxBounds::EMPTY, |b, &c| b.union(BoxBounds { lo: c, hi: c }));
            BoxBounds { lo: whole.lo.map(|v| v - 1), hi: whole.hi.map(|v| v + 2) }
        };
        let triangles = mesh.triangles();
        collected(triangles.len(), triangles.iter().map(bounds).zip(0..), "the bounds of a mesh's triangles")
    }

    /// Size on the heap in bytes.
    pub fn bytes(&self) -> u64 {
        (self.corners.capacity() * size_of::<[f32; 3]>()) as u64
    }
}

/// Placement of a mesh's grid in the world.
///
/// # Errors
/// [`RenderError::Scene`] names the mesh if its matrix is singular.
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
        // Far from the origin, where f32 alone would lose the shape.
        for (at, side) in [(0.0, 1.0), (1e9, 3.0), (-7e5, 1e-3), (0.0, 5e6)] {
            let data = mesh(&[[at, at, at], [at + side, at, at + side / 3.0], [at, at + side / 7.0, at]]);
            let grid = MeshGrid::new(0, &data).unwrap();
            for (p, g) in data.positions().iter().zip(&grid.corners) {
                let back = grid.mesh_from_grid.transform_point3(glam::Vec3::from(*g).as_dvec3());
                let error = (back - DVec3::from(*p)).abs().max_element();
                // Precision of f32 in the grid, plus that of f64 at the mesh's position.
                let bound = side / (1u64 << 24) as f64 + at.abs() * 4.0 * f64::EPSILON;
                assert!(error <= bound, "{error} > {bound} at {at}");
            }
            let [(bounds, 0)] = grid.bounds(&data).unwrap()[..] else { panic!("one triangle") };
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

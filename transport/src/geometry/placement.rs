//! The transform of an instance of a volume, or of the grid of a mesh, in the world.

use crate::RenderError;
use glam::{DAffine3, DVec3};

use super::each_axis;

/// An instance's matrix and its inverse, kept as adjugate and determinant, with the division last. A zero of the inverse then stays an
/// exact zero, and a matrix of small whole numbers (spacings in nm, permuted or sheared axes) is inverted without rounding except in that
/// division: rays in a plane between voxels, as in isometric views, stay in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Transform from index space to the world.
    pub world_from_index: DAffine3,
    /// Rows of the adjugate, each times the determinant's sign.
    pub adjugate: [DVec3; 3],
    /// Absolute value of the determinant.
    pub determinant: f64,
    /// Columns of the adjugate, padded with a 0 to four lanes.
    pub columns: [[f64; 4]; 3],
}

impl Placement {
    /// [`Placement::new`] for instance number `place` of the scene.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the instance if its matrix cannot be inverted.
    pub fn of_instance(place: u32, world_from_index: DAffine3) -> Result<Self, RenderError> {
        Self::new(world_from_index).ok_or_else(|| {
            RenderError::Scene(format!(
                "instances[{place}]: world_from_index cannot be inverted: {:?}",
                world_from_index.to_cols_array()
            ))
        })
    }

    /// Returns `None` where the matrix is singular or not finite, or its determinant is too small or large to be a normal number.
    pub fn new(world_from_index: DAffine3) -> Option<Self> {
        let m = world_from_index.matrix3;
        let rows = [m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis)];
        let det = m.x_axis.dot(rows[0]);
        let usable = world_from_index.is_finite() && det.is_normal() && rows.iter().all(|r| r.is_finite());
        let adjugate = rows.map(|r| if det < 0.0 { -r } else { r });
        let columns = each_axis(|c| [adjugate[0][c], adjugate[1][c], adjugate[2][c], 0.0]);
        usable.then_some(Self { world_from_index, adjugate, determinant: det.abs(), columns })
    }

    /// Transforms a vector from the world to index space.
    #[inline(always)]
    pub fn index_from_world(&self, v: DVec3) -> DVec3 {
        let [x, y, z] = &self.columns;
        DVec3::from(each_axis(|a| (x[a] * v.x + y[a] * v.y + z[a] * v.z) / self.determinant))
    }

    /// Unit normal in the world of a surface with this normal in index space. It stays on the same side of the surface, also where the
    /// matrix mirrors.
    pub fn normal_of(&self, normal: DVec3) -> DVec3 {
        let [x, y, z] = self.adjugate;
        // The adjugate of small voxels is small; scaling the normal to 1 first keeps its square representable.
        let n = normal / normal.abs().max_element();
        let n = x * n.x + y * n.y + z * n.z;
        (n / n.abs().max_element()).normalize()
    }

    /// Outward unit normal of a voxel face in the world, from the axis' covector, so that sheared and mirrored matrices are right.
    pub fn normal(&self, axis: usize, positive: bool) -> DVec3 {
        let n = self.adjugate[axis].normalize();
        if positive { n } else { -n }
    }
}

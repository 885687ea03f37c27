//! Where an instance of a volume, or the grid of a mesh, is in the world.

use crate::RenderError;
use glam::{DAffine3, DVec3};

use super::each_axis;

/// An instance's place in the world, inverted once: as adjugate and determinant, divided last. A zero of the inverse then stays
/// an exact zero, and a matrix of small whole numbers (spacings in nm, permuted or sheared axes) is inverted without rounding
/// but for that division: rays in a plane between voxels, as in isometric views, stay in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Index space to world.
    pub world_from_index: DAffine3,
    /// Rows of the adjugate, all times the determinant's sign.
    pub adjugate: [DVec3; 3],
    /// Absolute determinant.
    pub determinant: f64,
    /// The adjugate's columns, each with a 0 after it: what four lanes hold.
    pub columns: [[f64; 4]; 3],
}

impl Placement {
    /// [`Placement::new`] for the instance at a place of the scene.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the instance.
    pub fn of_instance(place: u32, world_from_index: DAffine3) -> Result<Self, RenderError> {
        Self::new(world_from_index).ok_or_else(|| {
            RenderError::Scene(format!(
                "instances[{place}]: world_from_index cannot be inverted: {:?}",
                world_from_index.to_cols_array()
            ))
        })
    }

    /// `None` when the matrix is singular, not finite, or so small or large that its determinant is not a normal number.
    pub fn new(world_from_index: DAffine3) -> Option<Self> {
        let m = world_from_index.matrix3;
        let rows = [m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis)];
        let det = m.x_axis.dot(rows[0]);
        let usable = world_from_index.is_finite() && det.is_normal() && rows.iter().all(|r| r.is_finite());
        let adjugate = rows.map(|r| if det < 0.0 { -r } else { r });
        let columns = each_axis(|c| [adjugate[0][c], adjugate[1][c], adjugate[2][c], 0.0]);
        usable.then_some(Self { world_from_index, adjugate, determinant: det.abs(), columns })
    }

    /// A vector of the world in index space.
    #[inline(always)]
    pub fn index_from_world(&self, v: DVec3) -> DVec3 {
        let [x, y, z] = &self.columns;
        DVec3::from(each_axis(|a| (x[a] * v.x + y[a] * v.y + z[a] * v.z) / self.determinant))
    }

    /// Unit normal in the world of a surface with this normal in index space: it stays on the same side of the surface, in mirrored
    /// places too.
    pub fn normal_of(&self, normal: DVec3) -> DVec3 {
        let [x, y, z] = self.adjugate;
        // Adjugates of small voxels are small: a normal that was brought to 1 first has a square that is a number.
        let n = normal / normal.abs().max_element();
        let n = x * n.x + y * n.y + z * n.z;
        (n / n.abs().max_element()).normalize()
    }

    /// Outward unit normal of a face in the world: the axis' covector, so that sheared and mirrored matrices are right.
    pub fn normal(&self, axis: usize, positive: bool) -> DVec3 {
        let n = self.adjugate[axis].normalize();
        if positive { n } else { -n }
    }
}

//! The visible surfaces of a scene's volumes in world space, for formats that know only faces: PLY, OBJ and STL.
//!
//! ```text
//! LoadedScene ─► Surfaces ─┬─► ply   faces with label, volume and colour
//!                          ├─► obj   faces in a group for each label, materials in an .mtl beside it
//!                          └─► stl   triangles, shape alone
//! ```
//! Positions are computed in double precision and written in single. The corners of a mirrored volume are written in reverse, so that they
//! turn counter-clockwise as seen from outside in every file.

mod obj;
mod ply;
mod smooth;
mod stl;

use glam::{DAffine3, DVec3};
use pumice_core::{Error, Job};
use pumice_transport::LoadedScene;

use crate::drawn::Drawn;
use crate::labelled_surface::{Face, LabelledSurface};
use crate::voxel_region::nothing_shown;
use crate::{Budget, ExportOptions, Result};

pub(crate) use smooth::SmoothSurfaces;

/// The surfaces of a scene, each with what is drawn of its volume.
pub(crate) struct Surfaces<'a> {
    all: Vec<(Drawn<'a>, LabelledSurface)>,
}

impl<'a> Surfaces<'a> {
    /// The surfaces at the level of detail of the form that is asked for, taken from `budget`.
    ///
    /// # Errors
    /// [`Error::Caller`] where nothing is drawn, or the world is beyond single precision; [`Error::Limit`] where the faces take more than
    /// the budget; [`Error::Cancelled`].
    pub(crate) fn of_scene(
        scene: &'a LoadedScene,
        options: &ExportOptions,
        budget: &mut Budget,
        job: &Job,
    ) -> Result<Self> {
        let mut all = Vec::new();
        let Some(level) = options.forms.first().and_then(|form| form.level()) else {
            return Err(Error::Caller("forms: expected one of boxes, cells4, voxels".into()).into());
        };
        for place in 0..scene.volumes().len() {
            let drawn = Drawn::new(scene, place, options.region);
            let surface = LabelledSurface::new(&drawn, level, options.merging, budget, job)?;
            if !surface.is_empty() {
                check_range(&drawn)?;
                all.push((drawn, surface));
            }
        }
        if all.is_empty() {
            return Err(nothing_shown(options.region).into());
        }
        Ok(Self { all })
    }

    fn face_count(&self) -> u64 {
        self.all.iter().map(|(_, surface)| surface.face_count()).sum()
    }

    fn corner_count(&self) -> u64 {
        self.all.iter().map(|(_, surface)| surface.corner_count()).sum()
    }
}

/// Checks that the corners of a volume are numbers in single precision.
fn check_range(drawn: &Drawn<'_>) -> Result<()> {
    let (matrix, dims) =
        (drawn.instance.world_from_index, DVec3::from_array(drawn.volume.info().dims.map(f64::from)));
    let farthest = matrix.translation.abs() + matrix.matrix3.abs() * dims;
    if farthest.max_element() < f64::from(f32::MAX) {
        return Ok(());
    }
    let (name, got) = (drawn.name(), farthest.max_element());
    Err(Error::Caller(format!(
        "{name}: expected positions below {:e}, the largest of the file, got {got:e}",
        f32::MAX
    ))
    .into())
}

/// Puts the corners of a face in the world in place of what `corners` has, counter-clockwise as seen from outside.
fn put_corners_in_world(face: &dyn Face, world_from_index: &DAffine3, corners: &mut Vec<DVec3>) {
    corners.clear();
    face.for_each_corner(&mut |corner| corners.push(world_from_index.transform_point3(corner)));
    if world_from_index.matrix3.determinant() < 0.0 {
        corners.reverse();
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;
    use crate::Rectangle;

    #[test]
    fn corners_turn_outward_also_when_mirrored() {
        let rectangle = Rectangle { low: [3, 4, 5], size: [2, 1], axis: 2, is_up: true, label: 0 };
        for x in [1.0, -1.0] {
            let matrix = DAffine3::from_mat3(DMat3::from_diagonal(DVec3::new(x, 1.0, 1.0)));
            let mut corners = Vec::new();
            put_corners_in_world(&rectangle, &matrix, &mut corners);
            assert_eq!((corners[1] - corners[0]).cross(corners[2] - corners[1]).normalize(), DVec3::Z);
            // Control: the corners as they come turn inward where the volume is mirrored.
            let [a, b, c, _] =
                rectangle.corners().map(|p| matrix.transform_point3(DVec3::from_array(p.map(f64::from))));
            assert_eq!((b - a).cross(c - b).normalize(), DVec3::Z * x);
        }
    }
}

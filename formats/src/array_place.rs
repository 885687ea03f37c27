//! The place of an array in the world, from the attributes that programs give it: Zarr and HDF5 have none of their own.
//!
//! ```text
//! resolution, voxel_size, spacing       lengths in the order of the indices, which is z, y, x (CREMI, funlib, PlantSeg)
//! element_size_um                       the same in micrometres (ilastik, PlantSeg)
//! offset                                lowest corner of the first voxel, in the unit of the lengths (funlib, CREMI)
//! units, unit                           a name, or one an index
//! ```

use std::path::Path;

use glam::{DAffine3, DVec3};
use pumice_core::{Unit, VolumeInfo};

use crate::array_axes::along_xyz;
use crate::error::Result;
use crate::layout::Role;
use crate::options::OpenOptions;
use crate::placement::{self, unit_by_name};

/// What an array's attributes say of its place, in the order of its indices.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ArrayPlace {
    pub(crate) lengths: Option<Vec<f64>>,
    pub(crate) corner: Option<Vec<f64>>,
    pub(crate) unit: Option<String>,
}

/// Attributes with lengths along the indices, in the order in which they are looked for.
const LENGTHS: [&str; 4] = ["element_size_um", "resolution", "voxel_size", "spacing"];

impl ArrayPlace {
    /// Looks for attributes: `numbers` and `text` give one by its name.
    pub(crate) fn find(
        indices: usize,
        numbers: impl Fn(&str) -> Option<Vec<f64>>,
        text: impl Fn(&str) -> Option<String>,
    ) -> Self {
        let fitting = |name: &str| {
            numbers(name).filter(|list| list.len() == indices || (list.len() == 3 && indices > 3))
        };
        let Some((name, lengths)) = LENGTHS.iter().find_map(|&name| Some((name, fitting(name)?))) else {
            return Self::default();
        };
        let unit = if name == "element_size_um" {
            Some("um".to_owned())
        } else {
            text("units").or_else(|| text("unit"))
        };
        Self { lengths: Some(lengths), corner: fitting("offset"), unit }
    }

    /// The description of the volume: matrix and unit. Warns where the array says nothing.
    pub(crate) fn placed(
        &self,
        path: &Path,
        mut info: VolumeInfo,
        roles: &[Role],
        options: &OpenOptions,
    ) -> Result<VolumeInfo> {
        // Three numbers of an array with more indices are those of the spatial ones.
        let of_space: Vec<Role> = if self.lengths.as_ref().is_some_and(|list| list.len() < roles.len()) {
            space_only(roles)
        } else {
            roles.to_vec()
        };
        let lengths = match &self.lengths {
            Some(lengths) => along_xyz(&of_space, lengths, 1.0),
            None => {
                if options.spacing.is_none() {
                    options.warnings.push(format!(
                        "{}: the array states no spacing; 1 is assumed along each axis (give --spacing x,y,z)",
                        path.display()
                    ));
                }
                [1.0; 3]
            }
        };
        info.unit = self.unit.as_deref().and_then(unit_by_name).unwrap_or(Unit::Unknown);
        let affine = placement::from_spacing(path, lengths, options)?;
        // Without an offset the first voxel's middle is the origin, as with all formats that state no place.
        let Some(corner) = &self.corner else { return Ok(info.from_centre_affine(affine)) };
        let corner = DVec3::from_array(along_xyz(&of_space, corner, 0.0));
        info.world_from_index = DAffine3::from_translation(corner) * affine;
        Ok(info)
    }
}

fn space_only(roles: &[Role]) -> Vec<Role> {
    roles.iter().copied().filter(|role| matches!(role, Role::Space(_))).collect()
}

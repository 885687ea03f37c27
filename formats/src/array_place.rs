//! The place of an array in the world, from the attributes that programs give it: Zarr and HDF5 have none of their own.
//!
//! ```text
//! resolution, voxel_size, spacing       lengths in the order of the indices, which is z, y, x (CREMI, funlib, PlantSeg)
//! element_size_um                       the same in micrometres (ilastik, PlantSeg)
//! offset                                lowest corner of the first voxel, in the unit of the lengths (funlib, CREMI)
//! units, unit                           a name, or one an index
//! ```
//! One number stands for all indices. Lengths without an offset have the offset 0, as in funlib, so that a CREMI file's raw data (no offset) and
//! labels (with one) lie together: the *corner* of the first voxel is the origin. An array with neither says nothing of its place: the *middle* of
//! the first voxel is the origin, as with all formats that state no place.

use std::path::Path;

use glam::{DAffine3, DVec3};
use pumice_core::VolumeInfo;

use crate::array_axes::along_xyz;
use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::layout::Role;
use crate::options::OpenOptions;
use crate::placement;

/// What an array's attributes say of its place, in the order of its indices.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ArrayPlace {
    pub(crate) lengths: Option<Vec<f64>>,
    pub(crate) corner: Option<Vec<f64>>,
    /// Names of units: none, one for all, or one an index.
    pub(crate) units: Vec<String>,
}

/// Attributes with lengths along the indices, in the order in which they are looked for.
const LENGTHS: [&str; 4] = ["element_size_um", "resolution", "voxel_size", "spacing"];

impl ArrayPlace {
    /// Looks for attributes: `numbers` and `texts` give one by its name.
    pub(crate) fn find(
        indices: usize,
        numbers: impl Fn(&str) -> Option<Vec<f64>>,
        texts: impl Fn(&str) -> Option<Vec<String>>,
    ) -> Self {
        let fits = |count: usize| count == indices || (count == 3 && indices > 3);
        let fitting = |name: &str| match numbers(name)?.as_slice() {
            &[one] => Some(vec![one; indices]),
            list => fits(list.len()).then(|| list.to_vec()),
        };
        let lengths = LENGTHS.iter().find_map(|&name| Some((name, fitting(name)?)));
        let corner = fitting("offset");
        let units = match lengths {
            Some(("element_size_um", _)) => vec!["um".to_owned()],
            None if corner.is_none() => Vec::new(),
            _ => texts("units").or_else(|| texts("unit")).unwrap_or_default(),
        };
        let units = if units.len() == 1 || fits(units.len()) { units } else { Vec::new() };
        Self { lengths: lengths.map(|(_, list)| list), corner, units }
    }

    /// The names of units along x, y, z.
    fn unit_names(&self, roles: &[Role]) -> [Option<&str>; 3] {
        let mut names = [None; 3];
        let space = of_space(roles, self.units.len());
        for (n, role) in space.iter().enumerate() {
            let name = self.units.get(if self.units.len() == 1 { 0 } else { n });
            if let (Role::Space(space), Some(name)) = (role, name.filter(|name| !name.trim().is_empty())) {
                names[*space] = Some(name.as_str());
            }
        }
        names
    }

    /// The description of the volume: matrix and unit. Warns where the array says nothing.
    pub(crate) fn placed(
        &self,
        path: &Path,
        mut info: VolumeInfo,
        roles: &[Role],
        options: &OpenOptions,
    ) -> Result<VolumeInfo> {
        let lengths = match &self.lengths {
            Some(lengths) => along_xyz(&of_space(roles, lengths.len()), lengths, 1.0),
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
        let names = self.unit_names(roles);
        let (unit, factor, unknown) = placement::one_unit(names);
        // One name for all axes is named once.
        let unknown = if self.units.len() == 1 && !unknown.is_empty() {
            vec![format!("the unit {:?} is not known", shorten(&self.units[0]))]
        } else {
            unknown
        };
        for line in unknown {
            options.warnings.push(format!("{}: {line}", path.display()));
        }
        info.unit = unit;
        let lengths = [0, 1, 2].map(|a| lengths[a] * factor[a]);
        let affine = placement::from_spacing(path, lengths, options)?;
        let corner = match (&self.corner, &self.lengths) {
            (Some(corner), _) => along_xyz(&of_space(roles, corner.len()), corner, 0.0),
            (None, Some(_)) => [0.0; 3],
            (None, None) => return Ok(info.from_centre_affine(affine)),
        };
        let corner = DVec3::from_array([0, 1, 2].map(|a| corner[a] * factor[a]));
        if !corner.is_finite() {
            let [x, y, z] = corner.to_array();
            return Err(FormatError::damaged(
                path,
                format!("the offset is ({x}, {y}, {z}), expected finite numbers"),
            ));
        }
        info.world_from_index = DAffine3::from_translation(corner) * affine;
        Ok(info)
    }
}

/// The roles that a list of `count` numbers is about: three numbers of an array with more indices are those of the spatial ones.
fn of_space(roles: &[Role], count: usize) -> Vec<Role> {
    let is_all = count == 1 || count >= roles.len();
    roles.iter().copied().filter(|role| is_all || matches!(role, Role::Space(_))).collect()
}

#[cfg(test)]
mod tests {
    use pumice_core::{LabelType, Unit};

    use super::*;

    /// z, y, x.
    const ZYX: [Role; 3] = [Role::Space(2), Role::Space(1), Role::Space(0)];

    /// The place that attributes give to an array, and the warnings.
    fn place(numbers: &[(&str, &[f64])], units: &[&str], roles: &[Role]) -> (VolumeInfo, String) {
        let options = OpenOptions::default();
        let number = |name: &str| Some(numbers.iter().find(|(n, _)| *n == name)?.1.to_vec());
        let texts = |name: &str| {
            (name == "units" && !units.is_empty()).then(|| units.iter().map(|&u| u.to_owned()).collect())
        };
        let info = VolumeInfo::new([1; 3], LabelType::U8);
        let found = ArrayPlace::find(roles.len(), number, texts);
        let placed = found.placed(Path::new("a"), info, roles, &options).unwrap();
        (placed, options.warnings.list().join("\n"))
    }

    fn middle(info: &VolumeInfo) -> [f64; 3] {
        info.world_from_centre().translation.to_array()
    }

    #[test]
    fn units_of_the_indices_become_one() {
        let lengths: (&str, &[f64]) = ("resolution", &[40.0, 4.0, 4.0]);
        let offset: (&str, &[f64]) = ("offset", &[0.0, 1.0, 0.0]);
        let (info, warnings) = place(&[lengths, offset], &["nm", "um", "nm"], &ZYX);
        assert_eq!((info.unit, warnings.as_str()), (Unit::Nanometre, ""));
        assert_eq!((info.spacing(), middle(&info)[1]), ([4.0, 4000.0, 40.0], 3000.0));
        // Three units of four indices are those of space.
        let (info, _) = place(&[lengths], &["nm", "nm", "um"], &[&[Role::Fixed(0)], &ZYX[..]].concat());
        assert_eq!(info.unit, Unit::Micrometre);
        assert_eq!(info.spacing(), [4.0, 0.004, 0.04]);
    }

    #[test]
    fn a_unit_that_is_not_known_is_named() {
        let lengths: (&str, &[f64]) = ("resolution", &[40.0, 4.0, 4.0]);
        let (info, warnings) = place(&[lengths], &["furlong"], &ZYX);
        assert_eq!((info.unit, warnings.as_str()), (Unit::Unknown, "a: the unit \"furlong\" is not known"));
        let (info, warnings) = place(&[lengths], &["furlong", "nm", "nm"], &ZYX);
        let line = "a: the unit \"furlong\" of axis z is not known";
        assert_eq!((info.unit, warnings.as_str()), (Unit::Nanometre, line));
        assert_eq!(place(&[lengths], &[], &ZYX).1, "");
    }

    #[test]
    fn no_offset_is_an_offset_of_0() {
        let lengths: (&str, &[f64]) = ("resolution", &[40.0, 4.0, 8.0]);
        let none = place(&[lengths], &[], &ZYX).0;
        assert_eq!(middle(&none), [4.0, 2.0, 20.0]);
        assert_eq!(none, place(&[lengths, ("offset", &[0.0; 3])], &[], &ZYX).0);
        // An offset alone is read too, and an array that says nothing has its first voxel's middle at 0.
        assert_eq!(middle(&place(&[("offset", &[7.0, 0.0, 0.0])], &[], &ZYX).0), [0.5, 0.5, 7.5]);
        assert_eq!(middle(&place(&[], &[], &ZYX).0), [0.0; 3]);
    }

    #[test]
    fn one_number_stands_for_all_indices() {
        assert_eq!(place(&[("resolution", &[4.0])], &[], &ZYX).0.spacing(), [4.0; 3]);
        // Two of three indices are no place.
        let (info, warnings) = place(&[("resolution", &[4.0, 4.0])], &[], &ZYX);
        assert!(info.spacing() == [1.0; 3] && warnings.contains("states no spacing"), "{warnings}");
    }
}

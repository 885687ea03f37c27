//! Placement of a volume in the world: checks axis vectors and origin of a header and makes one matrix of them.

use std::path::Path;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::Unit;

use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::options::OpenOptions;

/// The matrix from whole-number voxel centres to the world, from one vector per axis.
///
/// `options.spacing` replaces the lengths of the vectors and keeps their directions and the centre of voxel (0, 0, 0).
///
/// # Errors
/// When a vector is not finite or has no length, or the three lie in one plane.
pub(crate) fn world_from_centre(
    path: &Path,
    axes: [DVec3; 3],
    origin: DVec3,
    options: &OpenOptions,
) -> Result<DAffine3> {
    let mut axes = axes;
    for (a, axis) in axes.iter_mut().enumerate() {
        let name = ["x", "y", "z"][a];
        // The length of a finite vector may overflow or underflow; that is not a valid spacing either.
        let length = axis.length();
        let file_ok = length.is_finite() && length > 0.0;
        if let Some(spacing) = options.spacing {
            let wanted = spacing[a];
            if !(wanted.is_finite() && wanted > 0.0) {
                return Err(FormatError::option(
                    path,
                    format!("the requested spacing along {name} is {wanted}, expected a positive length"),
                ));
            }
            *axis = if file_ok { *axis / length * wanted } else { DVec3::AXES[a] * wanted };
        } else if !file_ok {
            return Err(FormatError::damaged(
                path,
                format!(
                    "the spacing along {name} is {length} (vector {}, {}, {}), expected a positive length: give one \
                     with --spacing x,y,z",
                    axis.x, axis.y, axis.z
                ),
            ));
        }
    }
    if !origin.is_finite() {
        return Err(FormatError::damaged(
            path,
            format!("the origin is ({}, {}, {}), expected finite numbers", origin.x, origin.y, origin.z),
        ));
    }
    let matrix = DMat3::from_cols(axes[0], axes[1], axes[2]);
    // The volume of the parallelepiped divided by that of the box with the same edges; it is 0 when the axes lie in one plane. The
    // threshold 1e-9 guards against headers with seven written digits; real shears stay above 1e-2.
    let unit = DMat3::from_cols(axes[0].normalize(), axes[1].normalize(), axes[2].normalize());
    let flatness = unit.determinant().abs();
    if flatness.is_nan() || flatness < 1e-9 {
        return Err(FormatError::damaged(
            path,
            "the three axis vectors lie in one plane, or one is too short or too long beside the others: the orientation is damaged",
        ));
    }
    Ok(DAffine3::from_mat3_translation(matrix, origin))
}

/// Like [`world_from_centre`], for a file that only gives lengths along its axes.
pub(crate) fn from_spacing(path: &Path, spacing: [f64; 3], options: &OpenOptions) -> Result<DAffine3> {
    from_lengths(path, spacing, DVec3::ZERO, options)
}

/// Like [`from_spacing`], with the centre of voxel (0, 0, 0).
pub(crate) fn from_lengths(
    path: &Path,
    spacing: [f64; 3],
    origin: DVec3,
    options: &OpenOptions,
) -> Result<DAffine3> {
    if options.spacing.is_none() {
        for (a, &length) in spacing.iter().enumerate() {
            if !(length.is_finite() && length > 0.0) {
                return Err(FormatError::damaged(
                    path,
                    format!(
                        "the spacing along {} is {length}, expected a positive length: give one with --spacing x,y,z",
                        ["x", "y", "z"][a]
                    ),
                ));
            }
        }
    }
    // A length below 0 is no direction: with the caller's lengths the axis still points upwards.
    let axes = [0, 1, 2].map(|a| DVec3::AXES[a] * spacing[a].abs());
    world_from_centre(path, axes, origin, options)
}

/// Metres of a unit; 1 for an unknown one.
pub(crate) fn metres(unit: Unit) -> f64 {
    match unit {
        Unit::Nanometre => 1e-9,
        Unit::Micrometre => 1e-6,
        Unit::Millimetre => 1e-3,
        Unit::Metre | Unit::Unknown => 1.0,
    }
}

/// The unit in which lengths of a unit of this name are kept, and the metres of the named unit: ångströms are kept as nanometres.
pub(crate) fn length_unit(name: &str) -> Option<(Unit, f64)> {
    if let Some(unit) = unit_by_name(name) {
        return Some((unit, metres(unit)));
    }
    Some(match name.trim().to_lowercase().as_str() {
        "angstrom" | "ångström" => (Unit::Nanometre, 1e-10),
        "pm" | "picometer" | "picometre" => (Unit::Nanometre, 1e-12),
        "cm" | "centimeter" | "centimetre" => (Unit::Millimetre, 1e-2),
        _ => return None,
    })
}

/// One unit for the three axes of names along x, y, z, and what lengths along each are multiplied by to be in it: that of the first axis which has
/// a known one. Axes without a unit have that of the others. The last part are lines about names that are not known.
pub(crate) fn one_unit(names: [Option<&str>; 3]) -> (Unit, [f64; 3], Vec<String>) {
    let of_axes = names.map(|name| name.and_then(length_unit));
    let unknown = |a: &usize| names[*a].is_some() && of_axes[*a].is_none();
    let about = |a: usize| {
        let name = shorten(names[a].unwrap_or_default());
        format!("the unit {name:?} of axis {} is not known", ["x", "y", "z"][a])
    };
    let lines = (0..3).filter(unknown).map(about).collect();
    let Some((unit, _)) = of_axes.into_iter().flatten().next() else {
        return (Unit::Unknown, [1.0; 3], lines);
    };
    // Units are whole fractions of a metre, so a factor is the quotient of two exact powers of ten: 4 µm are 4000 nm to the last bit.
    let of_a_metre = |metres: f64| (1.0 / metres).round();
    let of_unit = of_a_metre(metres(unit));
    let factors = of_axes.map(|axis| axis.map_or(1.0, |(_, metres)| of_unit / of_a_metre(metres)));
    (unit, factors, lines)
}

/// A unit of length by one of the names that occur in files.
pub(crate) fn unit_by_name(name: &str) -> Option<Unit> {
    // ImageJ's escape (`\u00B5m`), the micro sign and the Greek letter.
    let name = name.trim().to_lowercase().replace("\\u00b5", "µ").replace('μ', "µ");
    Some(match name.as_str() {
        "nm" | "nanometer" | "nanometers" | "nanometre" | "nanometres" => Unit::Nanometre,
        "um" | "µm" | "micron" | "microns" | "micrometer" | "micrometers" | "micrometre" | "micrometres" => {
            Unit::Micrometre
        }
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Unit::Millimetre,
        "m" | "meter" | "meters" | "metre" | "metres" => Unit::Metre,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_converted_to_the_first_to_the_last_bit() {
        let (unit, factors, lines) = one_unit([Some("nm"), Some("micrometer"), None]);
        assert_eq!((unit, factors, lines.len()), (Unit::Nanometre, [1.0, 1000.0, 1.0], 0));
        assert_eq!(one_unit([Some("um"), Some("nm"), Some("m")]).1, [1.0, 0.001, 1e6]);
        assert_eq!(one_unit([Some("angstrom"); 3]).1, [0.1; 3]);
        let (unit, factors, lines) = one_unit([Some("furlong"), None, Some("mm")]);
        assert_eq!((unit, factors), (Unit::Millimetre, [1.0; 3]));
        assert_eq!(lines, ["the unit \"furlong\" of axis x is not known"]);
    }

    #[test]
    fn lengths_below_0_are_refused_and_mirror_nothing() {
        let place = |options: &OpenOptions| {
            from_lengths(Path::new("a"), [1.0, 2.0, -4.0], DVec3::new(5.0, 6.0, 7.0), options)
        };
        let line = place(&OpenOptions::default()).unwrap_err().to_string();
        assert!(line.contains("the spacing along z is -4") && line.contains("--spacing x,y,z"), "{line}");
        let said = OpenOptions { spacing: Some([3.0; 3]), ..OpenOptions::default() };
        let affine = place(&said).unwrap();
        assert_eq!(affine.matrix3, DMat3::from_diagonal(DVec3::splat(3.0)));
        assert_eq!(affine.translation, DVec3::new(5.0, 6.0, 7.0));
    }
}

//! The levels of detail at which a file holds one volume, and the choice among them.

use std::path::Path;

use pumice_core::Unit;

use crate::choice::{ChoiceValue, OpenChoice};
use crate::error::{FormatError, Result};
use crate::options::{OpenOptions, Scale};

/// One level, as its file describes it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Level {
    /// Voxels along x, y, z; `None` where the level's array is not there.
    pub(crate) dims: Option<[u64; 3]>,
    /// Lengths of a voxel along x, y, z.
    pub(crate) spacing: [f64; 3],
}

impl Level {
    fn text(&self, unit: Unit) -> String {
        let [a, b, c] = self.spacing;
        let count = match self.dims {
            Some([x, y, z]) => format!("{x} × {y} × {z} voxels"),
            None => "missing or damaged, voxels".into(),
        };
        format!("{count} of {a} × {b} × {c}{}", unit_text(unit))
    }
}

fn unit_text(unit: Unit) -> &'static str {
    match unit {
        Unit::Nanometre => " nm",
        Unit::Micrometre => " µm",
        Unit::Millimetre => " mm",
        Unit::Metre => " m",
        Unit::Unknown => "",
    }
}

/// The number of the level that is read: the caller's, or the finest, which a warning names. Levels are in the file's order.
pub(crate) fn choose_level(
    path: &Path,
    levels: &[Level],
    unit: Unit,
    options: &OpenOptions,
    open: &mut Vec<OpenChoice>,
) -> Result<usize> {
    let listed = || {
        let texts = levels.iter().enumerate().map(|(n, level)| format!("{n}: {}", level.text(unit)));
        texts.collect::<Vec<_>>().join("; ")
    };
    match options.scale {
        Some(scale) if levels.len() <= 1 => Err(FormatError::NotApplicable {
            path: path.to_owned(),
            option: format!("--scale {scale}"),
            why: "the volume has one level, which leaves nothing to choose".into(),
        }),
        Some(Scale::Level(level)) => {
            let number = level as usize;
            if number >= levels.len() {
                let count = levels.len();
                let what = format!(
                    "--scale {level} is out of range, counted from 0; there are {count} levels: {}",
                    listed()
                );
                return Err(FormatError::option(path, what));
            }
            Ok(number)
        }
        Some(Scale::Size(wanted)) => {
            let number = nearest(levels, wanted);
            if levels[number].spacing != wanted {
                options.warnings.push(format!(
                    "{}: level {number} is nearest to the voxels that were asked for: {}",
                    path.display(),
                    levels[number].text(unit)
                ));
            }
            Ok(number)
        }
        None => {
            if levels.len() > 1 {
                options.warnings.push(format!(
                    "{}: the finest of {} levels is read, {} (give --scale 0 to {})",
                    path.display(),
                    levels.len(),
                    levels[0].text(unit),
                    levels.len() - 1
                ));
                let value = |(n, level): (usize, &Level)| ChoiceValue {
                    value: n.to_string(),
                    text: level.text(unit),
                };
                open.push(OpenChoice {
                    keyword: "scale",
                    option: "--scale",
                    what: format!("the volume has {} levels", levels.len()),
                    listed: listed(),
                    values: levels.iter().enumerate().map(value).collect(),
                    count: levels.len() as u64,
                    assumed: Some("0"),
                });
            }
            Ok(0)
        }
    }
}

/// The level whose voxel lengths differ least from those that are wanted, as ratios; the finer of two that are alike.
fn nearest(levels: &[Level], wanted: [f64; 3]) -> usize {
    let off = |level: &Level| -> f64 { (0..3).map(|a| (level.spacing[a] / wanted[a]).ln().powi(2)).sum() };
    let mut best = (0, f64::INFINITY);
    for (number, level) in levels.iter().enumerate() {
        // A level without lengths is never nearest.
        let off = off(level);
        if off < best.1 {
            best = (number, off);
        }
    }
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_that_is_not_there_has_no_sizes() {
        let level = |dims| Level { dims, spacing: [4.0, 4.0, 40.0] };
        assert_eq!(level(Some([7, 5, 3])).text(Unit::Nanometre), "7 × 5 × 3 voxels of 4 × 4 × 40 nm");
        assert_eq!(level(None).text(Unit::Nanometre), "missing or damaged, voxels of 4 × 4 × 40 nm");
    }

    #[test]
    fn the_nearest_level_goes_by_ratios() {
        let level = |spacing: [f64; 3]| Level { dims: Some([1; 3]), spacing };
        let levels = [
            level([8.0, 8.0, 40.0]),
            level([16.0, 16.0, 40.0]),
            level([32.0, 32.0, 40.0]),
            level([64.0, 64.0, 80.0]),
        ];
        for (wanted, expected) in [
            ([32.0, 32.0, 40.0], 2),
            ([8.0; 3], 0),
            ([1e9; 3], 3),
            ([1e-3; 3], 0),
            ([22.0, 22.0, 40.0], 1),
            ([23.0, 23.0, 40.0], 2),
        ] {
            assert_eq!(nearest(&levels, wanted), expected, "{wanted:?}");
        }
        assert_eq!(nearest(&[level([f64::NAN; 3]), level([5.0; 3])], [5.0; 3]), 1);
    }
}

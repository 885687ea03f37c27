//! One of several volumes in a file: the index that the caller chose along an axis outside space.

use std::path::Path;

use crate::error::{FormatError, Result};

/// An axis outside space, as the user knows it.
pub(crate) struct Choice {
    /// Plural, for messages.
    pub(crate) name: &'static str,
    pub(crate) option: &'static str,
}

pub(crate) const TIME: Choice = Choice { name: "time steps", option: "--time-step" };
pub(crate) const LAYER: Choice = Choice { name: "layers", option: "--layer" };
pub(crate) const CHANNEL: Choice = Choice { name: "channels", option: "--channel" };

/// The index along an axis of `size` steps. Without a choice among several: index 0, and an error for whoever wants voxels.
pub(crate) fn choose(
    path: &Path,
    choice: &Choice,
    chosen: Option<u32>,
    size: u64,
    undecided: &mut Option<FormatError>,
) -> Result<u64> {
    let Choice { name, option } = choice;
    match chosen {
        Some(index) if u64::from(index) < size => Ok(index.into()),
        Some(index) => Err(FormatError::option(
            path,
            format!("{option} {index} asked for, counted from 0, but the number of {name} is {size}"),
        )),
        None if size <= 1 => Ok(0),
        None => {
            *undecided = Some(FormatError::Choose {
                path: path.to_owned(),
                what: format!("the file has {size} {name}, each a volume of its own"),
                option,
                choices: format!("0 to {}", size - 1),
            });
            Ok(0)
        }
    }
}

/// Refuses a choice along an axis that the file does not have, unless it is of the one step that is there.
pub(crate) fn refuse_absent(path: &Path, absent: &[(&Choice, Option<u32>)]) -> Result<()> {
    for &(choice, chosen) in absent {
        choose(path, choice, chosen, 1, &mut None)?;
    }
    Ok(())
}

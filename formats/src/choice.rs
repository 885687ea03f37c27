//! Chooses one of several volumes in a file, by the index along an axis that is not x, y or z.

use std::path::Path;

use crate::error::{FormatError, Result};

/// An axis that is not x, y or z, with its names in messages.
pub(crate) struct Choice {
    /// Plural name.
    pub(crate) name: &'static str,
    pub(crate) option: &'static str,
}

pub(crate) const TIME: Choice = Choice { name: "time steps", option: "--time-step" };
pub(crate) const LAYER: Choice = Choice { name: "layers", option: "--layer" };
pub(crate) const CHANNEL: Choice = Choice { name: "channels", option: "--channel" };

/// The index along an axis of `size` steps. If there are several and none was chosen, it is 0, and `undecided` gets the error for callers
/// that read voxels.
pub(crate) fn choose(
    path: &Path,
    choice: &Choice,
    chosen: Option<u32>,
    size: u64,
    undecided: &mut Option<FormatError>,
) -> Result<u64> {
    let choices = format!("0 to {}", size.saturating_sub(1));
    choose_among(path, choice, chosen, size, &choices, undecided)
}

/// Like [`choose`], with a text that lists the choices.
pub(crate) fn choose_among(
    path: &Path,
    choice: &Choice,
    chosen: Option<u32>,
    size: u64,
    choices: &str,
    undecided: &mut Option<FormatError>,
) -> Result<u64> {
    let Choice { name, option } = choice;
    match chosen {
        Some(index) if u64::from(index) < size => Ok(index.into()),
        Some(index) => Err(FormatError::option(
            path,
            format!(
                "{option} {index} is out of range, counted from 0; the number of {name} is {size}: {choices}"
            ),
        )),
        None if size <= 1 => Ok(0),
        None => {
            undecided.get_or_insert(FormatError::Choose {
                path: path.to_owned(),
                what: format!("the file has {size} {name}, and each is a separate volume"),
                option,
                choices: choices.to_owned(),
            });
            Ok(0)
        }
    }
}

/// Refuses a choice along axes that the file does not have, except index 0, which stands for the only step.
pub(crate) fn refuse_absent(path: &Path, absent: &[(&Choice, Option<u32>)]) -> Result<()> {
    for &(choice, chosen) in absent {
        choose(path, choice, chosen, 1, &mut None)?;
    }
    Ok(())
}

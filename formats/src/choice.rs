//! What a file leaves to the caller: which of several volumes in it is read (layers, time steps, channels, arrays), and the order of an
//! array's axes.
//!
//! A reader asks with [`choose`] while it reads the header. If the caller has not chosen, it describes the first volume and records an
//! [`OpenChoice`]: [`crate::probe()`] lists these, and [`crate::open()`] refuses a file with a choice that has no default. An index is
//! refused where a file has one volume alone, index 0 too, because it has no effect there. Only the record of a scene may have that 0.

use std::path::Path;

use crate::error::{FormatError, Result};
use crate::options::{OpenOptions, Recorded};

/// Largest number of values that are listed. A menu of more helps nobody, and a damaged header may claim billions.
const MOST_LISTED: u64 = 4096;

/// Something that a file leaves open, with the possible answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenChoice {
    /// Field of [`crate::OpenOptions`] that takes the answer: `layer`, `time`, `channel`, `array` or `axes`.
    pub keyword: &'static str,
    /// Option of the command that takes the answer, such as `--layer`.
    pub option: &'static str,
    /// What is open, as a sentence without a full stop.
    pub what: String,
    /// The answers in one line.
    pub listed: String,
    /// The answers one by one: the first 4096 of `count`.
    pub values: Vec<ChoiceValue>,
    /// Number of answers.
    pub count: u64,
    /// The answer that is assumed; `None` where [`crate::open()`] refuses the file without an answer.
    pub assumed: Option<&'static str>,
}

/// One possible answer to an [`OpenChoice`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChoiceValue {
    /// The answer, as the option takes it.
    pub value: String,
    /// What is behind it, in one line: names of segments, shape of an array. Empty where the file says nothing.
    pub text: String,
}

impl OpenChoice {
    /// The error of a caller who reads voxels without having chosen.
    pub(crate) fn undecided(&self, path: &Path) -> FormatError {
        FormatError::Choose {
            path: path.to_owned(),
            what: self.what.clone(),
            option: self.option,
            choices: self.listed.clone(),
        }
    }
}

/// An axis that is not x, y or z, with its names in messages.
pub(crate) struct Choice {
    /// Plural name.
    pub(crate) name: &'static str,
    pub(crate) keyword: &'static str,
    pub(crate) option: &'static str,
    /// The index in the options.
    chosen: fn(&OpenOptions) -> Option<u32>,
    /// Whether that index is one of a scene's record.
    is_recorded: fn(&Recorded) -> bool,
}

pub(crate) const TIME: Choice = Choice {
    name: "time steps",
    keyword: "time",
    option: "--time-step",
    chosen: |options| options.time,
    is_recorded: |recorded| recorded.time,
};
pub(crate) const LAYER: Choice = Choice {
    name: "layers",
    keyword: "layer",
    option: "--layer",
    chosen: |options| options.layer,
    is_recorded: |recorded| recorded.layer,
};
pub(crate) const CHANNEL: Choice = Choice {
    name: "channels",
    keyword: "channel",
    option: "--channel",
    chosen: |options| options.channel,
    is_recorded: |recorded| recorded.channel,
};

/// The index along an axis of `size` steps. If there are several and none was chosen, it is 0, and `open` gets the choice.
pub(crate) fn choose(
    path: &Path,
    choice: &Choice,
    options: &OpenOptions,
    size: u64,
    open: &mut Vec<OpenChoice>,
) -> Result<u64> {
    let listed = format!("0 to {}", size.saturating_sub(1));
    choose_among(path, choice, options, size, &listed, |_| String::new(), open)
}

/// Like [`choose`], with the choices in one line, and the text of each.
pub(crate) fn choose_among(
    path: &Path,
    choice: &Choice,
    options: &OpenOptions,
    size: u64,
    listed: &str,
    text_of: impl Fn(u64) -> String,
    open: &mut Vec<OpenChoice>,
) -> Result<u64> {
    let Choice { name, keyword, option, .. } = choice;
    match (choice.chosen)(options) {
        Some(0) if size <= 1 && (choice.is_recorded)(&options.recorded) => Ok(0),
        Some(index) if size <= 1 => Err(FormatError::NotApplicable {
            path: path.to_owned(),
            option: format!("{option} {index}"),
            why: format!("the number of {name} is 1, which leaves nothing to choose"),
        }),
        Some(index) if u64::from(index) < size => Ok(index.into()),
        Some(index) => Err(FormatError::option(
            path,
            format!(
                "{option} {index} is out of range, counted from 0; the number of {name} is {size}: {listed}"
            ),
        )),
        None if size <= 1 => Ok(0),
        None => {
            open.push(OpenChoice {
                keyword,
                option,
                what: format!("the file has {size} {name}, and each is a separate volume"),
                listed: listed.to_owned(),
                values: (0..size.min(MOST_LISTED))
                    .map(|index| ChoiceValue { value: index.to_string(), text: text_of(index) })
                    .collect(),
                count: size,
                assumed: None,
            });
            Ok(0)
        }
    }
}

/// Refuses an index along axes that the file does not have.
pub(crate) fn refuse_absent(path: &Path, options: &OpenOptions, absent: &[&Choice]) -> Result<()> {
    absent.iter().try_for_each(|choice| choose(path, choice, options, 1, &mut Vec::new()).map(drop))
}

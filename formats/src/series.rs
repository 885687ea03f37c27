//! Time series in foreign files: the time steps of one file, or files of which each is a frame.
//!
//! ```text
//! cells.tif, 20 time steps        --time-steps all     frame k is time step k
//! frame_{t}.tif                   the files of the folder that have a number there, in the order of the numbers
//! t{t}/labels.zarr                the same, with a folder for each frame
//! a.nrrd b.nrrd c.nrrd            several files, in the order of the numbers in their names
//! ```
//! A frame is opened when the one before has been read. Each is opened by itself, so a time step of a file that is one gzip stream is reached
//! by inflating those before it again.

use std::path::{Component, Path, PathBuf};

use pumice_core::{BlockSource, SeriesSource, VoxelRegion};

use crate::error::{FormatError, Result};
use crate::natural_order::natural;
use crate::open::{open, open_regions, probe};
use crate::options::{OpenOptions, Warnings};
use crate::slice_numbers::{Gap, gap};

/// Stands for a number in the names of files.
const NUMBER: &str = "{t}";

/// Which time steps of a source are frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeSteps {
    /// All of them.
    All,
    /// From the first to the last, both included, counted from 0.
    Range(u32, u32),
}

impl std::str::FromStr for TimeSteps {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let range = || {
            let (first, last) = text.split_once('-')?;
            let (first, last) = (first.parse().ok()?, last.parse().ok()?);
            (first <= last).then_some(Self::Range(first, last))
        };
        match text {
            "all" => Ok(Self::All),
            _ => range().ok_or_else(|| "expected all, or the first and the last time step, e.g. 0-19".into()),
        }
    }
}

impl TimeSteps {
    /// The chosen ones of `count` time steps of `path`.
    ///
    /// # Errors
    /// [`FormatError::Option`] where there are fewer.
    pub fn of(self, path: &Path, count: u64) -> Result<std::ops::Range<u32>> {
        let most = u32::try_from(count).map_err(|_| FormatError::Limit {
            path: path.to_owned(),
            what: "the number of time steps".into(),
            got: count.to_string(),
            limit: u32::MAX.into(),
        })?;
        match self {
            Self::All => Ok(0..most),
            Self::Range(first, last) if last < most => Ok(first..last + 1),
            Self::Range(first, last) => Err(FormatError::option(
                path,
                format!(
                    "--time-steps {first}-{last} is out of range, counted from 0; the number of time steps is {count}: 0 to {}",
                    count.saturating_sub(1)
                ),
            )),
        }
    }
}

/// A time series in foreign files.
#[derive(Debug)]
pub struct FileSeries {
    /// The file of each frame, and the time step of it where it has several.
    frames: Vec<(PathBuf, Option<u32>)>,
    options: OpenOptions,
    /// The regions of each frame that are read; `None` for all of it.
    regions: Option<Vec<VoxelRegion>>,
    next: usize,
}

/// Whether a source that is named like this is a series of files: a name with `{t}`.
pub fn is_pattern(path: &Path) -> bool {
    path.to_string_lossy().contains(NUMBER)
}

/// The frames of the files that a caller names; `None` where that is one volume. No voxel is read.
///
/// # Errors
/// [`FormatError`], also for numbers that are missing in a pattern and for time steps that a file does not have.
pub fn open_series(
    inputs: &[PathBuf],
    steps: Option<TimeSteps>,
    options: &OpenOptions,
) -> Result<Option<FileSeries>> {
    let of = |frames| Ok(Some(FileSeries { frames, options: options.clone(), regions: None, next: 0 }));
    match (inputs, steps) {
        ([one], None) if !is_pattern(one) => Ok(None),
        ([one], Some(steps)) if !is_pattern(one) => {
            let found = probe(one, options)?;
            let Some(choice) = found.choices.iter().find(|choice| choice.keyword == "time") else {
                return Err(FormatError::NotApplicable {
                    path: one.clone(),
                    option: "--time-steps".into(),
                    why: "the file has one time step".into(),
                });
            };
            of(steps.of(one, choice.count)?.map(|step| (one.clone(), Some(step))).collect())
        }
        _ => {
            let mut files = Vec::new();
            for input in inputs {
                match is_pattern(input) {
                    true => files.extend(files_of(input)?),
                    false => files.push(input.clone()),
                }
            }
            files.sort_by(|a, b| natural(&a.to_string_lossy(), &b.to_string_lossy()));
            let first = inputs.first().map_or(Path::new(""), PathBuf::as_path);
            refuse_gap(first, &files)?;
            let range = steps.unwrap_or(TimeSteps::All).of(first, files.len() as u64)?;
            of(files[range.start as usize..range.end as usize]
                .iter()
                .map(|file| (file.clone(), None))
                .collect())
        }
    }
}

/// The files that a pattern stands for: those with a number in place of `{t}`.
fn files_of(pattern: &Path) -> Result<Vec<PathBuf>> {
    let refuse = |what: String| FormatError::option(pattern, what);
    let parts: Vec<Component<'_>> = pattern.components().collect();
    let is_part = |part: &Component<'_>| part.as_os_str().to_string_lossy().contains(NUMBER);
    let places: Vec<usize> = (0..parts.len()).filter(|&i| is_part(&parts[i])).collect();
    let [place] = places[..] else {
        return Err(refuse(format!("expected {NUMBER} in one name of the path, got it in {}", places.len())));
    };
    let name = parts[place].as_os_str().to_string_lossy();
    let Some((before, after)) = name.split_once(NUMBER).filter(|(_, after)| !after.contains(NUMBER)) else {
        return Err(refuse(format!("expected {NUMBER} once, got it twice")));
    };
    let folder: PathBuf = parts[..place].iter().collect();
    let folder = if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder };
    let behind: PathBuf = parts[place + 1..].iter().collect();
    let mut files = Vec::new();
    for entry in std::fs::read_dir(&folder).map_err(FormatError::io(&folder))? {
        let entry = entry.map_err(FormatError::io(&folder))?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let number = name.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
        if number.is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit())) {
            let file = if place == 0 { PathBuf::from(entry.file_name()) } else { entry.path() };
            files.push(if behind.as_os_str().is_empty() { file } else { file.join(&behind) });
        }
    }
    if files.is_empty() {
        return Err(refuse(format!("no file has a number in place of {NUMBER}")));
    }
    Ok(files)
}

/// Refuses files between which a number is missing: all frames behind it would be at the wrong time.
fn refuse_gap(pattern: &Path, files: &[PathBuf]) -> Result<()> {
    let names: Vec<_> = files.iter().map(|file| file.to_string_lossy()).collect();
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    let Some(Gap { missing, count, before, after }) = gap(&names) else { return Ok(()) };
    let more = if count == 1 { String::new() } else { format!(" (the first of {count})") };
    Err(FormatError::damaged(
        pattern,
        format!(
            "time step {missing} is missing between {before} and {after}{more}: add it, or number the files without a gap"
        ),
    ))
}

impl FileSeries {
    /// The file of a frame, and the time step of it where it has several.
    pub fn place(&self, frame: u32) -> (&Path, Option<u32>) {
        let (path, step) = &self.frames[frame as usize];
        (path, *step)
    }

    /// The same frames, of which only the voxels of these regions are delivered ([`open_regions`]).
    pub fn of_regions(&self, regions: Vec<VoxelRegion>) -> Self {
        Self { frames: self.frames.clone(), options: self.options.clone(), regions: Some(regions), next: 0 }
    }

    /// Opens a frame, whatever was opened before.
    ///
    /// # Errors
    /// As [`open`].
    pub fn open(&self, frame: u32) -> Result<Box<dyn BlockSource>> {
        let (path, step) = self.place(frame);
        // Files of a series are alike, and so is what their readers have to say: the first speaks for all.
        let quiet = frame > 0 && path != self.frames[0].0;
        let warnings = if quiet { Warnings::default() } else { self.options.warnings.clone() };
        let options = OpenOptions {
            time: step.or(self.options.time),
            warnings: warnings.clone(),
            ..self.options.clone()
        };
        let source = match &self.regions {
            Some(regions) => open_regions(path, &options, regions)?,
            None => open(path, &options)?,
        };
        if quiet {
            let (this, first) = (path.to_string_lossy(), self.frames[0].0.to_string_lossy());
            let known = self.options.warnings.list();
            let news =
                warnings.list().into_iter().filter(|text| !known.contains(&text.replacen(&*this, &first, 1)));
            news.for_each(|text| self.options.warnings.push(text));
        }
        Ok(source)
    }
}

impl SeriesSource for FileSeries {
    fn frames(&self) -> u32 {
        self.frames.len() as u32
    }

    fn name(&self, frame: u32) -> String {
        match self.place(frame) {
            (path, None) => path.display().to_string(),
            (path, Some(step)) => format!("{}, time step {step}", path.display()),
        }
    }

    fn next_frame(&mut self) -> pumice_core::Result<Box<dyn BlockSource + '_>> {
        let frame = self.next as u32;
        self.next += 1;
        Ok(self.open(frame)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_steps_are_read_or_refused() {
        assert_eq!("all".parse(), Ok(TimeSteps::All));
        assert_eq!("3-7".parse(), Ok(TimeSteps::Range(3, 7)));
        assert_eq!("4-4".parse(), Ok(TimeSteps::Range(4, 4)));
        for bad in ["", "7", "7-3", "-3", "a-b", "0-4294967296", "All"] {
            assert!(bad.parse::<TimeSteps>().is_err(), "{bad}");
        }
        let path = Path::new("a.tif");
        assert_eq!(TimeSteps::All.of(path, 5).unwrap(), 0..5);
        assert_eq!(TimeSteps::Range(1, 4).of(path, 5).unwrap(), 1..5);
        let error = TimeSteps::Range(1, 5).of(path, 5).unwrap_err().to_string();
        assert_eq!(
            error,
            "a.tif: --time-steps 1-5 is out of range, counted from 0; the number of time steps is 5: 0 to 4"
        );
    }

    #[test]
    fn a_pattern_finds_its_files_in_the_order_of_their_numbers() {
        let folder = std::env::temp_dir().join(format!("pumice-pattern-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for name in ["f_9.tif", "f_10.tif", "f_11.tif", "f_x.tif", "f_12.nrrd", "g_13.tif", "f_.tif"] {
            std::fs::write(folder.join(name), "").unwrap();
        }
        let series = |pattern: &str| open_series(&[folder.join(pattern)], None, &OpenOptions::default());
        let found = series("f_{t}.tif").unwrap().unwrap();
        let names: Vec<_> =
            found.frames.iter().map(|(path, _)| path.file_name().unwrap().to_owned()).collect();
        assert_eq!(names, ["f_9.tif", "f_10.tif", "f_11.tif"]);
        std::fs::remove_file(folder.join("f_10.tif")).unwrap();
        std::fs::write(folder.join("f_12.tif"), "").unwrap();
        let missing = series("f_{t}.tif").unwrap_err().to_string();
        assert!(missing.contains("time step 10 is missing between"), "{missing}");
        for (pattern, what) in [
            ("h_{t}.tif", "no file has a number in place of {t}"),
            ("{t}_{t}.tif", "expected {t} once, got it twice"),
            ("{t}/{t}.tif", "expected {t} in one name of the path, got it in 2"),
        ] {
            let error = series(pattern).unwrap_err().to_string();
            assert!(error.ends_with(what), "{error}");
        }
        assert!(series("f_9.tif").unwrap().is_none());
        std::fs::remove_dir_all(folder).unwrap();
    }
}

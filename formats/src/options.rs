//! Options of a caller that complete or override what a file says.

use std::fmt;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use pumice_core::{CancelFlag, Job, LabelType, Outputs};

pub use crate::store_options::{MissingChunks, Roi, Scale};

/// How to read a file that does not fully describe itself.
#[derive(Clone, Debug, Default)]
pub struct OpenOptions {
    /// Index of the layer (a `list` or `vector` axis, overlapping segments), counted from 0.
    pub layer: Option<u32>,
    /// Index of the time step, counted from 0.
    pub time: Option<u32>,
    /// Index of the channel, counted from 0.
    pub channel: Option<u32>,
    /// Name of the array in an `.npz` archive.
    pub array: Option<String>,
    /// Voxel lengths along x, y, z that replace those of the file; axis directions and unit are kept.
    pub spacing: Option<[f64; 3]>,
    /// Read the file as voxels without a header. No other format is tried then.
    pub raw: Option<RawLayout>,
    /// Meaning of the axes of an array whose file does not say it (NumPy: by default [`ArrayAxes::Xyz`] with a warning), or of the pages of a TIFF
    /// file in place of what it says; other files say it themselves and refuse it.
    pub axes: Option<ArrayAxes>,
    /// Which level of a file with several, by number or by the size of its voxels; the finest if none is given.
    pub scale: Option<Scale>,
    /// The voxels to read, of the level that is read; all if none are given. The matrix of the volume is moved to their lowest.
    pub roi: Option<Roi>,
    /// Name of a label image among those of an OME-Zarr picture.
    pub label: Option<String>,
    /// Path of a data set within a file or folder that holds several, such as `volumes/labels`.
    pub dataset: Option<String>,
    /// What an absent chunk of a store means; the fill value if nothing is given.
    pub missing_chunks: Option<MissingChunks>,
    /// Table of pairs of ids: what has the first id gets the second.
    pub relabel: Option<PathBuf>,
    /// Receives notices for the user that are not errors. Clone it before reading and list it afterwards.
    pub warnings: Warnings,
    /// What the caller will write. Readers refuse to read one of these files, also where a header names it.
    pub outputs: Outputs,
    /// Which indices the caller has from a scene or a picture.
    pub recorded: Recorded,
    /// Whether the caller has given up; headers on servers are then no longer waited for.
    pub cancelled: CancelFlag,
}

/// Which of `layer`, `time` and `channel` a scene or a picture records. Index 0 of these is accepted where the file has one volume alone;
/// of a caller it is refused, because it has no effect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Recorded {
    /// Whether `layer` is recorded.
    pub layer: bool,
    /// Whether `time` is recorded.
    pub time: bool,
    /// Whether `channel` is recorded.
    pub channel: bool,
}

impl OpenOptions {
    /// No options; what reads with them gives up soon after the job is cancelled.
    pub fn heeding(job: &Job) -> Self {
        Self { cancelled: job.cancel_flag(), ..Self::default() }
    }

    /// The same, for reading a header that was read before: its warnings go nowhere.
    pub fn silent(&self) -> Self {
        Self { warnings: Warnings::default(), ..self.clone() }
    }

    /// The options of the command that the caller has given, such as `--layer`.
    pub fn given(&self) -> Vec<&'static str> {
        // Taken apart by name, so that a new field cannot be forgotten here.
        let Self {
            layer,
            time,
            channel,
            array,
            spacing,
            raw,
            axes,
            scale,
            roi,
            label,
            dataset,
            missing_chunks,
            relabel,
            warnings: _,
            outputs: _,
            recorded: _,
            cancelled: _,
        } = self;
        let all = [
            ("--layer", layer.is_some()),
            ("--time-step", time.is_some()),
            ("--channel", channel.is_some()),
            ("--array", array.is_some()),
            ("--spacing", spacing.is_some()),
            ("--axes", axes.is_some()),
            ("--raw-dims", raw.is_some()),
            ("--scale", scale.is_some()),
            ("--roi", roi.is_some()),
            ("--label", label.is_some()),
            ("--dataset", dataset.is_some()),
            ("--missing-chunks", missing_chunks.is_some()),
            ("--relabel", relabel.is_some()),
        ];
        all.into_iter().filter(|(_, is_given)| *is_given).map(|(option, _)| option).collect()
    }
}

impl fmt::Display for OpenOptions {
    /// The options that were given, as the command takes them: `--scale 2 --roi 0:512,:,:`. Of a table of joined ids it has the file's name alone.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let raw = self.raw.as_ref().map(|raw| {
            let [x, y, z] = raw.dims;
            let end = if raw.big_endian { " --raw-big-endian" } else { "" };
            let label_type = format!("{:?}", raw.label_type).to_lowercase();
            format!("{x},{y},{z} --raw-type {label_type} --raw-offset {}{end}", raw.offset)
        });
        let values = [
            ("--layer", self.layer.map(|n| n.to_string())),
            ("--time-step", self.time.map(|n| n.to_string())),
            ("--channel", self.channel.map(|n| n.to_string())),
            ("--array", self.array.clone()),
            ("--spacing", self.spacing.map(|lengths| list(&lengths))),
            ("--axes", self.axes.map(|axes| axes.name().to_owned())),
            ("--raw-dims", raw),
            ("--scale", self.scale.map(|scale| scale.to_string())),
            ("--roi", self.roi.map(|roi| roi.to_string())),
            ("--label", self.label.clone()),
            ("--dataset", self.dataset.clone()),
            ("--missing-chunks", self.missing_chunks.map(|missing| missing.name().to_owned())),
            (
                "--relabel",
                self.relabel
                    .as_ref()
                    .map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned()),
            ),
        ];
        debug_assert_eq!(values.iter().filter(|(_, value)| value.is_some()).count(), self.given().len());
        let given = values.into_iter().filter_map(|(name, value)| Some((name, value?)));
        for (i, (name, value)) in given.enumerate() {
            let space = if i == 0 { "" } else { " " };
            write!(f, "{space}{name} {value}")?;
        }
        Ok(())
    }
}

/// Layout of voxels without a header, in x-fastest order; a gzip file is recognised.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawLayout {
    /// Voxels along x, y, z.
    pub dims: [u64; 3],
    /// Number type of the voxels.
    pub label_type: LabelType,
    /// Whether the most significant byte comes first.
    pub big_endian: bool,
    /// Bytes before the first voxel (of the inflated data where the file is gzip).
    pub offset: u64,
}

/// Meaning of the axes of an array in the order of its indices, or of a TIFF file's pages, slowest first, and the pixels of a page.
///
/// The names are those of the axes: x, y, z, t for time steps, c for channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "each order is its name")]
pub enum ArrayAxes {
    /// `a[x, y, z]`, as nibabel and pynrrd return arrays.
    Xyz,
    /// `a[z, y, x]`, as tifffile, scikit-image and napari return arrays; the pages of a TIFF file are slices.
    Zyx,
    Tyx,
    Cyx,
    Tzyx,
    Ztyx,
    Czyx,
    Zcyx,
    Tcyx,
    Ctyx,
    Tczyx,
    Tzcyx,
    Ctzyx,
    Cztyx,
    Ztcyx,
    Zctyx,
}

impl ArrayAxes {
    /// All orders.
    pub const ALL: [Self; 16] = [
        Self::Xyz,
        Self::Zyx,
        Self::Tyx,
        Self::Cyx,
        Self::Tzyx,
        Self::Ztyx,
        Self::Czyx,
        Self::Zcyx,
        Self::Tcyx,
        Self::Ctyx,
        Self::Tczyx,
        Self::Tzcyx,
        Self::Ctzyx,
        Self::Cztyx,
        Self::Ztcyx,
        Self::Zctyx,
    ];

    /// The orders of an array of three axes.
    pub const OF_ARRAYS: [Self; 2] = [Self::Xyz, Self::Zyx];

    /// Name of the order, such as `zyx`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Xyz => "xyz",
            Self::Zyx => "zyx",
            Self::Tyx => "tyx",
            Self::Cyx => "cyx",
            Self::Tzyx => "tzyx",
            Self::Ztyx => "ztyx",
            Self::Czyx => "czyx",
            Self::Zcyx => "zcyx",
            Self::Tcyx => "tcyx",
            Self::Ctyx => "ctyx",
            Self::Tczyx => "tczyx",
            Self::Tzcyx => "tzcyx",
            Self::Ctzyx => "ctzyx",
            Self::Cztyx => "cztyx",
            Self::Ztcyx => "ztcyx",
            Self::Zctyx => "zctyx",
        }
    }

    /// The order of this name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|axes| axes.name() == name)
    }
}

/// A list of one-line warnings, shared by reader and caller.
#[derive(Clone, Default)]
pub struct Warnings {
    list: Arc<Mutex<Vec<String>>>,
    listener: Option<Arc<Listener>>,
}

/// A function that is called with each warning.
type Listener = dyn Fn(&str) + Send + Sync;

impl Warnings {
    /// An empty list; `listener` is called with each warning as it is added.
    pub fn told_to(listener: impl Fn(&str) + Send + Sync + 'static) -> Self {
        Self { list: Arc::default(), listener: Some(Arc::new(listener)) }
    }

    /// Adds a warning, unless the same text is already there.
    pub fn push(&self, text: impl Into<String>) {
        let text = text.into();
        let mut list = self.list.lock().unwrap_or_else(PoisonError::into_inner);
        if list.contains(&text) {
            return;
        }
        if let Some(listener) = &self.listener {
            listener(&text);
        }
        list.push(text);
    }

    /// All warnings up to now.
    pub fn list(&self) -> Vec<String> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl std::fmt::Debug for Warnings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Warnings").field(&self.list()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_listener_hears_each_warning_once_at_once() {
        let heard: Warnings = Warnings::default();
        let copy = heard.clone();
        let warnings = Warnings::told_to(move |text| copy.push(text));
        warnings.push("a");
        assert_eq!(heard.list(), ["a"]);
        warnings.clone().push("a");
        warnings.push("b");
        assert_eq!(
            (heard.list(), warnings.list()),
            (vec!["a".into(), "b".into()], vec!["a".into(), "b".into()])
        );
    }

    #[test]
    fn each_option_that_is_given_is_named() {
        assert_eq!(OpenOptions::default().given(), [""; 0]);
        let raw = RawLayout { dims: [1; 3], label_type: LabelType::U8, big_endian: false, offset: 0 };
        let all = OpenOptions {
            layer: Some(0),
            time: Some(0),
            channel: Some(0),
            array: Some(String::new()),
            spacing: Some([1.0; 3]),
            raw: Some(raw),
            axes: Some(ArrayAxes::Xyz),
            scale: Some(Scale::Level(0)),
            roi: Some(Roi([[None; 2]; 3])),
            label: Some(String::new()),
            dataset: Some(String::new()),
            missing_chunks: Some(MissingChunks::Fill),
            relabel: Some(PathBuf::new()),
            warnings: Warnings::default(),
            outputs: Outputs::default(),
            recorded: Recorded::default(),
            cancelled: CancelFlag::default(),
        };
        let options = "--layer --time-step --channel --array --spacing --axes --raw-dims --scale --roi --label --dataset \
                       --missing-chunks --relabel";
        assert_eq!(all.given().join(" "), options);
    }
}

//! Options of a caller that complete or override what a file says.

use std::sync::{Arc, Mutex, PoisonError};

use pumice_core::{LabelType, Outputs};

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
    /// Meaning of the axes of a NumPy array, by default [`ArrayAxes::Xyz`] with a warning; other files say it themselves and refuse it.
    pub axes: Option<ArrayAxes>,
    /// Receives notices for the user that are not errors. Clone it before reading and list it afterwards.
    pub warnings: Warnings,
    /// What the caller will write. Readers refuse to read one of these files, also where a header names it.
    pub outputs: Outputs,
}

/// Layout of voxels without a header, in x-fastest order; a gzip file is recognised.
#[derive(Clone, Debug)]
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

/// Meaning of the axes of a NumPy array, in the order of its indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArrayAxes {
    /// `a[x, y, z]`, as nibabel and pynrrd return arrays.
    Xyz,
    /// `a[z, y, x]`, as tifffile, scikit-image and napari return arrays.
    Zyx,
}

impl ArrayAxes {
    /// Both orders.
    pub const ALL: [Self; 2] = [Self::Xyz, Self::Zyx];

    /// Name of the order: `xyz` or `zyx`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Xyz => "xyz",
            Self::Zyx => "zyx",
        }
    }

    /// The order of this name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|axes| axes.name() == name)
    }
}

/// A list of one-line warnings, shared by reader and caller.
#[derive(Clone, Debug, Default)]
pub struct Warnings(Arc<Mutex<Vec<String>>>);

impl Warnings {
    /// Adds a warning, unless the same text is already there.
    pub(crate) fn push(&self, text: impl Into<String>) {
        let text = text.into();
        let mut list = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !list.contains(&text) {
            list.push(text);
        }
    }

    /// All warnings up to now.
    pub fn list(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

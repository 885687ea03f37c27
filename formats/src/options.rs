//! What a caller may add to what a file says.

use std::sync::{Arc, Mutex, PoisonError};

use pumice_core::LabelType;

/// How to read a file that does not say it all by itself.
#[derive(Clone, Debug, Default)]
pub struct OpenOptions {
    /// Which layer (a `list` or `vector` axis, overlapping segments), counted from 0.
    pub layer: Option<u32>,
    /// Which time step, counted from 0.
    pub time: Option<u32>,
    /// Which channel, counted from 0.
    pub channel: Option<u32>,
    /// Which array of an `.npz` archive.
    pub array: Option<String>,
    /// Voxel lengths along x, y, z, instead of the file's; axis directions and unit are kept.
    pub spacing: Option<[f64; 3]>,
    /// Read the file as voxels without a header; where this is given, no other format is tried.
    pub raw: Option<RawLayout>,
    /// What the axes of a NumPy array mean.
    pub axes: ArrayAxes,
    /// Where readers put what the user should know though it is no error. Clone it before, list it after reading.
    pub warnings: Warnings,
}

/// Voxels without a header, x fastest, then y, then z; gzip is recognised.
#[derive(Clone, Debug)]
pub struct RawLayout {
    /// Voxels along x, y, z.
    pub dims: [u64; 3],
    /// Their type.
    pub label_type: LabelType,
    /// Whether the most significant byte comes first.
    pub big_endian: bool,
    /// Bytes before the first voxel (of the inflated data where the file is gzip).
    pub offset: u64,
}

/// Meaning of the axes of a NumPy array, in the order of its indices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ArrayAxes {
    /// `a[x, y, z]`: as nibabel and pynrrd hand arrays out.
    #[default]
    Xyz,
    /// `a[z, y, x]`: as tifffile and scikit-image hand arrays out.
    Zyx,
}

/// A list of one-line warnings that reader and caller share.
#[derive(Clone, Debug, Default)]
pub struct Warnings(Arc<Mutex<Vec<String>>>);

impl Warnings {
    /// Adds a warning; the same text is kept once.
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

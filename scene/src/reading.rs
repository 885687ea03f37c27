//! How the file of a volume is read where the file alone does not decide it.
//!
//! A scene that draws one time step of a file, or an array whose axes are z, y, x, draws other voxels when it is opened without these
//! choices. So they are part of the instance, beside its `source`, and are left out of the JSON form where nothing was chosen.

use std::path::PathBuf;

use pumice_core::LabelType;
use serde::{Deserialize, Serialize};

/// The choices with which the source of an instance is read; each is `None` where the file decides.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Reading {
    /// Layer of a file with overlapping segments, counted from 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layer: Option<u32>,
    /// Time step, counted from 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<u32>,
    /// Channel, counted from 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<u32>,
    /// Name of an array in an `.npz` archive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub array: Option<String>,
    /// Meaning of the axes of an array, or of the pages of a TIFF file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes: Option<AxisOrder>,
    /// Lengths of a voxel along x, y, z in the file's unit, in place of those that the file states.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spacing: Option<[f64; 3]>,
    /// Layout of a file without a header.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub raw: Option<RawVoxels>,
    /// Level of a file with several: a number, or the lengths of a voxel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<LevelOfFile>,
    /// First voxel and the one after the last along x, y, z; null is the volume's end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roi: Option<[[Option<u64>; 2]; 3]>,
    /// Name of a label image of an OME-Zarr picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub label: Option<String>,
    /// Path of a data set within the file or folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dataset: Option<String>,
    /// What an absent chunk means.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing_chunks: Option<AbsentChunks>,
    /// Table of pairs of ids that are joined while the volume is read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relabel: Option<PathBuf>,
}

impl Reading {
    /// Whether nothing is chosen.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Meaning of the axes of an array in the order of its indices, or of a TIFF file's pages, slowest first, and the pixels of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "each order is its name")]
pub enum AxisOrder {
    /// `a[x, y, z]`.
    Xyz,
    /// `a[z, y, x]`; the pages of a TIFF file are slices.
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

impl AxisOrder {
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

    /// Its name, such as `zyx`.
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
}

/// A level of a file that holds a volume at several.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum LevelOfFile {
    /// Its number; 0 is the finest.
    Number(u32),
    /// The level whose voxels are nearest to these lengths along x, y, z.
    Size([f64; 3]),
}

/// What a chunk means that a store lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AbsentChunks {
    /// The fill value.
    Fill,
    /// The store is refused.
    Error,
}

/// Layout of voxels without a header, x fastest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawVoxels {
    /// Voxels along x, y, z.
    pub dims: [u64; 3],
    /// Number type of the labels.
    pub label_type: LabelType,
    /// Whether the most significant byte comes first.
    #[serde(default)]
    pub big_endian: bool,
    /// Bytes before the first voxel.
    #[serde(default)]
    pub offset: u64,
}

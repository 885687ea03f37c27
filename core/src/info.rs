//! The description of a volume without its voxels: size, label type, position in the world, names and colours.
//!
//! **Index space** has one unit a voxel: voxel (i, j, k) is the cube [i, i+1) × [j, j+1) × [k, k+1), so its centre is at
//! (i + ½, j + ½, k + ½). Other file formats place voxel *centres* at whole numbers; [`VolumeInfo::from_centre_affine`] and
//! [`VolumeInfo::world_from_centre`] convert.

use glam::{DAffine3, DVec3};
use serde::{Deserialize, Serialize};

/// Number type of the labels in their source file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "the names say it")]
pub enum LabelType {
    U8,
    U16,
    U32,
    U64,
    I8,
    I16,
    I32,
    I64,
    F32,
    F64,
}

/// Length unit of world space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[allow(missing_docs, reason = "the names say it")]
pub enum Unit {
    #[serde(rename = "nm")]
    Nanometre,
    #[serde(rename = "um")]
    Micrometre,
    #[serde(rename = "mm")]
    Millimetre,
    #[serde(rename = "m")]
    Metre,
    /// The file does not state a unit.
    #[default]
    #[serde(rename = "unknown")]
    Unknown,
}

/// Anatomical directions of the world axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum WorldFrame {
    /// x right, y anterior, z superior (NIfTI).
    #[serde(rename = "RAS")]
    Ras,
    /// x left, y posterior, z superior (DICOM, most NRRD).
    #[serde(rename = "LPS")]
    Lps,
    /// x left, y anterior, z superior.
    #[serde(rename = "LAS")]
    Las,
    /// The file does not state the directions.
    #[default]
    #[serde(rename = "unknown")]
    Unknown,
}

/// Name and colour of one label, where its source file has them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LabelNote {
    /// The label's id, as stored in the voxels.
    pub id: u64,
    /// Name of the label in the file.
    pub name: Option<String>,
    /// sRGB-encoded colour, each channel in [0, 1].
    pub color_srgb: Option<[f32; 3]>,
}

/// Description of a label volume without its voxels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VolumeInfo {
    /// Voxels along x, y, z; each at least 1 unless the volume is empty.
    pub dims: [u32; 3],
    /// Type of the labels in the file.
    pub label_type: LabelType,
    /// Maps index space (corner convention, see the module documentation) to the file's world, in [`VolumeInfo::unit`].
    pub world_from_index: DAffine3,
    /// Unit of world space.
    pub unit: Unit,
    /// Directions of the world axes.
    pub frame: WorldFrame,
    /// Names and colours of labels, sorted by id; labels with neither are left out.
    pub notes: Vec<LabelNote>,
}

impl VolumeInfo {
    /// A volume with cubic voxels of size 1 at the origin; its unit and frame are unknown.
    pub fn new(dims: [u32; 3], label_type: LabelType) -> Self {
        Self {
            dims,
            label_type,
            world_from_index: DAffine3::IDENTITY,
            unit: Unit::Unknown,
            frame: WorldFrame::Unknown,
            notes: Vec::new(),
        }
    }

    /// Sets [`VolumeInfo::world_from_index`] from a matrix that maps whole-number voxel *centres* to the world, as NIfTI and
    /// NRRD store it.
    pub fn from_centre_affine(mut self, world_from_centre: DAffine3) -> Self {
        self.world_from_index = world_from_centre * DAffine3::from_translation(DVec3::splat(-0.5));
        self
    }

    /// The matrix that maps whole-number voxel centres to the world: the affine of NIfTI and NRRD.
    pub fn world_from_centre(&self) -> DAffine3 {
        self.world_from_index * DAffine3::from_translation(DVec3::splat(0.5))
    }

    /// Lengths of one voxel along x, y, z in [`VolumeInfo::unit`].
    pub fn spacing(&self) -> [f64; 3] {
        let m = self.world_from_index.matrix3;
        [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()]
    }

    /// Number of voxels.
    pub fn voxels(&self) -> u64 {
        // Each axis is at most 2²³ (`MAX_DIM`), checked when a volume is compressed: 2⁶⁹ would overflow, so saturate.
        self.dims.iter().fold(1u64, |n, &d| n.saturating_mul(u64::from(d)))
    }
}

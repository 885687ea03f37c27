//! A summary of a `.pumice` file or a label volume.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::DAffine3;
use pumice_core::{CompressedVolume, Job};
use pumice_cpu::traverse::{TracedInstance, VolumeTracer};
use pumice_formats::OpenOptions;
use pumice_transport::geometry::LodChoice;
use serde::Serialize;

use crate::error::{Result, SessionError, io};
use crate::open::is_pumice_file;
use crate::render_file::hash_text;

/// Summary of a file of either kind. The JSON form has the fields of that kind and `kind`.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum FileInfo {
    /// A `.pumice` file.
    Pumice(PumiceInfo),
    /// A label volume in another format, from its header.
    Source(SourceInfo),
}

/// Summary of a `.pumice` file.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs, reason = "the names are the JSON contract")]
pub struct PumiceInfo {
    pub dims: [u32; 3],
    pub spacing: [f64; 3],
    pub unit: String,
    pub frame: String,
    pub label_type: String,
    pub world_from_centre: [[f64; 4]; 3],
    pub labels: u64,
    pub types: u64,
    pub touching_pairs: u64,
    pub boxes: u64,
    pub leaf_patterns: u64,
    pub content_hash: String,
    /// Size of the raw volume at four bytes per voxel.
    pub bytes_raw: u64,
    pub bytes_disk: u64,
    /// Sum of `resident_parts`.
    pub bytes_resident: u64,
    /// Bytes in memory by part, the acceleration structure for all labels included.
    pub resident_parts: BTreeMap<String, u64>,
}

/// Summary of a label volume in another format.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs, reason = "the names are the JSON contract")]
pub struct SourceInfo {
    pub format: String,
    pub encoding: String,
    pub dims: [u32; 3],
    pub spacing: [f64; 3],
    pub unit: String,
    pub frame: String,
    pub label_type: String,
    pub world_from_centre: [[f64; 4]; 3],
    pub bytes_raw: u64,
    pub named_labels: u64,
    /// Names of the segments of each layer.
    pub layers: Vec<Vec<String>>,
    pub warnings: Vec<String>,
}

/// Reads the summary of a file.
///
/// # Errors
/// One line that says what is wrong with the file; [`pumice_core::Error::Cancelled`] when `job` is cancelled.
pub fn file_info(path: &Path, reading: &OpenOptions, job: &Job) -> Result<FileInfo> {
    if is_pumice_file(path)? {
        pumice_info(path, job).map(FileInfo::Pumice)
    } else {
        source_info(path, reading).map(FileInfo::Source)
    }
}

fn pumice_info(path: &Path, job: &Job) -> Result<PumiceInfo> {
    let bytes_disk = std::fs::metadata(path).map_err(io(path))?.len();
    let volume = Arc::new(CompressedVolume::open(path, job)?);
    let mut parts: BTreeMap<String, u64> =
        volume.resident_parts().iter().map(|&(name, bytes)| (name.to_string(), bytes)).collect();

    parts.insert("acceleration".into(), acceleration_bytes(&volume)?);

    let (info, labels) = (volume.info(), volume.labels());
    Ok(PumiceInfo {
        dims: info.dims,
        spacing: info.spacing(),
        unit: name(&info.unit)?,
        frame: name(&info.frame)?,
        label_type: name(&info.label_type)?,
        world_from_centre: rows(&info.world_from_centre()),
        labels: labels.len() as u64,
        types: labels.type_names().len() as u64,
        touching_pairs: labels.contacts().len(),
        boxes: volume.boxes().len() as u64,
        leaf_patterns: volume.leaves().patterns().len() as u64,
        content_hash: hash_text(&volume),
        bytes_raw: info.voxels().saturating_mul(4),
        bytes_disk,
        bytes_resident: parts.values().sum(),
        resident_parts: parts,
    })
}

/// Bytes of the hierarchy over all boxes of a volume. No file holds it, so it is built here to measure its size.
pub fn acceleration_bytes(volume: &Arc<CompressedVolume>) -> Result<u64> {
    let everything = TracedInstance {
        visible: vec![true; volume.labels().len()],
        volume: Arc::clone(volume),
        world_from_index: volume.info().world_from_index,
        lod: LodChoice::Voxels,
    };
    Ok(VolumeTracer::new(0, &everything)?.bytes())
}

fn source_info(path: &Path, reading: &OpenOptions) -> Result<SourceInfo> {
    let probe = pumice_formats::probe(path, reading)?;
    let info = &probe.info;
    Ok(SourceInfo {
        format: probe.format.to_string(),
        encoding: probe.encoding.clone(),
        dims: info.dims,
        spacing: info.spacing(),
        unit: name(&info.unit)?,
        frame: name(&info.frame)?,
        label_type: name(&info.label_type)?,
        world_from_centre: rows(&info.world_from_centre()),
        bytes_raw: info.voxels().saturating_mul(4),
        named_labels: info.notes.len() as u64,
        layers: probe.layers.iter().map(|l| l.segments.clone()).collect(),
        warnings: probe.warnings.clone(),
    })
}

/// The serde name of a variant without fields.
fn name(value: &impl Serialize) -> Result<String> {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(text)) => Ok(text),
        other => Err(SessionError::Caller(format!("not a plain name: {other:?}"))),
    }
}

/// The upper 3 × 4 part of a matrix, as rows.
fn rows(m: &DAffine3) -> [[f64; 4]; 3] {
    let (l, t) = (m.matrix3.transpose(), m.translation);
    [0, 1, 2].map(|i| [l.col(i).x, l.col(i).y, l.col(i).z, t[i]])
}

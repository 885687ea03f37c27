//! A summary of a `.pumice` file or a label volume.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::DAffine3;
use pumice_core::{CompressedVolume, Job, LabelQuery, Series};
use pumice_cpu::traverse::{SceneTracer, TracedInstance, VolumeTracer};
use pumice_formats::{OpenChoice, OpenOptions, orientation};
use pumice_transport::geometry::LodChoice;
use serde::Serialize;

use crate::error::{Result, SessionError, io};
use crate::label_rows::LabelRows;
use crate::open::{Kind, Residence, kind_of, open_frame, open_volume};
use crate::render_file::hash_text;

/// Summary of a file of either kind. The JSON form has the fields of that kind and `kind`.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum FileInfo {
    /// A `.pumice` file.
    Pumice(PumiceInfo),
    /// A `.pumice` file of a time series, of which no time step is chosen.
    Series(SeriesInfo),
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
    /// Letters of the directions in which x, y and z run, such as `RAS`; `None` where the source did not say it.
    pub orientation: Option<String>,
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
    /// Bytes of the file; of a time series, with all time steps.
    pub bytes_disk: u64,
    /// The time step that is described, and how many there are; `None` where the file has one volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_step: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_steps: Option<u32>,
    /// Bytes of the compressed form in memory: `resident_parts` without `bricks` and `acceleration`.
    pub bytes_volume: u64,
    /// Sum of `resident_parts`: what a process holds that traces all labels by their voxels.
    pub bytes_resident: u64,
    /// Bytes in memory by part, with what rays need where all labels are shown: `bricks`, and `acceleration` for all else.
    pub resident_parts: BTreeMap<String, u64>,
    /// The same where some labels alone are shown: only of [`shown_info`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shown: Option<ShownInfo>,
}

/// Summary of a `.pumice` file of a time series.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs, reason = "the names are the JSON contract")]
pub struct SeriesInfo {
    pub time_steps: u32,
    pub dims: [u32; 3],
    pub spacing: [f64; 3],
    pub unit: String,
    pub frame: String,
    /// Letters of the directions in which x, y and z run, such as `RAS`; `None` where the source did not say it.
    pub orientation: Option<String>,
    pub label_type: String,
    pub world_from_centre: [[f64; 4]; 3],
    /// Labels of all time steps.
    pub labels: u64,
    pub types: u64,
    /// Pairs that touch at some time step.
    pub touching_pairs: u64,
    /// Boxes of all time steps.
    pub boxes: u64,
    pub content_hash: String,
    /// Size of the raw volumes of all time steps at four bytes per voxel.
    pub bytes_raw: u64,
    pub bytes_disk: u64,
    /// Bytes of the file by what they hold.
    pub stored_parts: BTreeMap<String, u64>,
}

/// What a process holds that traces some labels of a `.pumice` file by their voxels, and reads no others.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs, reason = "the names are the JSON contract")]
pub struct ShownInfo {
    pub labels: u64,
    /// Boxes that are read. In a file of `--level small` these are all, because such a file is read whole.
    pub boxes: u64,
    /// Bytes of the compressed form in memory, with the table of all labels.
    pub bytes_volume: u64,
    /// Sum of `resident_parts`.
    pub bytes_resident: u64,
    /// Bytes in memory by part, with what rays need of the shown labels.
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
    /// Letters of the directions in which x, y and z run, such as `RAS`; `None` where the file does not say it.
    pub orientation: Option<String>,
    pub label_type: String,
    pub world_from_centre: [[f64; 4]; 3],
    /// Size of the raw volume at four bytes per voxel.
    pub bytes_raw: u64,
    /// Size of the voxels in the file's own type, without compression.
    pub bytes_uncompressed: u64,
    /// Memory that compressing the volume is expected to take, for densely packed labels; see [`expected_bytes`].
    pub bytes_expected: u64,
    pub named_labels: u64,
    /// What the file leaves open and the caller has not chosen. The first volume is described.
    pub choices: Vec<ChoiceInfo>,
    /// Names of the segments of each layer.
    pub layers: Vec<Vec<String>>,
    pub warnings: Vec<String>,
}

/// Something that a file leaves open.
#[derive(Clone, Debug, Serialize)]
pub struct ChoiceInfo {
    /// `layer`, `time`, `channel`, `array` or `axes`: the keyword of Python and of Blender's operator.
    pub keyword: &'static str,
    /// Option of the command, such as `--layer`.
    pub option: &'static str,
    /// What is open, as a sentence without a full stop.
    pub what: String,
    /// The answers in one line.
    pub listed: String,
    /// Number of answers.
    pub count: u64,
    /// The answers one by one, at most 4096.
    pub values: Vec<ChoiceValue>,
    /// The answer that is assumed; `None` where the file is refused without an answer.
    pub assumed: Option<&'static str>,
}

/// One possible answer.
#[derive(Clone, Debug, Serialize)]
pub struct ChoiceValue {
    /// The answer, as the option and the keyword take it.
    pub value: String,
    /// What is behind it: names of segments, shape of an array; empty where the file says nothing.
    pub text: String,
}

impl From<&OpenChoice> for ChoiceInfo {
    fn from(choice: &OpenChoice) -> Self {
        let value =
            |v: &pumice_formats::ChoiceValue| ChoiceValue { value: v.value.clone(), text: v.text.clone() };
        Self {
            keyword: choice.keyword,
            option: choice.option,
            what: choice.what.clone(),
            listed: choice.listed.clone(),
            count: choice.count,
            values: choice.values.iter().map(value).collect(),
            assumed: choice.assumed,
        }
    }
}

/// Bytes that the command takes for a volume of few voxels: its code, and the blocks that are read ahead.
const BYTES_OF_READING: u64 = 48 << 20;

/// Bytes that compressing the volume `voxels` is expected to take: 48 MiB, and a byte and a quarter a voxel for the records of a densely
/// packed volume. `pumice compress` takes 50 to 58 MB for the 33.6 million voxels of the cortex in `data/`, of which 25 MB are the command
/// (a build without optimization 69 to 78 MB); a volume that is mostly background takes less, noise with an id of its own in each voxel
/// some twenty times as much.
pub fn expected_bytes(voxels: u64) -> u64 {
    BYTES_OF_READING.saturating_add(voxels.saturating_add(voxels / 4))
}

/// Reads the summary of a file.
///
/// # Errors
/// One line that says what is wrong with the file; [`pumice_core::Error::Cancelled`] when `job` is cancelled.
pub fn file_info(path: &Path, reading: &OpenOptions, job: &Job) -> Result<FileInfo> {
    match kind_of(path, reading)? {
        Kind::Foreign => source_info(path, reading).map(FileInfo::Source),
        Kind::Series if reading.time.is_none() => series_info(path, job).map(FileInfo::Series),
        Kind::Compressed | Kind::Series => pumice_info(path, reading, job).map(FileInfo::Pumice),
    }
}

fn series_info(path: &Path, job: &Job) -> Result<SeriesInfo> {
    let bytes_disk = std::fs::metadata(path).map_err(io(path))?.len();
    let series = Series::open(path, job)?;
    let (info, labels) = (series.info(), series.labels());
    Ok(SeriesInfo {
        time_steps: series.frames(),
        dims: info.dims,
        spacing: info.spacing(),
        unit: name(&info.unit)?,
        frame: name(&info.frame)?,
        orientation: orientation(info),
        label_type: name(&info.label_type)?,
        world_from_centre: rows(&info.world_from_centre()),
        labels: labels.len() as u64,
        types: labels.type_names().len() as u64,
        touching_pairs: labels.contacts().len(),
        boxes: series.boxes(),
        content_hash: format!("{:032x}", series.content_hash()),
        bytes_raw: info.voxels().saturating_mul(4).saturating_mul(series.frames().into()),
        bytes_disk,
        stored_parts: series.stored_parts().into_iter().map(|(part, bytes)| (part.into(), bytes)).collect(),
    })
}

/// Adds to the summary of a `.pumice` file what a process holds that shows only the labels for which `query` holds, as `pumice render` does.
///
/// # Errors
/// As [`file_info`]; a column that the volume does not have, a query that no label matches, and a file in another format, which can only be
/// read whole.
pub fn shown_info(path: &Path, query: &LabelQuery, reading: &OpenOptions, job: &Job) -> Result<FileInfo> {
    let kind = kind_of(path, reading)?;
    if kind == Kind::Foreign {
        return Err(SessionError::Caller(format!(
            "query: {} is not a .pumice file, and only those can be opened for some labels alone",
            path.display()
        )));
    }
    let mut info = pumice_info(path, reading, job)?;
    let all = open_volume(path, reading, Residence::Copied, job)?;
    let chosen =
        LabelRows::for_query(&all, query).matches(query).map_err(|e| SessionError::Caller(e.to_string()))?;
    drop(all);
    let labels = chosen.iter().filter(|&&c| c).count() as u64;
    if labels == 0 {
        return Err(SessionError::Caller("query: no label of the volume matches".into()));
    }
    let volume = Arc::new(match kind {
        Kind::Series => open_frame(path, reading, Some(&|_| chosen.clone()), job)?,
        _ => CompressedVolume::open_labels(path, |_| chosen.clone(), job)?,
    });
    let (resident_parts, bytes_volume) = parts_of(&volume, chosen)?;
    info.shown = Some(ShownInfo {
        labels,
        boxes: volume.boxes().len() as u64,
        bytes_volume,
        bytes_resident: resident_parts.values().sum(),
        resident_parts,
    });
    Ok(FileInfo::Pumice(info))
}

/// Bytes in memory by part, with what rays need of the visible labels, and the sum of those of the compressed form alone.
fn parts_of(volume: &Arc<CompressedVolume>, visible: Vec<bool>) -> Result<(BTreeMap<String, u64>, u64)> {
    let mut parts: BTreeMap<String, u64> =
        volume.resident_parts().iter().map(|&(name, bytes)| (name.to_string(), bytes)).collect();
    let bytes_volume = parts.values().sum();
    let tracer = SceneTracer::new(&[TracedInstance { visible, ..everything(volume) }])?;
    parts.insert("acceleration".into(), tracer.bytes() - tracer.brick_bytes());
    parts.insert("bricks".into(), tracer.brick_bytes());
    Ok((parts, bytes_volume))
}

fn pumice_info(path: &Path, reading: &OpenOptions, job: &Job) -> Result<PumiceInfo> {
    let bytes_disk = std::fs::metadata(path).map_err(io(path))?.len();
    let volume = open_volume(path, reading, Residence::Copied, job)?;
    let (parts, bytes_volume) = parts_of(&volume, vec![true; volume.labels().len()])?;

    let (info, labels) = (volume.info(), volume.labels());
    Ok(PumiceInfo {
        dims: info.dims,
        spacing: info.spacing(),
        unit: name(&info.unit)?,
        frame: name(&info.frame)?,
        orientation: orientation(info),
        label_type: name(&info.label_type)?,
        world_from_centre: rows(&info.world_from_centre()),
        labels: labels.len() as u64,
        types: labels.type_names().len() as u64,
        touching_pairs: labels.contacts().len(),
        boxes: volume.boxes().len() as u64,
        leaf_patterns: volume.leaves().iter().map(|leaves| leaves.patterns().len() as u64).sum(),
        content_hash: hash_text(&volume),
        bytes_raw: info.voxels().saturating_mul(4),
        bytes_disk,
        time_step: volume.frame().map(|of| of.number),
        time_steps: volume.frame().map(|of| of.frames),
        bytes_volume,
        bytes_resident: parts.values().sum(),
        resident_parts: parts,
        shown: None,
    })
}

/// Bytes of the hierarchy over all boxes of a volume, through which rays find boxes where there are no bricks. No file holds it, so it is
/// built here to measure its size.
///
/// # Errors
/// As [`VolumeTracer::new`].
pub fn acceleration_bytes(volume: &Arc<CompressedVolume>) -> Result<u64> {
    Ok(VolumeTracer::new(0, &everything(volume))?.bytes())
}

/// Bytes of all that rays need to trace a volume with all labels shown: bricks, or the hierarchy where there can be none.
///
/// # Errors
/// As [`SceneTracer::new`].
pub fn tracing_bytes(volume: &Arc<CompressedVolume>) -> Result<u64> {
    Ok(SceneTracer::new(&[everything(volume)])?.bytes())
}

/// A volume with all labels shown by their voxels.
fn everything(volume: &Arc<CompressedVolume>) -> TracedInstance {
    TracedInstance {
        visible: vec![true; volume.labels().len()],
        volume: Arc::clone(volume),
        world_from_index: volume.info().world_from_index,
        lod: LodChoice::Voxels,
    }
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
        orientation: probe.orientation.clone(),
        label_type: name(&info.label_type)?,
        world_from_centre: rows(&info.world_from_centre()),
        bytes_raw: info.voxels().saturating_mul(4),
        bytes_uncompressed: probe.bytes_uncompressed,
        bytes_expected: expected_bytes(info.voxels()),
        named_labels: info.notes.len() as u64,
        choices: probe.choices.iter().map(ChoiceInfo::from).collect(),
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

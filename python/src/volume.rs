//! Compressed volumes: opening, compressing from blocks, queries, saving.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::{Arc, Mutex};

use glam::DAffine3;
use pumice_core::{
    BlockSource, CompressOptions, CompressedVolume, CompressionLevel, Error as CoreError, LabelBlock,
    LabelBuffer, LabelNote, LabelType, Outputs, TypeTable, Unit, Verification, VolumeInfo,
};
use pumice_export::{CoarseSurface, Corners, Interfaces, QuadMesh};
use pumice_session::values::label_type;
use pumice_session::{
    ArrayAxes, LabelRows, OmeVersion, OpenOptions, PrecomputedEncoding, RawLayout, Residence, Roi, Scale,
    SessionError, StoreName,
};
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use serde_json::json;

use crate::array::{Array, Data};
use crate::errors::{IntoException, input};
use crate::job::{Job, job_of};
use crate::label_table::{AnnotationTable, colors_of, columns_of};
use crate::page_memory::PageMemory;
use crate::waiting::{detached, released};

/// An immutable volume in its compressed form.
#[pyclass(frozen, module = "pumice._native")]
pub(crate) struct Volume(pub(crate) Arc<CompressedVolume>);

/// A sequence of colours, linear Rec. 709, each as far as possible from those before it.
#[pyfunction]
pub(crate) fn distinct_colors(py: Python<'_>, count: usize, color_blind_safe: bool) -> PyResult<Array> {
    let most = pumice_transport::farthest_colors::MOST_DISTINCT;
    if count > most {
        return Err(input(&format_args!("count: expected at most {most}, got {count}")));
    }
    detached(py, || {
        let colors = pumice_transport::farthest_colors::distinct_colors(count, color_blind_safe);
        Ok::<_, CoreError>(Array::new(Data::F32(colors.into_flattened()), &[count, 3]))
    })
}

/// How to read a file: layer, time, channel, array, spacing, axes, raw and the rest of `pumice_formats::OpenOptions`; a
/// `pumice.arguments.ReadAs`.
pub(crate) type ReadAs = (
    Option<u32>,
    Option<u32>,
    Option<u32>,
    Option<String>,
    Option<[f64; 3]>,
    Option<String>,
    Option<RawAs>,
    StoreAs,
);

/// Scale, region, label image, data set, meaning of absent chunks and table of joined ids, each as the command takes it; a
/// `pumice.arguments.StoreAs`.
type StoreAs =
    (Option<String>, Option<String>, Option<String>, Option<String>, Option<String>, Option<PathBuf>);

/// Dims, label type, byte order and offset of voxels without a header; a `pumice.arguments.RawAs`.
type RawAs = ([u64; 3], String, bool, u64);

pub(crate) fn reading(
    (layer, time, channel, array, spacing, axes, raw, store): ReadAs,
    job: &pumice_core::Job,
) -> PyResult<OpenOptions> {
    let (scale, roi, label, dataset, missing_chunks, relabel) = store;
    let scale: Option<Scale> = parsed("scale", scale)?;
    let roi: Option<Roi> = parsed("roi", roi)?;
    let missing_chunks = parsed("missing_chunks", missing_chunks)?;
    let order = |name: String| {
        ArrayAxes::of_name(&name).ok_or_else(|| {
            input(&format_args!(
                "axes: expected one of {}, got {name:?}",
                ArrayAxes::ALL.map(ArrayAxes::name).join(" ")
            ))
        })
    };
    let axes = axes.map(order).transpose()?;
    let raw = raw.map(|(dims, name, big_endian, offset)| {
        let label_type =
            label_type(&name).map_err(|e| input(&format_args!("raw_type: {e}, got {name:?}")))?;
        Ok::<_, PyErr>(RawLayout { dims, label_type, big_endian, offset })
    });
    let raw = raw.transpose()?;
    Ok(OpenOptions {
        layer,
        time,
        channel,
        array,
        spacing,
        axes,
        raw,
        scale,
        roi,
        label,
        dataset,
        missing_chunks,
        relabel,
        cancelled: job.cancel_flag(),
        ..OpenOptions::default()
    })
}

/// What a volume is written as: format, version of OME, shards, encoding, gzip and side of a chunk; a `pumice.arguments.WriteAs`.
type WriteAs = (Option<String>, Option<String>, bool, Option<String>, bool, Option<u32>);

fn writing(
    (format, ome_version, shards, encoding, gzip, chunk): WriteAs,
) -> PyResult<pumice_session::WriteAs> {
    fn named<T: Copy>(
        keyword: &str,
        text: Option<String>,
        all: &[T],
        name: fn(T) -> &'static str,
    ) -> PyResult<Option<T>> {
        let Some(text) = text else { return Ok(None) };
        let found = all.iter().copied().find(|&value| name(value) == text);
        let names: Vec<&str> = all.iter().map(|&value| name(value)).collect();
        found.map(Some).ok_or_else(|| {
            input(&format_args!("{keyword}: expected one of {}, got {text:?}", names.join(" ")))
        })
    }
    Ok(pumice_session::WriteAs {
        format: named("format", format, &StoreName::ALL, StoreName::name)?,
        ome_version: named("ome_version", ome_version, &OmeVersion::ALL, OmeVersion::name)?,
        shards,
        encoding: named("encoding", encoding, &PrecomputedEncoding::ALL, PrecomputedEncoding::name)?,
        gzip,
        chunk,
    })
}

/// The value of a keyword that has a text form.
pub(crate) fn parsed<T: FromStr<Err = String>>(keyword: &str, text: Option<String>) -> PyResult<Option<T>> {
    text.map(|text| text.parse::<T>().map_err(|e| input(&format_args!("{keyword}: {e}")))).transpose()
}

#[pymethods]
impl Volume {
    /// Facts about the whole volume, as JSON text.
    fn facts(&self) -> String {
        let (v, info) = (&self.0, self.0.info());
        json!({
            "dims": info.dims,
            "spacing": info.spacing(),
            "unit": info.unit,
            "frame": info.frame,
            "label_type": info.label_type,
            "world_from_index": info.world_from_index.to_cols_array(),
            "labels": v.labels().len(),
            "boxes": v.pages().map_or(v.boxes().len() as u64, |pages| pages.boxes()),
            "is_whole": v.is_whole(),
            "type_names": v.labels().type_names(),
            "time_step": v.frame().map(|of| of.number),
            "time_steps": v.frame().map(|of| of.frames),
        })
        .to_string()
    }

    /// Hash of labels and voxels; computing it takes a walk over all boxes.
    fn content_hash(&self, py: Python<'_>) -> PyResult<String> {
        detached(py, || Ok::<_, CoreError>(pumice_session::render_file::hash_text(&self.0)))
    }

    /// Bytes of the volume that are pages of its file and not memory of this process.
    fn mapped_bytes(&self) -> u64 {
        self.0.mapped_bytes()
    }

    /// Current bytes in memory by part; queries add an index.
    fn resident_parts(&self) -> BTreeMap<&'static str, u64> {
        self.0.resident_parts().into_iter().collect()
    }

    /// Original ids, in rising order.
    fn ids(&self) -> Array {
        let ids = self.0.labels().ids().to_vec();
        let n = ids.len();
        Array::new(Data::U64(ids), &[n])
    }

    /// Number of voxels of each label.
    fn voxels(&self) -> Array {
        let voxels = self.0.labels().voxels().to_vec();
        let n = voxels.len();
        Array::new(Data::U64(voxels), &[n])
    }

    /// Lowest and highest voxel of each label, and its number of boxes.
    fn bounds(&self, py: Python<'_>) -> PyResult<(Array, Array, Array)> {
        detached(py, || {
            let bounds = self.0.label_bounds();
            let n = bounds.len();
            let mut boxes = vec![0u32; n];
            self.0.for_each_box(|label, _| boxes[label as usize] += 1);
            self.0.check_pages()?;
            let corner = |corners: Vec<[u32; 3]>| Array::new(Data::U32(corners.into_flattened()), &[n, 3]);
            Ok::<_, CoreError>((
                corner(bounds.iter().map(|b| b.low).collect()),
                corner(bounds.iter().map(|b| b.high).collect()),
                Array::new(Data::U32(boxes), &[n]),
            ))
        })
    }

    /// Names, empty where the file gives none, and sRGB colours, NaN where the file gives none.
    fn notes(&self) -> (Vec<String>, Array) {
        let n = self.0.labels().len();
        let notes = (0..n as u32).map(|label| self.0.note(label));
        let (names, colors): (Vec<String>, Vec<Option<[f32; 3]>>) = notes
            .map(|note| {
                let name = note.and_then(|n| n.name.clone()).unwrap_or_default();
                (name, note.and_then(|n| n.color_srgb))
            })
            .unzip();
        (names, colors_of(colors.into_iter()))
    }

    /// Type of each label: its index in `type_names`, or −1.
    fn types(&self) -> Array {
        let n = self.0.labels().len();
        let of = |label| self.0.labels().type_of(label).map_or(-1, i32::from);
        Array::new(Data::I32((0..n as u32).map(of).collect()), &[n])
    }

    /// Columns of numbers that a table gave to the labels, by name.
    fn columns(&self) -> Vec<(String, Array)> {
        columns_of(self.0.labels().columns())
    }

    /// Whether a query line holds for each label. Bounds are found if the line compares them.
    fn query(&self, py: Python<'_>, line: &str) -> PyResult<Array> {
        detached(py, || {
            let query = pumice_session::parse_query(line)?;
            let rows = LabelRows::for_query(&self.0, &query);
            let chosen = rows.matches(&query).map_err(|e| SessionError::Caller(e.to_string()))?;
            let n = chosen.len();
            Ok::<_, SessionError>(Array::new(Data::Bool(chosen), &[n]))
        })
    }

    /// Pairs of labels that touch, by row of the label table.
    fn contacts(&self, py: Python<'_>) -> PyResult<Array> {
        detached(py, || {
            let pairs: Vec<[u32; 2]> = self.0.labels().contacts().iter().map(|(a, b)| [a, b]).collect();
            let n = pairs.len();
            Ok::<_, CoreError>(Array::new(Data::U32(pairs.into_flattened()), &[n, 2]))
        })
    }

    /// Linear Rec. 709 colours that `auto_color` gives to the labels; those that are `visible` differ from their neighbours. With `known`,
    /// three numbers a label, labels keep their colour, and those of NaN get the palette's colour that is farthest from their neighbours'.
    #[pyo3(signature = (visible, known=None))]
    fn auto_colors(
        &self,
        py: Python<'_>,
        visible: Option<Vec<bool>>,
        known: Option<PyBuffer<f32>>,
    ) -> PyResult<Array> {
        let table = self.0.labels();
        let n = table.len();
        if visible.as_ref().is_some_and(|v| v.len() != n) {
            return Err(input(&format_args!("visible: expected {n} values, one a label")));
        }
        let known = known.map(|colors| colors.to_vec(py)).transpose()?;
        let known = known.as_ref().map(|numbers| numbers.as_chunks::<3>());
        if known.is_some_and(|(colors, rest)| colors.len() != n || !rest.is_empty()) {
            return Err(input(&format_args!("known: expected {n} colours, one a label")));
        }
        detached(py, || {
            let contacts = table.contacts().iter();
            let colors = match known {
                None => pumice_transport::palette::assign_colors(n, contacts, visible.as_deref()),
                Some((colors, _)) => pumice_transport::farthest_colors::color_new_labels(colors, contacts),
            };
            Ok::<_, CoreError>(Array::new(Data::F32(colors.into_flattened()), &[n, 3]))
        })
    }

    /// Origins and extents in voxels, and labels, of all boxes.
    fn box_arrays(&self, py: Python<'_>) -> PyResult<(Array, Array, Array)> {
        detached(py, || {
            self.0.require_boxes("a list of all boxes")?;
            let (mut origins, mut extents, mut labels) = (Vec::new(), Vec::new(), Vec::new());
            self.0.for_each_box(|label, b| {
                origins.push(b.origin.map(|v| v as i32));
                extents.push(b.extent.map(|v| v as i32));
                labels.push(label);
            });
            let n = labels.len();
            Ok::<_, CoreError>((
                Array::new(Data::I32(origins.into_flattened()), &[n, 3]),
                Array::new(Data::I32(extents.into_flattened()), &[n, 3]),
                Array::new(Data::U32(labels), &[n]),
            ))
        })
    }

    /// Voxel faces of the labels that are `visible`, by row of the table: vertices, quads, label of each quad.
    #[pyo3(signature = (visible, *, all_interfaces, shared_corners, job=None))]
    fn faces(
        &self,
        py: Python<'_>,
        visible: Vec<bool>,
        all_interfaces: bool,
        shared_corners: bool,
        job: Option<&Bound<'_, Job>>,
    ) -> PyResult<(Array, Array, Array)> {
        let job = job_of(job);
        let interfaces = if all_interfaces { Interfaces::All } else { Interfaces::Outside };
        let corners = if shared_corners { Corners::Shared } else { Corners::Own };
        let mesh = released(py, &job, || QuadMesh::new(&self.0, &visible, interfaces, corners, &job))?;
        let (vertices, quads) = (mesh.vertices.len(), mesh.quads.len());
        Ok((
            Array::new(Data::I32(mesh.vertices.into_flattened()), &[vertices, 3]),
            Array::new(Data::U32(mesh.quads.into_flattened()), &[quads, 4]),
            Array::new(Data::U32(mesh.labels), &[quads]),
        ))
    }

    /// A coarse surface of the labels that are `visible`, by row of the table: vertices, quads, label of each quad, voxels of a cell.
    #[pyo3(signature = (visible, *, most_faces, job=None))]
    fn coarse_surface(
        &self,
        py: Python<'_>,
        visible: Vec<bool>,
        most_faces: usize,
        job: Option<&Bound<'_, Job>>,
    ) -> PyResult<(Array, Array, Array, [u32; 3])> {
        let job = job_of(job);
        let mesh = released(py, &job, || {
            CoarseSurface::new(&self.0, &visible, most_faces, &job).map_err(SessionError::from)
        })?;
        let (vertices, quads) = (mesh.vertices.len(), mesh.quads.len());
        Ok((
            Array::new(Data::F32(mesh.vertices.into_flattened()), &[vertices, 3]),
            Array::new(Data::U32(mesh.quads.into_flattened()), &[quads, 4]),
            Array::new(Data::U32(mesh.labels), &[quads]),
            mesh.cell,
        ))
    }

    /// Original id of the label at a voxel; 0 is background. The first query builds the index.
    fn label_at(&self, py: Python<'_>, x: u32, y: u32, z: u32) -> PyResult<u64> {
        detached(py, || {
            let label = self.0.label_at([x, y, z])?;
            Ok::<_, CoreError>(label.map_or(0, |label| self.0.labels().ids()[label as usize]))
        })
    }

    /// Original ids of a block, x fastest: shape (z, y, x).
    #[pyo3(signature = (origin, dims, job=None))]
    fn decode_block(
        &self,
        py: Python<'_>,
        origin: [u32; 3],
        dims: [u32; 3],
        job: Option<&Bound<'_, Job>>,
    ) -> PyResult<Array> {
        let job = job_of(job);
        let ids = released(py, &job, || {
            job.check()?;
            self.0.decode_ids(origin, dims)
        })?;
        let [x, y, z] = dims.map(|d| d as usize);
        Ok(Array::new(Data::U64(ids), &[z, y, x]))
    }

    /// Writes a `.pumice` file, which appears complete or not at all.
    #[pyo3(signature = (path, level="default", job=None))]
    fn save(&self, py: Python<'_>, path: PathBuf, level: &str, job: Option<&Bound<'_, Job>>) -> PyResult<()> {
        let level = level_of(level)?;
        let job = job_of(job);
        released(py, &job, || self.0.save(&path, level, &job))
    }

    /// Writes the labels in a format of other programs; returns what the format does not hold, a line each.
    #[pyo3(signature = (path, *, write_as, job=None))]
    fn write(
        &self,
        py: Python<'_>,
        path: PathBuf,
        write_as: WriteAs,
        job: Option<&Bound<'_, Job>>,
    ) -> PyResult<Vec<String>> {
        let how = writing(write_as)?;
        let job = job_of(job);
        released(py, &job, || {
            if how.store(&path)?.is_none() {
                Outputs::default().declare(&path)?;
            }
            pumice_session::write_labels_of(&self.0, &path, &how, &job)
        })
    }

    /// The volume with these labels of its file added, which is `path`, read in the same way.
    #[pyo3(signature = (path, labels, *, read_as, job=None))]
    fn with_labels(
        &self,
        py: Python<'_>,
        path: PathBuf,
        labels: Vec<u64>,
        read_as: ReadAs,
        job: Option<&Bound<'_, Job>>,
    ) -> PyResult<Volume> {
        let job = job_of(job);
        let reading = reading(read_as, &job)?;
        let more = || pumice_session::open_more_labels(&self.0, &path, &labels, &reading, &job);
        Ok(Volume(released(py, &job, more)?))
    }

    /// Compares with a file, or with blocks; `None` if every voxel and id is the same, else the first difference.
    #[pyo3(signature = (source, *, read_as, job=None))]
    fn difference(
        &self,
        py: Python<'_>,
        source: Source,
        read_as: ReadAs,
        job: Option<&Bound<'_, Job>>,
    ) -> PyResult<Option<String>> {
        let job = job_of(job);
        let reading = reading(read_as, &job)?;
        with_source(py, source, &reading, &job, |source| {
            let found = pumice_core::verify(&self.0, source, &job)?;
            Ok((!matches!(found, Verification::Same { .. })).then(|| found.to_string()))
        })
    }
}

/// A volume, and its reader's warnings about the file, one line each.
type Opened = (Volume, Vec<String>);

/// Opens a `.pumice` file, or compresses a label volume of another format in memory; also returns the reader's warnings. If `labels` are
/// given, only these are read from a `.pumice` file; with a `memory` it is drawn from disk.
#[pyfunction]
#[pyo3(signature = (path, *, labels=None, mapped=false, memory=None, read_as, job=None))]
pub(crate) fn open(
    py: Python<'_>,
    path: PathBuf,
    labels: Option<Vec<u64>>,
    mapped: bool,
    memory: Option<&Bound<'_, PageMemory>>,
    read_as: ReadAs,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<Opened> {
    let job = job_of(job);
    let reading = reading(read_as, &job)?;
    let residence = match memory {
        Some(memory) => Residence::paged(&memory.get().0),
        None if mapped => Residence::Mapped,
        None => Residence::Copied,
    };
    let volume = released(py, &job, || match &labels {
        None => pumice_session::open_volume(&path, &reading, residence, &job),
        Some(ids) => pumice_session::open_labels(&path, ids, &reading, &job),
    })?;
    Ok((Volume(volume), reading.warnings.list()))
}

/// A summary of a file, from its header alone, as JSON text; with a query, also what a process holds that shows only the labels that match.
#[pyfunction]
#[pyo3(signature = (path, *, query=None, read_as, job=None))]
pub(crate) fn probe(
    py: Python<'_>,
    path: PathBuf,
    query: Option<String>,
    read_as: ReadAs,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<String> {
    let job = job_of(job);
    let reading = reading(read_as, &job)?;
    let info = released(py, &job, || match &query {
        None => pumice_session::file_info(&path, &reading, &job),
        Some(line) => pumice_session::shown_info(&path, &pumice_session::parse_query(line)?, &reading, &job),
    })?;
    serde_json::to_string(&info).map_err(|e| input(&e))
}

/// A file, or blocks that a Python function delivers.
#[derive(FromPyObject)]
pub(crate) enum Source {
    /// A label volume of any format.
    Path(PathBuf),
    /// See [`Blocks`].
    Blocks(Blocks),
}

/// Blocks from Python: `next()` gives `(origin, dims, buffer)` with the buffer's labels x fastest, unsigned and contiguous, or `None`
/// at the end. A whole array is never copied: the caller cuts it into blocks, whatever its type and strides.
#[derive(FromPyObject)]
pub(crate) struct Blocks {
    /// Dims, label type, matrix, unit, names: the JSON form of `pumice_core::VolumeInfo`.
    pub(crate) info: String,
    pub(crate) next: Py<PyAny>,
}

/// What a caller says about labels.
#[derive(FromPyObject)]
pub(crate) enum Given {
    /// The text of a CSV table id,type.
    Types(String),
    /// A table of any kind.
    Table(Py<AnnotationTable>),
    /// A path object, as a text is a table itself: the file of a CSV table id,type.
    TypesFile(PathBuf),
}

/// The level with this name.
pub(crate) fn level_of(name: &str) -> PyResult<CompressionLevel> {
    match name {
        "fast" => Ok(CompressionLevel::Fast),
        "default" => Ok(CompressionLevel::Default),
        "small" => Ok(CompressionLevel::Small),
        other => Err(input(&format_args!("level: expected fast, default or small, got {other:?}"))),
    }
}

impl Given {
    /// The types, or the table.
    pub(crate) fn parts(&self) -> PyResult<(Option<TypeTable>, Option<&pumice_core::AnnotationTable>)> {
        Ok(match self {
            Self::Types(text) => {
                (Some(TypeTable::parse_csv(text).map_err(IntoException::into_exception)?), None)
            }
            Self::Table(table) => (None, Some(&table.get().0)),
            Self::TypesFile(path) => {
                (Some(pumice_session::read_types(path).map_err(IntoException::into_exception)?), None)
            }
        })
    }
}

/// Compresses a file, or blocks, and gives the labels what the caller says of them; also returns the reader's warnings, and what of the table
/// does not fit.
#[pyfunction]
#[pyo3(signature = (source, *, given=None, memory_limit=None, threads=0, read_as, job=None))]
pub(crate) fn compress(
    py: Python<'_>,
    source: Source,
    given: Option<Given>,
    memory_limit: Option<u64>,
    threads: usize,
    read_as: ReadAs,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<Opened> {
    let job = job_of(job);
    let (types, table) = given.as_ref().map_or(Ok((None, None)), Given::parts)?;
    let reading = reading(read_as, &job)?;
    let options =
        CompressOptions { threads, memory_limit_bytes: memory_limit, types, ..CompressOptions::default() };
    let annotated = |mut volume| {
        let fit = table.map(|table| pumice_session::annotate(&mut volume, table, Vec::new())).transpose()?;
        Ok((volume, fit.map_or_else(Vec::new, |fit| fit.notes)))
    };
    if let Source::Path(path) = &source {
        let given = [("types", options.types.is_some()), ("memory_limit", memory_limit.is_some())];
        let open =
            || pumice_session::open_to_rewrite(path, &reading, &given, &job)?.map(annotated).transpose();
        if let Some((volume, notes)) = released(py, &job, open)? {
            return Ok((Volume(Arc::new(volume)), notes));
        }
    }
    let (volume, notes) = with_source(py, source, &reading, &job, |source| {
        annotated(pumice_core::compress(source, &options, &job)?)
    })?;
    Ok((Volume(Arc::new(volume)), [reading.warnings.list(), notes].concat()))
}

/// Runs `work` on a source, with the interpreter released except while blocks are fetched from Python.
pub(crate) fn with_source<T: Send>(
    py: Python<'_>,
    source: Source,
    reading: &OpenOptions,
    job: &Arc<pumice_core::Job>,
    work: impl FnOnce(&mut dyn BlockSource) -> Result<T, SessionError> + Send,
) -> PyResult<T> {
    match source {
        Source::Path(path) => released(py, job, || {
            let mut source = pumice_session::open_source(&path, reading)?;
            work(source.as_mut())
        }),
        Source::Blocks(Blocks { info, next }) => {
            let info: VolumeInfo =
                serde_json::from_str(&info).map_err(|e| input(&format_args!("info: {e}")))?;
            let raised = Mutex::new(None);
            let mut source = BlocksOfPython { info, next, raised: &raised };
            let result = released(py, job, || work(&mut source));
            match raised.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
                Some(error) => Err(error),
                None => result,
            }
        }
    }
}

/// See [`Blocks`].
pub(crate) struct BlocksOfPython<'a> {
    pub(crate) info: VolumeInfo,
    pub(crate) next: Py<PyAny>,
    /// The exception that Python raised; it is raised again where the call began.
    pub(crate) raised: &'a Mutex<Option<PyErr>>,
}

impl BlockSource for BlocksOfPython<'_> {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<LabelBlock>, CoreError> {
        Python::attach(|py| {
            self.fetch(py).map_err(|error| {
                let text = error.to_string();
                *self.raised.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(error);
                CoreError::Source(text.into())
            })
        })
    }
}

impl BlocksOfPython<'_> {
    fn fetch(&self, py: Python<'_>) -> PyResult<Option<LabelBlock>> {
        let Some((origin, dims, labels)) =
            self.next.call0(py)?.extract::<Option<([u32; 3], [u32; 3], Bound<'_, PyAny>)>>(py)?
        else {
            return Ok(None);
        };
        let labels = if let Ok(buffer) = PyBuffer::<u8>::get(&labels) {
            LabelBuffer::U8(buffer.to_vec(py)?)
        } else if let Ok(buffer) = PyBuffer::<u16>::get(&labels) {
            LabelBuffer::U16(buffer.to_vec(py)?)
        } else if let Ok(buffer) = PyBuffer::<u32>::get(&labels) {
            LabelBuffer::U32(buffer.to_vec(py)?)
        } else {
            LabelBuffer::U64(PyBuffer::<u64>::get(&labels)?.to_vec(py)?)
        };
        let expected: usize = dims.iter().map(|&d| d as usize).product();
        if labels.len() != expected {
            let got = labels.len();
            return Err(input(&format_args!(
                "a block of {dims:?} voxels: expected {expected} labels, got {got}"
            )));
        }
        Ok(Some(LabelBlock::x_fastest(origin, dims, labels)))
    }
}

/// Whether a path is the URL of a store on a server.
#[pyfunction]
#[pyo3(signature = (path))]
pub(crate) fn is_on_server(path: PathBuf) -> bool {
    pumice_formats::is_on_server(&path)
}

/// The JSON form of a volume's description, built from its parts: `world_from_index` is twelve numbers in column-major order.
#[pyfunction]
#[pyo3(signature = (dims, label_type, world_from_index, unit, names))]
pub(crate) fn volume_info(
    dims: [u32; 3],
    label_type: &str,
    world_from_index: [f64; 12],
    unit: &str,
    names: Vec<(u64, String)>,
) -> PyResult<String> {
    let fault = |e: serde_json::Error| input(&e);
    let label_type: LabelType = serde_json::from_value(label_type.into()).map_err(fault)?;
    let name = match unit {
        "" => "unknown",
        // The micro sign, and the Greek letter.
        "µm" | "μm" => "um",
        name => name,
    };
    let unit: Unit = serde_json::from_value(name.into())
        .map_err(|_| input(&format_args!("unit: expected nm, um, mm, m or unknown, got {unit:?}")))?;
    let notes = names.into_iter().map(|(id, name)| LabelNote { id, name: Some(name), color_srgb: None });
    let info = VolumeInfo {
        world_from_index: DAffine3::from_cols_array(&world_from_index),
        unit,
        notes: notes.collect(),
        ..VolumeInfo::new(dims, label_type)
    };
    serde_json::to_string(&info).map_err(fault)
}

//! Opens volumes and meshes: a `.pumice` file directly, a label volume in another format by compressing it in memory.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use pumice_core::{
    BlockSource, CompressOptions, CompressedVolume, Job, LabelTable, MeshData, Residency, Series,
    frames_in_file, open_input,
};
use pumice_formats::{OpenOptions, is_on_server};
use pumice_scene::{Instance, Reading, Scene, Show};

use crate::error::{Result, SessionError, io};
use crate::reading::options_for;

/// Whether a file begins with the magic bytes of `.pumice` files.
///
/// # Errors
/// When the file cannot be read.
pub fn is_pumice_file(path: &Path) -> Result<bool> {
    if path.is_dir() || is_on_server(path) {
        return Ok(false);
    }
    let mut magic = [0u8; 8];
    let mut file = open_input(path).map_err(io(path))?;
    let mut got = 0;
    while got < magic.len() {
        match file.read(&mut magic[got..]).map_err(io(path))? {
            0 => return Ok(false),
            n => got += n,
        }
    }
    Ok(magic == pumice_core::file::MAGIC)
}

/// What a file is that a caller wants to read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A label volume in another format.
    Foreign,
    /// A `.pumice` file of one volume.
    Compressed,
    /// A `.pumice` file of a time series.
    Series,
}

/// What a file is. A `.pumice` file leaves nothing to the caller but the time step of a series.
///
/// # Errors
/// When the file cannot be read or is an output of the caller, and for a `.pumice` file with any other option.
pub(crate) fn kind_of(path: &Path, reading: &OpenOptions) -> Result<Kind> {
    reading.outputs.check_input(path)?;
    if !is_pumice_file(path)? {
        return Ok(Kind::Foreign);
    }
    let is_series = frames_in_file(path)? > 1;
    // The record of a scene may say the first step of a file that has one alone.
    let is_fitting = |option: &str| {
        option == "--time-step" && (is_series || (reading.recorded.time && reading.time == Some(0)))
    };
    match reading.given().into_iter().find(|option| !is_fitting(option)) {
        Some(option) => {
            let named = reading.axes.map_or("", |axes| if option == "--axes" { axes.name() } else { "" });
            Err(pumice_formats::FormatError::NotApplicable {
                path: path.to_owned(),
                option: format!("{option} {named}").trim_end().to_owned(),
                why: "a .pumice file says what it holds, its spacing, and which axis is which: this is chosen when it is \
                      compressed"
                    .into(),
            }
            .into())
        }
        None => Ok(if is_series { Kind::Series } else { Kind::Compressed }),
    }
}

/// The chosen frame of a time series.
///
/// # Errors
/// [`pumice_formats::FormatError::Choose`] where none is chosen.
fn chosen_frame(series: &Series, path: &Path, reading: &OpenOptions) -> Result<u32> {
    reading.time.ok_or_else(|| {
        pumice_formats::FormatError::Choose {
            path: path.to_owned(),
            what: format!("the file has {} time steps, and each is a separate volume", series.frames()),
            option: "--time-step",
            choices: format!("0 to {}", series.frames() - 1),
        }
        .into()
    })
}

/// Which labels are wanted, by dense index.
type Chosen<'c> = &'c dyn Fn(&LabelTable) -> Vec<bool>;

/// Opens the chosen frame of a time series; with `choose` only labels that it marks.
pub(crate) fn open_frame(
    path: &Path,
    reading: &OpenOptions,
    choose: Option<Chosen<'_>>,
    job: &Job,
) -> Result<CompressedVolume> {
    let series = Series::open(path, job)?;
    let frame = chosen_frame(&series, path, reading)?;
    Ok(match choose {
        None => series.frame(frame, job)?,
        Some(choose) => series.frame_labels(frame, choose, job)?,
    })
}

/// Where the data of a `.pumice` file is while it is in use.
#[derive(Clone, Debug)]
pub enum Residence {
    /// In the memory of this process: the file may change afterwards.
    Copied,
    /// In the mapped file, as far as it is stored there as it is in memory ([`CompressedVolume::open_mapped`]): only for a process that
    /// has nothing to lose when another program truncates the file, which ends the process.
    Mapped,
    /// On disk, in pages that are loaded when rays meet them ([`CompressedVolume::open_paged`]); the file may change afterwards.
    Paged {
        /// The memory that the pages of all volumes share.
        memory: Arc<Residency>,
        /// Voxels along the side of a page.
        page_voxels: u32,
    },
}

/// Voxels along the side of a page: [the measured choice](../../docs/rendering-large-volumes.md#the-size-of-a-page).
const PAGE_VOXELS: u32 = 64;

impl Residence {
    /// Mapped, or where memory is limited on disk.
    pub fn within(limit_bytes: Option<u64>) -> Self {
        match limit_bytes {
            None => Self::Mapped,
            Some(limit) => Self::paged(&Arc::new(Residency::new(limit))),
        }
    }

    /// On disk, in pages of the usual size, in a memory that volumes may share.
    pub fn paged(memory: &Arc<Residency>) -> Self {
        Self::Paged { memory: Arc::clone(memory), page_voxels: PAGE_VOXELS }
    }
}

/// Opens a volume for rendering.
///
/// # Errors
/// One line that says what is wrong with the file and where; [`pumice_core::Error::Cancelled`] when `job` is cancelled.
pub fn open_volume(
    path: &Path,
    reading: &OpenOptions,
    residence: Residence,
    job: &Job,
) -> Result<Arc<CompressedVolume>> {
    match (kind_of(path, reading)?, &residence) {
        (Kind::Compressed, Residence::Copied) => return Ok(Arc::new(CompressedVolume::open(path, job)?)),
        (Kind::Compressed, Residence::Mapped) => {
            return Ok(Arc::new(CompressedVolume::open_mapped(path, job)?));
        }
        (Kind::Compressed, Residence::Paged { memory, page_voxels }) => {
            let folder = std::env::temp_dir();
            let volume = CompressedVolume::open_paged(path, *page_voxels, &folder, memory, job)?;
            return Ok(Arc::new(volume));
        }
        (Kind::Series, Residence::Paged { memory, page_voxels }) => {
            let series = Series::open(path, job)?;
            let (frame, folder) = (chosen_frame(&series, path, reading)?, std::env::temp_dir());
            return Ok(Arc::new(series.frame_paged(frame, *page_voxels, &folder, memory, job)?));
        }
        (Kind::Series, _) => return Ok(Arc::new(open_frame(path, reading, None, job)?)),
        (Kind::Foreign, _) => {}
    }
    if let Residence::Paged { .. } = residence {
        return Err(SessionError::Caller(format!(
            "memory limit: {} is not a .pumice file, and only those are drawn from disk: compress it first",
            path.display()
        )));
    }
    let mut source = pumice_formats::open(path, reading)?;
    Ok(Arc::new(compress_source(source.as_mut(), &CompressOptions::default(), job)?))
}

/// Opens the volumes of a scene, in its order, each as its instance says ([`options_for`]). A file that several instances read alike is
/// opened once, and of a `.pumice` file only the labels that the scene shows are read, or those of `instead` if it is given.
///
/// # Errors
/// As [`open_volume`].
pub fn open_shown(
    scene: &Scene,
    instead: Option<&Show>,
    reading: &OpenOptions,
    residence: Residence,
    job: &Job,
) -> Result<Vec<Arc<CompressedVolume>>> {
    let mut opened: BTreeMap<&Path, Vec<(&Reading, Arc<CompressedVolume>)>> = BTreeMap::new();
    let mut volumes = Vec::with_capacity(scene.instances.len());
    for instance in &scene.instances {
        let path = instance.source.as_path();
        let of_file = opened.entry(path).or_default();
        let volume = match of_file.iter().find(|(read_as, _)| **read_as == instance.reading) {
            Some((_, volume)) => Arc::clone(volume),
            None => {
                let alike = |i: &&Instance| i.source == path && i.reading == instance.reading;
                let shows: Vec<&Show> = match instead {
                    Some(show) => vec![show],
                    None => scene.instances.iter().filter(alike).map(|i| &i.style.show).collect(),
                };
                let options = options_for(&instance.reading, reading);
                let volume = open_chosen(path, &shows, &options, residence.clone(), job)?;
                of_file.push((&instance.reading, Arc::clone(&volume)));
                volume
            }
        };
        volumes.push(volume);
    }
    Ok(volumes)
}

/// Opens a volume with the labels that any of `shows` draws. If these are not all labels and the file is a `.pumice` file, only they
/// are read, and they are copied.
///
/// # Errors
/// As [`open_volume`].
pub fn open_chosen(
    path: &Path,
    shows: &[&Show],
    reading: &OpenOptions,
    residence: Residence,
    job: &Job,
) -> Result<Arc<CompressedVolume>> {
    let kind = kind_of(path, reading)?;
    // (Pages are made of the labels that are drawn, whatever is read.)
    let paged = matches!(residence, Residence::Paged { .. });
    if paged || kind == Kind::Foreign || shows.contains(&&Show::All) {
        return open_volume(path, reading, residence, job);
    }
    let choose = |labels: &LabelTable| {
        let mut chosen = vec![false; labels.len()];
        for show in shows {
            chosen.iter_mut().zip(show.among(labels.ids())).for_each(|(chosen, shown)| *chosen |= shown);
        }
        chosen
    };
    Ok(Arc::new(match kind {
        Kind::Series => open_frame(path, reading, Some(&choose), job)?,
        _ => CompressedVolume::open_labels(path, choose, job)?,
    }))
}

/// Opens these labels of a `.pumice` file.
///
/// # Errors
/// As [`open_volume`]; also for an id that the volume does not have, and for other formats, which can only be read whole.
pub fn open_labels(
    path: &Path,
    ids: &[u64],
    reading: &OpenOptions,
    job: &Job,
) -> Result<Arc<CompressedVolume>> {
    if !is_pumice_file(path)? {
        let path = path.display();
        return Err(SessionError::Caller(format!(
            "labels: {path} is not a .pumice file; only those can be opened for some labels alone"
        )));
    }
    let show = Show::Only(ids.to_vec());
    let volume = open_chosen(path, &[&show], reading, Residence::Copied, job)?;
    show.check("labels", volume.labels().ids()).map_err(|e| SessionError::Caller(e.to_string()))?;
    Ok(volume)
}

/// A volume of some labels of a `.pumice` file with these labels of the file added; of those that it holds already nothing is read. Where
/// it holds all of them, it is returned itself.
///
/// # Errors
/// As [`open_labels`]; where the file has changed since the volume was opened.
pub fn open_more_labels(
    volume: &Arc<CompressedVolume>,
    path: &Path,
    ids: &[u64],
    reading: &OpenOptions,
    job: &Job,
) -> Result<Arc<CompressedVolume>> {
    let table = volume.labels();
    Show::Only(ids.to_vec()).check("labels", table.ids()).map_err(|e| SessionError::Caller(e.to_string()))?;
    let is_missing = |id: &u64| table.index_of(*id).is_some_and(|label| !volume.holds(label));
    let missing: Vec<u64> = ids.iter().copied().filter(is_missing).collect();
    if missing.is_empty() {
        return Ok(Arc::clone(volume));
    }
    let more = open_chosen(path, &[&Show::Only(missing)], reading, Residence::Copied, job)?;
    Ok(Arc::new(volume.with_more_labels(&more)?))
}

/// Opens a label volume as a source of blocks; `.pumice` files are not accepted.
///
/// # Errors
/// As [`open_volume`].
pub fn open_source(path: &Path, reading: &OpenOptions) -> Result<Box<dyn BlockSource>> {
    Ok(pumice_formats::open(path, reading)?)
}

/// Compresses a source; `job` counts its voxels.
pub(crate) fn compress_source(
    source: &mut dyn BlockSource,
    options: &CompressOptions,
    job: &Job,
) -> Result<CompressedVolume> {
    Ok(pumice_core::compress(source, options, job)?)
}

/// Opens the meshes of a scene, in its order.
///
/// # Errors
/// One line that says what is wrong with which file.
pub fn open_meshes(scene: &Scene) -> Result<Vec<Arc<MeshData>>> {
    // A file that several meshes name is read once, and the data built from its triangles is built once.
    let mut opened: BTreeMap<&Path, Arc<MeshData>> = BTreeMap::new();
    let mut meshes = Vec::new();
    for mesh in &scene.meshes {
        let path = mesh.source.as_path();
        if !opened.contains_key(path) {
            let data = if mesh.is_built_in() { plane()? } else { pumice_formats::open_mesh(path)? };
            opened.insert(path, Arc::new(data));
        }
        meshes.extend(opened.get(path).cloned());
    }
    Ok(meshes)
}

/// The meshes of a scene, in its order, where the caller has given those that are not built in; also where it has given all.
///
/// # Errors
/// None: a list of another length is returned as it is, and refused by whoever takes it.
pub fn with_built_in(scene: &Scene, given: Vec<Arc<MeshData>>) -> Result<Vec<Arc<MeshData>>> {
    let built_in = scene.meshes.iter().filter(|mesh| mesh.is_built_in()).count();
    if built_in == 0 || given.len() + built_in != scene.meshes.len() {
        return Ok(given);
    }
    let plane = Arc::new(plane()?);
    let mut given = given.into_iter();
    let of_scene = scene.meshes.iter();
    Ok(of_scene
        .filter_map(|m| if m.is_built_in() { Some(Arc::clone(&plane)) } else { given.next() })
        .collect())
}

/// The mesh of [`pumice_scene::Mesh::PLANE`].
fn plane() -> Result<MeshData> {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| [x, y, 0.0]);
    MeshData::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]], Vec::new())
        .map_err(|e| SessionError::Caller(format!("{}: {e}", pumice_scene::Mesh::PLANE)))
}

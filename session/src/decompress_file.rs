//! Writes the labels of a `.pumice` file in a format of other programs: files by their ending, and folders of chunks.

use std::path::{Path, PathBuf};

use pumice_core::{AnnotationTable, CompressedVolume, Job, NumericColumn, Outputs, Series};
use pumice_formats::write::write_volume;
use pumice_formats::write_store::{
    CHUNK_SIDE, OmeVersion, PrecomputedEncoding, StoreFormat, check_is_free, write_store,
};
use pumice_formats::{OpenOptions, is_pattern};

use crate::error::{Result, SessionError};
use crate::label_rows::LabelRows;
use crate::open::{Kind, kind_of, open_frame};

/// What a volume is written as, as the caller says it.
#[derive(Clone, Debug, Default)]
pub struct WriteAs {
    /// The format; by default the ending of the output's name decides.
    pub format: Option<StoreName>,
    /// Version of OME-NGFF, by default 0.5.
    pub ome_version: Option<OmeVersion>,
    /// Whether 8 × 8 × 8 chunks lie in a file, in OME-Zarr 0.5.
    pub shards: bool,
    /// Encoding of precomputed chunks, by default compressed_segmentation.
    pub encoding: Option<PrecomputedEncoding>,
    /// Whether precomputed chunks are files of gzip.
    pub gzip: bool,
    /// Voxels along a side of a chunk.
    pub chunk: Option<u32>,
}

/// A kind of folder that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreName {
    /// OME-Zarr.
    OmeZarr,
    /// Neuroglancer precomputed.
    Precomputed,
}

impl StoreName {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::OmeZarr, Self::Precomputed];

    /// The name by which callers choose it, which is also the ending of folders.
    pub fn name(self) -> &'static str {
        match self {
            Self::OmeZarr => "ome-zarr",
            Self::Precomputed => "precomputed",
        }
    }

    /// The kind that a name of a folder ends with: `.zarr` or `.precomputed`.
    fn of_path(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
        [(".zarr", Self::OmeZarr), (".precomputed", Self::Precomputed)]
            .into_iter()
            .find_map(|(ending, store)| name.ends_with(ending).then_some(store))
    }
}

impl WriteAs {
    /// The kind of folder with all its settings; `None` for a file.
    ///
    /// # Errors
    /// For a setting that has no effect on what is written.
    pub fn store(&self, out: &Path) -> Result<Option<(StoreFormat, u32)>> {
        let store = self.format.or_else(|| StoreName::of_path(out));
        let version = self.ome_version.unwrap_or(OmeVersion::V0_5);
        let is_zarr = store == Some(StoreName::OmeZarr);
        let is_precomputed = store == Some(StoreName::Precomputed);
        let settings = [
            ("--ome-version", self.ome_version.is_some(), is_zarr, "it is for OME-Zarr"),
            ("--shards", self.shards, is_zarr && version == OmeVersion::V0_5, "it is for OME-Zarr 0.5"),
            ("--encoding", self.encoding.is_some(), is_precomputed, "it is for Neuroglancer precomputed"),
            ("--gzip", self.gzip, is_precomputed, "it is for Neuroglancer precomputed"),
            (
                "--chunk",
                self.chunk.is_some(),
                store.is_some(),
                "it is for OME-Zarr and Neuroglancer precomputed",
            ),
        ];
        if let Some((option, _, _, why)) = settings.iter().find(|(_, is_given, fits, _)| *is_given && !fits) {
            return Err(SessionError::Caller(format!("{}: {option} has no effect: {why}", out.display())));
        }
        let format = match store {
            None => return Ok(None),
            Some(StoreName::OmeZarr) => StoreFormat::OmeZarr { version, sharded: self.shards },
            Some(StoreName::Precomputed) => StoreFormat::Precomputed {
                encoding: self.encoding.unwrap_or(PrecomputedEncoding::CompressedSegmentation),
                gzip: self.gzip,
            },
        };
        Ok(Some((format, self.chunk.unwrap_or(CHUNK_SIDE))))
    }
}

/// Writes the labels of a `.pumice` file. Of a time series it writes one time step; where the name of `out` has `{t}`, all of them, each into an
/// output with its number there. Returns what the format does not hold, a line each; files say it in their documentation alone.
///
/// # Errors
/// As [`write_labels_of`]; when the file is damaged; for a time step that the file does not have.
pub fn decompress_file(
    pumice: &Path,
    out: &Path,
    time_step: Option<u32>,
    how: &WriteAs,
    job: &Job,
) -> Result<Vec<String>> {
    if !is_pattern(out) {
        check_output(pumice, out, how)?;
        let reading = OpenOptions { time: time_step, ..OpenOptions::default() };
        let volume = match kind_of(pumice, &reading)? {
            Kind::Series => open_frame(pumice, &reading, None, job)?,
            Kind::Compressed | Kind::Foreign => CompressedVolume::open(pumice, job)?,
        };
        return write_labels_of(&volume, out, how, job);
    }
    if let Some(step) = time_step {
        let out = out.display();
        return Err(SessionError::Caller(format!(
            "--time-step {step}: {out} names an output for each time step; name one without {{t}} for one"
        )));
    }
    let series = Series::open(pumice, job)?;
    // Numbers of equal length, so that names in the order of letters are in the order of time.
    let digits = (series.frames() - 1).to_string().len().max(4);
    let name = |step: u32| PathBuf::from(out.to_string_lossy().replace("{t}", &format!("{step:0digits$}")));
    let names: Vec<PathBuf> = (0..series.frames()).map(name).collect();
    names.iter().try_for_each(|out| check_output(pumice, out, how))?;
    let mut notes = Vec::new();
    for (step, out) in (0..).zip(&names) {
        // What a format does not hold is the same at all time steps.
        notes = write_labels_of(&series.frame(step, job)?, out, how, job)?;
    }
    Ok(notes)
}

/// Mistakes in the request show before a volume is read.
fn check_output(pumice: &Path, out: &Path, how: &WriteAs) -> Result<()> {
    if how.store(out)?.is_some() {
        return Ok(check_is_free(out)?);
    }
    let outputs = Outputs::default();
    outputs.declare(out)?;
    Ok(outputs.check_input(pumice)?)
}

/// Writes the labels of a volume, as [`decompress_file`] does.
///
/// # Errors
/// When the name or the settings fit no format, a folder of the name exists, or the output cannot be written.
pub fn write_labels_of(
    volume: &CompressedVolume,
    out: &Path,
    how: &WriteAs,
    job: &Job,
) -> Result<Vec<String>> {
    let info = volume.info().clone();
    let store = how.store(out)?;
    job.begin(info.voxels());
    let mut decode = |origin: [u32; 3], dims: [u32; 3]| {
        job.check()?;
        job.advance(dims.iter().map(|&d| u64::from(d)).product());
        volume.decode_ids(origin, dims)
    };
    match store {
        None => {
            write_volume(out, &info, &mut decode)?;
            Ok(Vec::new())
        }
        Some((format, side)) => {
            Ok(write_store(out, &info, &known_labels(volume)?, format, side, &mut decode)?)
        }
    }
}

/// Labels of which a name, a type, a colour or a number of a table is known.
fn known_labels(volume: &CompressedVolume) -> Result<AnnotationTable> {
    let labels = LabelRows::for_query(volume, &crate::parse_query("*")?);
    let columns = volume.labels().columns();
    let rows: Vec<usize> = (0..labels.ids().len())
        .filter(|&row| {
            !labels.names()[row].is_empty()
                || !labels.types()[row].is_empty()
                || labels.colors_srgb()[row].is_some()
                || columns.iter().any(|column| !column.values[row].is_nan())
        })
        .collect();
    let texts = |texts: &[&str]| rows.iter().map(|&row| texts[row].to_owned()).collect();
    Ok(AnnotationTable::new(
        rows.iter().map(|&row| labels.ids()[row]).collect(),
        texts(labels.names()),
        texts(labels.types()),
        rows.iter().map(|&row| labels.colors_srgb()[row]).collect(),
        columns
            .iter()
            .map(|column| NumericColumn {
                name: column.name.clone(),
                values: rows.iter().map(|&row| column.values[row]).collect(),
            })
            .collect(),
    )?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_without_effect_are_refused() {
        let none = WriteAs::default();
        let store = |how: &WriteAs, out: &str| how.store(Path::new(out)).map_err(|e| e.to_string());
        assert_eq!(store(&none, "a.nrrd"), Ok(None));
        let plain = StoreFormat::OmeZarr { version: OmeVersion::V0_5, sharded: false };
        assert_eq!(store(&none, "a.ome.zarr"), Ok(Some((plain, 64))));
        let named = WriteAs { format: Some(StoreName::Precomputed), ..none.clone() };
        assert!(matches!(store(&named, "a.zarr"), Ok(Some((StoreFormat::Precomputed { .. }, 64)))));
        for (how, out) in [
            (WriteAs { shards: true, ..none.clone() }, "a.precomputed"),
            (WriteAs { shards: true, ome_version: Some(OmeVersion::V0_4), ..none.clone() }, "a.zarr"),
            (WriteAs { gzip: true, ..none.clone() }, "a.zarr"),
            (WriteAs { encoding: Some(PrecomputedEncoding::Raw), ..none.clone() }, "a.nrrd"),
            (WriteAs { chunk: Some(32), ..none.clone() }, "a.nrrd"),
            (WriteAs { ome_version: Some(OmeVersion::V0_5), ..none }, "a.precomputed"),
        ] {
            assert!(store(&how, out).unwrap_err().contains("has no effect"), "{how:?}");
        }
    }
}

//! What parts are made of: one volume, or a time series, of which a part has its chunks at all time steps.

use std::path::{Path, PathBuf};

use pumice_core::{
    ChunkGrid, ChunkSet, CompressOptions, Job, PartSource, SeriesSource as _, VolumeInfo, VoxelRegion,
    WrittenVolume, compress_part, compress_series_part,
};
use pumice_formats::{FileSeries, OpenOptions, Reach, TimeSteps, open_series};

use crate::compress_file::limit_error;
use crate::error::{Result, SessionError};
use crate::source_fingerprint::{changes_of, source_of_all};

/// A volume or a time series, of which nothing is read yet.
pub(crate) struct PartInput {
    /// The file of the volume, or of the first time step.
    first: PathBuf,
    reading: OpenOptions,
    series: Option<FileSeries>,
}

impl PartInput {
    /// What `inputs` name, as [`crate::compress_file()`] takes them.
    ///
    /// # Errors
    /// As [`open_series`]; where there is no input.
    pub(crate) fn new(
        inputs: &[PathBuf],
        time_steps: Option<TimeSteps>,
        reading: &OpenOptions,
    ) -> Result<Self> {
        let series = open_series(inputs, time_steps, reading)?;
        let [input, ..] = inputs else {
            return Err(SessionError::Caller("expected a label volume, got none".into()));
        };
        let first = series.as_ref().map_or(input.clone(), |series| series.place(0).0.to_owned());
        Ok(Self { first, reading: reading.clone(), series })
    }

    /// The file of the volume or of the first time step, for messages.
    pub(crate) fn path(&self) -> &Path {
        &self.first
    }

    /// The files of the time steps, each once, or that of the volume.
    fn files(&self) -> Vec<&Path> {
        let Some(series) = &self.series else { return vec![&self.first] };
        let mut files: Vec<&Path> = (0..series.frames()).map(|frame| series.place(frame).0).collect();
        files.dedup();
        files
    }

    /// How a time step of a file is read, without the warnings of its reader; those of a volume where it has no time.
    fn reading_of(&self, frame: u32) -> OpenOptions {
        let step = self.series.as_ref().and_then(|series| series.place(frame).1);
        OpenOptions { time: step.or(self.reading.time), ..self.reading.silent() }
    }

    /// The description of the volume, or of the first time step.
    pub(crate) fn info(&self) -> Result<VolumeInfo> {
        Ok(pumice_formats::probe(&self.first, &self.reading_of(0))?.info)
    }

    /// How the voxels are reached: of several files, as of the one that is reached worst. Also returns that file.
    pub(crate) fn reach(&self) -> Result<(Reach, &Path)> {
        let mut worst = (Reach::Regions, &*self.first);
        for file in self.files() {
            let reach = pumice_formats::reach(file, &self.reading_of(0))?;
            worst = match (worst.0, reach) {
                (_, Reach::Stream) => return Ok((reach, file)),
                // (Layers across two axes: those of the first file divide the voxels as well as those of the second.)
                (Reach::Regions, Reach::Layers(_)) => (reach, file),
                _ => worst,
            };
        }
        Ok(worst)
    }

    /// What parts say of their source.
    pub(crate) fn source(&self) -> Result<PartSource> {
        let mut source = source_of_all(&self.files(), &self.reading)?;
        let step = |frame: u32| self.series.as_ref().and_then(|series| series.place(frame).1);
        let last = self.series.as_ref().map_or(0, |series| series.frames() - 1);
        if let (Some(first), Some(last)) = (step(0), step(last)) {
            let space = if source.reading.is_empty() { "" } else { " " };
            source.reading += &format!("{space}--time-steps {first}-{last}");
        }
        Ok(source)
    }

    /// When each of the files was changed last ([`changes_of`]).
    pub(crate) fn changes(&self) -> Result<Vec<(u64, u32, u64)>> {
        let mut all = Vec::new();
        for file in self.files() {
            all.extend(changes_of(file, &self.reading)?);
        }
        Ok(all)
    }

    /// Compresses some chunks into a part. `source` and `info` are those of this input.
    pub(crate) fn write_part(
        &self,
        chunks: &ChunkSet,
        (source, info): (&PartSource, &VolumeInfo),
        output: &Path,
        (threads, memory_limit_bytes): (Option<usize>, Option<u64>),
        job: &Job,
    ) -> Result<WrittenVolume> {
        let grid = ChunkGrid::new(info.dims);
        let of_input = |e: pumice_core::Error| SessionError::Caller(format!("{}: {e}", self.first.display()));
        chunks.check(&grid).map_err(of_input)?;
        let regions: Vec<VoxelRegion> = chunks.iter().filter_map(|number| grid.region(number)).collect();
        let threads = threads.unwrap_or(0);
        let options = CompressOptions { threads, memory_limit_bytes, ..CompressOptions::default() };
        let written = match &self.series {
            Some(series) => {
                let mut of_chunks = series.of_regions(regions);
                compress_series_part(&mut of_chunks, chunks, source, output, &options, job)
            }
            None => {
                let mut of_chunks = pumice_formats::open_regions(&self.first, &self.reading, &regions)?;
                compress_part(of_chunks.as_mut(), chunks, source, output, &options, job)
            }
        };
        written.map_err(|e| limit_error(e, &self.first, memory_limit_bytes))
    }
}

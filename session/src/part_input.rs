//! What parts are made of: one volume, or a time series, of which a part has its chunks at all time steps.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pumice_core::{
    BlockSource, ChunkGrid, ChunkSet, CompressOptions, Job, KeptRecords, LayerSource, PartSource,
    SeriesSource as _, VolumeInfo, VoxelRegion, WrittenVolume, compress_layer_parts, compress_parts,
    compress_series_parts,
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

    /// How the voxels are reached: of several files, as of the one that is reached worst.
    fn reach(&self) -> Result<Reach> {
        let mut worst = Reach::Regions;
        for file in self.files() {
            // (Files whose slowest axes differ: the layers of the first divide the voxels as well as those of the others.)
            if worst == Reach::Regions {
                worst = pumice_formats::reach(file, &self.reading_of(0))?;
            }
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

    /// The numbers of all chunks, those together that are read together: as few as the source gives without reading others too.
    pub(crate) fn groups(&self, info: &VolumeInfo) -> Result<Vec<Vec<u64>>> {
        let grid = ChunkGrid::new(info.dims);
        ChunkSet::all(&grid).check(&grid)?;
        let Reach::InOrder(axis) = self.reach()? else {
            return Ok((0..grid.chunks()).map(|number| vec![number]).collect());
        };
        let mut layers: BTreeMap<u32, Vec<u64>> = BTreeMap::new();
        for number in 0..grid.chunks() {
            if let Some(origin) = grid.origin(number) {
                layers.entry(origin[axis]).or_default().push(number);
            }
        }
        Ok(layers.into_values().collect())
    }
}

/// Compresses chunks of an input into parts.
pub(crate) struct PartWriter<'a> {
    input: &'a PartInput,
    /// What the parts say of the input.
    source: &'a PartSource,
    /// The input's description.
    info: &'a VolumeInfo,
    threads: Option<usize>,
    memory_limit_bytes: Option<u64>,
    /// The source of all chunks that are to be compressed, where it is read once from its beginning.
    layers: Option<LayerSource>,
}

/// Parts whose voxels are read together, and what was kept of them where they are several that are read from the beginning of a source.
pub(crate) struct PartGroup<'a> {
    pub(crate) parts: Vec<PartAt<'a>>,
    pub(crate) kept: Option<KeptRecords>,
}

/// Chunks, and the path of the part that they are compressed into.
pub(crate) type PartAt<'a> = (ChunkSet, &'a Path);

impl<'a> PartWriter<'a> {
    /// Begins to compress chunks of `input`, which `source` and `info` describe.
    pub(crate) fn new(
        input: &'a PartInput,
        (source, info): (&'a PartSource, &'a VolumeInfo),
        (threads, memory_limit_bytes): (Option<usize>, Option<u64>),
    ) -> Self {
        Self { input, source, info, threads, memory_limit_bytes, layers: None }
    }

    /// Takes all that is to be written, in the order of [`PartInput::groups`]: a volume that has to be read from its beginning is then read once
    /// for all of them. A time series is read anew for each group.
    pub(crate) fn announce(&mut self, groups: &[PartGroup<'_>]) -> Result<()> {
        let (Reach::InOrder(axis), None) = (self.input.reach()?, &self.input.series) else { return Ok(()) };
        let mut regions = Vec::new();
        for group in groups {
            let reached = group.kept.as_ref().map_or(0, KeptRecords::reached);
            for mut region in self.regions(&group.parts)? {
                region[axis][0] = region[axis][0].max(reached);
                regions.extend((region[axis][0] < region[axis][1]).then_some(region));
            }
        }
        self.layers = Some(LayerSource::new(self.open(&regions)?, axis));
        Ok(())
    }

    /// Writes parts whose voxels are read together.
    pub(crate) fn write(&mut self, group: PartGroup<'_>, job: &Job) -> Result<Vec<WrittenVolume>> {
        let PartGroup { parts, mut kept } = group;
        let options = CompressOptions {
            threads: self.threads.unwrap_or(0),
            memory_limit_bytes: self.memory_limit_bytes,
            ..CompressOptions::default()
        };
        let (regions, source) = (self.regions(&parts)?, self.source);
        let written = match (&self.input.series, &mut self.layers) {
            (Some(series), _) => {
                let mut frames = series.of_regions(regions);
                compress_series_parts(&mut frames, &parts, source, kept.as_mut(), &options, job)
            }
            (None, Some(layers)) => match &mut kept {
                Some(kept) => compress_layer_parts(layers, &parts, source, kept, &options, job),
                None => {
                    let axis = layers.axis();
                    layers.up_to(regions.iter().map(|region| region[axis][1]).max().unwrap_or(0));
                    compress_parts(layers, &parts, source, &options, job)
                }
            },
            (None, None) => compress_parts(self.open(&regions)?.as_mut(), &parts, source, &options, job),
        };
        let written = written.map_err(|e| limit_error(e, &self.input.first, self.memory_limit_bytes))?;
        kept.map_or(Ok(()), KeptRecords::remove)?;
        Ok(written)
    }

    fn open(&self, regions: &[VoxelRegion]) -> Result<Box<dyn BlockSource>> {
        Ok(pumice_formats::open_regions(&self.input.first, &self.input.reading, regions)?)
    }

    /// The regions of all chunks of some parts.
    fn regions(&self, parts: &[PartAt<'_>]) -> Result<Vec<VoxelRegion>> {
        let grid = ChunkGrid::new(self.info.dims);
        let mut regions = Vec::new();
        for (chunks, _) in parts {
            let of_input = |e| SessionError::Caller(format!("{}: {e}", self.input.first.display()));
            chunks.check(&grid).map_err(of_input)?;
            regions.extend(chunks.iter().filter_map(|number| grid.region(number)));
        }
        Ok(regions)
    }
}

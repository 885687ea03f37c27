//! `pumice decompress`

use std::path::PathBuf;

use clap::Args;
use pumice_session::{OmeVersion, PrecomputedEncoding, StoreName, WriteAs};

use super::values::by_name;

/// Write the labels of a .pumice file as NRRD, NPY, NIfTI or TIFF, or as a folder of OME-Zarr or Neuroglancer precomputed
#[derive(Debug, Args)]
pub(crate) struct Decompress {
    /// The .pumice file
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Output; its extension chooses the format: .nrrd .npy .nii .nii.gz .tif, or a new folder .zarr .precomputed
    ///
    /// Of a time series, a name with {t} stands for an output for each time step, such as frame_{t}.nrrd.
    #[arg(short, long, value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Time step of a time series, counted from 0
    #[arg(long = "time-step", value_name = "N")]
    pub(crate) time_step: Option<u32>,
    /// Write a folder of this format, whatever its name: ome-zarr, precomputed
    #[arg(long, value_name = "FORMAT", value_parser = by_name(&StoreName::ALL, StoreName::name))]
    format: Option<StoreName>,
    /// Version of OME-Zarr: 0.5, on Zarr 3 (the default), or 0.4, on Zarr 2
    #[arg(long, value_name = "VERSION", value_parser = by_name(&OmeVersion::ALL, OmeVersion::name))]
    ome_version: Option<OmeVersion>,
    /// Put 8 x 8 x 8 chunks into a file (OME-Zarr 0.5)
    #[arg(long)]
    shards: bool,
    /// Encoding of precomputed chunks: compressed_segmentation (the default) or raw
    #[arg(long, value_name = "ENCODING", value_parser = by_name(&PrecomputedEncoding::ALL, PrecomputedEncoding::name))]
    encoding: Option<PrecomputedEncoding>,
    /// Compress precomputed chunks by gzip, as files .gz, which cloud-volume reads, and a server that knows of them
    #[arg(long)]
    gzip: bool,
    /// Voxels along a side of a chunk, 8 to 128, by default 64
    #[arg(long, value_name = "N")]
    chunk: Option<u32>,
}

impl Decompress {
    pub(crate) fn how(&self) -> WriteAs {
        WriteAs {
            format: self.format,
            ome_version: self.ome_version,
            shards: self.shards,
            encoding: self.encoding,
            gzip: self.gzip,
            chunk: self.chunk,
        }
    }
}

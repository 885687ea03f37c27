//! `pumice decompress`

use std::path::PathBuf;

use clap::Args;

/// Write the labels of a .pumice file as NRRD, NPY, NIfTI or TIFF
#[derive(Debug, Args)]
pub(crate) struct Decompress {
    /// The .pumice file
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Output file; its extension chooses the format: .nrrd .npy .nii .nii.gz .tif
    ///
    /// Of a time series, a name with {t} stands for a file for each time step, such as frame_{t}.nrrd.
    #[arg(short, long, value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Time step of a time series, counted from 0
    #[arg(long = "time-step", value_name = "N")]
    pub(crate) time_step: Option<u32>,
}

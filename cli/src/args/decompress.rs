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
    #[arg(short, long, value_name = "OUT")]
    pub(crate) out: PathBuf,
}

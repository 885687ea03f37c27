//! `pumice table`

use std::path::PathBuf;

use clap::Args;
use pumice_session::LabelTableFormat;

use super::Reading;
use super::values::table_format;

/// Write the labels of a volume as a table: CSV, TSV, ITK-SNAP, FreeSurfer, 3D Slicer, Neuroglancer
///
/// CSV and TSV have id, name, type, colour, number of voxels and of boxes, the lowest and the highest voxel of each label, the middle of these
/// bounds in the volume's world, and the numbers that a table gave (`pumice compress --table`). The command says what another format has not.
#[derive(Debug, Args)]
pub(crate) struct Table {
    /// A .pumice file or any label volume
    #[arg(value_name = "FILE")]
    pub(crate) input: PathBuf,
    /// Table to write; its name chooses the format: .csv, .tsv, .txt or .label (ITK-SNAP), lut.txt, .lut or .ctab (FreeSurfer), .ctbl
    /// (3D Slicer), .json or the name info (Neuroglancer)
    #[arg(short, long, value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Format of the table, whatever its name: csv, tsv, itk-snap, freesurfer, slicer, neuroglancer
    #[arg(long = "as", value_name = "FORMAT", value_parser = table_format)]
    pub(crate) format: Option<LabelTableFormat>,
    /// Write only the labels for which this holds, e.g. 'glia voxels>1000' (see `pumice info --help`)
    #[arg(
        long,
        value_name = "QUERY",
        allow_hyphen_values = true,
        default_value = "*",
        hide_default_value = true
    )]
    pub(crate) query: String,
    /// Print a report in JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

//! The flags of the `pumice` command, one file per subcommand. Each flag has a short help line and, where needed, a longer text with
//! its default, unit and cost. The flags of `pumice bench` are in the crate `pumice-bench`, beside the benches.

mod annotations;
mod compare;
mod compress;
mod decompress;
mod demo;
mod devices;
mod export;
mod figure;
mod info;
mod merge;
mod pick;
mod reading;
mod render;
pub(crate) mod selectors;
mod table;
mod values;
mod verify;
mod verify_render;

use clap::{Parser, Subcommand};
use pumice_bench::Bench;

pub(crate) use compare::Compare;
pub(crate) use compress::{Compress, CompressionLevel};
pub(crate) use decompress::Decompress;
pub(crate) use demo::Demo;
pub(crate) use devices::Devices;
pub(crate) use export::{Export, FormArg, ReaderArg};
pub(crate) use info::{Info, LabelList};
pub(crate) use merge::Merge;
pub(crate) use pick::Pick;
pub(crate) use reading::{Missing, Reading};
pub(crate) use render::{LodArg, Render, RenderMode, ViewArg};
pub(crate) use table::Table;
pub(crate) use verify::Verify;
pub(crate) use verify_render::VerifyRender;

/// Path trace figures from segmentation volumes that other tools cannot load.
///
/// A segmentation volume has one integer label per voxel. Pumice compresses it losslessly to a few per cent of its size, path traces
/// the compressed form directly, and writes pictures that carry an estimate of their own error.
///
/// Begin with `pumice demo`, or with your own file: `pumice render volume.nrrd -o picture.png`.
#[derive(Debug, Parser)]
#[command(name = "pumice", version, max_term_width = 100, after_help = EXIT_CODES, disable_help_subcommand = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 success; 1 the command ran and the check failed (verify, verify-render, compare, bench); 2 bad usage or bad \
input, or verify-render cannot tell, explained in one line on standard error.";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Demo(Demo),
    Compress(Compress),
    Merge(Merge),
    Info(Info),
    Table(Table),
    Verify(Verify),
    Decompress(Decompress),
    Render(Box<Render>),
    VerifyRender(Box<VerifyRender>),
    Export(Export),
    Compare(Compare),
    Pick(Pick),
    Devices(Devices),
    Bench(Bench),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clap_finds_no_fault_with_the_flags() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }
}

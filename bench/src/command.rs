//! The subcommands of `pumice bench`. Each module of this crate has its flags and its `run`.

use std::io::Write;

use clap::{Args, Subcommand};
use pumice_core::Job;

use crate::console::{BenchResult, Console, Outcome};
use crate::{
    backends, convergence, denoise, embree, errors, export, extremes, instances, large, live, lod, needs,
    paper, peers, residency, shaders, sizes, speeds, stability, types,
};

/// Measure, and print a table
#[derive(Debug, Args)]
pub struct Bench {
    #[command(subcommand)]
    what: Kind,
}

#[derive(Debug, Subcommand)]
enum Kind {
    Convergence(convergence::command::Flags),
    Denoise(denoise::Flags),
    Errors(errors::Flags),
    Stability(stability::command::Flags),
    Needs(needs::command::Flags),
    Peers(peers::command::Flags),
    Extremes(extremes::command::Flags),
    Export(export::command::Flags),
    Lod(lod::command::Flags),
    Paper(paper::command::Flags),
    Sizes(sizes::Flags),
    Speeds(speeds::Flags),
    Live(live::Flags),
    Backends(backends::Flags),
    Instances(instances::Flags),
    Residency(residency::Flags),
    Large(large::Flags),
    Embree(embree::Flags),
    Shaders(shaders::Flags),
    Types(types::Flags),
}

impl Bench {
    /// Runs the bench that the flags select, and prints progress and results to `out`.
    ///
    /// # Errors
    /// Wrong flags or volumes; errors of measuring or writing; the job's cancellation.
    pub fn run(&self, job: &Job, out: &mut dyn Write) -> BenchResult<Outcome> {
        let console = &mut Console::new(out);
        match &self.what {
            Kind::Convergence(flags) => convergence::command::run(flags, job, console),
            Kind::Denoise(flags) => denoise::run(flags, job, console),
            Kind::Errors(flags) => errors::run(flags, job, console),
            Kind::Stability(flags) => stability::command::run(flags, job, console),
            Kind::Needs(flags) => needs::command::run(flags, job, console),
            Kind::Peers(flags) => peers::command::run(flags, job, console),
            Kind::Extremes(flags) => extremes::command::run(flags, job, console),
            Kind::Export(flags) => export::command::run(flags, job, console),
            Kind::Lod(flags) => lod::command::run(flags, job, console),
            Kind::Paper(flags) => paper::command::run(flags, job, console),
            Kind::Sizes(flags) => sizes::run(flags, job, console),
            Kind::Speeds(flags) => speeds::run(flags, job, console),
            Kind::Live(flags) => live::run(flags, job, console),
            Kind::Backends(flags) => backends::run(flags, job, console),
            Kind::Instances(flags) => instances::run(flags, job, console),
            Kind::Residency(flags) => residency::run(flags, job, console),
            Kind::Large(flags) => large::run(flags, job, console),
            Kind::Embree(flags) => embree::run(flags, job, console),
            Kind::Shaders(flags) => shaders::run(flags, job, console),
            Kind::Types(flags) => types::run(flags, job, console),
        }
    }
}

//! What a driver's compiler makes of the shaders: registers, spills, scratch memory, instructions and seconds
//! (`VK_KHR_pipeline_executable_properties`).
//!
//! ```text
//! device × backend × (samples, first surfaces) × kind of scene ──► the driver compiles, nothing is launched ──► its own statistics
//! ```
//! Registers that do not suffice are spilled to memory, and the more registers a thread has, the fewer threads hide the time that memory
//! takes: whether a shader fits a graphics processor shows here, without a picture.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use pumice_core::Job;
use pumice_scene::{Part, PartSet};
use pumice_session::backend::LOADER_VARIABLE;
use pumice_session::error::{Result, SessionError};
use pumice_transport::RenderError;
use pumice_vulkan::device::{
    Backend, Candidate, DeviceError, Executable, Gpu, Instance, InstanceOptions, survey,
};
use pumice_vulkan::pack::ShaderNeeds;
use pumice_vulkan::{Entry, executables};
use serde::Serialize;

use crate::console::{BenchResult, Console, Outcome};
use crate::files::write_results;
use crate::machine;
use crate::table::{Row, Table};

/// Registers, spills, scratch memory, instructions and seconds of the shaders, as the driver's compiler counts them
///
/// Compiles the shaders of each backend for scenes of several kinds on the devices of this machine, and launches nothing. Exit code 1
/// where no driver tells such figures. Writes shaders.md and shaders.json.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Backends whose shaders are compiled; default: all that the device supports
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', value_parser = backend)]
    backends: Vec<Backend>,
    /// Only devices with this text in their name
    #[arg(long, value_name = "TEXT")]
    device: Option<String>,
    /// Kinds of scenes; default: all
    #[arg(long, value_name = "NAME,…", value_enum, value_delimiter = ',')]
    scenes: Vec<SceneKind>,
    /// Also write the results into this folder, created if missing
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

fn backend(name: &str) -> std::result::Result<Backend, String> {
    let names = Backend::ALL.map(Backend::name).join(", ");
    Backend::from_name(name).ok_or_else(|| format!("expected one of {names}"))
}

/// A kind of scene, by what it needs of the shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SceneKind {
    /// Diffuse labels under a constant sky.
    Diffuse,
    /// Principled labels without glass, under a sky, a sun and lamps.
    Principled,
    /// Everything that a scene can need.
    All,
}

impl SceneKind {
    fn needs(self) -> ShaderNeeds {
        let few = PartSet::NONE;
        let parts = match self {
            Self::Diffuse => few,
            Self::Principled => few.with(Part::LightSampling).with(Part::Lamps).with(Part::Microfacets),
            Self::All => PartSet::ALL,
        };
        let all = self == Self::All;
        ShaderNeeds { parts, instance_tree: all, bricks: true, boxes: all, pages: all }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Diffuse => "diffuse",
            Self::Principled => "principled",
            Self::All => "all",
        }
    }
}

/// What a compiler counted in one executable of a pipeline.
#[derive(Clone, Debug, Serialize)]
pub struct CompiledShader {
    /// The device's name.
    pub device: String,
    /// Versions of Vulkan and the driver.
    pub driver: String,
    /// Name of the backend.
    pub backend: &'static str,
    /// `samples`, or `first surfaces`.
    pub entry: &'static str,
    /// The kind of scene for which it was compiled.
    pub scene: SceneKind,
    /// The driver's name of the executable.
    pub executable: String,
    /// Threads that run in step; 0 where the driver does not tell.
    pub subgroup_size: u32,
    /// Seconds that the pipeline took to compile.
    pub seconds: f64,
    /// All that the driver counted, by its own names.
    pub statistics: Vec<(String, f64)>,
}

/// Names of statistics with one meaning, by which drivers tell them: RADV, ANV, NVK and NVIDIA's own.
const REGISTERS: [&str; 4] = ["VGPRs", "GPRs", "Max live registers", "Register Count"];
const SPILLED: [&str; 3] = ["Spilled VGPRs", "Spills to memory", "Spill count"];
const SCRATCH: [&str; 4] = ["Scratch size", "Scratch Memory Size", "SLM size", "Local Memory Size"];
const INSTRUCTIONS: [&str; 2] = ["Instructions", "Instruction Count"];
const SUBGROUPS: [&str; 2] = ["Subgroups per SIMD", "Max warps/SM"];

impl CompiledShader {
    /// The first of these statistics that the driver tells.
    fn statistic(&self, names: &[&str]) -> Option<f64> {
        let told = |name: &&str| self.statistics.iter().find(|(n, _)| n.eq_ignore_ascii_case(name));
        names.iter().find_map(told).map(|(_, value)| *value)
    }
}

impl Row for CompiledShader {
    fn cells(&self) -> Vec<(&'static str, String)> {
        let told = |names: &[&str]| self.statistic(names).map_or("–".into(), |v| format!("{v}"));
        vec![
            ("device", self.device.clone()),
            ("backend", self.backend.into()),
            ("shader", format!("{}: {}", self.entry, self.executable)),
            ("scene", self.scene.name().into()),
            ("threads in step", self.subgroup_size.to_string()),
            ("registers", told(&REGISTERS)),
            ("spilled", told(&SPILLED)),
            ("scratch, bytes", told(&SCRATCH)),
            ("subgroups a SIMD", told(&SUBGROUPS)),
            ("instructions", told(&INSTRUCTIONS)),
            ("compiling, s", format!("{:.1}", self.seconds)),
        ]
    }
}

/// A problem of a device, in one line.
fn failed(error: &DeviceError) -> SessionError {
    RenderError::Device(error.to_string()).into()
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let loader = std::env::var_os(LOADER_VARIABLE).filter(|l| !l.is_empty()).map(PathBuf::from);
    let instance = Instance::new(&InstanceOptions { loader, ..InstanceOptions::default() });
    let instance = instance.map_err(|e| failed(&e))?;
    let (mut rows, mut notes) = (Vec::new(), Vec::new());
    let wanted = |c: &&Candidate| flags.device.as_ref().is_none_or(|text| contains(&c.name, text));
    for candidate in survey(&instance).map_err(|e| failed(&e))?.iter().filter(wanted) {
        if candidate.statistics {
            measure(&instance, candidate, flags, job, &mut rows, &mut notes)?;
        } else {
            notes.push(format!(
                "{} ({}): this driver tells no figures of compiled shaders",
                candidate.name, candidate.driver
            ));
        }
    }
    if rows.is_empty() && notes.is_empty() {
        notes.push("no Vulkan device here".into());
        if let Some(text) = &flags.device {
            notes = vec![format!("no Vulkan device here has “{text}” in its name")];
        }
    }
    for note in &notes {
        console.line(note)?;
    }
    if rows.is_empty() {
        return Ok(Outcome::Missed);
    }
    let page = page(&rows);
    console.line(page.trim_end())?;
    if let Some(folder) = &flags.out {
        let json = serde_json::to_string_pretty(&rows).map_err(|e| SessionError::Caller(e.to_string()))?;
        write_results(folder, [("shaders.md".into(), page), ("shaders.json".into(), json + "\n")])?;
    }
    Ok(Outcome::Holds)
}

fn contains(name: &str, text: &str) -> bool {
    name.to_lowercase().contains(&text.to_lowercase())
}

fn page(rows: &[CompiledShader]) -> String {
    let mut drivers: Vec<String> = rows.iter().map(|r| format!("{}: {}", r.device, r.driver)).collect();
    drivers.dedup();
    let drivers = drivers.join("; ");
    format!("# shaders\n\n{}\n\n{drivers}.\n\n{}", machine::description(), Table::of(rows).markdown())
}

/// Compiles the shaders of all wanted kinds for one device.
fn measure(
    instance: &Instance,
    candidate: &Candidate,
    flags: &Flags,
    job: &Job,
    rows: &mut Vec<CompiledShader>,
    notes: &mut Vec<String>,
) -> Result<()> {
    let named = |b: &Backend| flags.backends.is_empty() || flags.backends.contains(b);
    let scenes = if flags.scenes.is_empty() { SceneKind::value_variants() } else { &flags.scenes };
    for backend in Backend::ALL.into_iter().filter(named) {
        if !candidate.can(backend) {
            notes.push(format!(
                "{}, {backend}: lacks {}",
                candidate.name,
                candidate.missing(backend).join(", ")
            ));
            continue;
        }
        let gpu = Gpu::open_for_statistics(instance, candidate, backend).map_err(|e| failed(&e))?;
        for (entry, told) in [(Entry::Path, "samples"), (Entry::First, "first surfaces")] {
            for &scene in scenes {
                job.check()?;
                let (took, made) = executables(&gpu, entry, &scene.needs()).map_err(|e| failed(&e))?;
                rows.extend(made.into_iter().map(|Executable { name, subgroup_size, statistics }| {
                    CompiledShader {
                        device: candidate.name.clone(),
                        driver: candidate.driver.clone(),
                        backend: backend.name(),
                        entry: told,
                        scene,
                        executable: name,
                        subgroup_size,
                        seconds: took.as_secs_f64(),
                        statistics: statistics.into_iter().map(|s| (s.name, s.value)).collect(),
                    }
                }));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shader(statistics: &[(&str, f64)]) -> CompiledShader {
        CompiledShader {
            device: "a card".into(),
            driver: "Vulkan 1.4.0, a driver 1.2".into(),
            backend: "vulkan-compute",
            entry: "samples",
            scene: SceneKind::Diffuse,
            executable: "compute".into(),
            subgroup_size: 32,
            seconds: 1.25,
            statistics: statistics.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect(),
        }
    }

    fn cell(shader: &CompiledShader, column: &str) -> String {
        shader.cells().into_iter().find(|(name, _)| *name == column).map(|(_, text)| text).unwrap_or_default()
    }

    /// A statistic is found by any driver's name, and one that a driver does not tell is not taken for 0.
    #[test]
    fn statistics_of_several_drivers() {
        let amd = shader(&[("SGPRs", 128.0), ("VGPRs", 96.0), ("Spilled VGPRs", 0.0)]);
        let intel = shader(&[("Instruction Count", 42_000.0), ("Spill count", 1247.0)]);
        assert_eq!((cell(&amd, "registers"), cell(&amd, "spilled")), ("96".into(), "0".into()));
        assert_eq!(cell(&amd, "instructions"), "–");
        assert_eq!((cell(&intel, "instructions"), cell(&intel, "spilled")), ("42000".into(), "1247".into()));
        assert_eq!((cell(&intel, "registers"), cell(&intel, "compiling, s")), ("–".into(), "1.2".into()));
    }

    #[test]
    fn few_features_are_few() {
        let count = |kind: SceneKind| kind.needs().constants().iter().sum::<u32>();
        assert_eq!(SceneKind::value_variants().iter().map(|&k| count(k)).collect::<Vec<_>>(), [1, 4, 21]);
    }

    #[test]
    fn a_driver_is_named_once() {
        let text = page(&[shader(&[]), shader(&[])]);
        assert_eq!(text.matches("a driver 1.2").count(), 1);
        assert!(contains("Radeon RX 7900 XTX", "rx 7900") && !contains("Radeon", "arc"));
    }
}

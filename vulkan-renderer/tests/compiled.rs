//! The shaders of scenes with few features fit a graphics processor: nothing is spilled, and four subgroups share a SIMD unit. Mesa's
//! compiler for AMD cards counts it, without a card.
//!
//! ```text
//! test ──► this program again, with that driver and RADV_FORCE_FAMILY ──► a line for each shader: spilled, subgroups a SIMD
//! ```
//! `PUMICE_SHADER_COMPILER` is the driver's file for the Vulkan loader. `cargo xtask test` unpacks it and sets the variable; a test without
//! it fails, because it must not pass by doing nothing.
#![allow(clippy::unwrap_used, clippy::panic, clippy::expect_used, clippy::print_stdout, reason = "tests")]

use std::path::Path;
use std::process::Command;

use pumice_scene::{Part, PartSet};
use pumice_vulkan::device::{Backend, Gpu, Instance, InstanceOptions, survey};
use pumice_vulkan::pack::ShaderNeeds;
use pumice_vulkan::{Entry, executables};

/// What the program that is started again compiles: `BACKEND ENTRY SCENE`.
const TASK: &str = "PUMICE_TEST_COMPILES";
/// Begins its line of results.
const MARK: &str = "compiled:";

/// What the compiler counted in the largest executable of a pipeline.
#[derive(Clone, Copy, Debug)]
struct Compiled {
    spilled: u64,
    subgroups: u64,
}

fn needs(scene: &str) -> ShaderNeeds {
    let parts = match scene {
        "diffuse" => PartSet::NONE,
        "principled" => PartSet::NONE.with(Part::LightSampling).with(Part::Lamps).with(Part::Microfacets),
        _ => PartSet::ALL,
    };
    let all = scene == "all";
    ShaderNeeds { parts, instance_tree: all, bricks: true, boxes: all, pages: all }
}

/// Compiles one pipeline for the first device that tells statistics, and prints them.
fn compile(task: &str) {
    let [backend, entry, scene] = task.split(' ').collect::<Vec<_>>().try_into().expect("a task");
    let backend = Backend::from_name(backend).expect("a backend");
    let entry = if entry == "first" { Entry::First } else { Entry::Path };
    let instance = Instance::new(&InstanceOptions::default()).expect("Vulkan");
    let all = survey(&instance).expect("a list of devices");
    let device = all.iter().find(|c| c.statistics).unwrap_or_else(|| panic!("none with statistics: {all:?}"));
    let gpu = Gpu::open_for_statistics(&instance, device, backend).expect("a device");
    let (_, made) = executables(&gpu, entry, &needs(scene)).expect("compiled");
    let most = |name: &str, least: bool| {
        let told =
            made.iter().map(|e| e.statistics.iter().find(|s| s.name == name).expect(name).value as u64);
        if least { told.min() } else { told.max() }.expect("an executable")
    };
    println!("{MARK} {} {}", most("Spilled VGPRs", false), most("Subgroups per SIMD", true));
}

/// Compiles in a process that has the driver for a card of this family. `this` is the name of the test that asks.
fn compiled(this: &str, family: &str, task: &str) -> Compiled {
    let file = std::env::var("PUMICE_SHADER_COMPILER")
        .expect("PUMICE_SHADER_COMPILER: `cargo xtask test` unpacks a driver that compiles for AMD cards, and names it so");
    let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{file}: {e}"));
    let library = text.split("\"library_path\": \"").nth(1).and_then(|t| t.split('"').next());
    let folder = Path::new(library.expect("a library_path")).parent().expect("a folder");
    let output = Command::new(std::env::current_exe().unwrap())
        .args([this, "--exact", "--include-ignored", "--nocapture"])
        .env(TASK, task)
        .env("VK_DRIVER_FILES", &file)
        .env("VK_ICD_FILENAMES", &file)
        .env("LD_LIBRARY_PATH", folder)
        .env("MESA_SHADER_CACHE_DISABLE", "true")
        .env("RADV_FORCE_FAMILY", family)
        .output()
        .expect("started");
    let said = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    let line = said.lines().find_map(|line| line.split(MARK).nth(1));
    let line = line.unwrap_or_else(|| panic!("{task} for {family}: {}\n{said}{errors}", output.status));
    println!("{family} {task}: {line}");
    let mut numbers = line.split_whitespace().map(|n| n.parse().expect("a number"));
    Compiled { spilled: numbers.next().unwrap(), subgroups: numbers.next().unwrap() }
}

/// Runs the task of a program that was started again. Returns false in the test itself.
fn is_child() -> bool {
    let Ok(task) = std::env::var(TASK) else { return false };
    compile(&task);
    true
}

fn fits(compiled: Compiled) -> bool {
    compiled.spilled == 0 && compiled.subgroups >= 4
}

#[test]
fn compute_shaders_of_few_features_fit() {
    if is_child() {
        return;
    }
    for (family, task) in [
        ("navi21", "vulkan-compute path principled"),
        ("navi31", "vulkan-compute path diffuse"),
        ("navi21", "vulkan-compute first diffuse"),
    ] {
        let made = compiled("compute_shaders_of_few_features_fit", family, task);
        assert!(fits(made), "{task} for {family}: {made:?}");
    }
}

#[test]
fn queries_of_few_features_fit() {
    if is_child() {
        return;
    }
    for (family, task) in
        [("navi31", "vulkan-query path principled"), ("navi21", "vulkan-query first principled")]
    {
        let made = compiled("queries_of_few_features_fit", family, task);
        assert!(fits(made), "{task} for {family}: {made:?}");
    }
}

/// Control: a path that is compiled for every feature, as if there were no constants of the scene, does not fit, and the check sees it.
#[test]
#[ignore = "full: the compiler takes a minute for every feature"]
fn every_feature_at_once_does_not_fit() {
    if is_child() {
        return;
    }
    let made = compiled("every_feature_at_once_does_not_fit", "navi31", "vulkan-query path all");
    assert!(!fits(made), "{made:?}");
}

//! Measures, part by part, how much a renderer saves by leaving out parts that a scene does not need (tables, structures, shader code).
//! The scenes are minimal ones of a volume, with all of its labels and with some. `pumice render --explain` measures any scene in the same
//! way ([`pumice_session::savings`]).

pub(crate) mod command;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pumice_core::{CompressedVolume, CompressionLevel, Job};
use pumice_formats::OpenOptions;
use pumice_scene::{Environment, Material, Scene, Show, World};
use pumice_session::error::Result;
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::open::{Residence, open_volume};
use pumice_session::savings::{
    Both, OpeningSaved, Savings, SavingsOptions, Spread, measure_opening, measure_savings,
};
use pumice_session::selection::select_labels;
use pumice_transport::LoadedScene;
use serde::Serialize;

use crate::files::{file_name, scratch, write_results};
use crate::table::quoted;

/// Options of [`measure_needs`].
#[derive(Clone, Debug)]
pub struct NeedsOptions {
    /// Label volume or `.pumice` file.
    pub volume: PathBuf,
    /// Name of the backend.
    pub backend: String,
    /// Number of labels in the second scene, the longest ones.
    pub show: usize,
    /// Rounds, and pixels along the longer side of the picture.
    pub how: SavingsOptions,
}

/// Measurements of one scene.
#[derive(Clone, Debug, Serialize)]
pub struct NeedsScene {
    /// The volume's file name without its folder.
    pub volume: String,
    /// Description of the scene.
    pub scene: String,
    /// For each level of the file: savings of opening only the shown labels. Empty if the scene shows all labels.
    pub opening: Vec<(&'static str, OpeningSaved)>,
    /// Savings of each part.
    pub savings: Savings,
}

/// Measures two minimal scenes of a volume: with all of its labels, and with some.
///
/// # Errors
/// Errors of the file and of the renderer.
pub fn measure_needs(
    options: &NeedsOptions,
    job: &Job,
    watch: &mut dyn FnMut(&str),
) -> Result<Vec<NeedsScene>> {
    let volume = open_volume(&options.volume, &OpenOptions::default(), Residence::Copied, job)?;
    let all = volume.labels().len();
    let chosen = select_labels(&volume, options.show);
    let mut scenes = Vec::new();
    for (name, labels) in [
        (format!("all {all} labels, matte, under an even sky"), None),
        (format!("{} of {all} labels, matte, under an even sky", chosen.len()), Some(chosen)),
    ] {
        let scene = minimal(&volume, labels, options.how.side);
        let mut told = |part: &str| watch(&format!("{name}: {part}"));
        let show = &scene.instances[0].style.show;
        let opening =
            if *show == Show::All { Vec::new() } else { openings(&volume, show, &options.how, job)? };
        let loaded = LoadedScene::new(scene, vec![Arc::clone(&volume)], vec![])?;
        let savings = measure_savings(&loaded, &options.backend, &options.how, job, &mut told)?;
        scenes.push(NeedsScene { volume: file_name(&options.volume), scene: name, opening, savings });
    }
    Ok(scenes)
}

/// Saves the volume at the two levels whose files open differently, and measures opening each.
fn openings(
    volume: &CompressedVolume,
    show: &Show,
    how: &SavingsOptions,
    job: &Job,
) -> Result<Vec<(&'static str, OpeningSaved)>> {
    let folder = scratch()?;
    let mut openings = Vec::new();
    for (name, level) in [("default", CompressionLevel::Default), ("fast", CompressionLevel::Fast)] {
        let path = folder.path().join(format!("{name}.pumice"));
        volume.save(&path, level, job)?;
        openings.push((name, measure_opening(&path, &[show], &OpenOptions::default(), how.rounds, job)?.0));
    }
    Ok(openings)
}

/// A figure that needs none of the parts that a renderer can leave out.
fn minimal(volume: &CompressedVolume, labels: Option<Vec<u32>>, side: u32) -> Scene {
    let size = [side, (side * 9).div_ceil(16)];
    let options = FigureOptions { size, labels, ..FigureOptions::default() };
    let mut scene = compose(volume, "volume".into(), &options);
    scene.suns.clear();
    scene.world = World { environment: Environment::Constant { radiance: [1.0; 3] }, backdrop: None };
    let material = Material { base_color: [0.8; 3], specular: 0.0, roughness: 1.0, ..Material::default() };
    for instance in &mut scene.instances {
        instance.style.material = material;
        instance.style.auto_color = false;
        instance.style.materials.clear();
    }
    scene
}

/// Writes `needs.csv`, `needs-opening.csv` and `needs.md` into `folder`; `machine` describes the machine.
///
/// # Errors
/// When the folder or a file cannot be written.
pub fn write_needs(folder: &Path, machine: &str, scenes: &[NeedsScene]) -> Result<()> {
    write_results(
        folder,
        [
            ("needs.csv".into(), csv(scenes)),
            ("needs-opening.csv".into(), csv_of_openings(scenes)),
            ("needs.md".into(), markdown(machine, scenes)),
        ],
    )
}

fn csv(scenes: &[NeedsScene]) -> String {
    let both = |name: &str| {
        ["without", "with", "saved"]
            .map(|way| format!("{name}_{way}_low,{name}_{way},{name}_{way}_high"))
            .join(",")
    };
    let mut text = format!(
        "volume,scene,backend,device,rounds,width,height,left_out,bytes_without,bytes_with,{},first_ms_without,first_ms_with,{}\n",
        both("build_ms"),
        both("sample_ms")
    );
    for s in scenes {
        let all = &s.savings;
        for one in &all.savings {
            let [without, with] = one.bytes.values().fold([0, 0], |[a, b], [c, d]| [a + c, b + d]);
            let spread = |b: &Both| {
                let three = [b.without, b.with, b.saved];
                three.map(|s| format!("{:.4},{:.4},{:.4}", s.low, s.median, s.high)).join(",")
            };
            text += &format!(
                "{},{},{},{},{},{},{},{},{without},{with},{},{:.4},{:.4},{}\n",
                quoted(&s.volume),
                quoted(&s.scene),
                all.backend,
                quoted(&all.device),
                all.rounds,
                all.size[0],
                all.size[1],
                quoted(one.name()),
                spread(&one.build_ms),
                one.first_ms[0],
                one.first_ms[1],
                spread(&one.sample_ms)
            );
        }
    }
    text
}

fn csv_of_openings(scenes: &[NeedsScene]) -> String {
    let mut text = "volume,level,labels_shown,labels,bytes_shown,bytes,ms_shown_low,ms_shown,ms_shown_high,\
                    ms_low,ms,ms_high,ms_saved_low,ms_saved,ms_saved_high\n"
        .to_owned();
    for (scene, (level, one)) in scenes.iter().flat_map(|s| s.opening.iter().map(move |o| (s, o))) {
        let ([shown, all], [without, with]) = (one.labels, one.bytes);
        let three = [one.ms.without, one.ms.with, one.ms.saved];
        let ms = three.map(|s| format!("{:.4},{:.4},{:.4}", s.low, s.median, s.high)).join(",");
        text += &format!("{},{level},{shown},{all},{without},{with},{ms}\n", scene.volume);
    }
    text
}

fn markdown(machine: &str, scenes: &[NeedsScene]) -> String {
    let mut text = format!(
        "# needs\n\n{machine}\n\nEach part that the scene does not need, without and with it in turn (ABBA). Milliseconds are CPU time of \
         the process, medians with quartiles; *saved* is the median of the differences within rounds. Where the quartiles lie on both \
         sides of 0, no difference was found.\n"
    );
    for s in scenes {
        let all = &s.savings;
        text += &format!("\n## {}: {}, {} on {}\n\n", s.volume, s.scene, all.backend, all.device);
        if !s.opening.is_empty() {
            text += "| file, by its level | bytes in memory, all labels | those shown | opening, all labels, ms | those shown, ms |\n\
                     | --- | --- | --- | --- | --- |\n";
        }
        for (level, one) in &s.opening {
            let spread = |s: Spread| format!("{:.2} ({:.2} to {:.2})", s.median, s.low, s.high);
            let ([without, with], ms) = (one.bytes, one.ms);
            text +=
                &format!("| {level} | {with} | {without} | {} | {} |\n", spread(ms.with), spread(ms.without));
        }
        text += &format!(
            "\n{} rounds, {} × {} pixels.\n\n\
             | left out | bytes with it | bytes saved | building with it, ms | saved, ms | first sample, saved, ms | \
             a sample with it, ms | saved, ms |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n",
            all.rounds, all.size[0], all.size[1]
        );
        for one in &all.savings {
            let with: u64 = one.bytes.values().map(|[_, with]| with).sum();
            let saved =
                |b: &Both| format!("{:.2} ({:.2} to {:.2})", b.saved.median, b.saved.low, b.saved.high);
            text += &format!(
                "| {} | {with} | {} | {:.2} | {} | {:.1} | {:.2} | {} |\n",
                one.name(),
                one.bytes_saved(),
                one.build_ms.with.median,
                saved(&one.build_ms),
                one.first_ms[1] - one.first_ms[0],
                one.sample_ms.with.median,
                saved(&one.sample_ms)
            );
        }
        for (part, why) in &all.always_there {
            text += &format!("| {} | – | 0 | – | nothing: {why} | – | – | nothing |\n", part.spoken());
        }
    }
    text
}

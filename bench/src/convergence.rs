//! `pumice bench convergence`: error against run time on one scene, of Pumice beside Cycles.
//!
//! ```text
//! volume ─► figure of some labels, Lambert ─┬─► Pumice, 1, 4, 16 … samples ─► pictures ─┐
//!                                           └─► voxel faces ─► Cycles, the same ────────┼─► relMSE, FLIP ─► CSV, Markdown, SVG
//!                     both again with many samples and other seeds ─► common reference ─┘
//! ```
//! * Both programs render on all cores with the same numbers of samples, without adaptive sampling and denoising.
//! * The reference is the mean of both programs weighted by inverse variance, with seeds that no measured picture uses. The variance of
//!   its batches gives its own error, which is subtracted from every relMSE measured against it.
//! * The scene has Lambert surfaces, a constant sky and a sun, for which both programs converge to the same picture (`docs/cycles.md`).
//! * Preparation is reported separately: compressing and building in Pumice, sending the mesh and building the hierarchy in Cycles.
//!
//! [`real_light`] compares the noise of both programs in scenes with skies, lamps, metal, glass and coat.

pub(crate) mod command;
mod plot;
pub mod real_light;
mod tables;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pumice_core::{CompressedVolume, Job};
use pumice_formats::OpenOptions;
use pumice_picture::Image;
use pumice_picture::metrics::compare;
use pumice_scene::{Material, Scene};
use pumice_session::cycles::{Cycles, CyclesPicture};
use pumice_session::error::{Result, SessionError};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::measure::peak_rss_bytes;
use pumice_session::progressive::{Stop, render_until};
use pumice_session::selection::select_labels;
use pumice_session::{Residence, make_renderer, open_volume};
use pumice_transport::geometry::DetailLevel;
use pumice_transport::{LoadedScene, Renderer};
use serde::Serialize;

use crate::files::{file_name, write_results};
use crate::mean_picture::MeanPicture;
use crate::timing::{Took, clocked};

/// Seed of the first measured picture; further pictures use seeds near it, and the reference uses seeds far away.
const FIRST_SEED: u64 = 1;
const REFERENCE_SEED: u64 = 1_000;
/// Seeds and samples of two pictures that Cycles renders first: the first one's extra time over the second is preparation.
const WARM_UP: [(u64, u32); 2] = [(9_999_991, 1), (9_999_992, 1)];
/// Pictures per program over which the reference is averaged: enough to know its variance to within a third.
const BATCHES: usize = 8;

/// Options of [`measure_convergence`].
#[derive(Clone, Debug)]
pub struct ConvergenceOptions {
    /// Label volume.
    pub volume: PathBuf,
    /// A Python that has Blender as a module; without it only Pumice is measured, against its own reference.
    pub cycles: Option<PathBuf>,
    /// Number of labels shown, the longest ones.
    pub pick: usize,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Samples per pixel, in increasing order.
    pub spp: Vec<u32>,
    /// Pictures at each number of samples, each with its own seed.
    pub repeats: u32,
    /// Bounces of light, as `settings.bounces` of a scene.
    pub bounces: u32,
    /// Samples per pixel of the reference, by each program.
    pub reference_spp: u32,
}

/// Results of a program at one number of samples, averaged over the repeats.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Samples per pixel.
    pub spp: u32,
    /// Wall seconds of rendering.
    pub seconds: f64,
    /// CPU seconds of rendering, all threads.
    pub cpu_seconds: f64,
    /// relMSE against the reference, minus the reference's own.
    pub rel_mse: f64,
    /// FLIP against the reference.
    pub flip: f64,
}

/// Time and memory of a program before its first sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Preparation {
    /// Seconds before the first sample.
    #[serde(flatten)]
    pub took: Took,
    /// Peak resident set of the process while it rendered; `None` if the system does not report it.
    pub peak_bytes: Option<u64>,
    /// Resident set of the program before it received any data.
    pub base_bytes: Option<u64>,
}

/// Measurements of one program.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Program {
    /// Name and version of the program.
    pub name: String,
    /// Time and memory before the first sample.
    pub preparation: Preparation,
    /// Results for each number of samples, in increasing order.
    pub points: Vec<Point>,
}

/// All measurements of one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Convergence {
    /// The volume's file name.
    pub volume: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Bounces of light.
    pub bounces: u32,
    /// Number of voxel faces in the mesh that Cycles renders.
    pub faces: usize,
    /// The reference's own relMSE, which has been subtracted.
    pub reference_rel_mse: f64,
    /// Difference of the means of the two programs' references, in standard errors; `None` with one program.
    pub disagreement: Option<f64>,
    /// Pumice, then Cycles if it was measured.
    pub programs: Vec<Program>,
}

/// Pictures of one program, before they are compared with the reference.
struct Drawn {
    name: String,
    preparation: Preparation,
    /// Measured pictures: every repeat of every number of samples.
    pictures: Vec<Shot>,
    /// Pictures that the reference averages.
    batches: Vec<Image>,
}

/// One picture with its samples per pixel and its time.
struct Shot {
    spp: u32,
    took: Took,
    picture: Image,
}

impl From<CyclesPicture> for Shot {
    fn from(p: CyclesPicture) -> Self {
        let took = Took { seconds: p.took.seconds, cpu_seconds: p.took.cpu_seconds };
        Self { spp: p.spp, took, picture: p.picture }
    }
}

impl Drawn {
    /// Splits the pictures, which are in the order of [`schedule`], into measured ones and those of the reference.
    fn new(
        name: String,
        preparation: Preparation,
        mut pictures: Vec<Shot>,
        options: &ConvergenceOptions,
    ) -> Self {
        let batches = pictures.split_off(options.spp.len() * options.repeats as usize);
        Self { name, preparation, pictures, batches: batches.into_iter().map(|shot| shot.picture).collect() }
    }
}

/// Seeds and samples per pixel of all pictures in order: the measured ones, then those of the reference.
fn schedule(options: &ConvergenceOptions) -> Vec<(u64, u32)> {
    let measured = options.spp.iter().flat_map(|&spp| {
        (0..u64::from(options.repeats)).map(move |r| (FIRST_SEED + 31 * r + 7 * u64::from(spp), spp))
    });
    let each = options.reference_spp.div_ceil(BATCHES as u32);
    let reference = (0..BATCHES as u64).map(|b| (REFERENCE_SEED * (b + 1) + (1 << 20), each));
    measured.chain(reference).collect()
}

/// Measures one scene. `watch` is called with a line of text when a step begins.
///
/// # Errors
/// Errors of reading, rendering, or of Cycles.
pub fn measure_convergence(
    options: &ConvergenceOptions,
    job: &Job,
    watch: &mut dyn FnMut(&str),
) -> Result<Convergence> {
    // Pumice runs first, so that the process's peak memory is that of compressing and rendering.
    let base_bytes = peak_rss_bytes();
    watch("Pumice: compress, build, render");
    let ((volume, scene, mut renderer), took) = clocked(|| {
        let volume = open_volume(&options.volume, &OpenOptions::default(), Residence::Mapped, job)?;
        let scene = scene_of(&volume, options);
        let mut renderer = make_renderer("cpu")?;
        renderer.set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![])?)?;
        Ok((volume, scene, renderer))
    })?;
    let loaded = LoadedScene::new(scene, vec![volume], vec![])?;
    let pictures = drawn_by_us(&mut renderer, &loaded, &schedule(options), job)?;
    let name = format!("Pumice {}", env!("CARGO_PKG_VERSION"));
    let preparation = Preparation { took, peak_bytes: peak_rss_bytes(), base_bytes };
    let mut all = vec![Drawn::new(name, preparation, pictures, options)];
    let mut faces = 0;
    if let Some(python) = &options.cycles {
        watch("Cycles: send, build, render");
        let asked: Vec<(u64, u32)> = WARM_UP.into_iter().chain(schedule(options)).collect();
        let mut cycles = Cycles::start(python, &loaded, DetailLevel::Voxels, job)?;
        let pictures: Vec<CyclesPicture> =
            asked.into_iter().map(|(seed, spp)| cycles.picture(seed, spp, job)).collect::<Result<_>>()?;
        faces = cycles.faces() as usize;
        all.push(drawn_by_cycles(&cycles, pictures, options)?);
    }
    watch("compare");
    judged(options, faces, &all, job)
}

/// A figure of the longest labels, with materials on which both programs agree.
fn scene_of(volume: &CompressedVolume, options: &ConvergenceOptions) -> Scene {
    let labels = Some(select_labels(volume, options.pick));
    let figure = FigureOptions { size: options.size, labels, ..FigureOptions::default() };
    let mut scene = compose(volume, options.volume.clone(), &figure);
    scene.world.backdrop = None;
    scene.settings.bounces = options.bounces;
    scene.instances[0].style.material =
        Material { specular: 0.0, roughness: 1.0, ..scene.instances[0].style.material };
    scene
}

/// A picture for each seed and number of samples of the schedule.
fn drawn_by_us(
    renderer: &mut dyn Renderer,
    loaded: &LoadedScene,
    schedule: &[(u64, u32)],
    job: &Job,
) -> Result<Vec<Shot>> {
    let mut scene = loaded.scene().clone();
    let mut pictures = Vec::new();
    for &(seed, spp) in schedule {
        scene.settings.seed = seed;
        let data = (loaded.volumes().to_vec(), loaded.meshes().to_vec());
        renderer.set_scene(&LoadedScene::new(scene.clone(), data.0, data.1)?)?;
        let stop = Stop { spp: Some(spp), ..Stop::default() };
        let (_, took) = clocked(|| Ok(render_until(renderer, &stop, job, &mut |_| {})?))?;
        pictures.push(Shot { spp, took, picture: renderer.color()? });
    }
    Ok(pictures)
}

/// The pictures by Cycles; the extra time of its first picture over the second counts as preparation (see [`WARM_UP`]).
fn drawn_by_cycles(
    cycles: &Cycles,
    pictures: Vec<CyclesPicture>,
    options: &ConvergenceOptions,
) -> Result<Drawn> {
    let peak_bytes = pictures.last().map(|p| p.peak_bytes);
    let mut pictures = pictures.into_iter().map(Shot::from);
    let (Some(first), Some(second)) = (pictures.next(), pictures.next()) else {
        return Err(SessionError::Caller("Cycles drew fewer pictures than were asked for".into()));
    };
    let preparation = Preparation {
        took: Took {
            seconds: cycles.built().seconds + first.took.seconds - second.took.seconds,
            cpu_seconds: cycles.built().cpu_seconds + first.took.cpu_seconds - second.took.cpu_seconds,
        },
        peak_bytes,
        base_bytes: Some(cycles.bytes_before()),
    };
    let name = format!("Cycles in Blender {}", cycles.blender());
    Ok(Drawn::new(name, preparation, pictures.collect(), options))
}

/// Computes the errors of all pictures against the common reference.
fn judged(options: &ConvergenceOptions, faces: usize, all: &[Drawn], job: &Job) -> Result<Convergence> {
    let means: Vec<MeanPicture> = all.iter().map(|d| MeanPicture::of(&d.batches)).collect();
    // One weight per program: weights per pixel, from so few batches, would follow the noise.
    let weights: Vec<f64> = means.iter().map(|m| 1.0 / m.variances.iter().sum::<f64>().max(1e-300)).collect();
    let total: f64 = weights.iter().sum();
    let mix = |of: fn(&MeanPicture) -> &Vec<f64>, power: i32| -> Vec<f64> {
        let weighted =
            |i: usize| means.iter().zip(&weights).map(|(m, w)| of(m)[i] * (w / total).powi(power)).sum();
        (0..means[0].values.len()).map(weighted).collect()
    };
    let mixed = MeanPicture { values: mix(|m| &m.values, 1), variances: mix(|m| &m.variances, 2) };
    let reference_rel_mse = mixed.own_rel_mse();
    let disagreement = match &means[..] {
        [a, b] => Some(a.disagreement(b)),
        _ => None,
    };

    let reference = mixed.image(options.size);
    let mut programs = Vec::new();
    for drawn in all {
        let mut points = Vec::new();
        for repeats in drawn.pictures.chunks(options.repeats as usize) {
            let n = repeats.len() as f64;
            let (mut rel_mse, mut flip) = (0.0, 0.0);
            for shot in repeats {
                let found = compare(&shot.picture, &reference, None, &|| job.is_cancelled())
                    .map_err(|e| SessionError::Caller(e.to_string()))?;
                rel_mse += (found.rel_mse - reference_rel_mse) / n;
                flip += found.flip / n;
            }
            points.push(Point {
                spp: repeats[0].spp,
                seconds: repeats.iter().map(|r| r.took.seconds).sum::<f64>() / n,
                cpu_seconds: repeats.iter().map(|r| r.took.cpu_seconds).sum::<f64>() / n,
                rel_mse,
                flip,
            });
        }
        programs.push(Program { name: drawn.name.clone(), preparation: drawn.preparation, points });
    }
    Ok(Convergence {
        volume: file_name(&options.volume),
        size: options.size,
        bounces: options.bounces,
        faces,
        reference_rel_mse,
        disagreement,
        programs,
    })
}

/// Writes `convergence.csv`, `convergence.md` and an SVG for each scene into `folder`, which is created if missing. `machine` is a line
/// that describes the machine.
///
/// # Errors
/// When the folder cannot be written or there is nothing to plot.
pub fn write_convergence(folder: &Path, machine: &str, scenes: &[Convergence]) -> Result<()> {
    let mut files = vec![
        ("convergence.csv".into(), tables::csv(scenes)),
        ("convergence.md".into(), tables::markdown(machine, scenes)),
    ];
    for scene in scenes {
        let name = format!("convergence_{}_bounces.svg", scene.bounces);
        files.push((name, plot::svg(scene).map_err(SessionError::Caller)?));
    }
    write_results(folder, files)
}

impl Convergence {
    /// Ratio of Pumice's CPU seconds to those of the other program at equal error, which is the other's error at its most samples.
    /// Pumice's seconds are interpolated on logarithmic scales between its two points around that error. `None` with one program, or if
    /// noise makes an error 0 or less.
    pub fn cpu_ratio_at_equal_error(&self) -> Option<f64> {
        let [ours, theirs] = &self.programs[..] else { return None };
        let last = theirs.points.last()?;
        let curve: Vec<(f64, f64)> = ours.points.iter().map(|p| (p.cpu_seconds, p.rel_mse)).collect();
        let seconds = seconds_at(&curve, last.rel_mse)?;
        Some(seconds / last.cpu_seconds)
    }
}

/// CPU seconds at which a curve of (CPU seconds, error) reaches `error`, interpolated on logarithmic scales, and extrapolated beyond the
/// ends.
fn seconds_at(curve: &[(f64, f64)], error: f64) -> Option<f64> {
    if error <= 0.0 || curve.iter().any(|&(seconds, error)| error <= 0.0 || seconds <= 0.0) {
        return None;
    }
    let last = curve.len().checked_sub(2)?;
    let i = curve.iter().skip(1).position(|&(_, e)| e <= error).unwrap_or(last);
    let (a, b) = (curve[i], curve[i + 1]);
    let along = (error / a.1).ln() / (b.1 / a.1).ln();
    Some(a.0 * (b.0 / a.0).powf(along))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(cpu_seconds: f64, rel_mse: f64) -> Point {
        Point { spp: 1, seconds: cpu_seconds, cpu_seconds, rel_mse, flip: 0.0 }
    }

    fn both(ours: Vec<Point>, theirs: Vec<Point>) -> Convergence {
        let program = |points| Program { name: "p".into(), preparation: Preparation::default(), points };
        Convergence {
            volume: "v".into(),
            size: [4, 4],
            bounces: 1,
            faces: 6,
            reference_rel_mse: 1e-5,
            disagreement: Some(0.5),
            programs: vec![program(ours), program(theirs)],
        }
    }

    /// Errors fall as 1 / time. A program that is twice as fast needs half the time at every error, between and beyond the points.
    #[test]
    fn equal_error_is_found_between_points_and_beyond() {
        let curve = |speed: f64| [1.0, 4.0, 16.0].map(|t| point(t / speed, 0.1 / t)).to_vec();
        for their_last in [0.5, 1.0, 7.0, 16.0, 40.0] {
            let theirs = vec![point(0.1, 1.0), point(their_last, 0.1 / their_last)];
            let ratio = both(curve(2.0), theirs).cpu_ratio_at_equal_error().unwrap();
            assert!((ratio - 0.5).abs() < 1e-9, "{their_last}: {ratio}");
        }
        assert_eq!(both(curve(2.0), vec![point(1.0, -1e-9)]).cpu_ratio_at_equal_error(), None);
    }

    /// The weight of a program's reference is 1 / its variance.
    #[test]
    fn references_are_weighted_by_their_variance() {
        let image = |v: f32| Image::new(1, 1, vec![[v; 3]]);
        let drawn = |values: [f32; 2], picture: f32| Drawn {
            name: "p".into(),
            preparation: Preparation::default(),
            pictures: vec![Shot { spp: 1, took: Took::default(), picture: image(picture) }],
            batches: values.map(image).to_vec(),
        };
        // Variances 1 and 4: the reference is (4 · 2 + 1 · 7) / 5 = 3, its variance (16 · 1 + 1 · 4) / 25 = 0.8.
        let options = ConvergenceOptions {
            volume: "folder/v".into(),
            cycles: None,
            pick: 1,
            size: [1, 1],
            spp: vec![1],
            repeats: 1,
            bounces: 0,
            reference_spp: 1,
        };
        let all = [drawn([1.0, 3.0], 4.0), drawn([5.0, 9.0], 3.0)];
        let found = judged(&options, 0, &all, &Job::new()).unwrap();
        let floor = 0.8 / 9.01;
        assert!((found.reference_rel_mse - floor).abs() < 1e-9);
        assert!((found.programs[0].points[0].rel_mse - (1.0 / 9.01 - floor)).abs() < 1e-7);
        assert!((found.programs[1].points[0].rel_mse + floor).abs() < 1e-7);
        // Means 2 and 7 in three channels of one pixel, variances 1 and 4.
        assert!((found.disagreement.unwrap() - 15.0 / 15f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn seeds_of_the_reference_are_no_measured_ones() {
        let options = ConvergenceOptions {
            volume: "v".into(),
            cycles: None,
            pick: 1,
            size: [1, 1],
            spp: vec![1, 4, 16, 64, 256],
            repeats: 5,
            bounces: 0,
            reference_spp: 4096,
        };
        let all = schedule(&options);
        let (measured, reference) = all.split_at(25);
        assert!(reference.iter().all(|(seed, spp)| *spp == 512 && measured.iter().all(|m| m.0 != *seed)));
        let mut seeds: Vec<u64> = all.iter().map(|s| s.0).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), all.len());
    }
}

//! `pumice bench convergence --scenes real-light`: noise against run time in the light that artists use, of Pumice beside Cycles.
//!
//! ```text
//! volumes ─► six scenes ─┬─► Pumice, 4, 16, 64 … samples, R seeds each ─┐
//!                        └─► Cycles, the same ──────────────────────────┴─► noise, ratio with its interval ─► CSV, Markdown, SVG
//!            each scene with one kind of light, direct light … ────────────► the same, by part
//! ```
//! * The scenes are files that `pumice verify-render` takes too.
//! * Noise is the variance between pictures of other seeds; both programs are measured alike.
//! * Both render on all cores. Cycles has its light tree, which is its default and its best; adaptive sampling and the denoiser are off,
//!   because they change what a sample is and bias the picture. Its first sample goes through the middle of the pixel, so numbers of
//!   samples begin at [`LEAST_SPP`].

mod noise;
mod parts;
mod scenes;
mod skies;
mod tables;

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pumice_core::{CompressedVolume, Job};
use pumice_formats::OpenOptions;
use pumice_picture::Image;
use pumice_scene::Scene;
use pumice_session::cycles::Cycles;
use pumice_session::error::{Result, SessionError, io};
use pumice_session::{Residence, make_renderer, open_meshes, open_volume, shipped_volume};
use pumice_transport::geometry::DetailLevel;
use pumice_transport::{LoadedScene, Renderer};

pub use noise::Ratio;
pub use scenes::LightScene;

use super::{Shot, drawn_by_us, seconds_at};
use crate::files::file_name;
use crate::mean_picture::MeanPicture;
use crate::timing::Took;
use noise::{Noise, Weights};
use parts::{Part, parts_of};
pub(crate) use scenes::Figure;

pub(super) use tables::write_real_light;

/// Least number of samples per pixel: below it, most of Cycles' samples go through the middle of the pixel.
pub const LEAST_SPP: u32 = 4;
/// Seed and samples of the picture for which Cycles builds its scene; no measured picture has this seed.
const WARM_UP: (u64, u32) = (9_999_991, 1);

/// Options of [`measure_real_light`].
#[derive(Clone, Debug)]
pub struct RealLightOptions {
    /// Label volumes; see [`LightScene`] for which scene takes which.
    pub volumes: Vec<PathBuf>,
    /// A Python that has Blender as a module; without it only Pumice is measured.
    pub cycles: Option<PathBuf>,
    /// The scenes.
    pub scenes: Vec<LightScene>,
    /// Number of labels shown, the longest ones.
    pub pick: usize,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Samples per pixel, in increasing order, from [`LEAST_SPP`].
    pub spp: Vec<u32>,
    /// Pictures at each number of samples, each with its own seed; at least 2.
    pub repeats: u32,
    /// Bounces of light, as `settings.bounces` of a scene.
    pub bounces: u32,
    /// Samples per pixel at which parts of the light are measured too; `None` for the whole alone.
    pub parts_spp: Option<u32>,
}

/// Results of one program at one number of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPoint {
    /// Samples per pixel.
    pub spp: u32,
    /// Time of a picture, the mean over the seeds.
    pub took: Took,
    /// Noise: the variance of a pixel between seeds over its squared mean.
    pub noise: f64,
}

/// Results of one program on one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LightProgram {
    /// Name and version.
    pub name: String,
    /// Results by number of samples, in increasing order.
    pub points: Vec<LightPoint>,
}

/// One part of a scene's light, at [`RealLightOptions::parts_spp`] samples.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredPart {
    /// What is left of the scene.
    pub name: String,
    /// Noise of each program, in the order of [`LightResult::programs`].
    pub noise: Vec<f64>,
    /// Pumice's noise over that of Cycles.
    pub ratio: Option<Ratio>,
    /// Whether its noise is part of the whole's: it has the whole's weights.
    pub is_share: bool,
}

/// All results of one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LightResult {
    /// Name of the scene.
    pub scene: &'static str,
    /// The volume's file name.
    pub volume: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Bounces of light.
    pub bounces: u32,
    /// Number of seeds.
    pub seeds: u32,
    /// Number of voxel faces in the mesh that Cycles renders; 0 without it.
    pub faces: u64,
    /// Difference of the means of the two programs' pictures, in standard errors; `None` with one program.
    pub disagreement: Option<f64>,
    /// Pumice, then Cycles if it was measured.
    pub programs: Vec<LightProgram>,
    /// Pumice's noise over that of Cycles, for each number of samples; empty with one program.
    pub ratios: Vec<Option<Ratio>>,
    /// Parts of the light, the whole first; empty if they were not measured.
    pub parts: Vec<MeasuredPart>,
}

/// The pictures of one program at one number of samples, as their mean.
struct Level {
    spp: u32,
    took: Took,
    mean: MeanPicture,
}

/// The pictures of one program, by number of samples.
struct Drawn {
    name: String,
    faces: u64,
    levels: Vec<Level>,
}

/// Measures the scenes, which are written into `folder`. `watch` is called with a line of text when a step begins.
///
/// # Errors
/// Errors of reading, rendering, or of Cycles; a program that draws the same picture for two seeds.
pub fn measure_real_light(
    options: &RealLightOptions,
    folder: &Path,
    job: &Job,
    watch: &mut dyn FnMut(&str),
) -> Result<Vec<LightResult>> {
    std::fs::create_dir_all(folder).map_err(io(folder))?;
    let figure = Figure { size: options.size, pick: options.pick, bounces: options.bounces };
    let mut results = Vec::new();
    each_scene(&options.scenes, &options.volumes, figure, folder, job, &mut |name, scene, volume| {
        let mut said = |step: &str| watch(&format!("{name}: {step}"));
        results.push(measure_scene(options, name, scene, volume, job, &mut said)?);
        Ok(())
    })?;
    Ok(results)
}

/// What is done with a scene, whose name, fields and volume it gets.
type EachScene<'a> = dyn FnMut(&'static str, &Scene, &Arc<CompressedVolume>) -> Result<()> + 'a;

/// Calls `each` with some of the scenes, which are written into `folder`. Each volume is opened once.
///
/// # Errors
/// Errors of reading and writing, and those of `each`.
pub(crate) fn each_scene(
    scenes: &[LightScene],
    volumes: &[PathBuf],
    figure: Figure,
    folder: &Path,
    job: &Job,
    each: &mut EachScene<'_>,
) -> Result<()> {
    let folder = folder.canonicalize().map_err(io(folder))?;
    let mut opened: BTreeMap<usize, (PathBuf, Arc<CompressedVolume>)> = BTreeMap::new();
    for which in scenes {
        let place = which.volume() % volumes.len().max(1);
        let (source, volume) = match opened.entry(place) {
            Entry::Occupied(there) => there.into_mut(),
            Entry::Vacant(free) => {
                let path = volumes.get(place).ok_or_else(|| SessionError::Caller("no volume".into()))?;
                let volume = open_volume(path, &OpenOptions::default(), Residence::Mapped, job)?;
                free.insert((path.canonicalize().map_err(io(path))?, volume))
            }
        };
        let scene = which.write(&folder, volume, source.clone(), figure)?;
        each(which.name(), &scene, volume)?;
    }
    Ok(())
}

/// Volumes of real light, beside the shipped one: nuclei, brain regions, cortex.
const SHIPPED: [&str; 3] =
    ["platynereis_nuclei.tif", "torchio_t1_seg_gif_PIR.nii.gz", "connectomics_32x32x40nm.nrrd"];

/// The given volumes; if there are none, those of real light that the project ships.
///
/// # Errors
/// When there are none beside the program either.
pub(crate) fn volumes_or_those_of_real_light(volumes: &[PathBuf]) -> Result<Vec<PathBuf>> {
    if !volumes.is_empty() {
        return Ok(volumes.to_vec());
    }
    let cortex = shipped_volume()?;
    let folder = cortex.parent().unwrap_or(Path::new(""));
    Ok(SHIPPED.map(|name| folder.join(name)).to_vec())
}

/// Measures one scene, and its parts if they are asked for.
fn measure_scene(
    options: &RealLightOptions,
    name: &'static str,
    scene: &Scene,
    volume: &Arc<CompressedVolume>,
    job: &Job,
    watch: &mut dyn FnMut(&str),
) -> Result<LightResult> {
    let drawn = draw(options, scene, volume, &options.spp, job, watch)?;
    let weights = weights_of(&drawn);
    let width = options.size[0] as usize;
    let noise = |level: &Level| Noise::of(&level.mean, options.repeats as usize, &weights, width);
    let noises: Vec<Vec<Noise>> = drawn.iter().map(|d| d.levels.iter().map(noise).collect()).collect();
    let programs = drawn.iter().zip(&noises).map(|(program, noises)| LightProgram {
        name: program.name.clone(),
        points: (program.levels.iter().zip(noises))
            .map(|(level, noise)| LightPoint { spp: level.spp, took: level.took, noise: noise.mean() })
            .collect(),
    });
    let ratios = match &noises[..] {
        [ours, theirs] => ours.iter().zip(theirs).map(|(a, b)| a.over(b)).collect(),
        _ => Vec::new(),
    };
    let disagreement = match &drawn[..] {
        [Drawn { levels: ours, .. }, Drawn { levels: theirs, .. }] => {
            ours.last().zip(theirs.last()).map(|(a, b)| a.mean.disagreement(&b.mean))
        }
        _ => None,
    };
    Ok(LightResult {
        scene: name,
        volume: scene.instances.first().map(|i| file_name(&i.source)).unwrap_or_default(),
        size: options.size,
        bounces: options.bounces,
        seeds: options.repeats,
        faces: drawn.last().map_or(0, |d| d.faces),
        disagreement,
        programs: programs.collect(),
        ratios,
        parts: match options.parts_spp {
            Some(spp) => measure_parts(options, scene, volume, spp, job, watch)?,
            None => Vec::new(),
        },
    })
}

/// Measures the whole and its parts with `spp` samples. Parts that share the picture's light have the whole's weights, so that their noise
/// adds up.
fn measure_parts(
    options: &RealLightOptions,
    scene: &Scene,
    volume: &Arc<CompressedVolume>,
    spp: u32,
    job: &Job,
    watch: &mut dyn FnMut(&str),
) -> Result<Vec<MeasuredPart>> {
    let mut of_whole = None;
    let mut measured = Vec::new();
    for Part { name, scene, is_share } in parts_of(scene)? {
        let mut said = |step: &str| watch(&format!("{name}: {step}"));
        let drawn = draw(options, &scene, volume, &[spp], job, &mut said)?;
        let own = weights_of(&drawn);
        let weights = if is_share { &*of_whole.get_or_insert(own) } else { &own };
        let noise = |level: &Level| {
            Noise::of(&level.mean, options.repeats as usize, weights, options.size[0] as usize)
        };
        let noises: Vec<Noise> = drawn.iter().flat_map(|d| d.levels.iter().map(noise)).collect();
        let ratio = match &noises[..] {
            [ours, theirs] => ours.over(theirs),
            _ => None,
        };
        measured.push(MeasuredPart {
            name,
            noise: noises.iter().map(Noise::mean).collect(),
            ratio,
            is_share,
        });
    }
    Ok(measured)
}

/// Seeds and samples of all pictures; no two have the same seed.
fn schedule(spp: &[u32], repeats: u32) -> Vec<(u64, u32)> {
    let each = spp.iter().flat_map(|&spp| (0..repeats).map(move |_| spp));
    (1..).zip(each).collect()
}

/// The pictures by both programs.
fn draw(
    options: &RealLightOptions,
    scene: &Scene,
    volume: &Arc<CompressedVolume>,
    spp: &[u32],
    job: &Job,
    watch: &mut dyn FnMut(&str),
) -> Result<Vec<Drawn>> {
    let schedule = schedule(spp, options.repeats);
    let loaded = LoadedScene::new(scene.clone(), vec![Arc::clone(volume)], open_meshes(scene)?)?;
    watch("Pumice");
    let mut renderer = make_renderer("cpu")?;
    renderer.set_scene(&loaded)?;
    let shots = drawn_by_us(&mut renderer, &loaded, &schedule, job)?;
    drop(renderer);
    let name = format!("Pumice {}", env!("CARGO_PKG_VERSION"));
    let mut all = vec![Drawn { levels: levels(&name, &shots, options.repeats)?, name, faces: 0 }];
    if let Some(python) = &options.cycles {
        watch("Cycles");
        let mut cycles = Cycles::start(python, &loaded, DetailLevel::Voxels, job)?;
        cycles.picture(WARM_UP.0, WARM_UP.1, job)?;
        let shots: Vec<Shot> = schedule
            .iter()
            .map(|&(seed, spp)| cycles.picture(seed, spp, job).map(Shot::from))
            .collect::<Result<_>>()?;
        let name = format!("Cycles in Blender {}", cycles.blender());
        all.push(Drawn { levels: levels(&name, &shots, options.repeats)?, name, faces: cycles.faces() });
    }
    Ok(all)
}

/// The means of each `repeats` pictures.
///
/// # Errors
/// When two pictures of different seeds are equal: then the program ignores seeds, and would have no noise.
fn levels(name: &str, shots: &[Shot], repeats: u32) -> Result<Vec<Level>> {
    let of_level = |shots: &[Shot]| {
        if shots.windows(2).any(|pair| pair[0].picture == pair[1].picture) {
            return Err(SessionError::Caller(format!(
                "{name}: expected another picture for each seed, got equal ones at {} samples",
                shots[0].spp
            )));
        }
        let n = shots.len() as f64;
        let took = shots.iter().map(|s| s.took).fold(Took::default(), |a, b| a + b);
        let pictures: Vec<Image> = shots.iter().map(|s| s.picture.clone()).collect();
        Ok(Level {
            spp: shots[0].spp,
            took: Took { seconds: took.seconds / n, cpu_seconds: took.cpu_seconds / n },
            mean: MeanPicture::of(&pictures),
        })
    };
    shots.chunks(repeats as usize).map(of_level).collect()
}

/// Weights by the pictures of the most samples, each program counted once.
fn weights_of(drawn: &[Drawn]) -> Weights {
    let means: Vec<&MeanPicture> = drawn.iter().filter_map(|d| d.levels.last()).map(|l| &l.mean).collect();
    Weights::of(&means)
}

impl LightProgram {
    /// CPU seconds of one more sample per pixel: between the fewest and the most samples, so that what a render costs before its first
    /// sample does not count. `None` with one number of samples.
    pub fn cpu_seconds_a_sample(&self) -> Option<f64> {
        let (first, last) = (self.points.first()?, self.points.last()?);
        let more = last.spp - first.spp;
        (more > 0).then(|| (last.took.cpu_seconds - first.took.cpu_seconds) / f64::from(more))
    }

    /// CPU seconds at which its noise is `noise`, interpolated on logarithmic scales between its points and extrapolated beyond.
    pub fn cpu_seconds_at(&self, noise: f64) -> Option<f64> {
        let curve: Vec<(f64, f64)> = self.points.iter().map(|p| (p.took.cpu_seconds, p.noise)).collect();
        seconds_at(&curve, noise)
    }
}

impl LightResult {
    /// Pumice's CPU seconds at the noise that Cycles has at its point number `level`, over those of Cycles there.
    pub fn cpu_ratio_at_equal_noise(&self, level: usize) -> Option<f64> {
        let [ours, theirs] = &self.programs[..] else { return None };
        let point = theirs.points.get(level)?;
        Some(ours.cpu_seconds_at(point.noise)? / point.took.cpu_seconds)
    }

    /// Ratio of the CPU seconds of a sample, Pumice's over Cycles'.
    pub fn cpu_ratio_a_sample(&self) -> Option<f64> {
        let [ours, theirs] = &self.programs[..] else { return None };
        let (ours, theirs) = (ours.cpu_seconds_a_sample()?, theirs.cpu_seconds_a_sample()?);
        (theirs > 0.0).then(|| ours / theirs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shot(value: f32, spp: u32) -> Shot {
        Shot {
            spp,
            took: Took { seconds: 1.0, cpu_seconds: f64::from(spp) },
            picture: Image::new(1, 1, vec![[value; 3]]),
        }
    }

    #[test]
    fn no_two_pictures_share_a_seed() {
        let all = schedule(&[4, 16, 64], 5);
        let mut seeds: Vec<u64> = all.iter().map(|s| s.0).collect();
        seeds.dedup();
        assert_eq!((seeds.len(), all[5], all[14].1), (15, (6, 16), 64));
        assert!(!seeds.contains(&WARM_UP.0));
    }

    #[test]
    fn a_program_that_ignores_seeds_is_refused() {
        let shots = [shot(0.5, 4), shot(0.6, 4), shot(0.7, 16), shot(0.7, 16)];
        let said = levels("P", &shots, 2).err().unwrap().to_string();
        assert_eq!(said, "P: expected another picture for each seed, got equal ones at 16 samples");
        let fine = levels("P", &[shot(1.0, 4), shot(3.0, 4)], 2).unwrap();
        assert_eq!(
            (fine[0].mean.values[0], fine[0].mean.variances[0], fine[0].took.cpu_seconds),
            (2.0, 1.0, 4.0)
        );
    }

    /// Theirs costs 1 + n seconds and has the noise 1/n; ours costs n / 2 and has the noise 2/n, so at equal noise it needs n.
    #[test]
    fn equal_noise_is_found_beside_what_a_sample_costs() {
        let program = |cost: fn(f64) -> f64, noise: f64| LightProgram {
            name: "p".into(),
            points: [4u32, 16, 64]
                .map(|spp| {
                    let n = f64::from(spp);
                    LightPoint { spp, took: Took { seconds: 0.0, cpu_seconds: cost(n) }, noise: noise / n }
                })
                .to_vec(),
        };
        let result = LightResult {
            scene: "s",
            volume: "v".into(),
            size: [1, 1],
            bounces: 1,
            seeds: 2,
            faces: 0,
            disagreement: None,
            programs: vec![program(|n| n / 2.0, 2.0), program(|n| n + 1.0, 1.0)],
            ratios: Vec::new(),
            parts: Vec::new(),
        };
        assert!((result.cpu_ratio_a_sample().unwrap() - 0.5).abs() < 1e-12);
        for (level, n) in [4.0, 16.0, 64.0].into_iter().enumerate() {
            let ratio = result.cpu_ratio_at_equal_noise(level).unwrap();
            assert!((ratio - n / (n + 1.0)).abs() < 1e-9, "{n}: {ratio}");
        }
        let alone = LightResult { programs: result.programs[..1].to_vec(), ..result };
        assert_eq!((alone.cpu_ratio_a_sample(), alone.cpu_ratio_at_equal_noise(0)), (None, None));
    }
}

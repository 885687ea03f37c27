//! `pumice bench lod`: gain and cost of coarser levels of detail, as picture error against frame time and resident bytes.
//!
//! ```text
//! volume ─► file of the fast level, mapped ─► figure of some labels, rendered at voxels, cells, boxes and by distance:
//!     each level with the file for itself  bytes of the file that were read, bytes of what rays need, CPU seconds of building
//!     1, 4, 16 … samples, levels in turn   CPU seconds; relMSE and FLIP against voxels with many samples
//!     many samples                         the level's own error, with the noise subtracted
//! ```
//! Several picture sizes are measured, because the size of a voxel in pixels decides the cost of a level. A small picture stands for a
//! distant camera.

pub(crate) mod command;
mod tables;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pumice_core::{CompressedVolume, CompressionLevel, Job};
use pumice_formats::OpenOptions;
use pumice_picture::Image;
use pumice_picture::metrics::compare;
use pumice_scene::{Lod, Scene};
use pumice_session::backend::{FallbackRenderer, make_renderer};
use pumice_session::error::{Result, SessionError};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::measure::resident_file_bytes;
use pumice_session::progressive::{Stop, render_until};
use pumice_session::selection::select_labels;
use pumice_session::{Residence, open_volume};
use pumice_transport::{LoadedScene, Renderer};
use serde::Serialize;

use crate::convergence::Point;
use crate::files::{file_name, scratch};
use crate::mean_picture::MeanPicture;
use crate::timing::clocked;

pub use tables::write_lod;

/// The levels of detail. The first, voxels, is the reference.
pub const LEVELS: [(&str, Lod); 4] = [
    ("voxels", Lod::Voxels),
    ("by distance", Lod::Distance { pixels: 1.0 }),
    ("cells of 4³", Lod::Cells),
    ("boxes of 16³", Lod::Boxes),
];

/// Pictures over which a level's mean is taken: enough to know its variance to within a third.
const BATCHES: u64 = 8;
/// Samples per pixel after which the touched bytes of the file are counted; paths have reached about everything by then.
const TOUCHING_SPP: u32 = 4;

/// Options of [`measure_lod`].
#[derive(Clone, Debug)]
pub struct LodOptions {
    /// Label volume or `.pumice` file.
    pub volume: PathBuf,
    /// Number of labels shown, the longest ones.
    pub pick: usize,
    /// Width and height of each picture in pixels.
    pub sizes: Vec<[u32; 2]>,
    /// Samples per pixel, in increasing order.
    pub spp: Vec<u32>,
    /// Pictures at each number of samples, each with its own seed.
    pub repeats: u32,
    /// Samples per pixel of each level's mean.
    pub reference_spp: u32,
}

/// Measurements of one level in pictures of one size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LevelFigures {
    /// Name of the level in [`LEVELS`].
    pub name: &'static str,
    /// CPU seconds from an open volume until the renderer can take its first sample.
    pub build_cpu_seconds: f64,
    /// CPU seconds of one sample per pixel, measured at the largest number of samples.
    pub frame_cpu_seconds: f64,
    /// Bytes that the renderer holds: bricks, or a hierarchy over the boxes where levels differ within one picture, film and tables.
    pub bytes_held: u64,
    /// Bytes of the volume's file that were in memory after a few samples; `None` if the system does not report it.
    pub bytes_touched: Option<u64>,
    /// The level's own error: relMSE of its mean against that of the voxels, with the noise subtracted. `None` for the voxels.
    pub rel_mse: Option<f64>,
    /// FLIP between the two means; `None` for the voxels.
    pub flip: Option<f64>,
    /// Errors of pictures with increasing numbers of samples, minus the reference's own error.
    pub points: Vec<Point>,
}

/// All levels in pictures of one size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LodTable {
    /// The volume's file name.
    pub volume: String,
    /// Voxels along x, y and z.
    pub dims: [u32; 3],
    /// Bytes of its file that can be mapped.
    pub bytes_mapped: u64,
    /// Width and height of the pictures in pixels.
    pub size: [u32; 2],
    /// Number of labels shown.
    pub labels: usize,
    /// The reference's own relMSE, which has been subtracted.
    pub reference_rel_mse: f64,
    /// Measurements of each level, in the order of [`LEVELS`].
    pub levels: Vec<LevelFigures>,
}

/// Measures a volume and returns a table for each picture size. `watch` is called with a line of text when a step begins.
///
/// # Errors
/// Errors of reading, of saving a temporary file, or of rendering.
pub fn measure_lod(options: &LodOptions, job: &Job, watch: &mut dyn FnMut(&str)) -> Result<Vec<LodTable>> {
    let folder = scratch()?;
    let path = folder.path().join("volume.pumice");
    watch("open");
    open_volume(&options.volume, &OpenOptions::default(), Residence::Copied, job)?.save(
        &path,
        CompressionLevel::Fast,
        job,
    )?;
    let mut tables = Vec::new();
    for &size in &options.sizes {
        watch(&format!("{} × {}", size[0], size[1]));
        tables.push(measured(&path, size, options, job)?);
    }
    Ok(tables)
}

fn opened(path: &Path, job: &Job) -> Result<Arc<CompressedVolume>> {
    open_volume(path, &OpenOptions::default(), Residence::Mapped, job)
}

fn measured(path: &Path, size: [u32; 2], options: &LodOptions, job: &Job) -> Result<LodTable> {
    let volume = opened(path, job)?;
    let labels = select_labels(&volume, options.pick);
    let figure = FigureOptions { size, labels: Some(labels.clone()), ..FigureOptions::default() };
    let mut scene = compose(&volume, options.volume.clone(), &figure);
    // Without a backdrop, pixels that show no label are equal at all levels and add no error.
    scene.world.backdrop = None;
    let (dims, bytes_mapped) = (volume.info().dims, volume.mapped_bytes());
    drop(volume);

    let mut levels = Vec::new();
    for (name, lod) in LEVELS {
        scene.settings.lod = lod;
        levels.push(alone(name, path, &scene, job)?);
    }

    let volume = opened(path, job)?;
    let mut renderers = Vec::new();
    for (_, lod) in LEVELS {
        scene.settings.lod = lod;
        let mut renderer = make_renderer("cpu")?;
        renderer.set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![])?)?;
        renderers.push(renderer);
    }
    let mut draw = |renderer: &mut FallbackRenderer, lod: Lod, seed: u64, spp: u32| {
        scene.settings.lod = lod;
        scene.settings.seed = seed;
        renderer.set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![])?)?;
        let stop = Stop { spp: Some(spp), ..Stop::default() };
        let (_, took) = clocked(|| Ok(render_until(renderer, &stop, job, &mut |_| {})?))?;
        Ok::<_, SessionError>((took, renderer.color()?))
    };

    // Seeds of the means are far from those of the measured pictures.
    let each = options.reference_spp.div_ceil(BATCHES as u32);
    let mut means = Vec::new();
    for (level, (renderer, (_, lod))) in renderers.iter_mut().zip(LEVELS).enumerate() {
        let mut batches = Vec::new();
        for b in 0..BATCHES {
            // Each level has its own seeds, so the noise of two means is independent and its expected effect can be subtracted.
            let seed = (1 << 20) + BATCHES * level as u64 + b;
            batches.push(draw(renderer, lod, seed, each)?.1);
        }
        means.push(MeanPicture::of(&batches));
    }
    let reference = means[0].image(size);
    let judge = |picture: &Image| {
        compare(picture, &reference, None, &|| job.is_cancelled())
            .map_err(|e| SessionError::Caller(e.to_string()))
    };
    for (level, mean) in levels.iter_mut().zip(&means).skip(1) {
        level.rel_mse = Some(mean.rel_mse_without_noise(&means[0]));
        level.flip = Some(judge(&mean.image(size))?.flip);
    }

    let own = means[0].own_rel_mse();
    let n = f64::from(options.repeats);
    for &spp in &options.spp {
        let mut points = vec![Point { spp, seconds: 0.0, cpu_seconds: 0.0, rel_mse: -own, flip: 0.0 }; 4];
        for repeat in 0..u64::from(options.repeats) {
            for (i, (_, lod)) in LEVELS.into_iter().enumerate() {
                let seed = 1 + 31 * repeat + 7 * u64::from(spp);
                let (took, picture) = draw(&mut renderers[i], lod, seed, spp)?;
                let found = judge(&picture)?;
                let p = &mut points[i];
                p.seconds += took.seconds / n;
                p.cpu_seconds += took.cpu_seconds / n;
                (p.rel_mse, p.flip) = (p.rel_mse + found.rel_mse / n, p.flip + found.flip / n);
            }
        }
        for (level, point) in levels.iter_mut().zip(points) {
            level.frame_cpu_seconds = point.cpu_seconds / f64::from(spp);
            level.points.push(point);
        }
    }
    Ok(LodTable {
        volume: file_name(&options.volume),
        dims,
        bytes_mapped,
        size,
        labels: labels.len(),
        reference_rel_mse: own,
        levels,
    })
}

/// Measures the bytes that a level holds and touches, with a renderer that has the file for itself.
fn alone(name: &'static str, path: &Path, scene: &Scene, job: &Job) -> Result<LevelFigures> {
    let volume = opened(path, job)?;
    let mut renderer = make_renderer("cpu")?;
    let loaded = LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![])?;
    let ((), building) = clocked(|| Ok(renderer.set_scene(&loaded)?))?;
    render_until(&mut renderer, &Stop { spp: Some(TOUCHING_SPP), ..Stop::default() }, job, &mut |_| {})?;
    Ok(LevelFigures {
        name,
        build_cpu_seconds: building.cpu_seconds,
        frame_cpu_seconds: 0.0,
        bytes_held: renderer.bytes().iter().map(|(_, bytes)| bytes).sum(),
        bytes_touched: resident_file_bytes(path),
        rel_mse: None,
        flip: None,
        points: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use pumice_core::{LabelBuffer, LabelType, VolumeInfo, compress_labels};

    use super::*;

    /// An opened, mapped file is hardly in memory. Reading one box brings in a little of it, and decoding the volume nearly all.
    #[test]
    #[cfg(target_os = "linux")]
    fn a_mapped_file_comes_in_as_it_is_used() {
        // Noise takes eight bytes per cell, and no two boxes are equal.
        let mut s = 1u64;
        let mut voxel = || {
            s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (s >> 63) as u8
        };
        let dims = [224; 3];
        let ids = (0..dims[0] * dims[1] * dims[2]).map(|_| voxel()).collect();
        let volume = compress_labels(VolumeInfo::new(dims, LabelType::U8), LabelBuffer::U8(ids)).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("v.pumice");
        volume.save(&path, CompressionLevel::Fast, &Job::new()).unwrap();
        let mapped = opened(&path, &Job::new()).unwrap();
        let all = mapped.mapped_bytes();
        let resident = || resident_file_bytes(&path).unwrap();
        assert!(all > 1_000_000 && resident() < all / 4, "{} of {all}", resident());
        mapped.get_box(0);
        let one = resident();
        assert!(one > 0 && one < all / 4, "{one} of {all}");
        mapped.decode_block([0; 3], mapped.info().dims).unwrap();
        assert!(resident() > all * 9 / 10, "{} of {all}", resident());
        drop(mapped);
        assert_eq!(resident_file_bytes(&path), Some(0));
    }
}

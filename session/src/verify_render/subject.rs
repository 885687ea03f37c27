//! The scene that both programs draw: what is changed so that they draw the same, and the surface that memory allows.

use std::path::Path;

use pumice_core::Job;
use pumice_core::memory::available_bytes;
use pumice_export::for_each_cut_block;
use pumice_picture::{Pass, Passes};
use pumice_scene::{Filter, Lod, Mode, Scene};
use pumice_transport::LoadedScene;
use pumice_transport::geometry::DetailLevel;

use super::{MOST_PIXELS, VerifyRenderRequest};
use crate::cycles::faces_of;
use crate::error::{Result, SessionError};
use crate::open::Residence;
use crate::render_file::open_scene::{OpenedScene, open_scene};

/// Bytes of Blender's process for each face, in the mesh and in Cycles' hierarchy (measured: 0.52 kB, with a tenth to spare), and without
/// any.
const BYTES_A_FACE: u64 = 570;
const BYTES_OF_BLENDER: u64 = 400 << 20;

/// The scene, ready for both.
pub(super) struct Subject {
    pub(super) scene: LoadedScene,
    pub(super) level: DetailLevel,
    pub(super) notes: Vec<String>,
}

impl Subject {
    /// Opens and adapts a scene for a request.
    ///
    /// # Errors
    /// What the scene has and Cycles has not; [`pumice_core::Error::Limit`] where even the coarsest surface takes too much memory.
    pub(super) fn new(request: &VerifyRenderRequest, input: &Path, job: &Job) -> Result<Self> {
        let opened = open_scene(input, &request.overrides, &request.reading, Residence::Mapped, job)?;
        let OpenedScene { mut scene, volumes, meshes } = opened;
        let mut notes = Vec::new();
        refuse(&scene)?;
        adapt(&mut scene, request.overrides.size.is_none(), &mut notes);
        let loaded = LoadedScene::new(scene, volumes, meshes)?;
        let level = level(request, &loaded, &mut notes, job)?;
        let mut scene = loaded.scene().clone();
        scene.settings.lod = match level {
            DetailLevel::Voxels => Lod::Voxels,
            DetailLevel::Cells => Lod::Cells,
            DetailLevel::Boxes => Lod::Boxes,
        };
        let scene = LoadedScene::new(scene, loaded.volumes().to_vec(), loaded.meshes().to_vec())?;
        Ok(Self { scene, level, notes })
    }

    pub(super) fn surface(&self) -> &'static str {
        name(self.level)
    }
}

fn name(level: DetailLevel) -> &'static str {
    match level {
        DetailLevel::Voxels => "voxels",
        DetailLevel::Cells => "cells of 4³ voxels",
        DetailLevel::Boxes => "boxes",
    }
}

/// Refuses what Cycles has no equal of.
fn refuse(scene: &Scene) -> Result<()> {
    let what = if scene.settings.mode != Mode::Path {
        "settings.mode: only path traced light can be compared with Cycles".to_owned()
    } else if let Filter::Box { width } = scene.film.filter
        && width != 1.0
    {
        format!("film.filter: Cycles has a box of 1 pixel alone, got {width}")
    } else {
        return Ok(());
    };
    Err(SessionError::Caller(what))
}

/// Changes what would make the comparison meaningless or slow, and notes it.
fn adapt(scene: &mut Scene, may_shrink: bool, notes: &mut Vec<String>) {
    if scene.world.backdrop.take().is_some() {
        notes.push("The backdrop is left out: Cycles has none. The world is seen behind the scene.".into());
    }
    if scene.settings.adaptive.take().is_some() {
        notes.push("Pixels do not rest: adaptive sampling is biased, and is off in both.".into());
    }
    if std::mem::take(&mut scene.film.shadow_fade) > 0.0 {
        notes
            .push("Shadows on shadow catchers do not fade toward the border: those of Cycles do not.".into());
    }
    scene.film.half = false;
    // Only shadows that are a pass of their own change what the picture is.
    let catcher = scene.film.passes.has(Pass::ShadowCatcher);
    scene.film.passes = if catcher { Passes::NONE.with(Pass::ShadowCatcher) } else { Passes::NONE };
    if scene.film.transparent {
        notes.push("The film is transparent: both pictures are laid over white.".into());
    }
    let pixels = f64::from(scene.film.width) * f64::from(scene.film.height);
    if may_shrink && pixels > MOST_PIXELS {
        let before = [scene.film.width, scene.film.height];
        let factor = (MOST_PIXELS / pixels).sqrt();
        let smaller = |n: u32| ((f64::from(n) * factor).round() as u32).max(1);
        [scene.film.width, scene.film.height] = before.map(smaller);
        let after = [scene.film.width, scene.film.height];
        notes.push(format!(
            "The pictures have {} × {} pixels instead of {} × {}; another size can be asked for.",
            after[0], after[1], before[0], before[1]
        ));
    }
}

/// The level that was asked for, or the finest whose faces fit into memory.
fn level(
    request: &VerifyRenderRequest,
    scene: &LoadedScene,
    notes: &mut Vec<String>,
    job: &Job,
) -> Result<DetailLevel> {
    let limit = request.memory_limit.or_else(|| available_bytes().map(|free| free / 4 * 3));
    let limit = limit.unwrap_or(u64::MAX);
    let mut levels = vec![DetailLevel::Voxels, DetailLevel::Cells, DetailLevel::Boxes];
    if let Some(level) = request.level {
        levels = vec![level];
    }
    let mut needed = 0;
    for (tried, &level) in levels.iter().enumerate() {
        needed = BYTES_OF_BLENDER + BYTES_A_FACE * faces(scene, level, job)?;
        if needed <= limit {
            if tried > 0 {
                notes.push(format!(
                    "Both draw {} instead of voxels, whose faces would take more memory in Cycles than there is.",
                    name(level)
                ));
            }
            return Ok(level);
        }
    }
    let what = "bytes of memory for Cycles; fewer labels or a coarser level of detail need less".into();
    Err(pumice_core::Error::Limit { what, limit, got: needed }.into())
}

fn faces(scene: &LoadedScene, level: DetailLevel, job: &Job) -> Result<u64> {
    let mut faces = 0;
    for (place, volume) in scene.volumes().iter().enumerate() {
        let (visible, drawn) = (scene.visible(place), faces_of(&scene.scene().instances[place]));
        for_each_cut_block(volume, &visible, level, drawn, &[], job, |whole, _| {
            faces += whole.len() as u64;
            Ok(())
        })?;
    }
    Ok(faces)
}

#[cfg(test)]
mod tests {
    use pumice_core::{LabelBuffer, LabelType, VolumeInfo, compress_labels};

    use super::*;
    use crate::figure::{FigureOptions, compose};

    /// Cycles' shadows reach the border, so Pumice's must in a comparison, and the page says that they do.
    #[test]
    fn the_shadows_of_a_floor_do_not_fade() {
        let labels = LabelBuffer::U8(vec![5; 64]);
        let volume = compress_labels(VolumeInfo::new([4; 3], LabelType::U8), labels).unwrap();
        for (floor, expected) in [(true, 1), (false, 0)] {
            let options = FigureOptions { floor, ..FigureOptions::default() };
            let mut scene = compose(&volume, "memory".into(), &options);
            assert_eq!(scene.film.shadow_fade > 0.0, floor);
            let mut notes = Vec::new();
            adapt(&mut scene, false, &mut notes);
            assert_eq!(scene.film.shadow_fade, 0.0);
            assert_eq!(
                notes.iter().filter(|note| note.contains("do not fade")).count(),
                expected,
                "{notes:?}"
            );
        }
    }
}

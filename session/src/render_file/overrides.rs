//! Applies the caller's overrides to the scene.

use std::sync::Arc;

use pumice_core::CompressedVolume;
use pumice_scene::{Adaptive, Film, Mode, Scene, Show};

use super::request::RenderOverrides;
use crate::error::{Result, SessionError};

/// Default of `min_spp`: samples that every pixel gets before it may rest.
const DEFAULT_MIN_SPP: u32 = 16;

/// Gives a film another width; its height follows, rounded, so that its shape stays.
pub fn set_width(film: &mut Film, width: u32) {
    [film.width, film.height] = with_width([film.width, film.height], width);
}

fn with_width([before, height]: [u32; 2], width: u32) -> [u32; 2] {
    let height = f64::from(height) * f64::from(width) / f64::from(before.max(1));
    [width, height.round().max(1.0) as u32]
}

impl RenderOverrides {
    /// Pixels across and down of a picture that would have `size`.
    pub(super) fn pixels(&self, size: [u32; 2]) -> [u32; 2] {
        let size = self.size.unwrap_or(size);
        self.width.map_or(size, |width| with_width(size, width))
    }
}

/// Applies the overrides to the scene.
pub(super) fn apply(
    wishes: &RenderOverrides,
    scene: &mut Scene,
    volumes: &[Arc<CompressedVolume>],
) -> Result<()> {
    if wishes.size.is_some() || wishes.width.is_some() {
        [scene.film.width, scene.film.height] = wishes.pixels([scene.film.width, scene.film.height]);
    }
    if let Some(bounces) = wishes.bounces {
        scene.settings.bounces = bounces;
    }
    if let Some(mode) = wishes.mode {
        scene.settings.mode = mode;
    }
    if wishes.bounces.is_some() && scene.settings.mode != Mode::Path {
        let what = "--bounces: only the mode path has bounces; one-bounce and ao have none";
        return Err(SessionError::Caller(what.into()));
    }
    let painted =
        [("color", wishes.figure.color.is_empty()), ("material", wishes.figure.material.is_empty())];
    if let (Mode::AmbientOcclusion, Some((flag, _))) =
        (scene.settings.mode, painted.iter().find(|(_, is_none)| !is_none))
    {
        let what =
            format!("--{flag}: in the mode ao all labels are white; path and one-bounce have materials");
        return Err(SessionError::Caller(what));
    }
    if let Some(lod) = wishes.lod {
        scene.settings.lod = lod;
    }
    if let Some(seed) = wishes.seed {
        scene.settings.seed = seed;
    }
    scene.film.transparent |= wishes.transparent;
    scene.film.half |= wishes.half;
    wishes.figure.dress(scene);
    if let Some(view) = wishes.view_transform {
        scene.film.view_transform = view;
    }
    match (&mut scene.settings.adaptive, wishes.noise_threshold) {
        (Some(rule), Some(threshold)) => rule.threshold = threshold,
        (none, Some(threshold)) => *none = Some(Adaptive { threshold, min_spp: DEFAULT_MIN_SPP }),
        (_, None) => {}
    }
    match (&mut scene.settings.adaptive, wishes.min_spp) {
        (Some(rule), Some(min_spp)) => rule.min_spp = min_spp,
        (None, Some(_)) => {
            let what =
                "--min-spp: no pixel rests without --noise-threshold, or a scene with settings.adaptive";
            return Err(SessionError::Caller(what.into()));
        }
        (_, None) => {}
    }
    if let Some(ids) = &wishes.labels {
        // With several volumes, each shows the chosen labels that it has.
        for (instance, volume) in scene.instances.iter_mut().zip(volumes) {
            let held = ids.iter().copied().filter(|&id| volume.labels().index_of(id).is_some());
            instance.style.show = Show::Only(held.collect());
        }
        for &id in ids {
            if !volumes.iter().any(|v| v.labels().index_of(id).is_some()) {
                return Err(SessionError::Caller(format!("--labels: no volume has a label {id}")));
            }
        }
    }
    Ok(())
}

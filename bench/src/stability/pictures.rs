//! Renders small pictures of small volumes, and counts pixels that are not finite or negative.

use std::cell::Cell;
use std::sync::Arc;
use std::time::Duration;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::{CompressedVolume, Job};
use pumice_cpu::CpuRenderer;
use pumice_picture::{Image, Picture};
use pumice_scene::{
    Camera, Environment, Film, Filter, Instance, LabelStyle, Material, Projection, Reading, SCENE_VERSION,
    Scene, Settings, World,
};
use pumice_session::FallbackRenderer;
use pumice_session::backend::read_environment;
use pumice_session::error::{Result, SessionError};
use pumice_transport::{LoadedScene, RenderError, Renderer};

use super::Beside;

/// Pixels along each side of a picture.
pub(super) const SIDE: u32 = 12;

/// The renderer of all pictures, and a CPU renderer to compare with if the first is another backend.
pub(super) struct Studio<'a> {
    renderer: FallbackRenderer,
    processor: CpuRenderer,
    beside: &'a Cell<Option<Beside>>,
    job: &'a Job,
    pixels: u64,
    bad: u64,
}

impl<'a> Studio<'a> {
    /// `beside` collects the largest difference from the CPU's pictures, until the caller takes it.
    pub(super) fn new(renderer: FallbackRenderer, beside: &'a Cell<Option<Beside>>, job: &'a Job) -> Self {
        let processor = CpuRenderer::new(read_environment);
        Self { renderer, processor, beside, job, pixels: 0, bad: 0 }
    }

    /// Renders a picture with `spp` samples per pixel and returns its colours.
    pub(super) fn draw(
        &mut self,
        scene: &Scene,
        volume: &Arc<CompressedVolume>,
        spp: u32,
    ) -> std::result::Result<Vec<[f32; 3]>, RenderError> {
        let pixels = colors(&mut self.renderer, scene, volume, spp, self.job)?;
        self.pixels += pixels.len() as u64;
        self.bad += pixels.iter().filter(|p| p.iter().any(|v| !v.is_finite() || *v < 0.0)).count() as u64;
        if self.renderer.name() != "cpu" {
            let expected = colors(&mut self.processor, scene, volume, spp, self.job)?;
            let found = Beside::between(&pixels, &expected);
            self.beside.set(Some(self.beside.get().map_or(found, |former| former.worse(found))));
        }
        Ok(pixels)
    }

    /// [`Studio::draw`] for a scene that must not be refused.
    pub(super) fn expose(
        &mut self,
        scene: &Scene,
        volume: &Arc<CompressedVolume>,
        spp: u32,
    ) -> Result<Vec<[f32; 3]>> {
        self.draw(scene, volume, spp).map_err(SessionError::from)
    }

    /// Names of backend and device.
    pub(super) fn drawn_by(&self) -> (String, String) {
        (self.renderer.name().to_owned(), self.renderer.device().to_owned())
    }

    /// Number of pixels so far, and how many of them were not finite or negative.
    pub(super) fn looked_at(&self) -> (u64, u64) {
        (self.pixels, self.bad)
    }
}

fn colors(
    renderer: &mut dyn Renderer,
    scene: &Scene,
    volume: &Arc<CompressedVolume>,
    spp: u32,
    job: &Job,
) -> std::result::Result<Vec<[f32; 3]>, RenderError> {
    renderer.set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(volume)], vec![])?)?;
    // `advance` may return after its time slice with fewer samples, so it is called until the picture has all of them.
    let mut progress = renderer.advance(Duration::ZERO, spp, job)?;
    while progress.spp < spp {
        progress = renderer.advance(Duration::from_millis(100), spp, job)?;
    }
    Ok(renderer.color()?.pixels)
}

/// A Lambert material.
pub(super) fn lambert(albedo: f32) -> Material {
    Material { base_color: [albedo; 3], specular: 0.0, roughness: 1.0, ..Material::default() }
}

pub(super) fn sky(radiance: f32) -> Environment {
    Environment::Constant { radiance: [radiance; 3] }
}

/// A scene that shows a volume in orthographic projection from far above, looking down: `scale` index units around (x, y).
pub(super) fn from_above(material: Material, environment: Environment, at: [f64; 2], scale: f64) -> Scene {
    let translation = DVec3::new(at[0], at[1], 200.0);
    Scene {
        version: SCENE_VERSION,
        instances: vec![Instance {
            id: 1,
            source: "memory".into(),
            reading: Reading::default(),
            world_from_index: DAffine3::IDENTITY,
            style: LabelStyle { material, ..LabelStyle::default() },
        }],
        camera: Camera::new(
            DAffine3 { matrix3: DMat3::IDENTITY, translation },
            Projection::Orthographic { scale },
        ),
        film: Film::new(SIDE, SIDE, Filter::Box { width: 1.0 }),
        world: World { environment, backdrop: None },
        suns: Vec::new(),
        lights: Vec::new(),
        meshes: Vec::new(),
        cuts: Vec::new(),
        settings: Settings::default(),
    }
}

/// Largest relative difference of any channel from the expected value.
pub(super) fn worst(pixels: &[[f32; 3]], expected: f64) -> f64 {
    let off = |v: &f32| (f64::from(*v) / expected - 1.0).abs();
    pixels.iter().flatten().map(off).fold(0.0, |m, e| if e <= m { m } else { e })
}

/// Relative difference of the mean from the expected value.
pub(super) fn mean_off(pixels: &[[f32; 3]], expected: f64) -> f64 {
    mean(pixels) / expected - 1.0
}

/// By how much the mean of a grey picture exceeds the expected value beyond four standard errors of it, relative; 0 where it does not. The
/// standard error is that of the pixels' spread: rare bright samples raise it with the mean.
pub(super) fn surely_gained(pixels: &[[f32; 3]], expected: f64) -> f64 {
    let (middle, standard_error) = grey_mean(pixels);
    ((middle - 4.0 * standard_error) / expected - 1.0).max(0.0)
}

/// By how much the mean of a grey picture differs from the expected value beyond four standard errors of it, relative; 0 where it does not.
pub(super) fn surely_off(pixels: &[[f32; 3]], expected: f64) -> f64 {
    let (middle, standard_error) = grey_mean(pixels);
    let off = ((middle - expected).abs() - 4.0 * standard_error) / expected;
    // (A mean that is not a number stays one.)
    if off <= 0.0 { 0.0 } else { off }
}

/// The mean of a grey picture, and its standard error.
fn grey_mean(pixels: &[[f32; 3]]) -> (f64, f64) {
    let (n, middle) = (pixels.len() as f64, mean(pixels));
    let squares: f64 = pixels.iter().map(|p| (f64::from(p[0]) - middle).powi(2)).sum();
    (middle, (squares / (n * (n - 1.0))).sqrt())
}

pub(super) fn mean(pixels: &[[f32; 3]]) -> f64 {
    pixels.iter().flatten().map(|&v| f64::from(v)).sum::<f64>() / (3 * pixels.len()).max(1) as f64
}

/// A picture without passes.
pub(super) fn plain(color: Image) -> Picture {
    Picture::of(color)
}

#[cfg(test)]
mod tests {
    use pumice_oracle::volumes::blobs;
    use pumice_session::make_renderer;
    use pumice_session::savings::ROUNDING;

    use super::*;

    /// Ten pixels of mean 1 and standard error 0.1 / 3 gain nothing, and 0.2 less four of these errors if each is 0.2 brighter.
    #[test]
    fn what_is_surely_gained_leaves_four_standard_errors() {
        let pixels: Vec<_> = (0..10).map(|i| [if i % 2 == 0 { 0.9 } else { 1.1 }; 3]).collect();
        assert_eq!(surely_gained(&pixels, 1.0), 0.0);
        let brighter: Vec<_> = pixels.iter().map(|p| p.map(|v| v + 0.2)).collect();
        assert!((surely_gained(&brighter, 1.0) - (0.2 - 0.4 / 3.0)).abs() < 1e-6);
        let darker: Vec<_> = pixels.iter().map(|p| p.map(|v| v - 0.2)).collect();
        assert_eq!((surely_off(&pixels, 1.0), surely_gained(&darker, 1.0)), (0.0, 0.0));
        assert!((surely_off(&darker, 1.0) - (0.2 - 0.4 / 3.0)).abs() < 1e-6);
        assert!(surely_off(&[[f32::NAN; 3]; 4], 1.0).is_nan());
    }

    /// Controls: the comparison finds another seed, an albedo that is 2 % off, and fewer bounces.
    #[test]
    fn other_pictures_are_apart() {
        let (_, bodies) = blobs([24, 24, 24], 9, 4, 11);
        let (cell, job) = (Cell::new(None), Job::new());
        let mut studio = Studio::new(make_renderer("cpu").unwrap(), &cell, &job);
        let mut scene = from_above(lambert(0.8), sky(1.0), [12.0, 12.0], 20.0);
        scene.settings.bounces = 8;
        let truth = studio.expose(&scene, &bodies, 8).unwrap();
        assert_eq!(Beside::between(&truth, &truth), Beside { worst: 0.0, apart: 0.0 });
        // The CPU backend is not compared with itself.
        assert_eq!(cell.get(), None);
        let mut off = |fault: &dyn Fn(&mut Scene)| {
            let mut other = scene.clone();
            fault(&mut other);
            Beside::between(&studio.expose(&other, &bodies, 8).unwrap(), &truth)
        };
        for (name, found) in [
            ("the next seed", off(&|s| s.settings.seed += 1)),
            ("albedo 2 %", off(&|s| s.instances[0].style.material.base_color = [0.784; 3])),
            ("fewer bounces", off(&|s| s.settings.bounces = 1)),
        ] {
            assert!(!found.holds() && found.worst > ROUNDING, "{name}: {found:?}");
        }
        // A difference in the last bit of each value counts as rounding.
        let rounded: Vec<[f32; 3]> = truth.iter().map(|p| p.map(|v| v * (1.0 + f32::EPSILON))).collect();
        let found = Beside::between(&rounded, &truth);
        assert!(found.holds() && found.worst > 0.0, "{found:?}");
        // One wrong pixel in a hundred may be a path that diverged by rounding; one in ten is a failure.
        let spoiled = |count: usize, value: f32| {
            let mut pixels = truth.clone();
            pixels[..count].fill([value; 3]);
            Beside::between(&pixels, &truth)
        };
        assert!(spoiled(2, 7.0).holds() && !spoiled(15, 7.0).holds());
        assert!(!spoiled(15, f32::NAN).holds());
    }
}

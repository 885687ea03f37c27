//! A renderer that continues on the next device when its device fails.
//!
//! ```text
//!   ways:   vulkan-rt on X ──► vulkan-query on X ──► vulkan-compute on X ──► cpu
//!                    RenderError::Device: drop it, open the next, show the same scene, restart the picture, add a notice
//! ```
//! Only a device failure leads to the next way: a scene that cannot be drawn, a picture that cannot be read, or a cancelled job would
//! be the same on any other. If there is only one way, its failure is the caller's error.
//!
//! A way is opened only when the first scene is set: opening a graphics processor takes time, and a live client must not wait for it.

use std::time::Duration;

use pumice_core::Job;
use pumice_picture::{Guides, Image, Picture};
use pumice_transport::{
    CoarseFrame, LoadedScene, Pick, Progress, Rebuilt, RenderError, Renderer, SeenSurface,
};

/// A function that opens a renderer.
type Open = Box<dyn Fn() -> Result<Box<dyn Renderer>, RenderError> + Send>;

/// One way to render: a backend on a device, and how to open it.
pub(super) struct Way {
    /// Name as in `--backend`.
    pub(super) backend: &'static str,
    /// Name of the device that it runs on.
    pub(super) device: String,
    pub(super) open: Open,
}

impl Way {
    /// A message of its renderer, prefixed with the name of the way if it is not already.
    fn says(&self, line: &str) -> String {
        let name = format!("{} on {}: ", self.backend, self.device);
        if line.starts_with(&name) { line.to_owned() } else { name + line }
    }
}

/// A renderer that falls back to the next way when a device fails; the module describes how.
pub struct FallbackRenderer {
    ways: Vec<Way>,
    place: usize,
    current: Option<Box<dyn Renderer>>,
    shown: Option<LoadedScene>,
    notices: Vec<String>,
    /// Counts of what the renderers before the current one have built.
    rebuilt_before: Rebuilt,
    stand_in: Option<StandIn>,
}

/// Makes a renderer that needs no preparing.
type StandIn = Box<dyn Fn() -> FallbackRenderer + Send>;

impl std::fmt::Debug for FallbackRenderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FallbackRenderer").field("backend", &self.name()).finish_non_exhaustive()
    }
}

impl FallbackRenderer {
    /// A renderer that tries `ways` in order; there must be at least one.
    pub(super) fn new(ways: Vec<Way>) -> Self {
        let rebuilt_before = Rebuilt::default();
        Self {
            ways,
            place: 0,
            current: None,
            shown: None,
            notices: Vec::new(),
            rebuilt_before,
            stand_in: None,
        }
    }

    /// The same renderer, with what makes one that may draw while this one [prepares](Renderer::prepare).
    pub(super) fn with_stand_in(self, stand_in: StandIn) -> Self {
        Self { stand_in: Some(stand_in), ..self }
    }

    /// A renderer that may draw while this one prepares, if there is one.
    pub fn stand_in(&self) -> Option<Self> {
        self.stand_in.as_ref().map(|make| make())
    }

    /// Name of the device in use.
    pub fn device(&self) -> &str {
        self.ways.get(self.place).map_or("", |way| &way.device)
    }

    /// Calls the renderer for a result that needs samples. After a device failure the next renderer has none, so the result is
    /// [`RenderError::Restarted`].
    fn ask<T>(
        &mut self,
        question: impl Fn(&mut dyn Renderer) -> Result<T, RenderError>,
    ) -> Result<T, RenderError> {
        match question(self.current()?) {
            Err(RenderError::Device(why)) => {
                self.go_on(&why)?;
                self.show_again()?;
                Err(RenderError::Restarted)
            }
            other => other,
        }
    }

    /// As `ask`, for a result that needs no samples: after a failure the next renderer can answer.
    fn ask_anew<T>(
        &mut self,
        question: impl Fn(&mut dyn Renderer) -> Result<T, RenderError>,
    ) -> Result<T, RenderError> {
        loop {
            match self.ask(&question) {
                Err(RenderError::Restarted) => {}
                other => return other,
            }
        }
    }

    /// The renderer that shows the scene. If the last way has failed, it is tried again.
    fn current(&mut self) -> Result<&mut dyn Renderer, RenderError> {
        if self.current.is_none() {
            self.show_again()?;
        }
        match &mut self.current {
            Some(renderer) => Ok(renderer.as_mut()),
            None => Err(RenderError::Scene("scene: none was set".into())),
        }
    }

    /// The renderer of the way in use; opens it if it is not open yet.
    fn opened(&mut self) -> Result<&mut dyn Renderer, RenderError> {
        let renderer = match self.current.take() {
            Some(renderer) => renderer,
            None => match self.ways.get(self.place) {
                Some(way) => (way.open)()?,
                None => return Err(RenderError::Device("no backend is left to try".into())),
            },
        };
        Ok(self.current.insert(renderer).as_mut())
    }

    /// Switches to the next way, without opening it; returns the failure itself if there is no next way.
    fn go_on(&mut self, why: &str) -> Result<(), RenderError> {
        self.collect_notices();
        if let Some(failed) = self.current.take() {
            self.rebuilt_before = sum(self.rebuilt_before, failed.rebuilt());
            // The failed renderer is dropped now, because the next one may need its memory.
        }
        let failure = self.ways.get(self.place).map_or_else(|| why.to_owned(), |way| way.says(why));
        let Some(next) = self.ways.get(self.place + 1) else {
            return Err(RenderError::Device(failure));
        };
        self.notices.push(format!("{failure}; going on with {}", next.backend));
        self.place += 1;
        Ok(())
    }

    /// Shows a scene with the first way that does not fail.
    fn show(&mut self, scene: &LoadedScene) -> Result<(), RenderError> {
        loop {
            match self.opened().and_then(|renderer| renderer.set_scene(scene)) {
                Err(RenderError::Device(why)) => self.go_on(&why)?,
                other => return other,
            }
        }
    }

    /// Shows the previous scene again, with the way that is in use now.
    fn show_again(&mut self) -> Result<(), RenderError> {
        match self.shown.clone() {
            Some(scene) => self.show(&scene),
            None => Ok(()),
        }
    }

    fn collect_notices(&mut self) {
        let (Some(renderer), Some(way)) = (&mut self.current, self.ways.get(self.place)) else { return };
        let told = renderer.notices();
        self.notices.extend(told.iter().map(|line| way.says(line)));
    }
}

fn sum(a: Rebuilt, b: Rebuilt) -> Rebuilt {
    Rebuilt {
        camera: a.camera + b.camera,
        film: a.film + b.film,
        lights: a.lights + b.lights,
        materials: a.materials + b.materials,
        acceleration: a.acceleration + b.acceleration,
        top_level: a.top_level + b.top_level,
    }
}

impl Renderer for FallbackRenderer {
    fn name(&self) -> &'static str {
        self.ways.get(self.place).map_or("none", |way| way.backend)
    }

    fn set_scene(&mut self, scene: &LoadedScene) -> Result<(), RenderError> {
        let place = self.place;
        let result = self.show(scene);
        match &result {
            Ok(()) => self.shown = Some(scene.clone()),
            // A renderer that refuses a scene keeps its previous one. If the way has changed since, the new renderer has none, so the
            // previous scene is shown again.
            Err(_) if self.place != place => self.show_again()?,
            Err(_) => {}
        }
        result
    }

    fn advance(&mut self, slice: Duration, spp_limit: u32, job: &Job) -> Result<Progress, RenderError> {
        loop {
            match self.current()?.advance(slice, spp_limit, job) {
                Err(RenderError::Device(why)) => {
                    self.go_on(&why)?;
                    self.show_again()?;
                }
                other => return other,
            }
        }
    }

    fn prepare(&mut self) -> Result<bool, RenderError> {
        self.ask_anew(|renderer| renderer.prepare())
    }

    fn prepare_picture(&mut self) -> Result<(), RenderError> {
        self.ask_anew(|renderer| renderer.prepare_picture())
    }

    fn has_coarse_frames(&mut self) -> bool {
        // What cannot be opened is told when a scene is set.
        self.opened().is_ok_and(|renderer| renderer.has_coarse_frames())
    }

    fn coarse_frame(
        &mut self,
        size: [u32; 2],
        guided: bool,
        job: &Job,
    ) -> Result<Option<CoarseFrame>, RenderError> {
        self.ask_anew(|renderer| renderer.coarse_frame(size, guided, job))
    }

    fn guides(&mut self, job: &Job) -> Result<Option<Guides>, RenderError> {
        self.ask(|renderer| renderer.guides(job))
    }

    fn color(&mut self) -> Result<Image, RenderError> {
        self.ask(|renderer| renderer.color())
    }

    fn alpha(&mut self) -> Result<Option<Vec<f32>>, RenderError> {
        self.ask(|renderer| renderer.alpha())
    }

    fn variance(&mut self) -> Result<Option<Image>, RenderError> {
        self.ask(|renderer| renderer.variance())
    }

    fn denoised(&mut self) -> Result<Option<Image>, RenderError> {
        self.ask(|renderer| renderer.denoised())
    }

    fn picture(&mut self) -> Result<Picture, RenderError> {
        self.ask(|renderer| renderer.picture())
    }

    fn pick(&mut self, x: u32, y: u32) -> Result<Option<Pick>, RenderError> {
        self.ask_anew(|renderer| renderer.pick(x, y))
    }

    fn seen_surfaces(&mut self, job: &Job) -> Result<Vec<Option<SeenSurface>>, RenderError> {
        self.ask_anew(|renderer| renderer.seen_surfaces(job))
    }

    fn rebuilt(&self) -> Rebuilt {
        sum(self.rebuilt_before, self.current.as_ref().map_or(Rebuilt::default(), |r| r.rebuilt()))
    }

    fn bytes(&self) -> Vec<(&'static str, u64)> {
        self.current.as_ref().map_or_else(Vec::new, |r| r.bytes())
    }

    fn notices(&mut self) -> Vec<String> {
        self.collect_notices();
        std::mem::take(&mut self.notices)
    }
}

#[cfg(test)]
mod on_vulkan;
#[cfg(test)]
pub(crate) mod tests;

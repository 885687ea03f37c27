//! A renderer that goes on where its device fails.
//!
//! ```text
//!   ways:   vulkan-rt on X ──► vulkan-query on X ──► vulkan-compute on X ──► cpu
//!                    RenderError::Device: drop it, open the next, show the same scene, begin the picture again, tell a notice
//! ```
//! Only the device's failure is a reason: a scene that cannot be drawn, a picture that cannot be read, a cancelled job would be the
//! same with any other. With one way alone its failure is the caller's error.
//!
//! A way is opened when the first scene is set, and not before: opening a graphics processor takes time, and whoever draws live
//! shall not wait for it.

use std::time::Duration;

use pumice_core::Job;
use pumice_picture::{Image, Picture};
use pumice_transport::{LoadedScene, Pick, Progress, Rebuilt, RenderError, Renderer};

/// Opens a renderer.
type Open = Box<dyn Fn() -> Result<Box<dyn Renderer>, RenderError> + Send>;

/// One way to render.
pub(super) struct Way {
    /// Name as in `--backend`.
    pub(super) backend: &'static str,
    /// What it runs on.
    pub(super) device: String,
    pub(super) open: Open,
}

impl Way {
    /// What its renderer says, with the way's name before it where the renderer has not put it there itself.
    fn says(&self, line: &str) -> String {
        let name = format!("{} on {}: ", self.backend, self.device);
        if line.starts_with(&name) { line.to_owned() } else { name + line }
    }
}

/// See the module.
pub struct FallbackRenderer {
    ways: Vec<Way>,
    place: usize,
    current: Option<Box<dyn Renderer>>,
    shown: Option<LoadedScene>,
    notices: Vec<String>,
    /// What the renderers before the current one have made.
    rebuilt_before: Rebuilt,
}

impl std::fmt::Debug for FallbackRenderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FallbackRenderer").field("backend", &self.name()).finish_non_exhaustive()
    }
}

impl FallbackRenderer {
    /// `ways` has at least one; the first is tried first.
    pub(super) fn new(ways: Vec<Way>) -> Self {
        let rebuilt_before = Rebuilt::default();
        Self { ways, place: 0, current: None, shown: None, notices: Vec::new(), rebuilt_before }
    }

    /// What it draws on now.
    pub fn device(&self) -> &str {
        self.ways.get(self.place).map_or("", |way| &way.device)
    }

    /// Asks the renderer for what needs samples. After a failure the next one has none.
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

    /// The renderer that shows a scene; one that failed for good is tried again.
    fn current(&mut self) -> Result<&mut dyn Renderer, RenderError> {
        if self.current.is_none() {
            self.show_again()?;
        }
        match &mut self.current {
            Some(renderer) => Ok(renderer.as_mut()),
            None => Err(RenderError::Scene("scene: none was set".into())),
        }
    }

    /// The renderer of the way in use, opened where it is not yet.
    fn opened(&mut self) -> Result<&mut dyn Renderer, RenderError> {
        let renderer = match self.current.take() {
            Some(renderer) => renderer,
            None => match self.ways.get(self.place) {
                Some(way) => (way.open)()?,
                None => return Err(RenderError::Device("there is no way to render".into())),
            },
        };
        Ok(self.current.insert(renderer).as_mut())
    }

    /// Leaves the way in use for the next one, which is not opened yet; the failure itself where there is none.
    fn go_on(&mut self, why: &str) -> Result<(), RenderError> {
        self.collect_notices();
        if let Some(failed) = self.current.take() {
            self.rebuilt_before = sum(self.rebuilt_before, failed.rebuilt());
            // Dropped here: the next one may need its memory.
        }
        let failure = self.ways.get(self.place).map_or_else(|| why.to_owned(), |way| way.says(why));
        let Some(next) = self.ways.get(self.place + 1) else {
            return Err(RenderError::Device(failure));
        };
        self.notices.push(format!("{failure}; going on with {}", next.backend));
        self.place += 1;
        Ok(())
    }

    /// Shows a scene by the first way that can.
    fn show(&mut self, scene: &LoadedScene) -> Result<(), RenderError> {
        loop {
            match self.opened().and_then(|renderer| renderer.set_scene(scene)) {
                Err(RenderError::Device(why)) => self.go_on(&why)?,
                other => return other,
            }
        }
    }

    /// Shows what was shown before by the way that has come into use.
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
            // The renderer that refused the scene would keep its former one, but this one has come since.
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

    fn color(&mut self) -> Result<Image, RenderError> {
        self.ask(|renderer| renderer.color())
    }

    fn alpha(&mut self) -> Result<Option<Vec<f32>>, RenderError> {
        self.ask(|renderer| renderer.alpha())
    }

    fn variance(&mut self) -> Result<Option<Image>, RenderError> {
        self.ask(|renderer| renderer.variance())
    }

    fn picture(&mut self) -> Result<Picture, RenderError> {
        self.ask(|renderer| renderer.picture())
    }

    fn pick(&mut self, x: u32, y: u32) -> Result<Option<Pick>, RenderError> {
        // It needs no samples, so the next one can answer at once.
        loop {
            match self.ask(|renderer| renderer.pick(x, y)) {
                Err(RenderError::Restarted) => {}
                other => return other,
            }
        }
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

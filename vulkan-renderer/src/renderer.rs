//! Implements the [`Renderer`] interface on a GPU.
//!
//! **Failures.** Each failure of the device is handled once. Where memory was short, everything that can be made again is freed and
//! launches become smaller. Where the device was lost, it is opened again, the scene is sent again and the samples of the host's copy are
//! restored; what it had since is drawn again where it is asked for. A hang, and a second failure without a success in between, is [`RenderError::Device`]: another backend may take over with the
//! scene and the volumes, which the host still holds.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use pumice_core::Job;
use pumice_picture::film::CLASSES;
use pumice_picture::{Image, Picture, film_memory};
use pumice_transport::geometry::drawn_pages::SAMPLES_A_PASS_OF_PAGES;
use pumice_transport::{LoadedScene, Pick, Progress, ReadImage, Rebuilt, RenderError, Renderer, SeenSurface};

use crate::device::{Backend, Candidate, DeviceError, Gpu, Instance};
use crate::machine::{DeviceContext, Opening};
use crate::scene::UploadError;
use crate::sent::Sent;
use crate::shown::{Counters, Shown};

/// Most samples a pixel in one pass, because the time a sample takes is known only roughly.
const MOST_SAMPLES_A_PASS: u32 = 64;

/// A path tracer on a Vulkan device.
#[derive(Debug)]
pub struct VulkanRenderer {
    how: Opening,
    machine: DeviceContext,
    read_image: ReadImage,
    shown: Option<Shown>,
    counters: Counters,
    notices: Vec<String>,
    /// A failure was handled, and nothing has succeeded since.
    failed: bool,
    seconds_a_sample: f64,
    /// The device failed to denoise a picture: the host denoises all others.
    host_denoises: bool,
}

fn no_scene() -> RenderError {
    RenderError::Scene("scene: none was set".into())
}

impl VulkanRenderer {
    /// Opens a device for a backend, without a scene. Compiled pipelines are kept in `cache_folder`, if one is given.
    ///
    /// # Errors
    /// [`DeviceError::Unsupported`] says what the device lacks.
    pub fn open(
        instance: &Instance,
        candidate: &Candidate,
        backend: Backend,
        cache_folder: Option<PathBuf>,
        read_image: ReadImage,
    ) -> Result<Self, DeviceError> {
        let (instance, candidate) = (instance.clone(), candidate.clone());
        let how = Opening { instance, candidate, backend, cache_folder };
        Ok(Self {
            machine: DeviceContext::open(&how)?,
            how,
            read_image,
            shown: None,
            counters: Counters::default(),
            notices: Vec::new(),
            failed: false,
            seconds_a_sample: 0.0,
            host_denoises: false,
        })
    }

    /// The device that it renders on.
    pub fn gpu(&self) -> &Gpu {
        &self.machine.gpu
    }

    /// Removes the scene and frees its memory; compiled programs stay. A device that failed to denoise may try again.
    pub fn forget_scene(&mut self) {
        self.shown = None;
        self.host_denoises = false;
    }

    /// How often each part of a scene was sent to the device.
    pub fn sent(&self) -> Sent {
        self.counters.sent
    }

    /// Number of sampling launches so far, how many of them took more than a tenth of a second, and the longest in seconds.
    pub fn launches(&self) -> (u64, u64, f64) {
        self.machine.slices.launches()
    }

    /// Handles a failure: brings device and scene into a state from which the work can be tried again.
    fn overcome(&mut self, error: &DeviceError) -> Result<(), RenderError> {
        if self.failed || self.machine.gpu.is_hung() {
            return Err(self.given_up(error));
        }
        self.failed = true;
        // Any call may be the first to report that the device is lost.
        if !self.machine.gpu.is_lost() && !matches!(error, DeviceError::Lost(_)) {
            self.notices.push(format!("{error}; trying again with smaller launches"));
            self.shown.iter_mut().for_each(Shown::drop_scratch);
            self.machine.shrink();
            return Ok(());
        }
        self.notices.push(format!("{error}; opening the device again"));
        let mut slices = self.machine.slices;
        slices.shrink();
        let mut again = DeviceContext::open(&self.how).map_err(|e| self.given_up(&e))?;
        again.slices = slices;
        self.machine = again;
        let Some(shown) = self.shown.take() else { return Ok(()) };
        match shown.again(&mut self.machine, self.read_image, &mut self.counters) {
            Ok(shown) => self.shown = Some(shown),
            Err(UploadError::Device(e)) => return Err(self.given_up(&e)),
            Err(UploadError::Scene(e)) => return Err(e),
        }
        Ok(())
    }

    /// The error after a second failure.
    fn given_up(&self, error: &DeviceError) -> RenderError {
        RenderError::Device(format!("{} on {}: {error}", self.how.backend, self.how.candidate.name))
    }

    /// Does work that the device may fail at; `None` where a failure was handled, and it is to be tried again.
    fn once<T, E: Into<UploadError>>(
        &mut self,
        work: &mut impl FnMut(&mut Shown, &mut DeviceContext) -> Result<T, E>,
    ) -> Result<Option<T>, RenderError> {
        let shown = self.shown.as_mut().ok_or_else(no_scene)?;
        match work(shown, &mut self.machine).map_err(E::into) {
            Ok(done) => {
                self.failed = false;
                Ok(Some(done))
            }
            Err(UploadError::Device(e)) => self.overcome(&e).map(|()| None),
            Err(UploadError::Scene(e)) => Err(e),
        }
    }

    /// Does work that the device may fail at, and does it again after a first failure.
    fn twice<T, E: Into<UploadError>>(
        &mut self,
        mut work: impl FnMut(&mut Shown, &mut DeviceContext) -> Result<T, E>,
    ) -> Result<T, RenderError> {
        loop {
            if let Some(done) = self.once(&mut work)? {
                return Ok(done);
            }
        }
    }

    /// As [`Self::twice`], for what the film has: samples that were lost with the device are drawn again before the second time.
    fn of_film<T, E: Into<UploadError>>(
        &mut self,
        mut work: impl FnMut(&mut Shown, &mut DeviceContext) -> Result<T, E>,
    ) -> Result<T, RenderError> {
        let spp = self.spp()?;
        if let Some(done) = self.once(&mut work)? {
            return Ok(done);
        }
        self.sample(None, spp, &Job::new())?;
        // Launches that succeeded do not make this failure the first one again.
        self.failed = true;
        self.twice(work)
    }

    /// Adds samples until pixels have `spp_limit` or rest, or until a time; at least one sample.
    fn sample(&mut self, end: Option<Instant>, spp_limit: u32, job: &Job) -> Result<(), RenderError> {
        loop {
            self.twice(|shown, machine| shown.film.look(&machine.gpu))?;
            let film = &self.shown.as_ref().ok_or_else(no_scene)?.film;
            let (start, spp) = (Instant::now(), film.spp);
            let (look, all_rest) = (film.copy().next_look(), film.copy().all_rest());
            if spp >= spp_limit || all_rest {
                break;
            }
            let seconds_left =
                end.map_or(f64::INFINITY, |end| end.saturating_duration_since(start).as_secs_f64());
            let fit =
                if self.seconds_a_sample > 0.0 { (seconds_left / self.seconds_a_sample) as u32 } else { 1 };
            let most = MOST_SAMPLES_A_PASS.min(self.machine.slices.most_samples());
            let again = self.shown.as_ref().is_some_and(Shown::loads_pages_again);
            let least = if again { SAMPLES_A_PASS_OF_PAGES } else { 1 };
            let left = spp_limit.min(look) - spp;
            self.pass(spp + fit.clamp(1, most).max(least).min(left), job)?;
            let now = Instant::now();
            let added = self.spp()?.saturating_sub(spp).max(1);
            self.seconds_a_sample = (now - start).as_secs_f64() / f64::from(added);
            if end.is_some_and(|end| now >= end) {
                break;
            }
        }
        self.twice(|shown, machine| shown.film.look(&machine.gpu))
    }

    /// Brings every pixel to `target` samples. Continues a pass that was cancelled.
    fn pass(&mut self, target: u32, job: &Job) -> Result<(), RenderError> {
        loop {
            if job.is_cancelled() {
                return Err(RenderError::Cancelled);
            }
            if self.twice(|shown, machine| shown.launch(machine, target, job))? {
                return Ok(());
            }
        }
    }

    fn spp(&self) -> Result<u32, RenderError> {
        Ok(self.shown.as_ref().ok_or_else(no_scene)?.film.spp)
    }
}

impl Renderer for VulkanRenderer {
    fn name(&self) -> &'static str {
        self.how.backend.name()
    }

    fn set_scene(&mut self, scene: &LoadedScene) -> Result<(), RenderError> {
        loop {
            let (machine, former, counters) = (&mut self.machine, &mut self.shown, &mut self.counters);
            match Shown::new(machine, former, scene, self.read_image, counters) {
                Ok(shown) => {
                    self.shown = Some(shown);
                    self.failed = false;
                    self.seconds_a_sample = 0.0;
                    return Ok(());
                }
                Err(UploadError::Scene(e)) => return Err(e),
                Err(UploadError::Device(e)) => {
                    // Free the former scene: its memory may be what is missing.
                    self.shown = None;
                    self.overcome(&e)?;
                }
            }
        }
    }

    fn prepare(&mut self) -> Result<bool, RenderError> {
        self.twice(|shown, machine| shown.prepare(machine))
    }

    fn prepare_picture(&mut self) -> Result<(), RenderError> {
        self.twice(|shown, machine| shown.prepare_picture(machine))
    }

    fn advance(&mut self, slice: Duration, spp_limit: u32, job: &Job) -> Result<Progress, RenderError> {
        self.sample(Some(Instant::now() + slice), spp_limit, job)?;
        self.of_film(|shown, machine| shown.film.keep(&machine.gpu))?;
        let error_estimate = self.of_film(|shown, machine| shown.film.error_estimate(machine))?;
        let film = &self.shown.as_ref().ok_or_else(no_scene)?.film;
        Ok(Progress {
            spp: film.spp,
            mean_spp: film.mean_spp(),
            error_estimate,
            all_rest: film.copy().all_rest(),
        })
    }

    fn color(&mut self) -> Result<Image, RenderError> {
        self.of_film(|shown, machine| shown.film.color(machine))
    }

    fn alpha(&mut self) -> Result<Option<Vec<f32>>, RenderError> {
        self.of_film(|shown, machine| shown.film.alpha(machine))
    }

    fn variance(&mut self) -> Result<Option<Image>, RenderError> {
        self.of_film(|shown, machine| shown.film.read(&machine.gpu))?;
        let film = self.shown.as_ref().ok_or_else(no_scene)?.film.copy();
        Ok((film.spp() >= CLASSES).then(|| film.variance()).transpose()?)
    }

    fn picture(&mut self) -> Result<Picture, RenderError> {
        self.shown.as_ref().ok_or_else(no_scene)?.check_memory()?;
        self.of_film(|shown, machine| shown.picture(machine))
    }

    fn denoised(&mut self) -> Result<Option<Image>, RenderError> {
        let shown = self.shown.as_mut().ok_or_else(no_scene)?;
        if self.host_denoises {
            return Ok(None);
        }
        match shown.denoised(&mut self.machine) {
            Ok(image) => Ok(Some(image)),
            Err(UploadError::Scene(error)) => Err(error),
            Err(UploadError::Device(error)) => {
                // The samples are not lost with it. A device that was lost is opened again by the call that needs it next.
                shown.drop_denoiser();
                self.host_denoises = true;
                self.notices.push(format!("{error}; the processor denoises from now on"));
                Ok(None)
            }
        }
    }

    fn pick(&mut self, x: u32, y: u32) -> Result<Option<Pick>, RenderError> {
        self.twice(|shown, machine| shown.pick(machine, x, y))
    }

    fn seen_surfaces(&mut self, job: &Job) -> Result<Vec<Option<SeenSurface>>, RenderError> {
        let [width, height] = self.shown.as_ref().ok_or_else(no_scene)?.film.size;
        film_memory::check_labels(width, height, size_of::<Option<SeenSurface>>())?;
        let surfaces = self.twice(|shown, machine| shown.seen_surfaces(machine, job))?;
        if job.is_cancelled() { Err(RenderError::Cancelled) } else { Ok(surfaces) }
    }

    fn rebuilt(&self) -> Rebuilt {
        self.counters.rebuilt
    }

    fn bytes(&self) -> Vec<(&'static str, u64)> {
        let Some(shown) = &self.shown else { return Vec::new() };
        let mut bytes = shown.bytes();
        bytes.push(("scratch", self.machine.scratch_bytes()));
        bytes
    }

    fn notices(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notices)
    }
}

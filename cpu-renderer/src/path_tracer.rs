//! The progressive path tracer over any [`Tracer`]. Each pixel's samples depend on (seed, pixel, sample number) alone and are added in
//! order, so the picture depends neither on the number of threads nor on the division into time slices.

use std::ops::Range;
use std::time::{Duration, Instant};

use pumice_core::reserve::{collected, collected_by_threads};
use pumice_core::{Job, NoMemory};
use pumice_picture::film::{CLASSES, PICTURE, STRIDE};
use pumice_picture::{CoarsePixels, FilmBuffer, GuideSurface, Guides, Image, PassSums, Picture};
use pumice_scene::{Camera, Film, Passes};
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::sampler::PixelSampler;
use pumice_transport::{
    FilterTable, Hit, PathOrigin, Progress, RayInWorld, RenderError, SurfaceKind, Tracer,
};
use rayon::prelude::*;

use crate::film_sample::AovSample;
use crate::path::{Surroundings, follow, radiance};

/// Largest number of samples that each pixel gets between two looks at the clock.
const MOST_SAMPLES_A_PASS: u32 = 64;

/// Samples from which on a pass completes a block of [`CLASSES`] samples, however short the slice: the samples of a pixel share work on
/// random numbers, and their rays read the same memory. A live picture is then shown again at the latest when it has a quarter more samples.
const FIRST_OF_BLOCKS: u32 = 16;

/// Least number of samples of a pass for which a pixel's random numbers are made by blocks.
const LEAST_BY_BLOCKS: u32 = 3;

/// A scene and its picture so far.
#[derive(Debug)]
pub struct PathTracer<T> {
    tracer: T,
    around: Surroundings,
    rays: CameraRays,
    filter: FilterTable,
    film: FilmBuffer,
    wanted: Passes,
    seconds_a_sample: f64,
    /// Whether light is sorted into AOVs even where no pass asks for it.
    sorts: bool,
}

impl<T: Tracer> PathTracer<T> {
    /// Starts a black picture.
    ///
    /// # Errors
    /// [`RenderError::Memory`] where the film does not fit into memory.
    pub fn new(tracer: T, around: Surroundings, camera: &Camera, film: &Film) -> Result<Self, RenderError> {
        let kept = PassSums::of(film, around.materials.iter().any(|materials| materials.catches()));
        let mut buffer = FilmBuffer::with_passes(film.width, film.height, kept)?;
        buffer.rest_by(around.settings.adaptive)?;
        Ok(Self {
            tracer,
            around,
            rays: CameraRays::new(camera, film),
            filter: FilterTable::new(&film.filter),
            film: buffer,
            wanted: film.passes,
            seconds_a_sample: 0.0,
            sorts: false,
        })
    }

    /// Sets whether light is sorted into AOVs even where no pass asks for it.
    pub fn sort_into_aovs(&mut self, on: bool) {
        self.sorts = on;
    }

    /// Restarts the picture on the same film, with new surroundings and, if given, a new camera.
    ///
    /// # Errors
    /// [`RenderError::Memory`] where there is none to keep which pixels rest; the picture stays as it is.
    pub fn restart(
        &mut self,
        tracer: T,
        around: Surroundings,
        camera: Option<CameraRays>,
    ) -> Result<(), RenderError> {
        self.film.rest_by(around.settings.adaptive)?;
        self.tracer = tracer;
        self.around = around;
        self.rays = camera.unwrap_or(self.rays);
        self.seconds_a_sample = 0.0;
        Ok(())
    }

    /// The geometry.
    pub fn tracer(&self) -> &T {
        &self.tracer
    }

    /// The picture so far.
    pub fn film(&self) -> &FilmBuffer {
        &self.film
    }

    /// Lights, materials and settings.
    pub fn around(&self) -> &Surroundings {
        &self.around
    }

    /// The camera's rays.
    pub fn rays(&self) -> &CameraRays {
        &self.rays
    }

    /// Adds samples for about the time `slice`: at least one, at most `spp_limit` in all.
    ///
    /// # Errors
    /// [`RenderError::Cancelled`]: rows may then differ by the samples of one pass; the next call completes them.
    pub fn advance(&mut self, slice: Duration, spp_limit: u32, job: &Job) -> Result<Progress, RenderError> {
        let end = Instant::now() + slice;
        loop {
            // A pass that was cancelled at its very end, or had no memory for it, has not decided which pixels rest.
            self.film.look()?;
            let spp = self.film.spp();
            if spp >= spp_limit || self.film.all_rest() {
                break;
            }
            let left = end.saturating_duration_since(Instant::now()).as_secs_f64();
            let fit = if self.seconds_a_sample > 0.0 { (left / self.seconds_a_sample) as u32 } else { 1 };
            let most = MOST_SAMPLES_A_PASS.min(spp_limit.min(self.film.next_look()) - spp);
            let least = self.tracer.least_samples_a_pass().min(most);
            let mut target = spp + fit.clamp(least, most);
            if spp >= FIRST_OF_BLOCKS {
                target = target.div_ceil(CLASSES).saturating_mul(CLASSES).min(spp + most);
            }
            self.add_samples(target, job)?;
            if Instant::now() >= end {
                break;
            }
        }
        Ok(Progress {
            spp: self.film.spp(),
            mean_spp: self.film.mean_spp(),
            error_estimate: self.error_estimate(),
            all_rest: self.film.all_rest(),
        })
    }

    /// Brings every pixel that does not rest to `target` samples, which must not exceed the next count at which the film checks for resting
    /// pixels.
    ///
    /// # Errors
    /// As [`PathTracer::advance`].
    pub fn add_samples(&mut self, target: u32, job: &Job) -> Result<(), RenderError> {
        let start = Instant::now();
        let before = self.film.spp();
        let (width, _) = self.film.size();
        let (film, adding) = self.adding();
        let tracer = adding.tracer;
        film.rows_mut().par_bridge().for_each(|row| {
            if job.is_cancelled() || *row.samples >= target || tracer.failure().is_some() {
                return;
            }
            let by_blocks = target - *row.samples >= LEAST_BY_BLOCKS;
            for (x, sums) in row.sums.chunks_exact_mut(STRIDE).enumerate() {
                let target = target.min(row.most.get(x).copied().unwrap_or(u32::MAX));
                let is_early = row.early.get_mut(x).is_some_and(std::mem::take);
                let has = *row.samples + u32::from(is_early);
                let passes = &mut row.passes[x * adding.stride..][..adding.stride];
                adding.add([x as u32, row.y], has..target, by_blocks, sums, passes);
            }
            job.advance(u64::from(target - *row.samples) * width as u64);
            *row.samples = target;
        });
        if job.is_cancelled() {
            return Err(RenderError::Cancelled);
        }
        self.check()?;
        self.film.look()?;
        if target > before {
            self.seconds_a_sample = start.elapsed().as_secs_f64() / f64::from(target - before);
        }
        Ok(())
    }

    /// Adds the first sample to each of these pixels that has none. Does nothing once a pass over all pixels has begun.
    ///
    /// # Errors
    /// [`RenderError::Cancelled`]: the next call continues; [`RenderError::Memory`]; as [`PathTracer::check`].
    pub fn add_early(&mut self, pixels: &CoarsePixels, job: &Job) -> Result<(), RenderError> {
        if !self.film.is_before_passes() {
            return Ok(());
        }
        self.film.allow_early()?;
        let mut is_shown = vec![false; self.film.size().1];
        pixels.rows().for_each(|y| is_shown[y as usize] = true);
        let (film, adding) = self.adding();
        let tracer = adding.tracer;
        film.rows_mut().filter(|row| is_shown[row.y as usize]).par_bridge().for_each(|row| {
            if job.is_cancelled() || tracer.failure().is_some() {
                return;
            }
            for column in pixels.columns() {
                let x = column as usize;
                if !std::mem::replace(&mut row.early[x], true) {
                    let sums = &mut row.sums[x * STRIDE..][..STRIDE];
                    let passes = &mut row.passes[x * adding.stride..][..adding.stride];
                    adding.add([column, row.y], 0..1, false, sums, passes);
                }
            }
        });
        if job.is_cancelled() {
            return Err(RenderError::Cancelled);
        }
        self.check()
    }

    /// The film, and what samples are added with.
    fn adding(&mut self) -> (&mut FilmBuffer, Adding<'_, T>) {
        let Self { tracer, around, rays, filter, film, sorts, .. } = self;
        let (kept, height) = (film.kept(), film.size().1);
        let stride = kept.stride();
        let sorts = stride > 0 || *sorts;
        (film, Adding { tracer, around, rays, filter, kept, stride, sorts, height })
    }

    /// Whether all geometry could be read that rays met.
    ///
    /// # Errors
    /// [`RenderError::Source`] with the reason.
    pub fn check(&self) -> Result<(), RenderError> {
        self.tracer.failure().map_or(Ok(()), |why| Err(RenderError::Source(why)))
    }

    /// Estimated relative error of the picture so far.
    pub fn error_estimate(&self) -> f64 {
        self.film.error_estimate()
    }

    /// The surface seen through the middle of a pixel from the aperture's centre, and its depth along the view axis.
    pub fn pick(&self, x: u32, y: u32) -> Option<(Hit, f64)> {
        let (_, hit) = self.seen(x, y)?;
        Some((hit, hit.t + self.rays.near()))
    }

    /// The ray through the middle of a pixel from the aperture's centre, and what it hits.
    fn seen(&self, x: u32, y: u32) -> Option<(RayInWorld, Hit)> {
        let (ray, t_max) = self.rays.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
        Some((ray, self.tracer.first_hit(&ray, PathOrigin::Free, t_max)?))
    }

    /// The picture so far; depth, label, base colour and normal are those seen through the middle of each pixel. Instances
    /// are positions in the scene's list: [`pumice_picture::name_labels`] names them.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn picture(&self) -> Result<Picture, NoMemory> {
        let color = self.film.mean()?;
        let variance = (self.film.spp() >= CLASSES).then(|| self.film.variance());
        let (width, height) = self.film.size();
        let first = |i: usize| self.first((i % width) as u32, (i / width) as u32).unwrap_or(First::NONE);
        let firsts: Vec<First> =
            collected_by_threads((0..width * height).into_par_iter().map(first), PICTURE)?;
        let image = |of: fn(&First) -> [f32; 3]| {
            let pixels = collected(firsts.len(), firsts.iter().map(of), PICTURE)?;
            Ok::<_, NoMemory>(Image::new(width, height, pixels))
        };
        let picture = Picture {
            depth: Some(collected(firsts.len(), firsts.iter().map(|f| f.depth), PICTURE)?),
            label: Some(collected(firsts.len(), firsts.iter().map(|f| f.surface.label), PICTURE)?),
            instance: Some(collected(firsts.len(), firsts.iter().map(|f| f.surface.instance), PICTURE)?),
            albedo: Some(image(|f| f.surface.albedo)?),
            normal: Some(image(|f| f.surface.normal)?),
            position: Some(image(|f| f.position)?),
            variance: variance.transpose()?,
            ..Picture::of(color)
        };
        drop(firsts);
        self.film.passes_into(picture, self.wanted)
    }

    /// What the denoiser knows of these pixels of the film: their first surfaces, as [`PathTracer::picture`] has them.
    ///
    /// # Errors
    /// [`RenderError::Memory`]; [`RenderError::Cancelled`] soon after `job` is cancelled.
    pub fn guides(&self, pixels: &CoarsePixels, job: &Job) -> Result<Guides, RenderError> {
        let guides = Guides::by_pixels(pixels.size().map(|n| n as usize), |column, row| {
            if job.is_cancelled() {
                return None;
            }
            let [x, y] = pixels.pixel(column as u32, row as u32);
            self.first(x, y).map(|first| first.surface)
        })?;
        if job.is_cancelled() { Err(RenderError::Cancelled) } else { Ok(guides) }
    }

    /// The first surface seen through the middle of a pixel.
    fn first(&self, x: u32, y: u32) -> Option<First> {
        let (ray, hit) = self.seen(x, y)?;
        let point = ray.origin + ray.direction * hit.t;
        let normal = if hit.from_inside { -hit.normal_in_world } else { hit.normal_in_world };
        let normal = self.tracer.shading_normal(&hit, point, normal).unwrap_or(normal);
        let materials = &self.around.materials[hit.surface.instance as usize];
        Some(First {
            position: point.as_vec3().to_array(),
            depth: (hit.t + self.rays.near()) as f32,
            surface: GuideSurface {
                normal: normal.as_vec3().to_array(),
                albedo: materials.material(hit.surface.label).base_color,
                label: if hit.surface.kind == SurfaceKind::Triangle { 0 } else { hit.surface.label + 1 },
                instance: hit.surface.instance,
            },
        })
    }
}

/// What samples of pixels are added with.
struct Adding<'a, T> {
    tracer: &'a T,
    around: &'a Surroundings,
    rays: &'a CameraRays,
    filter: &'a FilterTable,
    kept: PassSums,
    /// Floats of passes a pixel.
    stride: usize,
    /// Whether light is sorted into AOVs.
    sorts: bool,
    /// Rows of the film.
    height: usize,
}

impl<T: Tracer> Adding<'_, T> {
    /// Adds samples of these numbers to the sums of a pixel. `by_blocks`: whether their random numbers are made together.
    #[inline]
    fn add(
        &self,
        pixel: [u32; 2],
        samples: Range<u32>,
        by_blocks: bool,
        sums: &mut [f32],
        passes: &mut [f32],
    ) {
        let Self { tracer, around, rays, filter, height, .. } = *self;
        let mut sampler = PixelSampler::new(around.settings.seed, pixel, samples.start).by_blocks(by_blocks);
        for sample in samples {
            sampler.set_sample(sample);
            let [u, v] = sampler.film();
            let px = f64::from(pixel[0]) + 0.5 + f64::from(filter.sample(u));
            let py = f64::from(pixel[1]) + 0.5 + f64::from(filter.sample(v));
            let (ray, t_max) = match &rays.lens {
                None => rays.ray(px, py),
                Some(lens) => rays.lens_ray(lens, px, py, sampler.lens()),
            };
            let down = (py / height as f64) as f32;
            let color = if self.sorts {
                let mut sorted = AovSample::new(&around.settings, self.kept);
                follow(tracer, around, &sampler, ray, t_max, down, &mut sorted);
                sorted.add_to(passes, sample);
                sorted.total
            } else {
                radiance(tracer, around, &sampler, ray, t_max, down)
            };
            let at = 3 * (sample % CLASSES) as usize;
            sums[at] += color.x;
            sums[at + 1] += color.y;
            sums[at + 2] += color.z;
        }
    }
}

/// The first surface seen through the middle of a pixel. Its instance is the position in the scene's list.
struct First {
    /// Along the view axis.
    depth: f32,
    position: [f32; 3],
    surface: GuideSurface,
}

impl First {
    /// Where a pixel shows no surface.
    const NONE: Self = Self {
        depth: f32::INFINITY,
        position: [0.0; 3],
        surface: GuideSurface { normal: [0.0; 3], albedo: [0.0; 3], label: 0, instance: 0 },
    };
}

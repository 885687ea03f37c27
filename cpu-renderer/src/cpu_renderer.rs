//! The renderer: keeps a scene made ready, exposes the film sample by sample.
//!
//! A pixel's value follows from (seed, pixel, number of samples) alone: rows are shared out to threads, but each pixel's samples
//! are added in their order by one thread at a time, so threads leave no trace in the picture.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::Vec3;
use pumice_core::{CompressedVolume, Job};
use pumice_render::environment::EnvironmentMap;
use pumice_render::filter::PixelFilter;
use pumice_render::palette::assign_colors;
use pumice_render::sampler::{PixelSampler, REPLICATES};
use pumice_render::{PathOrigin, Picture, Progress, RenderError, RenderReport, Renderer, Tracer};
use pumice_scene::{Environment, Instance, Material, Mode, Needs, Scene, SceneError, Settings};
use rayon::prelude::*;

use crate::camera_rays::CameraRays;
use crate::film_store::{Exposure, FilmStore};
use crate::lighting::{Lighting, Sky};
use crate::path::PathScene;
use crate::traverse::{LodChoice, SceneTracer, TracedInstance};

/// A scene, made ready.
struct Ready {
    geometry: Arc<Geometry>,
    materials: Vec<Vec<Material>>,
    lighting: Lighting,
    backdrop: Option<[Vec3; 2]>,
    settings: Settings,
    camera: CameraRays,
    filter: PixelFilter,
    film: FilmStore,
    samples: u32,
    report: RenderReport,
}

/// The acceleration structures, and what they were built for.
struct Geometry {
    instances: Vec<TracedInstance>,
    tracer: SceneTracer,
}

impl Geometry {
    /// Whether it serves these instances as it is.
    fn serves(&self, instances: &[TracedInstance]) -> bool {
        let same = |(a, b): (&TracedInstance, &TracedInstance)| {
            Arc::ptr_eq(&a.volume, &b.volume)
                && a.world_from_index == b.world_from_index
                && a.visible == b.visible
                && a.lod == b.lod
        };
        self.instances.len() == instances.len() && self.instances.iter().zip(instances).all(same)
    }
}

/// Path traces on the processor.
#[derive(Default)]
pub struct CpuRenderer {
    ready: Option<Ready>,
}

impl CpuRenderer {
    /// A renderer without a scene.
    pub fn new() -> Self {
        Self::default()
    }
}

impl Renderer for CpuRenderer {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn set_scene(&mut self, scene: &Scene, volumes: &[Arc<CompressedVolume>]) -> Result<(), RenderError> {
        self.ready = Some(Ready::new(scene, volumes, self.ready.as_ref())?);
        Ok(())
    }

    fn advance(&mut self, slice: Duration, spp_limit: u32, job: &Job) -> Result<Progress, RenderError> {
        let ready = self.ready.as_mut().ok_or_else(|| RenderError::Scene("no scene was set".into()))?;
        let start = Instant::now();
        while ready.samples < spp_limit {
            ready.expose(job)?;
            if start.elapsed() >= slice {
                break;
            }
        }
        Ok(Progress { spp: ready.samples, error_estimate: ready.film.error_estimate() })
    }

    fn picture(&self) -> Option<Picture> {
        self.ready.as_ref().map(|r| r.film.picture())
    }

    fn report(&self) -> RenderReport {
        self.ready.as_ref().map_or_else(RenderReport::default, |r| r.report.clone())
    }
}

impl Ready {
    fn new(
        scene: &Scene,
        volumes: &[Arc<CompressedVolume>],
        former: Option<&Ready>,
    ) -> Result<Self, RenderError> {
        let fault = |e: SceneError| RenderError::Scene(e.to_string());
        scene.validate().map_err(fault)?;
        if volumes.len() != scene.instances.len() {
            let (expected, got) = (scene.instances.len(), volumes.len());
            return Err(RenderError::Scene(format!("instances: expected {expected} volumes, got {got}")));
        }

        // Geometry: what is visible, where, how finely; the former one where nothing of that has changed.
        let lod = LodChoice::new(scene.settings.lod, &scene.camera, &scene.film);
        let mut instances = Vec::with_capacity(volumes.len());
        for (i, (instance, volume)) in scene.instances.iter().zip(volumes).enumerate() {
            let visible = instance
                .style
                .show
                .resolve(volume.labels().ids(), &format!("instances[{i}].style.show"))
                .map_err(fault)?;
            let (volume, world_from_index) = (volume.clone(), instance.world_from_index);
            instances.push(TracedInstance { volume, world_from_index, visible, lod });
        }
        let (geometry, geometry_built) = match former.map(|f| &f.geometry).filter(|g| g.serves(&instances)) {
            Some(same) => (same.clone(), false),
            None => {
                let tracer = SceneTracer::new(&instances)?;
                (Arc::new(Geometry { instances, tracer }), true)
            }
        };

        // Looks and lights.
        let materials = scene.instances.iter().zip(&geometry.instances).map(|(i, t)| materials_of(i, t)).collect();
        let sky = match &scene.world.environment {
            Environment::Constant { radiance } => Sky::Constant(Vec3::from_array(*radiance)),
            Environment::Image { path, rotation_rad, strength } => Sky::Image(
                EnvironmentMap::load(path, *rotation_rad, *strength).map_err(|e| RenderError::Source(e.to_string()))?,
            ),
        };
        let report = RenderReport {
            acceleration_bytes: geometry.tracer.bytes(),
            geometry_built,
            explanation: Needs::of(scene, &geometry.instances.iter().map(|t| t.visible.as_slice()).collect::<Vec<_>>())
                .explain(),
        };
        Ok(Self {
            materials,
            lighting: Lighting::new(sky, &scene.suns),
            backdrop: scene.world.backdrop.map(|b| b.map(Vec3::from_array)),
            settings: scene.settings,
            camera: CameraRays::new(&scene.camera, &scene.film),
            filter: PixelFilter::new(scene.film.filter),
            film: FilmStore::new(scene.film.width as usize, scene.film.height as usize),
            samples: 0,
            report,
            geometry,
        })
    }

    /// Adds one sample to every pixel.
    fn expose(&mut self, job: &Job) -> Result<(), RenderError> {
        let Self { geometry, materials, lighting, backdrop, settings, camera, filter, film, samples, .. } = self;
        let sample = *samples;
        let paths = PathScene {
            tracer: &geometry.tracer,
            lighting,
            materials,
            bounces: match settings.mode {
                Mode::Path => settings.bounces,
                Mode::OneBounce | Mode::AmbientOcclusion => 0,
            },
            russian_roulette: settings.russian_roulette,
        };
        let (width, height) = (film.width, film.height);
        let expose_row = |y: usize, row: &mut [Exposure]| {
            for (x, exposure) in row.iter_mut().enumerate() {
                if sample == 0 {
                    first_surface(&paths, camera, [x, y], exposure);
                }
                let points = PixelSampler::new(settings.seed, [x as u32, y as u32], sample);
                let [dx, dy] = filter.sample(points.film());
                let (film_x, film_y) = (x as f64 + 0.5 + f64::from(dx), y as f64 + 0.5 + f64::from(dy));
                let (ray, reach) = camera.ray(film_x, film_y);
                let color = match paths.tracer.first_hit(&ray, PathOrigin::Free, reach) {
                    None => match *backdrop {
                        Some([bottom, top]) => bottom.lerp(top, 1.0 - (film_y / height as f64) as f32),
                        None => lighting.background(ray.direction.normalize()),
                    },
                    Some(hit) => {
                        let material = &materials[hit.surface.instance as usize][hit.surface.label as usize];
                        let n = hit.normal_in_world;
                        let n = if n.dot(ray.direction) > 0.0 { -n } else { n };
                        for c in 0..3 {
                            exposure.albedo[c] += material.base_color[c];
                            exposure.normal[c] += n[c] as f32;
                        }
                        match settings.mode {
                            Mode::AmbientOcclusion => {
                                Vec3::splat(paths.ambient_occlusion(&ray, &hit, &points, settings.ao_distance))
                            }
                            Mode::Path | Mode::OneBounce => paths.radiance(ray, hit, &points),
                        }
                    }
                };
                let sum = &mut exposure.color[(sample % REPLICATES) as usize];
                for (c, value) in sum.iter_mut().enumerate() {
                    *value += color[c];
                }
            }
        };
        film.exposures
            .par_chunks_mut(width)
            .zip(film.samples_of_row.par_iter_mut())
            .enumerate()
            .try_for_each(|(y, (row, samples_of_row))| {
                // A row that a cancelled pass has already exposed is not exposed again.
                if *samples_of_row <= sample {
                    job.check().map_err(|_| RenderError::Cancelled)?;
                    expose_row(y, row);
                    *samples_of_row = sample + 1;
                }
                Ok(())
            })?;
        *samples += 1;
        Ok(())
    }
}

/// Depth and label through the pixel's centre.
fn first_surface(paths: &PathScene<'_, SceneTracer>, camera: &CameraRays, [x, y]: [usize; 2], exposure: &mut Exposure) {
    let (ray, reach) = camera.ray(x as f64 + 0.5, y as f64 + 0.5);
    let hit = paths.tracer.first_hit(&ray, PathOrigin::Free, reach);
    exposure.depth = hit.map_or(f32::INFINITY, |h| (h.t + camera.near()) as f32);
    exposure.label = hit.map_or(0, |h| h.surface.label + 1);
}

/// The material of each label by dense index: its own, else the instance's, coloured unlike its neighbours where that is asked.
fn materials_of(instance: &Instance, traced: &TracedInstance) -> Vec<Material> {
    let labels = traced.volume.labels();
    let style = &instance.style;
    let mut materials = vec![style.material; labels.len()];
    if style.auto_color {
        let colors = assign_colors(labels.len(), labels.contacts().iter(), Some(&traced.visible));
        for (material, color) in materials.iter_mut().zip(colors) {
            material.base_color = color;
        }
    }
    for (id, own) in &style.materials {
        if let Some(label) = labels.index_of(*id) {
            materials[label as usize] = *own;
        }
    }
    materials
}

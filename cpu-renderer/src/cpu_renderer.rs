//! The CPU behind the [`Renderer`] interface: builds from a scene what paths need, and only that.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;

use pumice_core::{CompressedVolume, Job};
use pumice_render::{EnvironmentTable, Image, Picture, Progress, ReadySun, RenderError, Renderer};
use pumice_scene::{Environment, Scene, Show};

use crate::lights::{Lights, Sky};
use crate::looks::Looks;
use crate::path::Surroundings;
use crate::path_tracer::PathTracer;
use crate::traverse::{LodChoice, SceneTracer, TracedInstance};

/// Reads the scene-linear pictures that scenes name as environments; files are the caller's business.
pub type ReadImage = fn(&std::path::Path) -> Result<Image, String>;

/// What is under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Position of the instance in the scene's list.
    pub instance: u32,
    /// Dense label index.
    pub label: u32,
    /// Lowest voxel of the element that was hit.
    pub voxel: [u32; 3],
    /// Distance along the view axis.
    pub depth: f64,
}

/// See the module.
#[derive(Debug)]
pub struct CpuRenderer {
    read_image: ReadImage,
    shown: Option<Shown>,
}

#[derive(Debug)]
struct Shown {
    scene: Scene,
    volumes: Vec<Arc<CompressedVolume>>,
    tracer: PathTracer<Arc<SceneTracer>>,
}

impl CpuRenderer {
    /// A renderer that shows nothing yet.
    pub fn new(read_image: ReadImage) -> Self {
        Self { read_image, shown: None }
    }

    /// What is under the middle of a pixel.
    pub fn pick(&self, x: u32, y: u32) -> Option<Pick> {
        let (hit, depth) = self.shown.as_ref()?.tracer.pick(x, y)?;
        let s = hit.surface;
        Some(Pick { instance: s.instance, label: s.label, voxel: s.voxel, depth })
    }

    fn lights(&self, scene: &Scene) -> Result<Lights, RenderError> {
        let sky = match &scene.world.environment {
            Environment::Constant { radiance } => Sky::Constant(glam::Vec3::from_array(*radiance)),
            Environment::Image { path, rotation_rad, strength } => {
                let at = |what: String| RenderError::Source(format!("{}: {what}", path.display()));
                let image = (self.read_image)(path).map_err(at)?;
                Sky::Image(Box::new(EnvironmentTable::new(image, *strength, *rotation_rad).map_err(at)?))
            }
        };
        Ok(Lights::new(sky, scene.suns.iter().map(ReadySun::new).collect(), scene.world.backdrop))
    }
}

/// Which labels are drawn, by dense index.
fn visible(show: &Show, ids: &[u64]) -> Vec<bool> {
    let set = |list: &[u64]| list.iter().copied().collect::<HashSet<u64>>();
    match show {
        Show::All => vec![true; ids.len()],
        Show::Only(list) => {
            let list = set(list);
            ids.iter().map(|id| list.contains(id)).collect()
        }
        Show::Except(list) => {
            let list = set(list);
            ids.iter().map(|id| !list.contains(id)).collect()
        }
    }
}

/// Whether the acceleration structures of the former scene serve the new one.
fn same_geometry(old: &Shown, scene: &Scene, volumes: &[Arc<CompressedVolume>]) -> bool {
    let same_instance = |(a, b): (&pumice_scene::Instance, &pumice_scene::Instance)| {
        a.world_from_index == b.world_from_index && a.style.show == b.style.show
    };
    let lod = |s: &Scene| LodChoice::new(s.settings.lod, &s.camera, &s.film);
    old.scene.instances.len() == scene.instances.len()
        && old.scene.instances.iter().zip(&scene.instances).all(same_instance)
        && old.volumes.len() == volumes.len()
        && old.volumes.iter().zip(volumes).all(|(a, b)| Arc::ptr_eq(a, b))
        && lod(&old.scene) == lod(scene)
}

impl Renderer for CpuRenderer {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn set_scene(&mut self, scene: &Scene, volumes: &[Arc<CompressedVolume>]) -> Result<(), RenderError> {
        scene.validate().map_err(|e| RenderError::Scene(e.to_string()))?;
        if scene.instances.len() != volumes.len() {
            return Err(RenderError::Scene(format!(
                "instances: expected one volume for each of {}, got {}",
                scene.instances.len(),
                volumes.len()
            )));
        }
        for (i, (instance, volume)) in scene.instances.iter().zip(volumes).enumerate() {
            instance.validate_ids(i, volume.labels().ids()).map_err(|e| RenderError::Scene(e.to_string()))?;
        }
        let lights = self.lights(scene)?;
        let looks = scene
            .instances
            .iter()
            .zip(volumes)
            .map(|(instance, volume)| {
                let table = volume.labels();
                let visible = visible(&instance.style.show, table.ids());
                Looks::new(&instance.style, table.ids(), table.contacts().iter(), &visible)
            })
            .collect();
        let geometry = match &self.shown {
            Some(old) if same_geometry(old, scene, volumes) => Arc::clone(old.tracer.tracer()),
            _ => {
                let traced: Vec<_> = scene
                    .instances
                    .iter()
                    .zip(volumes)
                    .map(|(instance, volume)| TracedInstance {
                        volume: Arc::clone(volume),
                        world_from_index: instance.world_from_index,
                        visible: visible(&instance.style.show, volume.labels().ids()),
                        lod: LodChoice::new(scene.settings.lod, &scene.camera, &scene.film),
                    })
                    .collect();
                Arc::new(SceneTracer::new(&traced)?)
            }
        };
        let around = Surroundings { lights, looks, settings: scene.settings };
        let tracer = PathTracer::new(geometry, around, &scene.camera, &scene.film);
        self.shown = Some(Shown { scene: scene.clone(), volumes: volumes.to_vec(), tracer });
        Ok(())
    }

    fn advance(&mut self, slice: Duration, spp_limit: u32, job: &Job) -> Result<Progress, RenderError> {
        match &mut self.shown {
            Some(shown) => shown.tracer.advance(slice, spp_limit, job),
            None => Err(RenderError::Scene("scene: none was set".into())),
        }
    }

    fn picture(&self) -> Result<Picture, RenderError> {
        let Some(shown) = &self.shown else {
            return Err(RenderError::Scene("scene: none was set".into()));
        };
        Ok(shown.tracer.picture())
    }

    fn bytes(&self) -> Vec<(&'static str, u64)> {
        self.shown.as_ref().map_or_else(Vec::new, |s| {
            vec![
                ("acceleration", s.tracer.tracer().bytes()),
                ("film", s.tracer.film().bytes()),
                ("materials", s.tracer.around().looks.iter().map(Looks::bytes).sum()),
            ]
        })
    }
}

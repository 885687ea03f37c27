//! The [`Renderer`] for the CPU: builds the data that paths need from a scene, and nothing else.

use std::sync::Arc;
use std::time::Duration;

use pumice_core::Job;
use pumice_picture::cryptomatte::{self, Ids};
use pumice_picture::film::CLASSES;
use pumice_picture::{CoarsePixels, Guides, Image, Picture, film_memory, name_labels, name_mattes};
use pumice_scene::{Film, Part, PartSet, Scene};
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::emitters::{EmissiveGeometry, Emitters};
use pumice_transport::geometry::{Contacts, LodChoice};
use pumice_transport::lights::Lights;
use pumice_transport::material_table::{MaterialTable, MaterialTables};
use pumice_transport::scene_lights::{ReadImage, scene_lights};
use pumice_transport::scene_plan::{InstancePlan, MeshPlan, Reuse, ScenePlan};
use pumice_transport::{
    CoarseFrame, LoadedScene, Pick, Progress, Rebuilt, RenderError, Renderer, SeenSurface, SurfaceKind,
};
use rayon::prelude::*;

use crate::path::Surroundings;
use crate::path_tracer::PathTracer;
use crate::traverse::{MeshTracer, SceneTracer, TracedInstance, VolumeTracer};

/// The CPU backend, with the data of the scene that it shows.
#[derive(Debug)]
pub struct CpuRenderer {
    read_image: ReadImage,
    shown: Option<Shown>,
    rebuilt: Rebuilt,
}

#[derive(Debug)]
struct Shown {
    scene: LoadedScene,
    tracer: PathTracer<SceneTracer>,
    /// All lights except emissive surfaces.
    lights: Arc<Lights>,
}

/// Parts that this renderer leaves out where a scene does not need them. The code for all other parts is always present; whether it runs is
/// decided while paths are traced.
pub const LEAVES_OUT: PartSet = PartSet::NONE
    .with(Part::HiddenLabels)
    .with(Part::Levels)
    .with(Part::Transparent)
    .with(Part::Sorting)
    .with(Part::Mattes)
    .with(Part::InstanceTree);

/// Memory of the material tables; tables that instances share count once.
fn material_bytes(materials: &[Arc<MaterialTable>]) -> u64 {
    let mut seen = std::collections::BTreeSet::new();
    materials.iter().filter(|l| seen.insert(Arc::as_ptr(l).addr())).map(|l| l.bytes()).sum()
}

fn no_scene() -> RenderError {
    RenderError::Scene("scene: none was set".into())
}

impl CpuRenderer {
    /// A renderer without a scene.
    pub fn new(read_image: ReadImage) -> Self {
        Self { read_image, shown: None, rebuilt: Rebuilt::default() }
    }

    fn shown(&self) -> Result<&Shown, RenderError> {
        self.shown.as_ref().ok_or_else(no_scene)
    }
}

/// The emissive surfaces of a scene that light sampling can choose.
///
/// # Errors
/// As [`Emitters::new`].
pub fn emitters_of(
    tracer: &SceneTracer,
    materials: &[Arc<MaterialTable>],
) -> Result<Option<Emitters>, RenderError> {
    let volumes = tracer.volumes().iter().zip(0u32..).filter(|(_, i)| materials[*i as usize].is_emissive());
    let of_volumes = volumes.map(|(v, instance)| {
        if v.volume().pages().is_some() {
            return Err(RenderError::Scene(format!(
                "memory limit: instances[{instance}] emits light, which needs the whole volume in memory: leave the limit out"
            )));
        }
        Ok(EmissiveGeometry::Volume {
            instance,
            volume: v.volume(),
            drawn: v.drawn()?,
            placement: *v.placement(),
            detail: v.detail(),
            cuts: v.cuts(),
            materials: &materials[instance as usize],
        })
    });
    let first = tracer.volumes().len() as u32;
    let meshes = tracer.meshes().iter().zip(first..).filter(|(_, i)| materials[*i as usize].is_emissive());
    let of_meshes = meshes.map(|(m, instance)| {
        let (mesh, grid) = m.mesh();
        Ok(EmissiveGeometry::Mesh {
            instance,
            mesh,
            grid,
            placement: *m.placement(),
            materials: &materials[instance as usize],
        })
    });
    Emitters::new(&of_volumes.chain(of_meshes).collect::<Result<Vec<_>, RenderError>>()?)
}

/// The construction of a scene's data for `set_scene`, with counts of what was built.
struct Making<'a> {
    new: &'a LoadedScene,
    old: Option<&'a Shown>,
    lod: LodChoice,
    parts: PartSet,
    rebuilt: Rebuilt,
}

impl Making<'_> {
    /// Completes the material table of an instance or of a mesh, so that it can be shared.
    fn ready(&mut self, materials: MaterialTable, ids: impl FnOnce() -> Vec<Ids>) -> Arc<MaterialTable> {
        self.rebuilt.materials += 1;
        let mattes = self.parts.has(Part::Mattes);
        Arc::new(materials.with_ids(if mattes { ids() } else { Vec::new() }))
    }

    /// The material table at this index of the previous scene, where meshes come after volumes.
    fn former_materials(&self, number: usize) -> Option<Arc<MaterialTable>> {
        self.old.and_then(|old| old.tracer.around().materials.get(number)).map(Arc::clone)
    }

    fn materials_of_instance(
        &mut self,
        place: usize,
        plan: &InstancePlan,
        before: &[Arc<MaterialTable>],
    ) -> Arc<MaterialTable> {
        let (former, shared) =
            (|i: usize| self.former_materials(i), |i: usize| before.get(i).map(Arc::clone));
        if let Some(materials) = plan.materials.find(former, shared) {
            return materials;
        }
        let (style, table) = (&self.new.scene().instances[place].style, self.new.volumes()[place].labels());
        let materials =
            MaterialTable::new(style, table.ids(), table.contacts().iter(), &self.new.visible(place));
        self.ready(materials, || cryptomatte::ids_of_volume(table))
    }

    fn materials_of_mesh(&mut self, place: usize, plan: &MeshPlan) -> Arc<MaterialTable> {
        let former = |i: usize| self.former_materials(self.old?.scene.volumes().len() + i);
        if let Some(materials) = plan.materials.find(former, |_| None) {
            return materials;
        }
        let mesh = &self.new.scene().meshes[place];
        let materials = MaterialTable::of_mesh(&mesh.materials).catching(mesh.shadow_catcher);
        self.ready(materials, || cryptomatte::ids_of_mesh(&mesh.source))
    }

    /// Geometry of an instance; `before` is the geometry of the instances before it.
    fn volume(
        &mut self,
        place: usize,
        plan: &InstancePlan,
        before: &[Arc<VolumeTracer>],
    ) -> Result<Arc<VolumeTracer>, RenderError> {
        let former = |i: usize| self.old.and_then(|old| old.tracer.tracer().volumes().get(i));
        if let (true, Some(kept)) = (plan.keeps_geometry(), former(place)) {
            return Ok(Arc::clone(kept));
        }
        let scene = self.new.scene();
        let instance = &scene.instances[place];
        let again = match plan.hierarchy.find(former, |i| before.get(i)) {
            Some(like) => like.again(place as u32, instance.world_from_index, self.lod)?,
            None => None,
        };
        let geometry = match again {
            Some(geometry) => geometry,
            None => {
                let traced = TracedInstance {
                    volume: Arc::clone(&self.new.volumes()[place]),
                    world_from_index: instance.world_from_index,
                    visible: self.new.visible(place),
                    lod: self.lod,
                };
                // With other labels shown, the former geometry of the volume may still serve.
                let old = self.old.filter(|old| !old.scene.needs().parts().has(Part::HiddenLabels));
                let like = plan.former.and_then(|i| Some((former(i)?, old?.scene.visible(i))));
                let (geometry, is_built) = match (self.parts.has(Part::HiddenLabels), like) {
                    (true, _) => {
                        (VolumeTracer::with_hidden_labels(place as u32, &traced)?.with_bricks()?, true)
                    }
                    (false, Some((like, before))) => like.showing(&before, place as u32, &traced)?,
                    (false, None) => (VolumeTracer::in_bricks(place as u32, &traced)?, true),
                };
                self.rebuilt.acceleration += u64::from(is_built);
                geometry
            }
        };
        let geometry = geometry.with_cuts(scene.cuts_of(instance.id));
        Ok(Arc::new(geometry.shaded_smooth(scene.settings.smooth_voxels)?))
    }

    /// Geometry of a mesh; `before` is the geometry of the meshes before it.
    fn mesh(
        &mut self,
        place: usize,
        plan: &MeshPlan,
        before: &[Arc<MeshTracer>],
    ) -> Result<Arc<MeshTracer>, RenderError> {
        let former = |i: usize| self.old.and_then(|old| old.tracer.tracer().mesh(i));
        let world_from_mesh = self.new.scene().meshes[place].world_from_mesh;
        let (number, instance) = (place as u32, (self.new.volumes().len() + place) as u32);
        if let Some(like) = plan.triangles.find(former, |i| before.get(i)) {
            return Ok(Arc::new(like.again(number, instance, world_from_mesh)?));
        }
        self.rebuilt.acceleration += 1;
        Ok(Arc::new(MeshTracer::new(number, instance, &self.new.meshes()[place], world_from_mesh)?))
    }
}

impl Renderer for CpuRenderer {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn set_scene(&mut self, scene: &LoadedScene) -> Result<(), RenderError> {
        let old = self.shown.as_ref();
        let plan = ScenePlan::between(old.map(|o| &o.scene), scene);
        let (needs, parts) = (scene.needs(), scene.needs().parts());
        let mut making = Making { new: scene, old, lod: scene.lod(), parts, rebuilt: self.rebuilt };

        // All lights except emissive surfaces.
        let lights = match old {
            Some(o) if plan.lights == Reuse::Keep => Arc::clone(&o.lights),
            _ => {
                making.rebuilt.lights += 1;
                Arc::new(scene_lights(scene.scene(), self.read_image)?)
            }
        };

        // Materials and geometry, volumes first.
        let (mut materials, mut volumes, mut meshes) = (Vec::new(), Vec::new(), Vec::new());
        for (place, plan) in plan.instances.iter().enumerate() {
            materials.push(making.materials_of_instance(place, plan, &materials));
            volumes.push(making.volume(place, plan, &volumes)?);
        }
        for (place, plan) in plan.meshes.iter().enumerate() {
            materials.push(making.materials_of_mesh(place, plan));
            meshes.push(making.mesh(place, plan, &meshes)?);
        }

        // The hierarchy over all instances and meshes.
        let geometry = SceneTracer::of(volumes).with_meshes(meshes).with_contacts(Contacts::new(scene));
        let geometry = match old {
            Some(o) if plan.top_level == Reuse::Keep => geometry.with_tree_of(o.tracer.tracer()),
            _ => {
                let (geometry, made) = geometry.with_tree(needs.least_of_a_tree())?;
                making.rebuilt.top_level += u64::from(made);
                geometry
            }
        };
        let catches: Vec<bool> = scene.scene().meshes.iter().map(|m| m.shadow_catcher).collect();
        let geometry = geometry.with_catchers(&catches);

        // Emissive surfaces.
        let emitters = match old {
            Some(o) if plan.emitters == Reuse::Keep => o.tracer.around().lights.emitters().map(Arc::clone),
            _ if !parts.has(Part::Emitters) => None,
            _ => {
                let made = emitters_of(&geometry, &materials)?.map(Arc::new);
                making.rebuilt.lights += u64::from(made.is_some());
                made
            }
        };
        let lit = match emitters {
            None => Arc::clone(&lights),
            some => Arc::new(Lights::clone(&lights).with_emitters(some)),
        };

        // Camera and film.
        let Making { mut rebuilt, .. } = making;
        rebuilt.camera += u64::from(plan.camera.is_build());
        rebuilt.film += u64::from(plan.film.is_build());
        let Scene { camera, film, settings, .. } = scene.scene();
        let materials = MaterialTables::new(materials, parts.has(Part::Transparent));
        let around = Surroundings { lights: lit, materials, settings: *settings };
        let keeps_film = [plan.film, plan.sums] == [Reuse::Keep; 2];
        let mut tracer = match self.shown.take_if(|_| keeps_film) {
            Some(mut former) => {
                let camera = plan.camera.is_build().then(|| CameraRays::new(camera, film));
                if let Err(error) = former.tracer.restart(geometry, around, camera) {
                    self.shown = Some(former);
                    return Err(error);
                }
                former.tracer
            }
            // A film that does not fit leaves the previous scene as it is.
            None => PathTracer::new(geometry, around, camera, film)?,
        };
        tracer.sort_into_aovs(parts.has(Part::Sorting));
        self.rebuilt = rebuilt;
        self.shown = Some(Shown { scene: scene.clone(), tracer, lights });
        Ok(())
    }

    fn advance(&mut self, slice: Duration, spp_limit: u32, job: &Job) -> Result<Progress, RenderError> {
        match &mut self.shown {
            Some(shown) => shown.tracer.advance(slice, spp_limit, job),
            None => Err(no_scene()),
        }
    }

    fn has_coarse_frames(&mut self) -> bool {
        true
    }

    fn coarse_frame(
        &mut self,
        size: [u32; 2],
        guided: bool,
        job: &Job,
    ) -> Result<Option<CoarseFrame>, RenderError> {
        let Some(Shown { tracer, scene, .. }) = &mut self.shown else { return Err(no_scene()) };
        let film = &scene.scene().film;
        let pixels = CoarsePixels::new([film.width, film.height], size);
        if !tracer.film().is_before_passes() {
            return Ok(None);
        }
        tracer.add_early(&pixels, job)?;
        let coarse = tracer.film().coarse(&pixels)?;
        let (color, alpha) = (coarse.mean()?, coarse.alpha()?);
        let guides = guided.then(|| tracer.guides(&pixels, job)).transpose()?;
        tracer.check()?;
        Ok(Some(CoarseFrame { color, alpha, guides }))
    }

    fn guides(&mut self, job: &Job) -> Result<Option<Guides>, RenderError> {
        let Shown { tracer, scene, .. } = self.shown()?;
        let Film { width, height, .. } = scene.scene().film;
        let guides = tracer.guides(&CoarsePixels::new([width, height], [width, height]), job)?;
        tracer.check()?;
        Ok(Some(guides))
    }

    fn color(&mut self) -> Result<Image, RenderError> {
        Ok(self.shown()?.tracer.film().mean()?)
    }

    fn alpha(&mut self) -> Result<Option<Vec<f32>>, RenderError> {
        Ok(self.shown()?.tracer.film().alpha()?)
    }

    fn variance(&mut self) -> Result<Option<Image>, RenderError> {
        let film = self.shown()?.tracer.film();
        Ok((film.spp() >= CLASSES).then(|| film.variance()).transpose()?)
    }

    fn picture(&mut self) -> Result<Picture, RenderError> {
        let shown = self.shown()?;
        let (scene, film) = (shown.scene.scene(), shown.tracer.film());
        film_memory::check(&scene.film, film.kept(), scene.settings.adaptive, film.bytes())?;
        let mut picture = shown.tracer.picture()?;
        shown.tracer.check()?;
        name_mattes(&mut picture, shown.scene.scene(), shown.scene.volumes());
        name_labels(&mut picture, shown.scene.scene(), shown.scene.volumes());
        Ok(picture)
    }

    fn pick(&mut self, x: u32, y: u32) -> Result<Option<Pick>, RenderError> {
        let shown = self.shown()?;
        let film = &shown.scene.scene().film;
        let hit = if x < film.width && y < film.height { shown.tracer.pick(x, y) } else { None };
        shown.tracer.check()?;
        let labelled = hit.filter(|(hit, _)| hit.surface.kind != SurfaceKind::Triangle);
        Ok(labelled.map(|(hit, depth)| {
            let s = hit.surface;
            Pick { instance: s.instance, label: s.label, voxel: s.voxel, depth }
        }))
    }

    fn seen_surfaces(&mut self, job: &Job) -> Result<Vec<Option<SeenSurface>>, RenderError> {
        let shown = self.shown()?;
        let Film { width, height, .. } = shown.scene.scene().film;
        film_memory::check_labels(width, height, size_of::<Option<SeenSurface>>())?;
        let seen = |pixel: usize| {
            if job.is_cancelled() {
                return None;
            }
            let (x, y) = (pixel % width as usize, pixel / width as usize);
            let (hit, depth) = shown.tracer.pick(x as u32, y as u32)?;
            let s = hit.surface;
            let label = (s.kind != SurfaceKind::Triangle).then_some(s.label);
            Some(SeenSurface { instance: s.instance, label, depth: depth as f32 })
        };
        let surfaces = (0..width as usize * height as usize).into_par_iter().map(seen).collect();
        shown.tracer.check()?;
        if job.is_cancelled() { Err(RenderError::Cancelled) } else { Ok(surfaces) }
    }

    fn rebuilt(&self) -> Rebuilt {
        self.rebuilt
    }

    fn bytes(&self) -> Vec<(&'static str, u64)> {
        self.shown.as_ref().map_or_else(Vec::new, |s| {
            let tracer = s.tracer.tracer();
            vec![
                ("acceleration", tracer.bytes() - tracer.brick_bytes()),
                ("bricks", tracer.brick_bytes()),
                ("film", s.tracer.film().bytes()),
                ("materials", material_bytes(&s.tracer.around().materials)),
                ("emitters", s.tracer.around().lights.emitters().map_or(0, |e| e.bytes())),
            ]
        })
    }
}

//! The CPU behind the [`Renderer`] interface: builds from a scene what paths need, and only that.

use std::sync::Arc;
use std::time::Duration;

use pumice_core::{CompressedVolume, Job, MeshData};
use pumice_picture::film::REPLICATES;
use pumice_picture::{Image, PassSums, Picture, cryptomatte, name_mattes};
use pumice_scene::{
    INSTANCES_OF_A_TREE, InstanceDiff, MeshDiff, Part, Pass, Scene, SceneDiff, SceneError, Spare,
};
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::emitters::{Emitters, Shining};
use pumice_transport::geometry::LodChoice;
use pumice_transport::lights::Lights;
use pumice_transport::looks::Looks;
use pumice_transport::scene_lights::{ReadImage, scene_lights};
use pumice_transport::{Pick, Progress, Rebuilt, RenderError, Renderer, SurfaceKind};

use crate::path::Surroundings;
use crate::path_tracer::PathTracer;
use crate::traverse::{MeshTracer, SceneTracer, TracedInstance, VolumeTracer};

/// See the module.
#[derive(Debug)]
pub struct CpuRenderer {
    read_image: ReadImage,
    shown: Option<Shown>,
    rebuilt: Rebuilt,
    spare: Spare,
}

#[derive(Debug)]
struct Shown {
    scene: Scene,
    volumes: Vec<Arc<CompressedVolume>>,
    meshes: Vec<Arc<MeshData>>,
    lod: LodChoice,
    tracer: PathTracer<SceneTracer>,
    /// Lights but surfaces that shine.
    lights: Arc<Lights>,
}

impl Shown {
    fn has_mattes(&self) -> bool {
        self.scene.film.passes.has_any(Pass::MATTES)
    }
}

/// Those that instances share counted once.
fn bytes_of_looks(looks: &[Arc<Looks>]) -> u64 {
    let mut seen = std::collections::BTreeSet::new();
    looks.iter().filter(|l| seen.insert(Arc::as_ptr(l).addr())).map(|l| l.bytes()).sum()
}

fn no_scene() -> RenderError {
    RenderError::Scene("scene: none was set".into())
}

impl CpuRenderer {
    /// A renderer that shows nothing yet.
    pub fn new(read_image: ReadImage) -> Self {
        Self { read_image, shown: None, rebuilt: Rebuilt::default(), spare: Spare::NONE }
    }

    fn shown(&self) -> Result<&Shown, RenderError> {
        self.shown.as_ref().ok_or_else(no_scene)
    }
}

/// What of a scene shines and can be aimed at.
///
/// # Errors
/// As [`Emitters::new`].
pub fn emitters_of(tracer: &SceneTracer, looks: &[Arc<Looks>]) -> Result<Option<Emitters>, RenderError> {
    let volumes = tracer.volumes().iter().zip(0u32..).filter(|(_, i)| looks[*i as usize].shines());
    let of_volumes = volumes.map(|(v, instance)| Shining::Volume {
        instance,
        volume: v.volume(),
        drawn: v.drawn().to_vec(),
        placement: *v.placement(),
        detail: v.detail(),
        cuts: v.cuts(),
        looks: &looks[instance as usize],
    });
    let first = tracer.volumes().len() as u32;
    let meshes = tracer.meshes().iter().zip(first..).filter(|(_, i)| looks[*i as usize].shines());
    let of_meshes = meshes.map(|(m, instance)| {
        let (mesh, grid) = m.mesh();
        Shining::Mesh { instance, mesh, grid, placement: *m.placement(), looks: &looks[instance as usize] }
    });
    Emitters::new(&of_volumes.chain(of_meshes).collect::<Vec<_>>())
}

/// Whether the same surfaces shine alike, so that what is made to aim at them stays right.
fn shine_alike(a: &SceneTracer, a_looks: &[Arc<Looks>], b: &SceneTracer, b_looks: &[Arc<Looks>]) -> bool {
    let same_looks = a_looks.len() == b_looks.len()
        && a_looks.iter().zip(b_looks).all(|(a, b)| Arc::ptr_eq(a, b) || a.shines_like(b));
    let shines = |i: usize| b_looks[i].shines();
    let volumes = a.volumes().len();
    same_looks
        && volumes == b.volumes().len()
        && (0..volumes).all(|i| !shines(i) || Arc::ptr_eq(&a.volumes()[i], &b.volumes()[i]))
        && a.meshes().iter().zip(b.meshes()).zip(volumes..).all(|((a, b), i)| {
            !shines(i) || (Arc::ptr_eq(a.mesh().0, b.mesh().0) && a.placement() == b.placement())
        })
}

/// What the former scene has to offer for an instance of the new one: its place there, where its volume is the same.
struct Former<'a> {
    shown: &'a Shown,
    place: usize,
    change: InstanceDiff,
}

impl<'a> Former<'a> {
    fn find(
        old: Option<&'a Shown>,
        diff: &SceneDiff,
        id: u32,
        volume: &Arc<CompressedVolume>,
    ) -> Option<Self> {
        let shown = old?;
        let place = shown.scene.instances.iter().position(|i| i.id == id)?;
        // The same path may hold another volume by now.
        Arc::ptr_eq(&shown.volumes[place], volume).then(|| {
            let change = diff.changed.iter().find(|c| c.id == id).copied();
            Self { shown, place, change: change.unwrap_or_default() }
        })
    }

    /// Its materials, where they are still right: colours of neighbours follow from which labels are drawn.
    fn looks(&self, mattes: bool) -> Option<&'a Arc<Looks>> {
        let looks = &self.shown.tracer.around().looks[self.place];
        let same = !self.change.materials && !self.change.visibility && self.shown.has_mattes() == mattes;
        same.then_some(looks)
    }

    /// Its geometry, where the same boxes are still drawn as the same instance; elsewhere, at other levels or cut otherwise if need
    /// be.
    fn geometry(
        &self,
        place: usize,
        scene: &Scene,
        cuts: bool,
        lod: LodChoice,
    ) -> Result<Option<Arc<VolumeTracer>>, RenderError> {
        if self.place != place || self.change.visibility {
            return Ok(None);
        }
        let Some(kept) = self.shown.tracer.tracer().instance(place as u32) else { return Ok(None) };
        let smooth = scene.settings.smooth_voxels;
        let is_as_smooth = self.shown.scene.settings.smooth_voxels == smooth;
        if !self.change.moved && !cuts && self.shown.lod == lod && is_as_smooth {
            return Ok(Some(Arc::clone(kept)));
        }
        let instance = &scene.instances[place];
        let again = kept.again(place as u32, instance.world_from_index, lod)?;
        let made =
            |geometry: VolumeTracer| geometry.with_cuts(scene.cuts_of(instance.id)).shaded_smooth(smooth);
        Ok(again.map(|geometry| Arc::new(made(geometry))))
    }
}

/// The same for a mesh.
struct FormerMesh<'a> {
    shown: &'a Shown,
    place: usize,
    change: MeshDiff,
}

impl<'a> FormerMesh<'a> {
    fn find(old: Option<&'a Shown>, diff: &SceneDiff, id: u32, mesh: &Arc<MeshData>) -> Option<Self> {
        let shown = old?;
        let place = shown.scene.meshes.iter().position(|m| m.id == id)?;
        Arc::ptr_eq(&shown.meshes[place], mesh).then(|| {
            let change = diff.meshes_changed.iter().find(|c| c.id == id).copied();
            Self { shown, place, change: change.unwrap_or_default() }
        })
    }

    fn looks(&self, mattes: bool) -> Option<&'a Arc<Looks>> {
        let instance = self.shown.volumes.len() + self.place;
        // Its source is its name there.
        let renamed = mattes && self.change.geometry;
        (!self.change.materials && !renamed && self.shown.has_mattes() == mattes)
            .then(|| &self.shown.tracer.around().looks[instance])
    }

    /// Its triangles, elsewhere if need be.
    fn geometry(
        &self,
        place: u32,
        instance: u32,
        world_from_mesh: glam::DAffine3,
    ) -> Result<Option<Arc<MeshTracer>>, RenderError> {
        let Some(kept) = self.shown.tracer.tracer().mesh(self.place) else { return Ok(None) };
        Ok(Some(Arc::new(kept.again(place, instance, world_from_mesh)?)))
    }
}

impl Renderer for CpuRenderer {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn carry(&mut self, spare: Spare) {
        (self.spare, self.shown) = (spare, None);
    }

    /// The rest is decided as paths go: its code is always there, and asked only by what a scene has.
    fn can_carry(&self) -> Spare {
        let parts =
            [Part::HiddenLabels, Part::Levels, Part::Clear, Part::Sorting, Part::Mattes, Part::InstanceTree];
        parts.into_iter().fold(Spare::NONE, Spare::with)
    }

    fn set_scene(
        &mut self,
        scene: &Scene,
        volumes: &[Arc<CompressedVolume>],
        meshes: &[Arc<MeshData>],
    ) -> Result<(), RenderError> {
        let fault = |e: SceneError| RenderError::Scene(e.to_string());
        scene.validate().map_err(fault)?;
        pumice_transport::check_counts(scene, volumes, meshes)?;
        let old = self.shown.as_ref();
        let diff = SceneDiff::between(old.map(|o| &o.scene), scene);
        let mut rebuilt = self.rebuilt;

        let lights = match old {
            Some(o) if !diff.world && !diff.suns && !diff.lights => Arc::clone(&o.lights),
            _ => {
                rebuilt.lights += 1;
                Arc::new(scene_lights(scene, self.read_image)?)
            }
        };
        let lod = LodChoice::new(scene.settings.lod, &scene.camera, &scene.film);
        let mattes = scene.film.passes.has_any(Pass::MATTES) || self.spare.has(Part::Mattes);
        let lod = if self.spare.has(Part::Levels) { lod.carrying_levels() } else { lod };
        let carry_clear =
            |looks: Looks| Arc::new(if self.spare.has(Part::Clear) { looks.carrying_clear() } else { looks });
        let mut looks = Vec::with_capacity(volumes.len());
        let mut geometry = Vec::with_capacity(volumes.len());
        for (place, (instance, volume)) in scene.instances.iter().zip(volumes).enumerate() {
            let former = Former::find(old, &diff, instance.id, volume);
            let twin = (0..place).find(|&other| {
                Arc::ptr_eq(&volumes[other], volume)
                    && scene.instances[other].style.show == instance.style.show
            });
            let kept_looks = former.as_ref().and_then(|f| f.looks(mattes)).or_else(|| {
                let alike = twin.filter(|&other| scene.instances[other].style == instance.style)?;
                looks.get(alike)
            });
            let kept_looks = kept_looks.map(Arc::clone);
            let kept_geometry = match &former {
                Some(f) => f.geometry(place, scene, diff.cuts, lod)?,
                None => None,
            };
            let kept_geometry = match (kept_geometry, twin) {
                (None, Some(other)) => {
                    let twin: &Arc<VolumeTracer> = &geometry[other];
                    let again = twin.again(place as u32, instance.world_from_index, lod)?;
                    let cuts = scene.cuts_of(instance.id);
                    let smooth = scene.settings.smooth_voxels;
                    again.map(|g| Arc::new(g.with_cuts(cuts).shaded_smooth(smooth)))
                }
                (kept, _) => kept,
            };
            let table = volume.labels();
            let visible = if kept_looks.is_none() || kept_geometry.is_none() {
                let field = format!("instances[{place}].style.show");
                instance.style.show.resolve(&field, table.ids()).map_err(fault)?
            } else {
                Vec::new()
            };
            looks.push(match kept_looks {
                Some(kept) => kept,
                None => {
                    rebuilt.materials += 1;
                    let touching = table.contacts().iter();
                    let looks = Looks::new(&instance.style, table.ids(), touching, &visible);
                    let ids = if mattes { cryptomatte::ids_of_volume(table) } else { Vec::new() };
                    carry_clear(looks.with_ids(ids))
                }
            });
            geometry.push(match kept_geometry {
                Some(kept) => kept,
                None => {
                    rebuilt.acceleration += 1;
                    let traced = TracedInstance {
                        volume: Arc::clone(volume),
                        world_from_index: instance.world_from_index,
                        visible,
                        lod,
                    };
                    let geometry = match self.spare.has(Part::HiddenLabels) {
                        true => VolumeTracer::carrying_hidden(place as u32, &traced)?,
                        false => VolumeTracer::new(place as u32, &traced)?,
                    };
                    let geometry = geometry.with_bricks().with_cuts(scene.cuts_of(instance.id));
                    Arc::new(geometry.shaded_smooth(scene.settings.smooth_voxels))
                }
            });
        }
        let mut triangles = Vec::with_capacity(meshes.len());
        for ((place, mesh), data) in (0u32..).zip(&scene.meshes).zip(meshes) {
            let former = FormerMesh::find(old, &diff, mesh.id, data);
            looks.push(match former.as_ref().and_then(|f| f.looks(mattes)) {
                Some(kept) => Arc::clone(kept),
                None => {
                    rebuilt.materials += 1;
                    let ids = if mattes { cryptomatte::ids_of_mesh(&mesh.source) } else { Vec::new() };
                    let looks = Looks::of_mesh(&mesh.materials).catching(mesh.shadow_catcher);
                    carry_clear(looks.with_ids(ids))
                }
            });
            let instance = volumes.len() as u32 + place;
            let twin = || triangles.iter().find(|other: &&Arc<MeshTracer>| Arc::ptr_eq(other.mesh().0, data));
            let kept = match (&former, twin()) {
                (Some(f), _) => f.geometry(place, instance, mesh.world_from_mesh)?,
                (None, Some(twin)) => Some(Arc::new(twin.again(place, instance, mesh.world_from_mesh)?)),
                (None, None) => None,
            };
            triangles.push(match kept {
                Some(kept) => kept,
                None => {
                    rebuilt.acceleration += 1;
                    Arc::new(MeshTracer::new(place, instance, data, mesh.world_from_mesh)?)
                }
            });
        }
        let least = if self.spare.has(Part::InstanceTree) { 1 } else { INSTANCES_OF_A_TREE };
        let former = old.map(|o| o.tracer.tracer());
        let (geometry, made) = SceneTracer::of(geometry).with_meshes(triangles).with_tree(former, least)?;
        rebuilt.top_level += u64::from(made);
        let catches: Vec<bool> = scene.meshes.iter().map(|m| m.shadow_catcher).collect();
        let geometry = geometry.with_catchers(&catches);
        let emitters = match old {
            Some(o) if shine_alike(o.tracer.tracer(), &o.tracer.around().looks, &geometry, &looks) => {
                o.tracer.around().lights.emitters().map(Arc::clone)
            }
            _ => {
                let made = emitters_of(&geometry, &looks)?.map(Arc::new);
                rebuilt.lights += u64::from(made.is_some());
                made
            }
        };
        let lit = match emitters {
            None => Arc::clone(&lights),
            some => Arc::new(Lights::clone(&lights).with_emitters(some)),
        };
        let around = Surroundings { lights: lit, looks: looks.into(), settings: scene.settings };
        rebuilt.camera += u64::from(diff.camera || diff.film);
        rebuilt.film += u64::from(diff.film);
        let kept = PassSums::of(&scene.film, catches.contains(&true));
        let mut tracer = match self.shown.take() {
            Some(Shown { mut tracer, .. }) if !diff.film && tracer.film().kept() == kept => {
                let camera = diff.camera.then(|| CameraRays::new(&scene.camera, &scene.film));
                tracer.restart(geometry, around, camera);
                tracer
            }
            _ => PathTracer::new(geometry, around, &scene.camera, &scene.film),
        };
        tracer.carry_sorting(self.spare.has(Part::Sorting));
        self.rebuilt = rebuilt;
        let (volumes, meshes) = (volumes.to_vec(), meshes.to_vec());
        self.shown = Some(Shown { scene: scene.clone(), volumes, meshes, lod, tracer, lights });
        Ok(())
    }

    fn advance(&mut self, slice: Duration, spp_limit: u32, job: &Job) -> Result<Progress, RenderError> {
        match &mut self.shown {
            Some(shown) => shown.tracer.advance(slice, spp_limit, job),
            None => Err(no_scene()),
        }
    }

    fn color(&mut self) -> Result<Image, RenderError> {
        Ok(self.shown()?.tracer.film().mean())
    }

    fn alpha(&mut self) -> Result<Option<Vec<f32>>, RenderError> {
        Ok(self.shown()?.tracer.film().alpha())
    }

    fn variance(&mut self) -> Result<Option<Image>, RenderError> {
        let film = self.shown()?.tracer.film();
        Ok((film.spp() >= REPLICATES).then(|| film.variance()))
    }

    fn picture(&mut self) -> Result<Picture, RenderError> {
        let shown = self.shown()?;
        let mut picture = shown.tracer.picture();
        name_mattes(&mut picture, &shown.scene, &shown.volumes);
        Ok(picture)
    }

    fn pick(&mut self, x: u32, y: u32) -> Result<Option<Pick>, RenderError> {
        let shown = self.shown()?;
        let film = &shown.scene.film;
        let hit = if x < film.width && y < film.height { shown.tracer.pick(x, y) } else { None };
        let labelled = hit.filter(|(hit, _)| hit.surface.kind != SurfaceKind::Triangle);
        Ok(labelled.map(|(hit, depth)| {
            let s = hit.surface;
            Pick { instance: s.instance, label: s.label, voxel: s.voxel, depth }
        }))
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
                ("materials", bytes_of_looks(&s.tracer.around().looks)),
                ("emitters", s.tracer.around().lights.emitters().map_or(0, |e| e.bytes())),
            ]
        })
    }
}

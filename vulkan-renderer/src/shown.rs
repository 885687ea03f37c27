//! What a renderer shows: a scene, its parts on the device, the film. A new scene takes from the former what is still right.

use std::sync::Arc;
use std::time::Duration;

use bytemuck::Zeroable as _;
use glam::DAffine3;
use pumice_core::{CompressedVolume, Job, MeshData};
use pumice_picture::{FilmBuffer, Image, PassSums, Picture, cryptomatte, name_mattes};
use pumice_scene::{INSTANCES_OF_A_TREE, InstanceDiff, MeshDiff, Part, Pass, Scene, SceneDiff};
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::emitters::Shining;
use pumice_transport::geometry::{Cuts, LodChoice, MeshGrid, Placement, mesh_placement};
use pumice_transport::{Emitters, Looks, Pick, ReadImage, Rebuilt, RenderError, SurfaceKind, scene_lights};

use crate::device::{Backend, Buffer, DeviceError};
use crate::film::Film;
use crate::layout::{FirstRecord, HitRecord, Launch, NONE};
use crate::machine::Machine;
use crate::pack::{self, ShaderNeeds};
use crate::scene::{
    Boxes, CutsOnDevice, EmittersOnDevice, Fault, FilterOnDevice, InstanceOnDevice, LooksOnDevice,
    MeshOnDevice, Nodes, SceneOnDevice, SkyOnDevice, TreeOnDevice, Triangles,
};
use crate::sent::Sent;
use crate::shaders::Entry;
use crate::slices::{Cursor, Tile};

/// See the module.
#[derive(Debug)]
pub(crate) struct Shown {
    scene: Scene,
    volumes: Vec<Arc<CompressedVolume>>,
    meshes: Vec<Arc<MeshData>>,
    lod: LodChoice,
    parts: SceneOnDevice,
    pub(crate) film: Film,
    constants: Vec<u32>,
}

/// How often what was made and sent, by all scenes so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Counters {
    pub(crate) rebuilt: Rebuilt,
    pub(crate) sent: Sent,
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

    fn parts(&self) -> &'a InstanceOnDevice {
        &self.shown.parts.instances[self.place]
    }

    /// Its materials, where they are still right: colours of neighbours follow from which labels are drawn.
    fn looks(&self, mattes: bool) -> Option<&'a Arc<LooksOnDevice>> {
        let same = !self.change.materials && !self.change.visibility && self.shown.has_mattes() == mattes;
        same.then(|| &self.parts().looks)
    }

    /// Its boxes, where the same ones are drawn as the same instance and at the same kind of detail.
    fn boxes(&self, place: usize, lod: LodChoice, smooth: bool) -> Option<&'a Arc<Boxes>> {
        let boxes = &self.parts().boxes;
        let same = !self.change.visibility && boxes.are_at(lod) && boxes.is_smooth() == smooth;
        (self.place == place && same).then_some(boxes)
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

    fn looks(&self, mattes: bool) -> Option<&'a Arc<LooksOnDevice>> {
        // Its source is its name there.
        let renamed = mattes && self.change.geometry;
        (!self.change.materials && !renamed && self.shown.has_mattes() == mattes)
            .then(|| &self.shown.parts.meshes[self.place].looks)
    }

    /// Its triangles, where they are still the same instance's: a hierarchy knows its number.
    fn triangles(&self, instance: usize) -> Option<&'a Arc<Triangles>> {
        let same = self.shown.volumes.len() + self.place == instance;
        same.then(|| &self.shown.parts.meshes[self.place].triangles)
    }
}

impl Shown {
    /// Puts a valid scene on the device. The former one gives its film away, and nothing where the new one cannot be shown because
    /// of a fault in it.
    pub(crate) fn new(
        machine: &mut Machine,
        former: &mut Option<Self>,
        scene: &Scene,
        volumes: &[Arc<CompressedVolume>],
        meshes: &[Arc<MeshData>],
        read_image: ReadImage,
        counters: &mut Counters,
    ) -> Result<Self, Fault> {
        let mut counted = *counters;
        let old = former.as_ref();
        let diff = SceneDiff::between(old.map(|o| &o.scene), scene);
        let lod = LodChoice::new(scene.settings.lod, &scene.camera, &scene.film);
        let lod = if machine.spare.has(Part::Levels) { lod.carrying_levels() } else { lod };
        let parts = parts_of(machine, old, &diff, scene, volumes, meshes, lod, read_image, &mut counted)?;
        let of_meshes = parts.meshes.iter().map(|m| &m.looks.packed);
        let mut needs = ShaderNeeds::new(
            &scene.camera,
            &scene.film,
            &scene.settings,
            &parts.sky.lights,
            parts.instances.iter().map(|i| &i.looks.packed).chain(of_meshes),
            parts.instances.iter().any(|i| !i.cuts.cuts.is_empty()),
            !meshes.is_empty(),
        );
        needs.emitters = parts.emitters.is_some();
        needs.instance_tree = parts.tree.is_some();
        needs.aim |= needs.emitters;
        needs.bricks = parts.instances.iter().any(|i| i.boxes.has_bricks());
        needs.boxes = parts.instances.iter().any(|i| !i.boxes.has_bricks());
        needs.smooth = scene.settings.smooth_voxels || meshes.iter().any(|mesh| mesh.is_smooth());
        let size = [scene.film.width, scene.film.height];
        let kept = kept_of(scene);
        let film = match former.take() {
            Some(Self { mut film, .. }) if film.size == size && film.copy().kept() == kept => {
                film.clear(&machine.gpu, scene.settings.adaptive)?;
                film
            }
            // The former film's memory may be what the new one needs.
            other => {
                drop(other);
                Film::new(&machine.gpu, size, kept, scene.settings.adaptive)?
            }
        };
        counted.rebuilt.camera += u64::from(diff.camera || diff.film);
        counted.rebuilt.film += u64::from(diff.film);
        *counters = counted;
        machine.slices.be_careful();
        machine.slices_of_firsts.be_careful();
        Ok(Self {
            scene: scene.clone(),
            volumes: volumes.to_vec(),
            meshes: meshes.to_vec(),
            lod,
            parts,
            film,
            constants: pack::carrying(needs.constants().to_vec(), machine.spare),
        })
    }

    /// The same scene and samples on another device.
    pub(crate) fn again(
        self,
        machine: &mut Machine,
        read_image: ReadImage,
        counters: &mut Counters,
    ) -> Result<Self, Fault> {
        let Self { scene, volumes, meshes, lod, mut film, constants, parts } = self;
        // Of the lost device: given back before its successor is asked for as much.
        drop(parts);
        let diff = SceneDiff::between(None, &scene);
        let parts = parts_of(machine, None, &diff, &scene, &volumes, &meshes, lod, read_image, counters)?;
        film.again(&machine.gpu)?;
        Ok(Self { scene, volumes, meshes, lod, parts, film, constants })
    }

    /// One launch of a pass that brings every pixel to `target` samples, or of the pass that is under way. True when the pass is
    /// done.
    pub(crate) fn launch(
        &mut self,
        machine: &mut Machine,
        target: u32,
        job: &Job,
    ) -> Result<bool, DeviceError> {
        let film = &mut self.film;
        let (target, at) = *film.pass.get_or_insert((target, Cursor::default()));
        let samples = target - film.spp;
        let Some((tile, after)) = machine.slices.next(film.size, at, samples) else {
            (film.spp, film.pass) = (target, None);
            return Ok(true);
        };
        let launch = Launch {
            scene: self.parts.address(),
            input: film.pass_sums.as_ref().map_or(0, Buffer::address),
            output: film.sums.address(),
            resting: film.resting.as_ref().map_or(0, Buffer::address),
            first_sample: film.spp,
            samples,
            ..launch_of(&tile)
        };
        let program = machine.program(Entry::Path, &self.constants)?;
        let taken = program.run("a launch of samples", &launch, [tile.width, tile.height])?;
        machine.slices.learn(tile.pixels(), samples, taken.as_secs_f64());
        job.advance(tile.pixels() * u64::from(samples));
        film.pass = Some((target, after));
        if after.y >= film.size[1] {
            (film.spp, film.pass) = (target, None);
        }
        Ok(film.pass.is_none())
    }

    /// The first surface through the middle of a pixel of the film.
    pub(crate) fn pick(&self, machine: &mut Machine, x: u32, y: u32) -> Result<Option<Pick>, DeviceError> {
        let [width, height] = self.film.size;
        if x >= width || y >= height {
            return Ok(None);
        }
        let mut hit = [HitRecord::zeroed()];
        let tile = Tile { x, y, width: 1, height: 1 };
        self.first(machine, &tile, 1, bytemuck::cast_slice_mut(&mut hit))?;
        let [HitRecord { t: depth, surface: s, .. }] = hit;
        let labelled = s.instance != NONE && s.face >> 3 != SurfaceKind::Triangle as u32;
        Ok(labelled.then_some(Pick { instance: s.instance, label: s.label, voxel: s.voxel, depth }))
    }

    /// The picture so far: its colours from the host's copy of the film, its passes from the device.
    pub(crate) fn picture(&self, machine: &mut Machine) -> Result<Picture, DeviceError> {
        let [width, height] = self.film.size;
        let mut firsts = vec![FirstRecord::zeroed(); width as usize * height as usize];
        let mut at = Cursor::default();
        while let Some((tile, after)) = machine.slices_of_firsts.next([width, height], at, 1) {
            let mut records = vec![FirstRecord::zeroed(); tile.pixels() as usize];
            let taken = self.first(machine, &tile, 0, bytemuck::cast_slice_mut(&mut records))?;
            machine.slices_of_firsts.learn(tile.pixels(), 1, taken.as_secs_f64());
            for (row, y) in records.chunks(tile.width as usize).zip(tile.y..) {
                let place = y as usize * width as usize + tile.x as usize;
                firsts[place..][..row.len()].copy_from_slice(row);
            }
            at = after;
        }
        let (width, height) = (width as usize, height as usize);
        let image =
            |f: fn(&FirstRecord) -> [f32; 3]| Image::new(width, height, firsts.iter().map(f).collect());
        let film: &FilmBuffer = self.film.copy();
        let spp = film.spp();
        let picture = Picture {
            variance: (spp >= pumice_picture::film::REPLICATES).then(|| film.variance()),
            depth: Some(firsts.iter().map(|f| f.depth).collect()),
            label: Some(firsts.iter().map(|f| f.label).collect()),
            albedo: Some(image(|f| f.albedo)),
            normal: Some(image(|f| f.normal)),
            position: Some(image(|f| f.position)),
            ..Picture::of(film.mean())
        };
        let mut picture = film.passes_into(picture, self.scene.film.passes);
        name_mattes(&mut picture, &self.scene, &self.volumes);
        Ok(picture)
    }

    fn has_mattes(&self) -> bool {
        self.scene.film.passes.has_any(Pass::MATTES)
    }

    /// First surfaces of a tile; how long the launch took.
    fn first(
        &self,
        machine: &mut Machine,
        tile: &Tile,
        wanted: u32,
        records: &mut [u8],
    ) -> Result<Duration, DeviceError> {
        let output = machine.gpu.buffer("first surfaces", records.len() as u64)?;
        let launch =
            Launch { scene: self.parts.address(), output: output.address(), wanted, ..launch_of(tile) };
        let program = machine.program(Entry::First, &[])?;
        let taken = program.run("first surfaces", &launch, [tile.width, tile.height])?;
        machine.gpu.download(&output, 0, records)?;
        Ok(taken)
    }

    /// Bytes on the device by part.
    pub(crate) fn bytes(&self) -> Vec<(&'static str, u64)> {
        let mut bytes = self.parts.bytes().to_vec();
        bytes.push(("film", self.film.bytes()));
        bytes
    }
}

fn launch_of(tile: &Tile) -> Launch {
    Launch {
        tile_x: tile.x,
        tile_y: tile.y,
        tile_width: tile.width,
        tile_height: tile.height,
        ..Launch::default()
    }
}

/// The parts of a scene, from the former one's where they are still right.
#[expect(clippy::too_many_arguments, reason = "all that decides what is made anew")]
fn parts_of(
    machine: &Machine,
    old: Option<&Shown>,
    diff: &SceneDiff,
    scene: &Scene,
    volumes: &[Arc<CompressedVolume>],
    meshes: &[Arc<MeshData>],
    lod: LodChoice,
    read_image: ReadImage,
    counters: &mut Counters,
) -> Result<SceneOnDevice, Fault> {
    let gpu = &machine.gpu;
    let sky = match old {
        Some(o) if !diff.world && !diff.suns && !diff.lights => Arc::clone(&o.parts.sky),
        _ => {
            counters.rebuilt.lights += 1;
            counters.sent.lights += 1;
            Arc::new(SkyOnDevice::new(gpu, scene_lights(scene, read_image)?)?)
        }
    };
    let filter = match old {
        Some(o) if o.scene.film.filter == scene.film.filter => Arc::clone(&o.parts.filter),
        _ => {
            counters.sent.filter += 1;
            Arc::new(FilterOnDevice::new(gpu, &scene.film.filter)?)
        }
    };
    let mut instances: Vec<InstanceOnDevice> = Vec::with_capacity(volumes.len());
    for (place, (instance, volume)) in scene.instances.iter().zip(volumes).enumerate() {
        let former = Former::find(old, diff, instance.id, volume);
        let made = instance_of(machine, former.as_ref(), place, scene, volume, lod, &instances, counters)?;
        instances.push(made);
    }
    let mut on_device: Vec<MeshOnDevice> = Vec::with_capacity(meshes.len());
    for (place, (mesh, data)) in scene.meshes.iter().zip(meshes).enumerate() {
        let former = FormerMesh::find(old, diff, mesh.id, data);
        let twin = (0..place).find(|&other| Arc::ptr_eq(&meshes[other], data)).map(|other| &on_device[other]);
        let made = mesh_of(machine, former.as_ref(), twin, place, volumes.len(), scene, data, counters)?;
        on_device.push(made);
    }
    let emitters = match old {
        Some(o) if shine_alike(&o.parts, &instances, &on_device) => o.parts.emitters.clone(),
        _ => {
            let made = emitters_of(scene, volumes, meshes, &instances, &on_device)?;
            counters.rebuilt.lights += u64::from(made.is_some());
            counters.sent.lights += u64::from(made.is_some());
            made.map(|made| EmittersOnDevice::new(gpu, &made).map(Arc::new)).transpose()?
        }
    };
    let least = if machine.spare.has(Part::InstanceTree) { 1 } else { INSTANCES_OF_A_TREE };
    let former = old.and_then(|o| o.parts.tree.as_ref());
    let (tree, made) = TreeOnDevice::new(gpu, former, &instances, &on_device, least)?;
    counters.rebuilt.top_level += u64::from(made);
    counters.sent.header += 1;
    let rays = CameraRays::new(&scene.camera, &scene.film);
    let settings = pack::settings(&scene.settings, kept_of(scene));
    let tables = &machine.tables;
    Ok(SceneOnDevice::new(gpu, tables, instances, on_device, sky, emitters, filter, tree, &rays, settings)?)
}

/// What a scene's film keeps for passes.
fn kept_of(scene: &Scene) -> PassSums {
    PassSums::of(&scene.film, scene.meshes.iter().any(|mesh| mesh.shadow_catcher))
}

/// What of a scene shines and can be aimed at.
fn emitters_of(
    scene: &Scene,
    volumes: &[Arc<CompressedVolume>],
    meshes: &[Arc<MeshData>],
    instances: &[InstanceOnDevice],
    on_device: &[MeshOnDevice],
) -> Result<Option<Emitters>, RenderError> {
    let mut grids = Vec::new();
    for (place, (mesh, data)) in (0u32..).zip(on_device.iter().zip(meshes)) {
        grids.push(if mesh.looks.looks.shines() { Some(MeshGrid::new(place, data)?) } else { None });
    }
    let mut shining = Vec::new();
    for (place, (instance, volume)) in instances.iter().zip(volumes).enumerate() {
        if !instance.looks.looks.shines() {
            continue;
        }
        let field = format!("instances[{place}].style.show");
        let visible = scene.instances[place].style.show.resolve(&field, volume.labels().ids());
        let visible = visible.map_err(|e| RenderError::Scene(e.to_string()))?;
        let (mut drawn, mut number) = (Vec::new(), 0);
        volume.for_each_box(|label, _| {
            if visible[label as usize] {
                drawn.push(number);
            }
            number += 1;
        });
        shining.push(Shining::Volume {
            instance: place as u32,
            volume,
            drawn,
            placement: instance.placement,
            detail: instance.lod.placed(&instance.placement.world_from_index),
            cuts: &instance.cuts.cuts,
            looks: &instance.looks.looks,
        });
    }
    for (place, (mesh, data)) in on_device.iter().zip(meshes).enumerate() {
        if let Some(grid) = &grids[place] {
            shining.push(Shining::Mesh {
                instance: (instances.len() + place) as u32,
                mesh: data,
                grid,
                placement: mesh.placement,
                looks: &mesh.looks.looks,
            });
        }
    }
    Emitters::new(&shining)
}

/// Whether the same surfaces shine alike, so that what is made to aim at them stays right.
fn shine_alike(old: &SceneOnDevice, instances: &[InstanceOnDevice], meshes: &[MeshOnDevice]) -> bool {
    let like =
        |a: &Arc<LooksOnDevice>, b: &Arc<LooksOnDevice>| Arc::ptr_eq(a, b) || a.looks.shines_like(&b.looks);
    old.instances.len() == instances.len()
        && old.meshes.len() == meshes.len()
        && old.instances.iter().zip(instances).all(|(a, b)| {
            let same = Arc::ptr_eq(&a.boxes, &b.boxes)
                && Arc::ptr_eq(&a.cuts, &b.cuts)
                && a.placement == b.placement
                && a.lod == b.lod;
            like(&a.looks, &b.looks) && (same || !b.looks.looks.shines())
        })
        && old.meshes.iter().zip(meshes).all(|(a, b)| {
            let same = Arc::ptr_eq(&a.triangles, &b.triangles) && a.placement == b.placement;
            like(&a.looks, &b.looks) && (same || !b.looks.looks.shines())
        })
}

/// One instance; `before` are those that come before it in the scene.
#[expect(clippy::too_many_arguments, reason = "as parts_of")]
fn instance_of(
    machine: &Machine,
    former: Option<&Former<'_>>,
    place: usize,
    scene: &Scene,
    volume: &Arc<CompressedVolume>,
    lod: LodChoice,
    before: &[InstanceOnDevice],
    counters: &mut Counters,
) -> Result<InstanceOnDevice, Fault> {
    let gpu = &machine.gpu;
    let instance = &scene.instances[place];
    let smooth = scene.settings.smooth_voxels;
    let table = volume.labels();
    let mattes = scene.film.passes.has_any(Pass::MATTES) || machine.spare.has(Part::Mattes);
    // Of the same labels of the same volume; and in the same colours.
    let twin = (0..place).find(|&other| {
        before[other].boxes.nodes().is_of(volume) && scene.instances[other].style.show == instance.style.show
    });
    let alike = twin.filter(|&other| scene.instances[other].style == instance.style);
    let kept_looks = former.and_then(|f| f.looks(mattes)).or_else(|| Some(&before[alike?].looks));
    // The intersection shader of a pipeline knows an instance by its hierarchy.
    let sharing = gpu.backend() != Backend::RayPipeline;
    let kept_boxes = former.and_then(|f| f.boxes(place, lod, smooth));
    let kept_boxes = kept_boxes.or_else(|| Some(&before[twin.filter(|_| sharing)?].boxes));
    let visible = if kept_looks.is_none() || kept_boxes.is_none() {
        let field = format!("instances[{place}].style.show");
        let resolved = instance.style.show.resolve(&field, table.ids());
        resolved.map_err(|e| RenderError::Scene(e.to_string()))?
    } else {
        Vec::new()
    };
    let looks = match kept_looks {
        Some(kept) => Arc::clone(kept),
        None => {
            counters.rebuilt.materials += 1;
            counters.sent.materials += 1;
            let looks = Looks::new(&instance.style, table.ids(), table.contacts().iter(), &visible);
            let ids = if mattes { cryptomatte::ids_of_volume(table) } else { Vec::new() };
            Arc::new(LooksOnDevice::new(gpu, looks.with_ids(ids))?)
        }
    };
    let boxes = match kept_boxes {
        Some(kept) => Arc::clone(kept),
        None => {
            counters.rebuilt.acceleration += 1;
            counters.sent.boxes += 1;
            // The same volume may be on the device already, with all that is wanted now.
            let here = former.map(|f| f.parts().boxes.nodes());
            let here = here.into_iter().chain(before.iter().map(|i| i.boxes.nodes()));
            let carry_hidden = machine.spare.has(Part::HiddenLabels);
            let all = vec![true; visible.len()];
            let wanted = if carry_hidden { &all } else { &visible };
            let known = here.filter(|n| n.is_of(volume)).find(|n| n.covers(wanted)).map(Arc::clone);
            let nodes = match known {
                Some(nodes) => nodes,
                None => {
                    counters.sent.nodes += 1;
                    Arc::new(Nodes::new(gpu, volume, wanted)?)
                }
            };
            Arc::new(Boxes::new(gpu, place as u32, volume, nodes, &visible, lod, smooth, carry_hidden)?)
        }
    };
    let placement = placement(place, instance.world_from_index)?;
    let cuts = Cuts::new(scene.cuts_of(instance.id), &instance.world_from_index);
    let cuts = match former.map(|f| &f.parts().cuts).filter(|kept| kept.cuts == cuts) {
        Some(kept) => Arc::clone(kept),
        None => {
            counters.sent.cuts += u64::from(!cuts.is_empty());
            Arc::new(CutsOnDevice::new(gpu, cuts)?)
        }
    };
    Ok(InstanceOnDevice { boxes, looks, cuts, placement, lod })
}

/// One mesh; it comes after all `volumes`. `twin` has the same triangles.
#[expect(clippy::too_many_arguments, reason = "as parts_of")]
fn mesh_of(
    machine: &Machine,
    former: Option<&FormerMesh<'_>>,
    twin: Option<&MeshOnDevice>,
    place: usize,
    volumes: usize,
    scene: &Scene,
    data: &MeshData,
    counters: &mut Counters,
) -> Result<MeshOnDevice, Fault> {
    let gpu = &machine.gpu;
    let mesh = &scene.meshes[place];
    let mattes = scene.film.passes.has_any(Pass::MATTES) || machine.spare.has(Part::Mattes);
    let looks = match former.and_then(|f| f.looks(mattes)) {
        Some(kept) => Arc::clone(kept),
        None => {
            counters.rebuilt.materials += 1;
            counters.sent.materials += 1;
            let ids = if mattes { cryptomatte::ids_of_mesh(&mesh.source) } else { Vec::new() };
            let looks = Looks::of_mesh(&mesh.materials).catching(mesh.shadow_catcher);
            Arc::new(LooksOnDevice::new(gpu, looks.with_ids(ids))?)
        }
    };
    let instance = volumes + place;
    let shared = twin.filter(|_| gpu.backend() != Backend::RayPipeline).map(|t| &t.triangles);
    let triangles = match former.and_then(|f| f.triangles(instance)).or(shared) {
        Some(kept) => Arc::clone(kept),
        None => {
            counters.rebuilt.acceleration += 1;
            counters.sent.boxes += 1;
            Arc::new(Triangles::new(gpu, place as u32, instance as u32, data)?)
        }
    };
    let placement = mesh_placement(place as u32, triangles.mesh_from_grid(), mesh.world_from_mesh)?;
    Ok(MeshOnDevice { triangles, looks, placement })
}

fn placement(place: usize, world_from_index: DAffine3) -> Result<Placement, RenderError> {
    Placement::of_instance(place as u32, world_from_index)
}

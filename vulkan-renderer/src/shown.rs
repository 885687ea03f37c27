//! What a renderer shows: a scene, its parts on the device, and the film. A new scene reuses those parts of the former one that are still
//! valid.

use std::iter::repeat_n;
use std::sync::Arc;
use std::time::Duration;

use bytemuck::Zeroable as _;
use pumice_core::Job;
use pumice_core::reserve::{collected, zeroed};
use pumice_picture::denoise::WelchTest;
use pumice_picture::film::{CLASSES, DEGREES_OF_FREEDOM, PICTURE, variance_known};
use pumice_picture::{FilmBuffer, Image, Picture, cryptomatte, film_memory, name_labels, name_mattes};
use pumice_scene::{Part, PartSet};
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::emitters::EmissiveGeometry;
use pumice_transport::geometry::{Contacts, Cuts, LodChoice, MeshGrid, Placement, mesh_placement};
use pumice_transport::scene_plan::{InstancePlan, MeshPlan, Reuse, ScenePlan, Source, sums_of};
use pumice_transport::{
    Emitters, LoadedScene, MaterialTable, Pick, ReadImage, Rebuilt, RenderError, SeenSurface, SurfaceKind,
    scene_lights,
};

use crate::denoise::{Noisy, PictureDenoiser};
use crate::device::{Backend, Buffer, DeviceError};
use crate::film::Film;
use crate::layout::{HitRecord, Launch, NONE, SurfaceAovsRecord, SurfaceRecord};
use crate::machine::DeviceContext;
use crate::pack::{self, ShaderNeeds};
use crate::pages::{PagedVolume, ScenePages};
use crate::scene::{
    Boxes, CutsOnDevice, Drawn, EmittersOnDevice, FilterOnDevice, Former, InstanceOnDevice,
    MaterialsOnDevice, MeshOnDevice, Nodes, SceneOnDevice, SceneParts, SkyOnDevice, TreeOnDevice, Triangles,
    UploadError,
};
use crate::sent::Sent;
use crate::shaders::Entry;
use crate::slices::{Cursor, Tile};

/// A scene on the device with its film.
#[derive(Debug)]
pub(crate) struct Shown {
    scene: LoadedScene,
    on_device: SceneOnDevice,
    /// Pages of volumes on disk, where there are any.
    pages: Option<ScenePages>,
    pub(crate) film: Film,
    needs: ShaderNeeds,
    /// Memory for denoising with the scene's guides, once it was asked for.
    denoiser: Option<PictureDenoiser>,
}

/// How often each part was rebuilt and sent, over all scenes so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Counters {
    pub(crate) rebuilt: Rebuilt,
    pub(crate) sent: Sent,
}

impl Shown {
    /// Puts a scene on the device. It takes over the film of the former scene. If the new scene is at fault and cannot be shown, the former
    /// one stays as it is.
    pub(crate) fn new(
        machine: &mut DeviceContext,
        former: &mut Option<Self>,
        scene: &LoadedScene,
        read_image: ReadImage,
        counters: &mut Counters,
    ) -> Result<Self, UploadError> {
        let mut counted = *counters;
        let plan = ScenePlan::between(former.as_ref().map(|o| &o.scene), scene);
        let parts = Making::new(machine, scene, former.as_ref(), &mut counted).parts(&plan, read_image)?;
        let s = scene.scene();
        let empty_film = || -> Result<FilmBuffer, RenderError> {
            let mut copy = FilmBuffer::with_passes(s.film.width, s.film.height, sums_of(s))?;
            copy.rest_by(s.settings.adaptive)?;
            Ok(copy)
        };
        // The host's copy of another film comes first: where the host has no memory for it, the former scene stays. From here on only
        // the device can fail, and then the former scene is given up.
        let another = if plan.sums == Reuse::Keep { None } else { Some(empty_film()?) };
        let pages = scene_pages(machine, &parts, former.as_mut().map(|f| &mut f.pages))?;
        let on_device = scene_on_device(machine, scene, parts, pages.as_ref())?;
        let parts = &on_device.parts;
        let needs = ShaderNeeds {
            parts: scene.needs().parts(),
            instance_tree: parts.tree.is_some(),
            bricks: parts.instances.iter().any(|i| i.boxes.has_bricks()),
            boxes: parts.instances.iter().any(|i| i.boxes.has_boxes()),
            pages: pages.is_some(),
        };
        let film = match (another, former.take()) {
            (None, Some(Self { mut film, .. })) => {
                film.clear(&machine.gpu, s.settings.adaptive)?;
                film
            }
            (another, old) => {
                // Free the former film now: the new one may need its memory on the device.
                drop(old);
                let copy = match another {
                    Some(copy) => copy,
                    None => empty_film()?,
                };
                Film::new(&machine.gpu, copy)?
            }
        };
        counted.rebuilt.camera += u64::from(plan.camera.is_build());
        counted.rebuilt.film += u64::from(plan.film.is_build());
        *counters = counted;
        machine.slices.be_careful();
        machine.slices_of_firsts.be_careful();
        Ok(Self { scene: scene.clone(), on_device, pages, film, needs, denoiser: None })
    }

    /// Puts the same scene and samples on another device.
    pub(crate) fn again(
        self,
        machine: &mut DeviceContext,
        read_image: ReadImage,
        counters: &mut Counters,
    ) -> Result<Self, UploadError> {
        let Self { scene, mut film, needs, on_device, pages, denoiser } = self;
        // They are of the lost device. Free them before as much is allocated again.
        drop((on_device, pages, denoiser));
        let plan = ScenePlan::between(None, &scene);
        let parts = Making::new(machine, &scene, None, counters).parts(&plan, read_image)?;
        let pages = scene_pages(machine, &parts, None)?;
        let on_device = scene_on_device(machine, &scene, parts, pages.as_ref())?;
        film.again(&machine.gpu)?;
        Ok(Self { scene, on_device, pages, film, needs, denoiser: None })
    }

    /// Begins to compile the program that adds samples; returns whether it is there.
    pub(crate) fn prepare(&self, machine: &mut DeviceContext) -> Result<bool, DeviceError> {
        machine.programs.prepare(
            &machine.gpu,
            Entry::Path,
            &Entry::Path.constants(self.needs, machine.gpu.candidate()),
        )
    }

    /// Begins to compile the program that adds samples, and the one that finds first surfaces beside it.
    pub(crate) fn prepare_picture(&self, machine: &mut DeviceContext) -> Result<(), DeviceError> {
        self.prepare(machine)?;
        let constants = Entry::First.constants(self.needs, machine.gpu.candidate());
        machine.programs.prepare(&machine.gpu, Entry::First, &constants).map(drop)
    }

    /// Runs one launch of the unfinished pass, or of a new pass that brings every pixel to `target` samples. Returns true when the pass is
    /// complete.
    pub(crate) fn launch(
        &mut self,
        machine: &mut DeviceContext,
        target: u32,
        job: &Job,
    ) -> Result<bool, UploadError> {
        let (gpu, film) = (machine.gpu.clone(), &mut self.film);
        let (target, at) = *film.pass.get_or_insert((target, Cursor::default()));
        let samples = target - film.spp;
        let Some((tile, after)) = machine.slices.next(film.size, at, samples) else {
            (film.spp, film.pass) = (target, None);
            return Ok(true);
        };
        let launch = Launch {
            scene: self.on_device.address(),
            input: film.pass_sums.as_ref().map_or(0, Buffer::address),
            output: film.sums.address(),
            resting: film.resting.as_ref().map_or(0, Buffer::address),
            first_sample: film.spp,
            samples,
            ..tile.launch()
        };
        let program = machine.programs.wait(
            &gpu,
            Entry::Path,
            &Entry::Path.constants(self.needs, gpu.candidate()),
            job,
        )?;
        let during = "a launch of samples";
        let taken = match &mut self.pages {
            None => program.run(during, &launch, [tile.width, tile.height])?,
            Some(pages) => {
                let launch = Launch { samples_done: film.samples_done(&gpu)?, ..launch };
                let run = |part: &Tile, page_requests: u64| {
                    let launch = Launch { page_requests, ..part.of(&launch) };
                    Ok(program.run(during, &launch, [part.width, part.height])?)
                };
                pages.draw(&gpu, &tile, run, |_, _| Ok(()))?
            }
        };
        machine.slices.learn(tile.pixels(), samples, taken.as_secs_f64());
        film.add_time(taken);
        job.advance(tile.pixels() * u64::from(samples));
        film.pass = Some((target, after));
        if after.y >= film.size[1] {
            (film.spp, film.pass) = (target, None);
        }
        Ok(film.pass.is_none())
    }

    /// The first surface through the centre of a pixel of the film.
    pub(crate) fn pick(
        &mut self,
        machine: &mut DeviceContext,
        x: u32,
        y: u32,
    ) -> Result<Option<Pick>, UploadError> {
        let [width, height] = self.film.size;
        if x >= width || y >= height {
            return Ok(None);
        }
        let mut hit = [HitRecord::zeroed()];
        let tile = Tile { x, y, width: 1, height: 1 };
        let gpu = machine.gpu.clone();
        self.first(machine, &tile, 1, size_of::<HitRecord>(), &Job::new(), |_, records| {
            Ok(gpu.download(&records, 0, bytemuck::cast_slice_mut(&mut hit))?)
        })?;
        let [HitRecord { t: depth, surface: s, .. }] = hit;
        Ok(label_of(&s).map(|label| Pick { instance: s.instance, label, voxel: s.voxel, depth }))
    }

    /// The first surfaces under the centres of all pixels; incomplete if the job is cancelled.
    pub(crate) fn seen_surfaces(
        &mut self,
        machine: &mut DeviceContext,
        job: &Job,
    ) -> Result<Vec<Option<SeenSurface>>, UploadError> {
        self.firsts(machine, 1, job, |HitRecord { t: depth, surface: s, .. }: &HitRecord| {
            let seen = SeenSurface { instance: s.instance, label: label_of(s), depth: *depth as f32 };
            (s.instance != NONE).then_some(seen)
        })
    }

    /// Checks that the host has memory for the finished picture.
    pub(crate) fn check_memory(&self) -> Result<(), RenderError> {
        let (scene, copy) = (self.scene.scene(), self.film.copy());
        Ok(film_memory::check(&scene.film, copy.kept(), scene.settings.adaptive, copy.bytes())?)
    }

    /// The picture so far: colours from the whole film, which the host reads, first surfaces from the device.
    pub(crate) fn picture(&mut self, machine: &mut DeviceContext) -> Result<Picture, UploadError> {
        self.film.read(&machine.gpu)?;
        let firsts = self.firsts(machine, 0, &Job::new(), SurfaceAovsRecord::clone)?;
        let [width, height] = self.film.size.map(|n| n as usize);
        let image = |f: fn(&SurfaceAovsRecord) -> [f32; 3]| {
            let pixels = collected(firsts.len(), firsts.iter().map(f), PICTURE)?;
            Ok::<_, RenderError>(Image::new(width, height, pixels))
        };
        let film: &FilmBuffer = self.film.copy();
        let spp = film.spp();
        let variance = (spp >= CLASSES).then(|| film.variance());
        let memory = RenderError::from;
        let instance = match self.scene.scene().instances.len() {
            0 | 1 => None,
            _ => Some(collected(firsts.len(), firsts.iter().map(|f| f.instance), PICTURE).map_err(memory)?),
        };
        let picture = Picture {
            variance: variance.transpose().map_err(memory)?,
            depth: Some(collected(firsts.len(), firsts.iter().map(|f| f.depth), PICTURE).map_err(memory)?),
            label: Some(collected(firsts.len(), firsts.iter().map(|f| f.label), PICTURE).map_err(memory)?),
            instance,
            albedo: Some(image(|f| f.albedo)?),
            normal: Some(image(|f| f.normal)?),
            position: Some(image(|f| f.position)?),
            ..Picture::of(film.mean().map_err(memory)?)
        };
        // Passes need the memory that these records took.
        drop(firsts);
        let passes = self.scene.scene().film.passes;
        let mut picture = film.passes_into(picture, passes).map_err(memory)?;
        name_mattes(&mut picture, self.scene.scene(), self.scene.volumes());
        name_labels(&mut picture, self.scene.scene(), self.scene.volumes());
        Ok(picture)
    }

    /// What `of` finds in the record of the first surface of each pixel, row by row from the top; incomplete if the job is cancelled.
    fn firsts<R: bytemuck::Pod, T: Clone>(
        &mut self,
        machine: &mut DeviceContext,
        wanted: u32,
        job: &Job,
        of: impl Fn(&R) -> T,
    ) -> Result<Vec<T>, UploadError> {
        let [width, height] = self.film.size;
        let pixels = width as usize * height as usize;
        let memory = RenderError::from;
        let none = repeat_n(of(&R::zeroed()), pixels);
        let mut firsts = collected(pixels, none, PICTURE).map_err(memory)?;
        let (gpu, mut at) = (machine.gpu.clone(), Cursor::default());
        while let Some((tile, after)) = machine.slices_of_firsts.next([width, height], at, 1) {
            if job.is_cancelled() {
                break;
            }
            let taken = self.first(machine, &tile, wanted, size_of::<R>(), job, |part, found| {
                let mut records: Vec<R> = zeroed(part.pixels() as usize, PICTURE).map_err(memory)?;
                gpu.download(&found, 0, bytemuck::cast_slice_mut(&mut records))?;
                for (row, y) in records.chunks(part.width as usize).zip(part.y..) {
                    let place = y as usize * width as usize + part.x as usize;
                    firsts[place..][..row.len()].iter_mut().zip(row).for_each(|(to, from)| *to = of(from));
                }
                Ok(())
            })?;
            machine.slices_of_firsts.learn(tile.pixels(), 1, taken.as_secs_f64());
            at = after;
        }
        Ok(firsts)
    }

    /// Computes the first surfaces of a tile and hands them to `complete`, in memory of the device: of the whole tile, or of its parts where
    /// the pages for it do not fit. A record has `record_bytes`. Returns how long the launches took.
    fn first(
        &mut self,
        machine: &mut DeviceContext,
        tile: &Tile,
        wanted: u32,
        record_bytes: usize,
        job: &Job,
        mut complete: impl FnMut(&Tile, Buffer) -> Result<(), UploadError>,
    ) -> Result<Duration, UploadError> {
        let (gpu, scene) = (machine.gpu.clone(), self.on_device.address());
        let program = machine.programs.wait(
            &gpu,
            Entry::First,
            &Entry::First.constants(self.needs, gpu.candidate()),
            job,
        )?;
        let mut run = |part: &Tile, page_requests: u64| {
            let output = gpu.buffer("first surfaces", part.pixels() * record_bytes as u64)?;
            let launch = Launch { scene, output: output.address(), page_requests, wanted, ..part.launch() };
            let taken = program.run("first surfaces", &launch, [part.width, part.height])?;
            Ok::<_, UploadError>((output, taken))
        };
        match &mut self.pages {
            None => {
                let (found, taken) = run(tile, 0)?;
                complete(tile, found).map(|()| taken)
            }
            Some(pages) => pages.draw(&gpu, tile, run, |part, (found, _)| complete(part, found)),
        }
    }

    /// The picture so far, denoised on the device. The guides are made once for a scene.
    pub(crate) fn denoised(&mut self, machine: &mut DeviceContext) -> Result<Image, UploadError> {
        let denoiser = match self.denoiser.take() {
            Some(made) => made,
            None => self.guided(machine)?,
        };
        // The host composites shadow catchers, and knows the samples of each pixel in an unfinished pass.
        let on_host = self.film.copy().kept().caught || self.film.pass.is_some();
        if on_host {
            self.film.read(&machine.gpu)?;
        }
        let (film, memory) = (&self.film, RenderError::from);
        let [width, height] = film.size.map(|n| n as usize);
        let mut pixels = zeroed(width * height, "denoiser: its picture").map_err(memory)?;
        let copy = film.copy();
        let test = |samples| WelchTest::of((samples >= CLASSES).then_some(DEGREES_OF_FREEDOM));
        if on_host {
            let mean = copy.mean().map_err(memory)?;
            let variance = (copy.spp() >= CLASSES).then(|| copy.variance()).transpose().map_err(memory)?;
            let noisy = Noisy::Host { mean: &mean, variance: variance.as_ref().map(variance_known) };
            denoiser.denoise(machine.denoiser()?, &noisy, test(copy.spp()), &mut pixels)?;
        } else {
            let (sums, resting, samples) = (&film.sums, film.resting.as_ref(), film.spp);
            let noisy = Noisy::Film { sums, resting, samples };
            denoiser.denoise(machine.denoiser()?, &noisy, test(samples), &mut pixels)?;
        }
        self.denoiser = Some(denoiser);
        Ok(Image::new(width, height, pixels))
    }

    /// Memory for denoising, with the guides of this scene.
    fn guided(&mut self, machine: &mut DeviceContext) -> Result<PictureDenoiser, UploadError> {
        let size = self.film.size;
        let denoiser = PictureDenoiser::new(&machine.gpu, size)?;
        let mut at = Cursor::default();
        while let Some((tile, after)) = machine.slices_of_firsts.next(size, at, 1) {
            let mut found = Vec::new();
            let taken = self.first(
                machine,
                &tile,
                0,
                size_of::<SurfaceAovsRecord>(),
                &Job::new(),
                |part, surfaces| {
                    found.push((*part, surfaces));
                    Ok(())
                },
            )?;
            machine.slices_of_firsts.learn(tile.pixels(), 1, taken.as_secs_f64());
            for (part, surfaces) in found {
                denoiser.guide(machine.denoiser()?, &surfaces, &part)?;
            }
            at = after;
        }
        Ok(denoiser)
    }

    /// Whether pages were loaded again: then a pass adds several samples, which share the loads.
    pub(crate) fn loads_pages_again(&self) -> bool {
        self.pages.as_ref().is_some_and(ScenePages::loads_again)
    }

    /// Frees the memory for denoising, which can be made again.
    pub(crate) fn drop_denoiser(&mut self) {
        self.denoiser = None;
    }

    /// Frees all memory that can be made again.
    pub(crate) fn drop_scratch(&mut self) {
        self.drop_denoiser();
        self.film.drop_resolver();
    }

    /// Bytes on the device by part.
    pub(crate) fn bytes(&self) -> Vec<(&'static str, u64)> {
        let mut bytes = self.on_device.bytes().to_vec();
        bytes.push(("film", self.film.bytes()));
        bytes.extend(self.pages.as_ref().map(|pages| ("pages", pages.bytes())));
        bytes.extend(self.denoiser.as_ref().map(|denoiser| ("denoiser", denoiser.bytes())));
        bytes
    }
}

/// The pages of the volumes of a scene that are drawn in pages.
fn scene_pages(
    machine: &DeviceContext,
    parts: &SceneParts,
    former: Option<&mut Option<ScenePages>>,
) -> Result<Option<ScenePages>, UploadError> {
    let mut volumes: Vec<Arc<PagedVolume>> = Vec::new();
    for volume in parts.instances.iter().filter_map(|i| i.boxes.paged()) {
        if !volumes.iter().any(|known| Arc::ptr_eq(known, volume)) {
            volumes.push(Arc::clone(volume));
        }
    }
    ScenePages::new(&machine.gpu, &volumes, former)
}

/// The parts with the header through which shaders find them.
fn scene_on_device(
    machine: &DeviceContext,
    scene: &LoadedScene,
    parts: SceneParts,
    pages: Option<&ScenePages>,
) -> Result<SceneOnDevice, DeviceError> {
    let scene = scene.scene();
    let rays = CameraRays::new(&scene.camera, &scene.film);
    let settings = pack::settings(&scene.settings, sums_of(scene));
    SceneOnDevice::new(&machine.gpu, &machine.tables, parts, pages, &rays, settings)
}

/// The label of a surface, if there is one and it has a label.
fn label_of(surface: &SurfaceRecord) -> Option<u32> {
    let labelled = surface.instance != NONE && surface.face >> 3 != SurfaceKind::Triangle as u32;
    labelled.then_some(surface.label)
}

/// Makes the parts of a scene by its plan. It reuses parts of the former scene that are still valid.
struct Making<'a> {
    machine: &'a DeviceContext,
    new: &'a LoadedScene,
    old: Option<&'a SceneParts>,
    old_scene: Option<&'a LoadedScene>,
    lod: LodChoice,
    wanted: PartSet,
    counters: &'a mut Counters,
}

impl<'a> Making<'a> {
    fn new(
        machine: &'a DeviceContext,
        new: &'a LoadedScene,
        old: Option<&'a Shown>,
        counters: &'a mut Counters,
    ) -> Self {
        let (lod, wanted) = (new.lod(), new.needs().parts());
        let (old_scene, old) = old.map(|o| (&o.scene, &o.on_device.parts)).unzip();
        Self { machine, new, old, old_scene, lod, wanted, counters }
    }

    fn parts(mut self, plan: &ScenePlan, read_image: ReadImage) -> Result<SceneParts, UploadError> {
        let (gpu, scene) = (&self.machine.gpu, self.new.scene());
        let sky = match self.old {
            Some(old) if plan.lights == Reuse::Keep => Arc::clone(&old.sky),
            _ => {
                self.counters.rebuilt.lights += 1;
                self.counters.sent.lights += 1;
                Arc::new(SkyOnDevice::new(gpu, &scene_lights(scene, read_image)?)?)
            }
        };
        let filter = match self.old {
            Some(old) if plan.filter == Reuse::Keep => Arc::clone(&old.filter),
            _ => {
                self.counters.sent.filter += 1;
                Arc::new(FilterOnDevice::new(gpu, &scene.film.filter)?)
            }
        };
        let mut instances = Vec::with_capacity(plan.instances.len());
        for (place, plan) in plan.instances.iter().enumerate() {
            instances.push(self.instance(place, plan, &instances)?);
        }
        let mut meshes = Vec::with_capacity(plan.meshes.len());
        for (place, plan) in plan.meshes.iter().enumerate() {
            meshes.push(self.mesh(place, plan, &meshes)?);
        }
        let emitters = match self.old {
            Some(old) if plan.emitters == Reuse::Keep => old.emitters.clone(),
            _ if !self.wanted.has(Part::Emitters) => None,
            _ => {
                let made = emitters_of(self.new, &instances, &meshes)?;
                self.counters.rebuilt.lights += u64::from(made.is_some());
                self.counters.sent.lights += u64::from(made.is_some());
                made.map(|made| EmittersOnDevice::new(gpu, &made).map(Arc::new)).transpose()?
            }
        };
        let tree = match self.old {
            Some(old) if plan.top_level == Reuse::Keep => old.tree.clone(),
            _ => {
                let least = self.new.needs().least_of_a_tree();
                let tree = TreeOnDevice::new(gpu, &instances, &meshes, least)?;
                self.counters.rebuilt.top_level += u64::from(tree.is_some());
                tree.map(Arc::new)
            }
        };
        self.counters.sent.header += 1;
        let contacts = Contacts::new(self.new);
        Ok(SceneParts { instances, meshes, sky, emitters, filter, tree, contacts })
    }

    /// Whether instances may share a hierarchy. Not in a ray tracing pipeline, whose intersection shader identifies the instance by the
    /// hierarchy.
    fn shares_hierarchies(&self) -> bool {
        self.machine.gpu.backend() != Backend::RayPipeline
    }

    fn material_table(
        &mut self,
        materials: MaterialTable,
        ids: impl FnOnce() -> Vec<cryptomatte::Ids>,
    ) -> Result<MaterialsOnDevice, UploadError> {
        self.counters.rebuilt.materials += 1;
        self.counters.sent.materials += 1;
        let materials = materials.with_ids(if self.wanted.has(Part::Mattes) { ids() } else { Vec::new() });
        Ok(MaterialsOnDevice::new(&self.machine.gpu, materials)?)
    }

    /// Makes one instance; `before` are those that precede it in the scene.
    fn instance(
        &mut self,
        place: usize,
        plan: &InstancePlan,
        before: &[InstanceOnDevice],
    ) -> Result<InstanceOnDevice, UploadError> {
        let (gpu, scene, volume) = (&self.machine.gpu, self.new.scene(), &self.new.volumes()[place]);
        let (instance, old) = (&scene.instances[place], self.old);
        let former = |place: usize| old.and_then(|old| old.instances.get(place));

        let materials =
            plan.materials.find(former, |i| before.get(i)).map(|like| Arc::clone(&like.materials));
        let materials = match materials {
            Some(kept) => kept,
            None => {
                let (style, table) = (&instance.style, volume.labels());
                let materials =
                    MaterialTable::new(style, table.ids(), table.contacts().iter(), &self.new.visible(place));
                Arc::new(self.material_table(materials, || cryptomatte::ids_of_volume(table))?)
            }
        };

        // (Pages are found without a hierarchy.)
        let source = match self.shares_hierarchies() || volume.pages().is_some() {
            true => plan.boxes(),
            false if plan.number == Reuse::Keep => plan.boxes().unshared(),
            false => Source::Built,
        };
        let placement = Placement::of_instance(place as u32, instance.world_from_index)?;
        let detail = self.lod.placed(&placement.world_from_index);
        let boxes = match source.find(former, |i| before.get(i)).filter(|like| like.boxes.suit(&detail)) {
            Some(like) => Arc::clone(&like.boxes),
            None => {
                let visible = self.new.visible(place);
                let hidden_too = self.wanted.has(Part::HiddenLabels);
                let drawn = Drawn {
                    place: place as u32,
                    volume,
                    visible: &visible,
                    lod: self.lod,
                    smooth: scene.settings.smooth_voxels,
                    hidden_too,
                };
                let before_edit = plan.former.and_then(former);
                if volume.pages().is_some() {
                    self.counters.rebuilt.acceleration += 1;
                    self.counters.sent.boxes += 1;
                    Arc::new(Boxes::in_pages(gpu, &drawn, detail, before_edit.map(|i| i.boxes.as_ref()))?)
                } else {
                    // The nodes of this volume may be on the device already, with all wanted labels.
                    let here = before_edit.into_iter().chain(before).filter_map(|i| i.boxes.nodes());
                    let all = vec![true; visible.len()];
                    let wanted = if hidden_too { &all } else { &visible };
                    let known = here.filter(|n| n.is_of(volume)).find(|n| n.covers(wanted)).map(Arc::clone);
                    let mut sent_nodes = 0;
                    let nodes = || match known {
                        Some(nodes) => Ok(nodes),
                        None => {
                            sent_nodes = 1;
                            Nodes::new(gpu, volume, wanted).map(Arc::new)
                        }
                    };
                    let was_visible = match (self.old_scene, plan.former) {
                        (Some(scene), Some(place)) => scene.visible(place),
                        _ => Vec::new(),
                    };
                    let former = before_edit.map(|i| Former { boxes: &i.boxes, visible: &was_visible });
                    let showing = Boxes::showing(gpu, &drawn, former, nodes)?;
                    self.counters.rebuilt.acceleration += u64::from(showing.is_built);
                    self.counters.sent.boxes += u64::from(showing.is_sent);
                    self.counters.sent.nodes += sent_nodes;
                    showing.boxes
                }
            }
        };

        let cuts = match plan.former.and_then(former) {
            Some(former) if plan.cuts == Reuse::Keep => Arc::clone(&former.cuts),
            _ => {
                let cuts = Cuts::new(scene.cuts_of(instance.id), &instance.world_from_index);
                self.counters.sent.cuts += u64::from(!cuts.is_empty());
                Arc::new(CutsOnDevice::new(gpu, cuts)?)
            }
        };
        Ok(InstanceOnDevice { boxes, materials, cuts, placement, lod: self.lod })
    }

    /// Makes one mesh. It follows all volumes and the meshes `before`.
    fn mesh(
        &mut self,
        place: usize,
        plan: &MeshPlan,
        before: &[MeshOnDevice],
    ) -> Result<MeshOnDevice, UploadError> {
        let (mesh, data, old) = (&self.new.scene().meshes[place], &self.new.meshes()[place], self.old);
        let former = |place: usize| old.and_then(|old| old.meshes.get(place));

        let materials =
            plan.materials.find(former, |i| before.get(i)).map(|like| Arc::clone(&like.materials));
        let materials = match materials {
            Some(kept) => kept,
            None => {
                let materials = MaterialTable::of_mesh(&mesh.materials).catching(mesh.shadow_catcher);
                Arc::new(self.material_table(materials, || cryptomatte::ids_of_mesh(&mesh.source))?)
            }
        };

        let source = match self.shares_hierarchies() {
            true => plan.triangles,
            false if plan.number == Reuse::Keep => plan.triangles.unshared(),
            false => Source::Built,
        };
        let triangles = match source.find(former, |i| before.get(i)) {
            Some(like) => Arc::clone(&like.triangles),
            None => {
                self.counters.rebuilt.acceleration += 1;
                self.counters.sent.boxes += 1;
                let instance = self.new.volumes().len() + place;
                Arc::new(Triangles::new(&self.machine.gpu, place as u32, instance as u32, data)?)
            }
        };
        let placement = mesh_placement(place as u32, triangles.mesh_from_grid(), mesh.world_from_mesh)?;
        Ok(MeshOnDevice { triangles, materials, placement })
    }
}

/// The emissive surfaces of a scene, ready to be sampled as lights.
fn emitters_of(
    scene: &LoadedScene,
    instances: &[InstanceOnDevice],
    meshes: &[MeshOnDevice],
) -> Result<Option<Emitters>, RenderError> {
    let mut grids = Vec::new();
    for (place, (mesh, data)) in (0u32..).zip(meshes.iter().zip(scene.meshes())) {
        grids.push(if mesh.materials.table.is_emissive() { Some(MeshGrid::new(place, data)?) } else { None });
    }
    let mut shining = Vec::new();
    for (place, (instance, volume)) in instances.iter().zip(scene.volumes()).enumerate() {
        if !instance.materials.table.is_emissive() {
            continue;
        }
        if volume.pages().is_some() {
            return Err(RenderError::Scene(format!(
                "memory limit: instances[{place}] emits light, which needs the whole volume in memory: leave the limit out"
            )));
        }
        let visible = scene.visible(place);
        let (mut drawn, mut number) = (Vec::new(), 0);
        volume.for_each_box(|label, _| {
            if visible[label as usize] {
                drawn.push(number);
            }
            number += 1;
        });
        shining.push(EmissiveGeometry::Volume {
            instance: place as u32,
            volume,
            drawn,
            placement: instance.placement,
            detail: instance.lod.placed(&instance.placement.world_from_index),
            cuts: &instance.cuts.cuts,
            materials: &instance.materials.table,
        });
    }
    for (place, (mesh, data)) in meshes.iter().zip(scene.meshes()).enumerate() {
        if let Some(grid) = &grids[place] {
            shining.push(EmissiveGeometry::Mesh {
                instance: (instances.len() + place) as u32,
                mesh: data,
                grid,
                placement: mesh.placement,
                materials: &mesh.materials.table,
            });
        }
    }
    Emitters::new(&shining)
}

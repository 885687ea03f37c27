//! Scenes in a device's memory, and the results of its entry points for them.

use std::cell::RefCell;

use glam::Vec3;
use pumice_picture::film::{CLASSES, STRIDE};
use pumice_transport::FilterTable;
use pumice_transport::bsdf::tables::TABLES;
use pumice_transport::camera_rays::CameraRays;
use pumice_vulkan::device::Backend;
use pumice_vulkan::layout::{self, Launch, SurfaceAovsRecord};
use pumice_vulkan::pack::{self, PackedEmitters, PackedMaterials, PackedSky};
use pumice_vulkan::program::Program;

use crate::gpu::scene::{Form, Uploaded};
use crate::gpu::{Gpu, backends, of_today};
use crate::scenes::Case;

/// A scene on a device. It must be kept as long as its address is used.
pub(crate) struct OnDevice {
    _kept: Uploaded,
    pub(crate) address: u64,
}

impl OnDevice {
    pub(crate) fn new(gpu: &Gpu, case: &Case) -> Self {
        let mut uploaded = Uploaded::new(gpu, &case.traced, Form::Bricks);
        if case.around.settings.smooth_voxels {
            uploaded.shade_smooth(gpu, &case.traced);
        }
        for (mesh, place) in &case.meshes {
            uploaded.add_mesh(gpu, mesh, *place);
        }
        for (i, materials) in case.around.materials.iter().enumerate() {
            let packed = PackedMaterials::new(materials);
            let materials = uploaded.put(gpu, &packed.materials);
            let of_label = if packed.of_label.is_empty() { 0 } else { uploaded.put(gpu, &packed.of_label) };
            let ids = if packed.ids.is_empty() { 0 } else { uploaded.put(gpu, &packed.ids) };
            packed.describe(&mut uploaded.instances[i], materials, of_label, ids);
        }
        for (record, number) in uploaded.instances.iter_mut().zip(0..) {
            record.body = case.contacts.as_ref().and_then(|c| c.body(number)).unwrap_or(number);
        }
        let lights = &case.around.lights;
        let suns = pack::suns(lights);
        let suns = if suns.is_empty() { 0 } else { uploaded.put(gpu, &suns) };
        let lamps = pack::lamps(lights);
        let lamps = if lamps.is_empty() { 0 } else { uploaded.put(gpu, &lamps) };
        let (nodes, cones) = pack::lamp_tree(lights);
        let nodes = if nodes.is_empty() { 0 } else { uploaded.put(gpu, &nodes) };
        let cones = if cones.is_empty() { 0 } else { uploaded.put(gpu, &cones) };
        let sky = PackedSky::new(lights);
        let environment = sky.map(|sky| {
            let parts = sky.parts().map(|part| uploaded.put(gpu, part));
            sky.record(parts)
        });
        let emitters = lights.emitters().map(|emitters| {
            let packed = PackedEmitters::new(emitters);
            let parts = packed.parts();
            packed.record(parts.map(|(_, part)| if part.is_empty() { 0 } else { uploaded.put(gpu, part) }))
        });
        let table = FilterTable::new(&case.film.filter);
        let steps = table.inverse().len().saturating_sub(1) as u32;
        let inverse = if steps == 0 { 0 } else { uploaded.put(gpu, table.inverse()) };
        let filter = layout::Filter { inverse, width: table.width(), steps };
        let tables = uploaded.put(gpu, &TABLES);
        let rays = CameraRays::new(&case.camera, &case.film);
        let settings = pack::settings(&case.around.settings, case.kept());
        let lights = pack::lights(lights, [suns, lamps, nodes, cones]);
        let header = layout::SceneHeader {
            tables,
            camera: pack::camera(&rays),
            filter,
            settings,
            lights,
            environment: environment.unwrap_or_default(),
            emitters: emitters.unwrap_or_default(),
            film_width: rays.size[0] as u32,
            contact_distance: case.contacts.as_ref().map_or(0.0, |c| c.distance()),
            ..layout::SceneHeader::default()
        };
        let address = uploaded.header(gpu, header);
        Self { _kept: uploaded, address }
    }
}

/// An entry point on one backend.
pub(crate) struct Front {
    pub(crate) name: String,
    pub(crate) gpu: Gpu,
    program: RefCell<Program>,
}

impl Front {
    /// An entry point as a compute shader with native doubles, last, and before it on a hardware backend where it is its turn: each has one
    /// day in eight.
    pub(crate) fn of_today(entry: &str) -> Vec<Self> {
        let [rays, queries] = [Some(Backend::RayPipeline), Some(Backend::RayQuery)];
        // On other days than those on which `pumice bench stability` draws with a device (every eighth, tests/python).
        let mut hardware = vec![None, None, rays, None, None, None, queries, None];
        hardware.retain(|backend| backend.is_none_or(|b| backends().contains(&b)));
        let hardware = of_today(&hardware);
        let backends = hardware.into_iter().flatten().chain([Backend::Compute]);
        backends.map(|backend| Self::of(entry, backend, true, &[])).collect()
    }

    /// An entry point as a compute shader with emulated doubles.
    pub(crate) fn in_integers(entry: &str) -> Self {
        Self::in_integers_for(entry, &[])
    }

    /// As [`Front::in_integers`], compiled for the needs of some scenes only.
    pub(crate) fn in_integers_for(entry: &str, constants: &[u32]) -> Self {
        Self::of(entry, Backend::Compute, false, constants)
    }

    pub(crate) fn of(entry: &str, backend: Backend, native: bool, constants: &[u32]) -> Self {
        let gpu = Gpu::of(backend);
        assert!(gpu.has_f64 || !native, "{} has no doubles of its own", gpu.name);
        let program = RefCell::new(gpu.program_with(entry, native, [8, 8], constants));
        let name = format!("{backend}{}", if native { "" } else { ", doubles in integers" });
        Self { name, gpu, program }
    }

    /// Runs the entry point over one tile of the film.
    fn run(&self, launch: &Launch, tile: [u32; 4]) {
        let [tile_x, tile_y, tile_width, tile_height] = tile;
        let launch = Launch { tile_x, tile_y, tile_width, tile_height, ..*launch };
        self.program.borrow_mut().run("a test", &launch, [tile_width, tile_height]).expect("run");
    }

    /// Sums of `samples` in every pixel, in launches as the renderer might divide them.
    pub(crate) fn film(&self, case: &Case, samples: u32) -> Vec<f32> {
        self.film_and_passes(case, samples).0
    }

    /// As [`Front::film`], with the sums that the film keeps for render passes.
    pub(crate) fn film_and_passes(&self, case: &Case, samples: u32) -> (Vec<f32>, Vec<f32>) {
        let scene = OnDevice::new(&self.gpu, case);
        let (width, height) = (case.film.width, case.film.height);
        let floats = (width * height) as usize * STRIDE;
        let target = self.gpu.buffer(4 * floats);
        let floats_of_passes = (width * height) as usize * case.kept().stride();
        let passes = self.gpu.buffer(4 * floats_of_passes.max(1));
        let input = if floats_of_passes > 0 { passes.address } else { 0 };
        let launch = Launch { scene: scene.address, input, output: target.address, ..Launch::default() };
        let first = samples / 3;
        self.run(&Launch { samples: first, ..launch }, [0, 0, width, height]);
        let rest = Launch { first_sample: first, samples: samples - first, ..launch };
        self.run(&rest, [0, 0, width, 9]);
        self.run(&rest, [0, 9, 13, height - 9]);
        self.run(&rest, [13, 9, width - 13, height - 9]);
        (target.read(floats), passes.read(floats_of_passes))
    }

    /// Radiance of the samples of every pixel, numbered from 0 to below `spp`: what a film of as many classes holds of each.
    pub(crate) fn radiances(&self, case: &Case, spp: u32) -> Vec<Vec3> {
        let scene = OnDevice::new(&self.gpu, case);
        let (width, height) = (case.film.width, case.film.height);
        let pixels = (width * height) as usize;
        let mut found = vec![Vec3::ZERO; pixels * spp as usize];
        for first_sample in (0..spp).step_by(CLASSES as usize) {
            let samples = CLASSES.min(spp - first_sample);
            let target = self.gpu.buffer(4 * pixels * STRIDE);
            let output = target.address;
            let launch = Launch { scene: scene.address, output, first_sample, samples, ..Launch::default() };
            self.run(&launch, [0, 0, width, height]);
            let sums: Vec<f32> = target.read(pixels * STRIDE);
            for (of_pixel, sums) in found.chunks_mut(spp as usize).zip(sums.chunks(STRIDE)) {
                for (sample, sum) in of_pixel[first_sample as usize..].iter_mut().zip(sums.chunks(3)) {
                    *sample = Vec3::from_slice(sum);
                }
            }
        }
        found
    }

    /// First surfaces of all pixels.
    pub(crate) fn firsts(&self, case: &Case) -> Vec<SurfaceAovsRecord> {
        let scene = OnDevice::new(&self.gpu, case);
        let (width, height) = (case.film.width, case.film.height);
        let count = (width * height) as usize;
        let target = self.gpu.buffer(count * size_of::<SurfaceAovsRecord>());
        let launch = Launch { scene: scene.address, output: target.address, ..Launch::default() };
        self.run(&launch, [0, 0, width, height]);
        target.read(count)
    }
}

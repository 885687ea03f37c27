//! Hits of the shaders equal the CPU's bit for bit: instance, voxel, face, label, t, normal. (Tests of the CPU renderer check its hits
//! against an exact oracle.)
#![allow(clippy::unwrap_used, clippy::panic, clippy::expect_used, reason = "tests")]

#[path = "exactness/doubles.rs"]
mod doubles;
#[path = "../../cpu-renderer/tests/exact/mod.rs"]
mod exact;
mod gpu;
#[path = "../../cpu-renderer/tests/meshes/shapes.rs"]
#[expect(dead_code, reason = "made for another test too")]
mod shapes;

use std::cell::RefCell;
use std::sync::{Arc, Mutex};

use exact::cases::volumes;
use exact::rays::{CLASSES, Class, ray};
use exact::volumes::{Random, noise};
use exact::{Dense, in_world};
use glam::{DAffine3, DMat3, DVec3};
use gpu::scene::{Form, Uploaded};
use gpu::{Gpu, Shared, of_today};
use pumice_core::{CompressedVolume, MeshData};
use pumice_cpu::traverse::{MeshTracer, SceneTracer, TracedInstance, VolumeTracer};
use pumice_scene::CutShape;
use pumice_transport::geometry::{Cuts, LodChoice};
use pumice_transport::{Hit, PathOrigin, RayInWorld, Surface, SurfaceKind, Tracer};
use pumice_vulkan::device::Backend;
use pumice_vulkan::layout::{HitRecord, Launch, NONE, Question, RayRecord, SceneHeader, SurfaceRecord};
use pumice_vulkan::pack::{FLOATS_FIRST, cut_planes};
use pumice_vulkan::program::Program;

/// A ray query to both sides.
#[derive(Clone, Copy, Debug)]
struct Asked {
    ray: RayInWorld,
    from: PathOrigin,
    t_max: f64,
    question: Question,
    /// Label of `Question::NextBoundary`, in instance 0.
    only: u32,
}

fn record_of(s: &Surface) -> SurfaceRecord {
    SurfaceRecord {
        instance: s.instance,
        voxel: s.voxel,
        face: u32::from(s.axis) | u32::from(s.positive) << 2 | (s.kind as u32) << 3,
        plane: s.plane,
        label: s.label,
        box_number: NONE,
    }
}

impl Asked {
    fn first(ray: RayInWorld) -> Self {
        Self { ray, from: PathOrigin::Free, t_max: f64::INFINITY, question: Question::FirstHit, only: 0 }
    }

    fn record(&self) -> RayRecord {
        let nowhere =
            SurfaceRecord { instance: NONE, voxel: [0; 3], face: 0, plane: 0, label: 0, box_number: NONE };
        RayRecord {
            origin: self.ray.origin.to_array(),
            direction: self.ray.direction.to_array(),
            t_max: self.t_max,
            from: match &self.from {
                PathOrigin::Free => nowhere,
                PathOrigin::Face(s) => record_of(s),
            },
            question: self.question as u32,
            only: self.only,
            only_instance: 0,
            reserved: 0,
        }
    }

    fn answer(&self, tracer: &SceneTracer) -> Option<Hit> {
        match self.question {
            Question::NextBoundary => tracer.next_boundary(&self.ray, 0, self.only, self.from, self.t_max),
            _ => tracer.first_hit(&self.ray, self.from, self.t_max),
        }
    }
}

/// How a front computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Numbers {
    /// Doubles of the device's own, or emulated ones.
    native: bool,
    /// The walk through bricks compares floats first. Pictures of a software driver have it in doubles alone.
    floats_first: bool,
}

const FLOATS: Numbers = Numbers { native: true, floats_first: true };
const DOUBLES: Numbers = Numbers { native: true, floats_first: false };
const IN_INTEGERS: Numbers = Numbers { native: false, floats_first: true };

/// One backend on a device.
struct Front {
    name: String,
    gpu: Gpu,
    program: RefCell<Program>,
}

static FRONTS: Mutex<Option<Vec<Front>>> = Mutex::new(None);
static OTHERS: Mutex<Option<Vec<Front>>> = Mutex::new(None);

/// Compute shaders with native doubles that compare floats first, and every other day one of the others: each hardware backend with native
/// doubles, or compute shaders with emulated doubles, which take minutes to compile for a CPU.
fn fronts() -> Shared<Vec<Front>> {
    let made = || {
        let [rays, queries] = [Backend::RayPipeline, Backend::RayQuery];
        let others = [
            (rays, FLOATS),
            (queries, FLOATS),
            (rays, DOUBLES),
            (queries, DOUBLES),
            (Backend::Compute, IN_INTEGERS),
        ];
        let others = others.into_iter().filter(|(backend, _)| gpu::backends().contains(backend));
        let turns: Vec<_> = others.flat_map(|other| [None, Some(other)]).collect();
        let wanted =
            std::iter::once((Backend::Compute, FLOATS)).chain(of_today(&turns).into_iter().flatten());
        let mut different: Vec<(Backend, Numbers)> = Vec::new();
        for (backend, numbers) in wanted {
            let numbers = Numbers { native: numbers.native && Gpu::of(backend).has_f64, ..numbers };
            if !different.contains(&(backend, numbers)) {
                different.push((backend, numbers));
            }
        }
        different.into_iter().map(|(backend, numbers)| Front::new(backend, numbers)).collect()
    };
    Shared::take(&FRONTS, made, |fronts| fronts.iter().map(|f| &f.gpu).collect())
}

/// Emulated doubles on hardware backends whose device has native doubles.
fn others() -> Shared<Vec<Front>> {
    let made = || {
        let hardware = gpu::hardware_backends().into_iter();
        hardware.filter(|&b| Gpu::of(b).has_f64).map(|b| Front::new(b, IN_INTEGERS)).collect()
    };
    Shared::take(&OTHERS, made, |fronts| fronts.iter().map(|f| &f.gpu).collect())
}

/// Makes a test of each property for the backends of an ordinary run, and one test of all for the others.
macro_rules! on_fronts {
    ($($property:ident)*) => {
        mod fronts {
            $(#[test]
            fn $property() {
                super::$property(&super::fronts());
            })*
        }
        /// One test, so that it has one day of the share: its shaders take minutes to compile.
        #[test]
        #[ignore = "full: doubles in integers where rays are found by hardware, compiled for a CPU"]
        fn doubles_in_integers_find_the_same() {
            let fronts = others();
            $($property(&fronts);)*
        }
    };
}

on_fronts! {
    first_hits_are_the_cpus
    placed_volumes_are_the_cpus
    bounces_are_the_cpus
    boundaries_of_one_label_are_the_cpus
    cut_volumes_are_the_cpus
    scenes_of_several_instances_are_the_cpus
    long_volumes_are_the_cpus
    rays_from_far_away_are_the_cpus
    meshes_are_the_cpus
    instances_are_the_cpus
}

impl Front {
    fn new(backend: Backend, numbers: Numbers) -> Self {
        let mut constants = [1; FLOATS_FIRST + 1];
        constants[FLOATS_FIRST] = u32::from(numbers.floats_first);
        Self::of("trace_rays", backend, numbers, &constants)
    }

    fn of(entry: &str, backend: Backend, numbers: Numbers, constants: &[u32]) -> Self {
        let gpu = Gpu::of(backend);
        let program = RefCell::new(gpu.program_with(entry, numbers.native, [64, 1], constants));
        let name = format!("{backend}, {numbers:?}");
        Self { name, gpu, program }
    }

    fn trace(
        &self,
        form: Form,
        traced: &[TracedInstance],
        cuts: &[CutShape],
        meshes: &[Placed],
        asked: &[Asked],
    ) -> Vec<HitRecord> {
        let mut uploaded = Uploaded::new(&self.gpu, traced, form);
        for (mesh, place) in meshes {
            uploaded.add_mesh(&self.gpu, mesh, *place);
        }
        for (i, t) in traced.iter().enumerate().filter(|_| !cuts.is_empty()) {
            let planes = cut_planes(&Cuts::new(cuts, &t.world_from_index));
            uploaded.instances[i].cut_planes = uploaded.put(&self.gpu, &planes);
            uploaded.instances[i].cut_plane_count = planes.len() as u32;
        }
        self.ask(uploaded, asked)
    }

    fn ask(&self, mut uploaded: Uploaded, asked: &[Asked]) -> Vec<HitRecord> {
        let scene = uploaded.header(&self.gpu, SceneHeader::default());
        let records: Vec<RayRecord> = asked.iter().map(Asked::record).collect();
        let source = self.gpu.buffer_of(&records);
        let target = self.gpu.buffer(records.len() * size_of::<HitRecord>());
        let count = records.len() as u32;
        let launch =
            Launch { scene, input: source.address, output: target.address, count, ..Launch::default() };
        self.program.borrow_mut().run("a test", &launch, [count, 1]).unwrap();
        target.read(records.len())
    }

    /// Compares all answers, and returns the number of hits.
    fn check(&self, what: &str, traced: &[TracedInstance], asked: &[Asked]) -> usize {
        self.check_beside(what, traced, &[], asked)
    }

    /// As [`Front::check`], where parts of space are cut away.
    fn check_cut(&self, what: &str, traced: &[TracedInstance], cuts: &[CutShape], asked: &[Asked]) -> usize {
        self.in_both_forms(|form| {
            let got = self.trace(form, traced, cuts, &[], asked);
            self.compare(&format!("{what}, {form:?}"), &cut_open(traced, cuts, form), got, asked)
        })
    }

    /// As [`Front::check`], for a scene with meshes.
    fn check_beside(
        &self,
        what: &str,
        traced: &[TracedInstance],
        meshes: &[Placed],
        asked: &[Asked],
    ) -> usize {
        self.in_both_forms(|form| {
            let got = self.trace(form, traced, &[], meshes, asked);
            self.compare(&format!("{what}, {form:?}"), &tracer(traced, meshes, form), got, asked)
        })
    }

    /// The sum of the hits with boxes and with bricks. The two may differ where rays touch edges.
    fn in_both_forms(&self, hits: impl Fn(Form) -> usize) -> usize {
        hits(Form::Boxes).min(hits(Form::Bricks))
    }

    /// As [`Front::check`], with a hierarchy over instances on both sides.
    fn check_tree(&self, what: &str, traced: &[TracedInstance], meshes: &[Placed], asked: &[Asked]) -> usize {
        self.in_both_forms(|form| {
            let (tracer, made) = tracer(traced, meshes, form).with_tree(1).unwrap();
            assert!(made);
            let mut uploaded = Uploaded::new(&self.gpu, traced, form);
            for (mesh, place) in meshes {
                uploaded.add_mesh(&self.gpu, mesh, *place);
            }
            uploaded.add_tree(&self.gpu, &tracer);
            self.compare(&format!("{what}, {form:?}"), &tracer, self.ask(uploaded, asked), asked)
        })
    }

    fn compare(&self, what: &str, tracer: &SceneTracer, got: Vec<HitRecord>, asked: &[Asked]) -> usize {
        let mut hits = 0;
        for (a, got) in asked.iter().zip(got) {
            let expected = a.answer(tracer);
            hits += usize::from(expected.is_some());
            let same = match &expected {
                _ if a.question == Question::Occluded => {
                    tracer.occluded(&a.ray, a.from, a.t_max) == (got.surface.instance != NONE)
                }
                None => got.surface.instance == NONE,
                Some(h) => {
                    let surface = SurfaceRecord { box_number: NONE, ..got.surface };
                    got.t.to_bits() == h.t.to_bits()
                        && surface == record_of(&h.surface)
                        && got.normal == h.normal_in_world.to_array()
                        && (got.from_inside != 0) == h.from_inside
                }
            };
            assert!(same, "{} on {what}: {a:?}\nexpected {expected:?}\ngot {got:?}", self.name);
        }
        hits
    }
}

/// The CPU's tracer for the same form of geometry. (With levels of detail by distance, devices have boxes alone.)
fn cut_open(traced: &[TracedInstance], cuts: &[CutShape], form: Form) -> SceneTracer {
    let built = traced.iter().enumerate().map(|(i, t)| {
        let made = VolumeTracer::new(i as u32, t).unwrap().with_cuts(cuts);
        let by_distance = matches!(t.lod, LodChoice::Distance { .. });
        Arc::new(if form == Form::Bricks && !by_distance { made.with_bricks().unwrap() } else { made })
    });
    SceneTracer::of(built.collect())
}

/// A mesh and its placement.
type Placed = (Arc<MeshData>, DAffine3);

fn tracer(traced: &[TracedInstance], meshes: &[Placed], form: Form) -> SceneTracer {
    let meshes = (0u32..).zip(meshes).map(|(i, (mesh, place))| {
        Arc::new(MeshTracer::new(i, traced.len() as u32 + i, mesh, *place).unwrap())
    });
    cut_open(traced, &[], form).with_meshes(meshes.collect())
}

fn instance(volume: &Arc<CompressedVolume>, world_from_index: DAffine3, lod: LodChoice) -> TracedInstance {
    let visible = vec![true; volume.labels().len()];
    TracedInstance { volume: Arc::clone(volume), world_from_index, visible, lod }
}

fn rays_of(class: Class, dims: [u32; 3], fine: u32, place: &DAffine3, n: u32) -> Vec<Asked> {
    let mut random = Random(u64::from(n) ^ class as u64);
    (0..n)
        .map(|_| {
            let (o, d) = ray(class, dims, fine, &mut random);
            Asked::first(in_world(o, d, place))
        })
        .collect()
}

fn first_hits_are_the_cpus(fronts: &[Front]) {
    for front in fronts {
        for (name, Dense { dims, .. }, volume) in volumes() {
            let traced = [instance(&volume, DAffine3::IDENTITY, LodChoice::Voxels)];
            let mut asked = Vec::new();
            for class in CLASSES {
                asked.extend(rays_of(class, dims, 20, &DAffine3::IDENTITY, 2_000));
            }
            let occluded: Vec<_> =
                asked.iter().map(|a| Asked { question: Question::Occluded, ..*a }).collect();
            asked.extend(occluded);
            let hits = front.check(name, &traced, &asked);
            println!("{}, {name}: {hits} hits of {} rays", front.name, asked.len());
            assert!(hits > asked.len() / 20, "{name}: rays must hit");
        }
    }
}

fn columns(x: [f64; 3], y: [f64; 3], z: [f64; 3], translation: [f64; 3]) -> DAffine3 {
    DAffine3 {
        matrix3: DMat3::from_cols(x.into(), y.into(), z.into()),
        translation: DVec3::from(translation),
    }
}

/// Placements with whole numbers, as the oracle needs them, and placements where every number is rounded.
fn places() -> Vec<DAffine3> {
    let at = [1024.0, -77.0, 3.0];
    vec![
        columns([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1000.0], at),
        columns([-16.0, 0.0, 0.0], [0.0, 0.0, 40.0], [0.0, 16.0, 0.0], at),
        columns([3.0, 1.0, 0.0], [-1.0, 5.0, 2.0], [7.0, 0.0, -11.0], at),
        columns([0.3, 0.1, 0.0], [-0.1, 0.7, 0.3], [0.01, 0.0, -1.1], [1e5 + 0.1, -3e-3, 1.0 / 3.0]),
        columns([3.2e-8, 0.0, 0.0], [0.0, 3.2e-8, 0.0], [0.0, 0.0, 4e-8], [0.1, 0.2, 0.3]),
    ]
}

fn placed_volumes_are_the_cpus(fronts: &[Front]) {
    for front in fronts {
        for (name, Dense { dims, .. }, volume) in volumes() {
            for (i, place) in places().iter().enumerate() {
                let traced = [instance(&volume, *place, LodChoice::Voxels)];
                let mut asked = Vec::new();
                for class in [Class::Random, Class::Lattice, Class::ThroughCorner, Class::Inside] {
                    asked.extend(rays_of(class, dims, 14, place, 500));
                }
                let hits = front.check(&format!("{name}, place {i}"), &traced, &asked);
                assert!(hits > asked.len() / 20, "{name}: rays must hit");
            }
        }
    }
}

/// Rays that leave the faces that were hit. Half of them lie nearly or exactly in the face's plane; some are shadow rays, some have a
/// limit.
fn bounces(tracer: &SceneTracer, asked: &[Asked], random: &mut Random) -> Vec<Asked> {
    let mut bounced = Vec::new();
    for a in asked {
        let Some(hit) = tracer.first_hit(&a.ray, a.from, a.t_max) else { continue };
        let n = hit.normal_in_world;
        let mut d = DVec3::from([0; 3].map(|_| random.unit() * 2.0 - 1.0));
        let up = d.dot(n);
        d += n * match random.below(6) {
            0 => -up,
            1 => 1e-9 - up,
            _ => up.abs() - up,
        };
        let ray = RayInWorld { origin: a.ray.origin + a.ray.direction * hit.t, direction: d };
        let question = if random.below(3) == 0 { Question::Occluded } else { Question::FirstHit };
        let t_max = if random.below(4) == 0 { 20.0 * random.unit() } else { f64::INFINITY };
        bounced.push(Asked { ray, from: PathOrigin::Face(hit.surface), t_max, question, only: 0 });
    }
    bounced
}

fn bounces_are_the_cpus(fronts: &[Front]) {
    for front in fronts {
        let mut random = Random(31);
        for (name, Dense { dims, .. }, volume) in volumes() {
            for place in [DAffine3::IDENTITY, places()[3]] {
                for lod in [LodChoice::Voxels, LodChoice::Cells, LodChoice::Boxes] {
                    let traced = [instance(&volume, place, lod)];
                    let tracer = SceneTracer::without_bricks(&traced).unwrap();
                    let first = rays_of(Class::Random, dims, 20, &place, 1_500);
                    let second = bounces(&tracer, &first, &mut random);
                    let third = bounces(&tracer, &second, &mut random);
                    front.check(&format!("{name}, {lod:?}"), &traced, &first);
                    front.check(&format!("{name}, {lod:?}, bounced"), &traced, &second);
                    front.check(&format!("{name}, {lod:?}, bounced twice"), &traced, &third);
                }
            }
        }
    }
}

fn boundaries_of_one_label_are_the_cpus(fronts: &[Front]) {
    for front in fronts {
        for (name, Dense { dims, .. }, volume) in volumes() {
            let traced = [instance(&volume, DAffine3::IDENTITY, LodChoice::Voxels)];
            let labels = volume.labels().len() as u32;
            let mut random = Random(77);
            let mut asked = Vec::new();
            for class in [Class::Random, Class::Inside, Class::Lattice] {
                for a in rays_of(class, dims, 20, &DAffine3::IDENTITY, 700) {
                    asked.push(Asked { question: Question::NextBoundary, only: random.below(labels), ..a });
                }
            }
            front.check(name, &traced, &asked);
        }
    }
}

/// Cut planes and boxes in placed volumes: oblique, along the axes and between voxels. Compared are first surfaces and caps, what paths
/// meet that continue from them to both sides, shadows, and the next boundary of one label.
fn cut_volumes_are_the_cpus(fronts: &[Front]) {
    for front in fronts {
        let mut random = Random(404);
        let mut caps = 0;
        for (name, Dense { dims, .. }, volume) in volumes() {
            for (place, lod) in [
                (DAffine3::IDENTITY, LodChoice::Voxels),
                (places()[1], LodChoice::Voxels),
                (places()[3], LodChoice::Voxels),
                (DAffine3::IDENTITY, LodChoice::Cells),
            ] {
                let at = |x: f64, y: f64, z: f64| {
                    let dims = DVec3::from(dims.map(f64::from));
                    place.transform_point3((dims * DVec3::new(x, y, z)).floor())
                };
                let across = |axis: DVec3| (place.matrix3.inverse().transpose() * axis).to_array();
                let slab = place.matrix3 * DMat3::from_diagonal(DVec3::new(7.0, 12.0, 5.5));
                let oblique = place.matrix3
                    * DMat3::from_cols(
                        [4.0, 3.0, 0.3].into(),
                        [-2.0, 5.0, 1.0].into(),
                        [0.5, 1.0, 9.0].into(),
                    );
                let cuts = [
                    CutShape::Plane { point: at(0.7, 0.0, 0.0).into(), normal: across(DVec3::X) },
                    CutShape::Plane {
                        point: at(0.5, 0.8, 0.9).into(),
                        normal: across(DVec3::new(0.3, 0.2, 1.0)),
                    },
                    CutShape::Box {
                        world_from_box: DAffine3::from_mat3_translation(slab, at(0.3, 0.4, 0.5)),
                    },
                    CutShape::Box {
                        world_from_box: DAffine3::from_mat3_translation(oblique, at(0.4, 0.6, 0.4)),
                    },
                ];
                let traced = [instance(&volume, place, lod)];
                let tracer = cut_open(&traced, &cuts, Form::Bricks);
                let mut asked = Vec::new();
                for class in [Class::Random, Class::Lattice, Class::Inside] {
                    asked.extend(rays_of(class, dims, 20, &place, 400));
                }
                for (i, a) in asked.iter_mut().enumerate() {
                    match i % 4 {
                        0 => a.question = Question::Occluded,
                        1 => a.only = random.below(volume.labels().len() as u32),
                        _ => {}
                    }
                    if i % 4 == 1 {
                        a.question = Question::NextBoundary;
                    }
                    if i % 5 == 0 {
                        a.t_max = 100.0 * random.unit();
                    }
                }
                let mut bounced = bounces(&tracer, &asked, &mut random);
                // Some rays start into the part that was cut away.
                for b in bounced.iter_mut().step_by(3) {
                    b.ray.direction = -b.ray.direction;
                }
                let third = bounces(&tracer, &bounced, &mut random);
                for (what, asked) in [("", &asked), (", bounced", &bounced), (", bounced twice", &third)] {
                    front.check_cut(&format!("{name}, {lod:?}{what}"), &traced, &cuts, asked);
                    caps += asked
                        .iter()
                        .filter_map(|a| tracer.first_hit(&a.ray, a.from, a.t_max))
                        .filter(|h| h.surface.kind == SurfaceKind::Cap)
                        .count();
                }
            }
        }
        println!("{}: {caps} caps", front.name);
        assert!(caps > 3000, "{caps}");
    }
}

/// Several instances, one volume twice, some labels hidden, levels of detail by distance, rays with limits.
fn scenes_of_several_instances_are_the_cpus(fronts: &[Front]) {
    for front in fronts {
        let volumes = volumes();
        let mut random = Random(5);
        let eye = DVec3::new(-40.0, 10.0, 20.0);
        let lod = LodChoice::Distance { eye_in_world: eye, world_per_distance: 0.1, world_constant: 0.0 };
        let mut traced = vec![
            instance(&volumes[6].2, DAffine3::IDENTITY, LodChoice::Voxels),
            instance(&volumes[5].2, DAffine3::from_translation(DVec3::new(30.0, 20.0, 10.5)), lod),
            instance(&volumes[6].2, DAffine3::from_scale(DVec3::new(1.0, -1.0, 2.0)), lod),
            instance(&volumes[1].2, places()[3] * DAffine3::from_scale(DVec3::splat(0.5)), LodChoice::Cells),
        ];
        for (i, t) in traced.iter_mut().enumerate() {
            for v in &mut t.visible {
                *v = i == 0 || random.below(3) != 0;
            }
        }
        // An instance of which nothing is drawn.
        traced.insert(1, instance(&volumes[4].2, DAffine3::IDENTITY, LodChoice::Voxels));
        traced[1].visible.fill(false);
        let tracer = SceneTracer::without_bricks(&traced).unwrap();
        let mut asked: Vec<_> = [Class::Random, Class::Inside, Class::Lattice, Class::Far1e6]
            .into_iter()
            .flat_map(|c| rays_of(c, [96; 3], 14, &DAffine3::IDENTITY, 1_500))
            .collect();
        for a in asked.iter_mut().step_by(3) {
            a.t_max = 300.0 * random.unit();
        }
        front.check("scene", &traced, &asked);
        front.check("scene, bounced", &traced, &bounces(&tracer, &asked, &mut random));
    }
}

/// A volume of 2²⁰ voxels along one axis, in many chunks: f32 coordinates of the hierarchy resolve only 1/16 voxel there.
fn long_volumes_are_the_cpus(fronts: &[Front]) {
    for front in fronts {
        let (dense, volume) = noise([1 << 20, 4, 4], 0.003, 5, 9);
        let mut traced = [instance(&volume, DAffine3::IDENTITY, LodChoice::Voxels)];
        for hidden in [None, Some(2)] {
            if let Some(label) = hidden {
                traced[0].visible[label] = false;
            }
            let mut asked = Vec::new();
            for class in [Class::Random, Class::Inside, Class::Grazing, Class::AxisParallel, Class::InFace] {
                asked.extend(rays_of(class, dense.dims, 20, &DAffine3::IDENTITY, 500));
            }
            let hits = front.check("2^20 voxels long", &traced, &asked);
            assert!(hits > 100, "{hits}");
        }
    }
}

/// From so far away that the roundings of doubles are larger than those of the floats that are compared first.
fn rays_from_far_away_are_the_cpus(fronts: &[Front]) {
    for front in fronts {
        let (_, Dense { dims, .. }, volume) = volumes().swap_remove(1);
        let traced = [instance(&volume, DAffine3::IDENTITY, LodChoice::Voxels)];
        for power in [34, 40, 46] {
            let mut asked = rays_of(Class::Random, dims, 20, &DAffine3::IDENTITY, 2_000);
            for a in &mut asked {
                a.ray.origin -= a.ray.direction * f64::from(power).exp2();
            }
            let hits = front.check(&format!("from 2^{power} away"), &traced, &asked);
            assert!(hits > asked.len() / 4, "{hits}");
        }
    }
}

/// Meshes beside a volume and in it, one of them mirrored and sheared. Rays are random, aimed at corners and edges, come from far away, and
/// run along coplanar triangles.
fn meshes_are_the_cpus(fronts: &[Front]) {
    for front in fronts {
        let (_, Dense { dims, .. }, volume) = volumes().swap_remove(5);
        let mut random = shapes::Random(6);
        let ball = shapes::bumpy_ball(3, &mut random);
        let sheared = columns([-20.0, 3.0, 0.1], [0.3, 17.0, 1.0], [2.0, 0.0, 25.0], [30.0, 31.0, 33.0]);
        let turned = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.7);
        let meshes = [
            (
                shapes::cube_of(80.0, 5, |face| face as u32),
                DAffine3::from_translation(DVec3::new(-8.0, -8.0, -81.0)),
            ),
            (Arc::clone(&ball), sheared),
            (shapes::cube(1e-3, 4), turned * DAffine3::from_scale(DVec3::new(4e4, 3e4, 5e4))),
        ];
        let traced = [instance(&volume, DAffine3::IDENTITY, LodChoice::Voxels)];
        let mut asked: Vec<_> =
            [Class::Random, Class::Inside, Class::Lattice, Class::Far1e6, Class::AxisParallel]
                .into_iter()
                .flat_map(|c| rays_of(c, dims, 14, &DAffine3::IDENTITY, 1_000))
                .collect();
        for (i, triangle) in ball.triangles().iter().enumerate() {
            let [a, b, c] =
                triangle.map(|c| sheared.transform_point3(DVec3::from(ball.positions()[c as usize])));
            let origin = sheared.translation + random.direction() * if i % 2 == 0 { 3.0 } else { 60.0 };
            for aim in [a, (a + b) / 2.0, (a + b + c) / 3.0] {
                asked.push(Asked::first(RayInWorld { origin, direction: aim - origin }));
            }
        }
        let occluded: Vec<_> = asked.iter().map(|a| Asked { question: Question::Occluded, ..*a }).collect();
        let hits = front.check_beside("meshes", &traced, &meshes, &asked);
        assert!(hits > asked.len() / 2, "{hits} hits of {}", asked.len());
        front.check_beside("meshes, occluded", &traced, &meshes, &occluded);
        let tracer = tracer(&traced, &meshes, Form::Bricks);
        let mut random = Random(32);
        let second = bounces(&tracer, &asked, &mut random);
        let on_meshes =
            second.iter().filter(|a| matches!(a.from, PathOrigin::Face(s) if s.instance > 0)).count();
        assert!(on_meshes > 1_000, "{on_meshes} paths go on from triangles");
        front.check_beside("meshes, bounced", &traced, &meshes, &second);
        let third = bounces(&tracer, &second, &mut random);
        front.check_beside("meshes, bounced twice", &traced, &meshes, &third);
    }
}

/// Negative control: rays that are moved by a thousandth of a voxel have other hits.
#[test]
fn other_rays_have_other_hits() {
    let fronts = fronts();
    let front = &fronts[0];
    let (_, Dense { dims, .. }, volume) = volumes().swap_remove(6);
    let traced = [instance(&volume, DAffine3::IDENTITY, LodChoice::Voxels)];
    let asked = rays_of(Class::Random, dims, 20, &DAffine3::IDENTITY, 2_000);
    let moved: Vec<_> = asked
        .iter()
        .map(|a| Asked { ray: RayInWorld { origin: a.ray.origin + DVec3::splat(1e-3), ..a.ray }, ..*a })
        .collect();
    let trace = |asked: &[Asked]| front.trace(Form::Bricks, &traced, &[], &[], asked);
    let (a, b) = (trace(&asked), trace(&moved));
    let differ = a.iter().zip(&b).filter(|(a, b)| a.t.to_bits() != b.t.to_bits()).count();
    let faces = a.iter().zip(&b).filter(|(a, b)| a.surface != b.surface).count();
    assert!(differ > 500 && faces > 0, "{differ} distances and {faces} faces differ");
}

/// Many instances and meshes: overlapping, at one place, far away, tiny. Compared are first surfaces, shadows and what continued paths
/// meet, with the hierarchy over instances and with a test of each in turn.
fn instances_are_the_cpus(fronts: &[Front]) {
    for front in fronts {
        let mut random = Random(12);
        let volumes = [volumes().swap_remove(1).2, volumes().swap_remove(5).2];
        let mesh = shapes::cube(30.0, 3);
        for (name, spread, size, at) in [
            ("about each other", 4.0, 1.0, 0.0),
            ("at one place", 0.0, 1.0, 0.0),
            ("far away", 3.0, 1.0, 1e9),
            ("tiny", 1e-8, 1e-9, 0.25),
        ] {
            let mut place = || {
                let m = [0; 3].map(|_| DVec3::from([0; 3].map(|_| random.unit() - 0.5)));
                let m = DMat3::from_cols(m[0], m[1], m[2]) * (size / 30.0);
                let m = if spread == 0.0 { DMat3::from_diagonal(DVec3::splat(size / 30.0)) } else { m };
                let offset = DVec3::from([0; 3].map(|_| random.unit())) * spread;
                DAffine3::from_mat3_translation(m, offset + at)
            };
            let traced: Vec<_> =
                (0..12).map(|i| instance(&volumes[i % 2], place(), LodChoice::Voxels)).collect();
            let meshes: Vec<Placed> = (0..5).map(|_| (Arc::clone(&mesh), place())).collect();
            let all: Vec<_> =
                traced.iter().map(|t| t.world_from_index).chain(meshes.iter().map(|m| m.1)).collect();
            let mut asked = Vec::new();
            for i in 0..1200 {
                let mut point = || {
                    let p = DVec3::from([0; 3].map(|_| 80.0 * random.unit() - 10.0));
                    all[random.below(all.len() as u32) as usize].transform_point3(p)
                };
                let (origin, target) = (point(), point());
                let mut a = Asked::first(RayInWorld { origin, direction: target - origin });
                if i % 3 == 0 {
                    a.question = Question::Occluded;
                }
                a.t_max = if i % 5 == 0 { random.unit() } else { f64::INFINITY };
                asked.push(a);
            }
            let tracer = tracer(&traced, &meshes, Form::Bricks);
            let second = bounces(&tracer, &asked, &mut random);
            let third = bounces(&tracer, &second, &mut random);
            let mut hits = 0;
            for (what, asked) in [("", &asked), (", bounced", &second), (", bounced twice", &third)] {
                hits += front.check_tree(&format!("{name}{what}"), &traced, &meshes, asked);
                front.check_beside(&format!("{name}{what}, in turn"), &traced, &meshes, asked);
            }
            println!("{}, {name}: {hits} hits", front.name);
            assert!(hits > 600, "{name}: {hits} hits");
        }
    }
}

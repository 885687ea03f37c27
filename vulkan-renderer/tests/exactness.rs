//! Hits of the shaders are the CPU's, bit for bit: instance, voxel, face, label, t, normal. (That the CPU's are right, an exact
//! oracle says in that crate's tests.)
#![allow(clippy::unwrap_used, clippy::panic, clippy::expect_used, reason = "tests")]

#[path = "../../cpu-renderer/tests/exact/mod.rs"]
mod exact;
mod gpu;

use std::sync::Arc;

use exact::in_world;
use exact::rays::{CLASSES, Class, ray};
use exact::volumes::{Random, blobs, checkerboard, neurites, noise, sheets};
use glam::{DAffine3, DMat3, DVec3};
use gpu::Gpu;
use gpu::scene::Uploaded;
use pumice_core::CompressedVolume;
use pumice_cpu::traverse::{LodChoice, SceneTracer, TracedInstance};
use pumice_render::{Hit, PathOrigin, RayInWorld, Surface, Tracer};
use pumice_vulkan::layout::{HitRecord, Launch, NONE, Question, RayRecord, SceneHeader, SurfaceRecord};

/// A question to both.
#[derive(Clone, Copy, Debug)]
struct Asked {
    ray: RayInWorld,
    from: PathOrigin,
    t_max: f64,
    question: Question,
    /// Label of `Question::NextBoundary`, of instance 0.
    only: u32,
}

fn record_of(s: &Surface) -> SurfaceRecord {
    SurfaceRecord {
        instance: s.instance,
        voxel: s.voxel,
        face: u32::from(s.axis) | u32::from(s.positive) << 2,
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

/// One way to trace on a device.
struct Front {
    name: &'static str,
    gpu: Gpu,
    pipeline: gpu::Pipeline,
}

fn fronts() -> Vec<Front> {
    let mut fronts = Vec::new();
    for (name, native) in [("compute", false), ("compute, native doubles", true)] {
        let gpu = Gpu::new();
        if native && !gpu.has_f64 {
            continue;
        }
        let pipeline = gpu.pipeline(&gpu::spirv("trace_rays_bvh.comp", native), &[]);
        fronts.push(Front { name, gpu, pipeline });
    }
    fronts
}

impl Front {
    fn trace(&self, traced: &[TracedInstance], asked: &[Asked]) -> Vec<HitRecord> {
        let mut uploaded = Uploaded::new(&self.gpu, traced);
        let scene = uploaded.header(&self.gpu, SceneHeader::default());
        let records: Vec<RayRecord> = asked.iter().map(Asked::record).collect();
        let source = self.gpu.buffer_of(&records);
        let target = self.gpu.buffer(records.len() * size_of::<HitRecord>());
        let count = records.len() as u32;
        let launch =
            Launch { scene, input: source.address, output: target.address, count, ..Launch::default() };
        self.gpu.run(&self.pipeline, &launch, [count.div_ceil(64), 1]);
        target.read(records.len())
    }

    /// Compares all answers; gives the number of hits.
    fn check(&self, what: &str, traced: &[TracedInstance], asked: &[Asked]) -> usize {
        let tracer = SceneTracer::new(traced).unwrap();
        let mut hits = 0;
        for (a, got) in asked.iter().zip(self.trace(traced, asked)) {
            let expected = a.answer(&tracer);
            hits += usize::from(expected.is_some());
            let same = match &expected {
                None => got.surface.instance == NONE,
                Some(_) if a.question == Question::Occluded => got.surface.instance != NONE,
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

fn instance(volume: &Arc<CompressedVolume>, world_from_index: DAffine3, lod: LodChoice) -> TracedInstance {
    let visible = vec![true; volume.labels().len()];
    TracedInstance { volume: Arc::clone(volume), world_from_index, visible, lod }
}

fn volumes() -> Vec<(&'static str, [u32; 3], Arc<CompressedVolume>)> {
    let named = |name, (dense, compressed): (exact::Dense, _)| (name, dense.dims, compressed);
    vec![
        named("noise 0.1 %", noise([70, 61, 83], 0.001, 9, 1)),
        named("noise 3 %", noise([64, 64, 64], 0.03, 4, 2)),
        named("noise 50 %", noise([37, 50, 41], 0.5, 3, 3)),
        named("checkerboard", checkerboard([33, 34, 35])),
        named("sheets", sheets([66, 70, 50])),
        named("blobs", blobs([64, 64, 64], 60, 12, 4)),
        named("neurites", neurites()),
    ]
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

#[test]
fn first_hits_are_the_cpus() {
    for front in fronts() {
        for (name, dims, volume) in volumes() {
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

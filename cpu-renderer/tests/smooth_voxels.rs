//! Smooth normals of voxels: compared with those of the voxelised balls and planes, and with a naive sum.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::sync::Arc;
use std::time::Duration;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::{CompressedVolume, Job, LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_cpu::CpuRenderer;
use pumice_cpu::traverse::{TracedInstance, VolumeTracer};
use pumice_picture::Picture;
use pumice_scene::{
    Camera, Environment, Film, Filter, Instance, LabelStyle, Lod, Projection, Reading, SCENE_VERSION, Scene,
    Settings, World,
};
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Hit, LoadedScene, PathOrigin, RayInWorld, Renderer, SurfaceKind, Tracer};

/// Random numbers in [0, 1) (Steele et al. 2014, *SplitMix*).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn direction(&mut self) -> DVec3 {
        loop {
            let d = DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0;
            if (1e-3..1.0).contains(&d.length_squared()) {
                return d.normalize();
            }
        }
    }
}

/// Voxels by a function of their position, x fastest.
struct Voxels {
    dims: [u32; 3],
    labels: Vec<u8>,
}

impl Voxels {
    fn new(dims: [u32; 3], label: impl Fn(DVec3) -> u8) -> Self {
        let middle = |i: u32| {
            let [x, y, z] = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
            DVec3::new(f64::from(x), f64::from(y), f64::from(z)) + 0.5
        };
        Self { dims, labels: (0..dims.iter().product()).map(|i| label(middle(i))).collect() }
    }

    fn at(&self, [x, y, z]: [i64; 3]) -> u8 {
        let within = [x, y, z].iter().zip(self.dims).all(|(&v, d)| (0..i64::from(d)).contains(&v));
        let [w, h] = [i64::from(self.dims[0]), i64::from(self.dims[1])];
        if within { self.labels[(x + w * (y + h * z)) as usize] } else { 0 }
    }

    fn compressed(&self) -> Arc<CompressedVolume> {
        let info = VolumeInfo::new(self.dims, LabelType::U8);
        Arc::new(compress_labels(info, LabelBuffer::U8(self.labels.clone())).unwrap())
    }

    fn tracer(&self, world_from_index: DAffine3, lod: LodChoice) -> VolumeTracer {
        let volume = self.compressed();
        let visible = vec![true; volume.labels().len()];
        let traced = TracedInstance { volume, world_from_index, visible, lod };
        VolumeTracer::new(3, &traced).unwrap().shaded_smooth(true).unwrap()
    }

    /// −∇f of the label around a point, from the definition, by looking at 343 voxels.
    fn naive(&self, label: u8, p: DVec3) -> DVec3 {
        let lowest = p.to_array().map(|v| v.floor() as i64 - 3);
        let mut sum = DVec3::ZERO;
        for i in 0..343 {
            let v = [lowest[0] + i % 7, lowest[1] + i / 7 % 7, lowest[2] + i / 49];
            if self.at(v) != label {
                continue;
            }
            let x = (p - DVec3::from(v.map(|v| v as f64)) - 0.5).to_array();
            let (w, s) = (x.map(weight), x.map(|x| trapezium(x - 0.5) - trapezium(x + 0.5)));
            sum += DVec3::new(s[0] * w[1] * w[2], w[0] * s[1] * w[2], w[0] * w[1] * s[2]);
        }
        sum
    }
}

/// Part of the interval of length 2 around `x` that lies within the one of length 3 around 0.
fn trapezium(x: f64) -> f64 {
    ((x + 1.0).min(1.5) - (x - 1.0).max(-1.5)).max(0.0)
}

/// The mean of that over an interval of length 1: linear pieces, each evaluated at its middle.
fn weight(x: f64) -> f64 {
    let mut ends = [-2.5, -0.5, 0.5, 2.5, x - 0.5, x + 0.5].map(|e: f64| e.clamp(x - 0.5, x + 0.5));
    ends.sort_by(f64::total_cmp);
    ends.windows(2).map(|e| (e[1] - e[0]) * trapezium(0.5 * (e[0] + e[1]))).sum()
}

/// Hits from all sides of a point: the hit, and its position.
fn hits(tracer: &VolumeTracer, middle: DVec3, reach: f64, count: usize) -> Vec<(Hit, DVec3)> {
    let mut random = Random(9);
    let mut found = Vec::new();
    while found.len() < count {
        let target = middle + random.direction() * reach * random.next();
        let from = middle + random.direction() * 4.0 * reach;
        let ray = RayInWorld { origin: from, direction: target - from };
        if let Some(hit) = tracer.first_hit(&ray, PathOrigin::Free, f64::INFINITY) {
            found.push((hit, ray.origin + ray.direction * hit.t));
        }
    }
    found
}

/// Mean and 95th percentile, in degrees, of the angle to the true normal, smooth and flat.
fn angles(tracer: &VolumeTracer, hits: &[(Hit, DVec3)], truth: impl Fn(DVec3) -> DVec3) -> [f64; 4] {
    let mut both = [Vec::new(), Vec::new()];
    for (hit, point) in hits {
        let smooth = tracer.smooth_normal(&hit.surface, *point).unwrap_or(hit.normal_in_world);
        assert!((smooth.length() - 1.0).abs() < 1e-9 && smooth.dot(hit.normal_in_world) > 0.0);
        let truth = truth(*point);
        both[0].push(smooth.angle_between(truth).to_degrees());
        both[1].push(hit.normal_in_world.angle_between(truth).to_degrees());
    }
    let of = |angles: &mut Vec<f64>| {
        angles.sort_by(f64::total_cmp);
        [angles.iter().sum::<f64>() / angles.len() as f64, angles[angles.len() * 95 / 100]]
    };
    let [mut smooth, mut flat] = both;
    let ([a, b], [c, d]) = (of(&mut smooth), of(&mut flat));
    [a, b, c, d]
}

/// A ball in the world, voxelised with a spacing.
fn ball(radius: f64, spacing: DVec3) -> (Voxels, DVec3) {
    let half = (DVec3::splat(radius) / spacing).ceil() + 4.0;
    let middle = half * spacing + DVec3::new(0.13, 0.27, 0.4);
    let dims = (half * 2.0).to_array().map(|v| v as u32);
    (Voxels::new(dims, |p| u8::from((p * spacing - middle).length() < radius) * 7), middle)
}

/// The figures of `docs/materials.md`; faces are off by 39° on average, for every size of the ball.
#[test]
fn balls_are_round() {
    for (spacing, cases) in [
        (DVec3::ONE, [(4.0, 3.6), (8.0, 3.3), (16.0, 3.3), (24.0, 3.3)]),
        // 16 × 16 × 40 nm, as in electron microscopy; radii in nm.
        (DVec3::new(16.0, 16.0, 40.0), [(100.0, 10.0), (200.0, 6.5), (400.0, 5.5), (600.0, 5.0)]),
    ] {
        for (radius, most) in cases {
            let (voxels, middle) = ball(radius, spacing);
            let tracer = voxels.tracer(DAffine3::from_scale(spacing), LodChoice::Voxels);
            let hits = hits(&tracer, middle, radius, 4000);
            let [mean, p95, flat, flat_95] = angles(&tracer, &hits, |p| (p - middle).normalize());
            println!(
                "radius {radius} spacing {spacing}: {mean:.2}° (95 %: {p95:.2}°), faces {flat:.1}° ({flat_95:.1}°)"
            );
            assert!(
                mean < most && flat > 35.0 && p95 < 3.5 * most,
                "{radius} {spacing}: {mean} {p95} {flat}"
            );
        }
    }
}

/// Planes of any orientation, in rotated, mirrored and sheared placements: the inverse transpose gives the right normals. Where voxels are
/// 2.5 times as high as wide, an angle in index space is up to 2.5 times as large in the world.
#[test]
fn planes_are_flat() {
    let shear =
        DMat3::from_cols(DVec3::new(16.0, 0.0, 0.0), DVec3::new(5.0, -16.0, 0.0), DVec3::new(0.0, 3.0, 40.0));
    let turned = DMat3::from_rotation_x(0.4) * DMat3::from_diagonal(DVec3::new(3.0, -3.0, 3.0));
    for (matrix3, reach, most_on_average, most) in [(turned, 20.0, 3.5, 7.5), (shear, 120.0, 6.0, 16.0)] {
        let place = DAffine3::from_mat3_translation(matrix3, DVec3::new(1e5, -3e4, 10.0));
        let mut random = Random(4);
        let (mut worst, mut all) = (0.0f64, 0.0);
        for _ in 0..12 {
            let normal = random.direction();
            let voxels = Voxels::new([40; 3], |p| u8::from((p - 20.1).dot(normal) < 0.0));
            let tracer = voxels.tracer(place, LodChoice::Voxels);
            let in_world = (matrix3.inverse().transpose() * normal).normalize();
            let middle = place.transform_point3(DVec3::splat(20.1));
            // Away from the volume's own sides.
            let inner = |p: DVec3| (place.inverse().transform_point3(p) - 20.0).abs().max_element() < 14.0;
            let found = hits(&tracer, middle, reach, 3000);
            let kept: Vec<_> = found.into_iter().filter(|(_, p)| inner(*p)).collect();
            assert!(kept.len() > 300);
            let [mean, ..] = angles(&tracer, &kept, |_| in_world);
            worst = worst.max(mean);
            all += mean / 12.0;
        }
        println!("planes: {all:.2}° on average, {worst:.2}° the worst");
        assert!(all < most_on_average && worst < most, "{all} {worst}");
    }
}

/// The sum by boxes, cells and rows of bits equals the sum over voxels; voxels of other labels do not count.
#[test]
fn normals_are_those_of_a_naive_sum() {
    // Touching bodies larger than boxes, and noise.
    let mut random = Random(2);
    let centers: Vec<_> =
        (0..6).map(|_| DVec3::new(random.next(), random.next(), random.next()) * 50.0).collect();
    let noise: Vec<f64> = (0..60 * 60 * 60).map(|_| random.next()).collect();
    let voxels = Voxels::new([60; 3], |p| {
        let i = (p.x as usize) + 60 * (p.y as usize + 60 * p.z as usize);
        match centers.iter().position(|c| (p - *c).length() < 17.0) {
            Some(body) if noise[i] < 0.97 => 1 + body as u8,
            None if noise[i] < 0.02 => 9,
            _ => 0,
        }
    });
    let place = DAffine3::from_scale(DVec3::new(-0.5, 0.25, 2.0));
    let tracer = voxels.tracer(place, LodChoice::Voxels);
    let ids = voxels.compressed().labels().ids().to_vec();
    let normals = place.matrix3.inverse().transpose();
    let (mut compared, mut flat) = (0, 0);
    for (hit, point) in hits(&tracer, place.transform_point3(DVec3::splat(30.0)), 40.0, 6000) {
        let mut p = place.inverse().transform_point3(point);
        p[usize::from(hit.surface.axis)] = f64::from(hit.surface.plane);
        let expected = voxels.naive(ids[hit.surface.label as usize] as u8, p);
        let in_world = (normals * expected).normalize();
        match tracer.smooth_normal(&hit.surface, point) {
            // Sums of up to 216 floats.
            Some(got) => {
                compared += 1;
                let short = 1e-5 / expected.length();
                assert!((got - in_world).length() < 1e-5 + 40.0 * short, "{hit:?}: {got} {in_world}");
            }
            None => {
                flat += 1;
                assert!(in_world.dot(hit.normal_in_world) < 1e-3, "{hit:?}: {in_world}");
            }
        }
    }
    assert!(compared > 5000, "{compared} {flat}");
}

/// Whether the voxel with this middle exists.
type Shape = fn(DVec3) -> bool;

/// A single voxel, a sheet and a rod of one voxel, corners that touch, a block that fills its volume: normals are finite and on the face's
/// side.
#[test]
fn what_is_thin_has_normals() {
    let shapes: [(&str, Shape); 6] = [
        ("voxel", |p| p == DVec3::splat(5.5)),
        ("sheet", |p| p.z == 5.5),
        ("rod", |p| p.z == 5.5 && p.x == 5.5),
        ("corners", |p| (p.x as u32 + p.y as u32 + p.z as u32).is_multiple_of(2)),
        ("block", |_| true),
        ("edge", |p| p.x < 6.0 && p.y > p.z),
    ];
    for (name, shape) in shapes {
        let voxels = Voxels::new([12, 11, 13], |p| u8::from(shape(p)));
        let tracer = voxels.tracer(DAffine3::IDENTITY, LodChoice::Voxels);
        let hits = hits(&tracer, DVec3::splat(5.5), 6.0, 400);
        let mut smooth = 0;
        for (hit, point) in &hits {
            if let Some(n) = tracer.smooth_normal(&hit.surface, *point) {
                smooth += 1;
                assert!(n.is_finite() && (n.length() - 1.0).abs() < 1e-9, "{name}: {n}");
                assert!(n.dot(hit.normal_in_world) > 0.0, "{name}: {n} at {hit:?}");
            }
        }
        assert!(smooth > 200, "{name}: {smooth}");
    }
    // In the middle of a sheet, and of a face of a block, normals are those of the faces.
    for shape in [shapes[1].1, shapes[4].1] {
        let voxels = Voxels::new([12, 11, 13], |p| u8::from(shape(p)));
        let tracer = voxels.tracer(DAffine3::IDENTITY, LodChoice::Voxels);
        let ray = RayInWorld { origin: DVec3::new(5.7, 5.2, 40.0), direction: DVec3::NEG_Z };
        let hit = tracer.first_hit(&ray, PathOrigin::Free, f64::INFINITY).unwrap();
        let n = tracer.smooth_normal(&hit.surface, ray.origin + ray.direction * hit.t).unwrap();
        assert!((n - DVec3::Z).length() < 1e-5, "{n}");
    }
}

/// Caps, coarse elements, and all surfaces where smooth shading is off stay flat.
#[test]
fn what_stays_flat() {
    let (voxels, middle) = ball(8.0, DVec3::ONE);
    let coarse = voxels.tracer(DAffine3::IDENTITY, LodChoice::Cells);
    assert!(coarse.is_smooth());
    let flat = |t: &VolumeTracer| {
        let hits = hits(t, middle, 8.0, 200);
        hits.iter().all(|(hit, p)| t.smooth_normal(&hit.surface, *p).is_none())
    };
    assert!(flat(&coarse));
    let plain = voxels.tracer(DAffine3::IDENTITY, LodChoice::Voxels).shaded_smooth(false).unwrap();
    assert!(flat(&plain) && !plain.is_smooth());
    let tracer = voxels.tracer(DAffine3::IDENTITY, LodChoice::Voxels);
    let (hit, point) = hits(&tracer, middle, 8.0, 1)[0];
    assert!(tracer.smooth_normal(&hit.surface, point).is_some());
    let cap = pumice_transport::Surface { kind: SurfaceKind::Cap, ..hit.surface };
    assert_eq!(tracer.smooth_normal(&cap, point), None);
}

fn draw(renderer: &mut CpuRenderer, scene: &Scene, volume: &Arc<CompressedVolume>) -> Picture {
    renderer.set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(volume)], vec![]).unwrap()).unwrap();
    while renderer.advance(Duration::from_secs(5), 4, &Job::new()).unwrap().spp < 4 {}
    renderer.picture().unwrap()
}

/// Switched on and off between frames of one renderer, with other levels and placements: each picture is that of a new renderer. The pass
/// of normals follows, the pass of depth does not.
#[test]
fn edits_switch_it() {
    let (voxels, middle) = ball(8.0, DVec3::ONE);
    let volume = voxels.compressed();
    let place = DAffine3::from_translation(-middle);
    let flat = Scene {
        version: SCENE_VERSION,
        instances: vec![Instance {
            id: 1,
            source: "memory".into(),
            reading: Reading::default(),
            world_from_index: place,
            style: LabelStyle::default(),
        }],
        camera: Camera::new(
            DAffine3::from_translation(DVec3::new(0.3, 0.2, 40.0)),
            Projection::Orthographic { scale: 20.0 },
        ),
        film: Film::new(24, 24, Filter::Box { width: 1.0 }),
        world: World { environment: Environment::Constant { radiance: [1.0, 0.9, 0.8] }, backdrop: None },
        suns: Vec::new(),
        lights: Vec::new(),
        meshes: Vec::new(),
        cuts: Vec::new(),
        settings: Settings { bounces: 2, ..Settings::default() },
    };
    let with = |change: &dyn Fn(&mut Scene)| {
        let mut scene = flat.clone();
        change(&mut scene);
        scene
    };
    let scenes = [
        flat.clone(),
        with(&|s| s.settings.smooth_voxels = true),
        with(&|s| (s.settings.smooth_voxels, s.settings.lod) = (true, Lod::Cells)),
        with(&|s| s.instances[0].world_from_index = place * DAffine3::from_rotation_x(0.1)),
        with(&|s| {
            s.settings.smooth_voxels = true;
            s.instances[0].world_from_index = place * DAffine3::from_rotation_x(0.1);
        }),
        flat.clone(),
    ];
    let new = || CpuRenderer::new(|path| Err(format!("no picture at {}", path.display())));
    let mut kept = new();
    let pictures: Vec<_> = scenes.iter().map(|scene| draw(&mut kept, scene, &volume)).collect();
    for (scene, picture) in scenes.iter().zip(&pictures) {
        let own = draw(&mut new(), scene, &volume);
        assert_eq!(own.color.pixels, picture.color.pixels);
        assert_eq!(own.normal.unwrap().pixels, picture.normal.as_ref().unwrap().pixels);
    }
    let [flat, smooth, ..] = &pictures[..] else { panic!("pictures") };
    assert!(flat.depth == smooth.depth && flat.color.pixels != smooth.color.pixels);
    let kinds = |p: &Picture| {
        let mut all: Vec<_> = p.normal.as_ref().unwrap().pixels.iter().map(|n| n.map(f32::to_bits)).collect();
        all.sort_unstable();
        all.dedup();
        all.len()
    };
    assert!(kinds(flat) < 5 && kinds(smooth) > 100, "{} {}", kinds(flat), kinds(smooth));
}

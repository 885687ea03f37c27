//! Volumes that are drawn from disk, compared with the same volumes in memory: every query bit by bit, whatever the limit of memory.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

#[path = "../../tests/tests/turns/mod.rs"]
mod turns;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::time::Duration;

use glam::{DAffine3, DVec3};
use pumice_core::residency::ResidencyCounts;
use pumice_core::{CompressedVolume, CompressionLevel, Job, Residency};
use pumice_cpu::CpuRenderer;
use pumice_cpu::traverse::{TracedInstance, VolumeTracer};
use pumice_oracle::volumes::{Random, blobs, noise, volume};
use pumice_picture::Image;
use pumice_scene::{
    Camera, CutShape, Environment, Film, Filter, Instance, LabelStyle, Projection, Reading, SCENE_VERSION,
    Scene, Settings, Sun, World,
};
use pumice_transport::geometry::LodChoice;
use pumice_transport::{LoadedScene, PathOrigin, RayInWorld, RenderError, Renderer, Tracer};
use rayon::prelude::*;
use turns::of_today;

/// A file that is removed when the test ends.
struct TestFile(PathBuf);

impl TestFile {
    fn of(volume: &CompressedVolume, level: CompressionLevel) -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let name = format!("pumice-pages-{}-{}.pumice", std::process::id(), NUMBER.fetch_add(1, Relaxed));
        let path = std::env::temp_dir().join(name);
        volume.save(&path, level, &Job::new()).unwrap();
        Self(path)
    }

    /// The volume in pages within a limit; the file is not needed any more.
    fn paged(&self, page_voxels: u32, limit: u64) -> (Arc<CompressedVolume>, Arc<Residency>) {
        let memory = Arc::new(Residency::new(limit));
        let folder = std::env::temp_dir();
        let volume =
            CompressedVolume::open_paged(&self.0, page_voxels, &folder, &memory, &Job::new()).unwrap();
        (Arc::new(volume), memory)
    }
}

impl Drop for TestFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn instance(volume: &Arc<CompressedVolume>, lod: LodChoice) -> TracedInstance {
    TracedInstance {
        volume: Arc::clone(volume),
        world_from_index: DAffine3::from_scale(DVec3::new(0.5, 0.75, 1.25)),
        visible: (0..volume.labels().len()).map(|label| label % 5 != 2).collect(),
        lod,
    }
}

/// The answers to all queries along some rays, from free points and from the faces that these hit, as text.
fn answers(tracer: &VolumeTracer, dims: [u32; 3], rays: u64) -> Vec<String> {
    let ask = |number: u64| {
        let mut random = Random(number.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let size = DVec3::from_array(dims.map(f64::from)) * DVec3::new(0.5, 0.75, 1.25);
        let mut point = || DVec3::new(random.unit(), random.unit(), random.unit()) * size * 1.4 - 0.2 * size;
        let (mut origin, target) = (point(), point());
        let mut direction = target - origin;
        if number.is_multiple_of(4) {
            // Along an axis and along planes of voxels.
            let axis = (number / 4 % 3) as usize;
            direction = DVec3::AXES[axis] * direction[axis].signum();
            origin = (origin * 4.0).round() / 4.0;
        }
        let (mut ray, mut from, mut said) =
            (RayInWorld { origin, direction }, PathOrigin::Free, String::new());
        for bounce in 0..4 {
            let hit = tracer.first_hit(&ray, from, f64::INFINITY);
            said += &format!("{hit:?} {} ", tracer.occluded(&ray, from, 100.0));
            let Some(hit) = hit else { break };
            let label = hit.surface.label;
            said += &format!("{:?} ", tracer.next_boundary(&ray, label, from, f64::INFINITY));
            said +=
                &format!("{:?} {:?} ", tracer.label_at(hit.surface.voxel), tracer.box_origin(&hit.surface));
            let mut turned = DVec3::new(random.unit(), random.unit(), random.unit()) - 0.5;
            if turned.dot(hit.normal_in_world) < 0.0 && bounce != 2 {
                turned = -turned;
            }
            ray = RayInWorld { origin: ray.origin + ray.direction * hit.t, direction: turned };
            from = PathOrigin::Face(hit.surface);
        }
        said
    };
    (0..rays).into_par_iter().map(ask).collect()
}

fn cut() -> CutShape {
    let middle = DAffine3::from_translation(DVec3::new(30.0, 40.0, 60.0));
    CutShape::Box { world_from_box: middle * DAffine3::from_scale(DVec3::splat(20.0)) }
}

const ALL_LEVELS: [LodChoice; 3] = [LodChoice::Voxels, LodChoice::Cells, LodChoice::Boxes];

/// Every query has the same bits as in memory, at every level of detail, from every kind of file and in pages of each size; without a
/// limit each page is loaded once at most.
#[test]
fn queries_have_the_bits_of_a_volume_in_memory() {
    let volumes = [blobs([150, 140, 201], 60, 50, 7).1, noise([70, 131, 90], 0.03, 40, 9).1];
    let files = [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small];
    let mut hits = 0;
    for (number, whole) in volumes.iter().enumerate() {
        for (lod, (file, page)) in ALL_LEVELS.into_iter().zip(files.into_iter().zip([64, 128, 256])) {
            let (paged, memory) = TestFile::of(whole, file).paged(page, u64::MAX);
            assert_eq!(paged.content_hash(), whole.content_hash());
            assert_eq!(paged.label_bounds(), whole.label_bounds());
            let shapes = if number == 0 { vec![cut()] } else { vec![] };
            let [a, b] = [whole, &paged]
                .map(|v| VolumeTracer::in_bricks(0, &instance(v, lod)).unwrap().with_cuts(&shapes));
            assert!(a.page_loads().is_none() && a.boxes() == b.boxes());
            let dims = whole.info().dims;
            let (expected, got) = (answers(&a, dims, 1200), answers(&b, dims, 1200));
            for (ray, (expected, got)) in expected.iter().zip(&got).enumerate() {
                assert_eq!(expected, got, "volume {number}, {lod:?}, ray {ray}");
            }
            hits += expected.iter().filter(|said| said.contains("Some(Hit")).count();
            let (loads, pages) = b.page_loads().unwrap();
            assert!(loads <= pages && loads > 0 && memory.counts().loads == loads, "{loads} of {pages}");
        }
    }
    assert!(hits > 3600, "{hits}");
}

/// Levels by distance from an eye at this place along x, in front of the volume: voxels, cells from 62 on, boxes from 250 on.
fn from_eye_at(x: f64) -> LodChoice {
    let eye_in_world = DVec3::new(x, 50.0, 20.0);
    LodChoice::Distance { eye_in_world, world_per_distance: 0.08, world_constant: 0.0 }
}

/// With levels by distance, every query has the same bits as in memory, where a hierarchy finds the boxes. From another eye they have too, and pages
/// whose boxes keep their level stay in memory.
#[test]
fn levels_by_distance_have_the_bits_of_a_volume_in_memory() {
    let volumes: [fn() -> Arc<CompressedVolume>; 2] =
        [|| blobs([150, 140, 301], 60, 50, 7).1, || noise([170, 131, 290], 0.03, 40, 9).1];
    for make in of_today(&volumes) {
        let whole = make();
        let (paged, memory) = TestFile::of(&whole, CompressionLevel::Fast).paged(64, u64::MAX);
        let dims = whole.info().dims;
        let mut tracer: Option<VolumeTracer> = None;
        let mut anew = Vec::new();
        for eye in [-10.0, -10.25, -400.0, 20.0] {
            let [whole, paged] = [&whole, &paged].map(|v| instance(v, from_eye_at(eye)));
            let in_memory = VolumeTracer::in_bricks(0, &whole).unwrap();
            let expected = answers(&in_memory, dims, 700);
            let loads = memory.counts().loads;
            let drawn = match &tracer {
                None => VolumeTracer::in_bricks(0, &paged).unwrap(),
                Some(former) => former.showing(&paged.visible, 0, &paged).unwrap().0,
            };
            let got = answers(&drawn, dims, 700);
            for (ray, (expected, got)) in expected.iter().zip(&got).enumerate() {
                assert_eq!(expected, got, "eye {eye}, ray {ray}");
            }
            anew.push(memory.counts().loads - loads);
            tracer = Some(drawn);
        }
        let all = anew[0];
        assert!(all > 20 && anew[1..].iter().all(|n| (1..all).contains(n)), "{anew:?}");
        assert!(anew[1] < all * 3 / 4, "a step of the eye: {anew:?}");

        // Control: another distance at which levels change gives other answers.
        let [near, far] = [0.08, 0.079].map(|world_per_distance| {
            let eye_in_world = DVec3::new(20.0, 50.0, 20.0);
            let lod = LodChoice::Distance { eye_in_world, world_per_distance, world_constant: 0.0 };
            answers(&VolumeTracer::in_bricks(0, &instance(&paged, lod)).unwrap(), dims, 700)
        });
        assert_ne!(near, far);
    }
}

/// Control of the comparisons above: with one more label hidden, answers differ.
#[test]
fn another_choice_of_labels_gives_other_answers() {
    let (_, whole) = blobs([150, 140, 101], 60, 50, 7);
    let (paged, _) = TestFile::of(&whole, CompressionLevel::Fast).paged(64, u64::MAX);
    let mut fewer = instance(&paged, LodChoice::Voxels);
    fewer.visible[11] = false;
    let a = VolumeTracer::in_bricks(0, &instance(&whole, LodChoice::Voxels)).unwrap();
    let b = VolumeTracer::in_bricks(0, &fewer).unwrap();
    assert_ne!(answers(&a, whole.info().dims, 500), answers(&b, whole.info().dims, 500));
}

/// Within a limit that holds a part of the pages they come and go, the limit holds, and the answers stay the same.
#[test]
fn a_limit_holds_and_changes_no_answer() {
    let (_, whole) = noise([256, 256, 192], 0.05, 500, 3);
    let file = TestFile::of(&whole, CompressionLevel::Fast);
    let counts_within = |limit: u64| -> (Vec<String>, ResidencyCounts) {
        let (paged, memory) = file.paged(64, limit);
        let tracer = VolumeTracer::in_bricks(0, &instance(&paged, LodChoice::Voxels)).unwrap();
        (answers(&tracer, whole.info().dims, 1500), memory.counts())
    };
    let in_memory = VolumeTracer::in_bricks(0, &instance(&whole, LodChoice::Voxels)).unwrap();
    let expected = answers(&in_memory, whole.info().dims, 1500);

    let (got, unlimited) = counts_within(u64::MAX);
    assert!(got == expected && unlimited.loads <= unlimited.parts && unlimited.parts == 48, "{unlimited:?}");
    let limit = unlimited.bytes_of_all / 2;
    let (got, limited) = counts_within(limit);
    assert!(got == expected, "{limited:?}");
    assert!(limited.most_held_bytes <= limit && limited.most_held_bytes > limit / 2, "{limited:?}");
    assert!(limited.loads > 4 * limited.parts, "pages come again: {limited:?}");

    // A limit that holds nothing says what is needed, and that is enough.
    let (paged, _) = file.paged(64, 1000);
    let refused = VolumeTracer::in_bricks(0, &instance(&paged, LodChoice::Voxels)).unwrap_err().to_string();
    assert!(refused.starts_with("memory limit: 1000 bytes are too few, "), "{refused}");
    let needed: u64 = refused.split([',', ' ']).filter_map(|word| word.parse().ok()).nth(1).unwrap();
    let (got, least) = counts_within(needed);
    assert!(got == expected && least.most_held_bytes <= needed, "{least:?}");
    let (paged, _) = file.paged(64, needed - 1);
    assert!(VolumeTracer::in_bricks(0, &instance(&paged, LodChoice::Voxels)).is_err());
}

/// A volume from above, in the light of a sun and of the sky.
fn scene(volume: &CompressedVolume) -> Scene {
    let size = DVec3::from_array(volume.info().dims.map(f64::from));
    let above = DAffine3::from_translation(size * DVec3::new(0.5, 0.5, 1.0) + DVec3::Z * 50.0);
    let scale = size.x.max(size.y) * 1.3;
    Scene {
        version: SCENE_VERSION,
        instances: vec![Instance {
            id: 1,
            source: "a.pumice".into(),
            reading: Reading::default(),
            world_from_index: DAffine3::IDENTITY,
            style: LabelStyle::default(),
        }],
        camera: Camera::new(above, Projection::Orthographic { scale }),
        film: Film::new(60, 50, Filter::Box { width: 1.0 }),
        world: World { environment: Environment::Constant { radiance: [0.5; 3] }, backdrop: None },
        suns: vec![Sun { direction: [0.3, 0.1, -1.0], strength: 2.0, color: [1.0; 3], angle_rad: 0.1 }],
        lights: Vec::new(),
        meshes: Vec::new(),
        cuts: Vec::new(),
        settings: Settings::default(),
    }
}

fn picture(scene: &Scene, volume: &Arc<CompressedVolume>) -> Result<Image, RenderError> {
    let mut renderer = CpuRenderer::new(|path| Err(format!("no picture at {}", path.display())));
    renderer.set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(volume)], vec![])?)?;
    while renderer.advance(Duration::from_millis(20), 9, &Job::new())?.spp < 9 {}
    renderer.color()
}

/// A path traced picture is equal bit by bit, within a limit that makes pages come again.
#[test]
fn a_picture_within_a_limit_is_the_same() {
    let (_, whole) = volume([256, 192, 128], |x, y, z| {
        let hash = (x / 3).wrapping_mul(0x9E37).wrapping_add((y / 4).wrapping_mul(0x85EB)) ^ (z / 5 * 0xC2B3);
        if hash % 13 < 2 { 1 + hash % 200 } else { 0 }
    });
    let scene = scene(&whole);
    let expected = picture(&scene, &whole).unwrap();
    let file = TestFile::of(&whole, CompressionLevel::Default);
    let (paged, memory) = file.paged(64, u64::MAX);
    assert!(picture(&scene, &paged).unwrap() == expected);
    let limit = memory.counts().most_held_bytes / 2;
    let (paged, memory) = file.paged(64, limit);
    assert!(picture(&scene, &paged).unwrap() == expected);
    let counts = memory.counts();
    assert!(counts.most_held_bytes <= limit && counts.loads > counts.parts, "{counts:?}");
}

/// What needs all boxes at once says so.
#[test]
fn what_needs_everything_in_memory_is_refused() {
    let (_, whole) = blobs([70, 40, 36], 20, 18, 3);
    let (paged, _) = TestFile::of(&whole, CompressionLevel::Fast).paged(64, u64::MAX);
    let line = |change: fn(&mut Scene)| {
        let mut scene = scene(&whole);
        change(&mut scene);
        picture(&scene, &paged).unwrap_err().to_string()
    };
    let smooth = line(|scene| scene.settings.smooth_voxels = true);
    assert!(smooth.starts_with("memory limit: smooth shading"), "{smooth}");
    let emits = line(|scene| scene.instances[0].style.material.emission = [1.0; 3]);
    assert!(emits.starts_with("memory limit: instances[0] emits light"), "{emits}");
}

/// With other labels shown, the picture is that of a volume in memory, and pages without the labels that changed stay in memory: the same
/// picture again loads those alone that were made anew. What is given up is counted out.
#[test]
fn pages_stay_when_labels_elsewhere_are_hidden() {
    // Labels of a single page each, and one, 50, that reaches through all.
    let (_, whole) = volume([256, 128, 128], |x, y, z| {
        let page = 1 + x / 64 + 4 * (y / 64) + 8 * (z / 64);
        match (x % 7 < 3, y % 5 < 2, z % 4 < 2) {
            (true, true, _) => page,
            (_, _, true) if (x + y) % 11 == 0 => 50,
            _ => 0,
        }
    });
    let (paged, memory) = TestFile::of(&whole, CompressionLevel::Fast).paged(64, u64::MAX);
    let shown_of = |volume: &Arc<CompressedVolume>, hidden: &[u64]| TracedInstance {
        visible: volume.labels().ids().iter().map(|id| !hidden.contains(id)).collect(),
        ..instance(volume, LodChoice::Voxels)
    };
    let expected = |hidden: &[u64]| {
        let traced = shown_of(&whole, hidden);
        answers(&VolumeTracer::in_bricks(0, &traced).unwrap(), whole.info().dims, 1500)
    };
    let got = |tracer: &VolumeTracer| answers(tracer, whole.info().dims, 1500);

    let all = shown_of(&paged, &[]);
    let mut tracer = VolumeTracer::in_bricks(0, &all).unwrap();
    assert!(got(&tracer) == expected(&[]));
    let before = memory.counts();
    assert_eq!((before.parts, before.loads), (16, 16), "every page was met");
    let (mut visible, mut loads) = (all.visible, before.loads);
    // (labels hidden now, pages made anew)
    for (hidden, anew) in [(vec![3], 1), (vec![3, 10], 1), (vec![10], 1), (vec![], 1), (vec![50], 16)] {
        let traced = shown_of(&paged, &hidden);
        let shown = tracer.showing(&visible, 0, &traced).unwrap().0;
        (tracer, visible) = (shown, traced.visible);
        assert!(got(&tracer) == expected(&hidden), "{hidden:?}");
        assert_eq!(memory.counts().loads - loads, anew, "{hidden:?}");
        assert_eq!(memory.counts().parts, 16);
        loads = memory.counts().loads;
    }
    // More changes than there may be files: then all pages are made anew, once.
    for change in 0..20u64 {
        let traced = shown_of(&paged, &[1 + change % 2, 50]);
        let shown = tracer.showing(&visible, 0, &traced).unwrap().0;
        (tracer, visible) = (shown, traced.visible);
        assert!(got(&tracer) == expected(&[1 + change % 2, 50]), "{change}");
    }
    drop(tracer);
    let after = memory.counts();
    assert_eq!(
        (after.held_bytes, after.kept_bytes, after.parts, after.bytes_of_all),
        (0, 0, 0, 0),
        "{after:?}"
    );
}

/// Two tracers share one memory: pages of the first make room for those of the second, which is not refused for them.
#[test]
fn tracers_share_a_limit() {
    // What suffices depends on the number of threads.
    rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap().install(check_that_tracers_share_a_limit);
}

fn check_that_tracers_share_a_limit() {
    let (_, whole) = noise([256, 192, 128], 0.05, 500, 3);
    let file = TestFile::of(&whole, CompressionLevel::Fast);
    let (paged, memory) = file.paged(64, u64::MAX);
    let in_memory = VolumeTracer::in_bricks(0, &instance(&whole, LodChoice::Voxels)).unwrap();
    let expected = answers(&in_memory, whole.info().dims, 800);
    let first = VolumeTracer::in_bricks(0, &instance(&paged, LodChoice::Voxels)).unwrap();
    let kept = memory.counts().kept_bytes;
    assert!(answers(&first, whole.info().dims, 800) == expected);
    let all = memory.counts().held_bytes - kept;

    // Both tables, and half of the pages of one.
    let limit = 2 * kept + all / 2;
    let (paged, memory) = file.paged(64, limit);
    let both = [(); 2].map(|()| VolumeTracer::in_bricks(0, &instance(&paged, LodChoice::Voxels)).unwrap());
    for tracer in both.iter().chain(&both[..1]) {
        assert!(answers(tracer, whole.info().dims, 800) == expected);
    }
    let counts = memory.counts();
    assert!(counts.most_held_bytes <= limit && counts.loads > counts.parts, "{counts:?}");
}

/// The least limit that suffices for some labels suffices for fewer of them too, although both choices are there for a moment: the tables of
/// the former one do not count.
#[test]
fn another_choice_of_labels_takes_the_place_of_the_former() {
    let of_two_threads = || {
        let (_, whole) = noise([256, 192, 128], 0.05, 500, 3);
        let file = TestFile::of(&whole, CompressionLevel::Fast);
        let (paged, _) = file.paged(64, 1);
        let refused =
            VolumeTracer::in_bricks(0, &instance(&paged, LodChoice::Voxels)).unwrap_err().to_string();
        let (_, text) = refused.split_once("too few, ").unwrap();
        let least: u64 = text.split_once(' ').unwrap().0.parse().unwrap();
        let (paged, _) = file.paged(64, least);
        let all = instance(&paged, LodChoice::Voxels);
        let tracer = VolumeTracer::in_bricks(0, &all).unwrap();
        let visible = all.visible.iter().zip(0..).map(|(&is, label)| is && label % 3 != 0).collect();
        tracer.showing(&all.visible, 0, &TracedInstance { visible, ..all.clone() }).unwrap();
        // Negative control: beside the former one, the other choice does not fit.
        VolumeTracer::in_bricks(0, &all).unwrap_err();
    };
    rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap().install(of_two_threads);
}

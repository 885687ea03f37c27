//! Volumes on disk, drawn in pages: pictures, passes, surfaces and picks have the bits of the same volume on the device as a whole, whatever
//! the limit of memory.

use std::sync::Arc;
use std::time::Duration;

use glam::{DAffine3, DQuat, DVec3};
use pumice_core::{CompressedVolume, CompressionLevel, Job, Residency};
use pumice_oracle::volumes::volume;
use pumice_picture::Picture;
use pumice_scene::{
    Camera, Cut, CutShape, Environment, Film, Filter, Instance, LabelStyle, Lod, Projection, Reading,
    SCENE_VERSION, Scene, Settings, Show, Sun, World,
};
use pumice_transport::{LoadedScene, Pick, RenderError, Renderer as _, SeenSurface};
use pumice_vulkan::device::InjectedFault;

use super::{Backend, Validated, of_today};

/// Crumbs of 200 labels, in 84 pages of 64³ voxels.
fn crumbs() -> Arc<CompressedVolume> {
    let label = |x: u32, y: u32, z: u32| {
        let hash = (x / 3).wrapping_mul(0x9E37).wrapping_add((y / 4).wrapping_mul(0x85EB)) ^ (z / 5 * 0xC2B3);
        if hash % 13 < 2 { 1 + hash % 200 } else { 0 }
    };
    volume([448, 384, 128], label).1
}

/// The same volume in pages within a limit.
fn paged(whole: &CompressedVolume, limit: u64) -> (Arc<CompressedVolume>, Arc<Residency>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("crumbs.pumice");
    whole.save(&path, CompressionLevel::Fast, &Job::new()).unwrap();
    let memory = Arc::new(Residency::new(limit));
    let volume =
        CompressedVolume::open_paged(&path, 64, &std::env::temp_dir(), &memory, &Job::new()).unwrap();
    (Arc::new(volume), memory)
}

/// The volume twice, once turned, in the light of a sun and of the sky.
fn scene(volume: &CompressedVolume) -> Scene {
    let size = DVec3::from_array(volume.info().dims.map(f64::from));
    let above = DAffine3::from_translation(size * DVec3::new(0.5, 0.5, 1.0) + DVec3::Z * 50.0);
    let instance = |id: u32, world_from_index: DAffine3| Instance {
        id,
        source: "a.pumice".into(),
        reading: Reading::default(),
        world_from_index,
        style: LabelStyle::default(),
    };
    let turned =
        DAffine3::from_rotation_translation(DQuat::from_rotation_z(0.4), DVec3::new(60.0, 90.0, 90.0));
    Scene {
        version: SCENE_VERSION,
        instances: vec![instance(1, DAffine3::IDENTITY), instance(2, turned)],
        camera: Camera::new(above, Projection::Orthographic { scale: size.x * 1.3 }),
        film: Film::new(44, 37, Filter::Box { width: 1.0 }),
        world: World { environment: Environment::Constant { radiance: [0.5; 3] }, backdrop: None },
        suns: vec![Sun { direction: [0.3, 0.1, -1.0], strength: 2.0, color: [1.0; 3], angle_rad: 0.1 }],
        lights: Vec::new(),
        meshes: Vec::new(),
        cuts: Vec::new(),
        settings: Settings { bounces: 3, ..Settings::default() },
    }
}

fn loaded(scene: &Scene, volume: &Arc<CompressedVolume>) -> LoadedScene {
    LoadedScene::new(scene.clone(), vec![Arc::clone(volume); scene.instances.len()], vec![]).unwrap()
}

/// Programs that draw pages are compiled for one backend a day.
fn backend_of_today() -> Backend {
    of_today(&[Backend::Compute, Backend::RayQuery, Backend::RayPipeline])[0]
}

/// All that a renderer gives of a scene.
#[derive(Debug, PartialEq)]
struct Given {
    picture: Picture,
    surfaces: Vec<Option<SeenSurface>>,
    picks: Vec<Option<Pick>>,
}

fn given(renderer: &mut Validated, scene: &LoadedScene) -> Result<Given, RenderError> {
    renderer.set_scene(scene)?;
    while renderer.advance(Duration::from_millis(20), 9, &Job::new())?.spp < 9 {}
    let picture = renderer.picture()?;
    let surfaces = renderer.seen_surfaces(&Job::new())?;
    let picks = [(3, 4), (20, 20), (43, 36)].map(|(x, y)| renderer.pick(x, y)).into_iter();
    Ok(Given { picture, surfaces, picks: picks.collect::<Result<_, _>>()? })
}

/// Without a limit each page is loaded once at most; within a part of what that takes, pages come again; within very little, tiles are
/// divided. Every time all bits are the same. Returns a 25th of what the picture takes, which is too little for it.
fn check_within_limits(renderer: &mut Validated, mut scene: Scene, whole: &Arc<CompressedVolume>) -> u64 {
    let expected = given(renderer, &loaded(&scene, whole)).unwrap();
    let (volume, memory) = paged(whole, u64::MAX);
    let got = given(renderer, &loaded(&scene, &volume)).unwrap();
    assert!(got == expected, "without a limit");
    let all = memory.counts();
    assert!(all.parts == 84 && all.loads > 40 && all.loads <= 84, "{all:?}");
    for part in [2, 3] {
        let limit = all.most_held_bytes / part;
        let (volume, memory) = paged(whole, limit);
        let got = given(renderer, &loaded(&scene, &volume)).unwrap();
        assert!(got == expected, "a {part}th");
        let counts = memory.counts();
        assert!(counts.most_held_bytes <= limit && counts.loads > counts.parts, "{limit} {counts:?}");
    }
    let hits = expected.surfaces.iter().flatten().count();
    assert!(hits > 500, "{hits}");
    // Negative control: with one label hidden, the picture is another.
    scene.instances[0].style.show = Show::Except(vec![13]);
    assert!(given(renderer, &loaded(&scene, &volume)).unwrap() != expected);
    all.most_held_bytes / 25
}

#[test]
#[ignore = "full: compiles programs with cuts, which takes a quarter of a minute"]
fn a_cut_picture_of_cells_within_a_limit_has_the_bits_of_the_whole_volume() {
    let whole = crumbs();
    let mut scene = scene(&whole);
    scene.settings.lod = Lod::Cells;
    let middle = DAffine3::from_translation(DVec3::new(120.0, 90.0, 120.0));
    let shape = CutShape::Box { world_from_box: middle * DAffine3::from_scale(DVec3::splat(50.0)) };
    scene.cuts = vec![Cut { shape, instances: None }];
    check_within_limits(&mut Validated::open_bare(backend_of_today()), scene, &whole);
}

fn a_picture_within_a_limit_has_the_bits_of_the_whole_volume() {
    let whole = crumbs();
    let mut renderer = Validated::open_bare(backend_of_today());
    let least = check_within_limits(&mut renderer, scene(&whole), &whole);

    // All pages of a path must fit. The error says what the path of one pixel took, and leaves the way open for another backend.
    let (scene, (volume, _)) = (scene(&whole), paged(&whole, least));
    let refused = given(&mut renderer, &loaded(&scene, &volume)).unwrap_err();
    let RenderError::Device(text) = refused else { panic!("{refused:?}") };
    let start = format!("memory limit: {least} bytes are too few, ");
    assert!(
        text.starts_with(&start)
            && text.contains("are needed at once on the device by the path through pixel"),
        "{text}"
    );
    let (volume, _) = paged(&whole, 1000);
    let RenderError::Device(text) = given(&mut renderer, &loaded(&scene, &volume)).unwrap_err() else {
        panic!()
    };
    assert!(
        text.starts_with("memory limit: 1000 bytes are too few, ") && text.contains("are needed"),
        "{text}"
    );
}

/// With levels by distance, a whole volume is drawn by its boxes and pages by their bricks. From another camera only pages whose boxes may
/// have another level are sent again.
#[test]
#[ignore = "full: compiles programs of boxes beside those of pages, which takes a quarter of a minute"]
fn levels_by_distance_have_the_bits_of_the_whole_volume() {
    let whole = crumbs();
    let (volume, memory) = paged(&whole, u64::MAX);
    let mut of_whole = Validated::open_bare(backend_of_today());
    let mut renderer = Validated::open_bare(backend_of_today());
    let mut scene = scene(&whole);
    scene.camera.projection = Projection::Perspective { fov_rad: 0.9 };
    let mut pictures: Vec<Given> = Vec::new();
    let mut loads = Vec::new();
    for (x, pixels) in [(-60.3, 0.7), (-60.8, 0.7), (-60.8, 1.1)] {
        // Along the volume: near it are voxels, then cells. No ray passes through an edge of the lattice, where the walk through a box may
        // skip what it only touches.
        let eye = DAffine3::from_translation(DVec3::new(x, 190.71, 90.13));
        let turn = DQuat::from_rotation_y(-std::f64::consts::FRAC_PI_2);
        scene.camera.world_from_camera = eye * DAffine3::from_quat(turn);
        scene.settings.lod = Lod::Distance { pixels };
        let expected = given(&mut of_whole, &loaded(&scene, &whole)).unwrap();
        let before = memory.counts().loads;
        let got = given(&mut renderer, &loaded(&scene, &volume)).unwrap();
        loads.push(memory.counts().loads - before);
        assert!(got == expected, "{x} {pixels}");
        // Control: other levels are another picture.
        assert!(pictures.iter().all(|other| *other != got));
        pictures.push(got);
    }
    assert!(loads[0] > 20 && loads[1] < loads[0] * 3 / 4 && loads[2] > 0, "{loads:?}");
    let (volume, memory) = paged(&whole, memory.counts().most_held_bytes / 2);
    assert!(given(&mut renderer, &loaded(&scene, &volume)).unwrap() == pictures[2]);
    assert!(memory.counts().loads > memory.counts().parts / 2, "{:?}", memory.counts());
}

/// Pages stay on the device over edits of anything else than what they show, and where labels are hidden that they do not have. After the
/// device was lost they are loaded again. Every picture has the bits of the whole volume.
fn pages_stay_over_edits() {
    // Labels of a single page each, and one, 50, that reaches through all.
    let (_, whole) = volume([256, 128, 128], |x, y, z| {
        let page = 1 + x / 64 + 4 * (y / 64) + 8 * (z / 64);
        match (x % 7 < 3, y % 5 < 2, z % 4 < 2) {
            (true, true, _) => page,
            (_, _, true) if (x + y) % 11 == 0 => 50,
            _ => 0,
        }
    });
    let (volume, memory) = paged(&whole, u64::MAX);
    let mut of_whole = Validated::open_bare(backend_of_today());
    let mut renderer = Validated::open_bare(backend_of_today());
    let mut scene = scene(&whole);
    scene.instances.truncate(1);
    let mut loads = |scene: &Scene, fault: bool| {
        let expected = given(&mut of_whole, &loaded(scene, &whole)).unwrap();
        let before = memory.counts().loads;
        renderer.set_scene(&loaded(scene, &volume)).unwrap();
        if fault {
            renderer.advance(Duration::ZERO, 1, &Job::new()).unwrap();
            renderer.gpu().inject(InjectedFault::Submission, 3, 1);
        }
        assert!(given(&mut renderer, &loaded(scene, &volume)).unwrap() == expected);
        assert_eq!(renderer.notices().len(), usize::from(fault));
        memory.counts().loads - before
    };
    let seen = loads(&scene, false);
    assert!((8..=16).contains(&seen), "{seen}");
    scene.instances[0].style.material.roughness = 0.3;
    scene.settings.bounces = 2;
    assert_eq!(loads(&scene, false), 0, "another material");
    for (hidden, most) in [(vec![3], 2), (vec![3, 10], 2), (vec![10], 2), (vec![], 2)] {
        scene.instances[0].style.show = Show::Except(hidden.clone());
        assert!(loads(&scene, false) <= most, "{hidden:?}");
    }
    scene.instances[0].style.show = Show::Except(vec![50]);
    assert!(loads(&scene, false) >= 8, "each page has label 50");
    assert!(loads(&scene, true) >= 8, "they were lost with the device");
    drop(renderer);
    // (A renderer that is kept for other tests forgets its scene.)
    let counts = memory.counts();
    assert_eq!((counts.kept_bytes, counts.parts), (0, 0), "{counts:?}");
}

/// Each compiles programs of its own, for the backend of the day. They alternate on odd days, on which this program has its turn.
#[test]
fn volumes_on_disk_are_drawn_as_in_memory() {
    let [edited, limited]: [fn(); 2] =
        [pages_stay_over_edits, a_picture_within_a_limit_has_the_bits_of_the_whole_volume];
    let turns = [None, Some(edited), None, Some(limited)];
    of_today(&turns).into_iter().flatten().for_each(|check| check());
}

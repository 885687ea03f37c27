//! A live picture as its clients see it: it follows edits, counts what it did, converges to the picture that a plain render gives, and
//! its failures do not reach the clients.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::sync::Arc;
use std::time::{Duration, Instant};

use pumice_core::{CompressedVolume, Job, LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_scene::{Environment, Material, Scene, SceneEdit, Show, World};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::live::{Frame, LabelFilm, Live, LiveOptions, LiveState, Status};
use pumice_session::{Filter, Stop, render_file::render_scene};
use pumice_transport::{LoadedEdit, LoadedScene};

/// Two touching blocks of labels 5 and 9 in a 24 × 16 × 8 volume.
fn volume() -> Arc<CompressedVolume> {
    let labels = (0..24 * 16 * 8u32).map(|i| match (i % 24, i / 24 % 16) {
        (2..12, 2..14) => 5u8,
        (12..22, 2..14) => 9,
        _ => 0,
    });
    let info = VolumeInfo::new([24, 16, 8], LabelType::U8);
    Arc::new(compress_labels(info, LabelBuffer::U8(labels.collect())).unwrap())
}

fn scene(size: [u32; 2]) -> Scene {
    let options = FigureOptions { size, ..FigureOptions::default() };
    compose(&volume(), "memory".into(), &options)
}

fn loaded(scene: Scene) -> LoadedScene {
    LoadedScene::new(scene, vec![volume()], vec![]).unwrap()
}

fn spp(n: u32) -> LiveOptions {
    LiveOptions {
        backend: "cpu".into(),
        stop: Stop { spp: Some(n), ..Stop::default() },
        ..LiveOptions::default()
    }
}

/// Waits for the next frame that is `wanted`; fails after a minute.
fn wait(live: &Live, mut wanted: impl FnMut(&Frame) -> bool) -> Arc<Frame> {
    let start = Instant::now();
    let mut serial = 0;
    loop {
        if let Some(frame) = live.latest(serial) {
            serial = frame.serial;
            if wanted(&frame) {
                return frame;
            }
        }
        assert!(start.elapsed() < Duration::from_secs(60), "no such frame: {:?}", live.status());
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Waits until the status is `wanted`, and returns it.
fn wait_status(live: &Live, wanted: impl Fn(&Status) -> bool) -> Status {
    let start = Instant::now();
    loop {
        let status = live.status();
        if wanted(&status) {
            return status;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "{status:?}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The picture of a plain render of `n` samples, in the layout of a frame.
fn plain(scene: &Scene, n: u32) -> Vec<f32> {
    let stop = Stop { spp: Some(n), ..Stop::default() };
    let made = render_scene(&loaded(scene.clone()), "cpu", &stop, &Job::new(), &mut |_| ()).unwrap();
    let color = made.picture.color;
    let rows: Vec<&[[f32; 3]]> = color.pixels.chunks(color.width).collect();
    rows.iter().rev().flat_map(|row| row.iter().flat_map(|&[r, g, b]| [r, g, b, 1.0])).collect()
}

/// Mean of (a − b)² / (b² + 0.01) over the colours.
fn rel_mse(a: &[f32], b: &[f32]) -> f64 {
    let off = |(a, b): (&f32, &f32)| f64::from((a - b).powi(2)) / (f64::from(b * b) + 0.01);
    a.iter().zip(b).map(off).sum::<f64>() / a.len() as f64
}

/// Denoised frames are closer to the converged picture, and the last frame is the plain mean of samples.
#[test]
fn young_frames_are_filtered_and_the_last_is_not() {
    let scene = scene([200, 120]);
    let reference = plain(&scene, 256);
    let filtered = LiveOptions { denoise: true, ..spp(64) };
    let live = Live::start(loaded(scene.clone()), filtered).unwrap();
    let mut young = None;
    let last = wait(&live, |f| {
        if !f.coarse && !f.converged && young.is_none() {
            young = Some((f.spp, f.filtered, f.rgba.clone()));
        }
        f.converged
    });
    assert!(!last.filtered && last.rgba == plain(&scene, 64), "bit for bit");
    let (samples, is_filtered, frame) = young.expect("64 samples take more than one slice");
    let (with, without) = (rel_mse(&frame, &reference), rel_mse(&plain(&scene, samples), &reference));
    println!("{samples} samples: {with:.5} filtered, {without:.5} as they are");
    assert!(is_filtered && with < without, "{samples} samples: {with} of {without}");
}

/// Frames that a device denoises are those of the processor: colours of the two renderers differ in their last bits, so that single
/// neighbours may count on one side alone.
#[test]
fn frames_are_filtered_on_a_vulkan_device() {
    let scene = scene([96, 64]);
    let options = LiveOptions { backend: "vulkan-compute".into(), denoise: true, ..spp(4096) };
    let live = Live::start(loaded(scene.clone()), options).unwrap();
    // The processor draws, until the device has compiled and shows what it drew itself.
    wait(&live, |_| true);
    wait_status(&live, |status| status.backend == "vulkan-compute" && status.compiling.is_none());
    let first = live.latest(0).unwrap().serial;
    let frame = wait(&live, |f| f.serial > first && !f.coarse && f.spp >= 4);
    let status = live.status();
    live.stop();
    assert!(frame.filtered && status.backend == "vulkan-compute" && status.notices.is_empty(), "{status:?}");
    let stop = Stop { spp: Some(frame.spp), ..Stop::default() };
    let mut made = render_scene(&loaded(scene.clone()), "cpu", &stop, &Job::new(), &mut |_| ()).unwrap();
    let unfiltered = rel_mse(&frame.rgba, &plain(&scene, frame.spp));
    made.denoise(Filter::Statistical).unwrap();
    let color = made.picture.color;
    let rows: Vec<&[[f32; 3]]> = color.pixels.chunks(color.width).collect();
    let expected: Vec<f32> =
        rows.iter().rev().flat_map(|row| row.iter().flat_map(|&[r, g, b]| [r, g, b, 1.0])).collect();
    let off = rel_mse(&frame.rgba, &expected);
    // Negative control: the frame is far from the mean of its samples.
    assert!(off < 1e-7 && unfiltered > 1e-5, "{off}, from the unfiltered picture {unfiltered}");
}

#[test]
fn it_converges_to_the_picture_of_a_plain_render() {
    let scene = scene([200, 120]);
    let live = Live::start(loaded(scene.clone()), spp(6)).unwrap();
    let frame = wait(&live, |f| f.converged);
    assert_eq!((frame.width, frame.height, frame.spp, frame.coarse), (200, 120, 6, false));
    assert!(frame.rgba == plain(&scene, 6), "bit for bit");
    assert!(frame.error_estimate.is_finite() && frame.cpu_seconds > 0.0);

    // An edit gives the picture of the edited scene, without remains of the previous one.
    let mut camera = scene.camera;
    camera.shift[0] = 0.125;
    assert_eq!(live.edit(vec![SceneEdit::Camera { camera }]).unwrap(), 2);
    let frame = wait(&live, |f| f.converged && f.revision == 2);
    assert!(frame.rgba == plain(&Scene { camera, ..scene }, 6), "bit for bit");
    assert_eq!(live.scene().camera, camera);
    // After convergence the worker sleeps, and no further frame comes.
    wait_status(&live, |s| s.state == LiveState::Converged);
    std::thread::sleep(Duration::from_millis(50));
    assert!(live.latest(frame.serial).is_none());
}

#[test]
fn a_large_film_begins_with_coarse_frames_of_the_whole_view() {
    let live = Live::start(loaded(scene([640, 360])), spp(1)).unwrap();
    let mut seen = Vec::new();
    wait(&live, |f| {
        seen.push((f.width, f.height, f.coarse));
        f.converged
    });
    assert_eq!(seen.last(), Some(&(640, 360, false)));
    // Frames may be replaced by the next before the test sees them, but the order is kept.
    let all = [(160, 90, true), (320, 180, true), (640, 360, false)];
    let mut rest = all.iter();
    assert!(seen.iter().all(|s| rest.any(|a| a == s)), "{seen:?}");
    assert_eq!(live.status().counters["frames"], 3);
}

/// The last coarse frame that is denoised comes again at the film's size, with the edges of the film's own surfaces: it is closer to the converged
/// picture than squares are.
#[test]
fn the_last_denoised_coarse_frame_is_enlarged() {
    let scene = scene([640, 360]);
    let live = Live::start(loaded(scene.clone()), LiveOptions { denoise: true, ..spp(1) }).unwrap();
    let mut seen: Vec<Arc<Frame>> = Vec::new();
    let start = Instant::now();
    while !seen.last().is_some_and(|f| f.converged) {
        seen.extend(live.latest(seen.last().map_or(0, |f| f.serial)));
        assert!(start.elapsed() < Duration::from_secs(60), "{:?}", live.status());
    }
    assert_eq!(live.status().counters["frames"], 4);
    let of = |width| seen.iter().find(|f| f.coarse && f.width == width).expect("it was shown long enough");
    let (half, enlarged) = (of(320), of(640));
    assert!(half.filtered && enlarged.filtered && enlarged.height == 360 && enlarged.spp == 1);
    let squares: Vec<f32> = (0..360 * 640)
        .flat_map(|i| half.rgba[4 * (i / 640 / 2 * 320 + i % 640 / 2)..][..4].to_vec())
        .collect();
    let reference = plain(&scene, 64);
    let [with, without] = [&enlarged.rgba, &squares].map(|rgba| rel_mse(rgba, &reference));
    assert!(with < 0.5 * without, "{with} {without}");
}

/// The processor takes coarse frames from the film, so that none is made for them.
#[test]
fn coarse_frames_of_the_processor_need_no_film() {
    let live = Live::start(loaded(scene([640, 360])), spp(1)).unwrap();
    let idle = |revision| wait_status(&live, |s| s.state == LiveState::Converged && s.revision == revision);
    assert_eq!(idle(1).counters["rebuilt.film"], 1);
    let mut camera = live.scene().camera;
    camera.shift[0] += 0.1;
    live.edit(vec![SceneEdit::Camera { camera }]).unwrap();
    let counters = idle(2).counters;
    assert_eq!((counters["rebuilt.film"], counters["rebuilt.camera"], counters["frames"]), (1, 2, 6));
}

#[test]
fn counters_prove_what_each_edit_costs() {
    let live = Live::start(loaded(scene([64, 48])), spp(1)).unwrap();
    let idle = |revision| wait_status(&live, |s| s.state == LiveState::Converged && s.revision == revision);
    let mut revision = 1;
    let mut costs = |edit: SceneEdit| {
        let before = idle(revision).counters;
        revision += 1;
        assert_eq!(live.edit(vec![edit]).unwrap(), revision);
        let after = idle(revision).counters;
        let differ = after.iter().filter(|(name, _)| *name != "frames");
        let differ = differ.map(|(name, n)| (name.clone(), n - before.get(name).copied().unwrap_or(0)));
        differ.filter(|(_, n)| *n > 0).collect::<Vec<(String, u64)>>()
    };
    let said = |list: &[&str]| list.iter().map(|name| ((*name).to_owned(), 1)).collect::<Vec<_>>();
    let mut camera = live.scene().camera;
    camera.shift[0] += 0.1;
    assert_eq!(costs(SceneEdit::Camera { camera }), said(&["edits.camera", "rebuilt.camera"]));
    let gray = Material { base_color: [0.2; 3], ..Material::default() };
    let colored = SceneEdit::LabelMaterials { id: 1, materials: [(9, Some(gray))].into() };
    assert_eq!(costs(colored), said(&["edits.label_materials", "rebuilt.materials"]));
    let material = SceneEdit::Material { id: 1, material: gray };
    assert_eq!(costs(material), said(&["edits.material", "rebuilt.materials"]));
    let show = SceneEdit::Show { id: 1, show: Show::Only(vec![9]) };
    assert_eq!(costs(show), said(&["edits.show", "rebuilt.materials"]));
    assert_eq!(costs(SceneEdit::Suns { suns: vec![] }), said(&["edits.suns", "rebuilt.lights"]));
}

#[test]
fn what_cannot_be_drawn_is_refused_and_changes_nothing() {
    let live = Live::start(loaded(scene([32, 32])), spp(2)).unwrap();
    let before = live.scene();
    let refused = |edits: Vec<SceneEdit>| live.edit(edits).unwrap_err().to_string();
    let mut camera = before.camera;
    camera.clip = [2.0, 1.0];
    let good = SceneEdit::Suns { suns: vec![] };
    let error = refused(vec![good, SceneEdit::Camera { camera }]);
    assert_eq!(error, "camera.clip: expected 0 ≤ near < far, got 2 and 1");
    let error = refused(vec![SceneEdit::Show { id: 1, show: Show::Only(vec![6]) }]);
    assert!(error.starts_with("instances[0].style.show.only[0]: the volume has no label 6"), "{error}");
    let error = refused(vec![SceneEdit::Remove { id: 4 }]);
    assert_eq!(error, "edits[0].remove.id: the scene has no instance 4; its instances are [1]");
    assert_eq!((live.scene(), live.status().revision), (before.clone(), 1));
    assert_eq!(live.status().counters["edits.suns"], 0);

    let mut bad = before.clone();
    bad.camera.shift[0] = f64::NAN;
    assert!(LoadedScene::new(bad, vec![volume()], vec![]).is_err());
    let options = LiveOptions { backend: "abacus".into(), ..spp(1) };
    assert!(Live::start(loaded(before.clone()), options).is_err());
    assert!(LoadedScene::new(before, vec![], vec![]).is_err());
}

#[test]
fn instances_come_and_go() {
    let live = Live::start(loaded(scene([48, 32])), spp(2)).unwrap();
    let mut second = live.scene().instances[0].clone();
    second.id = 2;
    second.world_from_index.translation.x += 3.0;
    let added = LoadedEdit::Add { instance: Box::new(second), volume: volume() };
    let revision = live.edit(vec![added]).unwrap();
    wait(&live, |f| f.converged && f.revision == revision);
    assert_eq!(live.status().counters["edits.add"], 1);
    let revision = live.edit(vec![SceneEdit::Remove { id: 1 }]).unwrap();
    let frame = wait(&live, |f| f.converged && f.revision == revision);
    let left = live.scene();
    assert_eq!(left.instances.len(), 1);
    assert!(frame.rgba == plain(&left, 2), "bit for bit");
    let revision = live.edit(vec![SceneEdit::Remove { id: 2 }]).unwrap();
    wait(&live, |f| f.converged && f.revision == revision);
}

#[test]
fn picks_name_what_is_seen() {
    let live = Live::start(loaded(scene([64, 64])), spp(4)).unwrap();
    let pick = live.pick(32, 32).unwrap().expect("the figure is in the middle");
    assert!(pick.label < 2 && pick.depth > 0.0);
    assert_eq!(live.pick(0, 0).unwrap(), None);
    assert_eq!(live.pick(64, 0).unwrap(), None, "outside of the film");
    live.stop();
    assert!(live.pick(32, 32).is_err());
}

/// The label film once it is there; fails after a minute.
fn label_film(live: &Live) -> Arc<LabelFilm> {
    let start = Instant::now();
    loop {
        if let Some(film) = live.label_film() {
            return film;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "no label film: {:?}", live.status());
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The pixels of which picks disagree with a label film.
fn unlike_picks(live: &Live, film: &LabelFilm) -> usize {
    let scene = live.scene();
    let pixels = (0..film.height).flat_map(|y| (0..film.width).map(move |x| [x, y]));
    let picked = pixels.map(|[x, y]| {
        let pick = live.pick(x, y).unwrap();
        let of = |p: pumice_transport::Pick| {
            ([scene.instances[p.instance as usize].id, p.label + 1], p.depth as f32)
        };
        pick.map_or(([0, 0], f32::INFINITY), of)
    });
    let seen = film.pixels.iter().copied().zip(film.depth.iter().copied());
    picked.zip(seen).filter(|(picked, seen)| picked != seen).count()
}

#[test]
fn a_label_film_is_what_picks_find_in_every_pixel() {
    let live = Live::start(loaded(scene([48, 40])), spp(2)).unwrap();
    let mut second = live.scene().instances[0].clone();
    second.id = 77;
    second.world_from_index.translation.x += 3.0;
    live.edit(vec![LoadedEdit::Add { instance: Box::new(second), volume: volume() }]).unwrap();
    let film = label_film(&live);
    assert_eq!((film.width, film.height, film.pixels.len(), film.revision), (48, 40, 48 * 40, 2));
    assert_eq!(unlike_picks(&live, &film), 0);
    for seen in [[0, 0], [1, 1], [1, 2], [77, 2]] {
        assert!(film.pixels.contains(&seen), "{seen:?} is in the picture");
    }
    let mut broken = (*film).clone();
    broken.pixels.swap(0, 24 + 20 * 48);
    assert_eq!(unlike_picks(&live, &broken), 2, "the comparison notices");
    broken = (*film).clone();
    broken.depth[24 + 20 * 48] *= 1.0 + 1e-6;
    assert_eq!(unlike_picks(&live, &broken), 1, "it notices a depth");
}

#[test]
fn a_label_film_follows_what_moves_surfaces_and_outlives_the_rest() {
    let live = Live::start(loaded(scene([48, 40])), spp(2)).unwrap();
    let first = label_film(&live);
    // A change of light or colour keeps it.
    live.edit(vec![SceneEdit::Suns { suns: vec![] }]).unwrap();
    live.edit(vec![SceneEdit::Material { id: 1, material: Material::default() }]).unwrap();
    assert!(Arc::ptr_eq(&live.label_film().unwrap(), &first));
    // Visibility, camera and size do not: no older film is given out.
    live.edit(vec![SceneEdit::Show { id: 1, show: Show::Only(vec![9]) }]).unwrap();
    assert!(live.label_film().is_none_or(|film| film.revision == 4));
    let second = label_film(&live);
    assert!(second.pixels.contains(&[1, 2]) && !second.pixels.contains(&[1, 1]));
    let mut camera = live.scene().camera;
    camera.shift[0] += 0.1;
    live.edit(vec![SceneEdit::Camera { camera }]).unwrap();
    let third = label_film(&live);
    assert_ne!(third.pixels, second.pixels);
    assert_eq!(unlike_picks(&live, &third), 0);
    let film = pumice_scene::Film { width: 20, height: 30, ..live.scene().film };
    live.edit(vec![SceneEdit::Film { film }]).unwrap();
    let fourth = label_film(&live);
    assert_eq!((fourth.width, fourth.height, fourth.pixels.len()), (20, 30, 600));
    live.stop();
    let refused = live.edit(vec![SceneEdit::Show { id: 1, show: Show::All }]).unwrap_err();
    assert_eq!(refused.to_string(), "edit: the live picture has stopped");
}

#[test]
fn edits_without_end_do_not_pile_up() {
    let live = Live::start(loaded(scene([320, 240])), LiveOptions::default()).unwrap();
    let mut camera = live.scene().camera;
    for i in 0..200 {
        camera.shift[0] = f64::from(i) * 0.001;
        live.edit(vec![SceneEdit::Camera { camera }]).unwrap();
    }
    let frame = wait(&live, |f| f.revision == 201 && !f.coarse);
    assert!(!frame.converged, "without a limit it goes on");
    live.stop();
    live.stop();
    assert_eq!(live.status().state, LiveState::Stopped);
    assert!(live.latest(0).is_some(), "the newest frame stays");
}

#[test]
fn a_panic_is_told_and_goes_no_further() {
    let live = Live::start(loaded(scene([32, 32])), LiveOptions::default()).unwrap();
    live.panic_on_purpose();
    let status = wait_status(&live, |s| s.state == LiveState::Failed);
    assert_eq!(status.error.as_deref(), Some("internal error: a panic on purpose"));
    assert!(live.pick(1, 1).is_err());
    live.edit(vec![SceneEdit::Suns { suns: vec![] }]).unwrap();
    live.stop();
    assert_eq!(live.status().state, LiveState::Failed);
}

#[test]
fn a_missing_sky_keeps_the_former_picture_and_says_why() {
    let live = Live::start(loaded(scene([32, 32])), spp(2)).unwrap();
    let good = wait(&live, |f| f.converged);
    let sky = |environment| vec![SceneEdit::World { world: World { environment, backdrop: None } }];
    let absent = Environment::Image { path: "absent.exr".into(), rotation_rad: 0.0, strength: 1.0 };
    live.edit(sky(absent)).unwrap();
    let status = wait_status(&live, |s| s.error.is_some());
    assert!(status.error.unwrap().starts_with("absent.exr: "));
    assert!(live.latest(good.serial).is_none());
    let revision = live.edit(sky(Environment::Constant { radiance: [1.0; 3] })).unwrap();
    wait(&live, |f| f.converged && f.revision == revision);
    assert_eq!(live.status().error, None);
}

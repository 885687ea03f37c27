//! A renderer that is kept: its pictures are those of fresh renders, it builds only what differs, and a cancelled picture is worth keeping.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

use pumice_core::{CompressedVolume, Job, LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_picture::Picture;
use pumice_scene::{Cut, CutShape, LabelStyle, Material, Pass, Passes, Scene, Show};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::render_file::render_scene;
use pumice_session::{CurvePoint, Frame, PersistentRenderer, SessionError, Stop, Watching};
use pumice_transport::{LoadedScene, RenderError};

const GROWING: Watching = Watching { growing: true, passes: false, unfinished: false, denoise: None };
const KEPT: Watching = Watching { unfinished: true, ..GROWING };

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

fn figure(volume: &Arc<CompressedVolume>, size: [u32; 2]) -> Scene {
    let options = FigureOptions { size, ..FigureOptions::default() };
    compose(volume, "memory".into(), &options)
}

fn loaded(volume: &Arc<CompressedVolume>, scene: &Scene) -> LoadedScene {
    LoadedScene::new(scene.clone(), vec![Arc::clone(volume)], vec![]).unwrap()
}

fn spp(n: u32) -> Stop {
    Stop { spp: Some(n), ..Stop::default() }
}

fn rendered(renderer: &PersistentRenderer, scene: &LoadedScene, n: u32) -> Picture {
    renderer.render(scene, &spp(n), &Job::new(), GROWING, &mut |_| ()).unwrap().picture
}

fn fresh(scene: &LoadedScene, n: u32) -> Picture {
    render_scene(scene, "cpu", &spp(n), &Job::new(), &mut |_| ()).unwrap().picture
}

/// A figure, and the figure after each change that an animation makes.
fn frames(volume: &Arc<CompressedVolume>) -> Vec<(&'static str, Scene)> {
    let first = figure(volume, [160, 120]);
    let mut moved = first.clone();
    moved.camera.world_from_camera.translation.x += 1.0;
    let style = |change: &dyn Fn(&mut LabelStyle)| {
        let mut scene = moved.clone();
        change(&mut scene.instances[0].style);
        scene
    };
    let ghost = style(&|s| s.material = Material { alpha: 0.3, ..s.material });
    let hidden = style(&|s| s.show = Show::Only(vec![9]));
    let mut cut = moved.clone();
    cut.cuts.push(Cut {
        shape: CutShape::Plane { point: [12.0, 8.0, 4.0], normal: [1.0, 0.0, 0.0] },
        instances: None,
    });
    vec![("first", first), ("moved", moved), ("ghost", ghost), ("hidden", hidden), ("cut", cut)]
}

#[test]
fn each_picture_is_that_of_a_fresh_render_whatever_came_before() {
    let volume = volume();
    let renderer = PersistentRenderer::new("cpu").unwrap();
    let mut former: Option<Picture> = None;
    // There and back, so that each scene comes after another one.
    let frames = frames(&volume);
    for (name, scene) in frames.iter().chain(frames.iter().rev().skip(1)) {
        let scene = loaded(&volume, scene);
        let (kept, fresh) = (rendered(&renderer, &scene, 4), fresh(&scene, 4));
        assert!(kept == fresh, "{name}");
        assert!(former.is_none_or(|f| f.color != kept.color), "{name}: another picture than the one before");
        former = Some(kept);
    }
}

#[test]
fn only_what_differs_is_built() {
    let volume = volume();
    let renderer = PersistentRenderer::new("cpu").unwrap();
    let built = |name| renderer.rebuilt().into_iter().find(|(n, _)| *n == name).unwrap().1;
    let mut counts = Vec::new();
    for (name, scene) in frames(&volume) {
        let scene = loaded(&volume, &scene);
        renderer.render(&scene, &spp(1), &Job::new(), Watching::default(), &mut |_| ()).unwrap();
        counts.push((name, built("acceleration"), built("materials"), built("camera")));
    }
    // A ghost needs another table of materials, and so do hidden labels and those that are shown again; the hierarchy serves them all.
    let expected =
        [("first", 1, 1, 1), ("moved", 1, 1, 2), ("ghost", 1, 2, 2), ("hidden", 1, 3, 2), ("cut", 1, 4, 2)];
    assert_eq!(counts, expected);
}

#[test]
fn a_picture_is_shown_while_it_grows_and_no_longer() {
    let volume = volume();
    let scene = loaded(&volume, &figure(&volume, [320, 240]));
    let renderer = PersistentRenderer::new("cpu").unwrap();
    let (start, job) = (Instant::now(), Job::new());
    let mut seen: Vec<Arc<Frame>> = Vec::new();
    let watch = &mut |_: &CurvePoint| {
        seen.extend(renderer.latest(seen.last().map_or(0, |f| f.serial)));
        if seen.len() == 3 || start.elapsed() > Duration::from_secs(60) {
            job.cancel();
        }
    };
    renderer.render(&scene, &Stop::default(), &job, KEPT, watch).unwrap();
    // The callback comes before the frame of its slice: what it sees first is a coarse frame.
    let of = |f: &Arc<Frame>| (f.coarse, [f.width, f.height]);
    let seen: Vec<_> = seen.iter().map(of).collect();
    assert_eq!(seen, [(true, [160, 120]), (false, [320, 240]), (false, [320, 240])]);
    assert!(renderer.latest(0).is_none(), "the picture has taken their place");

    let nobody = &mut |_: &CurvePoint| assert!(renderer.latest(0).is_none(), "nobody watches");
    let small = loaded(&volume, &figure(&volume, [16, 12]));
    let slices = Stop { seconds: Some(0.9), ..Stop::default() };
    renderer.render(&small, &slices, &Job::new(), Watching::default(), nobody).unwrap();
}

#[test]
fn passes_are_seen_while_a_picture_grows_and_change_nothing() {
    let volume = volume();
    let mut scene = figure(&volume, [160, 120]);
    scene.film.passes = Passes::NONE.with(Pass::Samples).with(Pass::DiffuseDirect);
    let scene = loaded(&volume, &scene);
    let renderer = PersistentRenderer::new("cpu").unwrap();
    let (start, job) = (Instant::now(), Job::new());
    let mut seen = Vec::new();
    let watch = &mut |_: &CurvePoint| {
        seen.extend(renderer.take_so_far());
        assert!(renderer.take_so_far().is_none(), "each is given once");
        if !seen.is_empty() || start.elapsed() > Duration::from_secs(60) {
            job.cancel();
        }
    };
    let watching = Watching { passes: true, ..KEPT };
    let last = renderer.render(&scene, &Stop::default(), &job, watching, watch).unwrap();
    assert_eq!(seen.len(), 1, "the next one would be due seconds later");
    let so_far = seen.remove(0);
    // The oracle: a picture of as many samples. Those of the same scene that differ have other samples.
    let whole = fresh(&scene, so_far.figures.spp);
    let mut named = so_far.picture.clone();
    named.provenance.clone_from(&whole.provenance);
    assert!(named == whole && whole.depth.is_some() && whole.label.is_some());
    assert_eq!(whole.light.len(), 1);
    assert!(so_far.figures.spp >= 1 && last.figures.mean_spp > so_far.figures.mean_spp);
    assert!(
        whole.color != fresh(&scene, so_far.figures.spp + 1).color,
        "control: other samples are another picture"
    );

    // What is watched and what nobody watches end in the same picture, and nothing is left to take.
    let watched = renderer.render(&scene, &spp(4), &Job::new(), watching, &mut |_| ()).unwrap().picture;
    assert!(watched == fresh(&scene, 4) && renderer.take_so_far().is_none());
    let nobody = &mut |_: &CurvePoint| assert!(renderer.take_so_far().is_none(), "nobody asked for passes");
    renderer
        .render(&scene, &Stop { seconds: Some(0.5), ..Stop::default() }, &Job::new(), KEPT, nobody)
        .unwrap();
}

/// Each row of a cancelled picture is that row of a whole picture of as many samples.
#[test]
fn a_cancelled_picture_is_the_mean_of_the_samples_that_it_has() {
    let volume = volume();
    let mut scene = figure(&volume, [64, 48]);
    scene.film.passes = Passes::NONE.with(Pass::Samples);
    let scene = loaded(&volume, &scene);
    let renderer = PersistentRenderer::new("cpu").unwrap();
    for milliseconds in [1, 25, 60] {
        let job = Arc::new(Job::new());
        let cancel = Arc::clone(&job);
        let later = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(milliseconds));
            cancel.cancel();
        });
        let result = renderer.render(&scene, &Stop::default(), &job, KEPT, &mut |_| ());
        later.join().unwrap();
        let cancelled = match result {
            Err(SessionError::Render(RenderError::Cancelled)) => continue,
            result => result.unwrap(),
        };
        let samples = cancelled.picture.samples.as_ref().unwrap();
        let mean = samples.iter().sum::<f32>() / samples.len() as f32;
        assert!((cancelled.figures.mean_spp - f64::from(mean)).abs() < 1e-3 * f64::from(mean));
        for row in (0..48).step_by(15) {
            let of_row = row * 64..(row + 1) * 64;
            let n = samples[of_row.start] as u32;
            let whole = if n > 0 { fresh(&scene, n).color.pixels } else { vec![[0.0; 3]; 64 * 48] };
            assert_eq!(
                cancelled.picture.color.pixels[of_row.clone()],
                whole[of_row],
                "row {row} of {n} samples"
            );
        }
    }
}

#[test]
fn a_cancelled_picture_without_a_sample_is_none() {
    let volume = volume();
    let scene = loaded(&volume, &figure(&volume, [64, 48]));
    let renderer = PersistentRenderer::new("cpu").unwrap();
    let job = Job::new();
    job.cancel();
    for watching in [Watching::default(), KEPT] {
        let error = renderer.render(&scene, &spp(2), &job, watching, &mut |_| ()).unwrap_err();
        assert!(matches!(error, SessionError::Render(RenderError::Cancelled)), "{error}");
    }
    assert!(rendered(&renderer, &scene, 2) == fresh(&scene, 2), "the next picture is whole");
}

#[test]
fn a_renderer_that_panicked_says_so() {
    let volume = volume();
    let scene = loaded(&volume, &figure(&volume, [16, 12]));
    let renderer = PersistentRenderer::new("cpu").unwrap();
    let broken = catch_unwind(AssertUnwindSafe(|| {
        renderer.render(&scene, &spp(1), &Job::new(), KEPT, &mut |_| panic!("on purpose"))
    }));
    assert!(broken.is_err());
    let error = renderer.render(&scene, &spp(1), &Job::new(), KEPT, &mut |_| ()).unwrap_err();
    assert!(error.to_string().contains("make a new one"), "{error}");
}

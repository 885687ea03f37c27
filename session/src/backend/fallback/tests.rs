//! Tests of [`super::FallbackRenderer`] with fake renderers that fail on command at each of their calls.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};

use pumice_core::{LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_scene::Scene;

use super::*;
use crate::figure::{FigureOptions, compose};

/// Where a fake renderer fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum At {
    Open,
    SetScene,
    Prepare,
    PreparePicture,
    Advance,
    Color,
    Picture,
    Denoised,
    Pick,
    Never,
}

/// Makes an error.
pub(crate) type Failure = fn() -> RenderError;
/// The calls to the fakes, in order.
pub(crate) type Log = Arc<Mutex<Vec<String>>>;

struct Fake {
    name: &'static str,
    fails: At,
    error: Failure,
    spp: u32,
    scene: Option<Scene>,
    rebuilt: Rebuilt,
    notices: Vec<String>,
    log: Log,
    /// Whether it is prepared.
    ready: Arc<AtomicBool>,
}

pub(crate) fn full() -> RenderError {
    RenderError::Device("out of GPU memory".into())
}

impl Fake {
    fn call(&self, at: At) -> Result<(), RenderError> {
        self.log.lock().unwrap().push(format!("{} {at:?}", self.name));
        if self.fails == at { Err((self.error)()) } else { Ok(()) }
    }

    fn image(&self) -> Image {
        let film = &self.scene.as_ref().unwrap().film;
        let (width, height) = (film.width as usize, film.height as usize);
        Image { width, height, pixels: vec![[self.spp as f32; 3]; width * height] }
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        self.log.lock().unwrap().push(format!("{} dropped", self.name));
    }
}

impl Renderer for Fake {
    fn name(&self) -> &'static str {
        self.name
    }

    fn set_scene(&mut self, scene: &LoadedScene) -> Result<(), RenderError> {
        self.call(At::SetScene)?;
        (self.scene, self.spp) = (Some(scene.scene().clone()), 0);
        self.rebuilt.camera += 1;
        Ok(())
    }

    fn prepare(&mut self) -> Result<bool, RenderError> {
        if self.fails == At::Prepare && self.ready.load(Relaxed) {
            return Err((self.error)());
        }
        Ok(self.ready.load(Relaxed))
    }

    fn prepare_picture(&mut self) -> Result<(), RenderError> {
        self.call(At::PreparePicture)
    }

    fn advance(&mut self, _: Duration, spp_limit: u32, job: &Job) -> Result<Progress, RenderError> {
        while self.spp < spp_limit && !self.ready.load(Relaxed) {
            if job.is_cancelled() {
                return Err(RenderError::Cancelled);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        // Only the second call fails, so that there are samples to lose.
        if self.spp > 0 {
            self.call(At::Advance)?;
        }
        self.spp = (self.spp + 1).min(spp_limit);
        Ok(Progress { spp: self.spp, mean_spp: f64::from(self.spp), error_estimate: 0.5, all_rest: false })
    }

    fn color(&mut self) -> Result<Image, RenderError> {
        self.call(At::Color)?;
        Ok(self.image())
    }

    fn variance(&mut self) -> Result<Option<Image>, RenderError> {
        Ok(None)
    }

    fn alpha(&mut self) -> Result<Option<Vec<f32>>, RenderError> {
        Ok(None)
    }

    fn denoised(&mut self) -> Result<Option<Image>, RenderError> {
        self.call(At::Denoised)?;
        let smooth = self.image().map(|pixel| pixel.map(|v| v + 0.5));
        Ok(self.name.starts_with("vulkan").then_some(smooth))
    }

    fn picture(&mut self) -> Result<Picture, RenderError> {
        self.call(At::Picture)?;
        Ok(Picture::of(self.image()))
    }

    fn pick(&mut self, x: u32, _: u32) -> Result<Option<Pick>, RenderError> {
        self.call(At::Pick)?;
        Ok(Some(Pick { instance: 0, label: x, voxel: [0; 3], depth: 1.0 }))
    }

    fn seen_surfaces(&mut self, _: &Job) -> Result<Vec<Option<SeenSurface>>, RenderError> {
        self.call(At::Pick)?;
        Ok(vec![Some(SeenSurface { instance: 0, label: Some(7), depth: 1.0 }); self.image().pixels.len()])
    }

    fn rebuilt(&self) -> Rebuilt {
        self.rebuilt
    }

    fn bytes(&self) -> Vec<(&'static str, u64)> {
        vec![("acceleration", 7)]
    }

    fn notices(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notices)
    }
}

/// Ways that fail at the given calls, and the log of all their calls.
pub(crate) fn ways(fails: &[(&'static str, At)], error: Failure) -> (FallbackRenderer, Log) {
    let log = Log::default();
    (made(fails, error, &Arc::new(AtomicBool::new(true)), &log), log)
}

/// Ways that are prepared when `ready` says so, but `cpu` is at once. Another `cpu`, on device Y, stands in; it fails at the given call.
pub(crate) fn preparing(
    fails: &[(&'static str, At)],
    ready: &Arc<AtomicBool>,
    stand_in_fails: At,
) -> (FallbackRenderer, Log) {
    let log = Log::default();
    let renderer = made(fails, full, ready, &log);
    let of_stand_in = Arc::clone(&log);
    let stand_in = move || {
        let too_large = || RenderError::Scene("too large for both".into());
        let mut other =
            made(&[("cpu", stand_in_fails)], too_large, &Arc::new(AtomicBool::new(true)), &of_stand_in);
        other.ways[0].device = "Y".into();
        other
    };
    (renderer.with_stand_in(Box::new(stand_in)), log)
}

fn made(
    fails: &[(&'static str, At)],
    error: Failure,
    ready: &Arc<AtomicBool>,
    log: &Log,
) -> FallbackRenderer {
    let way = |&(name, fails): &(&'static str, At)| {
        let log = Arc::clone(log);
        let ready = if name == "cpu" { Arc::new(AtomicBool::new(true)) } else { Arc::clone(ready) };
        let open: Open = Box::new(move || {
            if fails == At::Open {
                return Err(error());
            }
            let (notices, rebuilt) = (vec!["smaller tiles".to_string()], Rebuilt::default());
            let (log, ready) = (Arc::clone(&log), Arc::clone(&ready));
            Ok(Box::new(Fake { name, fails, error, spp: 0, scene: None, rebuilt, notices, log, ready }))
        });
        Way { backend: name, device: "X".into(), open }
    };
    FallbackRenderer::new(fails.iter().map(way).collect())
}

pub(crate) fn scene(size: [u32; 2]) -> LoadedScene {
    let info = VolumeInfo::new([2, 1, 1], LabelType::U8);
    let volume = compress_labels(info, LabelBuffer::U8(vec![5, 9])).unwrap();
    let options = FigureOptions { size, ..FigureOptions::default() };
    let scene = compose(&volume, "memory".into(), &options);
    LoadedScene::new(scene, vec![Arc::new(volume)], vec![]).unwrap()
}

/// Draws a picture of four samples as sessions do; also returns whether it was restarted on the way.
fn render(renderer: &mut FallbackRenderer) -> Result<(Picture, bool), RenderError> {
    let scene = scene([4, 2]);
    renderer.set_scene(&scene)?;
    let mut restarted = false;
    let mut former = 0;
    loop {
        let spp = renderer.advance(Duration::ZERO, 4, &Job::new())?.spp;
        restarted |= spp <= former;
        former = spp;
        if spp < 4 {
            continue;
        }
        match renderer.picture() {
            Err(RenderError::Restarted) => (restarted, former) = (true, 0),
            other => return other.map(|picture| (picture, restarted)),
        }
    }
}

#[test]
fn a_failure_at_any_call_gives_the_same_picture_from_the_next_way() {
    for at in [At::Open, At::SetScene, At::Advance, At::Picture] {
        let (mut renderer, log) = ways(&[("vulkan-rt", at), ("cpu", At::Never)], full);
        let (picture, restarted) = render(&mut renderer).unwrap();
        assert_eq!((renderer.name(), renderer.device()), ("cpu", "X"), "{at:?}");
        assert_eq!(restarted, matches!(at, At::Advance | At::Picture), "{at:?}");
        // All four samples come from one renderer, none from the failed one.
        assert_eq!((picture.color.width, picture.color.pixels[0]), (4, [4.0; 3]), "{at:?}");
        let notices = renderer.notices();
        let told = "vulkan-rt on X: out of GPU memory; going on with cpu";
        assert_eq!(notices.iter().filter(|n| *n == told).count(), 1, "{notices:?}");
        // The notices of the failed renderer are kept.
        let tiles = notices.contains(&"vulkan-rt on X: smaller tiles".to_string());
        assert_eq!(tiles, at != At::Open, "{notices:?}");
        assert_eq!(renderer.notices(), [""; 0], "a notice is told once");
        // The failed renderer is dropped before the next one allocates memory.
        let log = log.lock().unwrap();
        let place = |what: &str| log.iter().position(|l| l == what);
        if at != At::Open {
            assert!(place("vulkan-rt dropped").unwrap() < place("cpu SetScene").unwrap(), "{log:?}");
        }
    }
}

#[test]
fn without_a_failure_nothing_changes() {
    let (mut renderer, log) = ways(&[("vulkan-rt", At::Never), ("cpu", At::Never)], full);
    assert!(matches!(renderer.color(), Err(RenderError::Scene(_))), "no scene yet");
    assert!(log.lock().unwrap().is_empty(), "nothing is opened before the first scene");
    let (_, restarted) = render(&mut renderer).unwrap();
    assert!(!restarted && renderer.name() == "vulkan-rt");
    assert_eq!(renderer.notices(), ["vulkan-rt on X: smaller tiles"]);
    assert!(!log.lock().unwrap().iter().any(|l| l.starts_with("cpu")));
}

#[test]
fn every_way_is_tried_in_order() {
    let failing = [("vulkan-rt", At::Open), ("vulkan-query", At::SetScene), ("vulkan-compute", At::Advance)];
    let (mut renderer, _) = ways(&[&failing[..], &[("cpu", At::Never)]].concat(), full);
    render(&mut renderer).unwrap();
    assert_eq!(renderer.name(), "cpu");
    let notices = renderer.notices();
    let next = |name: &str| notices.iter().any(|n| n.ends_with(&format!("going on with {name}")));
    assert!(next("vulkan-query") && next("vulkan-compute") && next("cpu"), "{notices:?}");
    assert_eq!(renderer.rebuilt().camera, 2, "of the one that failed after its scene, and of the last");
    assert_eq!(renderer.bytes(), [("acceleration", 7)]);
}

#[test]
fn a_pick_is_answered_by_the_next_way_and_a_color_later() {
    let (mut renderer, _) = ways(&[("vulkan-rt", At::Pick), ("cpu", At::Never)], full);
    let scene = scene([4, 2]);
    renderer.set_scene(&scene).unwrap();
    renderer.advance(Duration::ZERO, 9, &Job::new()).unwrap();
    assert_eq!(renderer.pick(3, 0).unwrap().unwrap().label, 3);
    let (mut other, _) = ways(&[("vulkan-rt", At::Pick), ("cpu", At::Never)], full);
    other.set_scene(&scene).unwrap();
    let seen = other.seen_surfaces(&Job::new()).unwrap();
    assert_eq!((seen.len(), seen[0].unwrap().label, other.name()), (8, Some(7), "cpu"));
    assert_eq!(renderer.name(), "cpu");

    let (mut renderer, _) = ways(&[("vulkan-rt", At::Color), ("cpu", At::Never)], full);
    renderer.set_scene(&scene).unwrap();
    renderer.advance(Duration::ZERO, 9, &Job::new()).unwrap();
    assert!(matches!(renderer.color(), Err(RenderError::Restarted)));
    assert_eq!(renderer.advance(Duration::ZERO, 9, &Job::new()).unwrap().spp, 1);
    assert_eq!(renderer.color().unwrap().pixels[0], [1.0; 3]);
}

#[test]
fn other_errors_are_no_reason_to_fall_back() {
    let errors: [(Failure, &str); 3] = [
        (|| RenderError::Scene("film.width: too large".into()), "film.width: too large"),
        (|| RenderError::Source("sky.exr: gone".into()), "sky.exr: gone"),
        (|| RenderError::Cancelled, "cancelled"),
    ];
    for (error, text) in errors {
        for at in [At::SetScene, At::Advance, At::Picture] {
            let (mut renderer, log) = ways(&[("vulkan-rt", at), ("cpu", At::Never)], error);
            assert_eq!(render(&mut renderer).unwrap_err().to_string(), text);
            assert_eq!(renderer.name(), "vulkan-rt", "{at:?}");
            assert!(!log.lock().unwrap().iter().any(|l| l.starts_with("cpu")), "{at:?}");
        }
    }
}

#[test]
fn a_way_that_stands_alone_does_not_fall_back() {
    for at in [At::Open, At::SetScene, At::Advance, At::Picture] {
        let (mut renderer, _) = ways(&[("vulkan-rt", at)], full);
        let error = render(&mut renderer).unwrap_err();
        assert!(matches!(error, RenderError::Device(_)), "{error:?}");
        assert_eq!(error.to_string(), "vulkan-rt on X: out of GPU memory", "{at:?}");
    }
}

#[test]
fn a_scene_that_the_next_way_refuses_leaves_the_former_one() {
    // The first renderer fails when it gets its second scene; the next refuses that scene only.
    struct Refuses(Fake);
    impl Renderer for Refuses {
        fn name(&self) -> &'static str {
            self.0.name
        }
        fn set_scene(&mut self, scene: &LoadedScene) -> Result<(), RenderError> {
            match (scene.scene().film.width, self.0.name) {
                (8, "vulkan-rt") => Err(full()),
                (8, _) => Err(RenderError::Scene("film.width: not 8".into())),
                _ => self.0.set_scene(scene),
            }
        }
        fn advance(&mut self, slice: Duration, limit: u32, job: &Job) -> Result<Progress, RenderError> {
            self.0.advance(slice, limit, job)
        }
        fn color(&mut self) -> Result<Image, RenderError> {
            self.0.color()
        }
        fn variance(&mut self) -> Result<Option<Image>, RenderError> {
            Ok(None)
        }

        fn alpha(&mut self) -> Result<Option<Vec<f32>>, RenderError> {
            self.0.alpha()
        }
        fn picture(&mut self) -> Result<Picture, RenderError> {
            self.0.picture()
        }
        fn pick(&mut self, x: u32, y: u32) -> Result<Option<Pick>, RenderError> {
            self.0.pick(x, y)
        }
        fn seen_surfaces(&mut self, job: &Job) -> Result<Vec<Option<SeenSurface>>, RenderError> {
            self.0.seen_surfaces(job)
        }
        fn rebuilt(&self) -> Rebuilt {
            self.0.rebuilt()
        }
        fn bytes(&self) -> Vec<(&'static str, u64)> {
            self.0.bytes()
        }
    }
    let way = |name: &'static str| {
        let open: Open = Box::new(move || {
            let (rebuilt, log, error) = (Rebuilt::default(), Log::default(), full);
            let fails = At::Never;
            let fake = Fake {
                name,
                fails,
                error,
                spp: 0,
                scene: None,
                rebuilt,
                notices: vec![],
                log,
                ready: Arc::new(AtomicBool::new(true)),
            };
            Ok(Box::new(Refuses(fake)))
        });
        Way { backend: name, device: "X".into(), open }
    };
    let mut renderer = FallbackRenderer::new(vec![way("vulkan-rt"), way("cpu")]);
    renderer.set_scene(&scene([4, 2])).unwrap();
    let error = renderer.set_scene(&scene([8, 2])).unwrap_err();
    assert_eq!(error.to_string(), "film.width: not 8");
    assert_eq!(renderer.name(), "cpu");
    renderer.advance(Duration::ZERO, 1, &Job::new()).unwrap();
    assert_eq!(renderer.color().unwrap().width, 4);
}

//! What the client of a live picture sees when a device fails.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use super::*;
use crate::backend::fakes::{At, full, preparing, scene, ways};

/// Waits until the status is as wanted; fails after a minute.
fn awaited(live: &Live, what: impl Fn(&Status) -> bool) -> Status {
    let start = Instant::now();
    loop {
        let status = live.status();
        if what(&status) {
            return status;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "{status:?}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The status once the worker has converged or ended.
fn settled(live: &Live) -> Status {
    awaited(live, |status| status.state != LiveState::Rendering)
}

fn started(fails: &[(&'static str, At)]) -> Live {
    let stop = Stop { spp: Some(4), ..Stop::default() };
    Live::draw(scene([4, 2]), ways(fails, full).0, stop, false).unwrap()
}

#[test]
fn a_device_that_fails_is_followed_by_the_next_and_told() {
    for at in [At::Open, At::SetScene, At::Advance, At::Color] {
        let live = started(&[("vulkan-rt", at), ("cpu", At::Never)]);
        let status = settled(&live);
        assert_eq!(
            (status.state, status.backend, status.error),
            (LiveState::Converged, "cpu", None),
            "{at:?}"
        );
        let told = "vulkan-rt on X: out of GPU memory; going on with cpu".to_string();
        assert!(status.notices.contains(&told), "{at:?}: {:?}", status.notices);
        // The frame comes from one renderer: four samples, all after the failure.
        let frame = live.latest(0).unwrap();
        assert_eq!((frame.spp, frame.converged, frame.rgba[0]), (4, true, 4.0), "{at:?}");
    }
    let live = started(&[("vulkan-rt", At::Never), ("cpu", At::Never)]);
    let status = settled(&live);
    assert_eq!((status.backend, status.device.as_str()), ("vulkan-rt", "X"));
    assert_eq!(status.notices, ["vulkan-rt on X: smaller tiles"], "what it overcame by itself is told too");
}

#[test]
fn the_last_devices_failure_ends_the_picture_with_its_error() {
    for at in [At::Open, At::SetScene, At::Advance, At::Color] {
        let live = started(&[("vulkan-rt", at)]);
        let status = settled(&live);
        assert_eq!(status.state, LiveState::Failed, "{at:?}");
        assert_eq!(status.error.as_deref(), Some("vulkan-rt on X: out of GPU memory"), "{at:?}");
        assert!(live.pick(0, 0).is_err());
    }
}

#[test]
fn complaints_do_not_pile_up() {
    let names = ["vulkan-rt"; 3 * MOST_NOTICES].map(|name| (name, At::SetScene));
    let live = started(&[&names[..], &[("cpu", At::Never)]].concat());
    let status = settled(&live);
    assert_eq!((status.backend, status.notices.len()), ("cpu", MOST_NOTICES));
    assert!(status.notices.iter().any(|n| n.ends_with("going on with cpu")), "the latest are kept");
}

/// A live picture whose device is prepared when `ready` says so.
fn compiling(fails: &[(&'static str, At)], stand_in_fails: At, size: [u32; 2]) -> (Live, Arc<AtomicBool>) {
    let ready = Arc::new(AtomicBool::new(false));
    let stop = Stop { spp: Some(4), ..Stop::default() };
    let renderer = preparing(fails, &ready, stand_in_fails).0;
    (Live::draw(scene(size), renderer, stop, false).unwrap(), ready)
}

#[test]
fn the_processor_draws_while_a_device_compiles() {
    let (live, ready) = compiling(&[("vulkan-rt", At::Never)], At::Never, [400, 200]);
    let drawn = |live: &Live, revision| {
        live.latest(0).is_some_and(|f| (f.revision, f.spp, f.coarse) == (revision, 4, false))
    };
    let status = awaited(&live, |_| drawn(&live, 1));
    assert_eq!((status.state, status.revision), (LiveState::Rendering, 1), "the last frame is the device's");
    let status = awaited(&live, |s| s.backend == "cpu");
    assert_eq!((status.device.as_str(), status.compiling), ("Y", Some("vulkan-rt")));
    assert!(!live.latest(0).unwrap().converged);

    // What is asked meanwhile is answered, and edits are followed.
    assert_eq!(live.pick(3, 0).unwrap().unwrap().label, 3);
    assert_eq!(awaited(&live, |_| live.label_film().is_some()).compiling, Some("vulkan-rt"));
    live.edit(vec![SceneEdit::Settings { settings: live.scene().settings }]).unwrap();
    assert_eq!(awaited(&live, |_| drawn(&live, 2)).compiling, Some("vulkan-rt"));

    ready.store(true, Relaxed);
    let status = settled(&live);
    assert_eq!(
        (status.state, status.backend, status.device.as_str()),
        (LiveState::Converged, "vulkan-rt", "X")
    );
    assert_eq!((status.compiling, status.error), (None, None));
    let frame = live.latest(0).unwrap();
    assert_eq!((frame.spp, frame.converged, frame.revision), (4, true, 2));
    // From now on the device draws alone.
    live.edit(vec![SceneEdit::Settings { settings: live.scene().settings }]).unwrap();
    let status = awaited(&live, |s| s.revision == 3 && s.state == LiveState::Converged);
    assert_eq!((status.backend, status.compiling), ("vulkan-rt", None));
}

#[test]
fn what_cannot_be_compiled_is_followed_by_the_next() {
    let (live, ready) = compiling(&[("vulkan-rt", At::Prepare), ("cpu", At::Never)], At::Never, [4, 2]);
    awaited(&live, |s| s.compiling == Some("vulkan-rt"));
    ready.store(true, Relaxed);
    let status = settled(&live);
    assert_eq!((status.backend, status.device.as_str(), status.compiling), ("cpu", "X", None));
    assert!(status.notices.contains(&"vulkan-rt on X: out of GPU memory; going on with cpu".to_string()));

    let (live, ready) = compiling(&[("vulkan-rt", At::Prepare)], At::Never, [4, 2]);
    awaited(&live, |s| s.compiling.is_some());
    ready.store(true, Relaxed);
    let status = settled(&live);
    assert_eq!((status.state, status.compiling), (LiveState::Failed, None));
    assert_eq!(status.error.as_deref(), Some("vulkan-rt on X: out of GPU memory"));
}

/// Where nothing can stand in, the picture comes when the device is ready; until then edits and the end are not held up.
#[test]
fn a_device_that_compiles_is_waited_for_where_nothing_can_stand_in() {
    let (live, ready) = compiling(&[("vulkan-rt", At::Never)], At::SetScene, [4, 2]);
    std::thread::sleep(Duration::from_millis(300));
    assert!(live.latest(0).is_none());
    live.edit(vec![SceneEdit::Settings { settings: live.scene().settings }]).unwrap();
    ready.store(true, Relaxed);
    let status = settled(&live);
    assert_eq!((status.backend, status.revision, status.error), ("vulkan-rt", 2, None));
    let (live, _) = compiling(&[("vulkan-rt", At::Never)], At::SetScene, [4, 2]);
    std::thread::sleep(Duration::from_millis(300));
    live.stop();
    assert_eq!(live.status().state, LiveState::Stopped);
}

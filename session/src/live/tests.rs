//! What the client of a live picture sees when a device fails.

use std::time::{Duration, Instant};

use super::*;
use crate::backend::fakes::{At, full, scene, ways};

/// Waits until the worker has converged or ended, and returns the status; fails after a minute.
fn settled(live: &Live) -> Status {
    let start = Instant::now();
    loop {
        let status = live.status();
        if status.state != LiveState::Rendering {
            return status;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "{status:?}");
        std::thread::sleep(Duration::from_millis(2));
    }
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

//! Tests on a real Vulkan device that runs out of memory for good, at each of its allocations in turn, or that hangs; the CPU continues.

use pumice_cpu::CpuRenderer;
use pumice_vulkan::VulkanRenderer;
use pumice_vulkan::device::{Backend, InjectedFault, Instance, InstanceOptions, survey, unfinished};

use super::tests::scene;
use super::*;
use crate::backend::read_environment;

/// The compute backend with every allocation from the `nth` on failing.
fn full_from(nth: u32) -> Way {
    let open = Box::new(move || -> Result<Box<dyn Renderer>, RenderError> {
        let device = |e: pumice_vulkan::device::DeviceError| RenderError::Device(e.to_string());
        let instance = Instance::new(&InstanceOptions::default()).map_err(device)?;
        let all = survey(&instance).map_err(device)?;
        let candidate = all.iter().find(|c| c.can(Backend::Compute)).expect("a device that computes");
        let renderer = VulkanRenderer::open(&instance, candidate, Backend::Compute, None, read_environment);
        let renderer = renderer.map_err(device)?;
        renderer.gpu().inject(InjectedFault::Allocation, nth, u32::MAX);
        Ok(Box::new(renderer))
    });
    Way { backend: "vulkan-compute", device: "X".into(), open }
}

fn cpu() -> Way {
    let open = Box::new(|| Ok(Box::new(CpuRenderer::new(read_environment)) as Box<dyn Renderer>));
    Way { backend: "cpu", device: "Y".into(), open }
}

fn draw(renderer: &mut FallbackRenderer) -> Picture {
    renderer.set_scene(&scene([8, 6])).unwrap();
    loop {
        while renderer.advance(Duration::ZERO, 4, &Job::new()).unwrap().spp < 4 {}
        match renderer.picture() {
            Err(RenderError::Restarted) => {}
            other => return other.unwrap(),
        }
    }
}

#[test]
fn a_full_device_leaves_the_picture_to_the_cpu() {
    let expected = draw(&mut FallbackRenderer::new(vec![cpu()]));
    // The last allocation is that of the picture's passes.
    let mut fell = 0;
    for nth in [1, 2, 5, 9, 14, 17, 1000] {
        let mut renderer = FallbackRenderer::new(vec![full_from(nth), cpu()]);
        let picture = draw(&mut renderer);
        let notices = renderer.notices();
        if renderer.name() == "vulkan-compute" {
            assert!(notices.is_empty(), "{nth}: {notices:?}");
            continue;
        }
        fell += 1;
        assert_eq!(picture, expected, "{nth}");
        let last = notices.last().unwrap();
        assert!(last.contains("out of GPU memory: ") && last.ends_with("; going on with cpu"), "{notices:?}");
        // The device was tried once more before it was given up.
        assert!(notices.iter().any(|n| n.contains("trying again")), "{notices:?}");
    }
    assert!((3..7).contains(&fell), "{fell}");
}

/// A launch that does not end is not tried again, here and at the next start.
#[test]
fn a_device_that_hangs_leaves_the_picture_to_the_cpu_and_a_mark() {
    let expected = draw(&mut FallbackRenderer::new(vec![cpu()]));
    let folder = tempfile::tempdir().unwrap();
    let instance = Instance::new(&InstanceOptions::default()).unwrap();
    let candidate = survey(&instance).unwrap().into_iter().find(|c| c.can(Backend::Compute)).unwrap();
    let left = || unfinished(&instance, &candidate, Backend::Compute, folder.path());
    assert_eq!(left().why(), None);
    let (of, kept) = ((instance.clone(), candidate.clone()), folder.path().to_owned());
    let open = Box::new(move || -> Result<Box<dyn Renderer>, RenderError> {
        let kept = Some(kept.clone());
        let opened = VulkanRenderer::open(&of.0, &of.1, Backend::Compute, kept, read_environment);
        let renderer = opened.map_err(|e| RenderError::Device(e.to_string()))?;
        renderer.gpu().inject(InjectedFault::Hang, 8, 1);
        Ok(Box::new(renderer))
    });
    let hangs = Way { backend: "vulkan-compute", device: "X".into(), open };
    let mut renderer = FallbackRenderer::new(vec![hangs, cpu()]);
    let picture = draw(&mut renderer);
    let notices = renderer.notices();
    assert_eq!((renderer.name(), notices.len()), ("cpu", 1), "{notices:?}");
    assert!(notices[0].contains("the GPU was lost"), "{notices:?}");
    assert_eq!(picture, expected);
    let why = left().why().unwrap();
    assert!(why.contains("a launch hung at an earlier start") && why.contains(".vulkan-compute."), "{why}");
    // The device's objects may still be in use, so they are never destroyed, and neither may their instance be.
    std::mem::forget(instance.clone());
}

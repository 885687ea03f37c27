//! Tests on a real Vulkan device that runs out of memory for good, at each of its allocations in turn; the CPU continues.

use pumice_cpu::CpuRenderer;
use pumice_vulkan::VulkanRenderer;
use pumice_vulkan::device::{Backend, InjectedFault, Instance, InstanceOptions, survey};

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

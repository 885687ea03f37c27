//! Tests on a real Vulkan device that runs out of memory for good, at each of its allocations in turn, or that hangs; the CPU continues.

use pumice_cpu::CpuRenderer;
use pumice_vulkan::VulkanRenderer;
use pumice_vulkan::device::{Backend, InjectedFault, Instance, InstanceOptions, survey, unfinished};

use super::tests::scene;
use super::*;
use crate::backend::read_environment;
use crate::denoise::Filter;
use crate::progressive::Stop;
use crate::render_file::{render_and_denoise, render_scene};

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

/// The picture, its passes and what they tell of it are those that the processor makes of the same samples: bit for bit on Mesa's software
/// Vulkan, which rounds quotients correctly (`vulkan-renderer/tests/denoise.rs` has the tolerance for others).
#[test]
fn a_picture_denoised_on_the_device_is_the_processors() {
    let (loaded, stop, job) = (scene([64, 48]), Stop { spp: Some(5), ..Stop::default() }, Job::new());
    let mut expected = render_scene(&loaded, "vulkan-compute", &stop, &job, &mut |_| ()).unwrap();
    expected.denoise(Filter::Statistical).unwrap();
    let made =
        render_and_denoise(&loaded, "vulkan-compute", &stop, Some(Filter::Statistical), &job, &mut |_| ())
            .unwrap();
    let far = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-5 * a[c].abs());
    let (a, b) = (&expected.picture.color, &made.picture.color);
    assert!(a.pixels.iter().zip(&b.pixels).filter(|&p| far(p)).count() <= a.pixels.len() / 500);
    assert!(!made.figures.device.contains("llvmpipe") || a == b, "other bits");
    assert!(made.picture.noisy.as_ref().is_some_and(|noisy| noisy != b), "the filter does something");
    assert_eq!(
        (made.picture.noisy, made.picture.variance),
        (expected.picture.noisy, expected.picture.variance)
    );
    assert_eq!((made.figures.denoised, made.figures.notices), (expected.figures.denoised, vec![]));
    assert!(
        made.picture
            .provenance
            .is_some_and(|p| p.denoised.is_some() && p.denoised == expected.figures.denoised)
    );
    assert!(made.figures.denoise_seconds.is_some());
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

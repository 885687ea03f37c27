//! Compares the denoiser's shader with the host's filter, on pictures that are made here: noise, edges of labels, faces and base colours,
//! pixels without a surface, variances of every size, and what is no number.
//!
//! Both compute the same sums and products in the same order, so on Mesa's software Vulkan, which rounds quotients correctly, the bits are
//! equal. On a card a quotient may be off by 2.5 units in the last place: a weight of the window then by 1e-6, and where the difference of
//! two means is that near to what the test accepts, a neighbour counts on one side alone. There are 225 such comparisons a pixel.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod gpu;

#[path = "twins/words.rs"]
#[allow(dead_code, reason = "not every test uses all of it")]
mod words;

use gpu::Gpu;
use pumice_picture::denoise::{WelchTest, denoised};
use pumice_picture::film::{CLASSES, DEGREES_OF_FREEDOM, STRIDE, variance_known};
use pumice_picture::{FilmBuffer, Guides, Image, Picture};
use pumice_vulkan::denoise::{DenoiseProgram, Noisy, PictureDenoiser};
use pumice_vulkan::layout::SurfaceAovsRecord;
use words::Random;

/// One pixel, less than a window, odd sizes, and more than one workgroup and one launch.
const SIZES: [[u32; 2]; 7] = [[1, 1], [3, 5], [1, 9], [8, 8], [65, 33], [17, 200], [130, 7]];

/// So large that there is a third window.
const LARGE: [u32; 2] = [261, 257];

/// First surfaces of blocks of three labels and two instances, whose faces and base colours vary; a tenth of the pixels shows no surface, or
/// one that is no number.
fn surfaces([width, height]: [u32; 2], random: &mut Random) -> Vec<SurfaceAovsRecord> {
    let faces = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [0.0, 0.0, -1.0]];
    let colors = [[0.8, 0.4, 0.1], [0.82, 0.4, 0.1], [0.0; 3], [0.5; 3]];
    let mut surfaces = Vec::new();
    for i in 0..width * height {
        let (x, y) = (i % width, i / width);
        let mut surface = SurfaceAovsRecord {
            depth: 1.0 + random.unit(),
            label: 1 + (x / 11 + y / 7) % 3,
            instance: (x / 20 + y / 13) % 2,
            albedo: colors[((x / 5 + y / 9) % 4) as usize],
            normal: faces[((x / 4 + y / 3) % 4) as usize],
            position: [0.0; 3],
        };
        match random.below(60) {
            0 | 1 => surface.depth = f32::INFINITY,
            2 => surface.normal[1] = f32::NAN,
            3 => surface.albedo[2] = f32::INFINITY,
            4 => surface.albedo[0] = -0.01,
            5 => (surface.label, surface.instance) = (0, 0),
            _ => {}
        }
        surfaces.push(surface);
    }
    surfaces
}

fn picture_of([width, height]: [u32; 2], surfaces: &[SurfaceAovsRecord]) -> Picture {
    let image = |of: fn(&SurfaceAovsRecord) -> [f32; 3]| {
        Image::new(width as usize, height as usize, surfaces.iter().map(of).collect())
    };
    Picture {
        depth: Some(surfaces.iter().map(|s| s.depth).collect()),
        label: Some(surfaces.iter().map(|s| s.label).collect()),
        instance: Some(surfaces.iter().map(|s| s.instance).collect()),
        normal: Some(image(|s| s.normal)),
        albedo: Some(image(|s| s.albedo)),
        ..Picture::of(image(|_| [0.0; 3]))
    }
}

/// The host's result: the oracle.
fn expected(size: [u32; 2], surfaces: &[SurfaceAovsRecord], mean: &Image, variance: Option<&Image>) -> Image {
    let guides = Guides::of(&picture_of(size, surfaces)).unwrap().unwrap();
    denoised(mean, variance.map(variance_known), &guides).unwrap()
}

/// The denoiser on one device.
struct OnDevice {
    gpu: Gpu,
    program: DenoiseProgram,
}

impl OnDevice {
    fn new(gpu: Gpu) -> Self {
        let program = DenoiseProgram::new(gpu.device()).unwrap();
        Self { gpu, program }
    }

    fn run(
        &mut self,
        size: [u32; 2],
        surfaces: &[SurfaceAovsRecord],
        noisy: &Noisy<'_>,
        test: WelchTest,
    ) -> Image {
        let denoiser = PictureDenoiser::new(self.gpu.device(), size).unwrap();
        denoiser.guide_all(&self.program, surfaces).unwrap();
        let mut pixels = vec![[0.0; 3]; surfaces.len()];
        denoiser.denoise(&mut self.program, noisy, test, &mut pixels).unwrap();
        Image::new(size[0] as usize, size[1] as usize, pixels)
    }

    /// From mean and variance of the host.
    fn of_host(
        &mut self,
        size: [u32; 2],
        surfaces: &[SurfaceAovsRecord],
        mean: &Image,
        variance: Option<&Image>,
    ) -> Image {
        let test = WelchTest::of(variance.map(|_| DEGREES_OF_FREEDOM));
        self.run(size, surfaces, &Noisy::Host { mean, variance: variance.map(variance_known) }, test)
    }

    /// Fails if more pixels differ than the device's quotients explain.
    fn compare(&self, expected: &Image, got: &Image, what: &str) {
        if self.gpu.name.contains("llvmpipe") {
            let different = differing(expected, got, 0.0);
            assert!(different.is_empty(), "{what}: {different:?}");
        }
        let different = differing(expected, got, 1e-5);
        assert!(different.len() <= expected.pixels.len() / 500, "{what}: {different:?}");
    }
}

/// Pixels that differ by more than this part of their value, with both values; all that differ in a bit where it is 0. What is no number
/// equals itself alone.
fn differing(a: &Image, b: &Image, part: f32) -> Vec<(usize, [f32; 3], [f32; 3])> {
    let same = |a: f32, b: f32| a.to_bits() == b.to_bits() || (a - b).abs() < part * a.abs();
    let pairs = a.pixels.iter().zip(&b.pixels).enumerate();
    let differ = pairs.filter(|(_, (a, b))| (0..3).any(|c| !same(a[c], b[c])));
    differ.map(|(i, (a, b))| (i, *a, *b)).collect()
}

/// Light with noise of a tenth of it, edges of light within labels, and bright single pixels.
fn noisy_light([width, height]: [u32; 2], random: &mut Random) -> Image {
    let pixel = |i: u32| {
        let light = if ((i % width) / 6).is_multiple_of(2) { 1.0 } else { 1.4 };
        let bright = if random.below(40) == 0 { 30.0 } else { 1.0 };
        [0.9, 1.0, 0.3].map(|c: f32| c * light * bright * (0.9 + 0.2 * random.unit()))
    };
    Image::new(width as usize, height as usize, (0..width * height).map(pixel).collect())
}

/// A variance for a pixel's mean.
type VarianceOf = fn(f32, &mut Random) -> f32;

/// Kinds of variance.
const VARIANCES: [(&str, VarianceOf); 6] = [
    ("of noise", |v, random| v * v * 0.004 * (0.2 + random.unit())),
    ("of every size", |v, random| v * 10f32.powi(random.below(24) as i32 - 12)),
    ("none", |_, _| 0.0),
    ("huge", |_, random| 1e17 * random.unit()),
    ("infinite", |_, _| f32::INFINITY),
    ("odd", |v, random| [f32::NAN, f32::INFINITY, -1.0, f32::MAX, 0.0, v, v, v][random.below(8) as usize]),
];

#[test]
fn the_shader_is_the_hosts_filter() {
    for backend in gpu::backends() {
        let mut device = OnDevice::new(Gpu::of(backend));
        let mut random = Random(31);
        for size in SIZES {
            let surfaces = surfaces(size, &mut random);
            let mut mean = noisy_light(size, &mut random);
            let without = expected(size, &surfaces, &mean, None);
            let got = device.of_host(size, &surfaces, &mean, None);
            device.compare(&without, &got, &format!("{backend}, {size:?}, no variance"));
            for (name, of) in VARIANCES {
                if name == "odd" {
                    // Also means that are no number, or light that is too bright.
                    for pixel in &mut mean.pixels {
                        if random.below(20) == 0 {
                            pixel[1] = [f32::NAN, f32::INFINITY, -1e30, 1e18, -3.0][random.below(5) as usize];
                        }
                    }
                }
                let variance = mean.map(|p| p.map(|v| of(v, &mut random)));
                let smooth = expected(size, &surfaces, &mean, Some(&variance));
                let what = format!("{backend}, {size:?}, variance {name}");
                let got = device.of_host(size, &surfaces, &mean, Some(&variance));
                device.compare(&smooth, &got, &what);
                // Where there are neighbours and noise, the filter does something.
                assert!(name == "none" || size[0] * size[1] < 64 || smooth != mean, "{what}");
            }
        }
    }
}

/// The third window, which alone reaches further than 9 pixels: 18, and what it averages 6 and 2 further.
#[test]
fn the_third_window_is_the_hosts() {
    let mut device = OnDevice::new(Gpu::new());
    let mut random = Random(43);
    let mut surfaces = surfaces(LARGE, &mut random);
    let mut mean = noisy_light(LARGE, &mut random);
    let variance = mean.map(|p| p.map(|v| v * v * 0.004 * (0.2 + random.unit())));
    let got = device.of_host(LARGE, &surfaces, &mean, Some(&variance));
    device.compare(&expected(LARGE, &surfaces, &mean, Some(&variance)), &got, "with variance");
    // All of one label and face, so that windows hold all of their pixels.
    let one = surfaces[0];
    surfaces.fill(one);
    let before = device.of_host(LARGE, &surfaces, &mean, None);
    device.compare(&expected(LARGE, &surfaces, &mean, None), &before, "without");
    let [width, height] = LARGE.map(|n| n as usize);
    let [x, y] = [width / 2, height / 2];
    mean.pixels[y * width + x] = [100.0; 3];
    let after = device.of_host(LARGE, &surfaces, &mean, None);
    let differ = differing(&before, &after, 1e-5);
    let reach = differ.iter().map(|(i, ..)| (i % width).abs_diff(x).max((i / width).abs_diff(y))).max();
    assert!(reach.is_some_and(|reach| (10..=26).contains(&reach)), "{reach:?}");
}

/// From sums on the device: mean and variance of each pixel are found there, in doubles, from its own number of samples.
#[test]
fn sums_on_the_device_are_taken_as_the_host_takes_them() {
    let mut device = OnDevice::new(Gpu::new());
    let mut random = Random(77);
    for size in SIZES {
        let pixels = (size[0] * size[1]) as usize;
        for samples in [1, 3, 4, 5, 64, 1023] {
            let surfaces = surfaces(size, &mut random);
            let mut film = FilmBuffer::new(size[0], size[1]).unwrap();
            let light = noisy_light(size, &mut random);
            for (i, sums) in film.sums_mut(samples).chunks_exact_mut(STRIDE).enumerate() {
                for (class, sums) in sums.chunks_exact_mut(3).enumerate() {
                    let count = (samples + CLASSES - 1 - class as u32) / CLASSES;
                    for (c, sum) in sums.iter_mut().enumerate() {
                        *sum = count as f32 * light.pixels[i][c] * (0.5 + random.unit());
                    }
                }
            }
            let (mean, variance) = (film.mean().unwrap(), film.variance().unwrap());
            let known = (samples >= CLASSES).then_some(&variance);
            let sums = device.gpu.buffer_of(film.sums());
            let noisy = Noisy::Film { sums: &sums.inner, resting: None, samples };
            let test = WelchTest::of(known.map(|_| DEGREES_OF_FREEDOM));
            let got = device.run(size, &surfaces, &noisy, test);
            let what = format!("{size:?}, {samples} samples");
            device.compare(&expected(size, &surfaces, &mean, known), &got, &what);

            // No pixel rests, or all do with the samples of the film: the same picture. Negative control: with fewer, another.
            for (rested, same) in [(0, true), (samples, true), (samples.div_ceil(2), samples == 1)] {
                let resting = device.gpu.buffer_of(&vec![rested; pixels]);
                let noisy = Noisy::Film { sums: &sums.inner, resting: Some(&resting.inner), samples };
                let other = device.run(size, &surfaces, &noisy, test);
                assert_eq!(differing(&got, &other, 0.0).is_empty(), same, "{what}, {rested} at rest");
            }
        }
    }
}

/// Pixels of a picture of which one is changed, across and down, and where that one lies.
const SIDE: usize = 64;
const MIDDLE: usize = SIDE / 2;

/// A change of one pixel's first surface.
type Fault = fn(&mut SurfaceAovsRecord);

/// Negative control: another level of the test, a neighbour of another label, instance, face or base colour, a neighbour's mean or
/// variance, and a test without variance are all noticed.
#[test]
fn what_differs_is_noticed() {
    let mut device = OnDevice::new(Gpu::new());
    let mut random = Random(5);
    let size = [SIDE as u32; 2];
    let one = SurfaceAovsRecord {
        depth: 1.0,
        label: 3,
        instance: 1,
        albedo: [0.5; 3],
        normal: [0.0, 0.0, 1.0],
        position: [0.0; 3],
    };
    let surfaces = vec![one; SIDE * SIDE];
    let mean = noisy_light(size, &mut random);
    let variance = mean.map(|p| p.map(|v| v * v * 0.004 * (0.2 + random.unit())));
    let smooth = expected(size, &surfaces, &mean, Some(&variance));
    let got = device.of_host(size, &surfaces, &mean, Some(&variance));
    device.compare(&smooth, &got, "unchanged");

    let noisy = Noisy::Host { mean: &mean, variance: Some(variance_known(&variance)) };
    let other_level = device.run(size, &surfaces, &noisy, WelchTest::new(0.05, DEGREES_OF_FREEDOM));
    assert!(!differing(&smooth, &other_level, 1e-5).is_empty(), "another level");
    let without = device.of_host(size, &surfaces, &mean, None);
    assert!(!differing(&smooth, &without, 1e-5).is_empty(), "without variance");

    // The pixel in the middle changes; those around it, whose windows it lies in, and no others.
    let middle = SIDE * MIDDLE + MIDDLE;
    let faults: [(&str, Fault); 5] = [
        ("label", |s| s.label = 4),
        ("instance", |s| s.instance = 0),
        ("face", |s| s.normal = [1.0, 0.0, 0.0]),
        ("base colour", |s| s.albedo[1] = 0.56),
        ("no surface", |s| s.depth = f32::INFINITY),
    ];
    for (what, fault) in faults {
        let mut changed = surfaces.clone();
        fault(&mut changed[middle]);
        let got = device.of_host(size, &changed, &mean, Some(&variance));
        device.compare(&expected(size, &changed, &mean, Some(&variance)), &got, what);
        let places: Vec<usize> = differing(&smooth, &got, 1e-5).into_iter().map(|d| d.0).collect();
        // The windows have radii of 6 and 2, with no third one, the pooled variance reaches one pixel further, and the share of the noisy picture is
        // told from pixels up to 4 away.
        let near = |&i: &usize| (i % SIDE).abs_diff(MIDDLE) <= 13 && (i / SIDE).abs_diff(MIDDLE) <= 13;
        assert!(places.len() > 1 && places.iter().all(near), "{what}: {places:?}");
    }
    let mut other = mean.clone();
    other.pixels[middle] = other.pixels[middle].map(|v| v * 1.01);
    let got = device.of_host(size, &surfaces, &other, Some(&variance));
    assert!(differing(&smooth, &got, 1e-6).len() > 1, "a neighbour's mean");
    let mut other = variance.clone();
    other.pixels[middle] = [100.0; 3];
    let got = device.of_host(size, &surfaces, &mean, Some(&other));
    assert!(differing(&smooth, &got, 1e-5).len() > 1, "a neighbour's variance");
}

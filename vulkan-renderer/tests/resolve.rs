//! Compares the shader that resolves films with the host's [`FilmBuffer`], bit for bit on every device: the doubles of both round alike.
//! What is no number equals any other that is none, because processors differ in the bits of such a result.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod gpu;

#[path = "twins/words.rs"]
#[allow(dead_code, reason = "not every test uses all of it")]
mod words;

use gpu::Gpu;
use pumice_picture::film::{CLASSES, STRIDE};
use pumice_picture::resting::AWAKE;
use pumice_picture::{FilmBuffer, Image, PassSums};
use pumice_scene::Adaptive;
use pumice_vulkan::resolve::{FilmSums, ResolveProgram, Resolver};
use words::Random;

/// One pixel, one row, one column, odd sizes, and several strips, workgroups and launches.
const SIZES: [[u32; 2]; 7] = [[1, 1], [9, 1], [1, 70], [8, 8], [65, 33], [17, 200], [130, 32]];

/// Sums of passes of every kind that a film without catchers keeps: alpha is the first of them.
const PASSES: PassSums = PassSums {
    alpha: true,
    features: true,
    light: true,
    mattes: [true, false],
    ranks: 3,
    caught: false,
    shadow_apart: false,
    shadow_fade: 0,
};

/// What sums of light may be.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Light {
    /// Noise and bright single pixels.
    Noisy,
    /// All samples are alike, so that there is no error; a quarter of the pixels is black.
    Even,
    /// Also huge and tiny ones, infinities, and what is no number.
    Odd,
}

fn sum_of(light: Light, count: u32, random: &mut Random) -> f32 {
    let count = count as f32;
    match light {
        Light::Even => count * if random.below(4) == 0 { 0.0 } else { 0.5 },
        Light::Noisy if random.below(30) == 0 => count * 40.0,
        Light::Noisy => count * (0.5 + random.unit()),
        Light::Odd => match random.below(40) {
            0 => f32::NAN,
            1 => f32::INFINITY,
            2 => f32::NEG_INFINITY,
            3 => f32::MAX,
            4 => 1e-40,
            5 => -1.0,
            6 => -0.0,
            _ => count * random.unit(),
        },
    }
}

/// A film of the host with such sums; some of its pixels rest if `rests`.
fn film_of(
    [width, height]: [u32; 2],
    samples: u32,
    light: Light,
    rests: bool,
    random: &mut Random,
) -> FilmBuffer {
    let mut film = FilmBuffer::with_passes(width, height, PASSES).unwrap();
    let fill = |film: &mut FilmBuffer, samples: u32, random: &mut Random| {
        for sums in film.sums_mut(samples).chunks_exact_mut(STRIDE) {
            let even = sum_of(Light::Even, 1, random);
            for (i, sum) in sums.iter_mut().enumerate() {
                let count = (samples + CLASSES - 1 - i as u32 / 3) / CLASSES;
                *sum = if light == Light::Even { even * count as f32 } else { sum_of(light, count, random) };
            }
        }
        for sum in film.pass_sums_mut() {
            *sum = random.below(samples + 1) as f32;
        }
    };
    if rests {
        film.rest_by(Some(Adaptive { threshold: 0.35, min_spp: CLASSES })).unwrap();
        fill(&mut film, CLASSES, random);
        film.look().unwrap();
    }
    fill(&mut film, samples, random);
    film
}

/// What resolves films on one device.
struct OnDevice {
    gpu: Gpu,
    program: ResolveProgram,
}

/// What it finds.
struct Found {
    color: Image,
    alpha: Vec<f32>,
    strips: Vec<f64>,
}

impl OnDevice {
    fn new(gpu: Gpu) -> Self {
        let program = ResolveProgram::new(gpu.device()).unwrap();
        Self { gpu, program }
    }

    fn resolve(&mut self, film: &FilmBuffer) -> Found {
        let (width, height) = film.size();
        let sums = self.gpu.buffer_of(film.sums());
        let pass_sums = self.gpu.buffer_of(film.pass_sums());
        let word = |&rested: &u32| if rested == AWAKE { 0 } else { rested };
        let words = film.resting().map(|resting| resting.rested().iter().map(word).collect::<Vec<u32>>());
        let resting = words.map(|words| self.gpu.buffer_of(&words));
        let on_device = FilmSums {
            sums: &sums.inner,
            pass_sums: Some(&pass_sums.inner),
            resting: resting.as_ref().map(|resting| &resting.inner),
            samples: film.spp(),
            kept: film.kept(),
        };
        let resolver = Resolver::new(self.gpu.device(), [width as u32, height as u32]).unwrap();
        let mut pixels = vec![[7.0; 3]; width * height];
        let mut alpha = vec![7.0; width * height];
        let mut strips = vec![7.0; film.strips()];
        resolver.color(&mut self.program, &on_device, &mut pixels).unwrap();
        resolver.alpha(&mut self.program, &on_device, &mut alpha).unwrap();
        resolver.squared_errors(&mut self.program, &on_device, &mut strips).unwrap();
        Found { color: Image::new(width, height, pixels), alpha, strips }
    }
}

fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
}

/// Pixels whose colour differs in a bit.
fn differing(a: &Image, b: &Image) -> Vec<(usize, [f32; 3], [f32; 3])> {
    let pairs = a.pixels.iter().zip(&b.pixels).enumerate();
    let differ = pairs.filter(|(_, (a, b))| (0..3).any(|c| !same(a[c].into(), b[c].into())));
    differ.map(|(i, (a, b))| (i, *a, *b)).collect()
}

#[test]
fn the_shader_is_the_hosts_film() {
    for backend in gpu::backends() {
        let mut device = OnDevice::new(Gpu::of(backend));
        let mut random = Random(53);
        let mut resting = 0;
        for size in SIZES {
            for samples in [1, 3, 4, 5, 64, 1023] {
                for light in [Light::Noisy, Light::Even, Light::Odd] {
                    let rests = samples > CLASSES && light != Light::Odd;
                    let film = film_of(size, samples, light, rests, &mut random);
                    resting +=
                        film.resting().map_or(0, |r| r.rested().iter().filter(|&&n| n < samples).count());
                    let found = device.resolve(&film);
                    let what = format!("{backend}, {size:?}, {samples} samples, {light:?}");
                    assert_eq!(differing(&film.mean().unwrap(), &found.color), [], "{what}");
                    assert_eq!(film.alpha().unwrap().unwrap(), found.alpha, "{what}");
                    if samples < CLASSES {
                        continue;
                    }
                    let (expected, got) = (film.error_estimate(), film.error_of_strips(&found.strips));
                    assert!(same(expected, got), "{what}: error {expected}, got {got}");
                    assert!(light != Light::Noisy || expected > 0.01, "{what}: {expected}");
                    assert!(
                        light != Light::Even || samples % CLASSES != 0 || rests || expected == 0.0,
                        "{what}"
                    );
                }
            }
        }
        assert!(resting > 100, "{resting} pixels rest");
    }
}

/// The estimate by its formula, pixel by pixel with a new look at every neighbour: the strips leave nothing out. (In another order, so that
/// the last of 16 digits differ.)
#[test]
fn strips_add_up_to_the_formula() {
    let mut random = Random(8);
    for size in SIZES {
        let film = film_of(size, 9, Light::Noisy, false, &mut random);
        let (mean, variance) = (film.mean().unwrap(), film.variance().unwrap());
        let [width, height] = size.map(|n| n as i64);
        let mut sum = 0.0;
        for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
            for c in 0..3 {
                let at = |x: i64, y: i64| f64::from(mean.pixels[(y * width + x) as usize][c]);
                let near = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (x + dx, y + dy)));
                let inside =
                    |&(i, j): &(i64, i64)| i >= 0 && j >= 0 && i < width && j < height && (i, j) != (x, y);
                let around: Vec<f64> = near.filter(inside).map(|(i, j)| at(i, j)).collect();
                let a = around.iter().sum::<f64>() / around.len().max(1) as f64;
                let (m, var) = (at(x, y), f64::from(variance.pixels[(y * width + x) as usize][c]));
                let q = (m * m - var).max(0.0);
                let w = q / (q + 16.0 * var);
                sum += var / (w * q + (1.0 - w) * a * a + 0.01);
            }
        }
        let expected = (sum / (3 * width * height) as f64).sqrt();
        let got = film.error_estimate();
        // Mean and variance were rounded to floats.
        assert!((got / expected - 1.0).abs() < 1e-5, "{size:?}: {got}, expected {expected}");
    }
}

/// Negative control: a sum, a number of samples, a place of alpha that is off by one, and a pixel at the edge of a strip are noticed.
#[test]
fn what_differs_is_noticed() {
    let mut device = OnDevice::new(Gpu::new());
    let mut random = Random(3);
    let film = film_of([20, 70], 8, Light::Noisy, false, &mut random);
    let found = device.resolve(&film);
    for row in [0, 31, 32, 63, 69] {
        let mut other = film.clone();
        other.sums_mut(8)[(row * 20 + 7) * STRIDE + 4] *= 1.5;
        let changed = device.resolve(&other);
        let places: Vec<_> = differing(&found.color, &changed.color).into_iter().map(|d| d.0).collect();
        assert_eq!(places, [row * 20 + 7]);
        let strips = found.strips.iter().zip(&changed.strips).enumerate();
        let strips: Vec<_> = strips.filter(|(_, (a, b))| a != b).map(|(i, _)| i).collect();
        // Its own strip and those beside it; at a strip's edge those above or below too.
        let blocks: std::collections::BTreeSet<_> =
            [row.max(1) - 1, row, (row + 1).min(69)].map(|row| row / 32).into_iter().collect();
        let expected: Vec<_> = blocks.iter().flat_map(|b| (6..9).map(move |x| b * 20 + x)).collect();
        assert_eq!(strips, expected, "row {row}");
        assert!(!same(film.error_estimate(), film.error_of_strips(&changed.strips)));
    }
    let mut fewer = film.clone();
    fewer.sums_mut(7);
    assert_eq!(differing(&found.color, &device.resolve(&fewer).color).len(), 20 * 70);
    let mut other = film.clone();
    let stride = film.kept().stride();
    other.pass_sums_mut()[9 * stride] += 1.0;
    other.pass_sums_mut()[9 * stride + 1] += 1.0;
    let changed = device.resolve(&other).alpha;
    let places: Vec<_> = (0..20 * 70).filter(|&i| changed[i] != found.alpha[i]).collect();
    assert_eq!(places, [9]);
}

//! Compares the error that the film estimates with the true error; and the strategies that find light with one another.

#![allow(clippy::expect_used, reason = "test helpers: a failure is a failed test")]

mod naive;

use std::sync::OnceLock;
use std::time::Duration;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use naive::Dense;
use pumice_core::Job;
use pumice_cpu::{PathTracer, Surroundings};
use pumice_picture::{FilmBuffer, Image};
use pumice_scene::{Adaptive, Camera, Film, Filter, Material, Projection, Settings, Sun};
use pumice_transport::{EnvironmentTable, LightStrategy, Lights, MaterialTable, ReadySun, Sky};

const SIZE: u32 = 28;

fn camera() -> Camera {
    let (from, to) = (DVec3::new(30.0, -22.0, 24.0), DVec3::splat(8.0));
    let z = (from - to).normalize();
    let x = DVec3::Z.cross(z).normalize();
    Camera::new(
        DAffine3::from_mat3_translation(DMat3::from_cols(x, z.cross(x), z), from),
        Projection::Perspective { fov_rad: 0.55 },
    )
}

fn blobs() -> Dense {
    let centres = [(4, 4, 4, 4), (11, 6, 5, 4), (7, 11, 7, 4), (10, 4, 12, 3), (4, 10, 13, 3)];
    Dense::new([16, 16, 16], |[x, y, z]| {
        if z == 0 {
            return 9;
        }
        centres
            .iter()
            .position(|&(a, b, c, r)| (x - a).pow(2) + (y - b).pow(2) + (z - c).pow(2) <= r * r)
            .map_or(0, |i| i as u32 + 1)
    })
}

fn sky_picture() -> Sky {
    let mut image = Image::new(32, 16, vec![[0.2, 0.25, 0.35]; 512]);
    for (x, y) in [(20, 4), (21, 4), (20, 5), (21, 5)] {
        image.pixels[y * 32 + x] = [12.0, 10.0, 8.0];
    }
    Sky::Image(std::sync::Arc::new(EnvironmentTable::new(image, 1.0, 0.3).expect("valid")))
}

fn suns() -> Vec<ReadySun> {
    vec![ReadySun::new(&Sun {
        direction: [-0.6, 0.7, -1.0],
        strength: 2.0,
        color: [1.0, 0.9, 0.8],
        angle_rad: 0.4,
    })]
}

/// Three scenes: Lambert under a uniform sky; suns and an environment picture; rough metal under a picture.
fn scene(which: u32, seed: u64, finding: LightStrategy) -> PathTracer<Dense> {
    let (lights, material) = match which {
        0 => (
            Lights::new(Sky::Constant(Vec3::ONE), Vec::new(), None),
            Material { base_color: [0.8, 0.6, 0.4], specular: 0.0, ..Material::default() },
        ),
        1 => (
            Lights::new(sky_picture(), suns(), Some([[0.1; 3], [0.3; 3]])),
            Material { base_color: [0.7, 0.5, 0.3], roughness: 0.5, ..Material::default() },
        ),
        _ => (
            Lights::new(sky_picture(), Vec::new(), None),
            Material { base_color: [0.9, 0.7, 0.4], metallic: 1.0, roughness: 0.4, ..Material::default() },
        ),
    };
    let around = Surroundings {
        lights: lights.with_strategy(finding).into(),
        materials: vec![MaterialTable::same(material).into()].into(),
        settings: Settings { bounces: 4, seed, ..Settings::default() },
    };
    let film = Film::new(SIZE, SIZE, Filter::BlackmanHarris { width: 3.0 });
    PathTracer::new(blobs(), around, &camera(), &film).expect("memory for the film")
}

fn drawn(which: u32, seed: u64, spp: u32, finding: LightStrategy) -> PathTracer<Dense> {
    let mut tracer = scene(which, seed, finding);
    tracer.add_samples(spp, &Job::new()).expect("nobody cancels");
    tracer
}

/// The picture of a scene with 2,048 samples a pixel, made once.
fn reference(which: u32) -> &'static Image {
    static OF_SCENES: [OnceLock<Image>; 3] = [const { OnceLock::new() }; 3];
    OF_SCENES[which as usize]
        .get_or_init(|| drawn(which, 1_000, 2048, LightStrategy::Mis).film().mean().expect("memory"))
}

/// Mean of (a − b)² / (b² + 0.01).
fn rel_mse(a: &Image, b: &Image) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (p, q) in a.pixels.iter().zip(&b.pixels) {
        for c in 0..3 {
            let (a, b) = (f64::from(p[c]), f64::from(q[c]));
            sum += (a - b).powi(2) / (b * b + 0.01);
            n += 1.0;
        }
    }
    sum / n
}

/// Samples for each pixel, and the number of seeds for each count.
const CASES: [(u32, u64); 4] = [(4, 24), (8, 12), (16, 8), (64, 4)];

/// Least mean of estimate / truth over a case's seeds; well within the required 0.8.
///
/// Single seeds of such a small picture scatter, in the third scene, where a few pixels of metal hold most of the error, by 0.18 at four
/// samples and 0.07 at 64 (standard deviation). Divided by the root of the number of seeds that is 0.037 at most, of which three are
/// allowed: 0.11. Up to 0.06 more is the bias of the estimate, whose μ² is an estimate too. (The reference has 2,048 samples against at most
/// 64, stratified: it adds less than 1/32 to the square, 0.016 to the ratio, at 64 samples, where the seeds' share is 0.035 instead.)
const LEAST: f64 = 0.83;

/// Greatest mean of the same. From 16 samples on the required 1.25 less what seeds scatter; before, classes of one or two samples cannot
/// know how well all samples together are stratified: 1.02 to 1.33 occur at four, 0.93 to 1.24 at eight samples.
fn greatest(spp: u32) -> f64 {
    if spp < 16 { 1.45 } else { 1.14 }
}

#[test]
fn estimate_is_honest() {
    for which in 0..3 {
        let reference = reference(which);
        for (spp, seeds) in CASES {
            let ratio = |seed: u64| {
                let tracer = drawn(which, 100 * seed + u64::from(spp), spp, LightStrategy::Mis);
                tracer.error_estimate() / rel_mse(&tracer.film().mean().unwrap(), reference).sqrt()
            };
            let ratios: Vec<f64> = (0..seeds).map(ratio).collect();
            let mean = ratios.iter().sum::<f64>() / seeds as f64;
            println!("scene {which}, {spp} spp: estimate / truth = {mean:.3}, of {ratios:.2?}");
            assert!(mean > LEAST && mean < greatest(spp), "scene {which}, {spp} spp: {mean} of {ratios:?}");
        }
    }
}

/// A picture whose pixels all rest.
fn rested(which: u32, seed: u64, rule: Adaptive) -> PathTracer<Dense> {
    let uniform = scene(which, seed, LightStrategy::Mis);
    let mut around = uniform.around().clone();
    around.settings.adaptive = Some(rule);
    let film = Film::new(SIZE, SIZE, Filter::BlackmanHarris { width: 3.0 });
    let mut tracer = PathTracer::new(blobs(), around, &camera(), &film).expect("memory for the film");
    let progress = tracer.advance(Duration::from_secs(3600), u32::MAX, &Job::new()).expect("nobody cancels");
    assert!(progress.all_rest && tracer.film().all_rest());
    tracer
}

/// Observed over twelve seeds: errors of 0.51 to 0.66 of the threshold, and 0.67 to 0.85 of the errors of as many samples distributed
/// evenly; means of the picture off by at most 0.0016 of it, where even samples are off by 0.0006. So the bias is far below the threshold,
/// and its limit here is a tenth of the threshold.
#[test]
fn where_all_pixels_rest_the_error_is_below_the_threshold() {
    let seeds = 6u32;
    for (which, threshold) in [(0, 0.05), (1, 0.04), (2, 0.08)] {
        let reference = reference(which);
        let error = |film: &FilmBuffer| rel_mse(&film.mean().unwrap(), reference).sqrt() / f64::from(seeds);
        let sum = |i: &Image| i.pixels.iter().flatten().map(|&v| f64::from(v)).sum::<f64>();
        let mut mean_spp = 0.0;
        let (mut of_rested, mut of_even, mut of_first, mut bias) = (0.0, 0.0, 0.0, 0.0);
        for seed in 0..seeds {
            let tracer = rested(which, seed.into(), Adaptive { threshold, min_spp: 16 });
            let film = tracer.film();
            of_rested += error(film);
            mean_spp += film.mean_spp() / f64::from(seeds);
            bias += (sum(&film.mean().unwrap()) / sum(reference) - 1.0) / f64::from(seeds);
            let even = |spp| drawn(which, u64::from(seed) + 50, spp, LightStrategy::Mis);
            of_even += error(even(film.mean_spp().round() as u32).film());
            of_first += error(even(16).film());
        }
        println!(
            "scene {which}, {mean_spp:.1} samples: {of_rested:.4}, even {of_even:.4}, first {of_first:.4}, bias {bias:.5}"
        );
        let threshold = f64::from(threshold);
        assert!(of_rested < threshold && of_rested > 0.3 * threshold, "scene {which}: {of_rested}");
        assert!(of_rested < of_even, "scene {which}: {of_rested}, dealt evenly {of_even}");
        assert!(bias.abs() < 0.1 * threshold, "scene {which}: {bias}");
        // Negative control: the first samples alone would exceed the threshold.
        assert!(of_first > threshold, "scene {which}: {of_first}");
    }
}

/// Negative control: the variance of the samples within one scramble, treated as independent, overestimates the error of stratified points.
#[test]
fn taking_stratified_samples_for_independent_is_convicted() {
    use pumice_cpu::path::radiance;
    use pumice_transport::sampler::PixelSampler;
    let tracer = drawn(0, 3, 1, LightStrategy::Mis);
    let (n, mut naive, mut image) =
        (128u32, 0.0, Image::new(SIZE as usize, SIZE as usize, vec![[0.0; 3]; (SIZE * SIZE) as usize]));
    for y in 0..SIZE {
        for x in 0..SIZE {
            let (mut sum, mut squares) = (glam::DVec3::ZERO, glam::DVec3::ZERO);
            for i in 0..n {
                let s = PixelSampler::new(9, [x, y], i);
                let [u, v] = s.film();
                let table = pumice_transport::FilterTable::new(&Filter::Box { width: 1.0 });
                let (px, py) = (
                    f64::from(x) + 0.5 + f64::from(table.sample(u)),
                    f64::from(y) + 0.5 + f64::from(table.sample(v)),
                );
                let (ray, t_max) = tracer.rays().ray(px, py);
                let c = radiance(tracer.tracer(), tracer.around(), &s, ray, t_max, 0.5).as_dvec3();
                sum += c;
                squares += c * c;
            }
            let mean = sum / f64::from(n);
            let var = (squares / f64::from(n) - mean * mean) / f64::from(n - 1);
            naive += (var / (mean * mean + 0.01)).element_sum();
            image.pixels[(y * SIZE + x) as usize] = mean.as_vec3().to_array();
        }
    }
    let naive = (naive / f64::from(3 * SIZE * SIZE)).sqrt();
    // A box filter differs at edges from a reference with another filter: the same scene with more samples is the truth.
    let mut boxed = scene(0, 77, LightStrategy::Mis);
    boxed = {
        let film = Film::new(SIZE, SIZE, Filter::Box { width: 1.0 });
        PathTracer::new(blobs(), boxed.around().clone(), &camera(), &film).expect("memory for the film")
    };
    boxed.add_samples(1024, &Job::new()).expect("nobody cancels");
    let truth = rel_mse(&image, &boxed.film().mean().unwrap()).sqrt();
    println!("naive / truth = {:.3}", naive / truth);
    assert!(naive / truth > greatest(n), "naive {naive}, truth {truth}");
}

/// Light sampling, BSDF sampling and both agree: two-sided z of the picture's mean, each pair within 4.
#[test]
fn ways_to_find_light_agree() {
    let total = |which: u32, finding: LightStrategy, seed: u64| {
        let tracer = drawn(which, seed, 256, finding);
        let (mean, var) = (tracer.film().mean().unwrap(), tracer.film().variance().unwrap());
        let sum = |i: &Image| i.pixels.iter().map(|p| f64::from(p[0])).sum::<f64>();
        (sum(&mean), sum(&var))
    };
    for which in [1, 2] {
        let all = [LightStrategy::Mis, LightStrategy::LightsOnly, LightStrategy::BsdfOnly]
            .map(|f| total(which, f, 40 + f as u64));
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            let z = (all[a].0 - all[b].0) / (all[a].1 + all[b].1).sqrt();
            println!("scene {which}: {a} against {b}: z = {z:.2}");
            assert!(z.abs() < 4.0, "scene {which}: {all:?}");
        }
        // Negative control: four per cent more light in one of them would be noticed.
        let z = 0.04 * all[0].0 / (all[0].1 + all[2].1).sqrt();
        assert!(z > 4.0, "the test is blind: {z}");
    }
}

//! White furnaces: the renderer's mean is within 0.1 % of the exact value; and the same judgement rejects renderers with one fault each,
//! which shows that it is sharp enough.
//!
//! Pictures hide such faults. A roulette that divides by an unclamped probability from the first bounce keeps 71 to 85 % of the energy of a
//! furnace of albedo 0.95, which is invisible to the eye.

#![allow(clippy::expect_used, reason = "test helpers: a failure is a failed test")]

mod furnace;
mod naive;

use std::time::Duration;

use furnace::faulty::{self, Fault};
use furnace::{
    FILM, Furnace, convex_body, even_sky, glowing_cavity, outside, painted_sky, rendered, sponge, white_world,
};
use pumice_core::Job;
use pumice_cpu::{PathTracer, Surroundings};
use pumice_scene::{Material, Settings};
use pumice_transport::{Lights, MaterialTable};

fn furnaces() -> Vec<Furnace> {
    let mut all = Vec::new();
    // Roulette never ends a path of throughput 1, so switching it on changes nothing here.
    all.extend([false, true].map(|roulette| white_world(even_sky(1.0), roulette)));
    all.push(white_world(painted_sky(1.0), true));
    for albedo in [0.2, 0.7] {
        all.push(convex_body(even_sky(1.0), albedo));
        all.push(convex_body(painted_sky(1.0), albedo));
    }
    for (bounces, albedo) in [(0, 0.5), (1, 0.9), (3, 0.8), (3, 0.5), (5, 0.95), (31, 0.5)] {
        all.extend([false, true].map(|roulette| glowing_cavity(bounces, albedo, roulette)));
    }
    all
}

#[test]
fn every_furnace_has_its_exact_mean() {
    for furnace in furnaces() {
        assert!(furnace.accepts(&rendered), "{}", furnace.name);
    }
}

/// The film neither adds nor loses light: its mean is the mean of the samples.
#[test]
fn the_film_shows_the_mean_of_its_samples() {
    let furnace = glowing_cavity(3, 0.8, true).exactly(1.0, 16);
    let mut tracer = PathTracer::new(furnace.dense.clone(), furnace.around.clone(), &furnace.camera, &FILM)
        .expect("memory for the film");
    tracer.add_samples(furnace.spp, &Job::new()).expect("nobody cancels");
    let image = tracer.film().mean().unwrap();
    let pixels = furnace.pixels();
    let of_film =
        pixels.iter().map(|&[x, y]| f64::from(image.pixels[(y * FILM.width + x) as usize][0])).sum::<f64>()
            / pixels.len() as f64;
    let of_samples = furnace.mean(&rendered).value;
    // Sixteen sums in f32.
    assert!((of_film / of_samples - 1.0).abs() < 16.0 * f64::from(f32::EPSILON), "{of_film} {of_samples}");
}

/// Passes add single samples up to 16, then complete blocks of four, but for a limit in between.
#[test]
fn from_sixteen_samples_on_a_pass_completes_a_block() {
    let furnace = convex_body(even_sky(1.0), 0.7);
    let mut tracer = PathTracer::new(furnace.dense.clone(), furnace.around.clone(), &furnace.camera, &FILM)
        .expect("memory for the film");
    let mut pass = |limit| tracer.advance(Duration::ZERO, limit, &Job::new()).expect("nobody cancels").spp;
    let spp: Vec<u32> = (0..18).map(|_| pass(100)).collect();
    assert_eq!(spp, (1..=16).chain([20, 24]).collect::<Vec<_>>());
    assert_eq!([pass(26), pass(100), pass(100)], [26, 28, 32]);
}

/// The copy of the loop that carries the faults equals the renderer without them, sample by sample.
#[test]
fn the_loop_without_a_fault_is_the_renderer() {
    for furnace in furnaces() {
        for pixel in furnace.pixels().into_iter().step_by(7) {
            for sample in 0..4 {
                let got = furnace.sample(
                    &|d, a, s, r, t| faulty::radiance(Fault::None, d, a, s, r, t),
                    pixel,
                    sample,
                );
                assert_eq!(got, furnace.sample(&rendered, pixel, sample), "{}", furnace.name);
            }
        }
    }
}

fn assert_convicted(fault: Fault, furnaces: &[Furnace]) {
    for furnace in furnaces {
        println!("{fault:?}:");
        let convicted = furnace.convicts(&|d, a, s, r, t| faulty::radiance(fault, d, a, s, r, t));
        assert!(convicted, "{fault:?} goes unseen in {}", furnace.name);
    }
}

#[test]
fn a_roulette_without_compensation_is_convicted() {
    // Of walls of albedo 0.5, roulette may affect everything but 1 + ½ + ¼.
    let cases = [glowing_cavity(3, 0.5, true), glowing_cavity(31, 0.5, true)];
    assert_convicted(Fault::RouletteUncompensated, &cases);
}

/// Uniform directions are correct. With paths ended by their throughput where it is above 1, a convex body of albedo a keeps the share ∫₀¹
/// min(2au, 1) du / a = (1 − 1/(4a)) / a: 77.6 % for 0.95.
#[test]
fn a_roulette_by_an_unclamped_chance_is_convicted() {
    let body = convex_body(even_sky(1.0), 0.95).exactly(0.95, 64);
    assert!(body.accepts(&|d, a, s, r, t| faulty::radiance(Fault::EvenDirections, d, a, s, r, t)));
    assert_convicted(Fault::RouletteUnclamped, std::slice::from_ref(&body));
    let kept = body.mean(&|d, a, s, r, t| faulty::radiance(Fault::RouletteUnclamped, d, a, s, r, t));
    let expected = (1.0 - 1.0 / (4.0 * 0.95)) / 0.95;
    let off = kept.value / 0.95 - expected;
    assert!(off.abs() < 3.0 * kept.standard_error, "{kept:?}, expected {expected} of 0.95");
}

#[test]
fn a_density_two_per_cent_off_is_convicted() {
    let body = convex_body(painted_sky(1.0), 0.7);
    let furnaces =
        [white_world(even_sky(1.0), true), convex_body(even_sky(1.0), 0.7), glowing_cavity(3, 0.8, true)];
    for factor in [1.02, 1.0 / 1.02] {
        assert_convicted(Fault::Density(factor), &furnaces);
        assert_convicted(Fault::Density(factor), std::slice::from_ref(&body));
        assert_convicted(Fault::DensityInWeights(factor), std::slice::from_ref(&body));
    }
}

#[test]
fn weights_that_make_one_per_cent_more_or_less_than_one_are_convicted() {
    let body = [convex_body(painted_sky(1.0), 0.7)];
    for factor in [1.01, 0.99] {
        assert_convicted(Fault::SumOfWeights(factor), &body);
        assert_convicted(Fault::AimedWeight(factor), &body);
    }
}

#[test]
fn a_bound_on_bounces_is_convicted() {
    let mut furnace = white_world(even_sky(1.0), false);
    furnace.around.settings.bounces = 40;
    assert!(furnace.convicts(&rendered));
}

/// Under a uniform sky of 1 nothing is brighter than 1, to 4 standard errors: 0.8 % for the roughest metal, which keeps all light.
/// Single-scatter GGX of roughness 1 keeps about 45 %: more than 40 % is required.
#[test]
fn glossy_bodies_never_give_more_than_they_get() {
    for roughness in [0.0f32, 0.3, 1.0] {
        for metallic in [0.0f32, 1.0] {
            let mut furnace = convex_body(even_sky(1.0), 1.0);
            let material = Material { base_color: [1.0; 3], roughness, metallic, ..Material::default() };
            furnace.around.materials = vec![MaterialTable::same(material).into()].into();
            furnace.spp = 64;
            let kept = furnace.mean(&rendered);
            // (Rounding, where there is no noise.)
            let most = 1.0 + 4.0 * kept.standard_error + 1e-5;
            assert!(kept.value < most && kept.value > 0.4, "{roughness}, {metallic}: {kept:?}");
        }
    }
}

#[test]
fn threads_and_slices_do_not_change_the_picture() {
    let picture = |threads: usize, steps: &[u32]| {
        let around = Surroundings {
            lights: Lights::new(even_sky(1.0), Vec::new(), None).into(),
            materials: vec![MaterialTable::same(Material::default()).into()].into(),
            settings: Settings::default(),
        };
        let mut tracer = PathTracer::new(sponge(), around, &outside(), &FILM).expect("memory for the film");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            steps.iter().for_each(|&s| tracer.add_samples(s, &Job::new()).expect("nobody cancels"))
        });
        tracer.film().mean().unwrap()
    };
    let one = picture(1, &[7]);
    assert_eq!(one, picture(3, &[1, 2, 7]));
    assert_ne!(one, picture(1, &[8]));
}

//! Tests the entry points that a renderer launches, on each backend: films and first surfaces.

use pumice_core::Job;
use pumice_picture::film::CLASSES;
use pumice_picture::metrics::Variance;
use pumice_picture::metrics::significance::significance;
use pumice_picture::{FilmBuffer, Pass};
use pumice_scene::{Part, PartSet};
use pumice_transport::{MaterialTable, Sky};
use pumice_vulkan::device::Backend;
use pumice_vulkan::pack::ShaderNeeds;

use crate::device::Front;
use crate::gpu::hardware_backends;
use crate::gpu::turns::some_of_today;
use crate::paths;
use crate::samples::{asked, found, tolerance};
use crate::scenes::{Case, cases};

/// Samples a pixel: each class gets two of them.
const SPP: u32 = 2 * CLASSES;

/// One scene for each thing that the backends do differently: many boxes, several instances, levels of detail; and one scene that has all
/// lights and surfaces.
fn chosen() -> Vec<Case> {
    let names = [
        "all surfaces under",
        "32 bounces",
        "by distance",
        "several instances",
        "meshes beside",
        "smooth meshes",
        "smooth voxels",
        "begin within",
        "shine, in the dark",
    ];
    let is_chosen = |c: &Case| {
        let another = c.name.contains("even") || c.name.contains("shine") && !c.name.contains("in the dark");
        names.iter().any(|n| c.name.contains(n)) && !another
    };
    let chosen: Vec<Case> = cases().into_iter().filter(is_chosen).collect();
    assert_eq!(chosen.len(), names.len());
    chosen
}

fn film_of(case: &Case, sums: &[f32]) -> FilmBuffer {
    let mut film = FilmBuffer::new(case.film.width, case.film.height).expect("memory for the film");
    film.sums_mut(SPP).copy_from_slice(sums);
    film
}

/// The CPU's film of a case.
fn cpu_film(case: &Case) -> FilmBuffer {
    let mut tracer = case.path_tracer();
    tracer.add_samples(SPP, &Job::new()).expect("nobody cancels");
    tracer.film().clone()
}

/// How many sums differ by more than rounding explains, and how many may.
fn parted(case: &Case, sums: &[f32], expected: &[f32]) -> (usize, f64) {
    let found = found(case, &asked(case, SPP));
    let rays = found.iter().map(|f| f.rays).max().unwrap_or(0);
    let tolerance = tolerance(case, rays);
    let differ = |(a, b): (&[f32], &[f32])| {
        let scale = a.iter().chain(b).copied().fold(1e-6, f32::max);
        a.iter().zip(b).any(|(a, b)| (a - b).abs() > tolerance * scale)
    };
    // Three colours of a class: a path that parts shows in at least one of them.
    let parted = sums.chunks(3).zip(expected.chunks(3)).filter(|&pair| differ(pair)).count();
    let mean: f64 = found.iter().map(|f| f.parting.min(1.0)).sum();
    (parted, mean + 5.0 * mean.sqrt() + 3.0)
}

/// A third of the scenes a day.
#[test]
fn films_are_the_cpus_and_alike_on_the_days_backends() {
    let fronts = paths();
    for case in some_of_today(&chosen(), 3) {
        let expected = cpu_film(&case);
        let first = fronts[0].film(&case, SPP);
        let (parted, most) = parted(&case, &first, expected.sums());
        println!("{}: {parted} of {} sums parted (at most {most:.1})", case.name, first.len() / 3);
        assert!(parted as f64 <= most, "{}: {parted} sums differ, at most {most:.1} may", case.name);
        for front in &fronts[1..] {
            let sums = front.film(&case, SPP);
            let differ = first.iter().zip(&sums).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
            assert_eq!(differ, 0, "{}: {} against {}", case.name, front.name, fronts[0].name);
        }
        // With other random numbers the films must agree statistically: Welch's t of every tile, and of the picture's mean.
        let mut other = case.clone();
        other.around.settings.seed += 1;
        let (a, b) = (film_of(&case, &first), cpu_film(&other));
        let [variance_a, variance_b] = [a.variance().unwrap(), b.variance().unwrap()];
        let of = |of_mean| Variance { of_mean, degrees_of_freedom: f64::from(CLASSES - 1) };
        let welch = significance(&a.mean().unwrap(), &b.mean().unwrap(), of(&variance_a), of(&variance_b));
        assert_eq!(welch.rejected, 0, "{}: {welch:?}", case.name);
        let errors = welch.mean_difference_in_standard_errors;
        assert!(errors.iter().all(|e| e.abs() < 4.0), "{}: {welch:?}", case.name);
    }
}

/// Whole paths with emulated doubles, as devices without doubles compute them. The scenes are those with the fewest needs, so that as
/// little as possible is compiled. Levels of detail by distance are among them; they use doubles the most.
#[test]
#[ignore = "full: a path with doubles in integers takes a minute to compile for a CPU"]
fn films_with_doubles_in_integers_are_the_cpus() {
    let cases: Vec<Case> = cases()
        .into_iter()
        .filter(|c| ["an even sky", "cells and voxels by distance"].contains(&c.name))
        .collect();
    assert_eq!(cases.len(), 2);
    let needs = |case: &Case| {
        let materials = || case.around.materials.iter().flat_map(|l| l.materials());
        assert!(materials().all(|m| m.specular == 0.0 && m.emission == [0.0; 3] && m.alpha == 1.0));
        assert!(matches!(case.around.lights.sky(), Sky::Constant(_)) && case.camera.aperture.is_none());
        let parts = PartSet::NONE
            .with_if(Part::LightSampling, case.around.lights.samples_lights())
            .with_if(Part::Lamps, !case.around.lights.lamps().is_empty())
            .with_if(Part::Meshes, !case.meshes.is_empty());
        ShaderNeeds { parts, instance_tree: false, bricks: false, boxes: true, pages: false }
    };
    let [even, distance] = [needs(&cases[0]), needs(&cases[1])];
    assert!(even.constants().iter().zip(distance.constants()).all(|(&e, d)| e <= d), "one program will do");
    let front = Front::in_integers_for("path", &distance.constants());
    for case in cases {
        let expected = cpu_film(&case);
        let film = front.film(&case, SPP);
        let (parted, most) = parted(&case, &film, expected.sums());
        println!("{}: {parted} of {} sums parted (at most {most:.1})", case.name, film.len() / 3);
        assert!(parted as f64 <= most, "{}: {parted} sums differ, at most {most:.1} may", case.name);
        assert!(film.iter().any(|&s| s > 0.0), "{}: a black film", case.name);
    }
}

/// Gives labels Cryptomatte ids: few by type and many by label, so that slots overflow.
fn name_all(case: &mut Case) {
    for (materials, instance) in case.around.materials.iter_mut().zip(0u32..) {
        let count = case.traced.get(instance as usize).map_or(1, |t| t.volume.labels().len() as u32);
        // Close to one another, so that they do not widen a pixel's tolerance; 1/64 is far beyond it.
        let ids = |label: u32| [1.5 + (instance * 100 + label) as f32 / 64.0, -2.5 - (label % 3) as f32];
        *materials =
            std::sync::Arc::new(MaterialTable::clone(materials).with_ids((0..count).map(ids).collect()));
    }
}

/// Sums of render passes: light by kind, colours, normals, alpha, clamped light. The scenes are those in which most of these occur, half of
/// them a day.
#[test]
fn passes_are_the_cpus_and_alike_on_the_days_backends() {
    let fronts = paths();
    let names = ["all surfaces under a picture", "glass, clear", "lamps of all kinds", "occlusion"];
    let chosen: Vec<Case> =
        cases().into_iter().filter(|c| names.iter().any(|n| c.name.contains(n))).collect();
    for mut case in some_of_today(&chosen, 2) {
        case.film.transparent = true;
        let groups = [Pass::LIGHT, Pass::MATTES, &[Pass::Albedo, Pass::Normal]].concat();
        (case.film.passes, case.film.cryptomatte_ranks) = (groups.into_iter().collect(), 2);
        name_all(&mut case);
        (case.around.settings.clamp_direct, case.around.settings.clamp_indirect) = (0.5, 0.25);
        let expected = cpu_film(&case);
        let stride = expected.kept().stride();
        assert_eq!(stride, 56);
        let (_, first) = fronts[0].film_and_passes(&case, SPP);
        let found = found(&case, &asked(&case, SPP));
        let rays = found.iter().map(|f| f.rays).max().unwrap_or(0);
        // A part of a sum is as exact as the sum. What is left over of it, such as glossy light beside diffuse, has the error of the whole
        // pixel.
        let tolerance = tolerance(&case, rays);
        let differ = |(a, b): &(&[f32], &[f32])| {
            let scale = a.iter().chain(*b).fold(1e-6f32, |m, v| m.max(v.abs()));
            a.iter().zip(*b).any(|(a, b)| (a - b).abs() > tolerance * scale)
        };
        let pairs = first.chunks(stride).zip(expected.pass_sums().chunks(stride));
        let parted = pairs.filter(differ).count();
        let mean: f64 = found.iter().map(|f| f.parting.min(1.0)).sum();
        let most = mean + 5.0 * mean.sqrt() + 3.0;
        println!("{}: {parted} of {} pixels parted (at most {most:.1})", case.name, first.len() / stride);
        assert!(parted as f64 <= most, "{}: {parted} pixels differ, at most {most:.1} may", case.name);
        // Most pixels must be able to show a difference, and every kind of sum occurs: in ambient occlusion, diffuse light and its colour.
        assert!(most < 0.5 * (first.len() / stride) as f64, "{}", case.name);
        let sums: Vec<f32> =
            (0..stride).map(|i| first.iter().skip(i).step_by(stride).map(|v| v.abs()).sum()).collect();
        let groups = [0..1, 1..4, 4..7, 7..10, 31..34, 41..42, 49..50];
        assert!(groups.into_iter().all(|g| sums[g].iter().sum::<f32>() > 0.0), "{}: {sums:?}", case.name);
        for front in &fronts[1..] {
            let (_, sums) = front.film_and_passes(&case, SPP);
            let differ = first.iter().zip(&sums).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
            assert_eq!(differ, 0, "{}: {} against {}", case.name, front.name, fronts[0].name);
        }
        // Negative control: a lower clamp on what is seen and lit directly shows.
        (case.around.settings.clamp_direct, case.around.settings.clamp_indirect) = (0.05, 0.25);
        let (_, other) = fronts[0].film_and_passes(&case, SPP);
        let parted = other.chunks(stride).zip(expected.pass_sums().chunks(stride)).filter(differ).count();
        assert!(parted as f64 > most, "{}: other clamps go unnoticed, {parted} pixels", case.name);
    }
}

/// Compiling everything that a scene may need takes minutes on a device that computes on the CPU. Other tests compare functions, hits and
/// plain films with emulated doubles one by one, so this one only checks that they are put together in the same way.
#[test]
#[ignore = "full: the path with doubles in integers takes minutes to compile for a CPU"]
fn films_are_alike_with_doubles_in_integers() {
    let (fronts, integers) = (paths(), Front::in_integers("path"));
    let native = fronts.last().expect("compute");
    for case in chosen() {
        let (a, b) = (native.film(&case, SPP), integers.film(&case, SPP));
        let differ = a.iter().zip(&b).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
        assert_eq!(differ, 0, "{}: {} against {}", case.name, native.name, integers.name);
    }
}

#[test]
fn first_surfaces_are_the_cpus() {
    check_first_surfaces(&[Front::of("first", Backend::Compute, true, &of_first_surfaces())]);
}

/// `exactness.rs` compares the hits themselves on each backend, and with emulated doubles.
#[test]
#[ignore = "full: first surfaces on the other backends and with doubles in integers, each compiled for a CPU"]
fn first_surfaces_are_alike_everywhere() {
    let native = hardware_backends().into_iter().map(|backend| (backend, true));
    let fronts = native.chain([(Backend::Compute, false)]);
    let of = |(backend, native)| Front::of("first", backend, native, &of_first_surfaces());
    check_first_surfaces(&fronts.map(of).collect::<Vec<_>>());
}

/// What the first surfaces of the chosen scenes need.
fn of_first_surfaces() -> [u32; 22] {
    let parts = PartSet::NONE.with(Part::Meshes).with(Part::SmoothNormals);
    ShaderNeeds { parts, instance_tree: false, bricks: true, boxes: true, pages: false }.constants()
}

fn check_first_surfaces(fronts: &[Front]) {
    for front in fronts {
        for case in chosen() {
            let picture = case.path_tracer().picture().unwrap();
            let (depth, label) = (picture.depth.expect("a depth"), picture.label.expect("a label"));
            let (albedo, normal) = (picture.albedo.expect("an albedo"), picture.normal.expect("a normal"));
            let position = picture.position.expect("a position");
            let firsts = front.firsts(&case);
            let mut hits = 0;
            for (i, first) in firsts.iter().enumerate() {
                let what = || format!("{}, {}, pixel {i}: {first:?}", front.name, case.name);
                assert_eq!(first.depth.to_bits(), depth[i].to_bits(), "{}", what());
                assert_eq!(first.label, label[i], "{}", what());
                assert_eq!(first.albedo, albedo.pixels[i], "{}", what());
                // Normals of meshes are blended in floats, which a device may fuse, and divide with an error of 2.5 units.
                let off = (0..3).map(|a| (first.normal[a] - normal.pixels[i][a]).abs()).fold(0.0, f32::max);
                let limit = if case.name.contains("smooth meshes") { 2f32.powi(-18) } else { 0.0 };
                assert!(off <= limit, "{}: normal {:?}", what(), normal.pixels[i]);
                assert_eq!(first.position, position.pixels[i], "{}", what());
                hits += usize::from(first.label != 0);
            }
            assert!(hits > firsts.len() / 5, "{}: {hits} hits", case.name);
        }
    }
}

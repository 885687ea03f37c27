//! Light of shadow catchers, among all objects and among catchers alone: compares each backend's sums with the CPU's.

use std::sync::Arc;

use pumice_core::Job;
use pumice_picture::film::CLASSES;
use pumice_picture::{FilmBuffer, Pass};
use pumice_transport::MaterialTable;

use crate::gpu::turns::some_of_today;
use crate::paths;
use crate::samples::{asked, found, tolerance};
use crate::scenes::{Case, catching};

const SPP: u32 = 2 * CLASSES;

fn cpu_film(case: &Case) -> FilmBuffer {
    let mut tracer = case.path_tracer();
    tracer.add_samples(SPP, &Job::new()).expect("nobody cancels");
    tracer.film().clone()
}

/// Pixels whose sums differ by more than rounding explains.
fn parted(case: &Case, stride: usize, sums: &[f32], expected: &[f32], rays: u32) -> usize {
    let tolerance = tolerance(case, rays);
    let differ = |(a, b): &(&[f32], &[f32])| {
        let scale = a.iter().chain(*b).fold(1e-6f32, |m, v| m.max(v.abs()));
        a.iter().zip(*b).any(|(a, b)| (a - b).abs() > tolerance * scale)
    };
    sums.chunks(stride).zip(expected.chunks(stride)).filter(differ).count()
}

/// One of three films a day.
#[test]
fn caught_light_is_the_cpus_and_alike_on_the_days_backends() {
    let fronts = paths();
    // Ambient occlusion differs only in what is added to the sums, so one film suffices.
    let films = catching().into_iter().flat_map(|case| {
        let films = if case.name.contains("occlusion") { &[true][..] } else { &[false, true] };
        films.iter().map(move |&transparent| (case.clone(), transparent))
    });
    for (mut case, transparent) in some_of_today(&films.collect::<Vec<_>>(), 3) {
        case.film.transparent = transparent;
        // With a group of passes on either side, so that wrong places of the sums are noticed.
        case.film.passes = [Pass::Albedo, Pass::Normal].into_iter().collect();
        let expected = cpu_film(&case);
        let (stride, at) = (expected.kept().stride(), expected.kept().caught_at());
        assert_eq!((stride, at), if transparent { (39, 7) } else { (50, 6) });
        let (_, first) = fronts[0].film_and_passes(&case, SPP);
        let found = found(&case, &asked(&case, SPP));
        let rays = found.iter().map(|f| f.rays).max().unwrap_or(0);
        let differing = |sums: &[f32]| parted(&case, stride, sums, expected.pass_sums(), rays);
        // Paths that meet a catcher are continued twice.
        let mean: f64 = 2.0 * found.iter().map(|f| f.parting.min(1.0)).sum::<f64>();
        let most = mean + 5.0 * mean.sqrt() + 3.0;
        let (parted, pixels) = (differing(&first), first.len() / stride);
        println!("{}: {parted} of {pixels} pixels parted (at most {most:.1})", case.name);
        assert!(parted as f64 <= most, "{}: {parted} pixels differ, at most {most:.1} may", case.name);
        assert!(most < 0.5 * pixels as f64, "{}", case.name);
        // Each of the sums occurs, and so does shadow.
        let sum = |place: usize| first.iter().skip(at + place).step_by(stride).sum::<f32>();
        let [all, alone] = [sum(1), sum(4)];
        assert!(all > 0.0 && alone > 1.02 * all && sum(6) > 0.0, "{}: {all}, {alone}", case.name);
        assert_eq!(sum(7) > 0.0, transparent, "{}: samples that met nothing", case.name);
        for front in &fronts[1..] {
            let (_, sums) = front.film_and_passes(&case, SPP);
            let differ = first.iter().zip(&sums).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
            assert_eq!(differ, 0, "{}: {} against {}", case.name, front.name, fronts[0].name);
        }
        // Negative control: another object catches.
        let mut other = case.clone();
        let ball = other.around.materials.len() - 1;
        other.around.materials[ball] =
            Arc::new(MaterialTable::clone(&other.around.materials[ball]).catching(true));
        let (_, sums) = fronts[0].film_and_passes(&other, SPP);
        let parted = differing(&sums);
        assert!(parted as f64 > most, "{}: a second catcher goes unnoticed, {parted} pixels", case.name);
    }
}

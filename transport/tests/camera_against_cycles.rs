//! Compares the camera's rays with those of Cycles: pictures of glowing cubes in a black world, from one camera of each kind.
//!
//! `camera_against_cycles/draw.py` drew them with Blender 5.0.1 and defines the cubes and the cameras. This test intersects the same rays
//! with the planes of the cubes, using nothing of the renderer but its rays and sample points.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use std::f64::consts::PI;

use glam::{DAffine3, DVec3};
use pumice_scene::{Aperture, Camera, Film, Filter, Projection, SensorFit};
use pumice_transport::RayInWorld;
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::sampler::PixelSampler;

/// float32, kind by kind, rows from the top: the share of each pixel that the cubes fill.
const CYCLES: &[u8] = include_bytes!("camera_against_cycles/cycles.npy");

/// Longer and shorter side in pixels, and samples of each pixel, as in the script.
const LONG: u32 = 48;
const SHORT: u32 = 32;
const THEIR_SAMPLES: u32 = 1024;
const SAMPLES: u32 = 1024;

const CUBES: [[f64; 3]; 6] = [
    [-2.4, -1.2, -5.0],
    [0.1, 0.3, -8.0],
    [2.2, 1.4, -6.5],
    [1.1, -2.2, -10.0],
    [-1.9, 2.1, -12.0],
    [3.9, -1.0, -9.0],
];

/// Blender's camera: 35 mm lens, sensor of 36 × 24 mm.
const LENS: f64 = 35.0;

#[derive(Clone)]
struct Kind {
    name: &'static str,
    camera: Camera,
    film: Film,
}

fn kinds() -> Vec<Kind> {
    let turn =
        DAffine3::from_rotation_x(0.05) * DAffine3::from_rotation_y(-0.04) * DAffine3::from_rotation_z(0.1);
    let place = DAffine3::from_translation(DVec3::new(0.2, -0.1, 0.3)) * turn;
    let angle = |sensor: f64| Projection::Perspective { fov_rad: 2.0 * (0.5 * sensor / LENS).atan() };
    let kind = |name, change: &dyn Fn(&mut Camera, &mut Film)| {
        let mut camera = Camera { clip: [0.1, 100.0], ..Camera::new(place, angle(36.0)) };
        let mut film = Film::new(LONG, SHORT, Filter::Box { width: 1.0 });
        change(&mut camera, &mut film);
        Kind { name, camera, film }
    };
    // Blender's f-stop refers to the focal length in metres, or to 1 for parallel rays.
    let aperture = |length: f64, stop: f64, focus_distance, blades, rotation_rad, ratio| {
        Some(Aperture { radius: length / (2.0 * stop), focus_distance, blades, rotation_rad, ratio })
    };
    let metres = LENS * 1e-3;
    vec![
        kind("auto", &|_, _| ()),
        kind("horizontal, portrait", &|c, f| {
            (c.fit, f.width, f.height) = (SensorFit::Horizontal, SHORT, LONG);
        }),
        kind("vertical, shifted", &|c, _| {
            (c.fit, c.projection, c.shift) = (SensorFit::Vertical, angle(24.0), [0.1, -0.15]);
        }),
        kind("wide pixels, shifted", &|c, f| (f.pixel_aspect, c.shift) = (1.6, [-0.12, 0.08])),
        kind("parallel, tall pixels", &|c, f| {
            c.projection = Projection::Orthographic { scale: 9.0 };
            (f.pixel_aspect, c.shift) = (1.0 / 1.7, [0.05, 0.1]);
        }),
        kind("clipped", &|c, _| c.clip = [6.0, 10.0]),
        kind("disk", &|c, _| c.aperture = aperture(metres, 0.05, 8.0, 0, 0.0, 1.0)),
        kind("five blades, turned", &|c, _| c.aperture = aperture(metres, 0.03, 6.0, 5, 0.5, 1.0)),
        kind("three blades, narrow", &|c, _| {
            (c.aperture, c.shift) = (aperture(metres, 0.04, 11.0, 3, -0.9, 2.0), [0.1, 0.0]);
        }),
        kind("parallel, four blades, clipped", &|c, _| {
            c.projection = Projection::Orthographic { scale: 10.0 };
            (c.aperture, c.clip) = (aperture(1.0, 0.6, 9.0, 4, 0.0, 0.5), [5.0, 9.3]);
        }),
    ]
}

/// Whether a ray hits a face of a cube at t in (0, `t_max`).
fn meets_a_cube(ray: &RayInWorld, t_max: f64) -> bool {
    CUBES.iter().any(|&centre| {
        let at = |plane: f64| (DVec3::from(centre) + plane - ray.origin) / ray.direction;
        let (one, other) = (at(-0.5), at(0.5));
        let (enter, leave) = (one.min(other).max_element(), one.max(other).min_element());
        enter < leave && [enter, leave].iter().any(|t| (0.0..t_max).contains(t))
    })
}

/// The share of each pixel that the cubes fill, by our rays.
fn drawn(kind: &Kind) -> Vec<f64> {
    let rays = CameraRays::new(&kind.camera, &kind.film);
    let pixels = (0..kind.film.height).flat_map(|y| (0..kind.film.width).map(move |x| [x, y]));
    let share = |p: [u32; 2]| {
        let hits = (0..SAMPLES).filter(|&i| {
            let sampler = PixelSampler::new(3, p, i);
            let [u, v] = sampler.film().map(f64::from);
            let (x, y) = (f64::from(p[0]) + u, f64::from(p[1]) + v);
            let (ray, t_max) = match &rays.lens {
                None => rays.ray(x, y),
                Some(lens) => rays.lens_ray(lens, x, y, sampler.lens()),
            };
            meets_a_cube(&ray, t_max)
        });
        hits.count() as f64 / f64::from(SAMPLES)
    };
    pixels.map(share).collect()
}

fn cycles(number: usize) -> Vec<f64> {
    let pixels = (LONG * SHORT) as usize;
    let floats = CYCLES[CYCLES.len() - 4 * pixels * kinds().len()..].as_chunks::<4>().0;
    floats[number * pixels..][..pixels].iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect()
}

/// Squared differences of pixels, divided by the largest variance of independent samples: the mean over all pixels, and the largest.
///
/// A sample is 0 or 1: the variance is p (1 − p) / n for each picture, where p comes from both pictures plus one sample of either kind
/// (Laplace), so that pixels that are 0 or 1 in both pictures count too.
fn squared_differences(ours: &[f64], theirs: &[f64]) -> (f64, f64) {
    let (n, m) = (f64::from(SAMPLES), f64::from(THEIR_SAMPLES));
    let each = ours.iter().zip(theirs).map(|(a, b)| {
        let p = (a * n + b * m + 1.0) / (n + m + 2.0);
        (a - b).powi(2) / (p * (1.0 - p) * (1.0 / n + 1.0 / m))
    });
    let (sum, most) = each.fold((0.0, 0.0f64), |(sum, most), d| (sum + d, most.max(d)));
    (sum / ours.len() as f64, most)
}

/// Limits of the mean of [`squared_differences`], kind by kind. Samples are stratified, the better the fewer dimensions matter, so all
/// limits are well below the 1 of independent samples. Each is 1.5 times the maximum of eight seeds: seeds differ by a factor of two where
/// everything is sharp (few pixels have an edge), by a fifth elsewhere.
const MOST: [f64; 10] = [0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.123, 0.21, 0.093, 0.094];

/// Independent samples exceed 4 standard deviations in one pixel of 16,000, which is about the number of pixels here.
fn alike(number: usize, ours: &[f64], theirs: &[f64]) -> bool {
    let (mean, most) = squared_differences(ours, theirs);
    mean < MOST[number] && most < 16.0
}

#[test]
fn pictures_are_those_of_cycles() {
    for (number, kind) in kinds().iter().enumerate() {
        let (ours, theirs) = (drawn(kind), cycles(number));
        let filled = theirs.iter().sum::<f64>() / theirs.len() as f64;
        println!("{}: {filled:.3} filled, {:?}", kind.name, squared_differences(&ours, &theirs));
        assert!((0.02..0.6).contains(&filled), "{}: the cubes fill {filled} of the picture", kind.name);
        assert!(alike(number, &ours, &theirs), "{}: {:?}", kind.name, squared_differences(&ours, &theirs));
    }
}

/// Small errors in the camera are detected.
#[test]
fn other_cameras_are_told_apart() {
    type Change = fn(&mut Camera, &mut Film);
    let changes: [(usize, &str, Change); 10] = [
        (1, "another side is fitted", |c, _| c.fit = SensorFit::Vertical),
        (2, "shift the other way", |c, _| c.shift[1] *= -1.0),
        (3, "pixels 2 % narrower", |_, f| f.pixel_aspect *= 0.98),
        (4, "scale off by 1 %", |c, _| c.projection = Projection::Orthographic { scale: 9.09 }),
        (9, "near clip beyond a cube", |c, _| c.clip[0] = 5.9),
        (5, "far clip off by 4 %", |c, _| c.clip[1] *= 0.96),
        (6, "opening 20 % wider", |c, _| c.aperture.as_mut().unwrap().radius *= 1.2),
        (8, "turned by half a blade", |c, _| c.aperture.as_mut().unwrap().rotation_rad += PI / 3.0),
        (8, "ratio upside down", |c, _| c.aperture.as_mut().unwrap().ratio = 0.5),
        (9, "focus off by 3 %", |c, _| c.aperture.as_mut().unwrap().focus_distance *= 1.03),
    ];
    let mut missed = Vec::new();
    for (number, what, change) in changes {
        let mut kind = kinds()[number].clone();
        change(&mut kind.camera, &mut kind.film);
        let (ours, theirs) = (drawn(&kind), cycles(number));
        println!("{what}: {:?}", squared_differences(&ours, &theirs));
        missed.extend(alike(number, &ours, &theirs).then_some(what));
    }
    assert!(missed.is_empty(), "not told apart: {missed:?}");
}

//! Compares lamps with closed forms, with Cycles, and with themselves: sampled directions follow their density, and `meet` agrees with
//! `sample`.

#![allow(clippy::expect_used, clippy::panic, reason = "tests")]

use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use pumice_scene::{Light, LightShape, Outline};
use pumice_transport::{ReadyLamp, Receiver};

fn light(shape: LightShape) -> Light {
    Light { shape, power_w: 100.0, color: [1.0; 3], visible_to_camera: false }
}

fn floor(x: f64, y: f64) -> Receiver {
    Receiver { point: DVec3::new(x, y, 0.0), normal: Vec3::Z, both_sides: false }
}

/// Irradiance at a receiver, estimated with n² strata of the lamp's own sampling.
fn irradiance(lamp: &ReadyLamp, from: &Receiver, n: u32) -> f64 {
    let mut sum = 0.0;
    for i in 0..n * n {
        let u = [(i % n) as f32 + 0.5, (i / n) as f32 + 0.5].map(|v| v / n as f32);
        if let Some(s) = lamp.sample(from, u) {
            let over = if s.pdf > 0.0 { f64::from(s.pdf) } else { 1.0 };
            sum += f64::from(s.radiance.x) * f64::from(s.direction.dot(from.normal).max(0.0)) / over;
        }
    }
    sum / f64::from(n * n)
}

fn point(z: f64, radius: f64, soft_falloff: bool) -> ReadyLamp {
    ReadyLamp::new(&light(LightShape::Point { position: [0.0, 0.0, z], radius, soft_falloff }))
}

/// An area lamp at height `z` that shines down.
fn area(z: f64, outline: Outline, size: [f64; 2], spread_rad: f64) -> ReadyLamp {
    let world_from_light = DAffine3::from_translation(DVec3::new(0.0, 0.0, z));
    ReadyLamp::new(&light(LightShape::Area { world_from_light, outline, size, spread_rad }))
}

/// The error of f32 arithmetic and of strata over a smooth function is 1e-4 of the closed form.
#[test]
fn irradiance_is_the_closed_forms() {
    let close = |got: f64, expected: f64, what: &str| {
        assert!((got / expected - 1.0).abs() < 1e-4, "{what}: expected {expected}, got {got}");
    };
    // A point, a ball and a soft disk straight above: I = P / 4π; a ball's E is I / d² for any radius, a disk's I / (d² + r²).
    let intensity = 100.0 / (4.0 * PI);
    for d in [0.5, 2.0, 1000.0] {
        close(irradiance(&point(d, 0.0, false), &floor(0.0, 0.0), 1), intensity / (d * d), "a point");
        for r in [1e-9, 1e-3, 0.1, 0.45] {
            close(irradiance(&point(d, r, false), &floor(0.0, 0.0), 64), intensity / (d * d), "a ball");
            let soft = irradiance(&point(d, r, true), &floor(0.0, 0.0), 64);
            close(soft, intensity / (d * d + r * r), "a soft ball");
        }
    }
    // Inside a ball: its radiance from all sides, π L.
    close(irradiance(&point(0.3, 1.0, false), &floor(0.0, 0.0), 64), intensity, "within");
    // A disk straight above: Lambert's E = P / A · r² / (d² + r²).
    for (d, r) in [(1.0, 0.5), (0.5, 2.0), (30.0, 0.5)] {
        let lamp = area(d, Outline::Ellipse, [2.0 * r, 2.0 * r], PI);
        let expected = 100.0 / (PI * r * r) * r * r / (d * d + r * r);
        close(irradiance(&lamp, &floor(0.0, 0.0), 1000), expected, "a disk");
    }
    // A rectangle with one corner straight above: Lambert 1760; e.g. Howell, configuration C-11.
    for (a, b, d) in [(1.0, 1.0, 1.0), (3.0, 0.2, 0.5), (0.1, 0.1, 5.0), (40.0, 30.0, 1.0)] {
        let [x, y] = [a, b].map(|v: f64| v / d);
        let [rx, ry] = [x, y].map(|v| (1.0 + v * v).sqrt());
        let factor = (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / (2.0 * PI);
        let lamp = area(d, Outline::Rectangle, [a, b], PI);
        let got = irradiance(&lamp, &floor(0.5 * a, 0.5 * b), 256);
        close(got, 100.0 / (a * b) * factor, "a rectangle");
    }
    // A beam.
    close(irradiance(&area(7.0, Outline::Rectangle, [2.0, 0.5], 0.0), &floor(0.9, 0.2), 1), 100.0, "a beam");
    assert_eq!(irradiance(&area(7.0, Outline::Rectangle, [2.0, 0.5], 0.0), &floor(1.1, 0.2), 1), 0.0);
}

/// Whatever the spread, all of the power arrives on a plane close below the lamp that is wide enough for all but its margins.
#[test]
fn spread_keeps_the_power() {
    for spread in [0.01, 0.03, 0.05, 0.3, 1.0, 2.0] {
        let lamp = area(0.001, Outline::Rectangle, [1.0, 1.0], spread);
        let (mut sum, n) = (0.0, 9);
        for i in 0..n * n {
            let [x, y] = [i % n, i / n].map(|v| 0.8 * ((f64::from(v) + 0.5) / f64::from(n) - 0.5));
            sum += irradiance(&lamp, &floor(x, y), 128) / f64::from(n * n);
        }
        // Strata of a cone with a cusp on its axis, 128 across: 1e-3.
        assert!((sum / 100.0 - 1.0).abs() < 2e-3, "spread {spread}: {sum} of 100 W/m²");
    }
}

/// 3x² − 2x³ of (cos − cos half) / ((1 − cos half) blend), in f64; the negative control is a linear profile.
#[test]
fn spots_have_blenders_profile() {
    let mut convicted = 0;
    for (angle, blend) in [(1.0f64, 0.15f32), (0.02, 0.5), (PI, 1.0), (0.5, 0.0)] {
        let shape = LightShape::Spot {
            position: [0.0, 0.0, 2.0],
            direction: [0.0, 0.0, -3.0],
            radius: 0.0,
            angle_rad: angle,
            blend,
            soft_falloff: false,
        };
        let lamp = ReadyLamp::new(&light(shape));
        for i in 0..50 {
            let off = (0.55 * angle).min(1.5) * (f64::from(i) + 0.5) / 50.0;
            let cos = off.cos();
            let edge = (1.0 - (0.5 * angle).cos()) * f64::from(blend);
            let x = ((cos - (0.5 * angle).cos()) / edge).clamp(0.0, 1.0);
            let distance = 2.0 / cos;
            let alone = 100.0 / (4.0 * PI) / (distance * distance) * cos;
            let got = irradiance(&lamp, &floor(2.0 * off.tan(), 0.0), 1) / alone;
            let expected = x * x * (3.0 - 2.0 * x);
            // f32 directions, 1e-7, at the cone's angle: as an error of 1 − cos, relative to the blended part.
            let limit = 1e-5 + 1e-6 / angle / f64::from(blend.max(0.1));
            assert!((got - expected).abs() < limit, "{angle} {blend} at {off}: {got} for {expected}");
            convicted += usize::from((got - x).abs() > limit);
        }
    }
    assert!(convicted > 40, "{convicted}");
}

fn tilted() -> DAffine3 {
    // Blender's Matrix.Translation @ Rotation(0.5, 'X') @ Rotation(0.3, 'Y').
    let turn = DMat3::from_rotation_x(0.5) * DMat3::from_rotation_y(0.3);
    DAffine3 { matrix3: turn, translation: DVec3::new(0.3, 0.2, 1.5) }
}

fn ball(radius: f64, soft_falloff: bool) -> LightShape {
    LightShape::Point { position: [0.3, 0.2, 1.5], radius, soft_falloff }
}

fn spot(radius: f64, degrees: f64, blend: f32, soft_falloff: bool) -> LightShape {
    let direction = (-tilted().matrix3.z_axis).to_array();
    LightShape::Spot {
        position: [0.3, 0.2, 1.5],
        direction,
        radius,
        angle_rad: degrees.to_radians(),
        blend,
        soft_falloff,
    }
}

fn flat(outline: Outline, size: [f64; 2], degrees: f64) -> LightShape {
    LightShape::Area { world_from_light: tilted(), outline, size, spread_rad: degrees.to_radians() }
}

/// Mean over a white square from −1 to 1 in the plane z = 0 in Cycles (Blender 5.0.1, `tests/python/cycles_lamps.py`, 1,024 samples of each
/// of 32² pixels): its noise is below 5e-4, and so is the error of the strata at sharp edges here.
#[test]
fn means_are_those_of_cycles() {
    use Outline::{Ellipse, Rectangle};
    let cases = [
        ("a point", ball(0.0, false), 0.761489),
        ("a soft ball", ball(0.5, true), 0.699452),
        ("within a soft ball", ball(4.0, true), 0.116680),
        ("a spot", spot(0.0, 60.0, 0.4, false), 0.199227),
        ("a soft spot", spot(0.2, 60.0, 0.4, true), 0.195573),
        ("a sharp soft spot", spot(0.2, 50.0, 0.0, true), 0.173121),
        ("a narrow soft spot", spot(0.6, 20.0, 1.0, true), 0.0128757),
        ("a half space of a soft spot", spot(0.6, 180.0, 0.15, true), 0.674678),
        ("a square", flat(Rectangle, [1.0, 1.0], 180.0), 2.209202),
        ("a rectangle", flat(Rectangle, [1.5, 0.5], 180.0), 2.127561),
        ("a disk", flat(Ellipse, [1.0, 1.0], 180.0), 2.225472),
        ("an ellipse", flat(Ellipse, [1.5, 0.5], 180.0), 2.163567),
        ("a spread rectangle", flat(Rectangle, [1.5, 0.5], 60.0), 3.464297),
        ("a narrow disk", flat(Ellipse, [1.0, 1.0], 5.0), 3.810350),
        ("a spread ellipse", flat(Ellipse, [1.5, 0.5], 90.0), 3.294515),
        ("a ball", ball(0.5, false), 0.761489),
        ("within a ball", ball(4.0, false), 0.158315),
        ("within a spot's ball", spot(4.0, 60.0, 0.4, false), 0.158315),
        ("a spot's ball", spot(0.2, 60.0, 0.4, false), 0.198362),
        ("a sharp spot's ball", spot(0.2, 50.0, 0.0, false), 0.175701),
        ("a narrow spot's ball", spot(0.6, 20.0, 1.0, false), 0.0145491),
        ("a half space of a spot's ball", spot(0.6, 180.0, 0.15, false), 0.760563),
        ("a beam", flat(Rectangle, [1.5, 0.5], 0.0), 3.703354),
    ];
    for (name, shape, cycles) in cases {
        // From inside, a disk is wide, and few strata lie near its middle; a narrow cone shows little of its ball.
        let strata = if name.contains("within") || name.contains("narrow") { 64 } else { 16 };
        let lamp = ReadyLamp::new(&light(shape));
        // A beam's edges are sharp, and one sample measures all of it.
        let (strata, n) = if name.contains("beam") { (1, 1500) } else { (strata, 64) };
        let mut sum = 0.0;
        for i in 0..n * n {
            let [x, y] = [i % n, i / n].map(|v| 2.0 * (f64::from(v) + 0.5) / f64::from(n) - 1.0);
            sum += irradiance(&lamp, &floor(x, y), strata) / PI / f64::from(n * n);
        }
        // Few of Cycles' pixels see anything of a narrow cone.
        let limit = if name.contains("narrow") { 3e-3 } else { 1e-3 };
        assert!((sum / cycles - 1.0).abs() < limit, "{name}: Cycles has {cycles}, got {sum}");
    }
}

/// Lamps of all kinds, with receivers near, inside, at grazing angles, and partly behind the lamp's plane.
fn seen() -> Vec<(&'static str, ReadyLamp, Receiver)> {
    use Outline::{Ellipse, Rectangle};
    let at = |p: [f64; 3], n: [f32; 3], both_sides| Receiver {
        point: DVec3::from_array(p),
        normal: Vec3::from_array(n).normalize(),
        both_sides,
    };
    let below = || at([0.1, -0.4, 0.2], [0.2, 0.1, 1.0], false);
    let shapes = [
        ("a ball", ball(0.5, false), below()),
        ("within a ball", ball(2.0, false), below()),
        ("within a ball, both sides", ball(2.0, false), at([0.1, -0.4, 0.2], [0.2, 0.1, 1.0], true)),
        ("a soft ball", ball(0.5, true), below()),
        ("a spot", spot(0.4, 90.0, 0.3, false), below()),
        (
            "a spot of a narrow cone",
            spot(1.0, 30.0, 0.5, false),
            at([-0.35, 1.0, -0.2], [0.0, 0.0, 1.0], false),
        ),
        ("a soft spot", spot(0.4, 90.0, 0.3, true), below()),
        ("a rectangle", flat(Rectangle, [1.5, 0.5], 180.0), below()),
        (
            "a rectangle aslant",
            flat(Rectangle, [3.0, 2.0], 180.0),
            at([2.0, 0.2, 0.3], [0.0, 0.0, 1.0], false),
        ),
        ("a far rectangle", flat(Rectangle, [0.5, 0.5], 180.0), at([2.0, 6.0, -6.0], [0.0, 0.0, 1.0], false)),
        (
            "a spread rectangle",
            flat(Rectangle, [1.5, 0.5], 70.0),
            at([0.5, 0.8, 0.6], [0.0, 0.0, 1.0], false),
        ),
        ("an ellipse", flat(Ellipse, [1.5, 0.5], 180.0), below()),
        ("a spread ellipse", flat(Ellipse, [1.5, 1.2], 50.0), at([0.5, 0.8, 0.6], [0.0, 0.0, 1.0], false)),
    ];
    shapes.map(|(name, shape, from)| (name, ReadyLamp::new(&light(shape)), from)).into()
}

/// SplitMix64.
fn random(state: &mut u64) -> f32 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut x = *state;
    x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((x ^ x >> 31) >> 40) as f32 / 16_777_216.0
}

#[test]
fn what_is_sampled_is_met() {
    for (name, lamp, from) in seen() {
        let (mut state, mut sampled, mut lost) = (3, 0, 0);
        for _ in 0..20_000 {
            let Some(s) = lamp.sample(&from, [random(&mut state), random(&mut state)]) else { continue };
            sampled += 1;
            let Some(m) = lamp.meet(&from, s.direction) else {
                lost += 1;
                continue;
            };
            // The distance has a relative rounding error of 1e-7; light falls steeply at the rim of a spread or a cone.
            assert!((m.distance - s.distance).abs() < 2e-3 * s.distance, "{name}: {m:?} {s:?}");
            assert!((m.pdf / s.pdf - 1.0).abs() < 1e-3, "{name}: {m:?} {s:?}");
            assert!(
                (m.radiance - s.radiance).length() <= 1e-4 * lamp.radiance.length(),
                "{name}: {m:?} {s:?}"
            );
        }
        // Only a rim of 1e-6 may be lost to rounding.
        assert!(sampled > 1_000 && lost <= 5, "{name}: {lost} of {sampled}");
    }
}

/// Sum over cells of directions of (count − expected)² / expected, with its degrees of freedom. `told` is the lamp whose density is
/// integrated.
fn chi_square(lamp: &ReadyLamp, told: &ReadyLamp, from: &Receiver) -> (f64, f64) {
    let (rows, columns, fine, samples) = (16usize, 32usize, 100usize, 100_000);
    let mut expected = vec![0.0; rows * columns + 1];
    for i in 0..rows * fine {
        for j in 0..columns * fine {
            let z = 2.0 * (i as f64 + 0.5) / (rows * fine) as f64 - 1.0;
            let (s, c) = (2.0 * PI * (j as f64 + 0.5) / (columns * fine) as f64).sin_cos();
            let flat = (1.0 - z * z).sqrt();
            if let Some(m) = told.meet(from, DVec3::new(flat * c, flat * s, z).as_vec3()) {
                expected[i / fine * columns + j / fine] += f64::from(m.pdf);
            }
        }
    }
    let cell = 4.0 * PI / (rows * fine * columns * fine) as f64;
    expected.iter_mut().for_each(|e| *e *= cell * f64::from(samples));
    expected[rows * columns] = f64::from(samples) - expected.iter().sum::<f64>();
    let mut counts = vec![0.0; rows * columns + 1];
    let mut state = 7;
    for _ in 0..samples {
        let at = match lamp.sample(from, [random(&mut state), random(&mut state)]) {
            Some(s) => {
                let turn = f64::from(s.direction.y).atan2(s.direction.x.into()) / (2.0 * PI);
                let row = ((f64::from(s.direction.z) + 1.0) * 0.5 * rows as f64) as usize;
                let column = (turn.rem_euclid(1.0) * columns as f64) as usize;
                row.min(rows - 1) * columns + column.min(columns - 1)
            }
            None => rows * columns,
        };
        counts[at] += 1.0;
    }
    // Cells with few expected samples are pooled; cells with none must be empty except for parts of a rim that the fine grid misses.
    let (mut chi, mut cells, mut rest) = (0.0, 0.0, [0.0; 2]);
    for (i, (e, c)) in expected.iter().zip(&counts).enumerate() {
        if i == rows * columns {
            // The samples that find nothing, whose share follows from the grid. The grid assigns the pieces at a rim by the middles of five
            // million pieces: in an ellipse 0.07 % were missing.
            let off = ((c - e).abs() - 1e-3 * f64::from(samples)).max(0.0);
            chi += off * off / e.max(50.0);
        } else if *e > 50.0 {
            chi += (c - e) * (c - e) / e;
            cells += 1.0;
        } else {
            rest = [rest[0] + e, rest[1] + c];
        }
    }
    chi += (rest[1] - rest[0]).powi(2) / rest[0].max(50.0);
    (chi, cells)
}

/// The limit is five standard deviations of χ²; the negative control uses a lamp larger by 10 %.
#[test]
fn directions_follow_their_density() {
    // The cells are too wide for distant lamps.
    for (name, lamp, from) in seen().into_iter().filter(|s| !s.0.contains("far")) {
        let (chi, freedom) = chi_square(&lamp, &lamp, &from);
        let limit = freedom + 5.0 * (2.0 * freedom).sqrt() + 5.0;
        assert!(chi < limit, "{name}: χ² {chi} of {freedom} degrees of freedom");
        if name.contains("within") {
            continue;
        }
        let mut larger = lamp;
        larger.half = lamp.half.map(|h| 1.1 * h);
        larger.one_minus_cos_half_angle *= 1.2;
        let (chi, freedom) = chi_square(&lamp, &larger, &from);
        let limit = freedom + 5.0 * (2.0 * freedom).sqrt() + 5.0;
        assert!(chi > limit, "{name} is not told from one that is larger by 10 %: χ² {chi} of {freedom}");
    }
}

/// Sizes from 0 to 1e6, distances likewise, cones and spreads of 0: no NaN, no infinity.
#[test]
fn extremes_are_finite() {
    let mut state = 11;
    let mut lit = 0;
    let sizes = [0.0, 1e-300, 1e-20, 1e-12, 1e-3, 1.0, 1e6, 1e15];
    for size in sizes {
        let mut shapes = Vec::new();
        for soft in [false, true] {
            shapes.push(ball(size, soft));
            shapes.extend([0.0, 1e-9, 1e-4, 180.0].map(|degrees| spot(size, degrees, 0.0, soft)));
        }
        for outline in [Outline::Rectangle, Outline::Ellipse] {
            let other = size.max(1e-300);
            shapes.extend([0.0, 1e-3, 1.0, 179.999, 180.0].map(|d| flat(outline, [other, 1.0], d)));
            shapes.extend([0.0, 179.999].map(|d| flat(outline, [other, other], d)));
        }
        for shape in shapes {
            let lamp = ReadyLamp::new(&light(shape));
            assert!(lamp.intensity.is_finite(), "{shape:?}: {lamp:?}");
            for away in [0.0, 1e-30, 1e-12, 1e-3, 1.0, 1e6, 1e12] {
                for _ in 0..40 {
                    let d = Vec3::new(random(&mut state), random(&mut state), random(&mut state)) - 0.5;
                    let point = DVec3::new(0.3, 0.2, 1.5) + d.normalize().as_dvec3() * away;
                    let from = Receiver { point, normal: Vec3::Z, both_sides: random(&mut state) < 0.5 };
                    let u = [random(&mut state), random(&mut state)];
                    let direction = -d.normalize();
                    let weight = lamp.irradiance_at(&from);
                    assert!(weight.is_finite() && weight >= 0.0, "{shape:?} from {away}: {weight}");
                    // A lamp of weight 0 is never chosen: no light of it may be seen there, but for what underflows.
                    if let Some(s) = lamp.sample(&from, u)
                        && (from.both_sides || s.direction.z > 0.0)
                        && s.radiance.x / s.pdf.max(1.0) > 1e-30
                    {
                        assert!(weight > 0.0, "{shape:?} from {away}: {s:?} is never sampled");
                    }
                    for s in [lamp.sample(&from, u), lamp.meet(&from, direction)].into_iter().flatten() {
                        lit += 1;
                        let whole = s.radiance.is_finite() && s.pdf.is_finite() && s.pdf >= 0.0;
                        assert!(whole && s.direction.is_finite(), "{shape:?} from {away}: {s:?}");
                        assert!(!s.distance.is_nan(), "{shape:?} from {away}: {s:?}");
                    }
                }
            }
        }
    }
    assert!(lit > 10_000, "{lit}");
}

/// Lamps are chosen by about the irradiance that they give: exactly for a point straight above, within a half for what is small beside its
/// distance, and never by light that is not there.
#[test]
fn lamps_are_chosen_by_the_irradiance_that_they_give() {
    let mut state = 5;
    for case in 0..400 {
        let lamp = match case % 4 {
            0 => point(2.0, 0.0, false),
            1 => point(2.0, 0.2, case % 8 == 1),
            2 => area(2.0, Outline::Rectangle, [0.3, 0.1], PI),
            _ => area(2.0, Outline::Ellipse, [0.2, 0.3], PI),
        };
        let from =
            floor(4.0 * f64::from(random(&mut state)) - 2.0, 4.0 * f64::from(random(&mut state)) - 2.0);
        let (weight, true_one) = (f64::from(lamp.irradiance_at(&from)), irradiance(&lamp, &from, 32));
        let ratio = weight / true_one;
        assert!((0.66..1.5).contains(&ratio), "{lamp:?} from {from:?}: {weight} for {true_one}");
    }
    let above = point(2.0, 0.0, false).irradiance_at(&floor(0.0, 0.0));
    assert!((f64::from(above) / (100.0 / (16.0 * PI)) - 1.0).abs() < 1e-5, "{above}");

    // Behind a flat lamp, below the receiver's horizon; and with both sides, above 0.
    let up =
        |z: f64, both_sides: bool| Receiver { point: DVec3::new(0.0, 0.0, z), normal: Vec3::Z, both_sides };
    assert_eq!(area(2.0, Outline::Rectangle, [0.3, 0.1], PI).irradiance_at(&up(2.5, true)), 0.0);
    assert_eq!(point(2.0, 0.1, false).irradiance_at(&up(2.5, false)), 0.0);
    assert!(point(2.0, 0.1, false).irradiance_at(&up(2.5, true)) > 0.0);
    // A ball that touches the horizon is still seen.
    assert!(point(2.0, 0.1, false).irradiance_at(&up(2.09, false)) > 0.0);
}

/// A lamp that is narrower than the rounding of its distance gives the light of a lamp that is not.
#[test]
fn narrow_lamps_give_their_light() {
    for outline in [Outline::Rectangle, Outline::Ellipse] {
        for spread in [PI, 1.2] {
            let of = |size| irradiance(&area(2.0, outline, size, spread), &floor(0.7, 0.4), 16);
            let expected = of([1e-3; 2]);
            for size in [[1e-9, 1e-3], [1e-9; 2], [1e-14; 2]] {
                assert!(
                    (of(size) / expected - 1.0).abs() < 1e-3,
                    "{outline:?} {spread} {size:?}: {}",
                    of(size)
                );
            }
        }
    }
}

/// The axes of an area lamp are directions however short or long they are, and nothing that is near the limits of the scene's validation makes a
/// number that is none.
#[test]
fn extreme_lamps_give_finite_light() {
    for scale in [1e-300, 1e-160, 1e-20, 1e17] {
        let world_from_light = DAffine3::from_scale(DVec3::new(scale, 1.0, scale));
        let shape = |world_from_light| LightShape::Area {
            world_from_light,
            outline: Outline::Ellipse,
            size: [1.0; 2],
            spread_rad: PI,
        };
        let [lamp, unscaled] =
            [world_from_light, DAffine3::IDENTITY].map(|m| ReadyLamp::new(&light(shape(m))));
        assert_eq!((lamp.axis, lamp.sides), (unscaled.axis, unscaled.sides), "{scale}");
    }
    let mut lit = 0;
    for z in [1e-18, 1.0, 1e9, 1e18] {
        for size in [1e-15, 1.0, 1e18] {
            let lamps = [
                point(z, size, false),
                point(z, size, true),
                area(z, Outline::Rectangle, [size, 1.0], PI),
                area(z, Outline::Ellipse, [size; 2], PI),
                area(z, Outline::Rectangle, [size; 2], 0.5),
                area(z, Outline::Rectangle, [size; 2], 0.0),
            ];
            for (number, lamp) in lamps.iter().enumerate() {
                for x in [0.0, 1e-9, 3.0, 1e18] {
                    let from = floor(x, 0.0);
                    let what = format!("lamp {number}, {z} {size} {x}");
                    assert!(lamp.irradiance_at(&from).is_finite(), "{what}");
                    for u in [[0.0, 0.0], [0.25, 0.75], [0.999_999_9, 0.5]] {
                        let Some(s) = lamp.sample(&from, u) else { continue };
                        // On a ball's surface the distance is the difference of numbers as large as these, to 2⁻²⁴ of them each.
                        let least = -1e-6 * (z + size + x) as f32;
                        let is_sound = s.direction.is_normalized() && s.distance >= least && s.pdf >= 0.0;
                        assert!(is_sound && s.radiance.is_finite(), "{what}: {s:?}");
                        lit += 1;
                    }
                }
            }
        }
    }
    assert!(lit > 300, "{lit} samples carry light");
}

/// A lamp at height 2 that shines down in a cone.
fn spot_above(radius: f64, angle_rad: f64, blend: f32) -> ReadyLamp {
    ReadyLamp::new(&light(LightShape::Spot {
        position: [0.0, 0.0, 2.0],
        direction: [0.0, 0.0, -1.0],
        radius,
        angle_rad,
        blend,
        soft_falloff: false,
    }))
}

/// Cones and spreads count: lamps are chosen by the light that they let through, and not where they let none through.
#[test]
fn lamps_are_not_chosen_for_light_that_cone_or_spread_holds_back() {
    let area = |size, spread_rad| area(2.0, Outline::Rectangle, size, spread_rad);
    // Range of the weight over the irradiance, and the distance from the axis past which there is no light.
    for (what, lamp, range, dark_from) in [
        ("a point in a cone", spot_above(0.0, 1.5, 0.5), 0.99..1.01, 1.87),
        ("a point in a sharp cone", spot_above(0.0, 1.5, 0.0), 0.99..1.01, 1.87),
        ("a ball in a cone", spot_above(0.2, 1.5, 0.5), 0.8..1.3, 2.8),
        ("a small area with a spread", area([0.1, 0.2], 1.2), 0.9..1.2, 1.6),
        ("a wide area with a spread", area([2.0, 2.0], 1.2), 0.7..1.3, 3.4),
        ("a wide area with a narrow spread", area([2.0, 2.0], 0.2), 0.45..1.0, 1.7),
        ("a beam", area([2.0, 2.0], 0.0), 0.99..1.01, 1.5),
    ] {
        let brightest = irradiance(&lamp, &floor(0.0, 0.0), 64);
        let (mut lit, mut dark) = (0, 0);
        for x in 0..80 {
            let from = floor(0.05 * f64::from(x) + 0.013, 0.03);
            let (weight, true_one) = (f64::from(lamp.irradiance_at(&from)), irradiance(&lamp, &from, 64));
            assert!(true_one == 0.0 || weight > 0.0, "{what} from {from:?}");
            if true_one > 0.05 * brightest {
                lit += 1;
                let ratio = weight / true_one;
                assert!(range.contains(&ratio), "{what} from {from:?}: {weight} for {true_one}");
            }
            if from.point.x > dark_from {
                dark += 1;
                assert!(weight == 0.0, "{what} from {from:?}: {weight}");
            }
        }
        assert!(lit > 5 && dark > 5, "{what}: {lit} {dark}");
    }
}

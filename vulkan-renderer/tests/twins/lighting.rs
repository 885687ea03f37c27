//! Tests `trigonometry.glsl`, `sun.glsl`, `lamp*.glsl`, `environment.glsl`, `lights.glsl` and `camera_rays.glsl`.

use std::f64::consts::PI;

use glam::{DAffine3, DVec3, Vec3};
use pumice_picture::Image;
use pumice_scene::{Aperture, Camera, Film, Filter, Light, LightShape, Outline, Projection, SensorFit, Sun};
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::lamp::LampKind;
use pumice_transport::sun::frame_around;
use pumice_transport::{
    EnvironmentTable, LightStrategy, Lights, RayInWorld, ReadyLamp, ReadySun, Receiver, Sky,
};
use pumice_vulkan::layout::SceneHeader;
use pumice_vulkan::pack::{self, PackedSky};

use super::gpu::Gpu;
use super::gpu::scene::{Form, Uploaded};
use super::words::{Random, Reader, Row, close};

fn direction(random: &mut Random) -> DVec3 {
    loop {
        let d = DVec3::new(random.signed(), random.signed(), random.signed());
        if (0.01..1.0).contains(&d.length_squared()) {
            return d.normalize();
        }
    }
}

/// Unit directions, with the poles and the axes among them.
fn directions(random: &mut Random, n: usize) -> Vec<DVec3> {
    let mut all: Vec<DVec3> = (0..n).map(|_| direction(random)).collect();
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        // Not −axis, whose zeros are negative: they would choose the azimuth at a pole, where it means nothing.
        all.extend([axis, DVec3::ZERO - axis, (axis + direction(random) * 1e-5).normalize()]);
    }
    all
}

/// Compares with the standard library, in doubles. Sines: the argument has no rounding error, and the polynomial's omitted terms and four
/// roundings stay below 2⁻²³. Arctangents: three roundings of numbers up to π worth 2⁻²³ each, and the device's division and root, 2.5
/// units in the last place each.
#[test]
fn trigonometry_is_accurate() {
    let mut random = Random(21);
    let mut inputs: Vec<[f32; 3]> = (0..100_000)
        .map(|_| {
            let scale = 10f64.powi(-(random.below(8) as i32));
            [7.0 * random.signed(), random.signed() * scale, random.signed()].map(|v| v as f32)
        })
        .collect();
    for y in [0.0, 1.0, -1.0] {
        for x in [0.0, 1.0, -1.0] {
            inputs.push([x * std::f32::consts::PI, y, x]);
        }
    }
    let rows: Vec<_> = inputs.iter().map(|i| i.iter().fold(Row::default(), |r, &v| r.float(v)).0).collect();
    for (&[a, y, x], row) in inputs.iter().zip(Gpu::new().probe(false, 3, 0, &rows, 3)) {
        let mut r = Reader(&row);
        let (sin, cos) = f64::from(a).sin_cos();
        assert!((f64::from(r.float()) - sin).abs() < 2f64.powi(-23), "sin {a}");
        assert!((f64::from(r.float()) - cos).abs() < 2f64.powi(-23), "cos {a}");
        let angle = f64::from(y).atan2(f64::from(x));
        // Where y is −0 or 0 behind the origin, both of ±π are the angle.
        let got = f64::from(r.float());
        let error = (got - angle).abs().min((got + angle).abs() + if y == 0.0 { 0.0 } else { 9.0 });
        assert!(error < 2f64.powi(-20), "atan2 {y} {x}: {got}, {angle}");
    }
}

/// Lens apertures of each kind. With them rays are as exact as sines in floats: points of the aperture are within 2⁻²¹ of its radius.
#[test]
fn camera_rays_are_the_same() {
    let gpu = Gpu::new();
    let mut random = Random(22);
    let kinds = [
        (SensorFit::Auto, 1.0, 0, 1.0),
        (SensorFit::Horizontal, 1.3, 5, 2.0),
        (SensorFit::Vertical, 0.7, 3, 0.6),
    ];
    for (orthographic, (fit, pixel_aspect, blades, ratio)) in
        [false, true].into_iter().flat_map(|o| kinds.map(|k| (o, k)))
    {
        let (width, height) = (641, 1333);
        let turn = DAffine3::from_axis_angle(direction(&mut random), 1.3);
        let aperture = Aperture { radius: 0.3, focus_distance: 2.5, blades, rotation_rad: 40.0, ratio };
        let camera = Camera {
            shift: [0.13, -0.31],
            clip: [0.1, 1e4],
            fit,
            aperture: Some(aperture),
            ..Camera::new(
                DAffine3::from_translation(DVec3::new(1e5 + 0.3, -0.1, 7.7)) * turn,
                if orthographic {
                    Projection::Orthographic { scale: 3.7 }
                } else {
                    Projection::Perspective { fov_rad: 0.9 }
                },
            )
        };
        let film = Film { pixel_aspect, ..Film::new(width, height, Filter::Box { width: 1.0 }) };
        let rays = CameraRays::new(&camera, &film);
        let lens = rays.lens.expect("an opening");
        let header = SceneHeader { camera: pack::camera(&rays), ..Default::default() };
        let scene = gpu.buffer_of(&[header]);
        let inputs: Vec<([f64; 2], [f32; 2])> = (0..5_000)
            .map(|_| {
                let place = f64::from(random.below(1500)) + 0.5 + f64::from(random.unit() - 0.5);
                ([place, f64::from(random.below(1500)) + 0.5], [random.unit(), random.unit()])
            })
            .collect();
        let row =
            |&([x, y], [u, v]): &([f64; 2], [f32; 2])| Row::default().double(x).double(y).float(u).float(v).0;
        let rows: Vec<_> = inputs.iter().map(row).collect();
        for (&([x, y], u), row) in inputs.iter().zip(gpu.probe(false, 4, scene.address, &rows, 28)) {
            let numbers = |(ray, t_max): (RayInWorld, f64)| {
                ray.origin.to_array().into_iter().chain(ray.direction.to_array()).chain([t_max])
            };
            let mut r = Reader(&row);
            // In emulated doubles: bit for bit.
            for e in numbers(rays.ray(x, y)) {
                assert_eq!(r.double().to_bits(), e.to_bits(), "({x}, {y}) of {camera:?}");
            }
            for e in numbers(rays.lens_ray(&lens, x, y, u)) {
                let got = r.double();
                let off = aperture.radius / ratio.min(1.0) * 2f64.powi(-21);
                assert!((got - e).abs() <= off, "({x}, {y}), {u:?}: {got}, {e} of {camera:?}");
            }
        }
    }
}

/// In emulated doubles: bit for bit, −0 taken as 0.
#[test]
fn frames_are_the_same() {
    let inputs = directions(&mut Random(23), 20_000);
    let rows: Vec<_> = inputs.iter().map(|n| Row::default().doubles(n.to_array()).0).collect();
    for (n, row) in inputs.iter().zip(Gpu::new().probe(false, 5, 0, &rows, 12)) {
        let (tangent, bitangent) = frame_around(*n);
        let mut r = Reader(&row);
        for e in tangent.to_array().into_iter().chain(bitangent.to_array()) {
            let got = r.double();
            assert!(got == e, "{n}: {tangent}, {bitangent}; {got}");
        }
    }
}

fn sun(angle_rad: f64) -> ReadySun {
    let sun = Sun { direction: [0.3, -0.5, -2.0], strength: 2.5, color: [1.0, 0.5, 0.25], angle_rad };
    ReadySun::new(&sun)
}

fn lights_scene(gpu: &Gpu, lights: &Lights) -> (Uploaded, u64) {
    let mut uploaded = Uploaded::new(gpu, &[], Form::Bricks);
    let suns = pack::suns(lights);
    let suns = if suns.is_empty() { 0 } else { uploaded.put(gpu, &suns) };
    let lamps = pack::lamps(lights);
    let lamps = if lamps.is_empty() { 0 } else { uploaded.put(gpu, &lamps) };
    let (nodes, cones) = pack::lamp_tree(lights);
    let nodes = if nodes.is_empty() { 0 } else { uploaded.put(gpu, &nodes) };
    let cones = if cones.is_empty() { 0 } else { uploaded.put(gpu, &cones) };
    let environment = PackedSky::new(lights).map(|sky| {
        let parts = sky.parts().map(|p| uploaded.put(gpu, p));
        sky.record(parts)
    });
    let header = SceneHeader {
        lights: pack::lights(lights, [suns, lamps, nodes, cones]),
        environment: environment.unwrap_or_default(),
        ..Default::default()
    };
    let scene = uploaded.header(gpu, header);
    (uploaded, scene)
}

/// Density and membership are equal. A direction differs by the error that a float's sine causes in its distance from the sun's centre.
/// That is below the sine of the half angle times 2⁻²², for each of two terms.
#[test]
fn suns_are_the_same() {
    let gpu = Gpu::new();
    let mut random = Random(24);
    for angle in [0.0, 1e-4, 0.009, 0.5, 2.0, PI] {
        let sun = sun(angle);
        let lights = Lights::new(Sky::Constant(Vec3::ONE), vec![sun], None);
        let (_kept, scene) = lights_scene(&gpu, &lights);
        let inputs: Vec<_> = (0..5_000)
            .map(|_| {
                // Half of the directions are near the cone's border.
                let near = sun.towards + direction(&mut random) * (0.5 * angle).sin() * 1.2;
                let d = if random.below(2) == 0 { near.normalize() } else { direction(&mut random) };
                ([random.unit(), random.unit()], d)
            })
            .collect();
        let rows: Vec<_> = inputs
            .iter()
            .map(|&(u, d)| Row::default().float(u[0]).float(u[1]).doubles(d.to_array()).0)
            .collect();
        let reach = (0.5 * angle).sin().max(1e-12);
        let mut inside = 0;
        for (&(u, d), row) in inputs.iter().zip(gpu.probe(false, 6, scene, &rows, 11)) {
            let (direction, radiance, pdf) = sun.sample(u);
            let mut r = Reader(&row);
            let got = DVec3::new(r.double(), r.double(), r.double());
            assert!((got - direction).length() <= reach * 2f64.powi(-20), "{angle} {u:?}: {got} {direction}");
            assert_eq!([r.float(), r.float(), r.float()], radiance.to_array());
            assert_eq!(r.float(), pdf.unwrap_or(0.0));
            assert_eq!(r.word() != 0, sun.eval(d).is_some(), "{angle}: {d}");
            inside += usize::from(sun.eval(d).is_some());
        }
        assert!(angle == 0.0 || inside > 100, "{angle}: {inside}");
    }
}

/// A smooth image: a small error of the position changes radiance only a little, so the comparison checks positions, not noise.
fn picture(width: usize, height: usize) -> Image {
    let pixel = |i: usize| {
        let (x, y) = ((i % width) as f32 / width as f32, (i / width) as f32 / height as f32);
        let wave = (x * 2.0 * std::f32::consts::PI).sin();
        [2.0 + wave + y, 1.0 + y, 3.0 - wave * y]
    };
    Image::new(width, height, (0..width * height).map(pixel).collect())
}

/// Positions are floats. Relative to a turn, azimuth and height are off by at most 2⁻²⁰ (an arctangent's error and two roundings), and
/// radiance and density by their slopes times that.
#[test]
fn environments_are_the_same() {
    let gpu = Gpu::new();
    for (width, height, rotation) in [(64, 31, 0.0), (257, 128, 2.1), (8, 4, -7.0)] {
        let table = EnvironmentTable::new(picture(width, height), 1.5, rotation).expect("a table");
        let lights = Lights::new(Sky::Image(std::sync::Arc::new(table.clone())), vec![], None);
        let (_kept, scene) = lights_scene(&gpu, &lights);
        let mut random = Random(25);
        let inputs: Vec<_> = directions(&mut random, 20_000)
            .into_iter()
            .map(|d| ([random.unit(), random.unit()], d))
            .collect();
        let rows: Vec<_> = inputs
            .iter()
            .map(|&(u, d)| Row::default().float(u[0]).float(u[1]).doubles(d.to_array()).0)
            .collect();
        // The density of the whole sphere is 0.08; positions are off by 2⁻²⁰ turns, where it changes by its slope.
        let density = |got: f32, expected: f32| {
            assert!((got - expected).abs() < 1e-3 * expected.max(0.08), "density {got}, expected {expected}");
        };
        let mut sampled = 0;
        for (&(u, d), row) in inputs.iter().zip(gpu.probe(false, 7, scene, &rows, 14)) {
            let (direction, radiance, pdf) = table.sample(u);
            let mut r = Reader(&row);
            let got = DVec3::new(r.double(), r.double(), r.double());
            // The azimuth as a float: up to 10 rad, 2⁻²¹ for it and the same for its rotation.
            assert!((got - direction).length() < 2f64.powi(-18), "{u:?}: {got} {direction}");
            for c in radiance.to_array() {
                close(r.float(), c, 1e-4, "radiance of a sample");
            }
            density(r.float(), pdf);
            // At the poles the azimuth is undetermined: x and y of 10⁻⁵ are floats of 17 bits there.
            for c in table.eval(d).to_array() {
                close(r.float(), c, 1e-4, "radiance");
            }
            let (got, expected) = (r.float(), table.pdf(d));
            // In the rows at the poles the density has no bound, and its sine is a float's.
            if d.truncate().length() > 0.01 {
                density(got, expected);
            }
            sampled += usize::from(expected > 0.0);
        }
        assert!(sampled > inputs.len() / 4, "{sampled} of {} directions are above the mean", inputs.len());
    }
}

#[test]
fn chosen_lights_are_the_same() {
    let gpu = Gpu::new();
    let image = || {
        Sky::Image(std::sync::Arc::new(EnvironmentTable::new(picture(64, 32), 1.0, 0.3).expect("a table")))
    };
    let constant = || Sky::Constant(Vec3::new(0.1, 0.2, 0.3));
    let backdrop = Some([[0.1, 0.2, 0.3], [0.9, 0.8, 0.7]]);
    let scenes = [
        Lights::new(constant(), vec![], None),
        Lights::new(constant(), vec![sun(0.5), sun(0.0), sun(0.01)], backdrop),
        Lights::new(image(), vec![sun(0.3)], None),
        Lights::new(image(), vec![], backdrop),
        Lights::new(constant(), vec![sun(0.5)], None).with_lamps(lamps()),
        Lights::new(image(), vec![], None).with_lamps(lamps()),
        Lights::new(image(), vec![sun(0.3)], None).with_lamps(crowd()),
        Lights::new(image(), vec![sun(0.3)], None).with_strategy(LightStrategy::LightsOnly),
        Lights::new(image(), vec![sun(0.3)], None).with_strategy(LightStrategy::BsdfOnly),
    ];
    for lights in &scenes {
        let (_kept, scene) = lights_scene(&gpu, lights);
        let mut random = Random(26);
        let towards = sun(0.0).towards;
        let mut rims = 0;
        let inputs: Vec<_> = (0..4_000)
            .map(|_| {
                let d = match random.below(2) {
                    0 => direction(&mut random),
                    _ => (towards + 0.2 * direction(&mut random)).normalize(),
                };
                let (u, pdf) = ([random.unit(), random.unit()], 3.0 * random.unit());
                let limit = [0.5, 3.0, f64::INFINITY][random.below(3) as usize];
                (random.unit(), u, d, pdf, random.unit(), receiver(&mut random), limit)
            })
            .collect();
        let rows: Vec<_> = inputs
            .iter()
            .map(|&(choice, u, d, pdf, down, from, limit)| {
                let row = Row::default().float(choice).float(u[0]).float(u[1]);
                row_of(row.doubles(d.to_array()).float(pdf).float(down), &from).double(limit).0
            })
            .collect();
        let answers = gpu.probe(gpu.native_today(), 8, scene, &rows, 22);
        for (&(choice, u, d, pdf, down, ref from, limit), row) in inputs.iter().zip(answers) {
            let mut r = Reader(&row);
            let odds = lights.odds(from);
            let sampled = lights.sample_light(from, &odds, choice, u, || [0.0; 3]);
            let found = r.word() != 0;
            if found != sampled.is_some() {
                // The rim of a lamp.
                rims += 1;
                continue;
            }
            let got = DVec3::new(r.double(), r.double(), r.double());
            let numbers = [r.float(), r.float(), r.float(), r.float()];
            if let Some(s) = sampled {
                // For a lamp: see `lamps_are_the_same`.
                let limit = if s.distance.is_finite() { 5e-4 } else { 2f64.powi(-18) };
                assert!((got - s.direction).length() < limit, "{got} {}", s.direction);
                for (n, e) in numbers.into_iter().zip(s.radiance_over_pdf.to_array()) {
                    close(n, e, if s.distance.is_finite() { 2e-3 } else { 2e-4 }, "radiance over density");
                }
                close(numbers[3], s.pdf.unwrap_or(0.0), 1e-3, "density");
            }
            let distance = r.double();
            if let Some(s) = sampled {
                assert!(distance == s.distance || (distance / s.distance - 1.0).abs() < 1e-3, "{distance}");
            }
            let lamps = lights.lamp_emission(from, &odds, d, limit, pdf);
            let got = Vec3::new(r.float(), r.float(), r.float());
            rims += usize::from((got - lamps).length() > 1e-2 * lamps.length() + 1e-5);
            // A direction within a float's error of a pixel's border may find the neighbour's density: a slope of the image.
            for e in lights.infinite_emission(from, &odds, d, pdf).to_array() {
                close(r.float(), e, 1e-2, "found");
            }
            for e in lights.background(d, down).to_array() {
                close(r.float(), e, 1e-4, "behind");
            }
        }
        // A surface within 1e-6 of a rim may be hit on one side and missed on the other.
        assert!(rims <= 8, "{rims} of 4000 differ");
    }
}

/// Lamps of all kinds about the origin.
fn lamps() -> Vec<ReadyLamp> {
    let turned = DAffine3::from_axis_angle(DVec3::new(1.0, 0.4, 0.2).normalize(), 0.7);
    let world_from_light = DAffine3::from_translation(DVec3::new(0.1, -0.2, 0.4)) * turned;
    let position = [0.2, 0.1, -0.3];
    let point = |radius, soft_falloff| LightShape::Point { position, radius, soft_falloff };
    let spot = |radius, angle_rad, blend, soft_falloff| LightShape::Spot {
        position,
        direction: [0.3, 0.2, 1.0],
        radius,
        angle_rad,
        blend,
        soft_falloff,
    };
    let area = |outline, size, spread_rad| LightShape::Area { world_from_light, outline, size, spread_rad };
    let shapes = [
        point(0.0, false),
        point(0.4, false),
        point(3.0, false),
        point(0.4, true),
        spot(0.0, 1.0, 0.2, false),
        spot(0.4, 2.0, 0.0, false),
        spot(0.9, 0.4, 1.0, false),
        spot(0.4, 2.0, 0.3, true),
        area(Outline::Rectangle, [1.0, 0.6], PI),
        area(Outline::Rectangle, [0.03, 0.02], PI),
        area(Outline::Rectangle, [1.0, 0.6], 1.0),
        area(Outline::Rectangle, [1.0, 0.6], 0.0),
        area(Outline::Ellipse, [1.0, 0.6], PI),
        area(Outline::Ellipse, [2.0, 2.0], 0.8),
    ];
    let light = |shape| Light { shape, power_w: 40.0, color: [1.0, 0.5, 0.2], visible_to_camera: false };
    shapes.map(|s| ReadyLamp::new(&light(s))).into()
}

/// So many lamps of all kinds about the origin that a tree chooses among them.
fn crowd() -> Vec<ReadyLamp> {
    let mut random = Random(27);
    let lamp = |i: u32| {
        let position = (direction(&mut random) * (2.0 * f64::from(random.unit()))).to_array();
        let axis = direction(&mut random);
        let radius = [0.0, 0.05, 0.2][i as usize % 3];
        let shape = match i % 4 {
            0 => LightShape::Point { position, radius, soft_falloff: i.is_multiple_of(8) },
            1 => {
                let (direction, angle_rad) = (axis.to_array(), 1.5);
                LightShape::Spot { position, direction, radius, angle_rad, blend: 0.5, soft_falloff: false }
            }
            _ => LightShape::Area {
                world_from_light: DAffine3::from_translation(DVec3::from_array(position))
                    * DAffine3::from_axis_angle(axis, 2.0),
                outline: if i % 4 == 2 { Outline::Rectangle } else { Outline::Ellipse },
                size: [0.1, 0.2],
                spread_rad: 2.0,
            },
        };
        ReadyLamp::new(&Light { shape, power_w: 0.5, color: [1.0, 0.5, 0.2], visible_to_camera: false })
    };
    (0..600).map(lamp).collect()
}

pub(super) fn receiver(random: &mut Random) -> Receiver {
    let point = direction(random) * (3.0 * f64::from(random.unit()));
    Receiver { point, normal: direction(random).as_vec3(), both_sides: random.below(4) == 0 }
}

pub(super) fn row_of(row: Row, from: &Receiver) -> Row {
    let [x, y, z] = from.normal.to_array();
    row.doubles(from.point.to_array()).float(x).float(y).float(z).word(u32::from(from.both_sides))
}

/// Each lamp on its own. The device's roots and arctangents are correct to some units in the last place. In the solid angle of a small
/// rectangle, a difference of four angles, that is 1e-4; in a direction within one that is seen at a grazing angle, through the sine of a
/// difference of two of them, about 1e-4. So 5e-4 is tolerated there, 2e-6 elsewhere, and 1e-3 for densities. At the rims of cones, spreads
/// and outlines light ends.
#[test]
fn lamps_are_the_same() {
    let gpu = Gpu::new();
    let lamps = lamps();
    let lights = Lights::new(Sky::Constant(Vec3::ZERO), vec![], None).with_lamps(lamps.clone());
    let (_kept, scene) = lights_scene(&gpu, &lights);
    let mut random = Random(27);
    let inputs: Vec<_> = (0..20_000)
        .map(|_| {
            let from = receiver(&mut random);
            let number = random.below(lamps.len() as u32);
            let lamp = &lamps[number as usize];
            let reach = 1.2 * f64::from(lamp.half[0].max(lamp.half[1]));
            let near = lamp.position + direction(&mut random) * reach - from.point;
            let towards = if random.below(8) == 0 { direction(&mut random) } else { near.normalize() };
            (number, from, [random.unit(), random.unit()], towards.as_vec3())
        })
        .collect();
    let rows: Vec<_> = inputs
        .iter()
        .map(|(number, from, u, towards)| {
            let row = row_of(Row::default().word(*number), from).float(u[0]).float(u[1]);
            row.float(towards.x).float(towards.y).float(towards.z).0
        })
        .collect();
    let mut both = vec![[0; 2]; lamps.len()];
    let mut rims = 0;
    for ((number, from, u, towards), row) in inputs.iter().zip(gpu.probe(false, 20, scene, &rows, 18)) {
        let lamp = &lamps[*number as usize];
        let mut r = Reader(&row);
        for (way, expected) in [lamp.sample(from, *u), lamp.meet(from, *towards)].into_iter().enumerate() {
            let found = r.word() != 0;
            let direction = Vec3::new(r.float(), r.float(), r.float());
            let distance = r.float();
            let radiance = Vec3::new(r.float(), r.float(), r.float());
            let pdf = r.float();
            let Some(e) = expected.filter(|_| found) else {
                rims += usize::from(found != expected.is_some());
                continue;
            };
            both[*number as usize][way] += 1;
            let what = format!("lamp {number}, {way}: {e:?}; {direction} {distance} {radiance} {pdf}");
            let limit =
                if matches!(lamp.kind, LampKind::Rectangle | LampKind::Ellipse) { 5e-4 } else { 2e-6 };
            assert!((direction - e.direction).length() < limit, "{what}");
            let same = (distance - e.distance).abs() < 1e-3 * e.distance
                && (radiance - e.radiance).length() <= 2e-4 * lamp.radiance.length().max(e.radiance.length())
                && (pdf - e.pdf).abs() <= 1e-3 * e.pdf;
            rims += usize::from(!same);
        }
    }
    assert!(rims <= 20, "{rims} of 20000 differ");
    for (number, [sampled, met]) in both.iter().enumerate() {
        assert!(*sampled > 50, "lamp {number}: {sampled} samples");
        let single = lamps[number].half[0] == 0.0 || lamps[number].tan_half_spread == 0.0 && number == 11;
        assert!(single || *met > 20, "lamp {number}: {met} meetings");
    }
}

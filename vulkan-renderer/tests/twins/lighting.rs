//! `trigonometry.glsl`, `sun.glsl`, `environment.glsl`, `lights.glsl`, `camera_rays.glsl`.

use std::f64::consts::PI;

use glam::{DAffine3, DVec3, Vec3};
use pumice_cpu::camera_rays::CameraRays;
use pumice_cpu::{Finding, Lights, Sky};
use pumice_render::sun::frame_around;
use pumice_render::{EnvironmentTable, Image, ReadySun};
use pumice_scene::{Camera, Film, Filter, Projection, Sun};
use pumice_vulkan::layout::SceneHeader;
use pumice_vulkan::pack::{self, PackedSky};

use super::gpu::Gpu;
use super::gpu::scene::Uploaded;
use super::words::{Random, Reader, Row, close};

fn direction(random: &mut Random) -> DVec3 {
    loop {
        let d = DVec3::new(random.signed(), random.signed(), random.signed());
        if (0.01..1.0).contains(&d.length_squared()) {
            return d.normalize();
        }
    }
}

/// Unit directions, the poles and the axes among them.
fn directions(random: &mut Random, n: usize) -> Vec<DVec3> {
    let mut all: Vec<DVec3> = (0..n).map(|_| direction(random)).collect();
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        // Not −axis, whose zeros are negative: at a pole they choose the azimuth, which means nothing there.
        all.extend([axis, DVec3::ZERO - axis, (axis + direction(random) * 1e-5).normalize()]);
    }
    all
}

/// Against the language's, in doubles. Sines: the argument's own rounding is none, the polynomial's last terms and four roundings
/// are below 2⁻²³. Arctangents: three roundings of numbers up to π each worth 2⁻²³, and the division and root of the device, 2.5
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
        // Where y is −0 or 0 behind the origin, either of ±π is the angle.
        let got = f64::from(r.float());
        let error = (got - angle).abs().min((got + angle).abs() + if y == 0.0 { 0.0 } else { 9.0 });
        assert!(error < 2f64.powi(-20), "atan2 {y} {x}: {got}, {angle}");
    }
}

/// In emulated doubles: bit for bit.
#[test]
fn camera_rays_are_the_same() {
    let gpu = Gpu::new();
    let mut random = Random(22);
    for orthographic in [false, true] {
        let (width, height) = (641, 1333);
        let turn = DAffine3::from_axis_angle(direction(&mut random), 1.3);
        let camera = Camera {
            world_from_camera: DAffine3::from_translation(DVec3::new(1e5 + 0.3, -0.1, 7.7)) * turn,
            projection: if orthographic {
                Projection::Orthographic { scale: 3.7 }
            } else {
                Projection::Perspective { fov_rad: 0.9 }
            },
            shift: [0.13, -0.31],
            clip: [0.1, 1e4],
        };
        let film = Film { width, height, filter: Filter::Box { width: 1.0 } };
        let rays = CameraRays::new(&camera, &film);
        let header = SceneHeader { camera: pack::camera(&rays), ..Default::default() };
        let scene = gpu.buffer_of(&[header]);
        let inputs: Vec<[f64; 2]> = (0..20_000)
            .map(|_| [0, 1].map(|_| f64::from(random.below(1500)) + 0.5 + f64::from(random.unit() - 0.5)))
            .collect();
        let rows: Vec<_> = inputs.iter().map(|&[x, y]| Row::default().double(x).double(y).0).collect();
        for (&[x, y], row) in inputs.iter().zip(gpu.probe(false, 4, scene.address, &rows, 14)) {
            let (ray, t_max) = rays.ray(x, y);
            let mut r = Reader(&row);
            for e in ray.origin.to_array().into_iter().chain(ray.direction.to_array()).chain([t_max]) {
                assert_eq!(r.double().to_bits(), e.to_bits(), "({x}, {y}) of {camera:?}");
            }
        }
    }
}

/// In emulated doubles: bit for bit, −0 as 0.
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
    let mut uploaded = Uploaded::new(gpu, &[]);
    let ends = uploaded.put(gpu, if lights.ends().is_empty() { &[0.0] } else { lights.ends() });
    let suns = pack::suns(lights);
    let suns = if suns.is_empty() { 0 } else { uploaded.put(gpu, &suns) };
    let environment = PackedSky::new(lights).map(|sky| {
        let parts = sky.parts().map(|p| uploaded.put(gpu, p));
        sky.record(parts)
    });
    let header = SceneHeader {
        lights: pack::lights(lights, ends, suns),
        environment: environment.unwrap_or_default(),
        ..Default::default()
    };
    let scene = uploaded.header(gpu, header);
    (uploaded, scene)
}

/// Density and membership are equal; a direction differs by what a float's sine does to its distance from the sun's middle, which
/// is below the sine of the half angle: 2⁻²² of it for each of two terms.
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
                // Half of the directions near the cone's border.
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

/// Smooth, so that a place that is off by a little changes radiance by little: what is compared is the place, not its noise.
fn picture(width: usize, height: usize) -> Image {
    let pixel = |i: usize| {
        let (x, y) = ((i % width) as f32 / width as f32, (i / width) as f32 / height as f32);
        let wave = (x * 2.0 * std::f32::consts::PI).sin();
        [2.0 + wave + y, 1.0 + y, 3.0 - wave * y]
    };
    Image::new(width, height, (0..width * height).map(pixel).collect())
}

/// Places are floats: relative to a turn, azimuth and height are off by 2⁻²⁰ at most (an arctangent's error and two roundings), so
/// radiance by its slope times that; a density, constant within a pixel, is equal but within that distance of a pixel's border.
#[test]
fn environments_are_the_same() {
    let gpu = Gpu::new();
    for (width, height, rotation) in [(64, 31, 0.0), (257, 128, 2.1), (8, 4, -7.0)] {
        let table = EnvironmentTable::new(picture(width, height), 1.5, rotation).expect("a table");
        let lights = Lights::new(Sky::Image(Box::new(table.clone())), vec![], None);
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
        let mut other_pixel = 0;
        for (&(u, d), row) in inputs.iter().zip(gpu.probe(false, 7, scene, &rows, 14)) {
            let (direction, radiance, pdf) = table.sample(u);
            let mut r = Reader(&row);
            let got = DVec3::new(r.double(), r.double(), r.double());
            // The azimuth's float: up to 10 rad, 2⁻²¹ each for it and its rotation.
            assert!((got - direction).length() < 2f64.powi(-18), "{u:?}: {got} {direction}");
            for c in radiance.to_array() {
                close(r.float(), c, 1e-4, "radiance of a sample");
            }
            assert_eq!(r.float(), pdf, "{u:?}");
            // At the poles the azimuth is anything: x and y of 10⁻⁵ are floats of 17 bits there.
            for c in table.eval(d).to_array() {
                close(r.float(), c, 1e-4, "radiance");
            }
            other_pixel += usize::from(r.float() != table.pdf(d));
        }
        // Borders are 1 pixel apart and places off by 2⁻²⁰ turns: width + height borders cross so many of the directions.
        let expected = inputs.len() as f64 * (width + height) as f64 * 2f64.powi(-19);
        assert!((other_pixel as f64) < 4.0 * expected + 6.0, "{other_pixel} of {} pixels", inputs.len());
    }
}

#[test]
fn chosen_lights_are_the_same() {
    let gpu = Gpu::new();
    let image = || Sky::Image(Box::new(EnvironmentTable::new(picture(64, 32), 1.0, 0.3).expect("a table")));
    let constant = || Sky::Constant(Vec3::new(0.1, 0.2, 0.3));
    let backdrop = Some([[0.1, 0.2, 0.3], [0.9, 0.8, 0.7]]);
    let scenes = [
        Lights::new(constant(), vec![], None),
        Lights::new(constant(), vec![sun(0.5), sun(0.0), sun(0.01)], backdrop),
        Lights::new(image(), vec![sun(0.3)], None),
        Lights::new(image(), vec![], backdrop),
        Lights::new(image(), vec![sun(0.3)], None).found_by(Finding::Aimed),
        Lights::new(image(), vec![sun(0.3)], None).found_by(Finding::Scattered),
    ];
    for lights in &scenes {
        let (_kept, scene) = lights_scene(&gpu, lights);
        let mut random = Random(26);
        let towards = sun(0.0).towards;
        let inputs: Vec<_> = (0..4_000)
            .map(|_| {
                let d = match random.below(2) {
                    0 => direction(&mut random),
                    _ => (towards + 0.2 * direction(&mut random)).normalize(),
                };
                let (u, pdf) = ([random.unit(), random.unit()], 3.0 * random.unit());
                (random.unit(), u, d, pdf, random.unit())
            })
            .collect();
        let rows: Vec<_> = inputs
            .iter()
            .map(|&(choice, u, d, pdf, down)| {
                let row = Row::default().float(choice).float(u[0]).float(u[1]);
                row.doubles(d.to_array()).float(pdf).float(down).0
            })
            .collect();
        for (&(choice, u, d, pdf, down), row) in inputs.iter().zip(gpu.probe(false, 8, scene, &rows, 17)) {
            let mut r = Reader(&row);
            let sampled = lights.sample(choice, u);
            assert_eq!(r.word() != 0, sampled.is_some(), "{choice}");
            let got = DVec3::new(r.double(), r.double(), r.double());
            let numbers = [r.float(), r.float(), r.float(), r.float()];
            if let Some(s) = sampled {
                assert!((got - s.direction).length() < 2f64.powi(-18), "{got} {}", s.direction);
                for (n, e) in numbers.into_iter().zip(s.radiance_over_pdf.to_array()) {
                    close(n, e, 2e-4, "radiance over density");
                }
                close(numbers[3], s.pdf.unwrap_or(0.0), 1e-6, "density");
            }
            // A direction within a float's error of a pixel's border may find the neighbour's density: a slope of the picture.
            for e in lights.found(d, pdf).to_array() {
                close(r.float(), e, 1e-2, "found");
            }
            for e in lights.behind(d, down).to_array() {
                close(r.float(), e, 1e-4, "behind");
            }
        }
    }
}

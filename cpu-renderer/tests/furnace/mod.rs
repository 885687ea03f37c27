//! White furnaces: scenes whose picture is known exactly, and the one judgement for the renderer and for its faulty copies.
#![allow(dead_code, unreachable_pub, reason = "each test file uses its part")]
#![allow(clippy::expect_used, reason = "test helpers: a failure is a failed test")]

pub mod faulty;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use pumice_cpu::Surroundings;
use pumice_picture::Image;
use pumice_picture::film::CLASSES;
use pumice_scene::{Camera, Film, Filter, Material, Projection, Settings};
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::sampler::PixelSampler;
use pumice_transport::{EnvironmentTable, Lights, MaterialTable, PathOrigin, RayInWorld, Sky, Tracer};
use rayon::prelude::*;

use crate::naive::Dense;

/// Required accuracy: the relative error that a furnace's picture may have.
pub const TOLERANCE: f64 = 1e-3;

pub const FILM: Film = Film::new(32, 32, Filter::Box { width: 1.0 });

/// A scene in which every pixel that sees the shape has the value `exact`.
pub struct Furnace {
    pub name: String,
    pub dense: Dense,
    pub around: Surroundings,
    pub camera: Camera,
    pub spp: u32,
    pub exact: f64,
}

/// The mean over the pixels that see nothing but the shape, and its standard error.
#[derive(Clone, Copy, Debug)]
pub struct Mean {
    pub value: f64,
    pub standard_error: f64,
}

impl Furnace {
    pub fn new(
        name: &str,
        dense: Dense,
        camera: Camera,
        material: Material,
        sky: Sky,
        settings: Settings,
    ) -> Self {
        let around = Surroundings {
            lights: Lights::new(sky, Vec::new(), None).into(),
            materials: vec![MaterialTable::same(material).into()].into(),
            settings,
        };
        Self { name: name.to_owned(), dense, around, camera, spp: 16, exact: 1.0 }
    }

    #[must_use]
    pub fn exactly(self, exact: f64, spp: u32) -> Self {
        Self { exact, spp, ..self }
    }

    fn rays(&self) -> CameraRays {
        CameraRays::new(&self.camera, &FILM)
    }

    /// Pixels whose four corners hit the shape.
    pub fn pixels(&self) -> Vec<[u32; 2]> {
        let rays = self.rays();
        let pixels: Vec<_> = (0..FILM.height)
            .flat_map(|y| (0..FILM.width).map(move |x| [x, y]))
            .filter(|&[x, y]| {
                [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].iter().all(|&(cx, cy)| {
                    let (ray, t_max) = rays.ray(f64::from(cx), f64::from(cy));
                    self.dense.first_hit(&ray, PathOrigin::Free, t_max).is_some()
                })
            })
            .collect();
        assert!(pixels.len() > 100, "{}: the camera sees {} pixels of the shape", self.name, pixels.len());
        pixels
    }

    /// One sample of one pixel, computed by `radiance`.
    pub fn sample(&self, radiance: &Radiance<'_>, pixel: [u32; 2], sample: u32) -> Vec3 {
        let sampler = PixelSampler::new(self.around.settings.seed, pixel, sample);
        let [u, v] = sampler.film();
        let (ray, t_max) =
            self.rays().ray(f64::from(pixel[0]) + f64::from(u), f64::from(pixel[1]) + f64::from(v));
        radiance(&self.dense, &self.around, &sampler, ray, t_max)
    }

    /// The mean of `radiance`; its error follows from the classes, and is a little too large (see `pumice_picture::film`).
    pub fn mean(&self, radiance: &Radiance<'_>) -> Mean {
        let pixels = self.pixels();
        let sums: Vec<[f64; CLASSES as usize]> = pixels
            .par_iter()
            .map(|&pixel| {
                let mut sums = [0.0; CLASSES as usize];
                for s in 0..self.spp {
                    sums[(s % CLASSES) as usize] += f64::from(self.sample(radiance, pixel, s).x);
                }
                sums
            })
            .collect();
        assert_eq!(self.spp % CLASSES, 0);
        let (n, r) = (pixels.len() as f64, f64::from(CLASSES));
        let (mut value, mut variance) = (0.0, 0.0);
        for of_pixel in sums.iter().map(|s| s.map(|x| x * r / f64::from(self.spp))) {
            let mean = of_pixel.iter().sum::<f64>() / r;
            value += mean / n;
            variance += of_pixel.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (r * (r - 1.0)) / (n * n);
        }
        Mean { value, standard_error: variance.sqrt() }
    }

    /// Relative error of the mean of `radiance`, and its standard error.
    pub fn error(&self, radiance: &Radiance<'_>) -> [f64; 2] {
        let mean = self.mean(radiance);
        let (off, noise) = (mean.value / self.exact - 1.0, mean.standard_error / self.exact);
        println!("{:60} {off:+.5} ± {noise:.5}", self.name);
        [off, noise]
    }

    /// Whether `radiance` is within the tolerance.
    ///
    /// # Panics
    /// Panics where noise could hide a small fault: the tolerance must be at least three standard errors.
    pub fn accepts(&self, radiance: &Radiance<'_>) -> bool {
        let [off, noise] = self.error(radiance);
        assert!(3.0 * noise <= TOLERANCE, "{}: too noisy to judge, ± {noise}", self.name);
        off.abs() < TOLERANCE
    }

    /// Whether `radiance` is wrong by more than the tolerance, beyond its noise.
    pub fn convicts(&self, radiance: &Radiance<'_>) -> bool {
        let [off, noise] = self.error(radiance);
        off.abs() - 3.0 * noise > TOLERANCE
    }
}

/// Radiance along a camera ray.
pub type Radiance<'a> = dyn Fn(&Dense, &Surroundings, &PixelSampler, RayInWorld, f64) -> Vec3 + Sync + 'a;

/// The renderer's own [`Radiance`].
pub fn rendered(d: &Dense, around: &Surroundings, s: &PixelSampler, ray: RayInWorld, t_max: f64) -> Vec3 {
    pumice_cpu::path::radiance(d, around, s, ray, t_max, 0.5)
}

pub fn lambert(albedo: f64, emission: f32) -> Material {
    Material { base_color: [albedo as f32; 3], specular: 0.0, emission: [emission; 3], ..Material::default() }
}

pub fn even_sky(radiance: f32) -> Sky {
    Sky::Constant(Vec3::splat(radiance))
}

/// The same light as a picture of which all is sampled: light sampling uses it, and both strategies are weighted.
pub fn painted_sky(radiance: f32) -> Sky {
    let image = Image::new(16, 8, vec![[radiance; 3]; 128]);
    Sky::Image(std::sync::Arc::new(EnvironmentTable::above(0.0, image, 1.0, 0.7).expect("valid")))
}

pub fn camera(from: DVec3, to: DVec3, fov_rad: f64) -> Camera {
    let z = (from - to).normalize();
    let x = DVec3::Z.cross(z).normalize();
    let matrix = DMat3::from_cols(x, z.cross(x), z);
    Camera::new(DAffine3::from_mat3_translation(matrix, from), Projection::Perspective { fov_rad })
}

/// A shape full of pits and tunnels.
pub fn sponge() -> Dense {
    Dense::new([12, 12, 12], |[x, y, z]| u32::from((x * 7 + y * 5 + z * 3 + x * y + y * z) % 5 < 3))
}

pub fn cube() -> Dense {
    Dense::new([8, 8, 8], |_| 1)
}

pub fn cavity() -> Dense {
    Dense::new([10, 8, 9], |v| u32::from((0..3).any(|a| v[a] == 0 || v[a] == [9, 7, 8][a]) || v == [3, 3, 3]))
}

pub fn outside() -> Camera {
    camera(DVec3::new(24.0, -16.0, 20.0), DVec3::splat(5.0), 0.35)
}

pub fn inside() -> Camera {
    camera(DVec3::new(7.3, 5.2, 5.1), DVec3::new(1.0, 1.5, 2.0), 1.2)
}

/// Radiance 1 from everywhere, albedo 1, no bound on bounces: the result is 1 for every shape.
pub fn white_world(sky: Sky, russian_roulette: bool) -> Furnace {
    let settings = Settings { bounces: 1_000_000, russian_roulette, ..Settings::default() };
    let name = format!("white world, {}, roulette {russian_roulette}", of_sky(&sky));
    let spp = samples_for(&sky, 16, 400);
    Furnace::new(&name, sponge(), outside(), lambert(1.0, 0.0), sky, settings).exactly(1.0, spp)
}

/// A convex body of albedo a under radiance 1 has radiance a.
pub fn convex_body(sky: Sky, albedo: f64) -> Furnace {
    let name = format!("convex body of {albedo}, {}", of_sky(&sky));
    let spp = samples_for(&sky, 16, 256);
    Furnace::new(&name, cube(), outside(), lambert(albedo, 0.0), sky, Settings::default())
        .exactly(albedo, spp)
}

/// Walls of emission 1 and albedo a around the camera. With `bounces` B as in Cycles, B + 1 vertices scatter and the last ray still
/// collects emission: N = B + 1 scatterings make 1 + a + … + aᴺ = (1 − aᴺ⁺¹) / (1 − a).
pub fn glowing_cavity(bounces: u32, albedo: f64, russian_roulette: bool) -> Furnace {
    let exact = (1.0 - albedo.powi(bounces as i32 + 2)) / (1.0 - albedo);
    let settings = Settings { bounces, russian_roulette, ..Settings::default() };
    let name = format!("cavity of {albedo}, {bounces} bounces, roulette {russian_roulette}");
    // Without roulette every path has the same value. With it, noise grows with the number of bounces that it may end.
    let spp = if russian_roulette && bounces >= 2 { if bounces > 8 { 720 } else { 256 } } else { 16 };
    // No light comes in from outside: the sky's 7 would be noticed.
    Furnace::new(&name, cavity(), inside(), lambert(albedo, 1.0), even_sky(7.0), settings).exactly(exact, spp)
}

/// Under a uniform sky every path has the same value; where lights are sampled too, samples differ.
fn samples_for(sky: &Sky, even: u32, painted: u32) -> u32 {
    match sky {
        Sky::Constant(_) => even,
        Sky::Image(_) => painted,
    }
}

fn of_sky(sky: &Sky) -> &'static str {
    match sky {
        Sky::Constant(_) => "even sky",
        Sky::Image(_) => "painted sky",
    }
}

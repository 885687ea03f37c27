//! Compares sample by sample. Both sides use the same random numbers, so they follow the same path.
//!
//! Geometry is exact on both sides. The last bits of floats differ, and with them the directions in which paths continue.
//!
//! ```text
//! unparted   the same faces, the same choices: radiance differs by rounding alone
//! parted     a ray passes an edge on the other side, or a random choice falls the other way: from there on it is another, equally valid path
//! ```
//! How many paths may part is computed beforehand, from the CPU's own rays ([`Flown::parting`]).

use std::sync::Mutex;

use glam::{DVec3, Vec3};
use pumice_cpu::path::radiance;
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::sampler::PixelSampler;
use pumice_transport::{FilterTable, Hit, PathOrigin, RayInWorld, Surface, Tracer};

use crate::scenes::Case;

/// Error of a diffuse direction: sine and cosine of a few 2⁻²⁴ and a root (the tests of directions tolerate 2⁻²¹ and find less).
const DIRECTION: f64 = 1.0 / 2_097_152.0;

/// Probability that one of a vertex's choices (which lobe, continue or not, above the surface or not) falls the other way. The numbers that
/// are compared are correct to 2⁻¹⁷ where nothing cancels; there are fewer than eight choices.
const CHOICES: f64 = 8.0 / 131_072.0;

/// Rays of a path in flight.
#[derive(Default)]
struct Flown {
    /// Summed length of the rays that met something, and the number of rays that met nothing or were shadow rays.
    path: f64,
    parting: f64,
    rays: u32,
}

/// A tracer that records the rays that pass through it.
struct Listening<'a, T> {
    tracer: &'a T,
    voxel: f64,
    reach: f64,
    sharpness: f64,
    /// Error of the origin of a camera ray.
    lens: f64,
    flown: Mutex<Flown>,
}

impl<T> Listening<'_, T> {
    /// A ray from a vertex travels `length`. Its start may be off by the error of the rays before it, and its end additionally by its own
    /// direction's error. Surfaces have edges of voxels, at most two families of them, one voxel apart: a point has an edge within ε with a
    /// probability of 4ε/voxel. Slanting surfaces are hit farther off, by 1/cos, on average 2 for what scatters diffusely.
    fn fly(&self, length: f64, goes_on: bool) {
        let Ok(mut flown) = self.flown.lock() else { return };
        flown.rays += 1;
        // A mirror image has the error of its ray, so errors of directions add up from vertex to vertex.
        let off = flown.path + DIRECTION * self.sharpness * f64::from(flown.rays) * length;
        flown.parting += 8.0 * off / self.voxel + CHOICES;
        if goes_on {
            flown.path = off;
        }
    }
}

impl<T> Listening<'_, T> {
    /// The same for a camera ray; see [`Listening::fly`].
    fn swerve(&self) {
        let Ok(mut flown) = self.flown.lock() else { return };
        flown.path = self.lens;
        flown.parting += 8.0 * self.lens / self.voxel;
    }
}

impl<T: Tracer> Tracer for Listening<'_, T> {
    fn first_hit(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit> {
        let hit = self.tracer.first_hit(ray, from, t_max);
        // Camera rays are the same on both sides, bit for bit, except for points on the lens aperture.
        if from != PathOrigin::Free {
            let length = hit.map_or(self.reach, |h| h.t * ray.direction.length());
            self.fly(length, true);
        } else if self.lens > 0.0 {
            self.swerve();
        }
        hit
    }

    fn occluded(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        self.fly(self.reach.min(t_max), false);
        self.tracer.occluded(ray, from, t_max)
    }

    fn contact_distance(&self) -> f64 {
        self.tracer.contact_distance()
    }

    fn first_volume_besides(&self, ray: &RayInWorld, t_max: f64, instance: u32) -> Option<Hit> {
        self.tracer.first_volume_besides(ray, t_max, instance)
    }

    fn are_one(&self, a: &Surface, b: &Surface) -> bool {
        self.tracer.are_one(a, b)
    }

    fn box_origin(&self, face: &Surface) -> Option<[u32; 3]> {
        self.tracer.box_origin(face)
    }

    fn smooth_normal(&self, surface: &Surface, point: DVec3) -> Option<DVec3> {
        self.tracer.smooth_normal(surface, point)
    }

    fn is_smooth(&self) -> bool {
        self.tracer.is_smooth()
    }
}

/// The CPU's result for a sample.
pub(crate) struct Found {
    pub(crate) radiance: Vec3,
    /// Probability that another machine's path parts from this one.
    pub(crate) parting: f64,
    /// Number of rays after the camera's.
    pub(crate) rays: u32,
}

/// Samples of every pixel, numbered from 0 to below `spp`.
pub(crate) fn asked(case: &Case, spp: u32) -> Vec<([u32; 2], u32)> {
    let (width, height) = (case.film.width, case.film.height);
    let pixels = (0..width * height).map(move |i| [i % width, i / width]);
    pixels.flat_map(|p| (0..spp).map(move |number| (p, number))).collect()
}

/// The CPU's results.
pub(crate) fn found(case: &Case, asked: &[([u32; 2], u32)]) -> Vec<Found> {
    let tracer = case.tracer();
    let (rays, filter) = (CameraRays::new(&case.camera, &case.film), FilterTable::new(&case.film.filter));
    let seed = case.around.settings.seed;
    let listening = Listening {
        tracer: &tracer,
        voxel: case.voxel,
        reach: case.reach,
        sharpness: case.sharpness,
        // Correct to 2⁻²¹ of the radius at the aperture (the test of camera rays). Behind the plane in focus the error is mirrored and may
        // be as large again.
        lens: rays.lens.map_or(0.0, |l| l.radius * 2f64.powi(-20)),
        flown: Mutex::default(),
    };
    let one = |&([x, y], number): &([u32; 2], u32)| {
        let sampler = PixelSampler::new(seed, [x, y], number);
        let [u, v] = sampler.film();
        let px = f64::from(x) + 0.5 + f64::from(filter.sample(u));
        let py = f64::from(y) + 0.5 + f64::from(filter.sample(v));
        let (ray, t_max) = match &rays.lens {
            None => rays.ray(px, py),
            Some(lens) => rays.lens_ray(lens, px, py, sampler.lens()),
        };
        let down = (py / f64::from(case.film.height)) as f32;
        *listening.flown.lock().expect("nobody panics with it") = Flown::default();
        let radiance = radiance(&listening, &case.around, &sampler, ray, t_max, down);
        let flown = listening.flown.lock().expect("nobody panics with it");
        // Each ray looks up the sky at most once, and each light sample once more.
        let parting = flown.parting + case.borders * f64::from(2 * flown.rays);
        Found { radiance, parting, rays: flown.rays }
    };
    asked.iter().map(one).collect()
}

/// The result of comparing two machines' samples.
pub(crate) struct Verdict {
    pub(crate) samples: usize,
    /// Number of paths that differ by more than rounding explains, and how many of these chance explains.
    pub(crate) parted: usize,
    pub(crate) most_parted: f64,
    /// Largest relative difference of the other paths.
    pub(crate) largest: f32,
    /// Mean difference of all samples relative to the mean, by colour, and how much of it chance and rounding explain.
    pub(crate) shift: DVec3,
    pub(crate) most_shift: DVec3,
}

impl Verdict {
    /// Compares a device's samples with the CPU's.
    pub(crate) fn of(case: &Case, found: &[Found], got: &[Vec3]) -> Self {
        assert_eq!(found.len(), got.len());
        let (mut parted, mut expected, mut largest) = (0, 0.0, 0f32);
        let (mut sum, mut squares, mut total) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for (f, g) in found.iter().zip(got) {
            assert!(g.is_finite(), "{}: {g}", case.name);
            let scale = f.radiance.max(*g).max_element().max(1e-6);
            let relative = (f.radiance - *g).abs().max_element() / scale;
            if relative > tolerance(case, f.rays) {
                parted += 1;
            } else {
                largest = largest.max(relative);
            }
            expected += f.parting.min(1.0);
            let d = (*g - f.radiance).as_dvec3();
            (sum, squares, total) = (sum + d, squares + d * d, total + f.radiance.as_dvec3());
        }
        // A parted path is another sample of the same light: such differences have a mean of 0 and the spread that they show. The others
        // differ by rounding, which may have a mean: 2⁻¹⁷, as in single functions.
        let mean = (total / found.len() as f64).max(DVec3::splat(1e-9));
        let n = found.len() as f64;
        let spread = DVec3::from(squares.to_array().map(f64::sqrt)) / n;
        Self {
            samples: found.len(),
            parted,
            // Poisson distribution, five standard deviations.
            most_parted: expected + 5.0 * expected.sqrt() + 3.0,
            largest,
            shift: (sum / n / mean).abs(),
            most_shift: 5.0 * spread / mean + 2f64.powi(-17),
        }
    }

    /// The largest of the three colours, which are about equal.
    fn largest_shift(&self) -> [f64; 2] {
        [self.shift, self.most_shift].map(|s| s.max_element())
    }

    /// The fault that the comparison shows, if any.
    pub(crate) fn fault(&self) -> Option<String> {
        if self.parted as f64 > self.most_parted {
            return Some(format!("more paths part than floats explain: {self}"));
        }
        (0..3).any(|c| self.shift[c] > self.most_shift[c]).then(|| format!("the mean differs: {self}"))
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { samples, parted, most_parted, largest, .. } = self;
        let [shift, most_shift] = self.largest_shift();
        write!(f, "{parted} of {samples} samples parted (at most {most_parted:.1}), ")?;
        write!(f, "others differ by {largest:.1e}, the mean by {shift:.1e} (at most {most_shift:.1e})")
    }
}

/// Relative difference of paths that do not part. Each vertex multiplies by a weight that is correct to 2⁻¹⁷ (the tests of scattering), on
/// sharp lobes to 1/α times that, and the MIS weights are ratios of densities as exact as that. It counts twice a vertex, for light and for
/// the path.
pub(crate) fn tolerance(case: &Case, rays: u32) -> f32 {
    (2 + rays) as f32 * 2f32.powi(-17) * 2.0 * case.sharpness as f32
}

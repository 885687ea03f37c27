//! An oracle of ray traversal: it marches rays through dense arrays in exact integer arithmetic, straight from the definitions. It shares no
//! code with the traversal.
//!
//! Origins and directions are multiples of 2⁻⁴⁶ in index space (the generators ensure it), so every plane distance is a fraction of
//! integers and every comparison is exact in 128 bits: with |o| ≤ 2³⁰, products are at most 2¹²⁴.
#![forbid(unsafe_code)]

pub mod rays;
pub mod tally;
pub mod volumes;

use glam::{DAffine3, DVec3};
use pumice_transport::{Hit, PathOrigin, RayInWorld};

/// Fraction bits of origins and directions.
pub const BITS: u32 = 46;

/// Labels in a plain array: 0 for empty voxels, else the dense label + 1.
#[derive(Clone, Debug)]
pub struct Dense {
    /// Voxels along each axis.
    pub dims: [u32; 3],
    /// One value per voxel, x varying fastest.
    pub labels: Vec<u32>,
}

impl Dense {
    /// The value of a voxel; 0 outside the volume.
    pub fn at(&self, v: [i64; 3]) -> u32 {
        if (0..3).any(|a| v[a] < 0 || v[a] >= i64::from(self.dims[a])) {
            return 0;
        }
        let [x, y, z] = v.map(|c| c as usize);
        self.labels[x + self.dims[0] as usize * (y + self.dims[1] as usize * z)]
    }
}

/// A ray in index space, in units of 2⁻⁴⁶.
#[derive(Clone, Copy, Debug)]
pub struct ExactRay {
    /// Origin, in units of 2⁻⁴⁶ voxels.
    pub o: [i128; 3],
    /// Direction, in units of 2⁻⁴⁶ voxels.
    pub d: [i128; 3],
}

/// A distance along a ray: numerator over denominator (above 0).
pub type Fraction = (i128, i128);

fn less(a: Fraction, b: Fraction) -> bool {
    a.0 * b.1 < b.0 * a.1
}

fn minus(a: Fraction, b: Fraction) -> f64 {
    (a.0 * b.1 - b.0 * a.1) as f64 / (a.1 as f64 * b.1 as f64)
}

/// A fraction as a floating-point number.
pub fn value(t: Fraction) -> f64 {
    t.0 as f64 / t.1 as f64
}

impl ExactRay {
    /// A ray with this origin and direction in index space.
    ///
    /// # Panics
    /// When a component is not a multiple of 2⁻⁴⁶, which is a fault of the generator.
    pub fn new(o: [f64; 3], d: [f64; 3]) -> Self {
        let exact = |x: f64| {
            let scaled = x * (BITS as f64).exp2();
            assert!(scaled.fract() == 0.0 && scaled.abs() < 2f64.powi(77), "{x} is not on the grid");
            scaled as i128
        };
        Self { o: o.map(exact), d: d.map(exact) }
    }

    /// The t at which the ray meets plane `p` of axis `a`. The direction must not be 0 along `a`.
    pub fn plane(&self, a: usize, p: i64) -> Fraction {
        let n = (i128::from(p) << BITS) - self.o[a];
        if self.d[a] < 0 { (-n, -self.d[a]) } else { (n, self.d[a]) }
    }

    /// Length of the direction in voxels.
    pub fn length(&self) -> f64 {
        self.d.iter().map(|&d| (d as f64 / (BITS as f64).exp2()).powi(2)).sum::<f64>().sqrt()
    }

    /// Calls `visit(voxel, enter, leave)` in order for each voxel of `0..dims` in which the ray has a chord above 0 at t > 0, until `visit`
    /// returns false. Voxels are half-open, so a ray that runs in a plane is in the voxel above the plane.
    pub fn march(&self, dims: [u32; 3], mut visit: impl FnMut([i64; 3], Fraction, Fraction) -> bool) {
        // Find where the ray enters the volume.
        let mut t: Fraction = (0, 1);
        for a in (0..3).filter(|&a| self.d[a] != 0) {
            let near = self.plane(a, if self.d[a] < 0 { i64::from(dims[a]) } else { 0 });
            if less(t, near) {
                t = near;
            }
        }
        // The voxel just after t is the floor of o + t·d, or one less where the ray moves down from a plane.
        let mut v = [0, 1, 2].map(|a| {
            let (n, d) = (self.o[a] * t.1 + t.0 * self.d[a], t.1 << BITS);
            (if self.d[a] < 0 { -(-n).div_euclid(d) - 1 } else { n.div_euclid(d) }) as i64
        });
        while (0..3).all(|a| v[a] >= 0 && v[a] < i64::from(dims[a])) {
            let moving = || (0..3).filter(|&a| self.d[a] != 0);
            let next = |a: usize| self.plane(a, v[a] + i64::from(self.d[a] > 0));
            let Some(leave) = moving().map(next).reduce(|x, y| if less(y, x) { y } else { x }) else {
                return;
            };
            if !visit(v, t, leave) {
                return;
            }
            let tied: Vec<usize> = moving().filter(|&a| !less(leave, next(a))).collect();
            for a in tied {
                v[a] += self.d[a].signum() as i64;
            }
            t = leave;
        }
    }
}

/// The ray in the world whose image in index space has exactly this origin and direction, provided that the products are exact (the
/// generators ensure it).
pub fn in_world(o: [f64; 3], d: [f64; 3], world_from_index: &DAffine3) -> RayInWorld {
    RayInWorld {
        origin: world_from_index.transform_point3(DVec3::from(o)),
        direction: world_from_index.transform_vector3(DVec3::from(d)),
    }
}

/// Longest chord in voxels that a traversal may skip.
pub const REAL_CHORD: f64 = 1e-3;

/// The oracle's verdict on one hit or miss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Exactly the right voxel and face, or a right miss.
    Exact,
    /// The ray only touches the surface, or chords up to [`REAL_CHORD`] were skipped; the value is the longest of them.
    Touch(f64),
    /// Wrong, with the reason.
    Wrong(&'static str),
}

/// Checks a first hit, or a miss (`pumice_cpu::traverse` defines first hits).
pub fn judge(volume: &Dense, ray: &ExactRay, hit: Option<&Hit>) -> Verdict {
    let length = ray.length();
    // A hit of a ray that starts inside a voxel must say so, unless the ray's chord there is a touch.
    let mut started = (0, 0.0);
    ray.march(volume.dims, |v, enter, leave| {
        if enter.0 == 0 {
            started = (volume.at(v), minus(leave, enter) * length);
        }
        false
    });
    let starts_inside = started.0 != 0 && started.1 > REAL_CHORD;
    let Some(hit) = hit else {
        let mut worst = 0.0f64;
        ray.march(volume.dims, |v, enter, leave| {
            if volume.at(v) != 0 {
                worst = worst.max(minus(leave, enter) * length);
            }
            worst <= REAL_CHORD
        });
        return match worst {
            0.0 => Verdict::Exact,
            w if w <= REAL_CHORD => Verdict::Touch(w),
            _ => Verdict::Wrong("a voxel was missed"),
        };
    };
    // 1. The surface must be a face of a voxel of its label, must face the ray, and must be at the reported t.
    let s = &hit.surface;
    let a = usize::from(s.axis);
    let voxel = s.voxel.map(i64::from);
    if volume.at(voxel) != s.label + 1 {
        return Verdict::Wrong("the voxel does not have the label");
    }
    if i64::from(s.plane) != voxel[a] + i64::from(s.positive) {
        return Verdict::Wrong("the plane is not the voxel's face");
    }
    if ray.d[a] == 0 || (ray.d[a] < 0) != (s.positive != hit.from_inside) {
        return Verdict::Wrong("the face is turned away from the ray");
    }
    let t_hit = ray.plane(a, i64::from(s.plane));
    // Allows for four roundings (matrix, subtraction, division, scale), of numbers that may cancel in the subtraction.
    let origin_size = ray.o.iter().map(|&o| o.abs() as f64).fold(0.0, f64::max) / (BITS as f64).exp2();
    let slope = (ray.d[a].abs() as f64 / (BITS as f64).exp2()).min(1.0);
    if (hit.t - value(t_hit)).abs() > 16.0 * f64::EPSILON * (value(t_hit).abs() + (origin_size + 1.0) / slope)
    {
        return Verdict::Wrong("t is not the plane's");
    }
    if t_hit.0 < 0 {
        return Verdict::Wrong("the surface lies behind the start");
    }
    // 2. The ray must meet the face, or miss it by no more than a touch.
    for b in (0..3).filter(|&b| b != a) {
        let at = value((ray.o[b] * t_hit.1 + t_hit.0 * ray.d[b], t_hit.1 << BITS));
        let outside = (voxel[b] as f64 - at).max(at - voxel[b] as f64 - 1.0);
        if outside > REAL_CHORD / 10.0 {
            return Verdict::Wrong("the ray does not meet the face");
        }
    }
    if starts_inside != hit.from_inside && started.1 > REAL_CHORD {
        return Verdict::Wrong("inside and outside are confused");
    }
    // 3. No other surface may be before it.
    let mut worst = 0.0f64;
    let mut reached = false;
    ray.march(volume.dims, |v, enter, leave| {
        if !less(enter, t_hit) {
            // From outside, the voxel behind the face must be the hit; from inside, it must have another label.
            reached = enter.0 * t_hit.1 == t_hit.0 * enter.1
                && (hit.from_inside && volume.at(v) != s.label + 1 || !hit.from_inside && v == voxel);
            return false;
        }
        let end = if less(leave, t_hit) { leave } else { t_hit };
        let here = volume.at(v);
        if (!hit.from_inside && here != 0) || (hit.from_inside && here != s.label + 1) {
            worst = worst.max(minus(end, enter) * length);
        }
        if less(t_hit, leave) || less(leave, t_hit) {
            return worst <= REAL_CHORD;
        }
        // The ray leaves the volume, or continues behind the face.
        if hit.from_inside && v == voxel {
            reached = true;
        }
        true
    });
    match worst {
        0.0 if reached => Verdict::Exact,
        w if w <= REAL_CHORD => Verdict::Touch(w),
        _ => Verdict::Wrong("another surface lies before it"),
    }
}

/// Describes a ray and its hit, for messages.
pub fn describe(o: [f64; 3], d: [f64; 3], from: PathOrigin, hit: Option<&Hit>) -> String {
    format!("origin {o:?} direction {d:?} from {from:?}: {hit:?}")
}

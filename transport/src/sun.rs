//! A sun, prepared for sampling: a disk at infinity, uniform over a cone of directions, or a single direction where its angle is 0.
//!
//! Its strength is the irradiance on a surface that faces it, so the radiance within the cone is strength / (π sin²(angle/2)), as in
//! Cycles; the density of a sampled direction is 1 / (2π (1 − cos(angle/2))).

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use pumice_scene::Sun;

use crate::Receiver;
use crate::lamp::HORIZON;

/// A sun, prepared for sampling.
#[derive(Clone, Copy, Debug)]
pub struct ReadySun {
    /// Unit vector towards the middle of the disk.
    pub towards: DVec3,
    /// Unit vector perpendicular to `towards`.
    pub tangent: DVec3,
    /// Unit vector perpendicular to both.
    pub bitangent: DVec3,
    /// Radiance within the cone, or irradiance where the sun is a single direction.
    pub radiance: Vec3,
    /// 1 − cos of half the angle; 0 where the sun is a single direction.
    pub one_minus_cos_half_angle: f64,
}

/// Two unit vectors that complete a unit normal to a right-handed frame: Duff et al. 2017, JCGT 6(1), listing 3.
#[inline]
pub fn frame_around(n: DVec3) -> (DVec3, DVec3) {
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y))
}

impl ReadySun {
    /// Prepares a sun.
    pub fn new(sun: &Sun) -> Self {
        let towards = -DVec3::from_array(sun.direction).normalize();
        let (tangent, bitangent) = frame_around(towards);
        let half = (0.5 * sun.angle_rad).sin();
        // 1 − cos h = 2 sin²(h/2) avoids cancellation at the real sun's half degree.
        let one_minus_cos_half_angle = 2.0 * (0.25 * sun.angle_rad).sin().powi(2);
        let factor = if sun.angle_rad > 0.0 { 1.0 / (PI * half * half) } else { 1.0 };
        let radiance = Vec3::from_array(sun.color) * (f64::from(sun.strength) * factor) as f32;
        Self { towards, tangent, bitangent, radiance, one_minus_cos_half_angle }
    }

    /// Whether the sun is a single direction, which no scattered ray can meet.
    #[inline]
    pub fn is_delta(&self) -> bool {
        self.one_minus_cos_half_angle == 0.0
    }

    /// Largest irradiance of a surface in this light, for choosing among lights.
    pub fn irradiance(&self) -> f32 {
        let l = self.radiance.dot(Vec3::new(0.2126, 0.7152, 0.0722));
        if self.is_delta() {
            l
        } else {
            let cos = 1.0 - self.one_minus_cos_half_angle;
            l * (PI * (1.0 - cos * cos)) as f32
        }
    }

    /// About the largest irradiance that a receiver can have from the sun, for choosing among lights; 0 only where the sun is below its
    /// horizon.
    #[inline]
    pub fn irradiance_at(&self, from: &Receiver) -> f32 {
        let cos = self.towards.as_vec3().dot(from.normal);
        let cos = if from.both_sides { cos.abs() } else { cos };
        self.irradiance() * (cos + self.sin_half_angle() + HORIZON).clamp(0.0, 1.0)
    }

    /// Sine of half the angle; 1 where the sun fills more than half of the sky.
    pub fn sin_half_angle(&self) -> f32 {
        let w = self.one_minus_cos_half_angle;
        if w > 1.0 { 1.0 } else { (w * (2.0 - w)).sqrt() as f32 }
    }

    /// Samples a direction towards the sun; returns its radiance and its density per solid angle (`None` for a single direction, whose
    /// radiance is irradiance).
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> (DVec3, Vec3, Option<f32>) {
        if self.is_delta() {
            return (self.towards, self.radiance, None);
        }
        let w = f64::from(u[0]) * self.one_minus_cos_half_angle;
        let sin = (w * (2.0 - w)).max(0.0).sqrt();
        let (s, c) = (2.0 * PI * f64::from(u[1])).sin_cos();
        let direction = self.tangent * (sin * c) + self.bitangent * (sin * s) + self.towards * (1.0 - w);
        (direction, self.radiance, Some(self.cone_pdf()))
    }

    /// Radiance from a unit direction, and the density with which [`ReadySun::sample`] samples it; `None` outside the cone.
    #[inline]
    pub fn eval(&self, direction: DVec3) -> Option<(Vec3, f32)> {
        // |d − s|² / 2 = 1 − cos for unit vectors, accurate at small angles too.
        let one_minus_cos = 0.5 * (direction - self.towards).length_squared();
        (one_minus_cos < self.one_minus_cos_half_angle).then(|| (self.radiance, self.cone_pdf()))
    }

    /// Density of [`ReadySun::sample`] within the cone.
    #[inline]
    pub fn cone_pdf(&self) -> f32 {
        (1.0 / (2.0 * PI * self.one_minus_cos_half_angle)) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sun(angle_rad: f64) -> ReadySun {
        ReadySun::new(&Sun {
            direction: [0.3, -0.5, -2.0],
            strength: 2.5,
            color: [1.0, 0.5, 0.25],
            angle_rad,
        })
    }

    #[test]
    fn irradiance_is_the_strength() {
        for angle in [1e-4, 0.009, 0.5, 2.0, PI] {
            let sun = sun(angle);
            let (mut e, n) = (0.0, 400);
            for i in 0..n {
                let (d, l, pdf) = sun.sample([(i as f32 + 0.5) / n as f32, 0.3]);
                let (again, pdf_again) = sun.eval(d).expect("a sampled direction is in the cone");
                assert_eq!((l, pdf.expect("a disk")), (again, pdf_again));
                e += f64::from(l.x / pdf.expect("a disk")) * d.dot(sun.towards);
            }
            // The integrand is linear in u: the midpoint rule is exact except for f32 rounding of u, radiance and density.
            assert!((e / f64::from(n) - 2.5).abs() < 2e-5, "angle {angle}: {e}");
        }
        assert!(sun(0.5).eval(DVec3::X).is_none() && sun(0.0).sample([0.5; 2]).2.is_none());
    }
}

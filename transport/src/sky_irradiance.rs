//! About the irradiance that a sky gives to a receiver by its normal, for choosing among lights.
//!
//! A sky that is nearly all in one place lights surfaces that face it, and the others not at all. Irradiance is smooth in the normal, so
//! moments of the light up to the second tell it to a tenth of the brightest (Ramamoorthi and Hanrahan 2001, *An Efficient Representation
//! for Irradiance Environment Maps*):
//!
//! ```text
//! E(n) ≈ ∫ L(ω) (1/4 + (n·ω)/2 + 5/32 (3 (n·ω)² − 1)) dω
//! ```

use glam::{DVec3, Vec3};

use crate::Receiver;

/// Least irradiance by which a sky is chosen, as a share of the mean over all normals: the sum above may be 0 or less where there is light.
const LEAST_OF_MEAN: f32 = 0.1;

/// The moments of a sky's light, weighted so that their sum with powers of the normal is the irradiance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SkyIrradiance {
    /// Mean over all normals; 0 where the sky is not sampled.
    pub mean: f32,
    /// What no component of the normal changes.
    pub constant: f32,
    /// Factors of the normal's components.
    pub linear: Vec3,
    /// Factors of their products: xx, yy, zz, xy, yz, zx.
    pub squared: [f32; 6],
}

impl SkyIrradiance {
    /// A sky of this mean irradiance whose light comes from unit directions with these weights.
    pub(crate) fn new(mean: f32, light: impl Iterator<Item = (DVec3, f64)>) -> Self {
        let (mut total, mut first, mut second) = (0.0, DVec3::ZERO, [0.0; 6]);
        for (d, weight) in light {
            total += weight;
            first += d * weight;
            let products = [d.x * d.x, d.y * d.y, d.z * d.z, d.x * d.y, d.y * d.z, d.z * d.x];
            for (sum, product) in second.iter_mut().zip(products) {
                *sum += product * weight;
            }
        }
        if !(mean > 0.0 && total > 0.0) {
            return Self::default();
        }
        // The mean is a fourth of all light.
        let light = 4.0 * f64::from(mean);
        let each = light / total;
        let [diagonal, mixed] = [15.0 / 32.0 * each, 15.0 / 16.0 * each];
        let factors = [diagonal, diagonal, diagonal, mixed, mixed, mixed];
        let mut squared = [0.0; 6];
        for ((to, sum), factor) in squared.iter_mut().zip(second).zip(factors) {
            *to = (sum * factor) as f32;
        }
        Self {
            mean,
            constant: (3.0 / 32.0 * light) as f32,
            linear: (first * (0.5 * each)).as_vec3(),
            squared,
        }
    }

    /// About the irradiance at a receiver, on both sides together where both count; 0 only where the sky is not sampled.
    #[inline]
    pub fn irradiance_at(&self, from: &Receiver) -> f32 {
        let n = from.normal;
        let [xx, yy, zz, xy, yz, zx] = self.squared;
        let even = self.constant
            + (xx * n.x * n.x + yy * n.y * n.y + zz * n.z * n.z)
            + (xy * n.x * n.y + yz * n.y * n.z + zx * n.z * n.x);
        let irradiance = if from.both_sides { 2.0 * even } else { even + self.linear.dot(n) };
        irradiance.max(LEAST_OF_MEAN * self.mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light from a few places against the sum of cosines, for normals all around.
    #[test]
    fn irradiance_is_that_of_the_light_to_a_tenth() {
        let unit = |x: f64, y: f64, z: f64| DVec3::new(x, y, z).normalize();
        let one = vec![(unit(0.3, -0.5, 0.8), 1.0)];
        let two = vec![(unit(1.0, 0.2, 0.1), 3.0), (unit(-0.4, 0.6, -0.7), 1.0)];
        let even: Vec<(DVec3, f64)> = (0..2000)
            .map(|i| {
                let (z, turn) = (1.0 - (f64::from(i) + 0.5) / 1000.0, 2.399_963 * f64::from(i));
                (DVec3::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z), 1.0)
            })
            .collect();
        for (light, tolerance) in [(one, 0.1), (two, 0.1), (even.clone(), 2e-3)] {
            let total: f64 = light.iter().map(|l| l.1).sum();
            let sky = SkyIrradiance::new((0.25 * total) as f32, light.iter().copied());
            for &(normal, _) in &even {
                let from = |both_sides| Receiver { point: DVec3::ZERO, normal: normal.as_vec3(), both_sides };
                let cosines = |n: DVec3| light.iter().map(|(d, w)| w * d.dot(n).max(0.0)).sum::<f64>();
                let (front, back) = (cosines(normal), cosines(-normal));
                let off = |got: f32, expected: f64| (f64::from(got) - expected).abs() / total;
                assert!(off(sky.irradiance_at(&from(false)), front) < tolerance, "{normal}: {front}");
                assert!(
                    off(sky.irradiance_at(&from(true)), front + back) < 2.0 * tolerance,
                    "{normal}: {front} {back}"
                );
                assert!(sky.irradiance_at(&from(false)) > 0.0);
            }
        }
        let nothing = SkyIrradiance::new(0.0, std::iter::once((DVec3::X, 1.0)));
        assert_eq!(
            nothing.irradiance_at(&Receiver { point: DVec3::ZERO, normal: Vec3::X, both_sides: false }),
            0.0
        );
    }
}

//! Balls: point and spot lamps.
//!
//! From outside, a ball of radius r at distance d fills a cone of sin θ = r/d. Directions are uniform in it, so the density is 1 / (2π (1 −
//! cos θ)) (Shirley, Wang and Zimmerman 1996, §3.2.1). Where a spot's own cone is narrower, directions are sampled from that cone, and
//! those that miss the ball carry no light. From inside, the ball surrounds the receiver and emits inwards: directions follow the cosine,
//! and the spot's cone does not apply (as in Cycles).

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use super::{HORIZON, LEAST_SQUARED_TO_LAMP, LampKind, LampSample, ReadyLamp, Receiver};

/// Below this sin²θ a ball is treated as a point: directions in the cone differ by less than the rounding of an f32 direction.
pub(super) const LEAST_SIN_SQUARED: f32 = 1e-13;

/// Part of the largest transmission of a spot's cone by which it is chosen at least: where the middle is dark, a fifth of a ball's light is
/// about the mean.
const PART_OF_MOST: f32 = 0.2;

/// Two unit vectors that complete a unit normal to a right-handed frame: Duff et al. 2017, JCGT 6(1), listing 3.
#[inline]
pub(super) fn frame_around_f32(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// The direction whose cosine with `axis` is 1 − `w`, rotated about it by the fraction `turn` of a full turn.
#[inline]
fn around(axis: Vec3, w: f32, turn: f32) -> Vec3 {
    let (tangent, bitangent) = frame_around_f32(axis);
    let sin = (w * (2.0 - w)).max(0.0).sqrt();
    let (s, c) = (2.0 * PI * turn).sin_cos();
    tangent * (sin * c) + bitangent * (sin * s) + axis * (1.0 - w)
}

/// 3x² − 2x³ between 0 and 1.
#[inline]
fn smoothstep(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

impl ReadyLamp {
    /// Factor that a spot's cone transmits along a ray towards the lamp; 1 for other lamps.
    #[inline]
    pub(super) fn through_cone(&self, direction: Vec3) -> f32 {
        if self.kind != LampKind::Spot {
            return 1.0;
        }
        // |a − b|² / 2 = 1 − cos for unit vectors, accurate at small angles too.
        let one_minus_cos = 0.5 * (direction + self.axis).length_squared();
        smoothstep((self.one_minus_cos_half_angle - one_minus_cos) * self.inverse_blend)
    }

    /// About what a spot's cone transmits to a receiver, for choosing among lights; `way` goes from the receiver to the middle. It is the
    /// transmission from the middle, and at least a part of the largest from any point of the ball, or of the disk in its place.
    ///
    /// √(1 − cos x) is √2 sin(x/2). The directions of those points differ by an angle b from that of the middle, which is x off the axis, and
    /// sin(x/2) − sin(b/2) ≤ sin((x − b)/2), while √2 sin(b/2) ≤ sin b ≤ radius / distance.
    #[inline]
    pub(super) fn about_through_cone(&self, way: Vec3) -> f32 {
        let (squared, radius) = (way.length_squared(), self.half[0]);
        // Within the ball the cone does not count.
        if squared <= radius * radius {
            return 1.0;
        }
        let distance = squared.max(LEAST_SQUARED_TO_LAMP).sqrt();
        let apart = (0.5 * (way / distance + self.axis).length_squared()).sqrt();
        let least = (apart - radius / distance - HORIZON).max(0.0);
        let through =
            |apart: f32| smoothstep((self.one_minus_cos_half_angle - apart * apart) * self.inverse_blend);
        through(apart).max(PART_OF_MOST * through(least))
    }

    /// Whether directions are sampled from a spot's own cone, which is narrower than the cone that the ball fills (`one_minus_cos`).
    #[inline]
    fn by_own_cone(&self, one_minus_cos: f32) -> bool {
        self.kind == LampKind::Spot && self.one_minus_cos_half_angle < one_minus_cos
    }

    /// Samples a lamp that is so small that it is a single direction.
    #[inline]
    pub(super) fn sample_point(&self, to_middle: Vec3) -> Option<LampSample> {
        let (d2, r2) = (to_middle.length_squared(), self.half[0] * self.half[0]);
        let distance = d2.sqrt();
        let direction = to_middle / distance;
        // For a ball: radiance times its solid angle.
        let seen = if r2 == 0.0 { 1.0 / d2 } else { PI * (r2 / d2) };
        let radiance = self.radiance * (seen * self.through_cone(direction));
        let found = radiance.max_element() > 0.0 && radiance.is_finite();
        found.then_some(LampSample { direction, distance, radiance, pdf: 0.0 })
    }

    #[inline]
    pub(super) fn sample_ball(&self, to_middle: Vec3, from: &Receiver, u: [f32; 2]) -> Option<LampSample> {
        let (d2, r2) = (to_middle.length_squared(), self.half[0] * self.half[0]);
        let sin2 = r2 / d2;
        if sin2 < LEAST_SIN_SQUARED {
            return self.sample_point(to_middle);
        }
        if d2 <= r2 {
            return self.meet_ball(to_middle, from, within(from, u));
        }
        let distance = d2.sqrt();
        let towards = to_middle / distance;
        let one_minus_cos = sin2 / (1.0 + (1.0 - sin2).sqrt());
        if self.by_own_cone(one_minus_cos) {
            let direction = around(-self.axis, u[0] * self.one_minus_cos_half_angle, u[1]);
            return self.meet_ball(to_middle, from, direction);
        }
        let w = u[0] * one_minus_cos;
        let direction = around(towards, w, u[1]);
        let radiance = self.radiance * self.through_cone(direction);
        let across = w * (2.0 - w);
        (radiance.max_element() > 0.0).then(|| LampSample {
            direction,
            distance: distance * (1.0 - w) - (r2 - d2 * across).max(0.0).sqrt(),
            radiance,
            pdf: 1.0 / (2.0 * PI * one_minus_cos),
        })
    }

    #[inline]
    pub(super) fn meet_ball(&self, to_middle: Vec3, from: &Receiver, direction: Vec3) -> Option<LampSample> {
        let (d2, r2) = (to_middle.length_squared(), self.half[0] * self.half[0]);
        let along = to_middle.dot(direction);
        // The point of the ray nearest to the middle, then half of the chord.
        let chord2 = r2 - (to_middle - direction * along).length_squared();
        if d2 <= r2 {
            let distance = along + chord2.max(0.0).sqrt();
            let pdf = pdf_within(from, direction);
            let found = pdf > 0.0 && self.is_lit();
            return found.then_some(LampSample { direction, distance, radiance: self.radiance, pdf });
        }
        let sin2 = r2 / d2;
        if sin2 < LEAST_SIN_SQUARED || along <= 0.0 || chord2 <= 0.0 {
            return None;
        }
        let radiance = self.radiance * self.through_cone(direction);
        let one_minus_cos = sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt());
        let cone =
            if self.by_own_cone(one_minus_cos) { self.one_minus_cos_half_angle } else { one_minus_cos };
        (radiance.max_element() > 0.0).then(|| LampSample {
            direction,
            distance: along - chord2.sqrt(),
            radiance,
            pdf: 1.0 / (2.0 * PI * cone),
        })
    }
}

/// Samples a direction from inside a ball: by the cosine, or uniformly over the sphere where light from behind counts.
#[inline]
fn within(from: &Receiver, u: [f32; 2]) -> Vec3 {
    if from.both_sides {
        return around(from.normal, 2.0 * u[0], u[1]);
    }
    // cos = √(1 − u): 1 − cos without cancellation.
    around(from.normal, u[0] / (1.0 + (1.0 - u[0]).sqrt()), u[1])
}

/// Density of [`within`].
#[inline]
fn pdf_within(from: &Receiver, direction: Vec3) -> f32 {
    if from.both_sides {
        return 0.25 * FRAC_1_PI;
    }
    from.normal.dot(direction).max(0.0) * FRAC_1_PI
}

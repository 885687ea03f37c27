//! The directions in which emitters shine, as a cone of axes that each emitter shines around.
//!
//! ```text
//! axis        middle of the cone of axes
//! spread      angle from it to the axis that is farthest from it: 0 for a single emitter
//! reach       angle around its own axis within which each emitter shines: 90° for a flat one, half of a spot's angle
//! ```
//! (Conty Estevez and Kulla 2018, *Importance Sampling of Many Lights with Adaptive Tree Splitting*, §4.1 and §5.1, with cosines and sines in
//! place of angles as in Pharr, Jakob and Humphreys 2023, *Physically Based Rendering*, §12.6.3.)

use glam::{DQuat, Vec3};

/// Part of a cosine by which rounding may make an emitter look turned away, with room: sines of small angles are wrong by 4e-4.
const SLACK: f32 = 1e-3;

/// Directions in which the emitters of a node shine (see the module).
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Cone {
    /// Unit vector; 0 where they shine to all sides.
    pub axis: [f32; 3],
    /// Cosine of the spread; −1 where they shine to all sides.
    pub cos_spread: f32,
    /// Cosine of the reach.
    pub cos_reach: f32,
}

impl Cone {
    /// All directions.
    pub const ALL: Self = Self { axis: [0.0; 3], cos_spread: -1.0, cos_reach: -1.0 };

    /// The directions within an angle of an axis (unit vector), given by its cosine.
    pub fn around(axis: Vec3, cos_reach: f32) -> Self {
        if cos_reach <= -1.0 { Self::ALL } else { Self { axis: axis.to_array(), cos_spread: 1.0, cos_reach } }
    }

    /// Whether these are all directions.
    #[inline]
    pub fn is_all(&self) -> bool {
        self.cos_spread <= -1.0
    }

    /// A cone that holds both.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Self {
        if self.is_all() || other.is_all() {
            return Self::ALL;
        }
        let angle = |cos: f32| f64::from(cos.clamp(-1.0, 1.0)).acos();
        let (a, b) = (Vec3::from_array(self.axis).as_dvec3(), Vec3::from_array(other.axis).as_dvec3());
        let (of_a, of_b) = (angle(self.cos_spread), angle(other.cos_spread));
        let cos_reach = self.cos_reach.min(other.cos_reach);
        // (By both functions, since the cosine alone is coarse near 0.)
        let between = a.cross(b).length().atan2(a.dot(b));
        let spread = if between + of_b <= of_a {
            return Self { cos_reach, ..*self };
        } else if between + of_a <= of_b {
            return Self { cos_reach, ..*other };
        } else {
            0.5 * (of_a + between + of_b)
        };
        if spread + angle(cos_reach) >= std::f64::consts::PI {
            return Self::ALL;
        }
        let Some(around) = a.cross(b).try_normalize() else { return Self::ALL };
        let axis = (DQuat::from_axis_angle(around, spread - of_a) * a).normalize();
        Self { axis: axis.as_vec3().to_array(), cos_spread: spread.cos() as f32, cos_reach }
    }

    /// Bound of the cosine between an emitter's axis and the way from it to a receiver; 0 where none of the emitters can shine there. `way`
    /// goes from the receiver to the middle of a ball around all emitters with this squared radius.
    #[inline]
    pub fn towards(&self, way: Vec3, squared_radius: f32) -> f32 {
        let squared = way.dot(way);
        if self.is_all() || squared <= squared_radius {
            return 1.0;
        }
        let cos = (-way.dot(Vec3::from_array(self.axis)) / squared.sqrt()).clamp(-1.0, 1.0);
        // The angle to the axis in the middle, less the spread, less the angle of the ball as the receiver sees it.
        let from_middle = less((cos, sine(cos)), (self.cos_spread, sine(self.cos_spread)));
        let subtended = squared_radius / squared;
        let (cos, _) = less(from_middle, ((1.0 - subtended).sqrt(), subtended.sqrt()));
        if cos <= self.cos_reach - SLACK { 0.0 } else { cos.max(SLACK) }
    }
}

/// The sine of an angle from 0 to π, from its cosine.
#[inline]
fn sine(cos: f32) -> f32 {
    (1.0 - cos * cos).max(0.0).sqrt()
}

/// Cosine and sine of one angle less another, or of 0 where the other is larger; both from 0 to π.
#[inline]
fn less((cos_a, sin_a): (f32, f32), (cos_b, sin_b): (f32, f32)) -> (f32, f32) {
    if cos_a >= cos_b {
        return (1.0, 0.0);
    }
    (cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in [0, 1) in a fixed order.
    fn numbers() -> impl FnMut() -> f32 {
        let mut state = 7u32;
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1u32 << 24) as f32
        }
    }

    fn direction(mut number: impl FnMut() -> f32) -> Vec3 {
        let z = 2.0 * number() - 1.0;
        let (sin, cos) = (std::f32::consts::TAU * number()).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * cos, r * sin, z)
    }

    /// A joined cone holds the axes of both, and is no wider than it must be where one holds the other.
    #[test]
    fn a_joined_cone_holds_both() {
        let mut number = numbers();
        let mut wide = 0;
        for _ in 0..2000 {
            let near = Vec3::new(0.3, -0.5, 0.8).normalize();
            let all: Vec<Cone> = (0..5)
                .map(|_| {
                    let axis = near.lerp(direction(&mut number), number()).normalize();
                    Cone::around(axis, 0.9 * number())
                })
                .collect();
            let joined = all.iter().skip(1).fold(all[0], |sum, cone| sum.joined(cone));
            wide += usize::from(joined.is_all());
            if joined.is_all() {
                continue;
            }
            for cone in &all {
                let cos = Vec3::from_array(cone.axis).dot(Vec3::from_array(joined.axis));
                // Five unions of axes in f32, each off by some 1e-7, at slopes below 1.
                assert!(cos >= joined.cos_spread - 2e-6, "{cone:?} in {joined:?}: {cos}");
                assert!(joined.cos_reach <= cone.cos_reach);
            }
        }
        assert!((20..1500).contains(&wide), "{wide}");
        let one = Cone::around(Vec3::Z, 0.2);
        assert_eq!(one.joined(&one), one);
        assert!(one.joined(&Cone::ALL).is_all() && one.joined(&Cone::around(-Vec3::Z, 0.2)).is_all());
    }

    /// Emitters with any axis of the cone, anywhere in the ball: whatever shines to the receiver is bounded, and most of what does not is
    /// found.
    #[test]
    fn no_emitter_shines_where_the_bound_is_zero() {
        let mut number = numbers();
        let (mut dark, mut lit) = (0, 0);
        for _ in 0..3000 {
            let axis = direction(&mut number);
            let cone = Cone { axis: axis.to_array(), cos_spread: 1.0 - 0.6 * number(), cos_reach: number() };
            let radius = number() * number();
            let way = direction(&mut number) * (0.2 + 2.0 * number());
            let bound = cone.towards(way, radius * radius);
            dark += usize::from(bound == 0.0);
            for _ in 0..50 {
                let own = direction(&mut number);
                let place = direction(&mut number) * (radius * number());
                let to_receiver = -(way + place).normalize();
                let cos = own.dot(to_receiver);
                if own.dot(axis) < cone.cos_spread || cos < cone.cos_reach {
                    continue;
                }
                lit += 1;
                assert!(bound >= cos - 1e-3, "{cone:?} {way} {radius}: {cos} above {bound}");
            }
        }
        assert!(dark > 800 && lit > 2000, "{dark} {lit}");
    }
}

//! Area lamps: rectangles and ellipses that emit to one side.
//!
//! A rectangle is sampled by solid angle ([`SphericalRectangle`]), an ellipse by area, as in Cycles. **Spread** confines the light to a
//! cone about the lamp's normal, like a honeycomb grid in front of it: at angle x to the normal the grid transmits 1 − tan x / tan a, where
//! a is half the spread, and the rest is brightened so that the lamp's power stays the same. A receiver at height h sees only the part of
//! the lamp within h · tan a of its foot point, so only a rectangle around that part is sampled. A spread of 0 is a beam: parallel light as
//! wide as the lamp.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::{LampKind, LampSample, ReadyLamp, SphericalRectangle};

/// Below this solid angle a rectangle is sampled by area: the rounding error, about 4e-7, would exceed 1e-4 of the solid angle.
const LEAST_SOLID_ANGLE: f32 = 4e-3;

/// The part of an area lamp that is sampled for a receiver: a rectangle in its plane, or the whole ellipse.
struct SampledRegion {
    lo: Vec2,
    hi: Vec2,
    /// `hi − lo`, also where both round to the same numbers.
    size: Vec2,
    /// Height of the receiver above the plane.
    height: f32,
    /// Whether the ellipse itself is sampled, by area, instead of the rectangle.
    ellipse: bool,
}

/// Least share of the light along the axis by which a lamp with a spread is chosen: in a corner of what is sampled, the mean may be past the
/// spread where some light is.
const LEAST_THROUGH_SPREAD: f32 = 0.05;

/// The part of an area lamp that lights a receiver, as far as it matters for choosing among lights.
pub(super) struct LitPart {
    /// From the receiver to its middle; of a beam, to where its light comes from.
    pub(super) way: Vec3,
    /// Half of its diagonal; 0 of a beam.
    pub(super) radius: f32,
    /// Two factors, of which the product is about its intensity towards the receiver over that of the whole lamp along its axis.
    pub(super) share: Vec2,
}

impl ReadyLamp {
    /// Whether a point, relative to the middle and along the sides, lies within the outline.
    #[inline]
    fn within_outline(&self, place: Vec2) -> bool {
        let p = place / Vec2::from_array(self.half);
        match self.kind {
            LampKind::Ellipse => p.length_squared() <= 1.0,
            _ => p.x.abs() <= 1.0 && p.y.abs() <= 1.0,
        }
    }

    /// A vector in the coordinates of the sides.
    #[inline]
    fn along_sides(&self, v: Vec3) -> Vec2 {
        Vec2::new(v.dot(self.sides[0]), v.dot(self.sides[1]))
    }

    /// Factor that the spread transmits along a ray towards the lamp.
    #[inline]
    fn through_spread(&self, direction: Vec3) -> f32 {
        let cos = -direction.dot(self.axis);
        let tan = direction.cross(self.axis).length() / cos;
        (self.tan_half_spread - tan).max(0.0) * self.spread_factor
    }

    /// The part that is sampled; `None` where the lamp does not illuminate the receiver.
    #[inline]
    fn part(&self, to_middle: Vec3) -> Option<SampledRegion> {
        let height = -to_middle.dot(self.axis);
        if height <= 0.0 {
            return None;
        }
        let half = Vec2::from_array(self.half);
        let foot = self.along_sides(-to_middle);
        let reach = Vec2::splat(height * self.tan_half_spread);
        let (lo, hi) = ((foot - reach).max(-half), (foot + reach).min(half));
        if lo.x >= hi.x || lo.y >= hi.y {
            return None;
        }
        let size = hi - lo;
        let ellipse = self.kind == LampKind::Ellipse && size.x * size.y >= PI * half.x * half.y;
        // From here on relative to the receiver's foot point.
        Some(SampledRegion { lo: lo - foot, hi: hi - foot, size, height, ellipse })
    }

    /// What lights a receiver above the lamp's plane; `None` where nothing does. The spread counts as at the root of the mean squared distance
    /// from the foot point.
    #[inline]
    pub(super) fn lit_part(&self, to_middle: Vec3) -> Option<LitPart> {
        if self.tan_half_spread == 0.0 {
            let height = -to_middle.dot(self.axis);
            let lit = LitPart { way: self.axis * -height, radius: 0.0, share: Vec2::ONE };
            return self.within_outline(self.along_sides(-to_middle)).then_some(lit);
        }
        let part = self.part(to_middle)?;
        let middle = 0.5 * (part.lo + part.hi);
        let of_lamp = 0.5 * part.size / Vec2::from_array(self.half);
        let from_foot = (middle.length_squared() + part.size.length_squared() / 12.0).sqrt();
        let through = 1.0 - from_foot / (part.height * self.tan_half_spread);
        Some(LitPart {
            way: self.sides[0] * middle.x + self.sides[1] * middle.y - self.axis * part.height,
            radius: 0.5 * part.size.length(),
            share: Vec2::new(of_lamp.x, of_lamp.y * through.max(LEAST_THROUGH_SPREAD)),
        })
    }

    #[inline]
    pub(super) fn sample_area(&self, to_middle: Vec3, u: [f32; 2]) -> Option<LampSample> {
        if self.tan_half_spread == 0.0 {
            // A beam.
            let direction = -self.axis;
            let distance = -to_middle.dot(self.axis);
            let found = distance > 0.0 && self.within_outline(self.along_sides(-to_middle)) && self.is_lit();
            return found.then_some(LampSample { direction, distance, radiance: self.radiance, pdf: 0.0 });
        }
        let part = self.part(to_middle)?;
        let foot = self.along_sides(-to_middle);
        let place = if part.ellipse {
            let (s, c) = (2.0 * PI * u[1]).sin_cos();
            Vec2::from_array(self.half) * Vec2::new(c, s) * u[0].sqrt() - foot
        } else {
            let seen = SphericalRectangle::new(part.lo, part.hi, part.height);
            if seen.solid_angle < LEAST_SOLID_ANGLE {
                part.lo + part.size * Vec2::from_array(u)
            } else {
                seen.sample(u)
            }
        };
        if self.kind == LampKind::Ellipse && !self.within_outline(place + foot) {
            return None;
        }
        let way = self.sides[0] * place.x + self.sides[1] * place.y - self.axis * part.height;
        let distance = way.length();
        self.area_along(&part, way / distance, distance)
    }

    /// The lamp as seen along a direction that meets it; `None` where it is black.
    #[inline]
    fn area_along(&self, part: &SampledRegion, direction: Vec3, distance: f32) -> Option<LampSample> {
        let radiance = self.radiance * self.through_spread(direction);
        let pdf = self.pdf_area(part, direction, distance);
        let found = radiance.max_element() > 0.0 && pdf > 0.0 && pdf.is_finite();
        found.then_some(LampSample { direction, distance, radiance, pdf })
    }

    /// Density per solid angle of a direction to the sampled part.
    #[inline]
    fn pdf_area(&self, part: &SampledRegion, direction: Vec3, distance: f32) -> f32 {
        let per_area = distance * distance / -direction.dot(self.axis);
        if part.ellipse {
            return per_area / (PI * self.half[0] * self.half[1]);
        }
        let solid_angle = SphericalRectangle::new(part.lo, part.hi, part.height).solid_angle;
        if solid_angle < LEAST_SOLID_ANGLE {
            return per_area / (part.size.x * part.size.y);
        }
        1.0 / solid_angle
    }

    #[inline]
    pub(super) fn meet_area(&self, to_middle: Vec3, direction: Vec3) -> Option<LampSample> {
        let facing = -direction.dot(self.axis);
        if facing <= 0.0 || self.tan_half_spread == 0.0 {
            return None;
        }
        let part = self.part(to_middle)?;
        let distance = part.height / facing;
        if !self.within_outline(self.along_sides(direction * distance - to_middle)) {
            return None;
        }
        self.area_along(&part, direction, distance)
    }
}

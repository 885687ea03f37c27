//! Balls with Blender's *Soft Falloff*: a disk of the ball's radius that always faces the receiver, with the ball's radiance.
//!
//! Cycles drew all point and spot lamps in this way before it had balls. From far away both look the same. Near by, a disk fills at most
//! half of all directions, while a ball closes around the receiver. Directions are sampled by the disk's area.

use std::f32::consts::PI;

use glam::Vec3;

use super::ball::{LEAST_SIN_SQUARED, frame_around_f32};
use super::{LampSample, ReadyLamp};

impl ReadyLamp {
    /// The disk as seen along a direction that meets it; `None` where it is black.
    #[inline]
    fn disk_along(&self, to_middle: Vec3, direction: Vec3, distance: f32) -> Option<LampSample> {
        let cos = to_middle.dot(direction) / to_middle.length();
        let radiance = self.radiance * self.through_cone(direction);
        let pdf = distance * distance / (cos * PI * self.half[0] * self.half[0]);
        let found = radiance.max_element() > 0.0 && pdf > 0.0 && pdf.is_finite();
        found.then_some(LampSample { direction, distance, radiance, pdf })
    }

    #[inline]
    pub(super) fn sample_disk(&self, to_middle: Vec3, u: [f32; 2]) -> Option<LampSample> {
        if self.half[0] * self.half[0] < LEAST_SIN_SQUARED * to_middle.length_squared() {
            return self.sample_point(to_middle);
        }
        let (tangent, bitangent) = frame_around_f32(to_middle.normalize());
        let r = self.half[0] * u[0].sqrt();
        let (s, c) = (2.0 * PI * u[1]).sin_cos();
        let way = to_middle + tangent * (r * c) + bitangent * (r * s);
        let distance = way.length();
        self.disk_along(to_middle, way / distance, distance)
    }

    #[inline]
    pub(super) fn meet_disk(&self, to_middle: Vec3, direction: Vec3) -> Option<LampSample> {
        let (d2, r2) = (to_middle.length_squared(), self.half[0] * self.half[0]);
        let along = to_middle.dot(direction);
        if along <= 0.0 || r2 < LEAST_SIN_SQUARED * d2 {
            return None;
        }
        let distance = d2 / along;
        if (direction * distance - to_middle).length_squared() > r2 {
            return None;
        }
        self.disk_along(to_middle, direction, distance)
    }
}

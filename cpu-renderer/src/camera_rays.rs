//! Camera rays, as Blender's cameras send them.
//!
//! ```text
//! film (x, y) in pixels, y down ──► ((x − w/2)/longer + shift_x,  (h/2 − y)/longer + shift_y)   the longer side spans 1
//! perspective:   direction (2 tan(fov/2) · that, −1), origin at the eye
//! orthographic:  direction (0, 0, −1), origin scale · that
//! ```
//! The direction's camera-space z is −1, so t is the distance along the view axis: depth and clip range need no cosine.

use glam::{DMat3, DVec3};
use pumice_render::RayInWorld;
use pumice_scene::{Camera, Film, Projection};

/// A camera and a film, made ready.
#[derive(Clone, Copy, Debug)]
pub struct CameraRays {
    world_from_camera: DMat3,
    eye: DVec3,
    projection: Projection,
    shift: [f64; 2],
    half: [f64; 2],
    pixels_longer: f64,
    near: f64,
    reach: f64,
}

impl CameraRays {
    /// For a validated camera and film.
    pub fn new(camera: &Camera, film: &Film) -> Self {
        // The camera's scale is ignored, as Blender ignores it.
        let m = camera.world_from_camera.matrix3;
        let axes = DMat3::from_cols(m.x_axis.normalize(), m.y_axis.normalize(), m.z_axis.normalize());
        let [near, far] = camera.clip;
        Self {
            world_from_camera: axes,
            eye: camera.world_from_camera.translation,
            projection: camera.projection,
            shift: camera.shift,
            half: [f64::from(film.width) / 2.0, f64::from(film.height) / 2.0],
            pixels_longer: f64::from(film.width.max(film.height)),
            near,
            reach: if far == f64::MAX { f64::INFINITY } else { far - near },
        }
    }

    /// The ray through a point of the film in pixels, from the near clip plane, and its t at the far one.
    #[inline]
    pub fn ray(&self, x: f64, y: f64) -> (RayInWorld, f64) {
        let across = (x - self.half[0]) / self.pixels_longer + self.shift[0];
        let up = (self.half[1] - y) / self.pixels_longer + self.shift[1];
        let (origin, direction) = match self.projection {
            Projection::Perspective { fov_rad } => {
                let span = 2.0 * (fov_rad / 2.0).tan();
                (DVec3::ZERO, DVec3::new(span * across, span * up, -1.0))
            }
            Projection::Orthographic { scale } => {
                (DVec3::new(scale * across, scale * up, 0.0), DVec3::NEG_Z)
            }
        };
        let direction = self.world_from_camera * direction;
        let origin = self.eye + self.world_from_camera * origin + direction * self.near;
        (RayInWorld { origin, direction }, self.reach)
    }

    /// Distance along the view axis of the near clip plane: what depth adds to t.
    pub fn near(&self) -> f64 {
        self.near
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;
    use pumice_scene::Filter;

    fn film(width: u32, height: u32) -> Film {
        Film { width, height, filter: Filter::Box { width: 1.0 } }
    }

    #[test]
    fn the_field_of_view_spans_the_longer_side() {
        for (w, h) in [(960, 540), (540, 960)] {
            let camera = Camera {
                world_from_camera: DAffine3::IDENTITY,
                projection: Projection::Perspective { fov_rad: 1.0 },
                shift: [0.0; 2],
                clip: [0.0, f64::MAX],
            };
            let rays = CameraRays::new(&camera, &film(w, h));
            let (x, y) = if w > h { (f64::from(w), 270.0) } else { (270.0, 0.0) };
            let d = rays.ray(x, y).0.direction;
            let tangent = if w > h { d.x } else { d.y };
            assert!((tangent - 0.5f64.tan()).abs() < 1e-12 && d.z == -1.0, "{d}");
        }
    }

    #[test]
    fn clip_shift_and_parallel_projection() {
        let camera = Camera {
            world_from_camera: DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0)),
            projection: Projection::Orthographic { scale: 4.0 },
            shift: [0.25, 0.0],
            clip: [0.5, 2.0],
        };
        let (ray, reach) = CameraRays::new(&camera, &film(100, 50)).ray(50.0, 25.0);
        assert_eq!(ray.origin, DVec3::new(2.0, 2.0, 2.5));
        assert_eq!((ray.direction, reach), (DVec3::NEG_Z, 1.5));
    }
}

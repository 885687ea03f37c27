//! Rays of the camera. The longer side of the picture spans the field of view (Blender's sensor fit *Auto*).

use glam::{DAffine3, DVec3};
use pumice_render::RayInWorld;
use pumice_scene::{Camera, Film, Projection};

/// A camera with its film, made ready.
#[derive(Clone, Copy, Debug)]
pub struct CameraRays {
    /// Where a perspective camera is.
    pub position: DVec3,
    /// Unit vector along the picture.
    pub right: DVec3,
    /// Unit vector up the picture.
    pub up: DVec3,
    /// Unit vector along the view.
    pub forward: DVec3,
    /// Half extents of the longer side: at distance 1 (perspective), or anywhere (orthographic).
    pub half: f64,
    /// Whether rays are parallel.
    pub orthographic: bool,
    /// As the camera's.
    pub shift: [f64; 2],
    /// Pixels across and down.
    pub size: [f64; 2],
    /// Near and far.
    pub clip: [f64; 2],
}

impl CameraRays {
    /// Readies a camera whose matrix is not singular.
    pub fn new(camera: &Camera, film: &Film) -> Self {
        let DAffine3 { matrix3: m, translation } = camera.world_from_camera;
        let (half, orthographic) = match camera.projection {
            Projection::Perspective { fov_rad } => ((0.5 * fov_rad).tan(), false),
            Projection::Orthographic { scale } => (0.5 * scale, true),
        };
        Self {
            position: translation,
            right: m.x_axis.normalize(),
            up: m.y_axis.normalize(),
            forward: -m.z_axis.normalize(),
            half,
            orthographic,
            shift: camera.shift,
            size: [f64::from(film.width), f64::from(film.height)],
            clip: camera.clip,
        }
    }

    /// The ray through a point of the picture, in pixels from its upper left corner, and the largest t at which it sees.
    ///
    /// t counts along the view axis from the near clipping plane; add [`CameraRays::near`] for the depth.
    #[inline]
    pub fn ray(&self, x: f64, y: f64) -> (RayInWorld, f64) {
        let [width, height] = self.size;
        let longer = width.max(height);
        let sx = ((2.0 * x - width) / longer + 2.0 * self.shift[0]) * self.half;
        let sy = ((height - 2.0 * y) / longer + 2.0 * self.shift[1]) * self.half;
        let aside = self.right * sx + self.up * sy;
        let (origin, direction) = if self.orthographic {
            (self.position + aside, self.forward)
        } else {
            (self.position, self.forward + aside)
        };
        let ray = RayInWorld { origin: origin + direction * self.clip[0], direction };
        (ray, self.clip[1] - self.clip[0])
    }

    /// Distance of the near clipping plane.
    pub fn near(&self) -> f64 {
        self.clip[0]
    }
}

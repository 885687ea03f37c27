//! Camera rays that match Blender and Cycles: sensor fit, shift, pixel aspect, clip range, depth of field.
//!
//! The field of view spans the *fitted* side of the picture, its width or its height, in units of a pixel's height where pixels are not
//! square. With depth of field a ray starts at a point of the aperture and passes through the point in focus, where the ray from the
//! aperture's centre meets the plane at the focus distance.

use crate::RayInWorld;
use glam::{DAffine3, DVec3};
use pumice_scene::{Camera, Film, Projection, SensorFit};

use crate::lens::Lens;

/// A camera with its film, prepared for casting rays.
#[derive(Clone, Copy, Debug)]
pub struct CameraRays {
    /// Position of a perspective camera.
    pub position: DVec3,
    /// Unit vector to the right of the picture.
    pub right: DVec3,
    /// Unit vector to the top of the picture.
    pub up: DVec3,
    /// Unit vector along the view axis.
    pub forward: DVec3,
    /// Half extent of the fitted side: at distance 1 (perspective), or at any distance (orthographic).
    pub half: f64,
    /// Whether rays are parallel.
    pub orthographic: bool,
    /// Shift of the camera.
    pub shift: [f64; 2],
    /// Width and height of the picture in pixels.
    pub size: [f64; 2],
    /// Near and far clipping distance.
    pub clip: [f64; 2],
    /// Width of a pixel divided by its height.
    pub pixel_aspect: f64,
    /// Length of the fitted side, in heights of a pixel.
    pub fitted: f64,
    /// The aperture, if it has a size.
    pub lens: Option<Lens>,
}

/// Length of the side along which a camera's angle, scale and shift are measured, in heights of a pixel.
pub(crate) fn fitted_side(fit: SensorFit, film: &Film) -> f64 {
    let (width, height) = (f64::from(film.width) * film.pixel_aspect, f64::from(film.height));
    match fit {
        SensorFit::Auto => width.max(height),
        SensorFit::Horizontal => width,
        SensorFit::Vertical => height,
    }
}

impl CameraRays {
    /// Prepares a camera whose matrix is not singular.
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
            pixel_aspect: film.pixel_aspect,
            fitted: fitted_side(camera.fit, film),
            lens: camera.aperture.as_ref().map(Lens::new),
        }
    }

    /// Offset of a point of the picture from the view axis: at distance 1 (perspective), or at any distance (orthographic).
    #[inline]
    fn aside(&self, x: f64, y: f64) -> DVec3 {
        let [width, height] = self.size;
        let sx = ((2.0 * x - width) * self.pixel_aspect / self.fitted + 2.0 * self.shift[0]) * self.half;
        let sy = ((height - 2.0 * y) / self.fitted + 2.0 * self.shift[1]) * self.half;
        self.right * sx + self.up * sy
    }

    /// The ray from the aperture's centre through a point of the picture, in pixels from its upper left corner, and the largest t within
    /// the clip range.
    ///
    /// t is measured along the view axis from the near clipping plane; add [`CameraRays::near`] for the depth.
    #[inline]
    pub fn ray(&self, x: f64, y: f64) -> (RayInWorld, f64) {
        let aside = self.aside(x, y);
        let (origin, direction) = if self.orthographic {
            (self.position + aside, self.forward)
        } else {
            (self.position, self.forward + aside)
        };
        let ray = RayInWorld { origin: origin + direction * self.clip[0], direction };
        (ray, self.clip[1] - self.clip[0])
    }

    /// The ray from sample `u` of the aperture, through the same point in focus.
    ///
    /// It is clipped at the distances at which the ray from the centre would be, as in Cycles (`camera_sample_perspective`,
    /// `camera_sample_orthographic`: only parallel rays are clipped at a plane).
    #[inline]
    pub fn lens_ray(&self, lens: &Lens, x: f64, y: f64, u: [f32; 2]) -> (RayInWorld, f64) {
        let aside = self.aside(x, y);
        let [along, above] = lens.sample(u);
        let off = self.right * along + self.up * above;
        let middle = if self.orthographic { self.forward } else { self.forward + aside };
        let through = middle - off * lens.inverse_focus;
        let direction = through * (middle.length_squared() / through.length_squared()).sqrt();
        let (origin, onward) =
            if self.orthographic { (self.position + aside, through) } else { (self.position, direction) };
        let ray = RayInWorld { origin: origin + off + onward * self.clip[0], direction };
        (ray, self.clip[1] - self.clip[0])
    }

    /// Distance of the near clipping plane.
    pub fn near(&self) -> f64 {
        self.clip[0]
    }
}

//! Points of the camera's aperture, sampled as in Cycles: a disk, or a regular polygon of blades, narrowed along x by the ratio of an
//! anamorphic lens.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use pumice_scene::Aperture;

/// An aperture, prepared for sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius in world units.
    pub radius: f64,
    /// 1 / focus distance along the view axis.
    pub inverse_focus: f64,
    /// Rotation of the first blade's middle from the picture's x axis, within a full turn.
    pub rotation_rad: f32,
    /// 1 / (width over height of the blur).
    pub inverse_ratio: f32,
    /// Number of corners; 0 for a disk.
    pub blades: u32,
}

impl Lens {
    /// Prepares a valid aperture.
    pub fn new(aperture: &Aperture) -> Self {
        Self {
            radius: aperture.radius,
            inverse_focus: aperture.focus_distance.recip(),
            rotation_rad: (aperture.rotation_rad % std::f64::consts::TAU) as f32,
            inverse_ratio: aperture.ratio.recip() as f32,
            blades: aperture.blades,
        }
    }

    /// Samples a point of the aperture, in world units along the picture's x and y.
    pub fn sample(&self, u: [f32; 2]) -> [f64; 2] {
        let [x, y] =
            if self.blades == 0 { sample_disk(u) } else { sample_polygon(self.blades, self.rotation_rad, u) };
        [f64::from(x * self.inverse_ratio) * self.radius, f64::from(y) * self.radius]
    }
}

/// Maps two random numbers uniformly to the unit disk by the concentric map (Shirley and Chiu 1997).
pub fn sample_disk(u: [f32; 2]) -> [f32; 2] {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a == 0.0 && b == 0.0 {
        return [0.0, 0.0];
    }
    let (r, phi) =
        if a.abs() > b.abs() { (a, FRAC_PI_4 * (b / a)) } else { (b, FRAC_PI_2 - FRAC_PI_4 * (a / b)) };
    let (sin, cos) = phi.sin_cos();
    [r * cos, r * sin]
}

/// Maps two random numbers uniformly to the regular polygon in the unit circle whose first side has its middle at `rotation_rad`: u₀
/// selects the triangle of a side and, rescaled, the distance from the centre.
fn sample_polygon(corners: u32, rotation_rad: f32, u: [f32; 2]) -> [f32; 2] {
    let scaled = u[0] * corners as f32;
    let corner = scaled.floor();
    // Barycentric coordinates of a uniform point of a triangle (Turk 1990, Graphics Gems): the centre has 1 − √u.
    let from_centre = (scaled - corner).sqrt();
    let (a, b) = (1.0 - from_centre, u[1] * from_centre);
    let half = PI / corners as f32;
    let (sin, cos) = half.sin_cos();
    let (x, y) = ((1.0 - a) * cos, (1.0 - a - 2.0 * b) * sin);
    let (sin, cos) = (rotation_rad + corner * (TAU / corners as f32)).sin_cos();
    [cos * x - sin * y, sin * x + cos * y]
}

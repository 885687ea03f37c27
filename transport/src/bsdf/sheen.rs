//! Sheen: fibres that stand upright on a surface and scatter light among them several times.
//!
//! Zeltner, Burley, Chiang 2022, *Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines* (SIGGRAPH Talks), eq. 1: the
//! light that a layer of fibres scatters from one direction to all others is nearly a cosine lobe D, transformed by a matrix.
//!
//! ```text
//!                                        ⎡ A 0 B ⎤
//! f · cos = sheen · tint · R · D,  M⁻¹ = ⎢ 0 A 0 ⎥   in the frame whose x axis points to the viewer's side
//!                                        ⎣ 0 0 1 ⎦
//! ```
//! A, B and the albedo R come from a table over the viewer's cosine and the roughness. M keeps the horizon in place, so D is a density over
//! the hemisphere and can be sampled without loss. It is not reciprocal: the table is read for the viewer's direction only.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use pumice_scene::Material;

use super::tables::{SHEEN, SHEEN_ENTRIES, table_2d};

/// Below this table entry the sheen is omitted; it would reflect next to nothing (as in Cycles).
const LEAST_ENTRY: f32 = 1e-5;

/// Smaller roughnesses are raised to this one (as in Cycles).
const LEAST_ROUGHNESS: f32 = 1e-3;

/// The fibres of a material, prepared for one viewer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sheen {
    /// Reflection towards the viewer.
    pub(super) albedo: Vec3,
    a: f32,
    b: f32,
}

impl Sheen {
    /// No sheen.
    pub(super) const NONE: Self = Self { albedo: Vec3::ZERO, a: 1.0, b: 0.0 };

    /// The sheen of `m` seen at the cosine `cos`, and the weight that remains for everything below it.
    #[inline(never)]
    pub(super) fn new(m: &Material, cos: f32) -> (Self, f32) {
        let roughness = m.sheen_roughness.max(LEAST_ROUGHNESS);
        let a = table_2d(SHEEN, 32, cos, roughness);
        let b = table_2d(SHEEN + SHEEN_ENTRIES, 32, cos, roughness);
        let reflected = table_2d(SHEEN + 2 * SHEEN_ENTRIES, 32, cos, roughness);
        if a < LEAST_ENTRY || reflected < LEAST_ENTRY {
            return (Self::NONE, 1.0);
        }
        let albedo = m.sheen * reflected * Vec3::from_array(m.sheen_tint);
        (Self { albedo, a, b }, (1.0 - albedo.max_element()).clamp(0.0, 1.0))
    }

    /// Density of [`Sheen::sample`] above the surface; the reflected light is `albedo` times the density.
    #[inline(never)]
    pub(super) fn pdf(&self, wi: Vec3, wo: Vec3) -> f32 {
        let side = viewer_side(wi);
        let (x, y) = (wo.x * side[0] + wo.y * side[1], wo.y * side[0] - wo.x * side[1]);
        let (x, y) = (self.a * x + self.b * wo.z, self.a * y);
        let factor = self.a / (x * x + y * y + wo.z * wo.z);
        FRAC_1_PI * wo.z * (factor * factor)
    }

    /// Transforms `cosine`, a direction with density cos / π, into a sample of the lobe.
    pub(super) fn sample(&self, wi: Vec3, cosine: Vec3) -> Vec3 {
        let side = viewer_side(wi);
        let (x, y) = (cosine.x - self.b * cosine.z, cosine.y);
        Vec3::new(x * side[0] - y * side[1], x * side[1] + y * side[0], self.a * cosine.z).normalize()
    }
}

/// Unit vector along the surface towards the viewer; an arbitrary one where the viewer is straight above.
fn viewer_side(wi: Vec3) -> [f32; 2] {
    let r = (wi.x * wi.x + wi.y * wi.y).sqrt();
    if r > 0.0 { [wi.x / r, wi.y / r] } else { [1.0, 0.0] }
}

//! The first surface of each pixel, known without noise, which tells the filter what belongs together.

use pumice_core::NoMemory;

use super::planes::{Layout, Triple};
use crate::image::Image;
use crate::picture::Picture;

/// Squared difference of two normals at which a neighbour gets weight 0: opposite ones. At a right angle (2) the weight is 1/16: faces of
/// voxels that are as small as pixels turn at every pixel, and where 20° were the limit, the error of such pictures stayed three times as large.
const NORMAL: f32 = 4.0;

/// Squared difference of base colours at which a neighbour gets weight 0: colours that are distinguishable side by side.
const ALBEDO: f32 = 0.01;

/// The first surface at each pixel.
#[derive(Clone, Debug)]
pub struct Guides {
    pub(super) layout: Layout,
    pub(super) normal: Triple,
    pub(super) albedo: Triple,
    /// Row of the label + 1; 0 on meshes.
    pub(super) label: Vec<u32>,
    /// Instance of that label; 0 throughout a picture of one instance.
    pub(super) instance: Vec<u32>,
    /// 1 where there is a surface, of which everything is finite and no base colour is below 0; else 0.
    pub(super) is_surface: Vec<f32>,
}

impl Guides {
    /// The guides of a picture; `None` if it lacks depth, label, normal or base colour, which every rendered picture has, or if they are not
    /// of one size.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none for 36 bytes a pixel.
    pub fn of(picture: &Picture) -> Result<Option<Self>, NoMemory> {
        let (Some(depth), Some(label)) = (&picture.depth, &picture.label) else { return Ok(None) };
        let (Some(normal), Some(albedo)) = (&picture.normal, &picture.albedo) else { return Ok(None) };
        let layout = Layout { width: picture.color.width, height: picture.color.height };
        let pixels = layout.width * layout.height;
        let instance = picture.instance.as_deref();
        let lengths = [depth.len(), label.len(), normal.pixels.len(), albedo.pixels.len()];
        if lengths.iter().any(|&n| n != pixels) || instance.is_some_and(|of| of.len() != pixels) {
            return Ok(None);
        }
        let (normal, albedo) = (&normal.pixels, &albedo.pixels);
        let is_surface = layout.plane(|i, _| {
            let is_known = normal[i].iter().all(|v| v.is_finite()) && albedo[i].iter().all(|&a| a >= 0.0);
            let is_surface = depth[i].is_finite() && is_known && albedo[i].iter().all(|a| a.is_finite());
            f32::from(u8::from(is_surface))
        })?;
        // What is no number compares with nothing, and 0 times it is no number either.
        let known = |of: f32, at: usize| if is_surface[at] > 0.0 { of } else { 0.0 };
        Ok(Some(Self {
            layout,
            normal: layout.triple(|i, at, c| known(normal[i][c], at))?,
            albedo: layout.triple(|i, at, c| known(albedo[i][c], at))?,
            label: layout.plane(|i, _| label[i])?,
            instance: layout.plane(|i, _| instance.map_or(0, |of| of[i]))?,
            is_surface,
        }))
    }

    /// Whether the guides belong to a picture of this size.
    pub fn fit(&self, image: &Image) -> bool {
        self.layout == Layout { width: image.width, height: image.height }
    }
}

/// How alike two surfaces are: 1 if nothing differs, 0 if one property differs too much. With x the sum of what differs, (1 − x/4)⁴ stands
/// for e⁻ˣ, with the same effect. `normal` and `albedo` are the squared differences of the two.
#[inline(always)]
pub(super) fn likeness(normal: f32, albedo: f32) -> f32 {
    let y = (1.0 - (normal * (1.0 / NORMAL) + albedo * (1.0 / ALBEDO))).max(0.0);
    (y * y) * (y * y)
}

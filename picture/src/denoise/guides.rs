//! The first surface of each pixel, known without noise, which tells the filter what belongs together.

use pumice_core::NoMemory;
use rayon::prelude::*;

use super::planes::{Layout, MARGIN, Triple};
use crate::image::Image;
use crate::picture::Picture;

/// Squared difference of two normals at which a neighbour gets weight 0: opposite ones. At a right angle (2) the weight is 1/16: faces of
/// voxels that are as small as pixels turn at every pixel, and where 20° were the limit, the error of such pictures stayed three times as large.
const NORMAL: f32 = 4.0;

/// Squared difference of base colours at which a neighbour gets weight 0: colours that are distinguishable side by side.
const ALBEDO: f32 = 0.01;

/// The first surface at a pixel.
#[derive(Clone, Copy, Debug)]
pub struct GuideSurface {
    /// Unit normal towards the camera, in the world.
    pub normal: [f32; 3],
    /// Base colour, linear Rec. 709.
    pub albedo: [f32; 3],
    /// Row of the label + 1; 0 on meshes.
    pub label: u32,
    /// Instance of that label.
    pub instance: u32,
}

impl GuideSurface {
    /// Whether everything is finite and no base colour is below 0.
    fn is_sound(&self) -> bool {
        let is_color = |a: &f32| a.is_finite() && *a >= 0.0;
        self.normal.iter().all(|v| v.is_finite()) && self.albedo.iter().all(is_color)
    }
}

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
    /// 1 where there is a surface whose properties are sound; else 0, as is everything else there.
    pub(super) is_surface: Vec<f32>,
}

impl Guides {
    /// The guides of a picture; `None` if it lacks depth, label, normal or base colour, which every rendered picture has, or if they are not
    /// of one size.
    ///
    /// # Errors
    /// As [`Guides::by_pixels`].
    pub fn of(picture: &Picture) -> Result<Option<Self>, NoMemory> {
        let (Some(depth), Some(label)) = (&picture.depth, &picture.label) else { return Ok(None) };
        let (Some(normal), Some(albedo)) = (&picture.normal, &picture.albedo) else { return Ok(None) };
        let (width, height) = (picture.color.width, picture.color.height);
        let instance = picture.instance.as_deref();
        let lengths = [depth.len(), label.len(), normal.pixels.len(), albedo.pixels.len()];
        if lengths.iter().any(|&n| n != width * height) || instance.is_some_and(|of| of.len() != depth.len())
        {
            return Ok(None);
        }
        let surface = |x: usize, y: usize| {
            let i = y * width + x;
            depth[i].is_finite().then(|| GuideSurface {
                normal: normal.pixels[i],
                albedo: albedo.pixels[i],
                label: label[i],
                instance: instance.map_or(0, |of| of[i]),
            })
        };
        Self::by_pixels([width, height], surface).map(Some)
    }

    /// The guides of a picture of this width and height. `surface` says what is at column x and row y, from the upper left; several threads
    /// ask it.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none for 36 bytes a pixel.
    pub fn by_pixels(
        [width, height]: [usize; 2],
        surface: impl Fn(usize, usize) -> Option<GuideSurface> + Sync,
    ) -> Result<Self, NoMemory> {
        let layout = Layout { width, height };
        let triple = || Ok([layout.zeroes()?, layout.zeroes()?, layout.zeroes()?]);
        let mut guides = Self {
            layout,
            normal: triple()?,
            albedo: triple()?,
            label: layout.zeroes()?,
            instance: layout.zeroes()?,
            is_surface: layout.zeroes()?,
        };
        let n = layout.stride();
        let [nx, ny, nz] = guides.normal.each_mut().map(|plane| plane.par_chunks_mut(n));
        let [red, green, blue] = guides.albedo.each_mut().map(|plane| plane.par_chunks_mut(n));
        let label = guides.label.par_chunks_mut(n);
        let instance = guides.instance.par_chunks_mut(n);
        let is_surface = guides.is_surface.par_chunks_mut(n);
        let rows = ((nx, ny, nz), (red, green, blue), (label, instance, is_surface));
        rows.into_par_iter().enumerate().for_each(|(y, (normal, albedo, (label, instance, is_surface)))| {
            for x in 0..width {
                let Some(of) = surface(x, y).filter(GuideSurface::is_sound) else { continue };
                let at = MARGIN + x;
                [normal.0[at], normal.1[at], normal.2[at]] = of.normal;
                [albedo.0[at], albedo.1[at], albedo.2[at]] = of.albedo;
                (label[at], instance[at], is_surface[at]) = (of.label, of.instance, 1.0);
            }
        });
        Ok(guides)
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

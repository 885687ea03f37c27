//! The sums over samples that the passes of a picture need, and how passes are computed from them.
//!
//! ```text
//! floats per pixel; each group is kept only if it is needed:
//! alpha     1    samples that hit a surface
//! features  6    colour (r g b) and normal (x y z) of the first surface
//! light    33    diffuse, glossy, transmission, each direct and indirect; emission; environment; the three colours, r g b each
//! caught   32 or 44    light of shadow catchers, a group for each class (see crate::shadow_catcher)
//! labels   4 a rank    slots, each with an id and the number of samples that saw it (see crate::cryptomatte)
//! types    4 a rank    the same
//! ```
//! Sums are over all samples: only the error of the colour needs separate classes. The mean light of each kind is divided by the
//! mean colour of that kind, as in Cycles' `film_get_pass_pixel_light_path`, so that
//! `(direct + indirect) · colour` of the three kinds, emission and environment add up to the picture again.

use pumice_core::NoMemory;
use pumice_scene::{Film, Pass, Passes};

use crate::film::CLASSES;
use crate::film::FilmBuffer;
use crate::image::Image;
use crate::picture::Picture;
use crate::shadow_catcher::CAUGHT_FLOATS;

/// Kinds of light: two each of diffuse, glossy, transmission (direct, indirect), then emission and environment.
pub const LIGHT_KINDS: usize = 8;

/// Colours of diffuse, glossy, transmission.
pub const COLOR_KINDS: usize = 3;

/// Which groups are summed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PassSums {
    /// Share of the samples that hit a surface.
    pub alpha: bool,
    /// Colour and normal of the first surface.
    pub features: bool,
    /// Light by kind, and colours by kind.
    pub light: bool,
    /// Cryptomatte by label, and by type.
    pub mattes: [bool; 2],
    /// Ranks of the mattes in the picture; 0 if neither matte is kept.
    pub ranks: u32,
    /// Light of shadow catchers.
    pub caught: bool,
    /// Whether the caught shadows go into a pass of their own instead of into the picture.
    pub shadow_apart: bool,
    /// Pixels from the border over which shadows in the picture fade to nothing; 0: they do not.
    pub shadow_fade: u32,
}

impl PassSums {
    /// The sums that a film needs; `catches` says whether the scene has a shadow catcher.
    pub fn of(film: &Film, catches: bool) -> Self {
        let mattes = [Pass::CryptomatteLabel, Pass::CryptomatteType].map(|pass| film.passes.has(pass));
        Self {
            mattes,
            ranks: if mattes == [false; 2] { 0 } else { film.cryptomatte_ranks },
            alpha: film.transparent,
            features: film.passes.has_any(&[Pass::Albedo, Pass::Normal]),
            light: film.passes.has_any(Pass::LIGHT),
            caught: catches,
            shadow_apart: catches && film.passes.has(Pass::ShadowCatcher),
            shadow_fade: if catches { film.shadow_fade_pixels() } else { 0 },
        }
    }

    /// Floats per pixel.
    pub const fn stride(self) -> usize {
        self.mattes_at() + 2 * self.matte_slots() * (self.mattes[0] as usize + self.mattes[1] as usize)
    }

    /// Slots per pixel of each matte: twice the number of ranks.
    pub const fn matte_slots(self) -> usize {
        2 * self.ranks as usize
    }

    /// Offset of the mattes: by label, then by type.
    pub const fn mattes_at(self) -> usize {
        self.caught_at() + if self.caught { CLASSES as usize * self.caught_floats() } else { 0 }
    }

    /// Offset of the light of shadow catchers.
    pub const fn caught_at(self) -> usize {
        self.light_at() + if self.light { 3 * (LIGHT_KINDS + COLOR_KINDS) } else { 0 }
    }

    /// Floats per class of the light of shadow catchers.
    pub const fn caught_floats(self) -> usize {
        CAUGHT_FLOATS[self.keeps_behind() as usize]
    }

    /// Whether the light from behind everything is kept too: needed where the picture shows it past shadow catchers.
    pub const fn keeps_behind(self) -> bool {
        self.caught && !self.alpha && !self.shadow_apart
    }

    /// Offset of the features.
    pub const fn features_at(self) -> usize {
        self.alpha as usize
    }

    /// Offset of the light by kind.
    pub const fn light_at(self) -> usize {
        self.features_at() + if self.features { 6 } else { 0 }
    }

    /// The groups as bits for shaders: alpha, features, light, mattes by label, by type, catchers' light, light behind them; from bit 8
    /// on the number of slots of a matte.
    pub const fn bits(self) -> u32 {
        let groups = self.alpha as u32 | (self.features as u32) << 1 | (self.light as u32) << 2;
        groups
            | (self.mattes[0] as u32) << 3
            | (self.mattes[1] as u32) << 4
            | (self.caught as u32) << 5
            | (self.keeps_behind() as u32) << 6
            | (self.matte_slots() as u32) << 8
    }
}

/// The offsets of the kind of light and of the colour that a pass is computed from; `None` if it is not a pass of light.
fn kinds_of(pass: Pass) -> Option<(usize, Option<usize>)> {
    Some(match pass {
        Pass::DiffuseDirect => (0, Some(0)),
        Pass::DiffuseIndirect => (1, Some(0)),
        Pass::GlossyDirect => (2, Some(1)),
        Pass::GlossyIndirect => (3, Some(1)),
        Pass::TransmissionDirect => (4, Some(2)),
        Pass::TransmissionIndirect => (5, Some(2)),
        Pass::Emission => (6, None),
        Pass::Environment => (7, None),
        Pass::DiffuseColor => (LIGHT_KINDS, None),
        Pass::GlossyColor => (LIGHT_KINDS + 1, None),
        Pass::TransmissionColor => (LIGHT_KINDS + 2, None),
        _ => return None,
    })
}

/// Light divided by its colour. A channel in which the colour is 0 gets the mean of the others, as in Cycles'
/// `safe_divide_even_color`: denoisers need light without gaps.
fn divide(light: [f32; 3], color: [f32; 3]) -> [f32; 3] {
    let has = color.map(|c| c != 0.0);
    let mut quotient = [0, 1, 2].map(|c| if has[c] { light[c] / color[c] } else { 0.0 });
    let count = has.iter().filter(|h| **h).count();
    if count > 0 {
        let even = quotient.iter().sum::<f32>() / count as f32;
        (0..3).filter(|&c| !has[c]).for_each(|c| quotient[c] = even);
    }
    quotient
}

impl FilmBuffer {
    /// Applies a function to each pixel's pass sums and its number of samples, which is at least 1.
    pub(crate) fn of_each_pixel<T: Send>(
        &self,
        f: impl Fn(&[f32], f32) -> T + Sync + Send,
    ) -> Result<Vec<T>, NoMemory> {
        let stride = self.kept().stride();
        let of = |pixel: usize| {
            let sums = &self.pass_sums()[pixel * stride..][..stride];
            f(sums, self.samples_of(pixel).max(1) as f32)
        };
        self.each_pixel(of)
    }

    /// The mean of some of each pixel's pass sums, chosen by offset.
    fn means<T: Send>(
        &self,
        f: impl Fn(&dyn Fn(usize) -> f32) -> T + Sync + Send,
    ) -> Result<Vec<T>, NoMemory> {
        self.of_each_pixel(|sums, n| f(&|place| sums[place] / n))
    }

    fn mean_image(&self, place: usize) -> Result<Image, NoMemory> {
        let (width, height) = self.size();
        Ok(Image::new(width, height, self.means(|of| [0, 1, 2].map(|c| of(place + c)))?))
    }

    /// Whether the picture has alpha.
    pub fn has_alpha(&self) -> bool {
        self.kept().alpha || self.kept().shadow_apart
    }

    /// Share of the samples that hit a surface, if it is kept; it includes the caught shadows.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn alpha(&self) -> Result<Option<Vec<f32>>, NoMemory> {
        if self.kept().caught {
            return self.caught_alpha();
        }
        self.kept().alpha.then(|| self.means(|of| of(0))).transpose()
    }

    /// The shadow catcher pass, if it is requested: the share of light that is not blocked, 1 in a scene without shadow catchers.
    fn shadow_wanted(&self, wanted: Passes) -> Result<Option<(Pass, Image)>, NoMemory> {
        if !wanted.has(Pass::ShadowCatcher) {
            return Ok(None);
        }
        let (width, height) = self.size();
        let shadow = match self.kept().caught {
            true => self.shadow()?,
            false => Image::new(width, height, self.each_pixel(|_| [1.0; 3])?),
        };
        Ok(Some((Pass::ShadowCatcher, shadow)))
    }

    /// Colour and normal of the first surface, means over samples, where they are kept.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn features(&self) -> Result<Option<[Image; 2]>, NoMemory> {
        if !self.kept().features {
            return Ok(None);
        }
        let at = self.kept().features_at();
        Ok(Some([self.mean_image(at)?, self.mean_image(at + 3)?]))
    }

    /// The requested passes of light, if they are kept.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn light(&self, wanted: Passes) -> Result<Vec<(Pass, Image)>, NoMemory> {
        let (at, kept) = (self.kept().light_at(), self.kept().light);
        let (width, height) = self.size();
        let image = |(pass, light, color): (Pass, usize, Option<usize>)| {
            let Some(color) = color else { return Ok((pass, self.mean_image(at + 3 * light)?)) };
            let (light, color) = (at + 3 * light, at + 3 * (LIGHT_KINDS + color));
            let pixels =
                self.means(|of| divide([0, 1, 2].map(|c| of(light + c)), [0, 1, 2].map(|c| of(color + c))))?;
            Ok((pass, Image::new(width, height, pixels)))
        };
        let kinds =
            wanted.iter().filter_map(|pass| kinds_of(pass).map(|(light, color)| (pass, light, color)));
        kinds.filter(|_| kept).map(image).collect()
    }

    /// Adds the passes to the picture. Albedo and normal become means over samples if they are in `wanted`.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn passes_into(&self, picture: Picture, wanted: Passes) -> Result<Picture, NoMemory> {
        let counts = || self.each_pixel(|pixel| self.samples_of(pixel) as f32);
        let (albedo, normal) = match self.features()? {
            Some([albedo, normal]) => (Some(albedo), Some(normal)),
            None => (None, None),
        };
        Ok(Picture {
            alpha: self.alpha()?,
            albedo: albedo.filter(|_| wanted.has(Pass::Albedo)).or(picture.albedo),
            normal: normal.filter(|_| wanted.has(Pass::Normal)).or(picture.normal),
            samples: wanted.has(Pass::Samples).then(counts).transpose()?,
            light: self.light(wanted)?.into_iter().chain(self.shadow_wanted(wanted)?).collect(),
            mattes: self.mattes()?,
            ..picture
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_lie_one_behind_the_other() {
        let all = PassSums {
            alpha: true,
            features: true,
            light: true,
            mattes: [true; 2],
            ranks: 6,
            ..PassSums::default()
        };
        assert_eq!((all.features_at(), all.light_at(), all.mattes_at(), all.stride()), (1, 7, 40, 88));
        assert_eq!(all.bits(), 0xC1F, "12 slots of five groups");
        let caught = PassSums { caught: true, ..all };
        assert_eq!((caught.caught_at(), caught.mattes_at(), caught.stride()), (40, 72, 120));
        assert_eq!(caught.bits(), 0xC3F);
        let behind = PassSums { alpha: false, ..caught };
        assert_eq!((behind.caught_at(), behind.mattes_at(), behind.bits()), (39, 83, 0xC7E));
        assert!(!PassSums { shadow_apart: true, ..behind }.keeps_behind(), "nothing behind is shown");
        let types = PassSums { mattes: [false, true], ranks: 2, ..PassSums::default() };
        assert_eq!((types.mattes_at(), types.stride(), types.bits()), (0, 8, 0x410));
        let light = PassSums { light: true, ..PassSums::default() };
        assert_eq!((light.light_at(), light.stride(), light.bits()), (0, 33, 4));
        assert_eq!(PassSums::default().stride(), 0);
    }

    #[test]
    fn light_is_divided_by_its_colour() {
        assert_eq!(divide([1.0, 2.0, 3.0], [0.5, 0.25, 1.0]), [2.0, 8.0, 3.0]);
        assert_eq!(divide([1.0, 0.0, 3.0], [0.5, 0.0, 1.0]), [2.0, 2.5, 3.0], "the mean of the others");
        assert_eq!(divide([0.0, 0.0, 3.0], [0.0, 0.0, 1.5]), [2.0; 3]);
        assert_eq!(divide([0.0; 3], [0.0; 3]), [0.0; 3]);
    }
}

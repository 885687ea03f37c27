//! Denoises a finished picture, and says so in everything that tells of it: its provenance, its figures, and the mean of its samples, which stays
//! beside it.

mod filter;
mod oidn;

use pumice_picture::denoise::denoised;
use pumice_picture::film::variance_known;
use pumice_picture::{Denoiser, Guides, Image, Picture};
use pumice_transport::{RenderError, Renderer};

use crate::error::{Result, SessionError};
use crate::measure::Stopwatch;
use crate::render_file::Rendered;

pub use filter::{DenoiserName, Filter};
pub use oidn::Oidn;

impl Rendered {
    /// [Denoises](Rendered::denoise) the picture that `renderer` has just drawn and still shows, by Pumice's filter on the renderer's own device
    /// where it can. The notices of a device that cannot join those of the picture.
    ///
    /// # Errors
    /// As [`Rendered::denoise`].
    pub(crate) fn denoise_with(&mut self, renderer: &mut dyn Renderer, filter: Filter) -> Result<()> {
        if filter != Filter::Statistical {
            return self.denoise(filter);
        }
        let clock = Stopwatch::start();
        // A device that failed for good leaves the finished picture to the processor, which has all that the filter needs.
        let made = match renderer.denoised() {
            Ok(made) => made,
            Err(RenderError::Restarted) => None,
            Err(RenderError::Device(why)) => {
                self.figures.notices.push(format!("{why}; the processor denoises"));
                None
            }
            Err(error) => return Err(error.into()),
        };
        self.figures.notices.extend(renderer.notices());
        match made {
            Some(smooth) => {
                self.become_denoised(smooth, Denoiser::Statistical, &clock);
                Ok(())
            }
            None => self.denoise(filter),
        }
    }

    /// Puts the picture that `filter` makes in place of the mean of its samples, which becomes [`noisy`](pumice_picture::Picture::noisy). A
    /// picture that is denoised already stays as it is: filtered twice, its variance would be that of another picture.
    ///
    /// # Errors
    /// [`SessionError::Caller`] for a picture without its first surfaces, as other programs make them; [`RenderError::Memory`]; those of
    /// [`Oidn::denoised`].
    pub fn denoise(&mut self, filter: Filter) -> Result<()> {
        let picture = &self.picture;
        if self.figures.denoised.is_some() || picture.noisy.is_some() {
            return Ok(());
        }
        let clock = Stopwatch::start();
        let (smooth, by) = match filter {
            Filter::Statistical => (averaged(picture)?, Denoiser::Statistical),
            Filter::Oidn(oidn) => (oidn.denoised(picture)?, oidn.denoiser()),
        };
        self.become_denoised(smooth, by, &clock);
        Ok(())
    }

    /// Puts the denoised picture in place of the mean of its samples, and says so. `clock` runs since the filter began.
    fn become_denoised(&mut self, smooth: Image, by: Denoiser, clock: &Stopwatch) {
        let picture = &mut self.picture;
        picture.noisy = Some(std::mem::replace(&mut picture.color, smooth));
        if let Some(made) = &mut picture.provenance {
            made.denoised = Some(by);
        }
        self.figures.denoised = Some(by);
        self.figures.denoise_seconds = Some([clock.seconds(), clock.cpu_seconds()]);
    }
}

/// The picture through [Pumice's own filter](pumice_picture::denoise), on the processor.
fn averaged(picture: &Picture) -> Result<Image> {
    let guides = Guides::of(picture).map_err(RenderError::from)?.ok_or_else(|| {
        SessionError::Caller(
            "denoise: expected a picture with the passes depth, label, normal and albedo, got one without"
                .into(),
        )
    })?;
    let variance = picture.variance.as_ref().map(variance_known);
    Ok(denoised(&picture.color, variance, &guides).map_err(RenderError::from)?)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::backend::fakes::{At, full, scene, ways};
    use pumice_core::Job;

    /// Three pixels of one label, with noise that explains how they differ.
    fn rendered() -> Rendered {
        let same = |value: [f32; 3]| Some(Image::new(3, 1, vec![value; 3]));
        let color = Image::new(3, 1, [1.0, 3.0, 2.0].map(|v| [v; 3]).to_vec());
        Rendered::of_file(Picture {
            variance: same([1.0; 3]),
            depth: Some(vec![1.0; 3]),
            label: Some(vec![5; 3]),
            albedo: same([0.5; 3]),
            normal: same([0.0, 0.0, 1.0]),
            ..Picture::of(color)
        })
    }

    #[test]
    fn the_mean_of_the_samples_stays_and_the_picture_is_denoised_once() {
        let (raw, mut smooth) = (rendered(), rendered());
        smooth.denoise(Filter::Statistical).unwrap();
        assert_eq!(smooth.picture.noisy, Some(raw.picture.color.clone()));
        // All three lie within each other's windows, and none differs significantly: each becomes their mean.
        assert!(
            smooth.picture.color.pixels.iter().flatten().all(|v| (v - 2.0).abs() < 1e-5),
            "{:?}",
            smooth.picture.color
        );
        assert_eq!((smooth.figures.denoised, raw.figures.denoised), (Some(Denoiser::Statistical), None));
        assert!(smooth.figures.denoise_seconds.is_some());
        let (once, noisy) = (smooth.picture.color.clone(), smooth.picture.noisy.clone());
        smooth.denoise(Filter::Statistical).unwrap();
        assert_eq!((smooth.picture.color, smooth.picture.noisy), (once, noisy));
    }

    /// The fakes' devices denoise by adding ½ to their picture, of four samples here; their processor leaves it to the caller.
    #[test]
    fn the_renderer_denoises_where_it_can() {
        let mut by_host = rendered();
        by_host.denoise(Filter::Statistical).unwrap();
        let drawn = |fails: &[(&'static str, At)]| {
            let mut renderer = ways(fails, full).0;
            renderer.set_scene(&scene([3, 1])).unwrap();
            while renderer.advance(Duration::ZERO, 4, &Job::new()).unwrap().spp < 4 {}
            renderer.notices();
            let mut made = rendered();
            made.denoise_with(&mut renderer, Filter::Statistical).unwrap();
            assert_eq!(made.picture.noisy.as_ref(), by_host.picture.noisy.as_ref());
            assert_eq!(made.figures.denoised, Some(Denoiser::Statistical));
            assert!(made.figures.denoise_seconds.is_some());
            (made.picture.color, made.figures.notices)
        };
        let on_device = drawn(&[("vulkan-rt", At::Never)]);
        assert_eq!((on_device.0.pixels, on_device.1.len()), (vec![[4.5; 3]; 3], 0));
        assert_eq!(drawn(&[("cpu", At::Never)]), (by_host.picture.color.clone(), vec![]));
        // A device that fails for good: the picture is finished, and nothing is drawn again.
        for fails in [&[("vulkan-rt", At::Denoised)][..], &[("vulkan-rt", At::Denoised), ("cpu", At::Never)]]
        {
            let (color, notices) = drawn(fails);
            assert_eq!(color, by_host.picture.color);
            let told = "vulkan-rt on X: out of GPU memory";
            assert!(notices.iter().any(|n| n.starts_with(told)), "{notices:?}");
        }
    }

    #[test]
    fn a_picture_without_its_first_surfaces_is_refused_and_unchanged() {
        let mut bare = rendered();
        bare.picture.label = None;
        let before = bare.picture.clone();
        let line = bare.denoise(Filter::Statistical).unwrap_err().to_string();
        assert!(line.starts_with("denoise: expected a picture with the passes depth, label"), "{line}");
        assert!(bare.picture == before && bare.figures.denoised.is_none());
    }
}

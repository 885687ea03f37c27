//! Denoises a finished picture, and says so in everything that tells of it: its provenance, its figures, and the mean of its samples, which stays
//! beside it.

use pumice_picture::denoise::denoised;
use pumice_picture::film::variance_known;
use pumice_picture::{Denoiser, Guides};
use pumice_transport::RenderError;

use crate::error::{Result, SessionError};
use crate::measure::Stopwatch;
use crate::render_file::Rendered;

impl Rendered {
    /// Puts the [denoised](pumice_picture::denoise) picture in place of the mean of its samples, which becomes
    /// [`noisy`](pumice_picture::Picture::noisy). A picture that is denoised already stays as it is: filtered twice, its variance would be that
    /// of another picture.
    ///
    /// # Errors
    /// [`SessionError::Caller`] for a picture without its first surfaces, as other programs make them; [`RenderError::Memory`].
    pub fn denoise(&mut self) -> Result<()> {
        let picture = &mut self.picture;
        if self.figures.denoised.is_some() || picture.noisy.is_some() {
            return Ok(());
        }
        let clock = Stopwatch::start();
        let guides = Guides::of(picture).map_err(RenderError::from)?.ok_or_else(|| {
            SessionError::Caller(
                "denoise: expected a picture with the passes depth, label, normal and albedo, got one without".into(),
            )
        })?;
        let variance = picture.variance.as_ref().map(variance_known);
        let smooth = denoised(&picture.color, variance, &guides).map_err(RenderError::from)?;
        picture.noisy = Some(std::mem::replace(&mut picture.color, smooth));
        if let Some(made) = &mut picture.provenance {
            made.denoised = Some(Denoiser::Statistical);
        }
        self.figures.denoised = Some(Denoiser::Statistical);
        self.figures.denoise_seconds = Some([clock.seconds(), clock.cpu_seconds()]);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pumice_picture::{Image, Picture};

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
        smooth.denoise().unwrap();
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
        smooth.denoise().unwrap();
        assert_eq!((smooth.picture.color, smooth.picture.noisy), (once, noisy));
    }

    #[test]
    fn a_picture_without_its_first_surfaces_is_refused_and_unchanged() {
        let mut bare = rendered();
        bare.picture.label = None;
        let before = bare.picture.clone();
        let line = bare.denoise().unwrap_err().to_string();
        assert!(line.starts_with("denoise: expected a picture with the passes depth, label"), "{line}");
        assert!(bare.picture == before && bare.figures.denoised.is_none());
    }
}

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

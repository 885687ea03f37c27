//! Comparison of two picture files.

use std::path::Path;

use pumice_core::Job;
use pumice_picture::film::variance_known;
use pumice_picture::metrics::{CompareError, Comparison, compare};
use pumice_picture::{Picture, read_exr};

use crate::error::{Result, SessionError};

/// Compares a picture with its reference, both OpenEXR. If both files hold their variance and neither is denoised, a statistical test is
/// included.
///
/// # Errors
/// When either cannot be read, or they differ in size; [`pumice_core::Error::Cancelled`] when `job` is cancelled.
pub fn compare_pictures(picture: &Path, reference: &Path, job: &Job) -> Result<Comparison> {
    let read = |path| {
        job.check()?;
        read_exr(path).map_err(SessionError::from)
    };
    let (a, b) = (read(picture)?, read(reference)?);
    // The variance of a denoised picture is that of its samples' mean, and its bias is in neither.
    let testable = !is_denoised(&a) && !is_denoised(&b);
    let variances = a.variance.as_ref().zip(b.variance.as_ref()).filter(|_| testable);
    let variances = variances.map(|(a, b)| (variance_known(a), variance_known(b)));
    compare(&a.color, &b.color, variances, &|| job.is_cancelled()).map_err(|e| match e {
        CompareError::Cancelled => pumice_core::Error::Cancelled.into(),
        e => SessionError::Caller(format!("{} against {}: {e}", picture.display(), reference.display())),
    })
}

/// Whether a picture says that it is no mean of samples.
fn is_denoised(picture: &Picture) -> bool {
    picture.noisy.is_some() || picture.provenance.as_ref().is_some_and(|made| made.denoised.is_some())
}

//! Comparison of two picture files.

use std::path::Path;

use pumice_core::Job;
use pumice_picture::film::CLASSES;
use pumice_picture::metrics::{CompareError, Comparison, Variance, compare};
use pumice_picture::read_exr;

use crate::error::{Result, SessionError};

/// Compares a picture with its reference, both OpenEXR. If both files hold their variance, a statistical test is included.
///
/// # Errors
/// When either cannot be read, or they differ in size; [`pumice_core::Error::Cancelled`] when `job` is cancelled.
pub fn compare_pictures(picture: &Path, reference: &Path, job: &Job) -> Result<Comparison> {
    let read = |path| {
        job.check()?;
        read_exr(path).map_err(SessionError::from)
    };
    let (a, b) = (read(picture)?, read(reference)?);
    // A picture's variance comes from the spread of its classes.
    let of = |image| Variance { of_mean: image, degrees_of_freedom: f64::from(CLASSES - 1) };
    let variances = a.variance.as_ref().map(of).zip(b.variance.as_ref().map(of));
    compare(&a.color, &b.color, variances, &|| job.is_cancelled()).map_err(|e| match e {
        CompareError::Cancelled => pumice_core::Error::Cancelled.into(),
        e => SessionError::Caller(format!("{} against {}: {e}", picture.display(), reference.display())),
    })
}

//! Two pictures in files, compared.

use std::path::Path;

use pumice_render::metrics::{Comparison, Variance, compare};
use pumice_render::read_exr;
use pumice_render::sampler::REPLICATES;

use crate::error::{Result, SessionError};

/// Compares a picture with its reference, both OpenEXR; by chance too where both hold their variance.
///
/// # Errors
/// When either cannot be read, or they differ in size.
pub fn compare_pictures(picture: &Path, reference: &Path) -> Result<Comparison> {
    let (a, b) = (read_exr(picture)?, read_exr(reference)?);
    // A picture's variance comes from the spread of its replicates.
    let of = |image| Variance { of_mean: image, degrees_of_freedom: f64::from(REPLICATES - 1) };
    let variances = a.variance.as_ref().map(of).zip(b.variance.as_ref().map(of));
    compare(&a.color, &b.color, variances).map_err(|e| {
        SessionError::Caller(format!("{} against {}: {e}", picture.display(), reference.display()))
    })
}

//! Two pictures in files, compared.

use std::path::Path;

use pumice_render::metrics::{Comparison, Variance, compare};
use pumice_render::read_exr;

use crate::error::{Result, SessionError};

/// Compares a picture with its reference, both OpenEXR; by chance too where both hold their variance.
///
/// # Errors
/// When either cannot be read, or they differ in size.
pub fn compare_pictures(picture: &Path, reference: &Path) -> Result<Comparison> {
    let (a, b) = (read_exr(picture)?, read_exr(reference)?);
    let samples = |p: &pumice_render::Picture| p.provenance.as_ref().map(|m| m.spp);
    let variances = match (&a.variance, &b.variance, samples(&a), samples(&b)) {
        (Some(va), Some(vb), Some(na), Some(nb)) => {
            Some((Variance { of_mean: va, samples: na }, Variance { of_mean: vb, samples: nb }))
        }
        _ => None,
    };
    compare(&a.color, &b.color, variances).map_err(|e| {
        SessionError::Caller(format!("{} against {}: {e}", picture.display(), reference.display()))
    })
}

//! Comparison of two picture files.

use std::path::Path;

use pumice_core::Job;
use pumice_picture::film::variance_known;
use pumice_picture::metrics::{CompareError, Comparison, compare};
use pumice_picture::{Picture, read_exr};
use serde::Serialize;

use crate::error::{Result, SessionError};

/// The difference of two picture files.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparedPictures {
    /// Of their colours, which are premultiplied.
    #[serde(flatten)]
    pub colors: Comparison,
    /// Root of the mean squared difference of alpha, which is 1 in a picture without it; `None` where neither has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_rmse: Option<f64>,
}

/// Compares a picture with its reference, both OpenEXR. If both files hold their variance and neither is denoised, a statistical test is
/// included.
///
/// # Errors
/// When either cannot be read, they differ in size, or a value is not finite; [`pumice_core::Error::Cancelled`] when `job` is cancelled.
pub fn compare_pictures(picture: &Path, reference: &Path, job: &Job) -> Result<ComparedPictures> {
    let read = |path| {
        job.check()?;
        read_exr(path).map_err(SessionError::from)
    };
    let (a, b) = (read(picture)?, read(reference)?);
    // The variance of a denoised picture is that of its samples' mean, and its bias is in neither.
    let testable = !is_denoised(&a) && !is_denoised(&b);
    let variances = a.variance.as_ref().zip(b.variance.as_ref()).filter(|_| testable);
    let variances = variances.map(|(a, b)| (variance_known(a), variance_known(b)));
    let wrong = |e: &dyn std::fmt::Display| {
        SessionError::Caller(format!("{} against {}: {e}", picture.display(), reference.display()))
    };
    let colors = compare(&a.color, &b.color, variances, &|| job.is_cancelled()).map_err(|e| match e {
        CompareError::Cancelled => pumice_core::Error::Cancelled.into(),
        e => wrong(&e),
    })?;
    let alpha_rmse = alpha_rmse(&a, &b);
    if alpha_rmse.is_some_and(|rmse| !rmse.is_finite()) {
        return Err(wrong(&"alpha is not finite everywhere"));
    }
    Ok(ComparedPictures { colors, alpha_rmse })
}

/// Root of the mean squared difference of alpha of two pictures of the same size; `None` where neither has it.
fn alpha_rmse(a: &Picture, b: &Picture) -> Option<f64> {
    if a.alpha.is_none() && b.alpha.is_none() {
        return None;
    }
    let of = |picture: &Picture, i: usize| picture.alpha.as_ref().map_or(1.0, |alpha| f64::from(alpha[i]));
    let pixels = a.color.pixels.len();
    let sum: f64 = (0..pixels).map(|i| (of(a, i) - of(b, i)).powi(2)).sum();
    Some((sum / pixels as f64).sqrt())
}

/// Whether a picture says that it is no mean of samples.
fn is_denoised(picture: &Picture) -> bool {
    picture.noisy.is_some() || picture.provenance.as_ref().is_some_and(|made| made.denoised.is_some())
}

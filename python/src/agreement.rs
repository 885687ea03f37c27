//! The test of two sets of pictures, of any renderers.

use std::convert::Infallible;

use pumice_picture::Image;
use pumice_picture::agreement::{Agreement, LEVEL, PictureSet, judge};
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use serde_json::json;

use crate::errors::input;
use crate::waiting::detached;

/// Judges pictures (n, height, width, 3) of 32-bit floats against others of the same size; `covered` (height, width) has a byte for each
/// pixel, 0 where it shows no surface. Returns the verdict and its statistics as JSON text.
#[pyfunction]
pub(crate) fn agreement(
    py: Python<'_>,
    ours: &Bound<'_, PyAny>,
    theirs: &Bound<'_, PyAny>,
    covered: &Bound<'_, PyAny>,
) -> PyResult<String> {
    let covered: Vec<bool> = PyBuffer::<u8>::get(covered)?.to_vec(py)?.into_iter().map(|c| c != 0).collect();
    let (ours, theirs) = (pictures(ours)?, pictures(theirs)?);
    if ours.size() != theirs.size() || covered.len() != ours.size().into_iter().product::<usize>() {
        return Err(input(&"agreement: expected pictures of one size"));
    }
    let agreement = detached(py, move || Ok::<_, Infallible>(judge(&ours, &theirs, &covered, LEVEL)))?;
    as_json(&agreement)
}

fn as_json(agreement: &Agreement) -> PyResult<String> {
    let mut report = serde_json::to_value(agreement).map_err(|e| input(&e))?;
    report["sentence"] = json!(agreement.sentence());
    report["equality"]["agrees"] = json!(agreement.equality.agrees());
    Ok(report.to_string())
}

/// Two pictures or more, from an array (n, height, width, 3) of 32-bit floats.
pub(crate) fn pictures(array: &Bound<'_, PyAny>) -> PyResult<PictureSet> {
    let buffer = PyBuffer::<f32>::get(array)?;
    let &[count, height, width, 3] = buffer.shape() else {
        let got = buffer.shape();
        return Err(input(&format_args!("pictures: expected the shape (n, height, width, 3), got {got:?}")));
    };
    if count < 2 || height * width == 0 {
        return Err(input(&format_args!(
            "pictures: expected two pictures or more, of a pixel or more, got {count} of {width} × {height} pixels"
        )));
    }
    let values = buffer.to_vec(array.py())?;
    let (pixels, _) = values.as_chunks::<3>();
    let mut set = PictureSet::default();
    for picture in pixels.chunks_exact(height * width) {
        set.push(Image::new(width, height, picture.to_vec()));
    }
    Ok(set)
}

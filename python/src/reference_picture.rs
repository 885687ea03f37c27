//! A stored reference, and the test of pictures against it.

use std::convert::Infallible;

use pumice_picture::agreement::{self, ReferenceArrays, judge_equality};
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use serde_json::json;

use crate::agreement::pictures;
use crate::array::{Array, Data};
use crate::errors::input;
use crate::waiting::detached;

/// The mean picture of many seeds, with its noise. Arrays are of 64-bit floats.
#[pyclass(frozen, module = "pumice._native")]
pub(crate) struct ReferencePicture(agreement::ReferencePicture);

#[pymethods]
impl ReferencePicture {
    /// The reference of pictures (n, height, width, 3) of 32-bit floats.
    #[staticmethod]
    fn of(py: Python<'_>, pictures: &Bound<'_, PyAny>) -> PyResult<Self> {
        let set = self::pictures(pictures)?;
        let found = detached(py, move || Ok::<_, Infallible>(agreement::ReferencePicture::of(&set)))?;
        found.map(Self).map_err(|e| input(&e))
    }

    /// The reference of `seeds` pictures that these arrays of 64-bit floats store: mean and variance (height, width, 3), tile_variance
    /// (rows, columns, 3), total_variance (3).
    #[staticmethod]
    fn stored(
        mean: &Bound<'_, PyAny>,
        variance: &Bound<'_, PyAny>,
        tile_variance: &Bound<'_, PyAny>,
        total_variance: &Bound<'_, PyAny>,
        seeds: usize,
    ) -> PyResult<Self> {
        let (size, mean) = values("mean", mean)?;
        let &[height, width, _] = &size[..] else {
            return Err(input(&format_args!("mean: expected the shape (height, width, 3), got {size:?}")));
        };
        let (shape, total) = values("total_variance", total_variance)?;
        let &[total_variance] = &total[..] else {
            return Err(input(&format_args!("total_variance: expected the shape (3), got {shape:?}")));
        };
        let arrays = ReferenceArrays {
            size: [width, height],
            mean,
            variance: values("variance", variance)?.1,
            tile_variance: values("tile_variance", tile_variance)?.1,
            total_variance,
            seeds,
        };
        agreement::ReferencePicture::from_arrays(&arrays).map(Self).map_err(|e| input(&e))
    }

    /// mean, variance, tile_variance and total_variance in the shapes of `stored`, and seeds.
    fn arrays(&self) -> (Array, Array, Array, Array, usize) {
        let arrays = self.0.arrays();
        let [width, height] = arrays.size;
        let of =
            |values: Vec<[f64; 3]>, shape: &[usize]| Array::new(Data::F64(values.into_flattened()), shape);
        let tiles = [height, width].map(|n| n.div_ceil(agreement::TILE_PIXELS));
        (
            of(arrays.mean, &[height, width, 3]),
            of(arrays.variance, &[height, width, 3]),
            of(arrays.tile_variance, &[tiles[0], tiles[1], 3]),
            of(vec![arrays.total_variance], &[3]),
            arrays.seeds,
        )
    }

    /// Tests pictures (n, height, width, 3) of 32-bit floats against this. Returns whether they agree, and the statistics, as JSON text.
    fn judge(&self, py: Python<'_>, pictures: &Bound<'_, PyAny>) -> PyResult<String> {
        let set = self::pictures(pictures)?;
        let found = detached(py, || Ok::<_, Infallible>(judge_equality(&set, &self.0)))?;
        let found = found.map_err(|e| input(&e))?;
        let mut report = serde_json::to_value(found).map_err(|e| input(&e))?;
        report["agrees"] = json!(found.agrees());
        report["sentence"] = json!(found.to_string());
        Ok(report.to_string())
    }
}

/// The shape of an array whose last axis has three channels, and its values.
fn values(name: &str, array: &Bound<'_, PyAny>) -> PyResult<(Vec<usize>, Vec<[f64; 3]>)> {
    let buffer = PyBuffer::<f64>::get(array)?;
    let shape = buffer.shape().to_vec();
    if shape.last() != Some(&3) {
        return Err(input(&format_args!(
            "{name}: expected a last axis of 3 channels, got the shape {shape:?}"
        )));
    }
    let values = buffer.to_vec(array.py())?;
    let (triples, _) = values.as_chunks::<3>();
    Ok((shape, triples.to_vec()))
}

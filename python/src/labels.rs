//! Columns of labels, as Python has them in arrays: which are drawn, their groups and their colours. No object and no text is made for a
//! single label.

use pumice_scene::{LabelGroups as Groups, Material, Show};
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use crate::errors::{IntoException, input};

/// The groups of a volume's labels.
#[pyclass(frozen, module = "pumice._native")]
pub(crate) struct LabelGroups(pub(crate) Groups);

#[pymethods]
impl LabelGroups {
    /// Label `ids[i]`, in rising order, belongs to group `groups[i]` and has the linear colour `colors[4 i..4 i + 3]`. `materials` is a JSON
    /// list of a material for each group, and `colored` says whether colours of labels replace its base colour.
    #[new]
    fn new(
        py: Python<'_>,
        ids: PyBuffer<u64>,
        groups: PyBuffer<u32>,
        colors: PyBuffer<f32>,
        materials: &str,
        colored: Vec<bool>,
    ) -> PyResult<Self> {
        let materials: Vec<Material> =
            serde_json::from_str(materials).map_err(|e| input(&format_args!("materials: {e}")))?;
        if materials.len() != colored.len() {
            return Err(input(&format_args!(
                "colored: expected one value for each of {} materials, got {}",
                materials.len(),
                colored.len()
            )));
        }
        let materials: Vec<(Material, bool)> = materials.into_iter().zip(colored).collect();
        let (ids, groups, colors) = (ids.to_vec(py)?, groups.to_vec(py)?, colors.to_vec(py)?);
        Groups::from_columns(&materials, &ids, &groups, fours(&colors)?)
            .map(Self)
            .map_err(IntoException::into_exception)
    }

    /// The same groups, in which label `ids[i]`, in rising order, has the linear colour `colors[4 i..4 i + 3]`.
    fn with_colors(&self, py: Python<'_>, ids: PyBuffer<u64>, colors: PyBuffer<f32>) -> PyResult<Self> {
        let (ids, colors) = (ids.to_vec(py)?, colors.to_vec(py)?);
        self.0.with_colors(&ids, fours(&colors)?).map(Self).map_err(IntoException::into_exception)
    }
}

/// Colours of four numbers each.
fn fours(colors: &[f32]) -> PyResult<&[[f32; 4]]> {
    match colors.as_chunks::<4>() {
        (fours, []) => Ok(fours),
        _ => Err(input(&"colors: expected four numbers for each label")),
    }
}

/// The choice of drawn labels from one byte for each label, 0 where it is hidden.
pub(crate) fn show(py: Python<'_>, ids: &PyBuffer<u64>, visible: &PyBuffer<u8>) -> PyResult<Show> {
    let (ids, flags) = (ids.to_vec(py)?, visible.to_vec(py)?);
    Show::from_flags(ids.iter().copied(), flags.iter().map(|byte| *byte != 0))
        .map_err(IntoException::into_exception)
}

/// Which labels are drawn, as arrays: ids in rising order, and one byte for each.
pub(crate) type Visible = (PyBuffer<u64>, PyBuffer<u8>);

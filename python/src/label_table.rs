//! Tables of labels: reading and writing files, and the query line for tables that Python has.

use std::path::PathBuf;

use pumice_core::{AnnotationTable as Table, LabelColumns, Numbers, NumericColumn};
use pumice_session::{LabelTableFormat, SessionError};
use pyo3::prelude::*;

use crate::array::{Array, Data};
use crate::errors::input;
use crate::waiting::detached;

/// Names, types, colours and numbers of labels by id.
#[pyclass(frozen, module = "pumice._native")]
pub(crate) struct AnnotationTable(pub(crate) Table);

#[pymethods]
impl AnnotationTable {
    /// A table of these rows, which are sorted by id.
    #[new]
    fn new(
        ids: Vec<u64>,
        names: Vec<String>,
        types: Vec<String>,
        colors: Vec<Option<[f32; 3]>>,
        columns: Vec<(String, Vec<f64>)>,
    ) -> PyResult<Self> {
        let columns = columns.into_iter().map(|(name, values)| NumericColumn { name, values }).collect();
        Table::new(ids, names, types, colors, columns).map(Self).map_err(|e| input(&e))
    }

    /// Ids, in rising order.
    fn ids(&self) -> Array {
        Array::new(Data::U64(self.0.ids().to_vec()), &[self.0.len()])
    }

    /// Names, empty where a row has none.
    fn names(&self) -> Vec<String> {
        self.0.names().to_vec()
    }

    /// Types, empty where a row has none.
    fn types(&self) -> Vec<String> {
        self.0.types().to_vec()
    }

    /// sRGB colours, NaN where a row has none.
    fn colors(&self) -> Array {
        colors_of(self.0.colors_srgb().iter().copied())
    }

    /// Columns of numbers by name.
    fn columns(&self) -> Vec<(String, Array)> {
        columns_of(self.0.columns())
    }

    /// Whether a query line holds, for each row.
    fn query(&self, py: Python<'_>, line: &str) -> PyResult<Array> {
        let table = &self.0;
        let numbers = table.columns().iter().map(|c| (c.name.clone(), Numbers::Real(&c.values)));
        let numbers = numbers.collect::<Vec<_>>();
        detached(py, || matching(line, table.ids(), table.names(), table.types(), &numbers))
    }

    /// Writes a file in the format of this name, or in that of the file's name; returns what the format does not hold, a line each.
    fn save(&self, py: Python<'_>, path: PathBuf, format: Option<&str>) -> PyResult<Vec<String>> {
        let format = match format {
            Some(name) => LabelTableFormat::of_name(name).ok_or_else(|| {
                let known = LabelTableFormat::ALL.map(LabelTableFormat::name).join(", ");
                input(&format_args!("format: expected one of {known}, got {name:?}"))
            })?,
            None => LabelTableFormat::of_file_name(&path).map_err(|e| input(&e))?,
        };
        detached(py, || pumice_formats::write_label_table(&path, format, &self.0))
    }
}

/// Colours as an array (n, 3), NaN where there is none.
pub(crate) fn colors_of(colors: impl ExactSizeIterator<Item = Option<[f32; 3]>>) -> Array {
    let n = colors.len();
    let colors: Vec<[f32; 3]> = colors.map(|color| color.unwrap_or([f32::NAN; 3])).collect();
    Array::new(Data::F32(colors.into_flattened()), &[n, 3])
}

/// Columns of numbers as arrays.
pub(crate) fn columns_of(columns: &[NumericColumn]) -> Vec<(String, Array)> {
    let array = |c: &NumericColumn| Array::new(Data::F64(c.values.clone()), &[c.values.len()]);
    columns.iter().map(|c| (c.name.clone(), array(c))).collect()
}

/// Reads a table of labels; returns it, the name of its format, and what its reader left out, a line each.
#[pyfunction]
pub(crate) fn read_label_table(
    py: Python<'_>,
    path: PathBuf,
) -> PyResult<(AnnotationTable, &'static str, Vec<String>)> {
    let read = detached(py, || Ok::<_, SessionError>(pumice_formats::read_label_table(&path)?))?;
    Ok((AnnotationTable(read.table), read.format.name(), read.notes))
}

/// A column of numbers from Python.
#[derive(FromPyObject)]
pub(crate) enum Column {
    /// Whole numbers, which are compared exactly.
    Whole(Vec<u64>),
    /// Other numbers.
    Real(Vec<f64>),
}

/// Whether a query line holds, for each row of a table. Names and types are empty, or as many as there are ids.
#[pyfunction]
pub(crate) fn query_labels(
    py: Python<'_>,
    line: &str,
    ids: Vec<u64>,
    names: Vec<String>,
    types: Vec<String>,
    columns: Vec<(String, Column)>,
) -> PyResult<Array> {
    let rows = ids.len();
    let lengths = columns.iter().map(|(name, column)| match column {
        Column::Whole(values) => (name.as_str(), values.len()),
        Column::Real(values) => (name.as_str(), values.len()),
    });
    let texts =
        [("names", names.len()), ("types", types.len())].into_iter().filter(|(_, length)| *length > 0);
    if let Some((name, got)) = texts.chain(lengths).find(|(_, length)| *length != rows) {
        return Err(input(&format_args!("{name}: expected {rows} values, one an id, got {got}")));
    }
    let numbers = columns.iter().map(|(name, column)| match column {
        Column::Whole(values) => (name.clone(), Numbers::Whole(values)),
        Column::Real(values) => (name.clone(), Numbers::Real(values)),
    });
    let numbers = numbers.collect::<Vec<_>>();
    detached(py, || matching(line, &ids, &names, &types, &numbers))
}

/// Whether a query line holds, for each row of these columns.
fn matching(
    line: &str,
    ids: &[u64],
    names: &[String],
    types: &[String],
    numbers: &[(String, Numbers<'_>)],
) -> Result<Array, SessionError> {
    let query = pumice_session::parse_query(line)?;
    let numbers: Vec<(&str, Numbers<'_>)> = numbers.iter().map(|(name, n)| (name.as_str(), *n)).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let types: Vec<&str> = types.iter().map(String::as_str).collect();
    let table = LabelColumns { ids, names: &names, types: &types, numbers: &numbers };
    let chosen = query.matches(&table).map_err(|e| SessionError::Caller(e.to_string()))?;
    let rows = chosen.len();
    Ok(Array::new(Data::Bool(chosen), &[rows]))
}

//! Annotations of labels by id, as tables of other programs have them: names, types, colours and numbers.
//!
//! ```text
//! id   name      type    color     depth      one row an id, ids rising
//! 3    "PV 12"   axon    #ff8000   41.5
//! 17   ""        glia    none      NaN        an empty text, no colour, NaN: the table says nothing
//! ```
//! [`CompressedVolume::annotate`] gives a volume what a table says about its labels. A cell that says nothing leaves what the volume has.
//! Rows of ids that the volume lacks, and labels without a row, are returned, so that the caller can tell its user. Id 0 is background: it
//! may have a row, which nothing takes.

use std::collections::BTreeMap;

use crate::label_table::NO_TYPE;
use crate::types::numbered;
use crate::{CompressedVolume, Error, LabelNote, Result};

/// Names of columns that the volume itself determines or that are no numbers. A table cannot give them to a volume.
pub const OWN_COLUMNS: [&str; 15] = [
    "id", "name", "type", "color", "voxels", "boxes", "low_x", "low_y", "low_z", "high_x", "high_y",
    "high_z", "centre_x", "centre_y", "centre_z",
];

/// Most columns of numbers that a table may have: a table of more is no table of labels.
const MOST_COLUMNS: usize = 1000;

/// A number for each label of a table, or for each row.
#[derive(Clone, Debug)]
pub struct NumericColumn {
    /// The column's name, which is not empty.
    pub name: String,
    /// A finite number for each row, or NaN where there is none.
    pub values: Vec<f64>,
}

/// Equal where name and bits are, so that a missing number equals itself.
impl PartialEq for NumericColumn {
    fn eq(&self, other: &Self) -> bool {
        let bits = |column: &Self| column.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        self.name == other.name && bits(self) == bits(other)
    }
}

impl Eq for NumericColumn {}

/// Names, types, colours and numbers by label id.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AnnotationTable {
    ids: Vec<u64>,
    names: Vec<String>,
    types: Vec<String>,
    colors_srgb: Vec<Option<[f32; 3]>>,
    columns: Vec<NumericColumn>,
}

/// What of a table did not fit the volume that it annotates.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AnnotationFit {
    /// Number of labels that have a row.
    pub labels_with_row: u64,
    /// Ids of rows for which the volume has no label, rising; without 0.
    pub ids_without_label: Vec<u64>,
    /// Ids of labels for which the table has no row, rising.
    pub labels_without_row: Vec<u64>,
    /// Names of columns that the volume did not take, because it has its own ([`OWN_COLUMNS`]).
    pub columns_left_out: Vec<String>,
}

impl AnnotationTable {
    /// A table with these rows, which it sorts by id. `names` and `types` have an empty text, `colors_srgb` (sRGB-encoded, each channel in
    /// [0, 1]) `None` and `columns` NaN where a row says nothing.
    ///
    /// # Errors
    /// [`Error::Caller`] for columns of another length than `ids`, two rows of one id, a colour outside of [0, 1], an infinite number, an
    /// empty name of a column or two of the same name; [`Error::Limit`] for too many columns.
    pub fn new(
        ids: Vec<u64>,
        names: Vec<String>,
        types: Vec<String>,
        colors_srgb: Vec<Option<[f32; 3]>>,
        columns: Vec<NumericColumn>,
    ) -> Result<Self> {
        let rows = ids.len();
        let lengths = [("names", names.len()), ("types", types.len()), ("colours", colors_srgb.len())];
        let columns_lengths = columns.iter().map(|c| (c.name.as_str(), c.values.len()));
        for (what, length) in lengths.into_iter().chain(columns_lengths) {
            if length != rows {
                return Err(Error::Caller(format!("table, {what}: expected {rows} rows, got {length}")));
            }
        }
        check_names(&columns)?;
        for (row, &id) in ids.iter().enumerate() {
            let in_range = |c: &[f32; 3]| c.iter().all(|v| (0.0..=1.0).contains(v));
            if let Some(color) = colors_srgb[row].filter(|c| !in_range(c)) {
                let what = format!("table, label {id}: expected a colour from 0 to 1, got {color:?}");
                return Err(Error::Caller(what));
            }
            if let Some(column) = columns.iter().find(|c| c.values[row].is_infinite()) {
                let (name, got) = (&column.name, column.values[row]);
                let what = format!("table, label {id}, {name}: expected a finite number, got {got}");
                return Err(Error::Caller(what));
            }
        }

        // Sort the rows by id; a table that is sorted already is only checked.
        let mut order: Vec<usize> = (0..rows).collect();
        order.sort_by_key(|&row| ids[row]);
        if let Some(twice) = order.windows(2).find(|pair| ids[pair[0]] == ids[pair[1]]) {
            let what = format!("table: expected one row an id, got two of {}", ids[twice[0]]);
            return Err(Error::Caller(what));
        }
        let table = Self { ids, names, types, colors_srgb, columns };
        Ok(if order.is_sorted() { table } else { table.rows(&order) })
    }

    /// The rows at these indices, in this order.
    fn rows(&self, order: &[usize]) -> Self {
        fn pick<T: Clone>(values: &[T], order: &[usize]) -> Vec<T> {
            order.iter().map(|&row| values[row].clone()).collect()
        }
        let column =
            |c: &NumericColumn| NumericColumn { name: c.name.clone(), values: pick(&c.values, order) };
        Self {
            ids: pick(&self.ids, order),
            names: pick(&self.names, order),
            types: pick(&self.types, order),
            colors_srgb: pick(&self.colors_srgb, order),
            columns: self.columns.iter().map(column).collect(),
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Whether the table has no rows.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// Ids of the rows, rising.
    pub fn ids(&self) -> &[u64] {
        &self.ids
    }

    /// Names by row; empty where a row has none.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Types by row; empty where a row has none.
    pub fn types(&self) -> &[String] {
        &self.types
    }

    /// sRGB-encoded colours by row, each channel in [0, 1].
    pub fn colors_srgb(&self) -> &[Option<[f32; 3]>] {
        &self.colors_srgb
    }

    /// Columns of numbers.
    pub fn columns(&self) -> &[NumericColumn] {
        &self.columns
    }
}

/// Checks that columns have names, each its own, and that there are not too many.
pub(crate) fn check_names(columns: &[NumericColumn]) -> Result<()> {
    if columns.len() > MOST_COLUMNS {
        let (limit, got) = (MOST_COLUMNS as u64, columns.len() as u64);
        return Err(Error::Limit { what: "columns of a table".into(), limit, got });
    }
    let mut names: Vec<&str> = columns.iter().map(|c| c.name.as_str()).collect();
    names.sort_unstable();
    if names.first().is_some_and(|name| name.is_empty()) {
        return Err(Error::Caller("table: expected a name for each column, got an empty one".into()));
    }
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(Error::Caller(format!("table: expected one column {}, got two", pair[0]))),
        None => Ok(()),
    }
}

impl CompressedVolume {
    /// Gives the labels of this volume the names, types, colours and numbers that a table has for them. Returns what did not fit.
    ///
    /// # Errors
    /// [`Error::Limit`] for more types than a volume can have, [`Error::Caller`] where the volume and the table together have a faulty set
    /// of columns. The volume is then unchanged.
    pub fn annotate(&mut self, table: &AnnotationTable) -> Result<AnnotationFit> {
        let row_of: Vec<Option<usize>> =
            self.labels.ids.iter().map(|id| table.ids.binary_search(id).ok()).collect();
        let (types, type_names) = self.types_with(table, &row_of)?;
        let (columns, columns_left_out) = self.columns_with(table, &row_of)?;
        self.info.notes = self.notes_with(table);
        (self.labels.types, self.labels.type_names) = (types, type_names);
        self.labels.columns = columns;

        let without_label = |id: &&u64| **id != 0 && self.labels.index_of(**id).is_none();
        let rows = self.labels.ids.iter().zip(&row_of);
        Ok(AnnotationFit {
            labels_with_row: row_of.iter().flatten().count() as u64,
            ids_without_label: table.ids.iter().filter(without_label).copied().collect(),
            labels_without_row: rows.filter(|(_, row)| row.is_none()).map(|(&id, _)| id).collect(),
            columns_left_out,
        })
    }

    /// Names and colours: those of the table, and where it says nothing, those that the volume has.
    fn notes_with(&self, table: &AnnotationTable) -> Vec<LabelNote> {
        let mut notes: BTreeMap<u64, LabelNote> =
            self.info.notes.iter().map(|note| (note.id, note.clone())).collect();
        for (row, &id) in table.ids.iter().enumerate() {
            let (name, color_srgb) = (&table.names[row], table.colors_srgb[row]);
            if (name.is_empty() && color_srgb.is_none()) || self.labels.index_of(id).is_none() {
                continue;
            }
            let note = notes.entry(id).or_insert(LabelNote { id, name: None, color_srgb: None });
            if !name.is_empty() {
                note.name = Some(name.clone());
            }
            note.color_srgb = color_srgb.or(note.color_srgb);
        }
        notes.into_values().collect()
    }

    /// Type numbers by label, and the names of the types.
    fn types_with(
        &self,
        table: &AnnotationTable,
        row_of: &[Option<usize>],
    ) -> Result<(Vec<u16>, Vec<String>)> {
        if table.types.iter().all(String::is_empty) {
            return Ok((self.labels.types.clone(), self.labels.type_names.clone()));
        }
        let own = |label: usize| {
            self.labels.type_of(label as u32).map_or("", |t| self.labels.type_names[usize::from(t)].as_str())
        };
        let of_table = |row: &Option<usize>| row.map_or("", |row| table.types[row].as_str());
        let types: Vec<&str> = row_of
            .iter()
            .enumerate()
            .map(|(label, row)| Some(of_table(row)).filter(|t| !t.is_empty()).unwrap_or_else(|| own(label)))
            .collect();
        let names = numbered(types.iter().filter(|t| !t.is_empty()).map(|&t| t.to_owned()).collect())?;
        let number = |name: &&str| match name.is_empty() {
            true => NO_TYPE,
            false => names.partition_point(|n| n.as_str() < *name) as u16,
        };
        Ok((types.iter().map(number).collect(), names))
    }

    /// Columns of numbers, and the names of those of the table that are left out.
    fn columns_with(
        &self,
        table: &AnnotationTable,
        row_of: &[Option<usize>],
    ) -> Result<(Vec<NumericColumn>, Vec<String>)> {
        let mut columns = self.labels.columns.clone();
        let mut left_out = Vec::new();
        for column in &table.columns {
            if OWN_COLUMNS.contains(&column.name.as_str()) {
                left_out.push(column.name.clone());
                continue;
            }
            let values: Vec<f64> =
                row_of.iter().map(|row| row.map_or(f64::NAN, |row| column.values[row])).collect();
            match columns.iter_mut().find(|own| own.name == column.name) {
                Some(own) => own
                    .values
                    .iter_mut()
                    .zip(&values)
                    .filter(|(_, v)| !v.is_nan())
                    .for_each(|(own, &v)| *own = v),
                None => columns.push(NumericColumn { name: column.name.clone(), values }),
            }
        }
        check_names(&columns)?;
        Ok((columns, left_out))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LabelBuffer, LabelType, VolumeInfo, compress_labels};

    fn column(name: &str, values: &[f64]) -> NumericColumn {
        NumericColumn { name: name.into(), values: values.to_vec() }
    }

    fn texts(texts: &[&str]) -> Vec<String> {
        texts.iter().map(|&t| t.to_owned()).collect()
    }

    /// Labels 2, 5 and 9; 2 has a name, 9 a colour.
    fn volume() -> CompressedVolume {
        let mut info = VolumeInfo::new([4, 1, 1], LabelType::U8);
        info.notes = vec![
            LabelNote { id: 2, name: Some("two".into()), color_srgb: None },
            LabelNote { id: 9, name: None, color_srgb: Some([0.5; 3]) },
        ];
        compress_labels(info, LabelBuffer::U8(vec![0, 2, 5, 9])).unwrap()
    }

    #[test]
    fn a_table_gives_what_it_says_and_leaves_the_rest() {
        let mut volume = volume();
        let table = AnnotationTable::new(
            vec![9, 0, 2, 77],
            texts(&["nine", "nothing", "", "far"]),
            texts(&["glia", "", "axon", "soma"]),
            vec![None, None, Some([1.0, 0.0, 0.25]), None],
            vec![column("depth", &[9.5, 0.0, f64::NAN, 7.0]), column("voxels", &[1.0; 4])],
        )
        .unwrap();
        let fit = volume.annotate(&table).unwrap();
        assert_eq!(
            fit,
            AnnotationFit {
                labels_with_row: 2,
                ids_without_label: vec![77],
                labels_without_row: vec![5],
                columns_left_out: texts(&["voxels"]),
            }
        );
        let notes = [0, 1, 2].map(|label| volume.note(label).cloned());
        assert_eq!(
            notes,
            [
                Some(LabelNote { id: 2, name: Some("two".into()), color_srgb: Some([1.0, 0.0, 0.25]) }),
                None,
                Some(LabelNote { id: 9, name: Some("nine".into()), color_srgb: Some([0.5; 3]) }),
            ]
        );
        // The types of ids that the volume lacks are no types of the volume.
        assert_eq!(volume.labels().type_names(), ["axon", "glia"]);
        assert_eq!([0, 1, 2].map(|l| volume.labels().type_of(l)), [Some(0), None, Some(1)]);
        assert_eq!(volume.labels().columns(), [column("depth", &[f64::NAN, f64::NAN, 9.5])]);

        // A second table adds to the first.
        let more = AnnotationTable::new(
            vec![5, 9],
            texts(&["five", ""]),
            texts(&["", "axon"]),
            vec![None; 2],
            vec![column("depth", &[5.0, f64::NAN])],
        );
        volume.annotate(&more.unwrap()).unwrap();
        assert_eq!(volume.note(1).unwrap().name.as_deref(), Some("five"));
        assert_eq!(volume.labels().type_names(), ["axon"]);
        assert_eq!(volume.labels().columns(), [column("depth", &[f64::NAN, 5.0, 9.5])]);
    }

    #[test]
    fn rows_are_sorted_and_faulty_tables_refused() {
        let empty = |n: usize| (vec![String::new(); n], vec![String::new(); n], vec![None; n]);
        let make = |ids: &[u64], columns: Vec<NumericColumn>| {
            let (names, types, colors) = empty(ids.len());
            AnnotationTable::new(ids.to_vec(), names, types, colors, columns)
        };
        let sorted = make(&[u64::MAX, 3, 7], vec![column("a", &[1.0, 2.0, 3.0])]).unwrap();
        assert_eq!(
            (sorted.ids(), &sorted.columns()[0].values[..]),
            (&[3, 7, u64::MAX][..], &[2.0, 3.0, 1.0][..])
        );
        for (ids, columns, what) in [
            (&[3, 3][..], vec![], "one row an id, got two of 3"),
            (&[3], vec![column("a", &[])], "a: expected 1 rows, got 0"),
            (&[3], vec![column("", &[0.0])], "expected a name for each column"),
            (&[3], vec![column("a", &[0.0]), column("a", &[0.0])], "expected one column a, got two"),
            (&[3], vec![column("a", &[f64::INFINITY])], "label 3, a: expected a finite number, got inf"),
        ] {
            let error = make(ids, columns).unwrap_err().to_string();
            assert!(error.contains(what), "{error}");
        }
        let (names, types, _) = empty(1);
        let bright = AnnotationTable::new(vec![4], names, types, vec![Some([0.0, 1.5, 0.0])], vec![]);
        assert!(bright.unwrap_err().to_string().contains("label 4: expected a colour from 0 to 1"));
    }
}

//! The labels of a volume as a table: what the volume itself determines, and what tables gave to it.
//!
//! | column | what |
//! |---|---|
//! | `id` `name` `type` `color` | as the volume has them; empty where it has none |
//! | `voxels` `boxes` | number of voxels, and of boxes that hold them |
//! | `low_x` … `high_z` | lowest and highest voxel of the label, both inclusive |
//! | `centre_x` `centre_y` `centre_z` | middle of these bounds in the volume's world, in its unit |
//! | others | the columns of [`pumice_core::LabelTable::columns`] |
//!
//! Bounds of a label of which no voxel was read are NaN. Finding bounds takes a walk over all boxes, so it is done only when they are
//! needed.

use std::path::Path;

use glam::DVec3;
use pumice_core::annotations::OWN_COLUMNS;
use pumice_core::{
    AnnotationTable, CompressedVolume, LabelColumns, LabelQuery, Numbers, NumericColumn, QueryError,
};
use pumice_formats::label_tables::csv_of_rows;
use pumice_picture::metrics::display::srgb_from_linear;
use pumice_transport::palette::assign_colors;

use crate::error::{Result, SessionError};

/// Names of the columns that a walk over all boxes gives, in the order of [`walked_columns`].
const WALKED: [&str; 10] =
    ["boxes", "low_x", "low_y", "low_z", "high_x", "high_y", "high_z", "centre_x", "centre_y", "centre_z"];

/// Labels of a volume as columns, by dense index.
#[derive(Debug)]
pub struct LabelRows<'a> {
    volume: &'a CompressedVolume,
    names: Vec<&'a str>,
    types: Vec<&'a str>,
    colors_srgb: Vec<Option<[f32; 3]>>,
    /// The columns of [`WALKED`]; empty where they are not needed.
    walked: Vec<NumericColumn>,
}

impl<'a> LabelRows<'a> {
    /// All columns of a volume's labels.
    pub fn of(volume: &'a CompressedVolume) -> Self {
        Self { walked: walked_columns(volume), ..Self::without_bounds(volume) }
    }

    /// The columns that a query compares, and those that cost nothing.
    pub fn for_query(volume: &'a CompressedVolume, query: &LabelQuery) -> Self {
        // Names that are unknown count too: the error about them then has all names.
        let rows = Self::without_bounds(volume);
        let numbers = rows.numbers();
        let is_there = |name: &str| name == "id" || numbers.iter().any(|(known, _)| *known == name);
        match query.column_names().all(is_there) {
            true => rows,
            false => Self::of(volume),
        }
    }

    fn without_bounds(volume: &'a CompressedVolume) -> Self {
        let labels = volume.labels();
        let (mut names, mut colors_srgb) = (vec![""; labels.len()], vec![None; labels.len()]);
        // Both lists rise by id, so one walk over both finds the label of each note.
        let mut label = 0;
        for note in &volume.info().notes {
            label += labels.ids()[label..].iter().take_while(|&&id| id < note.id).count();
            if labels.ids().get(label) == Some(&note.id) {
                names[label] = note.name.as_deref().unwrap_or_default();
                colors_srgb[label] = note.color_srgb;
            }
        }
        let name_of_type =
            |label: u32| labels.type_of(label).map_or("", |t| labels.type_names()[usize::from(t)].as_str());
        Self {
            volume,
            names,
            types: (0..labels.len() as u32).map(name_of_type).collect(),
            colors_srgb,
            walked: Vec::new(),
        }
    }

    /// Ids by row, rising.
    pub fn ids(&self) -> &'a [u64] {
        self.volume.labels().ids()
    }

    /// Names by row; empty where a label has none.
    pub fn names(&self) -> &[&'a str] {
        &self.names
    }

    /// Types by row; empty where a label has none.
    pub fn types(&self) -> &[&'a str] {
        &self.types
    }

    /// sRGB-encoded colours by row, where labels have one.
    pub fn colors_srgb(&self) -> &[Option<[f32; 3]>] {
        &self.colors_srgb
    }

    /// Columns of numbers by name: `voxels`, those of the boxes if they were asked for, then those that tables gave.
    pub fn numbers(&self) -> Vec<(&str, Numbers<'_>)> {
        let labels = self.volume.labels();
        let columns = self.walked.iter().chain(labels.columns());
        let mut numbers = vec![("voxels", Numbers::Whole(labels.voxels()))];
        numbers.extend(columns.map(|c| (c.name.as_str(), Numbers::Real(&c.values))));
        numbers
    }

    /// Whether a query holds, by row.
    ///
    /// # Errors
    /// [`QueryError`] for a column that there is not.
    pub fn matches(&self, query: &LabelQuery) -> std::result::Result<Vec<bool>, QueryError> {
        query.matches(&LabelColumns {
            ids: self.ids(),
            names: &self.names,
            types: &self.types,
            numbers: &self.numbers(),
        })
    }

    /// Indices of the rows for which a query holds, ordered by a column: ids and texts rise, numbers fall; rows without a number come last,
    /// and equal ones by rising id.
    ///
    /// # Errors
    /// [`SessionError::Caller`] for a column that there is not.
    pub fn sorted(&self, query: &LabelQuery, by: &str) -> Result<Vec<usize>> {
        let chosen = self.matches(query).map_err(|e| SessionError::Caller(e.to_string()))?;
        let mut rows: Vec<usize> = (0..chosen.len()).filter(|&row| chosen[row]).collect();
        // Rows are in the order of ids, and the sorts are stable.
        match by {
            "id" => {}
            "name" => rows.sort_by_key(|&row| self.names[row]),
            "type" => rows.sort_by_key(|&row| self.types[row]),
            _ => match self.numbers().into_iter().find(|(name, _)| *name == by) {
                Some((_, Numbers::Whole(values))) => rows.sort_by_key(|&row| std::cmp::Reverse(values[row])),
                Some((_, Numbers::Real(values))) => {
                    let key = |row: usize| if values[row].is_nan() { f64::NEG_INFINITY } else { values[row] };
                    rows.sort_by(|&a, &b| key(b).total_cmp(&key(a)));
                }
                None => {
                    let known: Vec<&str> = self.numbers().into_iter().map(|(name, _)| name).collect();
                    let known = known.join(", ");
                    let what = format!("sort: expected id, name, type, {known}, got {by}");
                    return Err(SessionError::Caller(pumice_core::error::one_line(&what)));
                }
            },
        }
        Ok(rows)
    }

    /// A line for each id that a query names and the volume lacks.
    pub fn lacked(&self, query: &LabelQuery) -> Vec<String> {
        let lacks = |id: &u64| self.ids().binary_search(id).is_err();
        query.named_ids().filter(lacks).map(|id| format!("query: the volume has no label {id}")).collect()
    }

    /// Gives each label without a colour one that differs from its neighbours', as pictures do; returns how many there are.
    pub fn fill_colors(&mut self) -> u64 {
        let labels = self.volume.labels();
        let automatic = assign_colors(labels.len(), labels.contacts().iter(), None);
        let mut filled = 0;
        for (color, linear) in self.colors_srgb.iter_mut().zip(automatic) {
            if color.is_none() {
                *color = Some(linear.map(|c| srgb_from_linear(f64::from(c).clamp(0.0, 1.0)) as f32));
                filled += 1;
            }
        }
        filled
    }

    /// These rows, in this order, as CSV; `path` is named in errors.
    ///
    /// # Errors
    /// As [`LabelRows::table`].
    pub fn csv(&self, path: &Path, rows: &[usize]) -> Result<String> {
        // A table has its rows in the order of ids, which is that of all rows here.
        let all: Vec<usize> = (0..self.ids().len()).collect();
        Ok(csv_of_rows(path, &self.table(&all)?, rows)?)
    }

    /// These rows as a table that files can hold.
    ///
    /// # Errors
    /// As [`AnnotationTable::new`].
    pub fn table(&self, rows: &[usize]) -> Result<AnnotationTable> {
        let texts = |texts: &[&str]| rows.iter().map(|&row| texts[row].to_owned()).collect();
        let columns = self.numbers().into_iter().map(|(name, numbers)| NumericColumn {
            name: name.to_owned(),
            values: match numbers {
                // A volume has fewer than 2⁵³ voxels that a machine could count.
                Numbers::Whole(values) => rows.iter().map(|&row| values[row] as f64).collect(),
                Numbers::Real(values) => rows.iter().map(|&row| values[row]).collect(),
            },
        });
        Ok(AnnotationTable::new(
            rows.iter().map(|&row| self.ids()[row]).collect(),
            texts(&self.names),
            texts(&self.types),
            rows.iter().map(|&row| self.colors_srgb[row]).collect(),
            columns.collect(),
        )?)
    }
}

/// The columns of [`WALKED`].
fn walked_columns(volume: &CompressedVolume) -> Vec<NumericColumn> {
    debug_assert!(WALKED.iter().all(|name| OWN_COLUMNS.contains(name)));
    let bounds = volume.label_bounds();
    let mut boxes = vec![0.0; bounds.len()];
    volume.for_each_box(|label, _| boxes[label as usize] += 1.0);
    let world_from_index = volume.info().world_from_index;
    let rows = bounds.iter().zip(&boxes).map(|(b, &boxes)| {
        if boxes == 0.0 {
            return [[0.0; 1].as_slice(), &[f64::NAN; 9]].concat();
        }
        let (low, high) = (b.low.map(f64::from), b.high.map(f64::from));
        let middle = (DVec3::from_array(low) + DVec3::from_array(high) + DVec3::ONE) / 2.0;
        let centre = world_from_index.transform_point3(middle).to_array();
        [[boxes].as_slice(), &low, &high, &centre].concat()
    });
    let mut columns = WALKED.map(|name| NumericColumn { name: name.to_owned(), values: Vec::new() });
    for row in rows {
        columns.iter_mut().zip(row).for_each(|(column, value)| column.values.push(value));
    }
    columns.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pumice_core::{LabelBuffer, LabelNote, LabelType, VolumeInfo, compress_labels};

    /// Label 7 at x 0 to 1, label 3 at x 4, label 9 at x 5; voxels of 2 × 1 × 1, the first corner at (10, 0, 0).
    fn volume() -> CompressedVolume {
        let mut info = VolumeInfo::new([6, 1, 1], LabelType::U8);
        info.world_from_index.matrix3.x_axis.x = 2.0;
        info.world_from_index.translation.x = 10.0;
        info.notes = vec![LabelNote { id: 3, name: Some("axon".into()), color_srgb: Some([1.0, 0.0, 0.0]) }];
        compress_labels(info, LabelBuffer::U8(vec![7, 7, 0, 0, 3, 9])).unwrap()
    }

    fn sorted(line: &str, by: &str) -> Vec<u64> {
        let volume = volume();
        let query = LabelQuery::parse(line).unwrap();
        let rows = LabelRows::of(&volume);
        rows.sorted(&query, by).unwrap().into_iter().map(|row| rows.ids()[row]).collect()
    }

    #[test]
    fn bounds_and_centres_are_those_of_the_voxels() {
        let volume = volume();
        let rows = LabelRows::of(&volume);
        let column = |name: &str| match rows.numbers().into_iter().find(|(known, _)| *known == name) {
            Some((_, Numbers::Real(values))) => values.to_vec(),
            Some((_, Numbers::Whole(values))) => values.iter().map(|&v| v as f64).collect(),
            None => panic!("no column {name}"),
        };
        for (name, expected) in [
            ("voxels", [1.0, 2.0, 1.0]),
            ("low_x", [4.0, 0.0, 5.0]),
            ("high_x", [4.0, 1.0, 5.0]),
            // The middle of [4, 5] is 4.5, twice that and 10 more is 19.
            ("centre_x", [19.0, 12.0, 21.0]),
            ("centre_y", [0.5; 3]),
        ] {
            assert_eq!(column(name), expected, "{name}");
        }
    }

    #[test]
    fn rows_are_chosen_and_sorted() {
        assert_eq!(sorted("", "voxels"), [7, 3, 9]);
        assert_eq!(sorted("", "id"), [3, 7, 9]);
        assert_eq!(sorted("", "name"), [7, 9, 3]);
        assert_eq!(sorted("", "centre_x"), [9, 3, 7]);
        assert_eq!(sorted("low_x>=4", "id"), [3, 9]);
        assert_eq!(sorted("axon", "id"), [3]);
        let volume = volume();
        let error = LabelRows::of(&volume).sorted(&LabelQuery::default(), "size").unwrap_err().to_string();
        assert!(
            error.starts_with("sort: expected id, name, type, voxels, boxes") && error.ends_with("got size"),
            "{error}"
        );
    }

    #[test]
    fn labels_without_a_colour_get_one_and_others_keep_theirs() {
        let volume = volume();
        let mut rows = LabelRows::of(&volume);
        assert_eq!(rows.fill_colors(), 2);
        assert_eq!(rows.colors_srgb()[0], Some([1.0, 0.0, 0.0]));
        assert!(rows.colors_srgb().iter().all(Option::is_some));
        assert_eq!(rows.fill_colors(), 0);
    }
}

//! Segment properties of Neuroglancer: the file `info`, JSON (`src/datasource/precomputed/segment_properties.md` in its repository).
//!
//! ```text
//! { "@type": "neuroglancer_segment_properties",
//!   "inline": { "ids": ["3", "17"],
//!               "properties": [ { "id": "name",  "type": "label",  "values": ["PV 12", ""] },
//!                               { "id": "type",  "type": "tags",   "tags": ["axon", "glia"], "values": [[0], [1]] },
//!                               { "id": "depth", "type": "number", "data_type": "float32", "values": [41.5, 7] } ] } }
//! ```
//! `label` is the name, `tags` are the type (several, in their order, with a space between), `number` are columns. `description` and `string`
//! are not read. There are no colours. Numbers are of 8, 16 or 32 bits, and JSON has none for a label without one; so columns that do not
//! fit are left out or rounded, and named. A tag has no spaces: they are written as `_`.

use std::collections::BTreeMap;
use std::path::Path;

use pumice_core::error::one_line;
use pumice_core::{AnnotationTable, NumericColumn};
use serde::Deserialize;
use serde_json::{Value, json};

use super::cells::{id, quoted};
use super::text::check_rows;
use super::{LabelTableFile, LabelTableFormat, checked};
use crate::error::{FormatError, Result};

const KIND: &str = "neuroglancer_segment_properties";

#[derive(Deserialize)]
struct Info {
    #[serde(rename = "@type")]
    kind: String,
    #[serde(default)]
    inline: Option<Inline>,
}

#[derive(Deserialize)]
struct Inline {
    ids: Vec<String>,
    #[serde(default)]
    properties: Vec<Property>,
}

#[derive(Deserialize)]
struct Property {
    id: String,
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    tags: Vec<String>,
    values: Values,
}

/// The values of a property; their type depends on that of the property.
#[derive(Deserialize)]
#[serde(untagged)]
enum Values {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
    Tags(Vec<Vec<usize>>),
    /// None of these: what stands there is found for the error.
    Other(Value),
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Texts(values) => values.len(),
            Self::Tags(values) => values.len(),
            Self::Other(value) => value.as_array().map_or(0, Vec::len),
        }
    }
}

/// Whether the text is JSON.
pub(super) fn recognises(text: &str) -> bool {
    text.trim_start().starts_with(['{', '['])
}

pub(super) fn read(path: &Path, text: &str) -> Result<LabelTableFile> {
    let info: Info = serde_json::from_str(text).map_err(|e| match (e.line(), e.column()) {
        // An error about the type of the whole has no place.
        (0, _) => FormatError::damaged(path, one_line(&format!("JSON: {e}"))),
        (line, column) => {
            let what = e.to_string();
            let what = what.split(" at line ").next().unwrap_or_default();
            super::wrong_cell(path, line as u64, column, one_line(&format!("JSON: {what}")))
        }
    })?;
    if info.kind != KIND {
        return Err(FormatError::damaged(
            path,
            format!("@type: expected `{KIND}`, got {}", quoted(&info.kind)),
        ));
    }
    let Some(Inline { ids, properties }) = info.inline else {
        return Err(FormatError::damaged(path, "inline: expected ids and properties, got none"));
    };
    check_rows(path, ids.len().saturating_sub(1))?;
    let rows = ids.len();
    let mut numbers: Vec<u64> = Vec::with_capacity(rows);
    let mut first_of: BTreeMap<u64, usize> = BTreeMap::new();
    for (row, text) in ids.iter().enumerate() {
        let wrong = |what| FormatError::damaged(path, format!("inline.ids[{row}]: {what}"));
        let number = id(text).map_err(wrong)?;
        if let Some(first) = first_of.insert(number, row) {
            return Err(wrong(format!("expected each id once, got {number} as in ids[{first}]")));
        }
        numbers.push(number);
    }

    let (mut names, mut types) = (vec![String::new(); rows], vec![String::new(); rows]);
    let (mut columns, mut notes) = (Vec::new(), Vec::new());
    for (i, property) in properties.into_iter().enumerate() {
        let wrong = |what: String| FormatError::damaged(path, format!("inline.properties[{i}]: {what}"));
        let got = property.values.len();
        if got != rows && !matches!(property.values, Values::Other(_)) {
            return Err(wrong(format!("expected {rows} values, one an id, got {got}")));
        }
        match (property.kind.as_str(), property.values) {
            // A list without values fits every type.
            (_, values) if rows == 0 && values.len() == 0 => {}
            ("label", Values::Texts(texts)) => names = texts,
            ("tags", Values::Tags(tags)) => types = types_of(&tags, &property.tags).map_err(wrong)?,
            ("number", Values::Numbers(values)) => columns.push(NumericColumn { name: property.id, values }),
            (kind @ ("description" | "string"), Values::Texts(_)) => {
                notes.push(format!("left out: the {kind} {}", one_line(&property.id)));
            }
            (kind @ ("label" | "description" | "string"), values) => {
                return Err(wrong(unlike(kind, "a text", &values)));
            }
            ("tags", values) => return Err(wrong(unlike("tags", "a list of places in tags", &values))),
            ("number", values) => return Err(wrong(unlike("number", "a number", &values))),
            (kind, _) => {
                let what = format!(
                    "type: expected label, description, string, tags or number, got {}",
                    quoted(kind)
                );
                return Err(wrong(what));
            }
        }
    }
    let table = AnnotationTable::new(numbers, names, types, vec![None; rows], columns);
    Ok(LabelTableFile { table: checked(path, table)?, format: LabelTableFormat::Neuroglancer, notes })
}

/// Says which value is not what a property of this type has.
fn unlike(kind: &str, expected: &str, values: &Values) -> String {
    let is_right = |value: &Value| match kind {
        "number" => value.is_number(),
        "tags" => value.as_array().is_some_and(|tags| tags.iter().all(|t| t.as_u64().is_some())),
        _ => value.is_string(),
    };
    let place = match values {
        Values::Other(Value::Array(all)) => {
            all.iter().position(|value| !is_right(value)).map(|at| (at, &all[at]))
        }
        _ => None,
    };
    match place {
        Some((at, value)) => format!("values[{at}]: expected {expected}, got {}", quoted(&value.to_string())),
        None => format!("values: expected {expected} for each id, as type {kind} has it"),
    }
}

/// The tags of each label as its type.
fn types_of(tags: &[Vec<usize>], names: &[String]) -> std::result::Result<Vec<String>, String> {
    tags.iter()
        .enumerate()
        .map(|(row, places)| {
            let of_row = places.iter().map(|&place| match names.get(place) {
                Some(name) => Ok(name.as_str()),
                None => {
                    Err(format!("values[{row}]: expected places below {} in tags, got {place}", names.len()))
                }
            });
            Ok(of_row.collect::<std::result::Result<Vec<_>, String>>()?.join(" "))
        })
        .collect()
}

pub(super) fn write(_: &Path, table: &AnnotationTable) -> Result<(String, Vec<String>)> {
    let mut notes = Vec::new();
    let ids: Vec<String> = table.ids().iter().map(u64::to_string).collect();
    let mut properties = vec![json!({ "id": "name", "type": "label", "values": table.names() })];

    if table.types().iter().any(|t| !t.is_empty()) {
        let spaced = table.types().iter().filter(|t| t.contains(char::is_whitespace)).count();
        if spaced > 0 {
            notes.push(format!("spaces in the types of {spaced} labels are written as '_': tags have none"));
        }
        let tag_of = |kind: &String| kind.replace(char::is_whitespace, "_");
        let mut tags: Vec<String> = table.types().iter().filter(|t| !t.is_empty()).map(tag_of).collect();
        tags.sort_unstable();
        tags.dedup();
        let place = |kind: &String| tags.binary_search(&tag_of(kind)).into_iter().collect::<Vec<usize>>();
        let values: Vec<Vec<usize>> = table.types().iter().map(place).collect();
        properties.push(json!({ "id": "type", "type": "tags", "tags": tags, "values": values }));
    }
    for column in table.columns() {
        match number_property(column) {
            Ok((property, note)) => {
                properties.push(property);
                notes.extend(note);
            }
            Err(why) => notes.push(format!("left out: the column {}, {why}", one_line(&column.name))),
        }
    }
    let colored = table.colors_srgb().iter().flatten().count();
    if colored > 0 {
        notes.push(format!("left out: the colours of {colored} labels"));
    }
    let info = json!({ "@type": KIND, "inline": { "ids": ids, "properties": properties } });
    Ok((info.to_string() + "\n", notes))
}

/// A column as a property of the smallest type that holds it, and what it loses; or why it cannot be one.
fn number_property(column: &NumericColumn) -> std::result::Result<(Value, Option<String>), String> {
    /// Types of whole numbers, and the least and largest number of each.
    const WHOLE: [(&str, f64, f64); 6] = [
        ("uint8", 0.0, 255.0),
        ("int8", -128.0, 127.0),
        ("uint16", 0.0, 65_535.0),
        ("int16", -32_768.0, 32_767.0),
        ("uint32", 0.0, 4_294_967_295.0),
        ("int32", -2_147_483_648.0, 2_147_483_647.0),
    ];
    let values = &column.values;
    let missing = values.iter().filter(|v| v.is_nan()).count();
    if missing > 0 {
        return Err(format!("which has no number for {missing} labels"));
    }
    let property = |data_type: &str, values: Value| json!({ "id": column.name, "type": "number", "data_type": data_type, "values": values });
    let fits = |&&(_, low, high): &&(&str, f64, f64)| {
        values.iter().all(|v| v.fract() == 0.0 && (low..=high).contains(v))
    };
    if let Some((data_type, ..)) = WHOLE.iter().find(fits) {
        let whole: Vec<i64> = values.iter().map(|&v| v as i64).collect();
        return Ok((property(data_type, json!(whole)), None));
    }
    if let Some(large) = values.iter().find(|v| !(**v as f32).is_finite()) {
        return Err(format!("which has {large:e}, beyond numbers of 32 bits"));
    }
    let rounded = values.iter().filter(|v| f64::from(**v as f32) != **v).count();
    let note = (rounded > 0).then(|| {
        format!(
            "{rounded} numbers of the column {} are rounded to float32 by Neuroglancer",
            one_line(&column.name)
        )
    });
    Ok((property("float32", json!(values)), note))
}

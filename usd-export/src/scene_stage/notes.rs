//! What a volume's prim says of its labels and its source, under `userProperties:`, where Blender keeps it as custom properties.
//!
//! Lists are JSON text, because importers drop arrays of texts: `labels` has `[id, name, type]` by dense index, the number that the faces of
//! surfaces carry as primvar `label`; name and type are null where a label has none.

use pumice_core::Error;
use serde_json::{Value as Json, json};

use super::drawn::Drawn;
use crate::Result;
use crate::usd::{Property, Value};

pub(super) fn properties(drawn: &Drawn<'_>) -> Result<Vec<Property<'static>>> {
    let (volume, table) = (drawn.volume, drawn.volume.labels());
    let labels: Vec<Json> = (0u32..)
        .zip(table.ids())
        .map(|(label, id)| {
            let name = volume.note(label).and_then(|note| note.name.as_deref());
            let kind = table.type_of(label).and_then(|t| table.type_names().get(usize::from(t)));
            json!([id, name, kind])
        })
        .collect();
    let as_json = |e| Error::Caller(format!("notes of a volume cannot be written as JSON: {e}"));
    let labels = serde_json::to_string(&labels).map_err(as_json)?;
    let unit = serde_json::to_value(volume.info().unit).map_err(as_json)?;
    let [x, y, z] = volume.info().spacing();
    let text = |name: &str, text: String| {
        Property::custom(format!("userProperties:{name}"), "string", Value::String(text))
    };
    Ok(vec![
        text("labels", labels),
        text("data_hash", format!("{:032x}", volume.content_hash())),
        text("source", drawn.instance.source.display().to_string()),
        text("spacing", format!("[{x}, {y}, {z}]")),
        text("unit", unit.as_str().unwrap_or_default().to_owned()),
    ])
}

//! What a file says of a volume beside its shape: names and values that are the same in every format.
//!
//! Lists are JSON text, because importers drop arrays of texts: `labels` has `[id, name, type]` by dense index, the number that the faces of
//! surfaces carry as `label`; name and type are null where a label has none. A file of a part of a volume also
//! has `region`: the part's lowest voxel, and the one beyond its highest.

use std::path::Path;

use pumice_core::Error;
use serde_json::{Value as Json, json};

use crate::Result;
use crate::drawn::Drawn;

/// What a file says of where a volume or mesh came from: the name of its file, without the folders, which are nobody else's business.
pub(crate) fn source_name(source: &Path) -> String {
    source.file_name().unwrap_or(source.as_os_str()).display().to_string()
}

/// The notes of a volume, as names and texts.
///
/// # Errors
/// None that a valid volume gives.
pub(crate) fn notes(drawn: &Drawn<'_>) -> Result<Vec<(&'static str, String)>> {
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
    let mut notes = vec![
        ("labels", labels),
        ("data_hash", format!("{:032x}", volume.content_hash())),
        ("source", source_name(&drawn.instance.source)),
        ("spacing", format!("[{x}, {y}, {z}]")),
        ("unit", unit.as_str().unwrap_or_default().to_owned()),
    ];
    if let Some(region) = drawn.region {
        let ([x0, y0, z0], [x1, y1, z1]) = (region.low(), region.high());
        notes.push(("region", format!("[{x0}, {y0}, {z0}, {x1}, {y1}, {z1}]")));
    }
    Ok(notes)
}

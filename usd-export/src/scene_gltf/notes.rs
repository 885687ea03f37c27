//! The `extras` of a volume's node: what the notes of every format say, as JSON.
//!
//! ```text
//! { "data_hash": "…", "source": "…", "spacing": [x, y, z], "unit": "…", "region": […], "not_exact": "…", "labels": [["ID", name, type], …] }
//! ```
//! Ids are texts, because they have 64 bits and readers in JavaScript keep 53. The place in the list is the number in `_LABEL`.

use gltf_json::extras::RawValue;
use pumice_core::Error;
use serde_json::{Map, Value as Json};

use crate::drawn::Drawn;
use crate::notes::notes;
use crate::smooth_mesh::NOT_EXACT;
use crate::{Form, Result};

/// The `extras` of a volume in a form.
///
/// # Errors
/// None that a valid volume gives.
pub(super) fn extras(drawn: &Drawn<'_>, form: Option<&Form>) -> Result<Box<RawValue>> {
    let as_json = |e| Error::Caller(format!("notes of a volume cannot be written as JSON: {e}"));
    let mut all = Map::new();
    for (name, text) in notes(drawn)? {
        let value = match name {
            "spacing" | "region" => serde_json::from_str(&text).map_err(as_json)?,
            "labels" => {
                let mut labels: Vec<[Json; 3]> = serde_json::from_str(&text).map_err(as_json)?;
                labels.iter_mut().for_each(|[id, _, _]| *id = id.to_string().into());
                serde_json::to_value(labels).map_err(as_json)?
            }
            _ => Json::String(text),
        };
        all.insert(name.into(), value);
    }
    if form == Some(&Form::Smooth) {
        all.insert("not_exact".into(), NOT_EXACT.into());
    }
    Ok(serde_json::value::to_raw_value(&all).map_err(as_json)?)
}

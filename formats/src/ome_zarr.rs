//! The metadata of OME-Zarr (OME-NGFF 0.4 and 0.5, and what is like them): which arrays are the levels of an image, where they lie, and the names
//! and colours of labels.
//!
//! ```text
//! 0.4  .zattrs     { "multiscales": [ { "axes": [ {"name": "z", "type": "space", "unit": "micrometer"}, … ],
//! 0.5  zarr.json →     "datasets": [ { "path": "0", "coordinateTransformations": [ {"type": "scale", "scale": [1, .5, .5]}, … ] }, … ] } ],
//!      attributes    "image-label": { "colors": [ {"label-value": 3, "rgba": [255, 0, 0, 255]} ], "properties": [ {"label-value": 3, "name": "…"} ] } }
//!      → ome       labels/.zattrs  { "labels": ["cells", "nuclei"] }
//! ```
//! Fields that are not used are not looked at, because files in the wild have others than the specification. Transformations along an axis are
//! read, scale and translation; rotations and displacements are refused.

use std::path::Path;

use pumice_core::LabelNote;
use pumice_core::error::one_line;
use serde_json::Value;

use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::stores::{lengths, numbers};

/// An axis of an image, in the order of an array's indices.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Axis {
    pub(crate) name: String,
    pub(crate) unit: Option<String>,
}

/// One level: the path of its array, and the place of its voxels along each axis: `coordinate = scale · index + translation`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Dataset {
    pub(crate) path: String,
    pub(crate) scale: Vec<f64>,
    pub(crate) translation: Vec<f64>,
}

/// An image at several levels.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Multiscale {
    pub(crate) axes: Vec<Axis>,
    pub(crate) datasets: Vec<Dataset>,
}

/// The attributes that belong to OME: below `ome` from version 0.5 on.
pub(crate) fn of(attributes: &Value) -> &Value {
    attributes.get("ome").filter(|ome| ome.is_object()).unwrap_or(attributes)
}

/// The image that the attributes of a group describe; `None` where they describe none.
pub(crate) fn multiscale(path: &Path, attributes: &Value) -> Result<Option<Multiscale>> {
    let Some(first) = of(attributes).get("multiscales").and_then(|list| list.get(0)) else { return Ok(None) };
    let wrong = |what: String| FormatError::damaged(path, format!("multiscales: {what}"));
    let Some(list) = first.get("datasets").and_then(Value::as_array).filter(|list| !list.is_empty()) else {
        return Err(wrong("expected a list of datasets, got none".into()));
    };
    let axes =
        match first.get("axes").and_then(Value::as_array) {
            Some(axes) => axes.iter().map(axis).collect::<Option<Vec<_>>>().ok_or_else(|| {
                wrong("axes: expected names or objects with a name, got something else".into())
            })?,
            // Versions 0.1 and 0.2 have these five.
            None => ["t", "c", "z", "y", "x"].map(|name| Axis { name: name.into(), unit: None }).to_vec(),
        };
    let empty = Vec::new();
    let of_all = first.get("coordinateTransformations").and_then(Value::as_array).unwrap_or(&empty);
    let mut datasets = Vec::new();
    for (n, dataset) in list.iter().enumerate() {
        let Some(name) = dataset.get("path").and_then(Value::as_str) else {
            return Err(wrong(format!("datasets[{n}]: expected a path, got none")));
        };
        if !is_below(name) {
            return Err(wrong(format!(
                "datasets[{n}]: expected a path below the image, got {:?}",
                shorten(name)
            )));
        }
        let (mut scale, mut translation) = (vec![1.0; axes.len()], vec![0.0; axes.len()]);
        let of_one = dataset.get("coordinateTransformations").and_then(Value::as_array).unwrap_or(&empty);
        for transformation in of_one.iter().chain(of_all) {
            apply(transformation, &mut scale, &mut translation)
                .map_err(|what| wrong(format!("datasets[{n}]: coordinateTransformations: {what}")))?;
        }
        datasets.push(Dataset { path: name.to_owned(), scale, translation });
    }
    Ok(Some(Multiscale { axes, datasets }))
}

fn axis(value: &Value) -> Option<Axis> {
    if let Some(name) = value.as_str() {
        return Some(Axis { name: name.to_lowercase(), unit: None });
    }
    let name = value.get("name")?.as_str()?.to_lowercase();
    Some(Axis { name, unit: value.get("unit").and_then(Value::as_str).map(str::to_owned) })
}

/// Whether a path from metadata stays in its folder.
pub(crate) fn is_below(path: &str) -> bool {
    !path.is_empty()
        && !path.starts_with('/')
        && !path.contains('\\')
        && path.split('/').all(|part| part != "..")
}

/// Adds a transformation after those that are there.
fn apply(
    transformation: &Value,
    scale: &mut [f64],
    translation: &mut [f64],
) -> std::result::Result<(), String> {
    let kind = transformation.get("type").and_then(Value::as_str).unwrap_or_default();
    let values = |name: &str| match lengths(transformation.get(name)) {
        Some(values) if values.len() == scale.len() => Ok(values),
        Some(values) => {
            Err(format!("{name}: expected {} numbers, one an axis, got {}", scale.len(), values.len()))
        }
        None => {
            let got = match (transformation.get(name), transformation.get("path")) {
                (Some(other), _) => shorten(&one_line(&other.to_string())),
                (None, Some(_)) => "a file of their own, which is not read".into(),
                (None, None) => "none".into(),
            };
            Err(format!("{name}: expected {} numbers, one an axis, got {got}", scale.len()))
        }
    };
    match kind {
        "identity" => {}
        "scale" => {
            for (a, factor) in values("scale")?.into_iter().enumerate() {
                scale[a] *= factor;
                translation[a] *= factor;
            }
        }
        "translation" => {
            for (a, offset) in values("translation")?.into_iter().enumerate() {
                translation[a] += offset;
            }
        }
        other => {
            return Err(format!("expected identity, scale or translation, got {:?}", shorten(other)));
        }
    }
    Ok(())
}

/// Names of label images, from the attributes of the group `labels`.
pub(crate) fn label_images(attributes: &Value) -> Vec<String> {
    let list = of(attributes).get("labels").and_then(Value::as_array);
    list.into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .filter(|name| is_below(name))
        .map(str::to_owned)
        .collect()
}

/// Names and colours of labels, sorted by id.
pub(crate) fn notes(path: &Path, attributes: &Value) -> Result<Vec<LabelNote>> {
    let Some(about) = of(attributes).get("image-label") else { return Ok(Vec::new()) };
    let mut notes = std::collections::BTreeMap::<u64, LabelNote>::new();
    let wrong = |list: &str, n: usize, what: String| {
        FormatError::damaged(path, format!("image-label.{list}[{n}]: {what}"))
    };
    for list in ["colors", "properties"] {
        let entries = about.get(list).and_then(Value::as_array);
        for (n, entry) in entries.into_iter().flatten().enumerate() {
            let Some(id) = entry.get("label-value").and_then(whole) else {
                let got = entry.get("label-value").map_or_else(|| "none".into(), Value::to_string);
                let got = shorten(&one_line(&got));
                return Err(wrong(list, n, format!("label-value: expected a whole number, got {got}")));
            };
            let note = || LabelNote { id, name: None, color_srgb: None };
            if list == "properties" {
                let name =
                    ["name", "label_name", "label"].into_iter().find_map(|key| entry.get(key)?.as_str());
                if let Some(name) = name.filter(|name| !name.is_empty()) {
                    notes.entry(id).or_insert_with(note).name = Some(one_line(name));
                }
            } else if let Some(rgba) = entry.get("rgba") {
                let Some([r, g, b]) = numbers(Some(rgba)).as_deref().and_then(bytes) else {
                    return Err(wrong(list, n, "rgba: expected four numbers from 0 to 255".into()));
                };
                let color = [r, g, b].map(|channel| f32::from(channel) / 255.0);
                notes.entry(id).or_insert_with(note).color_srgb = Some(color);
            }
        }
    }
    // 0 is background.
    notes.remove(&0);
    Ok(notes.into_values().collect())
}

/// A label's id, which some writers store as a floating-point number.
fn whole(value: &Value) -> Option<u64> {
    value.as_u64().or_else(|| {
        let number = value.as_f64()?;
        (number.fract() == 0.0 && (0.0..=crate::element::MAX_EXACT_F64).contains(&number))
            .then_some(number as u64)
    })
}

fn bytes(rgba: &[u64]) -> Option<[u8; 3]> {
    let channel = |n: usize| u8::try_from(*rgba.get(n)?).ok();
    (matches!(rgba.len(), 3 | 4)).then_some([channel(0)?, channel(1)?, channel(2)?])
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn parsed(text: Value) -> std::result::Result<Option<Multiscale>, String> {
        multiscale(Path::new("a.zarr"), &text).map_err(|e| e.to_string())
    }

    #[test]
    fn transformations_act_in_their_order_and_those_of_all_levels_last() {
        let dataset = |steps: Value| json!({"path": "0", "coordinateTransformations": steps});
        let image = |steps: Value, all: Value| json!({"ome": {"multiscales": [{"axes": ["z", "y", "x"], "datasets": [dataset(steps)], "coordinateTransformations": all}]}});
        let scale = json!({"type": "scale", "scale": [4, 2, 2]});
        let moved = json!({"type": "translation", "translation": [1, 2, 3]});
        let of = |steps, all| parsed(image(steps, all)).unwrap().unwrap().datasets.remove(0);
        let got = of(json!([scale, moved]), json!([]));
        assert_eq!((got.scale, got.translation), (vec![4.0, 2.0, 2.0], vec![1.0, 2.0, 3.0]));
        let got = of(json!([moved]), json!([scale]));
        assert_eq!((got.scale, got.translation), (vec![4.0, 2.0, 2.0], vec![4.0, 4.0, 6.0]));
        for bad in [
            json!([{"type": "rotation"}]),
            json!([{"type": "scale", "scale": [1, 2]}]),
            json!([{"type": "scale", "path": "s"}]),
        ] {
            assert!(parsed(image(bad, json!([]))).unwrap_err().contains("coordinateTransformations"));
        }
        for (bad, got) in [
            (json!({"type": "scale", "scale": ["NaN", 1, 1]}), r#"got ["NaN",1,1]"#),
            (json!({"type": "scale", "path": "s"}), "got a file of their own, which is not read"),
            (json!({"type": "scale"}), "got none"),
        ] {
            let line = parsed(image(json!([bad]), json!([]))).unwrap_err();
            assert!(line.ends_with(&format!("scale: expected 3 numbers, one an axis, {got}")), "{line}");
        }
    }

    #[test]
    fn both_versions_and_odd_fields_are_read() {
        let image = json!([{"version": "9", "datasets": [{"path": "s0", "more": 1}], "axes": [{"name": "Y"}, {"name": "x", "unit": "micrometer"}]}]);
        let old = parsed(json!({"multiscales": image, "omero": {}})).unwrap().unwrap();
        assert_eq!(old, parsed(json!({"ome": {"multiscales": image}})).unwrap().unwrap());
        assert_eq!(old.axes[0].name, "y");
        assert_eq!(parsed(json!({"other": 1})).unwrap(), None);
        assert!(parsed(json!({"multiscales": [{"datasets": [{"path": "../../etc"}]}]})).is_err());
    }

    #[test]
    fn colours_and_names_come_together() {
        let attributes = json!({"image-label": {
            "colors": [{"label-value": 7, "rgba": [255, 0, 51, 255]}, {"label-value": 0, "rgba": [0, 0, 0, 0]}, {"label-value": 9}],
            "properties": [{"label-value": 5, "name": "left"}, {"label-value": 7.0, "area": 3, "label": "right"}]}});
        let notes = notes(Path::new("a.zarr"), &attributes).unwrap();
        assert_eq!(
            notes.iter().map(|n| (n.id, n.name.as_deref())).collect::<Vec<_>>(),
            [(5, Some("left")), (7, Some("right"))]
        );
        assert_eq!(notes[1].color_srgb, Some([1.0, 0.0, 0.2]));
        let bad = json!({"image-label": {"colors": [{"label-value": -1, "rgba": [1, 2, 3, 4]}]}});
        assert!(super::notes(Path::new("a.zarr"), &bad).is_err());
    }
}

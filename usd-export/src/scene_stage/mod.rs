//! A scene as a stage: its volumes in the forms that were asked for, with their materials and labels.
//!
//! ```text
//! /Scene             Xform, component; payload </Contents>
//! /Contents          class
//!   /Materials         a UsdPreviewSurface for each material that is drawn
//!   /volume_ID         Xform: world from index space, notes of the labels; variant set form, of the forms that were asked for
//!     {form=voxels}
//!     /surface           Mesh: rectangles sorted by material, each material's a GeomSubset
//!     {form=instances}
//!     /boxes             PointInstancer: a unit cube for each material, placed and scaled once a box
//! ```
//! The forms `boxes`, `cells4` and `voxels` are the surfaces that the renderers draw at the levels of detail 16, 4 and 1; `instances` has all
//! boxes whole, also where they coincide.

mod boxes;
mod materials;
mod surface;

use std::sync::Arc;

use pumice_core::{Error, Job};
use pumice_transport::LoadedScene;

use crate::drawn::Drawn;
use crate::notes::notes;
use crate::usd::{Prim, Property, Specifier, Stage, Value, Variant, VariantSet};
use crate::{Budget, ExportOptions, Result};
use materials::Materials;

/// The class that holds everything.
const CONTENTS: &str = "/Contents";

/// The stage of a scene, with the rectangles and boxes that its arrays are made of, which are taken from `budget`.
///
/// # Errors
/// [`Error::Caller`] where nothing is asked for or nothing is drawn; [`Error::Limit`] where the faces take more than the budget, as soon as
/// that is found; [`Error::Cancelled`]; errors of the volumes.
pub fn stage_of_scene(
    scene: &LoadedScene,
    options: &ExportOptions,
    budget: &mut Budget,
    job: &Job,
) -> Result<Stage<'static>> {
    let Some(shown_first) = options.forms.first() else {
        return Err(Error::Caller("forms: expected one of instances, boxes, cells4, voxels".into()).into());
    };
    let mut materials = Materials::default();
    let mut volumes = Vec::new();
    for place in 0..scene.volumes().len() {
        let drawn = Drawn::new(scene, place);
        let of_volume: Vec<String> =
            drawn.materials.iter().map(|material| materials.path(material)).collect();
        let mut forms = Vec::new();
        for &form in &options.forms {
            let prim = match form.level() {
                None => boxes::prim(&drawn, &of_volume, budget, job)?,
                Some(level) => surface::prim(&drawn, &of_volume, level, options.merging, budget, job)?,
            };
            let variant = Variant { name: form.name().into(), children: vec![prim], ..Variant::default() };
            forms.push(variant);
        }
        volumes.push(volume_prim(&drawn, shown_first.name(), forms)?);
    }
    if budget.faces() + budget.boxes() == 0 {
        return Err(Error::Caller("no label of the scene's volumes is shown".into()).into());
    }
    let mut children = vec![materials.into_prim()];
    children.append(&mut volumes);
    let contents = Prim {
        name: "Contents".into(),
        type_name: "Xform",
        specifier: Specifier::Class,
        children,
        ..Prim::default()
    };
    let root = Prim {
        name: "Scene".into(),
        type_name: "Xform",
        kind: "component",
        payload: Some(CONTENTS.into()),
        ..Prim::default()
    };
    let stage = Stage {
        default_prim: root.name.clone(),
        documentation: format!("Written by pumice {}", env!("CARGO_PKG_VERSION")),
        prims: vec![root, contents],
    };
    Ok(stage)
}

fn volume_prim(drawn: &Drawn<'_>, selected: &str, variants: Vec<Variant<'static>>) -> Result<Prim<'static>> {
    let m = drawn.instance.world_from_index;
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation];
    // Rows of USD's matrix are columns of ours.
    let mut rows = [[0.0; 4]; 4];
    for (row, column) in rows.iter_mut().zip(columns) {
        row[..3].copy_from_slice(&column.to_array());
    }
    rows[3][3] = 1.0;
    let mut properties = vec![
        Property::new("xformOp:transform", "matrix4d", Value::Matrix4(rows)),
        Property::uniform("xformOpOrder", "token[]", Value::Tokens(vec!["xformOp:transform".into()])),
    ];
    properties.extend(notes(drawn)?.into_iter().map(|(name, text)| {
        Property::custom(format!("userProperties:{name}"), "string", Value::String(text))
    }));
    Ok(Prim {
        name: drawn.name(),
        type_name: "Xform",
        properties,
        variant_sets: vec![VariantSet { name: "form", selected: selected.into(), variants }],
        ..Prim::default()
    })
}

/// Things that arrays are made of, shared by all arrays of a prim.
type Shared<T> = Arc<Vec<T>>;

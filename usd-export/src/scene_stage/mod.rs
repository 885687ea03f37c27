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
mod drawn;
mod materials;
mod notes;
mod surface;

use std::sync::Arc;

use pumice_core::{Error, Job};
use pumice_transport::LoadedScene;
use pumice_transport::geometry::DetailLevel;

use crate::usd::{Prim, Property, Specifier, Stage, Value, Variant, VariantSet};
use crate::{Merging, Result};
use drawn::Drawn;
use materials::Materials;

/// A form in which volumes are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Form {
    /// Every box, as a scaled cube.
    Instances,
    /// The visible surface of the boxes: level of detail 16.
    Boxes,
    /// The visible surface of cells of 4³ voxels: level of detail 4.
    Cells,
    /// The visible surface of the voxels: exact.
    Voxels,
}

impl Form {
    /// All forms, from the coarsest on.
    pub const ALL: [Self; 4] = [Self::Instances, Self::Boxes, Self::Cells, Self::Voxels];

    /// Its name in stages and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Instances => "instances",
            Self::Boxes => "boxes",
            Self::Cells => "cells4",
            Self::Voxels => "voxels",
        }
    }
}

/// What is written of a scene, and how much of it at most.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StageOptions {
    /// Forms of the volumes; the first is the one that programs show.
    pub forms: Vec<Form>,
    /// Whether neighbouring faces become one.
    pub merging: Merging,
    /// Most faces (and boxes of the form `instances`) of all forms together.
    pub most_faces: u64,
}

/// The stage of a scene, with the rectangles and boxes that its arrays are made of; and the number of those.
///
/// # Errors
/// [`Error::Caller`] where nothing is asked for or nothing is drawn; [`Error::Limit`] where there are more faces than allowed, as soon as
/// that is found; [`Error::Cancelled`]; errors of the volumes.
pub fn stage_of_scene(
    scene: &LoadedScene,
    options: &StageOptions,
    job: &Job,
) -> Result<(Stage<'static>, u64)> {
    let Some(shown_first) = options.forms.first() else {
        return Err(Error::Caller("forms: expected one of instances, boxes, cells4, voxels".into()).into());
    };
    let mut materials = Materials::default();
    let mut allowance = Allowance { most: options.most_faces, taken: 0 };
    let mut volumes = Vec::new();
    for place in 0..scene.volumes().len() {
        let drawn = Drawn::new(scene, place, &mut materials);
        let mut forms = Vec::new();
        for &form in &options.forms {
            let prim = form_of(form, &drawn, options, &mut allowance, job)?;
            let variant = Variant { name: form.name().into(), children: vec![prim], ..Variant::default() };
            forms.push(variant);
        }
        volumes.push(volume_prim(&drawn, shown_first.name(), forms)?);
    }
    let found = allowance.taken;
    if found == 0 {
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
        payload: Some("/Contents".into()),
        ..Prim::default()
    };
    let stage = Stage {
        default_prim: root.name.clone(),
        documentation: format!("Written by pumice {}", env!("CARGO_PKG_VERSION")),
        prims: vec![root, contents],
    };
    Ok((stage, found))
}

fn form_of(
    form: Form,
    drawn: &Drawn<'_>,
    options: &StageOptions,
    allowance: &mut Allowance,
    job: &Job,
) -> Result<Prim<'static>> {
    let level = match form {
        Form::Instances => return boxes::prim(drawn, allowance, job),
        Form::Boxes => DetailLevel::Boxes,
        Form::Cells => DetailLevel::Cells,
        Form::Voxels => DetailLevel::Voxels,
    };
    surface::prim(drawn, level, options.merging, allowance, job)
}

/// Faces and boxes that an export may have, and has.
struct Allowance {
    most: u64,
    taken: u64,
}

impl Allowance {
    /// Takes `count` of them.
    ///
    /// # Errors
    /// [`Error::Limit`] where they are more than allowed.
    fn take(&mut self, count: u64) -> Result<()> {
        self.taken += count;
        if self.taken <= self.most {
            return Ok(());
        }
        let what = "faces and boxes of this export, counted so far".into();
        Err(Error::Limit { what, limit: self.most, got: self.taken }.into())
    }
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
    properties.extend(notes::properties(drawn)?);
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

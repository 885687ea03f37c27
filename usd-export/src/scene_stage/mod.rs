//! A scene as a stage: its volumes in the forms that were asked for, with their materials and labels, and what stands around them.
//!
//! ```text
//! /Scene             Xform, component; payload </Contents>
//! /Contents          class
//!   /Materials         a UsdPreviewSurface for each material that is drawn
//!   /volume_ID         Xform: world from index space, notes of the labels; variant set form, of the forms that were asked for. Where the
//!                      matrix shears, the prim of each form has a part of it
//!     {form=voxels}
//!     /surface           Mesh: rectangles sorted by material, each material's a GeomSubset
//!     {form=smooth}
//!     /surface           Mesh: quads that share points, and normals of their corners
//!     {form=instances}
//!     /boxes             PointInstancer: a unit cube for each material, placed and scaled once a box
//!   /camera            Camera, and all that follows: the surroundings, unless they were not asked for
//!   /world             DomeLight
//!   /sun_0 …           DistantLight
//!   /lamp_0 …          SphereLight, with ShapingAPI for a spot; RectLight, DiskLight
//!   /mesh_ID …         Mesh; each material's faces a GeomSubset. Where its matrix shears, an Xform with the Mesh below it
//! ```
//! The forms `boxes`, `cells4` and `voxels` are the surfaces that the renderers draw at the levels of detail 16, 4 and 1; `instances` has all
//! boxes whole, also where they coincide.

mod boxes;
mod camera;
mod left_out;
mod lights;
mod materials;
mod mesh_parts;
mod meshes;
mod placement;
mod smooth;
mod surface;
mod world;

use std::sync::Arc;

use pumice_core::{Error, Job};
use pumice_transport::LoadedScene;

use crate::drawn::Drawn;
use crate::notes::notes;
use crate::usd::{Prim, Specifier, Stage, Value, Variant, VariantSet};
use crate::voxel_region::nothing_shown;
use crate::{Budget, ExportOptions, Form, Reader, Result};
use materials::Materials;
use placement::{note, outer_and_inner, placement};

pub(crate) use left_out::left_out_of_stage;

/// The class that holds everything.
const CONTENTS: &str = "/Contents";

/// The stage of a scene, with the rectangles and boxes that its arrays are made of, which are taken from `budget`. `sky` is the path by
/// which the stage refers to the picture of the world; without it, a world that has one is left out.
///
/// # Errors
/// [`Error::Caller`] where nothing is asked for or nothing is drawn; [`Error::Limit`] where the faces take more than the budget, as soon as
/// that is found; [`Error::Cancelled`]; errors of the volumes.
pub fn stage_of_scene(
    scene: &LoadedScene,
    options: &ExportOptions,
    sky: Option<&str>,
    budget: &mut Budget,
    job: &Job,
) -> Result<Stage<'static>> {
    let Some(shown_first) = options.forms.first() else {
        return Err(
            Error::Caller("forms: expected one of instances, boxes, cells4, voxels, smooth".into()).into()
        );
    };
    let mut materials = Materials::default();
    let mut volumes = Vec::new();
    for place in 0..scene.volumes().len() {
        let drawn = Drawn::new(scene, place, options.region);
        let of_volume: Vec<String> =
            drawn.materials.iter().map(|material| materials.path(material)).collect();
        let mut forms = Vec::new();
        for &form in &options.forms {
            let prim = match form.level() {
                None if form == Form::Smooth => smooth::prim(&drawn, &of_volume, budget, job)?,
                None => boxes::prim(&drawn, &of_volume, budget, job)?,
                Some(level) => surface::prim(&drawn, &of_volume, level, options.merging, budget, job)?,
            };
            let variant = Variant { name: form.name().into(), children: vec![prim], ..Variant::default() };
            forms.push(variant);
        }
        volumes.push(volume_prim(&drawn, shown_first.name(), forms)?);
    }
    let mut around = match options.surroundings {
        true => surroundings(scene, options.reader, sky, &mut materials, budget)?,
        false => Vec::new(),
    };
    if budget.faces() + budget.boxes() == 0 {
        return Err(nothing_shown(options.region).into());
    }
    let mut children = vec![materials.into_prim()?];
    children.append(&mut volumes);
    children.append(&mut around);
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
        documentation: documentation(options.reader),
        prims: vec![root, contents],
    };
    Ok(stage)
}

fn documentation(reader: Reader) -> String {
    let written = format!("Written by pumice {}", env!("CARGO_PKG_VERSION"));
    reader.note().map_or(written.clone(), |note| format!("{written}, {note}"))
}

/// Camera, world, suns, lamps and meshes.
fn surroundings(
    scene: &LoadedScene,
    reader: Reader,
    sky: Option<&str>,
    materials: &mut Materials,
    budget: &mut Budget,
) -> Result<Vec<Prim<'static>>> {
    let of = scene.scene();
    let eye = of.camera.world_from_camera.translation;
    let mut prims = vec![camera::prim(scene, reader)];
    prims.extend(world::prim(&of.world, sky));
    prims.extend(of.suns.iter().enumerate().map(|(number, sun)| lights::sun(number, sun, reader)));
    let lamps = of.lights.iter().enumerate();
    prims.extend(lamps.map(|(number, light)| lights::lamp(number, light, eye, reader)));
    for (place, (mesh, data)) in of.meshes.iter().zip(scene.meshes()).enumerate() {
        prims.extend(meshes::prim(place, mesh, data, materials, budget)?);
    }
    Ok(prims)
}

fn volume_prim(
    drawn: &Drawn<'_>,
    selected: &str,
    mut variants: Vec<Variant<'static>>,
) -> Result<Prim<'static>> {
    let (outer, inner) = outer_and_inner(&drawn.instance.world_from_index);
    if let Some(inner) = inner {
        let of_forms = variants.iter_mut().flat_map(|variant| &mut variant.children);
        of_forms.for_each(|prim| prim.properties.extend(placement(&inner)));
    }
    let mut properties = Vec::from(placement(&outer));
    let notes = notes(drawn)?.into_iter();
    properties.extend(notes.map(|(name, text)| note(name, "string", Value::String(text))));
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

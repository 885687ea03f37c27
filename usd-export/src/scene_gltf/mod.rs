//! A scene as glTF 2.0: its volumes in one form, its meshes, its camera and the lights that glTF has.
//!
//! ```text
//! scene ─ node "scene"         a quarter turn: z up in our scenes, y up in glTF
//!           ├ node "volume_ID"   world from index space; extras: notes of the labels
//!           │   mesh               a primitive for each material; or nodes below with parts of the surface, or with cubes
//!           ├ node "mesh_ID"     world from the mesh's space
//!           ├ node "camera"
//!           └ node "sun_N", "lamp_N"
//! ```
//! [`Gltf`] is planned as a whole and then written: its JSON, which is small, and its binary part, which is made a piece at a time from the
//! rectangles of the surfaces.

mod binary;
mod camera;
mod file;
mod instances;
mod lights;
mod materials;
mod meshes;
mod notes;
mod placement;
mod polygons;
mod smooth;
mod surface;
mod writer;

use std::collections::BTreeSet;
use std::f32::consts::FRAC_1_SQRT_2;

use gltf_json::scene::UnitQuaternion;
use gltf_json::{Asset, Index, Node, Root};
use pumice_core::{Error, Job};
use pumice_scene::{LightShape, Scene};
use pumice_transport::LoadedScene;

use crate::drawn::Drawn;
use crate::labelled_surface::LabelledSurface;
use crate::voxel_region::nothing_shown;
use crate::{Budget, ExportOptions, Form, Result};
use binary::Binary;
pub(crate) use file::MOST_GLB_BYTES;
use writer::Writer;

/// Whole numbers as positions.
const QUANTIZATION: &str = "KHR_mesh_quantization";
/// Many instances of a mesh at a node.
const INSTANCING: &str = "EXT_mesh_gpu_instancing";
const LIGHTS: &str = "KHR_lights_punctual";

/// A scene, ready to be written.
pub(crate) struct Gltf<'a> {
    /// Everything but the length and the name of the binary part.
    root: Root,
    binary: Binary<'a>,
}

impl Gltf<'_> {
    /// Bytes of the file, without the JSON: little beside the surfaces.
    pub(crate) fn bytes(&self) -> u64 {
        self.binary.bytes()
    }

    /// Checks that the file is not larger than allowed: exactly, now that all of it is known.
    ///
    /// # Errors
    /// [`Error::Limit`].
    pub(crate) fn check(&self, limit_bytes: u64) -> Result<()> {
        if self.bytes() <= limit_bytes {
            return Ok(());
        }
        let what = "bytes of the binary part of the file".into();
        Err(Error::Limit { what, limit: limit_bytes, got: self.bytes() }.into())
    }
}

/// Plans the file of a scene in the first of the forms that are asked for. Its faces and boxes are taken from `budget`.
///
/// # Errors
/// [`Error::Caller`] where nothing is drawn, or a number is beyond single precision; [`Error::Limit`] where the faces take more than the
/// budget, as soon as that is found, or more vertices or labels than glTF can number; [`Error::Cancelled`].
pub(crate) fn gltf_of_scene<'a>(
    scene: &'a LoadedScene,
    options: &ExportOptions,
    budget: &mut Budget,
    job: &Job,
) -> Result<Gltf<'a>> {
    let mut writer = Writer::default();
    let mut nodes = Vec::new();
    for place in 0..scene.volumes().len() {
        let drawn = Drawn::new(scene, place, options.region);
        nodes.extend(add_volume(&mut writer, &drawn, options, budget, job)?);
    }
    if nodes.is_empty() {
        return Err(nothing_shown(options.region).into());
    }
    if options.surroundings {
        add_surroundings(&mut writer, scene, &mut nodes)?;
    }
    writer.finish();
    Ok(Gltf { root: finished(writer.root, writer.used, nodes), binary: writer.binary })
}

/// Adds the nodes of a scene's meshes, camera and lights.
fn add_surroundings<'a>(
    writer: &mut Writer<'a>,
    scene: &'a LoadedScene,
    nodes: &mut Vec<Index<Node>>,
) -> Result<()> {
    let drawn = scene.scene().meshes.iter().zip(scene.meshes()).filter(|(mesh, _)| !mesh.shadow_catcher);
    for (mesh, data) in drawn {
        let name = format!("mesh_{}", mesh.id);
        if let Some(triangles) = meshes::add_mesh(writer, &name, mesh, data)? {
            let put = |node: &mut Node| node.mesh = Some(triangles);
            nodes.push(placement::place(&mut writer.root, &name, mesh.world_from_mesh, put)?);
        }
    }
    nodes.push(camera::add_camera(scene, &mut writer.root)?);
    let lights = lights::add_lights(scene.scene(), &mut writer.root)?;
    if !lights.is_empty() {
        writer.used.insert(LIGHTS);
    }
    nodes.extend(lights);
    Ok(())
}

/// Adds the node of a volume; none where nothing of it is drawn.
fn add_volume(
    writer: &mut Writer<'_>,
    drawn: &Drawn<'_>,
    options: &ExportOptions,
    budget: &mut Budget,
    job: &Job,
) -> Result<Option<Index<Node>>> {
    let (mut own_mesh, mut children) = (None, Vec::new());
    match options.forms.first().and_then(|form| form.level()) {
        None if options.forms == [Form::Smooth] => own_mesh = smooth::add_smooth(writer, drawn, budget, job)?,
        None => children = instances::add_boxes(writer, drawn, budget, job)?,
        Some(level) => {
            let surface = LabelledSurface::new(drawn, level, options.merging, budget, job)?;
            if !surface.is_empty() {
                for (mesh, low) in surface::add_surface(writer, drawn, surface)? {
                    if low == [0; 3] {
                        own_mesh = Some(mesh);
                    } else {
                        let translation = Some(low.map(|c| c as f32));
                        children.push(writer.root.push(Node {
                            mesh: Some(mesh),
                            translation,
                            ..Node::default()
                        }));
                    }
                }
            }
        }
    }
    if own_mesh.is_none() && children.is_empty() {
        return Ok(None);
    }
    let matrix = drawn.instance.world_from_index;
    let node = placement::place(&mut writer.root, &drawn.name(), matrix, |node| {
        node.mesh = own_mesh;
        node.children = (!children.is_empty()).then_some(children);
    })?;
    writer.root.nodes[node.value()].extras = Some(notes::extras(drawn, options.forms.first())?);
    Ok(Some(node))
}

fn finished(mut root: Root, used: BTreeSet<&'static str>, nodes: Vec<Index<Node>>) -> Root {
    let turned = root.push(Node {
        name: Some("scene".into()),
        rotation: Some(UnitQuaternion([-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2])),
        children: Some(nodes),
        ..Node::default()
    });
    let scene = gltf_json::Scene { extensions: None, extras: None, name: None, nodes: vec![turned] };
    root.scene = Some(root.push(scene));
    root.asset =
        Asset { generator: Some(format!("pumice {}", env!("CARGO_PKG_VERSION"))), ..Asset::default() };
    let required = [INSTANCING, QUANTIZATION].into_iter().filter(|name| used.contains(name));
    root.extensions_required = required.map(str::to_owned).collect();
    root.extensions_used = used.into_iter().map(str::to_owned).collect();
    root
}

/// What a scene has and a glTF file has not, in words.
pub(crate) fn left_out_of_gltf(scene: &Scene) -> Vec<String> {
    let is_area = |shape: &LightShape| matches!(shape, LightShape::Area { .. });
    let counted = |count: usize, [one, several]: [&str; 2]| match count {
        0 => None,
        1 => Some(format!("a {one}")),
        n => Some(format!("{n} {several}")),
    };
    let camera = &scene.camera;
    [
        (camera.shift != [0.0; 2]).then(|| "the camera's shift".into()),
        camera.aperture.is_some().then(|| "the camera's depth of field".into()),
        Some("the world".into()),
        counted(
            scene.lights.iter().filter(|light| is_area(&light.shape)).count(),
            ["area light", "area lights"],
        )
        .map(|text| text.replacen("a area", "an area", 1)),
        counted(
            scene.meshes.iter().filter(|mesh| mesh.shadow_catcher).count(),
            ["shadow catcher", "shadow catchers"],
        ),
    ]
    .into_iter()
    .flatten()
    .collect()
}

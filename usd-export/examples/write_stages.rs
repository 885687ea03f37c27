//! Writes one stage that has everything that a stage can have, in both forms, for tests that open it with other programs.
//!
//! ```text
//! cargo run -p pumice-export --example write_stages -- FOLDER     FOLDER/sample.usda, FOLDER/sample.usdc
//! ```
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use pumice_export::usd::{
    Array, Prim, Property, Specifier, Stage, Value, Variant, VariantSet, identifier, write_usda, write_usdc,
};

/// Arrays at and around the length from which integers are compressed, and one of many pieces.
const LENGTHS: [u64; 6] = [0, 1, 15, 16, 17, 70_000];

fn ints(len: u64) -> Vec<i32> {
    (0..len as i32).map(|i| if i % 7 == 3 { i.wrapping_mul(2_654_435) } else { i / 3 }).collect()
}

fn arrays() -> Prim<'static> {
    let mut prim = Prim { name: "arrays".into(), type_name: "Scope", ..Prim::default() };
    for len in LENGTHS {
        let in_pieces = move |sink: &mut dyn FnMut(&[i32]) -> pumice_export::Result<()>| {
            ints(len).chunks(1000).try_for_each(sink)
        };
        let floats = ints(len).iter().map(|&i| i as f32 / 7.0).collect::<Vec<f32>>();
        let triples = floats.iter().map(|&f| [f, -f, 1e-20 * f]).collect::<Vec<[f32; 3]>>();
        prim.properties.extend([
            Property::custom(format!("ints{len}"), "int[]", Value::Array(Array::new(len, in_pieces))),
            Property::custom(format!("floats{len}"), "float[]", Value::Array(Array::of(floats))),
            Property::custom(format!("triples{len}"), "float3[]", Value::Array(Array::of(triples))),
        ]);
    }
    prim
}

fn values() -> Prim<'static> {
    let matrix =
        [[0.1, 2.0, 1e-300, 0.0], [-0.5, 1e300, 3.0, 0.0], [0.0, 0.0, 1.0 / 3.0, 0.0], [7.0, 8.0, 9.0, 1.0]];
    let text = "line\nquote \" back\\slash\ttab 'µ' 日本 \u{1}";
    Prim {
        name: "values".into(),
        type_name: "Scope",
        properties: vec![
            Property::custom("yes", "bool", Value::Bool(true)),
            Property::custom("int", "int", Value::Int(-7)),
            Property::custom("float", "float", Value::Float(0.1)),
            Property::custom("small", "float", Value::Float(1e-30)),
            Property::custom("short", "double", Value::Double(0.25)),
            Property::custom("long", "double", Value::Double(0.1)),
            Property::custom("userProperties:json", "string", Value::String(text.into())),
            Property::custom("nothing", "string", Value::String(String::new())),
            Property::uniform("rule", "token", Value::Token("none".into())),
            Property::custom("file", "asset", Value::Asset("./sample.usda".into())),
            Property::custom("odd_file", "asset", Value::Asset("./a@b@@@@ 'µ'@".into())),
            Property::custom("pair", "float2", Value::Float2([1.0, 0.1])),
            Property::custom("color", "color3f", Value::Float3([0.2, 0.3, 1.0])),
            Property::custom("matrix", "matrix4d", Value::Matrix4(matrix)),
            Property::custom("names", "token[]", Value::Tokens(vec!["a".into(), "b c".into()])),
            Property::custom("no_names", "token[]", Value::Tokens(vec![])),
        ],
        ..Prim::default()
    }
}

fn triangle(name: &str, size: f32) -> Prim<'static> {
    let points = vec![[0.0, 0.0, 0.0], [size, 0.0, 0.0], [0.0, size, 0.0]];
    Prim {
        name: name.into(),
        type_name: "Mesh",
        api_schemas: vec!["MaterialBindingAPI"],
        properties: vec![
            Property::new("extent", "float3[]", Value::Array(Array::of(vec![[0.0; 3], [size, size, 0.0]]))),
            Property::new("faceVertexCounts", "int[]", Value::Array(Array::of(vec![3]))),
            Property::new("faceVertexIndices", "int[]", Value::Array(Array::of(vec![0, 1, 2]))),
            Property::new("points", "point3f[]", Value::Array(Array::of(points))),
            Property::primvar("label", "int[]", "uniform", Value::Array(Array::of(vec![5]))),
            Property::relationship("material:binding", vec!["/Contents/Materials/red".into()]),
            Property::uniform("subdivisionScheme", "token", Value::Token("none".into())),
        ],
        ..Prim::default()
    }
}

fn material() -> Prim<'static> {
    let shader = Prim {
        name: "surface".into(),
        type_name: "Shader",
        properties: vec![
            Property::uniform("info:id", "token", Value::Token("UsdPreviewSurface".into())),
            Property::new("inputs:diffuseColor", "color3f", Value::Float3([0.8, 0.1, 0.1])),
            Property::output("outputs:surface", "token"),
        ],
        ..Prim::default()
    };
    let surface = "/Contents/Materials/red/surface.outputs:surface".into();
    Prim {
        name: "red".into(),
        type_name: "Material",
        properties: vec![Property::connected("outputs:surface", "token", surface)],
        children: vec![shader],
        ..Prim::default()
    }
}

fn stage() -> Stage<'static> {
    let variant = |name: &str, size| Variant {
        name: name.into(),
        properties: vec![Property::custom("form", "token", Value::Token(name.into()))],
        children: vec![triangle("surface", size)],
    };
    let form = VariantSet {
        name: "form",
        selected: "boxes".into(),
        variants: vec![variant("boxes", 1.0), variant("voxels", 2.0)],
    };
    let named = Prim { name: identifier("3 µm {x}"), type_name: "Scope", ..Prim::default() };
    let materials =
        Prim { name: "Materials".into(), type_name: "Scope", children: vec![material()], ..Prim::default() };
    let figure = Prim {
        name: "Figure".into(),
        type_name: "Xform",
        kind: "component",
        payload: Some("/Contents".into()),
        children: vec![values(), arrays(), named],
        ..Prim::default()
    };
    let contents = Prim {
        name: "Contents".into(),
        type_name: "Xform",
        specifier: Specifier::Class,
        children: vec![materials],
        variant_sets: vec![form],
        ..Prim::default()
    };
    Stage {
        default_prim: "Figure".into(),
        documentation: "Everything that a stage can have".into(),
        prims: vec![figure, contents],
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("expected a folder")?;
    let file = |name: &str| File::create(Path::new(&folder).join(name)).map(BufWriter::new);
    write_usda(&stage(), &mut file("sample.usda")?)?;
    write_usdc(&stage(), &mut file("sample.usdc")?)?;
    Ok(())
}

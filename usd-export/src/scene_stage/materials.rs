//! Materials as UsdPreviewSurface, each once.
//!
//! What a preview surface has no word for is not written: subsurface scattering, sheen, tints, the coat's index of refraction, and that
//! light passes through glass without being absorbed. A material that transmits gets the opacity that is left.

use std::collections::HashMap;

use pumice_scene::Material;

use crate::usd::{Prim, Property, Value};

/// Materials by what a preview surface says of them.
#[derive(Default)]
pub(super) struct Materials {
    all: Vec<Preview>,
    /// Place in `all` by the bits of its inputs: scenes may have a material for each of 10⁵ labels.
    places: HashMap<[u32; 12], usize>,
}

/// Inputs of a preview surface.
#[derive(Clone, Copy, Debug)]
struct Preview {
    diffuse_color: [f32; 3],
    emissive_color: [f32; 3],
    metallic: f32,
    roughness: f32,
    clearcoat: f32,
    clearcoat_roughness: f32,
    opacity: f32,
    ior: f32,
}

impl Preview {
    fn of(material: &Material) -> Self {
        Self {
            diffuse_color: material.base_color,
            emissive_color: material.emission,
            metallic: material.metallic,
            roughness: material.roughness,
            clearcoat: material.coat,
            clearcoat_roughness: material.coat_roughness,
            opacity: material.alpha * (1.0 - material.transmission * (1.0 - material.metallic)),
            ior: material.ior,
        }
    }

    fn bits(&self) -> [u32; 12] {
        let ([r, g, b], [er, eg, eb]) = (self.diffuse_color, self.emissive_color);
        let coat = [self.clearcoat, self.clearcoat_roughness];
        [r, g, b, er, eg, eb, self.metallic, self.roughness, coat[0], coat[1], self.opacity, self.ior]
            .map(f32::to_bits)
    }

    fn prim(&self, number: usize) -> Prim<'static> {
        let name = name(number);
        let input = |name: &str, value| Property::new(format!("inputs:{name}"), "float", Value::Float(value));
        let color =
            |name: &str, value| Property::new(format!("inputs:{name}"), "color3f", Value::Float3(value));
        let shader = Prim {
            name: "surface".into(),
            type_name: "Shader",
            properties: vec![
                Property::uniform("info:id", "token", Value::Token("UsdPreviewSurface".into())),
                color("diffuseColor", self.diffuse_color),
                color("emissiveColor", self.emissive_color),
                input("metallic", self.metallic),
                input("roughness", self.roughness),
                input("clearcoat", self.clearcoat),
                input("clearcoatRoughness", self.clearcoat_roughness),
                input("opacity", self.opacity),
                input("ior", self.ior),
                Property::output("outputs:surface", "token"),
            ],
            ..Prim::default()
        };
        let output = format!("{}/surface.outputs:surface", path(number));
        Prim {
            name,
            type_name: "Material",
            properties: vec![Property::connected("outputs:surface", "token", output)],
            children: vec![shader],
            ..Prim::default()
        }
    }
}

fn name(number: usize) -> String {
    format!("material_{number}")
}

fn path(number: usize) -> String {
    format!("{}/Materials/{}", super::CONTENTS, name(number))
}

impl Materials {
    /// Path of a material, which is added if it is new.
    pub(super) fn path(&mut self, material: &Material) -> String {
        let preview = Preview::of(material);
        let next = self.all.len();
        let number = *self.places.entry(preview.bits()).or_insert(next);
        if number == next {
            self.all.push(preview);
        }
        path(number)
    }

    /// The prim that holds all of them.
    pub(super) fn into_prim(self) -> Prim<'static> {
        let children = self.all.iter().enumerate().map(|(number, preview)| preview.prim(number)).collect();
        Prim { name: "Materials".into(), type_name: "Scope", children, ..Prim::default() }
    }
}

//! Materials as UsdPreviewSurface, each once.
//!
//! A preview surface has no word for subsurface scattering, sheen, tints, the coat's index of refraction, and light that passes through
//! glass without being absorbed. A material that transmits gets the opacity that is left. The whole material is a note of the Material: the
//! JSON of the scene's fields, from which a program that knows them makes the surface anew.

use std::collections::HashMap;

use pumice_core::Error;
use pumice_scene::Material;

use super::placement::note;
use crate::Result;
use crate::usd::{Prim, Property, Value};

/// Number of 32-bit values in a [`Material`].
const VALUES: usize = 31;

/// Materials by all their fields.
#[derive(Default)]
pub(super) struct Materials {
    all: Vec<Material>,
    /// Place in `all` by the bits of the fields: scenes may have a material for each of 10⁵ labels.
    places: HashMap<[u32; VALUES], usize>,
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

    fn prim(&self, number: usize, all_fields: String) -> Prim<'static> {
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
            properties: vec![
                Property::connected("outputs:surface", "token", output),
                note("material", "string", Value::String(all_fields)),
            ],
            children: vec![shader],
            ..Prim::default()
        }
    }
}

/// The bits of all fields. A new field of the material does not compile until it is counted here.
fn bits(material: &Material) -> [u32; VALUES] {
    let Material {
        base_color: [r, g, b],
        metallic,
        roughness,
        specular,
        specular_tint: [tint_r, tint_g, tint_b],
        ior,
        transmission,
        subsurface,
        subsurface_radius: [radius_r, radius_g, radius_b],
        coat,
        coat_roughness,
        coat_ior,
        coat_tint: [coat_r, coat_g, coat_b],
        sheen,
        sheen_roughness,
        sheen_tint: [sheen_r, sheen_g, sheen_b],
        alpha,
        multiscatter,
        emission: [light_r, light_g, light_b],
    } = *material;
    let base = [r, g, b, metallic, roughness, specular, tint_r, tint_g, tint_b, ior, transmission];
    let below = [subsurface, radius_r, radius_g, radius_b];
    let above = [coat, coat_roughness, coat_ior, coat_r, coat_g, coat_b];
    let fuzz = [sheen, sheen_roughness, sheen_r, sheen_g, sheen_b];
    let rest = [alpha, f32::from(u8::from(multiscatter)), light_r, light_g, light_b];
    let mut bits = [0; VALUES];
    let values = base.iter().chain(&below).chain(&above).chain(&fuzz).chain(&rest);
    bits.iter_mut().zip(values).for_each(|(bits, value)| *bits = value.to_bits());
    bits
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
        let next = self.all.len();
        let number = *self.places.entry(bits(material)).or_insert(next);
        if number == next {
            self.all.push(*material);
        }
        path(number)
    }

    /// The prim that holds all of them.
    ///
    /// # Errors
    /// None that a valid material gives.
    pub(super) fn into_prim(self) -> Result<Prim<'static>> {
        let prim = |(number, material): (usize, &Material)| {
            let fields = serde_json::to_string(material)
                .map_err(|e| Error::Caller(format!("a material cannot be written as JSON: {e}")))?;
            Ok(Preview::of(material).prim(number, fields))
        };
        let children = self.all.iter().enumerate().map(prim).collect::<Result<_>>()?;
        Ok(Prim { name: "Materials".into(), type_name: "Scope", children, ..Prim::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_that_a_preview_surface_cannot_tell_apart_stay_apart() {
        let mut materials = Materials::default();
        let plain = Material::DEFAULT;
        let velvet = Material { sheen: 0.5, ..plain };
        let single = Material { multiscatter: false, ..plain };
        let paths = [plain, velvet, single, plain].map(|material| materials.path(&material));
        assert_eq!(paths[0], paths[3]);
        assert!(paths[0] != paths[1] && paths[1] != paths[2] && paths[0] != paths[2]);
        // The last value that is counted reaches the last place.
        let bright = Material { emission: [0.0, 0.0, 2.0], ..plain };
        assert_eq!(bits(&bright)[VALUES - 1], 2.0f32.to_bits());
        assert_eq!(materials.into_prim().unwrap().children.len(), 3);
    }
}

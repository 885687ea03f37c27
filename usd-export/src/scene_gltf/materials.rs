//! Materials with the extensions that Khronos ratified, each material once.
//!
//! | ours | glTF |
//! |---|---|
//! | base colour and alpha | `baseColorFactor`; alpha mode `BLEND` below 1 |
//! | metallic, roughness | the factors of those names |
//! | emission | `emissiveFactor`, times `KHR_materials_emissive_strength` above 1 |
//! | ior | `KHR_materials_ior` |
//! | specular, specular tint | `KHR_materials_specular`: factor 2 · specular up to 1; what is above 1 multiplies the tint |
//! | transmission | `KHR_materials_transmission` |
//! | coat, its roughness | `KHR_materials_clearcoat` |
//! | sheen · sheen tint, its roughness | `KHR_materials_sheen` |
//!
//! Colours are linear on both sides. glTF has no word for subsurface scattering, the coat's tint and index of refraction, and for light that
//! is scattered several times. An extension is written only where a material differs from what its absence means.

use std::collections::{BTreeSet, HashMap};

use gltf_json::extensions::material::{
    EmissiveStrength, EmissiveStrengthFactor, IndexOfRefraction, Ior, Specular, SpecularColorFactor,
    SpecularFactor, Transmission, TransmissionFactor,
};
use gltf_json::material::{
    AlphaMode, EmissiveFactor, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor,
};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Index, Root, extensions};
use pumice_core::Error;
use pumice_scene::Material;
use serde_json::json;

use crate::Result;

/// Materials of the file so far, by what it says of them.
#[derive(Default)]
pub(super) struct Materials {
    places: HashMap<String, Index<gltf_json::Material>>,
}

impl Materials {
    /// Place of a material, which is added if it is new. Names of its extensions are added to `used`.
    ///
    /// # Errors
    /// None that a valid material gives.
    pub(super) fn place(
        &mut self,
        material: &Material,
        root: &mut Root,
        used: &mut BTreeSet<&'static str>,
    ) -> Result<Index<gltf_json::Material>> {
        let mut written = of(material, used);
        let key = serde_json::to_string(&written)
            .map_err(|e| Error::Caller(format!("a material cannot be written as JSON: {e}")))?;
        Ok(*self.places.entry(key).or_insert_with(|| {
            written.name = Some(format!("material_{}", root.materials.len()));
            root.push(written)
        }))
    }
}

fn of(material: &Material, used: &mut BTreeSet<&'static str>) -> gltf_json::Material {
    let [r, g, b] = material.base_color;
    let strongest = material.emission.into_iter().fold(1.0, f32::max);
    gltf_json::Material {
        alpha_mode: Valid(if material.alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque }),
        // Both sides of a surface are drawn, also those of a floor without thickness.
        double_sided: true,
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([r, g, b, material.alpha]),
            metallic_factor: StrengthFactor(material.metallic),
            roughness_factor: StrengthFactor(material.roughness),
            ..PbrMetallicRoughness::default()
        },
        emissive_factor: EmissiveFactor(material.emission.map(|e| e / strongest)),
        extensions: extensions_of(material, strongest, used),
        ..gltf_json::Material::default()
    }
}

fn extensions_of(
    material: &Material,
    strongest: f32,
    used: &mut BTreeSet<&'static str>,
) -> Option<extensions::material::Material> {
    let mut all = extensions::material::Material::default();
    let mut any = false;
    let mut use_it = |name| {
        used.insert(name);
        any = true;
    };
    if strongest > 1.0 {
        use_it("KHR_materials_emissive_strength");
        let emissive_strength = EmissiveStrengthFactor(strongest);
        all.emissive_strength = Some(EmissiveStrength { emissive_strength });
    }
    if material.ior != 1.5 {
        use_it("KHR_materials_ior");
        all.ior = Some(Ior { ior: IndexOfRefraction(material.ior), ..Ior::default() });
    }
    let level = 2.0 * material.specular;
    let tint = material.specular_tint.map(|t| t * level.max(1.0));
    if level != 1.0 || tint != [1.0; 3] {
        use_it("KHR_materials_specular");
        all.specular = Some(Specular {
            specular_factor: SpecularFactor(level.min(1.0)),
            specular_color_factor: SpecularColorFactor(tint),
            ..Specular::default()
        });
    }
    if material.transmission > 0.0 {
        use_it("KHR_materials_transmission");
        let transmission_factor = TransmissionFactor(material.transmission);
        all.transmission = Some(Transmission { transmission_factor, ..Transmission::default() });
    }
    if material.coat > 0.0 {
        use_it("KHR_materials_clearcoat");
        let coat =
            json!({ "clearcoatFactor": material.coat, "clearcoatRoughnessFactor": material.coat_roughness });
        all.others.insert("KHR_materials_clearcoat".into(), coat);
    }
    if material.sheen > 0.0 {
        use_it("KHR_materials_sheen");
        let color = material.sheen_tint.map(|t| t * material.sheen);
        let sheen = json!({ "sheenColorFactor": color, "sheenRoughnessFactor": material.sheen_roughness });
        all.others.insert("KHR_materials_sheen".into(), sheen);
    }
    any.then_some(all)
}

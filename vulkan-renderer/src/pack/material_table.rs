//! Packs materials, and the material of each label.

use pumice_picture::cryptomatte::Ids;
use pumice_transport::MaterialTable;

use crate::layout::{Instance, LOD_CATCHER, Material};

/// Materials of one instance or mesh.
#[derive(Clone, Debug, Default)]
pub struct PackedMaterials {
    /// At least one material. The first is that of labels without a material of their own.
    pub materials: Vec<Material>,
    /// Material number by dense label; empty where all labels have the first material.
    pub of_label: Vec<u32>,
    /// Cryptomatte ids of each label; empty where there are no mattes.
    pub ids: Vec<Ids>,
    /// True for a mesh that is a shadow catcher.
    pub catches: bool,
}

impl PackedMaterials {
    /// Packs the materials of one instance.
    pub fn new(materials: &MaterialTable) -> Self {
        let material = |m: &pumice_scene::Material| Material {
            base_color: m.base_color,
            metallic: m.metallic,
            roughness: m.roughness,
            specular: m.specular,
            ior: m.ior,
            emission: m.emission,
            specular_tint: m.specular_tint,
            transmission: m.transmission,
            coat: m.coat,
            coat_roughness: m.coat_roughness,
            coat_ior: m.coat_ior,
            coat_tint: m.coat_tint,
            sheen: m.sheen,
            sheen_roughness: m.sheen_roughness,
            sheen_tint: m.sheen_tint,
            alpha: m.alpha,
            multiscatter: u32::from(m.multiscatter),
        };
        Self {
            materials: materials.materials().iter().map(material).collect(),
            of_label: materials.of_label().to_vec(),
            ids: materials.ids().to_vec(),
            catches: materials.catches(),
        }
    }

    /// Writes the tables' addresses and sizes into an instance's record.
    pub fn describe(&self, instance: &mut Instance, materials: u64, of_label: u64, ids: u64) {
        if self.catches {
            instance.lod = LOD_CATCHER;
        }
        instance.matte_ids = ids;
        instance.last_matte_id = (self.ids.len() as u32).saturating_sub(1);
        instance.materials = materials;
        instance.material_of_label = of_label;
        instance.label_count = self.of_label.len() as u32;
    }
}

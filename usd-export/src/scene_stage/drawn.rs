//! One instance of a scene: what is drawn of its volume, and the material of each label.

use pumice_core::CompressedVolume;
use pumice_scene::Instance;
use pumice_transport::{LoadedScene, MaterialTable};

use super::materials::Materials;

/// An instance with what an export asks of it.
pub(super) struct Drawn<'a> {
    pub(super) instance: &'a Instance,
    pub(super) volume: &'a CompressedVolume,
    /// Whether each label is drawn, by dense index.
    pub(super) visible: Vec<bool>,
    /// Path of the material of each label that is drawn, and its base colour, in the order of `material_of`.
    pub(super) materials: Vec<(String, [f32; 3])>,
    /// Place in `materials` of each label's, by dense index; those of hidden labels mean nothing.
    pub(super) material_of: Vec<u32>,
}

impl<'a> Drawn<'a> {
    /// Instance number `place` of a scene. Adds the materials that it uses.
    pub(super) fn new(scene: &'a LoadedScene, place: usize, all: &mut Materials) -> Self {
        let (instance, volume) = (&scene.scene().instances[place], &scene.volumes()[place]);
        let (visible, labels) = (scene.visible(place), volume.labels());
        let table = MaterialTable::new(&instance.style, labels.ids(), labels.contacts().iter(), &visible);
        // Only materials that some label uses, in the order of their first labels.
        let mut place_of = vec![None; table.materials().len()];
        let (mut materials, mut material_of) = (Vec::new(), Vec::with_capacity(visible.len()));
        for (label, is_visible) in (0u32..).zip(&visible) {
            let of_table = table.of_label().get(label as usize).copied().unwrap_or(0) as usize;
            let place = match place_of[of_table] {
                Some(place) => place,
                None if *is_visible => {
                    let material = &table.materials()[of_table];
                    materials.push((all.path(material), material.base_color));
                    let place = materials.len() as u32 - 1;
                    place_of[of_table] = Some(place);
                    place
                }
                None => 0,
            };
            material_of.push(place);
        }
        Self { instance, volume, visible, materials, material_of }
    }

    /// Name of its prim.
    pub(super) fn name(&self) -> String {
        format!("volume_{}", self.instance.id)
    }

    /// Path of its prim within the class that holds everything.
    pub(super) fn path(&self) -> String {
        format!("/Contents/{}", self.name())
    }
}

//! One instance of a scene: what is drawn of its volume, and the material of each label.

use pumice_core::CompressedVolume;
use pumice_scene::{Instance, Material};
use pumice_transport::{LoadedScene, MaterialTable};

use crate::{CutRegion, VoxelRegion};

/// An instance with what an export asks of it.
pub(crate) struct Drawn<'a> {
    pub(crate) instance: &'a Instance,
    pub(crate) volume: &'a CompressedVolume,
    /// Whether each label is drawn, by dense index.
    pub(crate) visible: Vec<bool>,
    /// Materials of the labels that are drawn, in the order of their first labels.
    pub(crate) materials: Vec<Material>,
    /// Place in `materials` of each label's, by dense index; those of hidden labels mean nothing.
    pub(crate) material_of: Vec<u32>,
    /// What cuts remove of it, in index space.
    pub(crate) cuts: Vec<CutRegion>,
    /// Nothing outside of it is drawn.
    pub(crate) region: Option<VoxelRegion>,
}

impl<'a> Drawn<'a> {
    /// Instance number `place` of a scene, within a region if there is one.
    pub(crate) fn new(scene: &'a LoadedScene, place: usize, region: Option<VoxelRegion>) -> Self {
        let (instance, volume) = (&scene.scene().instances[place], &scene.volumes()[place]);
        let (visible, labels) = (scene.visible(place), volume.labels());
        let table = MaterialTable::new(&instance.style, labels.ids(), labels.contacts().iter(), &visible);
        let mut place_of = vec![None; table.materials().len()];
        let (mut materials, mut material_of) = (Vec::new(), Vec::with_capacity(visible.len()));
        for (label, is_visible) in (0u32..).zip(&visible) {
            let of_table = table.of_label().get(label as usize).copied().unwrap_or(0) as usize;
            let place = match place_of[of_table] {
                Some(place) => place,
                None if *is_visible => {
                    materials.push(table.materials()[of_table]);
                    let place = materials.len() as u32 - 1;
                    place_of[of_table] = Some(place);
                    place
                }
                None => 0,
            };
            material_of.push(place);
        }
        let cuts = CutRegion::of_instance(scene.scene(), instance);
        Self { instance, volume, visible, materials, material_of, cuts, region }
    }

    /// Whether all of the volume is drawn.
    pub(crate) fn is_whole(&self) -> bool {
        self.region.is_none() && self.cuts.is_empty() && self.visible.iter().all(|is_visible| *is_visible)
    }

    /// Whether something of the box between two corners, in voxels, is drawn, of a label that is.
    pub(crate) fn reaches(&self, [low, end]: [[u32; 3]; 2]) -> bool {
        let extent = [0, 1, 2].map(|a| end[a] - low[a]);
        self.region.is_none_or(|region| region.overlaps(low, extent))
            && !self.cuts.iter().any(|cut| cut.removes([low, end]))
    }

    /// The name of its node: letters, digits and an underscore.
    pub(crate) fn name(&self) -> String {
        format!("volume_{}", self.instance.id)
    }
}

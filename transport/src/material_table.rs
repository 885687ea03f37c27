//! The materials of labels.

use std::collections::HashMap;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, OnceLock};

use pumice_picture::cryptomatte::Ids;
use pumice_scene::{LabelStyle, Material};

use crate::emitters::emission_luminance;
use crate::palette;

/// Materials of one instance by dense label, or of a mesh by the material index of its triangles.
#[derive(Clone, Debug)]
pub struct MaterialTable {
    materials: Vec<Material>,
    /// Index into `materials` by label; empty if all labels have the first.
    of_label: Vec<u32>,
    /// Whether some material is partly transparent (alpha below 1).
    has_transparent: bool,
    /// Matte ids of each label; labels past the end have the last ids. Empty where there are no mattes.
    ids: Vec<Ids>,
    /// Whether this is the table of a shadow catcher mesh.
    catches: bool,
}

/// The material table of each instance, then of each mesh; and whether any material is transparent, which each shadow ray checks.
#[derive(Clone, Debug, Default)]
pub struct MaterialTables {
    each: Vec<Arc<MaterialTable>>,
    has_transparent: OnceLock<bool>,
}

impl From<Vec<Arc<MaterialTable>>> for MaterialTables {
    fn from(each: Vec<Arc<MaterialTable>>) -> Self {
        Self { each, has_transparent: OnceLock::new() }
    }
}

impl Deref for MaterialTables {
    type Target = Vec<Arc<MaterialTable>>;

    #[inline]
    fn deref(&self) -> &Vec<Arc<MaterialTable>> {
        &self.each
    }
}

impl DerefMut for MaterialTables {
    fn deref_mut(&mut self) -> &mut Vec<Arc<MaterialTable>> {
        self.has_transparent = OnceLock::new();
        &mut self.each
    }
}

impl MaterialTables {
    /// The tables of a scene for which the need of transparent surfaces is already known.
    pub fn new(each: Vec<Arc<MaterialTable>>, has_transparent: bool) -> Self {
        Self { each, has_transparent: OnceLock::from(has_transparent) }
    }

    /// Whether some material of some table is partly transparent.
    #[inline]
    pub fn has_transparent(&self) -> bool {
        *self.has_transparent.get_or_init(|| self.each.iter().any(|materials| materials.has_transparent()))
    }
}

impl MaterialTable {
    /// One material for all labels.
    pub fn same(material: Material) -> Self {
        Self {
            has_transparent: material.alpha < 1.0,
            materials: vec![material],
            of_label: Vec::new(),
            ids: Vec::new(),
            catches: false,
        }
    }

    /// The table of a mesh with these materials, at least one; indices past the end have the last.
    pub fn of_mesh(materials: &[Material]) -> Self {
        let has_transparent = materials.iter().any(|m| m.alpha < 1.0);
        // Labels without a material of their own have the first.
        let last = materials.last().copied().unwrap_or_default();
        let materials = std::iter::once(last).chain(materials.iter().copied()).collect::<Vec<_>>();
        let of_label = (1..materials.len() as u32).collect();
        Self { of_label, materials, has_transparent, ids: Vec::new(), catches: false }
    }

    /// The table of the labels with these ids (ascending). `touching` are pairs of dense indices. They are only read for `auto_color`,
    /// where touching labels that are both `visible` get different colours.
    pub fn new(
        style: &LabelStyle,
        ids: &[u64],
        touching: impl Iterator<Item = (u32, u32)>,
        visible: &[bool],
    ) -> Self {
        let mut materials = vec![style.material];
        let mut of_label = Vec::new();
        if style.auto_color {
            let colors = palette::palette();
            materials.extend(colors.map(|base_color| Material { base_color, ..style.material }));
            of_label = palette::color_labels(ids.len(), touching, Some(visible))
                .iter()
                .map(|&c| 1 + u32::from(c))
                .collect();
        } else if !style.materials.is_empty() || !style.groups.is_empty() {
            of_label = vec![0; ids.len()];
        }
        for group in style.groups.iter() {
            // Labels of a group with the same colour share a material.
            let mut by_color = HashMap::new();
            for (label, base_color) in group.among(ids) {
                of_label[label] = *by_color.entry(base_color.map(f32::to_bits)).or_insert_with(|| {
                    materials.push(Material { base_color, ..group.material });
                    materials.len() as u32 - 1
                });
            }
        }
        for (id, material) in &style.materials {
            if let Ok(label) = ids.binary_search(id) {
                of_label[label] = materials.len() as u32;
                materials.push(*material);
            }
        }
        let has_transparent = materials.iter().any(|m| m.alpha < 1.0);
        Self { materials, of_label, has_transparent, ids: Vec::new(), catches: false }
    }

    /// The same table with these matte ids by label.
    pub fn with_ids(self, ids: Vec<Ids>) -> Self {
        Self { ids, ..self }
    }

    /// The same table, marked as a shadow catcher's or not.
    #[must_use]
    pub fn catching(self, catches: bool) -> Self {
        Self { catches, ..self }
    }

    /// Whether this is the table of a shadow catcher.
    #[inline]
    pub fn catches(&self) -> bool {
        self.catches
    }

    /// Matte ids of each label; empty where there are none.
    pub fn ids(&self) -> &[Ids] {
        &self.ids
    }

    /// Matte ids of a label.
    #[inline]
    pub fn ids_of(&self, label: u32) -> Ids {
        let last = self.ids.len().saturating_sub(1);
        self.ids.get(last.min(label as usize)).copied().unwrap_or_default()
    }

    /// All materials; labels without a material of their own have the first.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// Index into [`MaterialTable::materials`] by label; empty if all labels have the first.
    pub fn of_label(&self) -> &[u32] {
        &self.of_label
    }

    /// Material of a dense label.
    #[inline]
    pub fn material(&self, label: u32) -> &Material {
        let index = self.of_label.get(label as usize).map_or(0, |&i| i as usize);
        &self.materials[index]
    }

    /// Whether some material is partly transparent (alpha below 1).
    #[inline]
    pub fn has_transparent(&self) -> bool {
        self.has_transparent
    }

    /// Whether some material emits light.
    pub fn is_emissive(&self) -> bool {
        self.materials.iter().any(|m| emission_luminance(m) > 0.0)
    }

    /// Size on the heap in bytes.
    pub fn bytes(&self) -> u64 {
        let ids = self.ids.len() * size_of::<Ids>();
        (self.of_label.len() * 4 + self.materials.len() * size_of::<Material>() + ids) as u64
    }
}

//! What each label looks like.

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
    /// Index into `materials` by label; empty: all have the first.
    of_label: Vec<u32>,
    /// Whether some material lets light pass straight on.
    has_transparent: bool,
    /// What mattes call each label, past the end as the last; empty where there are no mattes.
    ids: Vec<Ids>,
    /// Of a mesh that is a shadow catcher.
    catches: bool,
}

/// The material table of each instance, then of each mesh; and whether any has a transparent material, which each shadow ray asks.
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
    /// The tables of a scene that is known to need surfaces that light passes straight through, or none.
    pub fn new(each: Vec<Arc<MaterialTable>>, has_transparent: bool) -> Self {
        Self { each, has_transparent: OnceLock::from(has_transparent) }
    }

    /// Whether some material of any lets light pass straight on.
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

    /// The table of a mesh with these materials, at least one: indices past the end have the last.
    pub fn of_mesh(materials: &[Material]) -> Self {
        let has_transparent = materials.iter().any(|m| m.alpha < 1.0);
        // Who has none of its own has the first.
        let last = materials.last().copied().unwrap_or_default();
        let materials = std::iter::once(last).chain(materials.iter().copied()).collect::<Vec<_>>();
        let of_label = (1..materials.len() as u32).collect();
        Self { of_label, materials, has_transparent: has_transparent, ids: Vec::new(), catches: false }
    }

    /// The table of the labels with these ids (rising). `touching` are pairs of dense indices, read only for `auto_color`, where labels
    /// that are both `visible` and touch get different colours.
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
        } else if !style.materials.is_empty() {
            of_label = vec![0; ids.len()];
        }
        for (id, material) in &style.materials {
            if let Ok(label) = ids.binary_search(id) {
                of_label[label] = materials.len() as u32;
                materials.push(*material);
            }
        }
        let has_transparent = materials.iter().any(|m| m.alpha < 1.0);
        Self { materials, of_label, has_transparent: has_transparent, ids: Vec::new(), catches: false }
    }

    /// The same with what mattes call each label.
    pub fn with_ids(self, ids: Vec<Ids>) -> Self {
        Self { ids, ..self }
    }

    /// The same as a shadow catcher, or not as one.
    #[must_use]
    pub fn catching(self, catches: bool) -> Self {
        Self { catches, ..self }
    }

    /// Whether they are a shadow catcher's.
    #[inline]
    pub fn catches(&self) -> bool {
        self.catches
    }

    /// What mattes call each label; empty where there are none.
    pub fn ids(&self) -> &[Ids] {
        &self.ids
    }

    /// What mattes call a label.
    #[inline]
    pub fn ids_of(&self, label: u32) -> Ids {
        let last = self.ids.len().saturating_sub(1);
        self.ids.get(last.min(label as usize)).copied().unwrap_or_default()
    }

    /// All materials; the first is that of labels without one of their own.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// Index into [`MaterialTable::materials`] by label; empty: all have the first.
    pub fn of_label(&self) -> &[u32] {
        &self.of_label
    }

    /// Material of a dense label.
    #[inline]
    pub fn material(&self, label: u32) -> &Material {
        let index = self.of_label.get(label as usize).map_or(0, |&i| i as usize);
        &self.materials[index]
    }

    /// Whether some material lets light pass straight on.
    #[inline]
    pub fn has_transparent(&self) -> bool {
        self.has_transparent
    }

    /// Whether some material shines.
    pub fn is_emissive(&self) -> bool {
        self.materials.iter().any(|m| emission_luminance(m) > 0.0)
    }

    /// Heap bytes.
    pub fn bytes(&self) -> u64 {
        let ids = self.ids.len() * size_of::<Ids>();
        (self.of_label.len() * 4 + self.materials.len() * size_of::<Material>() + ids) as u64
    }
}

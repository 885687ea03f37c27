//! What differs between two revisions of a scene, so that a camera move sends a camera and a colour edit a colour.
//!
//! Each flag is one kind of data that a renderer holds. It is set where that kind may have changed, and only then. What a renderer
//! derives from two kinds, it must look at both for:
//!
//! ```text
//! level of detail by distance      lod, camera, film, moved
//! automatic colours of neighbours  materials, visibility
//! ```
//!
//! Instances are matched by id, never by place.

use std::collections::BTreeMap;

use crate::{Instance, LabelStyle, Scene};

/// What differs within an instance that is in both revisions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InstanceDiff {
    /// Its id.
    pub id: u32,
    /// Its matrix.
    pub moved: bool,
    /// Its volume is another one.
    pub geometry: bool,
    /// Which labels are drawn. With [`LabelStyle::auto_color`] colours follow from this too.
    pub visibility: bool,
    /// Materials of labels.
    pub materials: bool,
}

impl InstanceDiff {
    /// Whether nothing differs.
    pub fn is_empty(&self) -> bool {
        *self == Self { id: self.id, ..Self::default() }
    }
}

/// What differs between two revisions of a scene.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SceneDiff {
    /// The camera.
    pub camera: bool,
    /// The film: its size or its filter.
    pub film: bool,
    /// Sky or backdrop.
    pub world: bool,
    /// Suns.
    pub suns: bool,
    /// Level of detail.
    pub lod: bool,
    /// All settings but the level of detail: mode, bounces, roulette, reach, seed.
    pub light_settings: bool,
    /// Ids of instances that are new, in the new order.
    pub added: Vec<u32>,
    /// Ids of instances that are gone, in the old order.
    pub removed: Vec<u32>,
    /// Instances that stayed come in another order; hits name places, so passes change.
    pub reordered: bool,
    /// Instances that stayed and differ, in the new order.
    pub changed: Vec<InstanceDiff>,
}

impl SceneDiff {
    /// What to send to a renderer that shows `old`, or nothing yet, for it to show `new`. Both are valid scenes.
    pub fn between(old: Option<&Scene>, new: &Scene) -> Self {
        let Some(old) = old else {
            return Self {
                camera: true,
                film: true,
                world: true,
                suns: true,
                lod: true,
                light_settings: true,
                added: new.instances.iter().map(|i| i.id).collect(),
                ..Self::default()
            };
        };
        let by_id = |scene: &'_ Scene| -> BTreeMap<u32, usize> {
            scene.instances.iter().enumerate().map(|(place, i)| (i.id, place)).collect()
        };
        let (old_places, new_places) = (by_id(old), by_id(new));
        let mut diff = Self {
            camera: old.camera != new.camera,
            film: old.film != new.film,
            world: old.world != new.world,
            suns: old.suns != new.suns,
            lod: old.settings.lod != new.settings.lod,
            light_settings: {
                let lod = new.settings.lod;
                crate::Settings { lod, ..old.settings } != new.settings
            },
            ..Self::default()
        };
        let gone = old.instances.iter().map(|i| i.id).filter(|id| !new_places.contains_key(id));
        diff.removed = gone.collect();
        let mut former_place = None;
        for instance in &new.instances {
            let Some(&place) = old_places.get(&instance.id) else {
                diff.added.push(instance.id);
                continue;
            };
            diff.reordered |= former_place.is_some_and(|former| place < former);
            former_place = Some(place);
            let change = instance_diff(&old.instances[place], instance);
            if !change.is_empty() {
                diff.changed.push(change);
            }
        }
        diff
    }

    /// Whether both revisions give the same picture.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

fn instance_diff(old: &Instance, new: &Instance) -> InstanceDiff {
    // Taken apart by name, so that a new field cannot be forgotten here.
    let Instance { id, source, world_from_index, style } = new;
    let LabelStyle { show, material, auto_color, materials } = style;
    InstanceDiff {
        id: *id,
        moved: old.world_from_index != *world_from_index,
        geometry: old.source != *source,
        visibility: !old.style.show.same_labels(show),
        materials: old.style.material != *material
            || old.style.auto_color != *auto_color
            || old.style.materials != *materials,
    }
}

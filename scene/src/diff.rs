//! The difference of two revisions of a scene, so that a camera move sends only a camera and a colour edit only colours.
//!
//! Each flag stands for one kind of data that a renderer holds. It is set if and only if that kind may have changed. Data that a
//! renderer derives from several kinds depends on all their flags:
//!
//! ```text
//! level of detail by distance      lod, camera, film, moved
//! automatic colours of neighbours  materials, visibility
//! ```
//!
//! Instances and meshes are matched by id, never by their position in the list.

use std::collections::BTreeMap;

use crate::{Instance, LabelStyle, Mesh, Scene};

/// The difference of an instance that is in both revisions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InstanceDiff {
    /// Its id.
    pub id: u32,
    /// Its matrix differs.
    pub moved: bool,
    /// It shows another volume.
    pub geometry: bool,
    /// Other labels are drawn. With [`LabelStyle::auto_color`] this changes colours too.
    pub visibility: bool,
    /// Materials of labels differ.
    pub materials: bool,
}

impl InstanceDiff {
    /// Whether nothing differs.
    pub fn is_empty(&self) -> bool {
        *self == Self { id: self.id, ..Self::default() }
    }
}

/// The difference of a mesh that is in both revisions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshDiff {
    /// Its id.
    pub id: u32,
    /// Its matrix differs.
    pub moved: bool,
    /// It has other triangles.
    pub geometry: bool,
    /// Its materials differ, or whether it is a shadow catcher.
    pub materials: bool,
}

impl MeshDiff {
    /// Whether nothing differs.
    pub fn is_empty(&self) -> bool {
        *self == Self { id: self.id, ..Self::default() }
    }
}

/// The difference of two revisions of a scene. A flag is set where that part of the scene differs.
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
    /// Lamps.
    pub lights: bool,
    /// Cuts.
    pub cuts: bool,
    /// Level of detail.
    pub lod: bool,
    /// All settings except the level of detail: mode, bounces, Russian roulette, reach of ambient occlusion, seed, clamps.
    pub light_settings: bool,
    /// Ids of instances that are new, in the new order.
    pub added: Vec<u32>,
    /// Ids of instances that were removed, in the old order.
    pub removed: Vec<u32>,
    /// The instances in both revisions come in another order. Hits refer to instances by list position, so passes change.
    pub reordered: bool,
    /// Instances that are in both revisions and differ, in the new order.
    pub changed: Vec<InstanceDiff>,
    /// Ids of meshes that are new, in the new order.
    pub meshes_added: Vec<u32>,
    /// Ids of meshes that were removed, in the old order.
    pub meshes_removed: Vec<u32>,
    /// The meshes in both revisions come in another order.
    pub meshes_reordered: bool,
    /// Meshes that are in both revisions and differ, in the new order.
    pub meshes_changed: Vec<MeshDiff>,
}

impl SceneDiff {
    /// The difference from `old` to `new`: what a renderer that shows `old` (or nothing yet, if `None`) needs to show `new`. Both must
    /// be valid scenes.
    pub fn between(old: Option<&Scene>, new: &Scene) -> Self {
        let Some(old) = old else {
            return Self {
                camera: true,
                film: true,
                world: true,
                suns: true,
                lights: true,
                cuts: true,
                lod: true,
                light_settings: true,
                added: new.instances.iter().map(|i| i.id).collect(),
                meshes_added: new.meshes.iter().map(|m| m.id).collect(),
                ..Self::default()
            };
        };
        let mut diff = Self {
            camera: old.camera != new.camera,
            film: old.film != new.film,
            world: old.world != new.world,
            suns: old.suns != new.suns,
            lights: old.lights != new.lights,
            cuts: old.cuts != new.cuts,
            lod: old.settings.lod != new.settings.lod,
            light_settings: {
                let lod = new.settings.lod;
                crate::Settings { lod, ..old.settings } != new.settings
            },
            ..Self::default()
        };
        let instances = match_by_id(&old.instances, &new.instances, |i| i.id);
        diff.changed = instances.stayed.iter().map(|(old, new)| instance_diff(old, new)).collect();
        diff.changed.retain(|change| !change.is_empty());
        (diff.added, diff.removed, diff.reordered) =
            (instances.added, instances.removed, instances.reordered);
        let meshes = match_by_id(&old.meshes, &new.meshes, |m| m.id);
        diff.meshes_changed = meshes.stayed.iter().map(|(old, new)| mesh_diff(old, new)).collect();
        diff.meshes_changed.retain(|change| !change.is_empty());
        (diff.meshes_added, diff.meshes_removed, diff.meshes_reordered) =
            (meshes.added, meshes.removed, meshes.reordered);
        diff
    }

    /// Whether both revisions give the same picture.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// The items of two lists, matched by id.
struct Matched<'a, T> {
    added: Vec<u32>,
    removed: Vec<u32>,
    reordered: bool,
    /// Pairs of the old and the new item with the same id, in the new order.
    stayed: Vec<(&'a T, &'a T)>,
}

fn match_by_id<'a, T>(old: &'a [T], new: &'a [T], id: impl Fn(&T) -> u32) -> Matched<'a, T> {
    let places = |items: &[T]| -> BTreeMap<u32, usize> {
        items.iter().enumerate().map(|(place, item)| (id(item), place)).collect()
    };
    let (old_places, new_places) = (places(old), places(new));
    let gone = old.iter().map(&id).filter(|id| !new_places.contains_key(id));
    let mut matched =
        Matched { added: Vec::new(), removed: gone.collect(), reordered: false, stayed: Vec::new() };
    let mut former_place = None;
    for item in new {
        let Some(&place) = old_places.get(&id(item)) else {
            matched.added.push(id(item));
            continue;
        };
        matched.reordered |= former_place.is_some_and(|former| place < former);
        former_place = Some(place);
        matched.stayed.push((&old[place], item));
    }
    matched
}

fn mesh_diff(old: &Mesh, new: &Mesh) -> MeshDiff {
    // Taken apart by name, so that a new field cannot be forgotten here.
    let Mesh { id, source, world_from_mesh, materials, shadow_catcher } = new;
    MeshDiff {
        id: *id,
        moved: old.world_from_mesh != *world_from_mesh,
        geometry: old.source != *source,
        materials: old.materials != *materials || old.shadow_catcher != *shadow_catcher,
    }
}

fn instance_diff(old: &Instance, new: &Instance) -> InstanceDiff {
    // Taken apart by name, so that a new field cannot be forgotten here.
    let Instance { id, source, reading, world_from_index, style } = new;
    let LabelStyle { show, material, auto_color, groups, materials } = style;
    InstanceDiff {
        id: *id,
        moved: old.world_from_index != *world_from_index,
        geometry: old.source != *source || old.reading != *reading,
        visibility: !old.style.show.same_labels(show),
        materials: old.style.material != *material
            || old.style.auto_color != *auto_color
            || old.style.groups != *groups
            || old.style.materials != *materials,
    }
}

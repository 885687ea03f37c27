//! Decides which data an edit rebuilds and which it keeps, once for all renderers and before anything is built.
//!
//! ```text
//! part                   depends on                                           kept for
//! lights                 world, suns, lamps                                   all other edits
//! materials              style, drawn labels, whether there are mattes        another placement, camera, film …
//! hierarchy of boxes     volume, drawn labels, whether boxes are tight        another placement, cut, coarser level …
//! bricks                 the same, level of detail                            another placement, cut …
//! neighbours of boxes    the same, smooth voxels
//! triangles              mesh                                                 another placement, other materials
//! emitters               all of these for emissive parts, but base colours    any change to parts that do not emit
//! top-level hierarchy    the list of instances, and their bounds              other materials, cuts …
//! ```
//! The needs of the scenes ([`pumice_scene::Needs`]) are compared like the scenes themselves.
//!
//! A part that cannot be kept may be shared: instances that draw the same labels of the same volume have one hierarchy. Rules that concern
//! one device alone (a ray tracing pipeline shares none) are added by its renderer.

use std::sync::Arc;

use pumice_picture::PassSums;
use pumice_scene::{Film, LabelGroup, LabelStyle, Material, Part, Scene, SceneDiff};

use crate::LoadedScene;
use crate::emitters::emission_luminance;
use crate::geometry::LodChoice;

/// Whether a part that a renderer has once is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reuse {
    /// The part is valid as it is.
    Keep,
    /// The part must be rebuilt.
    Build,
}

/// The origin of a part of an instance or of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Kept from the instance, or mesh, at this index of the previous scene.
    Kept(usize),
    /// Shared with an earlier instance, or mesh, of the new scene, at this index.
    Shared(usize),
    /// Built for this instance or mesh.
    Built,
}

/// The plan for the parts of an instance of a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstancePlan {
    /// Its index in the previous scene, if it had the same volume there.
    pub former: Option<usize>,
    /// Materials by label.
    pub materials: Source,
    /// The hierarchy over the drawn boxes, in index space.
    pub hierarchy: Source,
    /// The data built for the levels of detail of these boxes: bricks.
    pub levels: Source,
    /// The neighbours of each box with the same label, where voxels are shaded smooth.
    pub neighbors: Source,
    /// Its index in the list of instances, which hits report.
    pub number: Reuse,
    /// Its matrix, and the distances at which its boxes become coarser.
    pub placement: Reuse,
    /// The parts that are cut away from it.
    pub cuts: Reuse,
}

/// The plan for the parts of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshPlan {
    /// Materials by material index.
    pub materials: Source,
    /// Triangles, and the hierarchy over them.
    pub triangles: Source,
    /// Its index among all instances: meshes come after volumes.
    pub number: Reuse,
    /// Its matrix.
    pub placement: Reuse,
}

/// The plan for all data of a renderer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScenePlan {
    /// Rays of the camera.
    pub camera: Reuse,
    /// Anything of the film: its size, its filter, its passes.
    pub film: Reuse,
    /// Table of the film's filter.
    pub filter: Reuse,
    /// The film's memory: its size, and the sums that it keeps for passes.
    pub sums: Reuse,
    /// Sky, suns and lamps, and the choice among them.
    pub lights: Reuse,
    /// The plan of each instance of a volume.
    pub instances: Vec<InstancePlan>,
    /// The plan of each mesh.
    pub meshes: Vec<MeshPlan>,
    /// Emissive surfaces, and the tree over them.
    pub emitters: Reuse,
    /// The hierarchy over all instances and meshes.
    pub top_level: Reuse,
}

impl Reuse {
    fn keep_if(same: bool) -> Self {
        if same { Self::Keep } else { Self::Build }
    }

    /// Whether the part is rebuilt.
    pub fn is_build(self) -> bool {
        self == Self::Build
    }
}

impl Source {
    fn kept_or_shared(kept: Option<usize>, shared: Option<usize>) -> Self {
        kept.map(Self::Kept).or(shared.map(Self::Shared)).unwrap_or(Self::Built)
    }

    fn is_kept(self) -> bool {
        matches!(self, Self::Kept(_))
    }

    /// The same for a renderer that shares nothing between instances.
    #[must_use]
    pub fn unshared(self) -> Self {
        if let Self::Shared(_) = self { Self::Built } else { self }
    }

    /// The part itself, or `None` where it must be built: `kept` and `shared` find it by its index.
    pub fn find<T>(
        self,
        kept: impl FnOnce(usize) -> Option<T>,
        shared: impl FnOnce(usize) -> Option<T>,
    ) -> Option<T> {
        match self {
            Self::Kept(place) => kept(place),
            Self::Shared(place) => shared(place),
            Self::Built => None,
        }
    }
}

impl InstancePlan {
    /// Hierarchy, bricks and neighbours as one part, for a renderer that holds them as one.
    pub fn boxes(&self) -> Source {
        let parts = [self.hierarchy, self.levels, self.neighbors];
        parts.into_iter().find(|part| !part.is_kept()).unwrap_or(self.hierarchy)
    }

    /// Whether all of its geometry is unchanged and in the same place.
    pub fn keeps_geometry(&self) -> bool {
        self.boxes().is_kept() && [self.number, self.placement, self.cuts] == [Reuse::Keep; 3]
    }
}

impl MeshPlan {
    /// Whether all of its geometry is unchanged and in the same place.
    pub fn keeps_geometry(&self) -> bool {
        self.triangles.is_kept() && [self.number, self.placement] == [Reuse::Keep; 2]
    }
}

impl ScenePlan {
    /// What a renderer that shows `old`, or nothing yet, must build to show `new`.
    pub fn between(old: Option<&LoadedScene>, new: &LoadedScene) -> Self {
        let edit = Edit { old, new, diff: SceneDiff::between(old.map(LoadedScene::scene), new.scene()) };
        let instances: Vec<_> = (0..new.volumes().len()).map(|place| edit.instance(place)).collect();
        let meshes: Vec<_> = (0..new.meshes().len()).map(|place| edit.mesh(place)).collect();
        let Edit { diff, .. } = &edit;
        let of_film = |same: fn(&Scene, &Scene) -> bool| {
            Reuse::keep_if(old.is_some_and(|old| same(old.scene(), new.scene())))
        };
        Self {
            camera: Reuse::keep_if(!diff.camera && !diff.film),
            film: Reuse::keep_if(!diff.film),
            filter: of_film(|old, new| old.film.filter == new.film.filter),
            sums: of_film(|old, new| {
                size_of(&old.film) == size_of(&new.film) && sums_of(old) == sums_of(new)
            }),
            lights: Reuse::keep_if(!diff.world && !diff.suns && !diff.lights),
            emitters: Reuse::keep_if(edit.same_emission(&instances, &meshes)),
            top_level: Reuse::keep_if(edit.bounds_are_kept(&instances, &meshes)),
            instances,
            meshes,
        }
    }
}

fn size_of(film: &Film) -> [u32; 2] {
    [film.width, film.height]
}

/// The sums that a scene's film keeps for its passes.
pub fn sums_of(scene: &Scene) -> PassSums {
    PassSums::of(&scene.film, scene.meshes.iter().any(|mesh| mesh.shadow_catcher))
}

/// Whether both choices give boxes of the same kind: with a distance, each ray decides, whatever the distance is.
fn is_same_kind(a: LodChoice, b: LodChoice) -> bool {
    let by_distance = |lod| matches!(lod, LodChoice::Distance { .. });
    a == b || by_distance(a) && by_distance(b)
}

struct Edit<'a> {
    old: Option<&'a LoadedScene>,
    new: &'a LoadedScene,
    diff: SceneDiff,
}

impl Edit<'_> {
    /// Whether a part is built for both scenes, or for neither.
    fn same(&self, part: Part) -> bool {
        self.old.is_some_and(|old| old.needs().parts().has(part) == self.new.needs().parts().has(part))
    }

    fn instance(&self, place: usize) -> InstancePlan {
        let (scene, volumes) = (self.new.scene(), self.new.volumes());
        let (instance, volume) = (&scene.instances[place], &volumes[place]);
        // An earlier instance that draws the same labels of the same volume.
        let twin = (0..place).find(|&other| {
            Arc::ptr_eq(&volumes[other], volume) && scene.instances[other].style.show == instance.style.show
        });
        let alike = twin.filter(|&other| scene.instances[other].style == instance.style);
        let mut plan = InstancePlan {
            former: None,
            materials: Source::kept_or_shared(None, alike),
            hierarchy: Source::kept_or_shared(None, twin),
            levels: Source::kept_or_shared(None, twin),
            neighbors: Source::kept_or_shared(None, twin),
            number: Reuse::Build,
            placement: Reuse::Build,
            cuts: Reuse::Build,
        };
        let Some(old) = self.old else { return plan };
        // The same path may refer to another volume by now.
        let is_former = |&place: &usize| Arc::ptr_eq(&old.volumes()[place], volume);
        let Some(former) = old.scene().instances.iter().position(|i| i.id == instance.id).filter(is_former)
        else {
            return plan;
        };
        let change = self.diff.changed.iter().find(|c| c.id == instance.id).copied().unwrap_or_default();
        let keep = |same: bool, twin| Source::kept_or_shared(same.then_some(former), twin);
        let lods = [old.lod(), self.new.lod()];
        let [was_tight, is_tight] = lods.map(|lod| lod == LodChoice::Voxels);
        let same_boxes = !change.visibility && was_tight == is_tight && self.same(Part::HiddenLabels);
        let smooth = |scene: &Scene| scene.settings.smooth_voxels;
        let same_cuts = old.scene().cuts_of(instance.id).eq(scene.cuts_of(instance.id));
        let is_cut = scene.cuts_of(instance.id).next().is_some();
        plan.former = Some(former);
        // The colours of neighbours depend on which labels are drawn.
        plan.materials = keep(!change.materials && !change.visibility && self.same(Part::Mattes), alike);
        plan.hierarchy = keep(same_boxes, twin);
        plan.levels = keep(same_boxes && is_same_kind(lods[0], lods[1]), twin);
        plan.neighbors = keep(same_boxes && smooth(old.scene()) == smooth(scene), twin);
        plan.number = Reuse::keep_if(former == place);
        plan.placement = Reuse::keep_if(!change.moved && lods[0] == lods[1]);
        plan.cuts = Reuse::keep_if(same_cuts && !(is_cut && change.moved));
        plan
    }

    fn mesh(&self, place: usize) -> MeshPlan {
        let (scene, meshes) = (self.new.scene(), self.new.meshes());
        let (mesh, data) = (&scene.meshes[place], &meshes[place]);
        let twin = (0..place).find(|&other| Arc::ptr_eq(&meshes[other], data));
        let mut plan = MeshPlan {
            materials: Source::Built,
            triangles: Source::kept_or_shared(None, twin),
            number: Reuse::Build,
            placement: Reuse::Build,
        };
        let Some(old) = self.old else { return plan };
        let is_former = |&place: &usize| Arc::ptr_eq(&old.meshes()[place], data);
        let Some(former) = old.scene().meshes.iter().position(|m| m.id == mesh.id).filter(is_former) else {
            return plan;
        };
        let change = self.diff.meshes_changed.iter().find(|c| c.id == mesh.id).copied().unwrap_or_default();
        // Mattes name a mesh by its source.
        let is_renamed = self.new.needs().parts().has(Part::Mattes) && change.geometry;
        if !change.materials && !is_renamed && self.same(Part::Mattes) {
            plan.materials = Source::Kept(former);
        }
        plan.triangles = Source::Kept(former);
        plan.number = Reuse::keep_if(old.volumes().len() + former == self.new.volumes().len() + place);
        plan.placement = Reuse::keep_if(!change.moved);
        plan
    }

    /// Whether there are as many instances and meshes as before, so that their indices mean the same.
    fn same_counts(&self) -> bool {
        self.old.is_some_and(|old| {
            old.volumes().len() == self.new.volumes().len() && old.meshes().len() == self.new.meshes().len()
        })
    }

    /// Whether everything emissive has the same place and the same emission, whatever its base colours.
    fn same_emission(&self, instances: &[InstancePlan], meshes: &[MeshPlan]) -> bool {
        let Some(old) = self.old.filter(|_| self.same_counts()) else { return false };
        let (old, new) = (old.scene(), self.new.scene());
        let of_instances =
            old.instances.iter().zip(&new.instances).zip(instances).all(|((old, new), plan)| {
                let shine = [&old.style, &new.style].map(style_is_emissive);
                shine == [false; 2] || plan.keeps_geometry() && styles_shine_alike(&old.style, &new.style)
            });
        let of_meshes = old.meshes.iter().zip(&new.meshes).zip(meshes).all(|((old, new), plan)| {
            let shine = [&old.materials, &new.materials].map(|all| all.iter().any(is_emissive));
            shine == [false; 2]
                || plan.keeps_geometry()
                    && old.materials.iter().map(light).eq(new.materials.iter().map(light))
        });
        of_instances && of_meshes
    }

    /// Whether the drawn parts of each instance and mesh have the same bounds as before.
    fn bounds_are_kept(&self, instances: &[InstancePlan], meshes: &[MeshPlan]) -> bool {
        let least = |scene: &LoadedScene| scene.needs().least_of_a_tree();
        self.same_counts()
            && self.old.is_some_and(|old| least(old) == least(self.new))
            && instances.iter().all(|i| i.hierarchy.is_kept() && i.number == Reuse::Keep && !self.is_moved(i))
            && meshes.iter().all(MeshPlan::keeps_geometry)
    }

    fn is_moved(&self, plan: &InstancePlan) -> bool {
        let (Some(old), Some(former)) = (self.old, plan.former) else { return true };
        let id = old.scene().instances[former].id;
        self.diff.changed.iter().any(|change| change.id == id && change.moved)
    }
}

fn is_emissive(material: &Material) -> bool {
    emission_luminance(material) > 0.0
}

fn style_is_emissive(style: &LabelStyle) -> bool {
    is_emissive(&style.material)
        || style.materials.values().any(is_emissive)
        || style.groups.iter().any(|group| is_emissive(&group.material))
}

/// The properties that a material's light depends on; `None` for a material that does not emit.
fn light(material: &Material) -> Option<Material> {
    is_emissive(material).then_some(Material { base_color: [0.0; 3], ..*material })
}

/// Whether the same labels emit the same light.
fn styles_shine_alike(old: &LabelStyle, new: &LabelStyle) -> bool {
    let own =
        |style: &LabelStyle| -> Vec<_> { style.materials.iter().map(|(id, m)| (*id, light(m))).collect() };
    old.auto_color == new.auto_color
        && light(&old.material) == light(&new.material)
        && groups_shine_alike(&old.groups, &new.groups)
        && (old.materials == new.materials || own(old) == own(new))
}

/// Whether the same labels of groups emit the same light, whatever their colours.
fn groups_shine_alike(old: &[LabelGroup], new: &[LabelGroup]) -> bool {
    fn shining(groups: &[LabelGroup]) -> impl Iterator<Item = (&[u64], Option<Material>)> {
        groups.iter().map(|g| (g.ids(), light(&g.material))).filter(|(_, light)| light.is_some())
    }
    old.iter().eq(new) || shining(old).eq(shining(new))
}

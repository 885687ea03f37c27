//! All instances and meshes of a scene behind one [`Tracer`].
//!
//! The hit is the nearest of the hits of each instance by itself, and that of the lowest index where several are equally near. It therefore
//! depends neither on the order in which instances are asked, nor on the range that earlier hits leave to the others.
//!
//! **Contacts.** Where light passes through volumes that may touch ([`Contacts`]), of faces in one place the back of a label comes before
//! the front of another, and a back where a path leaves the face of another instance was passed together with that face: only what comes
//! behind it counts.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use pumice_core::CompressedVolume;
use pumice_transport::geometry::drawn_pages::SAMPLES_A_PASS_OF_PAGES;
use pumice_transport::geometry::instance_tree::{InstanceTree, WorldBounds};
use pumice_transport::geometry::{Contacts, LodChoice};
use pumice_transport::{Hit, PathOrigin, RayInWorld, RenderError, Surface, SurfaceKind, Tracer};

use super::{MeshTracer, VolumeTracer};

/// A volume placed in the world, with the labels that are drawn.
#[derive(Clone, Debug)]
pub struct TracedInstance {
    /// The volume; several instances may share it.
    pub volume: Arc<CompressedVolume>,
    /// Transform from index space to the world; it may mirror and shear but not be singular.
    pub world_from_index: DAffine3,
    /// Visibility by dense label; labels past the end are hidden.
    pub visible: Vec<bool>,
    /// Choice of the level of detail.
    pub lod: LodChoice,
}

/// The geometry of a scene (see the module).
#[derive(Debug)]
pub struct SceneTracer {
    volumes: Vec<Arc<VolumeTracer>>,
    meshes: Vec<Arc<MeshTracer>>,
    /// Whether a mesh, or the voxels of a volume, have smooth normals.
    is_smooth: bool,
    /// Hierarchy over instances; `None` if they are asked in turn.
    tree: Option<Arc<InstanceTree>>,
    /// The meshes that are shadow catchers, if there are any; they are asked in turn.
    catchers: Option<Box<SceneTracer>>,
    /// Where volumes touch; `None` where light passes through none, or there is only one.
    contacts: Option<Contacts>,
}

/// The nearest hit so far.
struct Nearest {
    hit: Option<Hit>,
    /// Its t; infinite where there is none.
    t: f64,
    t_max: f64,
    /// Difference in t up to which the back of a label comes before the front of another; 0 where there are no contacts.
    near: f64,
}

impl Nearest {
    fn new(t_max: f64, near: f64) -> Self {
        Self { hit: None, t: f64::INFINITY, t_max, near }
    }

    #[inline]
    fn see(&mut self, found: Option<Hit>) {
        let Some(found) = found else { return };
        if found.t < self.t_max && self.comes_first(&found) {
            self.t = found.t;
            self.hit = Some(found);
        }
    }

    /// Whether a hit comes before the nearest one so far.
    #[inline]
    fn comes_first(&self, found: &Hit) -> bool {
        let Some(other) = &self.hit else { return found.t < self.t };
        if self.near > 0.0 && found.is_seen_from_within() != other.is_seen_from_within() {
            let is_face = |hit: &Hit| hit.surface.kind != SurfaceKind::Triangle;
            if is_face(found) && is_face(other) {
                return match found.from_inside {
                    true => found.t <= self.t + self.near,
                    false => found.t + self.near < self.t,
                };
            }
        }
        found.t < self.t || (found.t == self.t && found.surface.instance < other.surface.instance)
    }
}

impl SceneTracer {
    /// Builds the acceleration structures, bricks where they are possible; `instances[i]` is reported as `Surface::instance` i.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the instance whose matrix is singular or which has too many boxes.
    pub fn new(instances: &[TracedInstance]) -> Result<Self, RenderError> {
        let build = |(i, instance)| VolumeTracer::in_bricks(i as u32, instance).map(Arc::new);
        Ok(Self::of(instances.iter().enumerate().map(build).collect::<Result<_, _>>()?))
    }

    /// Like [`SceneTracer::new`] without bricks: traces as a device does, where a ray along an edge may hit another of the voxels there.
    ///
    /// # Errors
    /// As [`SceneTracer::new`].
    pub fn without_bricks(instances: &[TracedInstance]) -> Result<Self, RenderError> {
        let build = |(i, instance)| VolumeTracer::new(i as u32, instance).map(Arc::new);
        Ok(Self::of(instances.iter().enumerate().map(build).collect::<Result<_, _>>()?))
    }

    /// The geometry of instances that are already built; the one at index i must have been built as instance i.
    pub fn of(volumes: Vec<Arc<VolumeTracer>>) -> Self {
        let is_smooth = volumes.iter().any(|v| v.is_smooth());
        Self { is_smooth, volumes, meshes: Vec::new(), tree: None, catchers: None, contacts: None }
    }

    /// Adds these meshes; the first has the index after the last volume's.
    #[must_use]
    pub fn with_meshes(self, meshes: Vec<Arc<MeshTracer>>) -> Self {
        let is_smooth = self.is_smooth || meshes.iter().any(|mesh| mesh.is_smooth());
        Self { meshes, is_smooth, ..self }
    }

    /// Marks those of its meshes as shadow catchers for which `catches` is true, by index.
    #[must_use]
    pub fn with_catchers(self, catches: &[bool]) -> Self {
        let of = self.meshes.iter().zip(catches).filter(|(_, catches)| **catches);
        let meshes: Vec<_> = of.map(|(mesh, _)| Arc::clone(mesh)).collect();
        let catchers = (!meshes.is_empty()).then(|| Box::new(Self::of(Vec::new()).with_meshes(meshes)));
        Self { catchers, ..self }
    }

    /// Adds the contacts of its volumes.
    #[must_use]
    pub fn with_contacts(self, contacts: Option<Contacts>) -> Self {
        Self { contacts, ..self }
    }

    /// Adds a hierarchy over instances and meshes if there are at least `least` of them ([`pumice_scene::INSTANCES_OF_A_TREE`] is where it
    /// pays off). Also returns whether one was built.
    ///
    /// # Errors
    /// As [`pumice_transport::Bvh::build`].
    pub fn with_tree(self, least: usize) -> Result<(Self, bool), RenderError> {
        if self.volumes.len() + self.meshes.len() < least {
            return Ok((self, false));
        }
        let tree = InstanceTree::new(self.world_bounds(), least)?.map(Arc::new);
        let made = tree.is_some();
        Ok((Self { tree, ..self }, made))
    }

    /// Reuses the hierarchy of `former`, in which all instances and meshes have the same bounds.
    #[must_use]
    pub fn with_tree_of(self, former: &Self) -> Self {
        Self { tree: former.tree.clone(), ..self }
    }

    /// The hierarchy over instances, if there is one.
    pub fn tree(&self) -> Option<&InstanceTree> {
        self.tree.as_deref()
    }

    fn world_bounds(&self) -> impl Iterator<Item = Option<WorldBounds>> {
        let of_volumes = self.volumes.iter().map(|v| v.world_bounds());
        of_volumes.chain(self.meshes.iter().map(|m| m.world_bounds()))
    }

    /// Size on the heap in bytes of the acceleration structures, shared ones counted once, without the volumes and the meshes.
    pub fn bytes(&self) -> u64 {
        let mut seen = std::collections::BTreeSet::new();
        let volumes = self.own_volumes().map(|v| v.bytes()).sum::<u64>();
        let meshes = self.meshes.iter().filter(|m| seen.insert(m.hierarchy_address()));
        volumes + meshes.map(|m| m.bytes()).sum::<u64>() + self.tree.as_ref().map_or(0, |t| t.bytes())
    }

    /// The part of [`SceneTracer::bytes`] that bricks take.
    pub fn brick_bytes(&self) -> u64 {
        self.own_volumes().map(|v| v.brick_bytes()).sum()
    }

    /// Number of pages of its volumes that have been loaded, each time again, and of pages that there are.
    pub fn page_loads(&self) -> (u64, u64) {
        let of = self.own_volumes().filter_map(|volume| volume.page_loads());
        of.fold((0, 0), |sum, of| (sum.0 + of.0, sum.1 + of.1))
    }

    /// Volumes; of those that share a hierarchy, the first.
    fn own_volumes(&self) -> impl Iterator<Item = &Arc<VolumeTracer>> {
        let mut seen = std::collections::BTreeSet::new();
        self.volumes.iter().filter(move |v| seen.insert(v.hierarchy_address()))
    }

    /// Geometry of all instances of volumes.
    pub fn volumes(&self) -> &[Arc<VolumeTracer>] {
        &self.volumes
    }

    /// Geometry of all meshes.
    pub fn meshes(&self) -> &[Arc<MeshTracer>] {
        &self.meshes
    }

    /// Geometry of one mesh, by its index among the meshes.
    pub fn mesh(&self, place: usize) -> Option<&Arc<MeshTracer>> {
        self.meshes.get(place)
    }

    /// Geometry of one instance of a volume.
    pub fn instance(&self, instance: u32) -> Option<&Arc<VolumeTracer>> {
        self.volumes.get(instance as usize)
    }

    /// Dense index of the visible label at a voxel of an instance, at the level of detail that is drawn.
    pub fn label_at(&self, instance: u32, voxel: [u32; 3]) -> Option<u32> {
        self.instance(instance)?.label_at(voxel)
    }

    /// See [`VolumeTracer::next_boundary`].
    pub fn next_boundary(
        &self,
        ray: &RayInWorld,
        instance: u32,
        label: u32,
        from: PathOrigin,
        t_max: f64,
    ) -> Option<Hit> {
        self.instance(instance)?.next_boundary(ray, label, from, t_max)
    }
}

impl SceneTracer {
    /// Asks one instance or mesh, by its index.
    #[inline]
    fn ask(&self, number: u32, ray: &RayInWorld, from: PathOrigin, nearest: &mut Nearest) {
        let (place, volumes, t_max) = (number as usize, self.volumes.len(), nearest.t_max);
        nearest.see(match self.volumes.get(place) {
            Some(volume) => {
                let hit = volume.first_hit_within(ray, from, t_max, nearest.t);
                match hit {
                    Some(hit) if nearest.near > 0.0 && self.was_passed(number, &hit, from, nearest.near) => {
                        // What comes behind it.
                        let ahead = 2.0 * nearest.near;
                        let ray = RayInWorld { origin: ray.origin + ray.direction * ahead, ..*ray };
                        let hit = volume.first_hit_within(&ray, PathOrigin::Free, t_max, nearest.t);
                        hit.map(|hit| Hit { t: hit.t + ahead, ..hit })
                    }
                    hit => hit,
                }
            }
            None => {
                self.meshes.get(place - volumes).and_then(|m| m.first_hit_within(ray, from, t_max, nearest.t))
            }
        });
    }

    /// Whether this hit of an instance is a back in the place of another instance's face, which the path leaves.
    #[inline]
    fn was_passed(&self, number: u32, hit: &Hit, from: PathOrigin, near: f64) -> bool {
        let PathOrigin::Face(left) = from else { return false };
        hit.t <= near
            && hit.is_seen_from_within()
            && left.kind != SurfaceKind::Triangle
            && left.instance != number
    }

    /// The distance of contacts in the ray's t; 0 where there are none.
    #[inline]
    fn near(&self, ray: &RayInWorld) -> f64 {
        self.contacts.as_ref().map_or(0.0, |contacts| contacts.distance() / ray.direction.length())
    }

    #[inline]
    fn occludes(&self, number: u32, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        let (place, volumes) = (number as usize, self.volumes.len());
        match self.volumes.get(place) {
            Some(volume) => volume.occluded(ray, from, t_max),
            None => self.meshes.get(place - volumes).is_some_and(|mesh| mesh.occluded(ray, from, t_max)),
        }
    }

    /// Index of the instance that a path continues from.
    #[inline]
    fn left(&self, from: PathOrigin) -> Option<u32> {
        let PathOrigin::Face(surface) = from else { return None };
        ((surface.instance as usize) < self.volumes.len() + self.meshes.len()).then_some(surface.instance)
    }

    #[inline(never)]
    fn first_hit_by_tree(
        &self,
        tree: &InstanceTree,
        ray: &RayInWorld,
        from: PathOrigin,
        t_max: f64,
    ) -> Option<Hit> {
        let (mut nearest, left) = (Nearest::new(t_max, self.near(ray)), self.left(from));
        if let Some(number) = left {
            self.ask(number, ray, from, &mut nearest);
        }
        tree.along_ray(ray, nearest.t.min(t_max), |number| {
            if left != Some(number) {
                self.ask(number, ray, from, &mut nearest);
            }
            nearest.t.min(t_max)
        });
        nearest.hit
    }

    #[inline(never)]
    fn occluded_by_tree(&self, tree: &InstanceTree, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        let left = self.left(from);
        let mut occluded = left.is_some_and(|number| self.occludes(number, ray, from, t_max));
        if !occluded {
            tree.along_ray(ray, t_max, |number| {
                occluded = left != Some(number) && self.occludes(number, ray, from, t_max);
                if occluded { f64::NEG_INFINITY } else { t_max }
            });
        }
        occluded
    }
}

impl Tracer for SceneTracer {
    fn first_hit(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit> {
        if let Some(tree) = &self.tree {
            return self.first_hit_by_tree(tree, ray, from, t_max);
        }
        // A single volume, as in most scenes, needs no comparison.
        if let ([volume], []) = (self.volumes.as_slice(), self.meshes.as_slice()) {
            let hit = volume.first_hit_within(ray, from, t_max, f64::INFINITY);
            // (Not `filter`, which copies the hit.)
            return if hit.as_ref().is_none_or(|hit| hit.t < t_max) { hit } else { None };
        }
        let mut nearest = Nearest::new(t_max, self.near(ray));
        for number in 0..self.volumes.len() as u32 {
            self.ask(number, ray, from, &mut nearest);
        }
        for mesh in &self.meshes {
            nearest.see(mesh.first_hit_within(ray, from, t_max, nearest.t));
        }
        nearest.hit
    }

    fn occluded(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        if let Some(tree) = &self.tree {
            return self.occluded_by_tree(tree, ray, from, t_max);
        }
        self.volumes.iter().any(|volume| volume.occluded(ray, from, t_max))
            || self.meshes.iter().any(|mesh| mesh.occluded(ray, from, t_max))
    }

    fn contact_distance(&self) -> f64 {
        self.contacts.as_ref().map_or(0.0, |contacts| contacts.distance())
    }

    fn first_volume_besides(&self, ray: &RayInWorld, t_max: f64, instance: u32) -> Option<Hit> {
        let mut nearest = Nearest::new(t_max, 0.0);
        let mut ask = |number: u32| {
            if let Some(volume) = self.volumes.get(number as usize).filter(|_| number != instance) {
                nearest.see(volume.first_hit_within(ray, PathOrigin::Free, t_max, nearest.t));
            }
            nearest.t.min(t_max)
        };
        match &self.tree {
            Some(tree) => tree.along_ray(ray, t_max, ask),
            None => (0..self.volumes.len() as u32).for_each(|number| _ = ask(number)),
        }
        nearest.hit
    }

    fn are_one(&self, a: &Surface, b: &Surface) -> bool {
        self.contacts.as_ref().is_some_and(|contacts| contacts.are_one(a, b))
    }

    fn catchers(&self) -> Option<&dyn Tracer> {
        self.catchers.as_deref().map(|catchers| catchers as &dyn Tracer)
    }

    fn box_origin(&self, face: &Surface) -> Option<[u32; 3]> {
        self.instance(face.instance)?.box_origin(face)
    }

    fn smooth_normal(&self, surface: &Surface, point: DVec3) -> Option<DVec3> {
        let Some(place) = (surface.instance as usize).checked_sub(self.volumes.len()) else {
            return self.instance(surface.instance)?.smooth_normal(surface, point);
        };
        // Among catchers alone, the position of a mesh in the list differs from its index.
        let is_it = |mesh: &&Arc<MeshTracer>| mesh.instance() == surface.instance;
        let mesh = self.mesh(place).filter(is_it).or_else(|| self.meshes.iter().find(is_it));
        mesh?.smooth_normal(surface, point)
    }

    fn is_smooth(&self) -> bool {
        self.is_smooth
    }

    fn failure(&self) -> Option<String> {
        self.volumes.iter().find_map(|volume| volume.failure())
    }

    fn least_samples_a_pass(&self) -> u32 {
        let (loads, pages) = self.page_loads();
        if loads > pages { SAMPLES_A_PASS_OF_PAGES } else { 1 }
    }
}

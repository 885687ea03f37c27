//! All instances and meshes of a scene behind one [`Tracer`].

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use pumice_core::CompressedVolume;
use pumice_render::{Hit, PathOrigin, RayInWorld, RenderError, Surface, Tracer};

use super::{LodChoice, MeshTracer, VolumeTracer};

/// A volume placed in the world, and what of it is drawn.
#[derive(Clone, Debug)]
pub struct TracedInstance {
    /// The volume; several instances may share it.
    pub volume: Arc<CompressedVolume>,
    /// Index space to world; mirrored and sheared is fine, singular is not.
    pub world_from_index: DAffine3,
    /// By dense label; labels past its end are hidden.
    pub visible: Vec<bool>,
    /// Detail.
    pub lod: LodChoice,
}

/// See the module.
#[derive(Debug)]
pub struct SceneTracer {
    volumes: Vec<Arc<VolumeTracer>>,
    meshes: Vec<Arc<MeshTracer>>,
    /// Some mesh, or some volume's voxels, are shaded smooth.
    is_smooth: bool,
}

impl SceneTracer {
    /// Builds the acceleration structures; instance i of `instances` is `Surface::instance` i.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the instance whose matrix is singular or which has too many boxes.
    pub fn new(instances: &[TracedInstance]) -> Result<Self, RenderError> {
        let build = |(i, instance)| VolumeTracer::new(i as u32, instance).map(Arc::new);
        Ok(Self::of(instances.iter().enumerate().map(build).collect::<Result<_, _>>()?))
    }

    /// The geometry of instances that are built already; the one at place i was built as instance i.
    pub fn of(volumes: Vec<Arc<VolumeTracer>>) -> Self {
        Self { is_smooth: volumes.iter().any(|v| v.is_smooth()), volumes, meshes: Vec::new() }
    }

    /// With these meshes; the first is the instance after the last volume's.
    #[must_use]
    pub fn with_meshes(self, meshes: Vec<Arc<MeshTracer>>) -> Self {
        let is_smooth = self.is_smooth || meshes.iter().any(|mesh| mesh.is_smooth());
        Self { meshes, is_smooth, ..self }
    }

    /// Heap bytes of the acceleration structures; the volumes and the meshes are not counted.
    pub fn bytes(&self) -> u64 {
        let volumes: u64 = self.volumes.iter().map(|v| v.bytes()).sum();
        volumes + self.meshes.iter().map(|m| m.bytes()).sum::<u64>()
    }

    /// Geometry of all instances of volumes.
    pub fn volumes(&self) -> &[Arc<VolumeTracer>] {
        &self.volumes
    }

    /// Geometry of all meshes.
    pub fn meshes(&self) -> &[Arc<MeshTracer>] {
        &self.meshes
    }

    /// One mesh's geometry, by its place among the meshes.
    pub fn mesh(&self, place: usize) -> Option<&Arc<MeshTracer>> {
        self.meshes.get(place)
    }

    /// One instance's geometry.
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

impl Tracer for SceneTracer {
    fn first_hit(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit> {
        // In order of instances, volumes then meshes, each within what the others left: at equal t the lowest instance stays.
        let of_volumes = self.volumes.iter().fold(None, |best: Option<Hit>, volume| {
            let limit = best.map_or(t_max, |b| b.t);
            volume.first_hit(ray, from, limit).filter(|h| h.t < limit).or(best)
        });
        self.meshes.iter().fold(of_volumes, |best, mesh| {
            let limit = best.map_or(t_max, |b| b.t);
            mesh.first_hit(ray, from, limit).filter(|h| h.t < limit).or(best)
        })
    }

    fn occluded(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        self.volumes.iter().any(|volume| volume.occluded(ray, from, t_max))
            || self.meshes.iter().any(|mesh| mesh.occluded(ray, from, t_max))
    }

    fn box_origin(&self, face: &Surface) -> Option<[u32; 3]> {
        self.instance(face.instance)?.box_origin(face)
    }

    fn smooth_normal(&self, surface: &Surface, point: DVec3) -> Option<DVec3> {
        match (surface.instance as usize).checked_sub(self.volumes.len()) {
            Some(place) => self.mesh(place)?.smooth_normal(surface, point),
            None => self.instance(surface.instance)?.smooth_normal(surface, point),
        }
    }

    fn is_smooth(&self) -> bool {
        self.is_smooth
    }
}

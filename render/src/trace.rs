//! What an integrator asks of geometry, whoever answers: a BVH on the CPU, a naive march in a test.

use glam::DVec3;

/// A ray in world space: points `origin + t·direction`. The direction need not have length 1; t is in its units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayInWorld {
    /// Where t = 0 is.
    pub origin: DVec3,
    /// Any length above 0.
    pub direction: DVec3,
}

/// Where a path continues from, so that it never meets the face that it leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathOrigin {
    /// A point in free space (the camera).
    Free,
    /// A face of a voxel (or of an LOD element): the ray starts exactly on its plane, on the outer side.
    Face(Surface),
}

/// The surface element that was hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Position of the instance in the scene's list.
    pub instance: u32,
    /// Lowest voxel of the element: the voxel itself, or a cell's or a box's corner at coarser LOD.
    pub voxel: [u32; 3],
    /// Axis of the face, 0 to 2.
    pub axis: u8,
    /// Whether the outward normal points along the positive axis (in index space).
    pub positive: bool,
    /// Index-space coordinate of the face's plane along `axis`.
    pub plane: u32,
    /// Dense label index.
    pub label: u32,
}

/// The first surface along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// In units of the ray's direction.
    pub t: f64,
    /// What was hit.
    pub surface: Surface,
    /// Outward unit normal in world space.
    pub normal_in_world: DVec3,
    /// The ray came from within the element (its origin was inside a solid voxel).
    pub from_inside: bool,
}

/// Geometry that rays can be asked against. Shared by all render threads.
pub trait Tracer: Sync {
    /// The nearest surface with t in (0, `t_max`). A ray with [`PathOrigin::Face`] starts on that face's plane: the tracer puts
    /// the origin there exactly in index space and meets neither the face nor its coplanar neighbours.
    fn first_hit(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit>;

    /// Whether anything lies at t in (0, `t_max`).
    fn occluded(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        self.first_hit(ray, from, t_max).is_some()
    }
}

impl<T: Tracer + Send + ?Sized> Tracer for std::sync::Arc<T> {
    fn first_hit(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit> {
        (**self).first_hit(ray, from, t_max)
    }

    fn occluded(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        (**self).occluded(ray, from, t_max)
    }
}

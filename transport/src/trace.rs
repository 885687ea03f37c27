//! The interface of geometry to an integrator. Implementations are a BVH on the CPU, and a naive march in a test.

use glam::DVec3;

/// A ray in world space: points `origin + t·direction`. The direction need not have length 1; t is in units of its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayInWorld {
    /// The point at t = 0.
    pub origin: DVec3,
    /// Direction, of any length above 0.
    pub direction: DVec3,
}

/// The origin of a path segment, which keeps it from hitting the face that it leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathOrigin {
    /// A point in free space (the camera).
    Free,
    /// A surface that was hit, of any kind.
    ///
    /// * A face: the ray starts exactly on its plane, on the outer side.
    /// * A cap: the ray starts exactly on the cut's plane; its direction decides the side.
    /// * A triangle: the ray hits neither that triangle nor another of its mesh that does not reach above the triangle's plane, on the
    ///   side that the ray goes to.
    Face(Surface),
}

/// Kinds of surface elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SurfaceKind {
    /// A face of a voxel (or of an LOD element).
    #[default]
    Face = 0,
    /// Where a cut passes through a voxel (or an LOD element).
    Cap = 1,
    /// A triangle of a mesh.
    Triangle = 2,
}

/// The surface element that was hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Index of the instance in the scene's list; the indices of meshes follow after those of instances.
    pub instance: u32,
    /// Kind of the element.
    pub kind: SurfaceKind,
    /// Lowest voxel of the element: the voxel itself, or the corner of a cell or a box at coarser LOD. 0 for a triangle.
    pub voxel: [u32; 3],
    /// Axis of a face, 0 to 2; otherwise 0.
    pub axis: u8,
    /// Whether the outward normal of a face points along the positive axis (in index space).
    pub positive: bool,
    /// For a face, the index-space coordinate of its plane along `axis`; for a cap, the index of its plane among the instance's cutting
    /// planes; for a triangle, its index in the mesh.
    pub plane: u32,
    /// Dense label index; for a triangle, the index of its material.
    pub label: u32,
}

/// The first surface along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter, in units of the ray's direction.
    pub t: f64,
    /// The surface that was hit.
    pub surface: Surface,
    /// Outward unit normal in world space. A triangle's normal points to the side from which its corners turn counterclockwise in the
    /// mesh's own space: a mirrored mesh keeps its outside, as in Cycles.
    pub normal_in_world: DVec3,
    /// Whether the ray came from inside the element (its origin was inside a solid voxel), or hit the back of a triangle.
    pub from_inside: bool,
}

impl Hit {
    /// Whether the ray started inside a solid and sees its inside. The back of a triangle is a surface like its front.
    pub fn is_seen_from_within(&self) -> bool {
        self.from_inside && self.surface.kind != SurfaceKind::Triangle
    }

    /// The unit normal on the side that the ray came from; the outward normal if the ray started inside a solid.
    pub fn normal_towards_ray(&self) -> DVec3 {
        let back = self.from_inside && self.surface.kind == SurfaceKind::Triangle;
        if back { -self.normal_in_world } else { self.normal_in_world }
    }
}

/// Geometry that rays can be traced through. All render threads share it.
pub trait Tracer: Sync {
    /// The nearest surface with t in (0, `t_max`). A ray with [`PathOrigin::Face`] starts on that face's plane: the tracer puts the origin
    /// exactly there in index space and hits neither the face nor its coplanar neighbours.
    fn first_hit(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit>;

    /// Whether there is any surface with t in (0, `t_max`).
    fn occluded(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        self.first_hit(ray, from, t_max).is_some()
    }

    /// Distance in world units within which faces of two instances count as one place ([`crate::geometry::Contacts`]); 0 where paths need
    /// not know.
    fn contact_distance(&self) -> f64 {
        0.0
    }

    /// The nearest surface of a volume with t in (0, `t_max`) along a ray from a free point, of all instances but this one.
    fn first_volume_besides(&self, _ray: &RayInWorld, _t_max: f64, _instance: u32) -> Option<Hit> {
        None
    }

    /// Whether two surfaces belong to one label of one body ([`crate::geometry::Contacts::are_one`]).
    fn are_one(&self, _a: &Surface, _b: &Surface) -> bool {
        false
    }

    /// The geometry of shadow catchers alone, with the same surface indices; `None` where there is none.
    fn catchers(&self) -> Option<&dyn Tracer> {
        None
    }

    /// Lowest voxel of the box that draws a face, which identifies the emitter that contains the face. `None` where it is not known; the
    /// face then cannot be sampled as a light.
    fn box_origin(&self, _face: &Surface) -> Option<[u32; 3]> {
        None
    }

    /// Unit shading normal in the world at a point of a surface, on the side of [`Hit::normal_in_world`]; `None` where that normal itself
    /// applies.
    fn smooth_normal(&self, _surface: &Surface, _point: DVec3) -> Option<DVec3> {
        None
    }

    /// Whether [`Tracer::smooth_normal`] may return a normal for any surface.
    fn is_smooth(&self) -> bool {
        false
    }

    /// Why the geometry could not be read, in one line: surfaces may have been missed since. `None` of geometry in memory.
    fn failure(&self) -> Option<String> {
        None
    }

    /// Samples of a pixel that one pass over the picture should add at least: more where geometry is read again in each pass.
    fn least_samples_a_pass(&self) -> u32 {
        1
    }

    /// The shading normal on the side of `normal`, which is the hit's own normal or its opposite.
    #[inline]
    fn shading_normal(&self, hit: &Hit, point: DVec3, normal: DVec3) -> Option<DVec3> {
        if !self.is_smooth() {
            return None;
        }
        let smooth = self.smooth_normal(&hit.surface, point)?;
        Some(if normal.dot(hit.normal_in_world) < 0.0 { -smooth } else { smooth })
    }
}

impl<T: Tracer + Send + ?Sized> Tracer for std::sync::Arc<T> {
    fn first_hit(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit> {
        (**self).first_hit(ray, from, t_max)
    }

    fn occluded(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        (**self).occluded(ray, from, t_max)
    }

    fn contact_distance(&self) -> f64 {
        (**self).contact_distance()
    }

    fn first_volume_besides(&self, ray: &RayInWorld, t_max: f64, instance: u32) -> Option<Hit> {
        (**self).first_volume_besides(ray, t_max, instance)
    }

    fn are_one(&self, a: &Surface, b: &Surface) -> bool {
        (**self).are_one(a, b)
    }

    fn catchers(&self) -> Option<&dyn Tracer> {
        (**self).catchers()
    }

    fn box_origin(&self, face: &Surface) -> Option<[u32; 3]> {
        (**self).box_origin(face)
    }

    fn smooth_normal(&self, surface: &Surface, point: DVec3) -> Option<DVec3> {
        (**self).smooth_normal(surface, point)
    }

    fn is_smooth(&self) -> bool {
        (**self).is_smooth()
    }

    fn failure(&self) -> Option<String> {
        (**self).failure()
    }

    fn least_samples_a_pass(&self) -> u32 {
        (**self).least_samples_a_pass()
    }
}

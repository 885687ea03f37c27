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
    /// A surface that was hit, of whatever kind.
    ///
    /// * A face: the ray starts exactly on its plane, on the outer side.
    /// * A cap: it starts exactly on the cut's plane; which side it goes to follows from its direction.
    /// * A triangle: the ray meets neither that triangle nor another of its mesh that does not reach above the triangle's plane, on
    ///   the side that the ray goes to.
    Face(Surface),
}

/// Kinds of surface elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SurfaceKind {
    /// A face of a voxel (or of an LOD element).
    #[default]
    Face = 0,
    /// Where a cut goes through a voxel (or an LOD element).
    Cap = 1,
    /// A triangle of a mesh.
    Triangle = 2,
}

/// The surface element that was hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Position of the instance in the scene's list; a mesh's position in its own list counts on from the last instance's.
    pub instance: u32,
    /// What kind of element it is.
    pub kind: SurfaceKind,
    /// Lowest voxel of the element: the voxel itself, or a cell's or a box's corner at coarser LOD. 0 for a triangle.
    pub voxel: [u32; 3],
    /// Axis of a face, 0 to 2; else 0.
    pub axis: u8,
    /// Whether the outward normal of a face points along the positive axis (in index space).
    pub positive: bool,
    /// Index-space coordinate of the face's plane along `axis`. Of a cap: which of its instance's cutting planes it lies in. Of a
    /// triangle: its number in the mesh.
    pub plane: u32,
    /// Dense label index; for a triangle, the index of its material.
    pub label: u32,
}

/// The first surface along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// In units of the ray's direction.
    pub t: f64,
    /// What was hit.
    pub surface: Surface,
    /// Outward unit normal in world space. A triangle's points to where its corners are seen to turn counterclockwise in the mesh's
    /// own space: a mirrored mesh keeps its outside, as in Cycles.
    pub normal_in_world: DVec3,
    /// The ray came from within the element (its origin was inside a solid voxel), or onto the back of a triangle.
    pub from_inside: bool,
}

impl Hit {
    /// Whether the ray started inside something solid, of which it sees the inside. The back of a triangle is a surface like its
    /// front.
    pub fn is_seen_from_within(&self) -> bool {
        self.from_inside && self.surface.kind != SurfaceKind::Triangle
    }

    /// The unit normal on the side that the ray came from; of what was seen from within, the outward one.
    pub fn normal_towards_ray(&self) -> DVec3 {
        let back = self.from_inside && self.surface.kind == SurfaceKind::Triangle;
        if back { -self.normal_in_world } else { self.normal_in_world }
    }
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

    /// The geometry of shadow catchers alone, their surfaces known by the same numbers; `None` where there is none.
    fn catchers(&self) -> Option<&dyn Tracer> {
        None
    }

    /// Lowest voxel of the box that draws a face: what of its label is there may be aimed at as one light. `None` where that is not
    /// known; no light is aimed at there then.
    fn box_origin(&self, _face: &Surface) -> Option<[u32; 3]> {
        None
    }

    /// Unit normal in the world that a surface is shaded by at a point of it, on the side of [`Hit::normal_in_world`]; `None` where
    /// that one is it.
    fn smooth_normal(&self, _surface: &Surface, _point: DVec3) -> Option<DVec3> {
        None
    }

    /// Whether [`Tracer::smooth_normal`] is worth asking anywhere.
    fn is_smooth(&self) -> bool {
        false
    }

    /// The same on the side of `normal`, which is the hit's own or its opposite.
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
}

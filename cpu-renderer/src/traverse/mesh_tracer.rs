//! The geometry of one mesh in the world: its hierarchy, and the queries of rays.
//!
//! Triangles are visible from both sides. A path that continues from a triangle hits neither that triangle nor another of the mesh that
//! does not reach above its plane on the side that the path goes to; only rounding could produce such a hit. Nothing is offset by an
//! epsilon, so a volume may stand on a mesh, and a crease may be arbitrarily narrow.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use pumice_core::MeshData;
use pumice_transport::geometry::instance_tree::WorldBounds;
use pumice_transport::geometry::mesh_grid::{MeshGrid, mesh_placement};
use pumice_transport::geometry::mesh_normals::blended_normal;
use pumice_transport::geometry::placement::Placement;
use pumice_transport::{Bvh, Hit, PathOrigin, RayInWorld, RenderError, Surface, SurfaceKind, Tracer};

use super::IndexRay;
use super::index_ray::surface_of;
use super::triangle::TriangleRay;
use super::volume_tracer::bvh_ray;

/// The data that all placements of a mesh share.
#[derive(Debug)]
struct Geometry {
    mesh: Arc<MeshData>,
    grid: MeshGrid,
    /// Items are indices of triangles.
    bvh: Bvh,
}

/// The geometry of one mesh in the world.
#[derive(Debug)]
pub struct MeshTracer {
    geometry: Arc<Geometry>,
    /// Placement of the mesh's grid.
    placement: Placement,
    instance: u32,
}

/// The triangle that a path continues from.
struct Leaving {
    triangle: u32,
    point: DVec3,
    /// Normal of its plane, towards the side that the path goes to; its length is twice the triangle's area.
    normal: DVec3,
    /// Bound of the lengths of its sides, which scales the rounding error of the normal.
    size: f64,
}

impl Leaving {
    /// Whether a triangle with these corners cannot be hit. Rounding loses less than 2⁻⁴⁹ of the terms of the products: three for each
    /// component of the normal, three for each height.
    #[inline]
    fn is_out_of_reach(&self, corners: [DVec3; 3]) -> bool {
        corners.iter().all(|&corner| {
            let d = corner - self.point;
            let size = self.size * (d.x.abs() + d.y.abs() + d.z.abs());
            self.normal.dot(d) <= size * (8.0 * f64::EPSILON)
        })
    }
}

impl MeshTracer {
    /// Builds the hierarchy of the mesh at index `place` of the scene's meshes; its hits report `instance`.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the mesh if it is too large or too small, or if its matrix is singular.
    pub fn new(
        place: u32,
        instance: u32,
        mesh: &Arc<MeshData>,
        world_from_mesh: DAffine3,
    ) -> Result<Self, RenderError> {
        let grid = MeshGrid::new(place, mesh)?;
        let placement = mesh_placement(place, grid.mesh_from_grid, world_from_mesh)?;
        let bvh = Bvh::build(grid.bounds(mesh)?)?;
        let geometry = Arc::new(Geometry { mesh: Arc::clone(mesh), grid, bvh });
        Ok(Self { geometry, placement, instance })
    }

    /// The same triangles at another placement, or as another instance; they share their hierarchy.
    ///
    /// # Errors
    /// [`RenderError::Scene`] if the matrix is singular.
    pub fn again(&self, place: u32, instance: u32, world_from_mesh: DAffine3) -> Result<Self, RenderError> {
        let placement = mesh_placement(place, self.geometry.grid.mesh_from_grid, world_from_mesh)?;
        Ok(Self { geometry: Arc::clone(&self.geometry), placement, instance })
    }

    /// The mesh, and its corners in its grid.
    pub fn mesh(&self) -> (&Arc<MeshData>, &MeshGrid) {
        (&self.geometry.mesh, &self.geometry.grid)
    }

    /// Instance index that its hits report.
    pub fn instance(&self) -> u32 {
        self.instance
    }

    /// Bounds in the world; `None` where the mesh has no triangles.
    pub(super) fn world_bounds(&self) -> Option<WorldBounds> {
        self.geometry.bvh.bounds().map(|bounds| WorldBounds::new(bounds, &self.placement))
    }

    /// Identifies the hierarchy: equal for all meshes that share it, and for no other.
    pub(super) fn hierarchy_address(&self) -> usize {
        Arc::as_ptr(&self.geometry).addr()
    }

    /// Placement of its grid.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// Size on the heap in bytes of the hierarchy and of the corners that it was built for, without the mesh itself.
    pub fn bytes(&self) -> u64 {
        self.geometry.bvh.bytes() + self.geometry.grid.bytes()
    }

    #[inline]
    fn corners(&self, triangle: u32) -> [DVec3; 3] {
        let corners = self.geometry.mesh.triangles()[triangle as usize];
        corners.map(|c| glam::Vec3::from(self.geometry.grid.corners[c as usize]).as_dvec3())
    }

    fn leaving(&self, ray: &IndexRay, from: PathOrigin) -> Option<Leaving> {
        let surface = surface_of(from, self.instance)?;
        let [a, b, c] = self.corners(surface.plane);
        let normal = (b - a).cross(c - a);
        let goes_back = normal.dot(DVec3::from_slice(&ray.direction)) < 0.0;
        let length = |d: DVec3| d.x.abs() + d.y.abs() + d.z.abs();
        Some(Leaving {
            triangle: surface.plane,
            point: a,
            normal: if goes_back { -normal } else { normal },
            size: length(b - a) * length(c - a),
        })
    }

    /// The nearest triangle with scaled t in (0, `t_max`), the one with the lowest index where several are equally near; with `any`, the
    /// first one found.
    fn nearest(&self, ray: &IndexRay, from: PathOrigin, t_max: f64, any: bool) -> Option<(f64, u32)> {
        let bvh = &self.geometry.bvh;
        let (moved, enter_all) = bvh_ray(bvh, ray, 0.0, t_max)?;
        let leaving = self.leaving(ray, from);
        // The origin is moved to where the ray reaches the mesh, so that f32 resolves the corners however far away the ray starts.
        let direction = DVec3::from_slice(&ray.direction);
        let in_grid = TriangleRay::new(DVec3::from_slice(&ray.origin) + direction * enter_all, direction);
        let mut best = None;
        let mut best_t = t_max;
        let limit = |t: f64| (t - enter_all) as f32 * 1.000_001 + moved.pad;
        bvh.along_ray(&moved, limit(best_t), |triangle| {
            let corners = self.corners(triangle);
            if let Some(t) = in_grid.meet(corners) {
                let t = enter_all + t;
                let first = t < best_t || (t == best_t && best.is_some_and(|(_, other)| triangle < other));
                let left = |l: &Leaving| l.triangle == triangle || l.is_out_of_reach(corners);
                if t > 0.0 && first && !leaving.as_ref().is_some_and(left) {
                    (best, best_t) = (Some((t, triangle)), t);
                    if any {
                        return -1.0;
                    }
                }
            }
            limit(best_t)
        });
        best
    }

    /// [`Tracer::first_hit`], where hits beyond `best` may be ignored.
    pub(super) fn first_hit_within(
        &self,
        ray: &RayInWorld,
        from: PathOrigin,
        t_max: f64,
        best: f64,
    ) -> Option<Hit> {
        let ray = IndexRay::in_mesh_grid(&self.placement, ray)?;
        let (t, triangle) = self.nearest(&ray, from, ray.reach(t_max, best), false)?;
        Some(self.hit(&ray, t, triangle))
    }

    fn hit(&self, ray: &IndexRay, t: f64, triangle: u32) -> Hit {
        let [a, b, c] = self.corners(triangle);
        let normal = (b - a).cross(c - a);
        Hit {
            t: t / ray.scaled_from_world,
            surface: Surface {
                instance: self.instance,
                kind: SurfaceKind::Triangle,
                voxel: [0; 3],
                axis: 0,
                positive: false,
                plane: triangle,
                label: self.geometry.mesh.material(triangle as usize),
            },
            normal_in_world: self.placement.normal_of(normal),
            from_inside: normal.dot(DVec3::from_slice(&ray.direction)) > 0.0,
        }
    }
}

impl Tracer for MeshTracer {
    fn first_hit(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit> {
        self.first_hit_within(ray, from, t_max, f64::INFINITY)
    }

    fn occluded(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        let Some(ray) = IndexRay::in_mesh_grid(&self.placement, ray) else { return false };
        self.nearest(&ray, from, ray.scaled_t(t_max), true).is_some()
    }

    fn smooth_normal(&self, surface: &Surface, point: DVec3) -> Option<DVec3> {
        let normals = *self.geometry.mesh.normals().get(surface.plane as usize)?;
        let in_grid = self.placement.index_from_world(point - self.placement.world_from_index.translation);
        let normal = blended_normal(self.corners(surface.plane), normals, in_grid)?;
        Some(self.placement.normal_of(normal.as_dvec3()))
    }

    fn is_smooth(&self) -> bool {
        self.geometry.mesh.is_smooth()
    }
}

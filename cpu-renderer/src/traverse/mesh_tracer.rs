//! One mesh in the world: its hierarchy, and the questions that rays ask of it.
//!
//! Triangles are seen from both sides. A path that goes on from a triangle meets neither that one nor another of the mesh that does not
//! reach above its plane on the side that the path goes to: those cannot be met, but by rounding. Nothing is moved by an epsilon,
//! so a volume may stand on a mesh, and a crease may be as narrow as it likes.

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

/// What every place of a mesh shares.
#[derive(Debug)]
struct Geometry {
    mesh: Arc<MeshData>,
    grid: MeshGrid,
    /// Items are numbers of triangles.
    bvh: Bvh,
}

/// Geometry of one mesh in the world.
#[derive(Debug)]
pub struct MeshTracer {
    geometry: Arc<Geometry>,
    /// Of the mesh's grid.
    placement: Placement,
    instance: u32,
}

/// The triangle that a path goes on from.
struct Leaving {
    triangle: u32,
    point: DVec3,
    /// Of its plane, towards the side that the path goes to; as long as twice its area.
    normal: DVec3,
    /// As long as its sides are: what the normal's rounding is measured by.
    size: f64,
}

impl Leaving {
    /// Whether a triangle with these corners cannot be met. Rounding takes less than 2⁻⁴⁹ of what the products are made of: three of
    /// each normal's component, three of each height's.
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
    /// Builds the hierarchy of the mesh at `place` among the scene's meshes; its hits are those of `instance`.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the mesh that is too large, too small, or whose matrix is singular.
    pub fn new(
        place: u32,
        instance: u32,
        mesh: &Arc<MeshData>,
        world_from_mesh: DAffine3,
    ) -> Result<Self, RenderError> {
        let grid = MeshGrid::new(place, mesh)?;
        let placement = mesh_placement(place, grid.mesh_from_grid, world_from_mesh)?;
        let bvh = Bvh::build(grid.bounds(mesh))?;
        let geometry = Arc::new(Geometry { mesh: Arc::clone(mesh), grid, bvh });
        Ok(Self { geometry, placement, instance })
    }

    /// The same triangles elsewhere, or as another instance: they and their hierarchy are shared.
    ///
    /// # Errors
    /// [`RenderError::Scene`] when the matrix is singular.
    pub fn again(&self, place: u32, instance: u32, world_from_mesh: DAffine3) -> Result<Self, RenderError> {
        let placement = mesh_placement(place, self.geometry.grid.mesh_from_grid, world_from_mesh)?;
        Ok(Self { geometry: Arc::clone(&self.geometry), placement, instance })
    }

    /// The mesh, and its corners in its grid.
    pub fn mesh(&self) -> (&Arc<MeshData>, &MeshGrid) {
        (&self.geometry.mesh, &self.geometry.grid)
    }

    /// As what its hits are known.
    pub fn instance(&self) -> u32 {
        self.instance
    }

    /// Where it is in the world.
    pub(super) fn world_bounds(&self) -> Option<WorldBounds> {
        self.geometry.bvh.bounds().map(|bounds| WorldBounds::new(bounds, &self.placement))
    }

    /// The same for all that share its hierarchy, and for no other.
    pub(super) fn hierarchy_address(&self) -> usize {
        Arc::as_ptr(&self.geometry).addr()
    }

    /// Where its grid is.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// Heap bytes of the hierarchy and of the corners that it was built for; the mesh itself is not counted.
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

    /// The nearest triangle with scaled t in (0, `t_max`), the one of the lowest number where several are; with `any`, the first
    /// found will do.
    fn nearest(&self, ray: &IndexRay, from: PathOrigin, t_max: f64, any: bool) -> Option<(f64, u32)> {
        let bvh = &self.geometry.bvh;
        let (moved, enter_all) = bvh_ray(bvh, ray, 0.0, t_max)?;
        let leaving = self.leaving(ray, from);
        // From where the ray comes to the mesh: beside it, f32 tells corners apart however far the ray comes from.
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

    /// [`Tracer::first_hit`], where nothing farther than `best` is of interest.
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

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
    /// Whether a path that continues from any of its triangles can hit none of them, as on a floor.
    is_one_plane: bool,
    /// Whether each triangle has the bounds of the whole mesh, so that a ray that meets these may meet any.
    is_one_box: bool,
}

/// Most triangles of a mesh that is examined for being one plane: all pairs are compared.
const MOST_OF_A_PLANE: usize = 16;

/// Most triangles that are asked in turn where each has the bounds of the whole mesh, as the two of a floor.
const MOST_OF_A_BOX: usize = 4;

impl Geometry {
    #[inline]
    fn corners(&self, triangle: u32) -> [DVec3; 3] {
        let corners = self.mesh.triangles()[triangle as usize];
        corners.map(|c| glam::Vec3::from(self.grid.corners[c as usize]).as_dvec3())
    }

    /// Whether [`Leaving`] excludes every triangle, whichever one a path leaves and to whichever side.
    fn excludes_all(&self) -> bool {
        let triangles = 0..self.mesh.triangles().len().min(MOST_OF_A_PLANE + 1) as u32;
        let excludes = |(left, goes_back): (u32, bool)| {
            let leaving = Leaving::new(left, self.corners(left), goes_back);
            triangles.clone().all(|other| leaving.excludes(other, self.corners(other)))
        };
        triangles.len() <= MOST_OF_A_PLANE
            && triangles.clone().flat_map(|left| [(left, false), (left, true)]).all(excludes)
    }
}

/// The geometry of one mesh in the world.
#[derive(Debug)]
pub struct MeshTracer {
    geometry: Arc<Geometry>,
    /// Placement of the mesh's grid.
    placement: Placement,
    /// Bounds in the world; `None` where the mesh has no triangles.
    bounds: Option<WorldBounds>,
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
    /// `goes_back` says that the path goes to the side from which the corners turn clockwise.
    #[inline]
    fn new(triangle: u32, [a, b, c]: [DVec3; 3], goes_back: bool) -> Self {
        let normal = (b - a).cross(c - a);
        let length = |d: DVec3| d.x.abs() + d.y.abs() + d.z.abs();
        Self {
            triangle,
            point: a,
            normal: if goes_back { -normal } else { normal },
            size: length(b - a) * length(c - a),
        }
    }

    /// Whether the path cannot hit this triangle.
    #[inline]
    fn excludes(&self, triangle: u32, corners: [DVec3; 3]) -> bool {
        self.triangle == triangle || self.is_out_of_reach(corners)
    }

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
        let bounds = grid.bounds(mesh)?;
        let is_one_box = bounds.len() <= MOST_OF_A_BOX && bounds.iter().all(|b| b.0 == bounds[0].0);
        let bvh = Bvh::build(bounds)?;
        let mut geometry = Geometry { mesh: Arc::clone(mesh), grid, bvh, is_one_plane: false, is_one_box };
        geometry.is_one_plane = geometry.excludes_all();
        Ok(Self::placed(Arc::new(geometry), placement, instance))
    }

    /// The same triangles at another placement, or as another instance; they share their hierarchy.
    ///
    /// # Errors
    /// [`RenderError::Scene`] if the matrix is singular.
    pub fn again(&self, place: u32, instance: u32, world_from_mesh: DAffine3) -> Result<Self, RenderError> {
        let placement = mesh_placement(place, self.geometry.grid.mesh_from_grid, world_from_mesh)?;
        Ok(Self::placed(Arc::clone(&self.geometry), placement, instance))
    }

    fn placed(geometry: Arc<Geometry>, placement: Placement, instance: u32) -> Self {
        let bounds = geometry.bvh.bounds().map(|bounds| WorldBounds::new(bounds, &placement));
        Self { geometry, placement, bounds, instance }
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
        self.bounds
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

    fn leaving(&self, ray: &IndexRay, from: PathOrigin) -> Option<Leaving> {
        let surface = surface_of(from, self.instance)?;
        let [a, b, c] = self.geometry.corners(surface.plane);
        let goes_back = (b - a).cross(c - a).dot(DVec3::from_slice(&ray.direction)) < 0.0;
        Some(Leaving::new(surface.plane, [a, b, c], goes_back))
    }

    /// Whether a ray certainly hits nothing of this mesh up to `t`: it leaves the one plane of all triangles, or misses their bounds.
    #[inline]
    fn is_missed(&self, ray: &RayInWorld, from: PathOrigin, t: f64) -> bool {
        self.geometry.is_one_plane && surface_of(from, self.instance).is_some()
            || self.bounds.is_none_or(|bounds| bounds.are_missed(ray, t))
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
        let mut visit = |triangle: u32| {
            let corners = self.geometry.corners(triangle);
            if let Some(t) = in_grid.meet(corners) {
                let t = enter_all + t;
                let first = t < best_t || (t == best_t && best.is_some_and(|(_, other)| triangle < other));
                if t > 0.0 && first && !leaving.as_ref().is_some_and(|l| l.excludes(triangle, corners)) {
                    (best, best_t) = (Some((t, triangle)), t);
                    if any {
                        return -1.0;
                    }
                }
            }
            limit(best_t)
        };
        if self.geometry.is_one_box {
            // `bvh_ray` has found that the ray meets these bounds before the limit: the hierarchy could leave out nothing.
            _ = (0..self.geometry.mesh.triangles().len() as u32).all(|triangle| visit(triangle) >= 0.0);
        } else {
            bvh.along_ray(&moved, limit(t_max), visit);
        }
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
        if self.is_missed(ray, from, if best < t_max { best } else { t_max }) {
            return None;
        }
        let ray = IndexRay::in_mesh_grid(&self.placement, ray)?;
        let (t, triangle) = self.nearest(&ray, from, ray.reach(t_max, best), false)?;
        Some(self.hit(&ray, t, triangle))
    }

    fn hit(&self, ray: &IndexRay, t: f64, triangle: u32) -> Hit {
        let [a, b, c] = self.geometry.corners(triangle);
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
        if self.is_missed(ray, from, t_max) {
            return false;
        }
        let Some(ray) = IndexRay::in_mesh_grid(&self.placement, ray) else { return false };
        self.nearest(&ray, from, ray.scaled_t(t_max), true).is_some()
    }

    fn smooth_normal(&self, surface: &Surface, point: DVec3) -> Option<DVec3> {
        let normals = *self.geometry.mesh.normals().get(surface.plane as usize)?;
        let in_grid = self.placement.index_from_world(point - self.placement.world_from_index.translation);
        let normal = blended_normal(self.geometry.corners(surface.plane), normals, in_grid)?;
        Some(self.placement.normal_of(normal.as_dvec3()))
    }

    fn is_smooth(&self) -> bool {
        self.geometry.mesh.is_smooth()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tracer(corners: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> MeshTracer {
        let mesh = Arc::new(MeshData::new(corners, triangles, Vec::new()).unwrap());
        let place = DAffine3::from_scale_rotation_translation(
            DVec3::new(100.0, 100.0, 1.0),
            glam::DQuat::IDENTITY,
            DVec3::new(0.0, 0.0, -1.9),
        );
        MeshTracer::new(0, 3, &mesh, place).unwrap()
    }

    fn square(last_height: f64) -> Vec<[f64; 3]> {
        vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, last_height]]
    }

    /// Rays from both sides of the square to points within and beside it.
    fn rays() -> impl Iterator<Item = (RayInWorld, DVec3)> {
        (0..2000).map(|i| {
            let at = |a: f64| (a * f64::from(i)).sin();
            let target = DVec3::new(140.0 * at(1.1), 140.0 * at(2.3), -1.9);
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            let origin =
                DVec3::new(30.0 * at(3.9), 30.0 * at(0.7), -1.9 + side * (0.1 + 20.0 * at(5.3).abs()));
            (RayInWorld { origin, direction: target - origin }, target)
        })
    }

    /// A floor is hit where the ray's point in its plane lies in the square, and no path from it hits it again.
    #[test]
    fn a_floor_is_hit_from_elsewhere_and_not_from_itself() {
        let floor = tracer(square(0.0), vec![[0, 1, 2], [0, 2, 3]]);
        assert!(floor.geometry.is_one_plane && floor.geometry.is_one_box);
        let mut hits = 0;
        for (ray, target) in rays() {
            let hit = floor.first_hit(&ray, PathOrigin::Free, f64::INFINITY);
            let inside = target.x.abs().max(target.y.abs());
            assert!((inside - 100.0).abs() < 1e-3 || hit.is_some() == (inside < 100.0), "{target}");
            assert_eq!(floor.occluded(&ray, PathOrigin::Free, f64::INFINITY), hit.is_some());
            let Some(hit) = hit else { continue };
            hits += 1;
            assert!((hit.t - 1.0).abs() < 1e-9, "{}", hit.t);
            assert!(floor.first_hit(&ray, PathOrigin::Free, 0.999).is_none());
            for direction in [ray.direction, -ray.direction, DVec3::X] {
                let onward = RayInWorld { origin: target, direction };
                let from = PathOrigin::Face(hit.surface);
                assert!(floor.first_hit(&onward, from, f64::INFINITY).is_none());
                assert!(!floor.occluded(&onward, from, f64::INFINITY));
                // From a surface of another instance it is hit like from anywhere.
                let other = PathOrigin::Face(Surface { instance: 2, ..hit.surface });
                assert_eq!(floor.first_hit(&ray, other, f64::INFINITY), Some(hit));
            }
        }
        assert!((500..1500).contains(&hits), "{hits}");
    }

    /// Negative control: in a folded square, a path from one triangle may hit the other.
    #[test]
    fn a_fold_is_no_plane() {
        let fold = tracer(square(0.3), vec![[0, 1, 2], [0, 2, 3]]);
        assert!(!fold.geometry.is_one_plane && !fold.geometry.is_one_box);
        let mut again = 0;
        for (ray, _) in rays() {
            let Some(hit) = fold.first_hit(&ray, PathOrigin::Free, f64::INFINITY) else { continue };
            let origin = ray.origin + ray.direction * hit.t;
            let onward =
                RayInWorld { origin, direction: DVec3::new(-origin.x - 60.0, 60.0 - origin.y, 0.08) };
            again += usize::from(fold.occluded(&onward, PathOrigin::Face(hit.surface), f64::INFINITY));
        }
        assert!(again > 20, "{again}");
    }

    /// A plane of more triangles than are examined goes the long way, with the hits of the plane of two.
    #[test]
    fn a_plane_of_many_triangles_has_the_same_hits() {
        let two = tracer(square(0.0), vec![[0, 1, 2], [0, 2, 3]]);
        let at = |i: u32| f64::from(i) / 5.0 - 1.0;
        let strip = (0..=10).flat_map(|i| [[at(i), -1.0, 0.0], [at(i), 1.0, 0.0]]).collect();
        let triangles = (0..10).map(|i| 2 * i).flat_map(|i| [[i, i + 2, i + 3], [i, i + 3, i + 1]]).collect();
        let many = tracer(strip, triangles);
        assert!(!many.geometry.is_one_plane && !many.geometry.is_one_box);
        for (ray, target) in rays() {
            let [a, b] = [&two, &many].map(|mesh| mesh.first_hit(&ray, PathOrigin::Free, f64::INFINITY));
            assert!((target.x.abs().max(target.y.abs()) - 100.0).abs() < 1e-3 || a.is_some() == b.is_some());
            let (Some(a), Some(b)) = (a, b) else { continue };
            assert!((a.t - b.t).abs() < 1e-9 && a.from_inside == b.from_inside);
            let onward = RayInWorld { origin: target, direction: -ray.direction };
            assert!(many.first_hit(&onward, PathOrigin::Face(b.surface), f64::INFINITY).is_none());
        }
    }
}

//! Emissive labels and meshes as lights for next-event estimation.
//!
//! An **emitter** is the part of an emissive label that lies in one of its boxes, or one triangle of an emissive material. A tree
//! ([`LightTree`]) chooses among all emitters; within a box a direction is chosen, then a face, then a point of the face:
//!
//! ```text
//!  tree ─► box ─► −x +x −y +y −z +z ─► face ─► point ─► shadow ray
//!   │           by number of faces × the receiver's height above them: their apparent size from there
//!   └────► triangle ─────────────────────────► point
//! ```
//! **Numbers.** With w the vector from the receiver to a point of a face in index space, N the area vector of the face there and s³ the
//! volume of a voxel, the vector in the world is d = M w, and a part dα of the face has the solid angle |N·w| s³ dα / |d|³. This holds for
//! every spacing, shear and mirroring, and in the same way for triangles in their mesh's grid. Vectors are computed in f64 and rounded
//! once; everything else is f32.
//!
//! **Sampled lights**: faces of voxels that are drawn as voxels, with nothing visible in front of them (`faces.rs`), and both sides of
//! triangles. All other emission (caps, coarser levels of detail, insides of labels, faces against other labels) has a density of 0 here;
//! only BSDF sampling finds it.

mod faces;
mod gather;

use std::f64::consts::PI;
use std::sync::Arc;

use crate::{Receiver, RenderError, Surface, SurfaceKind};
use glam::{DVec3, Vec3};

use crate::MaterialTable;
use crate::bsdf::emitted;
use crate::geometry::Placement;
use crate::light_tree::{Bounded, LightTree};
pub use gather::EmissiveGeometry;
pub(crate) use gather::emission_luminance;

/// Marks an instance that has no emitter.
pub const NOT_EMISSIVE: u32 = u32::MAX;

/// Twice the relative rounding of a point in the world: shadow rays end before a face by this part of the point's coordinates.
const POINT_ROUNDING: f64 = 2.0 * f64::EPSILON;

/// An instance or mesh that has emitters.
#[derive(Clone, Debug)]
pub struct EmissiveInstance {
    /// Index of the instance, as in [`crate::Surface`].
    pub instance: u32,
    /// Placement of the volume, or of the mesh's grid.
    pub placement: Placement,
    /// 1 / s (see the module).
    pub units_per_world: f64,
    /// Areas of a voxel's faces perpendicular to each axis, over s².
    pub areas: [f32; 3],
    /// Whether the emitters are triangles.
    pub is_mesh: bool,
    /// Range (first, end) of its emitters in [`Emitters::by_key`].
    pub keys: [u32; 2],
    materials: Arc<MaterialTable>,
}

/// The emissive faces of one label in one box, or one emissive triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emitter {
    /// Index in [`Emitters::emissive_instances`].
    pub emissive_instance: u32,
    /// Dense label, or the material index of a triangle.
    pub label: u32,
    /// Lowest voxel of the box, or (index, 0, 0) of a triangle.
    pub origin: [u32; 3],
    /// Index of its first face in [`Emitters::faces`], or of the triangle in [`Emitters::triangles`].
    pub first: u32,
    /// End of the faces of each direction, relative to the first.
    pub ends: [u16; 6],
    /// For each direction the outermost plane from which all its faces are in front: the lowest for + directions, the highest for −
    /// directions, relative to the box's lowest voxel; 5 bits each.
    pub planes: u32,
}

/// An emissive triangle, in its mesh's grid.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct EmissiveTriangle {
    /// Corners, in the grid.
    pub corners: [[f32; 3]; 3],
    /// Area in the world over s².
    pub area: f32,
}

/// All emitters of a scene (see the module).
#[derive(Clone, Debug)]
pub struct Emitters {
    emissive_instances: Vec<EmissiveInstance>,
    /// Index into `emissive_instances` by instance.
    emissive_instance_of: Vec<u32>,
    /// In the order of the tree.
    emitters: Vec<Emitter>,
    faces: Vec<u16>,
    triangles: Vec<EmissiveTriangle>,
    /// Emitters sorted by emissive instance, label and lowest voxel.
    by_key: Vec<u32>,
    tree: LightTree,
    irradiance: f32,
    /// Radius of the ball around all emitters, in the world.
    radius: f64,
}

/// Light from an emitter along one direction.
#[derive(Clone, Copy, Debug)]
pub struct EmitterSample {
    /// Unit vector towards the emitter.
    pub direction: DVec3,
    /// Surfaces nearer than this occlude the emitter.
    pub distance: f64,
    /// Radiance, times the material's opacity (alpha).
    pub radiance: Vec3,
    /// Density per solid angle.
    pub pdf: f32,
    /// Instance whose surface emits.
    pub instance: u32,
}

/// The vector from a receiver to a point of an emitter.
struct WayTo {
    /// The vector in index space.
    way: DVec3,
    /// N·w (see the module).
    across: f64,
    /// Density on the face, relative to a density of 1 over the whole face.
    share: f32,
    /// Area of the face over s².
    area: f32,
}

impl EmissiveInstance {
    #[inline]
    fn point(&self, from: &Receiver) -> DVec3 {
        self.placement.index_from_world(from.point - self.placement.world_from_index.translation)
    }
}

impl Emitter {
    fn key(&self) -> [u32; 5] {
        let [x, y, z] = self.origin;
        [self.emissive_instance, self.label, z, y, x]
    }

    /// First face and end of the list of a direction.
    #[inline]
    fn list(&self, direction: usize) -> (u32, u32) {
        let start = if direction == 0 { 0 } else { self.ends[direction - 1] };
        (self.first + u32::from(start), self.first + u32::from(self.ends[direction]))
    }

    /// Apparent size of each direction's faces from an index-space point, up to a common factor, and the sum of all six.
    #[inline]
    fn seen(&self, point: DVec3) -> ([f32; 6], f32) {
        let (mut seen, mut sum) = ([0.0; 6], 0.0);
        for (direction, part) in seen.iter_mut().enumerate() {
            let axis = direction / 2;
            // (Clamped, so that the product with the number of faces is finite.)
            let at = ((point[axis] - f64::from(self.origin[axis])) as f32).clamp(-1e30, 1e30);
            let plane = (self.planes >> (5 * direction) & 31) as f32;
            let height = if direction % 2 == 1 { at - plane } else { plane - at };
            let (start, end) = self.list(direction);
            *part = (end - start) as f32 * height.max(0.0);
            sum += *part;
        }
        (seen, sum)
    }
}

impl EmissiveTriangle {
    /// Corners, and the area vector, in the grid.
    #[inline]
    fn shape(&self) -> ([DVec3; 3], DVec3) {
        let [a, b, c] = self.corners.map(|c| Vec3::from_array(c).as_dvec3());
        ([a, b, c], (b - a).cross(c - a) * 0.5)
    }
}

impl Emitters {
    /// Collects everything emissive that light sampling can choose; `None` where there is nothing.
    ///
    /// # Errors
    /// [`RenderError::Scene`] if there are more emitters or faces than 32 bits can number.
    pub fn new(shining: &[EmissiveGeometry<'_>]) -> Result<Option<Self>, RenderError> {
        gather::gather(shining)
    }

    /// Builds the tree and the lookup tables from the collected emitters.
    fn of(
        mut places: Vec<EmissiveInstance>,
        unordered: &[Emitter],
        bounded: &[Bounded],
        faces: Vec<u16>,
        triangles: Vec<EmissiveTriangle>,
    ) -> Self {
        let (tree, order) = LightTree::new(bounded);
        let emitters: Vec<Emitter> = order.iter().map(|&e| unordered[e as usize]).collect();
        let mut by_key: Vec<u32> = (0..emitters.len() as u32).collect();
        by_key.sort_unstable_by_key(|&e| emitters[e as usize].key());
        let mut place_of = Vec::new();
        for (p, place) in (0u32..).zip(&mut places) {
            let end_of =
                |p: u32| by_key.partition_point(|&e| emitters[e as usize].emissive_instance < p) as u32;
            place.keys = [end_of(p), end_of(p + 1)];
            place_of.resize(place_of.len().max(place.instance as usize + 1), NOT_EMISSIVE);
            place_of[place.instance as usize] = p;
        }
        // Mean irradiance on the sphere around all emitters, from powers of π L A.
        let lo = bounded.iter().fold(DVec3::INFINITY, |m, e| m.min(e.lo));
        let hi = bounded.iter().fold(DVec3::NEG_INFINITY, |m, e| m.max(e.hi));
        let power: f64 = bounded.iter().map(|e| e.power).sum();
        let irradiance = (power / (PI * (hi - lo).length_squared())).min(f64::from(f32::MAX)) as f32;
        Self {
            emissive_instances: places,
            emissive_instance_of: place_of,
            emitters,
            faces,
            triangles,
            by_key,
            tree,
            irradiance,
            radius: (0.5 * (hi - lo).length()).max(f64::MIN_POSITIVE),
        }
    }

    /// Instances and meshes that have emitters.
    pub fn emissive_instances(&self) -> &[EmissiveInstance] {
        &self.emissive_instances
    }

    /// Index into [`Emitters::emissive_instances`] by instance; [`NOT_EMISSIVE`] for an instance without emitters. Instances past the end
    /// have none.
    pub fn emissive_instance_of(&self) -> &[u32] {
        &self.emissive_instance_of
    }

    /// All emitters, in the order of the tree.
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// Codes of faces, in the layout that `faces.rs` draws.
    pub fn faces(&self) -> &[u16] {
        &self.faces
    }

    /// Triangles of all emissive meshes.
    pub fn triangles(&self) -> &[EmissiveTriangle] {
        &self.triangles
    }

    /// Emitters sorted by emissive instance, label, and lowest voxel (z, y, x).
    pub fn by_key(&self) -> &[u32] {
        &self.by_key
    }

    /// The tree over all emitters.
    pub fn tree(&self) -> &LightTree {
        &self.tree
    }

    /// Approximate irradiance of the emitters around them, for choosing among lights.
    pub fn irradiance(&self) -> f32 {
        self.irradiance
    }

    /// Radius of the ball around all emitters, in the world.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// About the irradiance of a receiver, for choosing among lights: that of the ball around them, falling with the squared distance beyond.
    /// Never 0.
    #[inline]
    pub fn irradiance_at(&self, from: &Receiver) -> f32 {
        let squared = ((from.point - self.tree.middle) / self.radius).as_vec3().length_squared().max(1.0);
        (self.irradiance / squared).max(f32::MIN_POSITIVE)
    }

    /// Size on the heap in bytes.
    pub fn bytes(&self) -> u64 {
        let of_emitters = self.emitters.capacity() * size_of::<Emitter>() + self.by_key.capacity() * 4;
        let of_surfaces =
            self.faces.capacity() * 2 + self.triangles.capacity() * size_of::<EmissiveTriangle>();
        let of_places = self.emissive_instances.capacity() * size_of::<EmissiveInstance>()
            + self.emissive_instance_of.capacity() * 4;
        (of_emitters + of_surfaces + of_places) as u64 + self.tree.bytes()
    }

    /// Samples a point of an emitter: `choice` selects in the tree, `further` in the tree and the direction, `u` the face and its point.
    #[inline]
    pub fn sample(
        &self,
        from: &Receiver,
        choice: f32,
        further: [f32; 2],
        u: [f32; 2],
    ) -> Option<EmitterSample> {
        let seen_from = self.tree.seen_from(from.point, from.normal, from.both_sides);
        let (number, chance) = self.tree.choose(&seen_from, [choice, further[0]])?;
        let emitter = &self.emitters[number as usize];
        let place = &self.emissive_instances[emitter.emissive_instance as usize];
        let to = if place.is_mesh {
            self.sample_triangle(emitter, place.point(from), u)
        } else {
            self.sample_box(emitter, place, place.point(from), further[1], u)?
        };
        let way = place.placement.world_from_index.matrix3 * to.way;
        let distance = way.length();
        let units = (distance * place.units_per_world) as f32;
        let across = (to.across as f32).abs();
        let pdf = density(chance * to.share, units, across);
        let material = place.materials.material(emitter.label);
        let cos = (across / (to.area * units)).clamp(1e-6, 1.0);
        let radiance = emitted(material, cos) * material.alpha;
        (pdf > 0.0).then(|| EmitterSample {
            direction: way * (1.0 / distance),
            distance: distance * crate::lights::TOUCHING - from.point.abs().max_element() * POINT_ROUNDING,
            radiance,
            pdf,
            instance: place.instance,
        })
    }

    #[inline]
    fn sample_box(
        &self,
        emitter: &Emitter,
        place: &EmissiveInstance,
        point: DVec3,
        which: f32,
        u: [f32; 2],
    ) -> Option<WayTo> {
        let (seen, sum) = emitter.seen(point);
        if sum <= 0.0 {
            return None;
        }
        // The direction whose interval of the sum holds the random number.
        let (mut direction, mut end) = (6, 0.0);
        for (d, part) in seen.into_iter().enumerate() {
            if part > 0.0 && (direction == 6 || which * sum >= end) {
                direction = d;
            }
            end += part;
        }
        let (axis, positive) = (direction / 2, direction % 2 == 1);
        let (start, end) = emitter.list(direction);
        let count = end - start;
        let place_in_list = u[0] * count as f32;
        let index = (place_in_list as u32).min(count - 1);
        let code = u32::from(self.faces[(start + index) as usize]);
        let within = [place_in_list - index as f32, u[1]];
        // The two axes across the face, in their order.
        let mut next = 0;
        let mut way = DVec3::ZERO;
        for a in 0..3 {
            let voxel = f64::from(emitter.origin[a] + (code >> (4 * a) & 15));
            let at = if a == axis {
                voxel + if positive { 1.0 } else { 0.0 }
            } else {
                next += 1;
                voxel + f64::from(within[next - 1])
            };
            way[a] = at - point[a];
        }
        let faces = if positive { way[axis] < 0.0 } else { way[axis] > 0.0 };
        faces.then(|| WayTo {
            way,
            across: way[axis],
            share: seen[direction] / sum / count as f32,
            area: place.areas[axis],
        })
    }

    #[inline]
    fn sample_triangle(&self, emitter: &Emitter, point: DVec3, u: [f32; 2]) -> WayTo {
        let triangle = &self.triangles[emitter.first as usize];
        let ([a, b, c], normal) = triangle.shape();
        let root = u[0].sqrt();
        let (v, w) = (f64::from(root * (1.0 - u[1])), f64::from(root * u[1]));
        let way = (a - point) + (b - a) * v + (c - a) * w;
        WayTo { way, across: normal.dot(a - point), share: 1.0, area: triangle.area }
    }

    /// Density with which [`Emitters::sample`] chooses the direction to this surface, seen from outside or from a triangle's side at
    /// `distance` in the world; 0 where the surface cannot be sampled. `box_origin` is the lowest voxel of the box that draws it.
    #[inline]
    pub fn pdf(
        &self,
        from: &Receiver,
        surface: &Surface,
        box_origin: impl FnOnce() -> Option<[u32; 3]>,
        distance: f64,
    ) -> f32 {
        let place_number =
            self.emissive_instance_of.get(surface.instance as usize).copied().unwrap_or(NOT_EMISSIVE);
        if place_number == NOT_EMISSIVE || surface.kind == SurfaceKind::Cap {
            return 0.0;
        }
        let place = &self.emissive_instances[place_number as usize];
        let origin = match place.is_mesh {
            true => Some([surface.plane, 0, 0]),
            false => box_origin(),
        };
        let Some(number) = origin.and_then(|origin| self.find(place, surface.label, origin)) else {
            return 0.0;
        };
        let emitter = &self.emitters[number as usize];
        let point = place.point(from);
        let (share, across) = if place.is_mesh {
            let ([a, ..], normal) = self.triangles[emitter.first as usize].shape();
            (1.0, normal.dot(a - point))
        } else {
            let axis = usize::from(surface.axis);
            let direction = 2 * axis + usize::from(surface.positive);
            let (start, end) = emitter.list(direction);
            let at = [0, 1, 2].map(|a| surface.voxel[a].wrapping_sub(emitter.origin[a]));
            let code = (at[0] | at[1] << 4 | at[2] << 8) as u16;
            if self.faces[start as usize..end as usize].binary_search(&code).is_err() {
                return 0.0;
            }
            let (seen, sum) = emitter.seen(point);
            let across = f64::from(surface.plane) - point[axis];
            let faces = if surface.positive { across < 0.0 } else { across > 0.0 };
            if sum <= 0.0 || !faces {
                return 0.0;
            }
            (seen[direction] / sum / (end - start) as f32, across)
        };
        let seen_from = self.tree.seen_from(from.point, from.normal, from.both_sides);
        let chance = self.tree.probability(&seen_from, number);
        density(chance * share, (distance * place.units_per_world) as f32, (across as f32).abs())
    }

    /// The emitter with this key.
    #[inline]
    fn find(&self, place: &EmissiveInstance, label: u32, origin: [u32; 3]) -> Option<u32> {
        let keys = &self.by_key[place.keys[0] as usize..place.keys[1] as usize];
        let [x, y, z] = origin;
        let wanted = [label, z, y, x];
        let key = |&e: &u32| {
            let [_, label, z, y, x] = self.emitters[e as usize].key();
            [label, z, y, x]
        };
        keys.binary_search_by_key(&wanted, key).ok().map(|i| keys[i])
    }
}

/// Density per solid angle, at a distance in units of s, of a face with N·w = `across`; 0 where f32 cannot represent it.
#[inline]
fn density(share: f32, units: f32, across: f32) -> f32 {
    let pdf = share * (units / across) * units * units;
    if pdf.is_finite() { pdf } else { 0.0 }
}

//! Emissive labels and meshes as lights that are aimed at.
//!
//! An **emitter** is what of an emissive label lies in one of its boxes, or one triangle of an emissive material. A tree
//! ([`LightTree`]) chooses among all of them; within a box, a direction, then a face, then a point of it:
//!
//! ```text
//!  tree ─► box ─► −x +x −y +y −z +z ─► face ─► point ─► shadow ray
//!   │           by faces × height of the receiver over them: what they look like from there
//!   └────► triangle ─────────────────────────► point
//! ```
//! **Numbers.** With w the way to a point of a face in index space, N the face's area there as a vector and s³ the volume of a voxel,
//! the way in the world is d = M w, and a part dα of the face is seen under |N·w| s³ dα / |d|³: whatever the spacing, shear or mirror, and
//! the same for triangles in their mesh's grid. Ways are taken in f64 and rounded once; all else is f32.
//!
//! **What is aimed at**: faces of voxels that are drawn as such, with nothing visible before them (`faces.rs`), and both sides of
//! triangles. All other emission (caps, coarser levels of detail, insides of labels, faces against other labels) has a density of 0
//! here, and is found by scattering alone.

mod faces;
mod gather;
mod light_tree;

use std::f64::consts::PI;
use std::sync::Arc;

use crate::{Receiver, RenderError, Surface, SurfaceKind};
use glam::{DVec3, Vec3};

use crate::MaterialTable;
use crate::bsdf::emitted;
use crate::geometry::Placement;
pub use gather::EmissiveGeometry;
pub(crate) use gather::emission_luminance;
pub use light_tree::{Bounded, LightNode, LightTree, SeenFrom};

/// Says that an instance has no emitter.
pub const NOT_EMISSIVE: u32 = u32::MAX;

/// Rounding of a point in the world, twice over: shadow rays end this part of the point's coordinates before a face.
const POINT_ROUNDING: f64 = 2.0 * f64::EPSILON;

/// An instance or mesh that has emitters.
#[derive(Clone, Debug)]
pub struct EmissiveInstance {
    /// As in surfaces.
    pub instance: u32,
    /// Of index space, or of a mesh's grid.
    pub placement: Placement,
    /// 1 / s (see the module).
    pub units_per_world: f64,
    /// Areas of a voxel's faces across each axis, over s².
    pub areas: [f32; 3],
    /// Whether its emitters are triangles.
    pub is_mesh: bool,
    /// Its emitters by number in [`Emitters::by_key`]: first, end.
    pub keys: [u32; 2],
    materials: Arc<MaterialTable>,
}

/// What shines within a box, or a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emitter {
    /// Number of its place.
    pub emissive_instance: u32,
    /// Dense label; index of a triangle's material.
    pub label: u32,
    /// Lowest voxel of the box; of a triangle its number, 0, 0.
    pub origin: [u32; 3],
    /// Its first face in [`Emitters::faces`]; a triangle's place in [`Emitters::triangles`].
    pub first: u32,
    /// Where the faces of each direction end, counted from the first.
    pub ends: [u16; 6],
    /// For each direction the lowest plane of its faces as they look (the highest where they look down), from the box's lowest: 5 bits
    /// each.
    pub planes: u32,
}

/// A triangle, in its mesh's grid.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct EmissiveTriangle {
    /// Corners.
    pub corners: [[f32; 3]; 3],
    /// Area in the world over s².
    pub area: f32,
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Emitters {
    emissive_instances: Vec<EmissiveInstance>,
    /// Number of the place by instance.
    emissive_instance_of: Vec<u32>,
    /// In the tree's order.
    emitters: Vec<Emitter>,
    faces: Vec<u16>,
    triangles: Vec<EmissiveTriangle>,
    /// Emitters by place, label and lowest voxel.
    by_key: Vec<u32>,
    tree: LightTree,
    irradiance: f32,
}

/// Light from an emitter along one direction.
#[derive(Clone, Copy, Debug)]
pub struct EmitterSample {
    /// Unit vector towards it.
    pub direction: DVec3,
    /// What is nearer than this hides it.
    pub distance: f64,
    /// Radiance; what lets light pass there (alpha) taken off.
    pub radiance: Vec3,
    /// Density per solid angle.
    pub pdf: f32,
    /// Whose surface it is.
    pub instance: u32,
}

/// The way from a receiver to a point of an emitter.
struct WayTo {
    /// In index space.
    way: DVec3,
    /// N·w (see the module).
    across: f64,
    /// Density on the face, for all of it 1.
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

    /// First face and end of a direction's list.
    #[inline]
    fn list(&self, direction: usize) -> (u32, u32) {
        let start = if direction == 0 { 0 } else { self.ends[direction - 1] };
        (self.first + u32::from(start), self.first + u32::from(self.ends[direction]))
    }

    /// How much of each direction's faces a receiver at an index-space point sees, up to a common factor; and their sum.
    #[inline]
    fn seen(&self, point: DVec3) -> ([f32; 6], f32) {
        let (mut seen, mut sum) = ([0.0; 6], 0.0);
        for (direction, part) in seen.iter_mut().enumerate() {
            let axis = direction / 2;
            // (Faces times this far are a number.)
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
    /// Corners, and its area as a vector, in the grid.
    #[inline]
    fn shape(&self) -> ([DVec3; 3], DVec3) {
        let [a, b, c] = self.corners.map(|c| Vec3::from_array(c).as_dvec3());
        ([a, b, c], (b - a).cross(c - a) * 0.5)
    }
}

impl Emitters {
    /// Gathers all that shines and can be aimed at; `None` where nothing does.
    ///
    /// # Errors
    /// [`RenderError::Scene`] where there are more emitters or faces than 32 bits can number.
    pub fn new(shining: &[EmissiveGeometry<'_>]) -> Result<Option<Self>, RenderError> {
        gather::gather(shining)
    }

    /// What is gathered, made ready.
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
        // Mean irradiance on the sphere around all: of powers π L A.
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
        }
    }

    /// Instances and meshes that have emitters.
    pub fn emissive_instances(&self) -> &[EmissiveInstance] {
        &self.emissive_instances
    }

    /// Number of the place by instance, [`NOT_EMISSIVE`] where there is none; instances past the end have none.
    pub fn emissive_instance_of(&self) -> &[u32] {
        &self.emissive_instance_of
    }

    /// All emitters, in the tree's order.
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// Codes of faces, as drawn in `faces.rs`.
    pub fn faces(&self) -> &[u16] {
        &self.faces
    }

    /// Triangles.
    pub fn triangles(&self) -> &[EmissiveTriangle] {
        &self.triangles
    }

    /// Emitters by place, label, and lowest voxel (z, y, x).
    pub fn by_key(&self) -> &[u32] {
        &self.by_key
    }

    /// The tree.
    pub fn tree(&self) -> &LightTree {
        &self.tree
    }

    /// Irradiance that they give about where they are, for choosing among lights.
    pub fn irradiance(&self) -> f32 {
        self.irradiance
    }

    /// Heap bytes.
    pub fn bytes(&self) -> u64 {
        let of_emitters = self.emitters.capacity() * size_of::<Emitter>() + self.by_key.capacity() * 4;
        let of_surfaces =
            self.faces.capacity() * 2 + self.triangles.capacity() * size_of::<EmissiveTriangle>();
        let of_places = self.emissive_instances.capacity() * size_of::<EmissiveInstance>()
            + self.emissive_instance_of.capacity() * 4;
        (of_emitters + of_surfaces + of_places) as u64 + self.tree.bytes()
    }

    /// A point of an emitter: `choice` is for the tree, `further` for the tree and the direction, `u` for the face and its point.
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
        // The direction within whose part of the sum the number falls.
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
        // Across the face the two other axes, in their order.
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

    /// Density with which [`Emitters::sample`] gives a direction to the surface from outside or from a triangle's side, `distance` away
    /// in the world; 0 where it is not aimed at. `box_origin` is the lowest voxel of the box that draws it.
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

    /// The emitter with that key.
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

/// Density per solid angle at a distance of so many units, where a face lies `across` so much (N·w); 0 where f32 cannot hold it.
#[inline]
fn density(share: f32, units: f32, across: f32) -> f32 {
    let pdf = share * (units / across) * units * units;
    if pdf.is_finite() { pdf } else { 0.0 }
}

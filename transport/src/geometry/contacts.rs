//! Places where instances of volumes touch, in scenes that light passes through.
//!
//! ```text
//!            instance 1        instance 2
//! ─────────────►│────────────────►┊────────────────►│────────►      one body: the faces between them are no surfaces
//! ─────────────►│────────────────►││───────────────►│────────►      two bodies: the back of the first, then the front of the second
//! ```
//! Each instance finds its hits by itself, in its own index space. Where two of them have a face in one place, rounding alone would decide
//! which face a ray meets first, and whether a ray that continues from that face starts before or behind the other. Faces within
//! [`Contacts::distance`] of each other along a ray therefore count as one place; `cpu-renderer/src/crossing.rs` says in which order a path
//! passes them.
//!
//! Where no surface lets light through, or where there is only one volume, no path is ever inside a label: there are no contacts, and
//! rays cost what they did.

use std::sync::Arc;

use crate::geometry::Placement;
use crate::{LoadedScene, Surface};

/// Share of the thinnest voxel within which faces count as one place. The position of a face is rounded to 2⁻²⁹ voxels in the longest
/// volumes (2²³ voxels), which leaves room for the roundings of several matrices; and it is less than [`super::TIE`], up to which
/// tracers find hits beyond the nearest one.
const NEAR_VOXELS: f64 = 1.0 / 1_048_576.0;

/// How instances of volumes touch (see the module).
#[derive(Clone, Debug, PartialEq)]
pub struct Contacts {
    distance: f64,
    /// For each instance the first one that shows the same volume in the same style.
    bodies: Vec<u32>,
}

impl Contacts {
    /// The contacts of a scene; `None` where paths need none (see the module).
    pub fn new(scene: &LoadedScene) -> Option<Self> {
        let needs = scene.needs();
        if !(needs.glass || needs.transparent) || scene.volumes().len() < 2 {
            return None;
        }
        let (instances, volumes) = (&scene.scene().instances, scene.volumes());
        let first_alike = |place: usize| {
            let is_alike = |other: &usize| {
                Arc::ptr_eq(&volumes[*other], &volumes[place])
                    && instances[*other].style == instances[place].style
            };
            (0..place).find(is_alike).unwrap_or(place) as u32
        };
        let bodies = (0..instances.len()).map(first_alike).collect();
        // (A matrix that cannot be inverted is refused where the geometry is built.)
        let placements = instances.iter().filter_map(|i| Placement::new(i.world_from_index));
        Some(Self::of(placements, bodies))
    }

    /// The contacts of instances with these placements; instances of equal `bodies` are parts of one body.
    pub fn of(placements: impl Iterator<Item = Placement>, bodies: Vec<u32>) -> Self {
        let thickness = |p: Placement| {
            let of_axis = p.adjugate.map(|row| p.determinant / row.length());
            of_axis.into_iter().fold(f64::INFINITY, f64::min)
        };
        let thinnest = placements.map(thickness).fold(f64::INFINITY, f64::min);
        Self { distance: if thinnest.is_finite() { thinnest * NEAR_VOXELS } else { 0.0 }, bodies }
    }

    /// Distance along a ray, in world units, within which faces of two instances count as one place.
    pub fn distance(&self) -> f64 {
        self.distance
    }

    /// Number of the body that an instance of a volume is part of; `None` for a mesh.
    pub fn body(&self, instance: u32) -> Option<u32> {
        self.bodies.get(instance as usize).copied()
    }

    /// Whether the two surfaces belong to one label of one body: where they lie in one place, there is no surface.
    pub fn are_one(&self, a: &Surface, b: &Surface) -> bool {
        let body = self.body(a.instance);
        a.label == b.label && body.is_some() && body == self.body(b.instance)
    }
}

//! First hits of rays (§4.1, §4.2): a hierarchy over the boxes, and the walk through each.
//!
//! The hierarchy is the one that Pumice's own form is traced with, so that what is compared is the boxes and what is in them.

use glam::DAffine3;
use pumice_transport::{BoxBounds, Bvh, BvhRay, RayInWorld, RenderError};

use crate::encoding::{BoxRecord, Encoding, Trees};
use crate::tree::Node;
use crate::walk::{Found, IndexRay};

/// See the module.
#[derive(Debug)]
pub struct EncodingTracer<'a> {
    encoding: &'a Encoding,
    index_from_world: DAffine3,
    bvh: Bvh,
    /// Labels in the hierarchy that are passed over.
    hidden: Option<Vec<bool>>,
    /// Whether boxes are drawn whole (§4.3).
    is_coarse: bool,
}

/// What a ray met first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncodedHit {
    /// Along the ray.
    pub t: f64,
    /// Dense index.
    pub label: u32,
    /// The voxel, or the one of a coarse box where the ray came in.
    pub voxel: [u32; 3],
    /// Axis of the face; `None` where the ray began in the voxel.
    pub axis: Option<usize>,
}

impl<'a> EncodingTracer<'a> {
    /// Of the labels that are marked, by dense index, with a hierarchy over their boxes.
    ///
    /// # Errors
    /// [`RenderError::Scene`] when there are too many boxes.
    pub fn new(
        encoding: &'a Encoding,
        world_from_index: DAffine3,
        visible: &[bool],
    ) -> Result<Self, RenderError> {
        let bounds = encoding.boxes().iter().zip(0..).filter(|(b, _)| visible[b.label as usize]);
        let bounds = bounds.map(|(b, i)| (BoxBounds { lo: b.lo, hi: b.hi }, i)).collect();
        Ok(Self {
            encoding,
            index_from_world: world_from_index.inverse(),
            bvh: Bvh::build(bounds)?,
            hidden: None,
            is_coarse: false,
        })
    }

    /// The same with all boxes in the hierarchy: those of other labels are passed over where a ray meets them (§5.6).
    ///
    /// # Errors
    /// As [`EncodingTracer::new`].
    pub fn discarding(
        encoding: &'a Encoding,
        world_from_index: DAffine3,
        visible: &[bool],
    ) -> Result<Self, RenderError> {
        let hidden = Some(visible.iter().map(|v| !v).collect());
        Ok(Self { hidden, ..Self::new(encoding, world_from_index, &vec![true; visible.len()])? })
    }

    /// Draws boxes whole, or again what is in them.
    #[must_use]
    pub fn coarse(self, is_coarse: bool) -> Self {
        Self { is_coarse, ..self }
    }

    /// Bytes of the hierarchy.
    pub fn bvh_bytes(&self) -> u64 {
        self.bvh.bytes()
    }

    /// Boxes in the hierarchy.
    pub fn boxes(&self) -> usize {
        self.bvh.len()
    }

    /// The nearest voxel that the ray passes through, of the lowest label where several are as near. `nodes` grows by those that were
    /// read on the way.
    pub fn first_hit(&self, ray: &RayInWorld, nodes: &mut u64) -> Option<EncodedHit> {
        let (r, length) = IndexRay::new(
            self.index_from_world.transform_point3(ray.origin),
            self.index_from_world.transform_vector3(ray.direction),
        )?;
        let bounds = self.bvh.bounds()?;
        let (enter_all, leave_all) = r.clip(bounds.lo, bounds.hi);
        if enter_all >= leave_all {
            return None;
        }
        let moved = moved(&r, &self.bvh, bounds, enter_all);
        let mut best: Option<(Found, u32)> = None;
        let limit = |best: &Option<(Found, u32)>| {
            best.map_or(f32::INFINITY, |(f, _)| (f.t - enter_all) as f32 * 1.000_001 + moved.pad)
        };
        self.bvh.along_ray(&moved, f32::INFINITY, |item| {
            let b = &self.encoding.boxes[item as usize];
            if self.hidden.as_ref().is_some_and(|h| h[b.label as usize]) {
                return limit(&best);
            }
            let (enter, leave) = r.clip(b.lo, b.hi);
            if enter < leave && best.is_none_or(|(f, _)| enter <= f.t) {
                let nearer = |found: &Found| {
                    best.is_none_or(|(f, label)| found.t < f.t || (found.t == f.t && b.label < label))
                };
                if let Some(found) = self.in_box(&r, b, enter, nodes).filter(nearer) {
                    best = Some((found, b.label));
                }
            }
            limit(&best)
        });
        best.map(|(f, label)| EncodedHit { t: f.t / length, label, voxel: f.voxel, axis: f.axis })
    }

    #[inline]
    fn in_box(&self, ray: &IndexRay, b: &BoxRecord, enter: f64, nodes: &mut u64) -> Option<Found> {
        let (bounds, side) = ((b.lo, b.hi), self.encoding.cube(b));
        let dag = match &self.encoding.trees {
            _ if self.is_coarse => {
                let nothing = NoTree;
                return ray.first_voxel((&nothing, Node::Solid), bounds, side, enter, nodes);
            }
            Trees::Octrees(octrees) => {
                let (tree, root) = octrees.tree(b.root);
                return ray.first_voxel((&tree, root), bounds, side, enter, nodes);
            }
            Trees::Types(dags, types) => &dags[types.of(b.label)],
            Trees::Shared(dag) => dag,
        };
        ray.first_voxel((dag, dag.node(b.root)), bounds, side, enter, nodes)
    }
}

/// Of a box that is drawn whole.
struct NoTree;

impl crate::tree::Tree for NoTree {
    fn child(&self, _: u32, _: u32) -> Node {
        Node::Solid
    }
}

/// The ray as the hierarchy wants it, from where it comes into the hierarchy's bounds.
fn moved(ray: &IndexRay, bvh: &Bvh, bounds: BoxBounds, enter: f64) -> BvhRay {
    const MOST: f64 = (1u64 << 60) as f64;
    let at = |a: usize| {
        let at = ray.origin[a] + enter * ray.direction[a];
        at.clamp(f64::from(bounds.lo[a]), f64::from(bounds.hi[a])) as f32
    };
    let far = ray.origin.iter().fold(enter, |most, o| most.max(o.abs()));
    BvhRay {
        origin: [0, 1, 2].map(at),
        inverse: ray.inverse.map(|i| i.clamp(-MOST, MOST) as f32),
        // Three roundings of the move.
        pad: bvh.pad() + (far * 4.0 * f64::EPSILON) as f32,
    }
}

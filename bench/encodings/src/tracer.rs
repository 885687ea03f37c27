//! Finds the first hits of rays (§4.1, §4.2) with a hierarchy over the boxes and a walk through each box.
//!
//! The hierarchy is the one that also serves Pumice's own form, so that a comparison is only about the boxes and their content.

use glam::DAffine3;
use pumice_transport::{BoxBounds, Bvh, BvhRay, RayInWorld, RenderError};

use crate::encoding::{BoxRecord, Encoding, Trees};
use crate::tree::Node;
use crate::walk::{Found, IndexRay};

/// Traces rays through an [`Encoding`].
#[derive(Debug)]
pub struct EncodingTracer<'a> {
    encoding: &'a Encoding,
    index_from_world: DAffine3,
    bvh: Bvh,
    /// By dense label, whether boxes in the hierarchy are skipped; `None` where the hierarchy has only visible boxes.
    hidden: Option<Vec<bool>>,
    /// Whether boxes are drawn as solid boxes (§4.3).
    is_coarse: bool,
}

/// First hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncodedHit {
    /// Ray parameter, in lengths of the ray's direction.
    pub t: f64,
    /// Dense index of the label.
    pub label: u32,
    /// The voxel hit; of a box that is drawn solid, the voxel where the ray enters it.
    pub voxel: [u32; 3],
    /// Axis of the face that was hit; `None` where the ray starts inside the voxel.
    pub axis: Option<usize>,
}

impl<'a> EncodingTracer<'a> {
    /// A tracer with a hierarchy over the boxes of visible labels. `visible` has an entry for each dense label.
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

    /// A tracer with all boxes in the hierarchy, which skips the boxes of invisible labels when a ray meets them (§5.6).
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

    /// The same tracer, drawing boxes as solid (`true`) or with their voxels (`false`).
    #[must_use]
    pub fn coarse(self, is_coarse: bool) -> Self {
        Self { is_coarse, ..self }
    }

    /// Bytes of the hierarchy.
    pub fn bvh_bytes(&self) -> u64 {
        self.bvh.bytes()
    }

    /// Number of boxes in the hierarchy.
    pub fn boxes(&self) -> usize {
        self.bvh.len()
    }

    /// The nearest voxel that the ray passes through; at equal distance, that of the lowest label. Adds the number of tree nodes read to
    /// `nodes`.
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

/// The tree of a box that is drawn solid.
struct NoTree;

impl crate::tree::Tree for NoTree {
    fn child(&self, _: u32, _: u32) -> Node {
        Node::Solid
    }
}

/// The ray as [`Bvh::along_ray`] takes it, with its origin moved to where it enters the hierarchy's bounds.
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
        // Covers the three roundings of moving the origin.
        pad: bvh.pad() + (far * 4.0 * f64::EPSILON) as f32,
    }
}

//! A volume in one of the paper's encodings: boxes, and the octrees or graphs that their roots point into.

use std::ops::Range;

use pumice_core::CompressedVolume;

use crate::dag::Dag;
use crate::merge::{Merged, graphs_of_types};
use crate::octree::Octrees;
use crate::subdivision::{Subdivision, levels_of};
use crate::tree::for_each_cell;
use crate::types::Types;

/// How the voxels of boxes are stored (§5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Form {
    /// One octree for each box: SVOs (AABB).
    Octrees,
    /// One graph for each label type: SVDAGs (TYPE).
    DagPerType,
    /// One graph for all boxes: SVDAG (SHARED).
    DagShared,
}

impl Form {
    /// All forms in the order of the paper's tables.
    pub const ALL: [Self; 3] = [Self::Octrees, Self::DagPerType, Self::DagShared];

    /// The paper's name of the form.
    pub fn name(self) -> &'static str {
        match self {
            Self::Octrees => "SVOs (AABB)",
            Self::DagPerType => "SVDAGs (TYPE)",
            Self::DagShared => "SVDAG (SHARED)",
        }
    }
}

/// A box as it is stored in memory, 32 bytes: bounds, label and root (§3.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct BoxRecord {
    /// Lowest voxel, which is also the lowest corner of the cube that its tree divides.
    pub lo: [u32; 3],
    /// One past the highest voxel.
    pub hi: [u32; 3],
    /// Dense index of the label.
    pub label: u32,
    /// Root of its tree: an offset into the octrees, or an index of a node of the graph.
    pub root: u32,
}

/// A volume in one of the paper's encodings.
#[derive(Clone, Debug)]
pub struct Encoding {
    pub(crate) boxes: Vec<BoxRecord>,
    pub(crate) trees: Trees,
    pub(crate) side: Option<u32>,
    form: Form,
}

#[derive(Clone, Debug)]
pub(crate) enum Trees {
    Octrees(Octrees),
    Types(Vec<Dag>, Types),
    Shared(Dag),
}

/// A voxel where an encoding differs from the volume that it encodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotTheVolume {
    /// The voxel.
    pub voxel: [u32; 3],
    /// Dense label plus 1 in the volume; 0 for no label, or when an earlier box of the encoding already had the voxel.
    pub expected: u32,
    /// The same in the encoding.
    pub got: u32,
}

fn records(boxes: &Subdivision, roots: &[u32]) -> Vec<BoxRecord> {
    let record =
        |(b, &root): (&crate::TightBox, &u32)| BoxRecord { lo: b.lo, hi: b.hi, label: b.label, root };
    boxes.boxes().iter().zip(roots).map(record).collect()
}

impl Encoding {
    /// Encodes the boxes as one octree each, down to occupancy fields of 4³ voxels or to single voxels.
    pub fn octrees(boxes: &Subdivision, with_fields: bool) -> Self {
        let (octrees, roots) = Octrees::new(boxes, with_fields);
        let boxes_there = records(boxes, &roots);
        Self { boxes: boxes_there, trees: Trees::Octrees(octrees), side: boxes.side(), form: Form::Octrees }
    }

    /// Encodes the boxes as one SVDAG for each label type.
    pub fn types(boxes: &Subdivision, types: &Types, with_fields: bool) -> Self {
        let (dags, roots) = graphs_of_types(boxes, types, with_fields);
        let trees = Trees::Types(dags, types.clone());
        Self { boxes: records(boxes, &roots), trees, side: boxes.side(), form: Form::DagPerType }
    }

    /// The graphs: one for each type, one if shared, none for octrees.
    pub fn dags(&self) -> &[Dag] {
        match &self.trees {
            Trees::Octrees(_) => &[],
            Trees::Types(dags, _) => dags,
            Trees::Shared(dag) => std::slice::from_ref(dag),
        }
    }

    /// This encoding with the graphs of its types replaced by the one they were merged into; `None` for other forms.
    pub fn shared(&self, merged: Merged) -> Option<Self> {
        let Trees::Types(_, types) = &self.trees else { return None };
        let root = |b: &BoxRecord| merged.numbers[types.of(b.label)][b.root as usize];
        let boxes = self.boxes.iter().map(|b| BoxRecord { root: root(b), ..*b }).collect();
        Some(Self { boxes, trees: Trees::Shared(merged.dag), side: self.side, form: Form::DagShared })
    }

    /// The form of this encoding.
    pub fn form(&self) -> Form {
        self.form
    }

    /// All boxes, by rising labels.
    pub fn boxes(&self) -> &[BoxRecord] {
        &self.boxes
    }

    /// Bytes of the boxes.
    pub fn box_bytes(&self) -> u64 {
        size_of_val(&self.boxes[..]) as u64
    }

    /// Bytes of the octrees or graphs, with the table that finds a label's graph.
    pub fn tree_bytes(&self) -> u64 {
        match &self.trees {
            Trees::Octrees(octrees) => octrees.bytes(),
            Trees::Types(dags, types) => dags.iter().map(Dag::bytes).sum::<u64>() + types.bytes(),
            Trees::Shared(dag) => dag.bytes(),
        }
    }

    /// Bytes of each box's own tree; `None` where trees are shared.
    pub fn own_tree_bytes(&self) -> Option<Vec<u64>> {
        let Trees::Octrees(octrees) = &self.trees else { return None };
        Some(octrees.bytes_of_boxes(self.boxes.iter().map(|b| b.root)))
    }

    /// Voxels along each side of the cube that a box's tree divides.
    pub(crate) fn cube(&self, b: &BoxRecord) -> u32 {
        4 << levels_of(self.side, b.lo, b.hi)
    }

    /// Calls `visit` for each nonempty cell of 4³ voxels of a box, with the cell's lowest voxel in the volume and its occupancy field (bit
    /// x + 4y + 16z).
    pub fn for_each_cell(&self, b: &BoxRecord, mut visit: impl FnMut([u32; 3], u64)) {
        let side = self.cube(b);
        match &self.trees {
            Trees::Octrees(octrees) => {
                let (tree, root) = octrees.tree(b.root);
                for_each_cell(&tree, root, side, b.lo, &mut visit);
            }
            Trees::Types(dags, types) => {
                let dag = &dags[types.of(b.label)];
                for_each_cell(dag, dag.node(b.root), side, b.lo, &mut visit);
            }
            Trees::Shared(dag) => for_each_cell(dag, dag.node(b.root), side, b.lo, &mut visit),
        }
    }

    /// Decodes everything and compares it with the volume: each labelled voxel must lie in exactly one box, and no other voxel in any.
    ///
    /// # Errors
    /// The first voxel that differs.
    pub fn verify(&self, volume: &CompressedVolume) -> Result<(), NotTheVolume> {
        const LAYERS: u32 = 64;
        let [width, height, depth] = volume.info().dims;
        for from in (0..depth).step_by(LAYERS as usize) {
            let layers = from..depth.min(from + LAYERS);
            let dims = [width, height, layers.len() as u32];
            // The block lies within the volume, so decoding cannot fail.
            let Ok(mut labels) = volume.decode_block([0, 0, from], dims) else { continue };
            for b in self.boxes.iter().filter(|b| b.lo[2] < layers.end && b.hi[2] > layers.start) {
                self.claim(b, &layers, [width, height], &mut labels)?;
            }
            // Voxels found in a box are 0 now, so a label that is left was in no box.
            if let Some(i) = labels.iter().position(|&l| l != 0) {
                let (w, area) = (width as usize, width as usize * height as usize);
                let voxel = [i % w, i % area / w, i / area].map(|c| c as u32);
                let voxel = [voxel[0], voxel[1], voxel[2] + from];
                return Err(NotTheVolume { voxel, expected: labels[i], got: 0 });
            }
        }
        Ok(())
    }

    /// Sets the voxels of a box to 0 in `labels`, which holds the given layers; fails at the first voxel that has another label there.
    fn claim(
        &self,
        b: &BoxRecord,
        layers: &Range<u32>,
        [width, height]: [u32; 2],
        labels: &mut [u32],
    ) -> Result<(), NotTheVolume> {
        let mut wrong = None;
        self.for_each_cell(b, |low, mut field| {
            while field != 0 {
                let v = field.trailing_zeros();
                field &= field - 1;
                let voxel = [low[0] + (v & 3), low[1] + (v >> 2 & 3), low[2] + (v >> 4)];
                if !layers.contains(&voxel[2]) {
                    continue;
                }
                let got = b.label + 1;
                let inside = voxel[0] < width && voxel[1] < height;
                let i = ((voxel[2] - layers.start) as usize * height as usize + voxel[1] as usize)
                    * width as usize
                    + voxel[0] as usize;
                match labels.get_mut(i).filter(|_| inside) {
                    Some(label) if *label == got => *label = 0,
                    other => {
                        let expected = other.map_or(0, |l| *l);
                        wrong = wrong.or(Some(NotTheVolume { voxel, expected, got }));
                    }
                }
            }
        });
        wrong.map_or(Ok(()), Err)
    }
}

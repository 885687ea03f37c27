//! How often nodes of a graph are used (Figure 6).

use serde::Serialize;

use crate::dag::Dag;
use crate::encoding::{BoxRecord, Encoding};

/// Nodes of one level: those with as long a way down to their farthest leaf. (A node has no level of its own: equal ones of different
/// levels are one.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LevelReuse {
    /// Voxels along each side of the cube that a node of this level divides at least.
    pub side: u32,
    /// How many there are.
    pub nodes: u64,
    /// How often they are pointed to, by parents and by boxes.
    pub references: u64,
    /// How many are pointed to once only.
    pub once: u64,
}

/// See the module.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Reuse {
    /// From the lowest on. The empty and the solid leaf are in none.
    pub levels: Vec<LevelReuse>,
    /// References of each node of any level, falling.
    pub ranked: Vec<u32>,
}

impl Reuse {
    /// Of an encoding with one graph; `None` of others.
    pub fn of(encoding: &Encoding, with_fields: bool) -> Option<Self> {
        let [dag] = encoding.dags() else { return None };
        Some(Self::counted(dag, encoding.boxes(), if with_fields { 4 } else { 2 }))
    }

    fn counted(dag: &Dag, boxes: &[BoxRecord], lowest: u32) -> Self {
        let nodes = dag.nodes();
        let mut references = vec![0u32; nodes.len()];
        let mut heights = vec![0usize; nodes.len()];
        for (i, node) in nodes.iter().enumerate().skip(2).filter(|(_, node)| !Dag::is_leaf(node)) {
            for &child in node {
                references[child as usize] += 1;
                // An occupancy field is as high as a node over voxels; the two uniform leaves have no height.
                let height = if child < 2 { 0 } else { heights[child as usize] + 1 };
                heights[i] = heights[i].max(height);
            }
        }
        boxes.iter().for_each(|b| references[b.root as usize] += 1);

        let levels = heights.iter().skip(2).max().map_or(0, |h| h + 1);
        let mut levels: Vec<LevelReuse> =
            (0..levels).map(|h| LevelReuse { side: lowest << h, ..LevelReuse::default() }).collect();
        for (&count, &height) in references.iter().zip(&heights).skip(2) {
            let level = &mut levels[height];
            level.nodes += 1;
            level.references += u64::from(count);
            level.once += u64::from(count == 1);
        }
        let mut ranked = references.split_off(2.min(references.len()));
        ranked.sort_unstable_by(|a, b| b.cmp(a));
        Self { levels, ranked }
    }
}

//! Counts how often the nodes of an SVDAG are referenced (Figure 6 of the paper).

use serde::Serialize;

use crate::dag::Dag;
use crate::encoding::{BoxRecord, Encoding};

/// Counts for the nodes of one level, which are those with the same distance to their farthest leaf. (The depth from a root does not define
/// a level: equal nodes at different depths are stored as one.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LevelReuse {
    /// Smallest side, in voxels, of a cube that a node of this level divides.
    pub side: u32,
    /// Number of nodes.
    pub nodes: u64,
    /// Number of references to them from parents and boxes.
    pub references: u64,
    /// Number of nodes that are referenced exactly once.
    pub once: u64,
}

/// Reference counts of a graph's nodes. The empty and the solid leaf are not counted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Reuse {
    /// Counts by level, lowest first.
    pub levels: Vec<LevelReuse>,
    /// References to each node of all levels, largest first.
    pub ranked: Vec<u32>,
}

impl Reuse {
    /// Counts the references in an encoding that has exactly one graph; `None` for others.
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
                // An occupancy field has the height of a node over voxels (0); the two uniform leaves have no height.
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

//! A sparse voxel directed acyclic graph (§3.2.2, Figure 5): nodes of 32 bytes, of which no two are equal.
//!
//! ```text
//! inner node   8 numbers of nodes, 32 bits each
//! leaf         2³¹ where the first child would be, and bit 0: solid
//!              the next 8 bytes: the occupancy field of 4³, with all bits or none where the leaf stands for more
//! ```
//! Nodes 0 and 1 are the empty and the solid leaf. Children come before their parents.

use rustc_hash::FxHashMap;

use crate::subdivision::Cell;
use crate::tree::{Node, Tree, octants, parts};

pub(crate) const EMPTY: u32 = 0;
pub(crate) const SOLID: u32 = 1;
const LEAF: u32 = 1 << 31;

/// See the module.
#[derive(Clone, Debug)]
pub struct Dag {
    nodes: Vec<[u32; 8]>,
}

impl Dag {
    /// Bytes of all nodes.
    pub fn bytes(&self) -> u64 {
        32 * self.nodes.len() as u64
    }

    /// The nodes.
    pub fn nodes(&self) -> &[[u32; 8]] {
        &self.nodes
    }

    /// Whether these words are a leaf.
    pub(crate) fn is_leaf(node: &[u32; 8]) -> bool {
        node[0] & LEAF != 0
    }

    /// What a number is.
    #[inline]
    pub(crate) fn node(&self, number: u32) -> Node {
        let node = &self.nodes[number as usize];
        if node[0] & LEAF == 0 {
            return Node::Inner(number);
        }
        match u64::from(node[1]) | u64::from(node[2]) << 32 {
            0 => Node::Empty,
            u64::MAX => Node::Solid,
            field => Node::Field(field),
        }
    }
}

impl Tree for Dag {
    #[inline]
    fn child(&self, inner: u32, c: u32) -> Node {
        self.node(self.nodes[inner as usize][c as usize])
    }
}

/// A graph that grows, and knows its nodes by what they are.
#[derive(Debug)]
pub(crate) struct DagBuilder {
    nodes: Vec<[u32; 8]>,
    numbers: FxHashMap<[u32; 8], u32>,
    /// Roots of cells that went down to voxels: most come again.
    cells: FxHashMap<u64, u32>,
    with_fields: bool,
}

fn leaf(field: u64) -> [u32; 8] {
    [LEAF | u32::from(field == u64::MAX), field as u32, (field >> 32) as u32, 0, 0, 0, 0, 0]
}

impl DagBuilder {
    pub(crate) fn new(with_fields: bool) -> Self {
        let nodes = vec![leaf(0), leaf(u64::MAX)];
        Self { nodes, numbers: FxHashMap::default(), cells: FxHashMap::default(), with_fields }
    }

    pub(crate) fn finish(self) -> Dag {
        Dag { nodes: self.nodes }
    }

    /// Number of nodes so far.
    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// # Panics
    /// Where there are 2³¹ nodes: 64 GiB.
    fn number(&mut self, node: [u32; 8]) -> u32 {
        *self.numbers.entry(node).or_insert_with(|| {
            let number = self.nodes.len() as u32;
            assert!(number < LEAF, "a graph of 64 GiB");
            self.nodes.push(node);
            number
        })
    }

    fn inner(&mut self, children: [u32; 8]) -> u32 {
        match children {
            [EMPTY, EMPTY, EMPTY, EMPTY, EMPTY, EMPTY, EMPTY, EMPTY] => EMPTY,
            [SOLID, SOLID, SOLID, SOLID, SOLID, SOLID, SOLID, SOLID] => SOLID,
            _ => self.number(children),
        }
    }

    fn cell(&mut self, field: u64) -> u32 {
        match field {
            0 => EMPTY,
            u64::MAX => SOLID,
            _ if self.with_fields => self.number(leaf(field)),
            _ => {
                if let Some(&number) = self.cells.get(&field) {
                    return number;
                }
                let voxel = |octant: u8, v: u32| if octant >> v & 1 != 0 { SOLID } else { EMPTY };
                let children = octants(field).map(|octant| {
                    let voxels = [0, 1, 2, 3, 4, 5, 6, 7].map(|v| voxel(octant, v));
                    self.inner(voxels)
                });
                let number = self.inner(children);
                self.cells.insert(field, number);
                number
            }
        }
    }

    /// Puts in a tree of so many levels above its cells; returns its root.
    pub(crate) fn add(&mut self, cells: &[Cell], levels: u32, base: u64) -> u32 {
        if cells.is_empty() {
            return EMPTY;
        }
        if levels == 0 {
            return self.cell(cells[0].1);
        }
        let children = parts(cells, levels, base).map(|(part, start)| self.add(part, levels - 1, start));
        self.inner(children)
    }

    /// Puts in all nodes of another graph; returns the number here of each one there.
    pub(crate) fn absorb(&mut self, other: &Dag) -> Vec<u32> {
        let mut here = Vec::with_capacity(other.nodes.len());
        here.extend([EMPTY, SOLID]);
        for node in &other.nodes[2..] {
            // Children come first: their numbers are known.
            let node = if Dag::is_leaf(node) { *node } else { node.map(|child| here[child as usize]) };
            here.push(self.number(node));
        }
        here
    }
}

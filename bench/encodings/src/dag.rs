//! A sparse voxel directed acyclic graph (SVDAG; the paper's §3.2.2, Figure 5): nodes of 32 bytes, each stored once.
//!
//! ```text
//! inner node   the indices of its 8 children, 32 bits each
//! leaf         first word: bit 31 set, and bit 0 set when the leaf is solid
//!              next 8 bytes: the occupancy field of 4³ voxels; all bits or no bits when the leaf is a larger uniform cube
//! ```
//! Nodes 0 and 1 are the empty and the solid leaf. Children are stored before their parents.

use rustc_hash::FxHashMap;

use crate::subdivision::Cell;
use crate::tree::{Node, Tree, octants, parts};

pub(crate) const EMPTY: u32 = 0;
pub(crate) const SOLID: u32 = 1;
const LEAF: u32 = 1 << 31;

/// An SVDAG; the module documentation describes its layout.
#[derive(Clone, Debug)]
pub struct Dag {
    nodes: Vec<[u32; 8]>,
}

impl Dag {
    /// Bytes of all nodes.
    pub fn bytes(&self) -> u64 {
        32 * self.nodes.len() as u64
    }

    /// All nodes as stored, eight words each, children before parents.
    pub fn nodes(&self) -> &[[u32; 8]] {
        &self.nodes
    }

    /// Whether the eight words of a node describe a leaf.
    pub(crate) fn is_leaf(node: &[u32; 8]) -> bool {
        node[0] & LEAF != 0
    }

    /// Decodes the node with this index.
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

/// Builds an SVDAG: a hash map from a node's content to its index ensures that equal nodes are stored once.
#[derive(Debug)]
pub(crate) struct DagBuilder {
    nodes: Vec<[u32; 8]>,
    numbers: FxHashMap<[u32; 8], u32>,
    /// From the occupancy field of a cell that is stored down to voxels to its node. A cache: most fields occur again.
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

    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Index of a node with this content, added if it is new.
    ///
    /// # Panics
    /// When there are 2³¹ nodes (64 GiB).
    fn number(&mut self, node: [u32; 8]) -> u32 {
        *self.numbers.entry(node).or_insert_with(|| {
            let number = self.nodes.len() as u32;
            assert!(number < LEAF, "an SVDAG has at most 2³¹ nodes (64 GiB)");
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

    /// Adds the tree over `cells`, which has `levels` levels above its cells and whose first cell has the Morton index `base`. Returns its
    /// root.
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

    /// Adds all nodes of another graph. Returns, for each node of `other`, its index in this graph.
    pub(crate) fn absorb(&mut self, other: &Dag) -> Vec<u32> {
        let mut here = Vec::with_capacity(other.nodes.len());
        here.extend([EMPTY, SOLID]);
        for node in &other.nodes[2..] {
            // Children are stored before parents, so their indices here are known already.
            let node = if Dag::is_leaf(node) { *node } else { node.map(|child| here[child as usize]) };
            here.push(self.number(node));
        }
        here
    }
}

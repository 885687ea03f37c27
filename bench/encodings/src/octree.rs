//! A sparse voxel octree for each box (§3.2.1): nodes of 2 bytes, of which 12 bits point to the first of eight children.
//!
//! ```text
//! node      bits 0 to 11   offset of the eight children in units of 8 bytes from the box's first unit; 0xFFF: a leaf
//!           bit 12         a leaf is solid
//!           bit 13         the offset is that of an occupancy field (one unit) instead of children
//! ```
//! A pointer of 12 bits reaches all 585 groups of children that a box of 16³ can have, since a group takes two units. In larger boxes nodes
//! have 4 bytes and pointers 28 bits. The root itself is not stored: a box's record points to the root's children, or is [`SOLID`]. The
//! paper has occupancy fields only in nodes of 32 bytes; those of octrees here are the obvious counterpart.

use crate::subdivision::{Cell, Subdivision};
use crate::tree::{Node, Tree, is_solid, octants, parts};

/// Root of a box whose cube is full.
pub(crate) const SOLID: u32 = u32::MAX;

/// The octrees of all boxes; the module documentation describes their nodes.
#[derive(Clone, Debug)]
pub struct Octrees {
    units: Vec<u64>,
    is_wide: bool,
}

/// The octree of one box.
pub(crate) struct Octree<'a> {
    units: &'a [u64],
    is_wide: bool,
}

impl Octrees {
    /// Builds the octrees of all boxes. Returns them and the root of each box.
    ///
    /// # Panics
    /// When they take 32 GiB: roots are 32-bit offsets in units of 8 bytes.
    pub fn new(boxes: &Subdivision, with_fields: bool) -> (Self, Vec<u32>) {
        let is_wide = boxes.side().is_none_or(|side| side > 16);
        let mut writer = Writer { units: Vec::new(), base: 0, is_wide, with_fields };
        let roots = (0..boxes.boxes().len())
            .map(|i| {
                let (cells, levels) = (boxes.cells(i), boxes.levels(i));
                if is_solid(cells, levels) {
                    return SOLID;
                }
                writer.base = writer.units.len();
                assert!(writer.base < SOLID as usize, "octrees may take at most 32 GiB");
                writer.children(cells, levels, 0);
                writer.base as u32
            })
            .collect();
        (Self { units: writer.units, is_wide }, roots)
    }

    /// Bytes of all nodes and fields.
    pub fn bytes(&self) -> u64 {
        8 * self.units.len() as u64
    }

    /// Bytes of each box's tree, given the roots of all boxes in order.
    pub(crate) fn bytes_of_boxes(&self, roots: impl DoubleEndedIterator<Item = u32>) -> Vec<u64> {
        // A tree ends where the next one begins.
        let mut end = self.units.len() as u64;
        let own = |root: u32| match root {
            SOLID => 0,
            _ => 8 * (std::mem::replace(&mut end, root.into()) - u64::from(root)),
        };
        let mut bytes: Vec<u64> = roots.rev().map(own).collect();
        bytes.reverse();
        bytes
    }

    /// The octree of the box with this root, and its root node.
    pub(crate) fn tree(&self, root: u32) -> (Octree<'_>, Node) {
        match root {
            SOLID => (Octree { units: &[], is_wide: self.is_wide }, Node::Solid),
            _ => (Octree { units: &self.units[root as usize..], is_wide: self.is_wide }, Node::Inner(0)),
        }
    }
}

const fn bits(is_wide: bool) -> u32 {
    if is_wide { 28 } else { 12 }
}

struct Writer {
    units: Vec<u64>,
    base: usize,
    is_wide: bool,
    with_fields: bool,
}

impl Writer {
    fn leaf(&self, solid: bool) -> u64 {
        let bits = bits(self.is_wide);
        ((1 << bits) - 1) | u64::from(solid) << bits
    }

    /// Offset of the next group or field, in units from the box's first one.
    ///
    /// # Panics
    /// When the offset does not fit a pointer.
    fn next(&self) -> u64 {
        let pointer = (self.units.len() - self.base) as u64;
        assert!(pointer < (1 << bits(self.is_wide)) - 1, "a box's octree is longer than its pointers reach");
        pointer
    }

    /// Appends an empty group of eight nodes; returns the index of its first unit.
    fn group(&mut self) -> usize {
        let at = self.units.len();
        self.units.resize(at + if self.is_wide { 4 } else { 2 }, 0);
        at
    }

    fn put(&mut self, group: usize, c: usize, node: u64) {
        let each = if self.is_wide { 2 } else { 4 };
        self.units[group + c / each] |= node << (64 / each * (c % each));
    }

    /// Writes the children of a node `levels` above its cells.
    fn children(&mut self, cells: &[Cell], levels: u32, base: u64) {
        let group = self.group();
        for (c, (part, start)) in parts(cells, levels, base).into_iter().enumerate() {
            let node = if part.is_empty() {
                self.leaf(false)
            } else if is_solid(part, levels - 1) {
                self.leaf(true)
            } else if levels > 1 {
                let next = self.next();
                self.children(part, levels - 1, start);
                next
            } else if self.with_fields {
                let next = self.next() | 2 << bits(self.is_wide);
                self.units.push(part[0].1);
                next
            } else {
                let next = self.next();
                self.voxels(part[0].1);
                next
            };
            self.put(group, c, node);
        }
    }

    /// Writes the octants of a cell of 4³ voxels, and their voxels.
    fn voxels(&mut self, field: u64) {
        let group = self.group();
        for (c, octant) in octants(field).into_iter().enumerate() {
            let node = match octant {
                0 | 255 => self.leaf(octant != 0),
                _ => {
                    let next = self.next();
                    let voxels = self.group();
                    (0..8).for_each(|v| self.put(voxels, v, self.leaf(octant >> v & 1 != 0)));
                    next
                }
            };
            self.put(group, c, node);
        }
    }
}

impl Tree for Octree<'_> {
    #[inline]
    fn child(&self, inner: u32, c: u32) -> Node {
        let bits = bits(self.is_wide);
        let node = if self.is_wide {
            self.units[inner as usize + (c / 2) as usize] >> (32 * (c % 2)) & 0xFFFF_FFFF
        } else {
            self.units[inner as usize + (c / 4) as usize] >> (16 * (c % 4)) & 0xFFFF
        };
        let pointer = (node & ((1 << bits) - 1)) as u32;
        match (pointer == (1 << bits) - 1, node >> bits) {
            (true, 0) => Node::Empty,
            (true, _) => Node::Solid,
            (_, 0) => Node::Inner(pointer),
            _ => Node::Field(self.units[pointer as usize]),
        }
    }
}

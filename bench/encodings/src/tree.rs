//! The interface that octrees and SVDAGs share: a node has eight children, each of which is a node, solid, empty, or an occupancy field.

use crate::subdivision::Cell;

/// A decoded node of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Node {
    /// Has no voxel.
    Empty,
    /// Has all voxels.
    Solid,
    /// A cell of 4³ with this occupancy field.
    Field(u64),
    /// A node with children, by an index that its tree understands.
    Inner(u32),
}

/// A tree that can be descended. Child c is the octant at (c & 1, c >> 1 & 1, c >> 2).
pub(crate) trait Tree {
    fn child(&self, inner: u32, c: u32) -> Node;
}

/// Index x + 4y + 16z in the occupancy field of voxel `v` of octant `c`.
fn voxel_of_octant(c: u32, v: u32) -> u32 {
    let along = |a: u32| 2 * (c >> a & 1) + (v >> a & 1);
    along(0) + 4 * along(1) + 16 * along(2)
}

/// Splits an occupancy field into its eight octants of 2³ voxels; bit v of an octant is its voxel v.
pub(crate) fn octants(field: u64) -> [u8; 8] {
    let octant = |c: u32| (0..8).fold(0, |mask, v| mask | ((field >> voxel_of_octant(c, v) & 1) as u8) << v);
    [0, 1, 2, 3, 4, 5, 6, 7].map(octant)
}

/// Splits the cells of a node among its eight children; each comes with the Morton index of its first cell. The node is `levels` above the
/// cells, and `base` is the Morton index of its first cell.
pub(crate) fn parts(cells: &[Cell], levels: u32, base: u64) -> [(&[Cell], u64); 8] {
    let size = 1u64 << (3 * (levels - 1));
    let mut rest = cells;
    [0, 1, 2, 3, 4, 5, 6, 7].map(|c| {
        let start = base + c * size;
        let (part, after) = rest.split_at(rest.partition_point(|cell| cell.0 < start + size));
        rest = after;
        (part, start)
    })
}

/// Whether a cube that is `levels` above its cells has all its voxels.
pub(crate) fn is_solid(cells: &[Cell], levels: u32) -> bool {
    cells.len() as u64 == 1 << (3 * levels) && cells.iter().all(|c| c.1 == u64::MAX)
}

/// Calls `visit` for each nonempty cell of 4³ voxels under a node, with the cell's lowest voxel and its occupancy field. `low` is the lowest
/// voxel of the node's cube, `side` its side in voxels.
pub(crate) fn for_each_cell(
    tree: &impl Tree,
    node: Node,
    side: u32,
    low: [u32; 3],
    visit: &mut impl FnMut([u32; 3], u64),
) {
    match node {
        Node::Empty => {}
        Node::Field(field) => visit(low, field),
        Node::Solid if side > 4 => {
            for c in 0..8 {
                for_each_cell(tree, node, side / 2, corner(low, c, side / 2), visit);
            }
        }
        Node::Solid => visit(low, u64::MAX),
        Node::Inner(inner) if side > 4 => {
            for c in 0..8 {
                for_each_cell(tree, tree.child(inner, c), side / 2, corner(low, c, side / 2), visit);
            }
        }
        // A cell that is stored down to voxels: assemble its occupancy field.
        Node::Inner(inner) => {
            let mut field = 0;
            for c in 0..8 {
                let octant = tree.child(inner, c);
                for v in 0..8 {
                    let voxel = match octant {
                        Node::Inner(octant) => tree.child(octant, v),
                        other => other,
                    };
                    field |= u64::from(voxel == Node::Solid) << voxel_of_octant(c, v);
                }
            }
            visit(low, field);
        }
    }
}

/// Lowest voxel of child `c`, whose side is `half`, of the cube at `low`.
fn corner(low: [u32; 3], c: u32, half: u32) -> [u32; 3] {
    [0, 1, 2].map(|a| low[a] + half * (c >> a & 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octants_part_a_field() {
        assert_eq!(octants(u64::MAX), [255; 8]);
        // Voxel (3, 2, 1): octant 0b011, within it (1, 0, 1).
        assert_eq!(octants(1 << (3 + 4 * 2 + 16)), [0, 0, 0, 1 << 0b101, 0, 0, 0, 0]);
        let mut all: Vec<u32> = (0..8).flat_map(|c| (0..8).map(move |v| voxel_of_octant(c, v))).collect();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..64));
    }

    #[test]
    fn parts_are_the_children_in_order() {
        let cells: Vec<Cell> = [8, 9, 15, 23, 63].map(|c| (c, 1)).to_vec();
        let parts = parts(&cells, 2, 0);
        assert_eq!(parts.map(|(part, _)| part.len()), [0, 3, 1, 0, 0, 0, 0, 1]);
        assert_eq!(parts[2], (&[(23, 1)][..], 16));
        assert!(!is_solid(&cells, 1) && is_solid(&[(5, u64::MAX)], 0) && !is_solid(&[(5, 7)], 0));
    }
}

//! Packs trees over lights, by which shaders choose among emissive surfaces, or among lamps.

use pumice_transport::Lights;
use pumice_transport::light_tree::LightTree;

use crate::layout::{self, Cone, LightNode};

/// The nodes of a tree.
pub(super) fn light_nodes(tree: &LightTree) -> Vec<LightNode> {
    tree.nodes().iter().map(|n| LightNode { lo: n.lo, hi: n.hi, power: n.power }).collect()
}

/// The cones of a tree's nodes; empty where all emitters shine to all sides.
fn cones(tree: &LightTree) -> Vec<Cone> {
    let cone = |c: &pumice_transport::light_tree::Cone| Cone {
        axis: c.axis,
        cos_spread: c.cos_spread,
        cos_reach: c.cos_reach,
    };
    tree.cones().iter().map(cone).collect()
}

/// The record of a tree, with its nodes and cones at these addresses.
pub(super) fn light_tree(tree: &LightTree, [nodes, cones]: [u64; 2]) -> layout::LightTree {
    layout::LightTree {
        nodes,
        cones,
        middle: tree.middle.to_array(),
        scale: tree.scale,
        count: tree.len(),
        reserved: 0,
    }
}

/// The nodes and cones of the tree over the lamps; both empty where there are few lamps.
pub fn lamp_tree(lights: &Lights) -> (Vec<LightNode>, Vec<Cone>) {
    lights.lamp_tree().map_or_else(Default::default, |(tree, _)| (light_nodes(tree), cones(tree)))
}

//! Packs emissive surfaces, which shaders sample as lights.

use pumice_transport::Emitters;

use super::light_tree::{light_nodes, light_tree};
use crate::layout::{self, EmissiveInstance, EmissiveTriangle, Emitter, LightNode};

/// Tables of emitters, in the order of the addresses in their record.
#[derive(Clone, Debug, Default)]
pub struct PackedEmitters {
    /// Nodes of the light tree.
    pub nodes: Vec<LightNode>,
    /// Emitters in the order of the tree's leaves.
    pub emitters: Vec<Emitter>,
    /// Face codes of boxes, two a word.
    pub faces: Vec<u32>,
    /// Triangles of emissive meshes.
    pub triangles: Vec<EmissiveTriangle>,
    /// Numbers of emitters, sorted by key.
    pub by_key: Vec<u32>,
    /// Instances and meshes that emit.
    pub emissive_instances: Vec<EmissiveInstance>,
    /// Index into `emissive_instances` by instance.
    pub emissive_instance_of: Vec<u32>,
    record: layout::Emitters,
}

impl PackedEmitters {
    /// Packs the emitters of a scene.
    pub fn new(of: &Emitters) -> Self {
        let pairs = |a: u16, b: u16| u32::from(a) | u32::from(b) << 16;
        let emitter = |e: &pumice_transport::emitters::Emitter| Emitter {
            emissive_instance: e.emissive_instance,
            label: e.label,
            origin: e.origin,
            first: e.first,
            ends: [0, 1, 2].map(|i| pairs(e.ends[2 * i], e.ends[2 * i + 1])),
            planes: e.planes,
        };
        let place = |p: &pumice_transport::emitters::EmissiveInstance| EmissiveInstance {
            world_from_index: p.placement.world_from_index.matrix3.to_cols_array_2d(),
            units_per_world: p.units_per_world,
            areas: p.areas,
            instance: p.instance,
            is_mesh: u32::from(p.is_mesh),
            keys: p.keys,
            reserved: 0,
        };
        let triangle = |t: &pumice_transport::emitters::EmissiveTriangle| EmissiveTriangle {
            corners: t.corners,
            area: t.area,
        };
        let tree = of.tree();
        Self {
            nodes: light_nodes(tree),
            emitters: of.emitters().iter().map(emitter).collect(),
            faces: of.faces().chunks(2).map(|f| pairs(f[0], f.get(1).copied().unwrap_or(0))).collect(),
            triangles: of.triangles().iter().map(triangle).collect(),
            by_key: of.by_key().to_vec(),
            emissive_instances: of.emissive_instances().iter().map(place).collect(),
            emissive_instance_of: of.emissive_instance_of().to_vec(),
            record: layout::Emitters {
                tree: light_tree(tree, [0, 0]),
                radius: of.radius(),
                emissive_instance_of_count: of.emissive_instance_of().len() as u32,
                ..layout::Emitters::default()
            },
        }
    }

    /// The tables as bytes, each with a name for error messages.
    pub fn parts(&self) -> [(&'static str, &[u8]); 7] {
        [
            ("the tree of lights", bytemuck::cast_slice(&self.nodes)),
            ("boxes and triangles that shine", bytemuck::cast_slice(&self.emitters)),
            ("faces that shine", bytemuck::cast_slice(&self.faces)),
            ("triangles that shine", bytemuck::cast_slice(&self.triangles)),
            ("the order of what shines", bytemuck::cast_slice(&self.by_key)),
            ("instances that shine", bytemuck::cast_slice(&self.emissive_instances)),
            ("which instances shine", bytemuck::cast_slice(&self.emissive_instance_of)),
        ]
    }

    /// The record, with the tables at these addresses.
    pub fn record(&self, at: [u64; 7]) -> layout::Emitters {
        let [nodes, emitters, faces, triangles, by_key, places, place_of] = at;
        layout::Emitters {
            tree: layout::LightTree { nodes, ..self.record.tree },
            emitters,
            faces,
            triangles,
            by_key,
            emissive_instances: places,
            emissive_instance_of: place_of,
            ..self.record
        }
    }
}

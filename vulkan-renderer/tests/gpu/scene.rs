//! Scenes in a device's memory, packed with `pumice_vulkan::pack` as a renderer does.

use glam::DAffine3;
use pumice_core::MeshData;
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_transport::geometry::{LodChoice, Placement, mesh_placement};
use pumice_transport::{BoxBounds, Bvh};
use pumice_vulkan::device::Acceleration;
use pumice_vulkan::layout::{Instance, InstanceTree, SceneHeader};
use pumice_vulkan::pack::{
    PackedBoxes, PackedBricks, PackedMesh, PackedNodes, instance_tree, place, place_mesh,
};

use super::{Buffer, Gpu};

/// The form of volumes that rays traverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(dead_code, reason = "not of all tests")]
pub(crate) enum Form {
    /// Boxes, found through a hierarchy.
    Boxes,
    /// Bricks, where they can be built, as in a renderer.
    Bricks,
}

/// A scene on the device; its header is written last.
pub(crate) struct Uploaded {
    pub(crate) buffers: Vec<Buffer>,
    pub(crate) accelerations: Vec<Acceleration>,
    pub(crate) instances: Vec<Instance>,
    pub(crate) tree: InstanceTree,
}

impl Uploaded {
    pub(crate) fn new(gpu: &Gpu, traced: &[TracedInstance], form: Form) -> Self {
        let (buffers, accelerations, instances) = (Vec::new(), Vec::new(), Vec::new());
        let mut uploaded = Self { buffers, accelerations, instances, tree: InstanceTree::default() };
        for t in traced {
            let placement = Placement::new(t.world_from_index).expect("a place");
            let nodes = PackedNodes::new(&t.volume, &t.visible);
            let boxes =
                PackedBoxes::new(&t.volume, &nodes, &t.visible, t.lod == LodChoice::Voxels).expect("packed");
            let mut record = boxes.record();
            place(&mut record, &placement, t.lod);
            record.chunks = uploaded.put(gpu, &boxes.chunks);
            record.boxes = uploaded.put(gpu, &boxes.boxes);
            record.labels = uploaded.put(gpu, &boxes.labels);
            record.nodes = uploaded.put(gpu, &nodes.packed(&t.volume).expect("packed"));
            record.leaves =
                uploaded.put(gpu, &PackedNodes::leaves(t.volume.leaves().iter()).expect("packed"));
            let bricks = match form {
                Form::Boxes => None,
                Form::Bricks => PackedBricks::new(&t.volume, &boxes, &t.visible, t.lod).expect("packed"),
            };
            let numbered = boxes.numbered().expect("numbered");
            let Some(bricks) = bricks else {
                uploaded.push(gpu, record, &boxes.aabbs().expect("bounds"), numbered);
                continue;
            };
            record.blocks = uploaded.put(gpu, &bricks.blocks);
            record.bricks = uploaded.put(gpu, &bricks.bricks);
            record.brick_fields = uploaded.put(gpu, &bricks.fields);
            record.brick_parts = uploaded.put(gpu, &bricks.parts);
            record.brick_corners = uploaded.put(gpu, &bricks.corners);
            // (Shaders that traverse bricks as a grid search boxes for queries about one label alone, which no renderer makes.)
            uploaded.push(gpu, record, &bricks.aabbs(boxes.around_all()).expect("bounds"), numbered);
        }
        uploaded
    }

    /// Gives voxels smooth normals.
    pub(crate) fn shade_smooth(&mut self, gpu: &Gpu, traced: &[TracedInstance]) {
        for (i, t) in traced.iter().enumerate() {
            let nodes = PackedNodes::new(&t.volume, &t.visible);
            let boxes =
                PackedBoxes::new(&t.volume, &nodes, &t.visible, t.lod == LodChoice::Voxels).expect("packed");
            self.instances[i].neighbors = self.put(gpu, &boxes.neighbors().expect("packed"));
        }
    }

    /// Adds the next mesh of the scene; meshes follow all volumes.
    pub(crate) fn add_mesh(&mut self, gpu: &Gpu, mesh: &MeshData, world_from_mesh: DAffine3) {
        let packed = PackedMesh::new(0, mesh).expect("packed");
        let mut record = packed.record();
        let placement = mesh_placement(0, packed.grid.mesh_from_grid, world_from_mesh).expect("a place");
        place_mesh(&mut record, &placement);
        record.nodes = self.put(gpu, &packed.grid.corners);
        record.boxes = self.put(gpu, mesh.triangles());
        record.labels = self.put(gpu, &packed.materials);
        record.leaves = if mesh.is_smooth() { self.put(gpu, mesh.normals()) } else { 0 };
        self.push(gpu, record, &packed.aabbs().expect("bounds"), packed.bounds.clone());
    }

    fn push(&mut self, gpu: &Gpu, mut record: Instance, aabbs: &[[f32; 6]], numbered: Vec<(BoxBounds, u32)>) {
        let number = self.instances.len() as u32;
        if gpu.device().backend().uses_hardware_hierarchy() {
            if !aabbs.is_empty() {
                let (count, device) = (aabbs.len() as u32, gpu.device());
                let built = device.acceleration(number, count, |i| aabbs[i as usize]).expect("built");
                record.acceleration = built.address();
                self.accelerations.push(built);
            }
        } else {
            let bvh = Bvh::build(numbered).expect("a hierarchy");
            record.bvh_nodes = self.put(gpu, bvh.node_bytes());
            record.bvh_items = self.put(gpu, bvh.items());
        }
        self.instances.push(record);
    }

    pub(crate) fn put<T: bytemuck::Pod>(&mut self, gpu: &Gpu, values: &[T]) -> u64 {
        self.buffers.push(gpu.buffer_of(values));
        self.buffers[self.buffers.len() - 1].address
    }

    /// Adds the hierarchy over all instances that a scene on the CPU has.
    #[allow(dead_code, reason = "not of all tests")]
    pub(crate) fn add_tree(&mut self, gpu: &Gpu, tracer: &SceneTracer) {
        if let Some(tree) = tracer.tree() {
            let nodes = self.put(gpu, tree.bvh().node_bytes());
            let items = self.put(gpu, tree.bvh().items());
            self.tree = instance_tree(tree, [nodes, items]);
        }
    }

    /// Writes the header with the other fields as given, and returns its address.
    pub(crate) fn header(&mut self, gpu: &Gpu, mut header: SceneHeader) -> u64 {
        header.instances = self.put(gpu, &self.instances.clone());
        header.instance_count = self.instances.len() as u32;
        header.instance_tree = self.tree;
        self.put(gpu, &[header])
    }
}

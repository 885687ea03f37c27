//! Scenes in a device's memory, through `pumice_vulkan::pack` as a renderer would.

use pumice_cpu::traverse::{LodChoice, Placement, TracedInstance};
use pumice_render::Bvh;
use pumice_vulkan::device::Acceleration;
use pumice_vulkan::layout::{Instance, SceneHeader};
use pumice_vulkan::pack::{PackedBoxes, PackedNodes, place};

use super::{Buffer, Gpu};

/// What lies on the device; the header is written last.
pub(crate) struct Uploaded {
    pub(crate) buffers: Vec<Buffer>,
    pub(crate) accelerations: Vec<Acceleration>,
    pub(crate) instances: Vec<Instance>,
}

impl Uploaded {
    pub(crate) fn new(gpu: &Gpu, traced: &[TracedInstance]) -> Self {
        let mut uploaded = Self { buffers: Vec::new(), accelerations: Vec::new(), instances: Vec::new() };
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
            record.nodes = uploaded.put(gpu, &nodes.bytes(&t.volume));
            record.leaves = uploaded.put(gpu, &PackedNodes::leaves(&t.volume));
            let number = uploaded.instances.len() as u32;
            if gpu.device().backend().uses_hardware_hierarchy() {
                let aabbs = boxes.aabbs();
                if !aabbs.is_empty() {
                    let (count, device) = (aabbs.len() as u32, gpu.device());
                    let built = device.acceleration(number, count, |i| aabbs[i as usize]).expect("built");
                    record.acceleration = built.address();
                    uploaded.accelerations.push(built);
                }
            } else {
                let bvh = Bvh::build(boxes.numbered()).expect("a hierarchy");
                record.bvh_nodes = uploaded.put(gpu, bvh.node_bytes());
                record.bvh_items = uploaded.put(gpu, bvh.items());
            }
            uploaded.instances.push(record);
        }
        uploaded
    }

    pub(crate) fn put<T: bytemuck::Pod>(&mut self, gpu: &Gpu, values: &[T]) -> u64 {
        self.buffers.push(gpu.buffer_of(values));
        self.buffers[self.buffers.len() - 1].address
    }

    /// Address of a header whose other fields are as given.
    pub(crate) fn header(&mut self, gpu: &Gpu, mut header: SceneHeader) -> u64 {
        header.instances = self.put(gpu, &self.instances.clone());
        header.instance_count = self.instances.len() as u32;
        self.put(gpu, &[header])
    }
}

//! Packs the boxes that are drawn, in Morton order for the hierarchies, and the record of their instance.

use pumice_core::reserve::{collected, reserved};
use pumice_core::{BoxRecord, CompressedVolume, NoMemory, morton};
use pumice_transport::geometry::{Detail, LodChoice, Neighbors, Placement, visible_boxes};
use pumice_transport::{BoxBounds, RenderError};

use super::PackedNodes;
use crate::layout::{Chunk, Instance, LOD_BY_DISTANCE};

/// Boxes of one instance. Its arrays are parallel, and a box's number is its index in them.
#[derive(Debug, Default)]
pub struct PackedBoxes {
    /// Chunks with drawn boxes, in Morton order.
    pub chunks: Vec<Chunk>,
    /// Box records. A node's number counts from the chunk's base among the packed nodes.
    pub boxes: Vec<u64>,
    /// Dense label of each box.
    pub labels: Vec<u32>,
    /// The number of each box in the volume.
    pub items: Vec<u32>,
    /// Bounds over which hierarchies are built: the tight bounds of the voxels, or the box's own where it may be drawn at another level of
    /// detail.
    pub bounds: Vec<BoxBounds>,
    all: Option<BoxBounds>,
    dims: [u32; 3],
}

/// What the memory is for, in errors.
const BOXES: &str = "a list of the boxes for the device";

/// Added to the margin of hardware's boxes, in voxels. Moving a ray into index space in f64 loses less than this while its origin is within
/// 2⁴⁰ voxels. The BVH of compute shaders widens its boxes by the ray's own error instead, which hardware cannot do.
const FAR_MARGIN: f32 = 1.0 / 256.0;

impl PackedBoxes {
    /// Packs the boxes of visible labels. Bounds are those of the voxels if `tight`, otherwise those of the boxes.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the limit: more than 2³² boxes, or nodes too far from each other for a box record;
    /// [`RenderError::Memory`] where there is too little.
    pub fn new(
        volume: &CompressedVolume,
        nodes: &PackedNodes,
        visible: &[bool],
        tight: bool,
    ) -> Result<Self, RenderError> {
        if volume.boxes().len() as u64 >> 32 != 0 {
            let count = volume.boxes().len();
            let what = format!("{count} boxes are more than the limit of 2^32 of one instance");
            return Err(RenderError::Scene(what));
        }
        let mut drawn = visible_boxes(volume, visible, tight)?;
        drawn.sort_unstable_by_key(|&(b, item)| (morton::encode(b.lo.map(|v| v / 4)), b, item));
        let mut packed = Self {
            boxes: reserved(drawn.len(), BOXES)?,
            labels: reserved(drawn.len(), BOXES)?,
            items: reserved(drawn.len(), BOXES)?,
            bounds: reserved(drawn.len(), BOXES)?,
            dims: volume.info().dims,
            ..Self::default()
        };
        let mut chunk = usize::MAX;
        let mut least = 0;
        for &(bounds, index) in &drawn {
            let in_volume = volume.chunks().partition_point(|c| c.first_box <= u64::from(index)) - 1;
            if in_volume != chunk {
                chunk = in_volume;
                let source = &volume.chunks()[chunk];
                // The lowest drawn node of the chunk; the chunk's nodes are numbered from it.
                least = drawn[packed.boxes.len()..]
                    .iter()
                    .map(|&(_, index)| index as usize)
                    .take_while(|&i| {
                        volume.chunks().partition_point(|c| c.first_box <= i as u64) - 1 == chunk
                    })
                    .map(|i| nodes.place(source.node_base + u64::from(volume.boxes()[i].node())))
                    .min()
                    .unwrap_or(0);
                packed.chunks.push(Chunk {
                    node_base: least,
                    leaves: PackedNodes::leaves_before(volume.leaves()[..chunk].iter()),
                    origin: source.origin,
                    first_box: packed.boxes.len() as u32,
                });
            }
            let record = volume.boxes()[index as usize];
            let node = nodes.place(volume.chunks()[chunk].node_base + u64::from(record.node())) - least;
            let node = u32::try_from(node).map_err(|_| {
                let what = format!("chunk at {:?}: expected nodes less than 2^32 words apart", bounds.lo);
                RenderError::Scene(format!("{what}, got {node}"))
            })?;
            let record = BoxRecord::new(record.cell(), record.extent(), node);
            packed.boxes.push(record.0);
            packed.labels.push(volume.label_of_box(index as usize));
            packed.items.push(index);
            packed.bounds.push(bounds);
            packed.all = Some(packed.all.map_or(bounds, |all| all.union(bounds)));
        }
        Ok(packed)
    }

    /// Bounds and number of each box, as `pumice_transport::Bvh::build` takes them.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn numbered(&self) -> Result<Vec<(BoxBounds, u32)>, NoMemory> {
        let mut numbered = reserved(self.bounds.len(), BOXES)?;
        numbered.extend(self.bounds.iter().zip(0..).map(|(&b, i)| (b, i)));
        Ok(numbered)
    }

    /// For each box, the near boxes of the same label: ends of lists, then the lists. Smooth voxel normals need them.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn neighbors(&self) -> Result<Vec<u32>, NoMemory> {
        let drawn = self.bounds.iter().zip(&self.labels).zip(0..).map(|((&b, &label), i)| (i, label, b));
        let near = Neighbors::new(self.boxes.len(), &collected(self.boxes.len(), drawn, BOXES)?)?;
        let (ends, boxes) = (near.end_offsets(), near.boxes());
        collected(ends.len() + boxes.len(), ends.iter().chain(boxes).copied(), BOXES)
    }

    /// Bounds for hardware's hierarchies, in index space: lowest and highest corner. They are wider than the boxes by more than the
    /// rounding errors of rays and of the hardware's own test.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn aabbs(&self) -> Result<Vec<[f32; 6]>, NoMemory> {
        aabbs_of(self.bounds.iter().copied(), self.around_all())
    }

    /// Bounds of all boxes; empty bounds where there is none.
    pub fn around_all(&self) -> BoxBounds {
        self.all.unwrap_or(BoxBounds { lo: [0; 3], hi: [0; 3] })
    }

    /// The instance's record; addresses, materials, placement and level of detail are 0.
    pub fn record(&self) -> Instance {
        let all = self.around_all();
        Instance {
            lo: all.lo,
            hi: all.hi,
            dims: self.dims,
            chunk_count: self.chunks.len() as u32,
            pad: all.pad(),
            box_count: self.boxes.len() as u32,
            ..Instance::default()
        }
    }
}

/// Removes the voxels from packed boxes whose `labels` are not `visible`, where these are drawn by voxels or cells. Rays then meet such a box,
/// find nothing and go on.
///
/// # Errors
/// [`RenderError::Scene`] where the nodes are too far from each other for a box record.
pub(crate) fn take_voxels(
    chunks: &[Chunk],
    boxes: &mut [u64],
    labels: &[u32],
    nodes: &PackedNodes,
    visible: &[bool],
) -> Result<(), RenderError> {
    for (chunk, next) in chunks.iter().zip(chunks.iter().skip(1).map(Some).chain([None])) {
        let range = chunk.first_box as usize..next.map_or(boxes.len(), |n| n.first_box as usize);
        let is_visible = |label: u32| visible.get(label as usize).copied().unwrap_or(false);
        for i in range.filter(|&i| !is_visible(labels[i])) {
            let node = u32::try_from(nodes.empty() - chunk.node_base).map_err(|_| {
                let what = format!("chunk at {:?}: nodes are too far apart for a box record", chunk.origin);
                RenderError::Scene(what)
            })?;
            let record = BoxRecord(boxes[i]);
            boxes[i] = BoxRecord::new(record.cell(), record.extent(), node).0;
        }
    }
    Ok(())
}

/// Bounds for hardware's hierarchies of boxes that all lie within `all`.
pub(super) fn aabbs_of(
    bounds: impl ExactSizeIterator<Item = BoxBounds>,
    all: BoxBounds,
) -> Result<Vec<[f32; 6]>, NoMemory> {
    let margin = 2.0 * all.pad() + FAR_MARGIN;
    let corners = |b: BoxBounds| {
        let (lo, hi) = (b.lo.map(|v| v as f32 - margin), b.hi.map(|v| v as f32 + margin));
        [lo[0], lo[1], lo[2], hi[0], hi[1], hi[2]]
    };
    let mut aabbs = reserved(bounds.len(), BOXES)?;
    aabbs.extend(bounds.map(corners));
    Ok(aabbs)
}

/// Writes a placement and a level of detail into the record. The boxes stay as they are.
pub fn place(record: &mut Instance, placement: &Placement, lod: LodChoice) {
    record.translation = placement.world_from_index.translation.to_array();
    record.adjugate = placement.adjugate.map(|row| row.to_array());
    record.determinant = placement.determinant;
    record.normals = [0, 1, 2].map(|a| placement.normal(a, true).to_array());
    match lod.placed(&placement.world_from_index) {
        Detail::Same(level) => record.lod = level as u32,
        Detail::ByDistance(by) => {
            record.lod = LOD_BY_DISTANCE;
            record.eye_in_index = by.eye_in_index;
            record.edges_from_index = by.edges_from_index;
            record.coarser_from_squared = [by.cells_from_squared, by.boxes_from_squared];
        }
    }
}

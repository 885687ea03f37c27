//! Collects finished chunks as a volume in memory.

use crate::chunk_boxes::ChunkBoxes;
use crate::chunk_nodes::ChunkNodes;
use crate::finish::{Budget, ChunkSink};
use crate::layers::Layers;
use crate::reserve::make_room;
use crate::{BoxRecord, Chunk, CompressedVolume, Error, Job, Result, VolumeInfo};

/// A volume that grows.
pub(crate) struct VolumeSink {
    volume: CompressedVolume,
    boxes: Vec<BoxRecord>,
    nodes: Vec<u16>,
    /// Bytes of boxes and nodes so far; more than are held where the limit does not suffice.
    bytes: u64,
    limit_bytes: Option<u64>,
}

impl VolumeSink {
    /// An empty volume, which may take half of the limit.
    pub(crate) fn new(info: VolumeInfo, limit_bytes: Option<u64>) -> Self {
        let volume = CompressedVolume::empty(info);
        Self { volume, boxes: Vec::new(), nodes: Vec::new(), bytes: 0, limit_bytes }
    }

    /// The volume, still without labels.
    ///
    /// # Errors
    /// [`Error::Limit`] with the limit that would suffice, where this one does not.
    pub(crate) fn into_volume(mut self) -> Result<CompressedVolume> {
        if let Some(limit) = self.limit_bytes.filter(|limit| self.bytes > limit / 2) {
            return Err(Error::Limit { what: "bytes of memory".into(), limit, got: 2 * self.bytes });
        }
        self.volume.boxes = self.boxes.into();
        self.volume.nodes = self.nodes.into();
        self.volume.runs.shrink_to_fit();
        self.volume.chunks.shrink_to_fit();
        self.volume.leaves.shrink_to_fit();
        Ok(self.volume)
    }
}

impl ChunkSink for VolumeSink {
    fn layers(&mut self, _: &ChunkBoxes<'_>, _: &Layers<'_>, _: &Job) -> Result<()> {
        Ok(())
    }

    /// Takes the boxes of a chunk. A volume in memory has one frame.
    fn chunk(&mut self, frames: &[ChunkBoxes<'_>], budget: &Budget, job: &Job) -> Result<()> {
        let chunk = ChunkNodes::new(frames, budget, job)?;
        let Self { volume, boxes, nodes, bytes, limit_bytes } = self;
        let node_base = nodes.len() as u64;
        *bytes += chunk.leaves.bytes();
        let mut writer = chunk.writer()?;
        for frame in frames {
            volume.chunks.push(Chunk {
                origin: frame.cell.map(|c| 4 * c),
                first_box: boxes.len() as u64,
                first_run: volume.runs.len() as u64,
                node_base,
            });
            *bytes += size_of_val(&frame.runs[..]) as u64;
            make_room(&mut volume.runs, frame.runs.len(), "the boxes of the volume")?;
            volume.runs.extend_from_slice(&frame.runs);
            writer.frame(frame, job, |batch| {
                *bytes += (size_of_val(batch.records) + size_of_val(batch.nodes)) as u64;
                // Beyond the limit, boxes and nodes are only counted, so that the error can say what would suffice.
                if limit_bytes.is_none_or(|limit| *bytes <= limit / 2) {
                    make_room(boxes, batch.records.len(), "the boxes of the volume")?;
                    boxes.extend_from_slice(batch.records);
                    make_room(nodes, batch.nodes.len(), "the nodes of the volume")?;
                    nodes.extend_from_slice(batch.nodes);
                }
                Ok(())
            })?;
        }
        if boxes.len() > u32::MAX as usize {
            let (limit, got) = (u32::MAX.into(), boxes.len() as u64);
            return Err(Error::Limit { what: "boxes".into(), limit, got });
        }
        volume.leaves.push(chunk.leaves);
        Ok(())
    }
}

//! The block source of all formats: cuts a byte stream into slabs along the slowest axis.
//!
//! ```text
//! file axes, fastest first:   list   x   y   z         block = all of list, x, y × 16 steps of z (or fewer: ≤ 16 MiB);
//!                                                      then every `layer`-th element of list is kept
//! ```
//! Where one plane exceeds the budget, a block has rows of one plane, and at worst voxels of one row. Bytes between blocks (other layers,
//! time steps, channels) are skipped. Memory: one buffer of stored bytes, and the block that is returned.

use std::path::PathBuf;

use pumice_core::{BlockSource, LabelBlock, VolumeInfo};

use crate::chunk_walk::Region;
use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::layout::{Layout, Role};
use crate::options::Warnings;
use crate::stream::ByteStream;

/// Largest number of stored bytes in one block.
pub(crate) const BLOCK_BYTES: u64 = 16 << 20;

/// Number of steps of the slowest axis in a block, where they fit; a multiple of the sides of 4³ cells and 16³ boxes.
const BLOCK_STEPS: u64 = 16;

/// Number of bytes after the last voxel that are read to reach the stream's checksum. If there are more, a warning replaces the check: a
/// small file may inflate to a thousand times its size.
const TAIL_BYTES: u64 = 1 << 20;

/// Delivers the voxels of one file.
pub(crate) struct SlabSource {
    path: PathBuf,
    info: VolumeInfo,
    layout: Layout,
    element: Element,
    stream: Box<dyn ByteStream>,
    warnings: Warnings,
    /// The file axis along which blocks are cut.
    cut: usize,
    /// Number of steps of this axis in one block.
    steps: u64,
    /// Index of the next block's start, on `cut` and on all slower axes.
    at: Vec<u64>,
    /// Number of bytes taken from the stream.
    taken: u64,
    buffer: Vec<u8>,
    ended: bool,
}

impl SlabSource {
    pub(crate) fn new(
        path: PathBuf,
        info: VolumeInfo,
        layout: Layout,
        element: Element,
        stream: Box<dyn ByteStream>,
        warnings: Warnings,
    ) -> Result<Self> {
        let axes = layout.axes();
        // Cut along the slowest axis of which one step fits in the budget. Axes of one step are useless for that.
        let fits =
            |a: &usize| matches!(axes[*a].role, Role::Space(_)) && layout.stride_bytes(*a) <= BLOCK_BYTES;
        let candidates: Vec<usize> = (0..axes.len()).filter(fits).collect();
        let longer = candidates.iter().rev().find(|&&a| axes[a].size > 1);
        let Some(&cut) = longer.or(candidates.first()) else {
            return Err(FormatError::Limit {
                path,
                what: "the size of one voxel with all its layers".into(),
                got: format!("{} bytes", layout.stride_bytes(layout.axes().len() - 3)),
                limit: BLOCK_BYTES,
            });
        };
        // Small planes come in more than 16 steps: a block of less than 1 MiB costs more to pass on than to convert.
        let stride = layout.stride_bytes(cut);
        let most = (BLOCK_BYTES / stride).clamp(1, BLOCK_STEPS.max((1 << 20) / stride));
        let steps = if most > 4 { most - most % 4 } else { most };
        // Fixed axes keep their index; the others count up.
        let at = axes[cut..]
            .iter()
            .map(|axis| match axis.role {
                Role::Fixed(index) => index,
                Role::Space(_) => 0,
            })
            .collect();
        Ok(Self {
            path,
            info,
            layout,
            element,
            stream,
            warnings,
            cut,
            steps,
            at,
            taken: 0,
            buffer: Vec::new(),
            ended: false,
        })
    }

    /// Leaves out the blocks before the first voxel of a region, as far as they come before it in the file. To be called before the first block.
    pub(crate) fn begin_at(&mut self, region: Region) {
        let axes = self.layout.axes();
        let slowest = (0..self.at.len()).rev().find(|&i| matches!(axes[self.cut + i].role, Role::Space(_)));
        if let Some(i) = slowest
            && let Role::Space(space) = axes[self.cut + i].role
        {
            let low = region[space][0];
            // Blocks begin where they do in the whole volume.
            self.at[i] = if i == 0 { low - low % self.steps } else { low };
        }
    }

    /// The next block, or `None` after the last.
    fn next(&mut self) -> Result<Option<LabelBlock>> {
        if self.ended {
            return Ok(None);
        }
        // Past the last index of the slowest spatial axis, everything has been delivered.
        if self.at.is_empty() {
            self.ended = true;
            self.finish()?;
            return Ok(None);
        }
        // Read the stored bytes of this block.
        let axes = self.layout.axes().to_vec();
        let count = self.steps.min(axes[self.cut].size - self.at[0]);
        let start: u64 = self
            .at
            .iter()
            .enumerate()
            .map(|(i, &index)| index * self.layout.stride_bytes(self.cut + i))
            .sum();
        let skip = start - self.taken;
        let skipped = self.stream.skip(skip)?;
        self.taken += skipped;
        if skipped < skip {
            return Err(self.short());
        }
        // The size is at most BLOCK_BYTES, and the buffer grows only as far as the stream delivers.
        let wanted = (count * self.layout.stride_bytes(self.cut)) as usize;
        self.fill_buffer(wanted)?;

        // Remove the data of other layers, from the slowest such axis to the fastest.
        let mut sizes: Vec<u64> = axes[..self.cut].iter().map(|a| a.size).collect();
        for a in (0..self.cut).rev() {
            if let Role::Fixed(index) = axes[a].role
                && sizes[a] > 1
            {
                let inner = sizes[..a].iter().product::<u64>() as usize * self.layout.element_bytes();
                keep_one(&mut self.buffer, inner, axes[a].size as usize, index as usize);
                sizes[a] = 1;
            }
        }

        // Position of the block, and order of its labels.
        let mut origin = [0u32; 3];
        let mut dims = [1u32; 3];
        let mut strides = [0usize; 3];
        let mut stride = 1usize;
        for (a, axis) in axes.iter().enumerate() {
            let Role::Space(space) = axis.role else { continue };
            // All numbers are at most MAX_DIM.
            if a > self.cut {
                origin[space] = self.at[a - self.cut] as u32;
            } else {
                dims[space] = if a == self.cut { count } else { axis.size } as u32;
                if a == self.cut {
                    origin[space] = self.at[0] as u32;
                }
            }
            strides[space] = stride;
            stride *= dims[space] as usize;
        }
        let labels = self.element.decode(&self.buffer).map_err(|bad| FormatError::Label {
            path: self.path.clone(),
            voxel: voxel_of(bad.index, origin, dims, strides),
            value: bad.value,
            reason: bad.reason,
        })?;

        // Advance the cut axis first, then the slower ones of the volume.
        self.at[0] += count;
        for i in 0..self.at.len() {
            let axis = axes[self.cut + i];
            if matches!(axis.role, Role::Fixed(_)) || self.at[i] < axis.size {
                continue;
            }
            self.at[i] = 0;
            match (i + 1..self.at.len()).find(|&j| matches!(axes[self.cut + j].role, Role::Space(_))) {
                Some(next) => self.at[next] += 1,
                None => self.at.clear(),
            }
            if self.at.is_empty() {
                break;
            }
        }
        Ok(Some(LabelBlock { origin, dims, strides, labels }))
    }

    /// Reads `wanted` bytes into the buffer, which grows in pieces so that a wrong size in a header costs no memory.
    fn fill_buffer(&mut self, wanted: usize) -> Result<()> {
        const PIECE_BYTES: usize = 1 << 20;
        self.buffer.clear();
        while self.buffer.len() < wanted {
            let from = self.buffer.len();
            self.buffer.resize(wanted.min(from + PIECE_BYTES), 0);
            let n = self.stream.fill(&mut self.buffer[from..])?;
            self.taken += n as u64;
            if from + n < self.buffer.len() {
                return Err(self.short());
            }
        }
        Ok(())
    }

    fn short(&self) -> FormatError {
        FormatError::Short {
            path: self.path.clone(),
            expected: self.layout.total_bytes(),
            got: self.taken,
            at: self.stream.position(),
        }
    }

    /// After the last block, checks that the rest of the data exists and that its checksum is right. Further bytes cause a warning.
    fn finish(&mut self) -> Result<()> {
        let rest = self.layout.total_bytes() - self.taken;
        let skipped = self.stream.skip(rest)?;
        self.taken += skipped;
        if skipped < rest {
            return Err(self.short());
        }
        let extra = self.stream.skip(TAIL_BYTES)?;
        if extra > 0 {
            let more = if extra == TAIL_BYTES { " or more" } else { "" };
            self.warnings.push(format!(
                "{}: {extra} bytes{more} after the last voxel were ignored",
                self.path.display()
            ));
        }
        Ok(())
    }
}

impl BlockSource for SlabSource {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> pumice_core::Result<Option<LabelBlock>> {
        let block = self.next();
        self.ended |= block.is_err();
        Ok(block?)
    }
}

/// Keeps run `index` of every `count` runs of `run` bytes.
fn keep_one(buffer: &mut Vec<u8>, run: usize, count: usize, index: usize) {
    let groups = buffer.len() / (run * count);
    for group in 0..groups {
        let from = (group * count + index) * run;
        buffer.copy_within(from..from + run, group * run);
    }
    buffer.truncate(groups * run);
}

/// The voxel of the label at `index` in a block.
fn voxel_of(index: usize, origin: [u32; 3], dims: [u32; 3], strides: [usize; 3]) -> [u64; 3] {
    [0, 1, 2].map(|a| u64::from(origin[a]) + (index / strides[a].max(1) % dims[a] as usize) as u64)
}

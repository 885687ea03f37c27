//! The block source of all formats: cuts a byte stream into slabs along the slowest axis.
//!
//! ```text
//! file axes, fastest first:   list   x   y   z         block = all of list, x, y × 16 steps of z (or fewer: ≤ 16 MiB);
//!                                                      then every `layer`-th element of list is kept
//! ```
//! Blocks end at the faces of chunks across the axis that they are cut along.
//! Where one plane exceeds the budget, a block has rows of one plane, and at worst voxels of one row. Bytes between blocks (other layers,
//! time steps, channels) are skipped. Memory: one buffer of stored bytes, and the block that is returned.
//!
//! Of a window, which is a part of the volume, a block has the rows within it; what lies between them in the file is skipped too.

use std::cmp::Ordering;
use std::path::PathBuf;

use pumice_core::{BlockSource, CHUNK_VOXELS, LabelBlock, VolumeInfo};

use crate::chunk_order::Region;
use crate::chunk_walk::step;
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
    /// The steps of each file axis that are read: the window's, and of an axis outside the volume its one index (all of them where it is faster
    /// than `cut`).
    window: Vec<[u64; 2]>,
    /// Whether the window has the volume's last voxel, behind which the file ends.
    has_last: bool,
    /// Index of the next block's start, on `cut` and on all slower axes.
    at: Vec<u64>,
    /// Number of bytes taken from the stream.
    taken: u64,
    buffer: Vec<u8>,
    ended: bool,
}

impl SlabSource {
    /// The voxels of `window`, a region of the volume in the file.
    pub(crate) fn new(
        path: PathBuf,
        (info, layout, element): (VolumeInfo, Layout, Element),
        stream: Box<dyn ByteStream>,
        window: Region,
        warnings: Warnings,
    ) -> Result<Self> {
        let axes = layout.axes();
        let mut of_axes: Vec<[u64; 2]> = axes
            .iter()
            .map(|axis| match axis.role {
                Role::Space(space) => window[space],
                Role::Fixed(_) => [0, axis.size],
            })
            .collect();
        // Bytes that one step of an axis has within the window, with all steps of faster axes outside the volume.
        let bytes_of_step = |a: usize| {
            of_axes[..a].iter().map(|[low, high]| high - low).product::<u64>() * layout.element_bytes() as u64
        };
        // Cut along the slowest axis of which one step fits in the budget. Axes of one step are useless for that.
        let fits = |a: &usize| matches!(axes[*a].role, Role::Space(_)) && bytes_of_step(*a) <= BLOCK_BYTES;
        let candidates: Vec<usize> = (0..axes.len()).filter(fits).collect();
        let longer = candidates.iter().rev().find(|&&a| of_axes[a][1] - of_axes[a][0] > 1);
        let Some(&cut) = longer.or(candidates.first()) else {
            return Err(FormatError::Limit {
                path,
                what: "the size of one voxel with all its layers".into(),
                got: format!("{} bytes", layout.stride_bytes(layout.axes().len() - 3)),
                limit: BLOCK_BYTES,
            });
        };
        // Small planes come in more than 16 steps: a block of less than 1 MiB costs more to pass on than to convert.
        let stride = bytes_of_step(cut);
        let most = (BLOCK_BYTES / stride).clamp(1, BLOCK_STEPS.max((1 << 20) / stride));
        let steps = if most > 4 { most - most % 4 } else { most };
        for (axis, range) in axes.iter().zip(&mut of_axes).skip(cut) {
            if let Role::Fixed(index) = axis.role {
                *range = [index, index + 1];
            }
        }
        let at = of_axes[cut..].iter().map(|[low, _]| *low).collect();
        let has_last = window.map(|[_, high]| high) == layout.dims().map(u64::from);
        Ok(Self {
            path,
            info,
            layout,
            element,
            stream,
            warnings,
            cut,
            steps,
            has_last,
            window: of_axes,
            at,
            taken: 0,
            buffer: Vec::new(),
            ended: false,
        })
    }

    /// The next block, or `None` after the last.
    fn next(&mut self) -> Result<Option<LabelBlock>> {
        if self.ended {
            return Ok(None);
        }
        // Past the last index of the slowest axis, everything has been delivered.
        if self.at.is_empty() {
            self.ended = true;
            if self.has_last {
                self.finish()?;
            }
            return Ok(None);
        }
        // Read the stored bytes of this block.
        let axes = self.layout.axes().to_vec();
        let count = self.steps.min(self.window[self.cut][1] - self.at[0]).min(self.steps_to_face());
        self.read_block(count)?;

        // Remove the data of other layers, from the slowest such axis to the fastest.
        let mut sizes: Vec<u64> = self.window[..self.cut].iter().map(|[low, high]| high - low).collect();
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
            let [low, high] = match a.cmp(&self.cut) {
                Ordering::Less => self.window[a],
                Ordering::Equal => [self.at[0], self.at[0] + count],
                Ordering::Greater => [self.at[a - self.cut], self.at[a - self.cut] + 1],
            };
            (origin[space], dims[space]) = (low as u32, (high - low) as u32);
            strides[space] = stride;
            stride *= dims[space] as usize;
        }
        let labels = self.element.decode(&self.buffer).map_err(|bad| FormatError::Label {
            path: self.path.clone(),
            voxel: voxel_of(bad.index, origin, dims, strides),
            value: bad.value,
            reason: bad.reason,
        })?;

        // Advance the cut axis first, then the slower ones. Those outside the volume have one index.
        self.at[0] += count;
        let mut i = 0;
        while self.at[i] >= self.window[self.cut + i][1] {
            self.at[i] = self.window[self.cut + i][0];
            i += 1;
            if i == self.at.len() {
                self.at.clear();
                break;
            }
            self.at[i] += 1;
        }
        Ok(Some(LabelBlock { origin, dims, strides, labels }))
    }

    /// Steps along the axis that blocks are cut along, to the next face of chunks, of which one is the window's.
    fn steps_to_face(&self) -> u64 {
        let side = u64::from(CHUNK_VOXELS);
        side - (self.at[0] - self.window[self.cut][0]) % side
    }

    /// Reads the stored bytes of a block of `count` steps into the buffer: run after run, each as long as the window has whole axes.
    fn read_block(&mut self, count: u64) -> Result<()> {
        let axes = self.layout.axes();
        // At most BLOCK_BYTES in all.
        let mut ranges = self.window[..self.cut].to_vec();
        ranges.push([self.at[0], self.at[0] + count]);
        let is_whole = |a: usize| ranges[a] == [0, axes[a].size];
        let run_axis = (0..self.cut).find(|&a| !is_whole(a)).unwrap_or(self.cut);
        let strides: Vec<u64> = (0..axes.len()).map(|a| self.layout.stride_bytes(a)).collect();
        let run = (ranges[run_axis][1] - ranges[run_axis][0]) * strides[run_axis];
        let slower: u64 =
            self.at.iter().zip(&strides[self.cut..]).skip(1).map(|(i, stride)| i * stride).sum();
        // Where each run begins, along the axes from `run_axis` to `cut`.
        let first: Vec<u64> = ranges.iter().map(|r| r[0]).collect();
        let last: Vec<u64> = ranges.iter().map(|r| r[1] - 1).collect();
        let mut index = first.clone();
        self.buffer.clear();
        loop {
            let start =
                slower + index[run_axis..].iter().zip(&strides[run_axis..]).map(|(i, s)| i * s).sum::<u64>();
            self.read_run(start, run as usize)?;
            if !step(&mut index[run_axis + 1..], &first[run_axis + 1..], &last[run_axis + 1..]) {
                return Ok(());
            }
        }
    }

    /// Appends `wanted` bytes from byte `start` on to the buffer, which grows in pieces so that a wrong size in a header costs no memory.
    fn read_run(&mut self, start: u64, wanted: usize) -> Result<()> {
        const PIECE_BYTES: usize = 1 << 20;
        let skip = start - self.taken;
        if skip > 0 {
            let skipped = self.stream.skip(skip)?;
            self.taken += skipped;
            if skipped < skip {
                return Err(self.short());
            }
        }
        let end = self.buffer.len() + wanted;
        while self.buffer.len() < end {
            let from = self.buffer.len();
            self.buffer.resize(end.min(from + PIECE_BYTES), 0);
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

    use pumice_core::LabelType;

    use super::*;
    use crate::layout::FileAxis;

    /// Bytes in memory that count how many of them are read.
    struct Counted {
        bytes: Vec<u8>,
        at: usize,
        read: Arc<AtomicU64>,
    }

    impl ByteStream for Counted {
        fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
            let n = buffer.len().min(self.bytes.len() - self.at);
            buffer[..n].copy_from_slice(&self.bytes[self.at..self.at + n]);
            self.at += n;
            self.read.fetch_add(n as u64, Relaxed);
            Ok(n)
        }

        fn skip(&mut self, bytes: u64) -> Result<u64> {
            let n = bytes.min((self.bytes.len() - self.at) as u64);
            self.at += n as usize;
            Ok(n)
        }
    }

    const DIMS: [u64; 3] = [7, 11, 40];

    fn id(p: [u64; 3]) -> u16 {
        u16::try_from(1 + p[0] + 7 * (p[1] + 11 * p[2])).unwrap()
    }

    /// The voxels of a window of a file with these axes, `(size, role)` fastest first, and the number of bytes that are read.
    fn read(axes: &[FileAxis], window: Region) -> (BTreeMap<[u64; 3], u64>, u64) {
        let mut bytes = Vec::new();
        let mut index = vec![0; axes.len()];
        let (first, last) = (vec![0; axes.len()], axes.iter().map(|a| a.size - 1).collect::<Vec<u64>>());
        loop {
            let (mut p, mut is_own) = ([0; 3], true);
            for (axis, &i) in axes.iter().zip(&index) {
                match axis.role {
                    Role::Space(space) => p[space] = i,
                    Role::Fixed(own) => is_own &= own == i,
                }
            }
            bytes.extend(if is_own { id(p) } else { u16::MAX }.to_le_bytes());
            if !step(&mut index, &first, &last) {
                break;
            }
        }
        let count = Arc::new(AtomicU64::new(0));
        let stream = Box::new(Counted { bytes, at: 0, read: Arc::clone(&count) });
        let layout = Layout::new("a".as_ref(), axes.to_vec(), 2).unwrap();
        let element = Element::new(LabelType::U16, false);
        let info = VolumeInfo::new(layout.dims(), LabelType::U16);
        let mut source =
            SlabSource::new("a".into(), (info, layout, element), stream, window, Warnings::default())
                .unwrap();
        let mut voxels = BTreeMap::new();
        while let Some(block) = source.next_block().unwrap() {
            for z in 0..block.dims[2] {
                for y in 0..block.dims[1] {
                    for x in 0..block.dims[0] {
                        let at = [0, 1, 2].map(|a| u64::from(block.origin[a] + [x, y, z][a]));
                        assert!(voxels.insert(at, block.get([x, y, z])).is_none(), "{at:?}");
                    }
                }
            }
        }
        (voxels, count.load(Relaxed))
    }

    /// In each order of axes, with others before, between and behind them, a window has its own voxels, and no byte of another row is read.
    #[test]
    fn a_window_has_its_own_voxels_and_reads_no_row_outside() {
        let space = |a: usize| FileAxis { size: DIMS[a], role: Role::Space(a) };
        let other = |size| FileAxis { size, role: Role::Fixed(1) };
        let windows = [
            [[0, 7], [0, 11], [0, 40]],
            [[2, 5], [0, 11], [3, 40]],
            [[0, 7], [4, 5], [17, 18]],
            [[6, 7], [3, 9], [0, 39]],
        ];
        for [a, b, c] in [[0, 1, 2], [2, 1, 0], [1, 2, 0], [2, 0, 1]] {
            for place in 0..5 {
                let mut axes = vec![space(a), space(b), space(c)];
                if place < 4 {
                    axes.insert(place, other(3));
                }
                for window in windows {
                    let (voxels, bytes) = read(&axes, window);
                    let size = |a: usize| window[a][1] - window[a][0];
                    assert_eq!(voxels.len() as u64, size(0) * size(1) * size(2), "{axes:?} {window:?}");
                    for (&at, &found) in &voxels {
                        assert_eq!(found, u64::from(id(at)), "{axes:?} {window:?} {at:?}");
                        assert!((0..3).all(|a| (window[a][0]..window[a][1]).contains(&at[a])));
                    }
                    // Indices of another axis that is faster than the slowest one of several voxels are read along.
                    let several = |axis: &FileAxis| matches!(axis.role, Role::Space(a) if size(a) > 1);
                    let along = if axes.iter().rposition(several) > Some(place) { 3 } else { 1 };
                    let is_all = (0..3).all(|a| size(a) == DIMS[a]);
                    assert!(
                        is_all || bytes == 2 * along * voxels.len() as u64,
                        "{axes:?} {window:?}: {bytes}"
                    );
                }
            }
        }
    }

    /// Where a plane of the window is larger than a block, each plane begins at the window's first row again.
    #[test]
    fn planes_larger_than_a_block_begin_at_the_windows_first_row() {
        const SIDE: u64 = 4100;
        let bytes: Vec<u8> = (0..3 * SIDE * SIDE).map(|i| (i % 251) as u8).collect();
        let stream = Box::new(Counted { bytes, at: 0, read: Arc::default() });
        let layout = Layout::x_fastest("a".as_ref(), [SIDE, SIDE, 3], 1).unwrap();
        let of_file =
            (VolumeInfo::new(layout.dims(), LabelType::U8), layout, Element::new(LabelType::U8, false));
        let window = [[1, SIDE], [3, SIDE], [1, 3]];
        let mut source = SlabSource::new("a".into(), of_file, stream, window, Warnings::default()).unwrap();
        let (mut blocks, mut voxels) = (0, 0);
        while let Some(block) = source.next_block().unwrap() {
            assert_eq!((block.origin[0], block.dims[0], block.dims[2]), (1, SIDE as u32 - 1, 1));
            assert!(block.origin[1] >= 3 && block.origin[2] >= 1);
            for y in 0..block.dims[1] {
                for x in [0, 1, block.dims[0] - 1] {
                    let [x_in, y_in, z_in] =
                        [block.origin[0] + x, block.origin[1] + y, block.origin[2]].map(u64::from);
                    assert_eq!(block.get([x, y, 0]), (x_in + SIDE * (y_in + SIDE * z_in)) % 251);
                }
            }
            (blocks, voxels) = (blocks + 1, voxels + block.dims.map(u64::from).iter().product::<u64>());
        }
        assert_eq!(voxels, (SIDE - 1) * (SIDE - 3) * 2);
        assert!(blocks > 2, "{blocks}");
    }
}

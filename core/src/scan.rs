//! Converts a block of labels to a part: finds which voxels of each 4³ cell have which label.
//!
//! ```text
//! for each cell that the block touches, in Morton order (so that each label's records come out sorted):
//!     read its 64 labels
//!     if all are equal: one record with all bits set (most cells of real volumes)
//!     else, while voxels remain: take the first one's label, compare all 64 with it, add one record
//! group the records by label with a stable counting sort
//! ```
//! A block of many labels gives several parts, each of so many records at most: a cell may have a record for each of its 64 voxels, which is
//! then forty times what the voxels take.
//!
//! Labels are looked up in a small direct-mapped cache, then in a hash map; an array by id is impossible, because ids may be any number up
//! to 2⁶⁴.

use rustc_hash::FxHashMap;

use crate::block::{LabelBlock, LabelBuffer};
use crate::cell::{CELL, Cell, SOLID};
use crate::sorted_cells::SortedCells;
use crate::{Error, Result, morton};

/// Number type of labels in memory.
trait Label: Copy + Eq + Default + Into<u64> {
    /// Whether all 64 are equal to `first`. Branch-free, so that the compiler vectorises it.
    fn all_equal(labels: &[Self; 64], first: Self) -> bool;

    /// Whether all are background. Branch-free too.
    fn are_background(labels: &[Self]) -> bool;

    /// The labels as 32-bit numbers if they stay distinct that way; then twice as many are compared at once.
    fn narrow(_: &[Self; 64]) -> Option<[u32; 64]> {
        None
    }
}

macro_rules! label {
    ($($t:ty { $($more:item)* })*) => {$(
        impl Label for $t {
            $($more)*
            #[inline(always)]
            fn all_equal(labels: &[Self; 64], first: Self) -> bool {
                labels.iter().fold(0, |differing, &l| differing | (l ^ first)) == 0
            }
            #[inline(always)]
            fn are_background(labels: &[Self]) -> bool {
                labels.iter().fold(0, |any, &l| any | l) == 0
            }
        }
    )*};
}
label! {
    u8 {}
    u16 {}
    u32 {}
    u64 {
        #[inline(always)]
        fn narrow(labels: &[Self; 64]) -> Option<[u32; 64]> {
            let differing = labels.iter().fold(0, |differing, &l| differing | (l ^ labels[0]));
            (differing >> 32 == 0).then(|| labels.map(|l| l as u32))
        }
    }
}

/// A mask whose bit v is set where `labels[v]` is `label`.
#[inline(always)]
fn equal_mask<T: Label>(labels: &[T; 64], label: T) -> u64 {
    let mut equal = [0u8; 64];
    for (e, &l) in equal.iter_mut().zip(labels) {
        *e = u8::from(l == label);
    }
    let mut mask = 0;
    for (i, eight) in equal.as_chunks::<8>().0.iter().enumerate() {
        // Turn eight bytes of 0 or 1 into eight bits: the product moves byte k's bit to bit 56 + k, without carries.
        mask |= (u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * i);
    }
    mask
}

/// Adds a record for each label among a cell's `valid` voxels. Two `keys` are equal exactly where their labels are.
#[inline(always)]
fn record_each<T: Label, K: Label>(
    labels: &[T; 64],
    keys: &[K; 64],
    valid: u64,
    cell: u64,
    records: &mut Records<'_>,
) {
    let mut remaining = valid;
    while remaining != 0 {
        let first = remaining.trailing_zeros() as usize;
        let mask = equal_mask(keys, keys[first]) & valid;
        remaining &= !mask;
        records.push(labels[first].into(), cell, mask);
    }
}

/// Most records of a part of a block, which take 36 bytes each while they are grouped: 4.5 MiB a thread. Most blocks have fewer: one of 4 M
/// voxels has a record for each of its 65,536 cells, and some more at the borders of labels.
const MOST_RECORDS: usize = 1 << 17;

/// Takes the parts of a block.
type Visit<'v> = &'v mut dyn FnMut(SortedCells) -> Result<()>;

/// Records of a block, in the order of its cells; they are not grouped by label yet.
struct Records<'v> {
    /// Most records before they are grouped, and what takes them then.
    most: usize,
    visit: Visit<'v>,
    ids: Vec<u64>,
    counts: Vec<usize>,
    index_of: FxHashMap<u64, u32>,
    cache: Box<[(u64, u32); CACHE]>,
    indices: Vec<u32>,
    cells: Vec<Cell>,
}

/// Slots of the label cache: more labels than this seldom occur in one 64³ neighbourhood.
const CACHE: usize = 256;

impl<'v> Records<'v> {
    fn new(most: usize, visit: Visit<'v>) -> Self {
        // Id 0 is never looked up, so it marks an empty slot.
        Self {
            most,
            visit,
            ids: Vec::new(),
            counts: Vec::new(),
            index_of: FxHashMap::default(),
            cache: Box::new([(0, 0); CACHE]),
            indices: Vec::new(),
            cells: Vec::new(),
        }
    }

    /// Adds a record of a label's voxels in a cell; background gets none.
    #[inline(always)]
    fn push(&mut self, id: u64, key: u64, mask: u64) {
        if id == 0 {
            return;
        }
        // Fibonacci hashing: the top bits of the product depend on all bits of the id.
        let slot = (id.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as usize % CACHE;
        let (cached, index) = self.cache[slot];
        let index = if cached == id { index } else { self.look_up(id, slot) };
        self.counts[index as usize] += 1;
        self.indices.push(index);
        self.cells.push(Cell { key, mask });
    }

    #[inline(never)]
    fn look_up(&mut self, id: u64, slot: usize) -> u32 {
        let index = *self.index_of.entry(id).or_insert_with(|| {
            self.ids.push(id);
            self.counts.push(0);
            (self.ids.len() - 1) as u32
        });
        self.cache[slot] = (id, index);
        index
    }

    /// Passes the records on if the next cell may give more than may wait.
    #[inline(always)]
    fn make_room(&mut self) -> Result<()> {
        if self.cells.len().saturating_add(64) > self.most { self.pass_on() } else { Ok(()) }
    }

    /// Passes on the records as a part; none stay.
    #[inline(never)]
    fn pass_on(&mut self) -> Result<()> {
        let part = self.take_part();
        (self.visit)(part)
    }

    /// Groups the records by label, in rising order of ids; within a label the order of records stays. None stay.
    fn take_part(&mut self) -> SortedCells {
        let (ids, counts) = (std::mem::take(&mut self.ids), std::mem::take(&mut self.counts));
        let mut order: Vec<u32> = (0..ids.len() as u32).collect();
        order.sort_unstable_by_key(|&i| ids[i as usize]);
        let mut next = vec![0; ids.len()];
        let mut offsets = Vec::with_capacity(order.len() + 1);
        let mut at = 0;
        offsets.push(0);
        for &i in &order {
            next[i as usize] = at;
            at += counts[i as usize];
            offsets.push(at);
        }
        let mut cells = vec![Cell { key: 0, mask: 0 }; self.cells.len()];
        for (&index, &cell) in self.indices.iter().zip(&self.cells) {
            let to = &mut next[index as usize];
            cells[*to] = cell;
            *to += 1;
        }
        self.indices.clear();
        self.cells.clear();
        self.index_of.clear();
        self.cache.fill((0, 0));
        SortedCells { ids: order.iter().map(|&i| ids[i as usize]).collect(), offsets, cells }
    }
}

impl SortedCells {
    /// Converts one block of a volume of `dims` voxels to a part.
    ///
    /// # Errors
    /// [`Error::Caller`] when the block extends beyond the volume or beyond its own buffer.
    pub fn from_block(block: &LabelBlock, dims: [u32; 3]) -> Result<SortedCells> {
        let mut whole = SortedCells::default();
        let mut visit = |part| {
            whole = part;
            Ok(())
        };
        scan(block, dims, usize::MAX, &mut visit)?;
        Ok(whole)
    }

    /// Converts one block to parts, each of so few records that their memory does not depend on the block; a part that is not the only one
    /// may be empty.
    ///
    /// # Errors
    /// As [`SortedCells::from_block`]; those of `visit`.
    pub(crate) fn of_block(block: &LabelBlock, dims: [u32; 3], visit: Visit<'_>) -> Result<()> {
        scan(block, dims, MOST_RECORDS, visit)
    }

    /// Like [`SortedCells::from_block`] for borrowed labels, whose strides have the meaning of [`LabelBlock::strides`].
    pub(crate) fn from_labels(
        [origin, dims]: [[u32; 3]; 2],
        (labels, strides): (&[u32], [usize; 3]),
        volume_dims: [u32; 3],
    ) -> Result<SortedCells> {
        let mut whole = SortedCells::default();
        let mut visit = |part| {
            whole = part;
            Ok(())
        };
        Scan { origin, dims, strides, labels }.parts(volume_dims, usize::MAX, &mut visit)?;
        Ok(whole)
    }
}

/// Passes on the parts of a block, each of at most `most` records.
fn scan(block: &LabelBlock, volume_dims: [u32; 3], most: usize, visit: Visit<'_>) -> Result<()> {
    let LabelBlock { origin, dims, strides, .. } = *block;
    match &block.labels {
        LabelBuffer::U8(labels) => Scan { origin, dims, strides, labels }.parts(volume_dims, most, visit),
        LabelBuffer::U16(labels) => Scan { origin, dims, strides, labels }.parts(volume_dims, most, visit),
        LabelBuffer::U32(labels) => Scan { origin, dims, strides, labels }.parts(volume_dims, most, visit),
        LabelBuffer::U64(labels) => Scan { origin, dims, strides, labels }.parts(volume_dims, most, visit),
    }
}

/// Level of the cubes, 2² cells or 16 voxels a side, that are looked at as a whole first: where they are background, none of their cells is read.
const SPARSE_LEVEL: u32 = 2;

/// A block being scanned.
struct Scan<'a, T> {
    origin: [u32; 3],
    dims: [u32; 3],
    strides: [usize; 3],
    labels: &'a [T],
}

impl<T: Label> Scan<'_, T> {
    fn parts(&self, volume_dims: [u32; 3], most: usize, visit: Visit<'_>) -> Result<()> {
        self.check(volume_dims)?;
        let mut records = Records::new(most, visit);
        // A chunk that a store lacks is background throughout, and there may be millions of them.
        let is_background =
            self.strides == [0; 3] && self.labels.first().is_some_and(|&label| label.into() == 0);
        if !is_background {
            self.run(&mut records)?;
        }
        records.pass_on()
    }

    /// Returns an error unless all voxels of the block are in the volume and in the buffer.
    fn check(&self, volume_dims: [u32; 3]) -> Result<()> {
        let Self { origin, dims, strides, labels } = self;
        let mut last = 0u128;
        for a in 0..3 {
            let end = u64::from(origin[a]) + u64::from(dims[a]);
            if end > u64::from(volume_dims[a]) {
                return Err(Error::Caller(format!(
                    "block at {origin:?} of {dims:?} voxels reaches beyond the volume of {volume_dims:?}"
                )));
            }
            last += u128::from(dims[a].saturating_sub(1)) * strides[a] as u128;
        }
        if !dims.contains(&0) && last >= labels.len() as u128 {
            return Err(Error::Caller(format!(
                "block at {origin:?} of {dims:?} voxels needs {} labels, got {}",
                last + 1,
                labels.len()
            )));
        }
        Ok(())
    }

    fn run(&self, records: &mut Records<'_>) -> Result<()> {
        if self.dims.contains(&0) {
            return Ok(());
        }
        let first = self.origin.map(|o| o / CELL);
        let last = [0, 1, 2].map(|a| (self.origin[a] + self.dims[a] - 1) / CELL);
        // Start at the smallest aligned cube that contains all the cells.
        let mut level = 0;
        while (0..3).any(|a| first[a] >> level != last[a] >> level) {
            level += 1;
        }
        self.cube(level, first.map(|c| c >> level << level), first, last, records)
    }

    /// Visits the cells from `first` to `last` within the cube of side 2^`level` cells at `corner`, in Morton order.
    fn cube(
        &self,
        level: u32,
        corner: [u32; 3],
        first: [u32; 3],
        last: [u32; 3],
        records: &mut Records<'_>,
    ) -> Result<()> {
        if level == 0 {
            records.make_room()?;
            self.cell(corner, records);
            return Ok(());
        }
        if level == SPARSE_LEVEL && self.is_background(corner) {
            return Ok(());
        }
        let half = 1 << (level - 1);
        for child in 0..8u32 {
            let low = [0, 1, 2].map(|a| corner[a] + (child >> a & 1) * half);
            if (0..3).all(|a| low[a] <= last[a] && low[a] + (half - 1) >= first[a]) {
                self.cube(level - 1, low, first, last, records)?;
            }
        }
        Ok(())
    }

    /// Whether a cube of [`SPARSE_LEVEL`] is background throughout; false where no axis has a stride of 1. In a cube within a label the first row
    /// decides.
    fn is_background(&self, corner: [u32; 3]) -> bool {
        let Self { origin, dims, strides, labels } = self;
        let Some(fastest) = strides.iter().position(|&stride| stride == 1) else { return false };
        let (across, along) = ((fastest + 1) % 3, (fastest + 2) % 3);
        let voxels = |a: usize| {
            let low = (corner[a] * CELL).max(origin[a]) - origin[a];
            let high = ((corner[a] + (1 << SPARSE_LEVEL)) * CELL).min(origin[a] + dims[a]) - origin[a];
            low as usize..high as usize
        };
        voxels(along).all(|v| {
            voxels(across).all(|u| {
                let start = u * strides[across] + v * strides[along];
                let row = voxels(fastest);
                T::are_background(&labels[start + row.start..start + row.end])
            })
        })
    }

    /// Reads one cell and records its labels.
    #[inline]
    fn cell(&self, cell: [u32; 3], records: &mut Records<'_>) {
        let Self { origin, dims, strides, .. } = self;
        let low = cell.map(|c| c * CELL);
        let inside = (0..3).all(|a| low[a] >= origin[a] && low[a] - origin[a] + CELL <= dims[a]);
        let mut labels = [T::default(); 64];
        let mut valid = SOLID;
        if inside {
            let at: usize = (0..3).map(|a| (low[a] - origin[a]) as usize * strides[a]).sum();
            for z in 0..4 {
                for y in 0..4 {
                    let row = at + y * strides[1] + z * strides[2];
                    let to = 4 * y + 16 * z;
                    if strides[0] == 1 {
                        labels[to..to + 4].copy_from_slice(&self.labels[row..row + 4]);
                    } else {
                        for x in 0..4 {
                            labels[to + x] = self.labels[row + x * strides[0]];
                        }
                    }
                }
            }
        } else {
            valid = self.read_partly(low, &mut labels);
        }

        let key = morton::encode(cell);
        if valid == SOLID && T::all_equal(&labels, labels[0]) {
            return records.push(labels[0].into(), key, SOLID);
        }
        match T::narrow(&labels) {
            Some(narrow) => record_each(&labels, &narrow, valid, key, records),
            None => record_each(&labels, &labels, valid, key, records),
        }
    }

    /// Reads a cell at the block's edge. The result has a bit for each voxel that lies in the block.
    #[cold]
    fn read_partly(&self, low: [u32; 3], labels: &mut [T; 64]) -> u64 {
        let Self { origin, dims, strides, .. } = self;
        let mut valid = 0;
        for v in 0..64u32 {
            let voxel = [low[0] + (v & 3), low[1] + (v >> 2 & 3), low[2] + (v >> 4)];
            if (0..3).all(|a| voxel[a] >= origin[a] && voxel[a] - origin[a] < dims[a]) {
                let at: usize = (0..3).map(|a| (voxel[a] - origin[a]) as usize * strides[a]).sum();
                labels[v as usize] = self.labels[at];
                valid |= 1 << v;
            }
        }
        valid
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_mask_matches_naive() {
        for seed in 0..200u32 {
            let labels: [u32; 64] =
                std::array::from_fn(|v| (v as u32 ^ seed).wrapping_mul(0x9E37_79B9) >> 30);
            let naive = (0..64).filter(|&v| labels[v] == 2).fold(0u64, |m, v| m | 1 << v);
            assert_eq!(equal_mask(&labels, 2), naive);
        }
    }

    #[test]
    fn a_block_of_one_label_needs_one_label_in_memory() {
        let dims = [9, 6, 5];
        for id in [0u32, 7] {
            let one =
                LabelBlock { origin: [0; 3], dims, strides: [0; 3], labels: LabelBuffer::U32(vec![id]) };
            let all = LabelBlock::x_fastest([0; 3], dims, LabelBuffer::U32(vec![id; 270]));
            let part = |block| SortedCells::from_block(block, dims).unwrap();
            assert_eq!(part(&one).voxels(), if id == 0 { 0 } else { 270 });
            assert_eq!(part(&one).voxels(), part(&all).voxels());
        }
        let beyond =
            LabelBlock { origin: [1, 0, 0], dims, strides: [0; 3], labels: LabelBuffer::U32(vec![0]) };
        assert!(SortedCells::from_block(&beyond, dims).is_err());
    }

    /// Looking at cubes as a whole loses no voxel, wherever it lies in them and in the block.
    #[test]
    fn a_single_voxel_is_found_anywhere() {
        let (origin, dims, volume) = ([5, 2, 11], [33u32, 19, 22], [40, 40, 40]);
        let [x, y, z] = dims.map(|d| d as usize);
        for strides in [[1, x, x * y], [y * z, z, 1], [z, z * x, 1], [2, 2 * x, 2 * x * y]] {
            for v in (0..x * y * z).step_by(7) {
                let at = [v % x, v / x % y, v / x / y];
                let mut labels = vec![0u16; 2 * x * y * z];
                labels[(0..3).map(|a| at[a] * strides[a]).sum::<usize>()] = 9;
                let block = LabelBlock { origin, dims, strides, labels: LabelBuffer::U16(labels) };
                let part = SortedCells::from_block(&block, volume).unwrap();
                let voxel = [0, 1, 2].map(|a| origin[a] + at[a] as u32);
                let (key, bit) = (morton::encode(voxel.map(|c| c / CELL)), voxel.map(|c| c % CELL));
                let mask = 1 << (bit[0] + 4 * bit[1] + 16 * bit[2]);
                assert_eq!((part.ids, part.cells), (vec![9], vec![Cell { key, mask }]), "{at:?} {strides:?}");
            }
        }
    }

    #[test]
    fn blocks_outside_are_refused() {
        let block = |origin, dims, n| LabelBlock::x_fastest(origin, dims, LabelBuffer::U8(vec![1; n]));
        assert!(SortedCells::from_block(&block([0; 3], [2, 2, 2], 8), [2; 3]).is_ok());
        assert!(SortedCells::from_block(&block([1, 0, 0], [2, 2, 2], 8), [2; 3]).is_err());
        assert!(SortedCells::from_block(&block([0; 3], [2, 2, 2], 7), [2; 3]).is_err());
    }
}

//! The voxels of a volume that are drawn, all labels together: 4³ bricks of 4³ cells of 4³ voxels per block, as 64-bit masks.
//!
//! The compressed volume stores each label by itself, so several boxes cover one brick of space, and the hierarchy has to find and walk
//! them one after another. The label of a voxel does not matter until the ray hits it.
//! Here the voxels of all drawn labels are merged: a ray crosses space once, in order, and the first voxel found is the hit. (At coarser
//! levels labels overlap; the hit then reports the lowest label.) Bricks are derived from the volume for one choice of labels and one
//! choice of levels.
//!
//! ```text
//! blocks   64³ voxels each, x fastest: a mask of the bricks that hold a voxel, and the index of the first of these bricks
//! bricks   16³ voxels each, ordered by block and place in it: masks of the cells that hold a voxel and of the cells that hold all 64;
//!          the index of the first field
//! fields   for each cell that is neither empty nor full: a mask of its voxels, as a code where masks repeat (`brick_fields`)
//! items    for each brick: the numbers of the boxes that reach into it, rising
//! sections for each item: in which of 16 sections of the brick, of 2 × 2 × 1 cells each, the box has a cell
//! ```
//! In every mask of 64, the element at (x, y, z) is bit x + 4y + 16z; the section of cell (x, y, z) is bit ⌊x/2⌋ + 2⌊y/2⌋ + 4z.
//!
//! **Bytes.** An item takes six, whatever the box has in the brick. Sixteen, with a mask of all its cells and its label, made the bricks of
//! a cortex twice as large. What is left out is seldom needed: the label once a hit ([`LabelOfBox`]), the cells where the sections of
//! several boxes hold the voxel that was hit.

mod stored;

use std::ops::Range;
use std::sync::Arc;

use crate::BoxBounds;
use pumice_core::reserve::reserved;
use pumice_core::{CompressedVolume, NoMemory};

use super::brick_fields::Fields;
use super::each_axis;
use super::label_of_box::LabelOfBox;
use super::lod::{Detail, DetailLevel};

/// Voxels along the side of a block.
pub const BLOCK: u32 = 64;
/// Voxels along the side of a brick.
pub const BRICK: u32 = 16;

/// The merged voxels of one volume; the module documentation describes the arrays.
#[derive(Debug)]
pub struct Bricks {
    /// Level of detail of each box that the bricks were built for.
    detail: Detail,
    /// Bounds of all voxels: lowest and highest corner, padded to four lanes.
    pub bounds: [[f64; 4]; 2],
    /// Index of the last block along each axis.
    pub last_block: [f64; 4],
    /// Distance in `blocks` from a block to its neighbour along each axis.
    pub strides: [usize; 3],
    /// Place of the first block along each axis: 0, except in bricks of a part of a volume.
    first: [u32; 3],
    blocks: Vec<Block>,
    bricks: Vec<Brick>,
    fields: Fields,
    items: Vec<u32>,
    sections: Vec<u16>,
    labels: Arc<LabelOfBox>,
}

/// A block of 64³ voxels.
#[derive(Clone, Copy, Debug, Default)]
pub struct Block {
    /// Mask of its bricks that hold a voxel.
    pub occupied: u64,
    /// Index of the first of these bricks.
    pub first_brick: u32,
}

/// A brick of 16³ voxels, at least one of which is drawn.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Brick {
    /// Mask of the cells that hold a voxel.
    pub occupied: u64,
    /// Mask of the cells that hold all 64 voxels.
    pub full: u64,
    /// Index of its first field.
    pub first_field: u32,
    /// Index of its first item.
    pub first_item: u32,
}

/// Limit on the blocks of a sparse volume: this many for each box, or `FEW_BLOCKS` if that is more. Beyond it most blocks are empty and
/// waste memory.
const BLOCKS_A_BOX: u64 = 8;
const FEW_BLOCKS: u64 = 1 << 16;

/// Bits that hold a brick's place within its block.
const PLACE_BITS: u32 = 6;

impl Bricks {
    /// Builds the bricks of these boxes of a volume, all drawn at `level`. Returns `None` where `items` is empty, where the volume is too
    /// sparse, or where an index would not fit 32 bits.
    pub fn new(volume: &CompressedVolume, items: &[u32], level: DetailLevel) -> Option<Self> {
        let blocks_along = blocks_along(volume.info().dims);
        if items.is_empty() || !Self::are_possible(volume.info().dims, items.len() as u64) {
            return None;
        }
        Self::of_blocks(volume, items, Detail::Same(level), [0; 3], blocks_along)
    }

    /// Whether a volume of this size is not too sparse for bricks, with so many boxes drawn.
    pub fn are_possible(dims: [u32; 3], boxes: u64) -> bool {
        let blocks = blocks_along(dims).iter().map(|&n| u64::from(n)).try_fold(1u64, u64::checked_mul);
        blocks.is_some_and(|n| n <= FEW_BLOCKS.max(BLOCKS_A_BOX.saturating_mul(boxes)) && n >> 31 == 0)
    }

    /// Builds the bricks of a part of a volume: of `along` blocks from the block at `first`, both counted in blocks. `items` are all boxes
    /// that reach into it. Returns `None` where no voxel of theirs lies there, or where an index would not fit 32 bits.
    pub fn of_blocks(
        volume: &CompressedVolume,
        items: &[u32],
        detail: Detail,
        first: [u32; 3],
        along: [u32; 3],
    ) -> Option<Self> {
        let reaching = boxes_by_brick(volume, items, first, along);
        let mut made =
            Self::empty(detail, first, along, Fields::default(), Arc::new(LabelOfBox::new(volume)?));
        let mut bounds = BoxBounds::EMPTY;
        for of_brick in reaching.chunk_by(|a, b| a.0 == b.0) {
            let number = of_brick.first()?.0;
            bounds = bounds.union(made.add(volume, number, of_brick.iter().map(|of| of.1))?);
        }
        made.fields.pack();
        if made.bricks.is_empty() { None } else { made.finish(bounds) }
    }

    /// Blocks alone, of a volume of this size: `occupied` has the mask of the bricks of each that hold a voxel, x fastest, all of which lie
    /// within `bounds`. The bricks themselves are elsewhere.
    pub fn grid_of(dims: [u32; 3], detail: Detail, occupied: &[u64], bounds: BoxBounds) -> Self {
        let along = blocks_along(dims);
        let none = LabelOfBox::default();
        let mut grid = Self::empty(detail, [0; 3], along, Fields::default(), Arc::new(none));
        grid.blocks.iter_mut().zip(occupied).for_each(|(block, &occupied)| block.occupied = occupied);
        grid.bounds = [bounds.lo, bounds.hi].map(f64x4);
        grid
    }

    /// The same without the boxes of `hidden` labels: what [`Bricks::new`] builds of the others. Bricks that no hidden box reaches into are
    /// copied. `volume` is the one that these were built of. Returns `None` where nothing is left.
    pub fn without(&self, volume: &CompressedVolume, hidden: &[bool]) -> Option<Self> {
        let is_hidden =
            |item: &u32| hidden.get(self.label_of(volume, *item) as usize).copied().unwrap_or(true);
        let along = blocks_along(volume.info().dims);
        let fields = Fields::empty_like(&self.fields);
        let mut made = Self::empty(self.detail, [0; 3], along, fields, Arc::clone(&self.labels));
        let mut bounds = BoxBounds::EMPTY;
        for (b, block) in self.blocks.iter().enumerate() {
            for (i, place) in (0u32..64).filter(|&place| block.occupied >> place & 1 != 0).enumerate() {
                let number = (b as u64) << PLACE_BITS | u64::from(place);
                let at = block.first_brick as usize + i;
                let items = self.items_of(at);
                if items.iter().any(is_hidden) {
                    let kept = items.iter().copied().filter(|item| !is_hidden(item));
                    bounds = bounds.union(made.add(volume, number, kept)?);
                } else {
                    bounds = bounds.union(made.copy(self, at, number, &bounds)?);
                }
            }
        }
        if made.bricks.is_empty() { None } else { made.finish(bounds) }
    }

    fn empty(
        detail: Detail,
        first: [u32; 3],
        along: [u32; 3],
        fields: Fields,
        labels: Arc<LabelOfBox>,
    ) -> Self {
        let blocks: usize = along.iter().map(|&n| n as usize).product();
        Self {
            detail,
            bounds: [[0.0; 4]; 2],
            last_block: f64x4(along.map(|n| n - 1)),
            strides: [1, along[0] as usize, along[0] as usize * along[1] as usize],
            first,
            blocks: vec![Block::default(); blocks],
            bricks: Vec::new(),
            fields,
            items: Vec::new(),
            sections: Vec::new(),
            labels,
        }
    }

    /// Appends the entry that marks where the last brick's fields and items end.
    fn finish(mut self, bounds: BoxBounds) -> Option<Self> {
        self.bounds = [bounds.lo, bounds.hi].map(f64x4);
        self.bricks.push(self.next_brick()?);
        self.bricks.shrink_to_fit();
        self.fields.shrink_to_fit();
        self.items.shrink_to_fit();
        self.sections.shrink_to_fit();
        Some(self)
    }

    /// Lowest voxel of the brick of this number: block and place in it.
    fn origin(&self, number: u64) -> [u32; 3] {
        let (block, place) = ((number >> PLACE_BITS) as u32, number as u32 & 63);
        let [_, along_y, along_z] = self.strides.map(|stride| stride as u32);
        let of_block = [block % along_y, block % along_z / along_y, block / along_z];
        each_axis(|a| BLOCK * (self.first[a] + of_block[a]) + BRICK * (place >> (2 * a) & 3))
    }

    /// Marks the brick that is appended next in its block.
    fn mark(&mut self, number: u64) -> Option<()> {
        let next = self.bricks.len().try_into().ok()?;
        let block = &mut self.blocks[(number >> PLACE_BITS) as usize];
        if block.occupied == 0 {
            block.first_brick = next;
        }
        block.occupied |= 1 << (number & 63);
        Some(())
    }

    /// Appends brick `at` of `other`, and returns the bounds of its voxels, as far as they are not within `known`.
    fn copy(&mut self, other: &Self, at: usize, number: u64, known: &BoxBounds) -> Option<BoxBounds> {
        let brick = &other.bricks[at];
        let of_brick = Brick { occupied: brick.occupied, full: brick.full, ..self.next_brick()? };
        let origin = self.origin(number);
        let is_known = (0..3).all(|a| known.lo[a] <= origin[a] && origin[a] + BRICK <= known.hi[a]);
        let mut bounds = BoxBounds::EMPTY;
        for c in (0u32..64).filter(|c| !is_known && brick.occupied >> c & 1 != 0) {
            let corner = each_axis(|a| origin[a] + 4 * (c >> (2 * a) & 3));
            bounds = bounds.union(bounds_of(other.field(brick, c), corner));
        }
        self.mark(number)?;
        let fields = brick.first_field as usize..other.bricks[at + 1].first_field as usize;
        self.fields.extend_from(&other.fields, fields);
        self.items.extend(other.items_of(at));
        self.sections.extend(other.sections_of(at));
        self.bricks.push(of_brick);
        Some(bounds)
    }

    fn next_brick(&self) -> Option<Brick> {
        let first_field = self.fields.len().try_into().ok()?;
        Some(Brick { occupied: 0, full: 0, first_field, first_item: self.items.len().try_into().ok()? })
    }

    /// Appends the next brick, made of the boxes that reach into it, and returns the bounds of its voxels; `None` where an index overflows.
    fn add(
        &mut self,
        volume: &CompressedVolume,
        number: u64,
        of_brick: impl Iterator<Item = u32>,
    ) -> Option<BoxBounds> {
        let origin = self.origin(number);
        let (mut brick, mut cells, mut bounds) = (self.next_brick()?, [0u64; 64], BoxBounds::EMPTY);
        for item in of_brick {
            let mut sections = 0u16;
            for_each_cell(volume, item, origin, &self.detail, |c, field| {
                cells[c as usize] |= field;
                sections |= 1 << section_of(c);
            });
            if sections != 0 {
                self.items.push(item);
                self.sections.push(sections);
            }
        }
        for (c, &field) in cells.iter().enumerate().filter(|(_, field)| **field != 0) {
            brick.occupied |= 1 << c;
            let corner = each_axis(|a| origin[a] + 4 * (c as u32 >> (2 * a) & 3));
            // Elements of the coarser levels may reach beyond the volume, where nothing is drawn.
            let field = field & within(corner, volume.info().dims);
            bounds = bounds.union(bounds_of(field, corner));
            if field == u64::MAX {
                brick.full |= 1 << c;
            } else {
                self.fields.push(field);
            }
        }
        if brick.occupied != 0 {
            self.mark(number)?;
            self.bricks.push(brick);
        }
        Some(bounds)
    }

    /// All blocks, x fastest.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// All bricks, and one entry after the last that marks where its fields and items end.
    pub fn bricks(&self) -> &[Brick] {
        &self.bricks
    }

    /// Lowest voxel of each brick.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn corners(&self) -> Result<Vec<[u32; 3]>, NoMemory> {
        let mut corners = reserved(self.bricks.len() - 1, "the corners of bricks")?;
        for (number, block) in (0u64..).zip(&self.blocks) {
            let places = (0..64).filter(|&place| block.occupied >> place & 1 != 0);
            corners.extend(places.map(|place| self.origin(number << PLACE_BITS | place)));
        }
        Ok(corners)
    }

    /// Voxel masks of the cells that are neither empty nor full.
    pub fn fields(&self) -> impl ExactSizeIterator<Item = u64> {
        (0..self.fields.len()).map(|place| self.fields.at(place))
    }

    /// Numbers of the boxes that reach into each brick, brick by brick.
    pub fn items(&self) -> &[u32] {
        &self.items
    }

    /// Numbers of the boxes that reach into one brick, rising.
    pub fn items_of(&self, brick: usize) -> &[u32] {
        &self.items[self.range_of(brick)]
    }

    fn sections_of(&self, brick: usize) -> &[u16] {
        &self.sections[self.range_of(brick)]
    }

    #[inline(always)]
    fn range_of(&self, brick: usize) -> Range<usize> {
        self.bricks[brick].first_item as usize..self.bricks[brick + 1].first_item as usize
    }

    /// Dense label of a box of `volume`, of which these bricks are made.
    #[inline(always)]
    pub fn label_of(&self, volume: &CompressedVolume, item: u32) -> u32 {
        self.labels.of(volume, item)
    }

    /// The levels of detail that are drawn.
    pub fn detail(&self) -> &Detail {
        &self.detail
    }

    /// Size on the heap in bytes.
    pub fn bytes(&self) -> u64 {
        let bytes = self.blocks.capacity() * size_of::<Block>()
            + self.bricks.capacity() * size_of::<Brick>()
            + self.items.capacity() * size_of::<u32>()
            + self.sections.capacity() * size_of::<u16>();
        bytes as u64 + self.fields.bytes() + self.labels.bytes()
    }

    /// Mask of a block's bricks that hold a voxel.
    #[inline(always)]
    pub fn occupied(&self, block: usize) -> u64 {
        self.blocks[block].occupied
    }

    /// The brick at an occupied place of a block, with its index.
    #[inline(always)]
    pub fn brick(&self, block: usize, place: u32) -> (usize, &Brick) {
        let block = &self.blocks[block];
        let below = block.occupied & ((1 << place) - 1);
        let number = block.first_brick as usize + below.count_ones() as usize;
        (number, &self.bricks[number])
    }

    /// The voxel mask of an occupied cell of a brick.
    #[inline(always)]
    pub fn field(&self, brick: &Brick, cell: u32) -> u64 {
        let partial = brick.occupied & !brick.full;
        let bit = 1 << cell;
        if partial & bit == 0 {
            return u64::MAX;
        }
        self.fields.at(brick.first_field as usize + (partial & (bit - 1)).count_ones() as usize)
    }

    /// The boxes of a brick with a cell in the section of `voxel`: all that may hold it, and perhaps others.
    #[inline(always)]
    pub fn boxes_near(&self, brick: usize, voxel: [u32; 3]) -> impl Iterator<Item = u32> {
        let range = self.range_of(brick);
        let section = section_of(cell_of(voxel));
        let sections = self.sections[range.clone()].iter().zip(&self.items[range]);
        sections.filter(move |(sections, _)| **sections >> section & 1 != 0).map(|(_, &item)| item)
    }

    /// The box that holds `voxel`, which is set, of a brick. `holds` decides among the boxes that are near; at coarser levels elements
    /// overlap, and the box with the lowest label is returned.
    #[inline]
    pub fn box_with(
        &self,
        volume: &CompressedVolume,
        brick: usize,
        voxel: [u32; 3],
        holds: impl Fn(u32) -> bool,
    ) -> Option<u32> {
        let mut near = self.boxes_near(brick, voxel);
        if !matches!(self.detail, Detail::Same(DetailLevel::Voxels)) {
            return near.filter(|&item| holds(item)).min_by_key(|&item| self.label_of(volume, item));
        }
        // The last one that is left needs no question.
        let mut at = near.next()?;
        for next in near {
            if holds(at) {
                break;
            }
            at = next;
        }
        Some(at)
    }

    /// The brick that `voxel` lies in; `None` where that holds nothing, and outside of the volume.
    pub fn brick_with(&self, voxel: [u32; 3]) -> Option<usize> {
        let voxel = each_axis(|a| voxel[a].wrapping_sub(BLOCK * self.first[a]));
        if (0..3).any(|a| f64::from(voxel[a] / BLOCK) > self.last_block[a]) {
            return None;
        }
        let block = (0..3).map(|a| self.strides[a] * (voxel[a] / BLOCK) as usize).sum();
        let place = cell_of(voxel.map(|v| v / 4));
        (self.occupied(block) >> place & 1 != 0).then(|| self.brick(block, place).0)
    }
}

/// Place of the cell of `voxel` in its brick.
#[inline(always)]
fn cell_of(voxel: [u32; 3]) -> u32 {
    (voxel[0] >> 2 & 3) | (voxel[1] >> 2 & 3) << 2 | (voxel[2] >> 2 & 3) << 4
}

/// The section that a cell of a brick lies in.
#[inline(always)]
fn section_of(cell: u32) -> u32 {
    (cell >> 1 & 1) | (cell >> 3 & 1) << 1 | (cell >> 4) << 2
}

/// Calls `visit` with each cell of the brick at `origin` where a box has an element of its level, and with that element's voxels. Elements
/// of the coarser levels may reach beyond the volume.
pub fn for_each_cell(
    volume: &CompressedVolume,
    item: u32,
    origin: [u32; 3],
    detail: &Detail,
    mut visit: impl FnMut(u32, u64),
) {
    let b = volume.place_of_box(item as usize);
    // Boxes are aligned to cells, not to bricks.
    let shift = each_axis(|a| (b.origin[a] as i32 - origin[a] as i32) / 4);
    let mut put = |c: u32, field: u64| {
        let at = each_axis(|a| (c >> (2 * a) & 3) as i32 + shift[a]);
        if at.iter().all(|at| (0..4).contains(at)) {
            visit((at[0] + 4 * at[1] + 16 * at[2]) as u32, field);
        }
    };
    // Data that a level does not need is not read, so those pages of a mapped file never come into memory.
    match detail.level(b.origin, b.extent) {
        DetailLevel::Voxels => volume.box_at(&b).node.fields().for_each(|(c, field)| put(c, field)),
        DetailLevel::Cells => {
            let occupied = volume.box_at(&b).node.occupied;
            (0..64).filter(|c| occupied >> c & 1 != 0).for_each(|c| put(c, u64::MAX));
        }
        DetailLevel::Boxes => {
            let holds = |c: &u32| (0..3).all(|a| 4 * (c >> (2 * a) & 3) < b.extent[a]);
            (0..64).filter(holds).for_each(|c| put(c, u64::MAX));
        }
    }
}

/// Whole numbers as f64 in four lanes, the last one 0.
fn f64x4([x, y, z]: [u32; 3]) -> [f64; 4] {
    [f64::from(x), f64::from(y), f64::from(z), 0.0]
}

/// Number of blocks along each axis of a volume of this size.
fn blocks_along(dims: [u32; 3]) -> [u32; 3] {
    dims.map(|d| d.div_ceil(BLOCK))
}

/// The pairs (block and place of a brick, box) for each brick that a box reaches into, sorted, of `along` blocks from that at `from`.
fn boxes_by_brick(
    volume: &CompressedVolume,
    items: &[u32],
    from: [u32; 3],
    along: [u32; 3],
) -> Vec<(u64, u32)> {
    // In bricks.
    let (start, end) = (from.map(|b| 4 * b), each_axis(|a| 4 * (from[a] + along[a])));
    let mut reaching = Vec::with_capacity(items.len());
    for &item in items {
        let place = volume.place_of_box(item as usize);
        let first = each_axis(|a| (place.origin[a] / BRICK).max(start[a]));
        let last = each_axis(|a| (place.origin[a] + place.extent[a] - 1) / BRICK);
        // A box may end beyond the volume, where it holds no voxel.
        let last = each_axis(|a| last[a].min((volume.info().dims[a] - 1) / BRICK).min(end[a] - 1));
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    let [i, j, k] = [x / 4 - from[0], y / 4 - from[1], z / 4 - from[2]];
                    let block = u64::from(k * along[1] + j) * u64::from(along[0]) + u64::from(i);
                    let place = (x & 3) | (y & 3) << 2 | (z & 3) << 4;
                    reaching.push((block << PLACE_BITS | u64::from(place), item));
                }
            }
        }
    }
    reaching.sort_unstable();
    reaching
}

/// Mask of the voxels of the cell at `corner` that lie within the volume.
pub fn within(corner: [u32; 3], dims: [u32; 3]) -> u64 {
    let [x, y, z] = each_axis(|a| (dims[a] - corner[a]).min(4));
    if [x, y, z] == [4; 3] {
        return u64::MAX;
    }
    let row = (1 << x) - 1;
    let layer = (0..y).fold(0, |layer, y| layer | row << (4 * y));
    (0..z).fold(0, |field, z| field | layer << (16 * z))
}

/// Bounds of the voxels of a non-empty field whose first voxel is at `corner`.
fn bounds_of(field: u64, corner: [u32; 3]) -> BoxBounds {
    // Folds every fourth bit, nibble and 16-bit word together, which leaves the coordinates that occur along each axis.
    let layer = (field | field >> 32) | (field | field >> 32) >> 16;
    let row = (layer | layer >> 8) | (layer | layer >> 8) >> 4;
    let of = [
        row & 15,
        (0..4).fold(0, |of, y| of | u64::from(layer >> (4 * y) & 15 != 0) << y),
        (0..4).fold(0, |of, z| of | u64::from(field >> (16 * z) & 0xFFFF != 0) << z),
    ];
    BoxBounds {
        lo: each_axis(|a| corner[a] + of[a].trailing_zeros()),
        hi: each_axis(|a| corner[a] + 64 - of[a].leading_zeros()),
    }
}

#[cfg(test)]
mod tests {
    use pumice_oracle::volumes::blobs;

    use super::*;

    /// Compares voxel by voxel with the volume's own boxes: a voxel is set where a box holds it, and the brick names that box.
    #[test]
    fn voxels_are_those_of_the_boxes() {
        let (_, volume) = blobs([90, 70, 150], 60, 9, 8);
        let items: Vec<u32> =
            (0..volume.boxes().len() as u32).filter(|&i| volume.label_of_box(i as usize) % 3 != 1).collect();
        let bricks = Bricks::new(&volume, &items, DetailLevel::Voxels).unwrap();
        let mut expected = std::collections::BTreeMap::new();
        let (mut bounds, shared) = (BoxBounds::EMPTY, std::cell::Cell::new(0));
        for &item in &items {
            let b = volume.get_box(item as usize);
            for (c, field) in b.node.fields() {
                for v in (0..64).filter(|v| field >> v & 1 != 0) {
                    let voxel = each_axis(|a| b.origin[a] + 4 * (c >> (2 * a) & 3) + (v >> (2 * a) & 3));
                    bounds = bounds.union(BoxBounds { lo: voxel, hi: voxel.map(|x| x + 1) });
                    assert_eq!(expected.insert(voxel, item), None);
                }
            }
        }
        assert_eq!(
            bricks.bounds.map(|p| p.map(|v| v as u32)),
            [bounds.lo, bounds.hi].map(|[x, y, z]| [x, y, z, 0])
        );
        for z in 0..150 {
            for y in 0..70 {
                for x in 0..90 {
                    let voxel = [x, y, z];
                    let of_block = [x, y, z].map(|v| v as usize / 64);
                    let block = (0..3).map(|a| bricks.strides[a] * of_block[a]).sum();
                    let at = |shift: u32| (x >> shift & 3) | (y >> shift & 3) << 2 | (z >> shift & 3) << 4;
                    let found = (bricks.occupied(block) >> at(4) & 1 != 0)
                        .then(|| bricks.brick(block, at(4)))
                        .filter(|(_, brick)| brick.occupied >> at(2) & 1 != 0)
                        .filter(|(_, brick)| bricks.field(brick, at(2)) >> at(0) & 1 != 0)
                        .and_then(|(number, _)| {
                            assert_eq!(bricks.brick_with(voxel), Some(number));
                            bricks.box_with(&volume, number, voxel, |item| {
                                shared.set(shared.get() + 1);
                                expected[&voxel] == item
                            })
                        });
                    assert_eq!(found, expected.get(&voxel).copied(), "{voxel:?}");
                    if let Some(item) = found {
                        assert_eq!(bricks.label_of(&volume, item), volume.label_of_box(item as usize));
                    }
                }
            }
        }
        assert!(expected.len() > 50_000 && shared.get() > 1000, "{} {shared:?}", expected.len());
    }

    /// Hiding labels of existing bricks gives, entry by entry, what is built of the other boxes, at every level; for one label, for most,
    /// and for those at the volume's edge, which its bounds follow.
    #[test]
    fn hiding_labels_equals_building_without_them() {
        let (_, volume) = blobs([90, 70, 150], 60, 9, 8);
        let all: Vec<u32> = (0..volume.boxes().len() as u32).collect();
        let at_edge = |label: usize| {
            all.iter().any(|&i| {
                volume.label_of_box(i as usize) as usize == label && volume.get_box(i as usize).origin[2] < 16
            })
        };
        let labels = volume.labels().len();
        let edge: Vec<bool> = (0..labels).map(at_edge).collect();
        let text = |b: &Bricks| {
            let Bricks { bounds, blocks, bricks, items, sections, .. } = b;
            let fields: Vec<u64> = b.fields().collect();
            format!("{bounds:?} {blocks:?} {bricks:?} {fields:?} {items:?} {sections:?}")
        };
        for level in [DetailLevel::Voxels, DetailLevel::Cells, DetailLevel::Boxes] {
            let bricks = Bricks::new(&volume, &all, level).unwrap();
            let whole = text(&bricks);
            let hide: [Vec<bool>; 4] = [
                (0..labels).map(|label| label == 7).collect(),
                (0..labels).map(|label| label % 5 != 0).collect(),
                edge.clone(),
                vec![false; labels],
            ];
            for hidden in hide {
                let is_shown = |i: &u32| !hidden[volume.label_of_box(*i as usize) as usize];
                let shown: Vec<u32> = all.iter().copied().filter(is_shown).collect();
                let expected = text(&Bricks::new(&volume, &shown, level).unwrap());
                assert_eq!(expected != whole, shown.len() < all.len(), "hiding a label makes a difference");
                assert!(text(&bricks.without(&volume, &hidden).unwrap()) == expected, "{level:?} {hidden:?}");
            }
            assert!(bricks.without(&volume, &vec![true; labels]).is_none());
        }
    }

    #[test]
    fn nothing_and_what_is_too_sparse_have_none() {
        let (_, volume) = blobs([90, 70, 60], 50, 9, 8);
        assert!(Bricks::new(&volume, &[], DetailLevel::Voxels).is_none());
    }
}

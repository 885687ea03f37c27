//! The voxels of a volume that are drawn, all labels together: 4³ bricks of 4³ cells of 4³ voxels per block, as 64-bit masks.
//!
//! The compressed volume stores each label by itself, so several boxes cover one brick of space, and the hierarchy has to find and walk
//! them one after another. Where every label is drawn at one level of detail, the label of a voxel does not matter until the ray hits it.
//! Here the voxels of all drawn labels are merged: a ray crosses space once, in order, and the first voxel found is the hit. (At coarser
//! levels labels overlap; the hit then reports the lowest label.) Bricks are derived from the volume for one choice of labels and one
//! level.
//!
//! ```text
//! blocks   64³ voxels each, x fastest: a mask of the bricks that hold a voxel, and the index of the first of these bricks
//! bricks   16³ voxels each, ordered by block and place in it: masks of the cells that hold a voxel and of the cells that hold all 64;
//!          the index of the first field
//! fields   for each cell that is neither empty nor full: a mask of its voxels
//! parts    for each brick: the boxes that reach into it, with the cells that they occupy there
//! ```
//! In every mask, the element at (x, y, z) is bit x + 4y + 16z.

use crate::BoxBounds;
use pumice_core::CompressedVolume;

use super::each_axis;
use super::lod::DetailLevel;

/// Voxels along the side of a block.
pub const BLOCK: u32 = 64;
/// Voxels along the side of a brick.
pub const BRICK: u32 = 16;

/// The merged voxels of one volume; the module documentation describes the arrays.
#[derive(Debug)]
pub struct Bricks {
    /// Level of detail that the bricks were built for.
    level: DetailLevel,
    /// Bounds of all voxels: lowest and highest corner, padded to four lanes.
    pub bounds: [[f64; 4]; 2],
    /// Index of the last block along each axis.
    pub last_block: [f64; 4],
    /// Distance in `blocks` from a block to its neighbour along each axis.
    pub strides: [usize; 3],
    blocks: Vec<Block>,
    bricks: Vec<Brick>,
    fields: Vec<u64>,
    parts: Vec<BrickPart>,
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
#[derive(Clone, Copy, Debug)]
pub struct Brick {
    /// Mask of the cells that hold a voxel.
    pub occupied: u64,
    /// Mask of the cells that hold all 64 voxels.
    pub full: u64,
    /// Index of its first field.
    pub first_field: u32,
    /// Index of its first part.
    pub first_part: u32,
}

/// The part of a box that lies in one brick.
#[derive(Clone, Copy, Debug)]
pub struct BrickPart {
    /// Mask of the brick's cells that the box occupies.
    pub cells: u64,
    /// Index of the box in the volume.
    pub item: u32,
    /// Dense label of the box.
    pub label: u32,
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
        let blocks_along = volume.info().dims.map(|d| d.div_ceil(BLOCK));
        let blocks = blocks_along.iter().map(|&n| u64::from(n)).try_fold(1u64, u64::checked_mul)?;
        if items.is_empty() || blocks > FEW_BLOCKS.max(BLOCKS_A_BOX * items.len() as u64) || blocks >> 31 != 0
        {
            return None;
        }
        let reaching = boxes_by_brick(volume, items, blocks_along);
        let mut made = Self::empty(level, blocks_along);
        let mut bounds = BoxBounds::EMPTY;
        for of_brick in reaching.chunk_by(|a, b| a.0 == b.0) {
            let number = of_brick.first()?.0;
            bounds = bounds.union(made.add(volume, number, of_brick.iter().map(|of| of.1))?);
        }
        made.finish(bounds)
    }

    /// The same without the boxes of `hidden` labels: what [`Bricks::new`] builds of the others. Bricks that no hidden box reaches into are
    /// copied. `volume` is the one that these were built of. Returns `None` where nothing is left.
    pub fn without(&self, volume: &CompressedVolume, hidden: &[bool]) -> Option<Self> {
        let is_hidden = |part: &BrickPart| hidden.get(part.label as usize).copied().unwrap_or(true);
        let blocks_along = volume.info().dims.map(|d| d.div_ceil(BLOCK));
        let mut made = Self::empty(self.level, blocks_along);
        let mut bounds = BoxBounds::EMPTY;
        for (b, block) in self.blocks.iter().enumerate() {
            for (i, place) in (0u32..64).filter(|&place| block.occupied >> place & 1 != 0).enumerate() {
                let number = (b as u64) << PLACE_BITS | u64::from(place);
                let at = block.first_brick as usize + i;
                let parts =
                    &self.parts[self.bricks[at].first_part as usize..self.bricks[at + 1].first_part as usize];
                if parts.iter().any(is_hidden) {
                    let kept = parts.iter().filter(|part| !is_hidden(part)).map(|part| part.item);
                    bounds = bounds.union(made.add(volume, number, kept)?);
                } else {
                    bounds = bounds.union(made.copy(self, at, parts, number, &bounds)?);
                }
            }
        }
        if made.bricks.is_empty() { None } else { made.finish(bounds) }
    }

    fn empty(level: DetailLevel, blocks_along: [u32; 3]) -> Self {
        let blocks: usize = blocks_along.iter().map(|&n| n as usize).product();
        Self {
            level,
            bounds: [[0.0; 4]; 2],
            last_block: f64x4(blocks_along.map(|n| n - 1)),
            strides: [1, blocks_along[0] as usize, blocks_along[0] as usize * blocks_along[1] as usize],
            blocks: vec![Block::default(); blocks],
            bricks: Vec::new(),
            fields: Vec::new(),
            parts: Vec::new(),
        }
    }

    /// Appends the entry that marks where the last brick's fields and parts end.
    fn finish(mut self, bounds: BoxBounds) -> Option<Self> {
        self.bounds = [bounds.lo, bounds.hi].map(f64x4);
        self.bricks.push(self.next_brick()?);
        self.bricks.shrink_to_fit();
        self.fields.shrink_to_fit();
        self.parts.shrink_to_fit();
        Some(self)
    }

    /// Lowest voxel of the brick of this number: block and place in it.
    fn origin(&self, number: u64) -> [u32; 3] {
        let (block, place) = ((number >> PLACE_BITS) as u32, number as u32 & 63);
        let [_, along_y, along_z] = self.strides.map(|stride| stride as u32);
        let of_block = [block % along_y, block % along_z / along_y, block / along_z];
        each_axis(|a| BLOCK * of_block[a] + BRICK * (place >> (2 * a) & 3))
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

    /// Appends brick `at` of `other`, whose parts these are, and returns the bounds of its voxels, as far as they are not within `known`.
    fn copy(
        &mut self,
        other: &Self,
        at: usize,
        parts: &[BrickPart],
        number: u64,
        known: &BoxBounds,
    ) -> Option<BoxBounds> {
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
        self.fields
            .extend(&other.fields[brick.first_field as usize..other.bricks[at + 1].first_field as usize]);
        self.parts.extend(parts);
        self.bricks.push(of_brick);
        Some(bounds)
    }

    fn next_brick(&self) -> Option<Brick> {
        let first_field = self.fields.len().try_into().ok()?;
        Some(Brick { occupied: 0, full: 0, first_field, first_part: self.parts.len().try_into().ok()? })
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
            let b = volume.place_of_box(item as usize);
            // Boxes are aligned to cells, not to bricks.
            let shift = each_axis(|a| (b.origin[a] as i32 - origin[a] as i32) / 4);
            let mut part = BrickPart { cells: 0, item, label: volume.label_of_box(item as usize) };
            let mut put = |c: u32, field: u64| {
                let at = each_axis(|a| (c >> (2 * a) & 3) as i32 + shift[a]);
                if at.iter().all(|at| (0..4).contains(at)) {
                    let c = (at[0] + 4 * at[1] + 16 * at[2]) as usize;
                    cells[c] |= field;
                    part.cells |= 1 << c;
                }
            };
            // Data that a level does not need is not read, so those pages of a mapped file never come into memory.
            match self.level {
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
            if part.cells != 0 {
                self.parts.push(part);
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

    /// All bricks, and one entry after the last that marks where its fields and parts end.
    pub fn bricks(&self) -> &[Brick] {
        &self.bricks
    }

    /// Voxel masks of the cells that are neither empty nor full.
    pub fn fields(&self) -> &[u64] {
        &self.fields
    }

    /// Parts of all bricks, brick by brick.
    pub fn parts(&self) -> &[BrickPart] {
        &self.parts
    }

    /// The level of detail that is drawn.
    pub fn level(&self) -> DetailLevel {
        self.level
    }

    /// Size on the heap in bytes.
    pub fn bytes(&self) -> u64 {
        let bytes = self.blocks.capacity() * size_of::<Block>()
            + self.bricks.capacity() * size_of::<Brick>()
            + self.fields.capacity() * size_of::<u64>()
            + self.parts.capacity() * size_of::<BrickPart>();
        bytes as u64
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
        self.fields[brick.first_field as usize + (partial & (bit - 1)).count_ones() as usize]
    }

    /// The box that holds `voxel` of a brick. `holds` decides among the boxes that occupy the voxel's cell; at coarser levels the box with
    /// the lowest label is returned.
    #[inline]
    pub fn part(&self, brick: usize, voxel: [u32; 3], holds: impl Fn(u32) -> bool) -> Option<BrickPart> {
        let cell = (voxel[0] >> 2 & 3) | (voxel[1] >> 2 & 3) << 2 | (voxel[2] >> 2 & 3) << 4;
        let end = self.bricks[brick + 1].first_part as usize;
        let parts = &self.parts[self.bricks[brick].first_part as usize..end];
        let mut there = parts.iter().filter(|part| part.cells >> cell & 1 != 0);
        if self.level != DetailLevel::Voxels {
            return there.min_by_key(|part| part.label).copied();
        }
        let first = there.next()?;
        match there.next() {
            None => Some(*first),
            Some(second) => [first, second].into_iter().chain(there).find(|part| holds(part.item)).copied(),
        }
    }
}

/// Whole numbers as f64 in four lanes, the last one 0.
fn f64x4([x, y, z]: [u32; 3]) -> [f64; 4] {
    [f64::from(x), f64::from(y), f64::from(z), 0.0]
}

/// The pairs (block and place of a brick, box) for each brick that a box reaches into, sorted.
fn boxes_by_brick(volume: &CompressedVolume, items: &[u32], blocks_along: [u32; 3]) -> Vec<(u64, u32)> {
    let mut reaching = Vec::with_capacity(items.len());
    for &item in items {
        let place = volume.place_of_box(item as usize);
        let first = place.origin.map(|v| v / BRICK);
        let last = each_axis(|a| (place.origin[a] + place.extent[a] - 1) / BRICK);
        // A box may end beyond the volume, where it holds no voxel.
        let last = each_axis(|a| last[a].min((volume.info().dims[a] - 1) / BRICK));
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    let block = u64::from(z / 4 * blocks_along[1] + y / 4) * u64::from(blocks_along[0])
                        + u64::from(x / 4);
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
fn within(corner: [u32; 3], dims: [u32; 3]) -> u64 {
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

    /// Compares voxel by voxel with the volume's own boxes: a voxel is set where a box holds it, and the part names that box.
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
                            bricks.part(number, voxel, |item| {
                                shared.set(shared.get() + 1);
                                expected[&voxel] == item
                            })
                        });
                    assert_eq!(found.map(|part| part.item), expected.get(&voxel).copied(), "{voxel:?}");
                    if let Some(part) = found {
                        assert_eq!(part.label, volume.label_of_box(part.item as usize));
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
        let text =
            |b: &Bricks| format!("{:?} {:?} {:?} {:?} {:?}", b.bounds, b.blocks, b.bricks, b.fields, b.parts);
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

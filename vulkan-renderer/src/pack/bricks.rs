//! Packs the drawn voxels of a volume as bricks. The form is the CPU's, but boxes have their numbers among the drawn boxes, and each has a
//! part with its label and all its cells in the brick: threads that read them one after another wait for less.

use pumice_core::reserve::reserved;
use pumice_core::{CompressedVolume, NoMemory};
use pumice_transport::BoxBounds;
use pumice_transport::geometry::bricks::{for_each_cell, within};
use pumice_transport::geometry::{BLOCK, BRICK, Bricks, Detail, DetailLevel, LodChoice};

use super::PackedBoxes;
use super::boxes::aabbs_of;
use crate::layout::{Brick, BrickBlock, BrickPart};

/// What the memory is for, in errors.
const BRICKS: &str = "a list of the bricks for the device";

/// Bricks of one instance, parallel to the arrays of [`Bricks`].
#[derive(Debug)]
pub struct PackedBricks {
    /// Blocks of the whole volume, x first.
    pub blocks: Vec<BrickBlock>,
    /// Bricks, and one more that marks the end of the last one's parts.
    pub bricks: Vec<Brick>,
    /// Fields (voxel masks) of cells that are neither empty nor full.
    pub fields: Vec<u64>,
    /// Parts: the boxes in each brick, for all bricks.
    pub parts: Vec<BrickPart>,
    /// Lowest voxel of each brick.
    pub corners: Vec<[u32; 3]>,
}

impl PackedBricks {
    /// Packs the boxes whose labels are `visible`. `None` where boxes have different levels of detail, where the volume is too sparse to be
    /// covered by blocks, and where coordinates of blocks would exceed 32 bits.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn new(
        volume: &CompressedVolume,
        boxes: &PackedBoxes,
        visible: &[bool],
        lod: LodChoice,
    ) -> Result<Option<Self>, NoMemory> {
        let Some(level) = level_of(lod) else { return Ok(None) };
        let dims = volume.info().dims;
        if dims.iter().any(|&n| n > u32::MAX - BLOCK) {
            return Ok(None);
        }
        let is_visible = |label: u32| visible.get(label as usize).copied().unwrap_or(false);
        let drawn = (0u32..).zip(&boxes.items).zip(&boxes.labels).filter(|&(_, &label)| is_visible(label));
        let mut numbers: Vec<(u32, u32)> = reserved(boxes.items.len(), BRICKS)?;
        numbers.extend(drawn.map(|((number, &item), _)| (item, number)));
        numbers.sort_unstable();
        let items: Vec<u32> = listed(numbers.iter().map(|&(item, _)| item))?;
        let Some(made) = Bricks::new(volume, &items, level) else { return Ok(None) };
        // Every part belongs to one of these items.
        let number_of = |item: u32| numbers[numbers.partition_point(|&(i, _)| i < item)].1;
        let blocks = made.blocks().iter();
        let blocks = blocks.map(|b| BrickBlock { occupied: b.occupied, first_brick: b.first_brick, page: 0 });
        let bricks = made.bricks().iter().map(|b| Brick {
            occupied: b.occupied,
            full: b.full,
            first_field: b.first_field,
            first_part: b.first_item,
        });
        let corners = made.corners()?;
        let parts = parts_of(volume, &made, &corners, number_of)?;
        Ok(Some(Self {
            blocks: listed(blocks)?,
            bricks: listed(bricks)?,
            fields: listed(made.fields())?,
            parts,
            corners,
        }))
    }

    /// The same without the boxes whose labels are not `visible`: what [`PackedBricks::new`] packs of the others. Bricks that no hidden box
    /// reaches into are copied. `items` has the number in the volume of each box, and `level` is that of these bricks.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn without(
        &self,
        volume: &CompressedVolume,
        items: &[u32],
        visible: &[bool],
        level: DetailLevel,
    ) -> Result<Self, NoMemory> {
        let dims = volume.info().dims;
        let is_visible = |part: &BrickPart| visible.get(part.label as usize).copied().unwrap_or(false);
        let parts_of = |at: usize| {
            &self.parts[self.bricks[at].first_part as usize..self.bricks[at + 1].first_part as usize]
        };
        let count = self.bricks.len() - 1;
        let touched = (0..count).filter(|&at| !parts_of(at).iter().all(is_visible)).count();
        let mut made = Self {
            blocks: reserved(self.blocks.len(), BRICKS)?,
            bricks: reserved(self.bricks.len(), BRICKS)?,
            // A full cell may be full no more.
            fields: reserved(self.fields.len() + 64 * touched, BRICKS)?,
            parts: reserved(self.parts.len(), BRICKS)?,
            corners: reserved(count, BRICKS)?,
        };
        for (block, number) in self.blocks.iter().zip(0..) {
            let first_brick = made.bricks.len() as u32;
            let mut occupied = 0;
            let places = (0..64).filter(|place| block.occupied >> place & 1 != 0);
            for (place, at) in places.zip(block.first_brick as usize..) {
                let corner = corner_of(dims, number, place);
                let (first_field, first_part) = (made.fields.len() as u32, made.parts.len() as u32);
                let old = self.bricks[at];
                made.parts.extend(parts_of(at).iter().filter(|part| is_visible(part)));
                let kept = &made.parts[first_part as usize..];
                let brick = if kept.len() == parts_of(at).len() {
                    let fields = old.first_field as usize..self.bricks[at + 1].first_field as usize;
                    made.fields.extend_from_slice(&self.fields[fields]);
                    Brick { first_field, first_part, ..old }
                } else {
                    let mut cells = [0; 64];
                    for part in kept {
                        let item = items[part.box_number as usize];
                        let put = |cell: u32, field| cells[cell as usize] |= field;
                        for_each_cell(volume, item, corner, &Detail::Same(level), put);
                    }
                    let mut brick = Brick { occupied: 0, full: 0, first_field, first_part };
                    for (cell, field) in (0u32..).zip(cells).filter(|&(_, field)| field != 0) {
                        let first = [0, 1, 2].map(|a| corner[a] + 4 * (cell >> (2 * a) & 3));
                        let field = field & within(first, dims);
                        brick.occupied |= 1 << cell;
                        match field {
                            u64::MAX => brick.full |= 1 << cell,
                            _ => made.fields.push(field),
                        }
                    }
                    brick
                };
                if brick.occupied != 0 {
                    occupied |= 1 << place;
                    made.bricks.push(brick);
                    made.corners.push(corner);
                }
            }
            let first_brick = if occupied == 0 { 0 } else { first_brick };
            made.blocks.push(BrickBlock { occupied, first_brick, page: 0 });
        }
        let (first_field, first_part) = (made.fields.len() as u32, made.parts.len() as u32);
        made.bricks.push(Brick { occupied: 0, full: 0, first_field, first_part });
        Ok(made)
    }

    /// Bounds of the occupied cells of each brick, all within `all`, for hardware's hierarchies; see [`PackedBoxes::aabbs`].
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn aabbs(&self, all: BoxBounds) -> Result<Vec<[f32; 6]>, NoMemory> {
        let bounds = self.corners.iter().zip(&self.bricks).map(|(corner, brick)| {
            let has =
                |a: usize, at: u32| (0..64).any(|c| c >> (2 * a) & 3 == at && brick.occupied >> c & 1 != 0);
            let first = |a: usize| (0..4).find(|&at| has(a, at)).unwrap_or(0);
            let last = |a: usize| (0..4).rfind(|&at| has(a, at)).unwrap_or(3);
            BoxBounds {
                lo: [0, 1, 2].map(|a| corner[a] + 4 * first(a)),
                hi: [0, 1, 2].map(|a| corner[a] + 4 * last(a) + 4),
            }
        });
        aabbs_of(bounds, all)
    }
}

/// The level of all boxes; `None` where they have different ones.
pub(crate) fn level_of(lod: LodChoice) -> Option<DetailLevel> {
    match lod {
        LodChoice::Voxels => Some(DetailLevel::Voxels),
        LodChoice::Cells => Some(DetailLevel::Cells),
        LodChoice::Boxes => Some(DetailLevel::Boxes),
        LodChoice::Distance { .. } => None,
    }
}

/// Lowest voxel of the brick at a place of a block, in a volume of this size.
fn corner_of(dims: [u32; 3], block: u32, place: u32) -> [u32; 3] {
    let along = dims.map(|n| n.div_ceil(BLOCK));
    let at = [block % along[0], block / along[0] % along[1], block / along[0] / along[1]];
    [0, 1, 2].map(|a| BLOCK * at[a] + BRICK * (place >> (2 * a) & 3))
}

/// The parts of bricks with these corners; `number_of` numbers the boxes, given the number of each in the volume.
pub(super) fn parts_of(
    volume: &CompressedVolume,
    bricks: &Bricks,
    corners: &[[u32; 3]],
    number_of: impl Fn(u32) -> u32,
) -> Result<Vec<BrickPart>, NoMemory> {
    let mut parts = reserved(bricks.items().len(), BRICKS)?;
    for (brick, &corner) in corners.iter().enumerate() {
        parts.extend(bricks.items_of(brick).iter().map(|&item| {
            let mut cells = 0;
            for_each_cell(volume, item, corner, bricks.detail(), |c, _| cells |= 1 << c);
            BrickPart { cells, box_number: number_of(item), label: bricks.label_of(volume, item) }
        }));
    }
    Ok(parts)
}

/// A list of all these, whose memory is asked for first.
fn listed<T>(all: impl ExactSizeIterator<Item = T>) -> Result<Vec<T>, NoMemory> {
    let mut list = reserved(all.len(), BRICKS)?;
    list.extend(all);
    Ok(list)
}

#[cfg(test)]
mod tests {
    use pumice_oracle::volumes::{Random, blobs};

    use super::super::PackedNodes;
    use super::*;

    /// What is left of the bricks of all boxes is, record by record, what is packed of the labels that are left; also in a volume whose
    /// last cells reach beyond it, and again from what is left.
    #[test]
    fn bricks_without_labels_are_those_of_the_others() {
        let mut random = Random(5);
        let (mut full, mut vanished) = (0, 0);
        for dims in [[70, 41, 38], [130, 67, 20]] {
            let (_, volume) = blobs(dims, 40, 90, 3);
            let all = vec![true; volume.labels().len()];
            let nodes = PackedNodes::new(&volume, &all);
            let boxes = PackedBoxes::new(&volume, &nodes, &all, true).unwrap();
            for lod in [LodChoice::Voxels, LodChoice::Cells, LodChoice::Boxes] {
                let level = level_of(lod).unwrap();
                let whole = PackedBricks::new(&volume, &boxes, &all, lod).unwrap().unwrap();
                for round in 0..12 {
                    let few = random.below(1 + round % 6);
                    let visible: Vec<bool> = all.iter().map(|_| random.below(6) >= few).collect();
                    let Some(expected) = PackedBricks::new(&volume, &boxes, &visible, lod).unwrap() else {
                        continue;
                    };
                    let less = whole.without(&volume, &boxes.items, &visible, level).unwrap();
                    assert!(bytes(&less) == bytes(&expected), "{dims:?} {lod:?} {visible:?}");
                    let again = less.without(&volume, &boxes.items, &visible, level).unwrap();
                    assert!(bytes(&again) == bytes(&expected));
                    full += whole.bricks.iter().map(|b| b.full.count_ones()).sum::<u32>()
                        - less.bricks.iter().map(|b| b.full.count_ones()).sum::<u32>();
                    vanished += whole.bricks.len() - less.bricks.len();
                }
            }
        }
        assert!(full > 100 && vanished > 100, "{full} full cells and {vanished} bricks went");
    }

    fn bytes(bricks: &PackedBricks) -> [Vec<u8>; 5] {
        let PackedBricks { blocks, bricks, fields, parts, corners } = bricks;
        [
            bytemuck::cast_slice(blocks).to_vec(),
            bytemuck::cast_slice(bricks).to_vec(),
            bytemuck::cast_slice(fields).to_vec(),
            bytemuck::cast_slice(parts).to_vec(),
            bytemuck::cast_slice(corners).to_vec(),
        ]
    }
}

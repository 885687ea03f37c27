//! Packs the drawn voxels of a volume as bricks. The form is the CPU's, but boxes have their numbers among the drawn boxes, and each has a
//! part with its label and all its cells in the brick: threads that read them one after another wait for less.

use pumice_core::reserve::reserved;
use pumice_core::{CompressedVolume, NoMemory};
use pumice_transport::BoxBounds;
use pumice_transport::geometry::bricks::for_each_cell;
use pumice_transport::geometry::{BLOCK, Bricks, DetailLevel, LodChoice};

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
        let level = match lod {
            LodChoice::Voxels => DetailLevel::Voxels,
            LodChoice::Cells => DetailLevel::Cells,
            LodChoice::Boxes => DetailLevel::Boxes,
            LodChoice::Distance { .. } => return Ok(None),
        };
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

    /// Bounds of the occupied cells of each brick for hardware's hierarchies; see [`PackedBoxes::aabbs`].
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn aabbs(&self, boxes: &PackedBoxes) -> Result<Vec<[f32; 6]>, NoMemory> {
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
        aabbs_of(bounds, boxes.around_all())
    }
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

//! Covers the cells of one label with boxes of at most 4³ cells (the method Snap4).
//!
//! ```text
//! boxes(cells):
//!     take the tight box of the cells (a voxel's tight box snapped down to a multiple of 4 starts at a cell)
//!     if no axis is longer than 4 cells: it is a box
//!     halve the longest axis at a multiple of 4 cells from the tight box's origin
//!     boxes(lower half), boxes(upper half)            each half is tightened again, which reduces the number of boxes
//! ```
//! The paper (§3.1) splits each label's region until it fits; tightening after every split gives 22 % fewer boxes than one tight grid. All
//! cuts lie between cells, so no cell is ever divided and boxes of one label cannot overlap. Callers give
//! the cells of one chunk at a time, so no box reaches beyond a chunk's faces.

use crate::cell::{BOX_CELLS, Cell, SOLID};
use crate::reserve::make_room;
use crate::{NoMemory, morton};

/// A box with its contents, before nodes are shared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RawBox {
    /// Lowest cell in the volume.
    pub(crate) origin: [u32; 3],
    /// Extent in cells, 1 to 4 each.
    pub(crate) extent: [u8; 3],
    /// Dense label index.
    pub(crate) label: u32,
    /// Bit c is set when cell c has a voxel, in the order of [`crate::node`].
    pub(crate) occupied: u64,
    /// Bit c is set when all 64 voxels of cell c have the label.
    pub(crate) solid: u64,
    /// Index in [`RawBoxes::fields`] of its first field. Only cells that are occupied and not solid have a field, in rising order of c.
    pub(crate) first_field: usize,
}

impl RawBox {
    /// Number of fields.
    pub(crate) fn fields(&self) -> usize {
        (self.occupied & !self.solid).count_ones() as usize
    }
}

/// Boxes and their fields, the masks of 64 voxels.
#[derive(Clone, Debug, Default)]
pub(crate) struct RawBoxes {
    pub(crate) boxes: Vec<RawBox>,
    pub(crate) fields: Vec<u64>,
}

impl RawBoxes {
    /// Appends the boxes and fields of `other`.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub(crate) fn append(&mut self, other: RawBoxes) -> Result<(), NoMemory> {
        let shift = self.fields.len();
        self.make_room(other.boxes.len(), other.fields.len())?;
        self.fields.extend_from_slice(&other.fields);
        self.boxes
            .extend(other.boxes.into_iter().map(|b| RawBox { first_field: b.first_field + shift, ..b }));
        Ok(())
    }

    /// Makes room for more boxes and fields.
    fn make_room(&mut self, boxes: usize, fields: usize) -> Result<(), NoMemory> {
        make_room(&mut self.boxes, boxes, BOXES)?;
        make_room(&mut self.fields, fields, BOXES)
    }
}

/// What memory is for, in errors.
pub(crate) const BOXES: &str = "a list of the boxes of the volume";

/// A region of fewer cells, which takes some 100 µs, is not worth a task of its own.
const PARALLEL_CELLS: usize = 1 << 15;

/// Bits of one coordinate while cells are divided. `key` then holds x | y << 21 | z << 42, which is quicker to compare than a Morton code.
const AXIS: u32 = morton::AXIS_BITS;
const AXIS_MASK: u64 = (1 << AXIS) - 1;

#[inline]
fn coordinate(packed: u64, axis: usize) -> u32 {
    (packed >> (AXIS * axis as u32) & AXIS_MASK) as u32
}

/// Appends the boxes of one label in one chunk to `out`, using `cells` as scratch space. The order of the boxes depends only on the cells.
///
/// # Errors
/// [`NoMemory`].
pub(crate) fn split_label(label: u32, cells: &mut [Cell], out: &mut RawBoxes) -> Result<(), NoMemory> {
    for cell in cells.iter_mut() {
        let [x, y, z] = morton::decode(cell.key).map(u64::from);
        cell.key = x | y << AXIS | z << (2 * AXIS);
    }
    split(label, cells, out)
}

fn split(label: u32, cells: &mut [Cell], out: &mut RawBoxes) -> Result<(), NoMemory> {
    if cells.is_empty() {
        return Ok(());
    }
    // Tighten to the cells that remain.
    let (mut low, mut high) = ([u32::MAX; 3], [0; 3]);
    for cell in cells.iter() {
        for axis in 0..3 {
            let c = coordinate(cell.key, axis);
            low[axis] = low[axis].min(c);
            high[axis] = high[axis].max(c);
        }
    }
    let extent = [0, 1, 2].map(|a| high[a] - low[a] + 1);

    // A region that fits becomes a box.
    let Some((axis, cut)) = cut(low, high) else {
        return emit(label, cells, low, extent, out);
    };
    let middle = partition(cells, |cell| coordinate(cell.key, axis) < cut);
    let (lower, upper) = cells.split_at_mut(middle);
    if lower.len().min(upper.len()) > PARALLEL_CELLS {
        let mut right = RawBoxes::default();
        let (of_lower, of_upper) =
            rayon::join(|| split(label, lower, out), || split(label, upper, &mut right));
        of_lower.and(of_upper)?;
        out.append(right)
    } else {
        split(label, lower, out)?;
        split(label, upper, out)
    }
}

/// Where cells from `low` to `high` are cut, at a whole number of boxes from the origin: the axis and the first cell of the upper half. `None`
/// where they fit into a box.
pub(crate) fn cut(low: [u32; 3], high: [u32; 3]) -> Option<(usize, u32)> {
    let extent = |a: usize| (a, high[a] - low[a] + 1);
    let (axis, longest) = (0..3).map(extent).fold((0, 0), |m, e| if e.1 > m.1 { e } else { m });
    let boxes = longest.div_ceil(BOX_CELLS);
    (longest > BOX_CELLS).then(|| (axis, low[axis] + boxes / 2 * BOX_CELLS))
}

/// Moves the cells for which `is_lower` holds to the front and returns their number. It works in place and is not stable: [`emit`] places a
/// box's cells by coordinate, so their order does not matter.
fn partition(cells: &mut [Cell], is_lower: impl Fn(&Cell) -> bool) -> usize {
    let mut lower = 0;
    for i in 0..cells.len() {
        let cell = cells[i];
        cells.swap(i, lower);
        lower += usize::from(is_lower(&cell));
    }
    lower
}

fn emit(
    label: u32,
    cells: &[Cell],
    low: [u32; 3],
    extent: [u32; 3],
    out: &mut RawBoxes,
) -> Result<(), NoMemory> {
    let mut fields = [0u64; 64];
    let (mut occupied, mut solid) = (0u64, 0u64);
    for cell in cells {
        let [x, y, z] = [0, 1, 2].map(|a| coordinate(cell.key, a) - low[a]);
        let c = x + 4 * y + 16 * z;
        fields[c as usize] = cell.mask;
        occupied |= 1 << c;
        solid |= u64::from(cell.mask == SOLID) << c;
    }
    let first_field = out.fields.len();
    let mut mixed = occupied & !solid;
    out.make_room(1, mixed.count_ones() as usize)?;
    while mixed != 0 {
        out.fields.push(fields[mixed.trailing_zeros() as usize]);
        mixed &= mixed - 1;
    }
    out.boxes.push(RawBox {
        origin: low,
        extent: extent.map(|e| e as u8),
        label,
        occupied,
        solid,
        first_field,
    });
    Ok(())
}

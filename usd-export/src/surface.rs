//! The surface that is drawn of some labels at one level of detail, as rectangles.
//!
//! ```text
//!   level    a label's elements                        of several labels in one place
//!   boxes    all cells of 4³ voxels of its boxes       the lowest dense index
//!   cells    the cells that hold a voxel of it         the lowest dense index
//!   voxels   its voxels                                there is one
//!
//!   block of 64³ elements, with a margin of one ─► for each axis, side and layer: which faces have nothing before them, by label
//!                                                  ┌─┬─┬─┐        ┌─────┐
//!                                                  ├─┼─┼─┘  ────► │  ┌──┘   merged: rectangles of one label that cover the same faces,
//!                                                  └─┴─┘          └──┘      widest first; plain: a rectangle a face
//! ```
//! These are the renderers' own rules for levels of detail ([`LodChoice`](pumice_transport::geometry::LodChoice)), so the surface is what
//! they draw of opaque labels that nothing cuts. Faces between shown labels are left out, because no ray from outside reaches them, unless
//! [`Interfaces::All`] asks for them. Elements end where the volume ends. A surface may be limited to a [`VoxelRegion`]: blocks outside of it
//! are not visited.

use bytemuck::Zeroable;
use pumice_core::{BoxView, CompressedVolume, Error, Job, grid::BRICK_VOXELS, morton};
use pumice_transport::geometry::DetailLevel;
use rayon::prelude::*;

use crate::{Interfaces, Result, VoxelRegion};

/// Side of a block in elements: with its margin a tenth more is looked at than is used.
pub(crate) const BLOCK: usize = 64;
const WITH_MARGIN: usize = BLOCK + 2;
/// From an element of a block to the next along each axis.
const STEPS: [usize; 3] = [1, WITH_MARGIN, WITH_MARGIN * WITH_MARGIN];
/// Number of blocks per thread that are processed at a time. It bounds the memory, and keeps threads busy while a slow block is finished.
const BLOCKS_A_THREAD: usize = 4;
/// Voxels by which a box that overlaps a region may reach beyond it: boxes have at most 16 along an axis.
const BEYOND_REGION: u32 = 15;

/// How faces become rectangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Merging {
    /// Neighbouring faces of one label in one plane become one rectangle, within blocks of 64³ elements.
    #[default]
    Merged,
    /// A square for each face.
    Plain,
}

/// A rectangle of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Zeroable)]
pub struct Rectangle {
    /// Its lowest corner in index space.
    pub low: [u32; 3],
    /// Extent along the two axes after [`Rectangle::axis`], which follow each other cyclically.
    pub size: [u16; 2],
    /// The axis that it is perpendicular to.
    pub axis: u8,
    /// Whether its outside is towards larger coordinates.
    pub is_up: bool,
    /// Dense index of its label.
    pub label: u32,
}

impl Rectangle {
    /// Its lowest and highest corner in index space.
    pub fn bounds(&self) -> [[u32; 3]; 2] {
        let axis = usize::from(self.axis);
        let mut high = self.low;
        high[(axis + 1) % 3] += u32::from(self.size[0]);
        high[(axis + 2) % 3] += u32::from(self.size[1]);
        [self.low, high]
    }

    /// Its corners in index space, counter-clockwise as seen from outside.
    pub fn corners(&self) -> [[u32; 3]; 4] {
        let axis = usize::from(self.axis);
        let (across, along) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut wide = self.low;
        wide[across] += u32::from(self.size[0]);
        let (mut far, mut high) = (wide, self.low);
        far[along] += u32::from(self.size[1]);
        high[along] = far[along];
        if self.is_up { [self.low, wide, far, high] } else { [high, far, wide, self.low] }
    }
}

/// Visits the surface of the labels that are `visible` (by dense index) at a level of detail, block by block in Morton order; the same
/// rectangles in the same order whatever the number of threads.
///
/// # Errors
/// [`Error::Caller`] where `visible` does not have one value per label; [`Error::Cancelled`]; any error of `visit`.
pub fn for_each_surface_block(
    volume: &CompressedVolume,
    visible: &[bool],
    level: DetailLevel,
    merging: Merging,
    job: &Job,
    mut visit: impl FnMut(&[Rectangle]) -> Result<()>,
) -> Result<()> {
    let surface = Surface::new(volume, visible, level, merging)?;
    surface.for_each_block(
        job,
        |origin| Ok(surface.rectangles_of(&surface.elements(origin)?, origin, |_| true)),
        |rectangles| if rectangles.is_empty() { Ok(()) } else { visit(&rectangles) },
    )
}

/// The surface of some labels at one level of detail.
pub(crate) struct Surface<'a> {
    volume: &'a CompressedVolume,
    visible: &'a [bool],
    level: DetailLevel,
    merging: Merging,
    interfaces: Interfaces,
    /// Nothing outside of it is shown.
    region: VoxelRegion,
}

/// Labels of the elements of a block and its margin, x fastest, as dense index + 1; 0 where nothing is shown.
pub(crate) type Elements = Vec<u32>;

impl<'a> Surface<'a> {
    /// # Errors
    /// [`Error::Caller`] where `visible` does not have one value per label.
    pub(crate) fn new(
        volume: &'a CompressedVolume,
        visible: &'a [bool],
        level: DetailLevel,
        merging: Merging,
    ) -> Result<Self> {
        let labels = volume.labels().len();
        if visible.len() != labels {
            let what = format!("visible: expected {labels} values, one a label, got {}", visible.len());
            return Err(Error::Caller(what).into());
        }
        let region = VoxelRegion::whole(volume.info().dims);
        Ok(Self { volume, visible, level, merging, interfaces: Interfaces::Outside, region })
    }

    /// The same with other faces between labels that are shown; [`Surface::new`] has none.
    pub(crate) fn with_interfaces(self, interfaces: Interfaces) -> Self {
        Self { interfaces, ..self }
    }

    /// The same without what lies outside of a region, if there is one.
    pub(crate) fn within(self, region: Option<VoxelRegion>) -> Self {
        Self { region: region.unwrap_or(self.region), ..self }
    }

    /// Outside of it nothing is shown.
    pub(crate) fn region(&self) -> VoxelRegion {
        self.region
    }

    /// Visits what `of_block` makes of the block at each lowest element, in Morton order of the blocks.
    ///
    /// # Errors
    /// [`Error::Cancelled`]; any error of `of_block` or `visit`.
    pub(crate) fn for_each_block<T: Send>(
        &self,
        job: &Job,
        of_block: impl Fn([u32; 3]) -> Result<T, Error> + Sync,
        visit: impl FnMut(T) -> Result<()>,
    ) -> Result<()> {
        let mut visit = visit;
        // Bricks rise in Morton order, so those of one block are consecutive.
        let block_voxels = BLOCK as u32 * self.side();
        let brick_bits = 3 * (block_voxels / BRICK_VOXELS).ilog2();
        let mut blocks: Vec<u64> = self.volume.grid()?.bricks().iter().map(|&b| b >> brick_bits).collect();
        blocks.dedup();
        let low = self.region.low().map(|c| c.saturating_sub(BEYOND_REGION));
        let high = self.region.high().map(|c| c + BEYOND_REGION);
        blocks.retain(|&block| {
            let first = morton::decode(block).map(|b| b * block_voxels);
            (0..3).all(|a| first[a] < high[a] && first[a] + block_voxels > low[a])
        });
        job.begin(blocks.len() as u64);
        for group in blocks.chunks(BLOCKS_A_THREAD * rayon::current_num_threads()) {
            let found: Vec<T> = group
                .par_iter()
                .map(|&block| {
                    job.check()?;
                    let found = of_block(morton::decode(block).map(|b| b * BLOCK as u32));
                    job.advance(1);
                    found
                })
                .collect::<Result<_, Error>>()?;
            found.into_iter().try_for_each(&mut visit)?;
        }
        Ok(())
    }

    /// Voxels along a side of an element.
    pub(crate) fn side(&self) -> u32 {
        match self.level {
            DetailLevel::Voxels => 1,
            DetailLevel::Cells | DetailLevel::Boxes => 4,
        }
    }

    /// Labels of the block whose lowest element is `origin`, and of its margin.
    pub(crate) fn elements(&self, origin: [u32; 3]) -> Result<Elements, Error> {
        match self.level {
            DetailLevel::Voxels => self.voxels(origin),
            DetailLevel::Cells => self.cells(origin, |view| view.node.occupied),
            DetailLevel::Boxes => self.cells(origin, |view| cells_of_extent(view.extent)),
        }
    }

    /// The surface of a block: the faces that `keep` takes, each asked about as a square of its own, as rectangles.
    pub(crate) fn rectangles_of(
        &self,
        elements: &[u32],
        origin: [u32; 3],
        mut keep: impl FnMut(&Rectangle) -> bool,
    ) -> Vec<Rectangle> {
        let mut rectangles = Vec::new();
        for (axis, shown) in shown(elements).iter().enumerate() {
            for is_up in [false, true] {
                self.faces(elements, shown, origin, (axis, is_up), &mut keep, &mut rectangles);
            }
        }
        rectangles
    }

    /// Lowest and highest corner in voxels of the block whose lowest element is `origin`.
    pub(crate) fn block_ends(&self, origin: [u32; 3]) -> [[u32; 3]; 2] {
        let dims = self.volume.info().dims;
        let low = origin.map(|o| o * self.side());
        [low, [0, 1, 2].map(|a| ((origin[a] + BLOCK as u32) * self.side()).min(dims[a]))]
    }

    /// Whether a shown element has no face towards its neighbour, given the labels of both as [`Elements`] has them.
    fn is_hidden(&self, label: u32, neighbor: u32) -> bool {
        match self.interfaces {
            Interfaces::Outside => neighbor != 0,
            Interfaces::All => neighbor == label,
        }
    }

    /// Visits the shown elements of a block without its margin: lowest and highest corner in voxels, dense index, and whether the element
    /// beyond each side hides it, in the order −x, +x, −y, +y, −z, +z.
    pub(crate) fn for_each_element(
        &self,
        elements: &[u32],
        origin: [u32; 3],
        mut visit: impl FnMut([[u32; 3]; 2], u32, [bool; 6]),
    ) {
        let dims = self.volume.info().dims;
        for i in 0..BLOCK.pow(3) {
            let at = [i % BLOCK, i / BLOCK % BLOCK, i / BLOCK / BLOCK];
            let place: usize = (0..3).map(|a| (at[a] + 1) * STEPS[a]).sum();
            let label = elements[place];
            if label == 0 {
                continue;
            }
            let low = [0, 1, 2].map(|a| (origin[a] + at[a] as u32) * self.side());
            let high = [0, 1, 2].map(|a| (low[a] + self.side()).min(dims[a]));
            let beyond = [0, 1, 2, 3, 4, 5].map(|side: usize| {
                let step = STEPS[side / 2];
                self.is_hidden(label, elements[if side % 2 == 1 { place + step } else { place - step }])
            });
            visit([low, high], label - 1, beyond);
        }
    }

    /// Labels of the voxels, where the elements are voxels.
    fn voxels(&self, origin: [u32; 3]) -> Result<Elements, Error> {
        self.voxels_around(origin.map(|o| i64::from(o) - 1), WITH_MARGIN)
    }

    /// Labels of a cube of voxels of this `side`, whose lowest may lie before the volume: as [`Elements`].
    ///
    /// # Errors
    /// Errors of the volume.
    pub(crate) fn voxels_around(&self, lowest: [i64; 3], side: usize) -> Result<Elements, Error> {
        let mut elements = vec![0; side.pow(3)];
        let [region_low, region_high] = [self.region.low(), self.region.high()].map(|c| c.map(i64::from));
        let low = [0, 1, 2].map(|a| lowest[a].max(region_low[a]));
        let size = [0, 1, 2].map(|a| (lowest[a] + side as i64).min(region_high[a]) - low[a]);
        if size.iter().any(|&n| n <= 0) {
            return Ok(elements);
        }
        let decoded = self.volume.decode_block(low.map(|c| c as u32), size.map(|n| n as u32))?;
        let start = [0, 1, 2].map(|a| (low[a] - lowest[a]) as usize);
        for (row, labels) in decoded.chunks_exact(size[0] as usize).enumerate() {
            let (y, z) = (row % size[1] as usize + start[1], row / size[1] as usize + start[2]);
            let place = (z * side + y) * side + start[0];
            let shown = labels.iter().map(|&l| if l != 0 && self.visible[l as usize - 1] { l } else { 0 });
            elements[place..][..labels.len()].iter_mut().zip(shown).for_each(|(to, from)| *to = from);
        }
        Ok(elements)
    }

    /// Labels of the cells, of which `of_box` says which a box has: bit x + 4 y + 16 z.
    fn cells(&self, origin: [u32; 3], of_box: impl Fn(&BoxView<'_>) -> u64) -> Result<Elements, Error> {
        let mut elements = vec![0; WITH_MARGIN.pow(3)];
        let bricks = origin.map(|o| [o.saturating_sub(1) / 4, (o + BLOCK as u32) / 4]);
        let grid = self.volume.grid()?;
        let mut boxes: Vec<u32> = Vec::new();
        for z in bricks[2][0]..=bricks[2][1] {
            for y in bricks[1][0]..=bricks[1][1] {
                for x in bricks[0][0]..=bricks[0][1] {
                    boxes.extend(grid.boxes_in([x, y, z]));
                }
            }
        }
        boxes.sort_unstable();
        boxes.dedup();
        // Of the boxes that overlap a region all cells are shown, where the elements are boxes.
        let is_of_cells = self.level == DetailLevel::Cells;
        for index in boxes {
            let label = self.volume.label_of_box(index as usize);
            let view = self.volume.get_box(index as usize);
            if !self.visible[label as usize] || !self.region.overlaps(view.origin, view.extent) {
                continue;
            }
            let cells = of_box(&view);
            // The box's lowest cell, counted from the margin's.
            let low = [0, 1, 2].map(|a| i64::from(view.origin[a] / 4) + 1 - i64::from(origin[a]));
            for bit in (0..64).filter(|bit| cells >> bit & 1 != 0) {
                let at = [bit & 3, bit >> 2 & 3, bit >> 4];
                let place = [0, 1, 2].map(|a| low[a] + at[a]);
                let cell = [0, 1, 2].map(|a| view.origin[a] + 4 * at[a] as u32);
                if is_of_cells && !self.region.overlaps(cell, [4; 3]) {
                    continue;
                }
                if place.iter().all(|p| (0..WITH_MARGIN as i64).contains(p)) {
                    let [x, y, z] = place.map(|p| p as usize);
                    let element = &mut elements[(z * WITH_MARGIN + y) * WITH_MARGIN + x];
                    *element = if *element == 0 { label + 1 } else { (*element).min(label + 1) };
                }
            }
        }
        Ok(elements)
    }

    /// Appends the faces on one side of the elements of a block that `keep` takes.
    fn faces(
        &self,
        elements: &[u32],
        shown: &[Layer],
        origin: [u32; 3],
        (axis, is_up): (usize, bool),
        keep: &mut impl FnMut(&Rectangle) -> bool,
        rectangles: &mut Vec<Rectangle>,
    ) {
        let (across, along) = ((axis + 1) % 3, (axis + 2) % 3);
        for depth in 0..BLOCK {
            let place = |[a, b]: [usize; 2]| {
                (depth + 1) * STEPS[axis] + (a + 1) * STEPS[across] + (b + 1) * STEPS[along]
            };
            let label = |at: [usize; 2]| elements[place(at)];
            let beyond = |at: [usize; 2]| {
                let place = place(at);
                elements[if is_up { place + STEPS[axis] } else { place - STEPS[axis] }]
            };
            let rectangle = |[a, b]: [usize; 2], [width, height]: [usize; 2]| {
                let mut low = origin;
                low[axis] += depth as u32 + u32::from(is_up);
                low[across] += a as u32;
                low[along] += b as u32;
                self.rectangle(low, [width as u32, height as u32], axis, is_up, label([a, b]) - 1)
            };
            let (own, before) = (&shown[depth + 1], &shown[if is_up { depth + 2 } else { depth }]);
            let mut layer = [0; BLOCK];
            for (b, faces) in layer.iter_mut().enumerate() {
                let hidden = match self.interfaces {
                    Interfaces::Outside => own[b] & before[b],
                    Interfaces::All => where_bits(own[b] & before[b], |a| label([a, b]) == beyond([a, b])),
                };
                *faces = where_bits(own[b] & !hidden, |a| keep(&rectangle([a, b], [1, 1])));
            }
            self.rectangles(layer, label, |place, size| rectangles.push(rectangle(place, size)));
        }
    }

    /// Divides the faces of a layer among rectangles of one label each.
    fn rectangles(
        &self,
        mut layer: Layer,
        label: impl Fn([usize; 2]) -> u32,
        mut put: impl FnMut([usize; 2], [usize; 2]),
    ) {
        for b in 0..BLOCK {
            while layer[b] != 0 {
                let a = layer[b].trailing_zeros() as usize;
                let [mut width, mut height] = [1, 1];
                if self.merging == Merging::Merged {
                    let own = label([a, b]);
                    let most = (layer[b] >> a).trailing_ones() as usize;
                    width = (0..most).take_while(|i| label([a + i, b]) == own).count();
                    let wide = bits(width) << a;
                    let is_same =
                        |&b: &usize| layer[b] & wide == wide && (a..a + width).all(|a| label([a, b]) == own);
                    height = (b..BLOCK).take_while(is_same).count();
                }
                layer[b..b + height].iter_mut().for_each(|row| *row &= !(bits(width) << a));
                put([a, b], [width, height]);
            }
        }
    }

    /// From elements to voxels; a cell may extend beyond the volume's end.
    fn rectangle(&self, low: [u32; 3], size: [u32; 2], axis: usize, is_up: bool, label: u32) -> Rectangle {
        let dims = self.volume.info().dims;
        let voxels = |element: u32, a: usize| (element * self.side()).min(dims[a]);
        let (across, along) = ((axis + 1) % 3, (axis + 2) % 3);
        let extent = |a: usize, size: u32| (voxels(low[a] + size, a) - voxels(low[a], a)) as u16;
        Rectangle {
            low: [0, 1, 2].map(|a| voxels(low[a], a)),
            size: [extent(across, size[0]), extent(along, size[1])],
            axis: axis as u8,
            is_up,
            label,
        }
    }
}

/// Some elements of a layer of a block: a row for each place along the second axis after the layer's own, in it a bit for each along the first.
type Layer = [u64; BLOCK];

/// The shown elements, for each axis by layer; the first layer and the last are of the margin.
fn shown(elements: &[u32]) -> [Vec<Layer>; 3] {
    let mut shown = [0, 1, 2].map(|_| vec![[0; BLOCK]; WITH_MARGIN]);
    for (row, labels) in elements.chunks_exact(WITH_MARGIN).enumerate() {
        let (y, z) = (row % WITH_MARGIN, row / WITH_MARGIN);
        for (x, _) in labels.iter().enumerate().filter(|(_, label)| **label != 0) {
            let at = [x, y, z];
            for (axis, layers) in shown.iter_mut().enumerate() {
                let [a, b] = [at[(axis + 1) % 3], at[(axis + 2) % 3]];
                if (1..=BLOCK).contains(&a) && (1..=BLOCK).contains(&b) {
                    layers[at[axis]][b - 1] |= 1 << (a - 1);
                }
            }
        }
    }
    shown
}

/// The lowest bits, so many of 1 to 64.
fn bits(count: usize) -> u64 {
    u64::MAX >> (BLOCK - count)
}

/// Those of some bits, by number, that are taken.
fn where_bits(bits: u64, mut takes: impl FnMut(usize) -> bool) -> u64 {
    let (mut left, mut taken) = (bits, 0);
    while left != 0 {
        let at = left.trailing_zeros();
        taken |= u64::from(takes(at as usize)) << at;
        left &= left - 1;
    }
    taken
}

/// All cells of a box of this extent in voxels: bit x + 4 y + 16 z.
fn cells_of_extent(extent: [u32; 3]) -> u64 {
    let [x, y, z] = extent.map(|e| e / 4);
    let row = (1u64 << x) - 1;
    let plane = (0..y).fold(0, |plane, y| plane | row << (4 * y));
    (0..z).fold(0, |cells, z| cells | plane << (16 * z))
}

#[cfg(test)]
mod tests {
    use pumice_oracle::volumes;

    use super::*;

    /// Blocks that are visited for a level of detail and a region.
    fn visited(volume: &CompressedVolume, level: DetailLevel, region: Option<VoxelRegion>) -> usize {
        let visible = vec![true; volume.labels().len()];
        let surface = Surface::new(volume, &visible, level, Merging::Merged).unwrap().within(region);
        let mut count = 0;
        let visit = |()| {
            count += 1;
            Ok(())
        };
        surface.for_each_block(&Job::new(), |_| Ok(()), visit).unwrap();
        count
    }

    #[test]
    fn blocks_outside_of_a_region_are_not_visited() {
        let (_, volume) = volumes::volume([300, 130, 70], |_, _, _| 1);
        let region = VoxelRegion::new([150, 80, 20], [170, 90, 30]).unwrap();
        assert_eq!(visited(&volume, DetailLevel::Voxels, None), 5 * 3 * 2);
        // One block of 64³ has the region; boxes of others may not reach it, being 16 voxels long.
        assert_eq!(visited(&volume, DetailLevel::Voxels, Some(region)), 1);
        assert_eq!([None, Some(region)].map(|r| visited(&volume, DetailLevel::Cells, r)), [2, 1]);
    }
}

//! What the labels that are drawn give the pages of a volume whose boxes are not in memory: bricks and boxes of each page in a temporary
//! file, and a grid that says where bricks are.
//!
//! ```text
//! grid     the blocks of the whole volume, with the mask of the bricks of each: always in memory, so empty space loads nothing
//! pages    those that draw something: where each is in a temporary file. A renderer keeps some of them in memory
//! ```
//! A ray walks through the grid as through bricks in memory, with the same numbers, and asks for a page only at a block where it meets a
//! brick. All boxes that reach into a page are in it, so what is found there is what the whole volume would give.
//!
//! With other labels shown, only pages that have one of the labels that changed are made anew:
//!
//! ```text
//! shown before    page 0   page 1   page 2   page 3      file a
//! shown now       page 0      │     page 2   page 3      in both
//!                             └─► new page               file b, until more is left in such files than all pages take
//! ```
//! With levels of detail by distance, a page has its boxes' levels. From another camera, only pages where a box may have another level are
//! made anew.

use std::collections::BTreeSet;
use std::sync::Arc;

use pumice_core::pages::{NodeDetail, StoredBytes, encode};
use pumice_core::{BoxPlace, CompressedVolume, Pages, Scratch};
use rayon::prelude::*;

use super::bricks::{BLOCK, Bricks};
use super::each_axis;
use super::lod::{Detail, DetailLevel};
use super::visible_boxes::{for_each_visible_box, visible_items};
use crate::{BoxBounds, RenderError};

/// Samples that a pass adds where pages are loaded again: loading them costs a pass a few samples' time, not each sample.
pub const SAMPLES_A_PASS_OF_PAGES: u32 = 8;

/// Place of a page of the volume that draws nothing.
const NONE: u32 = u32::MAX;

/// Temporary files that hold drawn pages at most, for each of which a process has a descriptor. A change of labels adds one; then all pages
/// are made anew, in one file.
const MOST_FILES: usize = 16;

/// A page as it is drawn, in a temporary file.
#[derive(Debug)]
pub struct DrawnPage {
    index: usize,
    scratch: Arc<Scratch>,
    stored: StoredBytes,
    bytes: u64,
    counts: PageCounts,
}

/// Numbers of things in a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PageCounts {
    /// Boxes that reach into it.
    pub boxes: usize,
    /// 16-bit words of their nodes.
    pub node_words: usize,
    /// Bricks that hold a voxel.
    pub bricks: usize,
    /// Voxel masks of cells that are neither empty nor full.
    pub fields: usize,
    /// Parts: boxes in each brick, for all bricks.
    pub parts: usize,
}

impl PageCounts {
    /// Of the boxes of a page and their bricks.
    pub fn of(boxes: &CompressedVolume, bricks: &Bricks) -> Self {
        Self {
            boxes: boxes.boxes().len(),
            node_words: boxes.nodes().len(),
            // (One more marks the end of the last one's parts.)
            bricks: bricks.bricks().len() - 1,
            fields: bricks.fields().len(),
            parts: bricks.items().len(),
        }
    }
}

impl DrawnPage {
    /// Its index among the pages of the volume.
    pub fn index(&self) -> usize {
        self.index
    }

    /// Bytes of its bricks, boxes and nodes in memory.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Bytes that are read at once where it is loaded.
    pub fn stored_bytes(&self) -> u64 {
        self.stored.bytes()
    }

    /// What is in it.
    pub fn counts(&self) -> PageCounts {
        self.counts
    }
}

/// What the drawn labels give a page of the volume.
#[derive(Clone, Copy, Debug)]
struct OfPage {
    /// Its place among the drawn pages; [`NONE`] where no voxel of these labels lies in it.
    place: u32,
    /// Boxes whose lowest voxel it has.
    own: u32,
    /// Bounds of all its boxes, and of the voxels.
    bounds: BoxBounds,
    of_voxels: BoxBounds,
}

/// What was drawn before, of which pages stay.
#[derive(Clone, Copy, Debug)]
pub struct Former<'a> {
    /// Its pages.
    pub pages: &'a DrawnPages,
    /// The labels that it draws, by dense index.
    pub visible: &'a [bool],
}

/// What the drawn labels of a volume take in pages.
#[derive(Clone, Copy, Debug)]
pub struct DrawnInPages {
    /// Boxes, each counted once.
    pub boxes: usize,
    /// Their bounds; `None` where there is no box.
    pub bounds: Option<BoxBounds>,
}

/// The pages that a choice of labels draws (see the module).
#[derive(Debug)]
pub struct DrawnPages {
    dims: [u32; 3],
    pages: Arc<Pages>,
    detail: Detail,
    grid: Bricks,
    /// The place of each page among the drawn ones, x fastest.
    places: Vec<u32>,
    drawn: Vec<Arc<DrawnPage>>,
    /// By the index of the page in the volume.
    of_pages: Vec<OfPage>,
    is_tight: bool,
}

/// A page as it is made.
struct Made {
    /// `None` where nothing of it is drawn.
    page: Option<Arc<DrawnPage>>,
    of_page: OfPage,
    /// Masks of the bricks of its blocks, with the blocks' places in the grid.
    occupied: Vec<(usize, u64)>,
}

impl DrawnPages {
    /// Makes the pages of the labels that are drawn, at the levels of `detail`; none where no label is drawn. Pages that `former` draws
    /// alike are those of `former`. `is_tight`: bounds are those of voxels, not of boxes.
    ///
    /// # Errors
    /// [`RenderError::Scene`] where the volume is too sparse for bricks; [`RenderError::Source`] where a page cannot be read or written;
    /// [`RenderError::Memory`].
    pub fn new(
        volume: &CompressedVolume,
        pages: &Arc<Pages>,
        visible: &[bool],
        detail: Detail,
        is_tight: bool,
        former: Option<Former<'_>>,
    ) -> Result<(Option<Self>, DrawnInPages), RenderError> {
        let dims = volume.info().dims;
        let scratch = Arc::new(pages.another_file());
        let blocks = dims.map(|d| d.div_ceil(BLOCK));
        let serves = |f: &Former<'_>| Arc::ptr_eq(&f.pages.pages, pages) && f.pages.is_tight == is_tight;
        let reused = former.filter(|f| serves(f) && f.pages.files() < MOST_FILES);
        let shows = |labels: &[bool], label: u32| labels.get(label as usize).copied().unwrap_or(false);
        let is_alike = |f: &Former<'_>, index: usize| {
            pages.labels(index).iter().all(|&l| shows(f.visible, l) == shows(visible, l))
                && f.pages.has_levels_of(&detail, index)
        };
        let made: Vec<Made> = (0..pages.len())
            .into_par_iter()
            .map(|index| match reused {
                Some(f) if is_alike(&f, index) => Ok(f.pages.again(index)),
                _ => make(pages, index, visible, detail, is_tight, &scratch),
            })
            .collect::<Result<_, _>>()?;
        let (mut boxes, mut bounds) = (0, BoxBounds::EMPTY);
        for Made { of_page, .. } in &made {
            boxes += of_page.own as usize;
            bounds = bounds.union(of_page.bounds);
        }
        let in_pages = DrawnInPages { boxes, bounds: (boxes > 0).then_some(bounds) };
        if boxes == 0 {
            return Ok((None, in_pages));
        }
        if !Bricks::are_possible(dims, boxes as u64) {
            return Err(RenderError::Scene(format!(
                "memory limit: {boxes} boxes in {} blocks are too few to draw from disk, and take little memory: leave the limit out",
                blocks.iter().map(|&n| u64::from(n)).product::<u64>()
            )));
        }

        // The grid, which has the bounds that the bricks of the whole volume would have.
        let mut occupied = vec![0; blocks.iter().map(|&n| n as usize).product()];
        let mut places = vec![NONE; pages.along().iter().map(|&n| n as usize).product()];
        let (mut drawn, mut of_pages, mut of_voxels) = (Vec::new(), Vec::new(), BoxBounds::EMPTY);
        for (index, Made { page, of_page, occupied: of_blocks }) in made.into_iter().enumerate() {
            let place = if page.is_some() { drawn.len() as u32 } else { NONE };
            of_pages.push(OfPage { place, ..of_page });
            let Some(page) = page else { continue };
            places[pages.number(index) as usize] = place;
            of_voxels = of_voxels.union(of_page.of_voxels);
            of_blocks.into_iter().for_each(|(block, mask)| occupied[block] = mask);
            drawn.push(page);
        }
        let grid = Bricks::grid_of(dims, detail, &occupied, of_voxels);
        let pages = Arc::clone(pages);
        Ok((Some(Self { dims, pages, detail, grid, places, drawn, of_pages, is_tight }), in_pages))
    }

    /// Number of temporary files that its pages are in.
    fn files(&self) -> usize {
        let files: BTreeSet<_> = self.drawn.iter().map(|page| Arc::as_ptr(&page.scratch).addr()).collect();
        files.len()
    }

    /// Whether each box of the page at `index` of the volume certainly has the level that `other` gives it.
    fn has_levels_of(&self, other: &Detail, index: usize) -> bool {
        let bounds = &self.of_pages[index].bounds;
        if self.detail == *other || *bounds == BoxBounds::EMPTY {
            return true;
        }
        let level = self.detail.everywhere(bounds);
        level.is_some() && level == other.everywhere(bounds)
    }

    /// The page at `index` of the volume, as it is.
    fn again(&self, index: usize) -> Made {
        let of_page = self.of_pages[index];
        let page = self.drawn.get(of_page.place as usize).map(Arc::clone);
        let occupied = match &page {
            Some(_) => {
                self.blocks_of(index).map(|block| (block, self.grid.blocks()[block].occupied)).collect()
            }
            None => Vec::new(),
        };
        Made { page, of_page, occupied }
    }

    /// The pages of the volume.
    pub fn of_volume(&self) -> &Arc<Pages> {
        &self.pages
    }

    /// Size of the volume in voxels.
    pub fn dims(&self) -> [u32; 3] {
        self.dims
    }

    /// The levels of detail that are drawn.
    pub fn detail(&self) -> &Detail {
        &self.detail
    }

    /// Blocks of the whole volume, without bricks.
    pub fn grid(&self) -> &Bricks {
        &self.grid
    }

    /// The pages that draw something.
    pub fn drawn(&self) -> &[Arc<DrawnPage>] {
        &self.drawn
    }

    /// The place among [`DrawnPages::drawn`] of a page of the volume; `None` where that draws nothing.
    pub fn place_of(&self, index: usize) -> Option<usize> {
        Some(self.of_pages.get(index)?.place as usize).filter(|&place| place < self.drawn.len())
    }

    /// The place among [`DrawnPages::drawn`] of the page that a voxel of the volume lies in; `None` where that draws nothing.
    pub fn place_at(&self, voxel: [u32; 3]) -> Option<usize> {
        let [x, y, z] = voxel.map(|v| u64::from(v / self.pages.side()));
        let [along_x, along_y, _] = self.pages.along();
        let place = *self.places.get((x + along_x * (y + along_y * z)) as usize)? as usize;
        (place < self.drawn.len()).then_some(place)
    }

    /// Places in the grid of the blocks of the page at `index` of the volume, in the order of the page's own blocks.
    pub fn blocks_of(&self, index: usize) -> impl Iterator<Item = usize> {
        places_of_blocks(&self.pages, index, self.dims)
    }

    /// Bytes of the grid and of the tables of pages, which stay in memory.
    pub fn table_bytes(&self) -> u64 {
        let table = self.drawn.len() * (size_of::<Arc<DrawnPage>>() + size_of::<DrawnPage>())
            + self.of_pages.len() * size_of::<OfPage>()
            + self.places.len() * 4;
        self.grid.bytes() + self.pages.table_bytes() + table as u64
    }

    /// Reads the page at a place: a volume of its boxes, in places of the whole volume, and their bricks.
    ///
    /// # Errors
    /// As [`Pages::read`].
    ///
    /// # Panics
    /// When `place` is out of range.
    pub fn read(&self, place: usize) -> pumice_core::Result<(CompressedVolume, Bricks)> {
        let page = &self.drawn[place];
        let bytes = page.stored.read(&page.scratch)?;
        let mut rest = bytes.as_slice();
        let damaged = || pumice_core::Error::Caller("a page of the volume has changed on disk".into());
        let volume = self.pages.decode(page.index, &mut rest).ok_or_else(damaged)?;
        let bricks = Bricks::take(&mut rest, self.detail).ok_or_else(damaged)?;
        Ok((volume, bricks))
    }
}

/// Makes a page of the labels that are drawn, and appends it to the file.
fn make(
    pages: &Pages,
    index: usize,
    visible: &[bool],
    detail: Detail,
    is_tight: bool,
    scratch: &Arc<Scratch>,
) -> Result<Made, RenderError> {
    let read = pages.read(index).map_err(source)?;
    let items = visible_items(&read, visible)?;
    // What a level does not need takes no memory.
    let of_box = |place: &BoxPlace| match detail.level(place.origin, place.extent) {
        DetailLevel::Voxels => NodeDetail::Voxels,
        DetailLevel::Cells => NodeDetail::Cells,
        DetailLevel::Boxes => NodeDetail::Nothing,
    };
    let is_whole = items.len() == read.boxes().len() && detail == Detail::Same(DetailLevel::Voxels);
    let volume = if is_whole { read } else { read.with_coarser_boxes(&items, of_box).map_err(source)? };
    let side = pages.side();
    let origin = pages.origin(pages.number(index));
    let (mut own, mut bounds) = (0, BoxBounds::EMPTY);
    for_each_visible_box(&volume, visible, is_tight, |of_box, item| {
        let place = volume.place_of_box(item as usize);
        own += u32::from((0..3).all(|a| place.origin[a] / side == origin[a] / side));
        bounds = bounds.union(of_box);
    });
    let all: Vec<u32> = (0..volume.boxes().len() as u32).collect();
    let dims = volume.info().dims;
    let (first, along) = blocks_of(pages, index, dims);
    let of_page = OfPage { place: NONE, own, bounds, of_voxels: BoxBounds::EMPTY };
    let Some(bricks) = Bricks::of_blocks(&volume, &all, detail, first, along) else {
        return Ok(Made { page: None, of_page, occupied: Vec::new() });
    };
    let mut bytes = Vec::new();
    encode(&volume, &mut bytes).map_err(source)?;
    bricks.put(&mut bytes)?;
    let stored = StoredBytes::append(scratch, &bytes).map_err(source)?;
    let masks = bricks.blocks().iter().map(|block| block.occupied);
    let occupied = places_of_blocks(pages, index, dims).zip(masks).collect();
    let [lo, hi] = bricks.bounds.map(|corner| each_axis(|a| corner[a] as u32));
    // The leaves are those of the volume, and count there.
    let parts = volume.resident_parts();
    let of_volume: u64 = parts.iter().filter(|of| of.0 != "leaves").map(|of| of.1).sum();
    let bytes = of_volume + bricks.bytes() + (size_of::<CompressedVolume>() + size_of::<Bricks>()) as u64;
    let counts = PageCounts::of(&volume, &bricks);
    let page = DrawnPage { index, scratch: Arc::clone(scratch), stored, bytes, counts };
    let of_page = OfPage { of_voxels: BoxBounds { lo, hi }, ..of_page };
    Ok(Made { page: Some(Arc::new(page)), of_page, occupied })
}

/// The lowest block of the page at `index`, and its blocks along each axis.
fn blocks_of(pages: &Pages, index: usize, dims: [u32; 3]) -> ([u32; 3], [u32; 3]) {
    let first = pages.origin(pages.number(index)).map(|v| v / BLOCK);
    (first, each_axis(|a| (pages.side() / BLOCK).min(dims[a].div_ceil(BLOCK) - first[a])))
}

/// Places in the grid of the blocks of the page at `index`, x fastest.
fn places_of_blocks(pages: &Pages, index: usize, dims: [u32; 3]) -> impl Iterator<Item = usize> {
    let (first, along) = blocks_of(pages, index, dims);
    let of_grid = dims.map(|d| d.div_ceil(BLOCK) as usize);
    (0..along.iter().product::<u32>()).map(move |b| {
        let at = [b % along[0], b / along[0] % along[1], b / (along[0] * along[1])];
        let at = each_axis(|a| (first[a] + at[a]) as usize);
        at[0] + of_grid[0] * (at[1] + of_grid[1] * at[2])
    })
}

/// What a scene asks for and a volume on disk does not give.
pub fn refused(what: &str) -> RenderError {
    RenderError::Scene(format!("memory limit: {what} needs the whole volume in memory: leave the limit out"))
}

/// The error of reading or writing a page.
pub fn source(error: pumice_core::Error) -> RenderError {
    match error {
        pumice_core::Error::Memory(error) => RenderError::Memory(error),
        error => RenderError::Source(error.to_string()),
    }
}

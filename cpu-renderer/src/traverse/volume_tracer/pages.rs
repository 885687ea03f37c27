//! Bricks and boxes that are loaded when a ray meets them, for volumes that do not fit into memory.
//!
//! ```text
//! grid     the blocks of the whole volume, with the mask of the bricks of each: always in memory, so empty space loads nothing
//! slots    a page each: where it is in a temporary file, and its bricks and boxes while they are in memory
//! ```
//! A ray walks through the grid as through bricks in memory, with the same numbers, and asks for a page only at a block where it meets a
//! brick. All boxes that reach into a page are in it, so what is found there is what the whole volume would give: pictures are equal bit by
//! bit, whatever is in memory and in whatever order it came. A page stays while a ray uses it.
//!
//! With other labels shown, only pages that have one of the labels that changed are made anew:
//!
//! ```text
//! shown before    slot 0   slot 1   slot 2   slot 3      file a
//! shown now       slot 0      │     slot 2   slot 3      in both: what is in memory stays there
//!                             └─► new slot               file b, until more is left in such files than all pages take
//! ```

use std::collections::BTreeSet;
use std::ops::Deref;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::AcqRel, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use glam::DAffine3;
use pumice_core::pages::{StoredBytes, encode};
use pumice_core::reserve::size_text;
use pumice_core::residency::{Answer, Droppable};
use pumice_core::{CompressedVolume, Pages, Scratch};
use pumice_transport::geometry::bricks::{BLOCK, Bricks};
use pumice_transport::geometry::cuts::Cuts;
use pumice_transport::geometry::each_axis;
use pumice_transport::geometry::lod::{Detail, DetailLevel};
use pumice_transport::geometry::placement::Placement;
use pumice_transport::geometry::visible_boxes::{for_each_visible_box, visible_items};
use pumice_transport::{BoxBounds, RenderError};
use rayon::prelude::*;

use super::super::brick_walk::BrickStore;
use super::super::f64x4::Lanes;
use super::drawn_boxes::DrawnBoxes;
use super::{VolumeTracer, making};

/// Pages that a thread may hold at once: one that a ray is in, and one that is loaded.
const PAGES_A_THREAD: u64 = 2;

/// Number in the tables of places, and of pages of the volume, where nothing is drawn.
const NONE: u32 = u32::MAX;

/// Temporary files that hold drawn pages at most, for each of which a process has a descriptor. A change of labels adds one; then all pages
/// are made anew, in one file.
const MOST_FILES: usize = 16;

/// A page in memory: the geometry of its boxes alone.
#[derive(Debug)]
pub(in super::super) struct Page {
    tracer: VolumeTracer,
    bricks: Arc<Bricks>,
}

/// A page that stays in memory while this exists.
pub(in super::super) struct HeldPage(Arc<Page>);

impl HeldPage {
    /// The geometry of the page: queries of voxels that lie in it. Its placement and its number mean nothing.
    pub(in super::super) fn tracer(&self) -> &VolumeTracer {
        &self.0.tracer
    }
}

impl Deref for HeldPage {
    type Target = Bricks;

    #[inline(always)]
    fn deref(&self) -> &Bricks {
        &self.0.bricks
    }
}

/// A page and where it is.
#[derive(Debug)]
struct Slot {
    /// Its index among the pages of the volume.
    index: usize,
    scratch: Arc<Scratch>,
    stored: StoredBytes,
    /// Bytes in memory.
    bytes: u64,
    content: Mutex<Option<Arc<Page>>>,
    /// Whether it was used since it was last asked to go.
    used: AtomicBool,
    loads: AtomicU32,
    /// Choices of labels that draw it.
    users: AtomicU32,
}

impl Slot {
    fn content(&self) -> MutexGuard<'_, Option<Arc<Page>>> {
        self.content.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Droppable for Slot {
    fn drop_if_unused(&self) -> Answer {
        // A thread that loads this page waits for room meanwhile.
        let mut content = match self.content.try_lock() {
            Ok(content) => content,
            Err(TryLockError::Poisoned(content)) => content.into_inner(),
            Err(TryLockError::WouldBlock) => return Answer::Used,
        };
        let Some(page) = &*content else { return Answer::Gone };
        if self.used.swap(false, Relaxed) || Arc::strong_count(page) > 1 {
            return Answer::Used;
        }
        *content = None;
        Answer::Dropped(self.bytes)
    }
}

/// What the drawn labels give a page of the volume.
#[derive(Clone, Copy, Debug)]
struct OfPage {
    /// Its place among the slots; [`NONE`] where no voxel of these labels lies in it.
    slot: u32,
    /// Boxes whose lowest voxel it has.
    own: u32,
    /// Bounds of all its boxes, and of the voxels.
    bounds: BoxBounds,
    of_voxels: BoxBounds,
}

/// What was drawn before, of which pages stay.
#[derive(Clone, Copy)]
pub(super) struct Former<'a> {
    pub(super) paged: &'a PagedBricks,
    /// The labels that it draws, by dense index.
    pub(super) visible: &'a [bool],
}

/// What the drawn labels of a volume take in pages.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    pub(super) boxes: usize,
    pub(super) bounds: Option<BoxBounds>,
}

/// The bricks of a volume whose boxes are not in memory (see the module).
#[derive(Debug)]
pub(in super::super) struct PagedBricks {
    volume: Arc<CompressedVolume>,
    pages: Arc<Pages>,
    level: DetailLevel,
    grid: Bricks,
    /// The slot of each place of a page, x fastest.
    places: Vec<u32>,
    slots: Vec<Arc<Slot>>,
    /// By the index of the page in the volume.
    of_pages: Vec<OfPage>,
    is_tight: bool,
    /// Bytes that are always in memory, and those of a thread that loads a page.
    kept_bytes: u64,
    /// What each page shares with the others.
    placement: Placement,
    nothing: Arc<DrawnBoxes>,
}

/// A page as it is drawn.
struct Made {
    /// What it becomes in memory and its place in the file; `None` where nothing of it is drawn.
    slot: Option<Arc<Slot>>,
    of_page: OfPage,
    /// Masks of the bricks of its blocks, with the blocks' places in the grid.
    occupied: Vec<(usize, u64)>,
}

impl PagedBricks {
    /// Makes the pages of the labels that are drawn, all at `level`; none where no label is drawn. Pages that `former` draws alike are
    /// those of `former`.
    ///
    /// # Errors
    /// [`RenderError::Scene`] where the limit is too small, with the figure that is needed, and where the volume is too sparse for bricks;
    /// [`RenderError::Source`] where a page cannot be read or written; [`RenderError::Memory`].
    pub(super) fn new(
        volume: &Arc<CompressedVolume>,
        pages: &Arc<Pages>,
        visible: &[bool],
        level: DetailLevel,
        is_tight: bool,
        former: Option<Former<'_>>,
    ) -> Result<(Option<Self>, Drawn), RenderError> {
        let dims = volume.info().dims;
        let scratch = Arc::new(pages.another_file());
        let blocks = dims.map(|d| d.div_ceil(BLOCK));
        let nothing = Arc::new(DrawnBoxes::nothing());
        let serves = |f: &Former<'_>| {
            let paged = f.paged;
            Arc::ptr_eq(&paged.pages, pages) && (paged.level, paged.is_tight) == (level, is_tight)
        };
        let reused = former.filter(|f| serves(f) && f.paged.files() < MOST_FILES);
        let shows = |labels: &[bool], label: u32| labels.get(label as usize).copied().unwrap_or(false);
        let made: Vec<Made> = (0..pages.len())
            .into_par_iter()
            .map(|index| match reused {
                Some(f) if pages.labels(index).iter().all(|&l| shows(f.visible, l) == shows(visible, l)) => {
                    Ok(f.paged.again(index))
                }
                _ => make(pages, index, visible, level, is_tight, &scratch),
            })
            .collect::<Result<_, _>>()?;
        let (mut boxes, mut bounds) = (0, BoxBounds::EMPTY);
        for Made { of_page, .. } in &made {
            boxes += of_page.own as usize;
            bounds = bounds.union(of_page.bounds);
        }
        let drawn = Drawn { boxes, bounds: (boxes > 0).then_some(bounds) };
        if boxes == 0 {
            return Ok((None, drawn));
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
        let (mut slots, mut of_pages, mut of_voxels) = (Vec::new(), Vec::new(), BoxBounds::EMPTY);
        for (index, Made { slot, of_page, occupied: of_blocks }) in made.into_iter().enumerate() {
            let place = if slot.is_some() { slots.len() as u32 } else { NONE };
            of_pages.push(OfPage { slot: place, ..of_page });
            let Some(slot) = slot else { continue };
            places[pages.number(index) as usize] = place;
            of_voxels = of_voxels.union(of_page.of_voxels);
            of_blocks.into_iter().for_each(|(block, mask)| occupied[block] = mask);
            slots.push(slot);
        }
        let grid = Bricks::grid_of(dims, level, &occupied, of_voxels);
        let largest = slots.iter().map(|slot| slot.bytes.max(slot.stored.bytes())).max().unwrap_or(0);
        // (A thread outside of the pool may pick a pixel.)
        let threads = rayon::current_num_threads() as u64 + 1;
        let table = slots.len() * size_of::<Slot>() + of_pages.len() * size_of::<OfPage>() + places.len() * 4;
        let kept_bytes = grid.bytes() + pages.table_bytes() + table as u64 + threads * largest;
        let memory = pages.memory();
        // Pages of others make room, and what is drawn instead of `former` takes its place.
        let replaced = former.filter(|f| Arc::ptr_eq(f.paged.pages.memory(), memory));
        let of_former = replaced.map_or(0, |f| f.paged.kept_bytes);
        let of_others = memory.counts().kept_bytes.saturating_sub(of_former);
        let needed = of_others + kept_bytes + threads * PAGES_A_THREAD * largest;
        if needed > memory.limit_bytes() {
            let of_threads = (1 + PAGES_A_THREAD) * threads * largest;
            return Err(RenderError::Scene(format!(
                "memory limit: {} bytes are too few, {needed} are needed: {} for tables, and {} for what {threads} threads load and use at once",
                memory.limit_bytes(),
                size_text(needed - of_threads),
                size_text(of_threads),
            )));
        }
        let placement = Placement::of_instance(0, DAffine3::IDENTITY)?;
        memory.keep(kept_bytes);
        let new = slots.iter().filter(|slot| slot.users.fetch_add(1, AcqRel) == 0);
        let (parts, bytes) = new.fold((0, 0), |(parts, bytes), slot| (parts + 1, bytes + slot.bytes));
        memory.offer(parts, bytes);
        let (volume, pages) = (Arc::clone(volume), Arc::clone(pages));
        let paged = Self {
            volume,
            pages,
            level,
            grid,
            places,
            slots,
            of_pages,
            is_tight,
            kept_bytes,
            placement,
            nothing,
        };
        Ok((Some(paged), drawn))
    }

    /// Number of temporary files that its pages are in.
    fn files(&self) -> usize {
        let files: BTreeSet<_> = self.slots.iter().map(|slot| Arc::as_ptr(&slot.scratch).addr()).collect();
        files.len()
    }

    /// The page at `index` of the volume, as it is.
    fn again(&self, index: usize) -> Made {
        let of_page = self.of_pages[index];
        let slot = self.slots.get(of_page.slot as usize).map(Arc::clone);
        let places = places_of_blocks(&self.pages, index, self.volume.info().dims);
        let occupied = match &slot {
            Some(_) => places.map(|block| (block, self.grid.blocks()[block].occupied)).collect(),
            None => Vec::new(),
        };
        Made { slot, of_page, occupied }
    }

    /// The level of detail that is drawn.
    pub(super) fn level(&self) -> DetailLevel {
        self.level
    }

    /// Bytes that are always in memory.
    pub(super) fn bytes(&self) -> u64 {
        self.kept_bytes
    }

    /// Number of loads so far, and of pages.
    pub(super) fn loads(&self) -> (u64, u64) {
        let loads = self.slots.iter().map(|slot| u64::from(slot.loads.load(Relaxed))).sum();
        (loads, self.slots.len() as u64)
    }

    /// Why a page could not be loaded.
    pub(super) fn failure(&self) -> Option<String> {
        self.pages.failure()
    }

    /// The page that `voxel` lies in; `None` where that draws nothing, and outside of the volume.
    pub(super) fn with(&self, voxel: [u32; 3]) -> Option<HeldPage> {
        let dims = self.volume.info().dims;
        if (0..3).any(|a| voxel[a] >= dims[a]) { None } else { self.hold_at(voxel) }
    }

    fn hold_at(&self, voxel: [u32; 3]) -> Option<HeldPage> {
        let [x, y, z] = voxel.map(|v| u64::from(v / self.pages.side()));
        let [along_x, along_y, _] = self.pages.along();
        let place = x + along_x * (y + along_y * z);
        let slot = self.slots.get(*self.places.get(place as usize)? as usize)?;
        let mut content = slot.content();
        if let Some(page) = &*content {
            if !slot.used.load(Relaxed) {
                slot.used.store(true, Relaxed);
            }
            return Some(HeldPage(Arc::clone(page)));
        }
        // A picture with gaps is never shown, so further pages are not worth their time.
        if self.pages.failure().is_some() {
            return None;
        }
        self.pages.memory().make_room(slot.bytes);
        match self.load(slot) {
            Ok(page) => {
                let page = Arc::new(page);
                *content = Some(Arc::clone(&page));
                slot.used.store(true, Relaxed);
                slot.loads.fetch_add(1, Relaxed);
                drop(content);
                self.pages.memory().add(Arc::clone(slot) as Arc<dyn Droppable>);
                Some(HeldPage(page))
            }
            Err(error) => {
                self.pages.memory().release(slot.bytes);
                self.pages.fail(&error);
                None
            }
        }
    }

    #[cold]
    fn load(&self, slot: &Slot) -> pumice_core::Result<Page> {
        let bytes = slot.stored.read(&slot.scratch)?;
        let mut rest = bytes.as_slice();
        let damaged = || pumice_core::Error::Caller("a page of the volume has changed on disk".into());
        let volume = self.pages.decode(slot.index, &mut rest).ok_or_else(damaged)?;
        let bricks = Bricks::take(&mut rest, self.level).ok_or_else(damaged)?;
        let bricks = Arc::new(bricks);
        let tracer = VolumeTracer {
            volume: Arc::new(volume),
            normals: making::normals(&self.placement),
            level: Some(self.level),
            detail: Detail::Same(self.level),
            placement: self.placement,
            instance: 0,
            boxes: Arc::clone(&self.nothing),
            in_world: None,
            bricks: Some(Arc::clone(&bricks)),
            pages: None,
            wants_bricks: true,
            cuts: Cuts::default(),
            hidden: None,
            widest: None,
            neighbors: None,
        };
        Ok(Page { tracer, bricks })
    }
}

impl Drop for PagedBricks {
    fn drop(&mut self) {
        let memory = self.pages.memory();
        let (mut parts, mut bytes) = (0, 0);
        for slot in self.slots.iter().filter(|slot| slot.users.fetch_sub(1, AcqRel) == 1) {
            (parts, bytes) = (parts + 1, bytes + slot.bytes);
            if slot.content().take().is_some() {
                memory.release(slot.bytes);
            }
        }
        memory.withdraw(parts, bytes, self.kept_bytes);
    }
}

impl BrickStore for PagedBricks {
    type Held<'a> = HeldPage;

    #[inline(always)]
    fn grid(&self) -> &Bricks {
        &self.grid
    }

    #[inline]
    fn hold(&self, _: usize, corner: &Lanes) -> Option<(HeldPage, usize)> {
        let voxel = each_axis(|a| corner[a] as u32);
        let page = self.hold_at(voxel)?;
        let within = each_axis(|a| (voxel[a] % self.pages.side() / BLOCK) as usize);
        let block = (0..3).map(|a| page.strides[a] * within[a]).sum();
        Some((page, block))
    }
}

/// Makes a page of the labels that are drawn, and appends it to the file.
fn make(
    pages: &Pages,
    index: usize,
    visible: &[bool],
    level: DetailLevel,
    is_tight: bool,
    scratch: &Arc<Scratch>,
) -> Result<Made, RenderError> {
    let read = pages.read(index).map_err(source)?;
    let items = visible_items(&read, visible)?;
    let volume =
        if items.len() == read.boxes().len() { read } else { read.with_boxes(&items).map_err(source)? };
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
    let of_page = OfPage { slot: NONE, own, bounds, of_voxels: BoxBounds::EMPTY };
    let Some(bricks) = Bricks::of_blocks(&volume, &all, level, first, along) else {
        return Ok(Made { slot: None, of_page, occupied: Vec::new() });
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
    let bytes = of_volume
        + bricks.bytes()
        + (size_of::<Page>() + size_of::<CompressedVolume>() + size_of::<Bricks>()) as u64;
    let slot = Slot {
        index,
        scratch: Arc::clone(scratch),
        stored,
        bytes,
        content: Mutex::new(None),
        used: AtomicBool::new(false),
        loads: AtomicU32::new(0),
        users: AtomicU32::new(0),
    };
    let of_page = OfPage { of_voxels: BoxBounds { lo, hi }, ..of_page };
    Ok(Made { slot: Some(Arc::new(slot)), of_page, occupied })
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

fn source(error: pumice_core::Error) -> RenderError {
    match error {
        pumice_core::Error::Memory(error) => RenderError::Memory(error),
        error => RenderError::Source(error.to_string()),
    }
}

impl VolumeTracer {
    /// Number of pages that have been loaded, each time again, and of pages that there are; `None` of a volume in memory.
    pub fn page_loads(&self) -> Option<(u64, u64)> {
        self.pages.as_ref().map(|pages| pages.loads())
    }
}

/// What the scene asks for and a volume on disk does not give.
pub(super) fn refused(what: &str) -> RenderError {
    RenderError::Scene(format!("memory limit: {what} needs the whole volume in memory: leave the limit out"))
}

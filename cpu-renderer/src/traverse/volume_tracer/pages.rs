//! Bricks and boxes that are loaded when a ray meets them, for volumes that do not fit into memory.
//!
//! ```text
//! grid     the blocks of the whole volume, with the mask of the bricks of each: always in memory, so empty space loads nothing
//! slots    a page each: where it is in a temporary file, and its bricks and boxes while they are in memory
//! ```
//! A ray walks through the grid as through bricks in memory, with the same numbers, and asks for a page only at a block where it meets a
//! brick. All boxes that reach into a page are in it, so what is found there is what the whole volume would give: pictures are equal bit by
//! bit, whatever is in memory and in whatever order it came. A page stays while a ray uses it.

use std::ops::Deref;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
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

/// Number in the table of places without a page.
const NONE: u32 = u32::MAX;

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
    stored: StoredBytes,
    /// Bytes in memory.
    bytes: u64,
    content: Mutex<Option<Arc<Page>>>,
    /// Whether it was used since it was last asked to go.
    used: AtomicBool,
    loads: AtomicU32,
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
    scratch: Scratch,
    /// Bytes that are always in memory, and those of a thread that loads a page.
    kept_bytes: u64,
    /// What each page shares with the others.
    placement: Placement,
    nothing: Arc<DrawnBoxes>,
}

/// A page that was made: what it becomes in memory and its place in the file.
struct Made {
    slot: Slot,
    number: u64,
    bounds: [[f64; 4]; 2],
    occupied: Vec<(usize, u64)>,
}

impl PagedBricks {
    /// Makes the pages of the labels that are drawn, all at `level`; none where no label is drawn.
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
    ) -> Result<(Option<Self>, Drawn), RenderError> {
        let dims = volume.info().dims;
        let scratch = pages.another_file();
        let blocks = dims.map(|d| d.div_ceil(BLOCK));
        let nothing = Arc::new(DrawnBoxes::nothing());
        let made: Vec<_> = (0..pages.len())
            .into_par_iter()
            .map(|index| make(pages, index, visible, level, is_tight, &scratch))
            .collect::<Result<_, _>>()?;
        let (mut boxes, mut bounds) = (0, BoxBounds::EMPTY);
        for of_page in &made {
            boxes += of_page.1;
            bounds = bounds.union(of_page.2);
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
        let (mut slots, mut of_voxels) = (Vec::new(), BoxBounds::EMPTY);
        for Made { slot, number, bounds, occupied: of_page } in made.into_iter().filter_map(|of| of.0) {
            places[number as usize] = slots.len() as u32;
            let [lo, hi] = bounds.map(|corner| each_axis(|a| corner[a] as u32));
            of_voxels = of_voxels.union(BoxBounds { lo, hi });
            of_page.into_iter().for_each(|(block, mask)| occupied[block] = mask);
            slots.push(Arc::new(slot));
        }
        let grid = Bricks::grid_of(dims, level, &occupied, of_voxels);
        let largest = slots.iter().map(|slot| slot.bytes.max(slot.stored.bytes())).max().unwrap_or(0);
        // (A thread outside of the pool may pick a pixel.)
        let threads = rayon::current_num_threads() as u64 + 1;
        let table = (slots.len() * size_of::<Slot>() + places.len() * 4) as u64;
        let kept_bytes = grid.bytes() + table + threads * largest;
        let memory = pages.memory();
        let needed = memory.counts().held_bytes + kept_bytes + threads * PAGES_A_THREAD * largest;
        if needed > memory.limit_bytes() {
            let of_threads = (1 + PAGES_A_THREAD) * threads * largest;
            return Err(RenderError::Scene(format!(
                "memory limit: {} bytes are too few, {needed} are needed: {} for tables, and {} for what {threads} threads load and use at once",
                memory.limit_bytes(),
                size_text(needed - of_threads),
                size_text(of_threads),
            )));
        }
        memory.keep(kept_bytes);
        memory.offer(slots.len() as u64, slots.iter().map(|slot| slot.bytes).sum());
        let (volume, pages) = (Arc::clone(volume), Arc::clone(pages));
        let placement = Placement::of_instance(0, DAffine3::IDENTITY)?;
        let paged =
            Self { volume, pages, level, grid, places, slots, scratch, kept_bytes, placement, nothing };
        Ok((Some(paged), drawn))
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
        let bytes = slot.stored.read(&self.scratch)?;
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
        for slot in &self.slots {
            if slot.content().take().is_some() {
                memory.release(slot.bytes);
            }
        }
        let bytes = self.slots.iter().map(|slot| slot.bytes).sum();
        memory.withdraw(self.slots.len() as u64, bytes, self.kept_bytes);
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

/// Makes a page of the labels that are drawn, and appends it to the file; also the number of its own boxes and the bounds of all. There
/// is no page where no voxel of these labels lies.
fn make(
    pages: &Pages,
    index: usize,
    visible: &[bool],
    level: DetailLevel,
    is_tight: bool,
    scratch: &Scratch,
) -> Result<(Option<Made>, usize, BoxBounds), RenderError> {
    let read = pages.read(index).map_err(source)?;
    let items = visible_items(&read, visible)?;
    let volume =
        if items.len() == read.boxes().len() { read } else { read.with_boxes(&items).map_err(source)? };
    let (number, side) = (pages.number(index), pages.side());
    let origin = pages.origin(number);
    let (mut own, mut bounds) = (0, BoxBounds::EMPTY);
    for_each_visible_box(&volume, visible, is_tight, |of_box, item| {
        let place = volume.place_of_box(item as usize);
        own += usize::from((0..3).all(|a| place.origin[a] / side == origin[a] / side));
        bounds = bounds.union(of_box);
    });
    let all: Vec<u32> = (0..volume.boxes().len() as u32).collect();
    let dims = volume.info().dims;
    let first = origin.map(|v| v / BLOCK);
    let along = each_axis(|a| (side / BLOCK).min(dims[a].div_ceil(BLOCK) - first[a]));
    let Some(bricks) = Bricks::of_blocks(&volume, &all, level, first, along) else {
        return Ok((None, own, bounds));
    };
    let mut bytes = Vec::new();
    encode(&volume, &mut bytes).map_err(source)?;
    bricks.put(&mut bytes)?;
    let stored = StoredBytes::append(scratch, &bytes).map_err(source)?;
    let of_grid = dims.map(|d| d.div_ceil(BLOCK) as usize);
    let occupied = bricks.blocks().iter().enumerate().map(|(b, block)| {
        let at = [
            b % along[0] as usize,
            b / along[0] as usize % along[1] as usize,
            b / (along[0] * along[1]) as usize,
        ];
        let at = each_axis(|a| first[a] as usize + at[a]);
        (at[0] + of_grid[0] * (at[1] + of_grid[1] * at[2]), block.occupied)
    });
    let (occupied, of_voxels) = (occupied.collect(), bricks.bounds);
    // The leaves are those of the volume, and count there.
    let parts = volume.resident_parts();
    let of_volume: u64 = parts.iter().filter(|of| of.0 != "leaves").map(|of| of.1).sum();
    let bytes = of_volume
        + bricks.bytes()
        + (size_of::<Page>() + size_of::<CompressedVolume>() + size_of::<Bricks>()) as u64;
    let slot = Slot {
        index,
        stored,
        bytes,
        content: Mutex::new(None),
        used: AtomicBool::new(false),
        loads: AtomicU32::new(0),
    };
    Ok((Some(Made { slot, number, bounds: of_voxels, occupied }), own, bounds))
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

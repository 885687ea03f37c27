//! Bricks and boxes that are loaded when a ray meets them, for volumes that do not fit into memory.
//!
//! A ray asks for a [drawn page](pumice_transport::geometry::drawn_pages) only at a block where it meets a brick, so pictures are equal bit
//! by bit to those of a volume in memory, whatever is in memory and in whatever order it came. A page stays while a ray uses it.

use std::ops::Deref;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::AcqRel, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use glam::DAffine3;
use pumice_core::reserve::size_text;
use pumice_core::residency::{Answer, Droppable};
use pumice_core::{CompressedVolume, Pages};
use pumice_transport::RenderError;
use pumice_transport::geometry::bricks::{BLOCK, Bricks};
use pumice_transport::geometry::cuts::Cuts;
use pumice_transport::geometry::drawn_pages::{self, DrawnInPages, DrawnPage, DrawnPages};
use pumice_transport::geometry::each_axis;
use pumice_transport::geometry::lod::{Detail, DetailLevel};
use pumice_transport::geometry::placement::Placement;

use super::super::brick_walk::BrickStore;
use super::super::f64x4::Lanes;
use super::drawn_boxes::DrawnBoxes;
use super::{VolumeTracer, making};

/// Pages that a thread may hold at once: one that a ray is in, and one that is loaded.
const PAGES_A_THREAD: u64 = 2;

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

/// A page and what of it is in memory.
#[derive(Debug)]
struct Slot {
    page: Arc<DrawnPage>,
    content: Mutex<Option<Arc<Page>>>,
    /// Whether it was used since it was last asked to go.
    used: AtomicBool,
    loads: AtomicU32,
    /// Choices of labels that draw it.
    users: AtomicU32,
}

impl Slot {
    fn new(page: &Arc<DrawnPage>) -> Self {
        Self {
            page: Arc::clone(page),
            content: Mutex::new(None),
            used: AtomicBool::new(false),
            loads: AtomicU32::new(0),
            users: AtomicU32::new(0),
        }
    }

    /// Bytes in memory.
    fn bytes(&self) -> u64 {
        self.page.bytes() + size_of::<Page>() as u64
    }

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
        Answer::Dropped(self.bytes())
    }
}

/// What was drawn before, of which pages stay.
#[derive(Clone, Copy)]
pub(super) struct Former<'a> {
    pub(super) paged: &'a PagedBricks,
    /// The labels that it draws, by dense index.
    pub(super) visible: &'a [bool],
}

/// The bricks of a volume whose boxes are not in memory (see the module).
#[derive(Debug)]
pub(in super::super) struct PagedBricks {
    drawn: DrawnPages,
    /// One for each drawn page.
    slots: Vec<Arc<Slot>>,
    /// Bytes that are always in memory, and those of a thread that loads a page.
    kept_bytes: u64,
    /// The level of all boxes, where it is certain to be the same.
    level: Option<DetailLevel>,
    /// What each page shares with the others.
    placement: Placement,
    nothing: Arc<DrawnBoxes>,
}

impl PagedBricks {
    /// The pages of the labels that are drawn, at the levels of `detail`; none where no label is drawn. Pages that `former` draws alike are those of
    /// `former`, and what is in memory of them stays there.
    ///
    /// # Errors
    /// As [`DrawnPages::new`]; [`RenderError::Scene`] where the limit is too small, with the figure that is needed.
    pub(super) fn new(
        volume: &CompressedVolume,
        pages: &Arc<Pages>,
        visible: &[bool],
        detail: Detail,
        is_tight: bool,
        former: Option<Former<'_>>,
    ) -> Result<(Option<Self>, DrawnInPages), RenderError> {
        let before = former.map(|f| drawn_pages::Former { pages: &f.paged.drawn, visible: f.visible });
        let (drawn, in_pages) = DrawnPages::new(volume, pages, visible, detail, is_tight, before)?;
        let Some(drawn) = drawn else { return Ok((None, in_pages)) };
        let slot_before = |page: &Arc<DrawnPage>| {
            let paged = former?.paged;
            let slot = &paged.slots[paged.drawn.place_of(page.index())?];
            Arc::ptr_eq(&slot.page, page).then(|| Arc::clone(slot))
        };
        let slots = drawn.drawn().iter();
        let slots: Vec<Arc<Slot>> =
            slots.map(|page| slot_before(page).unwrap_or_else(|| Arc::new(Slot::new(page)))).collect();
        let largest = slots.iter().map(|slot| slot.bytes().max(slot.page.stored_bytes())).max().unwrap_or(0);
        // (A thread outside of the pool may pick a pixel.)
        let threads = rayon::current_num_threads() as u64 + 1;
        let table = slots.len() * (size_of::<Arc<Slot>>() + size_of::<Slot>());
        let kept_bytes = drawn.table_bytes() + table as u64 + threads * largest;
        let memory = pages.memory();
        // Pages of others make room, and what is drawn instead of `former` takes its place.
        let replaced = former.filter(|f| Arc::ptr_eq(f.paged.drawn.of_volume().memory(), memory));
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
        let (parts, bytes) = new.fold((0, 0), |(parts, bytes), slot| (parts + 1, bytes + slot.bytes()));
        memory.offer(parts, bytes);
        let nothing = Arc::new(DrawnBoxes::nothing());
        let level = in_pages.bounds.and_then(|bounds| detail.everywhere(&bounds));
        Ok((Some(Self { drawn, slots, kept_bytes, level, placement, nothing }), in_pages))
    }

    /// The levels of detail that are drawn.
    pub(super) fn detail(&self) -> &Detail {
        self.drawn.detail()
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
        self.drawn.of_volume().failure()
    }

    /// The page that `voxel` lies in; `None` where that draws nothing, and outside of the volume.
    pub(super) fn with(&self, voxel: [u32; 3]) -> Option<HeldPage> {
        if (0..3).any(|a| voxel[a] >= self.drawn.dims()[a]) { None } else { self.hold_at(voxel) }
    }

    fn hold_at(&self, voxel: [u32; 3]) -> Option<HeldPage> {
        let place = self.drawn.place_at(voxel)?;
        let (slot, pages) = (&self.slots[place], self.drawn.of_volume());
        let mut content = slot.content();
        if let Some(page) = &*content {
            if !slot.used.load(Relaxed) {
                slot.used.store(true, Relaxed);
            }
            return Some(HeldPage(Arc::clone(page)));
        }
        // A picture with gaps is never shown, so further pages are not worth their time.
        if pages.failure().is_some() {
            return None;
        }
        pages.memory().make_room(slot.bytes());
        match self.load(place) {
            Ok(page) => {
                let page = Arc::new(page);
                *content = Some(Arc::clone(&page));
                slot.used.store(true, Relaxed);
                slot.loads.fetch_add(1, Relaxed);
                drop(content);
                pages.memory().add(Arc::clone(slot) as Arc<dyn Droppable>);
                Some(HeldPage(page))
            }
            Err(error) => {
                pages.memory().release(slot.bytes());
                pages.fail(&error);
                None
            }
        }
    }

    #[cold]
    fn load(&self, place: usize) -> pumice_core::Result<Page> {
        let (volume, bricks) = self.drawn.read(place)?;
        let (detail, bricks) = (*self.detail(), Arc::new(bricks));
        let tracer = VolumeTracer {
            volume: Arc::new(volume),
            normals: making::normals(&self.placement),
            level: self.level,
            detail,
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
        let memory = self.drawn.of_volume().memory();
        let (mut parts, mut bytes) = (0, 0);
        for slot in self.slots.iter().filter(|slot| slot.users.fetch_sub(1, AcqRel) == 1) {
            (parts, bytes) = (parts + 1, bytes + slot.bytes());
            if slot.content().take().is_some() {
                memory.release(slot.bytes());
            }
        }
        memory.withdraw(parts, bytes, self.kept_bytes);
    }
}

impl BrickStore for PagedBricks {
    type Held<'a> = HeldPage;

    #[inline(always)]
    fn grid(&self) -> &Bricks {
        self.drawn.grid()
    }

    #[inline]
    fn hold(&self, _: usize, corner: &Lanes) -> Option<(HeldPage, usize)> {
        let voxel = each_axis(|a| corner[a] as u32);
        let page = self.hold_at(voxel)?;
        let side = self.drawn.of_volume().side();
        let within = each_axis(|a| (voxel[a] % side / BLOCK) as usize);
        let block = (0..3).map(|a| page.strides[a] * within[a]).sum();
        Some((page, block))
    }
}

impl VolumeTracer {
    /// Number of pages that have been loaded, each time again, and of pages that there are; `None` of a volume in memory.
    pub fn page_loads(&self) -> Option<(u64, u64)> {
        self.pages.as_ref().map(|pages| pages.loads())
    }
}

//! Volumes on disk of which the device holds the pages that rays ask for, in memory of one size for all of them.
//!
//! ```text
//! blocks   of the whole volume, always on the device: which bricks there are, and whether their page is here
//! launch ─► a ray asks for a page: it is marked. Is it here?  yes: the ray goes on    no: this sample is not stored
//!   ▲                                                                                    │
//!   └── the pages that were marked and are not here are read, pages that were marked longest ago make room ◄┘
//! ```
//! A tile is launched until every pixel has all its samples. A pixel goes on with the sample that lacked a page, so each gets the samples
//! that it would get of a whole volume, in the same order: the picture is the same, bit by bit. Where the pages that a tile asks for at once
//! do not fit, it is divided. All pages that one sample's path asks for must fit: here a path begins anew where it lacked a page, while on the
//! processor it waits. Where they do not, it is [`RenderError::Device`], so that the processor may go on.

mod free_space;

use std::sync::Arc;
use std::time::{Duration, Instant};

use pumice_core::reserve::size_text;
use pumice_core::{CompressedVolume, Residency};
use pumice_transport::geometry::Detail;
use pumice_transport::geometry::drawn_pages::{DrawnInPages, DrawnPages, Former, source};
use pumice_transport::{BoxBounds, RenderError};
use rayon::prelude::*;

use self::free_space::FreeSpace;
use crate::device::{Buffer, DeviceError, Gpu, Piece};
use crate::layout::{self, BrickBlock, Chunk, NONE, PAGE_COUNTS};
use crate::pack::{MOST_PAGE_BYTES, PAGE_ALIGNMENT, PackedNodes, PackedPage};
use crate::scene::UploadError;
use crate::slices::Tile;

/// Pages that are read before they are sent: some megabytes on the host.
const PAGES_AT_ONCE: usize = 64;

/// Tiles of at most so many pixels are divided further only where no pixel came forward.
const SMALL_TILE: u64 = 64;

/// Pages for which there must be room: one that a ray is in, and one that it asks for.
const LEAST_PAGES: u64 = 2;

/// What is drawn of a volume on disk.
#[derive(Debug)]
pub(crate) struct PagedVolume {
    drawn: DrawnPages,
    /// Labels that are drawn.
    visible: Vec<bool>,
    memory: Arc<Residency>,
    /// Leaves of all chunks, and where those of each begin.
    leaves: Buffer,
    leaves_of_chunks: Vec<u64>,
}

impl PagedVolume {
    /// Makes the pages of the visible labels, at the levels of `detail`; those that `former` draws alike are those of `former`. `None` where
    /// nothing is drawn. `is_tight` as in [`DrawnPages::new`].
    ///
    /// # Errors
    /// As [`DrawnPages::new`]; those of the device.
    pub(crate) fn new(
        gpu: &Gpu,
        volume: &CompressedVolume,
        visible: &[bool],
        (detail, is_tight): (Detail, bool),
        former: Option<&Self>,
    ) -> Result<(Option<Self>, layout::Instance), UploadError> {
        let mut record = layout::Instance { dims: volume.info().dims, ..layout::Instance::default() };
        let Some(pages) = volume.pages() else { return Ok((None, record)) };
        let before = former.map(|f| Former { pages: &f.drawn, visible: &f.visible });
        let (drawn, in_pages) = DrawnPages::new(volume, pages, visible, detail, is_tight, before)?;
        let Some(drawn) = drawn else { return Ok((None, record)) };
        let DrawnInPages { boxes, bounds } = in_pages;
        let BoxBounds { lo, hi } = bounds.unwrap_or(BoxBounds { lo: [0; 3], hi: [0; 3] });
        (record.lo, record.hi) = (lo, hi);
        record.box_count = u32::try_from(boxes).unwrap_or(u32::MAX);

        let of_chunks = pages.chunks().iter().map(|(_, leaves)| leaves);
        let leaves_of_chunks =
            (0..pages.chunks().len()).map(|c| PackedNodes::leaves_before(of_chunks.clone().take(c)));
        let leaves_of_chunks = leaves_of_chunks.collect();
        let leaves = PackedNodes::leaves(of_chunks).map_err(RenderError::from)?;
        let leaves = gpu.buffer_of("the leaves of a volume", &leaves)?;
        record.leaves = leaves.address();
        let memory = Arc::clone(pages.memory());
        let kept = drawn.table_bytes();
        memory.keep(kept);
        let made = Self { drawn, visible: visible.to_vec(), memory, leaves, leaves_of_chunks };
        made.memory.offer(made.drawn.drawn().len() as u64, made.bytes_of_all());
        Ok((Some(made), record))
    }

    /// The levels of detail of its boxes.
    pub(crate) fn detail(&self) -> &Detail {
        self.drawn.detail()
    }

    /// Bytes of a drawn page on the device.
    fn page_bytes(&self, place: usize) -> u64 {
        PackedPage::len_bytes(&self.drawn.drawn()[place].counts())
    }

    /// Bytes of all drawn pages on the device.
    fn bytes_of_all(&self) -> u64 {
        (0..self.drawn.drawn().len()).map(|place| self.page_bytes(place)).sum()
    }

    /// Bytes of the largest page on the device.
    fn largest(&self) -> u64 {
        (0..self.drawn.drawn().len()).map(|place| self.page_bytes(place)).max().unwrap_or(0)
    }

    /// Bytes on the device that stay there: tables of blocks, of pages, and their marks.
    fn table_bytes(&self) -> u64 {
        let pages = self.drawn.of_volume().len();
        let (blocks, words) = (self.drawn.grid().blocks().len(), pages.div_ceil(32));
        (blocks * size_of::<BrickBlock>() + pages * size_of::<Chunk>() + words * 4) as u64
    }

    /// Bytes of the leaves on the device.
    pub(crate) fn leaf_bytes(&self) -> u64 {
        self.leaves.bytes()
    }
}

impl Drop for PagedVolume {
    fn drop(&mut self) {
        let parts = self.drawn.drawn().len() as u64;
        self.memory.withdraw(parts, self.bytes_of_all(), self.drawn.table_bytes());
    }
}

/// A page on the device.
#[derive(Clone, Copy, Debug)]
struct Held {
    at: u64,
    bytes: u64,
    /// The round in which a ray last asked for it.
    used: u64,
}

/// A volume with what the device knows of its pages. Pages have their numbers among all pages of the volume, so what is on the device stays
/// valid where other pages are drawn.
#[derive(Debug)]
struct OnDevice {
    volume: Arc<PagedVolume>,
    blocks: Vec<BrickBlock>,
    chunks: Vec<Chunk>,
    of_blocks: Buffer,
    of_chunks: Buffer,
    held: Vec<Option<Held>>,
    /// Its first word among the marks.
    first_word: usize,
}

/// The pages of all volumes of a scene.
#[derive(Debug)]
pub(crate) struct ScenePages {
    memory: Arc<Residency>,
    volumes: Vec<OnDevice>,
    pool: Buffer,
    free: FreeSpace,
    /// Counts, and the marks of all volumes.
    requests: Buffer,
    words: usize,
    round: u64,
    held_bytes: u64,
    table_bytes: u64,
    loads: u64,
}

/// What the pages need of the device.
#[derive(Clone, Copy, Debug)]
struct Room {
    pool: u64,
    tables: u64,
}

/// What came of the requests of a launch.
struct Loaded {
    pages: usize,
    /// All pages that were asked for are here.
    all: bool,
}

impl Room {
    /// Of these volumes, within the limit of a memory.
    fn of(volumes: &[Arc<PagedVolume>], memory: &Residency, gpu: &Gpu) -> Result<Self, RenderError> {
        let tables: u64 = volumes.iter().map(|v| v.table_bytes()).sum();
        let all: u64 = volumes.iter().map(|v| v.bytes_of_all()).sum();
        let largest = volumes.iter().map(|v| v.largest()).max().unwrap_or(0);
        let (limit, least) = (memory.limit_bytes(), all.min(LEAST_PAGES * largest));
        if tables + least > limit {
            return Err(RenderError::Device(format!(
                "memory limit: {limit} bytes are too few, {} are needed on the device: {} for tables, and {} for pages",
                tables + least,
                size_text(tables),
                size_text(least),
            )));
        }
        let most = (limit - tables).min(MOST_PAGE_BYTES).min(gpu.most_buffer_bytes());
        Ok(Self { pool: all.min(most / PAGE_ALIGNMENT * PAGE_ALIGNMENT), tables })
    }
}

impl ScenePages {
    /// The pages of these volumes, of which those stay on the device that `former` has there and that are drawn alike. `former` is left as it
    /// is where the scene is at fault. `None` where there are no volumes in pages.
    ///
    /// # Errors
    /// [`RenderError::Device`] where the limit is too small, with the figure that is needed; those of the device.
    pub(crate) fn new(
        gpu: &Gpu,
        volumes: &[Arc<PagedVolume>],
        former: Option<&mut Option<Self>>,
    ) -> Result<Option<Self>, UploadError> {
        // (Volumes may have been opened with several limits.)
        let memories = volumes.iter().map(|volume| &volume.memory);
        let Some(memory) = memories.min_by_key(|memory| memory.limit_bytes()) else { return Ok(None) };
        let memory = Arc::clone(memory);
        let room = Room::of(volumes, &memory, gpu)?;
        let former = former.and_then(Option::take);
        let is_same = |f: &Self| {
            f.volumes.len() == volumes.len()
                && f.volumes.iter().zip(volumes).all(|(of, volume)| Arc::ptr_eq(&of.volume, volume))
        };
        if let Some(former) = former {
            if is_same(&former) {
                return Ok(Some(former));
            }
            if former.free.bytes() >= room.pool && former.free.bytes() <= memory.limit_bytes() - room.tables {
                let mut pages = Self::empty(gpu, volumes, memory, room, Some((former.pool, former.free)))?;
                pages.take_over(gpu, former.volumes)?;
                return Ok(Some(pages));
            }
            // Its memory may be what is missing.
            drop(former);
        }
        Self::empty(gpu, volumes, memory, room, None).map(Some)
    }

    /// No page on the device yet.
    fn empty(
        gpu: &Gpu,
        volumes: &[Arc<PagedVolume>],
        memory: Arc<Residency>,
        room: Room,
        pool: Option<(Buffer, FreeSpace)>,
    ) -> Result<Self, UploadError> {
        let (pool, free) = match pool {
            Some(kept) => kept,
            None => (gpu.buffer("the pages of volumes", room.pool)?, FreeSpace::new(room.pool)),
        };
        let (mut on_device, mut words) = (Vec::new(), 0);
        for volume in volumes {
            let (drawn, pages) = (&volume.drawn, volume.drawn.of_volume().len());
            let occupied = drawn.grid().blocks().iter().map(|block| block.occupied);
            let mut blocks: Vec<BrickBlock> =
                occupied.map(|occupied| BrickBlock { occupied, first_brick: NONE, page: 0 }).collect();
            for page in drawn.drawn() {
                drawn.blocks_of(page.index()).for_each(|block| blocks[block].page = page.index() as u32);
            }
            let chunks = vec![Chunk::default(); pages];
            on_device.push(OnDevice {
                volume: Arc::clone(volume),
                of_blocks: gpu.buffer_of("the blocks of a volume", bytemuck::cast_slice(&blocks))?,
                of_chunks: gpu.buffer_of("the table of pages", bytemuck::cast_slice(&chunks))?,
                blocks,
                chunks,
                held: vec![None; pages],
                first_word: words,
            });
            words += pages.div_ceil(32);
        }
        let requests = gpu.buffer("requests for pages", ((PAGE_COUNTS + words) * 4) as u64)?;
        Ok(Self {
            memory,
            volumes: on_device,
            pool,
            free,
            requests,
            words,
            round: 0,
            held_bytes: 0,
            table_bytes: room.tables,
            loads: 0,
        })
    }

    /// Keeps the pages of former volumes that are drawn alike, and frees the others.
    fn take_over(&mut self, gpu: &Gpu, former: Vec<OnDevice>) -> Result<(), DeviceError> {
        for mut old in former {
            let same = |of: &&mut OnDevice| {
                Arc::ptr_eq(of.volume.drawn.of_volume(), old.volume.drawn.of_volume())
                    && of.held.iter().all(Option::is_none)
            };
            let new = self.volumes.iter_mut().find(same);
            let page_of = |volume: &PagedVolume, index: usize| {
                volume.drawn.place_of(index).map(|place| Arc::clone(&volume.drawn.drawn()[place]))
            };
            let stays = |new: &OnDevice, index: usize| match (
                page_of(&new.volume, index),
                page_of(&old.volume, index),
            ) {
                (Some(a), Some(b)) => Arc::ptr_eq(&a, &b),
                _ => false,
            };
            match new {
                Some(new) => {
                    for index in 0..old.held.len() {
                        let Some(held) = old.held[index].take() else { continue };
                        if !stays(new, index) {
                            self.free.give(held.at, held.bytes);
                            continue;
                        }
                        new.held[index] = Some(Held { used: 0, ..held });
                        new.chunks[index] = old.chunks[index];
                        self.held_bytes += held.bytes;
                        for block in new.volume.drawn.blocks_of(index) {
                            new.blocks[block].first_brick = old.blocks[block].first_brick;
                        }
                    }
                    gpu.upload(&new.of_blocks, 0, bytemuck::cast_slice(&new.blocks))?;
                    gpu.upload(&new.of_chunks, 0, bytemuck::cast_slice(&new.chunks))?;
                }
                None => old.held.iter().flatten().for_each(|held| self.free.give(held.at, held.bytes)),
            }
        }
        Ok(())
    }

    /// Writes the addresses of a volume's pages into its record.
    pub(crate) fn describe(&self, volume: &Arc<PagedVolume>, record: &mut layout::Instance) {
        let Some(of) = self.volumes.iter().find(|of| Arc::ptr_eq(&of.volume, volume)) else { return };
        record.chunks = of.of_chunks.address();
        record.blocks = of.of_blocks.address();
        let pool = self.pool.address();
        (record.boxes, record.nodes, record.bricks) = (pool, pool, pool);
        (record.brick_fields, record.brick_parts) = (pool, pool);
        record.page_marks = self.requests.address() + 4 * (PAGE_COUNTS + of.first_word) as u64;
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let tables = self.volumes.iter().map(|of| of.of_blocks.bytes() + of.of_chunks.bytes());
        self.pool.bytes() + self.requests.bytes() + tables.sum::<u64>()
    }

    /// Whether pages were loaded again.
    pub(crate) fn loads_again(&self) -> bool {
        self.loads > self.volumes.iter().map(|of| of.volume.drawn.drawn().len() as u64).sum()
    }

    /// Launches a tile until no pixel of it lacks a page, in parts where the pages for all of it do not fit. `launch` runs a part, with
    /// the address for requests; `complete` gets what it returned for a part that lacks nothing.
    ///
    /// # Errors
    /// [`RenderError::Device`] where the pages for one sample of one pixel do not fit; [`RenderError::Source`] where a page cannot be read;
    /// those of the device, and of `launch` and `complete`.
    pub(crate) fn draw<T>(
        &mut self,
        gpu: &Gpu,
        tile: &Tile,
        mut launch: impl FnMut(&Tile, u64) -> Result<T, UploadError>,
        mut complete: impl FnMut(&Tile, T) -> Result<(), UploadError>,
    ) -> Result<Duration, UploadError> {
        let begun = Instant::now();
        let mut parts = vec![*tile];
        let mut has_made_room = false;
        while let Some(part) = parts.pop() {
            gpu.clear(&self.requests)?;
            let made = launch(&part, self.requests.address())?;
            let (mut words, mut forward) = (vec![0u32; PAGE_COUNTS + self.words], true);
            gpu.download(&self.requests, 0, bytemuck::cast_slice_mut(&mut words))?;
            let [lacking, samples] = [words[0], words[1]];
            let loaded = self.load(gpu, &words[PAGE_COUNTS..])?;
            if lacking == 0 {
                complete(&part, made)?;
                has_made_room = false;
                continue;
            }
            if loaded.all && loaded.pages == 0 {
                // Launching it again would find the same.
                return Err(RenderError::Device("pages: the device lacks one that was sent".into()).into());
            }
            if !loaded.all {
                forward = samples > 0;
                if part.pixels() > 1 && (part.pixels() > SMALL_TILE || !forward) {
                    let [first, second] = part.halves();
                    parts.extend([second, first]);
                    continue;
                }
            }
            // The pages of one sample do not fit: all others have gone already, but what is left may not lie together.
            if loaded.pages == 0 && !loaded.all && !forward {
                if has_made_room {
                    return Err(self.too_few(&part, &words[PAGE_COUNTS..]).into());
                }
                self.drop_all(gpu)?;
                has_made_room = true;
            }
            parts.push(part);
        }
        Ok(begun.elapsed())
    }

    /// The error where the pages for one pixel do not fit.
    fn too_few(&self, pixel: &Tile, marks: &[u32]) -> RenderError {
        let needed: u64 = self.marked(marks).map(|(v, index)| self.bytes_of(v, index)).sum();
        RenderError::Device(format!(
            "memory limit: {} bytes are too few, {} are needed at once on the device by the path through pixel ({}, {})",
            self.memory.limit_bytes(),
            self.table_bytes + needed,
            pixel.x,
            pixel.y,
        ))
    }

    /// Volume and number of each page that is marked.
    fn marked<'a>(&'a self, marks: &'a [u32]) -> impl Iterator<Item = (usize, usize)> + 'a {
        self.volumes.iter().enumerate().flat_map(|(v, of)| {
            let is_marked = |index: usize| marks[of.first_word + index / 32] >> (index % 32) & 1 != 0;
            (0..of.held.len()).filter(move |&index| is_marked(index)).map(move |index| (v, index))
        })
    }

    fn bytes_of(&self, v: usize, index: usize) -> u64 {
        let volume = &self.volumes[v].volume;
        volume.drawn.place_of(index).map_or(0, |place| volume.page_bytes(place))
    }

    /// Loads the pages that are marked and not here, as far as there is room beside those that are marked and here.
    fn load(&mut self, gpu: &Gpu, marks: &[u32]) -> Result<Loaded, UploadError> {
        self.round += 1;
        let round = self.round;
        let marked: Vec<_> = self.marked(marks).collect();
        let mut wanted = Vec::new();
        for &(v, index) in &marked {
            match &mut self.volumes[v].held[index] {
                Some(held) => held.used = round,
                None => wanted.push((v, index)),
            }
        }
        if wanted.is_empty() {
            return Ok(Loaded { pages: 0, all: true });
        }
        // Those that were asked for longest ago go first.
        let mut old: Vec<(u64, usize, usize)> = Vec::new();
        for (v, of) in self.volumes.iter().enumerate() {
            let used = |index: usize| of.held[index].map(|held| held.used).filter(|&used| used < round);
            old.extend((0..of.held.len()).filter_map(|index| Some((used(index)?, v, index))));
        }
        old.sort_unstable_by(|a, b| b.cmp(a));
        let (mut gone, mut placed) = (Vec::new(), Vec::new());
        for &(v, index) in &wanted {
            let bytes = self.bytes_of(v, index);
            let at = loop {
                if let Some(at) = self.free.take(bytes) {
                    break Some(at);
                }
                let Some((_, v, index)) = old.pop() else { break None };
                self.release(v, index);
                gone.push((v, index));
            };
            // (A smaller one may still fit.)
            placed.extend(at.map(|at| (v, index, Held { at, bytes, used: round })));
        }
        let all = placed.len() == wanted.len();
        self.tell(gpu, &gone)?;
        for now in placed.chunks(PAGES_AT_ONCE) {
            if let Err(error) = self.send(gpu, now) {
                // What was not sent is not here.
                let here = |&(v, index, _): &(usize, usize, Held)| self.volumes[v].held[index].is_some();
                let lost: Vec<_> = placed.iter().filter(|of| !here(of)).map(|of| of.2).collect();
                lost.iter().for_each(|held| self.free.give(held.at, held.bytes));
                return Err(error);
            }
        }
        Ok(Loaded { pages: placed.len(), all })
    }

    /// Reads pages and sends them to their places.
    fn send(&mut self, gpu: &Gpu, pages: &[(usize, usize, Held)]) -> Result<(), UploadError> {
        let packed = |&(v, index, held): &(usize, usize, Held)| {
            let volume = &self.volumes[v].volume;
            let Some(place) = volume.drawn.place_of(index) else { return Ok(None) };
            let (boxes, bricks) = volume.drawn.read(place).map_err(|error| {
                volume.drawn.of_volume().fail(&error);
                source(error)
            })?;
            let leaves = volume.leaves_of_chunks[volume.drawn.of_volume().chunk(index)];
            PackedPage::new(&boxes, &bricks, index as u32, held.at, leaves)
                .map(Some)
                .map_err(RenderError::from)
        };
        let packed = pages.par_iter().map(packed).collect::<Result<Vec<_>, RenderError>>()?;
        let pieces: Vec<Piece<'_>> = pages
            .iter()
            .zip(&packed)
            .filter_map(|(of, page)| Some((of.2.at, page.as_ref()?.bytes.as_slice())))
            .collect();
        gpu.upload_pieces(&self.pool, &pieces)?;
        for (&(v, index, held), page) in pages.iter().zip(&packed) {
            let (of, Some(page)) = (&mut self.volumes[v], page) else { continue };
            of.held[index] = Some(held);
            of.chunks[index] = page.chunk;
            for (block, &first) in of.volume.drawn.blocks_of(index).zip(&page.first_bricks) {
                of.blocks[block].first_brick = first;
            }
            self.held_bytes += held.bytes;
            self.loads += 1;
            self.memory.count_elsewhere(self.table_bytes + self.held_bytes);
        }
        let changed: Vec<_> = pages.iter().map(|&(v, index, _)| (v, index)).collect();
        Ok(self.tell(gpu, &changed)?)
    }

    /// Frees the place of a page.
    fn release(&mut self, v: usize, index: usize) {
        let of = &mut self.volumes[v];
        let Some(held) = of.held[index].take() else { return };
        self.free.give(held.at, held.bytes);
        self.held_bytes -= held.bytes;
        of.volume.drawn.blocks_of(index).for_each(|block| of.blocks[block].first_brick = NONE);
    }

    /// Tells the device which of these pages are here.
    fn tell(&self, gpu: &Gpu, changed: &[(usize, usize)]) -> Result<(), DeviceError> {
        for (v, of) in self.volumes.iter().enumerate() {
            let own = changed.iter().filter(|page| page.0 == v).map(|page| page.1);
            let (mut blocks, mut chunks): (Vec<Piece<'_>>, Vec<Piece<'_>>) = (Vec::new(), Vec::new());
            for index in own {
                chunks.push(((index * size_of::<Chunk>()) as u64, bytemuck::bytes_of(&of.chunks[index])));
                blocks.extend(of.volume.drawn.blocks_of(index).map(|block| {
                    ((block * size_of::<BrickBlock>()) as u64, bytemuck::bytes_of(&of.blocks[block]))
                }));
            }
            gpu.upload_pieces(&of.of_chunks, &chunks)?;
            gpu.upload_pieces(&of.of_blocks, &blocks)?;
        }
        Ok(())
    }

    /// Removes all pages from the device.
    fn drop_all(&mut self, gpu: &Gpu) -> Result<(), DeviceError> {
        let all = self.volumes.iter().enumerate().flat_map(|(v, of)| {
            (0..of.held.len()).filter(|&index| of.held[index].is_some()).map(move |index| (v, index))
        });
        let all: Vec<_> = all.collect();
        all.iter().for_each(|&(v, index)| self.release(v, index));
        self.tell(gpu, &all)
    }
}

//! Packs a page of a volume on disk for the memory that all pages share on the device.
//!
//! ```text
//! page   bricks, and one that marks their end │ boxes │ parts │ fields │ nodes, and spare words      begins and ends at multiples of 48 bytes
//! ```
//! All numbers count from the beginning of that memory, so shaders find what is in pages as they find what is in whole volumes.

use pumice_core::CompressedVolume;
use pumice_core::reserve::{NoMemory, reserved};
use pumice_transport::geometry::Bricks;
use pumice_transport::geometry::drawn_pages::PageCounts;

use super::bricks::parts_of;
use super::nodes::SPARE_WORDS;
use crate::layout::{Brick, BrickPart, Chunk, PagedBox};

/// Bytes of which the place and the length of a page are multiples, so that each of its arrays begins at a whole element.
pub const PAGE_ALIGNMENT: u64 = 48;

/// Most bytes of the memory of pages: a field's number has 32 bits.
pub const MOST_PAGE_BYTES: u64 = (size_of::<u64>() as u64) << 32;

const _: () = assert!(
    size_of::<Brick>() == 24
        && size_of::<PagedBox>() == 16
        && size_of::<BrickPart>() == 16
        && PAGE_ALIGNMENT.is_multiple_of(24)
        && PAGE_ALIGNMENT.is_multiple_of(16)
);

/// Offsets of a page's arrays from its place, and its length.
#[derive(Clone, Copy, Debug)]
struct Offsets {
    boxes: u64,
    parts: u64,
    fields: u64,
    nodes: u64,
    end: u64,
}

impl Offsets {
    fn of(counts: &PageCounts) -> Self {
        let boxes = (size_of::<Brick>() as u64 * (counts.bricks as u64 + 1)).next_multiple_of(16);
        let parts = boxes + size_of::<PagedBox>() as u64 * counts.boxes as u64;
        let fields = parts + size_of::<BrickPart>() as u64 * counts.parts as u64;
        let nodes = fields + size_of::<u64>() as u64 * counts.fields as u64;
        let words = (counts.node_words + SPARE_WORDS) as u64;
        Self { boxes, parts, fields, nodes, end: (nodes + 2 * words).next_multiple_of(PAGE_ALIGNMENT) }
    }
}

/// A page for one place in the memory of pages.
#[derive(Debug)]
pub struct PackedPage {
    /// Its bytes, from that place on.
    pub bytes: Vec<u8>,
    /// Number of the first brick of each of its blocks.
    pub first_bricks: Vec<u32>,
    /// The chunk that its boxes lie in, with the page's own nodes.
    pub chunk: Chunk,
}

impl PackedPage {
    /// Length in bytes of a page with so much in it.
    pub fn len_bytes(counts: &PageCounts) -> u64 {
        Offsets::of(counts).end
    }

    /// Packs a volume of a page's boxes and their bricks for the place `at`, a multiple of [`PAGE_ALIGNMENT`] below [`MOST_PAGE_BYTES`].
    /// `page` is its number among the volume's pages, and `leaves` the byte offset of its chunk's leaves.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn new(
        volume: &CompressedVolume,
        bricks: &Bricks,
        page: u32,
        at: u64,
        leaves: u64,
    ) -> Result<Self, NoMemory> {
        let offsets = Offsets::of(&PageCounts::of(volume, bricks));
        let first = |offset: u64, element: usize| ((at + offset) / element as u64) as u32;
        let brick = first(0, size_of::<Brick>());
        let (field, part) =
            (first(offsets.fields, size_of::<u64>()), first(offsets.parts, size_of::<BrickPart>()));
        let of_box = first(offsets.boxes, size_of::<PagedBox>());
        let mut bytes: Vec<u8> = reserved(offsets.end as usize, "a page for the device")?;
        for b in bricks.bricks() {
            let (first_field, first_part) = (field + b.first_field, part + b.first_item);
            let packed = Brick { occupied: b.occupied, full: b.full, first_field, first_part };
            bytes.extend_from_slice(bytemuck::bytes_of(&packed));
        }
        bytes.resize(offsets.boxes as usize, 0);
        for (number, record) in volume.boxes().iter().enumerate() {
            let packed = PagedBox { record: record.0, label: volume.label_of_box(number), page };
            bytes.extend_from_slice(bytemuck::bytes_of(&packed));
        }
        let parts = parts_of(volume, bricks, &bricks.corners()?, |item| of_box + item)?;
        bytes.extend_from_slice(bytemuck::cast_slice(&parts));
        bricks.fields().for_each(|field| bytes.extend_from_slice(&field.to_ne_bytes()));
        bytes.extend_from_slice(bytemuck::cast_slice(volume.nodes()));
        bytes.resize(offsets.end as usize, 0);
        let origin = volume.chunks().first().map_or([0; 3], |chunk| chunk.origin);
        let chunk = Chunk { node_base: (at + offsets.nodes) / 2, leaves, origin, first_box: 0 };
        let first_bricks = bricks.blocks().iter().map(|block| brick + block.first_brick).collect();
        Ok(Self { bytes, first_bricks, chunk })
    }
}

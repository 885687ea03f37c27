//! Nodes and boxes as streams: what can be derived is left out, like goes with like.
//!
//! ```text
//! BCEL  u24 a box   Morton code of its lowest cell within its chunk
//! BNOD  u32 a box   0: its node is the next new one; k: the one k before the next new one
//! OCCU  u64 a node  occupied cells; a box's extent follows from it, because boxes are tight
//! SOLI  1 bit for each occupied cell      RANK  1 bit for each occupied, not solid cell
//! REFS  u16 for each set bit of RANK      FLDS  u64 for each unset bit of RANK
//! ```
//! Bits fill bytes from the lowest; the last byte's rest is 0.

use std::ops::Range;

use crate::node::{NODE_HEADER_WORDS, NodeRef, extent_of};
use crate::{BoxRecord, Chunk, morton};

/// See the module.
#[derive(Debug, Default)]
pub(super) struct Streams {
    pub(super) cells: Vec<u8>,
    pub(super) backs: Vec<u8>,
    pub(super) occupied: Vec<u8>,
    pub(super) solid: Vec<u8>,
    pub(super) ranked: Vec<u8>,
    pub(super) references: Vec<u8>,
    pub(super) fields: Vec<u8>,
}

/// Bits one after another.
#[derive(Default)]
struct BitWriter {
    bytes: Vec<u8>,
    used: u32,
}

impl BitWriter {
    fn push(&mut self, bit: bool) {
        if self.used.is_multiple_of(8) {
            self.bytes.push(0);
        }
        if let Some(last) = self.bytes.last_mut() {
            *last |= u8::from(bit) << (self.used % 8);
        }
        self.used = (self.used + 1) % 8;
    }
}

/// The bits of one stream again.
struct BitReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl BitReader<'_> {
    /// The next bit; `None` at the end.
    fn next(&mut self) -> Option<bool> {
        let bit = self.bytes.get(self.at / 8)? >> (self.at % 8) & 1 != 0;
        self.at += 1;
        Some(bit)
    }

    /// Whether nothing but the last byte's padding of zeros is left.
    fn is_done(&self) -> bool {
        self.at.div_ceil(8) == self.bytes.len()
            && (self.at.is_multiple_of(8) || self.bytes[self.at / 8] >> (self.at % 8) == 0)
    }
}

/// The cells of `mask`, rising.
fn cells(mut mask: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let c = mask.trailing_zeros();
        mask &= mask.wrapping_sub(1);
        (c < 64).then_some(c)
    })
}

/// A section and what is wrong with it.
pub(super) type Wrong = ([u8; 4], String);

/// Takes nodes and boxes apart.
pub(super) fn split(chunks: &[Chunk], boxes: &[BoxRecord], nodes: &[u16]) -> Streams {
    let mut streams = Streams::default();
    let (mut solid, mut ranked) = (BitWriter::default(), BitWriter::default());
    let mut starts = Vec::new();
    let mut at = 0;
    while at < nodes.len() {
        starts.push(at as u64);
        let node = NodeRef::read(nodes, at, &[]);
        let end = at + node.words();
        streams.occupied.extend(node.occupied.to_le_bytes());
        cells(node.occupied).for_each(|c| solid.push(node.solid >> c & 1 != 0));
        cells(node.occupied & !node.solid).for_each(|c| ranked.push(node.ranked >> c & 1 != 0));
        let fields = at + NODE_HEADER_WORDS + node.ranked.count_ones() as usize;
        streams.references.extend_from_slice(bytemuck::cast_slice(&nodes[at + NODE_HEADER_WORDS..fields]));
        streams.fields.extend_from_slice(bytemuck::cast_slice(&nodes[fields..end]));
        at = end;
    }
    (streams.solid, streams.ranked) = (solid.bytes, ranked.bytes);

    let mut next = 0;
    for (c, chunk) in chunks.iter().enumerate() {
        let end = chunks.get(c + 1).map_or(boxes.len(), |n| n.first_box as usize);
        for record in &boxes[chunk.first_box as usize..end] {
            streams.cells.extend_from_slice(&morton::encode(record.cell()).to_le_bytes()[..3]);
            let place = chunk.node_base + u64::from(record.node());
            // Nodes are in the order of first use, so a box's node is the next new one or one already met.
            let number =
                if starts.get(next) == Some(&place) { next } else { starts.partition_point(|&s| s < place) };
            streams.backs.extend(((next - number) as u32).to_le_bytes());
            next += usize::from(number == next);
        }
    }
    streams
}

fn u64s(bytes: &[u8]) -> impl Iterator<Item = u64> + '_ {
    bytes.as_chunks::<8>().0.iter().map(|&b| u64::from_le_bytes(b))
}

/// A mask or a field as words.
pub(super) fn words_of(mask: u64) -> [u16; 4] {
    [0, 16, 32, 48].map(|s| (mask >> s) as u16)
}

/// The lowest cell of box number `b`; `None` past the end.
pub(super) fn cell_of(cells: &[u8], b: u64) -> Option<[u32; 3]> {
    let code = cells.as_chunks::<3>().0.get(usize::try_from(b).ok()?)?;
    Some(morton::decode(u64::from(u32::from_le_bytes([code[0], code[1], code[2], 0]))))
}

/// The node of each box in rising ranges of boxes, by number.
pub(super) fn numbers_of(backs: &[u8], ranges: impl Iterator<Item = Range<u64>>) -> Result<Vec<u64>, Wrong> {
    let backs = backs.as_chunks::<4>().0;
    let (mut numbers, mut next, mut at) = (Vec::new(), 0u64, 0);
    for range in ranges {
        while at < range.end {
            let Some(&back) = backs.get(at as usize) else {
                return Err((*b"BNOD", format!("ends before box {at}")));
            };
            let back = u64::from(u32::from_le_bytes(back));
            if at >= range.start {
                let number = next.checked_sub(back);
                numbers.push(number.ok_or_else(|| {
                    (*b"BNOD", format!("box {at}: got a node out of reach ({back} before number {next})"))
                })?);
            }
            next += u64::from(back == 0);
            at += 1;
        }
    }
    Ok(numbers)
}

/// A node among the streams.
pub(super) struct Place {
    /// Occupied, solid, ranked.
    pub(super) masks: [u64; 3],
    /// Its elements of `REFS`.
    pub(super) references: Range<usize>,
    /// Its elements of `FLDS`.
    pub(super) fields: Range<usize>,
}

/// Where the nodes with these numbers lie, which rise.
pub(super) fn find(
    occupied: &[u8],
    solid: &[u8],
    ranked: &[u8],
    numbers: &[u64],
) -> Result<Vec<Place>, Wrong> {
    let mut solid = BitReader { bytes: solid, at: 0 };
    let mut ranked = BitReader { bytes: ranked, at: 0 };
    let mut places = Vec::with_capacity(numbers.len());
    let (mut references, mut fields) = (0, 0);
    let mut asked = numbers.iter();
    let mut wanted = asked.next();
    for (number, occupied) in (0u64..).zip(u64s(occupied)) {
        let Some(&asked_for) = wanted else { break };
        let masks = masks_of(occupied, &mut solid, &mut ranked)?;
        let references_end = references + masks[2].count_ones() as usize;
        let fields_end = fields + (occupied & !masks[1] & !masks[2]).count_ones() as usize;
        if number == asked_for {
            places.push(Place { masks, references: references..references_end, fields: fields..fields_end });
            wanted = asked.next();
        }
        (references, fields) = (references_end, fields_end);
    }
    match wanted {
        None => Ok(places),
        Some(number) => Err((*b"OCCU", format!("ends before node {number}"))),
    }
}

/// A node's masks: occupied, solid, ranked.
fn masks_of(occupied: u64, solid: &mut BitReader, ranked: &mut BitReader) -> Result<[u64; 3], Wrong> {
    let short = |section: &[u8; 4]| (*section, "ends before the last node".to_owned());
    let mut masks = [occupied, 0, 0];
    for c in cells(occupied) {
        masks[1] |= u64::from(solid.next().ok_or_else(|| short(b"SOLI"))?) << c;
    }
    for c in cells(occupied & !masks[1]) {
        masks[2] |= u64::from(ranked.next().ok_or_else(|| short(b"RANK"))?) << c;
    }
    Ok(masks)
}

/// Puts nodes together again; also returns each one's first word. The error names a section and what is wrong with it.
pub(super) fn join_nodes(streams: &Streams) -> Result<(Vec<u16>, Vec<u64>), Wrong> {
    if !streams.occupied.len().is_multiple_of(8) {
        return Err((*b"OCCU", format!("size: expected a multiple of 8, got {}", streams.occupied.len())));
    }
    let short = |section: &[u8; 4]| (*section, "ends before the last node".to_owned());
    let mut solid = BitReader { bytes: &streams.solid, at: 0 };
    let mut ranked = BitReader { bytes: &streams.ranked, at: 0 };
    let mut references = streams.references.as_chunks::<2>().0.iter().map(|&b| u16::from_le_bytes(b));
    let mut fields = u64s(&streams.fields);
    let nodes_count = streams.occupied.len() / 8;
    // What the streams can yield at most: their own sizes bound it.
    let mut nodes: Vec<u16> = Vec::with_capacity(
        NODE_HEADER_WORDS * nodes_count + streams.references.len() / 2 + streams.fields.len() / 2,
    );
    let mut starts = Vec::with_capacity(nodes_count);
    for occupied in u64s(&streams.occupied) {
        starts.push(nodes.len() as u64);
        let masks = masks_of(occupied, &mut solid, &mut ranked)?;
        nodes.extend(masks.iter().flat_map(|&m| words_of(m)));
        for _ in 0..masks[2].count_ones() {
            nodes.push(references.next().ok_or_else(|| short(b"REFS"))?);
        }
        for _ in 0..(occupied & !masks[1] & !masks[2]).count_ones() {
            let field = fields.next().ok_or_else(|| short(b"FLDS"))?;
            nodes.extend(words_of(field));
        }
    }
    let long = |section: &[u8; 4]| (*section, "goes on after the last node".to_owned());
    if !solid.is_done() {
        return Err(long(b"SOLI"));
    }
    if !ranked.is_done() {
        return Err(long(b"RANK"));
    }
    if references.next().is_some() || !streams.references.len().is_multiple_of(2) {
        return Err(long(b"REFS"));
    }
    if fields.next().is_some() || !streams.fields.len().is_multiple_of(8) {
        return Err(long(b"FLDS"));
    }
    Ok((nodes, starts))
}

/// Puts box records together again. `starts` are the nodes' first words.
pub(super) fn join_boxes(
    streams: &Streams,
    chunks: &[Chunk],
    nodes: &[u16],
    starts: &[u64],
) -> Result<Vec<BoxRecord>, Wrong> {
    let count = streams.backs.len() / 4;
    if !streams.backs.len().is_multiple_of(4) || streams.cells.len() != 3 * count {
        let what = format!(
            "size: expected 3 bytes for each 4 of BNOD ({}), got {}",
            streams.backs.len(),
            streams.cells.len()
        );
        return Err((*b"BCEL", what));
    }
    let mut records = Vec::with_capacity(count);
    let (mut next, mut c) = (0usize, 0usize);
    let boxes = streams.cells.as_chunks::<3>().0.iter().zip(streams.backs.as_chunks::<4>().0);
    for (i, (code, back)) in boxes.enumerate() {
        while chunks.get(c + 1).is_some_and(|n| n.first_box <= i as u64) {
            c += 1;
        }
        let back = u32::from_le_bytes(*back) as usize;
        let node = next.checked_sub(back).and_then(|n| starts.get(n)).copied();
        let place = node.zip(chunks.get(c)).and_then(|(at, chunk)| at.checked_sub(chunk.node_base));
        let (Some(at), Some(place)) = (node, place.and_then(|p| u32::try_from(p).ok())) else {
            return Err((
                *b"BNOD",
                format!("box {i}: got a node out of reach ({back} before number {next})"),
            ));
        };
        next += usize::from(back == 0);
        let cell = morton::decode(u64::from(u32::from_le_bytes([code[0], code[1], code[2], 0])));
        let occupied = NodeRef::read(nodes, at as usize, &[]).occupied;
        if occupied == 0 {
            return Err((*b"OCCU", format!("node of box {i}: got no occupied cell")));
        }
        records.push(BoxRecord::new(cell, extent_of(occupied), place));
    }
    if next != starts.len() {
        return Err((*b"BNOD", format!("expected use of all {} nodes, got {next}", starts.len())));
    }
    Ok(records)
}

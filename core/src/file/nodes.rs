//! Nodes and boxes of a chunk as streams. They omit what can be derived, and each holds values of one kind, so that they compress well.
//!
//! ```text
//! BCEL  u24 a box   Morton code of its lowest cell within its chunk
//! BNOD  u32 a box   0: its node is the next new one; k: its node is the one k before the next new one
//! OCCU  u64 a node  occupied cells; a box's extent follows from it, because boxes are tight
//! CLAS  2 bits for each occupied cell, the lower one first: its class ([`crate::node`])
//! REFS  1 word a ranked cell      SLCR  2 words a sliced cell      FLDS  3 or 4 words a cell with a long reference
//! ```
//! Bits fill each byte from the lowest up; the unused bits of the last byte are 0.
//!
//! **What was tried.** Where labels touch, the voxels that one box lacks in a cell are those of another. A bit for each cell of which earlier
//! boxes have some voxels, which says that it has all others, in place of its class and reference: 4.4 MB instead of 5.5 for a cortex of 512³
//! voxels. But the earlier boxes have to be followed cell by cell, in 17 MB of masks, and each such reference has to be found again: opening
//! such a file took four times as long as one of the level `fast`, and no label could be read without all others.

use std::ops::Range;

use crate::leaves::{Class, Leaves};
use crate::node::{NodeRef, OCCUPIED_WORDS, extent_of, header_words};
use crate::reserve::make_room;
use crate::{BoxRecord, NoMemory, morton};

/// The streams that the module documentation lists.
#[derive(Debug, Default)]
pub(super) struct Streams {
    pub(super) cells: Vec<u8>,
    pub(super) backs: Vec<u8>,
    pub(super) occupied: Vec<u8>,
    pub(super) classes: Vec<u8>,
    /// References of ranked cells, of sliced cells, and of cells with a long reference.
    pub(super) references: [Vec<u8>; 3],
}

/// Section names of [`Streams::references`].
pub(super) const REFERENCES: [&[u8; 4]; 3] = [b"REFS", b"SLCR", b"FLDS"];

/// Writes single bits.
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

/// Reads the pairs of bits that [`BitWriter`] wrote.
struct PairReader<'a> {
    bytes: &'a [u8],
    /// Pairs that were read.
    at: usize,
}

impl<'a> PairReader<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next `n` pairs, at most 64: their first bits and their second ones, from bit 0 on. `None` where they pass the end.
    fn next(&mut self, n: u32) -> Option<(u64, u64)> {
        let end = self.at + n as usize;
        if end > 4 * self.bytes.len() {
            return None;
        }
        // Up to 128 bits, which may begin within a byte: seventeen bytes, as far as there are so many.
        let bytes = &self.bytes[self.at / 4..];
        let mut near = [0; 17];
        let count = bytes.len().min(17);
        near[..count].copy_from_slice(&bytes[..count]);
        let shift = 2 * (self.at % 4) as u32;
        let [low, high] = [0, 8].map(|from| {
            let eight = near[from..from + 8].iter().rev().fold(0u64, |all, &b| all << 8 | u64::from(b));
            // (The ninth byte has at most six of the bits.)
            eight >> shift | u64::from(near[from + 8]).checked_shl(64 - shift).unwrap_or(0)
        });
        self.at = end;
        let used = u64::MAX.checked_shr(64 - n).unwrap_or(0);
        let all = |of: u32| u64::from(every_second(low >> of)) | u64::from(every_second(high >> of)) << 32;
        Some((all(0) & used, all(1) & used))
    }

    /// Whether only the last byte's zero padding is left.
    fn is_done(&self) -> bool {
        self.at.div_ceil(4) == self.bytes.len()
            && (self.at.is_multiple_of(4) || self.bytes[self.at / 4] >> (2 * (self.at % 4)) == 0)
    }
}

/// Bits 0, 2, 4 … of a word, side by side.
fn every_second(bits: u64) -> u32 {
    let bits = bits & 0x5555_5555_5555_5555;
    let bits = (bits | bits >> 1) & 0x3333_3333_3333_3333;
    let bits = (bits | bits >> 2) & 0x0F0F_0F0F_0F0F_0F0F;
    let bits = (bits | bits >> 4) & 0x00FF_00FF_00FF_00FF;
    let bits = (bits | bits >> 8) & 0x0000_FFFF_0000_FFFF;
    (bits | bits >> 16) as u32
}

/// The section that is wrong, and what is wrong with it.
pub(super) type Wrong = ([u8; 4], String);

/// Splits nodes and boxes into streams, piece after piece. Whoever takes a stream's bytes leaves it empty for the next piece.
#[derive(Default)]
pub(super) struct Splitter {
    pub(super) occupied: Vec<u8>,
    pub(super) references: [Vec<u8>; 3],
    classes: BitWriter,
}

impl Splitter {
    /// Appends what describes these nodes; returns the first word of each.
    pub(super) fn nodes(&mut self, nodes: &[u16], leaves: &Leaves) -> Vec<u32> {
        let mut starts = Vec::new();
        let mut at = 0;
        while at < nodes.len() {
            starts.push(at as u32);
            let node = NodeRef::read(nodes, at, leaves);
            self.occupied.extend(node.occupied.to_le_bytes());
            for (_, class, from) in node.references() {
                self.classes.push(class as u8 & 1 != 0);
                self.classes.push(class as u8 & 2 != 0);
                if class != Class::Solid {
                    let words = &nodes[at + from..][..leaves.words_of(class)];
                    self.references[class as usize - 1].extend(words.iter().flat_map(|w| w.to_le_bytes()));
                }
            }
            at += node.words();
        }
        starts
    }

    /// Appends the lowest cells of boxes.
    pub(super) fn cells(&self, boxes: &[BoxRecord], cells: &mut Vec<u8>) {
        for record in boxes {
            cells.extend_from_slice(&morton::encode(record.cell()).to_le_bytes()[..3]);
        }
    }

    /// The bytes of classes that are full; what is left begins the next piece.
    pub(super) fn take_classes(&mut self) -> Vec<u8> {
        let full = self.classes.bytes.len() - usize::from(self.classes.used != 0);
        let rest = self.classes.bytes.split_off(full);
        std::mem::replace(&mut self.classes.bytes, rest)
    }

    /// The last byte of the classes, if it is not full.
    pub(super) fn last_classes(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.classes.bytes)
    }
}

/// Splits the nodes and boxes of a chunk into streams.
pub(super) fn split(boxes: &[BoxRecord], nodes: &[u16], leaves: &Leaves) -> Streams {
    let mut splitter = Splitter::default();
    let starts = splitter.nodes(nodes, leaves);
    let mut streams = Streams::default();
    splitter.cells(boxes, &mut streams.cells);
    let mut next = 0;
    for record in boxes {
        let place = record.node();
        // Nodes are in the order of first use, so a box's node is either the next new one or one that came earlier.
        let number =
            if starts.get(next) == Some(&place) { next } else { starts.partition_point(|&s| s < place) };
        streams.backs.extend(((next - number) as u32).to_le_bytes());
        next += usize::from(number == next);
    }
    streams.classes = splitter.last_classes();
    (streams.occupied, streams.references) = (splitter.occupied, splitter.references);
    streams
}

fn u64s(bytes: &[u8]) -> impl Iterator<Item = u64> + '_ {
    bytes.as_chunks::<8>().0.iter().map(|&b| u64::from_le_bytes(b))
}

/// The lowest cell of box `b` within its chunk; `None` past the end.
pub(super) fn cell_of(cells: &[u8], b: u64) -> Option<[u32; 3]> {
    let code = cells.as_chunks::<3>().0.get(usize::try_from(b).ok()?)?;
    Some(morton::decode(u64::from(u32::from_le_bytes([code[0], code[1], code[2], 0]))))
}

/// The node number of each box in rising ranges of boxes; `next` is the number of the first node that these boxes are the first to use.
pub(super) fn numbers_of(
    backs: &[u8],
    mut next: u64,
    ranges: impl Iterator<Item = Range<u64>>,
) -> Result<Vec<u64>, Wrong> {
    let backs = backs.as_chunks::<4>().0;
    let (mut numbers, mut at) = (Vec::new(), 0);
    for range in ranges {
        while at < range.end {
            let Some(&back) = backs.get(at as usize) else {
                return Err((*b"BNOD", format!("expected box {at}, got the end")));
            };
            let back = u64::from(u32::from_le_bytes(back));
            if at >= range.start {
                let number = next.checked_sub(back);
                numbers.push(number.ok_or_else(|| {
                    (*b"BNOD", format!("box {at}: expected a node that came before, got the one {back} before number {next}"))
                })?);
            }
            next += u64::from(back == 0);
            at += 1;
        }
    }
    Ok(numbers)
}

/// A node in the streams.
pub(super) struct NodeOffsets {
    occupied: u64,
    /// Class of each occupied cell by rank: lower and upper bits.
    low: u64,
    high: u64,
    /// The node's range of elements in each of [`REFERENCES`].
    pub(super) references: [Range<usize>; 3],
}

impl NodeOffsets {
    /// Appends the node's words to `out`, from its elements in each of [`REFERENCES`].
    pub(super) fn append(&self, elements: [&[u8]; 3], leaves: &Leaves, out: &mut Vec<u16>) {
        let n = self.occupied.count_ones();
        out.extend((0..OCCUPIED_WORDS).map(|i| (self.occupied >> (16 * i)) as u16));
        let bits = u128::from(self.low) | u128::from(self.high) << n;
        out.extend((0..header_words(n) - OCCUPIED_WORDS).map(|i| (bits >> (16 * i)) as u16));
        let words_of = [Class::Ranked, Class::Sliced, Class::Long].map(|class| leaves.words_of(class));
        let mut elements = elements.map(|bytes| bytes.as_chunks::<2>().0);
        let mut left = self.low | self.high;
        while left != 0 {
            let rank = left.trailing_zeros();
            let k = ((self.low >> rank & 1) + 2 * (self.high >> rank & 1)) as usize - 1;
            let (next, rest) = elements[k].split_at(words_of[k]);
            // (A call to copy one word or two would take longer than to write them.)
            match next {
                [a] => out.push(u16::from_le_bytes(*a)),
                [a, b] => out.extend_from_slice(&[*a, *b].map(u16::from_le_bytes)),
                long => out.extend(long.iter().map(|&b| u16::from_le_bytes(b))),
            }
            elements[k] = rest;
            left &= left - 1;
        }
    }
}

/// Reads the nodes' heads, one after another.
struct Heads<'a> {
    classes: PairReader<'a>,
    /// Number of elements of each of [`REFERENCES`] that the nodes so far use.
    used: [usize; 3],
}

impl<'a> Heads<'a> {
    fn new(classes: &'a [u8]) -> Self {
        Self { classes: PairReader::new(classes), used: [0; 3] }
    }

    fn next(&mut self, occupied: u64) -> Result<NodeOffsets, Wrong> {
        let (low, high) = self
            .classes
            .next(occupied.count_ones())
            .ok_or_else(|| (*b"CLAS", "expected the classes of all nodes, got the end".to_owned()))?;
        let from = self.used;
        for (used, of_class) in self.used.iter_mut().zip([low & !high, high & !low, low & high]) {
            *used += of_class.count_ones() as usize;
        }
        let references = [0, 1, 2].map(|k| from[k]..self.used[k]);
        Ok(NodeOffsets { occupied, low, high, references })
    }
}

/// Bytes of one element of `REFERENCES[k]`.
fn element_bytes(k: usize, leaves: &Leaves) -> usize {
    2 * leaves.words_of([Class::Ranked, Class::Sliced, Class::Long][k])
}

/// Bytes of a range of elements of `REFERENCES[k]`.
pub(super) fn elements<'a>(
    bytes: &'a [u8],
    k: usize,
    range: &Range<usize>,
    leaves: &Leaves,
) -> Result<&'a [u8], Wrong> {
    let size = element_bytes(k, leaves);
    let bytes = bytes.get(size * range.start..size * range.end);
    bytes.ok_or_else(|| (*REFERENCES[k], "expected the references of all nodes, got the end".to_owned()))
}

/// Finds the nodes with these numbers, which must rise.
pub(super) fn find(occupied: &[u8], classes: &[u8], numbers: &[u64]) -> Result<Vec<NodeOffsets>, Wrong> {
    let mut heads = Heads::new(classes);
    let mut places = Vec::with_capacity(numbers.len());
    let mut asked = numbers.iter();
    let mut wanted = asked.next();
    for (number, occupied) in (0u64..).zip(u64s(occupied)) {
        let Some(&asked_for) = wanted else { break };
        let place = heads.next(occupied)?;
        if number == asked_for {
            places.push(place);
            wanted = asked.next();
        }
    }
    match wanted {
        None => Ok(places),
        Some(number) => Err((*b"OCCU", format!("expected node {number}, got the end"))),
    }
}

/// Joins the streams of a chunk, and appends its boxes and the words of its nodes. An error names a section and what is wrong with it.
pub(super) fn join(
    streams: &Streams,
    leaves: &Leaves,
    boxes: &mut Vec<BoxRecord>,
    nodes: &mut Vec<u16>,
) -> Result<(), Wrong> {
    join_frame(streams, leaves, boxes, (nodes.len(), nodes), &mut Vec::new())
}

/// Joins the streams of the next frame of a chunk, and appends its boxes and the words of the nodes that they are the first to use. The nodes of
/// the chunk begin at word `first`; `starts` holds the first word of each, counted from there.
pub(super) fn join_frame(
    streams: &Streams,
    leaves: &Leaves,
    boxes: &mut Vec<BoxRecord>,
    (first, nodes): (usize, &mut Vec<u16>),
    starts: &mut Vec<u32>,
) -> Result<(), Wrong> {
    let before = starts.len();
    join_nodes(streams, leaves, (first, nodes), starts)?;
    join_boxes(streams, &nodes[first..], (before, starts), boxes)
}

/// Appends the words of the nodes, and to `starts` each node's first word, counted from word `first`, which is the first of the chunk.
fn join_nodes(
    streams: &Streams,
    leaves: &Leaves,
    (first, nodes): (usize, &mut Vec<u16>),
    starts: &mut Vec<u32>,
) -> Result<(), Wrong> {
    if !streams.occupied.len().is_multiple_of(8) {
        return Err((*b"OCCU", format!("size: expected a multiple of 8, got {}", streams.occupied.len())));
    }
    let mut heads = Heads::new(&streams.classes);
    let nodes_count = streams.occupied.len() / 8;
    // An upper bound of the words, from the streams' own sizes.
    let references: usize = streams.references.iter().map(Vec::len).sum();
    let words = (OCCUPIED_WORDS + 1) * nodes_count + streams.classes.len() / 2 + references / 2;
    let no_memory = |e: NoMemory| (*b"OCCU", e.to_string());
    make_room(nodes, words, "the nodes of the volume").map_err(no_memory)?;
    make_room(starts, nodes_count, "the nodes of the volume").map_err(no_memory)?;
    for occupied in u64s(&streams.occupied) {
        let start = u32::try_from(nodes.len() - first);
        starts.push(start.map_err(|_| (*b"OCCU", "expected nodes below 2^32 words, got more".to_owned()))?);
        let place = heads.next(occupied)?;
        let mut parts: [&[u8]; 3] = [&[]; 3];
        for (k, part) in parts.iter_mut().enumerate() {
            *part = elements(&streams.references[k], k, &place.references[k], leaves)?;
        }
        place.append(parts, leaves, nodes);
    }
    let long =
        |section: &[u8; 4]| (*section, "expected the end after the last node, got more bytes".to_owned());
    if !heads.classes.is_done() {
        return Err(long(b"CLAS"));
    }
    for (k, bytes) in streams.references.iter().enumerate() {
        if bytes.len() != element_bytes(k, leaves) * heads.used[k] {
            return Err(long(REFERENCES[k]));
        }
    }
    Ok(())
}

/// Appends the box records of a chunk with these nodes. `starts` holds each node's first word; the boxes are the first to use all but `known` of
/// them.
fn join_boxes(
    streams: &Streams,
    nodes: &[u16],
    (known, starts): (usize, &[u32]),
    records: &mut Vec<BoxRecord>,
) -> Result<(), Wrong> {
    let count = streams.backs.len() / 4;
    if !streams.backs.len().is_multiple_of(4) || streams.cells.len() != 3 * count {
        let what = format!(
            "size: expected 3 bytes for each 4 of BNOD ({}), got {}",
            streams.backs.len(),
            streams.cells.len()
        );
        return Err((*b"BCEL", what));
    }
    make_room(records, count, "the boxes of the volume").map_err(|e| (*b"BCEL", e.to_string()))?;
    let leaves = Leaves::default();
    let mut next = known;
    let boxes = streams.cells.as_chunks::<3>().0.iter().zip(streams.backs.as_chunks::<4>().0);
    for (i, (code, back)) in boxes.enumerate() {
        let back = u32::from_le_bytes(*back) as usize;
        let Some(&at) = next.checked_sub(back).and_then(|n| starts.get(n)) else {
            return Err((
                *b"BNOD",
                format!("box {i}: expected a node of the chunk, got the one {back} before number {next}"),
            ));
        };
        next += usize::from(back == 0);
        let cell = morton::decode(u64::from(u32::from_le_bytes([code[0], code[1], code[2], 0])));
        let occupied = NodeRef::read(nodes, at as usize, &leaves).occupied;
        if occupied == 0 {
            return Err((*b"OCCU", format!("node of box {i}: got no occupied cell")));
        }
        records.push(BoxRecord::new(cell, extent_of(occupied), at));
    }
    if next != starts.len() {
        return Err((*b"BNOD", format!("expected use of all {} nodes, got {next}", starts.len())));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of every number and at every place within a byte are those that were written one by one; what passes the end is refused, and
    /// the padding counts as read.
    #[test]
    fn pairs_are_read_as_they_were_written() {
        let mut s = 1u64;
        let mut random = || {
            s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            s ^ s >> 31
        };
        let all: Vec<(u32, u64, u64)> =
            (0..500).map(|_| ((random() % 65) as u32, random(), random())).collect();
        let mut written = BitWriter::default();
        for &(n, low, high) in &all {
            for i in 0..n {
                written.push(low >> i & 1 != 0);
                written.push(high >> i & 1 != 0);
            }
        }
        let mut pairs = PairReader::new(&written.bytes);
        for &(n, low, high) in &all {
            let used = u64::MAX.checked_shr(64 - n).unwrap_or(0);
            assert!(!pairs.is_done() || n == 0);
            assert_eq!(pairs.next(n), Some((low & used, high & used)));
        }
        assert!(pairs.is_done() && pairs.next(4).is_none());
        let mut short = PairReader::new(&written.bytes[..3]);
        assert!(short.next(12).is_some() && short.next(1).is_none() && short.is_done());
        // A bit in the padding.
        let mut padded = PairReader::new(&[0b0100_0000]);
        assert!(padded.next(3).is_some() && !padded.is_done());
    }
}

//! Reads some boxes of a chunk, with their nodes and the leaves that these use, and puts them together as a chunk of a volume.
//!
//! ```text
//! plain form    ranges of BOXS ─► ranges of NODE
//! packed form   BNOD, BCEL of the chunk ─► numbers of nodes ─► OCCU, CLAS, REFS, SLCR, FLDS
//! ```
//! In a time series each frame of a chunk has streams of its own, and its boxes may use nodes that an earlier frame of the chunk has. The
//! nodes of a chunk are numbered through all of its frames.

use std::collections::BTreeMap;
use std::io::{Read, Seek};
use std::ops::Range;

use rustc_hash::FxHashMap;

use super::format_error::{FormatError, Stop};
use super::layout::{Entry, Layout};
use super::nodes::{self, Wrong};
use super::sections::{read_at, read_section, read_sections};
use crate::leaves::{Class, MAX_PATTERNS, RARE};
use crate::node::{MOST_NODE_WORDS, NodeRef, OCCUPIED_WORDS, extent_of, header_words};
use crate::{BoxRecord, Chunk, CompressedVolume, Job, LabelRun, Leaves};

/// Bytes of a section that are read at once, so that neighbouring nodes arrive together.
const PIECE_BYTES: u64 = 1 << 16;

/// Sections of chunks, by name and chunk.
pub(super) struct OfChunks<'l>(FxHashMap<([u8; 4], u32), &'l Entry>);

impl<'l> OfChunks<'l> {
    pub(super) fn of(layout: &'l Layout) -> Self {
        Self(layout.entries.iter().filter_map(|e| Some(((e.name, e.chunk?), e))).collect())
    }

    /// Reads and decodes a section; returns its place in the file too.
    pub(super) fn read(
        &self,
        file: &mut (impl Read + Seek),
        name: &[u8; 4],
        chunk: u32,
        job: &Job,
    ) -> std::result::Result<(Vec<u8>, u64), Stop> {
        let Some(entry) = self.0.get(&(*name, chunk)) else {
            let what = format!("chunk {chunk}: expected the section, got none");
            return Err(Stop::Fault(FormatError { section: *name, at: 0, what }));
        };
        // Its size was compared with INFO of the file when that was read.
        Ok((read_section(file, entry, job)?, entry.offset))
    }

    /// Number of nodes that a chunk at a frame is the first to use.
    fn nodes_of(&self, chunk: u32) -> u64 {
        self.0.get(&(*b"OCCU", chunk)).map_or(0, |entry| entry.decoded / 8)
    }
}

/// A range of boxes to read: those of one label in one chunk, as indices in the file.
pub(super) struct Wanted {
    pub(super) chunk: usize,
    pub(super) label: u32,
    pub(super) boxes: Range<u64>,
}

/// The boxes of a chunk that were read, in the file's order, with their nodes.
#[derive(Default)]
pub(super) struct Picked {
    /// Lowest cell within the chunk, and the key of the node in `nodes`.
    boxes: Vec<([u32; 3], u64)>,
    /// Words of each node, by the key that `boxes` uses: its first word in plain files, its number in packed ones.
    nodes: BTreeMap<u64, Vec<u16>>,
}

/// Reads boxes and nodes of a chunk from plain arrays. The key of a node is its first word; `end` is that of the next chunk's first node.
pub(super) fn pick_plain(
    file: &mut (impl Read + Seek),
    layout: &Layout,
    chunk: &Chunk,
    end: Option<u64>,
    leaves: &Leaves,
    wanted: &[Wanted],
    job: &Job,
) -> std::result::Result<Picked, Stop> {
    let mut picked = Picked::default();
    let mut boxes = Ranges::open(file, layout, b"BOXS", job)?;
    for w in wanted {
        job.check()?;
        let bytes = boxes.read(8 * w.boxes.start, 8 * (w.boxes.end - w.boxes.start))?;
        for &record in bytes.as_chunks::<8>().0 {
            let record = BoxRecord(u64::from_le_bytes(record));
            let at = chunk.node_base.saturating_add(record.node().into());
            picked.boxes.push((record.cell(), at));
            picked.nodes.entry(at).or_default();
        }
    }
    let mut nodes = Ranges::open(file, layout, b"NODE", job)?;
    let end = end.unwrap_or(u64::MAX).min(nodes.bytes / 2);
    for (&at, words) in &mut picked.nodes {
        job.check()?;
        let most = (MOST_NODE_WORDS as u64).min(end.saturating_sub(at));
        let bytes = nodes.read(2 * at.min(end), 2 * most)?;
        words.extend(bytes.as_chunks::<2>().0.iter().map(|&b| u16::from_le_bytes(b)));
        match length_of(words, leaves) {
            Some(length) => words.truncate(length),
            None => {
                let what = format!("node at word {at}: expected all of it before word {end}");
                return Err(nodes.fault(what));
            }
        }
    }
    Ok(picked)
}

/// Number of words of the node at the start of `words`; `None` where `words` end before the node does.
fn length_of(words: &[u16], leaves: &Leaves) -> Option<usize> {
    let occupied = words.get(..OCCUPIED_WORDS)?.iter().map(|w| w.count_ones()).sum();
    words.get(..header_words(occupied))?;
    let length = NodeRef::read(words, 0, leaves).words();
    (length <= words.len()).then_some(length)
}

/// Reads boxes and nodes from the streams of a chunk. The key of a node is its number. `frames` are the frames of the chunk up to the one
/// that is wanted, by the numbers of their streams.
pub(super) fn pick_packed(
    file: &mut (impl Read + Seek),
    sections: &OfChunks<'_>,
    frames: Range<u32>,
    chunk: &Chunk,
    leaves: &Leaves,
    wanted: &[Wanted],
    job: &Job,
) -> std::result::Result<Picked, Stop> {
    let mut picked = Picked::default();
    let own = wanted[0].chunk as u32;
    let fault = |number: u32, (section, what): Wrong, at: u64| {
        let what = format!("chunk {number}: {what}");
        Stop::Fault(FormatError { section, at, what })
    };
    // Number of the first node of each frame.
    let (mut firsts, mut next) = (Vec::new(), 0u64);
    for number in frames {
        firsts.push((number, next));
        next = next.saturating_add(if number == own { 0 } else { sections.nodes_of(number) });
    }

    let in_chunk = |w: &Wanted| w.boxes.start - chunk.first_box..w.boxes.end - chunk.first_box;
    let (backs, at) = sections.read(file, b"BNOD", own, job)?;
    let numbers =
        nodes::numbers_of(&backs, next, wanted.iter().map(in_chunk)).map_err(|w| fault(own, w, at))?;
    drop(backs);
    let (cells, at) = sections.read(file, b"BCEL", own, job)?;
    let places = wanted.iter().flat_map(in_chunk);
    for (b, &number) in places.zip(&numbers) {
        let cell = nodes::cell_of(&cells, b)
            .ok_or_else(|| fault(own, (*b"BCEL", format!("ends before box {b}")), at))?;
        picked.boxes.push((cell, number));
        picked.nodes.entry(number).or_default();
    }
    drop(cells);

    for (i, &(number, first)) in firsts.iter().enumerate() {
        // The streams of the last frame say themselves where they end.
        let end = firsts.get(i + 1).map_or(u64::MAX, |&(_, next)| next);
        let asked: Vec<u64> = picked.nodes.range(first..end).map(|(node, _)| node - first).collect();
        if asked.is_empty() {
            continue;
        }
        let (occupied, at) = sections.read(file, b"OCCU", number, job)?;
        let (classes, _) = sections.read(file, b"CLAS", number, job)?;
        let found = nodes::find(&occupied, &classes, &asked).map_err(|w| fault(number, w, at))?;
        drop((occupied, classes));
        let mut parts: Vec<[Vec<u8>; 3]> = found.iter().map(|_| Default::default()).collect();
        for (k, name) in nodes::REFERENCES.into_iter().enumerate() {
            let (stream, at) = sections.read(file, name, number, job)?;
            for (node, parts) in found.iter().zip(&mut parts) {
                let part = nodes::elements(&stream, k, &node.references[k], leaves);
                parts[k] = part.map_err(|w| fault(number, w, at))?.to_vec();
            }
        }
        let of_frame = picked.nodes.range_mut(first..end).map(|(_, words)| words);
        for ((node, parts), words) in found.iter().zip(&parts).zip(of_frame) {
            node.append([&parts[0], &parts[1], &parts[2]], leaves, words);
        }
    }
    Ok(picked)
}

/// Appends the picked boxes of a chunk, with their runs, nodes, and the leaves that these use.
pub(super) fn put_together(
    volume: &mut CompressedVolume,
    records: &mut Vec<BoxRecord>,
    nodes: &mut Vec<u16>,
    chunk: &Chunk,
    former: &Leaves,
    wanted: &[Wanted],
    picked: &Picked,
) -> std::result::Result<(), Wrong> {
    let (leaves, places) = used_leaves(former, picked)?;
    let (first_box, node_base) = (records.len(), nodes.len());
    volume.chunks.push(Chunk {
        origin: chunk.origin,
        first_box: first_box as u64,
        first_run: volume.runs.len() as u64,
        node_base: node_base as u64,
    });
    let mut placed: BTreeMap<u64, u32> = BTreeMap::new();
    let mut boxes = picked.boxes.iter();
    for w in wanted {
        let run = LabelRun { label: w.label, first_box: (records.len() - first_box) as u32 };
        volume.runs.push(run);
        for &(cell, name) in boxes.by_ref().take((w.boxes.end - w.boxes.start) as usize) {
            let words = &picked.nodes[&name];
            let occupied = NodeRef::read(words, 0, &leaves).occupied;
            if occupied == 0 {
                return Err((*b"OCCU", format!("node {name}: got no occupied cell")));
            }
            let node = match placed.get(&name) {
                Some(&node) => node,
                None => {
                    let node = u32::try_from(nodes.len() - node_base).map_err(|_| {
                        let what = "expected the nodes of its boxes within 2^32 words, got more";
                        (*b"NODE", format!("chunk {}: {what}", w.chunk))
                    })?;
                    append(nodes, words, former, &places);
                    placed.insert(name, node);
                    node
                }
            };
            records.push(BoxRecord::new(cell, extent_of(occupied), node));
        }
    }
    volume.leaves.push(leaves);
    Ok(())
}

/// A leaf that a node refers to and that may be left out of the dictionary.
enum Named {
    Pattern(usize),
    Rare(usize),
}

/// The patterns and rare leaves that a node refers to, each with the index of the reference among the node's words.
fn named<'a>(words: &'a [u16], leaves: &'a Leaves) -> impl Iterator<Item = (Named, usize)> + 'a {
    let node = NodeRef::read(words, 0, leaves);
    node.references().filter_map(|(_, class, at)| match class {
        Class::Ranked => Some((Named::Pattern(usize::from(words[at]) % MAX_PATTERNS), at)),
        Class::Long if leaves.words_beyond_3() == 0 && u64::from(words[at]) & RARE == RARE => {
            Some((Named::Rare(rare_at(words, at)), at))
        }
        _ => None,
    })
}

/// Index of the rare field that the reference at word `at` names.
fn rare_at(words: &[u16], at: usize) -> usize {
    usize::from(words[at]) >> 12 | usize::from(words[at + 1]) << 4 | usize::from(words[at + 2]) << 20
}

/// New index of each pattern and of each rare field.
struct Places {
    patterns: Vec<usize>,
    rare: Vec<usize>,
}

/// The leaves that the picked nodes refer to, in their former order, and the new index of each. Slices stay, so that long references keep
/// their length.
fn used_leaves(leaves: &Leaves, picked: &Picked) -> std::result::Result<(Leaves, Places), Wrong> {
    let (mut patterns, mut rare) = (vec![false; leaves.patterns.len()], vec![false; leaves.rare.len()]);
    for words in picked.nodes.values() {
        for (leaf, _) in named(words, leaves) {
            let (section, used, place) = match leaf {
                Named::Pattern(place) => (b"LEAF", &mut patterns, place),
                Named::Rare(place) => (b"RARE", &mut rare, place),
            };
            let entries = used.len();
            *used
                .get_mut(place)
                .ok_or_else(|| (*section, format!("entries: expected more than {place}, got {entries}")))? =
                true;
        }
    }
    let keep = |all: &[u64], is_used: &[bool]| -> (Vec<u64>, Vec<usize>) {
        let mut kept = Vec::new();
        let place = |(&field, &is_used): (&u64, &bool)| {
            let place = kept.len();
            kept.extend(is_used.then_some(field));
            place
        };
        let places = all.iter().zip(is_used).map(place).collect();
        (kept, places)
    };
    let (patterns, patterns_places) = keep(&leaves.patterns, &patterns);
    let (rare, rare_places) = keep(&leaves.rare, &rare);
    let places = Places { patterns: patterns_places, rare: rare_places };
    Ok((Leaves { patterns: patterns.into(), slices: leaves.slices.clone(), rare: rare.into() }, places))
}

/// Appends a node with its references changed to the new indices.
fn append(nodes: &mut Vec<u16>, words: &[u16], leaves: &Leaves, places: &Places) {
    let start = nodes.len();
    nodes.extend_from_slice(words);
    for (leaf, at) in named(words, leaves) {
        let to = &mut nodes[start + at..];
        match leaf {
            // No index grows, so its former bits are enough.
            Named::Pattern(from) => to[0] -= (from - places.patterns[from]) as u16,
            Named::Rare(from) => {
                let place = (places.rare[from] as u64) << 12 | RARE;
                to.iter_mut().take(3).zip([0, 16, 32]).for_each(|(w, s)| *w = (place >> s) as u16);
            }
        }
    }
}

/// Reads ranges of a section: from the file where it is stored as it is, otherwise from the decoded section in memory.
pub(super) struct Ranges<'a, F> {
    file: &'a mut F,
    entry: Entry,
    /// Size of the decoded section in bytes.
    pub(super) bytes: u64,
    /// Bytes of the section and the offset at which they start; the whole section where it had to be decoded.
    window: (u64, Vec<u8>),
}

impl<'a, F: Read + Seek> Ranges<'a, F> {
    pub(super) fn open(
        file: &'a mut F,
        layout: &Layout,
        name: &'static [u8; 4],
        job: &Job,
    ) -> std::result::Result<Self, Stop> {
        let Some(entry) = layout.entry(name).copied() else {
            let what = "expected the section, got none".into();
            return Err(Stop::Fault(FormatError { section: *name, at: 0, what }));
        };
        let e = entry.encoding;
        let window = if e.zstd || e.delta || e.planes {
            (0, read_sections(file, None, layout, &[name], job)?.take(name)?)
        } else {
            (0, Vec::new())
        };
        Ok(Self { file, entry, bytes: entry.decoded, window })
    }

    fn fault(&self, what: String) -> Stop {
        Stop::Fault(FormatError { section: self.entry.name, at: self.entry.offset, what })
    }

    /// Returns the bytes `from..from + length` of the section.
    pub(super) fn read(&mut self, from: u64, length: u64) -> std::result::Result<&[u8], Stop> {
        if from.checked_add(length).is_none_or(|end| end > self.bytes) {
            return Err(self.fault(format!("expected bytes {from} to {from} + {length}, got {}", self.bytes)));
        }
        let (start, window) = &self.window;
        if from < *start || from + length > start + window.len() as u64 {
            let take = length.max(PIECE_BYTES).min(self.bytes - from);
            let bytes = read_at(self.file, self.entry.offset + from, take, self.entry.name)?;
            self.window = (from, bytes);
        }
        let (start, window) = &self.window;
        let at = (from - start) as usize;
        Ok(&window[at..at + length as usize])
    }
}

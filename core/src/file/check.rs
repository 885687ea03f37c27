//! Checks every invariant of a volume that comes from outside once, so that later code never meets a bad index.
//!
//! The order is: names, dictionary, chunks, runs, nodes, boxes, voxel counts. It does not check whether two labels claim the same voxel,
//! which would take as much memory as decoding. The content hash, compared afterwards, covers that for files whose writer was not faulty.

use super::nodes::Wrong;
use crate::annotations::{NumericColumn, check_names};
use crate::cell::CELL;
use crate::error::one_line;
use crate::label_table::NO_TYPE;
use crate::leaves::{Class, MAX_PATTERNS, MAX_SLICES, RARE};
use crate::node::{NodeRef, OCCUPIED_WORDS, extent_of, header_words};
use crate::volume::CHUNK_CELLS;
use crate::{BoxView, CHUNK_VOXELS, Chunk, CompressedVolume, Leaves, MAX_DIM, VolumeInfo, morton};

/// Nothing, or the section that is wrong and what is wrong in it.
pub(super) type Finding = Result<(), Wrong>;

fn ensure(holds: bool, section: &[u8; 4], what: impl FnOnce() -> String) -> Finding {
    if holds { Ok(()) } else { Err((*section, what())) }
}

/// Checks the parts of a volume that do not need its boxes: info, labels, patterns, slices.
pub(super) fn check_head(v: &CompressedVolume) -> Finding {
    check_info(&v.info)?;
    check_labels(v)?;
    for (c, leaves) in v.leaves.iter().enumerate() {
        check_leaves(leaves).map_err(|(section, what)| (section, format!("chunk {c}: {what}")))?;
    }
    Ok(())
}

pub(super) fn check_leaves(leaves: &Leaves) -> Finding {
    let (patterns, slices) = (leaves.patterns().len(), leaves.slices().len());
    ensure(patterns <= MAX_PATTERNS, b"LEAF", || {
        format!("patterns: expected at most {MAX_PATTERNS}, got {patterns}")
    })?;
    ensure(slices <= MAX_SLICES, b"SLIC", || format!("slices: expected at most {MAX_SLICES}, got {slices}"))?;
    for (section, fields) in [(b"LEAF", leaves.patterns()), (b"RARE", leaves.rare())] {
        for (i, &field) in fields.iter().enumerate() {
            ensure(field != 0 && field != u64::MAX, section, || {
                format!("entry {i}: expected a mixed field, got an empty or a full one")
            })?;
        }
    }
    Ok(())
}

/// Checks the boxes of a volume whose head is valid. The volume may hold all labels of its file or a chosen subset.
pub(super) fn check(v: &CompressedVolume) -> Finding {
    check_chunks(v)?;
    check_runs(v)?;
    let mut nodes = Nodes::within(v.nodes.len());
    (0..v.chunks.len()).try_for_each(|chunk| check_nodes(v, chunk, &mut nodes))?;
    check_boxes(v, &nodes)?;
    let mut counts = vec![0; v.labels.ids.len()];
    count_voxels(v, &nodes, &mut counts)?;
    check_counts(v, &counts)
}

/// Checks the leaves, runs, nodes and boxes of a volume of one chunk, which need not be all of a volume; `visit` gets each label with its
/// voxels.
pub(super) fn check_chunk(v: &CompressedVolume, visit: impl FnMut(u32, u64)) -> Finding {
    let mut shared = SharedNodes::check(v)?;
    shared.check_frame(v, visit)?;
    shared.check_end(v)
}

/// The nodes of a volume of one chunk, checked, that the boxes of its frames share.
pub(super) struct SharedNodes {
    nodes: Nodes,
    /// Word at which the nodes begin that no box has used yet.
    unused: u64,
}

impl SharedNodes {
    /// Checks the leaves and nodes of the chunk, of all frames.
    pub(super) fn check(v: &CompressedVolume) -> Result<Self, Wrong> {
        v.leaves.iter().try_for_each(check_leaves)?;
        let mut nodes = Nodes::within(v.nodes.len());
        (0..v.chunks.len()).try_for_each(|chunk| check_nodes(v, chunk, &mut nodes))?;
        Ok(Self { nodes, unused: 0 })
    }

    /// Checks the runs and boxes of the next frame, which `v` holds; `visit` gets each label with its voxels.
    pub(super) fn check_frame(&mut self, v: &CompressedVolume, mut visit: impl FnMut(u32, u64)) -> Finding {
        check_chunks(v)?;
        check_runs(v)?;
        for chunk in 0..v.chunks.len() {
            self.unused = check_boxes_of(v, chunk, &self.nodes, self.unused)?;
        }
        check_order(v)?;
        for_each_run(v, |label, chunk, boxes| {
            let voxels =
                |record: &crate::BoxRecord| self.nodes.voxels_at(chunk.node_base + u64::from(record.node()));
            visit(label, boxes.iter().map(voxels).sum());
            Ok(())
        })
    }

    /// Checks, after the last frame, that some box uses each node.
    pub(super) fn check_end(&self, v: &CompressedVolume) -> Finding {
        check_all_used(0, self.unused, v.nodes.len())
    }
}

pub(super) fn check_info(info: &VolumeInfo) -> Finding {
    ensure(info.dims.iter().all(|&d| d <= MAX_DIM), b"INFO", || {
        format!("dims: expected at most {MAX_DIM} an axis, got {:?}", info.dims)
    })?;
    ensure(info.world_from_index.is_finite(), b"INFO", || {
        "world_from_index: expected finite entries, got one that is infinite or not a number".into()
    })?;
    ensure(info.notes.is_sorted_by(|a, b| a.id < b.id), b"INFO", || "notes: expected rising ids".into())
}

pub(super) fn check_labels(v: &CompressedVolume) -> Finding {
    let l = &v.labels;
    let n = l.ids.len();
    ensure(u32::try_from(n).is_ok(), b"LIDS", || format!("labels: expected below 2^32, got {n}"))?;
    ensure(l.ids.first() != Some(&0) && l.ids.is_sorted_by(|a, b| a < b), b"LIDS", || {
        "expected rising ids without 0".into()
    })?;
    ensure(l.voxels.len() == n, b"LVOX", || format!("labels: expected {n}, got {}", l.voxels.len()))?;
    let typed = l.types.is_empty() || l.types.len() == n;
    ensure(typed, b"LTYP", || format!("labels: expected {n} or 0, got {}", l.types.len()))?;
    let known = |&t: &u16| t == NO_TYPE || usize::from(t) < l.type_names.len();
    ensure(l.types.iter().all(known), b"LTYP", || format!("expected types below {}", l.type_names.len()))?;
    check_names(&l.columns).map_err(|e| (*b"INFO", one_line(&e.to_string())))?;
    let finite = |c: &NumericColumn| c.values.len() == n && !c.values.iter().any(|v| v.is_infinite());
    ensure(l.columns.iter().all(finite), b"LCOL", || "expected finite numbers, got an infinite one".into())
}

fn check_chunks(v: &CompressedVolume) -> Finding {
    let mut before: Option<(u64, &Chunk)> = None;
    for (i, c) in v.chunks.iter().enumerate() {
        let inside = (0..3).all(|a| c.origin[a] % CHUNK_VOXELS == 0 && c.origin[a] < v.info.dims[a]);
        ensure(inside, b"CHNK", || {
            format!("chunk {i}: got origin {:?} in {:?} voxels", c.origin, v.info.dims)
        })?;
        let code = morton::encode(c.origin.map(|o| o / 4)) / CHUNK_CELLS;
        let rises = match before {
            None => c.first_box == 0 && c.first_run == 0 && c.node_base == 0,
            Some((code_before, other)) => {
                code > code_before
                    && c.first_box > other.first_box
                    && c.first_run > other.first_run
                    && c.node_base > other.node_base
            }
        };
        ensure(rises, b"CHNK", || format!("chunk {i}: expected a start after the chunk before"))?;
        let fits = c.first_box < v.boxes.len() as u64
            && c.first_run < v.runs.len() as u64
            && c.node_base < v.nodes.len() as u64;
        ensure(fits, b"CHNK", || format!("chunk {i}: got a start beyond the boxes, runs or nodes"))?;
        before = Some((code, c));
    }
    ensure(!v.chunks.is_empty() || (v.boxes.is_empty() && v.runs.is_empty()), b"CHNK", || {
        "expected a chunk for the boxes, got none".into()
    })?;
    ensure(u32::try_from(v.boxes.len()).is_ok(), b"CHNK", || {
        format!("boxes: expected below 2^32, got {}", v.boxes.len())
    })
}

fn check_runs(v: &CompressedVolume) -> Finding {
    for (i, c) in v.chunks.iter().enumerate() {
        let next = v.chunks.get(i + 1);
        let boxes = next.map_or(v.boxes.len() as u64, |n| n.first_box) - c.first_box;
        let end = next.map_or(v.runs.len() as u64, |n| n.first_run);
        let runs = &v.runs[c.first_run as usize..end as usize];
        let rises = runs.is_sorted_by(|a, b| a.label < b.label && a.first_box < b.first_box)
            && runs.first().is_some_and(|r| r.first_box == 0)
            && runs
                .last()
                .is_some_and(|r| u64::from(r.first_box) < boxes && (r.label as usize) < v.labels.ids.len());
        ensure(rises, b"RUNS", || {
            format!("chunk {i}: expected rising labels below {} and boxes below {boxes}", v.labels.ids.len())
        })?;
    }
    Ok(())
}

/// Walks the nodes of a chunk from first to last.
fn check_nodes(v: &CompressedVolume, chunk: usize, nodes: &mut Nodes) -> Finding {
    let (range, leaves) = (v.node_range(chunk), &v.leaves[chunk]);
    let of_chunk = &v.nodes[..range.end];
    let mut at = range.start;
    while at < range.end {
        let wrong = |what: String| Err((*b"NODE", format!("node at word {at}: {what}")));
        let got = range.end - at;
        let occupied = of_chunk[at..].iter().take(OCCUPIED_WORDS).map(|w| w.count_ones()).sum::<u32>();
        if got < OCCUPIED_WORDS || occupied == 0 || got < header_words(occupied) {
            return wrong(format!("expected occupied cells and their classes, got {got} words"));
        }
        let node = NodeRef::read(of_chunk, at, leaves);
        if got < node.words() {
            return wrong(format!("expected {} words, got {got}", node.words()));
        }
        // Bits left over in the last word of the classes.
        let spare = 16 * (header_words(occupied) - OCCUPIED_WORDS) - 2 * occupied as usize;
        if u32::from(of_chunk[at + header_words(occupied) - 1]).wrapping_shr(16 - spare as u32) != 0 {
            return wrong("expected zeros behind the last class, got other bits".into());
        }
        for (_, class, from) in node.references() {
            let words = &of_chunk[at + from..];
            let (highest, entries) = match class {
                Class::Solid => continue,
                Class::Ranked => (u64::from(words[0]) % MAX_PATTERNS as u64, leaves.patterns().len()),
                Class::Sliced => {
                    let numbers = words[..2].iter().flat_map(|w| w.to_le_bytes()).max();
                    (numbers.unwrap_or(0).into(), leaves.slices().len())
                }
                Class::Long if leaves.words_beyond_3() == 1 => continue,
                Class::Long => {
                    let three = words[..3].iter().rev().fold(0, |all, &w| all << 16 | u64::from(w));
                    if three & RARE == RARE {
                        (three >> 12, leaves.rare().len())
                    } else {
                        let numbers = [0, 12, 24, 36].map(|s| three >> s & RARE);
                        (numbers.into_iter().max().unwrap_or(0), leaves.slices().len())
                    }
                }
            };
            if highest >= entries as u64 {
                return wrong(format!("expected leaves below {entries}, got {highest}"));
            }
        }
        let mut voxels = 0;
        for ((_, class), (_, field, _)) in node.classes().zip(node.flipped_fields()) {
            if class != Class::Solid && (field == 0 || field == u64::MAX) {
                return wrong("expected mixed fields, got an empty or a full one".into());
            }
            voxels += field.count_ones() as u16;
        }
        nodes.push(at, voxels);
        at += node.words();
    }
    Ok(())
}

fn check_boxes(v: &CompressedVolume, nodes: &Nodes) -> Finding {
    for (i, c) in v.chunks.iter().enumerate() {
        let unused = check_boxes_of(v, i, nodes, c.node_base)?;
        check_all_used(i, unused, v.node_range(i).end)?;
    }
    check_order(v)
}

/// Checks that the boxes of a chunk use all of its nodes, of which those from word `unused` on are without a box.
fn check_all_used(chunk: usize, unused: u64, end: usize) -> Finding {
    ensure(unused == end as u64, b"NODE", || {
        format!(
            "chunk {chunk}: expected use of all words to {end}, got nodes without a box from word {unused}"
        )
    })
}

/// The boxes within a run must rise in Morton order: binary searches and the packed form rely on it.
fn check_order(v: &CompressedVolume) -> Finding {
    for_each_run(v, |_, _, run| {
        let rises = run.is_sorted_by(|a, b| morton::encode(a.cell()) < morton::encode(b.cell()));
        ensure(rises, b"BOXS", || "expected boxes of a label in Morton order".into())
    })
}

/// Checks the boxes of a chunk. Before them, no box has used the nodes from word `unused` on; returns the word after them. Writing boxes and nodes
/// as streams relies on nodes in order of first use.
fn check_boxes_of(v: &CompressedVolume, i: usize, nodes: &Nodes, mut unused: u64) -> Result<u64, Wrong> {
    let (c, range) = (&v.chunks[i], v.node_range(i));
    for (k, record) in v.boxes[v.box_range(i)].iter().enumerate() {
        let wrong = |what: String| (*b"BOXS", format!("box {k} of chunk {i}: {what}"));
        let at = c.node_base + u64::from(record.node());
        if at >= range.end as u64 || !nodes.start_at(at) {
            return Err(wrong(format!("expected the start of a node of the chunk, got word {at}")));
        }
        if at > unused {
            return Err(wrong(format!("expected nodes in order of first use, next word {unused}, got {at}")));
        }
        let node = NodeRef::read(&v.nodes[..range.end], at as usize, &v.leaves[i]);
        if at == unused {
            unused += node.words() as u64;
        }
        let (extent, tight) = (record.extent(), extent_of(node.occupied));
        if extent != tight || record.0 >> 38 & 3 != 0 {
            return Err(wrong(format!("expected an extent of {tight:?} cells, got {extent:?}")));
        }
        let cell = record.cell();
        if (0..3).any(|a| cell[a] + extent[a] > CHUNK_VOXELS / CELL) {
            return Err(wrong(format!("reaches beyond the chunk from its cell {cell:?}")));
        }
        let low = [0, 1, 2].map(|a| c.origin[a] + 4 * cell[a]);
        let past = [0, 1, 2].map(|a| low[a] + 4 * extent[a] > v.info.dims[a]);
        let (_, high) = if past.contains(&true) {
            BoxView { origin: low, extent, node }.voxel_bounds()
        } else {
            (low, low)
        };
        if (0..3).any(|a| high[a] >= v.info.dims[a]) {
            return Err(wrong(format!("at {low:?} reaches beyond the volume of {:?} voxels", v.info.dims)));
        }
    }
    Ok(unused)
}

/// Calls `visit` with the label of each run, its chunk and its boxes.
fn for_each_run(
    v: &CompressedVolume,
    mut visit: impl FnMut(u32, &Chunk, &[crate::BoxRecord]) -> Finding,
) -> Finding {
    for (i, c) in v.chunks.iter().enumerate() {
        let next = v.chunks.get(i + 1);
        let boxes = &v.boxes[c.first_box as usize..next.map_or(v.boxes.len(), |n| n.first_box as usize)];
        let runs = &v.runs[c.first_run as usize..next.map_or(v.runs.len(), |n| n.first_run as usize)];
        for (r, run) in runs.iter().enumerate() {
            let end = runs.get(r + 1).map_or(boxes.len(), |n| n.first_box as usize);
            visit(run.label, c, &boxes[run.first_box as usize..end])?;
        }
    }
    Ok(())
}

/// Adds the voxels of each label.
fn count_voxels(v: &CompressedVolume, nodes: &Nodes, counts: &mut [u64]) -> Finding {
    for_each_run(v, |label, chunk, boxes| {
        let voxels = |record: &crate::BoxRecord| nodes.voxels_at(chunk.node_base + u64::from(record.node()));
        counts[label as usize] += boxes.iter().map(voxels).sum::<u64>();
        Ok(())
    })
}

/// Compares each label's voxels with the label table.
pub(super) fn check_counts(v: &CompressedVolume, counts: &[u64]) -> Finding {
    for (i, (&expected, &got)) in v.labels.voxels.iter().zip(counts).enumerate() {
        let expected = if v.holds(i as u32) { expected } else { 0 };
        // At one frame of a time series, labels of other frames have none.
        let may_be_absent = v.frame.is_some() || !v.holds(i as u32);
        ensure(expected == got && (got > 0 || may_be_absent), b"LVOX", || {
            format!("label {i}: expected {expected} voxels, got {got}")
        })?;
    }
    let total = counts.iter().fold(0u64, |t, &c| t.saturating_add(c));
    ensure(total <= v.info.voxels(), b"LVOX", || {
        format!("voxels: expected at most {}, got {total}", v.info.voxels())
    })
}

/// Where nodes start, and how many voxels each has.
///
/// ```text
/// starts   a bit for each word: 1 where a node starts
/// before   for each 64 of these bits, how many nodes start before them
/// voxels   for each node, from 1 to 4096
/// ```
struct Nodes {
    starts: Vec<u64>,
    before: Vec<u64>,
    voxels: Vec<u16>,
}

impl Nodes {
    /// None yet, of an array of this many words.
    fn within(words: usize) -> Self {
        let groups = words.div_ceil(64);
        Self { starts: vec![0; groups], before: Vec::with_capacity(groups), voxels: Vec::new() }
    }

    /// Appends the node that starts at this word, which comes after the others.
    fn push(&mut self, at: usize, voxels: u16) {
        self.before.resize(at / 64 + 1, self.voxels.len() as u64);
        self.starts[at / 64] |= 1 << (at % 64);
        self.voxels.push(voxels);
    }

    fn start_at(&self, at: u64) -> bool {
        self.starts.get((at / 64) as usize).is_some_and(|group| group >> (at % 64) & 1 != 0)
    }

    /// Voxels of the node that starts at this word.
    fn voxels_at(&self, at: u64) -> u64 {
        let (group, below) = ((at / 64) as usize, (1 << (at % 64)) - 1);
        let number = self.before[group] + u64::from((self.starts[group] & below).count_ones());
        self.voxels[number as usize].into()
    }
}

//! Adds labels to a volume that holds some of its file's labels: only their boxes and nodes are read, and these are merged.
//!
//! ```text
//! held      boxes of label 3, 7      ─┐   chunk by chunk   nodes of the held volume as they are, behind them those
//!                                     ├─►                  of the others that it has not: equal nodes become one
//! more      boxes of label 4         ─┘                    (paper §3.2.2: SVDAGs of types are merged on request)
//! ```
//! Each part refers to leaves of its own ([`crate::Leaves`]), which are some of the file's in the file's order. The joined chunk has those
//! of the held volume first, so that its nodes keep their references; nodes of the other part are rewritten.

use std::cmp::Ordering;

use rustc_hash::FxHashMap;
use xxhash_rust::xxh3::xxh3_64;

use crate::leaves::{Class, MAX_PATTERNS, RARE};
use crate::node::NodeRef;
use crate::reserve::{make_room, make_room_in_map, reserved};
use crate::{BoxRecord, CHUNK_VOXELS, Chunk, CompressedVolume, Error, LabelRun, Leaves, Result, morton};

/// What memory is for, in errors.
const WHAT: &str = "the volume with more of its labels";

impl CompressedVolume {
    /// The volume that holds the labels of this one and those of `more`: another part of the same file
    /// ([`CompressedVolume::open_labels`], [`crate::Series::frame_labels`]). Nodes that both parts have are stored once. It draws as the
    /// part that is opened with all of these labels at once. With all labels of the file it can be saved; nodes and leaves then stand in
    /// another order than in that file.
    ///
    /// # Errors
    /// [`Error::Caller`] where the two are not parts of one volume, where both hold a label, or where boxes are on disk
    /// ([`CompressedVolume::open_paged`]); [`Error::Memory`].
    pub fn with_more_labels(&self, more: &Self) -> Result<Self> {
        let held = self.check_parts(more)?;
        let mut joined = Self::empty(self.info.clone());
        joined.labels = self.labels.clone();
        (joined.hash, joined.frame, joined.held) = (self.hash.clone(), self.frame, Some(held));
        let sum = |of: fn(&Self) -> usize| of(self).saturating_add(of(more));
        let mut records: Vec<BoxRecord> = reserved(sum(|v| v.boxes.len()), WHAT)?;
        let mut nodes: Vec<u16> = reserved(sum(|v| v.nodes.len()), WHAT)?;
        joined.runs = reserved(sum(|v| v.runs.len()), WHAT)?;
        let (mut ours, mut theirs) = (0, 0);
        loop {
            let place = |v: &Self, c: usize| {
                v.chunks.get(c).map(|chunk| morton::encode(chunk.origin.map(|v| v / CHUNK_VOXELS)))
            };
            let order = match (place(self, ours), place(more, theirs)) {
                (None, None) => break,
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (Some(a), Some(b)) => a.cmp(&b),
            };
            let first = (order != Ordering::Greater).then_some(Part { volume: self, chunk: ours });
            let second = (order != Ordering::Less).then_some(Part { volume: more, chunk: theirs });
            (ours, theirs) = (ours + usize::from(first.is_some()), theirs + usize::from(second.is_some()));
            joined.join_chunk(&mut records, &mut nodes, first, second)?;
        }
        // Nodes that both parts have were counted twice.
        nodes.shrink_to_fit();
        (joined.boxes, joined.nodes) = (records.into(), nodes.into());
        Ok(joined)
    }

    /// Which labels the two hold together.
    fn check_parts(&self, more: &Self) -> Result<Vec<bool>> {
        let refused = |what: &str| Err(Error::Caller(format!("labels cannot be added: {what}")));
        if self.pages.is_some() || more.pages.is_some() {
            return refused("the boxes are on disk, and all labels with them");
        }
        let (Some(held), Some(others)) = (&self.held, &more.held) else {
            return refused("the volume holds all of its labels");
        };
        let same = self.content_hash() == more.content_hash() && self.frame == more.frame;
        if !same || self.info.dims != more.info.dims || self.labels.ids != more.labels.ids {
            return refused("they are of another volume; the file has changed");
        }
        match held.iter().zip(others).position(|(&a, &b)| a && b) {
            None => Ok(held.iter().zip(others).map(|(&a, &b)| a || b).collect()),
            Some(label) => refused(&format!("label {} is there already", self.labels.ids[label])),
        }
    }

    /// Appends a chunk that one part has or both have.
    fn join_chunk(
        &mut self,
        records: &mut Vec<BoxRecord>,
        nodes: &mut Vec<u16>,
        first: Option<Part<'_>>,
        second: Option<Part<'_>>,
    ) -> Result<()> {
        let (Some(a), b) = (match first {
            Some(first) => (Some(first), second),
            None => (second, None),
        }) else {
            return Ok(());
        };
        let (first_box, node_base) = (records.len() as u64, nodes.len() as u64);
        let origin = a.volume.chunks[a.chunk].origin;
        self.chunks.push(Chunk { origin, first_box, first_run: self.runs.len() as u64, node_base });
        nodes.extend_from_slice(a.nodes());
        let Some(b) = b else {
            self.runs.extend_from_slice(a.runs());
            records.extend_from_slice(a.boxes());
            self.leaves.push(a.leaves().clone());
            return Ok(());
        };
        let (leaves, places) = joined_leaves(a.leaves(), b.leaves())?;
        let moved = append_nodes(nodes, node_base as usize, &a, &b, &places)?;
        self.leaves.push(leaves);
        let (mut ours, mut theirs) = (0, 0);
        while ours < a.runs().len() || theirs < b.runs().len() {
            let label = |part: &Part<'_>, run: usize| part.runs().get(run).map_or(u32::MAX, |run| run.label);
            let is_ours =
                theirs == b.runs().len() || ours < a.runs().len() && label(&a, ours) < label(&b, theirs);
            let (part, run) = if is_ours { (&a, &mut ours) } else { (&b, &mut theirs) };
            let at = (records.len() as u64 - first_box) as u32;
            self.runs.push(LabelRun { label: label(part, *run), first_box: at });
            let of_run = part.boxes_of_run(*run);
            if is_ours {
                records.extend_from_slice(of_run);
            } else {
                records.extend(of_run.iter().map(|r| BoxRecord::new(r.cell(), r.extent(), moved[&r.node()])));
            }
            *run += 1;
        }
        Ok(())
    }
}

/// A chunk of a part.
struct Part<'v> {
    volume: &'v CompressedVolume,
    chunk: usize,
}

impl<'v> Part<'v> {
    fn nodes(&self) -> &'v [u16] {
        &self.volume.nodes[self.volume.node_range(self.chunk)]
    }

    fn boxes(&self) -> &'v [BoxRecord] {
        &self.volume.boxes[self.volume.box_range(self.chunk)]
    }

    fn runs(&self) -> &'v [LabelRun] {
        &self.volume.runs[self.volume.run_range(self.chunk)]
    }

    fn leaves(&self) -> &'v Leaves {
        &self.volume.leaves[self.chunk]
    }

    fn boxes_of_run(&self, run: usize) -> &'v [BoxRecord] {
        let (runs, boxes) = (self.runs(), self.boxes());
        let end = runs.get(run + 1).map_or(boxes.len(), |next| next.first_box as usize);
        &boxes[runs[run].first_box as usize..end]
    }

    /// Words of the node at `at` of the chunk's nodes.
    fn node(&self, at: u32) -> &'v [u16] {
        let nodes = &self.nodes()[at as usize..];
        &nodes[..NodeRef::read(nodes, 0, self.leaves()).words()]
    }
}

/// Index in the joined tables of each pattern and of each rare field of the second part.
struct Places {
    patterns: Vec<u16>,
    rare: Vec<u64>,
}

/// The leaves of two parts of a chunk: those of `first`, then those that it has not.
fn joined_leaves(first: &Leaves, second: &Leaves) -> Result<(Leaves, Places)> {
    let of_file = "labels cannot be added: the leaves of a chunk are not those of one file";
    if first.slices != second.slices {
        return Err(Error::Caller(of_file.into()));
    }
    let (patterns, of_patterns) = joined(&first.patterns, &second.patterns)?;
    let (rare, of_rare) = joined(&first.rare, &second.rare)?;
    if patterns.len() > MAX_PATTERNS {
        return Err(Error::Caller(of_file.into()));
    }
    let places = Places { patterns: of_patterns.into_iter().map(|p| p as u16).collect(), rare: of_rare };
    Ok((Leaves { patterns: patterns.into(), slices: first.slices.clone(), rare: rare.into() }, places))
}

/// Two tables as one, and the index in it of each entry of the second.
fn joined(first: &[u64], second: &[u64]) -> Result<(Vec<u64>, Vec<u64>)> {
    let mut index: FxHashMap<u64, u64> = FxHashMap::default();
    let mut all: Vec<u64> = reserved(first.len() + second.len(), WHAT)?;
    let mut places: Vec<u64> = reserved(second.len(), WHAT)?;
    for (place, &field) in (0u64..).zip(first) {
        make_room_in_map(&mut index, WHAT)?;
        index.entry(field).or_insert(place);
        all.push(field);
    }
    for &field in second {
        make_room_in_map(&mut index, WHAT)?;
        let place = *index.entry(field).or_insert_with(|| {
            all.push(field);
            all.len() as u64 - 1
        });
        places.push(place);
    }
    Ok((all, places))
}

/// Appends the nodes of `second` that are not among those of `first`, which begin at word `base`; returns the new place of each node of
/// `second` by its former one, both counted from the chunk's first word.
fn append_nodes(
    nodes: &mut Vec<u16>,
    base: usize,
    first: &Part<'_>,
    second: &Part<'_>,
    places: &Places,
) -> Result<FxHashMap<u32, u32>> {
    // Equal hashes are no proof, so words are compared; of two nodes with one hash the first alone is found again.
    let mut known: FxHashMap<u64, u32> = FxHashMap::default();
    for record in first.boxes() {
        make_room_in_map(&mut known, WHAT)?;
        known.entry(xxh3_64(bytemuck::cast_slice(first.node(record.node())))).or_insert(record.node());
    }
    let mut moved: FxHashMap<u32, u32> = FxHashMap::default();
    let mut words: Vec<u16> = Vec::new();
    for record in second.boxes() {
        if moved.contains_key(&record.node()) {
            continue;
        }
        words.clear();
        words.extend_from_slice(second.node(record.node()));
        rewrite(&mut words, second.leaves(), places);
        let hash = xxh3_64(bytemuck::cast_slice(&words));
        let there = known.get(&hash).copied().filter(|&at| nodes[base + at as usize..].starts_with(&words));
        let at = match there {
            Some(at) => at,
            None => {
                let at = u32::try_from(nodes.len() - base).map_err(|_| {
                    Error::Caller("labels cannot be added: the nodes of a chunk pass 2^32 words".into())
                })?;
                make_room(nodes, words.len(), WHAT)?;
                nodes.extend_from_slice(&words);
                make_room_in_map(&mut known, WHAT)?;
                known.entry(hash).or_insert(at);
                at
            }
        };
        make_room_in_map(&mut moved, WHAT)?;
        moved.insert(record.node(), at);
    }
    Ok(moved)
}

/// Changes the references of a node to leaves that have moved.
fn rewrite(words: &mut [u16], leaves: &Leaves, places: &Places) {
    let references: Vec<(Class, usize)> =
        NodeRef::read(words, 0, leaves).references().map(|(_, class, at)| (class, at)).collect();
    for (class, at) in references {
        match class {
            Class::Ranked => {
                let of_pattern = usize::from(words[at]) % MAX_PATTERNS;
                words[at] = words[at] - of_pattern as u16 + places.patterns[of_pattern];
            }
            Class::Long if leaves.words_beyond_3() == 0 => {
                let three = [0, 1, 2].iter().fold(0, |all, &i| all | u64::from(words[at + i]) << (16 * i));
                if three & RARE == RARE {
                    let named = places.rare[(three >> 12) as usize] << 12 | RARE;
                    [0, 1, 2].iter().for_each(|&i| words[at + i] = (named >> (16 * i)) as u16);
                }
            }
            _ => {}
        }
    }
}

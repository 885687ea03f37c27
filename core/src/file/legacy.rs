//! Files of version 1: the same boxes, with nodes in a larger layout, whose contents are taken out and written anew.
//!
//! ```text
//! a node then   occupied, solid, ranked (64 bits each)   16 bits a ranked cell: place in LEAF   64 bits a cell that is neither
//! LEAF          at most 65,536 fields
//! streams       SOLI  1 bit for each occupied cell       RANK  1 bit for each occupied, not solid cell
//!               REFS  u16 for each set bit of RANK       FLDS  u64 for each unset bit of RANK        the others as in `nodes`
//! ```
//! Version 3 says the same in fewer bytes ([`crate::node`]); the volume that comes out is the one that compressing anew would give.

use super::layout::{Layout, VERSION_OF_LARGE_NODES};
use super::nodes::{self, BitReader, Streams, Wrong, cells, u64s};
use super::read::{Sections, Stop};
use crate::leaves::{LeafIndex, Leaves};
use crate::node::{node_words, write_node};
use crate::{BoxRecord, Chunk, CompressedVolume};

/// Words of a node then before its references.
const HEADER_WORDS: usize = 12;

/// Sections that later files with boxes have not.
pub(super) const SECTIONS: [&[u8; 4]; 2] = [b"SOLI", b"RANK"];

/// Whether a file has such nodes.
pub(super) fn is_legacy(layout: &Layout) -> bool {
    layout.version == VERSION_OF_LARGE_NODES
}

/// What nodes hold.
#[derive(Default)]
struct Contents {
    /// Occupied, solid, and where its fields begin.
    nodes: Vec<(u64, u64, usize)>,
    fields: Vec<u64>,
    /// First word of each node in the larger layout.
    starts: Vec<u64>,
    words: u64,
}

impl Contents {
    fn push(
        &mut self,
        [occupied, solid, ranked]: [u64; 3],
        fields: impl Iterator<Item = Option<u64>>,
    ) -> bool {
        let first = self.fields.len();
        self.starts.push(self.words);
        self.nodes.push((occupied, solid, first));
        let mixed = occupied & !solid;
        let count = mixed.count_ones() as usize;
        self.fields.extend(fields.take(count).map_while(|f| f));
        let ranked = u64::from((mixed & ranked).count_ones());
        self.words += HEADER_WORDS as u64 + ranked + 4 * (count as u64 - ranked);
        self.fields.len() == first + count
    }

    fn fields_of(&self, node: usize) -> &[u64] {
        let end = self.nodes.get(node + 1).map_or(self.fields.len(), |n| n.2);
        &self.fields[self.nodes[node].2..end]
    }
}

/// Reads boxes and nodes into a volume whose head is read.
pub(super) fn read_boxes(volume: &mut CompressedVolume, sections: &mut Sections) -> Result<(), Stop> {
    let dictionary = std::mem::take(&mut volume.leaves.patterns);
    if let Some(i) = dictionary.iter().position(|&field| field == 0 || field == u64::MAX) {
        return Err(sections.fault(*b"LEAF", format!("entry {i}: got an empty or a full field")));
    }
    let plain = sections.has(b"NODE");
    let contents = if plain {
        let words = sections.elements(b"NODE", u16::from_le_bytes)?;
        from_words(&words, &dictionary)
    } else {
        from_streams(sections, &dictionary)?
    };
    let contents = contents.map_err(|(section, what)| sections.fault(section, what))?;

    // The nodes anew, in their order, and where each one is now.
    let leaves = Leaves::of_fields(contents.fields.clone());
    let index = LeafIndex::new(&leaves);
    let (mut words, mut starts) = (Vec::new(), Vec::with_capacity(contents.nodes.len()));
    for (i, &(occupied, solid, _)) in contents.nodes.iter().enumerate() {
        let (at, fields) = (words.len(), contents.fields_of(i));
        starts.push(at as u64);
        words.resize(at + node_words(occupied, fields, &index), 0);
        write_node(occupied, solid, fields, &index, &mut words[at..]);
    }
    (volume.nodes, volume.leaves) = (words.into(), leaves);

    let records: Option<Vec<BoxRecord>> = match plain {
        true => Some(sections.elements(b"BOXS", |b| BoxRecord(u64::from_le_bytes(b)))?),
        false => None,
    };
    let former = volume.chunks.clone();
    for chunk in &mut volume.chunks {
        let first = contents.starts.partition_point(|&s| s < chunk.node_base);
        chunk.node_base = starts.get(first).copied().unwrap_or(volume.nodes.len() as u64);
    }
    let boxes = match records {
        Some(records) => moved(&records, &former, &volume.chunks, &contents.starts, &starts),
        None => {
            let streams = Streams {
                cells: sections.take(b"BCEL")?,
                backs: sections.take(b"BNOD")?,
                ..Streams::default()
            };
            nodes::join_boxes(&streams, &volume.chunks, &volume.nodes, &starts)
        }
    };
    volume.boxes = boxes.map_err(|(section, what)| sections.fault(section, what))?.into();
    Ok(())
}

/// Contents of nodes that lie one after another.
fn from_words(words: &[u16], dictionary: &[u64]) -> Result<Contents, Wrong> {
    let mut contents = Contents::default();
    let mut rest = words;
    while !rest.is_empty() {
        let wrong = |what: &str| (*b"NODE", format!("node at word {}: {what}", words.len() - rest.len()));
        let short = || wrong("expected all of it, got the end");
        let (header, after) = rest.split_at_checked(HEADER_WORDS).ok_or_else(short)?;
        let (occupied, solid, ranked) = match header.as_chunks::<4>().0 {
            &[occupied, solid, ranked] => (word64(occupied), word64(solid), word64(ranked)),
            _ => return Err(short()),
        };
        let mixed = occupied & !solid;
        if occupied == 0 || solid & !occupied != 0 || ranked & !mixed != 0 {
            return Err(wrong("got masks that contradict each other"));
        }
        let (entries, after) = after.split_at_checked(ranked.count_ones() as usize).ok_or_else(short)?;
        let inline = 4 * (mixed & !ranked).count_ones() as usize;
        let (inline, after) = after.split_at_checked(inline).ok_or_else(short)?;
        let (mut entries, mut inline) = (entries.iter(), inline.as_chunks::<4>().0.iter());
        let fields = cells(mixed).map(|c| match ranked >> c & 1 {
            0 => inline.next().map(|&f| word64(f)).filter(|&f| f != 0 && f != u64::MAX),
            _ => entries.next().and_then(|&e| dictionary.get(usize::from(e))).copied(),
        });
        if !contents.push([occupied, solid, ranked], fields) {
            return Err(wrong("got an entry beyond LEAF, or an empty or a full field"));
        }
        rest = after;
    }
    Ok(contents)
}

fn word64(words: [u16; 4]) -> u64 {
    words.iter().rev().fold(0, |value, &w| value << 16 | u64::from(w))
}

/// Contents of nodes that were taken apart.
fn from_streams(sections: &mut Sections, dictionary: &[u64]) -> Result<Result<Contents, Wrong>, Stop> {
    let (occupied, solid) = (sections.take(b"OCCU")?, sections.take(b"SOLI")?);
    let (ranked, references) = (sections.take(b"RANK")?, sections.take(b"REFS")?);
    let fields = sections.take(b"FLDS")?;
    Ok(join(&occupied, &solid, &ranked, &references, &fields, dictionary))
}

fn join(
    occupied: &[u8],
    solid: &[u8],
    ranked: &[u8],
    references: &[u8],
    fields: &[u8],
    dictionary: &[u64],
) -> Result<Contents, Wrong> {
    let mut contents = Contents::default();
    let (mut solid, mut ranked) = (BitReader::new(solid), BitReader::new(ranked));
    let (references, extra) = references.as_chunks::<2>();
    let (mut references, mut inline) = (references.iter().map(|&b| u16::from_le_bytes(b)), u64s(fields));
    for (i, occupied) in u64s(occupied).enumerate() {
        let short = |section: &[u8; 4]| (*section, "ends before the last node".to_owned());
        let mut masks = [occupied, 0, 0];
        for c in cells(occupied) {
            masks[1] |= u64::from(solid.next().ok_or_else(|| short(b"SOLI"))?) << c;
        }
        for c in cells(occupied & !masks[1]) {
            masks[2] |= u64::from(ranked.next().ok_or_else(|| short(b"RANK"))?) << c;
        }
        let these = cells(occupied & !masks[1]).map(|c| match masks[2] >> c & 1 {
            0 => inline.next().filter(|&f| f != 0 && f != u64::MAX),
            _ => references.next().and_then(|e| dictionary.get(usize::from(e))).copied(),
        });
        if !contents.push(masks, these) {
            let what = format!("node {i}: expected a field for each cell, neither empty nor full");
            return Err((*b"FLDS", what));
        }
    }
    let ended = solid.is_done() && ranked.is_done() && extra.is_empty() && fields.len().is_multiple_of(8);
    match ended && references.next().is_none() && inline.next().is_none() && occupied.len().is_multiple_of(8)
    {
        true => Ok(contents),
        false => Err((*b"OCCU", "expected as many nodes as SOLI, RANK, REFS and FLDS have".to_owned())),
    }
}

/// Box records with their nodes where they are now.
fn moved(
    records: &[BoxRecord],
    former: &[Chunk],
    chunks: &[Chunk],
    former_starts: &[u64],
    starts: &[u64],
) -> Result<Vec<BoxRecord>, Wrong> {
    let mut c = 0;
    let place = |(i, record): (usize, &BoxRecord)| {
        while chunks.get(c + 1).is_some_and(|n| n.first_box <= i as u64) {
            c += 1;
        }
        let (before, now) = former.get(c).zip(chunks.get(c))?;
        let at = before.node_base.checked_add(record.node().into())?;
        let node = former_starts.binary_search(&at).ok()?;
        let place = u32::try_from(starts.get(node)?.checked_sub(now.node_base)?).ok()?;
        // Bits that should be 0 stay, to be found.
        Some(BoxRecord(record.0 >> 32 << 32 | u64::from(place)))
    };
    let mut place = place;
    let wrong = |i| (*b"BOXS", format!("box {i}: expected the start of a node, got none there"));
    records.iter().enumerate().map(|(i, r)| place((i, r)).ok_or_else(|| wrong(i))).collect()
}

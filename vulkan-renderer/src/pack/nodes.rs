//! Packs the nodes that drawn boxes refer to, without gaps.
//!
//! ```text
//! volume's nodes   [ a ][ b ][  c  ][ d ]        boxes of wanted labels refer to a, c, d
//! packed           [ a ][  c  ][ d ]             in the same order, so that offsets within a chunk only shrink
//! kept             (a → 0) (c → 20) (d → 44)     words; empty where all are kept and nothing moves
//! ```

use pumice_core::reserve::reserved;
use pumice_core::{CompressedVolume, Leaves, NoMemory};

/// The nodes of the wanted labels.
#[derive(Debug, Default)]
pub struct PackedNodes {
    /// Labels all of whose nodes are packed.
    labels: Vec<bool>,
    /// Former and new place of each kept node in 16-bit words, in ascending order; empty where nothing moved.
    kept: Vec<(u64, u64)>,
    words: u64,
}

/// Zero words at the end. They serve as a node without voxels. Shaders also read past the end of a node here, because they read aligned
/// 32-bit words; they never use these bits.
pub(super) const SPARE_WORDS: usize = 16;

impl PackedNodes {
    /// Chooses the nodes of the labels for which `wanted` is true; labels past its end are not wanted.
    pub fn new(volume: &CompressedVolume, wanted: &[bool]) -> Self {
        let is_wanted = |label: u32| wanted.get(label as usize).copied().unwrap_or(false);
        let labels: Vec<bool> = (0..volume.labels().ids().len() as u32).map(is_wanted).collect();
        if labels.iter().all(|&w| w) {
            return Self { labels, kept: Vec::new(), words: volume.nodes().len() as u64 };
        }
        let mut kept = Vec::new();
        for (c, run_label, range) in runs(volume) {
            if labels[run_label as usize] {
                let base = volume.chunks()[c].node_base;
                kept.extend(volume.boxes()[range].iter().map(|b| (base + u64::from(b.node()), 0)));
            }
        }
        kept.sort_unstable();
        kept.dedup();
        let mut words = 0;
        for (from, to) in &mut kept {
            *to = words;
            words += length(volume, *from) as u64;
        }
        // If no label is wanted, `kept` is empty too, but then no box looks up a node.
        Self { labels, kept, words }
    }

    /// Whether the nodes of all these labels are packed.
    pub fn covers(&self, wanted: &[bool]) -> bool {
        wanted.iter().enumerate().all(|(label, &w)| !w || self.labels.get(label).copied().unwrap_or(false))
    }

    /// New place of a node, given its place in the volume.
    pub(super) fn place(&self, word: u64) -> u64 {
        match self.kept.binary_search_by_key(&word, |&(from, _)| from) {
            Ok(i) => self.kept[i].1,
            Err(_) => word,
        }
    }

    /// Place of a node without voxels.
    pub(super) fn empty(&self) -> u64 {
        self.words
    }

    /// Length of [`PackedNodes::packed`].
    pub fn len_bytes(&self) -> u64 {
        2 * (self.words + SPARE_WORDS as u64)
    }

    /// The nodes, and a few spare words behind them.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn packed(&self, volume: &CompressedVolume) -> Result<Vec<u16>, NoMemory> {
        let mut words = reserved(self.words as usize + SPARE_WORDS, "the nodes of a volume for the device")?;
        if self.kept.is_empty() {
            words.extend_from_slice(&volume.nodes()[..self.words as usize]);
        }
        for &(from, _) in &self.kept {
            words.extend_from_slice(&volume.nodes()[from as usize..][..length(volume, from)]);
        }
        words.resize(words.len() + SPARE_WORDS, 0);
        Ok(words)
    }

    /// The leaves of all chunks, one after another at multiples of 16. Each has, in this order: words of a long reference, byte offset of
    /// the patterns, byte offset of the rare fields, 0 (4 bytes each); slices (2 bytes each); patterns, rare fields (8 bytes each, at
    /// multiples of 8). Offsets count from the chunk's own leaves.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn leaves<'a>(of_chunks: impl Iterator<Item = &'a Leaves> + Clone) -> Result<Vec<u8>, NoMemory> {
        let bytes = of_chunks.clone().map(bytes_of_leaves).sum();
        let mut all: Vec<u8> = reserved(bytes, "the leaves of a volume for the device")?;
        for leaves in of_chunks {
            let end = all.len() + bytes_of_leaves(leaves);
            let [slices, patterns, rare] = places_of_leaves(leaves);
            // There are at most 8192 slices and patterns, so 32 bits suffice.
            let header = [leaves.long_words() as u32, patterns as u32, rare as u32, 0];
            let first = all.len();
            all.extend_from_slice(bytemuck::cast_slice(&header));
            all.extend_from_slice(bytemuck::cast_slice(leaves.slices()));
            debug_assert_eq!(slices, size_of_val(&header));
            all.resize(first + patterns, 0);
            all.extend_from_slice(bytemuck::cast_slice(leaves.patterns()));
            all.extend_from_slice(bytemuck::cast_slice(leaves.rare()));
            all.resize(end, 0);
        }
        Ok(all)
    }

    /// Byte offset in [`PackedNodes::leaves`] of what follows the leaves of these chunks.
    pub fn leaves_before<'a>(of_chunks: impl Iterator<Item = &'a Leaves>) -> u64 {
        of_chunks.map(|leaves| bytes_of_leaves(leaves) as u64).sum()
    }
}

/// Byte offsets of slices, patterns and rare fields from the start of a chunk's leaves.
fn places_of_leaves(leaves: &Leaves) -> [usize; 3] {
    let slices = 16;
    let patterns = (slices + size_of_val(leaves.slices())).next_multiple_of(8);
    [slices, patterns, patterns + size_of_val(leaves.patterns())]
}

/// Bytes of a chunk's leaves on the device, a multiple of 16.
fn bytes_of_leaves(leaves: &Leaves) -> usize {
    let [.., rare] = places_of_leaves(leaves);
    (rare + size_of_val(leaves.rare())).next_multiple_of(16)
}

/// Length in words of the node at a word of the volume.
fn length(volume: &CompressedVolume, word: u64) -> usize {
    let chunk = volume.chunks().partition_point(|c| c.node_base <= word) - 1;
    pumice_core::NodeRef::read(volume.nodes(), word as usize, &volume.leaves()[chunk]).words()
}

/// Chunk, label and box range of each run of a volume.
fn runs(volume: &CompressedVolume) -> impl Iterator<Item = (usize, u32, std::ops::Range<usize>)> {
    volume.chunks().iter().enumerate().flat_map(move |(c, chunk)| {
        let next = volume.chunks().get(c + 1);
        let last_box = next.map_or(volume.boxes().len() as u64, |n| n.first_box);
        let last_run = next.map_or(volume.runs().len() as u64, |n| n.first_run);
        let runs = &volume.runs()[chunk.first_run as usize..last_run as usize];
        runs.iter().enumerate().map(move |(r, run)| {
            let start = chunk.first_box + u64::from(run.first_box);
            let end = runs.get(r + 1).map_or(last_box, |n| chunk.first_box + u64::from(n.first_box));
            (c, run.label, start as usize..end as usize)
        })
    })
}

//! The leaf dictionary: the occupancy fields that occur most often, so that a node can name each by 16 bits.
//!
//! A field in the dictionary costs 8 bytes once and 2 bytes a use, one outside 8 bytes a use, so a field that is used once stays
//! outside. Ranked by (count falling, pattern rising): the order follows from the content alone.

use rayon::prelude::*;
use rustc_hash::FxHashMap;

/// Most entries that a 16-bit index reaches.
pub const MAX_ENTRIES: usize = 1 << 16;

/// The dictionary of these fields (one entry a use); sorts `uses` as its scratch.
pub(crate) fn build(mut uses: Vec<u64>) -> Vec<u64> {
    uses.par_sort_unstable();
    let mut counted: Vec<(u32, u64)> = uses
        .chunk_by(|a, b| a == b)
        .filter(|same| same.len() > 1)
        .map(|same| (u32::try_from(same.len()).unwrap_or(u32::MAX), same[0]))
        .collect();
    drop(uses);
    let rank = |&(count, field): &(u32, u64)| (std::cmp::Reverse(count), field);
    if counted.len() > MAX_ENTRIES {
        counted.select_nth_unstable_by_key(MAX_ENTRIES, rank);
        counted.truncate(MAX_ENTRIES);
    }
    counted.sort_unstable_by_key(rank);
    // Through an iterator of known length into a vector of its own: `into_iter` would keep the larger allocation.
    counted.iter().map(|&(_, field)| field).collect()
}

/// Index of each entry.
pub(crate) fn index(dictionary: &[u64]) -> FxHashMap<u64, u16> {
    dictionary.iter().enumerate().map(|(i, &field)| (field, i as u16)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranked_by_count_then_pattern_without_singles() {
        assert_eq!(build(vec![9, 5, 7, 7, 9, 1, 2, 2, 2]), [2, 7, 9]);
    }

    #[test]
    fn holds_no_more_than_an_index_reaches() {
        let uses: Vec<u64> = (0..70_000u64).flat_map(|p| [p, p]).chain([69_999]).collect();
        let dictionary = build(uses);
        assert_eq!(dictionary.len(), MAX_ENTRIES);
        assert_eq!((dictionary[0], dictionary[1], dictionary[65_535]), (69_999, 0, 65_534));
    }
}

//! The rotating share: beside the ordinary tests, each run takes one of [`SHARES`] slices of the long tests.
//!
//! The hash of a test's name selects its share, and the date selects the share that runs. So each long test runs about once in
//! [`SHARES`] days, and `--share` repeats a run.

use std::time::{SystemTime, UNIX_EPOCH};

/// Number of slices: four weeks.
pub(crate) const SHARES: u64 = 28;

/// Today's share (UTC).
pub(crate) fn of_today() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs() / 86_400) % SHARES
}

/// The share that a test of this name belongs to: its 32-bit FNV-1a hash, as `tests/python/share.py` computes it.
pub(crate) fn of_name(name: &str) -> u64 {
    let hash = name.bytes().fold(0x811C_9DC5_u32, |h, b| (h ^ u32::from(b)).wrapping_mul(0x0100_0193));
    u64::from(hash) % SHARES
}

/// The names of tests in the output of `cargo test … -- --ignored --list` that belong to share `k`.
pub(crate) fn names_in(listing: &str, k: u64) -> Vec<String> {
    let mut names: Vec<String> = listing
        .lines()
        .filter_map(|l| l.strip_suffix(": test"))
        .filter(|name| of_name(name) == k)
        .map(str::to_owned)
        .collect();
    names.sort();
    names.dedup();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_its_turn_exactly_once() {
        let listing: String = (0..400).map(|i| format!("module::test_{i}: test\n")).collect();
        let listing = listing + "\n400 tests, 0 benchmarks\n";
        let turns: Vec<Vec<String>> = (0..SHARES).map(|k| names_in(&listing, k)).collect();
        let mut all: Vec<&String> = turns.iter().flatten().collect();
        all.sort();
        all.dedup();
        assert_eq!((all.len(), turns.iter().map(Vec::len).sum::<usize>()), (400, 400));
        assert!(turns.iter().all(|t| !t.is_empty()));
    }

    /// The published test value of FNV-1a: "foobar" gives 0xBF9CF968.
    #[test]
    fn hash_is_fnv_1a() {
        assert_eq!(of_name("foobar"), 0xBF9C_F968 % SHARES);
    }
}

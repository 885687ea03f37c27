//! A set of pairs of labels, in memory or, beyond a limit, in sorted runs on disk.
//!
//! ```text
//! add ─► hash set ─ full ─► sorted run │ sorted run │ …      scratch file; eight runs of one level are merged to one of the next
//!                 └────────────── merged, each pair once ─► packed contacts
//! ```
//! A run has a buffer while it is read, so their number is bounded by the merging.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rayon::slice::ParallelSliceMut as _;
use rustc_hash::FxHashMap;

use crate::contacts::{ContactsPacker, PAIRS};
use crate::reserve::{collected, make_room_in_map};
use crate::spool::{Scratch, Spool};
use crate::{Contacts, Result};

/// Bytes that a pair takes at most: in a hash set that has just doubled, beside the half as large one that it replaces.
pub(crate) const BYTES_A_PAIR: u64 = 32;

/// Pairs that are in memory at least, so that runs are worth a read each.
const LEAST_PAIRS: usize = 1 << 12;

/// Runs of a level that are merged to one.
const MERGED_RUNS: usize = 8;

/// Bytes of a merged run that wait in memory.
const RUN_BYTES: u64 = 1 << 16;

/// Pairs `a << 32 | b` of dense label indices with a < b.
pub(crate) struct PairSet<'a> {
    recent: FxHashMap<u64, ()>,
    /// Pairs in memory at most.
    most: usize,
    /// Rising pairs of `u64`, by level: a run of the next one is merged from some of a level.
    runs: Vec<Vec<Spool<'a>>>,
    scratch: &'a Scratch,
}

impl<'a> PairSet<'a> {
    /// An empty set that keeps about `bytes` in memory.
    pub(crate) fn new(scratch: &'a Scratch, bytes: u64) -> Self {
        let most = usize::try_from(bytes / BYTES_A_PAIR).unwrap_or(usize::MAX).max(LEAST_PAIRS);
        Self { recent: FxHashMap::default(), most, runs: Vec::new(), scratch }
    }

    /// Adds pairs.
    ///
    /// # Errors
    /// [`crate::Error::Memory`]; [`crate::Error::Io`] of the scratch file.
    pub(crate) fn add(&mut self, pairs: &[u64]) -> Result<()> {
        for &pair in pairs {
            make_room_in_map(&mut self.recent, PAIRS)?;
            self.recent.insert(pair, ());
            if self.recent.len() >= self.most {
                self.spill()?;
            }
        }
        Ok(())
    }

    /// The pairs in memory, rising; none stay.
    fn take_recent(&mut self) -> Result<Vec<u64>> {
        let recent = std::mem::take(&mut self.recent);
        let mut pairs = collected(recent.len(), recent.into_keys(), PAIRS)?;
        pairs.par_sort_unstable();
        Ok(pairs)
    }

    /// Moves the pairs in memory to a run.
    fn spill(&mut self) -> Result<()> {
        let pairs = self.take_recent()?;
        let mut run = Spool::new(self.scratch, 0);
        run.write(bytemuck::cast_slice(&pairs))?;
        drop(pairs);
        for level in 0.. {
            if self.runs.len() <= level {
                self.runs.resize_with(level + 1, Vec::new);
            }
            self.runs[level].push(run);
            if self.runs[level].len() < MERGED_RUNS {
                break;
            }
            run = Spool::new(self.scratch, RUN_BYTES);
            let merged = std::mem::take(&mut self.runs[level]);
            for_each_merged(&merged, |pair| run.write(bytemuck::bytes_of(&pair)))?;
            run.release()?;
        }
        Ok(())
    }

    /// All pairs, packed, of a volume with so many labels.
    ///
    /// # Errors
    /// As [`PairSet::add`].
    pub(crate) fn into_contacts(mut self, labels: u32) -> Result<Contacts> {
        if self.runs.is_empty() {
            return Ok(Contacts::pack(&self.take_recent()?, labels)?);
        }
        self.spill()?;
        let mut packer = ContactsPacker::new(labels);
        let runs: Vec<Spool<'_>> = self.runs.into_iter().flatten().collect();
        for_each_merged(&runs, |pair| Ok(packer.push(pair)?))?;
        Ok(packer.finish()?)
    }
}

/// Calls `visit` with each pair of some runs, once and rising.
fn for_each_merged(runs: &[Spool<'_>], mut visit: impl FnMut(u64) -> Result<()>) -> Result<()> {
    let mut readers: Vec<_> = runs.iter().map(|run| (run.reader(), run.len() / 8)).collect();
    // The next pair of each run that has one.
    let mut heads = BinaryHeap::new();
    let mut next = |run: usize, heads: &mut BinaryHeap<Reverse<(u64, usize)>>| -> Result<()> {
        let (reader, left) = &mut readers[run];
        if *left > 0 {
            *left -= 1;
            heads.push(Reverse((reader.value()?, run)));
        }
        Ok(())
    };
    for run in 0..runs.len() {
        next(run, &mut heads)?;
    }
    let mut before = None;
    while let Some(Reverse((pair, run))) = heads.pop() {
        if before != Some(pair) {
            visit(pair)?;
            before = Some(pair);
        }
        next(run, &mut heads)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_give_the_contacts_of_one_set() {
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        let labels = 3000;
        let mut state = 7u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) % below
        };
        // Pairs come several times, in any order, also in different runs.
        let pairs: Vec<u64> = (0..100_000)
            .map(|_| {
                let a = random(labels - 1);
                a << 32 | (a + 1 + random((labels - 1 - a).min(8)))
            })
            .collect();
        let (mut all, mut spilled) = (PairSet::new(&scratch, u64::MAX), PairSet::new(&scratch, 0));
        for some in pairs.chunks(777) {
            all.add(some).unwrap();
            spilled.add(some).unwrap();
        }
        // Some runs were merged, and some were not.
        let runs: Vec<usize> = spilled.runs.iter().map(Vec::len).collect();
        assert!(all.runs.is_empty() && runs.len() > 1 && runs[0] > 0, "{runs:?}");
        let expected = all.into_contacts(labels as u32).unwrap();
        assert!(expected.len() > 15_000);
        assert_eq!(spilled.into_contacts(labels as u32).unwrap(), expected);
        // The last labels may touch none.
        let none = PairSet::new(&scratch, 0).into_contacts(5).unwrap();
        assert_eq!(none, Contacts::pack(&[], 5).unwrap());
    }
}

//! Which parts of volumes are in memory: at most as many as a limit allows, and those that were not used for longest go first.
//!
//! ```text
//! ring    part ─ part ─ part ─ …     the order in which they were loaded
//!         ▲ asked first: used since it was last asked? then it goes to the end, otherwise it is dropped
//! ```
//! This is the clock algorithm: it comes close to dropping what was not used for longest, and marking a part as used is one store. A part
//! that a thread is using stays.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Sweeps around the ring in which every part is in use, before the limit gives way: then more threads use parts than the limit has
/// room for, and waiting could last for ever.
const SWEEPS: usize = 64;

/// What became of a part that was asked to go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// It was dropped, and so many bytes are free.
    Dropped(u64),
    /// It was used since it was last asked, or is in use now.
    Used,
    /// It is not in memory any more.
    Gone,
}

/// A part of a volume that can be dropped, because it can be loaded again.
pub trait Droppable: Send + Sync {
    /// Drops the part, unless it was used since the last call.
    fn drop_if_unused(&self) -> Answer;
}

/// The memory that parts of volumes share (see the module).
pub struct Residency {
    limit: u64,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    held: u64,
    kept: u64,
    most_held: u64,
    loads: u64,
    parts: u64,
    bytes_of_all: u64,
    ring: VecDeque<Arc<dyn Droppable>>,
}

/// What a [`Residency`] holds and has held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResidencyCounts {
    /// The limit in bytes.
    pub limit_bytes: u64,
    /// Bytes in memory now.
    pub held_bytes: u64,
    /// Those of them that stay, whatever is loaded ([`Residency::keep`]).
    pub kept_bytes: u64,
    /// The most bytes that were in memory at once.
    pub most_held_bytes: u64,
    /// Parts that were loaded, each time again.
    pub loads: u64,
    /// Parts that there are.
    pub parts: u64,
    /// Bytes that all of it would take, with what is always in memory.
    pub bytes_of_all: u64,
}

impl std::fmt::Debug for Residency {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.counts().fmt(f)
    }
}

impl Residency {
    /// Nothing yet, and at most this many bytes later.
    pub fn new(limit_bytes: u64) -> Self {
        Self { limit: limit_bytes, state: Mutex::default() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The limit in bytes.
    pub fn limit_bytes(&self) -> u64 {
        self.limit
    }

    /// Counts bytes that stay in memory until [`Residency::withdraw`]; parts make room for them.
    pub fn keep(&self, bytes: u64) {
        self.make_room(bytes);
        let mut state = self.state();
        state.kept += bytes;
        state.bytes_of_all += bytes;
    }

    /// Counts parts that may be loaded from now on, of so many bytes in all.
    pub fn offer(&self, parts: u64, bytes: u64) {
        let mut state = self.state();
        (state.parts, state.bytes_of_all) = (state.parts + parts, state.bytes_of_all + bytes);
    }

    /// Takes back what [`Residency::offer`] and [`Residency::keep`] have counted for parts that are given up.
    pub fn withdraw(&self, parts: u64, bytes: u64, kept_bytes: u64) {
        let mut state = self.state();
        state.parts = state.parts.saturating_sub(parts);
        state.bytes_of_all = state.bytes_of_all.saturating_sub(bytes + kept_bytes);
        state.held = state.held.saturating_sub(kept_bytes);
        state.kept = state.kept.saturating_sub(kept_bytes);
    }

    /// Makes room for a part that is about to be loaded, and counts its bytes.
    pub fn make_room(&self, bytes: u64) {
        let (mut asked, mut sweeps) = (0, 0);
        let mut state = self.state();
        while state.held.saturating_add(bytes) > self.limit && sweeps < SWEEPS {
            let Some(part) = state.ring.pop_front() else { break };
            match part.drop_if_unused() {
                Answer::Dropped(freed) => {
                    state.held = state.held.saturating_sub(freed);
                    asked = 0;
                }
                Answer::Gone => {}
                Answer::Used => {
                    state.ring.push_back(part);
                    asked += 1;
                }
            }
            // Twice around: the first time only clears the marks.
            if asked > 2 * state.ring.len() {
                (asked, sweeps) = (0, sweeps + 1);
                drop(state);
                std::thread::yield_now();
                state = self.state();
            }
        }
        state.held += bytes;
        state.most_held = state.most_held.max(state.held);
    }

    /// Adds a part that was loaded into the room that was made for it.
    pub fn add(&self, part: Arc<dyn Droppable>) {
        let mut state = self.state();
        state.loads += 1;
        state.ring.push_back(part);
    }

    /// Counts a part that was loaded into other memory than what is bounded here, which now holds `held_bytes`.
    pub fn count_elsewhere(&self, held_bytes: u64) {
        let mut state = self.state();
        state.loads += 1;
        state.most_held = state.most_held.max(held_bytes);
    }

    /// Takes back bytes that were counted and are free again.
    pub fn release(&self, bytes: u64) {
        let mut state = self.state();
        state.held = state.held.saturating_sub(bytes);
    }

    /// What is held, and was.
    pub fn counts(&self) -> ResidencyCounts {
        let state = self.state();
        ResidencyCounts {
            limit_bytes: self.limit,
            held_bytes: state.held,
            kept_bytes: state.kept,
            most_held_bytes: state.most_held,
            loads: state.loads,
            parts: state.parts,
            bytes_of_all: state.bytes_of_all,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

    use super::*;

    struct Part {
        bytes: u64,
        used: AtomicBool,
        pinned: AtomicBool,
        here: AtomicBool,
    }

    impl Droppable for Part {
        fn drop_if_unused(&self) -> Answer {
            if !self.here.load(Relaxed) {
                return Answer::Gone;
            }
            if self.used.swap(false, Relaxed) || self.pinned.load(Relaxed) {
                return Answer::Used;
            }
            self.here.store(false, Relaxed);
            Answer::Dropped(self.bytes)
        }
    }

    fn load(residency: &Residency, bytes: u64) -> Arc<Part> {
        residency.make_room(bytes);
        let yes = || AtomicBool::new(true);
        let part = Arc::new(Part { bytes, used: yes(), pinned: AtomicBool::new(false), here: yes() });
        residency.add(part.clone());
        part
    }

    /// Of three parts that fit, the one that was not used again goes for the fourth; the limit holds.
    #[test]
    fn what_was_not_used_goes_first_and_the_limit_holds() {
        let residency = Residency::new(100);
        residency.keep(10);
        let parts: Vec<_> = (0..3).map(|_| load(&residency, 30)).collect();
        let here = |parts: &[Arc<Part>]| parts.iter().map(|p| p.here.load(Relaxed)).collect::<Vec<_>>();
        assert_eq!(here(&parts), [true; 3]);
        for part in &parts {
            part.used.store(false, Relaxed);
        }
        parts[0].used.store(true, Relaxed);
        parts[2].used.store(true, Relaxed);
        load(&residency, 30);
        assert_eq!(here(&parts), [true, false, true]);
        let counts = residency.counts();
        assert_eq!((counts.held_bytes, counts.most_held_bytes, counts.loads), (100, 100, 4));
    }

    /// A part in use stays, and where all are in use the limit gives way, which the counts tell.
    #[test]
    fn what_is_in_use_stays() {
        let residency = Residency::new(50);
        let part = load(&residency, 40);
        part.pinned.store(true, Relaxed);
        load(&residency, 40);
        assert!(part.here.load(Relaxed));
        assert_eq!(residency.counts().most_held_bytes, 80);
        part.pinned.store(false, Relaxed);
        load(&residency, 10);
        assert!(!part.here.load(Relaxed));
    }
}

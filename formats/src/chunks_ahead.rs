//! Reads chunks before they are asked for, by several threads, and hands them over in their order.
//!
//! ```text
//! walk      0   1   2   3   4   5   6 …
//! taken ────────┘   └── read, or being read ──┘   at most so many
//! ```
//! A server answers after a tenth of a second, so many chunks are asked of it at once. Files are decompressed by as many threads as there are
//! processors.

use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use crate::chunk_walk::ChunkWalk;
use crate::chunks::{Chunk, ChunkReader};
use crate::error::Result;

/// Bytes of chunks that are read ahead, of files and of a server.
const AHEAD_BYTES: [u64; 2] = [8 << 20, 64 << 20];

/// Threads that ask a server.
const SERVER_THREADS: usize = 16;

/// Most chunks that are read ahead: the small ones of some stores would be millions.
const MOST_AHEAD: u64 = 64;

/// Chunks of a walk, in its order.
pub(crate) struct ChunksAhead {
    shared: Arc<Shared>,
    /// Without a thread chunks are read when they are asked for.
    threads: usize,
}

/// What the reader returned, or its panic.
type Outcome = std::result::Result<Result<Option<Chunk>>, Box<dyn Any + Send>>;

struct Shared {
    reader: Box<dyn ChunkReader>,
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    walk: ChunkWalk,
    /// Number of the next chunk that a thread reads.
    begun: u64,
    /// Number of the next chunk that is taken.
    taken: u64,
    /// What was read and not taken.
    read: BTreeMap<u64, Outcome>,
    most: u64,
    /// The walk has ended, or nobody takes chunks any more.
    is_over: bool,
}

impl Shared {
    /// The state, which is whole between any two statements under the lock.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>) -> MutexGuard<'a, State> {
        self.changed.wait(state).unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads chunks until the walk ends.
    fn work(&self) {
        let mut state = self.state();
        loop {
            while !state.is_over && state.begun >= state.taken + state.most {
                state = self.wait(state);
            }
            if state.is_over {
                return;
            }
            let Some(chunk) = state.walk.next() else {
                state.is_over = true;
                self.changed.notify_all();
                return;
            };
            let number = state.begun;
            state.begun += 1;
            drop(state);
            let read = catch_unwind(AssertUnwindSafe(|| self.reader.read(&chunk)));
            state = self.state();
            state.read.insert(number, read);
            self.changed.notify_all();
        }
    }
}

impl ChunksAhead {
    /// Chunks of `walk`, each of which takes `chunk_bytes` bytes.
    pub(crate) fn new(
        reader: Box<dyn ChunkReader>,
        walk: ChunkWalk,
        chunk_bytes: u64,
        of_server: bool,
    ) -> Self {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let wanted = if of_server { SERVER_THREADS } else { processors };
        let fits = AHEAD_BYTES[usize::from(of_server)] / chunk_bytes.max(1);
        let most = fits.clamp(1, MOST_AHEAD);
        let state = State { walk, begun: 0, taken: 0, read: BTreeMap::new(), most, is_over: false };
        let shared = Arc::new(Shared { reader, state: Mutex::new(state), changed: Condvar::new() });
        // Where the system gives no more threads, fewer do.
        let start = |_: &usize| {
            let shared = Arc::clone(&shared);
            std::thread::Builder::new().name("chunks".into()).spawn(move || shared.work()).is_ok()
        };
        let threads = (0..wanted.min(most as usize)).take_while(start).count();
        Self { shared, threads }
    }

    /// The next chunk of the walk, whose indices the caller knows; `None` where the store lacks it.
    pub(crate) fn next(&mut self, chunk: &[u64]) -> Result<Option<Chunk>> {
        if self.threads == 0 {
            return self.shared.reader.read(chunk);
        }
        let mut state = self.shared.state();
        let number = state.taken;
        let read = loop {
            match state.read.remove(&number) {
                Some(read) => break read,
                None => state = self.shared.wait(state),
            }
        };
        state.taken += 1;
        drop(state);
        self.shared.changed.notify_all();
        read.unwrap_or_else(|panic| resume_unwind(panic))
    }
}

impl Drop for ChunksAhead {
    /// Threads end after the chunk that they read.
    fn drop(&mut self) {
        self.shared.state().is_over = true;
        self.shared.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::time::Duration;

    use super::*;
    use crate::chunk_walk::{Axis, Walk};
    use crate::error::FormatError;
    use crate::layout::Role;

    /// Chunk n is the byte n; some are absent, one is damaged, one panics. Those with odd numbers take longer.
    struct Numbers {
        faulty: Option<u64>,
        panics: Option<u64>,
        reads: Arc<AtomicU64>,
    }

    impl ChunkReader for Numbers {
        fn read(&self, chunk: &[u64]) -> Result<Option<Chunk>> {
            self.reads.fetch_add(1, Ordering::Relaxed);
            let number = chunk[0];
            std::thread::sleep(Duration::from_micros(500 * (number % 2)));
            assert_ne!(Some(number), self.panics, "as the test asks");
            if Some(number) == self.faulty {
                return Err(FormatError::damaged("store".as_ref(), "as the test asks"));
            }
            Ok((!number.is_multiple_of(7)).then(|| Chunk { bytes: vec![number as u8], sizes: vec![1] }))
        }
    }

    const COUNT: u64 = 100;

    fn ahead(of_server: bool, faulty: Option<u64>, panics: Option<u64>) -> (ChunksAhead, Arc<AtomicU64>) {
        let reads = Arc::new(AtomicU64::new(0));
        let axes = (0..3).map(|a| Axis::new(Role::Space(a), 16, 1)).collect();
        let walk = Walk::new(axes, 16 * 16 * 16, vec![[[0, 16 * COUNT], [0, 16], [0, 16]]]);
        let reader = Box::new(Numbers { faulty, panics, reads: Arc::clone(&reads) });
        (ChunksAhead::new(reader, ChunkWalk::new(walk), 1 << 20, of_server), reads)
    }

    #[test]
    fn chunks_come_in_their_order() {
        for of_server in [false, true] {
            let (mut chunks, reads) = ahead(of_server, None, None);
            for number in 0..COUNT {
                let chunk = chunks.next(&[number, 0, 0]).unwrap();
                let expected = (number % 7 != 0).then_some(number as u8);
                assert_eq!(chunk.map(|c| c.bytes[0]), expected, "{number}");
            }
            assert_eq!(reads.load(Ordering::Relaxed), COUNT);
        }
    }

    /// Chunks of 1 MiB that nobody takes: 8 MiB of a store of files, 64 of a server.
    #[test]
    fn no_more_is_read_ahead_than_may_be() {
        for (of_server, most) in [(false, 8), (true, 64)] {
            let (mut chunks, reads) = ahead(of_server, None, None);
            let reach = |expected| {
                while reads.load(Ordering::Relaxed) < expected {
                    std::thread::sleep(Duration::from_millis(1));
                }
                // Far longer than reading one more takes.
                std::thread::sleep(Duration::from_millis(30));
                assert_eq!(reads.load(Ordering::Relaxed), expected);
            };
            reach(most);
            chunks.next(&[0, 0, 0]).unwrap();
            reach(most + 1);
        }
    }

    #[test]
    fn a_fault_comes_in_its_turn_and_a_panic_is_the_callers() {
        let (mut chunks, _) = ahead(true, Some(20), Some(30));
        for number in 0..30 {
            assert_eq!(chunks.next(&[number, 0, 0]).is_err(), number == 20, "{number}");
        }
        assert!(catch_unwind(AssertUnwindSafe(|| chunks.next(&[30, 0, 0]).map(|_| ()))).is_err());
    }

    #[test]
    fn nobody_reads_on_for_one_who_left() {
        let (mut chunks, reads) = ahead(false, None, None);
        chunks.next(&[0, 0, 0]).unwrap();
        let shared = Arc::downgrade(&chunks.shared);
        drop(chunks);
        while shared.upgrade().is_some() {
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(reads.load(Ordering::Relaxed) < COUNT);
    }

    /// Without threads the caller reads.
    #[test]
    fn threads_are_no_need() {
        let (chunks, reads) = ahead(false, Some(3), None);
        chunks.shared.state().is_over = true;
        chunks.shared.changed.notify_all();
        let mut alone = ChunksAhead { shared: Arc::clone(&chunks.shared), threads: 0 };
        let before = reads.load(Ordering::Relaxed);
        assert!(alone.next(&[3, 0, 0]).is_err() && alone.next(&[0, 0, 0]).unwrap().is_none());
        assert_eq!(alone.next(&[5, 0, 0]).unwrap().unwrap().bytes, [5]);
        assert!(reads.load(Ordering::Relaxed) >= before + 3);
    }
}

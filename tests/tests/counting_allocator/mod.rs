//! The system's allocator, counting the bytes that are asked for.
#![allow(unsafe_code, reason = "a global allocator cannot be written without; this module is all of it")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, Ordering::SeqCst};

struct CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

static LIVE: AtomicIsize = AtomicIsize::new(0);
static PEAK: AtomicIsize = AtomicIsize::new(0);

/// What a piece of work allocated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counted {
    /// Bytes that are still held at its end.
    pub(crate) kept: isize,
    /// Most bytes that were held at once, above what was held before.
    pub(crate) peak: isize,
}

/// Runs `work` and counts.
pub(crate) fn measured<T>(work: impl FnOnce() -> T) -> (T, Counted) {
    let before = LIVE.load(SeqCst);
    PEAK.store(before, SeqCst);
    let result = work();
    let counted = Counted { kept: LIVE.load(SeqCst) - before, peak: PEAK.load(SeqCst) - before };
    (result, counted)
}

fn grow(bytes: usize) {
    let live = LIVE.fetch_add(bytes as isize, SeqCst) + bytes as isize;
    PEAK.fetch_max(live, SeqCst);
}

// SAFETY: every call goes to `System` with the very arguments that it was made with, so its guarantees are ours; counting touches
// atomics only and allocates nothing.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size() as isize, SeqCst);
        // SAFETY: `pointer` came from `System` with this layout, for all of ours do.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        LIVE.fetch_sub(layout.size() as isize, SeqCst);
        grow(new_size);
        // SAFETY: as in `dealloc`, and the caller promises that `new_size` is valid.
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

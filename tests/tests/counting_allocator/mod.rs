//! The system's allocator, which also counts allocated bytes.
#![allow(unsafe_code, reason = "a global allocator needs unsafe code, all of which is in this module")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, Ordering::SeqCst};

struct CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

static LIVE: AtomicIsize = AtomicIsize::new(0);
static PEAK: AtomicIsize = AtomicIsize::new(0);

/// Bytes that a piece of work allocated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counted {
    /// Bytes that are still allocated at its end.
    pub(crate) kept: isize,
    /// Largest number of bytes allocated at once, above those allocated before.
    pub(crate) peak: isize,
}

/// Runs `work`; returns its result and its allocations.
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

// SAFETY: every call passes its arguments unchanged to `System`, so `System`'s guarantees hold here too; counting touches atomics only
// and allocates nothing.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller's promise about `layout` is what `System.alloc` requires.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: as in `alloc`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size() as isize, SeqCst);
        // SAFETY: `pointer` came from `System` with this layout, as all pointers of this allocator do.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        LIVE.fetch_sub(layout.size() as isize, SeqCst);
        grow(new_size);
        // SAFETY: as in `dealloc`, and the caller promises that `new_size` is valid.
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

//! The system's allocator, which also counts allocated bytes, and refuses large requests where a test asks for that.
#![allow(dead_code, reason = "each program of tests uses a part of it")]
#![allow(unsafe_code, reason = "a global allocator needs unsafe code, all of which is in this module")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, AtomicUsize, Ordering::SeqCst};

struct CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

static LIVE: AtomicIsize = AtomicIsize::new(0);
static PEAK: AtomicIsize = AtomicIsize::new(0);
/// Largest single request that is served.
static MOST: AtomicUsize = AtomicUsize::new(usize::MAX);

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

/// Runs `work` while every single request above `most_bytes` is refused, as by a system without memory; returns its result. Code that
/// does not ask whether it got the memory ends the process then.
pub(crate) fn refusing<T>(most_bytes: usize, work: impl FnOnce() -> T) -> T {
    MOST.store(most_bytes, SeqCst);
    let result = work();
    MOST.store(usize::MAX, SeqCst);
    result
}

/// Counts a request; false where it is refused.
fn grow(bytes: usize) -> bool {
    if bytes > MOST.load(SeqCst) {
        return false;
    }
    let live = LIVE.fetch_add(bytes as isize, SeqCst) + bytes as isize;
    PEAK.fetch_max(live, SeqCst);
    true
}

// SAFETY: every call passes its arguments unchanged to `System`, so `System`'s guarantees hold here too, or returns null, by which the
// trait says that there is no memory; counting touches atomics only and allocates nothing.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if !grow(layout.size()) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller's promise about `layout` is what `System.alloc` requires.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if !grow(layout.size()) {
            return std::ptr::null_mut();
        }
        // SAFETY: as in `alloc`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size() as isize, SeqCst);
        // SAFETY: `pointer` came from `System` with this layout, as all pointers of this allocator do.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        if !grow(new_size) {
            return std::ptr::null_mut();
        }
        LIVE.fetch_sub(layout.size() as isize, SeqCst);
        // SAFETY: as in `dealloc`, and the caller promises that `new_size` is valid.
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

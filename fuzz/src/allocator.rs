//! An allocator that makes a finding of memory out of proportion.
//!
//! libFuzzer's own `-malloc_limit_mb` needs a sanitizer's hooks, which stable Rust does not have, and `-rss_limit_mb` sees only
//! memory that has been written to: a reservation by an untrusted length would pass both.

#![allow(unsafe_code, reason = "an allocator is unsafe by its trait; this one only counts and hands on")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Most bytes asked for at once. Readers of volumes hand out blocks of at most 16 MiB in the file's type, at worst 128 MiB as 64-bit
/// labels from bytes; inputs have a few kB.
pub const MOST_AT_ONCE_BYTES: usize = 192 << 20;

/// Most bytes held at once.
pub const MOST_HELD_BYTES: usize = 768 << 20;

static HELD: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator with limits.
#[derive(Debug)]
pub struct Limited;

fn take(bytes: usize) {
    let held = HELD.fetch_add(bytes, Ordering::Relaxed) + bytes;
    if bytes > MOST_AT_ONCE_BYTES || held > MOST_HELD_BYTES {
        // Lowered first: the message and the trace allocate, too.
        HELD.fetch_sub(bytes, Ordering::Relaxed);
        eprintln!(
            "FINDING: {bytes} bytes asked for at once, {held} held\n{}",
            std::backtrace::Backtrace::force_capture()
        );
        std::process::abort();
    }
}

// SAFETY: every call goes to `System` unchanged.
unsafe impl GlobalAlloc for Limited {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        take(layout.size());
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        take(layout.size());
        // SAFETY: as in `alloc`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: `pointer` came from `System` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        take(new_size);
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: `pointer` came from `System` with this layout; the caller's promise about `new_size` is passed on.
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

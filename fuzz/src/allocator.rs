//! An allocator that aborts on excessive allocations, so that libFuzzer reports the input.
//!
//! libFuzzer's own `-malloc_limit_mb` needs hooks of a sanitizer, which stable Rust does not have, and `-rss_limit_mb` counts only memory
//! that has been written to. Both would miss an allocation by an untrusted length.

#![allow(unsafe_code, reason = "the trait of allocators is unsafe; this one only counts and forwards")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Largest allowed allocation. Inputs have a few kB. Readers of volumes return blocks of at most 16 MiB in the file's type, which are at
/// worst 128 MiB when bytes become 64-bit labels.
pub const MOST_AT_ONCE_BYTES: usize = 192 << 20;

/// Largest allowed total of all current allocations.
pub const MOST_HELD_BYTES: usize = 768 << 20;

static HELD: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator with limits.
#[derive(Debug)]
pub struct Limited;

fn take(bytes: usize) {
    let held = HELD.fetch_add(bytes, Ordering::Relaxed) + bytes;
    if bytes > MOST_AT_ONCE_BYTES || held > MOST_HELD_BYTES {
        // Lower the count first, because the message and the trace allocate too.
        HELD.fetch_sub(bytes, Ordering::Relaxed);
        eprintln!(
            "FINDING: an allocation of {bytes} bytes (at most {MOST_AT_ONCE_BYTES}), {held} bytes in all (at most {MOST_HELD_BYTES})\n{}",
            std::backtrace::Backtrace::force_capture()
        );
        std::process::abort();
    }
}

// SAFETY: every call passes its arguments unchanged to `System`; counting touches an atomic only.
unsafe impl GlobalAlloc for Limited {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        take(layout.size());
        // SAFETY: the caller's promise about `layout` is what `System.alloc` requires.
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
        // SAFETY: `pointer` came from `System` with this layout, and the caller promises that `new_size` is valid.
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

//! Freed memory goes back to the system. The allocator of glibc keeps it, in an arena for each thread.

/// Gives back what was freed; nothing where the allocator is another.
pub(crate) fn give_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        // SAFETY: the function may be called at any time from any thread; it changes nothing that is allocated.
        #[allow(unsafe_code)]
        unsafe {
            libc::malloc_trim(0);
        }
    }
}

/// Pieces of memory above this many bytes go back when they are freed: blocks of voxels, lists of records.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE_BYTES: libc::c_int = 1 << 20;

/// Below this limit the arenas cannot keep what blocks of voxels took: up to 32 MiB with two threads.
const SMALL_LIMIT_BYTES: u64 = 128 << 20;

/// Under a small limit of memory, gives back large pieces as soon as they are freed, from now on. The allocator of glibc raises its own
/// threshold, up to 32 MiB, with each such piece, and keeps what blocks of voxels took. The price is that the system clears the pages of each
/// block anew: on cortex a sixth of the CPU time of compressing.
pub(crate) fn give_back_large_pieces(limit_bytes: u64) {
    if limit_bytes >= SMALL_LIMIT_BYTES {
        return;
    }
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        // SAFETY: the function may be called at any time from any thread; it changes how later pieces are allocated, and none that are.
        #[allow(unsafe_code)]
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE_BYTES);
        }
    }
}

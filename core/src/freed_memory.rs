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

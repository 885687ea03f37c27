//! Limits that the system sets for the process.

/// Lets the process meet its limits in single calls, each of which says in its error what failed, and neither by a signal nor by what threads
/// reserve. Called once, before threads start, by a program and never by a library: both hold for the whole process.
///
/// * **File size** (`ulimit -f`): a write beyond it is an error, where the signal SIGXFSZ would end the process and leave its files.
/// * **Address space** (`ulimit -v`): the allocator of glibc reserves 64 MiB of it for each thread, so that under a limit small pieces fail
///   while most of it is free. Under a limit all threads share one reserve.
pub fn meet_limits() {
    #[cfg(unix)]
    {
        // SAFETY: the disposition is that of a signal for which no handler is set, and no other thread runs yet.
        #[allow(unsafe_code)]
        unsafe {
            libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
        }
    }
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    if has_address_limit() {
        // SAFETY: the function may be called at any time from any thread; it changes how later pieces are allocated, and none that are.
        #[allow(unsafe_code)]
        unsafe {
            libc::mallopt(libc::M_ARENA_MAX, 1);
        }
    }
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn has_address_limit() -> bool {
    let mut limit = libc::rlimit { rlim_cur: libc::RLIM_INFINITY, rlim_max: libc::RLIM_INFINITY };
    // SAFETY: the pointer is to a value of the type that the call fills, and stays valid during it.
    #[allow(unsafe_code)]
    let result = unsafe { libc::getrlimit(libc::RLIMIT_AS, &mut limit) };
    result == 0 && limit.rlim_cur != libc::RLIM_INFINITY
}

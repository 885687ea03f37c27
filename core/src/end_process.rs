//! The end of the process while some of its threads still work.

/// Ends the process now with exit code `code`, without what libraries have registered for its end: that takes away memory (a driver's compiler,
/// for one) which other threads still use, so that now and then the process would crash instead. What standard output has not yet taken is lost.
pub fn end_process(code: u8) -> ! {
    #[cfg(unix)]
    {
        // SAFETY: the function may be called at any time from any thread; no code of the process runs after it.
        #[allow(unsafe_code)]
        unsafe {
            libc::_exit(code.into())
        }
    }
    // Elsewhere (Windows) the other threads end before libraries do.
    #[cfg(not(unix))]
    std::process::exit(code.into())
}

//! The threads that all work shares.

use std::error::Error as _;

use crate::error::{Result, SessionError};

/// Starts the threads that work is spread over, one for each logical processor, unless they run already. Without this they start with the
/// first work, and a system that refuses them then causes a panic.
///
/// # Errors
/// [`SessionError::Caller`] where the system refuses to start one, by a limit on processes or on memory.
pub fn start_threads() -> Result<()> {
    match rayon::ThreadPoolBuilder::new().build_global() {
        Ok(()) => Ok(()),
        Err(error) => match error.source() {
            Some(refused) => Err(SessionError::Caller(format!(
                "the threads for the work cannot be started: {refused}; see the limits on processes and memory (ulimit -a)"
            ))),
            // They run already.
            None => Ok(()),
        },
    }
}

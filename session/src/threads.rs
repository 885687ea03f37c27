//! The threads that share the work of a call, also in a process that was forked.
//!
//! ```text
//! process             rayon's own pool, started by the first call
//! a forked process    a pool for each call in progress, kept for later calls
//! ```
//! A fork copies the memory of a process and none of its threads: work for the pool of the parent would wait for ever. Rayon's own pool cannot
//! be started a second time, so that a forked process gets others. One for all calls would not do: a call may wait for another one, inside
//! a pool's only thread.

use std::error::Error as _;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Result, SessionError};

/// Where rayon's own pool is: the process that started it, if it could.
static HOME: OnceLock<(u32, bool)> = OnceLock::new();

/// Pools of forked processes that no call uses, with the process that each belongs to.
static IDLE: Mutex<Vec<(u32, ThreadPool)>> = Mutex::new(Vec::new());

fn idle() -> MutexGuard<'static, Vec<(u32, ThreadPool)>> {
    // Only whole pools go in and out, so a poisoned lock is safe to use.
    IDLE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs `work` where its parallel parts find threads.
///
/// # Errors
/// When the system starts no more threads.
pub fn with_threads<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T> {
    let process = std::process::id();
    if *HOME.get_or_init(|| (process, start_pool())) == (process, true) {
        return Ok(work());
    }
    let pool = match idle_pool(process) {
        Some(pool) => pool,
        None => ThreadPoolBuilder::new()
            .build()
            .map_err(|e| SessionError::Caller(format!("the threads for the work cannot start: {e}")))?,
    };
    let result = pool.install(work);
    idle().push((process, pool));
    Ok(result)
}

/// Starts rayon's own pool; true if it exists, and false where the system starts no more threads.
fn start_pool() -> bool {
    match ThreadPoolBuilder::new().build_global() {
        Ok(()) => true,
        // Without a cause, the error is that it exists already.
        Err(error) => error.source().is_none(),
    }
}

/// Takes an idle pool of this process. Those of the parent are forgotten: their threads did not come along, and dropping them would talk
/// to these.
fn idle_pool(process: u32) -> Option<ThreadPool> {
    let mut idle = idle();
    while let Some((owner, pool)) = idle.pop() {
        if owner == process {
            return Some(pool);
        }
        std::mem::forget(pool);
    }
    None
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use super::*;

    #[test]
    fn work_and_its_parts_are_done() {
        let sum = with_threads(|| (0..1000u64).into_par_iter().sum::<u64>()).unwrap();
        assert_eq!(sum, 499_500);
        let inner =
            with_threads(|| with_threads(|| (0..10u64).into_par_iter().sum::<u64>()).unwrap()).unwrap();
        assert_eq!(inner, 45);
    }

    #[test]
    fn pools_of_another_process_are_not_used() {
        let pool = || ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let here = std::process::id();
        *idle() = vec![(here, pool()), (here ^ 1, pool())];
        assert!(idle_pool(here).is_some());
        assert!(idle_pool(here).is_none() && idle().is_empty());
    }
}

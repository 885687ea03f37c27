//! Failures on purpose, so that tests see what a full or lost device does where neither can be had.

use std::sync::atomic::{AtomicU32, Ordering};

use ash::vk;

/// What shall fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// An allocation of device memory: out of memory.
    Allocation,
    /// A submission: device lost.
    Submission,
}

/// Countdowns to the failures; 0: none is due.
#[derive(Debug, Default)]
pub(super) struct Faults {
    allocation: AtomicU32,
    submission: AtomicU32,
}

impl Faults {
    /// The `nth` call from now fails, 1 being the next.
    pub(super) fn inject(&self, fault: Fault, nth: u32) {
        self.countdown(fault).store(nth, Ordering::Relaxed);
    }

    /// The result of a call, or the failure that is due.
    pub(super) fn instead<T>(&self, fault: Fault, result: Result<T, vk::Result>) -> Result<T, vk::Result> {
        let due =
            self.countdown(fault).fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| n.checked_sub(1));
        match (due, fault) {
            (Ok(1), Fault::Allocation) => Err(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY),
            (Ok(1), Fault::Submission) => Err(vk::Result::ERROR_DEVICE_LOST),
            _ => result,
        }
    }

    fn countdown(&self, fault: Fault) -> &AtomicU32 {
        match fault {
            Fault::Allocation => &self.allocation,
            Fault::Submission => &self.submission,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nth_call_fails_once() {
        let faults = Faults::default();
        let call = |fault| faults.instead(fault, Ok(7));
        assert_eq!(call(Fault::Allocation), Ok(7));
        faults.inject(Fault::Allocation, 2);
        assert_eq!(call(Fault::Allocation), Ok(7));
        assert_eq!(call(Fault::Submission), Ok(7));
        assert_eq!(call(Fault::Allocation), Err(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY));
        assert_eq!(call(Fault::Allocation), Ok(7));
    }
}

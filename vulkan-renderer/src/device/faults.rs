//! Injected failures. Tests use them to see how a full or lost device is handled, on machines where neither can be produced.

use std::sync::atomic::{AtomicU32, Ordering};

use ash::vk;

/// The kind of call that fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InjectedFault {
    /// An allocation of device memory fails: out of memory.
    Allocation,
    /// A submission fails: device lost.
    Submission,
    /// A submission does not end: the wait for it times out.
    Hang,
}

/// Failures that are still to come.
#[derive(Debug, Default)]
pub(super) struct Faults {
    allocation: Due,
    submission: Due,
    hang: Due,
}

#[derive(Debug, Default)]
struct Due {
    /// Calls up to and including the first that fails; 0 where none does.
    countdown: AtomicU32,
    /// How many calls fail in a row from then on.
    times: AtomicU32,
}

impl Faults {
    /// From the `nth` call from now on, 1 being the next, `times` calls fail.
    pub(super) fn inject(&self, fault: InjectedFault, nth: u32, times: u32) {
        let due = self.due(fault);
        due.countdown.store(nth, Ordering::Relaxed);
        due.times.store(times, Ordering::Relaxed);
    }

    /// Replaces the result of a call by the injected failure, if one is due.
    pub(super) fn instead<T>(
        &self,
        fault: InjectedFault,
        result: Result<T, vk::Result>,
    ) -> Result<T, vk::Result> {
        let Due { countdown, times } = self.due(fault);
        let order = Ordering::Relaxed;
        let fails = match countdown.fetch_update(order, order, |n| if n > 1 { Some(n - 1) } else { None }) {
            Err(1) => {
                let last = times.fetch_sub(1, order) <= 1;
                countdown.store(u32::from(!last), order);
                true
            }
            _ => false,
        };
        match (fails, fault) {
            (true, InjectedFault::Allocation) => Err(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY),
            (true, InjectedFault::Submission) => Err(vk::Result::ERROR_DEVICE_LOST),
            (true, InjectedFault::Hang) => Err(vk::Result::TIMEOUT),
            (false, _) => result,
        }
    }

    fn due(&self, fault: InjectedFault) -> &Due {
        match fault {
            InjectedFault::Allocation => &self.allocation,
            InjectedFault::Submission => &self.submission,
            InjectedFault::Hang => &self.hang,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nth_calls_fail() {
        let faults = Faults::default();
        let call = |fault| faults.instead(fault, Ok(7));
        assert_eq!(call(InjectedFault::Allocation), Ok(7));
        faults.inject(InjectedFault::Allocation, 2, 1);
        assert_eq!(call(InjectedFault::Allocation), Ok(7));
        assert_eq!(call(InjectedFault::Submission), Ok(7));
        assert_eq!(call(InjectedFault::Allocation), Err(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY));
        assert_eq!(call(InjectedFault::Allocation), Ok(7));
        faults.inject(InjectedFault::Submission, 2, 2);
        let lost = Err(vk::Result::ERROR_DEVICE_LOST);
        assert_eq!([(); 5].map(|()| call(InjectedFault::Submission)), [Ok(7), lost, lost, Ok(7), Ok(7)]);
    }
}

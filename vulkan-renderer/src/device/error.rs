//! What can go wrong between us and a graphics processor, by who can do something about it.

use ash::vk;

use super::Backend;

/// See the module.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// The machine has no Vulkan at all, or none that starts.
    #[error("no Vulkan here: {0}")]
    NoVulkan(String),
    /// No device can run the backend; the text says what each lacks.
    #[error("{backend}: {why}")]
    Unsupported {
        /// What was asked for.
        backend: Backend,
        /// Which device lacks what.
        why: String,
    },
    /// The device's memory does not suffice.
    #[error("out of GPU memory: {}", shortage(what, *needed, *free))]
    OutOfMemory {
        /// What was to be stored.
        what: &'static str,
        /// Bytes that it needs; 0: the call that failed does not tell.
        needed: u64,
        /// Bytes that the driver says were free.
        free: Option<u64>,
    },
    /// More than this device can have at once, however much memory is free.
    #[error("{what}: {needed} are more than this device's limit of {limit}")]
    Limit {
        /// What there is too much of, with its unit.
        what: &'static str,
        /// How much was needed.
        needed: u64,
        /// How much is possible.
        limit: u64,
    },
    /// The device has stopped working: nothing that was made with it can be used again.
    #[error("the GPU was lost during {0}")]
    Lost(&'static str),
    /// A call failed in a way that has no name of its own here.
    #[error("{call} failed: {result:?}")]
    Call {
        /// Vulkan's name.
        call: &'static str,
        /// Vulkan's answer.
        result: vk::Result,
    },
}

impl DeviceError {
    /// The error of a call that allocates no memory of a known size.
    pub(super) fn of(call: &'static str) -> impl Fn(vk::Result) -> Self {
        move |result| match result {
            vk::Result::ERROR_DEVICE_LOST => Self::Lost(call),
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => Self::OutOfMemory { what: call, needed: 0, free: None },
            _ => Self::Call { call, result },
        }
    }
}

/// What was short, as far as it is known.
fn shortage(what: &str, needed: u64, free: Option<u64>) -> String {
    match (needed, free) {
        (0, _) => format!("{what} needs more than there is"),
        (_, Some(free)) => format!("{what} needs {needed} bytes, {free} are free"),
        (_, None) => format!("{what} needs {needed} bytes, how many are free the driver does not tell"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_one_line_with_numbers() {
        let full = DeviceError::OutOfMemory { what: "the film", needed: 1000, free: Some(10) };
        assert_eq!(full.to_string(), "out of GPU memory: the film needs 1000 bytes, 10 are free");
        let blind = DeviceError::OutOfMemory { what: "the film", needed: 1000, free: None };
        assert!(blind.to_string().ends_with("the driver does not tell"));
        let unknown = DeviceError::of("vkQueueSubmit")(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
        assert_eq!(unknown.to_string(), "out of GPU memory: vkQueueSubmit needs more than there is");
        let lost = DeviceError::of("vkQueueSubmit")(vk::Result::ERROR_DEVICE_LOST);
        assert_eq!(lost, DeviceError::Lost("vkQueueSubmit"));
        let other = DeviceError::of("vkCreateFence")(vk::Result::ERROR_OUT_OF_HOST_MEMORY);
        assert_eq!(other.to_string(), "vkCreateFence failed: ERROR_OUT_OF_HOST_MEMORY");
    }
}

//! Errors of the device, divided by what the caller can do about them.

use ash::vk;

use super::Backend;

/// An error of Vulkan or of a device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// The machine has no Vulkan, or none that starts.
    #[error("no Vulkan here: {0}")]
    NoVulkan(String),
    /// No device can run the backend; the text says what each device lacks.
    #[error("{backend}: {why}")]
    Unsupported {
        /// The requested backend.
        backend: Backend,
        /// Which device lacks what.
        why: String,
    },
    /// The device has too little memory.
    #[error("out of GPU memory: {}", shortage(what, *needed, *free))]
    OutOfMemory {
        /// What was to be stored.
        what: &'static str,
        /// Bytes that it needs; 0 where the failed call does not report a size.
        needed: u64,
        /// Free bytes, as the driver reports them.
        free: Option<u64>,
    },
    /// The request exceeds a limit of this device, however much memory is free.
    #[error("{what}: {needed} are more than this device's limit of {limit}")]
    Limit {
        /// What exceeds the limit, with its unit.
        what: &'static str,
        /// How much was needed.
        needed: u64,
        /// The limit.
        limit: u64,
    },
    /// The device has stopped working; nothing that was made with it can be used again.
    #[error("the GPU was lost during {0}")]
    Lost(&'static str),
    /// Any other failure of a call.
    #[error("{call} failed: {result:?}")]
    Call {
        /// Vulkan's name of the call.
        call: &'static str,
        /// Vulkan's result code.
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

/// Says what memory was short of, as far as that is known.
fn shortage(what: &str, needed: u64, free: Option<u64>) -> String {
    match (needed, free) {
        (0, _) => format!("{what} needs more than is free"),
        (_, Some(free)) => format!("{what} needs {needed} bytes, {free} are free"),
        (_, None) => format!("{what} needs {needed} bytes; the driver does not report how many are free"),
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
        assert!(blind.to_string().ends_with("the driver does not report how many are free"));
        let unknown = DeviceError::of("vkQueueSubmit")(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
        assert_eq!(unknown.to_string(), "out of GPU memory: vkQueueSubmit needs more than is free");
        let lost = DeviceError::of("vkQueueSubmit")(vk::Result::ERROR_DEVICE_LOST);
        assert_eq!(lost, DeviceError::Lost("vkQueueSubmit"));
        let other = DeviceError::of("vkCreateFence")(vk::Result::ERROR_OUT_OF_HOST_MEMORY);
        assert_eq!(other.to_string(), "vkCreateFence failed: ERROR_OUT_OF_HOST_MEMORY");
    }
}

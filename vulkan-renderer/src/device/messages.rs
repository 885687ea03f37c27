//! Messages of the validation layer.

use std::sync::{Mutex, PoisonError};

use ash::vk;

/// Most messages that are kept, so that an error in a loop does not fill the memory.
const KEPT: usize = 100;

/// Warnings and errors in the order in which they arrived.
#[derive(Debug, Default)]
pub struct Messages {
    texts: Mutex<Vec<String>>,
}

impl Messages {
    fn push(&self, text: String) {
        let mut texts = self.texts.lock().unwrap_or_else(PoisonError::into_inner);
        if texts.len() < KEPT {
            texts.push(text);
        }
    }

    /// Takes all messages so far (the first hundred) out of the list.
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut *self.texts.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Callback of the layer. It runs on the thread that called Vulkan.
///
/// # Safety
/// * `data` is null or points to a valid structure for the time of the call.
/// * `user` points to [`Messages`] that outlive the messenger.
pub(super) unsafe extern "system" fn receive(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut std::ffi::c_void,
) -> vk::Bool32 {
    // SAFETY: both as the caller promises; `Messages` is Sync, so a shared reference from any thread is fine.
    let (data, messages) = unsafe { (data.as_ref(), user.cast::<Messages>().cast_const().as_ref()) };
    if let (Some(data), Some(messages)) = (data, messages) {
        // SAFETY: the layer's text ends in 0 and lives during the call.
        let text = unsafe { data.message_as_c_str() };
        messages.push(text.map_or_else(String::new, |t| t.to_string_lossy().into_owned()));
    }
    vk::FALSE
}

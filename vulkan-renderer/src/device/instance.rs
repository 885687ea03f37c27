//! The Vulkan loader and the instance, the first things that a machine may lack.

use std::ffi::CStr;
use std::path::PathBuf;
use std::sync::Arc;

use ash::{ext, khr, vk};

use super::DeviceError;
use super::messages::{Messages, receive};

/// The required version of loader and devices. It has buffer addresses, the scalar layout and 64-bit integers.
pub(super) const VERSION: u32 = vk::API_VERSION_1_2;

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Options for starting Vulkan.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InstanceOptions {
    /// Enables the Khronos validation layer with its synchronisation checks. It is an error where the layer is not installed.
    pub validation: bool,
    /// The loader's file, instead of the system's own.
    pub loader: Option<PathBuf>,
}

/// A started Vulkan instance.
#[derive(Clone)]
pub struct Instance {
    inner: Arc<Inner>,
}

struct Inner {
    instance: ash::Instance,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    messages: Arc<Messages>,
    /// Declared last, hence dropped last: the library must outlive everything that was loaded from it.
    _entry: ash::Entry,
}

impl Instance {
    /// Loads the system's Vulkan loader and creates an instance without a surface.
    ///
    /// # Errors
    /// [`DeviceError::NoVulkan`] says what is missing.
    pub fn new(options: &InstanceOptions) -> Result<Self, DeviceError> {
        let absent = |what: String| DeviceError::NoVulkan(what.replace('\n', " "));
        // SAFETY: the loader is the system's own, or one that the caller vouches for; loading it runs its initialisers.
        let entry = unsafe {
            match &options.loader {
                None => ash::Entry::load(),
                Some(file) => ash::Entry::load_from(file),
            }
        };
        let entry = entry.map_err(|e| absent(format!("no loader ({e})")))?;
        // SAFETY: a plain query of the loader.
        let version = unsafe { entry.try_enumerate_instance_version() }
            .map_err(DeviceError::of("vkEnumerateInstanceVersion"))?
            .unwrap_or(vk::API_VERSION_1_0);
        if version < VERSION {
            return Err(absent(format!("expected a loader of version 1.2, got {}", spelled(version))));
        }
        // SAFETY: a plain query of the loader.
        let available = unsafe { entry.enumerate_instance_extension_properties(None) }
            .map_err(DeviceError::of("vkEnumerateInstanceExtensionProperties"))?;
        let has = |name: &CStr| available.iter().any(|e| e.extension_name_as_c_str() == Ok(name));

        let mut extensions = Vec::new();
        let mut flags = vk::InstanceCreateFlags::empty();
        if has(khr::portability_enumeration::NAME) {
            // Without it the loader hides devices that implement Vulkan on top of another interface (macOS).
            extensions.push(khr::portability_enumeration::NAME.as_ptr());
            flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        }
        let mut layers = Vec::new();
        let messages = Arc::<Messages>::default();
        let mut listener = listener(&messages);
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut checks = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        if options.validation {
            // SAFETY: a plain query of the loader.
            let installed = unsafe { entry.enumerate_instance_layer_properties() }
                .map_err(DeviceError::of("vkEnumerateInstanceLayerProperties"))?;
            if !installed.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION)) {
                return Err(absent("the Khronos validation layer was requested but is not installed".into()));
            }
            layers.push(VALIDATION.as_ptr());
            extensions.extend([ext::debug_utils::NAME.as_ptr(), ext::validation_features::NAME.as_ptr()]);
        }

        let app = vk::ApplicationInfo::default()
            .application_name(c"pumice")
            .engine_name(c"pumice")
            .api_version(VERSION);
        let mut create = vk::InstanceCreateInfo::default()
            .application_info(&app)
            .flags(flags)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&extensions);
        if options.validation {
            create = create.push_next(&mut checks).push_next(&mut listener);
        }
        // SAFETY: `create` and all that it points to live until the call returns; `messages` lives until the end of this
        // function, and in `Inner` from then on.
        let instance = unsafe { entry.create_instance(&create, None) }
            .map_err(|e| absent(format!("the loader cannot create an instance ({e})")))?;
        let mut inner = Inner { instance, messenger: None, messages, _entry: entry };
        if options.validation {
            let calls = ext::debug_utils::Instance::new(&inner._entry, &inner.instance);
            let create = self::listener(&inner.messages);
            // SAFETY: the messages outlive the messenger: `Inner` drops the messenger first.
            let messenger = unsafe { calls.create_debug_utils_messenger(&create, None) }
                .map_err(DeviceError::of("vkCreateDebugUtilsMessengerEXT"))?;
            inner.messenger = Some((calls, messenger));
        }
        Ok(Self { inner: Arc::new(inner) })
    }

    /// Messages of the validation layer; none where it is not enabled.
    pub fn messages(&self) -> &Arc<Messages> {
        &self.inner.messages
    }

    /// Vulkan's functions.
    pub(super) fn calls(&self) -> &ash::Instance {
        &self.inner.instance
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        // SAFETY: devices hold the instance alive, so none is left; the messenger is of this instance and dies before it.
        unsafe {
            if let Some((calls, messenger)) = &self.messenger {
                calls.destroy_debug_utils_messenger(*messenger, None);
            }
            self.instance.destroy_instance(None);
        }
    }
}

impl std::fmt::Debug for Instance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Instance").field("validation", &self.inner.messenger.is_some()).finish()
    }
}

/// Describes a messenger that receives warnings and errors.
fn listener(messages: &Arc<Messages>) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Kind};
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(Kind::VALIDATION | Kind::PERFORMANCE)
        .pfn_user_callback(Some(receive))
        .user_data(Arc::as_ptr(messages).cast_mut().cast())
}

/// A version as text: `major.minor.patch`.
pub(super) fn spelled(version: u32) -> String {
    format!(
        "{}.{}.{}",
        vk::api_version_major(version),
        vk::api_version_minor(version),
        vk::api_version_patch(version)
    )
}

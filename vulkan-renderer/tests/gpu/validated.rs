//! Renderers behind the validation layer.

use std::sync::Mutex;

use pumice_transport::Renderer as _;
use pumice_vulkan::VulkanRenderer;
use pumice_vulkan::device::{self, Backend};

/// A renderer whose every call is checked by the validation layer. It is used again by later tests, with nothing left of its scene:
/// compiling for a device that computes on the CPU takes longer than most tests.
pub(crate) struct Validated(Option<VulkanRenderer>);

static IDLE: Mutex<Vec<VulkanRenderer>> = Mutex::new(Vec::new());

impl Validated {
    pub(crate) fn open(backend: Backend) -> Self {
        let mut idle = IDLE.lock().expect("no test panicked while it held the lock");
        let known = idle.iter().position(|r| r.gpu().backend() == backend);
        Self(Some(known.map_or_else(|| open(backend), |place| idle.swap_remove(place))))
    }
}

fn open(backend: Backend) -> VulkanRenderer {
    let instance = super::validated();
    let all = device::survey(&instance).expect("the devices");
    let candidate = all.iter().find(|c| c.can(backend)).unwrap_or_else(|| panic!("{backend}: {all:?}"));
    let read = |path: &std::path::Path| Err(format!("no picture at {}", path.display()));
    VulkanRenderer::open(&instance, candidate, backend, None, read).expect("a renderer")
}

impl std::ops::Deref for Validated {
    type Target = VulkanRenderer;

    fn deref(&self) -> &VulkanRenderer {
        self.0.as_ref().expect("taken when dropped")
    }
}

impl std::ops::DerefMut for Validated {
    fn deref_mut(&mut self) -> &mut VulkanRenderer {
        self.0.as_mut().expect("taken when dropped")
    }
}

impl Drop for Validated {
    fn drop(&mut self) {
        let said = self.gpu().instance().messages().take();
        if std::thread::panicking() {
            return;
        }
        assert!(said.is_empty(), "the validation layer says:\n{}", said.join("\n"));
        if let Some(mut renderer) = self.0.take().filter(|r| !r.gpu().is_lost()) {
            renderer.forget_scene();
            renderer.notices();
            IDLE.lock().expect("no test panicked while it held the lock").push(renderer);
        }
    }
}

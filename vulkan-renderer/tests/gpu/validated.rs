//! Renderers with the validation layer, used by one test after the other.
//!
//! A driver that computes on the CPU spends most of a test's time on compiling, and never frees what it compiled. So there are only as many
//! renderers as one test uses at once, later tests use them again, and they compile what the scenes may need ([`carried`]): a few programs
//! draw all scenes of all tests. `carried.rs`, the tests of failures, and every test outside this crate use programs that leave out all
//! that a scene does not need.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::ThreadId;

use pumice_scene::{Part, PartSet};
use pumice_transport::{LoadedScene, RenderError, Renderer as _};
use pumice_vulkan::VulkanRenderer;
use pumice_vulkan::device::{self, Backend};

/// A renderer of which the validation layer checks every call. Later tests use it again, without any remains of its scene.
pub(crate) struct Validated {
    renderer: Option<VulkanRenderer>,
    /// Parts that are compiled in addition to what a scene needs.
    besides: PartSet,
}

/// The thread of the test whose turn it is, its number of renderers, and the renderers that are free.
struct Turn {
    of: Option<ThreadId>,
    taken: usize,
    idle: Vec<VulkanRenderer>,
}

static TURN: Mutex<Turn> = Mutex::new(Turn { of: None, taken: 0, idle: Vec::new() });
static OVER: Condvar = Condvar::new();

fn turn() -> MutexGuard<'static, Turn> {
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Parts that are compiled whether a scene needs them or not: what many of the tests' scenes need, so that few programs draw them all.
/// (Everything takes a CPU six times as long to compile as the minimum.) It has no part whose use tests count.
fn carried() -> PartSet {
    [Part::Microfacets, Part::LightSampling, Part::Lamps, Part::Cuts, Part::Transparent, Part::Meshes]
        .into_iter()
        .fold(PartSet::NONE, PartSet::with)
}

impl Validated {
    /// Opens a renderer after waiting for the test whose turn it is, unless that is the caller.
    pub(crate) fn open(backend: Backend) -> Self {
        Self::open_carrying(backend, carried())
    }

    /// Opens a renderer for scenes with all kinds of surfaces whose film keeps render passes and mattes.
    pub(crate) fn open_sorting(backend: Backend) -> Self {
        use Part::{Catchers, Coats, Emitters, Glass, Mattes, Sheen, Sorting};
        let parts = [Sorting, Mattes, Emitters, Coats, Glass, Sheen, Catchers];
        Self::open_carrying(backend, parts.into_iter().fold(carried(), PartSet::with))
    }

    /// Opens a renderer that leaves out what a scene does not need.
    pub(crate) fn open_bare(backend: Backend) -> Self {
        Self::open_carrying(backend, PartSet::NONE)
    }

    fn open_carrying(backend: Backend, besides: PartSet) -> Self {
        let me = std::thread::current().id();
        let others = |turn: &mut Turn| turn.of.is_some_and(|of| of != me);
        let mut turn = OVER.wait_while(turn(), others).unwrap_or_else(PoisonError::into_inner);
        (turn.of, turn.taken) = (Some(me), turn.taken + 1);
        let known = turn.idle.iter().position(|r| r.gpu().backend() == backend);
        let known = known.map(|place| turn.idle.swap_remove(place));
        drop(turn);
        // Its turn ends when this value is dropped, whatever happens here.
        let mut opened = Self { renderer: None, besides };
        opened.renderer = Some(known.unwrap_or_else(|| open(backend)));
        opened
    }

    /// [`pumice_transport::Renderer::set_scene`], with the parts that are compiled in addition.
    pub(crate) fn set_scene(&mut self, scene: &LoadedScene) -> Result<(), RenderError> {
        let scene = scene.with_parts(self.besides);
        (**self).set_scene(&scene)
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
        self.renderer.as_ref().expect("taken when dropped")
    }
}

impl std::ops::DerefMut for Validated {
    fn deref_mut(&mut self) -> &mut VulkanRenderer {
        self.renderer.as_mut().expect("taken when dropped")
    }
}

impl Drop for Validated {
    fn drop(&mut self) {
        let mut renderer = self.renderer.take();
        let said = renderer.as_ref().map(|r| r.gpu().instance().messages().take()).unwrap_or_default();
        if let Some(renderer) = &mut renderer {
            renderer.forget_scene();
            renderer.notices();
        }
        // A test that fails discards its renderer.
        let kept = renderer.filter(|r| !std::thread::panicking() && !r.gpu().is_lost());
        let mut turn = turn();
        turn.idle.extend(kept);
        turn.taken -= 1;
        if turn.taken == 0 {
            turn.of = None;
            OVER.notify_all();
        }
        drop(turn);
        if !std::thread::panicking() {
            assert!(said.is_empty(), "the validation layer says:\n{}", said.join("\n"));
        }
    }
}

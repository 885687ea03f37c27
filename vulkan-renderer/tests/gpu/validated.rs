//! Renderers behind the validation layer, for one test after the other.
//!
//! A driver that computes on the CPU takes most of a test's time to compile, and gives nothing back that it compiled. So there are no
//! more renderers than one test has at once, each is used again by later tests, and they carry what scenes may need ([`carried`]): a
//! few programs draw all scenes of all tests. Programs that leave out all that a scene does not need are those of `carried.rs`, of the
//! tests of failures, and of every test outside of this crate.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::ThreadId;

use pumice_scene::{Part, PartSet};
use pumice_transport::{LoadedScene, RenderError, Renderer as _};
use pumice_vulkan::VulkanRenderer;
use pumice_vulkan::device::{self, Backend};

/// A renderer whose every call is checked by the validation layer. It is used again by later tests, with nothing left of its scene.
pub(crate) struct Validated {
    renderer: Option<VulkanRenderer>,
    /// What is built besides what a scene needs.
    besides: PartSet,
}

/// The test whose turn it is, how many renderers it has, and those that wait.
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

/// What is compiled whether a scene needs it or not: what many of the tests' scenes need and little of others, so that few programs
/// draw them all. (All that there is takes a CPU six times as long to compile as the least.) Nothing that tests count.
fn carried() -> PartSet {
    [Part::Microfacets, Part::Aiming, Part::Lamps, Part::Cuts, Part::Clear, Part::Meshes]
        .into_iter()
        .fold(PartSet::NONE, PartSet::with)
}

impl Validated {
    /// Waits for the test whose turn it is, unless that is the caller.
    pub(crate) fn open(backend: Backend) -> Self {
        Self::open_carrying(backend, carried())
    }

    /// One for scenes of which the film keeps passes besides, with all kinds of surfaces.
    pub(crate) fn open_sorting(backend: Backend) -> Self {
        let parts = [Part::Sorting, Part::Coats, Part::Glass, Part::Sheen, Part::Catchers];
        Self::open_carrying(backend, parts.into_iter().fold(carried(), PartSet::with))
    }

    /// One that leaves out what a scene does not need.
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
        // Its turn ends with it, whatever happens here.
        let mut opened = Self { renderer: None, besides };
        opened.renderer = Some(known.unwrap_or_else(|| open(backend)));
        opened
    }

    /// [`pumice_transport::Renderer::set_scene`], with what is carried.
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
        // A test that fails leaves nothing to the next.
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

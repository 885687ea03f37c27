//! States of Neuroglancer, opened as scenes.
//!
//! ```text
//! state: JSON, or a link with it ─► State: layers with chosen segments, colours, position ─► a copy of each layer's volume
//!                                                                                             └─► scene: place, camera, materials
//! ```
//! Source of what the fields mean: Neuroglancer's own code (`src/navigation_state.ts`, `src/perspective_view/panel.ts`,
//! `src/layer/segmentation`, `src/segment_color.ts`).

mod color;
mod scene;
mod source;
mod state;

pub use scene::{OpenedState, open_state};
pub use state::State;

//! The encodings of "SVDAG Compression for Segmentation Volume Path Tracing" (Werner, Piochowiak, Dachsbacher, VMV 2024), in the
//! layouts that it describes. The bench measures Pumice's own form against them; no picture is rendered from them.
//!
//! ```text
//! volume ─► voxels of each label ─► Subdivision: tight boxes, halved along their longest side              §3.1
//!               ├─► Octrees      an SVO for each box, nodes of 2 bytes                                     §3.2.1
//!               └─► Dag          an SVDAG for each type, nodes of 32 bytes ─► merged into one for all      §3.2.2
//!                                both stop at single voxels, or at occupancy fields of 4³ voxels           §3.3
//! Encoding ─► decoded, cell by cell; traced by a hierarchy over the boxes and a DDA of several levels      §4
//! ```
//! The paper leaves some things open. The items that decide them document the choice: the size of a box record ([`BoxRecord`]), occupancy
//! fields in octrees and pointers of more than 12 bits ([`Octrees`]), types ([`Types`]).
#![forbid(unsafe_code)]

mod dag;
mod encoding;
mod merge;
mod octree;
mod reuse;
mod subdivision;
mod tracer;
mod tree;
mod types;
mod walk;

pub use dag::Dag;
pub use encoding::{BoxRecord, Encoding, Form, NotTheVolume};
pub use merge::{Merged, merge_in_turn, merge_on_all_cores};
pub use octree::Octrees;
pub use reuse::{LevelReuse, Reuse};
pub use subdivision::{Subdivision, TightBox};
pub use tracer::{EncodedHit, EncodingTracer};
pub use types::Types;

//! USD files: a stage as values, and its two forms.
//!
//! ```text
//! Stage ── Prim ─┬─ Property ── Value ── Array: its elements are produced while they are written
//!                ├─ Prim …
//!                └─ VariantSet ── Variant ── Prim …
//!   │
//!   ├─► write_usda   text, which people and version control read
//!   ├─► write_usdc   crate file 0.8.0: binary, with compressed integers
//!   └─► write_usdz   a package of such a file and the pictures that it refers to
//! ```
//! Both forms say the same: Pixar's library reads equal layers from them (`tests/python/test_usd_stages.py`).

mod crate_file;
mod identifier;
mod integers;
mod package;
mod stage;
mod text;
mod value;

pub use crate_file::write_usdc;
pub use identifier::{identifier, text_of_identifier};
pub use package::{PackedFile, write_usdz};
pub use stage::{Attribute, Content, Prim, Property, Specifier, Stage, Variant, VariantSet};
pub use text::write_usda;
pub use value::{Array, ArrayElement, Element, Sink, Value};

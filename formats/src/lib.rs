#![forbid(unsafe_code)]
//! Reads label volumes from foreign files (NRRD, NIfTI, TIFF, NPY/NPZ, MetaImage and raw) block by block and writes them; reads triangle
//! meshes ([`mesh`]); reads and writes tables of labels ([`label_tables`]).
//!
//! ```text
//! open ──► registry ──► one module a format ──► VolumeFile: info, axes, element type, byte stream ──► SlabSource ──► LabelBlock
//!          (content)    (header only)                                                                 (shared by all)
//! ```
//! A format module understands its own header and depends neither on other formats nor on its caller. The code that touches voxels is
//! shared: `stream` turns a file into the plain bytes of the voxels, `layout` maps each byte to a voxel, `element` turns bytes into labels
//! and refuses values that are not labels, and `slab` combines these with bounded memory.

pub mod error;
pub mod label_tables;
pub mod mesh;
pub mod open;
pub mod options;
pub mod write;

mod choice;
mod element;
mod gzip;
mod header_text;
mod layout;
mod metaimage;
mod metaimage_header;
mod nifti;
mod nifti_header;
mod npy;
mod npy_header;
mod npz;
mod nrrd;
mod nrrd_header;
mod orientation;
mod placement;
mod ply;
mod raw;
mod registry;
mod slab;
mod slice_numbers;
mod stream;
mod text_stream;
mod tiff;
mod tiff_axes;
mod tiff_folder;
mod tiff_ifd;
mod tiff_page;
mod volume_file;
mod voxel_writer;
mod write_nifti;
mod write_npy;
mod write_nrrd;
mod write_ply;
mod write_tiff;

pub use choice::{ChoiceValue, OpenChoice};
pub use error::FormatError;
pub use label_tables::{LabelTableFile, LabelTableFormat, read_label_table, write_label_table};
pub use mesh::open_mesh;
pub use open::{Probe, open, probe};
pub use options::{ArrayAxes, OpenOptions, RawLayout, Recorded, Warnings};
pub use orientation::orientation;
pub use volume_file::Layer;
pub use write_ply::write_mesh;

#![forbid(unsafe_code)]
//! Reads label volumes from foreign files (NRRD, NIfTI, TIFF, NPY/NPZ, MetaImage, HDF5 and raw) and stores of chunks (Zarr, OME-Zarr,
//! Neuroglancer precomputed, N5) block by block and writes some of them; reads triangle meshes ([`mesh`]); reads and writes tables of labels
//! ([`label_tables`]).
//!
//! ```text
//! open ──► registry ──► one module a format ──► VolumeFile: info, axes, element type, byte stream ──► SlabSource ──► LabelBlock
//!          (content)    (header only)                                                                 (shared by all)
//! ```
//! A format module understands its own header and depends neither on other formats nor on its caller. The code that touches voxels is
//! shared: `chunks` puts the chunks of a store together; `stream` turns a file into the plain bytes of the voxels, `layout` maps each byte to a voxel, `element` turns bytes into labels
//! and refuses values that are not labels, and `slab` combines these with bounded memory.

pub mod error;
pub mod label_tables;
pub mod mesh;
pub mod open;
pub mod options;
pub mod series;
pub mod write;
pub mod write_store;

mod array_axes;
mod array_place;
mod bounded_decoder;
mod choice;
mod chunk_order;
mod chunk_walk;
mod chunks;
mod chunks_ahead;
mod compressed_segmentation;
mod compressed_segmentation_writer;
mod compresso;
mod element;
mod gzip;
#[cfg(feature = "hdf5")]
mod hdf5;
#[cfg(feature = "hdf5")]
mod hdf5_attributes;
#[cfg(feature = "hdf5")]
mod hdf5_datasets;
mod hdf5_format;
#[cfg(feature = "hdf5")]
mod hdf5_lzf;
mod header_text;
mod layout;
mod levels;
mod metaimage;
mod metaimage_header;
mod n5;
mod n5_block;
mod natural_order;
mod nifti;
mod nifti_header;
mod npy;
mod npy_header;
mod npz;
mod nrrd;
mod nrrd_header;
#[cfg(feature = "zarr")]
mod ome_zarr;
mod orientation;
mod placement;
mod ply;
mod precomputed;
mod precomputed_info;
mod precomputed_shards;
mod raw;
mod region;
mod registry;
mod relabel;
#[cfg_attr(not(feature = "http"), path = "no_server.rs")]
mod server;
mod slab;
mod slabs_by_chunk;
mod slice_numbers;
mod store_files;
mod store_options;
mod stores;
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
mod write_ome_zarr;
mod write_ply;
mod write_precomputed;
mod write_tiff;
#[cfg(feature = "zarr")]
mod zarr;
#[cfg(feature = "zarr")]
mod zarr_chunks;
#[cfg(feature = "zarr")]
mod zarr_codecs;
#[cfg(feature = "zarr")]
mod zarr_files;
mod zarr_format;
#[cfg(feature = "zarr")]
mod zarr_node;
#[cfg(feature = "zarr")]
mod zarr_shards;

pub use choice::{ChoiceValue, OpenChoice};
pub use error::FormatError;
pub use label_tables::{LabelTableFile, LabelTableFormat, read_label_table, write_label_table};
pub use mesh::open_mesh;
pub use open::{Probe, Reach, open, open_regions, probe, reach};
pub use options::{ArrayAxes, MissingChunks, OpenOptions, RawLayout, Recorded, Roi, Scale, Warnings};
pub use orientation::orientation;
pub use series::{FileSeries, TimeSteps, is_pattern, open_series};
#[cfg(feature = "http")]
#[doc(hidden)]
pub use server::read_over;
pub use store_files::is_on_server;
pub use stores::server_descriptions;
pub use volume_file::Layer;
pub use write_ply::write_mesh;

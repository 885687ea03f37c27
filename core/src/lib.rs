//! Segmentation volumes (one integer label per voxel) compressed losslessly into per-label boxes over one shared sparse voxel
//! DAG, after *SVDAG Compression for Segmentation Volume Path Tracing* (Werner, Piochowiak, Dachsbacher, VMV 2024).
//!
//! ```text
//! BlockSource ──► parts, by chunk ──► finish ──► CompressedVolume ──► .pumice
//!   labels        (label, cell, mask)  boxes, nodes,  queries, decoding     ▲
//!   by block      records, OR-ed       leaves └─────────────────────────────┘ chunk by chunk, in bounded memory
//! ```

pub mod annotations;
pub mod array_source;
pub mod atomic_file;
pub mod block;
mod bounds;
pub mod box_record;
mod boxes;
pub mod cell;
mod chunk_boxes;
mod chunk_nodes;
pub mod chunk_set;
pub mod compress;
pub mod compress_series;
pub mod contacts;
pub mod content_hash;
mod counted_fields;
mod decode;
pub mod elements;
mod end_process;
pub mod error;
pub mod file;
mod find_contacts;
mod finish;
mod freed_memory;
pub mod grid;
pub mod info;
pub mod input_file;
pub mod job;
mod kept_records;
pub mod label_query;
pub mod label_table;
mod layer_source;
mod layers;
pub mod leaves;
pub mod memory;
pub mod mesh;
mod more_labels;
pub mod morton;
pub mod node;
pub mod octahedral;
mod one_line;
pub mod outputs;
pub mod pages;
mod pair_set;
mod process_limits;
pub mod reserve;
pub mod residency;
mod scan;
mod sharing;
pub mod sorted_cells;
mod spool;
mod store;
pub mod stored;
mod touching;
pub mod types;
pub mod verify;
pub mod volume;
mod volume_sink;

pub use annotations::{AnnotationFit, AnnotationTable, NumericColumn};
pub use array_source::ArraySource;
pub use atomic_file::{TargetError, WrittenFile, link_target, write_atomically, write_text};
pub use block::{BlockSource, LabelBlock, LabelBuffer};
pub use bounds::Bounds;
pub use box_record::BoxRecord;
pub use chunk_set::{ChunkGrid, ChunkSet, VoxelRegion};
pub use compress::{
    CompressOptions, compress, compress_labels, compress_layer_parts, compress_parts, compress_to_file,
};
pub use compress_series::{SeriesSource, compress_series_parts, compress_series_to_file};
pub use contacts::Contacts;
pub use elements::Elements;
pub use end_process::end_process;
pub use error::{Error, Result};
pub use file::{
    CompressionLevel, PartInfo, PartSource, Series, WrittenVolume, frames_in_file, merge_into_part,
    merge_parts, read_part,
};
pub use grid::BoxGrid;
pub use info::{LabelNote, LabelType, Unit, VolumeInfo, WorldFrame};
pub use input_file::{open_input, read_input};
pub use job::{CancelFlag, Job};
pub use kept_records::KeptRecords;
pub use label_query::{LabelColumns, LabelQuery, Numbers, QueryError};
pub use label_table::LabelTable;
pub use layer_source::LayerSource;
pub use leaves::Leaves;
pub use mesh::{MeshData, MeshError};
pub use node::NodeRef;
pub use outputs::Outputs;
pub use pages::Pages;
pub use process_limits::meet_limits;
pub use reserve::NoMemory;
pub use residency::Residency;
pub use sorted_cells::SortedCells;
pub use spool::Scratch;
pub use types::TypeTable;
pub use verify::{Verification, verify};
pub use volume::{BoxPlace, BoxView, CHUNK_VOXELS, Chunk, CompressedVolume, FrameOf, LabelRun, MAX_DIM};

//! The work behind the command and the Python module: it opens volumes, chooses a backend, drives progressive rendering and reports.

pub mod annotations;
pub mod backend;
pub mod compare_files;
pub mod compress_file;
pub mod cycles;
pub mod decompress_file;
pub mod denoise;
pub mod error;
mod exit_code;
pub mod export_file;
pub mod figure;
pub mod file_info;
pub mod label_files;
pub mod label_rows;
mod legend_rows;
pub mod live;
pub mod measure;
pub mod neuroglancer;
pub mod npy;
pub mod open;
pub mod part_files;
mod part_input;
pub mod persistent_renderer;
pub mod pick_pixels;
pub mod plot;
pub mod progressive;
pub mod reading;
pub mod render_file;
pub mod resumable;
mod rewrite_file;
pub mod savings;
pub mod script;
pub mod selection;
pub mod shipped_volume;
pub mod source_fingerprint;
pub mod threads;
pub mod values;
pub mod verify_render;

pub use backend::{Device, FallbackRenderer, devices, make_renderer};
pub use compare_files::{ComparedPictures, compare_pictures};
pub use compress_file::{
    CompressOutcome, CompressRequest, LabelsGiven, Verified, compress_file, read_types, verify_file,
};
pub use decompress_file::{StoreName, WriteAs, decompress_file, write_labels_of};
pub use denoise::{DenoiserName, Filter, Oidn};
pub use error::SessionError;
pub use exit_code::{exit_code, interrupt};
pub use export_file::{ExportRequest, Exported, export_file};
pub use file_info::{FileInfo, file_info, shown_info};
pub use label_files::{
    Describe, TableFit, TableOutcome, TableRequest, annotate, describing, parse_query, read_table,
    write_labels,
};
pub use label_rows::LabelRows;
pub use live::{Frame, LabelFilm, Live, LiveOptions, LiveState, Status};
pub use measure::{Stopwatch, peak_rss_bytes, resident_file_bytes};
pub use open::{
    Residence, open_chosen, open_labels, open_meshes, open_more_labels, open_shown, open_source, open_volume,
    with_built_in,
};
pub use part_files::{
    MergeRequest, PartOutcome, PartRequest, compress_part_file, merge_files, merge_part_files,
};
pub use persistent_renderer::{PersistentRenderer, Watching};
pub use pick_pixels::{PickedPixel, PickedPixels, pick_pixels};
pub use progressive::{CurvePoint, Stop};
pub use pumice_core::{ChunkGrid, ChunkSet, CompressionLevel, Job, LabelType, Verification, meet_limits};
pub use pumice_export::{ExportSize, Form, Merging, Reader, VoxelRegion};
pub use pumice_formats::write_store::{OmeVersion, PrecomputedEncoding};
pub use pumice_formats::{
    ArrayAxes, LabelTableFormat, MissingChunks, OpenOptions, RawLayout, Recorded, Roi, Scale, TimeSteps,
    Warnings,
};
pub use pumice_picture::Denoiser;
pub use pumice_picture::annotate::{Annotations, Corner, DEFAULT_DPI, ScaleBar, pixels_of_mm};
pub use pumice_scene::{Lod, Mode, ViewTransform};
pub use pumice_transport::LoadedScene;
pub use pumice_transport::geometry::DetailLevel;
pub use pumice_vulkan::finish_compiling;
pub use render_file::{
    NumberedPicture, PageFigures, PicturePaths, RenderFigures, RenderOverrides, RenderRequest, Rendered,
    Subject, render_file, render_time_steps, render_turntable,
};
pub use resumable::{KeptParts, compress_resumable, compress_resumable_with, parts_folder};
pub use rewrite_file::open_to_rewrite;
pub use savings::{OpeningSaved, Savings, SavingsOptions, measure_savings};
pub use shipped_volume::shipped_volume;
pub use threads::with_threads;
pub use verify_render::{
    LastLook, VerifiedRender, VerifyMaps, VerifyProgress, VerifyRenderRequest, verify_render,
};

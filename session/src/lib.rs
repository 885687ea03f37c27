//! What the command and Python are both made of: opens volumes, picks a backend, drives progressive rendering, reports.
#![forbid(unsafe_code)]

pub mod backend;
pub mod compare_files;
pub mod compress_file;
pub mod convergence;
pub mod curve_plot;
pub mod demo;
pub mod detail;
pub mod error;
pub mod extremes;
pub mod figure;
pub mod file_info;
pub mod live;
pub mod measure;
mod npy;
pub mod open;
pub mod paper;
pub mod peers;
pub mod progressive;
pub mod ray_sets;
mod reference;
pub mod render_file;
pub mod savings;
mod script;
pub mod selection;
pub mod stability;

pub use backend::{Device, FallbackRenderer, devices, make_renderer};
pub use compare_files::compare_pictures;
pub use compress_file::{CompressOutcome, CompressRequest, compress_file, decompress_file, verify_file};
pub use convergence::{Convergence, ConvergenceOptions, measure_convergence, write_convergence};
pub use detail::{DetailOptions, DetailTable, measure_detail, write_detail};
pub use error::SessionError;
pub use extremes::{EXTREME_NAMES, ExtremeCase, ExtremesOptions, measure_extremes, write_extremes};
pub use file_info::{FileInfo, file_info};
pub use live::{Frame, Live, LiveOptions, LiveState, Status};
pub use measure::{Stopwatch, peak_rss_bytes, resident_file_bytes};
pub use open::{Residence, open_chosen, open_labels, open_meshes, open_shown, open_source, open_volume};
pub use paper::{PaperOptions, PaperTables, measure_paper, write_paper};
pub use peers::{PEERS, PeersOptions, PeersTable, measure_peers, write_peers};
pub use progressive::{CurvePoint, Stop};
pub use pumice_core::{Job, LabelType, Level, Verification};
pub use pumice_formats::{ArrayAxes, OpenOptions, RawLayout};
pub use pumice_scene::{Lod, Mode, ViewTransform};
pub use render_file::{RenderFigures, RenderOverrides, RenderRequest, Rendered, Subject, render_file};
pub use savings::{
    NeedsOptions, NeedsScene, OpeningSaved, Savings, SavingsOptions, measure_needs, measure_savings,
    write_needs,
};
pub use stability::{Beside, Case, Stability, measure_stability};

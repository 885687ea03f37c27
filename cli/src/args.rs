//! Every flag of the command, once: its short line, its long text with default, unit and cost.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// Path traced figures from segmentation volumes that other tools cannot load.
///
/// A segmentation volume has one whole-number label per voxel. Pumice compresses it losslessly to a few per cent, path traces
/// the compressed form as it is, and writes pictures that know their own error.
///
/// Begin with `pumice demo`, or with your own file: `pumice render volume.nrrd -o picture.png`.
#[derive(Debug, Parser)]
#[command(name = "pumice", version, max_term_width = 100, after_help = EXIT_CODES, disable_help_subcommand = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 done; 1 the answer is no (verify, compare, bench); 2 bad usage or bad input, with one line that \
says what and where.";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Demo(Demo),
    Compress(Compress),
    Info(Info),
    Verify(Verify),
    Decompress(Decompress),
    Render(Box<Render>),
    Compare(Compare),
    Devices(Devices),
    Bench(Bench),
}

/// Compress a real volume of mouse cortex and path trace thirty of its neurons
///
/// Writes picture.png, picture.exr, report.md and error.svg. Ends when the picture's estimated relative error is at most 3 % or
/// after 60 seconds of rendering.
#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Another label volume instead of the shipped one
    #[arg(long, value_name = "FILE")]
    pub(crate) volume: Option<PathBuf>,
    /// Folder for the results, made if absent
    #[arg(long, value_name = "DIR", default_value = "pumice-demo")]
    pub(crate) out: PathBuf,
    /// Seconds of rendering at most
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = positive)]
    pub(crate) time: f64,
    /// Estimated relative error to stop at: 0.03 or 3%
    #[arg(long, value_name = "RELATIVE", default_value = "0.03", value_parser = relative)]
    pub(crate) error: f64,
    /// Picture size in pixels
    #[arg(long, value_name = "WxH", default_value = "960x540", value_parser = size)]
    pub(crate) size: [u32; 2],
}

/// How to read a label volume where the file leaves something open
#[derive(Debug, Default, Args)]
pub(crate) struct Reading {
    /// Layer of a file with overlapping segments, counted from 0
    #[arg(long, value_name = "N")]
    pub(crate) layer: Option<u32>,
    /// Time step of a file with several, counted from 0
    #[arg(long = "time-step", value_name = "N")]
    pub(crate) time_step: Option<u32>,
    /// Channel of a file with several, counted from 0
    #[arg(long, value_name = "N")]
    pub(crate) channel: Option<u32>,
    /// Array of an .npz archive with several
    #[arg(long, value_name = "NAME")]
    pub(crate) array: Option<String>,
    /// Voxel size x,y,z in the file's unit, instead of the file's own
    #[arg(long, value_name = "X,Y,Z", value_parser = spacing)]
    pub(crate) spacing: Option<[f64; 3]>,
    /// Array axes of .npy and .npz in the order of indexing
    ///
    /// NumPy arrays do not say which axis is which. `xyz` (default) is what nibabel and pynrrd give, `zyx` what tifffile,
    /// scikit-image and napari use.
    #[arg(long, value_name = "ORDER", value_enum)]
    pub(crate) axes: Option<Axes>,
    /// Read a file without header: its dims, e.g. 512,512,128 (needs --raw-type)
    #[arg(long, value_name = "X,Y,Z", value_parser = dims, requires = "raw_type")]
    pub(crate) raw_dims: Option<[u64; 3]>,
    /// Label type of a file without header: u8 u16 u32 u64 i8 i16 i32 i64 f32 f64
    #[arg(long, value_name = "TYPE", value_parser = label_type, requires = "raw_dims")]
    pub(crate) raw_type: Option<pumice_session::LabelType>,
    /// A file without header is big-endian
    #[arg(long, requires = "raw_dims")]
    pub(crate) raw_big_endian: bool,
    /// Bytes to skip at the start of a file without header
    #[arg(long, value_name = "BYTES", default_value_t = 0, requires = "raw_dims")]
    pub(crate) raw_offset: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Axes {
    Xyz,
    Zyx,
}

/// Compress a label volume losslessly into a .pumice file
///
/// Reads NRRD, NIfTI, TIFF (also a folder of slices), NPY, NPZ, MetaImage and raw files as a stream: the whole volume is never in
/// memory. A file under the final name is always whole.
#[derive(Debug, Args)]
pub(crate) struct Compress {
    /// Label volume
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// The .pumice file to write
    #[arg(short, long, value_name = "OUT.pumice")]
    pub(crate) out: PathBuf,
    /// Size on disk against speed
    ///
    /// `fast` stores the form as it is in memory, `default` costs little time, `small` takes about twice as long.
    #[arg(long, value_enum, default_value_t = Level::Default)]
    pub(crate) level: Level,
    /// Write a report in JSON to this file (- for standard output)
    #[arg(long, value_name = "REPORT")]
    pub(crate) json: Option<PathBuf>,
    /// Threads; default: all cores. The result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) threads: Option<u16>,
    /// Memory for records not yet merged; more is spilled to a temporary folder. Bytes, or with K, M, G
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub(crate) memory_limit: Option<u64>,
    /// CSV table with the columns id,type: groups labels into types
    #[arg(long, value_name = "TABLE")]
    pub(crate) types: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Level {
    /// Arrays as they are in memory: opens soonest, for a few labels at once
    Fast,
    /// Half the size or less, inflated when it is opened
    Default,
    /// The voxels themselves, a third of the default; writing and opening take seconds for each 10⁸
    Small,
}

/// Show what a .pumice file or a label volume holds
///
/// For .pumice: dims, spacing, labels, boxes, bytes on disk and in memory by part. For files of others only the header is read.
#[derive(Debug, Args)]
pub(crate) struct Info {
    /// A .pumice file or any label volume
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// One JSON object instead of text
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

/// Check that a .pumice file holds a volume exactly: every voxel, every id
///
/// Exit code 0 only if all are the same; 1 with the first difference if not.
#[derive(Debug, Args)]
pub(crate) struct Verify {
    /// The .pumice file
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// The volume that it was made from
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

/// Write the labels of a .pumice file as NRRD, NPY, NIfTI or TIFF
#[derive(Debug, Args)]
pub(crate) struct Decompress {
    /// The .pumice file
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Where to: the ending chooses the format, .nrrd .npy .nii .nii.gz .tif
    #[arg(short, long, value_name = "OUT")]
    pub(crate) out: PathBuf,
}

/// Path trace a volume or a scene
///
/// A volume is framed and lit by itself; a scene (JSON, see docs) says all. Ends at the first of --spp, --time and --error;
/// with none of them at 64 samples a pixel. The picture is written when the rendering ends, also when it is interrupted by its
/// limits, and carries the data's hash, the scene and all settings.
#[derive(Debug, Args)]
pub(crate) struct Render {
    /// A .pumice file, any label volume, or a scene (.json)
    #[arg(value_name = "FILE|SCENE.json", required_unless_present = "again")]
    pub(crate) input: Option<PathBuf>,
    /// The picture: .exr (scene-linear, all passes) or .png (8 bit sRGB)
    #[arg(short, long, value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Render a picture again from what it carries: the same pixels
    #[arg(long, value_name = "PICTURE", conflicts_with_all = ["input", "size", "spp", "time", "error", "bounces", "mode", "lod", "seed", "labels", "pick", "view", "transparent", "half", "view_transform", "noise_threshold", "min_spp"])]
    pub(crate) again: Option<PathBuf>,
    /// What renders: auto, cpu, vulkan-rt, vulkan-query or vulkan-compute
    ///
    /// auto takes the best graphics processor, goes on with the next backend where a device fails, and says so. A backend that is
    /// named is used alone; its device is the best that can, or the one after a colon, by number or part of its name: vulkan-rt:0.
    /// `pumice devices` lists them
    #[arg(long, value_name = "NAME[:DEVICE]", default_value = "auto")]
    pub(crate) backend: String,
    /// Picture size in pixels; default 960x540, or the scene's
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub(crate) size: Option<[u32; 2]>,
    /// Stop at this many samples a pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: Option<u32>,
    /// Stop after this many seconds
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) time: Option<f64>,
    /// Stop when the estimated relative error is at most this: 0.03 or 3%
    #[arg(long, value_name = "RELATIVE", value_parser = relative)]
    pub(crate) error: Option<f64>,
    /// A pixel gets no more samples once its estimated relative error is at most this: 0.05 or 5%
    ///
    /// Blender's Noise Threshold. The picture is done when all pixels rest, or at another limit. It is a little biased: which pixels
    /// go on depends on what they found
    #[arg(long, value_name = "RELATIVE", value_parser = relative)]
    pub(crate) noise_threshold: Option<f64>,
    /// Samples that every pixel gets before it may rest, from 4; default 16
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..))]
    pub(crate) min_spp: Option<u32>,
    /// Bounces of light, as in Cycles; default 32, or the scene's
    #[arg(long, value_name = "N")]
    pub(crate) bounces: Option<u32>,
    /// Which light is counted; default path, or the scene's
    #[arg(long, value_enum)]
    pub(crate) mode: Option<RenderMode>,
    /// Finest element drawn: voxels (1), 4³ cells (4), boxes (16), or by distance (auto)
    #[arg(long, value_enum)]
    pub(crate) lod: Option<LodArg>,
    /// Every random number follows from it; default 0, or the scene's
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Passes in the EXR beside the picture, separated by commas; or all, or none
    ///
    /// First surface: depth, position, normal, label, albedo. Of the samples: variance, samples. Light by kind, for 132 bytes a pixel:
    /// light for all of it, or diffuse_direct, diffuse_indirect, diffuse_color, the same of glossy and transmission, emission,
    /// environment. shadow_catcher: shadows that are caught, which then leave the picture. Mattes, 96 bytes a pixel each: cryptomatte_label, cryptomatte_type, or cryptomatte for both. What is named is made,
    /// albedo and normal as means over samples; all is what needs no making, and what the scene's film.passes asks for
    #[arg(long, value_name = "A,B,C", default_value = "all", value_delimiter = ',')]
    pub(crate) passes: Vec<String>,
    /// Leave transparent what camera rays do not meet, instead of the sky or the backdrop
    #[arg(long)]
    pub(crate) transparent: bool,
    /// In an EXR, colours as half floats (16 bits): half the size, 3 digits, at most 65504
    ///
    /// Depth, position, label, Cryptomatte, variance and samples keep 32 bits
    #[arg(long)]
    pub(crate) half: bool,
    /// How a PNG shows light: the sRGB curve (standard), or like Blender's Filmic or AgX
    ///
    /// Default: standard, or the scene's. The last two are approximations; docs/passes.md says how near they come
    #[arg(long, value_enum, value_name = "VIEW")]
    pub(crate) view_transform: Option<ViewArg>,
    /// Only these labels, by id, separated by commas
    #[arg(long, value_name = "ID,ID", value_delimiter = ',', conflicts_with = "pick")]
    pub(crate) labels: Option<Vec<u64>>,
    /// Only the N labels that make the best figure: long and thin before lumps
    #[arg(long, value_name = "N")]
    pub(crate) pick: Option<usize>,
    /// Where a volume is seen from, in degrees: around the vertical axis, above the horizon
    #[arg(long, value_name = "AROUND,ABOVE", value_parser = view, allow_hyphen_values = true)]
    pub(crate) view: Option<[f64; 2]>,
    /// Threads; default: all cores. The picture does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) threads: Option<u16>,
    /// Write a report in JSON to this file (- for standard output)
    #[arg(long, value_name = "REPORT")]
    pub(crate) json: Option<PathBuf>,
    /// Write the scene as JSON to this file
    #[arg(long, value_name = "SCENE.json")]
    pub(crate) save_scene: Option<PathBuf>,
    /// Print what the scene needs, what was left out, and what that saves
    ///
    /// What it saves is measured: after the picture small ones of 160 pixels are drawn both ways, each part left out and put in in turn.
    /// Takes seconds; on a graphics processor also the driver's time to compile each way
    #[arg(long)]
    pub(crate) explain: bool,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RenderMode {
    /// All light
    Path,
    /// Direct light only
    OneBounce,
    /// Ambient occlusion: white surfaces, no lights
    Ao,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum LodArg {
    #[value(name = "1")]
    Voxels,
    #[value(name = "4")]
    Cells,
    #[value(name = "16")]
    Boxes,
    Auto,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ViewArg {
    Standard,
    Filmic,
    Agx,
}

/// Measure how far a picture is from a reference: relMSE, PSNR, SSIM, FLIP, and a test for chance where variances are known
#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// The picture (.exr)
    #[arg(value_name = "A.exr")]
    pub(crate) picture: PathBuf,
    /// The reference (.exr), of the same size
    #[arg(value_name = "B.exr")]
    pub(crate) reference: PathBuf,
    /// Write a report in JSON to this file (- for standard output)
    #[arg(long, value_name = "REPORT")]
    pub(crate) json: Option<PathBuf>,
    /// Exit with 1 when relMSE is above this
    #[arg(long, value_name = "VALUE", value_parser = positive)]
    pub(crate) max_rel_mse: Option<f64>,
}

/// List what can render here, what would be chosen, and why
#[derive(Debug, Args)]
pub(crate) struct Devices {
    /// One JSON object instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

fn numbers<T: std::str::FromStr, const N: usize>(text: &str, separator: char) -> Option<[T; N]> {
    let parts: Vec<T> = text.split(separator).map(|p| p.trim().parse().ok()).collect::<Option<_>>()?;
    parts.try_into().ok()
}

fn size(text: &str) -> Result<[u32; 2], String> {
    numbers(text, 'x')
        .filter(|s: &[u32; 2]| s.iter().all(|&n| (1..=65_536).contains(&n)))
        .ok_or_else(|| "expected WIDTHxHEIGHT in pixels, each 1 to 65536, e.g. 960x540".into())
}

fn dims(text: &str) -> Result<[u64; 3], String> {
    numbers(text, ',').ok_or_else(|| "expected three whole numbers, e.g. 512,512,128".into())
}

fn spacing(text: &str) -> Result<[f64; 3], String> {
    numbers(text, ',')
        .filter(|s: &[f64; 3]| s.iter().all(|v| v.is_finite() && *v > 0.0))
        .ok_or_else(|| "expected three numbers above 0, e.g. 16,16,40".into())
}

fn view(text: &str) -> Result<[f64; 2], String> {
    numbers(text, ',')
        .filter(|v: &[f64; 2]| v[0].is_finite() && v[1].abs() <= 90.0)
        .ok_or_else(|| "expected degrees around and above (-90 to 90), e.g. 30,20".into())
}

fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|v: &f64| v.is_finite() && *v > 0.0)
        .ok_or_else(|| "expected a number above 0".into())
}

fn relative(text: &str) -> Result<f64, String> {
    let (number, factor) = text.strip_suffix('%').map_or((text, 1.0), |t| (t, 0.01));
    positive(number).map(|v| v * factor).map_err(|_| "expected a number above 0, e.g. 0.03 or 3%".into())
}

fn bytes(text: &str) -> Result<u64, String> {
    let (number, shift) = match text.chars().last() {
        Some('K' | 'k') => (&text[..text.len() - 1], 10),
        Some('M' | 'm') => (&text[..text.len() - 1], 20),
        Some('G' | 'g') => (&text[..text.len() - 1], 30),
        _ => (text, 0),
    };
    number
        .parse::<u64>()
        .ok()
        .and_then(|n| n.checked_mul(1 << shift))
        .filter(|&n| n > 0)
        .ok_or_else(|| "expected a number of bytes above 0, e.g. 268435456 or 256M".into())
}

fn label_type(text: &str) -> Result<pumice_session::LabelType, String> {
    serde_json::from_value(serde_json::Value::String(text.to_lowercase()))
        .map_err(|_| "expected one of u8 u16 u32 u64 i8 i16 i32 i64 f32 f64".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clap_finds_no_fault_with_the_flags() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }

    #[test]
    fn values_are_read_or_refused() {
        assert_eq!(size("960x540"), Ok([960, 540]));
        assert_eq!(relative("3%"), Ok(0.03));
        assert_eq!(bytes("256M"), Ok(256 << 20));
        assert_eq!(spacing("16,16,40"), Ok([16.0, 16.0, 40.0]));
        for bad in ["0x5", "960", "-1x3", "960x540x2", "99999999x1"] {
            assert!(size(bad).is_err(), "{bad}");
        }
        for bad in ["NaN,1,1", "0,1,1", "1,1", "inf,1,1"] {
            assert!(spacing(bad).is_err(), "{bad}");
        }
        for bad in ["", "0", "-5", "18446744073709551615G", "M"] {
            assert!(bytes(bad).is_err(), "{bad}");
        }
        for bad in ["0", "-0.1", "nan", "x%"] {
            assert!(relative(bad).is_err(), "{bad}");
        }
    }
}

/// Measure, and print a table
#[derive(Debug, Args)]
pub(crate) struct Bench {
    #[command(subcommand)]
    pub(crate) what: BenchKind,
}

#[derive(Debug, Subcommand)]
pub(crate) enum BenchKind {
    Convergence(Convergence),
    Stability(Stability),
    Needs(Needs),
    Peers(Peers),
    Extremes(Extremes),
    Lod(LodBench),
    Paper(Paper),
}

/// The encodings of the paper that Pumice implements, in its layouts, with ours beside them
///
/// Makes SVOs, SVDAGs of types and one SVDAG of all, without and with occupancy fields, decodes each back, and traces the same rays through
/// them. Writes paper.csv, paper.md with the paper's tables 1, 3, 4 and 5 and section 5.6, and the curves of its figure 6 as SVG. Takes
/// minutes and some 4 GB for 512³ voxels.
#[derive(Debug, Args)]
pub(crate) struct Paper {
    /// Label volumes; the shipped one by default
    #[arg(value_name = "FILE")]
    pub(crate) volumes: Vec<PathBuf>,
    /// Types that labels are dealt to in turn; by default the volume's own, or one for each label
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) types: Option<u32>,
    /// Labels that rays meet, in per cent
    #[arg(long, value_name = "PERCENT", default_value = "15", value_parser = clap::value_parser!(u32).range(1..=100))]
    pub(crate) show: u32,
    /// Pixels of the camera along each side
    #[arg(long, value_name = "N", default_value = "512", value_parser = clap::value_parser!(u32).range(8..=8192))]
    pub(crate) side: u32,
    /// Rounds of rays, of which the fastest counts
    #[arg(long, value_name = "N", default_value = "3", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) rounds: u32,
    /// Folder for the results, made if absent
    #[arg(long, value_name = "DIR", default_value = "pumice-paper")]
    pub(crate) out: PathBuf,
}

/// Levels of detail: picture error against frame time and resident bytes
///
/// Draws a figure of some labels at voxels, by distance, at cells of 4³ and at boxes of 16³, in pictures of each size, on the CPU, and
/// compares all with voxels of many samples. Writes lod.csv, lod.md and an SVG for each volume and size.
#[derive(Debug, Args)]
pub(crate) struct LodBench {
    /// Label volumes; the shipped one by default
    #[arg(value_name = "FILE")]
    pub(crate) volumes: Vec<PathBuf>,
    /// Number of labels, the longest ones
    #[arg(long, value_name = "N", default_value = "30", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) pick: u32,
    /// Picture sizes in pixels
    #[arg(long = "size", value_name = "WxH,…", value_delimiter = ',', default_value = "384x216,96x54", value_parser = size)]
    pub(crate) sizes: Vec<[u32; 2]>,
    /// Samples a pixel, rising
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "1,4,16,64", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: Vec<u32>,
    /// Pictures at each number of samples, averaged
    #[arg(long, value_name = "N", default_value = "3", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) repeats: u32,
    /// Samples a pixel by which a level's own error is known
    #[arg(long, value_name = "N", default_value = "512", value_parser = clap::value_parser!(u32).range(8..))]
    pub(crate) reference_spp: u32,
    /// Folder for the results, made if absent
    #[arg(long, value_name = "DIR", default_value = "pumice-lod")]
    pub(crate) out: PathBuf,
}

/// The worst volumes that there are, generated: bytes, memory, time, and how it grows
///
/// A label of 2³² voxels, 10⁷ labels of one voxel, a line, a checkerboard, noise: each compressed, saved, opened and held against its
/// generator. Writes extremes.csv and extremes.md. Exit code 1 when one takes more bytes than its bound, or its time grows faster than
/// its voxels.
#[derive(Debug, Args)]
pub(crate) struct Extremes {
    /// Some cases only: runs, full, labels, checkerboard, noise-2, noise-256
    #[arg(long = "case", value_name = "NAME,…", value_delimiter = ',')]
    pub(crate) cases: Vec<String>,
    /// A 64th of the voxels: seconds instead of minutes
    #[arg(long)]
    pub(crate) reduced: bool,
    /// Memory to stay below while compressing, in bytes
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub(crate) memory_limit: Option<u64>,
    /// Folder for the results, made if absent
    #[arg(long, value_name = "DIR", default_value = "pumice-extremes")]
    pub(crate) out: PathBuf,
}

/// Other programs that store label volumes, side by side: bytes, CPU seconds, what one voxel costs
///
/// Compresses and decompresses the volume with Pumice at all levels and with crackle, compresso, compressed_segmentation, zstd, NIfTI and
/// zarr by their own Python packages, and holds what comes back against the volume. Writes peers.csv and peers.md.
#[derive(Debug, Args)]
pub(crate) struct Peers {
    /// Label volumes; the shipped one by default
    #[arg(value_name = "FILE")]
    pub(crate) volumes: Vec<PathBuf>,
    /// Python interpreter that has the programs' packages
    #[arg(long, value_name = "PYTHON", default_value = "python3")]
    pub(crate) python: PathBuf,
    /// Programs to leave out
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    pub(crate) without: Vec<String>,
    /// Folder for the results, made if absent
    #[arg(long, value_name = "DIR", default_value = "pumice-peers")]
    pub(crate) out: PathBuf,
}

/// What it saves to leave out what a scene does not need: both ways in turn
///
/// Draws the least that can be drawn of a volume, with all labels and with some, without and with each part that a renderer leaves out
/// where no scene needs it. Writes needs.csv and needs.md. Exit code 1 when both ways do not draw the same picture.
#[derive(Debug, Args)]
pub(crate) struct Needs {
    /// Label volumes; the shipped one by default
    #[arg(value_name = "FILE")]
    pub(crate) volumes: Vec<PathBuf>,
    /// What draws: auto, cpu, vulkan-rt, vulkan-query or vulkan-compute
    #[arg(long, value_name = "NAME", default_value = "auto")]
    pub(crate) backend: String,
    /// Labels of the scene that shows some, the longest ones
    #[arg(long, value_name = "N", default_value = "10", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) show: u32,
    /// Rounds of both ways
    #[arg(long, value_name = "N", default_value = "21", value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub(crate) rounds: u32,
    /// Pixels of the pictures across
    #[arg(long, value_name = "N", default_value = "320", value_parser = clap::value_parser!(u32).range(16..=4096))]
    pub(crate) side: u32,
    /// Folder for the results, made if absent
    #[arg(long, value_name = "DIR", default_value = "pumice-needs")]
    pub(crate) out: PathBuf,
}

/// Error against CPU seconds, beside Cycles where a Python with Blender is named
///
/// Draws a figure of some labels with rising numbers of samples, and the same voxels as a mesh with Cycles on the same cores, and
/// compares both with a reference of many samples of both. Writes convergence.csv, convergence.md and an SVG for each number of bounces.
#[derive(Debug, Args)]
pub(crate) struct Convergence {
    /// Label volume; the shipped one by default
    #[arg(value_name = "FILE")]
    pub(crate) volume: Option<PathBuf>,
    /// Python interpreter that has Blender as the module bpy
    #[arg(long, value_name = "PYTHON")]
    pub(crate) cycles: Option<PathBuf>,
    /// Number of labels, the longest ones
    #[arg(long, value_name = "N", default_value = "30", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) pick: u32,
    /// Picture size in pixels
    #[arg(long, value_name = "WxH", default_value = "240x135", value_parser = size)]
    pub(crate) size: [u32; 2],
    /// Samples a pixel, rising
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "1,4,16,64", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: Vec<u32>,
    /// Bounces, a scene for each
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "1,8")]
    pub(crate) bounces: Vec<u32>,
    /// Pictures at each number of samples, averaged
    #[arg(long, value_name = "N", default_value = "3", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) repeats: u32,
    /// Samples a pixel of the reference, of each program
    #[arg(long, value_name = "N", default_value = "4096", value_parser = clap::value_parser!(u32).range(8..))]
    pub(crate) reference_spp: u32,
    /// Folder for the results, made if absent
    #[arg(long, value_name = "DIR", default_value = "pumice-convergence")]
    pub(crate) out: PathBuf,
}

/// Extreme cases, each with its error against an exact oracle or a closed form, and a bar
///
/// Rays of every kind against whole-number arithmetic; volumes far away, tiny, huge, squeezed; suns, materials and depths of which
/// the picture is known; what must be refused. Rays are the processor's in any case; pictures are drawn by the backend and, where that
/// is another than cpu, held beside the processor's of the same samples. Exit code 1 when a bar is missed, more of a picture is apart
/// from the processor's than roundings explain, or a pixel is not a number from 0 on.
#[derive(Debug, Args)]
pub(crate) struct Stability {
    /// What draws the pictures: auto, cpu, vulkan-rt, vulkan-query or vulkan-compute
    #[arg(long, value_name = "NAME", default_value = "auto")]
    pub(crate) backend: String,
    /// Fewer rays: seconds instead of a minute
    #[arg(long)]
    pub(crate) reduced: bool,
    /// Write the table as Markdown
    #[arg(short, long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Write a report as JSON; `-` for standard output
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

//! `pumice render`

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use pumice_session::values::{bytes, size};
use pumice_session::{DenoiserName, TimeSteps};

use super::Reading;
use super::annotations::AnnotationArgs;
use super::figure::{Figure, NOT_AGAIN};
use super::values::{layer_file, positive, relative, threads};

/// Path trace a volume or a scene
///
/// A volume is framed and lit automatically; a scene (JSON, docs/scene.md) sets everything itself; a state of Neuroglancer
/// (docs/neuroglancer.md) says layers, segments, colours and the view. Rendering stops at whichever of
/// --spp, --time and --error is reached first, or at 64 samples per pixel if none is given. The picture file carries the hash of the
/// data, the scene and all settings.
#[derive(Debug, Args)]
pub(crate) struct Render {
    /// A .pumice file, any label volume, a scene (.json), or a state of Neuroglancer (.json, or a link with it)
    #[arg(value_name = "FILE|SCENE.json", required_unless_present = "again")]
    pub(crate) input: Option<PathBuf>,
    /// Read a layer of a state of Neuroglancer from a copy, in place of where the state says; repeatable
    #[arg(long, value_name = "NAME=PATH", value_parser = layer_file, conflicts_with = "again")]
    pub(crate) layer_file: Vec<(String, PathBuf)>,
    /// The picture: .exr (scene-linear, all passes) or .png (8 bit sRGB)
    #[arg(short, long, value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Render a picture again from the scene and settings that its file carries; gives the same pixels
    #[arg(long, value_name = "PICTURE", conflicts_with_all = ["input", "size", "spp", "error", "bounces", "mode", "lod", "seed", "transparent", "half", "denoise", "view_transform", "noise_threshold", "min_spp"], conflicts_with_all = NOT_AGAIN)]
    pub(crate) again: Option<PathBuf>,
    /// With --again: a file to render from, in place of one that the picture names; once for each, first the volumes, then the meshes, then
    /// the picture of the sky
    #[arg(long, value_name = "FILE", conflicts_with = "input")]
    pub(crate) source: Vec<PathBuf>,
    /// Write no paths into the picture; --again then needs --source
    #[arg(long)]
    pub(crate) no_paths: bool,
    /// Backend that renders: auto, cpu, vulkan-rt, vulkan-query or vulkan-compute
    ///
    /// auto takes the best graphics processor; if a device fails, auto continues with the next backend and prints a notice. A named
    /// backend never falls back to another. It runs on the best device that supports it, or on the device named after a colon, by number
    /// or by part of its name: vulkan-rt:0. `pumice devices` lists backends and devices
    #[arg(long, value_name = "NAME[:DEVICE]", default_value = "auto")]
    pub(crate) backend: String,
    /// Picture size in pixels; default 960x540, or the scene's
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub(crate) size: Option<[u32; 2]>,
    /// Stop at this many samples per pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: Option<u32>,
    /// Stop after this many seconds; with --again the picture may then have fewer samples than the one before, and a warning says so
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) time: Option<f64>,
    /// Stop when the estimated relative error is at most this: 0.03 or 3%
    #[arg(long, value_name = "RELATIVE", value_parser = relative)]
    pub(crate) error: Option<f64>,
    /// Stop sampling a pixel once its estimated relative error is at most this: 0.05 or 5%
    ///
    /// This is Blender's Noise Threshold. The picture is done when every pixel has stopped, or at another limit. It is slightly biased,
    /// because the samples of a pixel themselves decide when it stops
    #[arg(long, value_name = "RELATIVE", value_parser = relative)]
    pub(crate) noise_threshold: Option<f64>,
    /// Minimum samples per pixel with --noise-threshold, 4 or more; default 16
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..))]
    pub(crate) min_spp: Option<u32>,
    /// Maximum number of light bounces, counted as in Cycles; default 32, or the scene's
    #[arg(long, value_name = "N")]
    pub(crate) bounces: Option<u32>,
    /// Which light the picture shows; default path, or the scene's
    #[arg(long, value_enum)]
    pub(crate) mode: Option<RenderMode>,
    /// Finest element that is drawn: voxels (1), cells of 4³ voxels (4), boxes of up to 16³ (16), or by distance (auto)
    ///
    /// Coarser elements need less memory. On the processor they save hardly any time, and boxes none.
    #[arg(long, value_enum)]
    pub(crate) lod: Option<LodArg>,
    /// Seed of all random numbers; default 0, or the scene's
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Passes in an EXR in addition to the picture, separated by commas; or all, or none
    ///
    /// First surface: depth, position, normal, label, albedo. Sampling: variance, samples. Light by kind, 132 bytes of memory per pixel:
    /// light for all of these, or diffuse_direct, diffuse_indirect, diffuse_color, the same three of glossy and transmission, emission,
    /// environment. shadow_catcher: the caught shadows, which are then left out of the picture. Mattes, 96 bytes per pixel each:
    /// cryptomatte_label, cryptomatte_type, or cryptomatte for both. A pass named here is rendered even if the scene does not ask for it;
    /// albedo and normal are then means over the samples. all: the passes that every picture has, and those of the scene's film.passes
    #[arg(long, value_name = "A,B,C", default_value = "all", value_delimiter = ',')]
    pub(crate) passes: Vec<String>,
    /// Make the background transparent, instead of showing the sky or the backdrop
    #[arg(long)]
    pub(crate) transparent: bool,
    /// Denoise the picture: smoother and biased, no longer the mean of its samples
    ///
    /// Averages pixels of one label that a statistical test cannot tell apart. An EXR keeps the picture before as the pass Noisy Image,
    /// unless --passes none; a PNG has the denoised picture alone. Pictures and report say that they are denoised. It runs on the
    /// device of the backend that renders.
    ///
    /// oidn: Intel's Open Image Denoise instead, a neural network, on the processor. Pumice does not bring it along: its library is at
    /// the path of oidn:LIBRARY, or of the environment variable PUMICE_OIDN, or where the system looks
    #[arg(long, value_name = "statistical|oidn[:LIBRARY]", num_args = 0..=1, require_equals = true, default_missing_value = "statistical")]
    pub(crate) denoise: Option<DenoiserName>,
    /// Write colours in an EXR as half floats (16 bits): half the size, 3 significant digits, values up to 65504
    ///
    /// Depth, position, label, Cryptomatte, variance and samples keep 32 bits
    #[arg(long)]
    pub(crate) half: bool,
    /// View transform of a PNG: the sRGB curve (standard), or curves like Blender's Filmic or AgX
    ///
    /// Default: standard, or the scene's. filmic and agx are approximations; docs/passes.md says how close they are
    #[arg(long, value_enum, value_name = "VIEW")]
    pub(crate) view_transform: Option<ViewArg>,
    /// Number of threads; default: all cores. The picture does not depend on it
    #[arg(long, value_name = "N", value_parser = threads())]
    pub(crate) threads: Option<u16>,
    /// Draw from disk, with at most this much of the volumes in memory: in bytes or with K, M, G, KiB, MiB, GiB (powers of 1024)
    ///
    /// The picture is the same, bit by bit. The boxes of a .pumice file go to a temporary file in the folder of TMPDIR, and pages of it are
    /// loaded when rays meet them. The limit holds while rays are traced, for volumes and what is built for them; opening holds a chunk of
    /// 1024³ voxels at a time. A graphics processor holds the pages itself, within the same limit; docs/rendering-large-volumes.md
    #[arg(long, value_name = "BYTES", value_parser = bytes, conflicts_with = "explain")]
    pub(crate) memory_limit: Option<u64>,
    /// Write a report in JSON to this file (- for standard output)
    #[arg(long, value_name = "REPORT")]
    pub(crate) json: Option<PathBuf>,
    /// Write the scene as JSON to this file
    #[arg(long, value_name = "SCENE.json")]
    pub(crate) save_scene: Option<PathBuf>,
    /// Print what the scene needs, what was left out, and what that saves
    ///
    /// The savings are measured: after the picture, Pumice renders pictures of 160 pixels with and without each part in turn. This takes
    /// seconds, and on a graphics processor also the driver's time to compile both variants
    #[arg(long)]
    pub(crate) explain: bool,
    #[command(flatten)]
    pub(crate) annotate: AnnotationArgs,
    #[command(flatten)]
    pub(crate) figure: Figure,
    /// Render several time steps: all, or the first and the last, such as 0-19, counted from 0
    ///
    /// OUT.png stands for OUT_0001.png, OUT_0002.png and so on. Volumes that have time steps show them; camera, chosen labels and colours stay
    /// those of the first.
    #[arg(long, value_name = "all|A-B", conflicts_with_all = ["time_step", "again", "turntable", "explain"])]
    pub(crate) time_steps: Option<TimeSteps>,
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

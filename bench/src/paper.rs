//! The tables and figures of the paper, of its encodings with ours beside them, on one volume: what `pumice bench paper` writes.
//!
//! ```text
//! volume ─► the paper's boxes ─► SVOs (AABB), SVDAGs (TYPE), SVDAG (SHARED), each without and with occupancy fields
//!               │                    decoded back and held against the volume
//!               │                    bytes                                              Tables 1, 3
//!               │                    the same rays through each and through ours        Table 4
//!               │                    seconds of each step, types merged in two ways     Table 5
//!               │                    reuse of nodes, growth while types are merged      Figure 6
//!               └─► boxes of 8³, 16³, 32³ and one a label                               section 5.6
//! ours and the paper's ─► some labels hidden: hierarchy built anew, or hits passed over section 5.6
//! ```
//! Rays are traced on one thread, CPU seconds; the least of some rounds in turn.

pub(crate) mod command;
mod plots;
mod rays;
mod tables;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pumice_core::{ArraySource, CompressOptions, CompressedVolume, Job, LabelBuffer, LabelType, VolumeInfo};
use pumice_encodings::{
    Encoding, EncodingTracer, Form, Reuse, Subdivision, Types, merge_in_turn, merge_on_all_cores,
};
use pumice_formats::OpenOptions;
use pumice_session::error::{Result, SessionError};
use pumice_session::file_info::acceleration_bytes;
use pumice_session::{Residence, open_volume};
use serde::Serialize;

use crate::files::{file_name, write_results};
use crate::timing::{Took, clocked};

pub use rays::{Hiding, Rates};

/// Longest side of the paper's boxes.
const SIDE: u32 = 16;
/// Sides that are compared: voxels, or one box a label.
const SIDES: [Option<u32>; 4] = [Some(8), Some(16), Some(32), None];

/// What is measured.
#[derive(Clone, Debug)]
pub struct PaperOptions {
    /// Label volume or `.pumice` file.
    pub volume: PathBuf,
    /// Labels are dealt to so many types; by default the volume's own types, or one for each label.
    pub types: Option<u32>,
    /// Labels that rays meet, in per cent.
    pub show: u32,
    /// Pixels of the rays' camera along each side.
    pub side: u32,
    /// Rounds of rays.
    pub rounds: u32,
}

/// A form's figures.
#[derive(Clone, Debug, Serialize)]
pub struct FormFigures {
    /// The form's name in the paper, or `Pumice`.
    pub name: String,
    /// Whether cells of 4³ are bit fields.
    pub with_fields: bool,
    /// Boxes of all labels.
    pub boxes: usize,
    /// Bytes of those boxes.
    pub box_bytes: u64,
    /// Bytes of the hierarchy over all of them.
    pub bvh_bytes: u64,
    /// Bytes of what is in them.
    pub tree_bytes: u64,
    /// Rays through the voxels of labels that are shown.
    pub fine: Rates,
    /// Rays that meet boxes drawn whole.
    pub coarse: Rates,
}

impl FormFigures {
    /// All bytes.
    pub fn bytes(&self) -> u64 {
        self.box_bytes + self.bvh_bytes + self.tree_bytes
    }
}

/// A step of compressing.
#[derive(Clone, Debug, Serialize)]
pub struct Step {
    /// What is done.
    pub name: &'static str,
    /// Without and with occupancy fields; the first alone where they make no difference.
    pub took: Vec<Took>,
}

/// Boxes of another size.
#[derive(Clone, Debug, Serialize)]
pub struct SideFigures {
    /// Longest side; none where boxes are not cut.
    pub side: Option<u32>,
    /// Figures of one shared graph with occupancy fields.
    pub figures: FormFigures,
}

/// Steps of merging that are told of, at most.
const STEPS_TOLD: usize = 64;

/// Bytes while types are merged one after another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// Types so far.
    pub types: usize,
    /// Boxes of those types.
    pub boxes: usize,
    /// Bytes of their octrees, of their graphs, of the one graph.
    pub bytes: [u64; 3],
}

/// All figures of a volume.
#[derive(Clone, Debug, Serialize)]
pub struct PaperTables {
    /// The volume's file name.
    pub volume: String,
    /// Voxels along x, y and z.
    pub dims: [u32; 3],
    /// Voxels that have a label.
    pub solid: u64,
    /// Labels.
    pub labels: usize,
    /// Types.
    pub types: usize,
    /// Labels that rays meet, in per cent.
    pub show: u32,
    /// Rays of the camera, and those that went on from their hits.
    pub rays: [usize; 2],
    /// The paper's forms, then ours.
    pub forms: Vec<FormFigures>,
    /// Steps of compressing, from voxels to each form.
    pub steps: Vec<Step>,
    /// Other sizes of boxes.
    pub sides: Vec<SideFigures>,
    /// Labels hidden in two ways.
    pub hiding: Vec<Hiding>,
    /// Uses of the shared graph's nodes, without and with fields.
    pub reuse: Vec<Reuse>,
    /// Bytes with occupancy fields after some steps, evenly apart, and after the last.
    pub growth: Vec<Growth>,
}

impl PaperTables {
    /// Bytes at 4 a voxel.
    pub fn bytes_raw(&self) -> u64 {
        4 * self.dims.map(u64::from).iter().product::<u64>()
    }
}

/// Measures a volume. `watch` hears what begins.
///
/// # Errors
/// What reading and rendering report; a form that is not decoded back to the volume; the job's cancellation.
pub fn measure_paper(options: &PaperOptions, job: &Job, watch: &mut dyn FnMut(&str)) -> Result<PaperTables> {
    watch("open");
    let volume = open_volume(&options.volume, &OpenOptions::default(), Residence::Copied, job)?;
    let labels = volume.labels().len();
    let types = match options.types {
        Some(count) => Types::dealt(labels, count),
        None => Types::of_volume(&volume),
    };

    watch("encode");
    let (boxes, subdividing) = clocked(|| Ok(Subdivision::new(&volume, Some(SIDE))))?;
    let mut encodings = Vec::new();
    let mut took: [Vec<Took>; 4] = Default::default();
    let mut growth = Vec::new();
    for with_fields in [false, true] {
        job.check()?;
        let (octrees, a) = clocked(|| Ok(Encoding::octrees(&boxes, with_fields)))?;
        let (per_type, b) = clocked(|| Ok(Encoding::types(&boxes, &types, with_fields)))?;
        let (in_turn, c) = clocked(|| Ok(merge_in_turn(per_type.dags(), with_fields)))?;
        job.check()?;
        let (_, d) = clocked(|| Ok(merge_on_all_cores(per_type.dags(), with_fields)))?;
        took.iter_mut().zip([a, b, c, d]).for_each(|(took, one)| took.push(one));
        if with_fields {
            growth = growth_of(&octrees, &per_type, &in_turn.growth, &types);
        }
        let Some(shared) = per_type.shared(in_turn) else { continue };
        encodings.extend([(octrees, with_fields), (per_type, with_fields), (shared, with_fields)]);
    }
    drop(boxes);
    watch("decode back");
    for (encoding, with_fields) in &encodings {
        job.check()?;
        verified(encoding, *with_fields, &volume)?;
    }
    let mut steps = vec![Step { name: "voxels of each label to boxes", took: vec![subdividing] }];
    let names = [
        "to SVOs (AABB), one core",
        "to SVDAGs (TYPE), types on all cores",
        "SVDAGs (TYPE) to SVDAG (SHARED), one core",
        "SVDAGs (TYPE) to SVDAG (SHARED), all cores",
    ];
    steps.extend(names.into_iter().zip(took).map(|(name, took)| Step { name, took }));
    steps.push(Step {
        name: "ours, from an array of voxels, all cores",
        took: vec![ours_took(&volume, job)?],
    });

    watch("rays");
    let rays = rays::Rays::new(&volume, options)?;
    let mut forms = measured_forms(&encodings, &volume, &rays, job)?;
    forms.push(ours(&volume, &rays, job)?);
    let reuse = encodings.iter().filter_map(|(e, with_fields)| {
        (e.form() == Form::DagShared).then(|| Reuse::of(e, *with_fields)).flatten()
    });
    let reuse = reuse.collect();
    let shared = encodings.pop().map(|(shared, _)| shared);
    drop(encodings);
    watch("hiding labels");
    let hiding = match &shared {
        Some(shared) => rays.hiding(shared, &volume, job)?,
        None => Vec::new(),
    };
    drop(shared);

    let mut sides = Vec::new();
    for side in SIDES {
        watch(&side.map_or("one box a label".into(), |s| format!("boxes of {s}³")));
        job.check()?;
        let boxes = Subdivision::new(&volume, side);
        let per_type = Encoding::types(&boxes, &types, true);
        drop(boxes);
        let Some(shared) = per_type.shared(merge_on_all_cores(per_type.dags(), true)) else { continue };
        drop(per_type);
        verified(&shared, true, &volume)?;
        let figures = measured_forms(&[(shared, true)], &volume, &rays, job)?;
        sides.extend(figures.into_iter().map(|figures| SideFigures { side, figures }));
    }
    Ok(PaperTables {
        volume: file_name(&options.volume),
        dims: volume.info().dims,
        solid: volume.labels().voxels().iter().sum(),
        labels,
        types: types.count(),
        show: options.show,
        rays: rays.counts(),
        forms,
        steps,
        sides,
        hiding,
        reuse,
        growth,
    })
}

fn verified(encoding: &Encoding, with_fields: bool, volume: &CompressedVolume) -> Result<()> {
    encoding.verify(volume).map_err(|wrong| {
        SessionError::Caller(format!(
            "{}{}: voxel {:?}: expected label {}, got {} (dense indices and 1, 0 for none)",
            encoding.form().name(),
            if with_fields { " with fields" } else { "" },
            wrong.voxel,
            wrong.expected,
            wrong.got
        ))
    })
}

fn growth_of(octrees: &Encoding, per_type: &Encoding, shared: &[usize], types: &Types) -> Vec<Growth> {
    let mut of_type = vec![(0, 0); types.count()];
    for (b, bytes) in octrees.boxes().iter().zip(octrees.own_tree_bytes().unwrap_or_default()) {
        let (boxes, octrees) = &mut of_type[types.of(b.label)];
        (*boxes, *octrees) = (*boxes + 1, *octrees + bytes);
    }
    let mut sum = Growth { types: 0, boxes: 0, bytes: [0; 3] };
    let grown = of_type.iter().zip(per_type.dags()).zip(shared).map(|((&(boxes, octrees), dag), &nodes)| {
        let [a, b, _] = sum.bytes;
        let bytes = [a + octrees, b + dag.bytes(), 32 * nodes as u64];
        sum = Growth { types: sum.types + 1, boxes: sum.boxes + boxes, bytes };
        sum
    });
    let mut grown: Vec<Growth> = grown.collect();
    let step = grown.len().div_ceil(STEPS_TOLD).max(1);
    let last = grown.len().saturating_sub(1);
    let mut place = 0..;
    grown.retain(|_| place.next().is_some_and(|i: usize| (last - i).is_multiple_of(step)));
    grown
}

/// Our own compression, from an array of the same voxels.
fn ours_took(volume: &CompressedVolume, job: &Job) -> Result<Took> {
    let dims = volume.info().dims;
    let dense = LabelBuffer::U32(volume.decode_block([0; 3], dims)?);
    let mut source = ArraySource::new(VolumeInfo::new(dims, LabelType::U32), dense)?;
    let (_, took) = clocked(|| Ok(pumice_core::compress(&mut source, &CompressOptions::default(), job)?))?;
    Ok(took)
}

fn measured_forms(
    encodings: &[(Encoding, bool)],
    volume: &Arc<CompressedVolume>,
    rays: &rays::Rays,
    job: &Job,
) -> Result<Vec<FormFigures>> {
    let place = volume.info().world_from_index;
    let all = vec![true; volume.labels().len()];
    let tracer = |e| EncodingTracer::new(e, place, &rays.visible);
    let fine = encodings.iter().map(|(e, _)| tracer(e)).collect::<std::result::Result<Vec<_>, _>>()?;
    let coarse = encodings.iter().map(|(e, _)| Ok(tracer(e)?.coarse(true)));
    let coarse = coarse.collect::<std::result::Result<Vec<_>, pumice_transport::RenderError>>()?;
    let (fine, coarse) = (rays.rates(&fine, job)?, rays.rates(&coarse, job)?);
    let mut figures = Vec::new();
    for ((e, with_fields), (fine, coarse)) in encodings.iter().zip(fine.into_iter().zip(coarse)) {
        figures.push(FormFigures {
            name: e.form().name().into(),
            with_fields: *with_fields,
            boxes: e.boxes().len(),
            box_bytes: e.box_bytes(),
            bvh_bytes: EncodingTracer::new(e, place, &all)?.bvh_bytes(),
            tree_bytes: e.tree_bytes(),
            fine,
            coarse,
        });
    }
    Ok(figures)
}

fn ours(volume: &Arc<CompressedVolume>, rays: &rays::Rays, job: &Job) -> Result<FormFigures> {
    let [fine, coarse] = rays.ours(volume, job)?;
    // What the paper's forms have too: labels' ids and names are left out.
    let parts = volume.resident_parts();
    let of = |names: &[&str]| parts.iter().filter(|p| names.contains(&p.0)).map(|p| p.1).sum();
    Ok(FormFigures {
        name: "Pumice".into(),
        with_fields: true,
        boxes: volume.boxes().len(),
        box_bytes: of(&["boxes"]),
        bvh_bytes: acceleration_bytes(volume)?,
        tree_bytes: of(&["nodes", "leaves"]),
        fine,
        coarse,
    })
}

/// Writes `paper.csv`, `paper.md` and two SVGs for each volume into `folder`, made if absent. `machine` is a line on what it ran.
///
/// # Errors
/// When the folder cannot be written or there is nothing to plot.
pub fn write_paper(folder: &Path, machine: &str, volumes: &[PaperTables]) -> Result<()> {
    let mut files = vec![
        ("paper.csv".into(), tables::csv(volumes)),
        ("paper.md".into(), tables::markdown(machine, volumes)),
    ];
    for volume in volumes {
        files.extend(plots::svgs(volume).map_err(SessionError::Caller)?);
    }
    write_results(folder, files)
}

//! `pumice bench paper`: the tables and figures of the paper for one volume, with Pumice's own form beside the paper's encodings.
//!
//! ```text
//! volume ─► the paper's boxes ─► SVOs (AABB), SVDAGs (TYPE), SVDAG (SHARED), each without and with occupancy fields
//!               │                    decoded and compared with the volume
//!               │                    bytes                                              Tables 1, 3
//!               │                    the same rays through each and through Pumice's    Table 4
//!               │                    seconds of each step, types merged in two ways     Table 5
//!               │                    reuse of nodes, growth while types are merged      Figure 6
//!               └─► boxes of 8³, 16³, 32³ and one per label                             section 5.6
//! both ─► some labels hidden: by a rebuilt hierarchy, or by skipping their boxes        section 5.6
//! ```
//! Rays are traced on one thread and timed in CPU seconds. Of several rounds, in which the forms take turns, the fastest counts.

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

/// Largest side of the paper's boxes in voxels.
const SIDE: u32 = 16;
/// Largest sides of boxes that are compared, in voxels; `None` is one box per label.
const SIDES: [Option<u32>; 4] = [Some(8), Some(16), Some(32), None];

/// Options of [`measure_paper`].
#[derive(Clone, Debug)]
pub struct PaperOptions {
    /// Label volume or `.pumice` file.
    pub volume: PathBuf,
    /// Number of types to which labels are assigned round robin; `None`: the volume's own types, or one for each label.
    pub types: Option<u32>,
    /// Share of the labels that rays meet, in per cent.
    pub show: u32,
    /// Pixels of the camera along each side.
    pub side: u32,
    /// Rounds of rays, of which the fastest counts.
    pub rounds: u32,
}

/// Measurements of one form.
#[derive(Clone, Debug, Serialize)]
pub struct FormFigures {
    /// The form's name in the paper, or `Pumice`.
    pub name: String,
    /// Whether cells of 4³ voxels are stored as occupancy fields.
    pub with_fields: bool,
    /// Number of boxes of all labels.
    pub boxes: usize,
    /// Bytes of the box records.
    pub box_bytes: u64,
    /// Bytes of the hierarchy over all boxes.
    pub bvh_bytes: u64,
    /// Bytes of the octrees or graphs within the boxes.
    pub tree_bytes: u64,
    /// Rays through the voxels of the shown labels.
    pub fine: Rates,
    /// Rays through boxes that are drawn solid.
    pub coarse: Rates,
}

impl FormFigures {
    /// Bytes of boxes, hierarchy and trees together.
    pub fn bytes(&self) -> u64 {
        self.box_bytes + self.bvh_bytes + self.tree_bytes
    }
}

/// Time of one step of compressing.
#[derive(Clone, Debug, Serialize)]
pub struct TimedStep {
    /// Description of the step.
    pub name: &'static str,
    /// Times without and with occupancy fields; only one if the step does not depend on them.
    pub took: Vec<Took>,
}

/// Measurements with one size of boxes.
#[derive(Clone, Debug, Serialize)]
pub struct SideFigures {
    /// Largest side of a box in voxels; `None` for one box per label.
    pub side: Option<u32>,
    /// Measurements of SVDAG (SHARED) with occupancy fields.
    pub figures: FormFigures,
}

/// Largest number of [`Growth`] entries that are reported.
const STEPS_TOLD: usize = 64;

/// Bytes after some types have been merged one after another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// Number of types merged so far.
    pub types: usize,
    /// Number of boxes of those types.
    pub boxes: usize,
    /// Bytes of their octrees, of their separate graphs, and of the merged graph.
    pub bytes: [u64; 3],
}

/// All measurements of a volume.
#[derive(Clone, Debug, Serialize)]
pub struct PaperTables {
    /// The volume's file name.
    pub volume: String,
    /// Voxels along x, y and z.
    pub dims: [u32; 3],
    /// Number of voxels that have a label.
    pub solid: u64,
    /// Number of labels.
    pub labels: usize,
    /// Number of types.
    pub types: usize,
    /// Share of the labels that rays meet, in per cent.
    pub show: u32,
    /// Number of camera rays, and of diffuse rays from their hits.
    pub rays: [usize; 2],
    /// Measurements of the paper's forms, then of Pumice's.
    pub forms: Vec<FormFigures>,
    /// Steps of compressing, from voxels to each form.
    pub steps: Vec<TimedStep>,
    /// Measurements with several sizes of boxes.
    pub sides: Vec<SideFigures>,
    /// Rates with labels hidden in two ways.
    pub hiding: Vec<Hiding>,
    /// Reference counts of the shared graph's nodes, without and with occupancy fields.
    pub reuse: Vec<Reuse>,
    /// Bytes with occupancy fields, at evenly spaced steps of merging and after the last one.
    pub growth: Vec<Growth>,
}

impl PaperTables {
    /// Bytes of the volume at 4 bytes per voxel.
    pub fn bytes_raw(&self) -> u64 {
        4 * self.dims.map(u64::from).iter().product::<u64>()
    }
}

/// Measures a volume. `watch` is called with a line of text when a step begins.
///
/// # Errors
/// Errors of reading and rendering; a form that does not decode to the volume; the job's cancellation.
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
    let mut steps = vec![TimedStep { name: "voxels of each label to boxes", took: vec![subdividing] }];
    let names = [
        "to SVOs (AABB), one core",
        "to SVDAGs (TYPE), types on all cores",
        "SVDAGs (TYPE) to SVDAG (SHARED), one core",
        "SVDAGs (TYPE) to SVDAG (SHARED), all cores",
    ];
    steps.extend(names.into_iter().zip(took).map(|(name, took)| TimedStep { name, took }));
    steps.push(TimedStep {
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

/// Time of Pumice's own compression, from an array of the same voxels.
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
    // Counts only parts that the paper's forms have too, so ids and names of labels are left out.
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

/// Writes `paper.csv`, `paper.md` and two SVGs for each volume into `folder`, which is created if missing. `machine` is a line that
/// describes the machine.
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

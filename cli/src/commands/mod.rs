//! The subcommands, one file each.

pub(crate) mod bench;
pub(crate) mod compare;
pub(crate) mod compress;
pub(crate) mod decompress;
pub(crate) mod demo;
pub(crate) mod devices;
pub(crate) mod export;
pub(crate) mod info;
mod label_list;
pub(crate) mod merge;
pub(crate) mod pick;
pub(crate) mod render;
pub(crate) mod table;
pub(crate) mod verify;
pub(crate) mod verify_render;

use pumice_core::Outputs;
use pumice_session::{Job, MissingChunks, OpenOptions, RawLayout, Recorded, Warnings};

use crate::args::{Missing, Reading};
use crate::failure::warn_at_work;

/// Converts the flags on reading to the options that the readers of `pumice-formats` take. What a reader finds odd, or assumes, is printed to
/// standard error as soon as it is known.
fn open_options(reading: &Reading, job: &Job) -> OpenOptions {
    OpenOptions {
        layer: reading.layer,
        time: reading.time_step,
        channel: reading.channel,
        array: reading.array.clone(),
        spacing: reading.spacing,
        axes: reading.axes,
        raw: match (reading.raw_dims, reading.raw_type) {
            (Some(dims), Some(label_type)) => Some(RawLayout {
                dims,
                label_type,
                big_endian: reading.raw_big_endian,
                offset: reading.raw_offset,
            }),
            _ => None,
        },
        scale: reading.scale,
        roi: reading.roi,
        label: reading.label.clone(),
        dataset: reading.dataset.clone(),
        missing_chunks: reading.missing_chunks.map(|missing| match missing {
            Missing::Fill => MissingChunks::Fill,
            Missing::Error => MissingChunks::Error,
        }),
        relabel: reading.relabel.clone(),
        warnings: Warnings::told_to(|line| warn_at_work(format_args!("warning: {line}"))),
        outputs: Outputs::default(),
        recorded: Recorded::default(),
        cancelled: job.cancel_flag(),
    }
}

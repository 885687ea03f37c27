//! `pumice info`

use std::sync::Arc;

use pumice_session::{FileInfo, Job, file_info, parse_query, shown_info};

use super::{label_list, open_options};
use crate::Answer;
use crate::args::Info;
use crate::failure::{Failure, print, say};

pub(crate) fn run(args: &Info, job: &Arc<Job>) -> Result<Answer, Failure> {
    if args.list.labels {
        label_list::print(&args.file, &args.list, &open_options(&args.reading, job), job)?;
        return Ok(Answer::Yes);
    }
    let reading = open_options(&args.reading, job);
    let info = match &args.list.query {
        Some(query) => shown_info(&args.file, &parse_query(query)?, &reading, job)?,
        None => file_info(&args.file, &reading, job)?,
    };
    if args.json {
        print(&serde_json::to_string_pretty(&info)?)?;
        return Ok(Answer::Yes);
    }
    match info {
        FileInfo::Pumice(p) => {
            let percent = |bytes: u64| 100.0 * bytes as f64 / p.bytes_raw.max(1) as f64;
            say("format     Pumice")?;
            if let (Some(step), Some(steps)) = (p.time_step, p.time_steps) {
                say(format_args!("time       step {step} of {steps}, counted from 0"))?;
            }
            placement(p.dims, p.spacing, &p.unit, &p.frame, &p.label_type)?;
            orientation(p.orientation.as_deref())?;
            say(format_args!(
                "labels     {} in {} types, {} touching pairs",
                p.labels, p.types, p.touching_pairs
            ))?;
            say(format_args!("boxes      {} over {} leaf patterns", p.boxes, p.leaf_patterns))?;
            say(format_args!("raw        {:>14} bytes at 4 a voxel", p.bytes_raw))?;
            say(format_args!("disk       {:>14} bytes  {:6.3} %", p.bytes_disk, percent(p.bytes_disk)))?;
            say(format_args!(
                "volume     {:>14} bytes  {:6.3} %  in memory",
                p.bytes_volume,
                percent(p.bytes_volume)
            ))?;
            say(format_args!(
                "memory     {:>14} bytes  {:6.3} %  with what rays need of all labels (bricks, acceleration)",
                p.bytes_resident,
                percent(p.bytes_resident)
            ))?;
            for (name, bytes) in &p.resident_parts {
                say(format_args!("  {name:12} {bytes:>10} bytes  {:6.3} %", percent(*bytes)))?;
            }
            if let Some(shown) = &p.shown {
                say(format_args!(
                    "shown      {:>14} bytes  {:6.3} %  in memory, of {} labels alone, with what rays need of them",
                    shown.bytes_resident,
                    percent(shown.bytes_resident),
                    shown.labels
                ))?;
                for (name, bytes) in &shown.resident_parts {
                    say(format_args!("  {name:12} {bytes:>10} bytes  {:6.3} %", percent(*bytes)))?;
                }
            }
            say(format_args!("hash       {}", p.content_hash))?;
        }
        FileInfo::Series(s) => {
            let percent = |bytes: u64| 100.0 * bytes as f64 / s.bytes_raw.max(1) as f64;
            say("format     Pumice")?;
            say(format_args!("time       {} steps, 0 to {}", s.time_steps, s.time_steps - 1))?;
            placement(s.dims, s.spacing, &s.unit, &s.frame, &s.label_type)?;
            orientation(s.orientation.as_deref())?;
            say(format_args!(
                "labels     {} in {} types, {} touching pairs, over all steps",
                s.labels, s.types, s.touching_pairs
            ))?;
            say(format_args!("boxes      {}", s.boxes))?;
            say(format_args!("raw        {:>14} bytes at 4 a voxel", s.bytes_raw))?;
            say(format_args!("disk       {:>14} bytes  {:6.3} %", s.bytes_disk, percent(s.bytes_disk)))?;
            for (name, bytes) in &s.stored_parts {
                say(format_args!("  {name:12} {bytes:>10} bytes  {:6.3} %", percent(*bytes)))?;
            }
            say(format_args!("hash       {}", s.content_hash))?;
            say("one step   --time-step N")?;
        }
        FileInfo::Source(s) => {
            say(format_args!("format     {}, {}", s.format, s.encoding))?;
            placement(s.dims, s.spacing, &s.unit, &s.frame, &s.label_type)?;
            orientation(s.orientation.as_deref())?;
            for row in s.world_from_centre {
                say(format_args!(
                    "affine     {:12.6} {:12.6} {:12.6} {:14.6}",
                    row[0], row[1], row[2], row[3]
                ))?;
            }
            say(format_args!("raw        {:>14} bytes in the file's own type", s.bytes_uncompressed))?;
            say(format_args!("memory     {:>14} bytes expected while it is compressed", s.bytes_expected))?;
            if s.named_labels > 0 {
                say(format_args!("names      {} labels have a name or a colour", s.named_labels))?;
            }
            for (i, layer) in s.layers.iter().enumerate() {
                say(format_args!("layer {i}    {}", layer.join(", ")))?;
            }
            for open in &s.choices {
                let assumed =
                    open.assumed.map_or_else(String::new, |answer| format!("; {answer} is assumed"));
                say(format_args!(
                    "open       {}; choose one with {} ({}){assumed}",
                    open.what, open.option, open.listed
                ))?;
            }
        }
    }
    Ok(Answer::Yes)
}

/// The line of the directions in which x, y and z run, where the file says them.
fn orientation(letters: Option<&str>) -> Result<(), Failure> {
    letters.map_or(Ok(()), |letters| {
        say(format_args!("axes       {letters}: x, y and z run to {}", directions(letters)))
    })
}

/// The words of letters such as RAS.
fn directions(letters: &str) -> String {
    let word = |letter| match letter {
        'R' => "right",
        'L' => "left",
        'A' => "anterior",
        'P' => "posterior",
        'S' => "superior",
        _ => "inferior",
    };
    letters.chars().map(word).collect::<Vec<_>>().join(", ")
}

fn placement(
    dims: [u32; 3],
    spacing: [f64; 3],
    unit: &str,
    frame: &str,
    label_type: &str,
) -> Result<(), Failure> {
    say(format_args!("dims       {} × {} × {} voxels of {label_type}", dims[0], dims[1], dims[2]))?;
    say(format_args!(
        "spacing    {} × {} × {} (unit {unit}), world axes {frame}",
        spacing[0], spacing[1], spacing[2]
    ))
}

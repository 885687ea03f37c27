//! `pumice pick`

use std::sync::Arc;

use pumice_session::{Job, PickedPixel, pick_pixels};

use crate::Answer;
use crate::args::Pick;
use crate::failure::{Failure, print, say, warn};

pub(crate) fn run(args: &Pick, job: &Arc<Job>) -> Result<Answer, Failure> {
    let picked = pick_pixels(&args.picture, &args.pixels, job)?;
    if args.json {
        print(&serde_json::to_string_pretty(&picked)?)?;
        return Ok(Answer::Yes);
    }
    for pixel in &picked.pixels {
        say(line(pixel))?;
    }
    picked.notices.iter().try_for_each(warn)?;
    Ok(Answer::Yes)
}

/// One line about a pixel.
fn line(pixel: &PickedPixel) -> String {
    let mut line = format!("{},{}: ", pixel.x, pixel.y);
    match (pixel.label, pixel.depth) {
        (Some(id), _) => line += &format!("label {id}"),
        (None, Some(_)) => line += "no label, a mesh",
        (None, None) => line += "no label",
    }
    if let Some(name) = pixel.name.as_ref().filter(|name| !name.is_empty()) {
        line += &format!(" {name:?}");
    }
    if let Some(label_type) = pixel.label_type.as_ref().filter(|t| !t.is_empty()) {
        line += &format!(", type {label_type:?}");
    }
    if let Some(instance) = pixel.instance {
        line += &format!(", instance {instance}");
    }
    if let Some([x, y, z]) = pixel.voxel {
        line += &format!(", voxel {x},{y},{z}");
    }
    if let Some([x, y, z]) = pixel.position {
        line += &format!(", position {x},{y},{z}");
    }
    if let Some(depth) = pixel.depth {
        line += &format!(", depth {depth}");
    }
    line
}

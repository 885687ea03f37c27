//! The camera of a figure: it sees everything that is framed, at the distance of the flags or as near as a window of the picture allows, beside the
//! legend where there is one, and in every picture of a turntable.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};
use pumice_scene::Camera;

use super::FigureOptions;
use super::framing::{FrameOn, Framing, Outermost, toward_camera};
use super::window::{Seen, Window, free_windows};

/// Shows points to its argument.
type Points<'a> = dyn Fn(&mut dyn Outermost) + 'a;

/// The camera of a figure that shows `points`, of which `bounds` are corners.
pub(super) fn camera(options: &FigureOptions, points: &Points<'_>, bounds: &[DVec3]) -> Camera {
    let whole = camera_within(&Window::WHOLE, options, points, bounds);
    let reach = match options.legend {
        Some(reach) if options.distance.is_none() && options.frame == FrameOn::Labels => reach,
        _ => return whole,
    };

    // Nothing is nearer than what fills the whole picture.
    let frames = options.turntable.unwrap_or(1);
    let clears = |frame: u32| {
        let turn = DAffine3::from_rotation_z(turn_rad(frame, frames));
        let camera = Camera { world_from_camera: turn * whole.world_from_camera, ..whole };
        let mut seen = Seen::new(&camera, options.size);
        match options.turntable {
            Some(_) => bounds.iter().for_each(|&p| seen.include(p)),
            None => points(&mut seen),
        }
        seen.clears(reach)
    };
    if (0..frames).all(clears) {
        return whole;
    }
    let free = free_windows(options.size, reach);
    let cameras = free.iter().map(|window| camera_within(window, options, points, bounds));
    let back =
        |camera: &Camera| camera.world_from_camera.translation.dot(camera.world_from_camera.matrix3.z_axis);
    cameras.min_by(|a, b| back(a).total_cmp(&back(b))).unwrap_or(whole)
}

/// The camera that shows the points within a window.
fn camera_within(window: &Window, options: &FigureOptions, points: &Points<'_>, bounds: &[DVec3]) -> Camera {
    let framing = |view_deg| Framing::new(toward_camera(view_deg), options.size, window);
    let mut of_first = framing(options.view_deg);
    let of_turn = |frames: u32| {
        // All pictures have one distance, at which each sees everything.
        let at = |frame: u32| {
            let around = turn_rad(frame, frames).to_degrees();
            let mut framing = framing([options.view_deg[0] + around, options.view_deg[1]]);
            bounds.iter().for_each(|&corner| framing.include(corner));
            framing.centred_distance()
        };
        (0..frames).map(at).fold(0.0, f64::max)
    };
    match (options.distance, options.turntable) {
        (Some(distance), _) => of_first.centred_camera(distance),
        (None, Some(frames)) => of_first.centred_camera(of_turn(frames)),
        (None, None) => {
            points(&mut of_first);
            of_first.camera()
        }
    }
}

/// How far the camera of a picture has gone around in a turntable of so many.
pub(super) fn turn_rad(frame: u32, frames: u32) -> f64 {
    TAU * f64::from(frame) / f64::from(frames)
}

//! Volumes far away, tiny, huge, squeezed, mirrored, sheared. Each is rendered twice: a white body under a constant sky of 1, whose pixels
//! are 1 after any number of bounces (white furnace); and a room with walls one voxel thick, seen from inside, which no light may enter.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::CompressedVolume;
use pumice_oracle::volumes::{blobs, volume};
use pumice_scene::{Projection, Scene};
use pumice_session::error::Result;

use super::Case;
use super::pictures::{Studio, from_above, lambert, sky, worst};

/// Enough bounces that every path has left the space between the bodies.
const FURNACE_BOUNCES: u32 = 1024;
/// Number of bounces, each of which might find a gap in a wall.
const ROOM_BOUNCES: u32 = 32;

pub(super) fn measure(studio: &mut Studio<'_>, tell: &mut dyn FnMut(Case) -> Result<()>) -> Result<()> {
    let (_, bodies) = blobs([24, 24, 24], 9, 4, 11);
    let (_, room) = volume([20, 20, 20], |x, y, z| u32::from([x, y, z].iter().any(|&v| v == 2 || v == 17)));
    for (name, place) in places() {
        let error = worst(&studio.expose(&furnace(&place), &bodies, 4)?, 1.0);
        let (unit, reason) = ("largest relative error of a pixel", "1,024 products in f32, 6e-8 each");
        tell(Case::new("placements", format!("white furnace, {name}"), error, unit, 6.2e-5, reason))?;
        let leaked = leak(studio, &dark_room(&place), &room)?;
        let (unit, reason) = ("largest value of a pixel", "no ray may pass a wall");
        tell(Case::new("placements", format!("dark room, {name}"), leaked, unit, 0.0, reason))?;
    }
    Ok(())
}

fn leak(studio: &mut Studio<'_>, scene: &Scene, room: &Arc<CompressedVolume>) -> Result<f64> {
    let pixels = studio.expose(scene, room, 16)?;
    Ok(pixels.iter().flatten().fold(0.0, |m, &v| f64::from(v).max(m)))
}

fn places() -> Vec<(&'static str, DAffine3)> {
    let diagonal = |x, y, z| DMat3::from_diagonal(DVec3::new(x, y, z));
    let sheared = DMat3::from_cols_array(&[1.0, 0.2, 0.0, -0.3, 1.1, 0.1, 0.4, 0.0, 0.9]);
    let turned = DMat3::from_rotation_x(0.7) * DMat3::from_rotation_z(2.1) * diagonal(16.0, 16.0, 40.0);
    let placed = |matrix3, x: f64| DAffine3 { matrix3, translation: DVec3::new(x, -x, 0.5 * x) };
    vec![
        ("in place", DAffine3::IDENTITY),
        ("turned, 16 : 16 : 40", placed(turned, 3.7)),
        ("1e6 voxels away", placed(DMat3::IDENTITY, 1e6 + 0.3)),
        ("1e9 voxels away", placed(DMat3::IDENTITY, 1e9 + 0.3)),
        ("spacing 1e-9", placed(DMat3::IDENTITY * 1e-9, 0.0)),
        ("spacing 1e6", placed(DMat3::IDENTITY * 1e6, 1e7)),
        ("spacing 1 : 1000", placed(diagonal(1.0, 1.0, 1000.0), 5.0)),
        ("spacing 1000 : 1", placed(diagonal(1000.0, 1000.0, 1.0), 5.0)),
        ("mirrored", placed(diagonal(-1.0, 1.0, 1.0), 0.0)),
        ("sheared", placed(sheared, 2.0)),
    ]
}

/// Places the volume, and a camera at `eye_in_index` that looks at `at_in_index`.
fn look(scene: &mut Scene, place: &DAffine3, eye_in_index: DVec3, at_in_index: DVec3) {
    let (eye, at) = (place.transform_point3(eye_in_index), place.transform_point3(at_in_index));
    let back = (eye - at).normalize();
    let right = back.any_orthonormal_vector();
    let matrix3 = DMat3::from_cols(right, back.cross(right), back);
    scene.camera.world_from_camera = DAffine3 { matrix3, translation: eye };
    scene.instances[0].world_from_index = *place;
}

fn furnace(place: &DAffine3) -> Scene {
    let mut scene = from_above(lambert(1.0), sky(1.0), [0.0; 2], 1.0);
    scene.camera.projection = Projection::Perspective { fov_rad: 0.3 };
    look(&mut scene, place, DVec3::new(60.0, 50.0, 70.0), DVec3::splat(12.0));
    scene.settings.bounces = FURNACE_BOUNCES;
    scene
}

fn dark_room(place: &DAffine3) -> Scene {
    let mut scene = from_above(lambert(1.0), sky(1.0), [0.0; 2], 1.0);
    scene.camera.projection = Projection::Perspective { fov_rad: 2.0 };
    look(&mut scene, place, DVec3::new(9.3, 10.2, 11.1), DVec3::new(3.1, 3.3, 3.2));
    scene.settings.bounces = ROOM_BOUNCES;
    scene.settings.russian_roulette = false;
    scene
}

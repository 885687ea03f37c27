//! Scenes that must be refused with an error text of one line instead of being rendered.

use glam::DMat3;
use pumice_oracle::volumes::volume;
use pumice_picture::{Image, Passes, write_exr};
use pumice_scene::{Environment, Scene, Sun};
use pumice_session::error::Result;

use super::Case;
use super::pictures::{Studio, from_above, lambert, plain, sky};
use crate::files::scratch;

pub(super) fn measure(studio: &mut Studio<'_>, tell: &mut dyn FnMut(Case) -> Result<()>) -> Result<()> {
    let (_, floor) = volume([16, 16, 4], |_, _, z| u32::from(z < 2));
    let folder = scratch()?;
    let base = || from_above(lambert(0.5), sky(1.0), [8.0, 8.0], 3.0);
    let mut scenes: Vec<(&str, Scene)> = Vec::new();
    for (name, value) in
        [("not a number in a sky's picture", f32::NAN), ("infinity in a sky's picture", f32::INFINITY)]
    {
        let path = folder.path().join(format!("{}.exr", scenes.len()));
        let mut pixels = vec![[1.0f32; 3]; 32];
        pixels[9] = [value; 3];
        write_exr(&path, &plain(Image::new(8, 4, pixels)), &Passes::NONE)?;
        let mut scene = base();
        scene.world.environment = Environment::Image { path, rotation_rad: 0.0, strength: 1.0 };
        scenes.push((name, scene));
    }
    let mut flat = base();
    flat.instances[0].world_from_index.matrix3 = DMat3::from_diagonal([1.0, 0.0, 1.0].into());
    scenes.push(("a scale of 0", flat));
    let mut nowhere = base();
    nowhere.instances[0].world_from_index.translation.x = f64::NAN;
    scenes.push(("a place that is not a number", nowhere));
    let mut needle = base();
    let direction = [0.0, 0.0, -1.0];
    needle.suns = vec![Sun { direction, strength: 1.0, color: [1.0; 3], angle_rad: 1e-20 }];
    scenes.push(("a sun whose radiance overflows", needle));
    for (name, scene) in scenes {
        let (error, note) = match studio.draw(&scene, &floor, 1) {
            Ok(_) => (1.0, Some("it was drawn".to_owned())),
            Err(e) => {
                let line = e.to_string();
                (if line.contains('\n') { 1.0 } else { 0.0 }, Some(line))
            }
        };
        let (unit, reason) = ("0 refused, 1 drawn", "one line, and no picture");
        tell(Case { note, ..Case::new("refusals", name, error, unit, 0.0, reason) })?;
    }
    Ok(())
}

//! Suns, skies, materials, path depths and camera positions for which the picture is known.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::CompressedVolume;
use pumice_oracle::volumes::{noise, volume};
use pumice_picture::{Image, Passes, write_exr};
use pumice_scene::{Environment, Film, Filter, Material, Mode, Projection, Scene, Sun};
use pumice_session::error::Result;

use super::Case;
use super::pictures::{Studio, from_above, lambert, mean, mean_off, plain, sky, surely_gained, worst};
use crate::files::scratch;

type Tell<'a> = dyn FnMut(Case) -> Result<()> + 'a;

const FEW_PRODUCTS: &str = "a handful of products in f32";

fn case(name: &str, error: f64, unit: &'static str, bar: f64, reason: &'static str) -> Case {
    Case::new("light", name, error, unit, bar, reason)
}

pub(super) fn measure(studio: &mut Studio<'_>, tell: &mut Tell<'_>) -> Result<()> {
    let (_, floor) = volume([16, 16, 4], |_, _, z| u32::from(z < 2));
    let (_, sponge) = noise([24, 24, 24], 0.3, 3, 12);
    suns(studio, &floor, tell)?;
    bright_pixel(studio, &floor, tell)?;
    materials(studio, &floor, tell)?;
    depths(studio, &sponge, tell)?;
    views(studio, &floor, tell)
}

fn on_floor(material: Material, environment: Environment) -> Scene {
    let mut scene = from_above(material, environment, [8.0, 8.0], 3.0);
    scene.settings.mode = Mode::OneBounce;
    scene
}

/// The irradiance of a small sun is strength × cosine, and the floor's radiance albedo / π of it.
fn suns(studio: &mut Studio<'_>, floor: &Arc<CompressedVolume>, tell: &mut Tell<'_>) -> Result<()> {
    for (name, strength, angle_rad, tilt) in [
        ("a sun of one direction", 3.0, 0.0, 0.6f64),
        ("a sun 1e-7 rad wide", 3.0, 1e-7, 0.6),
        ("a sun of strength 1e8", 1e8, 0.0, 0.0),
        ("a sun 1e-3 rad above the floor", 3.0, 0.0, PI / 2.0 - 1e-3),
    ] {
        let mut scene = on_floor(lambert(0.6), sky(0.0));
        let direction = [tilt.sin(), 0.0, -tilt.cos()];
        scene.suns = vec![Sun { direction, strength, color: [1.0; 3], angle_rad }];
        let expected = 0.6 / PI * f64::from(strength) * tilt.cos();
        let error = worst(&studio.expose(&scene, floor, 2)?, expected);
        // A cosine of 1e-3, from a direction with f32 components, has a relative error of 6e-8 / 1e-3.
        let (bar, reason) = match name.contains("above") {
            true => (1e-4, "a cosine of 1e-3, rounded to 6e-8"),
            false => (5e-6, FEW_PRODUCTS),
        };
        tell(case(name, error, "largest relative error of a pixel", bar, reason))?;
    }
    Ok(())
}

/// One pixel of a sky image has 1e8, all others 0. The sky is interpolated between pixels, so the pixel becomes a tent two pixels wide along
/// each axis, and irradiance = L·Δφ·Δθ·½ sin 2θ·(sin Δθ / Δθ)² with θ at the pixel's middle.
fn bright_pixel(studio: &mut Studio<'_>, floor: &Arc<CompressedVolume>, tell: &mut Tell<'_>) -> Result<()> {
    let (width, height, row) = (256usize, 128usize, 20usize);
    let mut pixels = vec![[0.0f32; 3]; width * height];
    pixels[row * width + 77] = [1e8; 3];
    let folder = scratch()?;
    let path = folder.path().join("sky.exr");
    let picture = plain(Image::new(width, height, pixels));
    write_exr(&path, &picture, &Passes::NONE)?;
    let scene = on_floor(lambert(0.5), Environment::Image { path, rotation_rad: 0.0, strength: 1.0 });
    let (across, down) = (2.0 * PI / width as f64, PI / height as f64);
    let middle = (row as f64 + 0.5) * down;
    let irradiance = 1e8 * across * down * (2.0 * middle).sin() / 2.0 * (down.sin() / down).powi(2);
    let off = mean_off(&studio.expose(&scene, floor, 512)?, 0.5 / PI * irradiance).abs();
    // With uniform samples of the tent σ is 1.7 of the mean, of which 144 pixels × 512 samples leave 0.64 %.
    let reason = "two standard errors of even samples of the tent";
    tell(case("1e8 in one pixel of the sky's picture", off, "relative error of the mean", 1.3e-2, reason))
}

/// Under a constant sky of radiance 1 no surface may be brighter than 1.
fn materials(studio: &mut Studio<'_>, floor: &Arc<CompressedVolume>, tell: &mut Tell<'_>) -> Result<()> {
    for metallic in [0.0, 1.0] {
        for roughness in [0.0, 1e-4, 1.0] {
            for ior in [1.0, 1.0001, 3.0] {
                let material =
                    Material { base_color: [1.0; 3], metallic, roughness, ior, ..Material::default() };
                let mut scene = on_floor(material, sky(1.0));
                scene.camera.projection = Projection::Orthographic { scale: 1.0 };
                let gained = mean_off(&studio.expose(&scene, floor, 16)?, 1.0).max(0.0);
                let name = format!("metallic {metallic}, roughness {roughness}, IOR {ior}, white");
                // Stratified samples of a weight between 0 and 2: the noise is below 5e-3 for 144 pixels × 16 samples.
                let reason = "no surface gives more light than it gets; noise";
                tell(case(&name, gained, "energy gained", 5e-3, reason))?;
            }
        }
    }
    covers_and_glass(studio, floor, tell)
}

/// Coats and fibres over white: light that they do not reflect is reflected below them, so each pixel is 1 under a constant sky of 1. Rough
/// glass loses light that it refracts to the wrong side (docs/materials.md), but must not gain any.
fn covers_and_glass(
    studio: &mut Studio<'_>,
    floor: &Arc<CompressedVolume>,
    tell: &mut Tell<'_>,
) -> Result<()> {
    let mut look = |name: String, material: Material| {
        let mut scene = from_above(material, sky(1.0), [8.0, 8.0], 1.0);
        scene.settings.bounces = 256;
        let pixels = studio.expose(&scene, floor, 128)?;
        // A lobe that reflects next to nothing is still chosen once in ten times: σ is 0.33, of which 144 pixels × 128 samples leave 0.25 %.
        // The rest of the bar is for linear interpolation between table entries. In rough glass of a high IOR few paths carry weights of
        // hundreds: single means of these samples lie between 0.8 and 2.6, so what they surely gained is judged.
        let (unit, off, reason) = match material.transmission > 0.0 {
            true => {
                let gained = surely_gained(&pixels, 1.0);
                (
                    "energy gained",
                    gained,
                    "no surface gives more light than it gets; four standard errors off",
                )
            }
            false => {
                let off = mean_off(&pixels, 1.0).abs();
                ("relative error of the mean", off, "a white cover over white loses nothing; noise")
            }
        };
        tell(case(&name, off, unit, 8e-3, reason))
    };
    for roughness in [0.0, 1e-4, 1.0] {
        let white = Material { base_color: [1.0; 3], roughness, ..Material::default() };
        for ior in [1.0, 1.0001, 3.0] {
            let glass = Material { transmission: 1.0, ior, ..white };
            look(format!("glass, roughness {roughness}, IOR {ior}, white"), glass)?;
            let coat =
                Material { specular: 0.0, coat: 1.0, coat_ior: ior, coat_roughness: roughness, ..white };
            look(format!("a coat, roughness {roughness}, IOR {ior}, over white"), coat)?;
        }
        let sheen = Material { specular: 0.0, sheen: 1.0, sheen_roughness: roughness, ..white };
        look(format!("sheen, roughness {roughness}, over white"), sheen)?;
    }
    Ok(())
}

/// Paths with very many bounces, and paths whose throughput underflows.
fn depths(studio: &mut Studio<'_>, sponge: &Arc<CompressedVolume>, tell: &mut Tell<'_>) -> Result<()> {
    let mut scene = from_above(lambert(1.0), sky(1.0), [12.0, 12.0], 20.0);
    scene.settings.bounces = 1024;
    let error = worst(&studio.expose(&scene, sponge, 4)?, 1.0);
    let reason = "1,024 bounces of one product in f32 each";
    tell(case("albedo 1 at 1,024 bounces", error, "largest relative error of a pixel", 6.2e-5, reason))?;
    scene.film = Film::new(1, 1, Filter::Box { width: 1.0 });
    let error = worst(&studio.expose(&scene, sponge, 4)?, 1.0);
    tell(case(
        "the same on a film of one pixel",
        error,
        "largest relative error of a pixel",
        6.2e-5,
        reason,
    ))?;

    // After some bounces the throughput is below the smallest normal f32.
    let mut scene = from_above(lambert(1e-9), sky(1e30), [12.0, 12.0], 20.0);
    scene.settings.bounces = 32;
    scene.settings.russian_roulette = false;
    let pixels = studio.expose(&scene, sponge, 4)?;
    let bad = pixels.iter().flatten().filter(|v| !v.is_finite() || **v < 0.0).count() as f64;
    let dark = if mean(&pixels) > 0.0 { bad } else { f64::INFINITY };
    tell(case(
        "throughput below the smallest normal number",
        dark,
        "pixels that are not finite or negative",
        0.0,
        "every pixel must be a finite number ≥ 0",
    ))
}

/// A camera that looks along the floor, and a camera inside a label.
fn views(studio: &mut Studio<'_>, floor: &Arc<CompressedVolume>, tell: &mut Tell<'_>) -> Result<()> {
    let glowing = Material { emission: [2.0; 3], ..lambert(0.0) };
    let mut scene = on_floor(glowing, sky(0.0));
    // The camera is 1e-7 voxels above the floor and looks along it. The lower half of the picture is floor.
    scene.camera.world_from_camera = DAffine3 {
        matrix3: DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X),
        translation: DVec3::new(0.5, 8.0, 2.0 + 1e-7),
    };
    scene.camera.projection = Projection::Perspective { fov_rad: 1e-5 };
    let pixels = studio.expose(&scene, floor, 1)?;
    let side = super::pictures::SIDE as usize;
    let wrong =
        pixels.iter().enumerate().filter(|(i, p)| p[0] != if i / side < side / 2 { 0.0 } else { 2.0 });
    // Skips the row at the horizon: rays within 1e-7 rad of it pass the end of the floor before they meet it.
    let wrong = wrong.filter(|(i, _)| i / side != side / 2).count() as f64;
    tell(case(
        "along the floor, 1e-7 voxels above it",
        wrong,
        "pixels that are wrong",
        0.0,
        "each pixel sees either floor or sky",
    ))?;

    let mut scene = on_floor(Material { emission: [2.0; 3], ..lambert(0.5) }, sky(1.0));
    scene.camera.world_from_camera.translation = DVec3::new(8.3, 8.2, 1.1);
    scene.camera.projection = Projection::Perspective { fov_rad: 2.0 };
    // From inside, a label's surface is shaded as from outside: it emits 2 and reflects half of the 2 that it receives from inside.
    let error = worst(&studio.expose(&scene, floor, 1)?, 2.0 + 0.5 * 2.0);
    tell(case("the camera inside a label", error, "largest relative error of a pixel", 1e-6, FEW_PRODUCTS))
}

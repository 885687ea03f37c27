//! Importance sampling of emissive labels that are very many, very small, far away, or of very long voxels. The irradiance straight below
//! the middle of an emissive rectangle is known in closed form (Howell, *Radiation Configuration Factors*, B-3).

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::CompressedVolume;
use pumice_oracle::volumes::volume;
use pumice_scene::{Material, Mode, Scene};
use pumice_session::error::Result;

use super::Case;
use super::pictures::{Studio, from_above, lambert, mean_off, sky, worst};

const ALBEDO: f32 = 0.6;
/// Voxels along each side of the emissive plate, each a label of its own: 99,856 labels.
const WIDE: u32 = 316;
/// Height of the plate over the floor, in voxels.
const HEIGHT: u32 = 12;
/// Side of the piece of floor that the camera sees, in voxels. The irradiance is the same all over it to 1e-6.
const SIDE: f64 = 1e-3;

pub(super) fn measure(studio: &mut Studio<'_>, tell: &mut dyn FnMut(Case) -> Result<()>) -> Result<()> {
    very_many(studio, tell)?;
    extreme(studio, tell)
}

/// Irradiance below the middle of an emissive rectangle with these half sides, as a share of that under a constant sky.
fn below_the_middle(half: [f64; 2], height: f64) -> f64 {
    let [a, b] = half.map(|h| h / height);
    let part = |a: f64, b: f64| a / (1.0 + a * a).sqrt() * (b / (1.0 + a * a).sqrt()).atan();
    4.0 * (part(a, b) + part(b, a)) / (2.0 * PI)
}

/// A scene with a floor of label 1 and above it a plate whose voxel (x, y) has the label `at(x, y)`; the camera is between the two.
fn below(
    wide: u32,
    at: impl Fn(u32, u32) -> u32,
    shines: Material,
    place: DAffine3,
) -> (Scene, Arc<CompressedVolume>) {
    let (_, volume) = volume([wide, wide, 2 + HEIGHT], |x, y, z| match z {
        0 => 1,
        z if z == 1 + HEIGHT => at(x, y),
        _ => 0,
    });
    let mut scene = from_above(shines, sky(0.0), [0.0; 2], SIDE);
    scene.settings.mode = Mode::OneBounce;
    let middle = f64::from(wide) / 2.0;
    let side = place.matrix3.x_axis.length().min(place.matrix3.y_axis.length());
    let seen = place.transform_point3(DVec3::new(middle, middle, 1.0));
    let above = place.matrix3.z_axis.length();
    scene.camera.world_from_camera.translation = seen + DVec3::Z * above;
    scene.camera.projection = pumice_scene::Projection::Orthographic { scale: SIDE * side };
    scene.instances[0].world_from_index = place;
    scene.instances[0].style.materials = [(1, lambert(ALBEDO))].into_iter().collect();
    (scene, volume)
}

fn case(name: &str, error: f64, unit: &'static str, bar: f64, reason: &'static str) -> Case {
    Case::new("emission", name, error, unit, bar, reason)
}

/// A plate of a hundred thousand equal labels; then the same with one label, over the piece of floor seen, a million times brighter.
fn very_many(studio: &mut Studio<'_>, tell: &mut dyn FnMut(Case) -> Result<()>) -> Result<()> {
    let radiance = 2.0;
    let shines = Material { emission: [radiance; 3], ..lambert(0.0) };
    let label = |x: u32, y: u32| 2 + x + WIDE * y;
    let (mut scene, plate) = below(WIDE, label, shines, DAffine3::IDENTITY);
    let height = f64::from(HEIGHT);
    let of_plate = f64::from(ALBEDO * radiance) * below_the_middle([f64::from(WIDE) / 2.0; 2], height);
    let pixels = studio.expose(&scene, &plate, 256)?;
    // With importance sampling the standard deviation of a sample is at most a fifth of its mean (a twentieth was measured). The mean has
    // 36,864 samples. A pixel has 256, and the largest of 144 pixels is within four standard errors.
    let reason = "two standard errors of samples that vary by a fifth of their mean";
    let off = mean_off(&pixels, of_plate).abs();
    tell(case("100,000 labels, mean", off, "relative error of the mean", 2.1e-3, reason))?;
    // A picture of its own, so that this case is compared with the CPU's too.
    scene.settings.seed += 1;
    let pixels = studio.expose(&scene, &plate, 256)?;
    let reason = "four standard errors of samples that vary by a fifth of their mean";
    tell(case("100,000 labels, noise", worst(&pixels, of_plate), RELATIVE, 5e-2, reason))?;

    let middle = WIDE / 2;
    let bright = Material { emission: [radiance * 1e6; 3], ..lambert(0.0) };
    let styles = &mut scene.instances[0].style.materials;
    styles.insert(u64::from(label(middle, middle)), bright);
    // The bright voxel is half a voxel off along both axes, so it is a quarter of a rectangle of twice its sides that is centred.
    let of_bright = f64::from(ALBEDO * radiance) * 1e6 * below_the_middle([1.0; 2], height) / 4.0;
    let pixels = studio.expose(&scene, &plate, 64)?;
    let name = "one of 100,000 labels a million times brighter";
    let reason = "four standard errors of 64 samples of which one in twenty goes to the others";
    tell(case(name, worst(&pixels, of_bright + of_plate), RELATIVE, 0.115, reason))
}

const RELATIVE: &str = "largest relative error of a pixel";

/// An emissive plate of 8 × 8 voxels of one label, with extreme voxel sizes and radiances.
fn extreme(studio: &mut Studio<'_>, tell: &mut dyn FnMut(Case) -> Result<()>) -> Result<()> {
    let at = |x: u32, y: u32| 2 * u32::from((8..16).contains(&x) && (8..16).contains(&y));
    let scaled =
        |scale: DVec3, translation: DVec3| DAffine3 { matrix3: DMat3::from_diagonal(scale), translation };
    let near = DVec3::ZERO;
    for (name, radiance, place) in [
        ("voxels of 1", 1.0, scaled(DVec3::ONE, near)),
        ("voxels of 1e-9", 1.0, scaled(DVec3::splat(1e-9), near)),
        ("voxels of 1e9", 1.0, scaled(DVec3::splat(1e9), near)),
        ("voxels of 1e-3, 1e6 from the origin", 1.0, scaled(DVec3::splat(1e-3), DVec3::new(1e6, -1e6, 1e6))),
        ("voxels of 1 × 1000 × 1", 1.0, scaled(DVec3::new(1.0, 1000.0, 1.0), near)),
        ("voxels of 1 × 1 × 100", 1.0, scaled(DVec3::new(1.0, 1.0, 100.0), near)),
        ("mirrored voxels", 1.0, scaled(DVec3::new(-1.0, 1.0, 1.0), near)),
        ("radiance of 1e30", 1e30, scaled(DVec3::ONE, near)),
        ("radiance of 1e-30", 1e-30, scaled(DVec3::ONE, near)),
    ] {
        let shines = Material { emission: [radiance; 3], ..lambert(0.0) };
        let (scene, volume) = below(24, at, shines, place);
        let [x, y, z] = [place.matrix3.x_axis, place.matrix3.y_axis, place.matrix3.z_axis].map(DVec3::length);
        let seen = below_the_middle([4.0 * x, 4.0 * y], f64::from(HEIGHT) * z);
        let expected = f64::from(ALBEDO) * f64::from(radiance) * seen;
        let off = mean_off(&studio.expose(&scene, &volume, 64)?, expected).abs();
        // Samples are uniform by area. On very long voxels the standard deviation is up to 20 times the mean, of which 9,216 stratified
        // samples leave a few per cent; elsewhere it is less than half of the mean, which leaves half a per cent.
        let (bar, reason) = match name.contains("1000") {
            true => (0.1, "samples by area vary by twenty times their mean"),
            false => (1e-2, "two standard errors of samples that vary by half of their mean"),
        };
        tell(case(name, off, "relative error of the mean", bar, reason))?;
    }
    Ok(())
}

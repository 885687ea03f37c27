//! The camera as a UsdGeomCamera.
//!
//! ```text
//! ours                                          USD
//! angle or scale of the fitted side         ─►  apertures in the film's proportions; the fitted side's is 0.36 (36 mm, if a unit is
//!                                               a metre) or the scale; focal length from the angle
//! shift in units of the fitted side         ─►  offsets of the apertures
//! radius of the opening                     ─►  fStop = focal length / diameter
//! clip range without an end                 ─►  an end behind or before all that is in the scene
//! ```
//! Apertures, their offsets and the focal length are in tenths of a scene unit (UsdGeomCamera, *Units of Measure for Camera Properties*).
//! Blender's importer reads them so, but takes the apertures of orthographic cameras for whole units.
//!
//! The shape of the opening and the size of the picture have no words in USD; they are notes.

use glam::{DAffine3, DVec3};
use pumice_scene::{Film, Projection, SensorFit};
use pumice_transport::LoadedScene;

use super::placement::{note, placement, without_scale};
use crate::Reader;
use crate::usd::{Prim, Property, Value};

/// Aperture of the fitted side of perspective cameras, in tenths of a unit: Blender's default sensor, where a unit is a metre. The picture
/// does not depend on it.
const APERTURE: f64 = 0.36;
/// Focal length of orthographic cameras, in tenths of a unit: one unit, so that the f-stop is 1 / diameter, as in Blender. Only the depth of
/// field depends on it.
const ORTHOGRAPHIC_FOCAL_LENGTH: f64 = 10.0;
/// Tenths in a unit.
const TENTHS: f64 = 10.0;
/// Least near distance that is chosen for a camera that does not clip, as a part of the farthest depth in the scene: depth buffers of
/// 24 bits resolve 1/1600 of the depth at that ratio.
const LEAST_NEAR: f64 = 1e-4;

/// The camera of a scene.
pub(super) fn prim(scene: &LoadedScene, reader: Reader) -> Prim<'static> {
    let (camera, film) = (&scene.scene().camera, &scene.scene().film);
    let (width, height) = (f64::from(film.width) * film.pixel_aspect, f64::from(film.height));
    let fitted = match camera.fit {
        SensorFit::Auto => width.max(height),
        SensorFit::Horizontal => width,
        SensorFit::Vertical => height,
    };
    let (projection, aperture, focal_length) = match camera.projection {
        Projection::Perspective { fov_rad } => {
            ("perspective", APERTURE, 0.5 * APERTURE / (0.5 * fov_rad).tan())
        }
        Projection::Orthographic { scale } => {
            let aperture = match reader {
                Reader::Specification => scale * TENTHS,
                Reader::Blender => scale,
            };
            ("orthographic", aperture, ORTHOGRAPHIC_FOCAL_LENGTH)
        }
    };
    let float = |name: &str, value: f64| Property::new(name, "float", Value::Float(value as f32));
    let mut properties = Vec::from(placement(&without_scale(&camera.world_from_camera)));
    properties.extend([
        Property::new("projection", "token", Value::Token(projection.into())),
        float("focalLength", focal_length),
        float("horizontalAperture", aperture * width / fitted),
        float("verticalAperture", aperture * height / fitted),
        float("horizontalApertureOffset", aperture * camera.shift[0]),
        float("verticalApertureOffset", aperture * camera.shift[1]),
        Property::new("clippingRange", "float2", Value::Float2(clip_range(scene).map(|d| d as f32))),
    ]);
    if let Some(opening) = &camera.aperture {
        properties.push(float("focusDistance", opening.focus_distance));
        properties.push(float("fStop", focal_length / TENTHS / (2.0 * opening.radius)));
        properties.push(note("aperture_blades", "int", Value::Int(opening.blades as i32)));
        properties.push(note(
            "aperture_rotation_deg",
            "double",
            Value::Double(opening.rotation_rad.to_degrees()),
        ));
        properties.push(note("aperture_ratio", "double", Value::Double(opening.ratio)));
    }
    properties.extend(notes_of_film(film));
    Prim { name: "camera".into(), type_name: "Camera", properties, ..Prim::default() }
}

fn notes_of_film(film: &Film) -> [Property<'static>; 2] {
    [
        note("resolution", "string", Value::String(format!("[{}, {}]", film.width, film.height))),
        note("pixel_aspect", "double", Value::Double(film.pixel_aspect)),
    ]
}

/// The camera's clip range, with ends for a camera that has none: half the least depth in the scene, and twice the farthest.
fn clip_range(scene: &LoadedScene) -> [f64; 2] {
    let camera = &scene.scene().camera;
    let forward = -camera.world_from_camera.matrix3.z_axis.normalize();
    let position = camera.world_from_camera.translation;
    let depths = corners(scene).map(|corner| (corner - position).dot(forward));
    let [nearest, farthest] =
        depths.fold([f64::INFINITY, 0.0f64], |[near, far], depth| [near.min(depth), far.max(depth)]);
    // Nothing is before the camera: any depth will do.
    let (nearest, farthest) = if farthest > 0.0 { (nearest, farthest) } else { (1.0, 1.0) };
    let [near, far] = camera.clip;
    let far = if far < f64::from(f32::MAX) { far } else { (2.0 * farthest).max(2.0 * near) };
    let near =
        if near as f32 > 0.0 { near } else { (0.5 * nearest).max(LEAST_NEAR * farthest).min(0.5 * far) };
    [near, far]
}

/// Corners of the boxes around all volumes and meshes, in the world.
fn corners(scene: &LoadedScene) -> impl Iterator<Item = DVec3> + '_ {
    let volumes = scene.scene().instances.iter().zip(scene.volumes()).map(|(instance, volume)| {
        let end = volume.info().dims.map(f64::from);
        (instance.world_from_index, [DVec3::ZERO, DVec3::from_array(end)])
    });
    let meshes = scene.scene().meshes.iter().zip(scene.meshes()).filter_map(|(mesh, data)| {
        let mut positions = data.positions().iter().map(|p| DVec3::from_array(*p));
        let first = positions.next()?;
        let bounds = positions.fold([first; 2], |[low, high], p| [low.min(p), high.max(p)]);
        Some((mesh.world_from_mesh, bounds))
    });
    volumes.chain(meshes).flat_map(|(matrix, ends)| corners_of_box(matrix, ends))
}

fn corners_of_box(world_from_box: DAffine3, ends: [DVec3; 2]) -> [DVec3; 8] {
    std::array::from_fn(|c| {
        let corner = DVec3::new(ends[c & 1].x, ends[c >> 1 & 1].y, ends[c >> 2].z);
        world_from_box.transform_point3(corner)
    })
}

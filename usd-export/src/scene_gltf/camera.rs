//! The camera of a scene, and the distances between which a viewer with a depth buffer must draw.
//!
//! Both look along −z with y up. glTF measures the field of view over the height, ours spans the fitted side:
//! tan(yfov / 2) = tan(fov / 2) · height / fitted side, in heights of a pixel. The shift and the depth of field cannot be said.

use glam::{DAffine3, DMat3, DVec3};
use gltf_json::camera::{Orthographic, Perspective, Type};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Camera, Index, Node, Root};
use pumice_scene::{Projection, SensorFit};
use pumice_transport::LoadedScene;

use super::placement::{place, single};
use crate::Result;

/// Nearest distance that is drawn where the camera has no limit, as a share of the farthest point's: with it, a depth buffer of 24 bits still
/// separates surfaces that are 6·10⁻⁵ of the farthest distance apart.
const NEAREST: f64 = 1e-3;

/// Adds the node of the scene's camera.
///
/// # Errors
/// [`pumice_core::Error::Caller`] for numbers beyond single precision.
pub(super) fn add_camera(scene: &LoadedScene, root: &mut Root) -> Result<Index<Node>> {
    let (camera, film) = (&scene.scene().camera, &scene.scene().film);
    let (width, height) = (f64::from(film.width) * film.pixel_aspect, f64::from(film.height));
    let fitted = match camera.fit {
        SensorFit::Auto => width.max(height),
        SensorFit::Horizontal => width,
        SensorFit::Vertical => height,
    };
    let m = camera.world_from_camera;
    let farthest = farthest(scene, m.translation);
    let far = if camera.clip[1] < f64::from(f32::MAX) { Some(camera.clip[1]) } else { None };
    let mut written = Camera {
        name: Some("camera".into()),
        orthographic: None,
        perspective: None,
        type_: Valid(Type::Perspective),
        extensions: None,
        extras: None,
    };
    match camera.projection {
        Projection::Perspective { fov_rad } => {
            // A perspective camera of glTF cannot see what is at its own place.
            let near = if camera.clip[0] > 0.0 {
                camera.clip[0]
            } else {
                NEAREST * farthest.min(far.unwrap_or(farthest))
            };
            let yfov_rad = 2.0 * ((0.5 * fov_rad).tan() * height / fitted).atan();
            let [yfov, znear, aspect_ratio] = single("camera", [yfov_rad, near, width / height])?;
            written.perspective = Some(Perspective {
                aspect_ratio: Some(aspect_ratio),
                yfov,
                zfar: far.map(|far| far as f32),
                znear,
                extensions: None,
                extras: None,
            });
        }
        Projection::Orthographic { scale } => {
            let far = far.unwrap_or(farthest.max(2.0 * camera.clip[0]));
            let half = [0.5 * scale * width / fitted, 0.5 * scale * height / fitted];
            let [xmag, ymag, znear, zfar] = single("camera", [half[0], half[1], camera.clip[0], far])?;
            written.type_ = Valid(Type::Orthographic);
            written.orthographic =
                Some(Orthographic { xmag, ymag, zfar, znear, extensions: None, extras: None });
        }
    }
    let camera = root.push(written);
    let [x, y, z] = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(DVec3::normalize);
    let rigid = DAffine3 { matrix3: DMat3::from_cols(x, y, z), ..m };
    place(root, "camera", rigid, |node| node.camera = Some(camera))
}

/// Distance from `eye` to the farthest corner of what bounds the volumes and meshes of a scene; 1 where it has none.
fn farthest(scene: &LoadedScene, eye: DVec3) -> f64 {
    let volumes = scene.scene().instances.iter().zip(scene.volumes());
    let volumes = volumes.map(|(instance, volume)| {
        let dims = volume.info().dims.map(f64::from);
        (instance.world_from_index, [DVec3::ZERO, DVec3::from_array(dims)])
    });
    let meshes = scene.scene().meshes.iter().zip(scene.meshes()).filter_map(|(mesh, data)| {
        let corners = data.positions().iter().map(|&p| DVec3::from_array(p));
        let bounds = corners.fold(None, |bounds: Option<[DVec3; 2]>, p| {
            let [low, high] = bounds.unwrap_or([p; 2]);
            Some([low.min(p), high.max(p)])
        });
        Some((mesh.world_from_mesh, bounds?))
    });
    let corners = volumes.chain(meshes).flat_map(|(matrix, [low, high])| {
        (0..8).map(move |bits: u32| {
            let side = |axis: u32| bits >> axis & 1 != 0;
            matrix.transform_point3(DVec3::select(glam::BVec3::new(side(0), side(1), side(2)), high, low))
        })
    });
    let distance = corners.map(|corner| corner.distance(eye)).fold(0.0, f64::max);
    if distance > 0.0 { distance } else { 1.0 }
}

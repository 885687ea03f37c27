//! Tells what lies under pixels of a finished picture, from the passes of its file.
//!
//! ```text
//! label pass ─► id, name, type        exact, from the table in the file (pumice_picture::InstanceLabels)
//! position   ─► world position ─► voxel      only with the volume: a surface lies between two voxels, and the label tells which
//! ```
//! Nothing is traced. The voxel is the one behind the face that was hit; where none of the voxels there has the label, as with levels of
//! detail coarser than a voxel, it is left out.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};
use pumice_core::{CompressedVolume, Job};
use pumice_formats::OpenOptions;
use pumice_picture::{Picture, read_exr};
use pumice_scene::{Camera, Instance, Projection, Show};
use serde::Serialize;

use crate::error::{Result, SessionError};
use crate::open::{Residence, open_chosen};
use crate::reading::options_for;
use crate::render_file::hash_text;

/// What lies under a pixel; fields without a label are `None`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PickedPixel {
    /// Pixel from the left.
    pub x: u32,
    /// Pixel from the top.
    pub y: u32,
    /// Id of the instance.
    pub instance: Option<u32>,
    /// Id of the label.
    pub label: Option<u64>,
    /// Name of the label; empty if it has none.
    pub name: Option<String>,
    /// Type of the label; empty if it has none.
    #[serde(rename = "type")]
    pub label_type: Option<String>,
    /// Where the surface is in the world; also of meshes.
    pub position: Option<[f32; 3]>,
    /// Its distance along the view axis, in world units.
    pub depth: Option<f32>,
    /// The voxel that was hit.
    pub voxel: Option<[u32; 3]>,
}

/// What lies under pixels of a picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PickedPixels {
    /// The picture.
    pub picture: PathBuf,
    /// In the order of the question.
    pub pixels: Vec<PickedPixel>,
    /// Why voxels of an instance are not told, one line each.
    pub notices: Vec<String>,
}

/// Tells what lies under these pixels (x, y from the upper left) of an OpenEXR picture.
///
/// # Errors
/// One line: the file is no such picture, lacks its label pass, or a pixel is outside; [`pumice_core::Error::Cancelled`].
pub fn pick_pixels(path: &Path, pixels: &[[u32; 2]], job: &Job) -> Result<PickedPixels> {
    let picture = read_exr(path)?;
    let refuse = |what| SessionError::Caller(format!("{}: {what}", path.display()));
    let mut picked = pixels
        .iter()
        .map(|&[x, y]| pick(&picture, x, y))
        .collect::<std::result::Result<Vec<_>, _>>()
        .map_err(refuse)?;
    let notices = find_voxels(&picture, &mut picked, job)?;
    Ok(PickedPixels { picture: path.to_owned(), pixels: picked, notices })
}

/// What a picture itself tells of a pixel: all but the voxel.
///
/// # Errors
/// One line: the pixel is outside, or the picture does not tell its labels.
pub fn pick(picture: &Picture, x: u32, y: u32) -> std::result::Result<PickedPixel, String> {
    let seen = picture.label_at(x, y)?;
    let pixel = y as usize * picture.color.width + x as usize;
    let depth = picture.depth.as_ref().map(|d| d[pixel]).filter(|d| d.is_finite());
    // Without depth, a label tells that there is a surface.
    let is_hit = depth.is_some() || seen.is_some();
    let position = picture.position.as_ref().filter(|_| is_hit).map(|p| p.pixels[pixel]);
    let of = seen.as_ref();
    Ok(PickedPixel {
        x,
        y,
        instance: of.map(|s| s.instance),
        label: of.map(|s| s.id),
        name: of.map(|s| s.name.to_owned()),
        label_type: of.map(|s| s.label_type.to_owned()),
        position,
        depth,
        voxel: None,
    })
}

/// Finds the voxels of pixels with the volumes that the picture was made of; returns why some are not told.
fn find_voxels(picture: &Picture, picked: &mut [PickedPixel], job: &Job) -> Result<Vec<String>> {
    let mut of_instance: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (i, instance) in picked.iter().enumerate().filter_map(|(i, p)| Some((i, p.instance?))) {
        of_instance.entry(instance).or_default().push(i);
    }
    let mut notices = Vec::new();
    for (id, pixels) in of_instance {
        let ids = pixels.iter().filter_map(|&i| picked[i].label).collect();
        let found = placed(picture, id).and_then(|(instance, _)| {
            let show = Show::Only(ids);
            let reading = options_for(&instance.reading, &OpenOptions::heeding(job));
            let volume = open_chosen(&instance.source, &[&show], &reading, Residence::Mapped, job)?;
            pixels
                .iter()
                .map(|&i| Ok((i, find_voxel(picture, &picked[i], &volume)?)))
                .collect::<Result<Vec<_>>>()
        });
        match found {
            Ok(voxels) => voxels.into_iter().for_each(|(i, voxel)| picked[i].voxel = voxel),
            Err(cancelled @ SessionError::Core(pumice_core::Error::Cancelled)) => return Err(cancelled),
            Err(error) => notices.push(format!("voxels of instance {id} are not told: {error}")),
        }
    }
    Ok(notices)
}

/// The voxel under a picked pixel, in the volume that the picture shows there; `None` where no label is, or no voxel of it is at the surface.
///
/// # Errors
/// One line: the volume is not the one of which the picture was made, or the picture lacks its scene or its position pass.
pub fn find_voxel(
    picture: &Picture,
    picked: &PickedPixel,
    volume: &CompressedVolume,
) -> Result<Option<[u32; 3]>> {
    let (Some(id), Some(label)) = (picked.instance, picked.label) else { return Ok(None) };
    let (instance, expected) = placed(picture, id)?;
    let (got, source) = (hash_text(volume), instance.source.display());
    if got != expected {
        return Err(SessionError::Caller(format!(
            "the picture was made from a volume with the hash {expected} ({source}), and the one that is given has {got}"
        )));
    }
    let Some(position) = picked.position else {
        return Err(SessionError::Caller("the picture has no position pass".into()));
    };
    let camera = picture.provenance.as_ref().map(|made| made.scene.camera);
    let position = DVec3::from_array(position.map(f64::from));
    let find = |camera| voxel_at(volume, &instance.world_from_index, &camera, position, label);
    Ok(camera.map(find).transpose()?.flatten())
}

/// An instance of a picture's scene, and the hash of its volume.
fn placed(picture: &Picture, id: u32) -> Result<(&Instance, &str)> {
    let none = || SessionError::Caller(format!("the picture carries no scene with an instance {id}"));
    let made = picture.provenance.as_ref().ok_or_else(none)?;
    let mut instances = made.scene.instances.iter().zip(&made.volume_hashes);
    instances.find(|(i, _)| i.id == id).map(|(i, hash)| (i, hash.as_str())).ok_or_else(none)
}

/// The voxel with the label `id` behind the face on which a point seen by the camera lies.
fn voxel_at(
    volume: &CompressedVolume,
    world_from_index: &DAffine3,
    camera: &Camera,
    p_in_world: DVec3,
    id: u64,
) -> Result<Option<[u32; 3]>> {
    let Some(label) = volume.labels().index_of(id) else { return Ok(None) };
    let index_from_world = world_from_index.inverse();
    let p = index_from_world.transform_point3(p_in_world);
    let ray = match camera.projection {
        Projection::Perspective { .. } => p_in_world - camera.world_from_camera.translation,
        Projection::Orthographic { .. } => -camera.world_from_camera.matrix3.z_axis,
    };
    let ray = index_from_world.matrix3 * ray;
    // Positions are 32 bit floats, rounded to 2⁻²⁴ of themselves on each axis, which the matrix mixes; eight times that is on the safe side.
    let m = index_from_world.matrix3;
    let most = m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs();
    let slack = most * p_in_world.abs().max_element() * (8.0 * 2f64.powi(-24)) + 1e-9;
    // A point within `slack` of a plane between voxels lies on it; on an edge, two or three planes meet.
    let on_plane = [0, 1, 2].map(|a| (p[a] - p[a].round()).abs() <= slack[a]);
    let behind = |crossed: usize| {
        let of = |a: usize| match crossed >> a & 1 {
            1 => p[a].round() - if ray[a] > 0.0 { 0.0 } else { 1.0 },
            _ if on_plane[a] => p[a].round() - if ray[a] > 0.0 { 1.0 } else { 0.0 },
            _ => p[a].floor(),
        };
        let voxel = [0, 1, 2].map(of);
        voxel.iter().all(|&v| (0.0..f64::from(u32::MAX)).contains(&v)).then(|| voxel.map(|v| v as u32))
    };
    // All planes crossed first: where the ray goes on from an edge. Then fewer, as where a face ends at that edge.
    let all = (0..3).filter(|&a| on_plane[a]).map(|a| 1 << a).sum::<usize>();
    let ways = (0..8usize).rev().filter(|way| way & !all == 0);
    for voxel in ways.filter_map(behind) {
        if volume.label_at(voxel)? == Some(label) {
            return Ok(Some(voxel));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DMat3, DQuat};
    use pumice_core::{LabelBuffer, LabelType, VolumeInfo, compress_labels};
    use pumice_oracle::volumes::Random;
    use pumice_picture::{Annotations, Image, InstanceLabels, Provenance};
    use pumice_scene::Scene;

    use super::*;

    const SIDE: u32 = 5;

    fn volume(ids: Vec<u16>) -> Arc<CompressedVolume> {
        let info = VolumeInfo::new([SIDE; 3], LabelType::U16);
        Arc::new(compress_labels(info, LabelBuffer::U16(ids)).unwrap())
    }

    /// Slanted, mirrored, and with voxels of three lengths.
    fn slanted() -> DAffine3 {
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.3, -0.7, 0.4)));
        let matrix3 = turn * DMat3::from_diagonal(DVec3::new(0.31, -0.17, 0.23));
        DAffine3 { matrix3, translation: DVec3::new(-3.1, 2.7, 0.3) }
    }

    fn camera(origin: DVec3, toward: DVec3, is_parallel: bool) -> Camera {
        let back = -toward.normalize();
        let right = back.any_orthonormal_vector();
        let matrix3 = DMat3::from_cols(right, back.cross(right), back);
        let projection = match is_parallel {
            true => Projection::Orthographic { scale: 1.0 },
            false => Projection::Perspective { fov_rad: 0.5 },
        };
        Camera::new(DAffine3 { matrix3, translation: origin }, projection)
    }

    /// The first filled voxel along a ray in index space and where the ray enters it, by asking every voxel.
    fn first_voxel(ids: &[u16], origin: DVec3, ray: DVec3) -> Option<(f64, [u32; 3])> {
        let mut first: Option<(f64, [u32; 3])> = None;
        for (i, _) in (0u32..).zip(ids).filter(|(_, id)| **id != 0) {
            let voxel = [i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE)];
            let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
            for a in 0..3 {
                let low = (f64::from(voxel[a]) - origin[a]) / ray[a];
                let high = (f64::from(voxel[a]) + 1.0 - origin[a]) / ray[a];
                (enter, leave) = (enter.max(low.min(high)), leave.min(low.max(high)));
            }
            if enter < leave && enter > 0.0 && first.is_none_or(|(t, _)| enter < t) {
                first = Some((enter, voxel));
            }
        }
        first
    }

    /// Positions are 32 bit floats, as in a picture.
    fn in_a_picture(p: DVec3) -> DVec3 {
        p.as_vec3().as_dvec3()
    }

    #[test]
    fn the_voxel_is_the_first_one_along_the_ray() {
        let mut random = Random(5);
        let own_ids = (1..=125).map(|id| if random.below(10) < 6 { id } else { 0 }).collect::<Vec<u16>>();
        let (mut met, place) = (0, slanted());
        // Each voxel with a label of its own; and one label for all, where a neighbour may be taken for the voxel.
        for ids in [own_ids.clone(), own_ids.iter().map(|id| 7 * (*id).min(1)).collect()] {
            let volume = volume(ids.clone());
            for round in 0..1500 {
                let mut unit = || random.unit() * 2.0 - 1.0;
                let direction = DVec3::new(unit(), unit(), unit());
                let target = DVec3::splat(2.5) + DVec3::new(unit(), unit(), unit()) * 2.4;
                let origin = target - direction.normalize() * 15.0;
                let Some((t, voxel)) = first_voxel(&ids, origin, direction) else { continue };
                let id = ids[(voxel[0] + SIDE * (voxel[1] + SIDE * voxel[2])) as usize];
                let [eye, hit] = [origin, origin + direction * t].map(|p| place.transform_point3(p));
                let toward = place.transform_vector3(direction);
                // A perspective camera looks elsewhere than along the ray; a parallel one stands elsewhere.
                let camera = match round % 2 {
                    0 => camera(eye, toward + DVec3::new(0.3, -0.2, 0.1) * toward.length(), false),
                    _ => camera(eye + DVec3::new(5.0, 3.0, -4.0), toward, true),
                };
                let got = voxel_at(&volume, &place, &camera, in_a_picture(hit), u64::from(id)).unwrap();
                // Of one label, a point within the rounding of an edge may lie on either of two faces of it.
                let p = origin + direction * t;
                let on_planes = (0..3).filter(|&a| (p[a] - p[a].round()).abs() < 1e-5).count();
                if on_planes == 1 {
                    assert_eq!(got, Some(voxel), "{p} of id {id}");
                    met += 1;
                }
                // Negative control: a label that is not there, and one that is elsewhere.
                assert_eq!(voxel_at(&volume, &place, &camera, in_a_picture(hit), 999).unwrap(), None);
            }
        }
        assert!(met > 2000, "{met}");
    }

    /// A block of one label seen along a diagonal of its edge: the ray goes on in the voxel behind both faces.
    #[test]
    fn at_an_edge_the_voxel_is_where_the_ray_goes_on() {
        let mut ids = vec![0; 125];
        ids[(1 + SIDE * (1 + SIDE)) as usize] = 3;
        let one = volume(ids.clone());
        let eye = DVec3::new(-4.0, -3.0, 1.5);
        let at = |p: DVec3, eye: DVec3| {
            voxel_at(&one, &DAffine3::IDENTITY, &camera(eye, p - eye, false), p, 3).unwrap()
        };
        assert_eq!(at(DVec3::new(1.0, 1.0, 1.5), eye), Some([1, 1, 1]));
        // Past the far edge of a face, where the way behind the edge is empty, the face's own voxel is told.
        assert_eq!(at(DVec3::new(1.0, 2.0, 1.5), eye), Some([1, 1, 1]));
        assert_eq!(at(DVec3::new(1.0, 2.0, 2.0), eye), Some([1, 1, 1]));
        // From the other side.
        assert_eq!(at(DVec3::new(2.0, 2.0, 1.5), DVec3::splat(9.0)), Some([1, 1, 1]));
        // At the border of the volume nothing is below 0.
        ids[0] = 3;
        let two = volume(ids);
        let eye = DVec3::new(-4.0, 0.5, 0.5);
        let edge =
            voxel_at(&two, &DAffine3::IDENTITY, &camera(eye, DVec3::X, false), DVec3::new(0.0, 0.5, 0.5), 3);
        assert_eq!(edge.unwrap(), Some([0; 3]));
        // A quarter of a voxel inside of a voxel no face is near: the point's own voxel is told.
        assert_eq!(at(DVec3::new(1.25, 1.5, 1.5), eye), Some([1, 1, 1]));
        assert_eq!(at(DVec3::new(2.25, 1.5, 1.5), eye), None);
    }

    const SCENE: &str = r#"{
      "version": 1,
      "instances": [{ "id": 4, "source": "memory", "world_from_index": [1,0,0, 0,1,0, 0,0,1, 0,0,0] }],
      "camera": { "world_from_camera": [1,0,0, 0,1,0, 0,0,1, 2.5,2.5,20], "projection": { "perspective": { "fov_rad": 0.5 } } },
      "film": { "width": 3, "height": 2, "filter": { "box": { "width": 1.0 } } },
      "world": { "environment": { "constant": { "radiance": [1, 1, 1] } } }
    }"#;

    /// 3 × 2 pixels, all different: pixel n counted in rows from the top has the row n of the table, or nothing for 0 and 4.
    fn picture(volume: &CompressedVolume) -> Picture {
        let n = [0u32, 1, 2, 3, 4, 5];
        let is_hit = |n: u32| !n.is_multiple_of(4);
        let position = n.map(|n| [0.5 + n as f32 % 3.0, 0.5, 5.0]).to_vec();
        Picture {
            depth: Some(n.map(|n| if is_hit(n) { 15.0 + n as f32 } else { f32::INFINITY }).to_vec()),
            label: Some(n.map(|n| if is_hit(n) { n } else { 0 }).to_vec()),
            instance: Some(n.map(|n| if is_hit(n) { 4 } else { 0 }).to_vec()),
            labels: vec![InstanceLabels {
                instance: 4,
                rows: vec![1, 2, 3, 5],
                ids: vec![101, 102, 103, 105],
                ..InstanceLabels::default()
            }],
            position: Some(Image::new(3, 2, position)),
            provenance: Some(Provenance {
                version: "0.1.0".into(),
                backend: "cpu".into(),
                scene: Scene::from_json(SCENE).unwrap(),
                volume_hashes: vec![hash_text(volume)],
                label_hashes: Vec::new(),
                mesh_hashes: Vec::new(),
                sky_hash: None,
                spp: 1,
                error_estimate: None,
                denoised: None,
                annotations: Annotations::default(),
            }),
            ..Picture::of(Image::new(3, 2, vec![[0.0; 3]; 6]))
        }
    }

    #[test]
    fn pixels_are_counted_from_the_upper_left() {
        let volume = volume(vec![101; 125]);
        let picture = picture(&volume);
        for (n, label) in
            [(0, None), (1, Some(101)), (2, Some(102)), (3, Some(103)), (4, None), (5, Some(105))]
        {
            let (x, y) = (n % 3, n / 3);
            let picked = pick(&picture, x, y).unwrap();
            assert_eq!((picked.x, picked.y, picked.label), (x, y, label));
            assert_eq!(picked.instance, label.map(|_| 4));
            assert_eq!(picked.depth, label.map(|_| 15.0 + n as f32));
            assert_eq!(picked.position, label.map(|_| [0.5 + n as f32 % 3.0, 0.5, 5.0]));
        }
        for (x, y) in [(3, 0), (0, 2), (u32::MAX, 0)] {
            assert!(pick(&picture, x, y).unwrap_err().contains("expected x below 3 and y below 2"));
        }
    }

    #[test]
    fn a_surface_without_a_label_has_a_position_and_one_without_depth_too() {
        let volume = volume(vec![101; 125]);
        let mut mesh = picture(&volume);
        mesh.label.as_mut().unwrap()[1] = 0;
        mesh.instance.as_mut().unwrap()[1] = 0;
        let picked = pick(&mesh, 1, 0).unwrap();
        assert!(
            picked.label.is_none() && picked.position.is_some() && picked.depth == Some(16.0),
            "{picked:?}"
        );
        mesh.depth = None;
        assert_eq!(pick(&mesh, 1, 0).unwrap().position, None);
        assert!(pick(&mesh, 2, 0).unwrap().position.is_some());
    }

    #[test]
    fn voxels_are_told_of_the_volume_of_which_the_picture_was_made() {
        let volume_of = volume(vec![101; 125]);
        let mut made = picture(&volume_of);
        let picked = pick(&made, 1, 0).unwrap();
        assert_eq!(find_voxel(&made, &picked, &volume_of).unwrap(), Some([1, 0, 4]));
        let nothing = pick(&made, 0, 0).unwrap();
        assert_eq!(find_voxel(&made, &nothing, &volume_of).unwrap(), None);
        let says = |made: &Picture, picked: &PickedPixel, volume: &CompressedVolume| {
            find_voxel(made, picked, volume).unwrap_err().to_string()
        };
        let other = volume(vec![102; 125]);
        assert!(says(&made, &picked, &other).contains("was made from a volume with the hash"));
        let without = PickedPixel { position: None, ..picked.clone() };
        assert!(says(&made, &without, &volume_of).contains("no position pass"));
        let elsewhere = PickedPixel { instance: Some(9), ..picked.clone() };
        assert!(says(&made, &elsewhere, &volume_of).contains("no scene with an instance 9"));
        made.provenance = None;
        assert!(says(&made, &picked, &volume_of).contains("no scene with an instance 4"));
    }
}

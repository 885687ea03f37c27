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
            let reading = options_for(&instance.reading, &OpenOptions::default());
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
            "the picture was made from a volume with the hash {expected}, but {source} now has {got}"
        )));
    }
    let Some(position) = picked.position else {
        return Err(SessionError::Caller("the picture has no position pass".into()));
    };
    let camera = picture.provenance.as_ref().map(|made| made.scene.camera);
    let position = DVec3::from_array(position.map(f64::from));
    Ok(camera.and_then(|camera| voxel_at(volume, &instance.world_from_index, &camera, position, label)))
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
) -> Option<[u32; 3]> {
    let label = volume.labels().index_of(id)?;
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
    ways.filter_map(behind).find(|&voxel| volume.label_at(voxel) == Some(label))
}

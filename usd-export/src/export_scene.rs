//! Writes a scene to a file of any format: finds what is drawn, says how much it is, and writes it.

use std::io::{Seek, Write};
use std::path::Path;

use pumice_core::{Error, Job, open_input};
use pumice_transport::LoadedScene;

use crate::drawn::Drawn;
use crate::drawn_boxes::count_boxes;
use crate::scene_gltf::{MOST_GLB_BYTES, gltf_of_scene};
use crate::scene_triangles::{SmoothSurfaces, Surfaces};
use crate::sky_picture::SkyPicture;
use crate::usd::{PackedFile, Stage, write_usda, write_usdc, write_usdz};
use crate::whole_file::{temporary_beside, write_whole};
use crate::{
    Budget, ExportError, FileFormat, Form, Merging, Reader, Result, VoxelRegion, scene_stage::stage_of_scene,
};

/// What is written of a scene, and how much of it at most.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExportOptions {
    /// Forms of the volumes; the first is the one that programs show.
    pub forms: Vec<Form>,
    /// Whether neighbouring faces become one.
    pub merging: Merging,
    /// Bytes that the file may take, as estimated while its faces are found.
    pub limit_bytes: u64,
    /// Whether the scene's camera, world, suns, lamps and meshes are written too.
    pub surroundings: bool,
    /// The program whose reading of the format is followed.
    pub reader: Reader,
    /// Voxels of each volume outside of which nothing is written; none for all.
    pub region: Option<VoxelRegion>,
}

/// What an export has found and is about to write, or has written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExportSize {
    /// Faces of all forms together, and triangles of meshes.
    pub faces: u64,
    /// Boxes of the form [`Form::Instances`].
    pub boxes: u64,
    /// Bytes of the file: an estimate before it is written.
    pub bytes: u64,
}

/// Writes a scene to `path`, whose ending chooses the format. The file appears complete or not at all. `tell` hears how much it is before
/// writing begins.
///
/// # Errors
/// Those of [`FileFormat::of`]; [`pumice_core::Error::Caller`] where nothing is asked for or nothing is drawn, where the region reaches
/// beyond a volume, or where a smoothed surface is asked for of a scene with cuts;
/// [`pumice_core::Error::Limit`] where the file would take more bytes than allowed, as soon as that is found;
/// [`pumice_core::Error::Io`] with the file's name where it cannot be written; [`pumice_core::Error::Cancelled`].
pub fn export_scene(
    scene: &LoadedScene,
    options: &ExportOptions,
    path: &Path,
    tell: &mut dyn FnMut(ExportSize),
    job: &Job,
) -> Result<ExportSize> {
    let format = FileFormat::of(path)?;
    format.check_forms(&options.forms)?;
    if let Some(region) = &options.region {
        for (instance, volume) in scene.scene().instances.iter().zip(scene.volumes()) {
            region.check_within(volume.info().dims, &format!("volume_{}", instance.id))?;
        }
    }
    if options.forms.contains(&Form::Smooth) && !scene.scene().cuts.is_empty() {
        let what = "form: smooth: the surface of cut volumes cannot be smoothed; choose another form, or remove the cuts";
        return Err(Error::Caller(what.into()).into());
    }
    let limit_bytes = options.limit_bytes.min(format.most_bytes());
    let mut budget = Budget::new(limit_bytes, format.face_bytes());
    if options.forms.contains(&Form::Instances) {
        check_boxes(scene, options.region, budget)?;
    }
    let size = |budget: &Budget, bytes| ExportSize { faces: budget.faces(), boxes: budget.boxes(), bytes };
    let explained = |error| explained(error, format);
    let bytes = match format {
        FileFormat::Usda | FileFormat::Usdc | FileFormat::Usdz => {
            let sky = match options.surroundings {
                true => SkyPicture::of(scene.scene(), path, format)?,
                false => None,
            };
            if let (FileFormat::Usdz, Some(sky)) = (format, &sky) {
                budget.take_packed(sky.bytes)?;
            }
            let asset = sky.as_ref().map(|sky| sky.asset.as_str());
            let stage = stage_of_scene(scene, options, asset, &mut budget, job)?;
            tell(size(&budget, budget.bytes()));
            write_whole(path, job, |mut out| match format {
                FileFormat::Usda => write_usda(&stage, &mut out),
                FileFormat::Usdz => write_package(&stage, sky.as_ref(), path, job, &mut out),
                _ => write_usdc(&stage, &mut out),
            })?
        }
        FileFormat::Gltf | FileFormat::Glb => {
            let gltf = gltf_of_scene(scene, options, &mut budget, job).map_err(explained)?;
            gltf.check(limit_bytes).map_err(explained)?;
            tell(size(&budget, gltf.bytes()));
            match format {
                FileFormat::Gltf => gltf.write_gltf(path, job)?,
                _ => gltf.write_glb(path, job)?,
            }
        }
        FileFormat::Ply | FileFormat::Obj | FileFormat::Stl if options.forms == [Form::Smooth] => {
            let surfaces = SmoothSurfaces::of_scene(scene, options, &mut budget, job)?;
            tell(size(&budget, budget.bytes()));
            surfaces.write(format, path, job)?
        }
        FileFormat::Ply | FileFormat::Obj | FileFormat::Stl => {
            let surfaces = Surfaces::of_scene(scene, options, &mut budget, job)?;
            tell(size(&budget, budget.bytes()));
            match format {
                FileFormat::Ply => write_whole(path, job, |out| surfaces.write_ply(out))?,
                FileFormat::Obj => surfaces.write_obj_and_mtl(path, job)?,
                _ => write_whole(path, job, |out| surfaces.write_stl(out))?,
            }
        }
    };
    Ok(size(&budget, bytes))
}

/// Checks that the boxes of all instances fit, before any of them is kept: each instance takes a few lines of a scene and may have millions.
fn check_boxes(scene: &LoadedScene, region: Option<VoxelRegion>, mut budget: Budget) -> Result<()> {
    (0..scene.volumes().len())
        .try_for_each(|place| budget.take_boxes(count_boxes(&Drawn::new(scene, place, region))))
}

/// Writes a stage and the picture of its world as a package. The stage is a file of its own first, without a name in the folder of
/// `path`, because a package says how long its files are.
fn write_package(
    stage: &Stage<'_>,
    sky: Option<&SkyPicture>,
    path: &Path,
    job: &Job,
    out: &mut (impl Write + Seek),
) -> Result<()> {
    let (stage_file, bytes) = temporary_beside(path, job, |out| write_usdc(stage, out))?;
    let mut files = vec![PackedFile { name: "stage.usdc", from: stage_file, bytes }];
    if let Some(sky) = sky {
        let at = |source| Error::Io { path: sky.file.clone(), source };
        let from = open_input(&sky.file).map_err(at)?;
        files.push(PackedFile { name: sky.asset.trim_start_matches("./"), from, bytes: sky.bytes });
    }
    write_usdz(files, out)
}

/// Adds the reason to an error about a limit that is the format's own.
fn explained(error: ExportError, format: FileFormat) -> ExportError {
    match error {
        ExportError::Volume(Error::Limit { what, limit, got })
            if format == FileFormat::Glb && limit == MOST_GLB_BYTES =>
        {
            let what = format!("{what} (a .glb has lengths of 32 bits; a .gltf may be larger)");
            Error::Limit { what, limit, got }.into()
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_of_the_format_says_so_and_another_does_not() {
        let error = |limit, format| {
            let what = "bytes".to_owned();
            explained(Error::Limit { what, limit, got: 1 << 40 }.into(), format).to_string()
        };
        let own = "bytes (a .glb has lengths of 32 bits; a .gltf may be larger): 1099511627776 is more than the limit of 4294967295";
        assert_eq!(error(MOST_GLB_BYTES, FileFormat::Glb), own);
        for (limit, format) in [(1 << 30, FileFormat::Glb), (MOST_GLB_BYTES, FileFormat::Gltf)] {
            assert_eq!(
                error(limit, format),
                format!("bytes: 1099511627776 is more than the limit of {limit}")
            );
        }
    }
}

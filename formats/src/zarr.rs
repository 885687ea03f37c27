//! Zarr, versions 2 and 3, with shards; and OME-Zarr. The crate `zarrs` decodes chunks; this module says which array is read and where it lies.
//!
//! ```text
//! cells.zarr/                          the folder of an image, of a group, or of one array can be opened
//!   zarr.json | .zattrs                multiscales: levels 0, 1, …     --scale
//!   0/ 1/ 2/                           arrays: zarr.json | .zarray, and chunks
//!   labels/cells/                      label images of a picture       --label
//! group.zarr/volumes/labels            arrays of a plain group         --dataset
//! ```
//! Specifications: *Zarr storage specification version 2*, *Zarr core specification version 3*, *OME-NGFF* 0.4 and 0.5.

use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use pumice_core::error::one_line;
use pumice_core::{LabelType, Unit, VolumeInfo};
use serde_json::Value;
use zarrs::array::Array;

use crate::array_axes::{along_xyz, by_names, by_order, shape_text};
use crate::array_place::ArrayPlace;
use crate::choice::OpenChoice;
use crate::chunks::Chunks;
use crate::element::{Element, type_of_code, type_of_name};
use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::layout::{FileAxis, Layout, Role};
use crate::levels::{Level, choose_level};
use crate::ome_zarr::{self, Multiscale};
use crate::options::{MissingChunks, OpenOptions};
use crate::placement;
use crate::stores::lengths;
use crate::volume_file::{VolumeFile, Voxels};
use crate::zarr_chunks::ZarrChunks;
use crate::zarr_codecs;
use crate::zarr_files::ZarrFiles;
use crate::zarr_node::{Kind, Node, choose_dataset, choose_label};
use crate::zarr_shards::Sharding;

/// Reads the metadata of the store at `folder`.
pub(crate) fn read(folder: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    let mut choices = Vec::new();
    let Some(mut node) = Node::read(folder)? else {
        return Err(FormatError::damaged(folder, "the folder is no Zarr array or group"));
    };
    if let Some(chosen) = choose_dataset(&node, options, &mut choices)? {
        node = chosen;
    }
    if let Some(chosen) = choose_label(&node, options, &mut choices)? {
        node = chosen;
    }
    if node.kind == Kind::Array {
        return match level_of(&node)? {
            Some((image, level)) => of_level(&image.1, &image.0, level, options, choices),
            None => of_array(&node, options, choices),
        };
    }
    let Some(image) = ome_zarr::multiscale(&node.path, &node.attributes)? else {
        return Err(FormatError::damaged(
            &node.path,
            "the group is no image and holds no arrays that may be labels",
        ));
    };
    of_image(&node, &image, options, choices)
}

/// The image of which an array is a level, and the level: of an array that is opened by its own path.
fn level_of(array: &Node) -> Result<Option<((Node, Multiscale), usize)>> {
    // Paths of levels have one part, rarely two.
    for parent in array.path.ancestors().skip(1).take(2) {
        // Without a name the ancestor is the working folder, of which nobody has spoken.
        if parent.as_os_str().is_empty() {
            break;
        }
        let Ok(Some(node)) = Node::read(parent) else { continue };
        let Ok(Some(image)) = ome_zarr::multiscale(parent, &node.attributes) else { continue };
        if let Some(level) = image.datasets.iter().position(|d| parent.join(&d.path) == array.path) {
            return Ok(Some(((node, image), level)));
        }
    }
    Ok(None)
}

/// An array by itself.
fn of_array(node: &Node, options: &OpenOptions, mut choices: Vec<OpenChoice>) -> Result<VolumeFile> {
    if let Some(scale) = &options.scale {
        return Err(FormatError::NotApplicable {
            path: node.path.clone(),
            option: format!("--scale {scale}"),
            why: "an array by itself has one level".into(),
        });
    }
    let array = Opened::open(&node.path)?;
    let names = array.names(node);
    let roles = match &names {
        Some(names) => by_names(&node.path, names, &array.shape, options, &mut choices)?,
        None => by_order(&node.path, &array.shape, options, &mut choices)?,
    };
    let texts = |name: &str| match node.attributes.get(name)? {
        Value::String(text) => Some(vec![text.clone()]),
        Value::Array(list) => {
            Some(list.iter().map(|one| one.as_str().unwrap_or_default().to_owned()).collect())
        }
        _ => None,
    };
    let numbers = |name: &str| {
        let found = node.attributes.get(name);
        lengths(found).or_else(|| Some(vec![found?.as_f64()?]))
    };
    let place = ArrayPlace::find(array.shape.len(), numbers, texts);
    array
        .volume_file("Zarr", &roles, choices, options, |info| place.placed(&node.path, info, &roles, options))
}

/// The level of an image that the caller chooses.
fn of_image(
    node: &Node,
    image: &Multiscale,
    options: &OpenOptions,
    mut choices: Vec<OpenChoice>,
) -> Result<VolumeFile> {
    let (unit, factor) = units(node, image, options);
    let mut levels = Vec::new();
    for dataset in &image.datasets {
        // The sizes of other levels are for people, and must not keep the level that is read from being read.
        let shape = Node::read(&node.path.join(&dataset.path)).ok().flatten().and_then(|array| array.shape());
        let along = |numbers: &[f64]| {
            let mut xyz = [1.0; 3];
            for (axis, &number) in image.axes.iter().zip(numbers) {
                if let Some(space) = space_of(&axis.name) {
                    xyz[space] = number;
                }
            }
            xyz
        };
        let sizes = shape.map(|shape| along(&shape.iter().map(|&n| n as f64).collect::<Vec<f64>>()));
        let scale = along(&dataset.scale);
        levels.push(Level {
            dims: sizes.map(|sizes| sizes.map(|n| n as u64)),
            spacing: [0, 1, 2].map(|a| scale[a] * factor[a]),
        });
    }
    let level = choose_level(&node.path, &levels, unit, options, &mut choices)?;
    of_level(image, node, level, options, choices)
}

/// A level of an image.
fn of_level(
    image: &Multiscale,
    node: &Node,
    level: usize,
    options: &OpenOptions,
    mut choices: Vec<OpenChoice>,
) -> Result<VolumeFile> {
    let dataset = &image.datasets[level];
    let path = node.path.join(&dataset.path);
    let array = Opened::open(&path)?;
    let names: Vec<String> = image.axes.iter().map(|axis| axis.name.clone()).collect();
    let roles = by_names(&path, &names, &array.shape, options, &mut choices)?;
    let notes = ome_zarr::notes(&node.path, &node.attributes)?;
    let (unit, factor) = units(node, image, options);
    array.volume_file("OME-Zarr", &roles, choices, options, |mut info| {
        let scale = along_xyz(&roles, &dataset.scale, 1.0);
        let moved = along_xyz(&roles, &dataset.translation, 0.0);
        let scale = [0, 1, 2].map(|a| scale[a] * factor[a]);
        let origin = DVec3::from_array([0, 1, 2].map(|a| moved[a] * factor[a]));
        info.unit = unit;
        info.notes = notes;
        Ok(info.from_centre_affine(placement::from_lengths(&path, scale, origin, options)?))
    })
}

fn space_of(name: &str) -> Option<usize> {
    ["x", "y", "z"].iter().position(|&space| space == name)
}

/// The unit of an image, and what lengths along x, y, z are multiplied by to be in it. Axes without a unit have that of the others.
fn units(node: &Node, image: &Multiscale, options: &OpenOptions) -> (Unit, [f64; 3]) {
    let mut names = [None; 3];
    for axis in &image.axes {
        if let Some(space) = space_of(&axis.name) {
            names[space] = axis.unit.as_deref();
        }
    }
    let (unit, factor, unknown) = placement::one_unit(names);
    for line in unknown {
        options.warnings.push(format!("{}: {line}", node.path.display()));
    }
    (unit, factor)
}

/// An array whose metadata are read.
struct Opened {
    path: PathBuf,
    array: Arc<Array<ZarrFiles>>,
    shape: Vec<u64>,
    element: Element,
    encoding: String,
    /// How its files hold several chunks each.
    sharding: Option<Sharding>,
}

impl Opened {
    fn open(path: &Path) -> Result<Self> {
        let Some(node) = Node::read(path)?.filter(|node| node.kind == Kind::Array) else {
            return Err(FormatError::damaged(path, "expected a Zarr array (zarr.json or .zarray), got none"));
        };
        let label_type = node.label_type()?;
        zarr_codecs::register();
        let mut files = ZarrFiles::new(path.to_owned()).with_answers_of(node.most_of_a_file(label_type));
        if let Some(most) = node.blosc_most(label_type) {
            files = files.with_blosc_of(most);
        }
        let array = Array::open(Arc::new(files), "/").map_err(|e| {
            FormatError::unsupported(
                path,
                one_line(&format!("the array's metadata: {e}")),
                "save the array with blosc, zstd, gzip, zlib or bz2",
            )
        })?;
        let shape = array.shape().to_vec();
        Ok(Self {
            path: path.to_owned(),
            shape,
            // `zarrs` gives numbers in the machine's own byte order.
            element: Element::new(label_type, cfg!(target_endian = "big")),
            encoding: node.encoding(),
            sharding: Sharding::of(&node.metadata),
            array: Arc::new(array),
        })
    }

    /// Names of the indices, if the array has some that name x, y or z.
    fn names(&self, node: &Node) -> Option<Vec<String>> {
        let of_xarray = node.attributes.get("_ARRAY_DIMENSIONS");
        let of_v3 = node.metadata.get("dimension_names");
        let of_funlib = node.attributes.get("axis_names");
        [of_v3, of_xarray, of_funlib].into_iter().flatten().find_map(|list| {
            let names: Vec<String> =
                list.as_array()?.iter().map(|name| name.as_str().unwrap_or_default().to_owned()).collect();
            let known = |name: &&String| space_of(&name.to_lowercase()).is_some();
            (names.len() == self.shape.len() && names.iter().filter(known).count() >= 2).then_some(names)
        })
    }

    fn volume_file(
        self,
        format: &'static str,
        roles: &[Role],
        choices: Vec<OpenChoice>,
        options: &OpenOptions,
        placed: impl FnOnce(VolumeInfo) -> Result<VolumeInfo>,
    ) -> Result<VolumeFile> {
        let Self { path, array, shape, element, encoding, sharding } = self;
        let axes = shape.iter().zip(roles).map(|(&size, &role)| FileAxis { size, role });
        let layout = Layout::new(&path, axes.rev().collect(), element.bytes())?;
        let wrong = |e: &dyn std::fmt::Display| {
            FormatError::damaged(
                &path,
                one_line(&format!("the grid of chunks of shape {}: {e}", shape_text(&shape))),
            )
        };
        let origin = vec![0; shape.len()];
        let outer: Vec<u64> =
            array.chunk_shape(&origin).map_err(|e| wrong(&e))?.iter().map(|n| n.get()).collect();
        if !matches!(array.chunk_grid().metadata().name(), "regular" | "regular_bounded") {
            return Err(FormatError::unsupported(
                &path,
                format!("the grid of chunks is {:?}", shorten(array.chunk_grid().metadata().name())),
                "save the array with a regular grid",
            ));
        }
        // A shard whose chunks do not divide it, or which has codecs around it, is read whole, as a chunk.
        let sharding = sharding.and_then(|sharding| {
            let fits = |(&outer, inner): (&u64, &NonZeroU64)| {
                NonZeroU64::new(outer / inner.get()).filter(|_| outer.is_multiple_of(inner.get()))
            };
            let chunks: Option<Vec<NonZeroU64>> = outer.iter().zip(&sharding.chunk).map(fits).collect();
            // So many that their number overflows have no index in any file.
            let count = chunks.iter().flatten().try_fold(1u64, |count, n| count.checked_mul(n.get()));
            let chunks = chunks.filter(|chunks| {
                chunks.len() == outer.len()
                    && sharding.chunk.len() == outer.len()
                    && count.is_some_and(|count| count < 1 << 40)
            })?;
            Some((sharding, chunks))
        });
        let (chunk, shard): (Vec<u64>, Vec<u64>) = match &sharding {
            Some((sharding, chunks)) => {
                (sharding.chunk.iter().map(|n| n.get()).collect(), chunks.iter().map(|n| n.get()).collect())
            }
            None => (outer.clone(), vec![1; outer.len()]),
        };
        let fill = array.fill_value().as_ne_bytes().to_vec();
        if fill.len() != element.bytes() {
            return Err(FormatError::damaged(&path, "the fill value has another type than the array"));
        }
        let fastest_first = |mut sizes: Vec<u64>| {
            sizes.reverse();
            sizes
        };
        let reader_path = path.clone();
        let shape = chunk.clone();
        Ok(VolumeFile {
            format,
            encoding,
            info: placed(VolumeInfo::new(layout.dims(), element.label_type))?,
            layout,
            element,
            layers: Vec::new(),
            choices,
            voxels: Voxels::Chunks(Chunks {
                chunk: fastest_first(chunk),
                shard: fastest_first(shard),
                fill,
                missing: options.missing_chunks.unwrap_or(MissingChunks::Fill),
                open: Box::new(move || Ok(Box::new(ZarrChunks::new(reader_path, array, shape, sharding)))),
            }),
        })
    }
}

/// The label type of a Zarr data type: `uint16` of version 3, `<u2` of version 2.
pub(crate) fn label_type(name: &str) -> Option<LabelType> {
    match name.trim_start_matches(['<', '>', '|']) {
        "bool" => Some(LabelType::U8),
        name => type_of_name(name).or_else(|| type_of_code(name)),
    }
}

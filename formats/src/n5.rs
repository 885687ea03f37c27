//! N5: folders of blocks (*N5 specification*, github.com/saalfeldlab/n5), and the levels of an image in N5 as N5-viewer, Paintera and COSEM have them.
//!
//! ```text
//! cells.n5/attributes.json               { "n5": "2.5.0" }
//! cells.n5/volumes/labels/attributes.json  { "dimensions": [x, y, z], "blockSize": […], "dataType": "uint64", "compression": {"type": "gzip"} }   --dataset
//! cells.n5/volumes/labels/0/0/1          a block: x/y/z (`n5_block`)
//! cells.n5/image/s0 s1 s2                levels: "downsamplingFactors": [2, 2, 1], "pixelResolution" or "resolution"                           --scale
//! ```
//! Sizes, lengths and offsets are x first. N5 has no fill value: an absent block is 0.
//!
//! `resolution` and `offset` are those of funlib and CREMI: the corner of the first voxel is at the offset, or at 0 ([`crate::array_place`]).
//! `axis_names` of funlib say another order of these attributes. N5-viewer's `pixelResolution` puts the *middle* of the finest level's first
//! voxel there.

use std::path::{Path, PathBuf};

use glam::DVec3;
use pumice_core::{Unit, VolumeInfo};
use serde_json::Value;

use crate::array_axes::shape_text;
use crate::choice::{self, ChoiceValue, OpenChoice, choose, refuse_absent};
use crate::chunks::Chunks;
use crate::element::{Element, type_of_name};
use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::layout::{FileAxis, Layout, Role};
use crate::levels::{Level, choose_level};
use crate::n5_block::{N5Blocks, compression};
use crate::options::{MissingChunks, OpenOptions};
use crate::placement::{self, one_unit};
use crate::store_files::is_file;
use crate::stores::{self, lengths, numbers};
use crate::volume_file::{Format, Takes, VolumeFile, Voxels};

/// N5 folders.
pub(crate) const FORMAT: Format = Format {
    name: "N5",
    takes: Takes { dataset: true, scale: true, missing_chunks: true, ..Takes::NOTHING },
    recognises: |folder, _| is_file(&folder.join("attributes.json")),
    read,
};

/// A group or data set: its folder and its attributes.
#[derive(Clone, Debug)]
struct Node {
    path: PathBuf,
    attributes: Value,
}

impl Node {
    fn read(path: &Path) -> Result<Self> {
        // Groups need no attributes.
        let attributes = stores::json(path, "attributes.json")?.unwrap_or(Value::Null);
        Ok(Self { path: path.to_owned(), attributes })
    }

    fn dims(&self) -> Option<Vec<u64>> {
        numbers(self.attributes.get("dimensions")).filter(|dims| !dims.is_empty())
    }

    /// Data sets s0, s1, … below a group.
    fn levels(&self) -> Result<Vec<Self>> {
        let mut levels = Vec::new();
        while let path = self.path.join(format!("s{}", levels.len()))
            && is_file(&path.join("attributes.json"))
        {
            let level = Self::read(&path)?;
            if level.dims().is_none() {
                break;
            }
            levels.push(level);
        }
        Ok(levels)
    }
}

/// Deepest level at which data sets are looked for.
const MOST_DEPTH: usize = 5;

fn read(folder: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    let mut choices = Vec::new();
    let node = choose_dataset(&Node::read(folder)?, options, &mut choices)?;
    if node.dims().is_some() {
        if let Some(scale) = &options.scale {
            return Err(FormatError::NotApplicable {
                path: node.path,
                option: format!("--scale {scale}"),
                why: "a data set by itself has one level".into(),
            });
        }
        // A level that is opened by its own path is described by its group, too.
        let group = node
            .path
            .parent()
            .filter(|p| !p.as_os_str().is_empty())
            .map(Node::read)
            .transpose()
            .ok()
            .flatten();
        let place = Place::of(&node, group.as_ref(), None);
        return of_dataset(&node, place, options, choices);
    }
    let group = if node.levels()?.is_empty() { Node::read(&node.path.join("data"))? } else { node };
    let levels = group.levels()?;
    let places: Vec<Place> =
        levels.iter().map(|level| Place::of(level, Some(&group), levels.first())).collect();
    let unit = places.first().map_or(Unit::Unknown, |place| place.unit);
    let described: Vec<Level> = levels
        .iter()
        .zip(&places)
        .map(|(level, place)| {
            let dims = level.dims().unwrap_or_default();
            let dims = [0, 1, 2].map(|a| dims.get(a).copied().unwrap_or(1));
            Level { dims: Some(dims), spacing: place.lengths }
        })
        .collect();
    let number = choose_level(&group.path, &described, unit, options, &mut choices)?;
    of_dataset(&levels[number], places[number].clone(), options, choices)
}

/// Where the voxels of a data set lie.
#[derive(Clone, Debug)]
struct Place {
    lengths: [f64; 3],
    /// Middle of the first voxel.
    origin: [f64; 3],
    unit: Unit,
    /// Whether the attributes say it.
    is_stated: bool,
    /// Lines about units that are not known.
    unknown: Vec<String>,
}

/// Lengths of a voxel along x, y, z as attributes state them.
struct Stated {
    lengths: [f64; 3],
    /// Names of units along x, y, z.
    units: [Option<String>; 3],
    /// Whether they are `resolution`, whose offset is a corner.
    is_corner: bool,
}

impl Place {
    /// From the attributes of a data set, of the group of its levels, and of the finest level.
    fn of(node: &Node, group: Option<&Node>, finest: Option<&Node>) -> Self {
        let three = |list: Option<Vec<f64>>| list.and_then(|list| <[f64; 3]>::try_from(list.get(..3)?).ok());
        let stated = |node: &Node| {
            let pixel = node.attributes.get("pixelResolution");
            let of_pixel = pixel.and_then(|p| three(lengths(Some(p.get("dimensions").unwrap_or(p)))));
            let is_corner = of_pixel.is_none();
            let of_funlib = || ordered(node, "resolution").or_else(|| ordered(node, "voxel_size"));
            let lengths = of_pixel.or_else(of_funlib)?;
            let unit = pixel.and_then(|p| p.get("unit")).or_else(|| node.attributes.get("unit"));
            let units = names(unit.or_else(|| node.attributes.get("units")));
            let units = if is_corner { order(node, 3).map(|n| units[n].clone()) } else { units };
            Some(Stated { lengths, units, is_corner })
        };
        let own_factors = three(lengths(node.attributes.get("downsamplingFactors")));
        // COSEM writes a transformation, in the order of its own axes.
        let transform = node.attributes.get("transform").and_then(cosem);
        if let Some((lengths, origin, units)) = transform {
            let (unit, factor, unknown) = one_unit(units.each_ref().map(Option::as_deref));
            let [lengths, origin] = [lengths, origin].map(|list| [0, 1, 2].map(|a| list[a] * factor[a]));
            return Self { lengths, origin, unit, is_stated: true, unknown };
        }
        // The resolution of a level without factors is its own; with factors it is that of the finest level.
        let base = stated(node).or_else(|| finest.and_then(stated)).or_else(|| group.and_then(stated));
        let number =
            node.path.file_name().and_then(|name| name.to_str()?.strip_prefix('s')?.parse::<usize>().ok());
        let of_group = group.and_then(|group| three(lengths(group.attributes.get("scales")?.get(number?))));
        let factors = own_factors.or(of_group).unwrap_or([1.0; 3]);
        let offset = |node: &Node| ordered(node, "offset");
        let offset = offset(node).or_else(|| finest.and_then(offset)).or_else(|| group.and_then(offset));
        let is_stated = base.is_some();
        // An offset alone is one of voxels of length 1.
        let base = base.unwrap_or(Stated {
            lengths: [1.0; 3],
            units: Default::default(),
            is_corner: offset.is_some(),
        });
        let (unit, factor, unknown) = one_unit(base.units.each_ref().map(Option::as_deref));
        let offset = offset.unwrap_or_default();
        let fine = [0, 1, 2].map(|a| base.lengths[a] * factor[a]);
        // Averages of `factor` voxels lie in their middle: all levels begin at the same corner.
        let first = if base.is_corner { 0.0 } else { 1.0 };
        Self {
            lengths: [0, 1, 2].map(|a| fine[a] * factors[a]),
            origin: [0, 1, 2].map(|a| offset[a] * factor[a] + fine[a] * (factors[a] - first) / 2.0),
            unit,
            is_stated,
            unknown,
        }
    }
}

/// Where x, y, z are in a list of attributes of `count` axes: in this order, unless funlib's `axis_names` say otherwise.
fn order(node: &Node, count: usize) -> [usize; 3] {
    let all: Vec<&str> = node
        .attributes
        .get("axis_names")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    // Three numbers of more axes are those of space.
    let space = |name: &&str| ["x", "y", "z"].iter().any(|space| name.eq_ignore_ascii_case(space));
    let all: Vec<&str> = if all.len() == count { all } else { all.into_iter().filter(space).collect() };
    let at =
        |space: &str| all.iter().position(|name| name.eq_ignore_ascii_case(space)).filter(|&n| n < count);
    match [at("x"), at("y"), at("z")] {
        [Some(x), Some(y), Some(z)] => [x, y, z],
        _ => [0, 1, 2],
    }
}

/// Numbers of an attribute along x, y, z.
fn ordered(node: &Node, name: &str) -> Option<[f64; 3]> {
    let list = lengths(node.attributes.get(name)).filter(|list| list.len() >= 3)?;
    Some(order(node, list.len()).map(|n| list[n]))
}

/// Names of units along x, y, z: one for all, or one an axis.
fn names(value: Option<&Value>) -> [Option<String>; 3] {
    let name = |value: &Value| value.as_str().filter(|name| !name.trim().is_empty()).map(str::to_owned);
    match value {
        Some(Value::Array(list)) if list.len() > 1 => [0, 1, 2].map(|a| name(list.get(a)?)),
        Some(Value::Array(list)) => [0, 1, 2].map(|_| name(list.first()?)),
        Some(one) => [0, 1, 2].map(|_| name(one)),
        None => Default::default(),
    }
}

/// Lengths, place and names of units along x, y, z.
type Transform = ([f64; 3], [f64; 3], [Option<String>; 3]);

/// What COSEM's `transform` says, whose axes have names.
fn cosem(transform: &Value) -> Option<Transform> {
    let axes = transform.get("axes")?.as_array()?;
    let (scale, moved) = (lengths(transform.get("scale"))?, lengths(transform.get("translate"))?);
    let units = transform.get("units");
    let mut found = ([1.0; 3], [0.0; 3], names(units));
    for (n, axis) in axes.iter().enumerate() {
        let space = ["x", "y", "z"].iter().position(|name| axis.as_str() == Some(name))?;
        found.0[space] = *scale.get(n)?;
        found.1[space] = *moved.get(n)?;
        if let Some(list) = units.and_then(Value::as_array).filter(|list| list.len() > 1) {
            found.2[space] = list.get(n).and_then(Value::as_str).map(str::to_owned);
        }
    }
    Some(found)
}

fn of_dataset(
    node: &Node,
    place: Place,
    options: &OpenOptions,
    mut choices: Vec<OpenChoice>,
) -> Result<VolumeFile> {
    let Node { path, attributes } = node;
    let wrong = |what: &str| FormatError::damaged(&path.join("attributes.json"), what.to_owned());
    let dims = node.dims().ok_or_else(|| wrong("dimensions: expected a list of whole numbers"))?;
    let block = numbers(attributes.get("blockSize"))
        .filter(|block| block.len() == dims.len() && !block.contains(&0))
        .ok_or_else(|| wrong("blockSize: expected a number above 0 for each of the dimensions"))?;
    if attributes.get("isLabelMultiset").and_then(Value::as_bool) == Some(true) {
        return Err(FormatError::unsupported(
            path,
            "the data set holds label multisets, several labels a voxel",
            "convert it to a data set of uint64",
        ));
    }
    let name = attributes.get("dataType").and_then(Value::as_str).unwrap_or("none");
    let label_type = type_of_name(name).ok_or_else(|| {
        FormatError::unsupported(
            path,
            format!("the data set's type is {}", shorten(name)),
            "labels are integers, or floating-point numbers that are whole",
        )
    })?;
    let coder = compression(attributes).map_err(|name| {
        FormatError::unsupported(
            path,
            format!("the blocks are compressed by {name}"),
            "write them as gzip, bzip2, zstd, blosc or raw",
        )
    })?;
    let element = Element::new(label_type, true);
    let mut axes = Vec::new();
    let mut has_layers = false;
    for (a, &size) in dims.iter().enumerate() {
        let role = match a {
            0..3 => Role::Space(a),
            _ if size == 1 => Role::Fixed(0),
            _ if has_layers => {
                return Err(FormatError::unsupported(
                    path,
                    format!("the data set has dimensions {}", shape_text(&dims)),
                    "save one label map a data set",
                ));
            }
            _ => {
                has_layers = true;
                Role::Fixed(choose(path, &choice::LAYER, options, size, &mut choices)?)
            }
        };
        axes.push(FileAxis { size, role });
    }
    let absent: &[&choice::Choice] = if has_layers {
        &[&choice::TIME, &choice::CHANNEL]
    } else {
        &[&choice::TIME, &choice::CHANNEL, &choice::LAYER]
    };
    refuse_absent(path, options, absent)?;
    let layout = Layout::new(path, axes, element.bytes())?;
    if !place.is_stated && options.spacing.is_none() {
        options.warnings.push(format!(
            "{}: the data set states no spacing; 1 is assumed along each axis (give --spacing x,y,z)",
            path.display()
        ));
    }
    for line in &place.unknown {
        options.warnings.push(format!("{}: {line}", path.display()));
    }
    let affine = placement::from_lengths(path, place.lengths, DVec3::from_array(place.origin), options)?;
    let mut info = VolumeInfo::new(layout.dims(), label_type).from_centre_affine(affine);
    info.unit = place.unit;
    let blocks = N5Blocks {
        folder: path.clone(),
        dims,
        block: block.clone(),
        compression: coder,
        element_bytes: element.bytes(),
    };
    Ok(VolumeFile {
        format: "N5",
        encoding: coder.map_or("raw", |coder| coder.name()).into(),
        info,
        layout,
        element,
        layers: Vec::new(),
        choices,
        voxels: Voxels::Chunks(Chunks {
            shard: vec![1; block.len()],
            chunk: block,
            fill: vec![0; element.bytes()],
            missing: options.missing_chunks.unwrap_or(MissingChunks::Fill),
            open: Box::new(move || Ok(Box::new(blocks))),
        }),
    })
}

/// The data set, or the group of levels, that the caller names, or the only one.
fn choose_dataset(node: &Node, options: &OpenOptions, open: &mut Vec<OpenChoice>) -> Result<Node> {
    let is_one = |node: &Node| -> Result<bool> {
        Ok(node.dims().is_some()
            || !node.levels()?.is_empty()
            || !Node { path: node.path.join("data"), attributes: Value::Null }.levels()?.is_empty())
    };
    let found = || -> Result<Vec<String>> {
        let fits = |path: &Path| {
            is_file(&path.join("attributes.json"))
                && Node::read(path).is_ok_and(|n| is_one(&n).unwrap_or(false))
        };
        stores::find_below(&node.path, MOST_DEPTH, &fits)
    };
    if let Some(name) = &options.dataset {
        let wrong =
            |what: String| FormatError::option(&node.path, format!("--dataset {}: {what}", shorten(name)));
        if node.dims().is_some() {
            return Err(FormatError::NotApplicable {
                path: node.path.clone(),
                option: format!("--dataset {}", shorten(name)),
                why: "the folder is a data set by itself".into(),
            });
        }
        let name = name.trim_matches('/');
        if name.is_empty() || name.contains('\\') || name.split('/').any(|part| part == "..") {
            return Err(wrong("expected a path below the folder".into()));
        }
        let chosen = Node::read(&node.path.join(name))?;
        if !is_one(&chosen)? {
            return Err(wrong(format!("there is no data set; there are: {}", found()?.join(", "))));
        }
        return Ok(chosen);
    }
    if is_one(node)? {
        return Ok(node.clone());
    }
    let names = found()?;
    let Some(first) = names.first() else {
        return Err(FormatError::unsupported(
            &node.path,
            "the folder holds no data set of N5",
            "open the folder of a data set",
        ));
    };
    if names.len() == 1 {
        options.warnings.push(format!("{}: the data set {first} is read", node.path.display()));
    } else {
        let value = |name: &String| ChoiceValue {
            value: name.clone(),
            text: Node::read(&node.path.join(name))
                .ok()
                .and_then(|n| n.dims())
                .map_or_else(String::new, |d| shape_text(&d)),
        };
        let listed: Vec<String> = names.iter().take(32).map(|name| shorten(name)).collect();
        open.push(OpenChoice {
            keyword: "dataset",
            option: "--dataset",
            what: format!("the folder has {} data sets", names.len()),
            listed: listed.join(", ") + if names.len() > 32 { ", …" } else { "" },
            values: names.iter().take(4096).map(value).collect(),
            count: names.len() as u64,
            assumed: None,
        });
    }
    Node::read(&node.path.join(first))
}

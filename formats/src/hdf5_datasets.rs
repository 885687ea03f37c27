//! The data sets of an HDF5 file that can be labels, and the choice of one.

use std::collections::BTreeSet;
use std::path::Path;

use hdf5_reader::datatype_api::H5Type as _;
use hdf5_reader::error::Error;
use hdf5_reader::group::Group;
use hdf5_reader::{Dataset, Datatype, Hdf5File};
use pumice_core::LabelType;
use pumice_core::error::one_line;

use crate::array_axes::shape_text;
use crate::choice::{ChoiceValue, OpenChoice};
use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::options::OpenOptions;

/// Deepest group that is looked into, and the largest number of objects that are looked at.
const MOST_DEPTH: usize = 16;
const MOST_OBJECTS: usize = 20_000;

/// The label type of a data set.
pub(crate) fn label_type(datatype: &Datatype) -> Option<LabelType> {
    Some(match datatype {
        Datatype::FixedPoint { size: 1, signed: false, .. } => LabelType::U8,
        Datatype::FixedPoint { size: 2, signed: false, .. } => LabelType::U16,
        Datatype::FixedPoint { size: 4, signed: false, .. } => LabelType::U32,
        Datatype::FixedPoint { size: 8, signed: false, .. } => LabelType::U64,
        Datatype::FixedPoint { size: 1, signed: true, .. } => LabelType::I8,
        Datatype::FixedPoint { size: 2, signed: true, .. } => LabelType::I16,
        Datatype::FixedPoint { size: 4, signed: true, .. } => LabelType::I32,
        Datatype::FixedPoint { size: 8, signed: true, .. } => LabelType::I64,
        Datatype::FloatingPoint { size: 4, .. } => LabelType::F32,
        Datatype::FloatingPoint { size: 8, .. } => LabelType::F64,
        mask if is_bool(mask) => LabelType::U8,
        _ => return None,
    })
}

/// Whether a type is h5py's bool: an enumeration of bytes, FALSE is 0 and TRUE is 1.
pub(crate) fn is_bool(datatype: &Datatype) -> bool {
    let Datatype::Enum { base, members } = datatype else { return false };
    let has = |name: &str, value: u8| members.iter().any(|m| m.name == name && m.value == [value]);
    matches!(**base, Datatype::FixedPoint { size: 1, .. })
        && members.len() == 2
        && has("FALSE", 0)
        && has("TRUE", 1)
}

/// Whether a data set is one that nobody needs to be asked for: whole numbers along three axes or more.
fn is_integer_volume(dataset: &Dataset) -> bool {
    // A mask beside labels is not asked about either.
    let is_integer = !is_bool(dataset.dtype())
        && label_type(dataset.dtype()).is_some_and(|t| !matches!(t, LabelType::F32 | LabelType::F64));
    is_integer && dataset.shape().iter().filter(|&&size| size > 1).count() >= 3
}

/// Whether a data set can be labels at all.
fn is_possible(dataset: &Dataset) -> bool {
    label_type(dataset.dtype()).is_some() && dataset.shape().iter().filter(|&&size| size > 1).count() >= 2
}

/// The data set that the caller names, or the only integer one with three axes.
pub(crate) fn choose(
    path: &Path,
    file: &Hdf5File,
    options: &OpenOptions,
    open: &mut Vec<OpenChoice>,
) -> Result<(String, Dataset)> {
    let damaged = |e: Error| match is_virtual(&e) {
        true => virtual_refused(path, &e),
        false => FormatError::damaged(path, one_line(&format!("HDF5: {e}"))),
    };
    let mut all = Vec::new();
    let mut seen = BTreeSet::new();
    let root = file.root_group().map_err(damaged)?;
    let named = options.dataset.as_deref().map(|name| name.trim_matches('/'));
    if let Some(name) = named {
        match file.dataset(name) {
            Ok(found) => return Ok((name.to_owned(), found)),
            Err(error) if is_virtual(&error) => return Err(damaged(error)),
            // The list below says which there are.
            Err(_) => {}
        }
    }
    collect(&root, "", 0, &mut seen, &mut all).map_err(damaged)?;
    all.sort_by(|a, b| a.0.cmp(&b.0));
    let listed = |of: &[(String, Dataset)]| {
        let more = if of.len() > 32 { ", …" } else { "" };
        of.iter().take(32).map(|(name, _)| shorten(name)).collect::<Vec<_>>().join(", ") + more
    };
    if let Some(name) = named {
        let names = if all.is_empty() { "none".to_owned() } else { listed(&all) };
        let what = format!("--dataset {}: the file has no such data set; it has: {names}", shorten(name));
        return Err(FormatError::option(path, what));
    }
    let volumes = all.iter().filter(|(_, dataset)| is_integer_volume(dataset)).count();
    if volumes > 0 {
        all.retain(|(_, dataset)| is_integer_volume(dataset));
    } else {
        all.retain(|(_, dataset)| is_possible(dataset));
    }
    if all.is_empty() {
        return Err(FormatError::unsupported(
            path,
            "the file has no data set of two or more axes whose numbers can be labels",
            "labels are arrays of whole numbers",
        ));
    }
    if all.len() > 1 {
        let value = |(name, dataset): &(String, Dataset)| ChoiceValue {
            value: name.clone(),
            text: format!("{} of {}", shape_text(dataset.shape()), type_text(dataset.dtype())),
        };
        open.push(OpenChoice {
            keyword: "dataset",
            option: "--dataset",
            what: format!("the file has {} data sets that may be the labels", all.len()),
            listed: listed(&all),
            values: all.iter().take(4096).map(value).collect(),
            count: all.len() as u64,
            assumed: None,
        });
    } else {
        options.warnings.push(format!("{}: the data set {} is read", path.display(), shorten(&all[0].0)));
    }
    Ok(all.swap_remove(0))
}

pub(crate) fn type_text(datatype: &Datatype) -> String {
    match label_type(datatype) {
        Some(known) => format!("{known:?}").to_lowercase(),
        None if matches!(datatype, Datatype::Enum { .. }) => "an enumeration of names".into(),
        None => format!("{} bytes that are no numbers", u8::element_size(datatype)),
    }
}

/// Layout class of a virtual data set (HDF5 file format 3.0, IV.A.2.i), which the crate does not read.
const VIRTUAL: u8 = 3;

fn is_virtual(error: &Error) -> bool {
    match error {
        Error::UnsupportedLayoutClass(class) => *class == VIRTUAL,
        Error::Context { source, .. } => is_virtual(source),
        _ => false,
    }
}

/// The line about a virtual data set, whose name the crate puts into its error: `child 'name' at 0x320`.
fn virtual_refused(path: &Path, error: &Error) -> FormatError {
    let text = error.to_string();
    let name = text.split('\'').nth(1).map_or_else(|| "one of the data sets".into(), shorten);
    FormatError::unsupported(
        path,
        one_line(&format!(
            "{name} is a virtual data set, put together from others, and keeps the others from being listed"
        )),
        "name another one by --dataset, or copy its values into a data set of its own",
    )
}

/// Adds all data sets below a group; `seen` has the addresses of the groups and data sets that were met, so that links in a circle end.
fn collect(
    group: &Group,
    name: &str,
    depth: usize,
    seen: &mut BTreeSet<u64>,
    all: &mut Vec<(String, Dataset)>,
) -> hdf5_reader::error::Result<()> {
    if depth > MOST_DEPTH || seen.len() > MOST_OBJECTS || !seen.insert(group.address()) {
        return Ok(());
    }
    let (groups, datasets) = group.members()?;
    let below = |child: &str| if name.is_empty() { child.to_owned() } else { format!("{name}/{child}") };
    for dataset in datasets {
        if seen.insert(dataset.address()) {
            all.push((below(dataset.name()), dataset));
        }
    }
    for child in groups {
        collect(&child, &below(child.name()), depth + 1, seen, all)?;
    }
    Ok(())
}

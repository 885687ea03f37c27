//! Arrays and groups of a Zarr hierarchy, and the choice of one: a data set of a plain group, a label image of a picture.

use std::path::{Path, PathBuf};

use pumice_core::LabelType;
use serde_json::Value;

use crate::array_axes::shape_text;
use crate::choice::{ChoiceValue, OpenChoice};
use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::ome_zarr;
use crate::options::OpenOptions;
use crate::stores::{self, numbers};
use crate::zarr;

/// What a folder of a hierarchy is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Array,
    Group,
}

/// An array or a group.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) path: PathBuf,
    pub(crate) kind: Kind,
    /// The content of `zarr.json` or `.zarray`; null for groups of version 2.
    pub(crate) metadata: Value,
    pub(crate) attributes: Value,
}

/// Deepest level at which arrays of a plain group are looked for.
const MOST_DEPTH: usize = 4;

/// Largest number of arrays that are listed in a line.
const MOST_LISTED: usize = 32;

impl Node {
    /// The node at a folder; `None` where there is none.
    pub(crate) fn read(path: &Path) -> Result<Option<Self>> {
        let path = path.to_owned();
        if let Some(metadata) = stores::json(&path, "zarr.json")? {
            let kind = match metadata.get("node_type").and_then(Value::as_str) {
                Some("array") => Kind::Array,
                Some("group") => Kind::Group,
                other => {
                    let got = other.map_or_else(|| "none".into(), shorten);
                    return Err(FormatError::damaged(
                        &path.join("zarr.json"),
                        format!("node_type: expected array or group, got {got}"),
                    ));
                }
            };
            let attributes = metadata.get("attributes").cloned().unwrap_or(Value::Null);
            return Ok(Some(Self { path, kind, metadata, attributes }));
        }
        let array = stores::json(&path, ".zarray")?;
        let group = stores::json(&path, ".zgroup")?;
        let attributes = stores::json(&path, ".zattrs")?;
        if array.is_none() && group.is_none() && attributes.is_none() {
            return Ok(None);
        }
        let kind = if array.is_some() { Kind::Array } else { Kind::Group };
        let (metadata, attributes) = (array.unwrap_or(Value::Null), attributes.unwrap_or(Value::Null));
        Ok(Some(Self { path, kind, metadata, attributes }))
    }

    pub(crate) fn shape(&self) -> Option<Vec<u64>> {
        numbers(self.metadata.get("shape"))
    }

    /// The type of an array's elements as its metadata name it.
    fn type_name(&self) -> String {
        let name = self.metadata.get("data_type").or_else(|| self.metadata.get("dtype"));
        match name {
            Some(Value::String(name)) => name.clone(),
            Some(other) => other.get("name").and_then(Value::as_str).unwrap_or("structured").to_owned(),
            None => "none".into(),
        }
    }

    /// The type of an array's labels.
    pub(crate) fn label_type(&self) -> Result<LabelType> {
        let name = self.type_name();
        zarr::label_type(&name).ok_or_else(|| {
            FormatError::unsupported(
                &self.path,
                format!("the array's type is {}", shorten(&name)),
                "labels are integers, or floating-point numbers that are whole",
            )
        })
    }

    /// Most bytes of a file with a chunk, or a shard, of an array: what cannot be compressed becomes a little longer, and a shard has an index.
    pub(crate) fn most_of_a_file(&self, label_type: LabelType) -> u64 {
        let of_v3 = || self.metadata.pointer("/chunk_grid/configuration/chunk_shape");
        let chunk = numbers(self.metadata.get("chunks").or_else(of_v3)).unwrap_or_default();
        let element = Element::new(label_type, false).bytes() as u64;
        let plain = chunk.iter().fold(element, |bytes, &size| bytes.saturating_mul(size));
        plain.saturating_mul(2).saturating_add(1 << 20)
    }

    /// Bytes of a chunk of an array of Zarr 2 whose chunks are frames of blosc.
    pub(crate) fn blosc_most(&self, label_type: LabelType) -> Option<u64> {
        let compressor = self.metadata.get("compressor")?.get("id")?.as_str()?;
        let chunk = numbers(self.metadata.get("chunks")).filter(|_| compressor == "blosc")?;
        let element = Element::new(label_type, false).bytes() as u64;
        Some(chunk.iter().fold(element, |bytes, &size| bytes.saturating_mul(size)))
    }

    /// Names of the codecs, such as `blosc` or `sharded zstd`.
    pub(crate) fn encoding(&self) -> String {
        if let Some(codecs) = self.metadata.get("codecs").and_then(Value::as_array) {
            return encoding_of(codecs);
        }
        let id = self.metadata.get("compressor").and_then(|c| c.get("id")).and_then(Value::as_str);
        id.map_or_else(|| "raw".into(), shorten)
    }
}

fn encoding_of(codecs: &[Value]) -> String {
    let mut names = Vec::new();
    for codec in codecs {
        let name = codec.as_str().or_else(|| codec.get("name")?.as_str()).unwrap_or_default();
        if name == "sharding_indexed" {
            let inner = codec.pointer("/configuration/codecs").and_then(Value::as_array);
            names.push(format!("sharded {}", inner.map_or_else(String::new, |codecs| encoding_of(codecs))));
        } else if !matches!(name, "bytes" | "transpose" | "crc32c") {
            names.push(shorten(name));
        }
    }
    if names.is_empty() { "raw".into() } else { names.join(", ") }
}

/// Whether a group is an image, or holds label images.
fn is_image(node: &Node) -> bool {
    let ome = ome_zarr::of(&node.attributes);
    ome.get("multiscales").is_some() || ome.get("labels").is_some()
}

/// The array or image of a plain group that the caller names, or the only one; `None` where the node itself is one.
pub(crate) fn choose_dataset(
    node: &Node,
    options: &OpenOptions,
    open: &mut Vec<OpenChoice>,
) -> Result<Option<Node>> {
    if let Some(name) = &options.dataset {
        let wrong =
            |what: String| FormatError::option(&node.path, format!("--dataset {}: {what}", shorten(name)));
        let name = name.trim_matches('/');
        if node.kind == Kind::Array {
            return Err(FormatError::NotApplicable {
                path: node.path.clone(),
                option: format!("--dataset {}", shorten(name)),
                why: "the folder is an array by itself".into(),
            });
        }
        if !ome_zarr::is_below(name) {
            return Err(wrong("expected a path below the folder".into()));
        }
        return match Node::read(&node.path.join(name))? {
            Some(found) => Ok(Some(found)),
            None => {
                let names = candidates(node)?.into_iter().map(|(name, _)| name).collect::<Vec<_>>();
                Err(wrong(format!("there is no array or group; there are: {}", listed(&names))))
            }
        };
    }
    if node.kind == Kind::Array || is_image(node) || has_labels(node)? {
        return Ok(None);
    }
    let found = candidates(node)?;
    let names: Vec<String> = found.iter().map(|(name, _)| name.clone()).collect();
    match found.len() {
        0 => Err(FormatError::unsupported(
            &node.path,
            "the group holds no array of two or more axes whose numbers can be labels",
            "labels are arrays of whole numbers",
        )),
        1 => {
            options.warnings.push(format!("{}: the data set {} is read", node.path.display(), names[0]));
            Ok(found.into_iter().next().map(|(_, node)| node))
        }
        count => {
            let value = |(name, node): &(String, Node)| ChoiceValue {
                value: name.clone(),
                text: node.shape().map_or_else(
                    || "image".into(),
                    |s| format!("{} of {}", shape_text(&s), node.type_name()),
                ),
            };
            open.push(OpenChoice {
                keyword: "dataset",
                option: "--dataset",
                what: format!("the group has {count} data sets that may be the labels"),
                listed: listed(&names),
                values: found.iter().take(4096).map(value).collect(),
                count: count as u64,
                assumed: None,
            });
            Ok(found.into_iter().next().map(|(_, node)| node))
        }
    }
}

fn listed(names: &[String]) -> String {
    let more = if names.len() > MOST_LISTED { ", …" } else { "" };
    let some: Vec<String> = names.iter().take(MOST_LISTED).map(|name| shorten(name)).collect();
    some.join(", ") + more
}

/// Arrays below a group that can be labels, and images.
fn candidates(group: &Node) -> Result<Vec<(String, Node)>> {
    let is_one = |path: &Path| match Node::read(path) {
        Ok(Some(node)) => node.kind == Kind::Array || is_image(&node),
        _ => false,
    };
    let mut found = Vec::new();
    for name in stores::find_below(&group.path, MOST_DEPTH, &is_one)? {
        let Some(node) = Node::read(&group.path.join(&name))? else { continue };
        let fits = node.kind == Kind::Group
            || (node.label_type().is_ok()
                && node.shape().is_some_and(|s| s.iter().filter(|&&n| n > 1).count() >= 2));
        if fits {
            found.push((name, node));
        }
    }
    Ok(found)
}

/// The names of label images of a picture, and the group that holds them.
fn labels_of(node: &Node) -> Result<Option<(Node, Vec<String>)>> {
    if node.kind == Kind::Array {
        return Ok(None);
    }
    // The group `labels` itself, or that of a picture.
    let names = ome_zarr::label_images(&node.attributes);
    if !names.is_empty() {
        return Ok(Some((node.clone(), names)));
    }
    let Some(labels) = Node::read(&node.path.join("labels"))? else { return Ok(None) };
    let names = ome_zarr::label_images(&labels.attributes);
    Ok((!names.is_empty()).then_some((labels, names)))
}

fn has_labels(node: &Node) -> Result<bool> {
    Ok(labels_of(node)?.is_some())
}

/// The label image of a picture that the caller names, or the only one; `None` where the node has none and is read itself.
pub(crate) fn choose_label(
    node: &Node,
    options: &OpenOptions,
    open: &mut Vec<OpenChoice>,
) -> Result<Option<Node>> {
    let Some((group, names)) = labels_of(node)? else {
        return match &options.label {
            None => Ok(None),
            Some(name) => Err(FormatError::NotApplicable {
                path: node.path.clone(),
                option: format!("--label {}", shorten(name)),
                why: "the folder has no label images beside a picture".into(),
            }),
        };
    };
    let read = |name: &str| {
        Node::read(&group.path.join(name))?.ok_or_else(|| {
            FormatError::damaged(&group.path, format!("the label image {} is not there", shorten(name)))
        })
    };
    if let Some(name) = &options.label {
        if !names.contains(name) {
            let what = format!("there is no label image {:?}; there are: {}", shorten(name), listed(&names));
            return Err(FormatError::option(&node.path, what));
        }
        return read(name).map(Some);
    }
    if names.len() == 1 {
        options.warnings.push(format!(
            "{}: the label image {} is read",
            node.path.display(),
            shorten(&names[0])
        ));
    } else {
        open.push(OpenChoice {
            keyword: "label",
            option: "--label",
            what: format!("the picture has {} label images", names.len()),
            listed: listed(&names),
            values: names
                .iter()
                .take(4096)
                .map(|n| ChoiceValue { value: n.clone(), text: String::new() })
                .collect(),
            count: names.len() as u64,
            assumed: None,
        });
    }
    read(&names[0]).map(Some)
}

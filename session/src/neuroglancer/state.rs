//! Reads what of a state matters for a picture.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

use glam::DQuat;
use pumice_core::error::one_line;
use pumice_formats::is_on_server;
use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, Visitor};
use serde_json::Value;

use super::source::{local_path, unescaped};
use crate::error::SessionError;
use crate::figure::css_color;

/// Largest file that is looked at, as large as the largest scene: whether a file is a state or a scene shows only inside.
const MOST_BYTES: u64 = 1 << 29;

/// The axes that Neuroglancer displays unless it is told others.
const AXES: [&str; 3] = ["x", "y", "z"];

/// A state of Neuroglancer, as far as a picture shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Metres of one step along x, y and z; `None` where the state leaves them to its first layer, whose voxels they then are.
    pub(super) metres: Option<[f64; 3]>,
    /// How much longer than that the steps are drawn.
    pub(super) stretch: [f64; 3],
    /// What the view turns around, in steps.
    pub(super) position: Option<[f64; 3]>,
    /// From the view, x right, y down, z away, to the volume.
    pub(super) orientation: DQuat,
    /// Height of the picture at the position.
    pub(super) height: Option<Height>,
    pub(super) is_orthographic: bool,
    /// Display colour behind everything, sRGB-encoded.
    pub(super) background_srgb: Option<[f32; 3]>,
    pub(super) layers: Vec<Layer>,
    /// What a picture does not show of the state, a line each.
    pub(super) left_out: Vec<String>,
}

/// A height as it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Height {
    /// In steps of the axis whose steps are the shortest.
    Steps(f64),
    Metres(f64),
}

/// A layer of segments that are shown.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layer {
    pub(super) name: String,
    pub(super) url: String,
    /// The shown segments, and of those that are joined the lowest, whose colour all have.
    pub(super) segments: BTreeMap<u64, u64>,
    /// Display colours of segments, sRGB-encoded, by id.
    pub(super) colors_srgb: BTreeMap<u64, [f32; 3]>,
    pub(super) common_srgb: Option<[f32; 3]>,
    pub(super) seed: u32,
    pub(super) saturation: f32,
    pub(super) alpha: f32,
}

impl State {
    /// Reads a state: JSON, or a link in which it stands after `#!`.
    ///
    /// # Errors
    /// One line that names the field.
    pub fn parse(text: &str) -> Result<Self, String> {
        let read = || {
            let json = match link(text) {
                Some(part) => state_of_link(part)?,
                None => text.to_owned(),
            };
            let raw: RawState = serde_json::from_str(&json).map_err(|e| e.to_string())?;
            raw.state()
        };
        // (Names and links may have anything in them.)
        let mut state = read().map_err(|what: String| one_line(&what))?;
        state.left_out.iter_mut().for_each(|line| *line = one_line(line));
        Ok(state)
    }

    /// Whether a text may be a state: a link, or a JSON object with layers and without what a scene has.
    pub fn is_one(text: &str) -> bool {
        #[derive(Deserialize)]
        struct Members {
            version: Option<Value>,
            instances: Option<Value>,
            layers: Option<Value>,
        }
        link(text).is_some()
            || serde_json::from_str::<Members>(text)
                .is_ok_and(|m| m.layers.is_some() && m.version.is_none() && m.instances.is_none())
    }

    /// The layers that are drawn, by name, with the path or the URL of each one's volume. Relative URLs count from `folder`.
    ///
    /// # Errors
    /// [`SessionError::Caller`] names a layer whose server is of a kind that is not read.
    pub fn sources(&self, folder: &Path) -> Result<Vec<(String, PathBuf)>, SessionError> {
        let source = |layer: &Layer| {
            let (name, url) = (&layer.name, &layer.url);
            let on_server = || Some(PathBuf::from(url)).filter(|path| is_on_server(path));
            let found = local_path(url, folder).or_else(on_server).ok_or_else(|| {
                SessionError::Caller(one_line(&format!(
                    "layer {name}: {url}: expected a file, or a store of Zarr, N5 or Neuroglancer at https://, gs:// or s3://"
                )))
            });
            found.map(|path| (name.clone(), path))
        };
        self.layers.iter().map(source).collect()
    }

    /// Whether a path is a link in place of one.
    pub fn is_link(path: &Path) -> bool {
        path.to_str().is_some_and(|text| link(text).is_some())
    }

    /// The state that a path stands for: a link in place of a path, or a file with one; `None` for any other file.
    ///
    /// # Errors
    /// When the file cannot be read, and as [`State::parse`].
    pub fn at(path: &Path) -> Result<Option<Self>, String> {
        let text = match path.to_str().filter(|text| link(text).is_some()) {
            Some(text) => text.to_owned(),
            None => {
                match String::from_utf8(pumice_core::read_input(path, MOST_BYTES).map_err(|e| e.to_string())?)
                {
                    // Editors of Windows put a byte order mark before a text.
                    Ok(text) => text.strip_prefix('\u{FEFF}').map(str::to_owned).unwrap_or(text),
                    Err(_) => return Ok(None),
                }
            }
        };
        if Self::is_one(&text) { Self::parse(&text).map(Some) } else { Ok(None) }
    }
}

/// What follows `#!` in a link.
pub(super) fn link(text: &str) -> Option<&str> {
    let text = text.trim();
    let (place, state) = text.split_once("#!")?;
    (place.starts_with("http://") || place.starts_with("https://")).then_some(state)
}

fn state_of_link(part: &str) -> Result<String, String> {
    let text = unescaped(part).ok_or("link: expected Unicode behind #!")?;
    if text.trim_start().starts_with('{') {
        return Ok(json_of_link(&text));
    }
    let short: String = text.chars().take(80).collect();
    Err(format!("link: the state lies on a server, at {short}: save it as JSON, and give the file"))
}

/// The JSON of the text in a link. There a comma may be an underscore, and strings may have single quotes, because browsers escape the other
/// characters. JSON stays as it is.
fn json_of_link(text: &str) -> String {
    let mut json = String::with_capacity(text.len());
    let mut quote = None;
    let mut characters = text.chars();
    while let Some(c) = characters.next() {
        match (quote, c) {
            (None, '_') => json.push(','),
            (None, '"' | '\'') => {
                quote = Some(c);
                json.push('"');
            }
            (Some(open), _) if c == open => {
                quote = None;
                json.push('"');
            }
            (Some(_), '"') => json.push_str("\\\""),
            // JSON has no escape for a single quote.
            (Some(_), '\\') => match characters.next() {
                Some('\'') => json.push('\''),
                escaped => json.extend(['\\'].into_iter().chain(escaped)),
            },
            _ => json.push(c),
        }
    }
    json
}

/// A JSON object whose members keep their order.
#[derive(Debug)]
struct InOrder<T>(Vec<(String, T)>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for InOrder<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Members<T>(std::marker::PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Members<T> {
            type Value = InOrder<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<InOrder<T>, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                }
                Ok(InOrder(members))
            }
        }
        deserializer.deserialize_map(Members(std::marker::PhantomData))
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct RawState {
    dimensions: Option<InOrder<(f64, String)>>,
    #[serde(default)]
    relative_display_scales: BTreeMap<String, f64>,
    display_dimensions: Option<Vec<String>>,
    position: Option<Vec<f64>>,
    projection_orientation: Option<[f64; 4]>,
    projection_scale: Option<f64>,
    projection_background_color: Option<String>,
    layout: Option<Value>,
    /// A list, or by name.
    layers: Value,
    // What states had before 2019.
    navigation: Option<RawNavigation>,
    perspective_orientation: Option<[f64; 4]>,
    perspective_zoom: Option<f64>,
    perspective_view_background_color: Option<String>,
}

#[derive(Debug, Deserialize)]
struct RawNavigation {
    pose: Option<RawPose>,
}

#[derive(Debug, Deserialize)]
struct RawPose {
    position: Option<RawPosition>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct RawPosition {
    /// In nanometres.
    voxel_size: Option<[f64; 3]>,
    voxel_coordinates: Option<[f64; 3]>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct RawLayer {
    #[serde(rename = "type")]
    kind: Option<String>,
    source: Option<Value>,
    visible: Option<bool>,
    archived: Option<bool>,
    segments: Option<Vec<Value>>,
    #[serde(default)]
    segment_colors: BTreeMap<String, String>,
    segment_default_color: Option<String>,
    color_seed: Option<f64>,
    saturation: Option<f32>,
    object_alpha: Option<f32>,
    #[serde(default)]
    equivalences: Vec<Vec<Value>>,
    linked_segmentation_group: Option<String>,
}

/// Steps along x, y and z.
struct Steps {
    metres: Option<[f64; 3]>,
    /// How much longer they are drawn.
    stretch: [f64; 3],
    /// Which of the state's dimensions they are.
    places: [usize; 3],
}

impl RawState {
    fn state(self) -> Result<State, String> {
        let Steps { metres, stretch, places } = self.steps()?;
        let legacy = self.navigation.as_ref().and_then(|n| n.pose.as_ref()).and_then(|p| p.position.as_ref());
        let position = match &self.position {
            Some(place) => Some(places.map(|at| place.get(at).copied().unwrap_or(f64::NAN))),
            None => legacy.and_then(|p| p.voxel_coordinates),
        };
        if position.is_some_and(|place| place.iter().any(|c| !c.is_finite())) {
            return Err("position: expected a number for each of the dimensions".into());
        }
        let quaternion =
            self.projection_orientation.or(self.perspective_orientation).unwrap_or([0.0, 0.0, 0.0, 1.0]);
        let orientation = DQuat::from_array(quaternion);
        if !(orientation.length() > 0.0 && orientation.is_finite()) {
            return Err(format!("projectionOrientation: expected a rotation, got {quaternion:?}"));
        }
        let old_zoom = |zoom: f64| 200.0 * (std::f64::consts::PI / 8.0).tan() * 1e-9 * zoom;
        let height = self
            .projection_scale
            .map(Height::Steps)
            .or(self.perspective_zoom.map(|zoom| Height::Metres(old_zoom(zoom))));
        if let Some(Height::Steps(h) | Height::Metres(h)) = height
            && !(h > 0.0 && h.is_finite())
        {
            return Err("projectionScale: expected a number above 0".into());
        }
        let background = self.projection_background_color.or(self.perspective_view_background_color);
        let background_srgb = background.map(|text| color("projectionBackgroundColor", &text)).transpose()?;
        let orthographic = self.layout.as_ref().and_then(|layout| layout.get("orthographicProjection"));
        let mut left_out = Vec::new();
        let layers = layers(self.layers, &mut left_out)?;
        Ok(State {
            metres,
            stretch,
            position,
            orientation: orientation.normalize(),
            height,
            is_orthographic: orthographic.and_then(Value::as_bool).unwrap_or(false),
            background_srgb,
            layers,
            left_out,
        })
    }

    fn steps(&self) -> Result<Steps, String> {
        if self.display_dimensions.as_ref().is_some_and(|axes| *axes != AXES) {
            return Err("displayDimensions: expected x, y, z; other views are not drawn".into());
        }
        let Some(InOrder(dimensions)) = &self.dimensions else {
            let legacy =
                self.navigation.as_ref().and_then(|n| n.pose.as_ref()?.position.as_ref()?.voxel_size);
            let metres = legacy.map(|nanometres| lengths(nanometres.map(|n| 1e-9 * n))).transpose()?;
            return Ok(Steps { metres, stretch: self.stretch()?, places: [0, 1, 2] });
        };
        let mut places = [0; 3];
        let mut metres = [0.0; 3];
        for (a, axis) in AXES.iter().enumerate() {
            let place = dimensions.iter().position(|(name, _)| name == axis);
            places[a] =
                place.ok_or_else(|| format!("dimensions: expected x, y and z, and there is no {axis}"))?;
            let (scale, unit) = &dimensions[places[a]].1;
            metres[a] = scale * metres_of(unit)?;
        }
        Ok(Steps { metres: Some(lengths(metres)?), stretch: self.stretch()?, places })
    }

    fn stretch(&self) -> Result<[f64; 3], String> {
        lengths(AXES.map(|axis| self.relative_display_scales.get(axis).copied().unwrap_or(1.0)))
    }
}

fn lengths(lengths: [f64; 3]) -> Result<[f64; 3], String> {
    match lengths.iter().all(|&l| l > 0.0 && l.is_finite()) {
        true => Ok(lengths),
        false => Err(format!("dimensions: expected lengths above 0, got {lengths:?}")),
    }
}

/// Metres of a unit of length.
fn metres_of(unit: &str) -> Result<f64, String> {
    match unit {
        // Without a unit only proportions count.
        "m" | "" => Ok(1.0),
        "mm" => Ok(1e-3),
        "um" | "µm" => Ok(1e-6),
        "nm" => Ok(1e-9),
        _ => Err(format!("dimensions: expected a length in m, got one in {unit:?}")),
    }
}

fn color(field: &str, text: &str) -> Result<[f32; 3], String> {
    css_color(text).map_err(|e| format!("{field}: {e}"))
}

fn layers(raw: Value, left_out: &mut Vec<String>) -> Result<Vec<Layer>, String> {
    let raw: Vec<(String, Value)> = match raw {
        Value::Array(list) => list
            .into_iter()
            .enumerate()
            .map(|(i, layer)| {
                let name = layer.get("name").and_then(Value::as_str);
                (name.map_or_else(|| format!("number {i}"), str::to_owned), layer)
            })
            .collect(),
        Value::Object(by_name) => by_name.into_iter().collect(),
        _ => return Err("layers: expected a list".into()),
    };
    let raw: Vec<(String, RawLayer)> = raw
        .into_iter()
        .map(|(name, layer)| match serde_json::from_value(layer) {
            Ok(layer) => Ok((name, layer)),
            Err(e) => Err(format!("layer {name}: {e}")),
        })
        .collect::<Result<_, _>>()?;
    let mut layers = Vec::new();
    for (name, layer) in &raw {
        // Before there were types, a layer with segments was one of them.
        let is_segmentation = layer.kind.as_deref() == Some("segmentation")
            || (layer.kind.is_none() && layer.segments.is_some());
        if layer.visible == Some(false) || layer.archived == Some(true) {
            continue;
        }
        if !is_segmentation {
            let kind = layer.kind.as_deref().unwrap_or("no type");
            left_out.push(format!("layer {name} is left out: {kind}, not segmentation"));
            continue;
        }
        // A linked layer has the segments of the other, and its own colours.
        let chosen = match &layer.linked_segmentation_group {
            None => layer,
            Some(other) => {
                raw.iter().find(|(name, _)| name == other).map(|(_, layer)| layer).ok_or_else(|| {
                    format!("layer {name}: there is no layer {other}, with which it is linked")
                })?
            }
        };
        let segments = shown(name, chosen)?;
        if segments.is_empty() {
            left_out.push(format!("layer {name} is left out: no segment is chosen"));
            continue;
        }
        layers.push(Layer {
            url: url(name, layer.source.as_ref())?,
            segments,
            colors_srgb: layer
                .segment_colors
                .iter()
                .map(|(id, text)| {
                    Ok((self::id(name, id)?, color(&format!("layer {name}: segmentColors"), text)?))
                })
                .collect::<Result<_, String>>()?,
            common_srgb: layer
                .segment_default_color
                .as_deref()
                .map(|text| color(&format!("layer {name}: segmentDefaultColor"), text))
                .transpose()?,
            seed: layer.color_seed.unwrap_or(0.0) as u32,
            saturation: layer.saturation.unwrap_or(1.0).clamp(0.0, 1.0),
            alpha: layer.object_alpha.unwrap_or(1.0).clamp(0.0, 1.0),
            name: name.clone(),
        });
    }
    Ok(layers)
}

fn id(layer: &str, text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("layer {layer}: expected the id of a segment, got {text:?}"))
}

fn id_of(layer: &str, value: &Value) -> Result<u64, String> {
    match value {
        Value::String(text) => id(layer, text),
        _ => {
            value.as_u64().ok_or_else(|| format!("layer {layer}: expected the id of a segment, got {value}"))
        }
    }
}

/// The segments that a layer shows, with those that are joined to them: each with the lowest of its own, whose colour it has.
fn shown(name: &str, layer: &RawLayer) -> Result<BTreeMap<u64, u64>, String> {
    // Sets of segments that are joined, by member.
    let mut set_of: BTreeMap<u64, usize> = BTreeMap::new();
    let mut sets: Vec<BTreeSet<u64>> = Vec::new();
    for joined in &layer.equivalences {
        let mut whole: BTreeSet<u64> = joined.iter().map(|v| id_of(name, v)).collect::<Result<_, _>>()?;
        let others: BTreeSet<usize> = whole.iter().filter_map(|id| set_of.get(id).copied()).collect();
        for other in others {
            whole.append(&mut sets[other]);
        }
        set_of.extend(whole.iter().map(|&id| (id, sets.len())));
        sets.push(whole);
    }
    let mut segments = BTreeMap::new();
    for value in layer.segments.iter().flatten() {
        // Segments behind an exclamation mark are listed, and not shown.
        if value.as_str().is_some_and(|text| text.starts_with('!')) {
            continue;
        }
        let id = id_of(name, value)?;
        match set_of.get(&id).map(|&set| &sets[set]) {
            Some(set) => {
                let lowest = set.first().copied().unwrap_or(id);
                segments.extend(set.iter().map(|&member| (member, lowest)));
            }
            None => {
                segments.insert(id, id);
            }
        }
    }
    // 0 is what no segment has.
    segments.remove(&0);
    Ok(segments)
}

/// The URL of a layer's volume: that of its first source.
fn url(layer: &str, source: Option<&Value>) -> Result<String, String> {
    let first = match source {
        Some(Value::Array(list)) => list.first(),
        other => other,
    };
    let wrong = || format!("layer {layer}: source: expected a URL");
    match first.ok_or_else(wrong)? {
        Value::String(url) => Ok(url.clone()),
        Value::Object(fields) => {
            let placed =
                fields.get("transform").is_some_and(|t| t.get("matrix").is_some_and(|m| !is_identity(m)));
            if placed {
                return Err(format!(
                    "layer {layer}: source: expected a volume without a transform, which is not drawn"
                ));
            }
            fields.get("url").and_then(Value::as_str).map(str::to_owned).ok_or_else(wrong)
        }
        _ => Err(wrong()),
    }
}

fn is_identity(matrix: &Value) -> bool {
    let rows = matrix.as_array().map_or(&[][..], |rows| rows);
    rows.iter().enumerate().all(|(r, row)| {
        let row = row.as_array().map_or(&[][..], |row| row);
        row.iter().enumerate().all(|(c, v)| v.as_f64() == Some(if r == c { 1.0 } else { 0.0 }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names and links with line breaks, as they are and escaped.
    #[test]
    fn errors_are_one_line() {
        let layer = |source: &str| {
            format!(
                r#"{{"layers": [{{"type": "segmentation", "name": "a\nb", "segments": ["1"]{source}}}]}}"#
            )
        };
        let wrong = ["https://h/#!gs://b/\nstate".to_owned(), "https://h/#!gs:%0Ab".into(), layer("")];
        for text in wrong {
            let error = State::parse(&text).unwrap_err();
            assert!(!error.contains('\n') && error.contains(r"\n"), "{error}");
        }
        let elsewhere = State::parse(&layer(r#", "source": "ftp://a""#)).unwrap();
        let error = elsewhere.sources(Path::new("/")).unwrap_err().to_string();
        assert!(error.contains(r"layer a\nb: ftp://a"), "{error}");
    }

    /// The notation of older links: what each character becomes, and JSON as it is.
    #[test]
    fn links_may_have_single_quotes_and_underscores() {
        for (text, json) in [
            (r"{'a_b':['1'_'2']_'c':{}}", r#"{"a_b":["1","2"],"c":{}}"#),
            (r#"{'it\'s':'\"\n"'}"#, r#"{"it's":"\"\n\""}"#),
            (r#"{"a_'b": ["\"_\\", 1], "c": "é"}"#, r#"{"a_'b": ["\"_\\", 1], "c": "é"}"#),
            ("{'open", "{\"open"),
        ] {
            assert_eq!(json_of_link(text), json);
        }
        let old = "https://h/#!{'layers':{'s':{'type':'segmentation'_'source':'a.zarr'_'segments':['7'_'9']}}_'layout':'3d'}";
        let state = State::parse(old).unwrap();
        assert_eq!(state.layers[0].segments.keys().copied().collect::<Vec<_>>(), [7, 9]);
    }
}

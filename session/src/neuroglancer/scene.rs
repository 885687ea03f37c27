//! Makes a scene of a state: opens the layers' volumes, places them as Neuroglancer does, and looks at them from the same place.
//!
//! ```text
//! index space ─ the volume's matrix, its unit ─► metres ─ stretch, scale ─► world, the state's position at its origin
//! camera       Neuroglancer's view has x right, y down, z away; its picture is as high as projectionScale at the position,
//!              and 45° in perspective
//! ```

use std::f64::consts::FRAC_PI_4;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::error::one_line;
use pumice_core::{CompressedVolume, Job, Unit};
use pumice_formats::OpenOptions;
use pumice_scene::{
    Camera, Film, Filter, Instance, LabelGroup, LabelGroups, LabelStyle, Material, Projection, Reading,
    SCENE_VERSION, Scene, SceneError, SensorFit, Settings, Show,
};

use super::color::color_of;
use super::source::local_path;
use super::state::{Height, Layer, State};
use crate::error::{Result, SessionError, io};
use crate::figure::{DIAGONAL, MaterialPreset, key_light, linear, sky};
use crate::open::{Residence, open_chosen};

/// A state as a scene, with its volumes open.
#[derive(Clone, Debug)]
pub struct OpenedState {
    /// The scene, with an instance a layer.
    pub scene: Scene,
    /// The volumes of its instances, in their order.
    pub volumes: Vec<Arc<CompressedVolume>>,
}

/// A layer with its volume open.
struct Opened<'s> {
    layer: &'s Layer,
    source: PathBuf,
    volume: Arc<CompressedVolume>,
    /// Ids of the shown segments that the volume has.
    ids: Vec<u64>,
    /// From index space to metres, as they are drawn.
    drawn_from_index: DAffine3,
}

/// Makes a scene of `size` pixels of a state. Relative URLs count from `folder`; `copies` has the paths of layers, by name, that are to be read from
/// elsewhere than the state says. `reading` is told what is left out.
///
/// # Errors
/// [`SessionError::Caller`] names the layer: one that lies on a server and has no copy, or of which no segment is in its volume; a copy of an unknown
/// layer; a state without a segment. Errors of the volumes.
pub fn open_state(
    state: &State,
    copies: &[(String, PathBuf)],
    (folder, size): (&Path, [u32; 2]),
    (reading, residence): (&OpenOptions, Residence),
    job: &Job,
) -> Result<OpenedState> {
    let wrong = |what: String| Err(SessionError::Caller(one_line(&what)));
    state.left_out.iter().for_each(|line| reading.warnings.push(line.clone()));
    let names = || state.layers.iter().map(|l| l.name.as_str()).collect::<Vec<_>>().join(", ");
    if state.layers.is_empty() {
        return wrong("the state: expected a layer of segments that are chosen and shown, got none".into());
    }
    if let Some((name, _)) = copies.iter().find(|(name, _)| state.layers.iter().all(|l| l.name != *name)) {
        return wrong(format!("--layer-file {name}: the state shows no such layer; it shows {}", names()));
    }
    let (mut opened, mut metres) = (Vec::new(), state.metres);
    for layer in &state.layers {
        let copy = copies.iter().rev().find(|(name, _)| *name == layer.name).map(|(_, path)| path.clone());
        let Some(path) = copy.or_else(|| local_path(&layer.url, folder)) else {
            let (name, url) = (&layer.name, &layer.url);
            return wrong(format!(
                "layer {name} lies on a server, at {url}: copy what the picture needs, and give it with --layer-file {name}=PATH"
            ));
        };
        let place = (state.stretch, &mut metres);
        opened.push(open_layer(layer, path, place, (reading, residence.clone()), job)?);
    }
    let metres = metres.unwrap_or([1.0; 3]);

    // What the view turns around, and how high it is there.
    let bounds = bounds(&opened);
    let stretch = DVec3::from_array(state.stretch);
    let centre = match state.position {
        Some(steps) => DVec3::from_array(steps) * DVec3::from_array(metres) * stretch,
        None => (bounds[0] + bounds[1]) / 2.0,
    };
    let reach = (centre - bounds[0]).abs().max((bounds[1] - centre).abs()).length();
    let height = match state.height {
        Some(Height::Steps(steps)) => steps * (DVec3::from_array(metres) * stretch).min_element(),
        Some(Height::Metres(height)) => height,
        None => 2.0 * reach,
    };
    let scale = DIAGONAL / height;

    // Neuroglancer's camera looks along its z with y down.
    let axes = DMat3::from_quat(state.orientation) * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let (projection, distance) = if state.is_orthographic {
        // Outside of all that is shown.
        (Projection::Orthographic { scale: DIAGONAL }, DIAGONAL + reach * scale)
    } else {
        (Projection::Perspective { fov_rad: FRAC_PI_4 }, DIAGONAL / 2.0 / (FRAC_PI_4 / 2.0).tan())
    };
    let pose = DAffine3 { matrix3: axes, translation: axes.z_axis * distance };
    let camera = Camera { fit: SensorFit::Vertical, ..Camera::new(pose, projection) };
    let world_from_drawn =
        DAffine3 { matrix3: DMat3::from_diagonal(DVec3::splat(scale)), translation: -centre * scale };

    let mut instances = Vec::new();
    let mut volumes = Vec::new();
    for (i, layer) in opened.into_iter().enumerate() {
        let style = style(layer.layer, &layer.ids)
            .map_err(|source| SessionError::Scene { path: layer.source.clone(), source })?;
        instances.push(Instance {
            id: i as u32 + 1,
            world_from_index: world_from_drawn * layer.drawn_from_index,
            source: layer.source,
            reading: Reading::default(),
            style,
        });
        volumes.push(layer.volume);
    }
    let film = Film {
        transparent: state.background_srgb.is_some(),
        background: state.background_srgb,
        ..Film::new(size[0], size[1], Filter::BlackmanHarris { width: 3.0 })
    };
    let scene = Scene {
        version: SCENE_VERSION,
        instances,
        suns: vec![key_light(&axes)],
        camera,
        film,
        world: sky(),
        lights: Vec::new(),
        meshes: Vec::new(),
        cuts: Vec::new(),
        settings: Settings::default(),
    };
    Ok(OpenedState { scene, volumes })
}

/// Opens a layer, of which a metre is drawn `stretch` long along each axis. `metres` is the length of the state's steps, and becomes that of the
/// layer's voxels where the state says none.
fn open_layer<'s>(
    layer: &'s Layer,
    path: PathBuf,
    (stretch, metres): ([f64; 3], &mut Option<[f64; 3]>),
    (reading, residence): (&OpenOptions, Residence),
    job: &Job,
) -> Result<Opened<'s>> {
    let name = one_line(&layer.name);
    reading.outputs.check_input(&path)?;
    let wanted = Show::Only(layer.segments.keys().copied().collect());
    let volume = open_chosen(&path, &[&wanted], reading, residence, job)?;
    let has = |id: &u64| volume.labels().index_of(*id).is_some();
    let (ids, absent): (Vec<u64>, Vec<u64>) = layer.segments.keys().partition(|id| has(id));
    let count = layer.segments.len();
    match absent.first() {
        Some(first) if ids.is_empty() => {
            let what = format!(
                "layer {name}: {}: it has none of the {count} segments, such as {first}",
                path.display()
            );
            return Err(SessionError::Caller(what));
        }
        Some(first) => reading.warnings.push(format!(
            "layer {name}: {} of {count} segments are not in {}, such as {first}",
            absent.len(),
            path.display()
        )),
        None => {}
    }
    let info = volume.info();
    let metres_from_index = match metres_of(info.unit) {
        Some(unit) => {
            metres.get_or_insert(info.spacing().map(|length| length * unit));
            DAffine3::from_scale(DVec3::splat(unit)) * info.world_from_index
        }
        None => {
            reading.warnings.push(format!(
                "layer {name}: {} has no unit: its voxels are taken for the steps of the state",
                path.display()
            ));
            DAffine3::from_scale(DVec3::from_array(*metres.get_or_insert([1.0; 3])))
        }
    };
    let source = path.canonicalize().map_err(io(&path))?;
    let drawn_from_index = DAffine3::from_scale(DVec3::from_array(stretch)) * metres_from_index;
    Ok(Opened { layer, source, volume, ids, drawn_from_index })
}

fn metres_of(unit: Unit) -> Option<f64> {
    match unit {
        Unit::Nanometre => Some(1e-9),
        Unit::Micrometre => Some(1e-6),
        Unit::Millimetre => Some(1e-3),
        Unit::Metre => Some(1.0),
        Unit::Unknown => None,
    }
}

/// Common bounds of what is shown, as it is drawn, in metres.
fn bounds(opened: &[Opened<'_>]) -> [DVec3; 2] {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for layer in opened {
        let of_labels = layer.volume.label_bounds();
        for label in layer.ids.iter().filter_map(|&id| layer.volume.labels().index_of(id)) {
            let of_label = of_labels[label as usize];
            let ends = [of_label.low, of_label.high.map(|c| c + 1)];
            for corner in 0..8usize {
                let at = DVec3::from_array([0, 1, 2].map(|a| f64::from(ends[corner >> a & 1][a])));
                let place = layer.drawn_from_index.transform_point3(at);
                (low, high) = (low.min(place), high.max(place));
            }
        }
    }
    [low, high]
}

/// The shown segments of a layer, in one group, in the colours that Neuroglancer gives them.
fn style(layer: &Layer, ids: &[u64]) -> std::result::Result<LabelStyle, SceneError> {
    let color = |id: &u64| {
        let lowest = layer.segments.get(id).copied().unwrap_or(*id);
        let own = layer.colors_srgb.get(id).or_else(|| layer.colors_srgb.get(&lowest)).copied();
        let color = own.or(layer.common_srgb).unwrap_or_else(|| color_of(lowest, layer.seed));
        linear(color.map(|c| c * layer.saturation + (1.0 - layer.saturation)))
    };
    let material = Material { alpha: layer.alpha, ..MaterialPreset::Plastic.material() };
    let group = LabelGroup::new(material, ids.to_vec(), ids.iter().map(color).collect())?;
    Ok(LabelStyle {
        show: Show::Only(ids.to_vec()),
        material,
        auto_color: false,
        groups: LabelGroups::new(vec![group])?,
        ..LabelStyle::default()
    })
}

//! Lays out the scale bar and the legend of a picture: the part that needs its scene and volumes.
//!
//! ```text
//! length of the bar in the world = length in the volume's unit · (column of world_from_index / spacing)     the same along all axes, or refused
//! pixels = length in the world / extent of a pixel: everywhere the same (orthographic), or that at the plane (perspective)
//! ```
//! All refusals come before the first ray.

use glam::DVec3;
use pumice_core::{CompressedVolume, Unit};
use pumice_picture::Annotations;
use pumice_picture::annotate::{
    BarLength, BarPlane, DEFAULT_DPI, LegendRow, Mark, Paper, legend_marks, length_text, meters_of,
    missing_characters, reach_of, round_length, scale_bar_marks,
};
use pumice_scene::{Instance, Mode};
use pumice_transport::LoadedScene;
use pumice_transport::camera_rays::CameraRays;
use pumice_transport::material_table::MaterialTable;

use crate::error::{Result, SessionError};
use crate::figure::free_windows;
use crate::legend_rows::{Listed, listed};
use crate::render_file::Rendered;

/// Part of the picture's width that a bar of automatic length fills at most.
const MOST_OF_WIDTH: f64 = 0.25;
/// Largest relative difference of the scales of axes and volumes at which one bar is true for all: a hundredth of a pixel in a bar of 100.
const MOST_UNEVEN: f64 = 1e-4;

/// Annotations that are laid out for the film of a scene.
#[derive(Clone, Debug, Default)]
pub struct LaidOut {
    wishes: Annotations,
    marks: Vec<Mark>,
    /// What is drawn otherwise than wished, one line each.
    notices: Vec<String>,
}

impl LaidOut {
    /// Gives a picture of that scene its annotations; files of it have them.
    pub fn apply(&self, rendered: &mut Rendered) {
        rendered.figures.notices.extend_from_slice(&self.notices);
        let picture = &mut rendered.picture;
        picture.marks.clone_from(&self.marks);
        picture.dpi = self.wishes.dpi;
        if let Some(made) = &mut picture.provenance {
            made.annotations = self.wishes.clone();
        }
    }
}

/// Lays out annotations.
///
/// # Errors
/// One line, where the bar would not be true, the legend would be empty or have other colours than the picture, or either does not fit.
pub fn lay_out(loaded: &LoadedScene, wishes: &Annotations) -> Result<LaidOut> {
    let film = &loaded.scene().film;
    if let Some(dpi) = wishes.dpi
        && !(1.0..=100_000.0).contains(&dpi)
    {
        return Err(SessionError::Caller(format!("dpi: expected 1 to 100000 pixels per inch, got {dpi}")));
    }
    let dpi = wishes.dpi.unwrap_or(DEFAULT_DPI);
    let paper = Paper { width: f64::from(film.width), height: f64::from(film.height), dpi };
    let mut laid = LaidOut { wishes: wishes.clone(), ..LaidOut::default() };
    if let Some(most) = wishes.legend {
        let refuse = |what| SessionError::Caller(format!("legend: {what}"));
        let (rows, more) = legend_rows(loaded, most as usize).map_err(refuse)?;
        let names: String = rows.iter().map(|row| row.name.as_str()).collect();
        let missing = missing_characters(&names).map_err(refuse)?;
        if !missing.is_empty() {
            let some: String = missing.iter().take(8).collect();
            laid.notices.push(format!(
                "legend: the font lacks {some}, so boxes stand for {} characters",
                missing.len()
            ));
        }
        let marks = legend_marks(&paper, &rows, more).map_err(refuse)?;
        if free_windows([film.width, film.height], reach_of(&marks)).is_empty() {
            laid.notices.push(
                "legend: it leaves no room for what is shown and covers it; expected a larger picture, a lower dpi or fewer labels".into(),
            );
        }
        laid.marks.extend(marks);
    }
    if let Some(bar) = &wishes.scale_bar {
        let refuse = |what| SessionError::Caller(format!("scale bar {bar}: {what}"));
        let (length_px, said) = measured(loaded, bar.length, bar.plane).map_err(refuse)?;
        laid.marks.extend(scale_bar_marks(&paper, length_px, &said).map_err(refuse)?);
    }
    Ok(laid)
}

/// The length of a scale bar in pixels, and what it says.
fn measured(
    loaded: &LoadedScene,
    length: BarLength,
    plane: Option<BarPlane>,
) -> std::result::Result<(f64, String), String> {
    let scene = loaded.scene();
    let rays = CameraRays::new(&scene.camera, &scene.film);
    let (world_per_unit, unit) = scale_of_all(loaded)?;
    let (distance, place) = match plane {
        _ if rays.orthographic => (1.0, String::new()),
        None => return Err("in a perspective view a bar is true only in a plane; expected one, e.g. auto@center or auto@focus".into()),
        Some(BarPlane::Middle) => (distance_of_middle(loaded, &rays), " (middle)".into()),
        Some(BarPlane::Focus) => match scene.camera.aperture {
            Some(aperture) => (aperture.focus_distance, " (focus)".into()),
            None => return Err("the camera has no depth of field, so no plane is in focus; expected @center or @DISTANCE".into()),
        },
        Some(BarPlane::Distance(distance)) => (distance, format!(" (at {distance})")),
    };
    if distance <= 0.0 {
        return Err("its plane lies behind the camera".into());
    }
    let reach = if rays.orthographic { 1.0 } else { distance };
    let world_per_pixel = 2.0 * rays.half * reach * rays.pixel_aspect / rays.fitted;
    let (length, in_unit) = match length {
        BarLength::Auto => {
            (round_length(MOST_OF_WIDTH * rays.size[0] * world_per_pixel / world_per_unit), unit)
        }
        BarLength::Given(length, None) => (length, unit),
        BarLength::Given(length, Some(given)) => (length, given),
    };
    let units = match (in_unit == unit, meters_of(in_unit), meters_of(unit)) {
        (true, ..) => 1.0,
        (false, Some(given), Some(own)) => given / own,
        _ => return Err("the volume states no unit; expected a length without one".into()),
    };
    Ok((length * units * world_per_unit / world_per_pixel, length_text(length, in_unit) + &place))
}

/// Length in the world of one unit of the volumes, and that unit.
fn scale_of_all(loaded: &LoadedScene) -> std::result::Result<(f64, Unit), String> {
    let of = |(instance, volume): (&Instance, &std::sync::Arc<CompressedVolume>)| {
        let m = instance.world_from_index.matrix3;
        let spacing = volume.info().spacing();
        let along =
            [m.x_axis.length() / spacing[0], m.y_axis.length() / spacing[1], m.z_axis.length() / spacing[2]];
        (along, volume.info().unit, instance.id)
    };
    let all: Vec<_> = loaded.scene().instances.iter().zip(loaded.volumes()).map(of).collect();
    let Some(&(first, unit, _)) = all.first() else {
        return Err("the scene has no volume, so no length is known".into());
    };
    let scale = first.iter().sum::<f64>() / 3.0;
    for (along, its_unit, id) in &all {
        // Relative to the first volume's unit; two unknown units count as the same.
        let per_own = match (its_unit == &unit, meters_of(unit), meters_of(*its_unit)) {
            (true, ..) => 1.0,
            (false, Some(own), Some(its)) => own / its,
            _ => {
                return Err(format!(
                    "instance {id} and the first have units that cannot be compared, {its_unit:?} and {unit:?}"
                ));
            }
        };
        let low = along.iter().copied().fold(f64::INFINITY, f64::min);
        let high = along.iter().copied().fold(0.0, f64::max);
        if high - low > MOST_UNEVEN * high {
            return Err(format!(
                "instance {id} is scaled unevenly, so no bar is true; expected the same scale along its axes"
            ));
        }
        if (along[0] * per_own - scale).abs() > MOST_UNEVEN * scale {
            return Err(format!(
                "instance {id} has another scale than the first, so no bar is true for both"
            ));
        }
    }
    Ok((scale, unit))
}

/// Distance from the camera, along its axis, of the middle of the labels that are shown.
fn distance_of_middle(loaded: &LoadedScene, rays: &CameraRays) -> f64 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (place, (instance, volume)) in loaded.scene().instances.iter().zip(loaded.volumes()).enumerate() {
        let visible = loaded.visible(place);
        let (mut first, mut last) = ([u32::MAX; 3], [0; 3]);
        for (bounds, _) in volume
            .label_bounds()
            .iter()
            .zip(visible)
            .filter(|(b, is_shown)| *is_shown && b.low[0] <= b.high[0])
        {
            for a in 0..3 {
                (first[a], last[a]) = (first[a].min(bounds.low[a]), last[a].max(bounds.high[a] + 1));
            }
        }
        if first[0] > last[0] {
            (first, last) = ([0; 3], volume.info().dims);
        }
        for corner in 0..8 {
            let p = DVec3::from_array(
                [0, 1, 2].map(|a| f64::from(if corner >> a & 1 == 0 { first[a] } else { last[a] })),
            );
            let p = instance.world_from_index.transform_point3(p);
            (low, high) = (low.min(p), high.max(p));
        }
    }
    rays.forward.dot((low + high) / 2.0 - rays.position)
}

/// The lines of the legend, most voxels first, and how many labels there are beyond `most`.
fn legend_rows(loaded: &LoadedScene, most: usize) -> std::result::Result<(Vec<LegendRow>, usize), String> {
    let scene = loaded.scene();
    if scene.settings.mode == Mode::AmbientOcclusion {
        return Err("in ambient occlusion all labels are white; expected another mode".into());
    }
    let volumes = || loaded.volumes().iter().map(|volume| &**volume);
    let (rows, more) = listed(volumes().enumerate().map(|(place, v)| (v, loaded.visible(place))), most)?;
    let mut tables: Vec<Option<MaterialTable>> = vec![None; loaded.volumes().len()];
    let row = |listed: &Listed| {
        let place = listed.place;
        let (style, table) = (&scene.instances[place].style, loaded.volumes()[place].labels());
        let materials = tables[place].get_or_insert_with(|| {
            MaterialTable::new(style, table.ids(), table.contacts().iter(), &loaded.visible(place))
        });
        listed.row(materials.material(listed.label).base_color)
    };
    Ok((rows.iter().map(row).collect(), more))
}

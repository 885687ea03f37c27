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
    BarLength, BarPlane, Corner, DEFAULT_DPI, LegendRow, Mark, Paper, legend_marks, length_text, meters_of,
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
        let corner = wishes.scale_bar_corner;
        if wishes.legend.is_some() && corner == Corner::UpperLeft {
            return Err(refuse("the legend is in the upper left corner; expected another one".into()));
        }
        laid.marks.extend(scale_bar_marks(&paper, corner, length_px, &said).map_err(refuse)?);
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DAffine3;
    use pumice_core::{LabelBuffer, LabelNote, LabelType, VolumeInfo, compress_labels};
    use pumice_picture::ScaleBar;
    use pumice_scene::Scene;

    use super::*;

    /// Voxels of 0.5 × 0.25 × 2 of a unit; label 3 has 1 voxel, label 8 has 2, label 9 has 2, label 20 has 4.
    fn volume(unit: Unit) -> Arc<CompressedVolume> {
        let mut info = VolumeInfo::new([9, 1, 1], LabelType::U8);
        info.unit = unit;
        info.world_from_index = DAffine3::from_scale(DVec3::new(0.5, 0.25, 2.0));
        let labels = LabelBuffer::U8(vec![20, 20, 8, 9, 3, 9, 8, 20, 20]);
        Arc::new(compress_labels(info, labels).unwrap())
    }

    /// A scene of one volume, of which a unit of length is 3 in the world, placed aside of the camera's axis. The camera looks down from
    /// (1, −2, 40).
    fn scene(projection: &str) -> Scene {
        let text = format!(
            r#"{{
              "version": 1,
              "instances": [{{ "id": 4, "source": "memory", "world_from_index": [1.5,0,0, 0,0,-0.75, 0,6,0, 7,5,3] }}],
              "camera": {{ "world_from_camera": [2,0,0, 0,2,0, 0,0,2, 1,-2,40], "projection": {{ {projection} }} }},
              "film": {{ "width": 100, "height": 50, "filter": {{ "box": {{ "width": 1.0 }} }} }},
              "world": {{ "environment": {{ "constant": {{ "radiance": [1, 1, 1] }} }} }}
            }}"#
        );
        Scene::from_json(&text).unwrap()
    }

    const PARALLEL: &str = r#""orthographic": { "scale": 40 }"#;
    const FROM_A_POINT: &str = r#""perspective": { "fov_rad": 0.8 }"#;

    fn loaded(scene: Scene, units: &[Unit]) -> LoadedScene {
        LoadedScene::new(scene, units.iter().map(|&unit| volume(unit)).collect(), vec![]).unwrap()
    }

    fn micrometres(scene: Scene) -> LoadedScene {
        loaded(scene, &[Unit::Micrometre])
    }

    fn near(got: f64, expected: f64) -> bool {
        (got - expected).abs() < 1e-9 * expected.abs()
    }

    /// 100 pixels for 40 units of the world, of which 3 are a micrometre: a micrometre is 7.5 pixels long.
    #[test]
    fn a_bar_in_a_parallel_view_has_the_pixels_of_its_length() {
        let parallel = micrometres(scene(PARALLEL));
        for (length, pixels, text) in [
            (BarLength::Given(5.0, None), 37.5, "5 µm"),
            (BarLength::Given(4000.0, Some(Unit::Nanometre)), 30.0, "4 µm"),
            (BarLength::Given(0.002, Some(Unit::Millimetre)), 15.0, "2 µm"),
            // A quarter of the width is 3.33 µm, and 2 the longest of 1, 2, 5, … below.
            (BarLength::Auto, 15.0, "2 µm"),
        ] {
            let (got, said) = measured(&parallel, length, None).unwrap();
            assert!(near(got, pixels) && said == text, "{length:?}: {got} pixels, {said}");
            // A plane makes no difference, wherever it is.
            let (again, said) = measured(&parallel, length, Some(BarPlane::Distance(7.0))).unwrap();
            assert!(near(again, pixels) && said == text);
        }
    }

    /// Pixels wider than high are fewer along a bar: 1.5 times as wide, of a side of 50 heights that spans 40 units of the world.
    #[test]
    fn a_bar_counts_the_width_of_pixels_and_the_side_that_is_fitted() {
        let mut tall = scene(PARALLEL);
        tall.film.pixel_aspect = 1.5;
        tall.camera.fit = pumice_scene::SensorFit::Vertical;
        let (got, _) = measured(&micrometres(tall), BarLength::Given(5.0, None), None).unwrap();
        assert!(near(got, 15.0 / (1.5 * 40.0 / 50.0)), "{got}");
    }

    /// At depth z a pinhole shows a length L as L · f / z pixels, f = (100 / 2) / tan(0.8 / 2). The volume's middle is 5.9 units aside of
    /// the axis: its depth is not its distance.
    #[test]
    fn a_bar_in_perspective_is_true_at_the_depth_of_its_plane() {
        let mut sharp = scene(FROM_A_POINT);
        sharp.camera.aperture = Some(pumice_scene::Aperture {
            radius: 0.1,
            focus_distance: 30.0,
            blades: 0,
            rotation_rad: 0.0,
            ratio: 1.0,
        });
        let sharp = micrometres(sharp);
        // Along z the volume reaches from 3 − 0.75 to 3.
        let middle = 40.0 - (3.0 - 0.375);
        let focal_length_px = 50.0 / 0.4f64.tan();
        for (plane, depth, place) in [
            (BarPlane::Middle, middle, " (middle)"),
            (BarPlane::Focus, 30.0, " (focus)"),
            (BarPlane::Distance(12.5), 12.5, " (at 12.5)"),
        ] {
            let (got, said) = measured(&sharp, BarLength::Given(2.0, None), Some(plane)).unwrap();
            assert!(near(got, 6.0 * focal_length_px / depth), "{plane:?}: {got}");
            assert_eq!(said, format!("2 µm{place}"));
        }
        // An automatic length is chosen for its plane: 25 pixels are 25 · 12.5 / f / 3 = 0.88 µm there.
        let (got, said) = measured(&sharp, BarLength::Auto, Some(BarPlane::Distance(12.5))).unwrap();
        assert!(near(got, 1.5 * focal_length_px / 12.5) && said == "500 nm (at 12.5)", "{got} {said}");
    }

    #[test]
    fn the_middle_is_that_of_the_labels_that_are_shown() {
        let mut all = scene(FROM_A_POINT);
        // The camera looks along the volume: 9 voxels of 1.5, the first of them at depth 10.
        all.camera.world_from_camera = DAffine3 {
            matrix3: glam::DMat3::from_rotation_y(-std::f64::consts::FRAC_PI_2),
            translation: DVec3::new(-3.0, 0.0, 0.0),
        };
        let of = |scene: &Scene| {
            distance_of_middle(&micrometres(scene.clone()), &CameraRays::new(&scene.camera, &scene.film))
        };
        assert!(near(of(&all), 10.0 + 4.5 * 1.5), "{}", of(&all));
        // Of no label, the whole volume counts.
        all.instances[0].style.show = pumice_scene::Show::Only(vec![]);
        assert!(near(of(&all), 10.0 + 4.5 * 1.5));
        let mut info = VolumeInfo::new([9, 1, 1], LabelType::U8);
        info.unit = Unit::Micrometre;
        let aside =
            Arc::new(compress_labels(info, LabelBuffer::U8(vec![0, 5, 0, 0, 6, 6, 0, 0, 0])).unwrap());
        for (ids, middle) in [(vec![5], 1.5), (vec![6], 5.0), (vec![5, 6], 3.5)] {
            all.instances[0].style.show = pumice_scene::Show::Only(ids);
            let one = LoadedScene::new(all.clone(), vec![Arc::clone(&aside)], vec![]).unwrap();
            let got = distance_of_middle(&one, &CameraRays::new(&all.camera, &all.film));
            assert!(near(got, 10.0 + middle * 1.5), "{got}");
        }
    }

    #[test]
    fn bars_that_would_not_be_true_are_refused_by_name() {
        let given = BarLength::Given(2.0, None);
        let says = |loaded: &LoadedScene, length, plane| measured(loaded, length, plane).unwrap_err();
        let flat = micrometres(scene(FROM_A_POINT));
        assert!(says(&flat, given, None).contains("true only in a plane"));
        assert!(says(&flat, given, Some(BarPlane::Focus)).contains("no plane is in focus"));
        assert!(says(&flat, given, Some(BarPlane::Distance(-1.0))).contains("behind the camera"));
        let unknown = loaded(scene(PARALLEL), &[Unit::Unknown]);
        assert!(says(&unknown, BarLength::Given(2.0, Some(Unit::Metre)), None).contains("states no unit"));
        let (got, said) = measured(&unknown, given, None).unwrap();
        assert!(near(got, 15.0) && said == "2 units", "{got} {said}");
        let mut none = scene(PARALLEL);
        none.instances.clear();
        assert!(says(&loaded(none, &[]), given, None).contains("has no volume"));
        // An axis that is longer by a thousandth, and one by less than a ten-thousandth.
        for (factor, is_refused) in [(1.001, true), (0.999, true), (1.00005, false)] {
            let mut uneven = scene(PARALLEL);
            uneven.instances[0].world_from_index.matrix3.y_axis *= factor;
            let got = measured(&micrometres(uneven), given, None);
            assert_eq!(
                got.is_err_and(|e| e.contains("instance 4 is scaled unevenly")),
                is_refused,
                "{factor}"
            );
        }
    }

    #[test]
    fn volumes_of_two_units_have_one_bar_where_their_scales_are_one() {
        let two = |factor: f64, units: [Unit; 2]| {
            let mut scene = scene(PARALLEL);
            let mut second = scene.instances[0].clone();
            second.id = 5;
            second.world_from_index.matrix3 *= factor;
            scene.instances.push(second);
            measured(&loaded(scene, &units), BarLength::Given(2.0, None), None)
        };
        let (coarse, fine) = (Unit::Micrometre, Unit::Nanometre);
        assert!(near(two(1.0, [coarse, coarse]).unwrap().0, 15.0));
        assert!(near(two(1e-3, [coarse, fine]).unwrap().0, 15.0), "a nanometre is a thousandth");
        assert!(near(two(1.0, [Unit::Unknown, Unit::Unknown]).unwrap().0, 15.0));
        for (factor, units, what) in [
            (1.0, [coarse, fine], "another scale"),
            (1e3, [coarse, fine], "another scale"),
            (0.5, [coarse, coarse], "another scale"),
            (1.0, [coarse, Unit::Unknown], "cannot be compared"),
        ] {
            let text = two(factor, units).unwrap_err();
            assert!(text.contains("instance 5") && text.contains(what), "{text}");
        }
    }

    #[test]
    fn a_legend_has_the_labels_by_their_voxels_and_counts_the_rest() {
        let mut shown = scene(PARALLEL);
        shown.instances[0].style.show = pumice_scene::Show::Except(vec![3]);
        let red = pumice_scene::Material { base_color: [0.9, 0.1, 0.1], ..Default::default() };
        shown.instances[0].style.materials.insert(9, red);
        let names = |most| {
            let (rows, more) = legend_rows(&micrometres(shown.clone()), most).unwrap();
            (rows.iter().map(|row| row.name.clone()).collect::<Vec<_>>().join(" "), more)
        };
        assert_eq!(names(9), ("20 8 9".to_owned(), 0), "of equal size, the smaller id first");
        assert_eq!(names(2), ("20 8".to_owned(), 1));
        let (rows, _) = legend_rows(&micrometres(shown.clone()), 9).unwrap();
        assert_eq!([rows[2].color, rows[1].color], [[0.9, 0.1, 0.1], [0.8, 0.8, 0.8]]);
        shown.instances[0].style.show = pumice_scene::Show::Only(vec![]);
        assert_eq!(legend_rows(&micrometres(shown.clone()), 9).unwrap_err(), "the scene shows no label");
        shown.settings.mode = Mode::AmbientOcclusion;
        assert!(legend_rows(&micrometres(shown), 9).unwrap_err().contains("all labels are white"));
    }

    /// The rows of two instances of different volumes and styles, of which the second has names; a name is one line, and an empty one is none.
    #[test]
    fn a_legend_of_two_volumes_takes_names_and_colors_of_each() {
        let mut info = VolumeInfo::new([9, 1, 1], LabelType::U8);
        info.unit = Unit::Micrometre;
        info.world_from_index = DAffine3::from_scale(DVec3::new(0.5, 0.25, 2.0));
        let note = |id, name: &str| LabelNote { id, name: Some(name.into()), color_srgb: None };
        info.notes = vec![note(8, "a\nb"), note(9, ""), note(20, "twenty")];
        let named = compress_labels(info, LabelBuffer::U8(vec![20, 20, 20, 20, 20, 8, 8, 9, 0])).unwrap();
        let mut two = scene(PARALLEL);
        let mut second = two.instances[0].clone();
        second.id = 5;
        let colored = |color| pumice_scene::Material { base_color: color, ..Default::default() };
        let (red, blue) = ([0.9, 0.1, 0.1], [0.1, 0.1, 0.9]);
        (two.instances[0].style.material, second.style.material) = (colored(red), colored(blue));
        two.instances.push(second);
        let volumes = vec![volume(Unit::Micrometre), Arc::new(named)];
        let (rows, more) = legend_rows(&LoadedScene::new(two, volumes, vec![]).unwrap(), 9).unwrap();
        let found: Vec<_> = rows.iter().map(|row| (row.name.as_str(), row.color)).collect();
        // By voxels: 5, 4, 2, 2, 2, 1, 1; of as many, the first volume's before the second's.
        let expected =
            [("twenty", blue), ("20", red), ("8", red), ("9", red), ("a\\nb", blue), ("3", red), ("9", blue)];
        assert_eq!((found.as_slice(), more), (&expected[..], 0));
    }

    #[test]
    fn resolutions_from_1_to_100000_are_taken() {
        let parallel = micrometres(scene(PARALLEL));
        for (dpi, is_taken) in
            [(1.0, true), (100_000.0, true), (0.99, false), (100_001.0, false), (f64::NAN, false)]
        {
            let wishes = Annotations { dpi: Some(dpi), ..Annotations::default() };
            assert_eq!(lay_out(&parallel, &wishes).is_ok(), is_taken, "{dpi}");
        }
        // A bar has the pixels of its length whatever the resolution.
        let bar = ScaleBar { length: BarLength::Given(5.0, None), plane: None };
        let wishes = Annotations { dpi: Some(30.0), scale_bar: Some(bar), ..Annotations::default() };
        assert!(!lay_out(&parallel, &wishes).unwrap().marks.is_empty());
    }

    #[test]
    fn a_bar_is_in_its_corner_and_never_on_the_legend() {
        let mut large = scene(PARALLEL);
        (large.film.width, large.film.height) = (400, 200);
        let large = micrometres(large);
        let bar = ScaleBar { length: BarLength::Given(2.0, None), plane: None };
        let laid = |corner, legend| {
            let wishes =
                Annotations { dpi: Some(100.0), scale_bar: Some(bar), scale_bar_corner: corner, legend };
            lay_out(&large, &wishes).map_err(|error| error.to_string())
        };
        let left = |corner| laid(corner, None).unwrap().marks[0].left;
        assert_eq!(left(Corner::LowerLeft), 15, "4 mm at 100 dpi are 15.7 pixels");
        assert!(left(Corner::LowerRight) > 200 && left(Corner::default()) == left(Corner::LowerRight));
        let refused = laid(Corner::UpperLeft, Some(3)).unwrap_err();
        assert!(refused.contains("scale bar 2: the legend is in the upper left corner"), "{refused}");
        // A control: each alone, and both in two corners.
        assert!(laid(Corner::UpperLeft, None).is_ok() && laid(Corner::UpperRight, Some(3)).is_ok());
    }
}

//! What a caller says of a figure, in words: the flags of `pumice render` and the keywords of `pumice.figure`. They name labels by
//! [`Selector`]s, which are looked up once the volume is open.

use std::collections::BTreeMap;
use std::path::PathBuf;

use pumice_core::CompressedVolume;
use pumice_picture::annotate::{DEFAULT_DPI, Paper, legend_marks, reach_of};
use pumice_scene::{Scene, Show};

use super::axis_cut::AxisCut;
use super::color::{Background, LabelColor};
use super::framing::FrameOn;
use super::lens::{FocusOn, Lens, Opening, SharpAt};
use super::material::LabelPreset;
use super::selector::Selector;
use super::style::FigureStyle;
use super::{FigureOptions, bounds_of, compose, voxel_corners};
use crate::legend_rows::listed;
use crate::selection::select_among;
use crate::values::{numbers, whole_from_1};

/// Flags of a figure. Each field is the flag of its name.
#[derive(Clone, Debug, Default)]
pub struct FigureFlags {
    /// Labels to show; with several selectors those that any of them chooses. Empty: all.
    pub labels: Vec<Selector>,
    /// Labels to show, by one query line.
    pub query: Option<Selector>,
    /// Number of labels to choose, of those that `query` chooses.
    pub pick: Option<usize>,
    /// Colours of labels; later ones count.
    pub color: Vec<LabelColor>,
    /// Materials of labels; later ones count.
    pub material: Vec<LabelPreset>,
    /// Cuts across index axes.
    pub cut: Vec<AxisCut>,
    /// Whether shadows fall on a floor.
    pub floor: bool,
    /// Direction of the camera in degrees: around the vertical axis, above the horizon.
    pub view: Option<[f64; 2]>,
    /// Distance of the camera from the middle of what is framed, in world units.
    pub distance: Option<f64>,
    /// What the camera frames.
    pub frame: Option<FrameOn>,
    /// Number of pictures around the vertical axis.
    pub turntable: Option<u32>,
    /// What is in focus.
    pub focus: Option<FocusOn>,
    /// How wide the lens is open.
    pub aperture: Option<Opening>,
    /// What is behind everything; also of scenes.
    pub background: Option<Background>,
    /// Whether voxels are shaded smooth; also of scenes.
    pub smooth: bool,
    /// Number of labels in the legend that the picture will have, beside which the figure is framed.
    pub legend: Option<u32>,
    /// Pixels per inch on paper, for the size of the legend.
    pub dpi: Option<f64>,
}

/// Degrees around the vertical axis and above the horizon: `30,20`.
///
/// # Errors
/// The expected form, if `text` has another.
pub fn view(text: &str) -> Result<[f64; 2], String> {
    numbers(text, ',')
        .filter(|v: &[f64; 2]| v[0].is_finite() && v[1].abs() <= 90.0)
        .ok_or_else(|| format!("expected degrees around and above (-90 to 90), e.g. 30,20, got {text}"))
}

/// A distance in world units: `30`.
///
/// # Errors
/// The expected form, if `text` has another.
pub fn distance(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|d: &f64| d.is_finite() && *d > 0.0)
        .ok_or_else(|| format!("expected a distance above 0, e.g. 30, got {text}"))
}

/// Pixels per inch: `300`.
///
/// # Errors
/// The expected form, if `text` has another.
fn dpi(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|dpi: &f64| dpi.is_finite() && *dpi > 0.0)
        .ok_or_else(|| format!("expected a number above 0, got {text}"))
}

impl FigureFlags {
    /// Adds the flag of this name, as `pumice render` has it without its dashes, with its text.
    ///
    /// # Errors
    /// Begins with the flag's name and says what was expected; also for a name that no flag has.
    pub fn set(&mut self, flag: &str, text: &str) -> Result<(), String> {
        self.set_parsed(flag, text).map_err(|e| format!("{flag}: {e}"))
    }

    fn set_parsed(&mut self, flag: &str, text: &str) -> Result<(), String> {
        match flag {
            "labels" => self.labels.extend(Selector::parse_list(text)?),
            "query" => self.query = Some(Selector::parse(text)?),
            "pick" => self.pick = Some(whole_from_1(text)? as usize),
            "color" => self.color.push(LabelColor::parse(text)?),
            "material" => self.material.push(LabelPreset::parse(text)?),
            "cut" => self.cut.push(AxisCut::parse(text)?),
            "floor" => self.floor = true,
            "view" => self.view = Some(view(text)?),
            "distance" => self.distance = Some(distance(text)?),
            "frame" => self.frame = Some(FrameOn::parse(text)?),
            "turntable" => self.turntable = Some(whole_from_1(text)?),
            "focus" => self.focus = Some(FocusOn::parse(text)?),
            "aperture" => self.aperture = Some(Opening::parse(text)?),
            "background" => self.background = Some(Background::parse(text)?),
            "smooth" => self.smooth = true,
            "legend" => self.legend = Some(whole_from_1(text)?),
            "dpi" => self.dpi = Some(dpi(text)?),
            _ => return Err("a figure has no such option".into()),
        }
        Ok(())
    }

    /// The first flag that is given and has an effect on volumes alone, because a scene says that itself.
    pub fn first_for_volumes(&self) -> Option<&'static str> {
        let given = [
            ("pick", self.pick.is_some()),
            ("color", !self.color.is_empty()),
            ("material", !self.material.is_empty()),
            ("cut", !self.cut.is_empty()),
            ("floor", self.floor),
            ("view", self.view.is_some()),
            ("distance", self.distance.is_some()),
            ("frame", self.frame.is_some()),
            ("turntable", self.turntable.is_some()),
            ("focus", self.focus.is_some()),
            ("aperture", self.aperture.is_some()),
        ];
        given.iter().find(|(_, is_given)| *is_given).map(|(name, _)| *name)
    }

    /// Whether labels to show are named by anything but ids.
    pub fn queries(&self) -> bool {
        self.query.is_some() || !self.labels.is_empty()
    }

    /// Dense indices of the labels of a volume that `labels` and `query` choose, in their order, each once; `None` where neither is given.
    ///
    /// # Errors
    /// Begins with the flag's name. A selector that chooses nothing is no error here.
    pub fn chosen(&self, volume: &CompressedVolume) -> Result<Option<Vec<u32>>, String> {
        if !self.queries() {
            return Ok(None);
        }
        let (mut taken, mut chosen) = (vec![false; volume.labels().len()], Vec::new());
        let named = self.labels.iter().map(|s| ("labels", s)).chain(self.query.iter().map(|s| ("query", s)));
        for (flag, selector) in named {
            let matches = selector.matches(volume).map_err(|e| format!("{flag}: {e}"))?;
            let new = matches.into_iter().filter(|&label| volume.holds(label));
            chosen.extend(new.filter(|&label| !std::mem::replace(&mut taken[label as usize], true)));
        }
        Ok(Some(chosen))
    }

    /// The first selector of `labels` or `query` that chooses no label of any of the volumes, as an error that begins with the flag's name.
    ///
    /// # Errors
    /// That one.
    pub fn require_matches<'a>(
        &self,
        volumes: impl Iterator<Item = &'a CompressedVolume> + Clone,
        what: &str,
    ) -> Result<(), String> {
        let named = self.labels.iter().map(|s| ("labels", s)).chain(self.query.iter().map(|s| ("query", s)));
        for (flag, selector) in named {
            let mut found = false;
            for volume in volumes.clone() {
                found |= !selector.matches(volume).map_err(|e| format!("{flag}: {e}"))?.is_empty();
            }
            if !found {
                return Err(format!("{flag}: {}", selector.matches_nothing(what)));
            }
        }
        Ok(())
    }

    /// Composes the figure of a volume, whose file is `source`. `labels` are dense indices of the labels to show, if they are known by id.
    ///
    /// # Errors
    /// Begins with the flag's name. The scene is not validated yet.
    pub fn figure(
        &self,
        volume: &CompressedVolume,
        source: PathBuf,
        size: [u32; 2],
        labels: Option<Vec<u32>>,
    ) -> Result<Scene, String> {
        let options = self.options(volume, size, labels)?;
        let mut scene = compose(volume, source, &options);
        self.dress(&mut scene);
        Ok(scene)
    }

    /// Sets what flags say of any scene: its background, and whether voxels are smooth.
    pub fn dress(&self, scene: &mut Scene) {
        match self.background {
            None => {}
            Some(Background::Transparent) => (scene.film.transparent, scene.film.background) = (true, None),
            Some(Background::Color(srgb)) => {
                (scene.film.transparent, scene.film.background) = (true, Some(srgb));
            }
        }
        scene.settings.smooth_voxels |= self.smooth;
    }

    /// The options that the flags mean for a volume.
    fn options(
        &self,
        volume: &CompressedVolume,
        size: [u32; 2],
        labels: Option<Vec<u32>>,
    ) -> Result<FigureOptions, String> {
        self.require_matches(std::iter::once(volume), "the volume")?;
        let view_deg = self.view.unwrap_or(FigureOptions::DEFAULT_VIEW_DEG);
        if self.floor && view_deg[1] < 0.0 {
            let [around, above] = view_deg;
            return Err(format!("floor: it hides what is seen from below, as with view {around},{above}"));
        }

        // Which labels are shown.
        let held = || (0..volume.labels().len() as u32).filter(|&label| volume.holds(label)).collect();
        let chosen = labels.map_or_else(|| self.chosen(volume), |ids| Ok(Some(ids)))?;
        let labels = match self.pick {
            None => chosen,
            Some(count) => Some(select_among(volume, chosen.unwrap_or_else(held), count)),
        };

        // A cut that leaves nothing of them would give an empty picture.
        let shown = labels.clone().unwrap_or_else(held);
        // (At a time step of a series there may be nothing before the cut.)
        let left = |cut| bounds_of(volume, &shown, cut).is_some();
        if !self.cut.is_empty() && !left(&self.cut[..]) && left(&[]) {
            return Err("cut: nothing is left of the labels that are shown".into());
        }

        // How they look.
        let ids = volume.labels().ids();
        let show = labels.as_ref().map_or(Show::All, |labels| {
            Show::Only(labels.iter().map(|&label| ids[label as usize]).collect())
        });
        let style = self
            .style(volume, &shown, labels.is_some())?
            .label_style(volume, show)
            .map_err(|e| e.to_string())?;

        Ok(FigureOptions {
            size,
            labels,
            view_deg,
            frame: self.frame.unwrap_or_default(),
            distance: self.distance,
            turntable: self.turntable,
            style: Some(style),
            cuts: self.cut.clone(),
            floor: self.floor,
            lens: self.lens(volume)?,
            legend: self.legend_reach(volume, &shown, size)?,
        })
    }

    /// How far the legend of these labels reaches from the upper left corner of a picture, in pixels; `None` without a legend.
    fn legend_reach(
        &self,
        volume: &CompressedVolume,
        shown: &[u32],
        size: [u32; 2],
    ) -> Result<Option<[f64; 2]>, String> {
        let Some(most) = self.legend else { return Ok(None) };
        let mut is_shown = vec![false; volume.labels().len()];
        shown.iter().for_each(|&label| is_shown[label as usize] = true);
        let reach = || {
            let (rows, more) = listed(std::iter::once((volume, is_shown)), most as usize)?;
            let [width, height] = size.map(f64::from);
            let paper = Paper { width, height, dpi: self.dpi.unwrap_or(DEFAULT_DPI) };
            let rows: Vec<_> = rows.iter().map(|listed| listed.row([0.0; 3])).collect();
            Ok::<_, String>(reach_of(&legend_marks(&paper, &rows, more)?))
        };
        reach().map(Some).map_err(|e| format!("legend: {e}"))
    }

    /// Colours and materials. A selector of theirs that chooses none of the labels that are `shown` has no effect, and is refused;
    /// `is_chosen` says whether flags chose these, or the volume was read without the others.
    fn style(
        &self,
        volume: &CompressedVolume,
        shown: &[u32],
        is_chosen: bool,
    ) -> Result<FigureStyle, String> {
        let mut is_shown = vec![false; volume.labels().len()];
        shown.iter().for_each(|&label| is_shown[label as usize] = true);
        let labels_of = |flag: &str, selector: &Selector| {
            let labels = selector.labels_in(volume).map_err(|e| format!("{flag}: {e}"))?;
            if labels.iter().any(|&label| is_shown[label as usize]) {
                return Ok(labels);
            }
            Err(format!("{flag}: {}; {}", selector.is_not_shown(), self.how_to_show(is_chosen)))
        };
        let mut style = FigureStyle::default();
        for LabelPreset { selector, preset } in &self.material {
            match selector {
                // What is said of all replaces what was said of some before.
                None => (style.common, style.presets) = (*preset, BTreeMap::new()),
                Some(selector) => {
                    let labels = labels_of("material", selector)?;
                    style.presets.extend(labels.into_iter().map(|label| (label, *preset)));
                }
            }
        }
        for LabelColor { selector, color_srgb } in &self.color {
            let labels = labels_of("color", selector)?;
            style.colors_srgb.extend(labels.into_iter().map(|label| (label, *color_srgb)));
        }
        Ok(style)
    }

    /// How to show a label that is not shown, for whoever gave these flags.
    fn how_to_show(&self, is_chosen: bool) -> &'static str {
        if self.pick.is_some() {
            "pick chose others: name in labels what to show, instead of pick"
        } else if self.query.is_some() {
            "the query does not match: name in labels what to show, which takes ids and queries"
        } else if is_chosen {
            "add it to labels"
        } else {
            "the volume was read without it"
        }
    }

    fn lens(&self, volume: &CompressedVolume) -> Result<Option<Lens>, String> {
        if self.focus.is_none() && self.aperture.is_none() {
            return Ok(None);
        }
        let focus = match &self.focus {
            None => SharpAt::Middle,
            Some(FocusOn::Distance(distance)) => SharpAt::Distance(*distance),
            Some(FocusOn::Labels(selector)) => {
                let labels = selector.labels_in(volume).map_err(|e| format!("focus: {e}"))?;
                let bounds = volume.label_bounds();
                let corners = labels.iter().filter(|&&label| volume.holds(label)).map(|&label| {
                    let b = bounds[label as usize];
                    voxel_corners((b.low, b.high))
                });
                let common = corners.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
                let [low, high] = common.ok_or_else(|| {
                    format!("focus: {}", selector.matches_nothing("the part that was read"))
                })?;
                SharpAt::Index((low + high) / 2.0)
            }
        };
        Ok(Some(Lens { focus, opening: self.aperture.unwrap_or(Lens::DEFAULT_OPENING) }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::samples::named;

    fn figure(flags: &[(&str, &str)]) -> Result<Scene, String> {
        let mut read = FigureFlags::default();
        for (flag, text) in flags {
            read.set(flag, text)?;
        }
        read.figure(&named(), "memory".into(), [32, 18], None)
    }

    fn shown(flags: &[(&str, &str)]) -> Vec<u64> {
        match figure(flags).unwrap().instances[0].style.show.clone() {
            Show::Only(ids) => ids,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn labels_are_chosen_by_any_selector_and_picked_among_them() {
        assert_eq!(shown(&[("labels", "7,thin")]), [7, 3]);
        assert_eq!(shown(&[("labels", "axon,9,3")]), [3, 9]);
        assert_eq!(shown(&[("query", "axon id>3")]), [9]);
        assert_eq!(shown(&[("query", "axon"), ("pick", "1")]), [3]);
        assert_eq!(shown(&[("query", "axon"), ("pick", "9")]), [3, 9]);
        assert_eq!(figure(&[]).unwrap().instances[0].style.show, Show::All);
    }

    #[test]
    fn a_selector_that_chooses_nothing_is_refused_with_its_flag() {
        for (flag, text) in [
            ("labels", "3,axn"),
            ("query", "voxels>9"),
            ("color", "axn=#fff"),
            ("material", "8=glass"),
            ("focus", "8"),
        ] {
            let error = figure(&[(flag, text)]).unwrap_err();
            assert!(error.starts_with(&format!("{flag}: ")) && error.contains("label"), "{error}");
        }
        assert!(figure(&[("pick", "0")]).unwrap_err().starts_with("pick: expected"));
        assert!(figure(&[("glow", "1")]).unwrap_err().contains("no such option"));
        // Label 7 is at the low end of x.
        assert!(
            figure(&[("labels", "7"), ("cut", "-x=0.5")]).unwrap_err().starts_with("cut: nothing is left")
        );
        assert!(figure(&[("labels", "7"), ("cut", "x=0.5")]).is_ok());
        assert!(figure(&[("floor", ""), ("view", "0,-5")]).unwrap_err().starts_with("floor: "));
    }

    #[test]
    fn a_look_of_labels_that_are_not_shown_is_refused_by_name() {
        let refused = |flags: &[(&str, &str)]| figure(flags).unwrap_err();
        for (flag, look) in [("color", "#fff"), ("material", "glass")] {
            let of = |selector: &str| format!("{selector}={look}");
            let line = refused(&[("labels", "3,9"), (flag, &of("7"))]);
            assert!(line.starts_with(&format!("{flag}: label 7 is not shown; add it to labels")), "{line}");
            let line = refused(&[("query", "axon"), (flag, &of("id=7"))]);
            let expected = format!("{flag}: no label that matches id=7 is shown; the query does not match");
            assert!(line.starts_with(&expected), "{line}");
            let line = refused(&[("query", "axon"), ("pick", "1"), (flag, &of("9"))]);
            assert!(line.starts_with(&format!("{flag}: label 9 is not shown; pick chose others")), "{line}");
            // Of several, the one without effect is refused.
            assert!(refused(&[("labels", "3"), (flag, &of("3")), (flag, &of("9"))]).contains("label 9"));

            // Controls: the same look of what is shown, of all of a query of which a part is shown, and where all labels are.
            assert!(figure(&[("labels", "3,9"), (flag, &of("9"))]).is_ok());
            assert!(figure(&[("labels", "3"), (flag, &of("axon"))]).is_ok());
            assert!(figure(&[("labels", "3"), (flag, &of("*"))]).is_ok());
            assert!(figure(&[(flag, &of("7"))]).is_ok());
        }
    }

    #[test]
    fn what_is_said_later_counts() {
        let scene = figure(&[("color", "axon=#f00"), ("color", "9=#00f")]).unwrap();
        let style = &scene.instances[0].style;
        assert_eq!(
            (style.materials[&3].base_color, style.materials[&9].base_color),
            ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
        );
        let groups = |flags: &[(&str, &str)]| figure(flags).unwrap().instances[0].style.groups.len();
        assert_eq!(groups(&[("material", "3=glass"), ("material", "ghost")]), 0);
        assert_eq!(groups(&[("material", "ghost"), ("material", "3=glass")]), 1);
    }

    #[test]
    fn a_background_makes_the_film_transparent() {
        let white = figure(&[("background", "white")]).unwrap().film;
        assert_eq!((white.transparent, white.background), (true, Some([1.0; 3])));
        let clear = figure(&[("background", "transparent")]).unwrap().film;
        assert_eq!((clear.transparent, clear.background), (true, None));
        assert!(!figure(&[]).unwrap().film.transparent);
    }

    #[test]
    fn flags_of_volumes_alone_are_named() {
        let mut flags = FigureFlags::default();
        for (flag, text) in [("labels", "3"), ("query", "3"), ("background", "white"), ("smooth", "")] {
            flags.set(flag, text).unwrap();
        }
        assert_eq!(flags.first_for_volumes(), None);
        for (flag, text) in [
            ("pick", "1"),
            ("color", "3=#fff"),
            ("material", "glass"),
            ("cut", "x=0.5"),
            ("floor", ""),
            ("view", "1,2"),
            ("distance", "9"),
            ("frame", "volume"),
            ("turntable", "4"),
            ("focus", "3"),
            ("aperture", "f/2"),
        ] {
            let mut one = FigureFlags::default();
            one.set(flag, text).unwrap();
            assert_eq!(one.first_for_volumes(), Some(flag));
        }
    }
}

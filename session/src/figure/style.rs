//! The style of a figure's labels: which material and which colour each has.
//!
//! ```text
//! colour    --color ─► else the file's ─► else automatic, unlike its neighbours'
//! material  --material SELECTOR=NAME ─► else --material NAME ─► else plastic
//! ```
//! Labels of the common material with a colour of their own are in the scene's `materials`; labels of another material are in its `groups`,
//! one for each material, so that 10⁵ labels take a line of ids and not a material each.

use std::collections::BTreeMap;

use pumice_core::CompressedVolume;
use pumice_scene::{LabelGroup, LabelGroups, LabelStyle, Material, SceneError, Show};
use pumice_transport::palette::assign_colors;

use super::color::linear;
use super::material::MaterialPreset;

/// Materials and colours that a figure gives to labels, by dense index.
#[derive(Clone, Debug, Default)]
pub struct FigureStyle {
    /// Material of the labels that have none of their own.
    pub common: MaterialPreset,
    /// Materials of single labels.
    pub presets: BTreeMap<u32, MaterialPreset>,
    /// Colours of single labels, sRGB-encoded, each channel from 0 to 1.
    pub colors_srgb: BTreeMap<u32, [f32; 3]>,
}

impl FigureStyle {
    /// The style as a scene has it.
    ///
    /// # Errors
    /// None for labels that the volume has.
    pub(super) fn label_style(
        &self,
        volume: &CompressedVolume,
        show: Show,
    ) -> Result<LabelStyle, SceneError> {
        // Colours: those of the file, then those of the figure.
        let ids = volume.labels().ids();
        let mut colors = colors_of(volume);
        colors.extend(self.colors_srgb.iter().map(|(&label, &color)| (ids[label as usize], color)));

        // Labels of another material, group by group. All of them have a colour of their own there.
        let presets = self.presets.iter().filter(|(_, preset)| **preset != self.common);
        let mut automatic = None;
        let mut groups: BTreeMap<MaterialPreset, (Vec<u64>, Vec<[f32; 3]>)> = BTreeMap::new();
        for (&label, &preset) in presets {
            let id = ids[label as usize];
            let color = match colors.remove(&id) {
                Some(own) => linear(own),
                None => automatic.get_or_insert_with(|| automatic_colors(volume, &show))[label as usize],
            };
            let (of_group, their_colors) = groups.entry(preset).or_default();
            of_group.push(id);
            their_colors.push(color);
        }
        let groups = groups
            .into_iter()
            .map(|(preset, (ids, colors))| LabelGroup::new(preset.material(), ids, colors))
            .collect::<Result<_, _>>()?;
        Ok(LabelStyle { groups: LabelGroups::new(groups)?, ..in_common(self.common, &colors, show) })
    }
}

/// The style of plastic labels in the colours that the file gives them, and in automatic ones.
pub(super) fn plain(volume: &CompressedVolume, show: Show) -> LabelStyle {
    in_common(MaterialPreset::default(), &colors_of(volume), show)
}

/// The colours that the file gives to labels, by id.
fn colors_of(volume: &CompressedVolume) -> BTreeMap<u64, [f32; 3]> {
    volume.info().notes.iter().filter_map(|note| Some((note.id, note.color_srgb?))).collect()
}

/// A style in which all labels have one material; those of `colors` have a colour of their own, the others an automatic one.
fn in_common(common: MaterialPreset, colors: &BTreeMap<u64, [f32; 3]>, show: Show) -> LabelStyle {
    let material = common.material();
    let own = colors.iter().map(|(&id, &color)| (id, Material { base_color: linear(color), ..material }));
    LabelStyle { materials: own.collect(), groups: LabelGroups::default(), show, material, auto_color: true }
}

/// The colours that a scene with `auto_color` gives to labels, by dense index.
fn automatic_colors(volume: &CompressedVolume, show: &Show) -> Vec<[f32; 3]> {
    let labels = volume.labels();
    assign_colors(labels.len(), labels.contacts().iter(), Some(&show.among(labels.ids())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::samples::named;

    const BLUE: [f32; 3] = [0.0, 0.0, 1.0];

    fn style_of(style: &FigureStyle) -> LabelStyle {
        style.label_style(&named(), Show::All).unwrap()
    }

    #[test]
    fn chosen_colors_come_before_those_of_the_file() {
        let plain = style_of(&FigureStyle::default());
        assert_eq!(plain.materials.keys().copied().collect::<Vec<_>>(), [3]);
        assert_eq!(plain.materials[&3].base_color, [1.0, 0.0, 0.0]);
        let chosen =
            style_of(&FigureStyle { colors_srgb: [(0, BLUE), (1, BLUE)].into(), ..Default::default() });
        assert_eq!(chosen.materials.keys().copied().collect::<Vec<_>>(), [3, 7]);
        assert!(
            chosen
                .materials
                .values()
                .all(|m| m.base_color == BLUE && m.roughness == plain.material.roughness)
        );
    }

    #[test]
    fn another_material_keeps_the_color() {
        let presets = [(0, MaterialPreset::Glass), (1, MaterialPreset::Glass), (2, MaterialPreset::Plastic)];
        let style = style_of(&FigureStyle { presets: presets.into(), ..Default::default() });
        assert!(style.materials.is_empty(), "label 3 is in the group alone");
        let [group] = &style.groups[..] else { panic!("{:?}", style.groups) };
        assert_eq!((group.ids(), group.material), (&[3, 7][..], MaterialPreset::Glass.material()));
        assert_eq!(group.colors()[0], [1.0, 0.0, 0.0]);
        // Label 7 keeps the colour that it has in a figure without glass.
        assert_eq!(group.colors()[1], automatic_colors(&named(), &Show::All)[1]);
    }

    #[test]
    fn the_common_material_is_that_of_all() {
        let style = style_of(&FigureStyle { common: MaterialPreset::Ghost, ..Default::default() });
        assert!(style.material.alpha < 1.0 && style.materials[&3].alpha == style.material.alpha);
        assert!(style.groups.is_empty() && style.auto_color);
    }
}

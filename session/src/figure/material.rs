//! Materials of a figure by name.
//!
//! | name | what it is | time to the same error |
//! |---|---|---|
//! | `plastic` | the default: matte with a soft highlight | 1 |
//! | `metal` | brushed metal of the label's colour | 1.7 |
//! | `ghost` | a thin veil that light passes straight through, without refraction: context around opaque labels | 2.0 |
//! | `glass` | clear coloured glass that refracts what is behind | 3.6 |
//!
//! Times are CPU times of twelve neurites that all have the material, `--pick 12 --size 480x270` of the shipped cortex.

use pumice_scene::Material;

use super::selector::Selector;

/// A material by name. The label's colour becomes its base colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum MaterialPreset {
    /// Matte with a soft highlight.
    #[default]
    Plastic,
    /// Brushed metal.
    Metal,
    /// A thin veil: light passes straight through most of it.
    Ghost,
    /// Clear glass that refracts.
    Glass,
}

impl MaterialPreset {
    /// All materials, with their names.
    pub const NAMED: [(&'static str, Self); 4] =
        [("plastic", Self::Plastic), ("metal", Self::Metal), ("ghost", Self::Ghost), ("glass", Self::Glass)];

    /// The material of this name.
    ///
    /// # Errors
    /// The names that there are, if `name` is none of them.
    pub fn parse(name: &str) -> Result<Self, String> {
        match Self::NAMED.iter().find(|(known, _)| *known == name) {
            Some((_, preset)) => Ok(*preset),
            None => Err(format!("expected {}, got {name}", Self::NAMED.map(|(known, _)| known).join(", "))),
        }
    }

    /// The material's values; its base colour is the default's.
    pub fn material(self) -> Material {
        let plastic = Material { roughness: 0.45, specular: 0.35, ..Material::default() };
        match self {
            Self::Plastic => plastic,
            Self::Metal => Material { metallic: 1.0, roughness: 0.35, ..plastic },
            // A ray through a body crosses two of its surfaces, so that it shows 1 − 0.84² ≈ 0.3 of its colour.
            Self::Ghost => Material { alpha: 0.16, roughness: 1.0, specular: 0.0, ..plastic },
            Self::Glass => {
                Material { transmission: 1.0, roughness: 0.0, specular: 0.5, ior: 1.45, ..plastic }
            }
        }
    }
}

/// Labels with a material: `type:axon=glass`, or `glass` for all.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelPreset {
    /// The labels; `None` for all.
    pub selector: Option<Selector>,
    /// Their material.
    pub preset: MaterialPreset,
}

impl LabelPreset {
    /// Parses a name, or a selector, `=` and a name. The last `=` of the text counts, because selectors may have some.
    ///
    /// # Errors
    /// The expected form, if `text` has another.
    pub fn parse(text: &str) -> Result<Self, String> {
        match text.rsplit_once('=') {
            None => Ok(Self { selector: None, preset: MaterialPreset::parse(text)? }),
            Some((selector, name)) => {
                Ok(Self { preset: MaterialPreset::parse(name)?, selector: Some(Selector::parse(selector)?) })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_are_read_or_refused() {
        let glass = LabelPreset { selector: None, preset: MaterialPreset::Glass };
        assert_eq!(LabelPreset::parse("glass"), Ok(glass));
        let some = LabelPreset::parse("type=axon=ghost").unwrap();
        assert_eq!(
            (some.preset, some.selector),
            (MaterialPreset::Ghost, Some(Selector::parse("type=axon").unwrap()))
        );
        assert_eq!(
            LabelPreset::parse("gold").unwrap_err(),
            "expected plastic, metal, ghost, glass, got gold"
        );
        for bad in ["", "17=", "=glass", "glass=17"] {
            assert!(LabelPreset::parse(bad).is_err(), "{bad}");
        }
    }
}

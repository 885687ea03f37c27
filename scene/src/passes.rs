//! Passes (AOVs): the channels of a picture in addition to its colour, by name.

use serde::{Deserialize, Serialize};

macro_rules! passes {
    ($($(#[$doc:meta])* $variant:ident $name:literal,)*) => {
        /// One pass. The page `docs/passes.md` says what each holds.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Pass {
            $($(#[$doc])* $variant,)*
        }

        impl Pass {
            /// All passes, in the order of files and lists.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// The name of the pass in scenes, on the command line and in Python.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }
        }
    };
}

passes! {
    /// Distance to the first surface along the view axis.
    Depth "depth",
    /// World position of the first surface.
    Position "position",
    /// Normal of the first surface.
    Normal "normal",
    /// Label of the first surface.
    Label "label",
    /// Base colour of the first surface.
    Albedo "albedo",
    /// Light from its source that the first surface scatters diffusely to the camera, divided by the diffuse colour.
    DiffuseDirect "diffuse_direct",
    /// Light from other surfaces that the first surface scatters diffusely to the camera, divided by the diffuse colour.
    DiffuseIndirect "diffuse_indirect",
    /// Diffuse colour: the share of uniform light that is scattered diffusely.
    DiffuseColor "diffuse_color",
    /// As `DiffuseDirect`, for reflection.
    GlossyDirect "glossy_direct",
    /// As `DiffuseIndirect`, for reflection.
    GlossyIndirect "glossy_indirect",
    /// As `DiffuseColor`, for reflection.
    GlossyColor "glossy_color",
    /// As `DiffuseDirect`, for transmission.
    TransmissionDirect "transmission_direct",
    /// As `DiffuseIndirect`, for transmission.
    TransmissionIndirect "transmission_indirect",
    /// As `DiffuseColor`, for transmission.
    TransmissionColor "transmission_color",
    /// Light that visible surfaces and lamps emit themselves.
    Emission "emission",
    /// The sky or the backdrop where the camera sees it.
    Environment "environment",
    /// Share of a shadow catcher's light that is not blocked: 1 where nothing shades it.
    ShadowCatcher "shadow_catcher",
    /// Cryptomatte of labels: the labels that a pixel sees, each with the share of the pixel that it covers.
    CryptomatteLabel "cryptomatte_label",
    /// Cryptomatte of the labels' types.
    CryptomatteType "cryptomatte_type",
    /// Variance of the pixel's colour, estimated from its samples.
    Variance "variance",
    /// Number of samples of the pixel.
    Samples "samples",
}

impl Pass {
    /// The passes of light and of the colours that the light is divided by.
    pub const LIGHT: &'static [Self] = &[
        Self::DiffuseDirect,
        Self::DiffuseIndirect,
        Self::DiffuseColor,
        Self::GlossyDirect,
        Self::GlossyIndirect,
        Self::GlossyColor,
        Self::TransmissionDirect,
        Self::TransmissionIndirect,
        Self::TransmissionColor,
        Self::Emission,
        Self::Environment,
    ];

    /// The Cryptomatte passes.
    pub const MATTES: &'static [Self] = &[Self::CryptomatteLabel, Self::CryptomatteType];
}

/// A set of passes. Its JSON form is a list of names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Vec<Pass>", into = "Vec<Pass>")]
pub struct Passes(u32);

impl From<Vec<Pass>> for Passes {
    fn from(list: Vec<Pass>) -> Self {
        list.into_iter().collect()
    }
}

impl From<Passes> for Vec<Pass> {
    fn from(set: Passes) -> Self {
        set.iter().collect()
    }
}

impl FromIterator<Pass> for Passes {
    fn from_iter<I: IntoIterator<Item = Pass>>(list: I) -> Self {
        list.into_iter().fold(Self::NONE, Self::with)
    }
}

impl Passes {
    /// The empty set: a picture with colour only.
    pub const NONE: Self = Self(0);
    /// The set of all passes.
    pub const ALL: Self = Self((1 << Pass::ALL.len()) - 1);

    /// This set with `pass` added.
    #[must_use]
    pub const fn with(self, pass: Pass) -> Self {
        Self(self.0 | 1 << pass as u32)
    }

    /// The union of both sets.
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether the set contains `pass`.
    pub const fn has(self, pass: Pass) -> bool {
        self.0 >> pass as u32 & 1 != 0
    }

    /// Whether the set contains any of these passes.
    pub fn has_any(self, of: &[Pass]) -> bool {
        of.iter().any(|p| self.has(*p))
    }

    /// Whether the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The passes in the set, in the order of [`Pass::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Pass> {
        Pass::ALL.iter().copied().filter(move |p| self.has(*p))
    }

    /// Parses names of passes and of the groups `light` and `cryptomatte`; `all` and `none` must be the only name.
    ///
    /// # Errors
    /// One line that quotes the unknown name and lists the valid ones.
    pub fn parse(names: &[String]) -> Result<Self, String> {
        let mut passes = Self::NONE;
        for name in names {
            match name.as_str() {
                "all" if names.len() == 1 => return Ok(Self::ALL),
                "none" if names.len() == 1 => return Ok(Self::NONE),
                "all" | "none" => return Err(format!("passes: \"{name}\" must stand alone")),
                "light" => passes = passes.or(Pass::LIGHT.iter().copied().collect()),
                "cryptomatte" => passes = passes.or(Pass::MATTES.iter().copied().collect()),
                other => match Pass::ALL.iter().find(|p| p.name() == other) {
                    Some(pass) => passes = passes.with(*pass),
                    None => {
                        let names: Vec<_> = Pass::ALL.iter().map(|p| p.name()).collect();
                        let names = names.join(", ");
                        return Err(format!(
                            "passes: expected all, none, light, cryptomatte or any of {names}; got {other:?}"
                        ));
                    }
                },
            }
        }
        Ok(passes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(names: &str) -> Result<Passes, String> {
        Passes::parse(&names.split(',').map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn names_are_read() {
        assert_eq!(parse("all"), Ok(Passes::ALL));
        assert_eq!(parse("none"), Ok(Passes::NONE));
        assert_eq!(Passes::parse(&[]), Ok(Passes::NONE));
        assert_eq!(parse("depth,label"), Ok(Passes::NONE.with(Pass::Depth).with(Pass::Label)));
        let names: Vec<_> = Pass::ALL.iter().map(|p| p.name()).collect();
        assert_eq!(parse(&names.join(",")), Ok(Passes::ALL), "every listed name is known");
        let light = parse("light").unwrap();
        assert!(light.iter().eq(Pass::LIGHT.iter().copied()) && !light.has(Pass::Depth));
        assert!(parse("cryptomatte").unwrap().iter().eq(Pass::MATTES.iter().copied()));
    }

    #[test]
    fn unknown_names_are_refused_with_the_list() {
        let error = parse("depth,beauty\n").unwrap_err();
        assert!(
            error.starts_with("passes: expected all, none, light, cryptomatte or any of depth, position, "),
            "{error}"
        );
        assert!(error.ends_with("variance, samples; got \"beauty\\n\""), "{error}");
        assert!(parse("all,depth").is_err() && parse("Depth").is_err() && parse("").is_err());
    }

    /// `Pass::name` is the name in JSON, and a set becomes a list in a fixed order, whatever the order in which it was given.
    #[test]
    fn sets_are_lists_in_json() {
        for pass in Pass::ALL {
            assert_eq!(serde_json::to_string(pass).unwrap(), format!("\"{}\"", pass.name()));
        }
        let set: Passes = serde_json::from_str(r#"["emission", "depth", "emission"]"#).unwrap();
        assert_eq!(serde_json::to_string(&set).unwrap(), r#"["depth","emission"]"#);
        assert!(serde_json::from_str::<Passes>(r#"["beauty"]"#).is_err());
    }
}

//! Passes: what a picture holds beside its colour, by name.

use serde::{Deserialize, Serialize};

macro_rules! passes {
    ($($(#[$doc:meta])* $variant:ident $name:literal,)*) => {
        /// One pass; what each holds is on the page `docs/passes.md`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Pass {
            $($(#[$doc])* $variant,)*
        }

        impl Pass {
            /// All, in the order of files and lists.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// As in scenes, on the command line and in Python.
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
    /// Where it is in the world.
    Position "position",
    /// Its normal.
    Normal "normal",
    /// Its label.
    Label "label",
    /// Its colour.
    Albedo "albedo",
    /// Light by the way it was last scattered towards the camera: Lambert's, straight from its source, over the colour.
    DiffuseDirect "diffuse_direct",
    /// The same after further surfaces.
    DiffuseIndirect "diffuse_indirect",
    /// Part of even light that is scattered so.
    DiffuseColor "diffuse_color",
    /// The same of what is reflected.
    GlossyDirect "glossy_direct",
    /// See above.
    GlossyIndirect "glossy_indirect",
    /// See above.
    GlossyColor "glossy_color",
    /// The same of what passes through.
    TransmissionDirect "transmission_direct",
    /// See above.
    TransmissionIndirect "transmission_indirect",
    /// See above.
    TransmissionColor "transmission_color",
    /// Light that seen surfaces and lamps send out themselves.
    Emission "emission",
    /// The sky or the backdrop where it is seen.
    Environment "environment",
    /// What is left of a shadow catcher's light: 1 where nothing shades it.
    ShadowCatcher "shadow_catcher",
    /// Labels by name, each with the part of the pixel that it covers.
    CryptomatteLabel "cryptomatte_label",
    /// The same by the labels' types.
    CryptomatteType "cryptomatte_type",
    /// Variance of the picture.
    Variance "variance",
    /// Number of samples.
    Samples "samples",
}

impl Pass {
    /// Passes of light and of the colours that it is divided by.
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

    /// Mattes after the specification of Cryptomatte.
    pub const MATTES: &'static [Self] = &[Self::CryptomatteLabel, Self::CryptomatteType];
}

/// A set of passes; in JSON a list of names.
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
    /// The colour alone.
    pub const NONE: Self = Self(0);
    /// Every pass.
    pub const ALL: Self = Self((1 << Pass::ALL.len()) - 1);

    /// The set with one more.
    #[must_use]
    pub const fn with(self, pass: Pass) -> Self {
        Self(self.0 | 1 << pass as u32)
    }

    /// What is in either.
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether a pass is among them.
    pub const fn has(self, pass: Pass) -> bool {
        self.0 >> pass as u32 & 1 != 0
    }

    /// Whether any of these is among them.
    pub fn has_any(self, of: &[Pass]) -> bool {
        of.iter().any(|p| self.has(*p))
    }

    /// Whether there is none.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Its passes in their order.
    pub fn iter(self) -> impl Iterator<Item = Pass> {
        Pass::ALL.iter().copied().filter(move |p| self.has(*p))
    }

    /// Reads names of passes and the groups `light` and `cryptomatte`; `all` and `none` must stand alone.
    ///
    /// # Errors
    /// One line that names what is not a pass and lists those that are.
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

    /// The names of the list are those of JSON, and a set is a list there, whatever its order was.
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

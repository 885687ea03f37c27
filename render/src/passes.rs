//! Which passes a file holds beside the colour.

/// Names, and what each is; the order in which errors list them.
const NAMES: [&str; 5] = ["variance", "depth", "label", "albedo", "normal"];

/// The passes to write; a pass that the picture does not have is left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Passes {
    /// Variance of the mean, each channel.
    pub variance: bool,
    /// Distance to the first surface.
    pub depth: bool,
    /// Label of the first surface.
    pub label: bool,
    /// Base colour of the first surface.
    pub albedo: bool,
    /// Normal of the first surface.
    pub normal: bool,
}

impl Passes {
    /// Colour alone.
    pub const NONE: Self = Self { variance: false, depth: false, label: false, albedo: false, normal: false };
    /// Every pass.
    pub const ALL: Self = Self { variance: true, depth: true, label: true, albedo: true, normal: true };

    /// Reads names of passes; `all` and `none` must stand alone.
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
                "variance" => passes.variance = true,
                "depth" => passes.depth = true,
                "label" => passes.label = true,
                "albedo" => passes.albedo = true,
                "normal" => passes.normal = true,
                other => {
                    let names = NAMES.join(", ");
                    return Err(format!("passes: expected all, none or any of {names}; got {other:?}"));
                }
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
        assert_eq!(parse("depth,label"), Ok(Passes { depth: true, label: true, ..Passes::NONE }));
        assert_eq!(parse(&NAMES.join(",")), Ok(Passes::ALL), "every listed name is known");
    }

    #[test]
    fn unknown_names_are_refused_with_the_list() {
        let error = parse("depth,beauty\n").unwrap_err();
        assert_eq!(
            error,
            "passes: expected all, none or any of variance, depth, label, albedo, normal; got \"beauty\\n\""
        );
        assert!(parse("all,depth").is_err() && parse("Depth").is_err() && parse("").is_err());
    }
}

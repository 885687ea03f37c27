//! Colours as flags and states of Neuroglancer write them, those of CSS: `#e0a030`, `#fff`, `white`, `rgb(224 160 48)`.

use pumice_picture::metrics::display::linear_from_srgb;

use super::selector::Selector;

/// Parses a display colour as CSS has them: sRGB-encoded channels from 0 to 1.
///
/// # Errors
/// The expected form, if `text` has another, or if the colour is not opaque.
pub fn css_color(text: &str) -> Result<[f32; 3], String> {
    let wrong = || format!("expected a colour such as #e0a030 or orange, got {text}");
    // The parser takes hexadecimal digits alone for a colour, as CSS does not.
    if text.chars().all(|c| c.is_ascii_hexdigit()) {
        return Err(wrong());
    }
    let color = csscolorparser::parse(text).map_err(|_| wrong())?;
    let channels = [color.r, color.g, color.b];
    let is_sound = color.a >= 1.0 && channels.iter().all(|c| c.is_finite());
    if is_sound { Ok(channels.map(|c| c.clamp(0.0, 1.0))) } else { Err(wrong()) }
}

/// The linear Rec. 709 colour of a display colour, each channel from 0 to 1.
pub(crate) fn linear(color_srgb: [f32; 3]) -> [f32; 3] {
    color_srgb.map(|c| linear_from_srgb(f64::from(c.clamp(0.0, 1.0))) as f32)
}

/// Labels with a colour: `17=#e0a030`, `type:axon=#26c`.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelColor {
    /// The labels.
    pub selector: Selector,
    /// Their colour, sRGB-encoded, each channel from 0 to 1.
    pub color_srgb: [f32; 3],
}

impl LabelColor {
    /// Parses a selector, `=` and a [colour](css_color). The last `=` of the text counts, because selectors may have some.
    ///
    /// # Errors
    /// The expected form, if `text` has another.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (selector, color) = text
            .rsplit_once('=')
            .ok_or_else(|| format!("expected SELECTOR=COLOR, e.g. 17=#e0a030, got {text}"))?;
        Ok(Self { color_srgb: css_color(color)?, selector: Selector::parse(selector)? })
    }
}

/// What is behind everything in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// Nothing: the picture has alpha.
    Transparent,
    /// A display colour, sRGB-encoded, each channel from 0 to 1.
    Color([f32; 3]),
}

impl Background {
    /// Parses `transparent` or a [colour](css_color).
    ///
    /// # Errors
    /// The expected form, if `text` has another.
    pub fn parse(text: &str) -> Result<Self, String> {
        match text {
            "transparent" => Ok(Self::Transparent),
            _ => css_color(text).map(Self::Color).map_err(|_| {
                format!("expected transparent, white or another colour such as #e0a030, got {text}")
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_are_read_or_refused() {
        let eight_bits = |text| css_color(text).map(|of| of.map(|c| (255.0 * c).round() as u8));
        for (text, color) in [
            ("#ff0033", [255, 0, 51]),
            ("#F03", [255, 0, 51]),
            ("#ff0033ff", [255, 0, 51]),
            ("red", [255, 0, 0]),
            ("RebeccaPurple", [102, 51, 153]),
            ("rgb(0,255,64)", [0, 255, 64]),
            ("rgb(0% 100% 50% / 1)", [0, 255, 128]),
            ("hsl(120, 100%, 25%)", [0, 128, 0]),
        ] {
            assert_eq!(eight_bits(text), Ok(color), "{text}");
        }
        let opaque = ["transparent", "#ff003380", "rgba(1, 2, 3, 0.5)"];
        let wrong =
            ["ff0033", "fff", "#ff003", "#ff00334", "#gg0000", "#", "", "reddish", "#é00", "rgb(NaN,0,0)"];
        for bad in wrong.into_iter().chain(opaque) {
            assert!(css_color(bad).unwrap_err().contains("such as #e0a030"), "{bad}");
        }
        assert_eq!(Background::parse("white"), Ok(Background::Color([1.0; 3])));
        assert_eq!(Background::parse("transparent"), Ok(Background::Transparent));
        assert_eq!(Background::parse("black"), Ok(Background::Color([0.0; 3])));
        assert!(Background::parse("greyish").unwrap_err().ends_with("got greyish"));
    }

    #[test]
    fn the_last_equals_sign_counts() {
        let parsed = LabelColor::parse("type=axon=#000").unwrap();
        assert_eq!(parsed.selector, Selector::parse("type=axon").unwrap());
        for bad in ["17", "17=", "=#000", "17=#00", "17=#000="] {
            assert!(LabelColor::parse(bad).is_err(), "{bad}");
        }
    }
}

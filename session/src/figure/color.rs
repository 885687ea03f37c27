//! Colours as flags write them: `#e0a030`, `#fff`, `white`.

use pumice_picture::metrics::display::linear_from_srgb;

use super::selector::Selector;

/// Parses a display colour, `#rrggbb` or `#rgb`: sRGB-encoded channels from 0 to 1.
///
/// # Errors
/// The expected form, if `text` has another.
pub fn hex_color(text: &str) -> Result<[f32; 3], String> {
    let wrong = || format!("expected a colour such as #e0a030, got {text}");
    let digits = text.strip_prefix('#').ok_or_else(wrong)?;
    let nibbles: Vec<u32> =
        digits.chars().map(|c| c.to_digit(16)).collect::<Option<_>>().ok_or_else(wrong)?;
    let bytes: [u32; 3] = match nibbles[..] {
        [r, g, b] => [17 * r, 17 * g, 17 * b],
        [r, s, g, h, b, c] => [16 * r + s, 16 * g + h, 16 * b + c],
        _ => return Err(wrong()),
    };
    Ok(bytes.map(|byte| byte as f32 / 255.0))
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
    /// Parses a selector, `=` and a colour. The last `=` of the text counts, because selectors may have some.
    ///
    /// # Errors
    /// The expected form, if `text` has another.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (selector, color) = text
            .rsplit_once('=')
            .ok_or_else(|| format!("expected SELECTOR=#RRGGBB, e.g. 17=#e0a030, got {text}"))?;
        Ok(Self { color_srgb: hex_color(color)?, selector: Selector::parse(selector)? })
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
    /// Parses `white`, `black`, `transparent` or a colour such as `#e0a030`.
    ///
    /// # Errors
    /// The expected form, if `text` has another.
    pub fn parse(text: &str) -> Result<Self, String> {
        match text {
            "transparent" => Ok(Self::Transparent),
            "white" => Ok(Self::Color([1.0; 3])),
            "black" => Ok(Self::Color([0.0; 3])),
            _ => hex_color(text).map(Self::Color).map_err(|_| {
                format!("expected white, black, transparent or a colour such as #e0a030, got {text}")
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_are_read_or_refused() {
        assert_eq!(hex_color("#ff0033").unwrap(), [1.0, 0.0, 0.2]);
        assert_eq!(hex_color("#F03").unwrap(), [1.0, 0.0, 0.2]);
        for bad in ["ff0033", "#ff003", "#ff00334", "#gg0000", "#", "", "red", "#é00"] {
            assert!(hex_color(bad).unwrap_err().contains("such as #e0a030"), "{bad}");
        }
        assert_eq!(Background::parse("white"), Ok(Background::Color([1.0; 3])));
        assert_eq!(Background::parse("transparent"), Ok(Background::Transparent));
        assert!(Background::parse("grey").unwrap_err().ends_with("got grey"));
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

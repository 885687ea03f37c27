//! The wishes for annotations, as flags and files have them.

use std::fmt;
use std::str::FromStr;

use pumice_core::Unit;
use serde::{Deserialize, Serialize};

/// Annotations of a picture, and the density that its file states.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Annotations {
    /// Pixels per inch on paper.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dpi: Option<f64>,
    /// A scale bar.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale_bar: Option<ScaleBar>,
    /// A legend with at most this many labels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub legend: Option<u32>,
}

impl Annotations {
    /// Whether nothing is wished for.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// The length of a scale bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BarLength {
    /// 1, 2 or 5 times a power of ten that fills at most a quarter of the picture's width.
    Auto,
    /// A length, above 0; without a unit in that of the volume.
    Given(f64, Option<Unit>),
}

/// Where a scale bar is true in a perspective view: a plane across the camera's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BarPlane {
    /// Through the middle of what is shown.
    Middle,
    /// Where the camera is sharp.
    Focus,
    /// At this distance from the camera, in world units.
    Distance(f64),
}

/// A scale bar. Its text form is `10um`, `auto`, `10um@center`, `auto@focus` or `10um@4.5`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ScaleBar {
    /// How long it is.
    pub length: BarLength,
    /// Where it is true; a perspective view needs it.
    pub plane: Option<BarPlane>,
}

/// Names of units; a micrometre's is written with the sign µ or the Greek letter μ. The metre comes last, since others end with its name.
const UNITS: [(&str, Unit); 6] = [
    ("nm", Unit::Nanometre),
    ("um", Unit::Micrometre),
    ("µm", Unit::Micrometre),
    ("μm", Unit::Micrometre),
    ("mm", Unit::Millimetre),
    ("m", Unit::Metre),
];

impl FromStr for ScaleBar {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "expected a length with nm, um, mm or m, or auto, and in perspective a plane: 10um, 10um@center, auto@focus; got {text:?}"
            )
        };
        let number =
            |text: &str| text.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0).ok_or_else(wrong);
        let (length, plane) =
            text.split_once('@').map_or((text, None), |(length, plane)| (length, Some(plane)));
        let plane = match plane {
            None => None,
            Some("center" | "middle") => Some(BarPlane::Middle),
            Some("focus") => Some(BarPlane::Focus),
            Some(distance) => Some(BarPlane::Distance(number(distance)?)),
        };
        let length = length.trim();
        if length == "auto" {
            return Ok(Self { length: BarLength::Auto, plane });
        }
        let unit = UNITS.iter().find_map(|(name, unit)| Some((length.strip_suffix(name)?, *unit)));
        let length = match unit {
            None => BarLength::Given(number(length)?, None),
            Some((digits, unit)) => BarLength::Given(number(digits.trim())?, Some(unit)),
        };
        Ok(Self { length, plane })
    }
}

impl fmt::Display for ScaleBar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.length {
            BarLength::Auto => f.write_str("auto")?,
            BarLength::Given(length, unit) => {
                let unit = UNITS.iter().find(|(_, known)| Some(*known) == unit).map_or("", |(name, _)| name);
                write!(f, "{length}{unit}")?;
            }
        }
        match self.plane {
            None => Ok(()),
            Some(BarPlane::Middle) => f.write_str("@center"),
            Some(BarPlane::Focus) => f.write_str("@focus"),
            Some(BarPlane::Distance(distance)) => write!(f, "@{distance}"),
        }
    }
}

impl TryFrom<String> for ScaleBar {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<ScaleBar> for String {
    fn from(bar: ScaleBar) -> Self {
        bar.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_bars_are_read_written_and_refused() {
        let bar = |length, plane| ScaleBar { length, plane };
        let um = |n| BarLength::Given(n, Some(Unit::Micrometre));
        for (text, expected, again) in [
            ("10um", bar(um(10.0), None), "10um"),
            ("0.5 µm@center", bar(um(0.5), Some(BarPlane::Middle)), "0.5um@center"),
            ("2μm@middle", bar(um(2.0), Some(BarPlane::Middle)), "2um@center"),
            (
                "1e3nm@focus",
                bar(BarLength::Given(1e3, Some(Unit::Nanometre)), Some(BarPlane::Focus)),
                "1000nm@focus",
            ),
            ("2mm", bar(BarLength::Given(2.0, Some(Unit::Millimetre)), None), "2mm"),
            (
                "3m@4.5",
                bar(BarLength::Given(3.0, Some(Unit::Metre)), Some(BarPlane::Distance(4.5))),
                "3m@4.5",
            ),
            ("7", bar(BarLength::Given(7.0, None), None), "7"),
            ("auto", bar(BarLength::Auto, None), "auto"),
        ] {
            assert_eq!(text.parse(), Ok(expected), "{text}");
            assert_eq!(expected.to_string(), again);
            assert_eq!(again.parse(), Ok(expected));
        }
        for bad in [
            "",
            "um",
            "0um",
            "-1um",
            "nan",
            "inf",
            "10 parsecs",
            "10um@",
            "10um@back",
            "10um@-1",
            "10um@focus@center",
        ] {
            let error = bad.parse::<ScaleBar>().unwrap_err();
            assert!(error.starts_with("expected a length") && error.contains(&format!("{bad:?}")), "{error}");
        }
    }
}

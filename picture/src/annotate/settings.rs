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
    /// Where the scale bar is.
    #[serde(skip_serializing_if = "Corner::is_default")]
    pub scale_bar_corner: Corner,
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

/// A corner of the picture. Its text form is `lower-left`, also with an underscore.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Corner {
    /// Lower right, where a scale bar is unless another corner is asked for.
    #[default]
    LowerRight,
    /// Lower left.
    LowerLeft,
    /// Upper right.
    UpperRight,
    /// Upper left, where the legend is.
    UpperLeft,
}

/// Corners with their names.
const CORNERS: [(&str, Corner); 4] = [
    ("lower-right", Corner::LowerRight),
    ("lower-left", Corner::LowerLeft),
    ("upper-right", Corner::UpperRight),
    ("upper-left", Corner::UpperLeft),
];

impl Corner {
    /// Whether it is the corner of a scale bar that asks for none.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Whether it is at the left side.
    pub fn is_left(self) -> bool {
        matches!(self, Self::LowerLeft | Self::UpperLeft)
    }

    /// Whether it is at the upper side.
    pub fn is_upper(self) -> bool {
        matches!(self, Self::UpperRight | Self::UpperLeft)
    }
}

impl FromStr for Corner {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let name = text.replace('_', "-");
        CORNERS.iter().find(|(known, _)| *known == name).map(|(_, corner)| *corner).ok_or_else(|| {
            format!("expected lower-right, lower-left, upper-right or upper-left, got {text:?}")
        })
    }
}

impl fmt::Display for Corner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = CORNERS.iter().find(|(_, corner)| corner == self);
        f.write_str(name.map_or("", |(name, _)| name))
    }
}

impl TryFrom<String> for Corner {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Corner> for String {
    fn from(corner: Corner) -> Self {
        corner.to_string()
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
    fn corners_are_read_written_and_refused() {
        for (name, corner, is_left, is_upper) in [
            ("lower-right", Corner::LowerRight, false, false),
            ("lower-left", Corner::LowerLeft, true, false),
            ("upper-right", Corner::UpperRight, false, true),
            ("upper-left", Corner::UpperLeft, true, true),
        ] {
            assert_eq!((name.parse(), name.replace('-', "_").parse()), (Ok(corner), Ok(corner)));
            assert_eq!(
                (corner.to_string().as_str(), corner.is_left(), corner.is_upper()),
                (name, is_left, is_upper)
            );
        }
        for bad in ["", "left", "lower right", "LOWER-LEFT"] {
            let error = bad.parse::<Corner>().unwrap_err();
            assert_eq!(
                error,
                format!("expected lower-right, lower-left, upper-right or upper-left, got {bad:?}")
            );
        }
        // Pictures made before corners could be chosen carry none, and a bar where it always was is written as it was.
        let old = r#"{"scale_bar":"10um"}"#;
        let read: Annotations = serde_json::from_str(old).unwrap();
        assert!(read.scale_bar_corner == Corner::LowerRight && serde_json::to_string(&read).unwrap() == old);
        let aside = Annotations { scale_bar_corner: Corner::UpperLeft, ..read };
        let text = serde_json::to_string(&aside).unwrap();
        assert_eq!(text, r#"{"scale_bar":"10um","scale_bar_corner":"upper-left"}"#);
        assert_eq!(serde_json::from_str::<Annotations>(&text).unwrap(), aside);
    }

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

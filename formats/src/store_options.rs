//! Options for volumes that are too large to be read whole: level of detail, region, and what absent chunks mean. Each has a text form, which
//! the command takes, and scenes and Python too.

use std::fmt;
use std::str::FromStr;

/// Which level of a file that holds a volume at several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// By its number in the file; 0 is the finest.
    Level(u32),
    /// The level whose voxels are nearest to these lengths along x, y, z, in the unit of the file.
    Size([f64; 3]),
}

impl FromStr for Scale {
    type Err = String;

    /// Parses `2` or `32,32,40`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "expected the number of a level such as 2, or voxel lengths x,y,z such as 32,32,40, got {text:?}"
            )
        };
        if let Ok(level) = text.trim().parse() {
            return Ok(Self::Level(level));
        }
        let lengths: Vec<f64> =
            text.split(',').map(|part| part.trim().parse().map_err(|_| wrong())).collect::<Result<_, _>>()?;
        let lengths: [f64; 3] = lengths.try_into().map_err(|_| wrong())?;
        if lengths.iter().all(|length| length.is_finite() && *length > 0.0) {
            Ok(Self::Size(lengths))
        } else {
            Err(wrong())
        }
    }
}

impl fmt::Display for Scale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Level(level) => write!(f, "{level}"),
            Self::Size([x, y, z]) => write!(f, "{x},{y},{z}"),
        }
    }
}

/// A box of voxels along x, y, z: the first voxel, and the one after the last. `None` is the volume's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Roi(pub [[Option<u64>; 2]; 3]);

impl FromStr for Roi {
    type Err = String;

    /// Parses `x0:x1,y0:y1,z0:z1`; what is left out is the volume's end.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("expected x0:x1,y0:y1,z0:z1 in voxels, such as 0:512,100:200,:, got {text:?}");
        let number = |part: &str| match part.trim() {
            "" => Ok(None),
            digits => digits.parse().map(Some).map_err(|_| wrong()),
        };
        let mut ends = Vec::new();
        for part in text.split(',') {
            let (low, high) = part.split_once(':').ok_or_else(wrong)?;
            let (low, high) = (number(low)?, number(high)?);
            if high.is_some_and(|high| low.unwrap_or(0) >= high) {
                return Err(format!(
                    "{part}: the first voxel must lie below the one after the last, got {text:?}"
                ));
            }
            ends.push([low, high]);
        }
        ends.try_into().map(Self).map_err(|_| wrong())
    }
}

impl fmt::Display for Roi {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = |end: Option<u64>| end.map_or_else(String::new, |n| n.to_string());
        let parts = self.0.map(|[low, high]| format!("{}:{}", text(low), text(high)));
        f.write_str(&parts.join(","))
    }
}

/// What a chunk means that a store lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissingChunks {
    /// The fill value of the store, with a warning that counts them.
    Fill,
    /// The store is incomplete: an error that names the chunk.
    Error,
}

impl MissingChunks {
    /// Both meanings.
    pub const ALL: [Self; 2] = [Self::Fill, Self::Error];

    /// Name: `fill` or `error`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fill => "fill",
            Self::Error => "error",
        }
    }
}

impl FromStr for MissingChunks {
    type Err = String;

    /// Parses `fill` or `error`.
    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|missing| missing.name() == text)
            .ok_or_else(|| format!("expected fill or error, got {text:?}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_come_back() {
        for text in ["0", "2", "32,32,40", "0.5,0.5,1.25"] {
            assert_eq!(text.parse::<Scale>().unwrap().to_string(), text);
        }
        for text in ["0:5,1:2,3:4", ":,:,:", "7:,:9,2:3"] {
            assert_eq!(text.parse::<Roi>().unwrap().to_string(), text);
        }
        assert_eq!("4".parse(), Ok(Scale::Level(4)));
        assert_eq!(" 1: 2 ,:,3:".parse(), Ok(Roi([[Some(1), Some(2)], [None; 2], [Some(3), None]])));
    }

    #[test]
    fn what_is_no_scale_and_no_region_is_refused() {
        for text in ["", "-1", "1,2", "1,2,3,4", "1,2,0", "1,2,inf", "1,2,NaN", "x"] {
            assert!(text.parse::<Scale>().is_err(), "{text}");
        }
        for text in
            ["", "1:2", "1:2,3:4,5", "1:2,3:4,5:6,7:8", "2:2,:,:", "3:2,:,:", ":0,:,:", "-1:2,:,:", "a:b,:,:"]
        {
            assert!(text.parse::<Roi>().is_err(), "{text}");
        }
        assert!("ignore".parse::<MissingChunks>().is_err());
    }
}

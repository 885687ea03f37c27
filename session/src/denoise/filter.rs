//! The filter that finished pictures go through: as callers name it, and ready for use.

use std::path::PathBuf;
use std::str::FromStr;

use super::oidn::Oidn;
use crate::error::Result;

/// A denoiser as callers name it: `statistical`, `oidn`, or `oidn:LIBRARY` with the path of the library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DenoiserName {
    /// [Pumice's own](pumice_picture::denoise).
    Statistical,
    /// Intel's Open Image Denoise from this library, or from where [`Oidn::find`] looks.
    Oidn(Option<PathBuf>),
}

impl FromStr for DenoiserName {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text.split_once(':') {
            None if text == "statistical" => Ok(Self::Statistical),
            None if text == "oidn" => Ok(Self::Oidn(None)),
            Some(("oidn", library)) if !library.is_empty() => Ok(Self::Oidn(Some(library.into()))),
            _ => Err(format!("expected statistical, oidn or oidn:LIBRARY, got {text:?}")),
        }
    }
}

impl DenoiserName {
    /// The filter of this name, ready for use.
    ///
    /// # Errors
    /// Those of [`Oidn::find`].
    pub fn filter(&self) -> Result<Filter> {
        match self {
            Self::Statistical => Ok(Filter::Statistical),
            Self::Oidn(library) => Ok(Filter::Oidn(Oidn::find(library.as_deref())?)),
        }
    }
}

/// A filter that is ready for use, so that nothing is rendered for one that is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// [Pumice's own](pumice_picture::denoise).
    Statistical,
    /// Intel's Open Image Denoise.
    Oidn(&'static Oidn),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_and_others_are_refused() {
        assert_eq!("statistical".parse(), Ok(DenoiserName::Statistical));
        assert_eq!("oidn".parse(), Ok(DenoiserName::Oidn(None)));
        assert_eq!("oidn:C:\\a.dll".parse(), Ok(DenoiserName::Oidn(Some("C:\\a.dll".into()))));
        for text in ["", "true", "OIDN", "oidn:", "statistical:", "optix"] {
            let line = format!("expected statistical, oidn or oidn:LIBRARY, got {text:?}");
            assert_eq!(text.parse::<DenoiserName>(), Err(line));
        }
    }
}

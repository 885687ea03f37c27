//! The filter that a picture went through, as files name it.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// A filter that a picture went through. Files hold its text, which says that the picture is no longer the mean of its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Denoiser {
    /// The [filter](super) of this crate: `statistical, biased`.
    Statistical,
    /// Intel's Open Image Denoise with its version: `Open Image Denoise 2.3.3, biased`.
    OpenImageDenoise([u32; 3]),
}

const STATISTICAL: &str = "statistical";
const OPEN_IMAGE_DENOISE: &str = "Open Image Denoise ";
const BIASED: &str = ", biased";

impl Denoiser {
    /// Its name, with the version where it has one.
    pub fn name(self) -> String {
        match self {
            Self::Statistical => STATISTICAL.into(),
            Self::OpenImageDenoise([major, minor, patch]) => {
                format!("{OPEN_IMAGE_DENOISE}{major}.{minor}.{patch}")
            }
        }
    }
}

impl fmt::Display for Denoiser {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{BIASED}", self.name())
    }
}

impl FromStr for Denoiser {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let name = text.strip_suffix(BIASED);
        let version = name.and_then(|name| name.strip_prefix(OPEN_IMAGE_DENOISE)).and_then(|version| {
            let parts: Vec<u32> = version.split('.').map(|part| part.parse().ok()).collect::<Option<_>>()?;
            <[u32; 3]>::try_from(parts).ok()
        });
        match (name, version) {
            (Some(STATISTICAL), _) => Ok(Self::Statistical),
            (_, Some(version)) => Ok(Self::OpenImageDenoise(version)),
            _ => Err(format!(
                "expected a denoiser (\"{}\", or such as \"{}\"), got {text:?}",
                Self::Statistical,
                Self::OpenImageDenoise([2, 3, 3])
            )),
        }
    }
}

impl From<Denoiser> for String {
    fn from(denoiser: Denoiser) -> Self {
        denoiser.to_string()
    }
}

impl TryFrom<String> for Denoiser {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_text_is_read_back_and_others_are_refused() {
        for (denoiser, text) in [
            (Denoiser::Statistical, "\"statistical, biased\""),
            (Denoiser::OpenImageDenoise([2, 3, 3]), "\"Open Image Denoise 2.3.3, biased\""),
        ] {
            assert_eq!(serde_json::to_string(&denoiser).unwrap(), text);
            assert_eq!(serde_json::from_str::<Denoiser>(text).unwrap(), denoiser);
        }
        for text in ["", "statistical", "Open Image Denoise 2.3, biased", "Open Image Denoise 2.3.x, biased"]
        {
            let error = serde_json::from_str::<Denoiser>(&format!("{text:?}")).unwrap_err().to_string();
            assert!(error.starts_with("expected a denoiser") && error.contains(text), "{error}");
        }
    }
}

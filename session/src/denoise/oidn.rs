//! Intel's Open Image Denoise, a neural network for pictures of path tracers. Pumice neither ships nor needs it: it opens the library of a copy
//! that the machine has, when a caller asks for it.
//!
//! ```text
//! a path from the caller, else PUMICE_OIDN, else the system's loader ─► library ─► a device on the processor: version 2? ─► Oidn
//! color, albedo, normal ─► Oidn ─► the picture, except what is not finite, and where a transparent film is empty
//! ```
//! Base colour and normal are values at the middle of each pixel, without noise but with jagged edges, unless the film asks for their means. The
//! network is therefore not told that they are clean (`cleanAux`): where it was, the squared error of three scenes in real light, at 1 to 64
//! samples a pixel, was 1.02 to 54 times as large. Alpha stays as it is, and the sky is filtered like all else, as in Blender.

mod library;

use std::borrow::Cow;
use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use pumice_core::reserve::{collected, zeroed};
use pumice_picture::{Denoiser, Image, Picture};
use pumice_transport::RenderError;

use crate::error::{Result, SessionError};
use library::{Inputs, Library};

/// Environment variable with the path of the library.
pub(crate) const VARIABLE: &str = "PUMICE_OIDN";

/// The library's file, by which the system's loader finds it.
const FILE: &str = if cfg!(windows) {
    "OpenImageDenoise.dll"
} else if cfg!(target_os = "macos") {
    "libOpenImageDenoise.2.dylib"
} else {
    "libOpenImageDenoise.so.2"
};

/// The version of the C interface that [`library`] calls.
const MAJOR: u32 = 2;

/// Open Image Denoise, ready for use. It stays open as long as the process: threads of its own may run its code at any time.
#[derive(Debug)]
pub struct Oidn {
    name: OsString,
    library: Library,
    version: [u32; 3],
}

/// Two are equal if they come from the same library.
impl PartialEq for Oidn {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Oidn {}

impl Oidn {
    /// Opens the library at `path`; without one, that of the environment variable `PUMICE_OIDN`; without that, the one that the system's loader finds.
    ///
    /// # Errors
    /// [`SessionError::Caller`] says what was tried, and what to set.
    pub fn find(path: Option<&Path>) -> Result<&'static Self> {
        let of_variable = || std::env::var_os(VARIABLE).filter(|path| !path.is_empty());
        let (name, whence) = match (path, of_variable()) {
            (Some(path), _) => (path.as_os_str().to_owned(), ""),
            (None, Some(path)) => (path, " (of PUMICE_OIDN)"),
            (None, None) => (OsString::from(FILE), " (where the system looks for libraries)"),
        };
        Self::opened(&name).map_err(|why| {
            let tried = Path::new(&name).display();
            SessionError::Caller(format!(
                "Open Image Denoise: tried {tried}{whence}: {why}; set {VARIABLE} to the path of {FILE}"
            ))
        })
    }

    /// The library of this name, which is opened once.
    fn opened(name: &OsStr) -> std::result::Result<&'static Self, String> {
        static OPENED: Mutex<Vec<&'static Oidn>> = Mutex::new(Vec::new());
        // Only whole ones go in, so a poisoned lock is safe to use.
        let mut opened = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = opened.iter().find(|oidn| oidn.name == name) {
            return Ok(known);
        }
        let library = Library::open(name)?;
        let version = library.version()?;
        if version[0] != MAJOR {
            let [major, minor, patch] = version;
            return Err(format!("expected version {MAJOR}, got {major}.{minor}.{patch}"));
        }
        let oidn: &'static Self = Box::leak(Box::new(Self { name: name.to_owned(), library, version }));
        opened.push(oidn);
        Ok(oidn)
    }

    /// What pictures say that they went through.
    pub fn denoiser(&self) -> Denoiser {
        Denoiser::OpenImageDenoise(self.version)
    }

    /// The denoised picture, by as many threads as the caller's work has.
    ///
    /// # Errors
    /// [`SessionError::Caller`] for a picture without base colour or normal, and for what the library reports; [`RenderError::Memory`].
    pub fn denoised(&self, picture: &Picture) -> Result<Image> {
        let refuse = |what: &str| SessionError::Caller(format!("{}: {what}", self.denoiser().name()));
        let (Some(albedo), Some(normal)) = (&picture.albedo, &picture.normal) else {
            return Err(refuse("expected a picture with the passes albedo and normal, got one without"));
        };
        let color = &picture.color;
        let mut smooth: Vec<[f32; 3]> =
            zeroed(color.pixels.len(), "Open Image Denoise: its picture").map_err(RenderError::from)?;
        let inputs = Inputs {
            size: [color.width, color.height],
            color: &finite(color)?,
            albedo: &albedo.pixels,
            normal: &normal.pixels,
        };
        self.library.denoise(&inputs, &mut smooth, rayon::current_num_threads()).map_err(|e| refuse(&e))?;
        keep_unfiltered(picture, &mut smooth);
        Ok(Image::new(color.width, color.height, smooth))
    }
}

/// The colours with black in place of what is not finite: one infinite pixel would decide the brightness that the network prepares for.
fn finite(color: &Image) -> Result<Cow<'_, [[f32; 3]]>> {
    if color.pixels.iter().all(is_finite) {
        return Ok(Cow::Borrowed(&color.pixels));
    }
    let pixels = color.pixels.iter().map(|pixel| if is_finite(pixel) { *pixel } else { [0.0; 3] });
    let pixels = collected(color.pixels.len(), pixels, "Open Image Denoise: finite colours");
    Ok(Cow::Owned(pixels.map_err(RenderError::from)?))
}

/// Puts the mean of the samples where it is not finite, and where a transparent film is empty: light there would be added to any background.
fn keep_unfiltered(picture: &Picture, smooth: &mut [[f32; 3]]) {
    for (i, (smooth, raw)) in smooth.iter_mut().zip(&picture.color.pixels).enumerate() {
        let is_empty = picture.alpha.as_ref().and_then(|alpha| alpha.get(i)) == Some(&0.0);
        if is_empty || !is_finite(raw) {
            *smooth = *raw;
        }
    }
}

fn is_finite(pixel: &[f32; 3]) -> bool {
    pixel.iter().all(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(path: &Path) -> String {
        Oidn::find(Some(path)).unwrap_err().to_string()
    }

    #[test]
    fn what_is_not_the_library_is_refused_in_a_line_that_says_what_to_set() {
        let folder = tempfile::tempdir().unwrap();
        let text = folder.path().join("text.so");
        std::fs::write(&text, "not a library").unwrap();
        for path in [folder.path().join("none.so"), text, folder.path().to_owned()] {
            let line = line(&path);
            let (tried, set) = (
                format!("Open Image Denoise: tried {}: ", path.display()),
                format!("set PUMICE_OIDN to the path of {FILE}"),
            );
            assert!(line.starts_with(&tried) && line.ends_with(&set) && !line.contains('\n'), "{line}");
            assert_eq!(line.matches(&path.display().to_string()).count(), 1, "{line}");
        }
    }

    #[test]
    fn what_is_not_finite_is_hidden_from_the_filter_and_stays_as_an_empty_film_does() {
        let raw = Image::new(4, 1, vec![[1.0; 3], [f32::INFINITY, 0.0, 0.0], [0.0; 3], [2.0, f32::NAN, 0.0]]);
        let seen = finite(&raw).unwrap();
        assert_eq!(seen[..], [[1.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]]);
        assert!(matches!(finite(&Image::new(1, 1, vec![[1.0; 3]])).unwrap(), Cow::Borrowed(_)));
        for (alpha, expected) in [(Some(vec![1.0, 1.0, 0.0, 1.0]), 0.0), (None, 9.0)] {
            let mut smooth = vec![[9.0; 3]; 4];
            keep_unfiltered(&Picture { alpha, ..Picture::of(raw.clone()) }, &mut smooth);
            assert_eq!((smooth[0], smooth[1], smooth[2]), ([9.0; 3], raw.pixels[1], [expected; 3]));
            assert!(smooth[3][1].is_nan());
        }
    }

    /// A library of other functions, which every Linux system has.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_library_of_something_else_is_refused_by_its_missing_function() {
        let line = line(Path::new("libm.so.6"));
        assert!(line.contains("expected version 2, which has the function oidn"), "{line}");
    }
}

//! Lengths on paper: millimetres to pixels.

/// Density that a picture counts as having where none is given, in pixels per inch: that of most journals, and of the add-on for Blender.
pub const DEFAULT_DPI: f64 = 300.0;

const MM_PER_INCH: f64 = 25.4;

/// Size of the text, distance from the sides: millimetres, as in the add-on (`figure_settings.py`).
pub(super) const TEXT_MM: f64 = 3.0;
pub(super) const MARGIN_MM: f64 = 4.0;

/// Pixels of a length on paper, rounded to the nearest.
pub fn pixels_of_mm(length_mm: f64, dpi: f64) -> f64 {
    (length_mm / MM_PER_INCH * dpi).round()
}

/// The sheet on which annotations are laid out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paper {
    /// Pixels across.
    pub width: f64,
    /// Pixels down.
    pub height: f64,
    /// Pixels per inch.
    pub dpi: f64,
}

impl Paper {
    /// The pixels of a length in millimetres, not rounded.
    pub(super) fn px(&self, length_mm: f64) -> f64 {
        length_mm / MM_PER_INCH * self.dpi
    }

    /// Why nothing is drawn on a sheet that is too small.
    pub(super) fn has_no_room(&self) -> String {
        format!(
            "a picture of {:.0} × {:.0} pixels at {:.0} dpi has no room for it",
            self.width, self.height, self.dpi
        )
    }
}

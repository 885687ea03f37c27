//! Flags of `pumice render` for print: size in millimetres, scale bar, legend.

use clap::Args;
use pumice_session::{Annotations, Corner, DEFAULT_DPI, ScaleBar, pixels_of_mm};

use super::values::positive;
use crate::failure::Failure;

/// Most pixels of a picture across.
const MOST_PIXELS: f64 = 65_536.0;

/// Size on paper, scale bar, legend.
#[derive(Debug, Args)]
pub(crate) struct AnnotationArgs {
    /// Width on paper in millimetres: sets the pixels across, at 300 dpi or --dpi; the height follows from the picture's shape
    #[arg(long, value_name = "MM", value_parser = positive, conflicts_with_all = ["size", "again"])]
    pub(crate) width_mm: Option<f64>,
    /// Pixels per inch that the picture's file states; sizes of text in bar and legend follow it
    ///
    /// Alone it changes no pixel of the picture itself. Default: none is stated, and text has the size of 300 dpi
    #[arg(long, value_name = "DPI", value_parser = positive, conflicts_with = "again")]
    pub(crate) dpi: Option<f64>,
    /// Draw a bar of this length in a corner, the lower right one: 10um, 500nm, 2mm, or auto for a round length
    ///
    /// Without a unit, in that of the volume. An orthographic picture has the same scale everywhere. In a perspective one it needs the plane in
    /// which it is true, across the view axis: 10um@center, through the middle of what is shown; 10um@focus, where depth of field is sharp;
    /// 10um@12.5, at that distance from the camera in world units. The text says which
    #[arg(long, value_name = "LENGTH[@PLANE]", conflicts_with = "again")]
    pub(crate) scale_bar: Option<ScaleBar>,
    /// Corner of the scale bar: lower-right, lower-left, upper-right or upper-left
    ///
    /// Choose one in which it covers nothing that the figure shows. With a legend, which is in the upper left corner, another one
    #[arg(long, value_name = "CORNER", default_value_t, requires = "scale_bar", conflicts_with = "again")]
    pub(crate) scale_bar_corner: Corner,
    /// Draw the names and colours of the shown labels in the upper left corner, those with most voxels first, at most N (12)
    ///
    /// A label without a name has its id. Labels that find no place are counted: "and 23 more". With N: --legend=20. The automatic view of a
    /// volume leaves room for it; with --distance, with --frame volume and for a scene it lies over the picture
    #[arg(
        long,
        value_name = "N",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "12",
        value_parser = clap::value_parser!(u32).range(1..),
        conflicts_with = "again"
    )]
    pub(crate) legend: Option<u32>,
}

impl AnnotationArgs {
    /// What is drawn over the picture and stated in its file.
    pub(crate) fn annotations(&self) -> Annotations {
        let dpi = self.dpi.or(self.width_mm.map(|_| DEFAULT_DPI));
        let (scale_bar, scale_bar_corner) = (self.scale_bar, self.scale_bar_corner);
        Annotations { dpi, scale_bar, scale_bar_corner, legend: self.legend }
    }

    /// Pixels across that the width on paper asks for.
    ///
    /// # Errors
    /// When no picture is so wide.
    pub(crate) fn width(&self) -> Result<Option<u32>, Failure> {
        let Some(mm) = self.width_mm else { return Ok(None) };
        let dpi = self.dpi.unwrap_or(DEFAULT_DPI);
        let pixels = pixels_of_mm(mm, dpi);
        match pixels {
            1.0..=MOST_PIXELS => Ok(Some(pixels as u32)),
            _ => Err(Failure::new(format!(
                "--width-mm: {mm} mm at {dpi} dpi are {pixels:.0} pixels, expected 1 to {MOST_PIXELS}"
            ))),
        }
    }
}

//! The boxes of an instance that are drawn, for the form that has each as a scaled cube.

use pumice_core::reserve::reserved;
use pumice_core::{Error, Job};

use crate::Result;
use crate::budget::Budget;
use crate::drawn::Drawn;

/// What memory is for, in errors.
pub(crate) const BOXES: &str = "a list of the boxes of a volume";

/// A box that is drawn, up to the end of its volume.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DrawnBox {
    /// Its lowest corner in voxels.
    pub(crate) low: [u32; 3],
    /// Voxels along each axis, at most 16.
    pub(crate) extent: [u8; 3],
    /// Dense index of its label.
    pub(crate) label: u32,
}

/// The boxes of an instance that are drawn, in the order of the volume: whole also where a cut or the end of a region passes through them,
/// and without those that a cut removes altogether.
///
/// # Errors
/// [`Error::Limit`] where they take more than is left of the budget; [`Error::Memory`]; [`Error::Cancelled`].
pub(crate) fn drawn_boxes(drawn: &Drawn<'_>, budget: &mut Budget, job: &Job) -> Result<Vec<DrawnBox>> {
    let mut count = 0;
    for_each_drawn_box(drawn, |_| count += 1);
    job.check()?;
    budget.take_boxes(count as u64)?;
    let mut boxes = reserved(count, BOXES).map_err(Error::from)?;
    for_each_drawn_box(drawn, |drawn_box| boxes.push(drawn_box));
    job.check()?;
    Ok(boxes)
}

/// The number of [`drawn_boxes`], without keeping any.
pub(crate) fn count_boxes(drawn: &Drawn<'_>) -> u64 {
    if drawn.is_whole() {
        return drawn.volume.boxes().len() as u64;
    }
    let mut count = 0;
    for_each_drawn_box(drawn, |_| count += 1);
    count
}

fn for_each_drawn_box(drawn: &Drawn<'_>, mut visit: impl FnMut(DrawnBox)) {
    let dims = drawn.volume.info().dims;
    drawn.volume.for_each_box(|label, view| {
        if !drawn.visible[label as usize] {
            return;
        }
        let low = view.origin;
        // A box may pass the volume's end by up to three voxels.
        let end = [0, 1, 2].map(|a| (low[a] + view.extent[a]).min(dims[a]));
        if drawn.reaches([low, end]) {
            let extent = [0, 1, 2].map(|a| (end[a] - low[a]) as u8);
            visit(DrawnBox { low, extent, label });
        }
    });
}

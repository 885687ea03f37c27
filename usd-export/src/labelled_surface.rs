//! The surface of an instance at one level of detail, sorted by material: what every mesh format writes.

use std::ops::Range;

use pumice_core::Job;
use pumice_transport::geometry::DetailLevel;

use crate::budget::Budget;
use crate::drawn::Drawn;
use crate::surface::Surface;
use crate::{Merging, Rectangle, Result};

/// Rectangles in index space, those of one material after each other.
pub(crate) struct LabelledSurface {
    /// By material, otherwise in the order in which they were found.
    pub(crate) rectangles: Vec<Rectangle>,
    /// Places of the rectangles of each material, in the order of [`Drawn::materials`]; empty for a material that no surface shows.
    pub(crate) of_material: Vec<Range<u32>>,
}

impl LabelledSurface {
    /// The visible surface of what is drawn.
    ///
    /// # Errors
    /// [`pumice_core::Error::Limit`] where it takes more than is left of the budget; [`pumice_core::Error::Cancelled`].
    pub(crate) fn new(
        drawn: &Drawn<'_>,
        level: DetailLevel,
        merging: Merging,
        budget: &mut Budget,
        job: &Job,
    ) -> Result<Self> {
        let mut rectangles = Vec::new();
        let surface = Surface::new(drawn.volume, &drawn.visible, level, merging)?.within(drawn.region);
        surface.for_each_block(
            job,
            |origin| surface.rectangles_of(&surface.elements(origin)?, origin),
            |block| {
                budget.take_faces(block.len() as u64)?;
                rectangles.extend(block);
                Ok(())
            },
        )?;
        let material = |r: &Rectangle| drawn.material_of[r.label as usize] as usize;
        let mut counts = vec![0u32; drawn.materials.len()];
        rectangles.iter().for_each(|r| counts[material(r)] += 1);
        let mut start = 0;
        let of_material = counts
            .iter()
            .map(|count| {
                let range = start..start + count;
                start = range.end;
                range
            })
            .collect();
        rectangles.sort_by_key(material);
        Ok(Self { rectangles, of_material })
    }

    /// Lowest and highest corner in index space; both 0 where there is no surface.
    pub(crate) fn bounds(&self) -> [[u32; 3]; 2] {
        let corners = self.rectangles.iter().flat_map(Rectangle::corners);
        let bounds = corners.fold(None, |bounds: Option<[[u32; 3]; 2]>, corner| {
            let [low, high] = bounds.unwrap_or([corner; 2]);
            Some([[0, 1, 2].map(|a| low[a].min(corner[a])), [0, 1, 2].map(|a| high[a].max(corner[a]))])
        });
        bounds.unwrap_or_default()
    }
}

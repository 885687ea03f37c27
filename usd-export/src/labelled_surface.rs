//! The surface of an instance at one level of detail, sorted by material: what every mesh format writes.

use std::ops::Range;

use glam::DVec3;
use pumice_core::reserve::{make_room, sort_by_group, sorted_by_group};
use pumice_core::{Error, Job};
use pumice_transport::geometry::DetailLevel;

use crate::budget::{Budget, fits_32_bits};
use crate::cut_surface::cut_blocks;
use crate::drawn::Drawn;
use crate::surface::Surface;
use crate::{CutPolygon, Merging, Rectangle, Result};

/// What memory is for, in errors.
pub(crate) const FACES: &str = "a list of the faces of a surface";

/// A surface in index space.
pub(crate) struct LabelledSurface {
    /// Faces that no cut touches.
    pub(crate) rectangles: ByMaterial<Rectangle>,
    /// What cuts leave of faces, and the caps that close them.
    pub(crate) polygons: ByMaterial<CutPolygon>,
}

/// Faces of labels, those of one material after each other, otherwise in the order in which they were found.
pub(crate) struct ByMaterial<T> {
    pub(crate) faces: Vec<T>,
    /// Places of the faces of each material, in the order of [`Drawn::materials`]; empty for a material that no face has.
    pub(crate) of_material: Vec<Range<u32>>,
}

/// A convex face of one label.
pub(crate) trait Face {
    /// Dense index of its label.
    fn label(&self) -> u32;

    /// Number of its corners.
    fn corner_count(&self) -> usize;

    /// Visits its corners in index space, counter-clockwise as seen from outside.
    fn for_each_corner(&self, visit: &mut dyn FnMut(DVec3));
}

impl Face for Rectangle {
    fn label(&self) -> u32 {
        self.label
    }

    fn corner_count(&self) -> usize {
        4
    }

    fn for_each_corner(&self, visit: &mut dyn FnMut(DVec3)) {
        self.corners().into_iter().for_each(|corner| visit(DVec3::from_array(corner.map(f64::from))));
    }
}

impl Face for CutPolygon {
    fn label(&self) -> u32 {
        self.label
    }

    fn corner_count(&self) -> usize {
        self.corners.len()
    }

    fn for_each_corner(&self, visit: &mut dyn FnMut(DVec3)) {
        self.corners.iter().copied().for_each(visit);
    }
}

impl LabelledSurface {
    /// The visible surface of what is drawn.
    ///
    /// # Errors
    /// [`Error::Limit`] where it takes more than is left of the budget; [`Error::Memory`]; [`Error::Cancelled`].
    pub(crate) fn new(
        drawn: &Drawn<'_>,
        level: DetailLevel,
        merging: Merging,
        budget: &mut Budget,
        job: &Job,
    ) -> Result<Self> {
        let (mut rectangles, mut polygons) = (Vec::new(), Vec::new());
        let surface = Surface::new(drawn.volume, &drawn.visible, level, merging)?.within(drawn.region);
        cut_blocks(&surface, &drawn.cuts, job, |whole, cut| {
            budget.take_faces((whole.len() + cut.len()) as u64)?;
            make_room(&mut rectangles, whole.len(), FACES).map_err(Error::from)?;
            make_room(&mut polygons, cut.len(), FACES).map_err(Error::from)?;
            rectangles.extend_from_slice(whole);
            polygons.extend_from_slice(cut);
            Ok(())
        })?;
        Ok(Self {
            rectangles: ByMaterial::of_rectangles(rectangles, drawn)?,
            polygons: ByMaterial::of_polygons(polygons, drawn)?,
        })
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.face_count() == 0
    }

    pub(crate) fn face_count(&self) -> u64 {
        (self.rectangles.faces.len() + self.polygons.faces.len()) as u64
    }

    pub(crate) fn corner_count(&self) -> u64 {
        let of_polygons: usize = self.polygons.faces.iter().map(Face::corner_count).sum();
        (4 * self.rectangles.faces.len() + of_polygons) as u64
    }

    /// All faces: rectangles, then polygons.
    pub(crate) fn faces(&self) -> impl Iterator<Item = &dyn Face> {
        let polygons = self.polygons.faces.iter().map(|polygon| polygon as &dyn Face);
        self.rectangles.faces.iter().map(|rectangle| rectangle as &dyn Face).chain(polygons)
    }

    /// A material's place in [`Drawn::materials`] and the places of faces that follow each other and have it, in the order of [`LabelledSurface::faces`].
    pub(crate) fn runs_of_materials(&self) -> impl Iterator<Item = (usize, Range<u32>)> {
        let lists = [&self.rectangles.of_material, &self.polygons.of_material];
        lists.into_iter().flat_map(|of_material| of_material.iter().cloned().enumerate())
    }

    /// For each face its material's place in [`Drawn::materials`], in the order of [`LabelledSurface::faces`].
    pub(crate) fn materials(&self) -> impl Iterator<Item = usize> {
        self.runs_of_materials().flat_map(|(place, faces)| faces.map(move |_| place))
    }

    /// Whether a face has this material, by its place in [`Drawn::materials`].
    pub(crate) fn has_material(&self, place: usize) -> bool {
        !(self.rectangles.of_material[place].is_empty() && self.polygons.of_material[place].is_empty())
    }
}

impl ByMaterial<Rectangle> {
    fn of_rectangles(faces: Vec<Rectangle>, drawn: &Drawn<'_>) -> Result<Self> {
        fits_32_bits(FACES, faces.len() as u64)?;
        let material = |face: &Rectangle| drawn.material_of[face.label as usize] as usize;
        let (faces, of_material) =
            sorted_by_group(faces, drawn.materials.len(), material, FACES).map_err(Error::from)?;
        Ok(Self { faces, of_material })
    }
}

impl ByMaterial<CutPolygon> {
    fn of_polygons(mut faces: Vec<CutPolygon>, drawn: &Drawn<'_>) -> Result<Self> {
        fits_32_bits(FACES, faces.len() as u64)?;
        let material = |face: &CutPolygon| drawn.material_of[face.label as usize] as usize;
        let of_material =
            sort_by_group(&mut faces, drawn.materials.len(), material, FACES).map_err(Error::from)?;
        Ok(Self { faces, of_material })
    }
}

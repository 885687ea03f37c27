//! Limits of a file: on its bytes, kept while its faces are found, so that nothing is written and little memory used where it is too large;
//! and on counts of 32 bits.

use pumice_core::Error;

use crate::Result;

/// Bytes that a face and a box take in a file of one format: estimates, from files of real volumes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaceBytes {
    /// Bytes of a rectangle.
    pub a_face: u64,
    /// Bytes of a face of the form [`smooth`](crate::Form::Smooth).
    pub a_smooth_face: u64,
    /// Bytes of a box of the form [`instances`](crate::Form::Instances).
    pub a_box: u64,
}

/// Faces and boxes that an export has so far, and the bytes that they may take.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    limit_bytes: u64,
    each: FaceBytes,
    faces: u64,
    smooth_faces: u64,
    boxes: u64,
    /// Of whole files that are packed into it.
    packed_bytes: u64,
}

impl Budget {
    /// A budget of `limit_bytes` for a file whose elements take `each`.
    pub fn new(limit_bytes: u64, each: FaceBytes) -> Self {
        Self { limit_bytes, each, faces: 0, smooth_faces: 0, boxes: 0, packed_bytes: 0 }
    }

    /// Counts `faces` more rectangles.
    ///
    /// # Errors
    /// [`Error::Limit`] where the file would take more bytes than allowed.
    pub fn take_faces(&mut self, faces: u64) -> Result<()> {
        self.faces += faces;
        self.check()
    }

    /// Counts `faces` more faces of a smoothed surface.
    ///
    /// # Errors
    /// As [`Budget::take_faces`].
    pub fn take_smooth_faces(&mut self, faces: u64) -> Result<()> {
        self.smooth_faces += faces;
        self.check()
    }

    /// Counts `boxes` more boxes.
    ///
    /// # Errors
    /// As [`Budget::take_faces`].
    pub fn take_boxes(&mut self, boxes: u64) -> Result<()> {
        self.boxes += boxes;
        self.check()
    }

    /// Counts a file of so many bytes that is packed into this one.
    ///
    /// # Errors
    /// As [`Budget::take_faces`].
    pub fn take_packed(&mut self, bytes: u64) -> Result<()> {
        self.packed_bytes += bytes;
        self.check()
    }

    /// Rectangles and smoothed faces so far.
    pub fn faces(&self) -> u64 {
        self.faces + self.smooth_faces
    }

    /// Boxes so far.
    pub fn boxes(&self) -> u64 {
        self.boxes
    }

    /// Bytes of the file, estimated.
    pub fn bytes(&self) -> u64 {
        let boxes = self.boxes.saturating_mul(self.each.a_box);
        let smooth = self.smooth_faces.saturating_mul(self.each.a_smooth_face);
        self.faces
            .saturating_mul(self.each.a_face)
            .saturating_add(smooth)
            .saturating_add(boxes)
            .saturating_add(self.packed_bytes)
    }

    fn check(&self) -> Result<()> {
        if self.bytes() <= self.limit_bytes {
            return Ok(());
        }
        let (faces, boxes) = (self.faces(), self.boxes);
        let what = match boxes {
            0 => format!("bytes of the file for the first {faces} faces, estimated"),
            _ => format!("bytes of the file for {boxes} boxes and the first {faces} faces, estimated"),
        };
        Err(Error::Limit { what, limit: self.limit_bytes, got: self.bytes() }.into())
    }
}

/// Checks a count that a format or a list stores in 32 bits.
///
/// # Errors
/// [`Error::Limit`].
pub(crate) fn fits_32_bits(what: &str, count: u64) -> Result<u32> {
    let limit = u64::from(u32::MAX);
    u32::try_from(count).map_err(|_| Error::Limit { what: what.into(), limit, got: count }.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_exactly_is_allowed_and_a_box_more_is_not() {
        let mut budget = Budget::new(1000, FaceBytes { a_face: 50, a_smooth_face: 60, a_box: 24 });
        budget.take_boxes(25).unwrap();
        budget.take_faces(8).unwrap();
        assert_eq!((budget.faces(), budget.boxes(), budget.bytes()), (8, 25, 1000));
        let (mut packed, mut smooth) = (budget, budget);
        assert!(packed.take_packed(1).is_err() && smooth.take_smooth_faces(1).is_err());
        assert_eq!((smooth.faces(), smooth.bytes()), (9, 1060));
        let error = budget.take_boxes(1).unwrap_err().to_string();
        assert_eq!(
            error,
            "bytes of the file for 26 boxes and the first 8 faces, estimated: 1024 is more than the limit of 1000"
        );
        assert!(budget.take_faces(u64::MAX / 2).is_err(), "products beyond 64 bits are beyond any limit");
    }

    #[test]
    fn counts_beyond_32_bits_are_refused() {
        assert_eq!(fits_32_bits("vertices", u64::from(u32::MAX)).unwrap(), u32::MAX);
        let error = fits_32_bits("vertices of a PLY file", 1 << 32).unwrap_err().to_string();
        assert_eq!(error, "vertices of a PLY file: 4294967296 is more than the limit of 4294967295");
    }
}

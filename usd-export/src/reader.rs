//! Whom a file is written for.

/// The program whose reading of the format a file follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Reader {
    /// Every program that keeps to the format's specification.
    #[default]
    Specification,
    /// Blender 4.2 to 5.0, whose USD importer departs from the specification: it makes suns four times as strong and their angles twice as
    /// wide, orthographic cameras ten times as wide, and takes the softness of a spot for its blend. The file has what becomes right by
    /// that; other programs read it wrong.
    Blender,
}

impl Reader {
    /// What a file for this reader has other than the specification says, in one line; none for [`Reader::Specification`].
    pub fn note(self) -> Option<&'static str> {
        match self {
            Self::Specification => None,
            Self::Blender => Some(
                "for Blender 4.2 to 5.0: suns have a quarter of their strength and half their angle, orthographic cameras a tenth of \
                 their width, spots Blender's own blend, as its importer takes them; other programs read these wrong",
            ),
        }
    }
}

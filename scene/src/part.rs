//! What a renderer may leave out where a scene does not need it, by name, and sets of it. Pictures do not depend on what is there
//! besides.

use serde::Serialize;

/// One thing that scenes may not need.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// Boxes of labels that are not shown.
    HiddenLabels,
    /// Levels of detail that no box is drawn at, and the bounds that hold all of them.
    Levels,
    /// Metal, glass, dielectric layers.
    Microfacets,
    /// Clear coats.
    Coats,
    /// Sheen.
    Sheen,
    /// Paths through labels.
    Glass,
    /// Surfaces that light passes straight through.
    Clear,
    /// Lamps.
    Lamps,
    /// Aiming at any light.
    Aiming,
    /// A picture for a sky.
    SkyPicture,
    /// A camera whose opening has a size.
    Lens,
    /// Cuts.
    Cuts,
    /// Triangle meshes.
    Meshes,
    /// Light sorted for passes, or clamped.
    Sorting,
    /// Cryptomatte.
    Mattes,
    /// Surfaces that shine, to be aimed at.
    Emitters,
    /// Surfaces shaded by another normal than their own.
    SmoothNormals,
    /// A hierarchy over instances and meshes.
    InstanceTree,
    /// Shadow catchers.
    Catchers,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 19] = [
        Self::HiddenLabels,
        Self::Levels,
        Self::Microfacets,
        Self::Coats,
        Self::Sheen,
        Self::Glass,
        Self::Clear,
        Self::Lamps,
        Self::Aiming,
        Self::SkyPicture,
        Self::Lens,
        Self::Cuts,
        Self::Meshes,
        Self::Sorting,
        Self::Mattes,
        Self::Emitters,
        Self::SmoothNormals,
        Self::InstanceTree,
        Self::Catchers,
    ];

    /// In words.
    pub fn spoken(self) -> &'static str {
        match self {
            Self::HiddenLabels => "boxes of labels that are not shown",
            Self::Levels => "other levels of detail",
            Self::Microfacets => "metal, glass and dielectric layers",
            Self::Coats => "clear coats",
            Self::Sheen => "sheen",
            Self::Glass => "paths through labels",
            Self::Clear => "surfaces that light passes straight through",
            Self::Lamps => "lamps",
            Self::Aiming => "aiming at lights",
            Self::SkyPicture => "a picture for a sky",
            Self::Lens => "depth of field",
            Self::Cuts => "cuts",
            Self::Meshes => "meshes",
            Self::Sorting => "sorting of light",
            Self::Mattes => "Cryptomatte",
            Self::Emitters => "surfaces that shine, to be aimed at",
            Self::SmoothNormals => "smooth normals",
            Self::InstanceTree => "a hierarchy over instances",
            Self::Catchers => "shadow catchers",
        }
    }
}

/// A set of parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PartSet(u32);

impl PartSet {
    /// None of them.
    pub const NONE: Self = Self(0);

    /// All of them.
    pub const ALL: Self = Self((1 << Part::ALL.len()) - 1);

    /// With this one.
    #[must_use]
    pub const fn with(self, part: Part) -> Self {
        Self(self.0 | 1 << part as u32)
    }

    /// With it where `is` holds.
    #[must_use]
    pub const fn with_if(self, part: Part, is: bool) -> Self {
        if is { self.with(part) } else { self }
    }

    /// Those that are in either set.
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Those of them that are in the other set too.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Those of them that are not in the other set.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether this one is there.
    pub const fn has(self, part: Part) -> bool {
        self.0 >> part as u32 & 1 != 0
    }

    /// Whether none is there.
    pub const fn is_none(self) -> bool {
        self.0 == 0
    }

    /// Those that are there, in order.
    pub fn parts(self) -> impl Iterator<Item = Part> {
        Part::ALL.into_iter().filter(move |&part| self.has(part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_hold_what_was_put_in() {
        assert!(Part::ALL.iter().enumerate().all(|(i, &part)| part as usize == i));
        let two = PartSet::NONE.with(Part::Levels).with(Part::Sorting).with(Part::Levels);
        assert_eq!(two.parts().collect::<Vec<_>>(), [Part::Levels, Part::Sorting]);
        assert_eq!(PartSet::ALL.parts().collect::<Vec<_>>(), Part::ALL);
        assert_eq!(PartSet::ALL.without(two).parts().count(), Part::ALL.len() - 2);
        assert!(PartSet::ALL.without(two).and(two).is_none() && !two.is_none());
        assert_eq!(PartSet::ALL.without(two).or(two), PartSet::ALL);
        assert_eq!(PartSet::NONE.with_if(Part::Cuts, false), PartSet::NONE);
    }
}

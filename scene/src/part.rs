//! The parts of a renderer that are left out where a scene does not need them, and sets of parts. Parts that are present without need
//! do not change the picture.

use serde::Serialize;

/// One part of a renderer that not every scene needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// Boxes of labels that are not shown.
    HiddenLabels,
    /// Levels of detail at which no box is drawn, and the bounds that enclose all levels.
    Levels,
    /// Metal, glass, dielectric layers.
    Microfacets,
    /// Clear coats.
    Coats,
    /// Sheen.
    Sheen,
    /// Glass: paths through the inside of labels.
    Glass,
    /// Surfaces that light passes straight through.
    #[serde(rename = "clear")]
    Transparent,
    /// Lamps.
    Lamps,
    /// Sampling of any light (next event estimation).
    #[serde(rename = "aiming")]
    LightSampling,
    /// An image as the sky.
    SkyPicture,
    /// A camera lens of finite size (depth of field).
    Lens,
    /// Cuts.
    Cuts,
    /// Triangle meshes.
    Meshes,
    /// Sorting of light by kind, for passes and clamps.
    Sorting,
    /// Cryptomatte.
    Mattes,
    /// Emissive surfaces that are sampled as lights.
    Emitters,
    /// Shading normals other than the geometric ones.
    SmoothNormals,
    /// A hierarchy over instances and meshes.
    InstanceTree,
    /// Shadow catchers.
    Catchers,
    /// A tree over lamps.
    LampTree,
}

impl Part {
    /// All parts, in the order of their numbers.
    pub const ALL: [Self; 20] = [
        Self::HiddenLabels,
        Self::Levels,
        Self::Microfacets,
        Self::Coats,
        Self::Sheen,
        Self::Glass,
        Self::Transparent,
        Self::Lamps,
        Self::LightSampling,
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
        Self::LampTree,
    ];

    /// The name of the part in texts for users and in the results of `pumice bench needs`.
    pub fn spoken(self) -> &'static str {
        match self {
            Self::HiddenLabels => "boxes of labels that are not shown",
            Self::Levels => "other levels of detail",
            Self::Microfacets => "metal, glass and dielectric layers",
            Self::Coats => "clear coats",
            Self::Sheen => "sheen",
            Self::Glass => "paths through the inside of labels",
            Self::Transparent => "transparent surfaces",
            Self::Lamps => "lamps",
            Self::LightSampling => "light sampling",
            Self::SkyPicture => "an environment map",
            Self::Lens => "depth of field",
            Self::Cuts => "cuts",
            Self::Meshes => "meshes",
            Self::Sorting => "separate sums of light",
            Self::Mattes => "Cryptomatte",
            Self::Emitters => "emissive surfaces that are sampled as lights",
            Self::SmoothNormals => "smooth normals",
            Self::InstanceTree => "a hierarchy over instances",
            Self::Catchers => "shadow catchers",
            Self::LampTree => "a tree over lamps",
        }
    }
}

/// A set of parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PartSet(u32);

impl PartSet {
    /// The empty set.
    pub const NONE: Self = Self(0);

    /// The set of all parts.
    pub const ALL: Self = Self((1 << Part::ALL.len()) - 1);

    /// This set with `part` added.
    #[must_use]
    pub const fn with(self, part: Part) -> Self {
        Self(self.0 | 1 << part as u32)
    }

    /// This set, with `part` added if `is` is true.
    #[must_use]
    pub const fn with_if(self, part: Part, is: bool) -> Self {
        if is { self.with(part) } else { self }
    }

    /// The union of both sets.
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The intersection of both sets.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// The parts of this set that are not in `other`.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether the set contains `part`.
    pub const fn has(self, part: Part) -> bool {
        self.0 >> part as u32 & 1 != 0
    }

    /// Whether the set is empty.
    pub const fn is_none(self) -> bool {
        self.0 == 0
    }

    /// The parts in the set, in the order of [`Part::ALL`].
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

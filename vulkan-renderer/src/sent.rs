//! Counts how often each part of a scene was sent to the device. Tests use it to check, for example, that a colour edit sends colours
//! alone.

/// Uploads by part of a scene. A part that every instance has counts once for each instance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// Camera, settings and placements: a few hundred bytes, sent with each edit.
    pub header: u64,
    /// Sky, suns, lamps and emissive surfaces.
    pub lights: u64,
    /// Inverse-cdf table of the pixel filter.
    pub filter: u64,
    /// Planes of cuts.
    pub cuts: u64,
    /// Materials, and the material of each label.
    pub materials: u64,
    /// Records and labels of the drawn boxes with their hierarchy; triangles of a mesh with theirs.
    pub boxes: u64,
    /// Nodes and leaves of a volume: the largest part.
    pub nodes: u64,
}

//! How often each part of a scene was sent to the device: what proves that a colour edit sends colours alone.

/// See the module. Each counts parts, one an instance where a part is an instance's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// Camera, settings and places: a few hundred bytes, with each edit.
    pub header: u64,
    /// Sky, suns and lamps; surfaces that shine.
    pub lights: u64,
    /// Table of the film's filter.
    pub filter: u64,
    /// Planes of cuts.
    pub cuts: u64,
    /// Materials, and which label has which.
    pub materials: u64,
    /// Records and labels of the boxes that are drawn, and their hierarchy; triangles of a mesh, and theirs.
    pub boxes: u64,
    /// Nodes and leaves of a volume: all that is large.
    pub nodes: u64,
}

//! Cut planes of an instance.

use pumice_transport::geometry::Cuts;

use crate::layout::CutPlane;

/// The planes of all parts that are cut away, in the shaders' layout.
pub fn cut_planes(cuts: &Cuts) -> Vec<CutPlane> {
    let record = |p: &pumice_transport::geometry::CutPlane| CutPlane {
        normal: p.normal,
        offset: p.offset,
        normal_in_world: p.normal_in_world.to_array(),
        axis: p.axis,
        ends_part: u32::from(p.ends_part),
    };
    cuts.planes().iter().map(record).collect()
}

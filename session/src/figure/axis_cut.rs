//! Cuts of a figure: planes across an index axis of the volume.

use glam::{DAffine3, DVec3};
use pumice_scene::{Cut, CutShape};

/// A plane across an index axis. It removes what lies beyond it, or what lies before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisCut {
    /// Index axis: 0, 1 or 2 for x, y or z.
    pub axis: usize,
    /// Place of the plane as a fraction of the volume's extent along the axis, above 0 and below 1.
    pub fraction: f64,
    /// Whether the part with the lower indices is removed, instead of that with the higher.
    pub removes_low: bool,
}

impl AxisCut {
    /// Parses `x=0.5`, which removes what lies beyond half of the extent along x, or `-x=0.5`, which removes the other half.
    ///
    /// # Errors
    /// The expected form, if `text` has another.
    pub fn parse(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "expected AXIS=FRACTION with x, y or z and a number above 0 and below 1, e.g. x=0.5 or -z=0.25, got {text}"
            )
        };
        let (axis, fraction) = text.split_once('=').ok_or_else(wrong)?;
        let (removes_low, axis) = axis.strip_prefix('-').map_or((false, axis), |rest| (true, rest));
        let axis = ["x", "y", "z"].iter().position(|name| *name == axis).ok_or_else(wrong)?;
        let fraction = fraction.parse().ok().filter(|f: &f64| *f > 0.0 && *f < 1.0).ok_or_else(wrong)?;
        Ok(Self { axis, fraction, removes_low })
    }

    /// What is left of a box in index space; `None` if nothing is.
    pub(super) fn clipped(&self, dims: [u32; 3], [mut low, mut high]: [DVec3; 2]) -> Option<[DVec3; 2]> {
        let (axis, place) = (self.axis, self.place(dims));
        if self.removes_low {
            low[axis] = low[axis].max(place);
        } else {
            high[axis] = high[axis].min(place);
        }
        (low[axis] < high[axis]).then_some([low, high])
    }

    /// The cut as a scene has it.
    pub(super) fn cut(&self, dims: [u32; 3], world_from_index: &DAffine3) -> Cut {
        let mut point = DVec3::ZERO;
        point[self.axis] = self.place(dims);
        let mut normal = DVec3::ZERO;
        normal[self.axis] = if self.removes_low { -1.0 } else { 1.0 };
        // Planes stay planes under a shear if their normals go by the inverse transpose.
        let normal = world_from_index.matrix3.inverse().transpose() * normal;
        Cut {
            shape: CutShape::Plane {
                point: world_from_index.transform_point3(point).to_array(),
                normal: normal.normalize().to_array(),
            },
            instances: None,
        }
    }

    fn place(&self, dims: [u32; 3]) -> f64 {
        self.fraction * f64::from(dims[self.axis])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cuts_are_read_or_refused() {
        let of = |axis, fraction, removes_low| Ok(AxisCut { axis, fraction, removes_low });
        assert_eq!(AxisCut::parse("x=0.5"), of(0, 0.5, false));
        assert_eq!(AxisCut::parse("-z=.25"), of(2, 0.25, true));
        for bad in ["x", "w=0.5", "x=0", "x=1", "x=nan", "x=-0.5", "--x=0.5", "x=50%", "", "=0.5"] {
            assert!(AxisCut::parse(bad).unwrap_err().ends_with(&format!("got {bad}")), "{bad}");
        }
    }

    /// Voxels beyond the plane are on the side of its normal, also in a sheared and mirrored volume; that of the opposite cut is the other.
    #[test]
    fn the_plane_parts_the_voxels_as_the_fraction_says() {
        let world_from_index = DAffine3 {
            matrix3: glam::DMat3::from_cols(
                DVec3::new(-2.0, 0.3, 0.0),
                DVec3::new(0.5, 1.0, -0.4),
                DVec3::new(0.0, 0.2, 3.0),
            ),
            translation: DVec3::new(5.0, -7.0, 1.0),
        };
        let dims = [10, 20, 30];
        for axis in 0..3 {
            for removes_low in [false, true] {
                let cut = AxisCut { axis, fraction: 0.3, removes_low };
                let CutShape::Plane { point, normal } = cut.cut(dims, &world_from_index).shape else {
                    panic!("a plane")
                };
                for p in [[0.5, 0.5, 0.5], [9.5, 19.5, 29.5], [2.9, 5.9, 8.9], [3.1, 6.1, 9.1]] {
                    let beyond = p[axis] > 0.3 * f64::from(dims[axis]);
                    let p = world_from_index.transform_point3(DVec3::from_array(p));
                    let side = (p - DVec3::from_array(point)).dot(DVec3::from_array(normal));
                    assert_eq!(side > 0.0, beyond != removes_low, "axis {axis}");
                }
                let all = [DVec3::ZERO, DVec3::new(10.0, 20.0, 30.0)];
                let [low, high] = cut.clipped(dims, all).unwrap();
                let length = (high - low)[axis] / f64::from(dims[axis]);
                assert!((length - if removes_low { 0.7 } else { 0.3 }).abs() < 1e-12);
            }
        }
        let last = [DVec3::splat(9.0), DVec3::splat(10.0)];
        assert_eq!(AxisCut { axis: 0, fraction: 0.5, removes_low: false }.clipped(dims, last), None);
    }
}

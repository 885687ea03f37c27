//! Framing: the camera that sees what a figure shows.

use glam::{DAffine3, DMat3, DVec3};
use pumice_scene::{Camera, Projection};

use super::window::Window;

/// Field of view over the longer side of the picture: that of a lens of 72 mm on a frame of 36 mm.
pub(super) const FOV_DEG: f64 = 28.0;

/// What a figure's camera frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrameOn {
    /// The labels that are shown, as far as cuts leave them.
    #[default]
    Labels,
    /// The whole volume, so that pictures of other labels of it have the same place, scale and camera.
    Volume,
}

impl FrameOn {
    /// Parses `labels` or `volume`.
    ///
    /// # Errors
    /// The two names, if `name` is neither.
    pub fn parse(name: &str) -> Result<Self, String> {
        match name {
            "labels" => Ok(Self::Labels),
            "volume" => Ok(Self::Volume),
            _ => Err(format!("expected labels or volume, got {name}")),
        }
    }
}

/// Direction from the subject to the camera for a view in degrees: around the vertical axis, counter-clockwise from above with 0 in front,
/// and above the horizon.
pub(super) fn toward_camera(view_deg: [f64; 2]) -> DVec3 {
    let [around, above] = view_deg.map(f64::to_radians);
    DVec3::new(around.sin() * above.cos(), -around.cos() * above.cos(), above.sin())
}

/// Right, up and back, in the world, of a camera that looks from this direction.
pub(super) fn camera_axes(toward_camera: DVec3) -> DMat3 {
    let back = toward_camera.normalize();
    let right = DVec3::Z.cross(back).try_normalize().unwrap_or(DVec3::X);
    DMat3::from_cols(right, back.cross(right), back)
}

/// The eight corners of a box.
pub(super) fn corners([low, high]: [DVec3; 2]) -> impl Iterator<Item = DVec3> {
    (0..8u32).map(move |i| DVec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), high, low))
}

/// Is shown points of which only the outermost matter.
pub(super) trait Outermost {
    /// Takes a point into account.
    fn include(&mut self, p: DVec3);

    /// Whether a point that is at most so far from `p` may matter; where none can, none needs to be included.
    fn may_matter(&self, _p: DVec3, _distance: f64) -> bool {
        true
    }
}

/// A distance with room for the rounding of coordinates, which is a billion times less.
fn roomy(distance: f64) -> f64 {
    (1.0 + 1e-6) * distance
}

/// The least height of some points in the world.
pub(super) struct Lowest(pub(super) f64);

impl Outermost for Lowest {
    fn include(&mut self, p: DVec3) {
        self.0 = self.0.min(p.z);
    }

    fn may_matter(&self, p: DVec3, distance: f64) -> bool {
        p.z - roomy(distance) <= self.0
    }
}

/// Finds the nearest perspective camera of 28° that shows all points within a window of the picture.
///
/// The camera stands in front of the middle of the points, and a shift of the lens moves them to the window, so that what is shown looks the same
/// wherever it is in the picture. Each point p gives two planes per axis: the camera at c must satisfy |(p−c)·right| ≤ tan·((c−p)·back). The tightest left and right
/// planes intersect at the best horizontal position, and likewise vertically; the larger of the two distances satisfies both.
pub(super) struct Framing {
    axes: DMat3,
    fov_rad: f64,
    /// Of half the window.
    tangents: [f64; 2],
    shift: [f64; 2],
    /// Largest of ±p·axis + tan·p·back among the points, for right and up.
    planes: [[f64; 2]; 2],
}

impl Framing {
    pub(super) fn new(toward_camera: DVec3, size: [u32; 2], window: &Window) -> Self {
        let fov_rad = FOV_DEG.to_radians();
        let longer = f64::from(size[0].max(size[1]));
        Self {
            axes: camera_axes(toward_camera),
            fov_rad,
            tangents: [0, 1].map(|a| (fov_rad / 2.0).tan() * f64::from(size[a]) / longer * window.half[a]),
            // In units of the longer side. The sum makes −0, which scene files would show, a plain 0.
            shift: [0, 1].map(|a| -window.middle[a] * f64::from(size[a]) / longer / 2.0 + 0.0),
            planes: [[f64::NEG_INFINITY; 2]; 2],
        }
    }

    /// ±p·axis + tan·p·back, by axis.
    fn planes_of(&self, p: DVec3) -> [[f64; 2]; 2] {
        let back = p.dot(self.axes.z_axis);
        [0, 1].map(|axis| {
            let (across, depth) = (p.dot(self.axes.col(axis)), self.tangents[axis] * back);
            [depth + across, depth - across]
        })
    }

    pub(super) fn camera(&self) -> Camera {
        let place = |axis: usize| {
            let [plus, minus] = self.planes[axis];
            ((plus - minus) / 2.0, (plus + minus) / (2.0 * self.tangents[axis]))
        };
        let ((x, back_x), (y, back_y)) = (place(0), place(1));
        self.camera_at(DVec3::new(x, y, back_x.max(back_y)))
    }

    /// The least distance from the world's origin at which a camera that looks at it sees all points, with the same margin.
    pub(super) fn centred_distance(&self) -> f64 {
        // The camera at (0, 0, d) must satisfy ±p·axis ≤ tan·(d − p·back).
        let of_axis = |axis: usize| self.planes[axis][0].max(self.planes[axis][1]) / self.tangents[axis];
        of_axis(0).max(of_axis(1))
    }

    /// A camera that looks at the world's origin from this distance.
    pub(super) fn centred_camera(&self, distance: f64) -> Camera {
        self.camera_at(DVec3::new(0.0, 0.0, distance))
    }

    fn camera_at(&self, place: DVec3) -> Camera {
        let pose = DAffine3 { matrix3: self.axes, translation: self.axes * place };
        Camera { shift: self.shift, ..Camera::new(pose, Projection::Perspective { fov_rad: self.fov_rad }) }
    }
}

impl Outermost for Framing {
    fn include(&mut self, p: DVec3) {
        let of_point = self.planes_of(p);
        for (planes, of_point) in self.planes.iter_mut().zip(of_point) {
            *planes = [0, 1].map(|side| planes[side].max(of_point[side]));
        }
    }

    fn may_matter(&self, p: DVec3, distance: f64) -> bool {
        let of_point = self.planes_of(p);
        (0..2).any(|axis| {
            // Right, up and back are perpendicular, so this is how long the planes' normals are.
            let reach = roomy(distance) * self.tangents[axis].hypot(1.0);
            (0..2).any(|side| of_point[axis][side] + reach >= self.planes[axis][side])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_sees_every_point_and_wastes_no_room() {
        for (size, view) in
            [([960, 540], [30.0, 20.0]), ([400, 900], [-75.0, 60.0]), ([512, 512], [0.0, 89.9])]
        {
            let points: Vec<DVec3> = (0..8u32)
                .map(|i| {
                    DVec3::new(
                        f64::from(i & 1) * 8.0,
                        f64::from(i >> 1 & 1) * 3.0 - 7.0,
                        f64::from(i >> 2) * 1.5,
                    )
                })
                .collect();
            let mut framing = Framing::new(toward_camera(view), size, &Window::WHOLE);
            points.iter().for_each(|&p| framing.include(p));
            for camera in [framing.camera(), framing.centred_camera(framing.centred_distance())] {
                let Projection::Perspective { fov_rad } = camera.projection else { unreachable!() };
                let camera_from_world = camera.world_from_camera.inverse();
                let longer = f64::from(size[0].max(size[1]));
                let mut extreme = [0f64; 2];
                for p in &points {
                    let q = camera_from_world.transform_point3(*p);
                    assert!(q.z < 0.0, "behind the camera");
                    for (a, e) in extreme.iter_mut().enumerate() {
                        let half = (fov_rad / 2.0).tan() * f64::from(size[a]) / longer;
                        *e = e.max((q[a] / -q.z / half).abs());
                    }
                }
                // Within the margin, and the tighter direction touches it.
                assert!(
                    extreme.iter().all(|&e| e <= 0.92 + 1e-9) && extreme.iter().any(|&e| e > 0.92 - 1e-9),
                    "{extreme:?}"
                );
            }
        }
    }

    #[test]
    fn the_camera_goes_around_as_the_help_says() {
        // From the front, from the right, from behind, from the left, from above.
        for (view, expected) in [
            ([0.0, 0.0], DVec3::NEG_Y),
            ([90.0, 0.0], DVec3::X),
            ([180.0, 0.0], DVec3::Y),
            ([-90.0, 0.0], DVec3::NEG_X),
            ([77.0, 90.0], DVec3::Z),
        ] {
            assert!(toward_camera(view).distance(expected) < 1e-12, "{view:?}");
        }
    }

    /// What may matter is included, so skipping the rest changes nothing.
    #[test]
    fn what_may_not_matter_moves_nothing() {
        let mut state = 1u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        let size = [960, 540];
        let mut lowest = f64::INFINITY;
        let framing = || Framing::new(toward_camera([24.0, 24.0]), size, &Window::WHOLE);
        let (mut whole, mut sparing, mut sparing_lowest) = (framing(), framing(), Lowest(f64::INFINITY));
        let mut skipped = 0;
        for _ in 0..5000 {
            let middle = 9.0 * DVec3::new(noise(), noise(), noise());
            let half = DVec3::new(noise(), noise(), noise()).abs();
            let points: Vec<DVec3> = corners([middle - half, middle + half]).collect();
            let distance = half.element_sum();
            points.iter().for_each(|&p| whole.include(p));
            lowest = points.iter().fold(lowest, |low, p| low.min(p.z));
            if sparing.may_matter(middle, distance) {
                points.iter().for_each(|&p| sparing.include(p));
            } else {
                skipped += 1;
            }
            if sparing_lowest.may_matter(middle, distance) {
                points.iter().for_each(|&p| sparing_lowest.include(p));
            }
        }
        assert_eq!((sparing.planes, sparing_lowest.0), (whole.planes, lowest));
        assert!((4000..5000).contains(&skipped), "{skipped}");
    }
}

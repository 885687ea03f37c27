//! The window of a picture in which a figure is framed: all of it, or what a legend leaves free.
//!
//! ```text
//! ┌──────────────────────┐
//! │ legend ┊             │   whole: all but a margin, where what is shown then keeps clear of the legend
//! │┄┄┄┄┄┄┄┄┊   right     │   right: beside the legend
//! │        ┊             │   below: under it
//! │   below              │   whichever shows the figure larger
//! └──────────────────────┘
//! ```

use glam::DVec3;
use pumice_scene::{Camera, Projection};

use super::framing::Outermost;

/// Margin on each side, as a part of the picture.
const MARGIN: f64 = 0.04;
/// Least part of the picture's width or height that is worth framing in: a figure in less would be smaller than its legend.
const LEAST: f64 = 0.25;

/// A rectangle of the picture, in halves of its sides from its middle: x right, y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Window {
    pub(super) middle: [f64; 2],
    pub(super) half: [f64; 2],
}

impl Window {
    /// The picture without its margins.
    pub(super) const WHOLE: Self = Self { middle: [0.0; 2], half: [1.0 - 2.0 * MARGIN; 2] };

    /// From a corner to another, as parts of the picture from its upper left.
    fn between(low: [f64; 2], high: [f64; 2]) -> Self {
        let middle = [low[0] + high[0] - 1.0, 1.0 - low[1] - high[1]];
        Self { middle, half: [high[0] - low[0], high[1] - low[1]] }
    }
}

/// The windows that a legend leaves free in a picture of `size` pixels, if it reaches so many pixels from the upper left corner: beside it and
/// below it, as far as they are worth framing in.
pub(crate) fn free_windows(size: [u32; 2], reach: [f64; 2]) -> Vec<Window> {
    let [right, below] = [0, 1].map(|a| reach[a] / f64::from(size[a]) + MARGIN);
    let (first, last) = (MARGIN, 1.0 - MARGIN);
    let beside = (last - right >= LEAST).then(|| Window::between([right, first], [last; 2]));
    let under = (last - below >= LEAST).then(|| Window::between([first, below], [last; 2]));
    beside.into_iter().chain(under).collect()
}

/// The bounds of points in the picture that a camera takes, in pixels from the upper left.
pub(super) struct Seen<'a> {
    camera: &'a Camera,
    size: [f64; 2],
    low: [f64; 2],
    high: [f64; 2],
}

impl<'a> Seen<'a> {
    pub(super) fn new(camera: &'a Camera, size: [u32; 2]) -> Self {
        let none = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        Self { camera, size: size.map(f64::from), low: none.0, high: none.1 }
    }

    /// Whether they keep clear of what reaches so many pixels from the upper left corner, by a margin.
    pub(super) fn clears(&self, reach: [f64; 2]) -> bool {
        (0..2).any(|a| self.low[a] >= reach[a] + MARGIN * self.size[a])
    }
}

impl Outermost for Seen<'_> {
    fn include(&mut self, p: DVec3) {
        let Projection::Perspective { fov_rad } = self.camera.projection else { return };
        let pose = &self.camera.world_from_camera;
        let q = pose.matrix3.transpose() * (p - pose.translation);
        let longer = self.size[0].max(self.size[1]);
        let across = |a: usize| {
            let part = q.to_array()[a] / -q.z / (2.0 * (fov_rad / 2.0).tan()) - self.camera.shift[a];
            self.size[a] / 2.0 + longer * if a == 0 { part } else { -part }
        };
        for a in 0..2 {
            (self.low[a], self.high[a]) = (self.low[a].min(across(a)), self.high[a].max(across(a)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::FigureFlags;
    use crate::figure::samples::{block, many, named};
    use pumice_core::CompressedVolume;
    use pumice_picture::annotate::{LegendRow, Paper, legend_marks};
    use pumice_scene::Scene;
    use pumice_transport::camera_rays::CameraRays;

    const SIZE: [u32; 2] = [1004, 565];

    /// The bounds of a whole volume's boxes in the picture of a scene, in pixels, by the camera rays of the renderers.
    fn seen(volume: &CompressedVolume, scene: &Scene) -> [[f64; 2]; 2] {
        let rays = CameraRays::new(&scene.camera, &scene.film);
        let camera_from_world = scene.camera.world_from_camera.inverse();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        volume.for_each_box(|_, b| {
            for i in 0..8u32 {
                let (first, last) = b.voxel_bounds();
                let at = |a: usize| {
                    if i >> a & 1 == 0 { f64::from(first[a]) } else { f64::from(last[a]) + 1.0 }
                };
                let p = DVec3::new(at(0), at(1), at(2));
                let q = camera_from_world
                    .transform_point3(scene.instances[0].world_from_index.transform_point3(p));
                assert!(q.z < 0.0, "behind the camera");
                let [x, y] = [q.x / -q.z, q.y / -q.z];
                let pixel = [
                    ((x / rays.half - 2.0 * rays.shift[0]) * rays.fitted + rays.size[0]) / 2.0,
                    (rays.size[1] - (y / rays.half - 2.0 * rays.shift[1]) * rays.fitted) / 2.0,
                ];
                for a in 0..2 {
                    (low[a], high[a]) = (low[a].min(pixel[a]), high[a].max(pixel[a]));
                }
            }
        });
        [low, high]
    }

    /// The lower right corner of the legend of a volume: its marks, whose text has any ink.
    fn legend_of(volume: &CompressedVolume, most: usize, dpi: f64) -> [f64; 2] {
        let mut rows: Vec<(u64, u32)> = volume.labels().voxels().iter().copied().zip(0..).collect();
        rows.sort_by_key(|&(voxels, label)| (std::cmp::Reverse(voxels), label));
        let name = |label: u32| {
            let note = volume.note(label).and_then(|note| note.name.clone());
            note.unwrap_or_else(|| volume.labels().ids()[label as usize].to_string())
        };
        let listed: Vec<_> = rows
            .iter()
            .take(most)
            .map(|&(_, label)| LegendRow { name: name(label), color: [0.5; 3] })
            .collect();
        let paper = Paper { width: SIZE[0].into(), height: SIZE[1].into(), dpi };
        let marks = legend_marks(&paper, &listed, rows.len().saturating_sub(most)).unwrap();
        let mut reach = [0f64; 2];
        for mark in &marks {
            for (i, _) in mark.coverage.iter().enumerate().filter(|(_, c)| **c > 0.0) {
                let at = [mark.left + (i % mark.width) as i64, mark.top + (i / mark.width) as i64];
                reach = [0, 1].map(|a| reach[a].max(at[a] as f64 + 1.0));
            }
        }
        reach
    }

    fn scene(volume: &CompressedVolume, flags: FigureFlags) -> Scene {
        flags.figure(volume, "memory".into(), SIZE, None).unwrap()
    }

    /// Of each volume, view and legend: what is shown and the legend's lower right corner, with and without the wish for a legend.
    fn for_each_case(mut check: impl FnMut(&str, [[f64; 2]; 2], [f64; 2], [[f64; 2]; 2])) {
        let volumes =
            [named(), block([9, 9, 9]), block([2, 2, 30]), many(20, [8, 8, 1]), many(3, [1, 40, 9])];
        for (number, volume) in volumes.iter().enumerate() {
            for view in [[24.0, 24.0], [-70.0, 5.0], [150.0, -40.0], [0.0, 90.0]] {
                for (most, dpi) in [(1, 300.0), (3, 300.0), (12, 300.0), (12, 150.0), (30, 100.0)] {
                    for turntable in [None, Some(7)] {
                        let flags = FigureFlags { view: Some(view), turntable, ..FigureFlags::default() };
                        let beside = FigureFlags { legend: Some(most), dpi: Some(dpi), ..flags.clone() };
                        let plain = seen(volume, &scene(volume, flags));
                        let what = format!("volume {number}, view {view:?}, {most} at {dpi}, {turntable:?}");
                        let scene = scene(volume, beside);
                        for turn in 0..turntable.unwrap_or(1) {
                            let angle = crate::figure::camera::turn_rad(turn, turntable.unwrap_or(1));
                            let turned = crate::figure::turned(&scene, angle);
                            let reach = legend_of(volume, most as usize, dpi);
                            check(&what, seen(volume, &turned), reach, plain);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn what_is_shown_keeps_clear_of_the_legend_and_stays_in_the_picture() {
        let mut covered_without = 0;
        for_each_case(|what, [low, high], reach, plain| {
            let clears = |low: [f64; 2]| (0..2).any(|a| low[a] > reach[a] + 1.0);
            assert!(clears(low), "{what}: {low:?} under a legend to {reach:?}");
            for a in 0..2 {
                let side = f64::from(SIZE[a]);
                assert!(
                    low[a] > 0.04 * side - 1e-6 && high[a] < 0.96 * side + 1e-6,
                    "{what}: {low:?} {high:?}"
                );
            }
            covered_without += u32::from(!clears(plain[0]));
        });
        // Negative control: the same figures without the wish for a legend.
        assert!(covered_without > 100, "{covered_without}");
    }

    /// A square block of one label in a wide picture: beside its legend there is more room than below it, and it fills that room.
    #[test]
    fn a_figure_fills_the_window_that_shows_it_larger() {
        let volume = block([9, 9, 9]);
        let flags = |most| FigureFlags { legend: most, view: Some([0.0, 0.0]), ..FigureFlags::default() };
        let height = |scene: &Scene| {
            let [low, high] = seen(&volume, scene);
            high[1] - low[1]
        };
        let [alone, beside] = [None, Some(1)].map(|most| height(&scene(&volume, flags(most))));
        // The picture's whole height, since the legend has one short line.
        assert!((alone - 0.92 * 565.0).abs() < 1e-6 && (beside - alone).abs() < 1e-6, "{alone} {beside}");
        // A flat one is clear of a legend of one line where it stands.
        let flat = block([40, 2, 2]);
        let cameras = [None, Some(1)].map(|most| scene(&flat, flags(most)).camera);
        assert_eq!(cameras[0], cameras[1]);
        assert_eq!(cameras[0].shift, [0.0; 2]);
    }

    #[test]
    fn the_camera_is_that_of_the_picture_without_legend_where_it_is_said() {
        let volume = block([9, 9, 9]);
        for fixed in [
            FigureFlags { distance: Some(22.0), ..FigureFlags::default() },
            FigureFlags { frame: Some(crate::figure::FrameOn::Volume), ..FigureFlags::default() },
        ] {
            let with = FigureFlags { legend: Some(12), ..fixed.clone() };
            assert_eq!(scene(&volume, with).camera, scene(&volume, fixed).camera);
        }
    }

    #[test]
    fn a_legend_that_leaves_little_free_leaves_no_window() {
        assert_eq!(free_windows([100, 100], [60.0, 60.0]).len(), 2);
        let [beside] = free_windows([100, 100], [60.0, 80.0])[..] else { panic!("below, 12 are left") };
        // From 64 to 96 across, 4 to 96 down.
        for (got, expected) in beside.middle.iter().chain(&beside.half).zip([0.6, 0.0, 0.32, 0.92]) {
            assert!((got - expected).abs() < 1e-12, "{beside:?}");
        }
        assert_eq!(free_windows([100, 100], [80.0, 80.0]), []);
    }
}

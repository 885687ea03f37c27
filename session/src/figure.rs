//! Composes a scene for a volume that comes without one: places, frames and lights it.
//!
//! The volume keeps its own handedness and voxel shape. It is centred on the visible labels and scaled so that their bounding
//! box has a diagonal of [`DIAGONAL`] world units. Where the file names anatomical axes, z stays up; elsewhere the longest axis is
//! laid from left to right, so that a tall stack fills a wide picture.
//!
//! The light is a photographer's: a wide sun as key light from above and behind the camera's left shoulder, a dim cool sky as
//! fill, and a backdrop that only camera rays see.

use std::path::PathBuf;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::{CompressedVolume, WorldFrame};
use pumice_picture::metrics::display::linear_from_srgb;
use pumice_scene::{
    Camera, Environment, Film, Filter, Instance, LabelGroups, LabelStyle, Material, Projection, Reading,
    SCENE_VERSION, Scene, Settings, Show, Sun, World,
};

/// Diagonal of the visible labels' bounding box in world units.
pub const DIAGONAL: f64 = 10.0;

/// Options of a figure.
#[derive(Clone, Debug)]
pub struct FigureOptions {
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Dense indices of the labels to show; `None` shows all that were read.
    pub labels: Option<Vec<u32>>,
    /// Direction from the subject to the camera in degrees: around the vertical axis, above the horizon.
    pub view_deg: [f64; 2],
}

impl FigureOptions {
    /// The default view: from the front right, a little above.
    pub const DEFAULT_VIEW_DEG: [f64; 2] = [24.0, 24.0];
}

/// Composes a scene that shows `volume`, whose file is `source`.
///
/// If no box is visible (no label shown, an empty volume), the whole volume is framed.
pub fn compose(volume: &CompressedVolume, source: PathBuf, options: &FigureOptions) -> Scene {
    // Bounding box of what is shown, in index space.
    let info = volume.info();
    let bounds = volume.label_bounds();
    let held = || (0..volume.labels().len() as u32).filter(|&label| volume.holds(label)).collect();
    let chosen: Option<Vec<u32>> = options.labels.clone().or_else(|| (!volume.is_whole()).then(held));
    let shown: Vec<u32> = chosen.clone().unwrap_or_else(held);
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &label in &shown {
        let b = bounds[label as usize];
        let (l, h) =
            (DVec3::from_array(b.low.map(f64::from)), DVec3::from_array(b.high.map(|v| f64::from(v) + 1.0)));
        (lo, hi) = (lo.min(l), hi.max(h));
    }
    if !lo.is_finite() {
        (lo, hi) = (DVec3::ZERO, DVec3::from_array(info.dims.map(f64::from)));
    }

    // Place it in the world: rotate, scale, centre.
    let turn = if info.frame == WorldFrame::Unknown {
        lay_longest_axis(info.spacing(), hi - lo)
    } else {
        DMat3::IDENTITY
    };
    let linear = turn * info.world_from_index.matrix3;
    let size = (linear * (hi - lo)).length();
    let linear = linear * if size > 0.0 { DIAGONAL / size } else { 1.0 };
    let world_from_index = DAffine3 { matrix3: linear, translation: -(linear * ((lo + hi) / 2.0)) };

    let [around, above] = options.view_deg.map(f64::to_radians);
    let toward_camera = DVec3::new(around.sin() * above.cos(), -around.cos() * above.cos(), above.sin());
    let mut is_shown = vec![chosen.is_none(); bounds.len()];
    for &label in &shown {
        is_shown[label as usize] = true;
    }
    // Frame the visible boxes, not the corners of their common bounding box: the camera comes closer and still sees everything.
    let mut framing = Framing::new(toward_camera, options.size);
    volume.for_each_box(|label, b| {
        if is_shown[label as usize] {
            let low = DVec3::from_array(b.origin.map(f64::from));
            let high = low + DVec3::from_array(b.extent.map(f64::from));
            corners(low, high).for_each(|c| framing.include(world_from_index.transform_point3(c)));
        }
    });
    if framing.is_empty() {
        corners(lo, hi).for_each(|c| framing.include(world_from_index.transform_point3(c)));
    }
    let camera = framing.camera();
    let right = camera.world_from_camera.matrix3.x_axis;
    let up = camera.world_from_camera.matrix3.y_axis;
    let key_from = toward_camera * 0.55 - right * 0.65 + up * 0.9;

    // Labels keep the colours that the file gives them; the others get automatic colours that differ between neighbours.
    let material = Material { roughness: 0.45, specular: 0.35, ..Material::default() };
    let own_colors = info.notes.iter().filter_map(|note| {
        let base_color = note.color_srgb?.map(|c| linear_from_srgb(f64::from(c.clamp(0.0, 1.0))) as f32);
        Some((note.id, Material { base_color, ..material }))
    });

    Scene {
        version: SCENE_VERSION,
        instances: vec![Instance {
            id: 1,
            source,
            reading: Reading::default(),
            world_from_index,
            style: LabelStyle {
                show: match &chosen {
                    Some(labels) => {
                        Show::Only(labels.iter().map(|&l| volume.labels().ids()[l as usize]).collect())
                    }
                    None => Show::All,
                },
                material,
                auto_color: true,
                groups: LabelGroups::default(),
                materials: own_colors.collect(),
            },
        }],
        camera,
        film: Film::new(options.size[0], options.size[1], Filter::BlackmanHarris { width: 3.0 }),
        world: World {
            environment: Environment::Constant { radiance: [0.92, 0.98, 1.06] },
            backdrop: Some([[0.78, 0.79, 0.80], [0.93, 0.945, 0.96]]),
        },
        suns: vec![Sun {
            direction: (-key_from).to_array(),
            strength: 2.6,
            color: [1.0, 0.95, 0.87],
            angle_rad: 24f64.to_radians(),
        }],
        lights: Vec::new(),
        meshes: Vec::new(),
        cuts: Vec::new(),
        settings: Settings::default(),
    }
}

/// A rotation that takes the longest axis of the box to +x and keeps the handedness.
fn lay_longest_axis(spacing: [f64; 3], extent: DVec3) -> DMat3 {
    let lengths = extent * DVec3::from_array(spacing);
    if lengths.x >= lengths.y && lengths.x >= lengths.z {
        DMat3::IDENTITY
    } else if lengths.y >= lengths.z {
        DMat3::from_cols(DVec3::Y, -DVec3::X, DVec3::Z).transpose()
    } else {
        // Cyclic: z to x, x to y, y to z.
        DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X)
    }
}

/// The eight corners of a box.
fn corners(low: DVec3, high: DVec3) -> impl Iterator<Item = DVec3> {
    (0..8u32).map(move |i| DVec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), high, low))
}

/// Finds the nearest perspective camera of 28° that sees all points with a margin of 4 % of the picture on each side.
///
/// Each point p gives two planes per axis: the camera at c must satisfy |(p−c)·right| ≤ tan·((c−p)·back). The tightest left and right
/// planes intersect at the best horizontal position, and likewise vertically; the larger of the two distances satisfies both.
struct Framing {
    axes: DMat3,
    fov_rad: f64,
    tangents: [f64; 2],
    /// Largest of ±p·axis + tan·p·back, for right and up.
    planes: [[f64; 2]; 2],
}

impl Framing {
    fn new(toward_camera: DVec3, size: [u32; 2]) -> Self {
        let back = toward_camera.normalize();
        let right = DVec3::Z.cross(back).try_normalize().unwrap_or(DVec3::X);
        let fov_rad = 28f64.to_radians();
        let longer = f64::from(size[0].max(size[1]));
        Self {
            axes: DMat3::from_cols(right, back.cross(right), back),
            fov_rad,
            tangents: size.map(|pixels| (fov_rad / 2.0).tan() * f64::from(pixels) / longer * 0.92),
            planes: [[f64::NEG_INFINITY; 2]; 2],
        }
    }

    fn include(&mut self, p: DVec3) {
        let back = p.dot(self.axes.z_axis);
        for (axis, planes) in self.planes.iter_mut().enumerate() {
            let (across, depth) = (p.dot(self.axes.col(axis)), self.tangents[axis] * back);
            *planes = [planes[0].max(depth + across), planes[1].max(depth - across)];
        }
    }

    fn is_empty(&self) -> bool {
        self.planes[0][0] == f64::NEG_INFINITY
    }

    fn camera(&self) -> Camera {
        let place = |axis: usize| {
            let [plus, minus] = self.planes[axis];
            ((plus - minus) / 2.0, (plus + minus) / (2.0 * self.tangents[axis]))
        };
        let ((x, back_x), (y, back_y)) = (place(0), place(1));
        Camera::new(
            DAffine3 { matrix3: self.axes, translation: self.axes * DVec3::new(x, y, back_x.max(back_y)) },
            Projection::Perspective { fov_rad: self.fov_rad },
        )
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
            let [around, above] = [f64::to_radians(view[0]), f64::to_radians(view[1])];
            let toward = DVec3::new(around.sin() * above.cos(), -around.cos() * above.cos(), above.sin());
            let points: Vec<DVec3> = (0..8u32)
                .map(|i| {
                    DVec3::new(
                        f64::from(i & 1) * 8.0,
                        f64::from(i >> 1 & 1) * 3.0 - 7.0,
                        f64::from(i >> 2) * 1.5,
                    )
                })
                .collect();
            let mut framing = Framing::new(toward, size);
            points.iter().for_each(|&p| framing.include(p));
            let camera = framing.camera();
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

    #[test]
    fn the_longest_axis_lies_along_x_and_nothing_is_mirrored() {
        for extent in [DVec3::new(9.0, 1.0, 1.0), DVec3::new(1.0, 9.0, 1.0), DVec3::new(1.0, 1.0, 9.0)] {
            let turn = lay_longest_axis([1.0; 3], extent);
            assert_eq!((turn * extent).abs().x, 9.0);
            assert_eq!(turn.determinant(), 1.0);
        }
    }
}

//! Composes a scene for a volume that comes without one: places, frames, colours and lights it.
//!
//! ```text
//! flags, keywords ─► FigureFlags ─ finds labels in the volume ─► FigureOptions ─ compose ─► Scene
//! ```
//! The volume keeps its own handedness and voxel shape. It is centred on what is framed and scaled so that its bounding
//! box has a diagonal of [`DIAGONAL`] world units. Where the file names anatomical axes, z stays up; elsewhere the longest axis is
//! laid from left to right, so that a tall stack fills a wide picture.

mod axis_cut;
mod camera;
mod color;
mod flags;
mod floor;
mod framing;
mod lens;
mod light;
mod material;
#[cfg(test)]
mod samples;
mod selector;
mod style;
mod turntable;
mod window;

use std::path::PathBuf;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::{CompressedVolume, WorldFrame};
use pumice_scene::{Film, Filter, Instance, LabelStyle, Reading, SCENE_VERSION, Scene, Settings, Show, Sun};

pub use axis_cut::AxisCut;
pub(crate) use color::linear;
pub use color::{Background, LabelColor, css_color};
pub use flags::{FigureFlags, distance, view};
pub use framing::FrameOn;
pub use lens::{FocusOn, Lens, Opening, SharpAt};
pub(crate) use light::{key as key_light, world as sky};
pub use material::{LabelPreset, MaterialPreset};
pub use selector::Selector;
pub use style::FigureStyle;
pub use turntable::turned;
pub(crate) use window::free_windows;

use camera::camera;
use framing::{Lowest, Outermost, camera_axes, corners, toward_camera};

/// Diagonal of the bounding box of what is framed in world units.
pub const DIAGONAL: f64 = 10.0;

/// Options of a figure. Labels are dense indices of the volume.
#[derive(Clone, Debug)]
pub struct FigureOptions {
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Labels to show; `None` shows all that were read.
    pub labels: Option<Vec<u32>>,
    /// Direction from the subject to the camera in degrees: around the vertical axis, above the horizon.
    pub view_deg: [f64; 2],
    /// What the camera frames.
    pub frame: FrameOn,
    /// Distance of the camera from the middle of what is framed, in world units; `None` comes as close as everything is seen.
    pub distance: Option<f64>,
    /// Number of pictures around the vertical axis that must all see what is framed.
    pub turntable: Option<u32>,
    /// Materials and colours of labels, whatever it shows; `None` for plastic in the colours that the file has.
    pub style: Option<LabelStyle>,
    /// Planes that cut the volume open.
    pub cuts: Vec<AxisCut>,
    /// Whether shadows fall on a floor.
    pub floor: bool,
    /// Depth of field; `None` keeps everything sharp.
    pub lens: Option<Lens>,
    /// How far a legend reaches from the upper left corner, in pixels across and down; what is framed keeps clear of it where the camera is free:
    /// without a `distance`, and where labels are framed.
    pub legend: Option<[f64; 2]>,
}

impl FigureOptions {
    /// The default view: from the front right, a little above.
    pub const DEFAULT_VIEW_DEG: [f64; 2] = [24.0, 24.0];
    /// The default size.
    pub const DEFAULT_SIZE: [u32; 2] = [960, 540];
}

impl Default for FigureOptions {
    fn default() -> Self {
        Self {
            size: Self::DEFAULT_SIZE,
            labels: None,
            view_deg: Self::DEFAULT_VIEW_DEG,
            frame: FrameOn::default(),
            distance: None,
            turntable: None,
            style: None,
            cuts: Vec::new(),
            floor: false,
            lens: None,
            legend: None,
        }
    }
}

/// Composes a scene that shows `volume`, whose file is `source`.
///
/// If no box is visible (no label shown, an empty volume, all cut away), the whole volume is framed.
pub fn compose(volume: &CompressedVolume, source: PathBuf, options: &FigureOptions) -> Scene {
    // Find what is shown, in index space.
    let info = volume.info();
    let ids = volume.labels().ids();
    let held = || (0..ids.len() as u32).filter(|&label| volume.holds(label)).collect();
    let chosen: Option<Vec<u32>> = options.labels.clone().or_else(|| (!volume.is_whole()).then(held));
    let shown: Vec<u32> = chosen.clone().unwrap_or_else(held);
    let whole = [DVec3::ZERO, DVec3::from_array(info.dims.map(f64::from))];
    // At a time step of a series labels may be shown that have no voxel there.
    let of_labels = match options.frame {
        FrameOn::Volume => None,
        FrameOn::Labels => bounds_of(volume, &shown, &options.cuts),
    };
    let framed = of_labels.unwrap_or(whole);

    // Place it in the world: rotate, scale, centre.
    let turn = if info.frame == WorldFrame::Unknown {
        lay_longest_axis(info.spacing(), framed[1] - framed[0])
    } else {
        DMat3::IDENTITY
    };
    let linear = turn * info.world_from_index.matrix3;
    let size = (linear * (framed[1] - framed[0])).length();
    let linear = linear * if size > 0.0 { DIAGONAL / size } else { 1.0 };
    let world_from_index =
        DAffine3 { matrix3: linear, translation: -(linear * ((framed[0] + framed[1]) / 2.0)) };
    let to_world = |p: DVec3| world_from_index.transform_point3(p);

    // Frame the visible boxes, not the corners of their common bounding box: the camera comes closer and still sees everything.
    let mut is_shown = vec![chosen.is_none(); ids.len()];
    shown.iter().for_each(|&label| is_shown[label as usize] = true);
    let half_sides = DVec3::from_array([0, 1, 2].map(|a| linear.col(a).length() / 2.0));
    let show_corners = |outermost: &mut dyn Outermost| {
        volume.for_each_box(|label, b| {
            let extent = DVec3::from_array(b.extent.map(f64::from));
            let middle = to_world(DVec3::from_array(b.origin.map(f64::from)) + extent / 2.0);
            if is_shown[label as usize]
                && outermost.may_matter(middle, extent.dot(half_sides))
                && let Some(visible) = left_of(&options.cuts, info.dims, voxel_corners(b.voxel_bounds()))
            {
                corners(visible).map(to_world).for_each(|corner| outermost.include(corner));
            }
        });
    };
    // For a floor; and cuts may leave nothing of what is shown.
    let lowest = (options.floor || !options.cuts.is_empty()).then(|| {
        let mut lowest = Lowest(f64::INFINITY);
        show_corners(&mut lowest);
        lowest.0
    });
    let frames_boxes = of_labels.is_some() && lowest.is_none_or(f64::is_finite);
    // What falls on the floor belongs to the picture.
    let key = light::key(&camera_axes(toward_camera(options.view_deg)));
    let shadows = if options.floor { shadows_of(corners(framed).map(to_world), &key) } else { Vec::new() };
    let of_bounds = || corners(framed).map(to_world).chain(shadows.iter().copied());
    let show_points = |outermost: &mut dyn Outermost| match frames_boxes {
        true => {
            show_corners(outermost);
            shadows.iter().for_each(|&shadow| outermost.include(shadow));
        }
        false => of_bounds().for_each(|point| outermost.include(point)),
    };
    let mut camera = camera(options, &show_points, &of_bounds().collect::<Vec<_>>());
    camera.aperture = options.lens.as_ref().map(|lens| lens.aperture(&camera, to_world));

    let show = match &chosen {
        Some(labels) => Show::Only(labels.iter().map(|&label| ids[label as usize]).collect()),
        None => Show::All,
    };
    let floor = options.floor.then(|| {
        let lowest_framed = || corners(framed).map(|corner| to_world(corner).z).fold(f64::INFINITY, f64::min);
        floor::floor_below(lowest.filter(|lowest| lowest.is_finite()).unwrap_or_else(lowest_framed))
    });
    Scene {
        version: SCENE_VERSION,
        instances: vec![Instance {
            id: 1,
            source,
            reading: Reading::default(),
            world_from_index,
            style: match &options.style {
                Some(style) => LabelStyle { show, ..style.clone() },
                None => style::plain(volume, show),
            },
        }],
        suns: vec![key],
        camera,
        film: Film {
            shadow_fade: if options.floor { floor::FADE } else { 0.0 },
            ..Film::new(options.size[0], options.size[1], Filter::BlackmanHarris { width: 3.0 })
        },
        world: light::world(),
        lights: Vec::new(),
        meshes: floor.into_iter().collect(),
        cuts: options.cuts.iter().map(|cut| cut.cut(info.dims, &world_from_index)).collect(),
        settings: Settings::default(),
    }
}

/// Where the shadows of points in the world fall on a floor below them all; none under a light from below.
fn shadows_of(points: impl Iterator<Item = DVec3>, key: &Sun) -> Vec<DVec3> {
    let along = DVec3::from_array(key.direction);
    let points: Vec<DVec3> = points.collect();
    let floor = points.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let fallen = points.iter().map(|&p| p + along * ((floor - p.z) / along.z));
    if along.z < 0.0 { fallen.collect() } else { Vec::new() }
}

/// What cuts leave of a box in index space; `None` if nothing.
fn left_of(cuts: &[AxisCut], dims: [u32; 3], bounds: [DVec3; 2]) -> Option<[DVec3; 2]> {
    cuts.iter().try_fold(bounds, |left, cut| cut.clipped(dims, left))
}

/// Common bounds of what cuts leave of labels in index space; `None` if nothing is.
fn bounds_of(volume: &CompressedVolume, labels: &[u32], cuts: &[AxisCut]) -> Option<[DVec3; 2]> {
    let dims = volume.info().dims;
    let bounds = volume.label_bounds();
    let of_label = |&label: &u32| {
        let b = bounds[label as usize];
        let [low, high] = voxel_corners((b.low, b.high));
        // A label of which no voxel was read has none.
        low.cmplt(high).all().then_some([low, high]).and_then(|b| left_of(cuts, dims, b))
    };
    labels.iter().filter_map(of_label).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// The lowest and the highest corner of voxels from the lowest to the highest.
fn voxel_corners((low, high): ([u32; 3], [u32; 3])) -> [DVec3; 2] {
    [low.map(f64::from), high.map(|v| f64::from(v) + 1.0)].map(DVec3::from_array)
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

#[cfg(test)]
mod tests {
    use pumice_scene::Camera;

    use super::samples::{block, named};
    use super::*;

    #[test]
    fn the_longest_axis_lies_along_x_and_nothing_is_mirrored() {
        for extent in [DVec3::new(9.0, 1.0, 1.0), DVec3::new(1.0, 9.0, 1.0), DVec3::new(1.0, 1.0, 9.0)] {
            let turn = lay_longest_axis([1.0; 3], extent);
            assert_eq!((turn * extent).abs().x, 9.0);
            assert_eq!(turn.determinant(), 1.0);
        }
    }

    fn placed(options: &FigureOptions) -> (DAffine3, Camera) {
        let scene = compose(&named(), "memory".into(), options);
        (scene.instances[0].world_from_index, scene.camera)
    }

    #[test]
    fn what_is_shown_moves_nothing_when_the_volume_is_framed() {
        let of = |frame, labels: &[u32]| {
            placed(&FigureOptions { frame, labels: Some(labels.to_vec()), ..FigureOptions::default() })
        };
        assert_eq!(of(FrameOn::Volume, &[0]), of(FrameOn::Volume, &[1, 2]));
        assert_ne!(of(FrameOn::Labels, &[0]).0, of(FrameOn::Labels, &[1, 2]).0);
        // The volume is 6 × 1 × 1 voxels: the middle is the origin, the diagonal √38 voxels.
        let (world_from_index, _) = of(FrameOn::Volume, &[0]);
        assert!(world_from_index.transform_point3(DVec3::new(3.0, 0.5, 0.5)).length() < 1e-12);
        assert!((world_from_index.matrix3.x_axis.length() - 10.0 / 38f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn the_camera_is_at_the_distance_and_looks_at_the_middle() {
        let (_, camera) = placed(&FigureOptions { distance: Some(33.0), ..FigureOptions::default() });
        let pose = camera.world_from_camera;
        assert!((pose.translation - pose.matrix3.z_axis * 33.0).length() < 1e-12);
        assert!((toward_camera(FigureOptions::DEFAULT_VIEW_DEG) - pose.matrix3.z_axis).length() < 1e-12);
    }

    #[test]
    fn the_floor_is_just_below_what_cuts_leave() {
        let lowest = |cuts: Vec<AxisCut>| {
            // Framed by the volume, a cube of 8: its diagonal of 10 units is √3 · 8 voxels.
            let options =
                FigureOptions { floor: true, frame: FrameOn::Volume, cuts, ..FigureOptions::default() };
            let scene = compose(&block([8, 8, 8]), "memory".into(), &options);
            (scene.meshes[0].world_from_mesh.translation.z + 0.01) * 3f64.sqrt() * 8.0 / 10.0
        };
        assert!((lowest(vec![]) + 4.0).abs() < 1e-9);
        let cut = AxisCut { axis: 2, fraction: 0.25, removes_low: true };
        assert!((lowest(vec![cut]) + 2.0).abs() < 1e-9);
    }

    #[test]
    fn the_picture_has_room_for_the_shadow_on_the_floor() {
        let most = |floor| {
            let options = FigureOptions { floor, view_deg: [0.0, 20.0], ..FigureOptions::default() };
            let scene = compose(&block([4, 4, 12]), "memory".into(), &options);
            let camera_from_world = scene.camera.world_from_camera.inverse();
            let along = DVec3::from_array(scene.suns[0].direction);
            let whole = [DVec3::ZERO, DVec3::new(4.0, 4.0, 12.0)];
            let lowest = corners(whole)
                .map(|c| scene.instances[0].world_from_index.transform_point3(c).z)
                .fold(f64::INFINITY, f64::min);
            let far = |corner| {
                let p = scene.instances[0].world_from_index.transform_point3(corner);
                let q = camera_from_world.transform_point3(p + along * ((lowest - p.z) / along.z));
                let half = (framing::FOV_DEG.to_radians() / 2.0).tan();
                (q.x / -q.z / half).abs().max((q.y / -q.z / half * 16.0 / 9.0).abs())
            };
            corners(whole).map(far).fold(0.0, f64::max)
        };
        assert!(most(true) < 0.92 + 1e-9 && most(false) > 1.0, "{} {}", most(true), most(false));
    }

    #[test]
    fn every_picture_of_a_turntable_sees_the_bounds() {
        let options = FigureOptions { turntable: Some(5), ..FigureOptions::default() };
        let scene = compose(&block([9, 2, 3]), "memory".into(), &options);
        let mut most = 0f64;
        for frame in 0..5 {
            let turned = turned(&scene, std::f64::consts::TAU * f64::from(frame) / 5.0);
            let camera_from_world = turned.camera.world_from_camera.inverse();
            let whole = [DVec3::ZERO, DVec3::new(9.0, 2.0, 3.0)];
            for corner in corners(whole) {
                let q = camera_from_world
                    .transform_point3(scene.instances[0].world_from_index.transform_point3(corner));
                let half = (framing::FOV_DEG.to_radians() / 2.0).tan();
                most = most.max((q.x / -q.z / half).abs()).max((q.y / -q.z / half * 16.0 / 9.0).abs());
            }
        }
        // The widest touches the margin.
        assert!((most - 0.92).abs() < 1e-9, "{most}");
    }

    #[test]
    fn the_focus_is_the_depth_of_its_point() {
        let lens = |focus| Some(Lens { focus, opening: Opening::Radius(0.5) });
        let depth = |focus| {
            let (_, camera) = placed(&FigureOptions {
                distance: Some(30.0),
                lens: lens(focus),
                view_deg: [90.0, 0.0],
                ..Default::default()
            });
            camera.aperture.unwrap().focus_distance
        };
        assert!((depth(SharpAt::Middle) - 30.0).abs() < 1e-12);
        assert_eq!(depth(SharpAt::Distance(7.0)), 7.0);
        // Seen along x: one voxel of 10/√38 units towards the camera.
        let nearer = depth(SharpAt::Index(DVec3::new(4.0, 0.5, 0.5)));
        assert!((nearer - (30.0 - 10.0 / 38f64.sqrt())).abs() < 1e-9, "{nearer}");
    }
}

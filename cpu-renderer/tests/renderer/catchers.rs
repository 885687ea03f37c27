//! Shadow catchers compared with closed forms, on a floor seen from straight above.
//!
//! ```text
//!       ┌────────────── plate, z = 1, x > 0      a sun of one direction from the upper right: shadow from x = −1 on, visible up to 0
//!  ·····│· camera rays, parallel, straight down
//! ──────┴────────────── floor, z = 0, a catcher
//! ```

use std::f64::consts::PI;
use std::sync::Arc;
use std::time::Duration;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::{Job, MeshData};
use pumice_picture::{Pass, Picture};
use pumice_scene::{
    Camera, Environment, Film, Filter, Material, Mesh, Mode, Passes, Projection, SCENE_VERSION, Scene,
    Settings, Sun, World,
};
use pumice_transport::{LoadedScene, Renderer as _};

/// Pixels across; the picture is 8 units wide, so a pixel is an eighth of a unit.
pub(crate) const SIDE: u32 = 64;

/// A rectangle: a corner and two sides.
pub(crate) struct Sheet {
    pub(crate) corner: [f64; 3],
    pub(crate) sides: [[f64; 3]; 2],
    pub(crate) material: Material,
    pub(crate) catches: bool,
}

pub(crate) fn lambert(color: f32) -> Material {
    Material { base_color: [color; 3], specular: 0.0, roughness: 1.0, ..Material::default() }
}

pub(crate) fn floor() -> Sheet {
    let sides = [[1000.0, 0.0, 0.0], [0.0, 1000.0, 0.0]];
    Sheet { corner: [-500.0, -500.0, 0.0], sides, material: lambert(0.8), catches: true }
}

/// A plate over all of x > 0, at height `z`.
pub(crate) fn plate(z: f64) -> Sheet {
    let sides = [[1000.0, 0.0, 0.0], [0.0, 1000.0, 0.0]];
    Sheet { corner: [0.0, -500.0, z], sides, material: lambert(0.5), catches: false }
}

/// A wall along x = 0.
pub(crate) fn wall(height: f64) -> Sheet {
    let sides = [[0.0, 1e5, 0.0], [0.0, 0.0, height]];
    Sheet { corner: [0.0, -5e4, 0.0], sides, material: lambert(0.0), catches: false }
}

fn mesh_of(sheet: &Sheet) -> Arc<MeshData> {
    let [p, a, b] = [sheet.corner, sheet.sides[0], sheet.sides[1]].map(DVec3::from);
    let corners = [p, p + a, p + a + b, p + b].map(|c| c.to_array());
    Arc::new(MeshData::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]], vec![0; 2]).unwrap())
}

/// A scene of these sheets in uniform light of the radiance `sky`.
pub(crate) fn scene_of(sheets: &[Sheet], sky: f32) -> (Scene, Vec<Arc<MeshData>>) {
    let camera = DAffine3 { matrix3: DMat3::IDENTITY, translation: DVec3::new(0.0, 0.0, 50.0) };
    let mut film = Film::new(SIDE, SIDE, Filter::Box { width: 1.0 });
    film.transparent = true;
    let meshes = sheets.iter().zip(1..).map(|(sheet, id)| Mesh {
        id,
        source: "memory".into(),
        world_from_mesh: DAffine3::IDENTITY,
        materials: vec![sheet.material],
        shadow_catcher: sheet.catches,
    });
    let scene = Scene {
        version: SCENE_VERSION,
        instances: Vec::new(),
        camera: Camera::new(camera, Projection::Orthographic { scale: 8.0 }),
        film,
        world: World { environment: Environment::Constant { radiance: [sky; 3] }, backdrop: None },
        suns: Vec::new(),
        lights: Vec::new(),
        meshes: meshes.collect(),
        cuts: Vec::new(),
        settings: Settings { bounces: 0, ..Settings::default() },
    };
    (scene, sheets.iter().map(mesh_of).collect())
}

/// From the upper right, at 45°.
pub(crate) fn sun() -> Sun {
    Sun { direction: [-1.0, 0.0, -1.0], strength: 2.0, color: [1.0; 3], angle_rad: 0.0 }
}

/// A loaded scene of meshes alone, with their triangles.
pub(crate) fn loaded(scene: &Scene, meshes: &[Arc<MeshData>]) -> LoadedScene {
    LoadedScene::new(scene.clone(), vec![], meshes.to_vec()).unwrap()
}

/// Draws until there are enough samples (a macro, because the result of `super::renderer()` need not be a renderer itself).
macro_rules! draw_on {
    ($renderer:expr, $scene:expr, $meshes:expr, $slice:expr, $spp:expr) => {{
        $renderer.set_scene(&super::catchers::loaded($scene, $meshes)).unwrap();
        loop {
            let told = $renderer.advance($slice, $spp, &Job::new()).unwrap();
            if told.spp >= $spp || told.all_rest {
                break (told.error_estimate, $renderer.picture().unwrap());
            }
        }
    }};
}

#[allow(unused_imports, reason = "of those who need more than a picture")]
pub(crate) use draw_on;

pub(crate) const SLICE: Duration = Duration::from_secs(5);

pub(crate) fn draw(scene: &Scene, meshes: &[Arc<MeshData>], spp: u32) -> Picture {
    let mut renderer = super::renderer();
    draw_on!(renderer, scene, meshes, SLICE, spp).1
}

/// The same, with the shadows in a pass of their own.
pub(crate) fn draw_apart(scene: &Scene, meshes: &[Arc<MeshData>], spp: u32) -> (Picture, Vec<[f32; 3]>) {
    let mut scene = scene.clone();
    scene.film.passes = scene.film.passes.or(Passes::NONE.with(Pass::ShadowCatcher));
    let picture = draw(&scene, meshes, spp);
    let shadow = picture.light.iter().find(|(pass, _)| *pass == Pass::ShadowCatcher).unwrap();
    let pixels = shadow.1.pixels.clone();
    (picture, pixels)
}

pub(crate) fn alpha(picture: &Picture) -> &[f32] {
    picture.alpha.as_ref().unwrap()
}

/// x of the middle of a column of pixels.
pub(crate) fn x_of(column: usize) -> f64 {
    (column as f64 + 0.5) / f64::from(SIDE) * 8.0 - 4.0
}

#[test]
fn nothing_on_an_open_floor() {
    let (scene, meshes) = scene_of(&[floor()], 0.7);
    let picture = draw(&scene, &meshes, 6);
    assert!(alpha(&picture).iter().all(|a| *a == 0.0));
    assert!(picture.color.pixels.iter().all(|c| *c == [0.0; 3]));
    let (apart, shadow) = draw_apart(&scene, &meshes, 6);
    assert!(shadow.iter().all(|s| *s == [1.0; 3]), "to the last bit");
    assert!(alpha(&apart).iter().all(|a| *a == 0.0));
    // With other lights, and with bounces between catchers: light that catchers exchange is no shadow.
    let (mut scene, meshes) = scene_of(&[floor(), Sheet { catches: true, ..wall(2.0) }], 0.4);
    scene.suns = vec![Sun { angle_rad: 0.3, ..sun() }];
    scene.settings.bounces = 4;
    let (_, shadow) = draw_apart(&scene, &meshes, 6);
    assert!(shadow.iter().all(|s| *s == [1.0; 3]));
    // On an opaque film the sky is visible through the floor.
    let mut opaque = scene.clone();
    opaque.film.transparent = false;
    let picture = draw(&opaque, &meshes, 6);
    assert!(picture.alpha.is_none());
    assert!(picture.color.pixels.iter().all(|c| c.iter().all(|v| (v - 0.4).abs() < 1e-6)));
    // Negative control: an ordinary floor is visible.
    opaque.meshes[0].shadow_catcher = false;
    assert!(draw(&opaque, &meshes, 6).color.pixels[5][0] > 0.41);
}

#[test]
fn a_plate_in_the_sun_leaves_an_umbra() {
    let (mut scene, meshes) = scene_of(&[floor(), plate(1.0)], 0.0);
    scene.suns = vec![sun()];
    let picture = draw(&scene, &meshes, 4);
    let (apart, shadow) = draw_apart(&scene, &meshes, 4);
    scene.film.transparent = false;
    scene.world.backdrop = Some([[3.0, 2.0, 1.0]; 2]);
    let over = draw(&scene, &meshes, 4);
    // Lambertian reflection of E cos 45°, where E is the irradiance across the beam.
    let lit = (2.0 * 0.5 / PI * 0.5f64.sqrt()) as f32;
    let mut seen = [0; 3];
    for (i, left) in shadow.iter().enumerate() {
        let x = x_of(i % SIDE as usize);
        let (a, c, s) = (alpha(&picture)[i], picture.color.pixels[i], left[1]);
        let behind = over.color.pixels[i];
        if x > 0.0 {
            assert!(a == 1.0 && (c[0] - lit).abs() < 1e-5 && (behind[0] - lit).abs() < 1e-5, "{c:?}");
            assert_eq!((alpha(&apart)[i], s), (1.0, 1.0), "no catcher is there");
            seen[0] += 1;
        } else if x > -1.0 {
            assert_eq!((a, c, s, alpha(&apart)[i]), (1.0, [0.0; 3], 0.0, 0.0), "{x}");
            assert_eq!(behind, [0.0; 3]);
            seen[1] += 1;
        } else {
            assert_eq!((a, c, s), (0.0, [0.0; 3], 1.0), "{x}");
            assert!(behind.iter().zip([3.0, 2.0, 1.0]).all(|(b, e)| (b - e).abs() < 1e-5), "{behind:?}");
            seen[2] += 1;
        }
    }
    assert_eq!(seen, [2048, 512, 1536]);
}

/// A uniform sky beside a black wall of height h hides (1 − d / √(d² + h²)) / 2 of the light on the floor at a distance d.
#[test]
fn a_wall_hides_its_form_factor() {
    let hidden = |d: f64, h: f64| 0.5 * (1.0 - d / d.hypot(h));
    let (scene, meshes) = scene_of(&[floor(), wall(1.5)], 0.9);
    let (_, shadow) = draw_apart(&scene, &meshes, 16);
    let picture = draw(&scene, &meshes, 16);
    let [mut sum, mut faulty] = [0.0; 2];
    for column in 0..SIDE as usize {
        let d = x_of(column).abs();
        let of = |f: &dyn Fn(usize) -> f32| {
            let pixels = (0..SIDE as usize).map(|row| f64::from(f(row * SIDE as usize + column)));
            pixels.sum::<f64>() / f64::from(SIDE)
        };
        let [s, a] = [of(&|i| shadow[i][0]), of(&|i| alpha(&picture)[i])];
        // 1,024 samples of a share of at most a half: four standard errors; across a pixel the form factor varies by less than 0.002.
        assert!((1.0 - s - hidden(d, 1.5)).abs() < 4.0 * 0.5 / 32.0 + 0.002, "{d}: {s}");
        assert!((a - (1.0 - s)).abs() < 1e-6, "{d}: shadow and alpha");
        sum += 1.0 - s - hidden(d, 1.5);
        faulty += 1.0 - s - hidden(d, 1.3);
    }
    // The mean of all columns to four standard errors; a wall lower by two fifteenths is noticed.
    let bound = 4.0 * 0.5 / 256.0;
    let columns = f64::from(SIDE);
    assert!((sum / columns).abs() < bound && (faulty / columns).abs() > bound, "{sum} {faulty}");
    // As ambient occlusion, with a distance so large that its result is that of the sky.
    let mut ambient = scene.clone();
    (ambient.settings.mode, ambient.settings.ao_distance) = (Mode::AmbientOcclusion, 1e9);
    let (_, shadow) = draw_apart(&ambient, &meshes, 16);
    let mean = shadow.iter().map(|s| f64::from(s[0])).sum::<f64>() / (columns * columns);
    let expected = (0..SIDE as usize).map(|c| 1.0 - hidden(x_of(c).abs(), 1.5)).sum::<f64>() / columns;
    assert!((mean - expected).abs() < bound, "{mean} {expected}");
}

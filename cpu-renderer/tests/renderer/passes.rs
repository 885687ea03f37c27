//! Passes, transparent film and clamps as a renderer's users see them: closed forms on the slab of `cases`, and sums that must add up.
//! `super::renderer()` returns the renderer under test.

use std::f32::consts::FRAC_1_PI;
use std::time::Duration;

use glam::DVec3;
use pumice_core::Job;
use pumice_picture::cryptomatte::id_of_hash;
use pumice_picture::{Image, Pass, Passes, Picture};
use pumice_scene::{Environment, Light, LightShape, Material, Mode, Projection, Scene, Settings, Show, Sun};
use pumice_transport::{LoadedScene, Renderer};

use super::floor::{lambert, looking_down, volume};

const BLACK: Environment = Environment::Constant { radiance: [0.0; 3] };
const SKY: Environment = Environment::Constant { radiance: [0.8, 0.6, 0.4] };

fn light() -> Passes {
    Pass::LIGHT.iter().copied().collect()
}

fn render(scene: &Scene, spp: u32) -> Picture {
    let mut renderer = super::renderer();
    renderer.set_scene(&LoadedScene::new(scene.clone(), vec![volume()], vec![]).unwrap()).unwrap();
    let job = Job::new();
    while renderer.advance(Duration::from_millis(20), spp, &job).unwrap().spp < spp {}
    renderer.picture().unwrap()
}

fn image(picture: &Picture, pass: Pass) -> &Image {
    let found = picture.light.iter().find(|(of, _)| *of == pass);
    &found.unwrap_or_else(|| panic!("no pass {}", pass.name())).1
}

/// Every channel of every pixel has the value, to a relative error of 64 roundings of f32: a handful of factors, and sums of at most 16
/// samples.
fn is_all(of: &Image, value: [f32; 3], what: &str) {
    for pixel in &of.pixels {
        for (got, expected) in pixel.iter().zip(value) {
            assert!((got - expected).abs() <= 4e-6 * expected.abs(), "{what}: {pixel:?}, expected {value:?}");
        }
    }
}

fn straight_sun() -> Sun {
    Sun { direction: [0.6, 0.0, -0.8], strength: 3.0, color: [1.0, 0.5, 0.25], angle_rad: 0.0 }
}

/// The floor alone, seen from above.
fn floor(environment: Environment, suns: Vec<Sun>, material: Material) -> Scene {
    let mut scene = looking_down(environment, suns, material);
    scene.instances[0].style.show = Show::Only(vec![5]);
    scene.film.passes = light();
    scene
}

/// A scene with every kind of light path: all kinds of surfaces side by side, sky, sun and a lamp, seen at an angle.
fn everything() -> Scene {
    let glossy = Material {
        base_color: [0.2, 0.6, 0.9],
        roughness: 0.4,
        coat: 0.5,
        sheen: 0.6,
        ..Material::default()
    };
    let mut scene = looking_down(SKY, vec![Sun { angle_rad: 0.3, ..straight_sun() }], glossy);
    let glass = Material { transmission: 0.7, roughness: 0.3, emission: [0.1, 0.2, 0.0], ..glossy };
    scene.instances[0].style.materials.insert(9, Material { alpha: 0.8, ..glass });
    scene.lights.push(Light {
        shape: LightShape::Point { position: [6.0, 6.0, 9.0], radius: 0.6, soft_falloff: false },
        power_w: 900.0,
        color: [1.0, 0.9, 0.8],
        visible_to_camera: true,
    });
    scene.camera.world_from_camera.translation = DVec3::new(9.0, 9.0, 30.0);
    scene.camera.projection = Projection::Perspective { fov_rad: 0.8 };
    scene.settings.bounces = 5;
    scene.film.passes = light();
    scene
}

/// (direct + indirect) · colour of each kind, emission, environment; the pass `without` counts as black.
fn recombined(picture: &Picture, without: Option<Pass>) -> Vec<[f32; 3]> {
    let at = |pass: Pass, i: usize, c: usize| match Some(pass) == without {
        true => 0.0,
        false => image(picture, pass).pixels[i][c],
    };
    use Pass::*;
    let kinds = [
        [DiffuseDirect, DiffuseIndirect, DiffuseColor],
        [GlossyDirect, GlossyIndirect, GlossyColor],
        [TransmissionDirect, TransmissionIndirect, TransmissionColor],
    ];
    let pixel = |i: usize| {
        [0, 1, 2].map(|c| {
            let scattered = kinds
                .map(|[direct, indirect, color]| (at(direct, i, c) + at(indirect, i, c)) * at(color, i, c));
            scattered.iter().sum::<f32>() + at(Emission, i, c) + at(Environment, i, c)
        })
    };
    (0..picture.color.pixels.len()).map(pixel).collect()
}

/// Largest difference of any channel, relative to the pixel.
fn apart(picture: &Picture, sums: &[[f32; 3]]) -> f32 {
    let pairs = picture.color.pixels.iter().flatten().zip(sums.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs() / a.abs().max(1e-3)).fold(0.0, f32::max)
}

/// Sums of up to 16 samples of a dozen contributions each, in f32: 200 roundings of 2⁻²⁴ are 1.2e-5, and twice that for both sums.
const ROUNDING: f32 = 3e-5;

#[test]
fn light_passes_add_up_to_the_picture() {
    let picture = render(&everything(), 16);
    let off = apart(&picture, &recombined(&picture, None));
    assert!(off < ROUNDING, "{off}");
    // Negative controls: every pass is needed.
    for pass in Pass::LIGHT {
        let off = apart(&picture, &recombined(&picture, Some(*pass)));
        assert!(off > 0.01, "without {}: {off}", pass.name());
    }
}

/// Sorting light into passes does not change it, and passes that were not asked for do not exist.
#[test]
fn the_picture_is_the_same_with_passes_and_without() {
    let scene = everything();
    let mut plain = scene.clone();
    plain.film.passes = Passes::NONE;
    let (with, without) = (render(&scene, 4), render(&plain, 4));
    // A device may round differently in another program.
    let off = apart(&with, &without.color.pixels);
    assert!(off < ROUNDING, "{off}");
    assert!(without.light.is_empty() && without.alpha.is_none() && without.samples.is_none());
    let mut one = scene;
    one.film.passes = Passes::NONE.with(Pass::Emission).with(Pass::Samples);
    let one = render(&one, 4);
    assert_eq!(one.light.iter().map(|(pass, _)| *pass).collect::<Vec<_>>(), [Pass::Emission]);
    assert_eq!(one.samples, Some(vec![4.0; 64]));
}

#[test]
fn a_matte_floor_under_a_sun_is_diffuse_and_direct() {
    let picture = render(&floor(BLACK, vec![straight_sun()], lambert(0.6)), 4);
    let cos = 0.8;
    is_all(image(&picture, Pass::DiffuseColor), [0.6; 3], "colour");
    is_all(
        image(&picture, Pass::DiffuseDirect),
        [1.0, 0.5, 0.25].map(|c| 3.0 * c * cos * FRAC_1_PI),
        "direct",
    );
    for pass in Pass::LIGHT.iter().filter(|p| !matches!(p, Pass::DiffuseColor | Pass::DiffuseDirect)) {
        is_all(image(&picture, *pass), [0.0; 3], pass.name());
    }
}

#[test]
fn a_sky_found_by_scattering_is_direct() {
    let picture = render(&floor(SKY, vec![], lambert(0.5)), 4);
    is_all(image(&picture, Pass::DiffuseDirect), [0.8, 0.6, 0.4], "direct");
    is_all(image(&picture, Pass::Environment), [0.0; 3], "nothing of it is seen");
}

/// A metal mirror reflects glossy light only: at normal incidence its base colour.
#[test]
fn a_mirror_is_glossy() {
    let base_color = [0.7, 0.5, 0.25];
    let metal = Material { base_color, metallic: 1.0, roughness: 0.0, ..Material::default() };
    let picture = render(&floor(SKY, vec![], metal), 4);
    let (direct, color) = (image(&picture, Pass::GlossyDirect), image(&picture, Pass::GlossyColor));
    let pixels = direct.pixels.iter().zip(&color.pixels).map(|(d, c)| [0, 1, 2].map(|i| d[i] * c[i]));
    let product = Image::new(direct.width, direct.height, pixels.collect());
    // The energy tables are accurate to four digits.
    let expected = [0.8 * 0.7, 0.6 * 0.5, 0.4 * 0.25];
    for pixel in &product.pixels {
        assert!(
            pixel.iter().zip(expected).all(|(g, e): (&f32, f32)| (g / e - 1.0).abs() < 2e-3),
            "{pixel:?}"
        );
    }
    for pass in [Pass::DiffuseDirect, Pass::DiffuseColor, Pass::GlossyIndirect, Pass::TransmissionDirect] {
        is_all(image(&picture, pass), [0.0; 3], pass.name());
    }
}

/// Glass of index 1 neither bends nor reflects: the sky behind two surfaces, each with the root of the colour.
fn window() -> Scene {
    let glass = Material {
        base_color: [0.64, 0.49, 0.36],
        transmission: 1.0,
        ior: 1.0,
        roughness: 0.0,
        specular: 0.0,
        multiscatter: false,
        ..Material::default()
    };
    floor(SKY, vec![], glass)
}

#[test]
fn what_comes_through_a_window_is_transmission_and_indirect() {
    let picture = render(&window(), 4);
    is_all(image(&picture, Pass::TransmissionColor), [0.8, 0.7, 0.6], "colour");
    let expected = [0.8 * 0.8, 0.6 * 0.7, 0.4 * 0.6];
    is_all(image(&picture, Pass::TransmissionIndirect), expected, "indirect");
    is_all(image(&picture, Pass::TransmissionDirect), [0.0; 3], "direct");
    is_all(image(&picture, Pass::GlossyIndirect), [0.0; 3], "glossy");
}

#[test]
fn emission_is_emission() {
    let glowing = Material { emission: [0.3, 0.2, 0.1], ..lambert(0.0) };
    let picture = render(&floor(SKY, vec![], glowing), 4);
    is_all(image(&picture, Pass::Emission), [0.3, 0.2, 0.1], "emission");
    is_all(&picture.color, [0.3, 0.2, 0.1], "the picture");
}

/// Indirect light is the difference that more bounces make.
#[test]
fn indirect_light_is_what_bounces_add() {
    let scene = everything();
    let mut once = scene.clone();
    once.settings.mode = Mode::OneBounce;
    let (many, one) = (render(&scene, 8), render(&once, 8));
    let mut seen = 0.0f32;
    for (direct, indirect) in [
        (Pass::DiffuseDirect, Pass::DiffuseIndirect),
        (Pass::GlossyDirect, Pass::GlossyIndirect),
        (Pass::TransmissionDirect, Pass::TransmissionIndirect),
    ] {
        let pairs =
            image(&many, direct).pixels.iter().flatten().zip(image(&one, direct).pixels.iter().flatten());
        for (a, b) in pairs {
            assert!((a - b).abs() <= ROUNDING * a.max(*b), "{}: {a}, of one bounce {b}", direct.name());
        }
        is_all(image(&one, indirect), [0.0; 3], indirect.name());
        seen += image(&many, indirect).pixels.iter().flatten().sum::<f32>();
    }
    assert!(seen > 1.0, "{seen}");
}

/// Two surfaces with an alpha of a quarter: the light seen past them is transparent.
#[test]
fn alpha_tells_how_much_is_there() {
    let mut scene = floor(SKY, vec![], Material { alpha: 0.25, ..lambert(0.0) });
    let opaque = render(&scene, 64);
    assert!(opaque.alpha.is_none());
    scene.film.transparent = true;
    let picture = render(&scene, 64);
    let alpha = picture.alpha.as_ref().unwrap();
    // A black surface: the picture is black, and the sky seen past it is in its own pass, whether or not the film is opaque.
    is_all(&picture.color, [0.0; 3], "the picture");
    for ((a, behind), seen) in
        alpha.iter().zip(&image(&picture, Pass::Environment).pixels).zip(&opaque.color.pixels)
    {
        for (c, sky) in [0.8, 0.6, 0.4].into_iter().enumerate() {
            // Sums of 64 equal terms.
            assert!((behind[c] - sky * (1.0 - a)).abs() < 64.0 * 6e-8, "{behind:?} behind {a}");
            assert!((behind[c] - seen[c]).abs() < 64.0 * 6e-8, "{behind:?}, opaque {seen:?}");
        }
    }
    // The top and the bottom of the slab transmit 3/4 each; 64 × 64 random choices: five standard errors of 0.008.
    let mean = alpha.iter().sum::<f32>() / alpha.len() as f32;
    assert!((mean - (1.0 - 0.75 * 0.75)).abs() < 0.04, "{mean}");
    // With opaque surfaces alpha is 1; where there is nothing alpha is 0, and the backdrop does not count.
    scene.instances[0].style.material.alpha = 1.0;
    assert_eq!(render(&scene, 2).alpha, Some(vec![1.0; 64]));
    scene.camera.world_from_camera.translation = DVec3::new(-90.0, 0.0, 20.0);
    scene.world.backdrop = Some([[1.0; 3]; 2]);
    let empty = render(&scene, 2);
    assert_eq!(empty.alpha, Some(vec![0.0; 64]));
    is_all(&empty.color, [0.0; 3], "nothing");
    is_all(image(&empty, Pass::Environment), [1.0; 3], "the backdrop");
}

fn clamped(mut scene: Scene, clamp_direct: f32, clamp_indirect: f32) -> Picture {
    scene.settings = Settings { clamp_direct, clamp_indirect, ..scene.settings };
    render(&scene, 4)
}

#[test]
fn clamps_hold_the_mean_of_three_channels() {
    // One contribution for each sample: that of the sun.
    let sun = Sun { color: [1.0; 3], ..straight_sun() };
    let value = 0.6 * 3.0 * 0.8 * FRAC_1_PI;
    let mut scene = floor(BLACK, vec![sun], lambert(0.6));
    scene.film.passes = Passes::NONE;
    is_all(&clamped(scene.clone(), 0.3, 0.0).color, [0.3; 3], "clamped");
    is_all(&clamped(scene.clone(), 2.0, 0.0).color, [value; 3], "below the clamp");
    is_all(&clamped(scene.clone(), 0.0, 0.1).color, [value; 3], "not indirect");
    // Colour is kept: all channels are scaled alike once their mean is above the clamp.
    scene.suns[0].color = [1.0, 0.5, 0.0];
    is_all(&clamped(scene.clone(), 0.1, 0.0).color, [0.2, 0.1, 0.0], "a colour");
    is_all(&clamped(scene, value / 2.0 + 1e-3, 0.0).color, [value, value / 2.0, 0.0], "a colour below it");
    // Through the two surfaces of a window: indirect.
    let open = [0.8 * 0.64, 0.6 * 0.49, 0.4 * 0.36];
    is_all(&clamped(window(), 0.01, 0.0).color, open, "not direct");
    let mean = open.iter().sum::<f32>() / 3.0;
    is_all(&clamped(window(), 0.0, mean / 2.0).color, open.map(|c| c / 2.0), "indirect, clamped");
    // Light seen directly is direct.
    let glowing = Material { emission: [0.4; 3], ..lambert(0.0) };
    let picture = clamped(floor(BLACK, vec![], glowing), 0.1, 0.0);
    is_all(&picture.color, [0.1; 3], "emission");
    is_all(image(&picture, Pass::Emission), [0.1; 3], "its pass");
}

#[test]
fn first_surfaces_are_where_they_are() {
    let mut scene = floor(SKY, vec![], lambert(0.5));
    scene.film.passes = Passes::NONE.with(Pass::Albedo).with(Pass::Normal);
    let picture = render(&scene, 4);
    is_all(picture.albedo.as_ref().unwrap(), [0.5; 3], "albedo");
    is_all(picture.normal.as_ref().unwrap(), [0.0, 0.0, 1.0], "normal");
    assert!(picture.light.is_empty());
    // 8 × 8 pixels over 3 units around (3, 3), the first row at the top; the floor's top is at z = 2.
    for (i, [x, y, z]) in picture.position.unwrap().pixels.into_iter().enumerate() {
        let along = |n: usize| 1.5 + 3.0 * (n as f32 + 0.5) / 8.0;
        let (column, row) = (i % 8, 7 - i / 8);
        assert!((x - along(column)).abs() < 1e-5 && (y - along(row)).abs() < 1e-5 && z == 2.0, "{x} {y} {z}");
    }
    // At an edge, means lie in between: half of the pixel sees the floor, half nothing.
    scene.film.width = 1;
    scene.film.height = 1;
    scene.camera.world_from_camera.translation = DVec3::new(0.0, 8.0, 20.0);
    let picture = render(&scene, 64);
    let half = picture.albedo.unwrap().pixels[0][0];
    assert!((half - 0.25).abs() < 0.02, "{half}");
    scene.film.passes = Passes::NONE;
    let middle = render(&scene, 64).albedo.unwrap().pixels[0][0];
    assert!(middle == 0.0 || middle == 0.5, "through the middle: {middle}");
}

#[test]
fn occlusion_is_direct_diffuse_light_of_white_surfaces() {
    let mut scene = everything();
    scene.settings.mode = Mode::AmbientOcclusion;
    scene.settings.ao_distance = 3.0;
    let picture = render(&scene, 16);
    assert!(apart(&picture, &recombined(&picture, None)) < ROUNDING);
    assert!(apart(&picture, &recombined(&picture, Some(Pass::DiffuseDirect))) > 0.1);
}

/// (id, coverage) of the ranks of a pixel, for one kind of matte.
fn ranks(picture: &Picture, pass: Pass, pixel: usize) -> Vec<[f32; 2]> {
    let matte =
        picture.mattes.iter().find(|m| m.pass == pass).unwrap_or_else(|| panic!("no {}", pass.name()));
    matte.layers.iter().flat_map(|l| [[l[pixel][0], l[pixel][1]], [l[pixel][2], l[pixel][3]]]).collect()
}

/// Transparent surfaces count with their opacity, and surfaces behind them with the rest; in all no more than alpha.
#[test]
fn mattes_cover_what_alpha_does() {
    let mut scene = looking_down(SKY, vec![], lambert(0.5));
    scene.instances[0].style.materials.insert(9, Material { alpha: 0.25, ..lambert(0.5) });
    // Across the tower's side at x = 12 and past the slab's at x = 16: 8 pixels of 1 unit.
    scene.camera.world_from_camera.translation = DVec3::new(14.0, 14.0, 20.0);
    scene.camera.projection = Projection::Orthographic { scale: 8.0 };
    (scene.film.transparent, scene.film.cryptomatte_ranks) = (true, 4);
    scene.film.passes = Pass::MATTES.iter().copied().collect();
    let spp = 256;
    let picture = render(&scene, spp);
    let alpha = picture.alpha.as_ref().unwrap();
    let names = |m: usize| picture.mattes[m].names.keys().map(String::as_str).collect::<Vec<_>>();
    assert_eq!((names(0), names(1)), (vec!["5", "9"], vec!["no type"]));
    let id = |m: usize, name: &str| id_of_hash(picture.mattes[m].names[name]);
    let mut towers = 0.0;
    for (i, &a) in alpha.iter().enumerate() {
        let labels = ranks(&picture, Pass::CryptomatteLabel, i);
        let of = |name: &str| labels.iter().find(|r| r[0] == id(0, name)).map_or(0.0, |r| r[1]);
        let (floor, tower) = (of("5"), of("9"));
        // Counts over a power of two: no rounding.
        assert_eq!(floor + tower, a, "pixel {i}");
        assert!(labels.is_sorted_by(|a, b| a[1] >= b[1]), "{labels:?}");
        let [whole, .., last] = ranks(&picture, Pass::CryptomatteType, i)[..] else { panic!("no ranks") };
        assert!(whole[1] == a && (whole[0] == id(1, "no type") || a == 0.0) && last == [0.0; 2]);
        let (column, row) = (i % 8, i / 8);
        if (2..6).contains(&column) && (2..6).contains(&row) {
            // Its top and its bottom stop a quarter each; under it is the floor, which is opaque.
            assert_eq!(a, 1.0);
            towers += tower;
        } else {
            let inside = column < 6 && row >= 2;
            assert_eq!(
                (floor, tower, a),
                if inside { (1.0, 0.0, 1.0) } else { (0.0, 0.0, 0.0) },
                "pixel {i}"
            );
        }
    }
    // 16 · 256 random choices: five standard errors of 0.0078.
    let mean = towers / 16.0;
    assert!((mean - (1.0 - 0.75 * 0.75)).abs() < 0.039, "{mean}");
    // Passes that were not asked for do not exist.
    scene.film.passes = Passes::NONE.with(Pass::CryptomatteType);
    let kinds: Vec<Pass> = render(&scene, 1).mattes.iter().map(|m| m.pass).collect();
    assert_eq!(kinds, [Pass::CryptomatteType]);
    scene.film.passes = Passes::NONE;
    assert!(render(&scene, 1).mattes.is_empty());
    // An edit that asks for mattes gets ids of surfaces that were drawn before without ids.
    let mut renderer = super::renderer();
    for passes in [Passes::NONE, Pass::MATTES.iter().copied().collect()] {
        scene.film.passes = passes;
        renderer.set_scene(&LoadedScene::new(scene.clone(), vec![volume()], vec![]).unwrap()).unwrap();
    }
    while renderer.advance(Duration::from_millis(20), spp, &Job::new()).unwrap().spp < spp {}
    assert_eq!(renderer.picture().unwrap().mattes, picture.mattes);
}

//! Pictures with a shadow catcher that the device denoises, compared with the host's filter on the picture that the renderer gives. The host
//! composites such pictures: their mean and variance are not those of the film's sums, which are all that the device would have.

use std::time::Duration;

use pumice_core::Job;
use pumice_picture::denoise::denoised;
use pumice_picture::film::{CLASSES, variance_known};
use pumice_picture::{Guides, Image, Picture};
use pumice_scene::{Pass, Passes, Scene};
use pumice_transport::Renderer as _;

use super::catchers::{Sheet, draw_on, floor, scene_of, sun, wall};
use super::floor::lambert;

/// A floor that catches, the shadow of a wall on it, and a sheet of another label's kind above: in uniform light and a wide sun, whose penumbra
/// is noise.
fn shaded() -> (Scene, Vec<std::sync::Arc<pumice_core::MeshData>>) {
    let above = Sheet {
        corner: [-3.0, -2.0, 1.5],
        sides: [[2.0, 0.0, 0.0], [0.0, 4.0, 0.0]],
        material: lambert(0.6),
        catches: false,
    };
    let (mut scene, meshes) = scene_of(&[floor(), wall(2.0), above], 0.4);
    scene.suns = vec![sun()];
    scene.suns[0].angle_rad = 0.6;
    scene.settings.bounces = 1;
    (scene, meshes)
}

fn by_host(picture: &Picture) -> Image {
    let guides = Guides::of(picture).unwrap().unwrap();
    denoised(&picture.color, picture.variance.as_ref().map(variance_known), &guides).unwrap()
}

/// With shadows in an opaque picture, in the alpha of a transparent one and in a pass of their own; before and after the variance is known.
#[test]
fn caught_shadows_are_denoised_as_the_host_would() {
    let mut renderer = super::renderer();
    let apart = Passes::NONE.with(Pass::ShadowCatcher);
    for (transparent, passes) in [(false, Passes::NONE), (true, Passes::NONE), (true, apart)] {
        for spp in [1, 2 * CLASSES] {
            let (mut scene, meshes) = shaded();
            scene.film.transparent = transparent;
            scene.film.passes = scene.film.passes.or(passes);
            draw_on!(renderer, &scene, &meshes, Duration::ZERO, spp);
            let what = format!("transparent {transparent}, apart {}, {spp} samples", passes == apart);
            let got = renderer.denoised().unwrap().expect(&what);
            let picture = renderer.picture().unwrap();
            let expected = by_host(&picture);
            if renderer.gpu().candidate().name.contains("llvmpipe") {
                assert!(got == expected, "{what}: other bits");
            }
            let far = |a: &[f32; 3], b: &[f32; 3]| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-5 * a[c].abs());
            let differ =
                |a: &Image, b: &Image| a.pixels.iter().zip(&b.pixels).filter(|(a, b)| far(a, b)).count();
            assert!(differ(&expected, &got) <= expected.pixels.len() / 500, "{what}");
            // The filter does something, and on an opaque film something else than to a picture in which nothing catches.
            assert!(differ(&picture.color, &got) > 0, "{what}: as noisy as before");
            if !transparent {
                scene.meshes[0].shadow_catcher = false;
                draw_on!(renderer, &scene, &meshes, Duration::ZERO, spp);
                let ordinary = renderer.denoised().unwrap().unwrap();
                assert!(differ(&ordinary, &got) > 0, "{what}: as if nothing caught");
            }
        }
    }
    assert!(renderer.notices().is_empty());
}

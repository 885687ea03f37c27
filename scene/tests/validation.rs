//! For each rule of validation, a scene that breaks only that rule is refused with the name of the field at fault.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use std::f64::consts::PI;

use common::full_scene;
use glam::{DAffine3, DMat3, DVec3};
use pumice_scene::{
    Adaptive, Aperture, CutShape, Environment, Filter, LightShape, Lod, Material, Outline, Projection,
    SCENE_VERSION, Scene, SceneError,
};

/// The field that validation names after `edit` was applied to a valid scene.
#[track_caller]
fn fault(edit: impl FnOnce(&mut Scene)) -> String {
    let mut scene = full_scene();
    scene.validate().expect("the scene is good before the edit");
    edit(&mut scene);
    let error = scene.validate().expect_err("the edit breaks a rule");
    let text = error.to_string();
    assert!(!text.contains(char::is_control), "one line: {text:?}");
    match error {
        SceneError::Field { field, problem } => {
            assert!(!problem.is_empty());
            field
        }
        other => panic!("a field was expected, got {other}"),
    }
}

#[track_caller]
fn good(edit: impl FnOnce(&mut Scene)) {
    let mut scene = full_scene();
    edit(&mut scene);
    scene.validate().expect("on the right side of the rule");
}

/// Asserts that each value of `bad`, applied by `set`, is refused at `field`, and that each of `fine` is accepted.
#[track_caller]
fn rule<T: Copy + std::fmt::Debug>(field: &str, set: impl Fn(&mut Scene, T), bad: &[T], fine: &[T]) {
    for &v in bad {
        assert_eq!(fault(|s| set(s, v)), field, "for {v:?}");
    }
    fine.iter().for_each(|&v| good(|s| set(s, v)));
}

const NAN: f32 = f32::NAN;
const INF: f32 = f32::INFINITY;

#[test]
fn materials() {
    fn each(name: &str, set: impl Fn(&mut Material, f32), bad: &[f32], fine: &[f32]) {
        rule(
            &format!("instances[1].style.material.{name}"),
            |s, v| set(&mut s.instances[1].style.material, v),
            bad,
            fine,
        );
        rule(
            &format!("instances[0].style.materials.17.{name}"),
            |s, v| set(s.instances[0].style.materials.get_mut(&17).unwrap(), v),
            bad,
            fine,
        );
        rule(
            &format!("instances[1].style.groups[1].material.{name}"),
            |s, v| set(s.instances[1].style.groups.material_mut(1).unwrap(), v),
            bad,
            fine,
        );
    }
    let above_one = 1.0f32.next_up();
    let below_zero = -f32::from_bits(1);
    let outside_unit = [below_zero, above_one, NAN, INF, -INF];
    let unit = [0.0, -0.0, 1.0];
    for i in 0..3 {
        each(&format!("base_color[{i}]"), |m, v| m.base_color[i] = v, &outside_unit, &unit);
        each(&format!("emission[{i}]"), |m, v| m.emission[i] = v, &[below_zero, NAN, INF], &[0.0, f32::MAX]);
    }
    each("metallic", |m, v| m.metallic = v, &outside_unit, &unit);
    each("roughness", |m, v| m.roughness = v, &outside_unit, &unit);
    each("specular", |m, v| m.specular = v, &[below_zero, NAN, INF], &[0.0, 2.0]);
    let below_one = [1.0f32.next_down(), 0.0, NAN, INF];
    each("ior", |m, v| m.ior = v, &below_one, &[1.0, 4.0]);
    each("coat_ior", |m, v| m.coat_ior = v, &below_one, &[1.0, 4.0]);
    each("transmission", |m, v| m.transmission = v, &outside_unit, &unit);
    each("subsurface", |m, v| m.subsurface = v, &outside_unit, &unit);
    each("coat", |m, v| m.coat = v, &outside_unit, &unit);
    each("coat_roughness", |m, v| m.coat_roughness = v, &outside_unit, &unit);
    each("sheen", |m, v| m.sheen = v, &outside_unit, &unit);
    each("sheen_roughness", |m, v| m.sheen_roughness = v, &outside_unit, &unit);
    each("alpha", |m, v| m.alpha = v, &outside_unit, &unit);
    for i in 0..3 {
        each(&format!("specular_tint[{i}]"), |m, v| m.specular_tint[i] = v, &outside_unit, &unit);
        each(&format!("coat_tint[{i}]"), |m, v| m.coat_tint[i] = v, &outside_unit, &unit);
        each(&format!("sheen_tint[{i}]"), |m, v| m.sheen_tint[i] = v, &outside_unit, &unit);
        let radius = format!("subsurface_radius[{i}]");
        each(&radius, |m, v| m.subsurface_radius[i] = v, &[below_zero, NAN, INF], &[0.0, 1e6]);
    }
}

#[test]
fn matrices_that_cannot_be_inverted() {
    let flat = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::X + DVec3::Y);
    let nearly_flat = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::X + DVec3::Z * 1e-13);
    let no_column = DMat3::from_cols(DVec3::X, DVec3::ZERO, DVec3::Z);
    let nan = DMat3::from_diagonal(DVec3::new(1.0, f64::NAN, 1.0));
    // The determinant of this matrix is 0 in f64, so it has no inverse to render with.
    let too_small = DMat3::from_diagonal(DVec3::splat(1e-150));
    let bad = [flat, nearly_flat, no_column, nan, too_small, DMat3::ZERO];
    let sheared = DMat3::from_cols(DVec3::X, DVec3::new(5.0, 1.0, 0.0), DVec3::Z);
    // Axes of very different lengths, nanometres and metres, are allowed.
    let uneven = DMat3::from_diagonal(DVec3::new(1e-9, 1.0, -1e9));
    rule(
        "instances[1].world_from_index",
        |s, m| s.instances[1].world_from_index.matrix3 = m,
        &bad,
        &[sheared, uneven, DMat3::from_diagonal(DVec3::splat(1e-30))],
    );
    rule(
        "instances[0].world_from_index",
        |s, t: f64| s.instances[0].world_from_index.translation.z = t,
        &[f64::NAN, f64::INFINITY],
        &[-1e12],
    );
    let mut with_shear = bad.to_vec();
    with_shear.push(sheared);
    rule(
        "camera.world_from_camera",
        |s, m| s.camera.world_from_camera = DAffine3::from_mat3(m),
        &with_shear,
        &[uneven, DMat3::IDENTITY],
    );
}

#[test]
fn instances() {
    assert_eq!(fault(|s| s.instances[1].id = 7), "instances[1].id");
    assert_eq!(fault(|s| s.instances[0].source = "".into()), "instances[0].source");
    assert_eq!(
        fault(|s| s.instances[1].reading.spacing = Some([1.0, 0.0, 1.0])),
        "instances[1].reading.spacing[1]"
    );
    assert_eq!(
        fault(|s| s.instances[0].reading.spacing = Some([f64::NAN, 1.0, 1.0])),
        "instances[0].reading.spacing[0]"
    );
    let no_voxels = |s: &mut Scene| s.instances[1].reading.raw.iter_mut().for_each(|raw| raw.dims[2] = 0);
    assert_eq!(fault(no_voxels), "instances[1].reading.raw.dims[2]");
    good(|s| {
        s.instances.clear();
        s.cuts.clear();
    });
}

#[test]
fn meshes() {
    assert_eq!(fault(|s| s.meshes[1].id = 3), "meshes[1].id");
    good(|s| s.meshes[1].id = 7); // instances have ids of their own
    assert_eq!(fault(|s| s.meshes[0].source = "".into()), "meshes[0].source");
    assert_eq!(fault(|s| s.meshes[0].materials.clear()), "meshes[0].materials");
    assert_eq!(fault(|s| s.meshes[1].materials[1].coat = 2.0), "meshes[1].materials[1].coat");
    assert_eq!(fault(|s| s.meshes[1].world_from_mesh.matrix3 = DMat3::ZERO), "meshes[1].world_from_mesh");
}

#[test]
fn cuts() {
    let plane = |s: &mut Scene, point: [f64; 3], normal: [f64; 3]| {
        s.cuts[0].shape = CutShape::Plane { point, normal };
    };
    rule(
        "cuts[0].shape.plane.normal",
        |s, normal| plane(s, [0.0; 3], normal),
        &[[0.0; 3], [f64::NAN, 0.0, 1.0], [1e-200, 0.0, 0.0]],
        &[[0.0, 0.0, 1e-100]],
    );
    rule(
        "cuts[0].shape.plane.point",
        |s, point| plane(s, point, [1.0; 3]),
        &[[f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 0.0]],
        &[[1e12, 0.0, 0.0]],
    );
    rule(
        "cuts[1].shape.box.world_from_box",
        |s, m| s.cuts[1].shape = CutShape::Box { world_from_box: DAffine3::from_mat3(m) },
        &[DMat3::ZERO, DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0))],
        &[DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1e-6))],
    );
    assert_eq!(fault(|s| s.cuts[1].instances = Some(vec![7, 9])), "cuts[1].instances[1]");
    good(|s| s.cuts[1].instances = Some(vec![]));
}

#[test]
fn apertures() {
    fn each<T: Copy + std::fmt::Debug>(name: &str, set: impl Fn(&mut Aperture, T), bad: &[T], fine: &[T]) {
        let field = format!("camera.aperture.{name}");
        rule(&field, |s, v| set(s.camera.aperture.as_mut().unwrap(), v), bad, fine);
    }
    let not_above_zero = [0.0, -1.0, f64::NAN, f64::INFINITY];
    each("radius", |a, v| a.radius = v, &not_above_zero, &[1e-9, 1e6]);
    each("focus_distance", |a, v| a.focus_distance = v, &not_above_zero, &[1e-9, 1e9]);
    each("ratio", |a, v| a.ratio = v, &not_above_zero, &[0.5, 2.0]);
    each("rotation_rad", |a, v| a.rotation_rad = v, &[f64::NAN, f64::INFINITY], &[-9.0]);
    each("blades", |a, v| a.blades = v, &[1, 2, 65], &[0, 3, 64]);
}

#[test]
fn lamps() {
    let negative = [-1.0f32, NAN, INF];
    rule("lights[1].power_w", |s, v| s.lights[1].power_w = v, &negative, &[0.0, 1e9]);
    rule("lights[2].color[1]", |s, v| s.lights[2].color[1] = v, &negative, &[0.0, 4.0]);
    let point = |s: &mut Scene, position: [f64; 3], radius: f64| {
        s.lights[0].shape = LightShape::Point { position, radius, soft_falloff: false };
    };
    let radii = [-1.0, f64::NAN, 1.1e18, 1e300];
    rule("lights[0].shape.point.radius", |s, r| point(s, [0.0; 3], r), &radii, &[0.0, 1e6, 1e18]);
    let somewhere = [[f64::NAN, 0.0, 0.0], [0.0, 0.0, f64::INFINITY], [0.0, -1e39, 0.0], [1e300, 0.0, 0.0]];
    rule("lights[0].shape.point.position", |s, p| point(s, p, 1.0), &somewhere, &[[1e9; 3], [-1e18; 3]]);
    let spot = |s: &mut Scene, direction: [f64; 3], angle_rad: f64, blend: f32| {
        s.lights[1].shape = LightShape::Spot {
            position: [0.0; 3],
            direction,
            radius: 0.0,
            angle_rad,
            blend,
            soft_falloff: true,
        };
    };
    let angles = [-0.1, PI.next_up(), f64::NAN];
    rule("lights[1].shape.spot.angle_rad", |s, a| spot(s, [1.0; 3], a, 0.0), &angles, &[0.0, PI]);
    rule("lights[1].shape.spot.blend", |s, b| spot(s, [1.0; 3], 1.0, b), &[-0.1, 1.1, NAN], &[0.0, 1.0]);
    rule("lights[1].shape.spot.direction", |s, d| spot(s, d, 1.0, 0.0), &[[0.0; 3]], &[[0.0, 1e-9, 0.0]]);
    let area = |s: &mut Scene, m: DMat3, size: [f64; 2], spread_rad: f64| {
        let world_from_light = DAffine3::from_mat3(m);
        s.lights[2].shape =
            LightShape::Area { world_from_light, outline: Outline::Rectangle, size, spread_rad };
    };
    let one = DMat3::IDENTITY;
    let sheared = DMat3::from_cols(DVec3::X, DVec3::new(0.6, 1.0, 0.0), DVec3::Z);
    let leaning = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(0.0, 2e-4, 1.0));
    let turned = DMat3::from_rotation_x(0.7) * DMat3::from_diagonal(DVec3::new(1e-3, -2.0, 30.0));
    rule(
        "lights[2].shape.area.world_from_light",
        |s, m| area(s, m, [1.0; 2], PI),
        &[DMat3::ZERO, sheared, leaning],
        &[one, turned],
    );
    for i in 0..2 {
        let sized = |s: &mut Scene, v: f64| {
            let mut size = [1.0; 2];
            size[i] = v;
            area(s, one, size, PI);
        };
        let field = format!("lights[2].shape.area.size[{i}]");
        rule(&field, sized, &[0.0, -1.0, f64::NAN, f64::INFINITY], &[1e-9, 1e6]);
    }
    // So much power from so small a lamp that its radiance overflows f32.
    let bright = |s: &mut Scene, power_w: f32| {
        area(s, one, [1e-12; 2], PI);
        s.lights[2].power_w = power_w;
    };
    rule("lights[2].power_w", bright, &[1e20, f32::MAX], &[1e10]);
    let ball = |s: &mut Scene, radius: f64| {
        point(s, [0.0; 3], radius);
        s.lights[0].power_w = 1e12;
    };
    rule("lights[0].power_w", ball, &[1e-14], &[1e-16, 1e-12]);
    let far = |s: &mut Scene, x: f64| {
        area(s, one, [1.0; 2], PI);
        let LightShape::Area { world_from_light, .. } = &mut s.lights[2].shape else { unreachable!() };
        world_from_light.translation.x = x;
    };
    rule("lights[2].shape.area.world_from_light", far, &[1e39, -1e300], &[1e18]);
    let long = |s: &mut Scene, scale: f64| area(s, one * scale, [2.0; 2], PI);
    rule("lights[2].shape.area.size[0]", long, &[1e18, 1e90], &[1e-6, 1e17]);
    rule("lights[2].shape.area.spread_rad", |s, a| area(s, one, [1.0; 2], a), &angles, &[0.0, PI]);
}

#[test]
fn camera() {
    rule(
        "camera.projection.perspective.fov_rad",
        |s, fov_rad| s.camera.projection = Projection::Perspective { fov_rad },
        &[0.0, -1.0, PI, 4.0, f64::NAN, f64::INFINITY],
        &[1e-6, PI.next_down()],
    );
    rule(
        "camera.projection.orthographic.scale",
        |s, scale| s.camera.projection = Projection::Orthographic { scale },
        &[0.0, -1.0, f64::NAN, f64::INFINITY],
        &[1e-9, 1e9],
    );
    for i in 0..2 {
        let infinite = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        rule(&format!("camera.shift[{i}]"), |s, v| s.camera.shift[i] = v, &infinite, &[-3.0]);
    }
    rule(
        "camera.clip",
        |s, clip| s.camera.clip = clip,
        &[[1.0, 1.0], [2.0, 1.0], [-1.0, 1.0], [f64::NAN, 1.0], [0.0, f64::NAN], [0.0, f64::INFINITY]],
        &[[0.0, f64::MAX], [1.0, 1.0f64.next_up()]],
    );
}

#[test]
fn film() {
    rule("film.width", |s, v| s.film.width = v, &[0, 65_537, u32::MAX], &[1, 16_384]);
    rule("film.height", |s, v| s.film.height = v, &[0, 65_537, u32::MAX], &[1, 65_536]);
    rule(
        "film.width",
        |s, [w, h]: [u32; 2]| (s.film.width, s.film.height) = (w, h),
        &[[32_768, 32_769], [65_536, 65_536]],
        &[[32_768, 32_768], [65_536, 16_384]],
    );
    for i in 0..3 {
        rule(
            &format!("film.background[{i}]"),
            |s, v| s.film.background.as_mut().unwrap()[i] = v,
            &[-0.1, 1.0f32.next_up(), NAN, INF],
            &[0.0, 1.0],
        );
    }
    rule("film.background", |s, v| s.film.transparent = v, &[false], &[true]);
    let (bad, fine) = ([0.0, -1.0, 16.0f32.next_up(), NAN, INF], [0.1, 16.0]);
    rule("film.filter.box.width", |s, width| s.film.filter = Filter::Box { width }, &bad, &fine);
    rule(
        "film.shadow_fade",
        |s, v| s.film.shadow_fade = v,
        &[-0.1, 0.5f64.next_up(), f64::NAN, f64::INFINITY],
        &[0.0, 0.5],
    );
    rule(
        "film.cryptomatte_ranks",
        |s, ranks| s.film.cryptomatte_ranks = ranks,
        &[0, 1, 5, 17, 18, u32::MAX],
        &[2, 6, 16],
    );
    rule(
        "film.filter.blackman_harris.width",
        |s, width| s.film.filter = Filter::BlackmanHarris { width },
        &bad,
        &fine,
    );
}

#[test]
fn world() {
    let bad = [-1.0, NAN, INF];
    for i in 0..3 {
        rule(
            &format!("world.environment.constant.radiance[{i}]"),
            |s, v| {
                let mut radiance = [1.0; 3];
                radiance[i] = v;
                s.world.environment = Environment::Constant { radiance };
            },
            &bad,
            &[0.0, 1e6],
        );
        for end in 0..2 {
            rule(
                &format!("world.backdrop[{end}][{i}]"),
                |s, v| s.world.backdrop.as_mut().unwrap()[end][i] = v,
                &bad,
                &[0.0, 2.0],
            );
        }
    }
    let image =
        |path: &str, rotation_rad, strength| Environment::Image { path: path.into(), rotation_rad, strength };
    assert_eq!(fault(|s| s.world.environment = image("", 0.0, 1.0)), "world.environment.image.path");
    rule(
        "world.environment.image.rotation_rad",
        |s, v| s.world.environment = image("a.exr", v, 1.0),
        &[f64::NAN, f64::INFINITY],
        &[100.0],
    );
    rule(
        "world.environment.image.strength",
        |s, v| s.world.environment = image("a.exr", 0.0, v),
        &bad,
        &[0.0, 10.0],
    );
}

#[test]
fn suns() {
    rule(
        "suns[1].direction",
        |s, v| s.suns[1].direction = v,
        &[[0.0; 3], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0], [1e-200, 0.0, 0.0], [1e200, 0.0, 0.0]],
        &[[0.0, 0.0, 1e-100], [1e100, 0.0, 0.0]],
    );
    rule("suns[0].strength", |s, v| s.suns[0].strength = v, &[-1.0, NAN, INF], &[0.0, 1e6]);
    for i in 0..3 {
        rule(&format!("suns[0].color[{i}]"), |s, v| s.suns[0].color[i] = v, &[-1.0, NAN, INF], &[0.0, 4.0]);
    }
    // The last two are angles in range whose cone would need more radiance than an f32 holds.
    rule(
        "suns[0].angle_rad",
        |s, v| s.suns[0].angle_rad = v,
        &[-0.1, PI.next_up(), f64::NAN, f64::INFINITY, 1e-20, f64::MIN_POSITIVE],
        &[0.0, PI, 0.0093],
    );
}

#[test]
fn settings() {
    rule("settings.bounces", |s, v| s.settings.bounces = v, &[(1 << 20) + 1, u32::MAX], &[0, 1 << 20]);
    rule(
        "settings.ao_distance",
        |s, v| s.settings.ao_distance = v,
        &[0.0, -1.0, f64::NAN, f64::INFINITY],
        &[1e-9, f64::MAX],
    );
    rule(
        "settings.lod.distance.pixels",
        |s, pixels| s.settings.lod = Lod::Distance { pixels },
        &[0.0, -1.0, NAN, INF],
        &[0.5, 100.0],
    );
    rule("settings.clamp_direct", |s, v| s.settings.clamp_direct = v, &[-1.0, NAN, INF], &[0.0, 10.0]);
    rule("settings.clamp_indirect", |s, v| s.settings.clamp_indirect = v, &[-1.0, NAN, INF], &[0.0, 10.0]);
    let adaptive = |s: &mut Scene, threshold, min_spp| {
        s.settings.adaptive = Some(Adaptive { threshold, min_spp });
    };
    rule("settings.adaptive.threshold", |s, v| adaptive(s, v, 4), &[0.0, -1.0, NAN, INF], &[1e-3, 1.0]);
    rule("settings.adaptive.min_spp", |s, v| adaptive(s, 0.1, v), &[0, 3], &[4, 4096]);
}

#[test]
fn a_scene_of_another_version_is_not_valid() {
    let mut scene = full_scene();
    scene.version = SCENE_VERSION + 1;
    assert!(
        matches!(scene.validate(), Err(SceneError::Version { got, .. }) if got == u64::from(SCENE_VERSION) + 1)
    );
}

//! Lamps in whole pictures: light sampling and BSDF sampling find the same light, and objects in front of a lamp occlude it.

#![allow(clippy::expect_used, clippy::panic, reason = "tests")]

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use pumice_core::{Job, LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_cpu::{PathTracer, Surroundings};
use pumice_picture::Image;
use pumice_scene::{
    Camera, Film, Filter, Light, LightShape, Material, Mode, Outline, Projection, Settings, Sun,
};
use pumice_transport::geometry::LodChoice;
use pumice_transport::{EnvironmentTable, LightStrategy, Lights, MaterialTable, ReadyLamp, ReadySun, Sky};

/// A floor of 16 × 16 voxels up to z = 2, a wall at x = 8 up to z = 10.
fn tracer() -> SceneTracer {
    let labels = (0..16 * 16 * 10).map(|i| u8::from(i / 256 < 2 || i % 16 == 8)).collect();
    let info = VolumeInfo::new([16, 16, 10], LabelType::U8);
    let volume = Arc::new(compress_labels(info, LabelBuffer::U8(labels)).expect("a volume"));
    let visible = vec![true; volume.labels().len()];
    let instance =
        TracedInstance { volume, world_from_index: DAffine3::IDENTITY, visible, lod: LodChoice::Voxels };
    SceneTracer::new(&[instance]).expect("a tracer")
}

fn lamp(shape: LightShape) -> ReadyLamp {
    ReadyLamp::new(&Light { shape, power_w: 1000.0, color: [1.0, 0.8, 0.6], visible_to_camera: false })
}

/// Mean colour of the lit side of the floor (pixel columns left of the wall) and of the other side.
fn halves(lights: Lights, finding: LightStrategy, mode: Mode, seed: u64, samples: u32) -> [Vec3; 2] {
    let lights = lights.with_strategy(finding);
    let material = Material { base_color: [0.7; 3], specular: 0.3, roughness: 0.5, ..Material::default() };
    let around = Surroundings {
        lights: Arc::new(lights),
        materials: vec![Arc::new(MaterialTable::same(material))].into(),
        settings: Settings { mode, bounces: 3, seed, ..Settings::default() },
    };
    let above = DAffine3::from_mat3_translation(DMat3::IDENTITY, DVec3::new(8.5, 8.0, 60.0));
    let camera = Camera::new(above, Projection::Orthographic { scale: 13.0 });
    let film = Film::new(12, 12, Filter::Box { width: 1.0 });
    let mut picture = PathTracer::new(tracer(), around, &camera, &film).expect("memory for the film");
    picture.add_samples(samples, &Job::default()).expect("samples");
    let mean = picture.film().mean().expect("memory");
    let mut sums = [Vec3::ZERO; 2];
    for (i, p) in mean.pixels.iter().enumerate() {
        // The wall is in the middle of the picture.
        match i % 12 {
            0..5 => sums[0] += Vec3::from_array(*p),
            7..12 => sums[1] += Vec3::from_array(*p),
            _ => {}
        }
    }
    sums.map(|s| s / 60.0)
}

/// Lamps in the dark.
fn in_the_dark(lamps: Vec<ReadyLamp>) -> Lights {
    Lights::new(Sky::Constant(Vec3::ZERO), vec![], None).with_lamps(lamps)
}

/// A picture of the sky with a bright spot, a wide sun, a lamp of each kind, and one that hardly gives any light.
fn together(ball: LightShape, spot: LightShape) -> Lights {
    let mut image = Image::new(32, 16, vec![[0.5, 0.6, 0.8]; 512]);
    image.pixels[3 * 32 + 9] = [60.0, 50.0, 40.0];
    let sky = EnvironmentTable::new(image, 1.0, 0.3).expect("a sky");
    let sun = Sun { direction: [0.4, 0.3, -1.0], strength: 2.0, color: [1.0; 3], angle_rad: 0.3 };
    let far = LightShape::Point { position: [30.0, 40.0, 50.0], radius: 1.0, soft_falloff: false };
    let lamps = [ball, spot, area(Outline::Rectangle, std::f64::consts::PI), far].map(lamp).to_vec();
    Lights::new(Sky::Image(Arc::new(sky)), vec![ReadySun::new(&sun)], None).with_lamps(lamps)
}

/// Hundreds of lamps of every kind, so many that a tree chooses among them, beside a sun.
fn crowd() -> Lights {
    let sun = Sun { direction: [0.4, 0.3, -1.0], strength: 0.5, color: [1.0; 3], angle_rad: 0.3 };
    let lamps = (0..700u32).map(|i| {
        let at = |a: f64| (a * f64::from(i)).sin();
        let position = [8.0 + 14.0 * at(1.0), 8.0 + 14.0 * at(2.3), 13.0 + 3.0 * at(3.7)];
        let direction = [at(5.1), at(4.7), -0.5];
        let shape = match i % 4 {
            0 => LightShape::Point { position, radius: 0.8, soft_falloff: false },
            1 => LightShape::Spot {
                position,
                direction,
                radius: 0.8,
                angle_rad: 1.5,
                blend: 0.5,
                soft_falloff: false,
            },
            _ => LightShape::Area {
                world_from_light: DAffine3::from_rotation_translation(
                    glam::DQuat::from_rotation_x(3.0 * at(6.1)),
                    DVec3::from_array(position),
                ),
                outline: if i % 4 == 2 { Outline::Rectangle } else { Outline::Ellipse },
                size: [1.5, 1.0],
                spread_rad: 2.0,
            },
        };
        ReadyLamp::new(&Light { shape, power_w: 4.0, color: [1.0, 0.8, 0.6], visible_to_camera: false })
    });
    Lights::new(Sky::Constant(Vec3::ZERO), vec![ReadySun::new(&sun)], None).with_lamps(lamps.collect())
}

fn area(outline: Outline, spread_rad: f64) -> LightShape {
    let world_from_light = DAffine3::from_translation(DVec3::new(4.0, 8.0, 14.0));
    LightShape::Area { world_from_light, outline, size: [6.0, 5.0], spread_rad }
}

/// Light sampling, BSDF sampling and both: means of 24 seeds differ by less than four standard errors of their difference, for every lamp and for all
/// kinds of light together; light that is off by 2 % does not pass.
#[test]
fn three_ways_to_find_light_agree() {
    let ball = |soft_falloff| LightShape::Point { position: [4.0, 8.0, 12.0], radius: 3.0, soft_falloff };
    let spot = LightShape::Spot {
        position: [4.0, 8.0, 12.0],
        direction: [0.1, 0.0, -1.0],
        radius: 3.0,
        angle_rad: 1.2,
        blend: 0.5,
        soft_falloff: false,
    };
    let around = LightShape::Point { position: [8.0; 3], radius: 30.0, soft_falloff: false };
    let one = |shape| in_the_dark(vec![lamp(shape)]);
    let cases = [
        ("a ball", one(ball(false))),
        ("a soft ball", one(ball(true))),
        ("a ball around all", one(around)),
        ("a spot", one(spot)),
        ("a rectangle", one(area(Outline::Rectangle, std::f64::consts::PI))),
        ("a spread ellipse", one(area(Outline::Ellipse, 1.5))),
        ("sky, sun and lamps", together(ball(false), spot)),
        ("a crowd of lamps and a sun", crowd()),
    ];
    for (name, lights) in cases {
        let estimate = |finding| {
            let means: Vec<f64> = (0..24)
                .map(|seed| {
                    let [left, right] = halves(lights.clone(), finding, Mode::Path, seed, 32);
                    f64::from((left + right).element_sum())
                })
                .collect();
            let mean = means.iter().sum::<f64>() / 24.0;
            let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (24.0 * 23.0);
            (mean, variance)
        };
        let [both, aimed, scattered] =
            [LightStrategy::Mis, LightStrategy::LightsOnly, LightStrategy::BsdfOnly].map(estimate);
        for (what, other) in [("aimed", aimed), ("scattered", scattered)] {
            let apart = (both.0 - other.0).abs() / (both.1 + other.1).sqrt();
            assert!(apart < 4.0, "{name}: both {both:?}, {what} {other:?}: {apart} standard errors");
            // Negative control: an error of 2 %.
            let control = (1.02 * both.0 - other.0).abs() / (both.1 + other.1).sqrt();
            assert!(control > 4.0 || what == "scattered", "{name}: 2 % go unnoticed, {control}");
        }
    }
}

/// A beam from the left does not reach the floor behind the wall; in front of it, the floor matches the closed form.
#[test]
fn walls_hide_lamps() {
    let turn = DMat3::from_rotation_y(-1.2);
    let position = DVec3::new(8.0, 8.0, 2.0) + turn.z_axis * 25.0;
    let world_from_light = DAffine3::from_mat3_translation(turn, position);
    let shape = LightShape::Area {
        world_from_light,
        outline: Outline::Rectangle,
        size: [100.0, 100.0],
        spread_rad: 0.0,
    };
    let lights = in_the_dark(vec![lamp(shape)]);
    let [left, right] = halves(lights, LightStrategy::Mis, Mode::OneBounce, 1, 4);
    assert!(left.min_element() > 0.0 && right == Vec3::ZERO, "{left} {right}");
}

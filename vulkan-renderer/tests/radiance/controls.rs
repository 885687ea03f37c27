//! Negative controls of the comparison of samples: a device that is given a slightly different scene is found out. (Given the right scene
//! it is not: the same cases with as many samples are those of `samples_are_the_cpus`.)

use std::sync::Arc;

use pumice_scene::Mode;
use pumice_transport::Lights;

use crate::gpu::turns::some_of_today;
use crate::samples::{Verdict, asked, found};
use crate::scenes::{Case, cases, picture, sun};
use crate::{SPP, paths};

fn case_of(name: &str) -> Case {
    cases().into_iter().find(|c| c.name.contains(name)).expect("a scene")
}

fn with_settings(name: &str, change: impl Fn(&mut pumice_scene::Settings)) -> [Case; 2] {
    let case = case_of(name);
    let mut other = case.clone();
    change(&mut other.around.settings);
    [case, other]
}

fn with_material(name: &str, change: impl Fn(&mut pumice_scene::Material)) -> [Case; 2] {
    let case = case_of(name);
    let mut material = *case.around.materials[0].material(0);
    change(&mut material);
    let mut other = case.clone();
    other.around.materials = vec![Arc::new(pumice_transport::MaterialTable::same(material))].into();
    [case, other]
}

type Fault = (&'static str, fn() -> [Case; 2]);

/// What is done to a scene, and the scene before and after.
const FAULTS: [Fault; 9] = [
    ("the next seed", || with_settings("a picture", |s| s.seed += 1)),
    ("suns brighter by 2 %", || {
        let lit = case_of("a wide sun");
        let sky = lit.around.lights.sky().clone();
        let brighter = Lights::new(sky, vec![sun(0.6, 2.04), sun(0.0, 0.51)], None);
        [lit.clone(), lit.with_lights(brighter)]
    }),
    ("a sky brighter by 1/1000", || {
        let painted = case_of("a picture");
        [painted.clone(), painted.with_lights(Lights::new(picture(1.001), vec![], None))]
    }),
    ("a bounce more", || with_settings("12 bounces", |s| s.bounces = 13)),
    ("a bounce less", || with_settings("12 bounces", |s| s.bounces = 11)),
    ("no roulette", || with_settings("32 bounces", |s| s.russian_roulette = false)),
    ("another reach of occlusion", || with_settings("occlusion", |s| s.ao_distance = 12.0)),
    ("one bounce instead of two", || with_settings("an even sky", |s| s.mode = Mode::OneBounce)),
    ("an albedo lower by 1/1000", || with_material("an even sky", |m| m.base_color[1] *= 0.999)),
];

/// A third of the faults a day.
#[test]
fn other_questions_are_convicted() {
    let fronts = paths();
    let compute = fronts.last().expect("compute");
    for (what, made) in some_of_today(&FAULTS, 3) {
        let [case, other] = made();
        let found = found(&case, &asked(&case, SPP));
        let wrong = Verdict::of(&case, &found, &compute.radiances(&other, SPP));
        println!("{what}: {wrong}");
        assert!(wrong.fault().is_some(), "{what} goes unnoticed: {wrong}");
    }
}

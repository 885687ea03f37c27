//! The JSON form: numbers survive exactly both ways, parsing is strict, and every error is one line.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::full_scene;
use pumice_scene::{Environment, Scene, SceneError};
use serde_json::Value;

/// Steele, Lea and Flood 2014, "Fast splittable pseudorandom number generators", §4 (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// A field of one scene for every kind of number in the form: f64 by itself, in a matrix, in an array; f32 likewise.
fn numbers(s: &mut Scene) -> (Vec<&mut f64>, Vec<&mut f32>) {
    let Environment::Image { rotation_rad, strength, .. } = &mut s.world.environment else { unreachable!() };
    let camera = &mut s.camera;
    let m = &mut camera.world_from_camera;
    let mut doubles = vec![rotation_rad, &mut s.settings.ao_distance, &mut s.suns[0].angle_rad];
    doubles.extend([&mut m.matrix3.x_axis.y, &mut m.matrix3.z_axis.z, &mut m.translation.x]);
    doubles.extend(&mut camera.shift);
    doubles.extend(&mut camera.clip);
    let mut singles = vec![strength];
    for material in s.instances[0].style.materials.values_mut() {
        singles.extend([&mut material.roughness, &mut material.ior]);
        singles.extend(&mut material.emission);
    }
    (doubles, singles)
}

fn bits(s: &mut Scene) -> Vec<u64> {
    let (doubles, singles) = numbers(s);
    let doubles = doubles.into_iter().map(|v| v.to_bits());
    doubles.chain(singles.into_iter().map(|v| u64::from(v.to_bits()))).collect()
}

#[test]
fn a_scene_comes_back_as_it_was() {
    let scene = full_scene();
    let text = scene.to_json().unwrap();
    assert_eq!(Scene::from_json(&text).unwrap(), scene);
    assert_eq!(Scene::from_json(&text).unwrap().to_json().unwrap(), text);
}

#[test]
fn every_finite_number_comes_back_bit_for_bit() {
    const EXTREME: [f64; 10] = [
        0.0,
        -0.0,
        f64::MAX,
        f64::MIN,
        f64::MIN_POSITIVE,
        5e-324,
        2.225_073_858_507_201e-308,
        9007199254740993.0,
        0.1,
        1e23,
    ];
    const EXTREME_F32: [f32; 8] =
        [0.0, -0.0, f32::MAX, f32::MIN, f32::MIN_POSITIVE, 1e-45, 0.1, 16_777_217.0];
    let mut random = Random(1);
    let mut seen = 0;
    for round in 0..2000 {
        let mut scene = full_scene();
        let (doubles, singles) = numbers(&mut scene);
        for v in doubles {
            *v = match f64::from_bits(random.next()) {
                v if v.is_finite() && round > 20 => v,
                _ => EXTREME[random.below(EXTREME.len())],
            };
            seen += 1;
        }
        for v in singles {
            *v = match f32::from_bits(random.next() as u32) {
                v if v.is_finite() && round > 20 => v,
                _ => EXTREME_F32[random.below(EXTREME_F32.len())],
            };
            seen += 1;
        }
        // By serde alone: validation would refuse most of these values, and has its own tests.
        let text = serde_json::to_string(&scene).unwrap();
        let mut back: Scene = serde_json::from_str(&text).unwrap();
        assert_eq!(bits(&mut back), bits(&mut scene), "{text}");
    }
    assert_eq!(seen, 2000 * 21);
}

/// Negative control of the test above: a change of one unit in the last place of any number is detected.
#[test]
fn a_number_that_comes_back_one_off_is_noticed() {
    let original = bits(&mut full_scene());
    for i in 0..original.len() {
        let mut scene = full_scene();
        let (mut doubles, mut singles) = numbers(&mut scene);
        match doubles.get_mut(i) {
            Some(v) => **v = v.next_up(),
            None => *singles[i - doubles.len()] = singles[i - doubles.len()].next_up(),
        }
        assert_ne!(bits(&mut scene), original);
    }
}

#[test]
fn what_is_left_out_has_its_default_and_comes_back_exactly() {
    let least = r#"{"version": 1, "instances": [{"id": 1, "source": "a.pumice",
        "world_from_index": [1,0,0, 0,1,0, 0,0,1, 0,0,0]}],
        "camera": {"world_from_camera": [1,0,0, 0,1,0, 0,0,1, 0,0,9], "projection": {"perspective": {"fov_rad": 1}}},
        "film": {"width": 4, "height": 3, "filter": {"box": {"width": 1}}},
        "world": {"environment": {"constant": {"radiance": [1, 1, 1]}}}}"#;
    let scene = Scene::from_json(least).unwrap();
    assert_eq!(scene.camera.clip, [0.0, f64::MAX]);
    assert_eq!(scene.settings, pumice_scene::Settings::default());
    assert_eq!(scene.instances[0].style, pumice_scene::LabelStyle::default());
    assert!(scene.suns.is_empty() && scene.world.backdrop.is_none());
    let back = Scene::from_json(&scene.to_json().unwrap()).unwrap();
    assert_eq!(back, scene);
    assert_eq!(back.camera.clip[1].to_bits(), f64::MAX.to_bits());
    assert_eq!(back.settings.ao_distance.to_bits(), f64::MAX.to_bits());
}

#[test]
fn another_version_is_told_before_anything_else() {
    let text = r#"{"volumes": [], "version": 2, "fields of the future": true}"#;
    let error = Scene::from_json(text).unwrap_err();
    assert!(matches!(error, SceneError::Version { got: 2, expected: 1 }));
    assert_eq!(error.to_string(), "version: this program reads scenes of version 1, got 2");
}

/// JSON pointers to all objects within a value.
fn objects(value: &Value, at: &str, out: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            out.push(at.to_owned());
            map.iter().for_each(|(k, v)| objects(v, &format!("{at}/{k}"), out));
        }
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, v)| objects(v, &format!("{at}/{i}"), out));
        }
        _ => (),
    }
}

/// The path of the field `zzz` of an object, as messages have it.
fn path(pointer: &str) -> String {
    let mut path = String::new();
    for part in pointer.split('/').skip(1).chain(["zzz"]) {
        match part.parse::<usize>() {
            // Ids are names of fields.
            Ok(id) if path.ends_with("style.materials") => path += &format!(".{id}"),
            Ok(place) => path += &format!("[{place}]"),
            Err(_) if path.is_empty() => path += part,
            Err(_) => path += &format!(".{part}"),
        }
    }
    path
}

#[test]
fn an_unknown_field_is_refused_by_name_wherever_it_is() {
    let whole: Value = serde_json::from_str(&full_scene().to_json().unwrap()).unwrap();
    let mut places = Vec::new();
    objects(&whole, "", &mut places);
    assert!(places.len() > 20, "{places:?}");
    for place in places {
        let mut edited = whole.clone();
        edited.pointer_mut(&place).unwrap().as_object_mut().unwrap().insert("zzz".into(), 1.into());
        let error = Scene::from_json(&edited.to_string()).unwrap_err().to_string();
        // In place of an enum variant or an id, the parser says what it expected instead.
        let choice = ["show", "materials", "projection", "filter", "environment", "lod", "shape"];
        if !choice.iter().any(|c| place.ends_with(&format!("/{c}"))) {
            assert!(error.contains("unknown field `zzz`"), "{place}: {error}");
            assert!(error.starts_with(&format!("{}: line 1, column ", path(&place))), "{place}: {error}");
        }
        assert!(error.contains("line 1, column "), "{place}: {error}");
    }
}

#[test]
fn errors_are_one_line_of_bounded_length() {
    for name in ["a\\nb at line 7", "\\u2028", &"x".repeat(1 << 20)] {
        let error = Scene::from_json(&format!("{{\"version\": 1, \"{name}\": 0}}")).unwrap_err().to_string();
        assert!(!error.contains(|c: char| c.is_control() || c == '\u{2028}'), "{error:?}");
        assert!(error.contains("unknown field `") && error.len() < 2000, "{error}");
    }
    let error = Scene::from_json("{\"version\": 1, \"a at line 7\": 0}").unwrap_err().to_string();
    assert!(error.contains("unknown field `a at line 7`, expected one of `version`, "), "{error}");
}

#[test]
fn numbers_beyond_their_type_are_refused() {
    let text = full_scene().to_json().unwrap();
    let with = |from: &str, to: &str| {
        assert!(text.contains(from), "{from} is no part of {text}");
        Scene::from_json(&text.replacen(from, to, 1)).unwrap_err().to_string()
    };
    assert!(with("\"ior\": 1.33", "\"ior\": 1e39").contains("number out of range"));
    assert!(with("\"ior\": 1.33", "\"ior\": 1e999").contains("number out of range"));
    assert!(with("\"ior\": 1.33", "\"ior\": null").contains("invalid type: null"));
    assert!(with("\"width\": 640", "\"width\": 4294967296").contains("invalid value: integer `4294967296`"));
    assert!(with("\"width\": 640", "\"width\": -1").contains("invalid value: integer `-1`"));
    assert!(with("18446744073709551615", "18446744073709551616").contains("expected u64"));
}

#[test]
fn a_label_with_two_materials_is_refused() {
    let text = full_scene().to_json().unwrap();
    let twice = text.replacen("\"18446744073709551615\": {", "\"17\": {", 1);
    assert_ne!(twice, text);
    let error = Scene::from_json(&twice).unwrap_err().to_string();
    assert!(error.contains("materials: label 17 occurs twice"), "{error}");
}

#[test]
fn mutated_text_never_panics_and_what_is_accepted_is_valid() {
    let text = full_scene().to_json().unwrap().into_bytes();
    let pieces: [&[u8]; 12] =
        [b"-", b"1e999", b"null", b"{", b"]", b"\"", b"\\u0000", b",", b"9", b"0.", b"{\"only\":[0]}", b"\n"];
    let mut random = Random(2);
    let (mut accepted, mut refused) = (0, 0);
    for _ in 0..10_000 {
        let mut bytes = text.clone();
        for _ in 0..1 + random.below(3) {
            let mut at = random.below(bytes.len());
            match random.below(5) {
                0 => bytes[at] = random.next() as u8,
                1 => {
                    // A digit is replaced by another, so that the number changes but the JSON stays well formed.
                    at = (at..bytes.len()).find(|&i| bytes[i].is_ascii_digit()).unwrap_or(at);
                    bytes[at] = b'0' + random.below(10) as u8;
                }
                2 => drop(bytes.splice(at..at, pieces[random.below(pieces.len())].iter().copied())),
                3 => drop(bytes.drain(at..(at + random.below(40)).min(bytes.len()))),
                _ => {
                    let end = (at + random.below(200)).min(bytes.len());
                    let piece = bytes[at..end].to_vec();
                    let to = random.below(bytes.len());
                    bytes.splice(to..to, piece);
                }
            }
        }
        match Scene::from_json(&String::from_utf8_lossy(&bytes)) {
            Ok(scene) => {
                accepted += 1;
                let again = scene.to_json().expect("what was accepted is valid");
                assert_eq!(Scene::from_json(&again).unwrap(), scene);
            }
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().contains(char::is_control), "{error:?}");
            }
        }
    }
    // The inputs covered both cases: neither all accepted nor all refused.
    assert!(accepted > 500 && refused > 500, "{accepted} accepted, {refused} refused");
}

#[test]
fn nesting_does_not_exhaust_the_stack() {
    let text = format!("{{\"version\": 1, \"instances\": {}", "[".repeat(1 << 20));
    assert!(matches!(Scene::from_json(&text), Err(SceneError::Json { .. })));
}

/// Editors of Windows put a byte order mark before a text.
#[test]
fn a_byte_order_mark_is_skipped() {
    let scene = full_scene();
    let text = scene.to_json().unwrap();
    assert_eq!(Scene::from_json(&format!("\u{FEFF}{text}")).unwrap(), scene);
    assert!(Scene::from_json(&format!("\u{FEFF}\u{FEFF}{text}")).is_err());
}

#[test]
fn what_is_no_scene_or_no_number_is_told() {
    for text in ["[]", "null", "3", "\"a\""] {
        let line = Scene::from_json(text).unwrap_err().to_string();
        assert!(line.contains("expected an object with the fields of a scene"), "{line}");
        assert!(!line.contains("struct"), "{line}");
    }
    let good = full_scene().to_json().unwrap();
    let field = "\"shadow_fade\": ";
    let at = good.find(field).unwrap() + field.len();
    let end = at + good[at..].find([',', '\n']).unwrap();
    for word in ["NaN", "Infinity", "-Infinity"] {
        let line =
            Scene::from_json(&format!("{}{word}{}", &good[..at], &good[end..])).unwrap_err().to_string();
        assert!(line.contains(&format!("{word} is no number of JSON")), "{line}");
    }
    // A control: another word.
    let line = Scene::from_json(&format!("{}none{}", &good[..at], &good[end..])).unwrap_err().to_string();
    assert!(!line.contains("no number"), "{line}");
}

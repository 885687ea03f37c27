//! Runs what the fuzz target `carried_scene` runs (`fuzz/src/carried_scene.rs`) over some thousand changed seeds: scenes that pictures carry,
//! for `--again`, are read or refused, and nothing panics.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail by panicking")]

#[path = "../../fuzz/src/carried_scene.rs"]
#[allow(unreachable_pub, reason = "public in the fuzzer's crate")]
mod carried_scene;
#[path = "../../fuzz/src/carriers.rs"]
#[allow(unreachable_pub, reason = "public in the fuzzer's crate")]
mod carriers;

use carried_scene::{Outcome, outcome, seeds};
use pumice_scene::Scene;

/// Every part that a scene can have, so that changes reach all of it.
const SCENE: &str = r#"{
  "version": 1,
  "instances": [{
    "id": 7, "source": "a.pumice", "world_from_index": [1, 0, 0, 0, 0.1, 0, 0, 0, 1e-9, -4, 5, 6],
    "style": { "show": { "only": [1, 18446744073709551615] }, "auto_color": true, "materials": { "3": { "alpha": 0.5 } } }
  }],
  "camera": {
    "world_from_camera": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 10],
    "projection": { "perspective": { "fov_rad": 0.7 } },
    "aperture": { "radius": 0.1, "focus_distance": 9 }
  },
  "film": { "width": 5, "height": 4, "filter": { "blackman_harris": { "width": 3.0 } } },
  "world": { "environment": { "constant": { "radiance": [0.1, 0.2, 0.3] } } },
  "suns": [{ "direction": [0, 1, -1], "strength": 2, "angle_rad": 0.1 }],
  "lights": [{ "shape": { "point": { "position": [1, 2, 3], "radius": 0.5 } }, "power_w": 10 }],
  "meshes": [{ "id": 2, "source": "builtin:plane", "world_from_mesh": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], "materials": [{}] }],
  "cuts": [{ "shape": { "plane": { "point": [0, 0, 0], "normal": [1, 0, 0] } } }],
  "settings": { "seed": 1, "adaptive": { "threshold": 0.1, "min_spp": 4 } }
}"#;

/// Values that readers of numbers get wrong most easily, and pieces of syntax.
const PIECES: [&str; 18] = [
    "0",
    "-1",
    "-0.0",
    "1e309",
    "1e-320",
    "NaN",
    "4294967296",
    "18446744073709551616",
    "16777217",
    "null",
    "[]",
    "{}",
    "\"\"",
    "\\u0000",
    "\n",
    "[[",
    "}",
    "\"version\":2,",
];

/// Marsaglia's xorshift with 64 bits (2003).
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 16) as usize % end.max(1)
    }
}

/// A seed with one to four changes behind its first two bytes, which choose the carrier and repeat nothing.
fn changed(seed: &[u8], random: &mut Random) -> Vec<u8> {
    let mut text = seed[2..].to_vec();
    for _ in 0..1 + random.below(4) {
        let at = random.below(text.len());
        let end = text.len().min(at + 1 + random.below(24));
        match random.below(5) {
            0 => text[at] ^= 1 << random.below(8),
            1 => drop(text.drain(at..end)),
            2 => {
                let again = text[at..end].to_vec();
                drop(text.splice(at..at, again));
            }
            // A whole number or word in place of another: behind a colon or a comma, up to the next one.
            _ => {
                let is_border = |byte: &u8| b",:[]{}".contains(byte);
                let Some(from) = text[at..].iter().position(is_border).map(|n| at + n + 1) else { continue };
                let to = text[from..].iter().position(is_border).map_or(text.len(), |n| from + n);
                drop(text.splice(from..to, PIECES[random.below(PIECES.len())].bytes()));
            }
        }
        if text.is_empty() {
            break;
        }
    }
    [&[seed[0], 0][..], &text].concat()
}

#[test]
fn seeds_are_read_and_what_no_machine_can_draw_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let mut expected = Scene::from_json(SCENE).unwrap();
    // Relative paths start at the picture's folder.
    expected.instances[0].source = folder.path().join("a.pumice");
    for (number, seed) in seeds(SCENE).iter().enumerate() {
        match (number, outcome(&path, seed)) {
            (3..6, Outcome::Refused(line)) => assert!(line.starts_with("film: a picture of 65536"), "{line}"),
            (9, Outcome::Refused(line)) => assert!(line.contains("expected at most 67.1 MB"), "{line}"),
            (0..3 | 6..9, Outcome::Accepted(scene)) => assert_eq!(*scene, expected),
            (_, other) => panic!("seed {number}: {other:?}"),
        }
    }
}

#[test]
fn changed_seeds_are_read_or_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let seeds = seeds(SCENE);
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (mut counts, mut fields) = ([0; 4], std::collections::BTreeSet::new());
    for round in 0..3000 {
        // The one that is inflated to 105 MB is for the fuzzer.
        let input = changed(&seeds[round % (seeds.len() - 1)], &mut random);
        match outcome(&path, &input) {
            Outcome::NoPicture => counts[0] += 1,
            Outcome::NoScene => counts[1] += 1,
            Outcome::Accepted(_) => counts[3] += 1,
            Outcome::Refused(line) => {
                counts[2] += 1;
                let words = line.split(|c: char| !c.is_ascii_lowercase() && c != '_').map(str::to_owned);
                fields.extend(words.filter(|word| word.len() > 3));
            }
        }
    }
    println!("no picture, no scene, refused, accepted: {counts:?}");
    // Bars that show that the changes reach all stages: the carrier, the text, the scene's values, and beyond.
    assert!(counts[2] > 1000 && counts[3] > 50, "{counts:?}");
    for field in ["fov_rad", "world_from_index", "power_w", "strength", "width", "version", "radius"] {
        assert!(fields.contains(field), "no line names {field}: {fields:?}");
    }
}

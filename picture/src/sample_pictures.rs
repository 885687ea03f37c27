//! Pictures for the tests of the files.

use pumice_scene::Scene;

use crate::annotate::Corner;
use crate::cryptomatte::{Matte, hash, id_of_hash};
use crate::denoise::Denoiser;
use crate::{Annotations, Image, InstanceLabels, Pass, Picture, Provenance};

/// A provenance with every kind of value, with characters that neither ASCII nor Latin-1 has.
pub(crate) fn provenance() -> Provenance {
    let scene: Scene = serde_json::from_value(serde_json::json!({
        "version": 1,
        "instances": [{
            "id": 7, "source": "gehirn \u{df}\u{6f22}\u{1f9e0}\".pumice",
            "world_from_index": [1.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1e-9, -4.0, 5.0, 6.0],
            "style": { "show": { "only": [1, u64::MAX] }, "auto_color": true }
        }],
        "camera": {
            "world_from_camera": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 10.0],
            "projection": { "perspective": { "fov_rad": 0.7 } }
        },
        "film": { "width": 5, "height": 4, "filter": { "blackman_harris": { "width": 3.0 } } },
        "world": { "environment": { "constant": { "radiance": [0.1, 0.2, 0.3] } } },
        "settings": { "seed": u64::MAX }
    }))
    .unwrap();
    Provenance {
        version: "0.1.0".into(),
        backend: "cpu".into(),
        scene,
        volume_hashes: vec!["0123456789abcdef0123456789abcdef".into()],
        label_hashes: Vec::new(),
        mesh_hashes: Vec::new(),
        sky_hash: None,
        spp: 64,
        error_estimate: Some(0.012_345_678_901_234_5),
        denoised: Some(Denoiser::Statistical),
        annotations: Annotations {
            dpi: Some(300.0),
            scale_bar: "10um@center".parse().ok(),
            scale_bar_corner: Corner::UpperRight,
            legend: Some(12),
        },
    }
}

/// Four ranks of what no file may take for numbers to be rounded: ids are bits.
fn matte(pass: Pass, pixels: usize) -> Matte {
    let names = ["17", "gehirn \u{df}\u{6f22}\"\\", "membrane"].map(|n| (n.to_owned(), hash(n.as_bytes())));
    let id = |i: usize| id_of_hash(names[i % 3].1);
    let layer =
        |l: usize| (0..pixels).map(|i| [id(i + l), 0.7 / (1 + l) as f32, id(i + l + 1), 1e-3]).collect();
    Matte { pass, layers: (0..2).map(layer).collect(), names: names.into() }
}

/// Two instances; ids that no float holds, a name that neither ASCII nor Latin-1 has, one without types.
fn labels() -> Vec<InstanceLabels> {
    let (rows, ids) = (vec![1, 16_777_217], vec![3, u64::MAX]);
    let names = vec![String::new(), "gehirn \u{df}\u{6f22}\u{1f9e0}\"\\".into()];
    let types = vec!["axon".into(), String::new()];
    vec![
        InstanceLabels { instance: 0, rows: rows.clone(), ids: ids.clone(), names, types },
        InstanceLabels { instance: u32::MAX, rows, ids, ..InstanceLabels::default() },
    ]
}

/// A picture with every pass, each sample different, with values that only 32 bits hold.
pub(crate) fn picture(width: usize, height: usize) -> Picture {
    let pixels = width * height;
    let image = |salt: f32| {
        let pixel = |i: usize| [0.1, 0.2, 0.3].map(|c: f32| (c + i as f32 / 7.0) * salt);
        Image::new(width, height, (0..pixels).map(pixel).collect())
    };
    let mut picture = Picture {
        color: image(1.0),
        noisy: Some(image(2.0)),
        variance: Some(image(1e-9)),
        depth: Some((0..pixels).map(|i| if i % 3 == 0 { f32::INFINITY } else { i as f32 / 3.0 }).collect()),
        label: Some((0..pixels).map(|i| (i as u32).wrapping_mul(0x0100_0001)).collect()),
        instance: Some((0..pixels).map(|i| (i as u32).wrapping_mul(0x0100_0003)).collect()),
        labels: labels(),
        albedo: Some(image(0.5)),
        normal: Some(image(-0.25)),
        alpha: Some((0..pixels).map(|i| (i % 5) as f32 / 4.0).collect()),
        position: Some(image(-3.0)),
        samples: Some(vec![64.0; pixels]),
        light: Pass::LIGHT
            .iter()
            .chain(&[Pass::ShadowCatcher])
            .zip(1..)
            .map(|(pass, n)| (*pass, image(1.0 / n as f32)))
            .collect(),
        mattes: Pass::MATTES.iter().map(|&pass| matte(pass, pixels)).collect(),
        marks: Vec::new(),
        dpi: Some(300.0),
        provenance: Some(provenance()),
    };
    // 2²⁴ + 1 and 2³² − 1 are no floats.
    picture.label.as_mut().unwrap()[0] = 16_777_217;
    picture.label.as_mut().unwrap()[pixels - 1] = u32::MAX;
    picture.color.pixels[0] = [1e30, -1.0, f32::MIN_POSITIVE / 8.0];
    picture
}

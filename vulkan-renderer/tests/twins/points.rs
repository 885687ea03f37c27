//! Tests `sampler.glsl` and `filter.glsl`, bit for bit.

use pumice_scene::Filter;
use pumice_transport::FilterTable;
use pumice_transport::sampler::{BounceSet, PixelSampler};
use pumice_vulkan::layout;

use super::gpu::Gpu;
use super::words::{Random, Row};

const SETS: [BounceSet; 4] = [BounceSet::Light, BounceSet::Scatter, BounceSet::Survival, BounceSet::Emitter];

#[test]
fn sample_points_are_the_same() {
    let mut random = Random(12);
    let inputs: Vec<_> = (0..50_000)
        .map(|_| {
            let pixel = [random.below(1 << 17), random.below(1 << 17)];
            let most = 1 << random.below(20);
            let bounces = 2 << random.below(7);
            (random.next(), pixel, random.below(most), random.below(bounces), random.below(4))
        })
        .collect();
    let rows: Vec<_> = inputs
        .iter()
        .map(|&(seed, p, s, b, set)| {
            Row::default().long(seed).word(p[0]).word(p[1]).word(s).word(b).word(set).0
        })
        .collect();
    let out = Gpu::new().probe(false, 1, 0, &rows, 7);
    for (&(seed, p, s, b, set), row) in inputs.iter().zip(&out) {
        let points = PixelSampler::new(seed, p, s);
        let numbers = [&points.bounce(b, SETS[set as usize])[..], &points.film(), &points.lens()];
        assert_eq!(
            row,
            &numbers.concat().iter().map(|u| u.to_bits()).collect::<Vec<_>>(),
            "seed {seed}, pixel {p:?}, sample {s}, bounce {b}"
        );
    }
}

#[test]
fn filters_are_the_same() {
    let gpu = Gpu::new();
    for filter in [Filter::Box { width: 1.5 }, Filter::BlackmanHarris { width: 3.1 }] {
        let table = FilterTable::new(&filter);
        let levels = gpu.buffer_of(if table.inverse().is_empty() { &[0.0] } else { table.inverse() });
        let scene = gpu.buffer_of(&[layout::SceneHeader {
            filter: layout::Filter {
                inverse: levels.address,
                width: table.width(),
                steps: table.inverse().len().saturating_sub(1) as u32,
            },
            ..Default::default()
        }]);
        let mut random = Random(13);
        let mut inputs: Vec<f32> = (0..20_000).map(|_| random.unit()).collect();
        inputs.extend([0.0, 0.5, 0.499_999_97, 0.999_999_94, 1.0 / 2048.0]);
        let rows: Vec<_> = inputs.iter().map(|&u| Row::default().float(u).0).collect();
        let out = gpu.probe(false, 2, scene.address, &rows, 1);
        for (&u, row) in inputs.iter().zip(&out) {
            assert_eq!(f32::from_bits(row[0]), table.sample(u), "{filter:?} at {u}");
        }
    }
}

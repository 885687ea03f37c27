//! M rays per CPU-second through the traversal alone: primary rays of a camera that sees the whole volume, then one diffuse
//! bounce from each surface that was hit, then a shadow ray from there to a light far above.
//!
//! ```text
//! cargo run --release -p pumice-cpu --example ray_rate -- VOLUME.nrrd [share of labels shown, in per cent: 15] [side: 1024]
//! ```
//! One thread; time is the process' own CPU time (Linux: `/proc/self/stat`, in ticks of 10 ms).
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a measuring tool: it stops at the first fault"
)]

use std::io::{Read, Write};
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use pumice_core::{LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Tracer};

/// Seconds that this process has computed, in user and system mode.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    let fields: Vec<&str> = stat.rsplit(") ").next().unwrap().split(' ').collect();
    (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()) / 100.0
}

/// A gzipped u32 NRRD with sizes and diagonal space directions: what the measured volumes are, and no more.
fn read_nrrd(path: &str) -> ([u32; 3], DVec3, Vec<u32>) {
    let bytes = std::fs::read(path).expect("the volume");
    let end = bytes.windows(2).position(|w| w == b"\n\n").expect("a header");
    let header = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let field =
        |name: &str| header.lines().find_map(|l| l.strip_prefix(name)).unwrap_or("").trim().to_owned();
    assert_eq!((field("type:").as_str(), field("encoding:").as_str()), ("uint32", "gzip"));
    let numbers = |text: &str| -> Vec<f64> {
        text.split(|c: char| !c.is_ascii_digit() && c != '.').filter_map(|n| n.parse().ok()).collect()
    };
    let sizes = numbers(&field("sizes:"));
    let m = numbers(&field("space directions:"));
    let mut raw = Vec::new();
    flate2::read::GzDecoder::new(&bytes[end + 2..]).read_to_end(&mut raw).expect("labels");
    let labels = raw.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    ([sizes[0] as u32, sizes[1] as u32, sizes[2] as u32], DVec3::new(m[0], m[4], m[8]), labels)
}

/// 64 well-mixed bits of a counter (SplitMix64).
fn mix(i: u64) -> u64 {
    let z = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn unit(i: u64) -> f64 {
    (mix(i) >> 11) as f64 / (1u64 << 53) as f64
}

/// Cosine-distributed around `n`.
fn diffuse(n: DVec3, i: u64) -> DVec3 {
    let (z, phi) = (1.0 - 2.0 * unit(2 * i), std::f64::consts::TAU * unit(2 * i + 1));
    let r = (1.0 - z * z).sqrt();
    n + DVec3::new(r * phi.cos(), r * phi.sin(), z)
}

fn main() {
    let mut args = std::env::args().skip(1);
    let path = args.next().expect("VOLUME.nrrd");
    let percent: u64 = args.next().map_or(15, |a| a.parse().unwrap());
    let side: u64 = args.next().map_or(1024, |a| a.parse().unwrap());

    let (dims, spacing, labels) = read_nrrd(&path);
    let volume =
        Arc::new(compress_labels(VolumeInfo::new(dims, LabelType::U32), LabelBuffer::U32(labels)).unwrap());
    let visible = (0..volume.labels().len() as u64).map(|l| mix(l) % 100 < percent).collect();
    let begin = cpu_seconds();
    let scene = SceneTracer::new(&[TracedInstance {
        volume: Arc::clone(&volume),
        world_from_index: DAffine3::from_scale(spacing),
        visible,
        lod: LodChoice::Voxels,
    }])
    .unwrap();
    println!(
        "{} of {} boxes shown; hierarchy {:.2} MB, {:.1} B a shown box, built in {:.2} CPU-s",
        scene.instance(0).unwrap().boxes(),
        volume.boxes().len(),
        scene.bytes() as f64 / 1e6,
        scene.bytes() as f64 / scene.instance(0).unwrap().boxes() as f64,
        cpu_seconds() - begin
    );

    let size = spacing * DVec3::from(dims.map(f64::from));
    let centre = size / 2.0;
    let forward = DVec3::new(-1.0, -0.8, -0.6).normalize();
    let eye = centre - forward * size.length() * 1.2;
    let right = forward.cross(DVec3::Z).normalize();
    let up = right.cross(forward);
    // Tiles of 8² pixels, as a renderer goes.
    let primary: Vec<RayInWorld> = (0..side * side)
        .map(|i| {
            let (tile, inner) = (i / 64, i % 64);
            let (x, y) = (tile % (side / 8) * 8 + inner % 8, tile / (side / 8) * 8 + inner / 8);
            let s = |v: u64| ((v as f64 + 0.5) / side as f64 - 0.5) * 0.75;
            RayInWorld { origin: eye, direction: (forward + right * s(x) + up * s(y)).normalize() }
        })
        .collect();

    let report = |name: &str, rays: usize, hits: usize, begin: f64| {
        let seconds = cpu_seconds() - begin;
        println!(
            "{name:8} {rays:>8} rays {:>5.1} % hit {seconds:.2} CPU-s {:.3} M/s",
            100.0 * hits as f64 / rays as f64,
            rays as f64 / seconds / 1e6
        );
        std::io::stdout().flush().unwrap();
    };
    let begin = cpu_seconds();
    let hits: Vec<(RayInWorld, Hit)> = primary
        .iter()
        .filter_map(|r| Some((*r, scene.first_hit(r, PathOrigin::Free, f64::INFINITY)?)))
        .collect();
    report("primary", primary.len(), hits.len(), begin);

    let starts: Vec<(RayInWorld, PathOrigin)> = hits
        .iter()
        .enumerate()
        .map(|(i, (r, h))| {
            let origin = r.origin + h.t * r.direction;
            let direction = diffuse(h.normal_in_world, i as u64);
            (RayInWorld { origin, direction }, PathOrigin::Face(h.surface))
        })
        .collect();
    let begin = cpu_seconds();
    let n = starts.iter().filter(|(r, from)| scene.first_hit(r, *from, f64::INFINITY).is_some()).count();
    report("diffuse", starts.len(), n, begin);
    let begin = cpu_seconds();
    let n = starts.iter().filter(|(r, from)| scene.occluded(r, *from, f64::INFINITY)).count();
    report("occluded", starts.len(), n, begin);
}

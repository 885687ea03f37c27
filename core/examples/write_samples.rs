//! Writes small volumes as `.pumice` files at several levels, with their voxels beside them, as test data for decoders.
//!
//! `write_samples FOLDER` writes NAME.LEVEL.pumice, and NAME.ids: the dims (3 × u32), then one id per voxel (u64), x fastest,
//! little-endian.

use std::path::Path;

use pumice_core::{CompressionLevel, Job, LabelBuffer, LabelType, VolumeInfo, compress_labels};

/// A pseudorandom whole number from 0 to 2³² − 1 (the finaliser of MurmurHash3).
fn mix(voxel: [u32; 3], seed: u32) -> u32 {
    let mut h = voxel.iter().fold(seed, |h, &v| (h ^ v).wrapping_mul(0x9E37_79B1).rotate_left(13));
    h = (h ^ h >> 16).wrapping_mul(0x85EB_CA6B);
    h = (h ^ h >> 13).wrapping_mul(0xC2B2_AE35);
    h ^ h >> 16
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: write_samples FOLDER")?;
    let folder = Path::new(&folder);
    let extreme = [0, 1, (1 << 32) - 1, u64::MAX];
    write(folder, "empty", [5, 6, 7], |_| 0)?;
    write(folder, "voxel", [1, 1, 1], |_| u64::MAX)?;
    write(folder, "full", [33, 18, 40], |_| 12)?;
    write(folder, "noise", [33, 18, 40], |p| u64::from(mix(p, 1) & 1))?;
    write(folder, "extreme", [19, 34, 21], |p| extreme[mix(p, 2) as usize % 4])?;
    write(folder, "checkerboard", [19, 34, 21], |[x, y, z]| 1 + u64::from((x + y + z) % 2))?;
    write(folder, "different", [9, 10, 11], |[x, y, z]| u64::from(x + 9 * (y + 10 * z)) * 0x1_0000_0003)?;
    write(folder, "sheets", [50, 41, 30], |[x, y, z]| {
        u64::from(x % 7 == 3) + 2 * u64::from((y + z) % 11 == 5)
    })?;
    write(folder, "long", [3, 2, 2100], |[x, y, z]| u64::from((z / 5 + x + y) % 4))?;
    write(folder, "cells", [70, 50, 61], |p| {
        let q = p.map(|v| u64::from((v + mix(p, 3) % 2) / 13));
        if q[0] == 2 { 0 } else { 1 + q[0] + 100 * q[1] + 10_000_000_000 * q[2] }
    })?;
    // Two chunks: labels cross the face between them, and the second has other fields than the first.
    write(folder, "faces", [1060, 24, 8], |p| match p[0] {
        900..1024 => 1 + u64::from((p[0] + 1) / 37 + mix(p, 6) % 16 / 15),
        1024.. => 1 + u64::from((p[0] + p[1]) / 40 + mix(p, 7) % 2),
        _ => 0,
    })?;
    // Most slices repeat and a few fields have rare ones, so that leaf references of every class occur.
    write(folder, "speckled", [200, 96, 64], |p| {
        let d2: u32 = p.iter().map(|&v| (v % 32).abs_diff(16).pow(2)).sum();
        match mix(p, 4) % 2 {
            0 => 1 + u64::from(mix(p, 5) % 5),
            _ if d2 < 140 => 6 + u64::from(p[0] / 32),
            _ => 0,
        }
    })?;
    Ok(())
}

fn write(
    folder: &Path,
    name: &str,
    dims: [u32; 3],
    id: impl Fn([u32; 3]) -> u64,
) -> Result<(), Box<dyn std::error::Error>> {
    let [w, h, d] = dims;
    let ids: Vec<u64> =
        (0..d).flat_map(|z| (0..h).flat_map(move |y| (0..w).map(move |x| [x, y, z]))).map(id).collect();
    let bytes: Vec<u8> =
        dims.iter().flat_map(|v| v.to_le_bytes()).chain(ids.iter().flat_map(|v| v.to_le_bytes())).collect();
    std::fs::write(folder.join(format!("{name}.ids")), bytes)?;
    let volume = compress_labels(VolumeInfo::new(dims, LabelType::U64), LabelBuffer::U64(ids))?;
    let levels = [
        (CompressionLevel::Fast, "fast"),
        (CompressionLevel::Default, "default"),
        (CompressionLevel::Small, "small"),
    ];
    // The level `small` is left out for large volumes: a decoder in Python takes seconds to decode 10⁵ voxels one by one.
    let few = usize::from(dims.iter().product::<u32>() < 300_000);
    for &(level, word) in &levels[..2 + few] {
        volume.save(&folder.join(format!("{name}.{word}.pumice")), level, &Job::new())?;
    }
    Ok(())
}

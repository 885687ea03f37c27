//! Colours of a real volume: neurites of mouse cortex, each of which touches many others.

#![expect(clippy::unwrap_used, reason = "a test: what cannot be read must stop it")]

use std::collections::{HashMap, HashSet};
use std::io::Read;
use std::path::Path;

use pumice_transport::palette::{PALETTE_COLORS, assign_colors, least_delta_e, palette};

/// Labels and touching pairs of the shipped volume, found voxel by voxel; label 0 is background.
fn contacts() -> (usize, Vec<(u32, u32)>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/connectomics_32x32x40nm.nrrd");
    let file = std::fs::read(&path).unwrap();
    let end = file.windows(2).position(|w| w == b"\n\n").unwrap();
    let header = std::str::from_utf8(&file[..end]).unwrap();
    for line in ["type: uint32", "sizes: 256 256 512", "endian: little", "encoding: gzip"] {
        assert!(header.contains(line), "{header}");
    }
    let mut bytes = Vec::new();
    flate2::read::GzDecoder::new(&file[end + 2..]).read_to_end(&mut bytes).unwrap();
    let ids: Vec<u32> = bytes.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
    let size = [256usize, 256, 512];
    assert_eq!(ids.len(), size.iter().product::<usize>());

    let mut index_of = HashMap::new();
    let mut sorted: Vec<u32> =
        ids.iter().copied().filter(|&i| i != 0).collect::<HashSet<_>>().into_iter().collect();
    sorted.sort_unstable();
    index_of.extend(sorted.iter().enumerate().map(|(i, &id)| (id, i as u32)));
    let mut pairs = HashSet::new();
    let mut last = (0, 0);
    for (i, &a) in ids.iter().enumerate() {
        let at = [i % size[0], i / size[0] % size[1], i / size[0] / size[1]];
        for (axis, stride) in [1, size[0], size[0] * size[1]].into_iter().enumerate() {
            if at[axis] + 1 < size[axis] {
                let b = ids[i + stride];
                if a != b && a != 0 && b != 0 && last != (a, b) {
                    last = (a, b);
                    pairs.insert((a.min(b), a.max(b)));
                }
            }
        }
    }
    let mut pairs: Vec<_> = pairs.into_iter().map(|(a, b)| (index_of[&a], index_of[&b])).collect();
    pairs.sort_unstable();
    (sorted.len(), pairs)
}

/// Share of touching pairs less than ΔE 10 apart for normal, protanope or deuteranope eyes.
fn alike(colors: &[[f32; 3]], pairs: &[(u32, u32)]) -> f64 {
    let close = |p: &&(u32, u32)| least_delta_e(colors[p.0 as usize], colors[p.1 as usize]) < 10.0;
    pairs.iter().filter(close).count() as f64 / pairs.len() as f64
}

#[test]
fn touching_neurites_differ_for_every_eye() {
    let (labels, pairs) = contacts();
    let colors = assign_colors(labels, pairs.iter().copied(), None);
    let share = alike(&colors, &pairs);
    // Negative control: the same palette, assigned by a hash of the label.
    let dealt: Vec<[f32; 3]> = (0..labels as u32)
        .map(|i| palette()[(i.wrapping_mul(0x9E37_79B9) >> 8) as usize % PALETTE_COLORS])
        .collect();
    let share_dealt = alike(&dealt, &pairs);
    let mut degree = vec![0u32; labels];
    for l in pairs.iter().flat_map(|&(a, b)| [a, b]) {
        degree[l as usize] += 1;
    }
    println!(
        "{labels} labels, {} pairs, greatest degree {:?}; alike: {share}, dealt by hash: {share_dealt}",
        pairs.len(),
        degree.iter().max()
    );
    assert!(share <= 0.001, "{share} of {} pairs", pairs.len());
    assert!(share_dealt > 0.05, "{share_dealt}");
}

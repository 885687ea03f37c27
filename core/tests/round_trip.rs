//! Round trips: every voxel of random and extreme volumes is decoded as it was compressed, whatever blocks the volume is cut into.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use pumice_core::*;

/// A source that delivers given blocks.
struct Blocks {
    info: VolumeInfo,
    blocks: Vec<LabelBlock>,
}

impl BlockSource for Blocks {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }
    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        Ok(self.blocks.pop())
    }
}

/// Pseudorandom numbers that are the same on every machine (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }
}

/// A volume as an id for each voxel, x fastest.
#[derive(Clone)]
struct Volume {
    name: String,
    dims: [u32; 3],
    ids: Vec<u64>,
}

impl Volume {
    fn new(name: &str, dims: [u32; 3], mut id: impl FnMut([u32; 3]) -> u64) -> Self {
        let mut ids = Vec::new();
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    ids.push(id([x, y, z]));
                }
            }
        }
        Self { name: format!("{name} {dims:?}"), dims, ids }
    }

    fn at(&self, [x, y, z]: [u32; 3]) -> u64 {
        self.ids[x as usize + self.dims[0] as usize * (y as usize + self.dims[1] as usize * z as usize)]
    }

    fn info(&self) -> VolumeInfo {
        VolumeInfo::new(self.dims, LabelType::U64)
    }

    fn compress(&self) -> CompressedVolume {
        compress_labels(self.info(), LabelBuffer::U64(self.ids.clone())).unwrap()
    }

    /// Blocks of random sizes in random order. Each has a random axis order and the narrowest type that holds its labels.
    fn random_blocks(&self, random: &mut Random) -> Vec<LabelBlock> {
        let cuts: [Vec<u32>; 3] = [0, 1, 2].map(|a| {
            let mut cuts = vec![0];
            while *cuts.last().unwrap() < self.dims[a] {
                let step = 1 + random.below(u64::from(self.dims[a]).min(23)) as u32;
                cuts.push((cuts.last().unwrap() + step).min(self.dims[a]));
            }
            cuts
        });
        let mut blocks = Vec::new();
        for z in cuts[2].windows(2) {
            for y in cuts[1].windows(2) {
                for x in cuts[0].windows(2) {
                    let origin = [x[0], y[0], z[0]];
                    let dims = [x[1] - x[0], y[1] - y[0], z[1] - z[0]];
                    blocks.push(self.block(origin, dims, random));
                }
            }
        }
        for i in (1..blocks.len()).rev() {
            blocks.swap(i, random.below(i as u64 + 1) as usize);
        }
        blocks
    }

    fn block(&self, origin: [u32; 3], dims: [u32; 3], random: &mut Random) -> LabelBlock {
        let order =
            [[0, 1, 2], [2, 1, 0], [1, 0, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1]][random.below(6) as usize];
        let mut strides = [0; 3];
        let mut size = 1 + random.below(2) as usize;
        for a in order {
            strides[a] = size;
            size *= dims[a] as usize;
        }
        let mut labels = vec![0u64; size];
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    let at: usize = [x, y, z].iter().zip(strides).map(|(&p, s)| p as usize * s).sum();
                    labels[at] = self.at([origin[0] + x, origin[1] + y, origin[2] + z]);
                }
            }
        }
        let labels = match labels.iter().max().copied().unwrap_or(0) {
            0..256 => LabelBuffer::U8(labels.iter().map(|&l| l as u8).collect()),
            256..65_536 => LabelBuffer::U16(labels.iter().map(|&l| l as u16).collect()),
            65_536..4_294_967_296 => LabelBuffer::U32(labels.iter().map(|&l| l as u32).collect()),
            _ => LabelBuffer::U64(labels),
        };
        LabelBlock { origin, dims, strides, labels }
    }
}

/// Shapes that cover every border case of cells, boxes and chunks.
const SHAPES: [[u32; 3]; 9] = [
    [1, 1, 1],
    [4, 4, 4],
    [5, 3, 2],
    [16, 16, 16],
    [17, 31, 15],
    [37, 20, 33],
    [1, 1, 2100],
    [1050, 3, 5],
    [2, 1030, 2],
];

/// Contents each of which is difficult for a different reason.
fn contents(dims: [u32; 3], random: &mut Random) -> Vec<Volume> {
    let ids = [0, 1, (1 << 32) - 1, u64::MAX, 77];
    let centre = [0, 1, 2].map(|a| random.below(dims[a].into()) as i64);
    let mut n = 0;
    let seed = random.next();
    let mut noise = Random(seed);
    let mut many = Random(seed ^ 1);
    vec![
        Volume::new("empty", dims, |_| 0),
        Volume::new("one label", dims, |_| u64::MAX),
        Volume::new("all different", dims, |_| {
            n += 1;
            n * 0x1_0000_0001
        }),
        Volume::new("checkerboard", dims, |[x, y, z]| u64::from(x + y + z) % 2 * 9),
        Volume::new("two-colour checkerboard", dims, |[x, y, z]| 1 + u64::from(x + y + z) % 2),
        Volume::new("noise", dims, |_| noise.below(2)),
        Volume::new("noise of extreme ids", dims, |_| ids[many.below(5) as usize]),
        Volume::new("sheets", dims, |[x, y, z]| match (x % 7 == 3, y % 9 == 4, z % 5 == 2) {
            (true, _, _) => 1,
            (_, true, _) => 2,
            (_, _, true) => 3,
            _ => 0,
        }),
        Volume::new("ball in a shell", dims, |p| {
            let r: i64 = (0..3).map(|a| (i64::from(p[a]) - centre[a]).pow(2)).sum();
            if r < 30 {
                5
            } else if r < 120 {
                u64::from(u32::MAX)
            } else {
                0
            }
        }),
        Volume::new("cells", dims, |p| {
            // Jittered blobs: many labels that meet at ragged borders.
            let q = p.map(|v| (u64::from(v) + (u64::from(p[0] + 3 * p[1] + 5 * p[2]) * 7 % 3)) / 6);
            1 + q[0] + 1000 * q[1] + 1_000_000 * q[2]
        }),
    ]
}

fn all() -> Vec<Volume> {
    let mut random = Random(2);
    SHAPES.iter().flat_map(|&dims| contents(dims, &mut random)).collect()
}

/// All data of a volume; equal if and only if the bytes are equal.
fn state(v: &CompressedVolume) -> impl PartialEq + std::fmt::Debug {
    (
        v.chunks().to_vec(),
        v.runs().iter().map(|r| (r.label, r.first_box)).collect::<Vec<_>>(),
        v.boxes().to_vec(),
        v.nodes().to_vec(),
        v.leaves().to_vec(),
        v.labels().clone(),
    )
}

#[test]
fn every_voxel_comes_back() {
    for volume in all() {
        let compressed = volume.compress();
        assert_eq!(compressed.decode_ids([0; 3], volume.dims).unwrap(), volume.ids, "{}", volume.name);
        let mut source = ArraySource::new(volume.info(), LabelBuffer::U64(volume.ids.clone())).unwrap();
        assert_eq!(
            verify(&compressed, &mut source, &Job::new()).unwrap(),
            Verification::Same { voxels: volume.ids.len() as u64 }
        );
    }
}

#[test]
fn every_voxel_can_be_asked_for() {
    for volume in all() {
        let compressed = volume.compress();
        let mut i = 0;
        for z in 0..volume.dims[2] {
            for y in 0..volume.dims[1] {
                for x in 0..volume.dims[0] {
                    let got = compressed
                        .label_at([x, y, z])
                        .unwrap()
                        .map_or(0, |l| compressed.labels().ids()[l as usize]);
                    assert_eq!(got, volume.ids[i], "{} at {:?}", volume.name, [x, y, z]);
                    i += 1;
                }
            }
        }
        assert_eq!(compressed.label_at(volume.dims).unwrap(), None);
    }
}

#[test]
fn any_blocks_in_any_order_on_any_threads_give_the_same_bytes() {
    let mut random = Random(3);
    for volume in all() {
        let whole = volume.compress();
        for threads in [1, 2, 5] {
            let blocks = volume.random_blocks(&mut random);
            let mut source = Blocks { info: volume.info(), blocks };
            let cut = compress(&mut source, &CompressOptions { threads, ..Default::default() }, &Job::new())
                .unwrap();
            assert!(state(&whole) == state(&cut), "{} on {threads} threads", volume.name);
            assert_eq!(whole.content_hash(), cut.content_hash());
        }
    }
}

#[test]
fn spilling_changes_nothing_and_too_small_a_limit_names_what_is_needed() {
    let mut random = Random(7);
    for volume in all() {
        let whole = volume.compress();
        let with_limit = |limit, random: &mut Random| {
            let options =
                CompressOptions { threads: 2, memory_limit_bytes: Some(limit), ..Default::default() };
            let mut source = Blocks { info: volume.info(), blocks: volume.random_blocks(random) };
            compress(&mut source, &options, &Job::new())
        };
        let mut limit = 1;
        // The limit that an error gives is enough, except for the parts' own index, whose size depends on the limit.
        for round in 0.. {
            match with_limit(limit, &mut random) {
                Ok(spilled) => {
                    assert!(state(&whole) == state(&spilled), "{}", volume.name);
                    break;
                }
                Err(Error::Limit { got, limit: told, .. }) => {
                    assert!(told == limit && got > limit && round < 9, "{got} {limit}");
                    limit = got + got / 16;
                }
                Err(other) => panic!("{other}"),
            }
        }
    }
}

#[test]
fn parts_merge_in_any_grouping() {
    let mut random = Random(4);
    for volume in all() {
        let parts: Vec<SortedCells> = volume
            .random_blocks(&mut random)
            .iter()
            .map(|b| SortedCells::from_block(b, volume.dims).unwrap())
            .collect();
        let merge = |parts: &[SortedCells]| SortedCells::merge(parts).unwrap();
        let at_once = merge(&parts);
        let (left, right) = parts.split_at(parts.len() / 3);
        let grouped = merge(&[merge(right), merge(left)]);
        assert!(at_once == grouped, "{}", volume.name);
        assert!(at_once.is_disjoint(), "{}", volume.name);
    }
}

#[test]
fn a_changed_voxel_is_found() {
    let mut random = Random(5);
    for volume in all() {
        let compressed = volume.compress();
        let mut other = volume.clone();
        let at = random.below(other.ids.len() as u64) as usize;
        other.ids[at] ^= 1 << 40;
        let mut source = ArraySource::new(other.info(), LabelBuffer::U64(other.ids.clone())).unwrap();
        let [w, h, _] = volume.dims.map(|d| d as usize);
        let voxel = [at % w, at / w % h, at / w / h].map(|v| v as u32);
        assert_eq!(
            verify(&compressed, &mut source, &Job::new()).unwrap(),
            Verification::OtherLabel { voxel, expected: other.ids[at], got: volume.ids[at] }
        );
        assert_ne!(other.compress().content_hash(), compressed.content_hash());
    }
}

#[test]
fn boxes_keep_the_laws_of_snap4() {
    for volume in all() {
        let compressed = volume.compress();
        let mut owner = std::collections::HashSet::new();
        for i in 0..compressed.boxes().len() {
            let (b, label) = (compressed.get_box(i), compressed.label_of_box(i));
            for a in 0..3 {
                assert_eq!(b.origin[a] % 4, 0);
                assert!(matches!(b.extent[a], 4 | 8 | 12 | 16));
                assert!(b.origin[a] + b.extent[a] < volume.dims[a] + 4);
                assert_eq!(b.origin[a] / CHUNK_VOXELS, (b.origin[a] + b.extent[a] - 1) / CHUNK_VOXELS);
            }
            // Tight: the first and the last layer of cells along each axis have a voxel; nothing lies outside.
            let cells: Vec<[u32; 3]> =
                (0..64).filter(|c| b.node.field(*c) != 0).map(|c| [c & 3, c >> 2 & 3, c >> 4]).collect();
            for a in 0..3 {
                assert_eq!(cells.iter().map(|c| c[a]).min(), Some(0), "{}", volume.name);
                assert_eq!(cells.iter().map(|c| c[a]).max(), Some(b.extent[a] / 4 - 1), "{}", volume.name);
            }
            // Boxes of one label are disjoint: no cell of space is in two of them.
            for z in 0..b.extent[2] / 4 {
                for y in 0..b.extent[1] / 4 {
                    for x in 0..b.extent[0] / 4 {
                        let cell = [b.origin[0] / 4 + x, b.origin[1] / 4 + y, b.origin[2] / 4 + z];
                        assert!(owner.insert((label, cell)), "{}", volume.name);
                    }
                }
            }
        }
    }
}

/// A chunk's boxes, nodes and leaves are those of a volume that has the chunk's voxels alone.
#[test]
fn a_chunk_stands_alone() {
    let mut chunks = 0;
    for volume in all().into_iter().filter(|v| v.dims.iter().any(|&d| d > CHUNK_VOXELS)) {
        let compressed = volume.compress();
        for (c, chunk) in compressed.chunks().iter().enumerate() {
            let dims = [0, 1, 2].map(|a| (volume.dims[a] - chunk.origin[a]).min(CHUNK_VOXELS));
            let at = |p: [u32; 3]| volume.at([0, 1, 2].map(|a| chunk.origin[a] + p[a]));
            let alone = Volume::new("chunk", dims, at).compress();
            let next = compressed.chunks().get(c + 1);
            let last_box = next.map_or(compressed.boxes().len(), |n| n.first_box as usize);
            let last_word = next.map_or(compressed.nodes().len(), |n| n.node_base as usize);
            assert_eq!(
                alone.boxes(),
                &compressed.boxes()[chunk.first_box as usize..last_box],
                "{}",
                volume.name
            );
            assert_eq!(alone.nodes(), &compressed.nodes()[chunk.node_base as usize..last_word]);
            assert_eq!(alone.leaves(), &compressed.leaves()[c..=c]);
            chunks += 1;
        }
    }
    assert!(chunks > 10, "{chunks}");
}

#[test]
fn voxels_are_counted() {
    for volume in all() {
        let compressed = volume.compress();
        let mut counts = std::collections::BTreeMap::new();
        for &id in volume.ids.iter().filter(|&&id| id != 0) {
            *counts.entry(id).or_insert(0u64) += 1;
        }
        let (ids, voxels): (Vec<u64>, Vec<u64>) = counts.into_iter().unzip();
        assert_eq!((compressed.labels().ids(), compressed.labels().voxels()), (&ids[..], &voxels[..]));
    }
}

/// Contacts and bounds voxel by voxel, from their definitions.
#[test]
fn contacts_and_bounds_match_naive() {
    for volume in all() {
        let compressed = volume.compress();
        let index = |id| compressed.labels().index_of(id);
        let mut contacts = std::collections::BTreeSet::new();
        let mut bounds = vec![([u32::MAX; 3], [0; 3]); compressed.labels().len()];
        for z in 0..volume.dims[2] {
            for y in 0..volume.dims[1] {
                for x in 0..volume.dims[0] {
                    let Some(here) = index(volume.at([x, y, z])) else { continue };
                    for a in 0..3 {
                        let mut p = [x, y, z];
                        bounds[here as usize].0[a] = p[a].min(bounds[here as usize].0[a]);
                        bounds[here as usize].1[a] = p[a].max(bounds[here as usize].1[a]);
                        p[a] += 1;
                        if p[a] < volume.dims[a]
                            && let Some(there) = index(volume.at(p))
                            && there != here
                        {
                            contacts.insert((here.min(there), here.max(there)));
                        }
                    }
                }
            }
        }
        let got: Vec<(u32, u32)> = compressed.labels().contacts().iter().collect();
        assert_eq!(got, contacts.into_iter().collect::<Vec<_>>(), "{}", volume.name);
        assert_eq!(got.len() as u64, compressed.labels().contacts().len());
        let got: Vec<_> = compressed.label_bounds().iter().map(|b| (b.low, b.high)).collect();
        assert_eq!(got, bounds, "{}", volume.name);
    }
}

#[test]
fn cancelled_and_incomplete_sources_fail() {
    let volume = Volume::new("noise", [40, 40, 40], |p| u64::from(p[0] ^ p[1] ^ p[2]));
    let job = Job::new();
    job.cancel();
    let mut source = ArraySource::new(volume.info(), LabelBuffer::U64(volume.ids.clone())).unwrap();
    assert!(matches!(compress(&mut source, &CompressOptions::default(), &job), Err(Error::Cancelled)));

    let mut blocks = volume.random_blocks(&mut Random(6));
    blocks.pop();
    let mut source = Blocks { info: volume.info(), blocks };
    let error = compress(&mut source, &CompressOptions::default(), &Job::new()).unwrap_err();
    assert!(error.to_string().contains("expected 64000 voxels"), "{error}");

    // The blocks have as many voxels as the volume, but two of them are at the same position, so that one position is missed.
    let one = |x: u32, id: u8| LabelBlock::x_fastest([x, 0, 0], [1, 1, 1], LabelBuffer::U8(vec![id]));
    for (other, what) in
        [(2, "two labels claim one voxel"), (1, "they delivered 2 labelled voxels and cover only 1")]
    {
        let info = VolumeInfo::new([2, 1, 1], LabelType::U8);
        let mut source = Blocks { info, blocks: vec![one(0, 1), one(0, other)] };
        let error = compress(&mut source, &CompressOptions::default(), &Job::new()).unwrap_err();
        assert!(error.to_string().contains(what), "{error}");
    }
}

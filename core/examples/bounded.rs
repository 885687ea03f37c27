//! Compresses a volume that is made on the fly, or a raw one, under a limit of memory, and prints what that took. On Linux.
//!
//! `bounded X Y Z LIMIT_BYTES LEVEL OUT.pumice [RAW_FILE HEADER_BYTES]`: voxels of the file (u32, x fastest, after a header), or made ones:
//! some thousand labels, each of many pieces of 20³ voxels with wavy borders, in three quarters of the volume.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::time::Instant;

use pumice_core::{
    BlockSource, CompressOptions, CompressedVolume, CompressionLevel, Error, Job, LabelBlock, LabelBuffer,
    LabelType, Result, VolumeInfo, compress_to_file,
};

/// Slices in a block: whole cells.
const SLICES: u32 = 4;

struct Source {
    info: VolumeInfo,
    raw: Option<File>,
    /// Lowest voxel of the next block.
    next: [u32; 3],
    /// Displacement of the borders of cells, in voxels, by position along another axis.
    waves: Vec<u32>,
}

impl Source {
    /// Size of the blocks: slabs of a file, and bricks of generated voxels in the order of chunks.
    fn block(&self) -> [u32; 3] {
        let [w, h, _] = self.info.dims;
        if self.raw.is_some() { [w, h, SLICES] } else { [w.min(1024), h.min(64), 16] }
    }

    fn label(&self, [x, y, z]: [u32; 3]) -> u32 {
        // Pieces of 20³ voxels with wavy borders; every fourth group of cells is background, and ids repeat.
        let wave = |v: u32| self.waves[(v % 256) as usize];
        let q = [(x + wave(y + z)) / 20, (y + wave(z + 77 + x / 2)) / 20, (z + wave(x + 150 + y / 2)) / 20];
        let group = (q[0] / 3 + q[1] / 2 + q[2] / 3) % 4;
        if group == 0 { 0 } else { 1 + (q[0] / 2 + 7 * (q[1] / 3) + 53 * (q[2] / 2) + 11 * group) % 5_000 }
    }
}

impl BlockSource for Source {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        let (volume, size, origin) = (self.info.dims, self.block(), self.next);
        if origin[2] >= volume[2] {
            return Ok(None);
        }
        let dims = [0, 1, 2].map(|a| size[a].min(volume[a] - origin[a]));
        let mut labels = vec![0u32; dims.iter().product::<u32>() as usize];
        match &mut self.raw {
            Some(file) => {
                let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut labels);
                file.read_exact(bytes).map_err(|e| Error::Source(e.into()))?;
            }
            None => {
                for (i, label) in (0u32..).zip(&mut labels) {
                    let p = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
                    *label = self.label([0, 1, 2].map(|a| origin[a] + p[a]));
                }
            }
        }
        // x first, then y, then z.
        for a in 0..3 {
            self.next[a] += size[a];
            if self.next[a] < volume[a] || a == 2 {
                break;
            }
            self.next[a] = 0;
        }
        Ok(Some(LabelBlock::x_fastest(origin, dims, LabelBuffer::U32(labels))))
    }
}

/// A line of `/proc/self/status`, in MiB; 0 elsewhere than on Linux.
fn peak_mib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse::<u64>().ok()).unwrap_or(0) / 1024
}

/// CPU seconds of the process so far, in ticks of a hundredth; 0 elsewhere than on Linux.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |i: usize| fields.get(i).and_then(|f| f.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / 100.0
}

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize| -> std::result::Result<u64, Box<dyn std::error::Error>> {
        Ok(args.get(i).ok_or("usage: bounded X Y Z LIMIT_BYTES LEVEL OUT [RAW HEADER_BYTES]")?.parse()?)
    };
    let dims = [number(0)? as u32, number(1)? as u32, number(2)? as u32];
    let limit = Some(number(3)?).filter(|&limit| limit > 0);
    let level = match args.get(4).map(String::as_str) {
        Some("fast") => CompressionLevel::Fast,
        Some("small") => CompressionLevel::Small,
        _ => CompressionLevel::Default,
    };
    let out = args.get(5).ok_or("no output")?;
    let raw = match args.get(6) {
        Some(path) => {
            let mut file = File::open(path)?;
            file.seek(SeekFrom::Start(number(7)?))?;
            Some(file)
        }
        None => None,
    };
    let waves =
        (0..256).map(|i| (6.0 + 5.0 * (f64::from(i) * std::f64::consts::TAU / 64.0).sin()) as u32).collect();
    let mut source = Source { info: VolumeInfo::new(dims, LabelType::U32), raw, next: [0; 3], waves };
    // What making the voxels alone costs, on a part of them.
    let (start, mut made) = (cpu_seconds(), 0u64);
    if source.raw.is_none() {
        while made < 1 << 27 {
            let Some(block) = source.next_block()? else { break };
            made += block.labels.len() as u64;
        }
        source.next = [0; 3];
    }
    let making = (cpu_seconds() - start) / made.max(1) as f64;
    let options = CompressOptions { memory_limit_bytes: limit, ..CompressOptions::default() };
    let (clock, start) = (Instant::now(), cpu_seconds());
    let mut describe = |_: &mut CompressedVolume| Ok(());
    let told = compress_to_file(&mut source, Path::new(out), level, &options, &mut describe, &Job::new())?;
    let voxels = dims.iter().map(|&d| f64::from(d)).product::<f64>();
    let cpu = cpu_seconds() - start - making * voxels;
    println!(
        "{dims:?} limit {limit:?}: {} labels, {} boxes, {} B on disk, {:.1} s, {cpu:.1} CPU s without making voxels ({:.2} ns a voxel), peak {} MiB",
        told.labels,
        told.boxes,
        told.bytes_disk,
        clock.elapsed().as_secs_f64(),
        1e9 * cpu / voxels,
        peak_mib(),
    );
    Ok(())
}

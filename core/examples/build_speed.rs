//! How fast labels in memory become a compressed volume, on one thread, in MVoxel per CPU-second; and how small, in memory and
//! on disk.
//!
//! `build_speed RAW X Y Z`: RAW holds X·Y·Z little-endian u32 labels, x fastest, no header.

use std::time::Instant;

use pumice_core::{CompressOptions, Job, LabelBlock, LabelBuffer, LabelType, Part, VolumeInfo};

/// CPU seconds (user and system) of this process so far, from the kernel's accounting in ticks of 10 ms.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks: u64 =
        after_name.split_whitespace().skip(11).take(2).filter_map(|t| t.parse::<u64>().ok()).sum();
    ticks as f64 / 100.0
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, path, x, y, z] = arguments.as_slice() else { return Err("usage: build_speed RAW X Y Z".into()) };
    let dims: [u32; 3] = [x.parse()?, y.parse()?, z.parse()?];
    let bytes = std::fs::read(path)?;
    let labels: Vec<u32> = bytes.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b)).collect();
    drop(bytes);
    let mvoxels = labels.len() as f64 / 1e6;
    let block = LabelBlock::x_fastest([0; 3], dims, LabelBuffer::U32(labels));

    let (start, wall) = (cpu_seconds(), Instant::now());
    let rounds = 3;
    let mut records = 0;
    for _ in 0..rounds {
        records = Part::from_block(&block, dims)?.len();
    }
    let seconds = (cpu_seconds() - start) / f64::from(rounds);
    println!(
        "parts   {:7.1} MVoxel/CPU-s  {seconds:.3} CPU-s  {records} records  (wall {:.3} s)",
        mvoxels / seconds,
        wall.elapsed().as_secs_f64() / f64::from(rounds)
    );

    let info = VolumeInfo::new(dims, LabelType::U32);
    let mut source = pumice_core::ArraySource::new(info, block.labels)?;
    let start = cpu_seconds();
    let options = CompressOptions { threads: 1, ..Default::default() };
    let volume = pumice_core::compress(&mut source, &options, &Job::new())?;
    let whole = cpu_seconds() - start;
    let mut walls = [f64::INFINITY; 2];
    for round in 0..6 {
        let threads = 1 + round % 2;
        source = source.rewound();
        let wall = Instant::now();
        let options = CompressOptions { threads, ..Default::default() };
        pumice_core::compress(&mut source, &options, &Job::new())?;
        walls[threads - 1] = walls[threads - 1].min(wall.elapsed().as_secs_f64());
    }
    let [one, two] = walls;
    println!("threads: one {one:.3} s, two {two:.3} s of wall, {:.2} times as fast", one / two);
    let start = cpu_seconds();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let contacts = pool.install(|| volume.find_contacts(&Job::new()))?;
    let contacts_seconds = cpu_seconds() - start;
    println!("contacts {contacts_seconds:.3} CPU-s, {} pairs", contacts.len());
    println!(
        "finish   {:.3} CPU-s (whole compression {whole:.3} less parts, contacts)",
        whole - seconds - contacts_seconds
    );
    println!(
        "labels {}  boxes {}  node words {}  dictionary {}  hash {:032x}",
        volume.labels().len(),
        volume.boxes().len(),
        volume.nodes().len(),
        volume.leaves().patterns().len(),
        volume.content_hash()
    );
    for level in [pumice_core::Level::Fast, pumice_core::Level::Default, pumice_core::Level::Small] {
        let path = std::env::temp_dir().join(format!("build_speed-{}.pumice", std::process::id()));
        let start = cpu_seconds();
        volume.save(&path, level, &Job::new())?;
        let (saved, bytes) = (cpu_seconds(), std::fs::metadata(&path)?.len());
        pumice_core::CompressedVolume::open(&path, &Job::new())?;
        println!(
            "{level:?}: {bytes} bytes on disk, {:.3} % of 4 B a voxel; save {:.3}, open {:.3} CPU-s",
            bytes as f64 / mvoxels / 4e4,
            saved - start,
            cpu_seconds() - saved
        );
        std::fs::remove_file(&path)?;
    }
    let start = cpu_seconds();
    let found = pool.install(|| pumice_core::verify(&volume, &mut source.rewound(), &Job::new()))?;
    println!("verify {:.3} CPU-s: {found:?}; index {} bytes", cpu_seconds() - start, volume.grid().bytes());
    let total: u64 = volume.resident_parts().iter().map(|p| p.1).sum();
    println!(
        "resident {total} = {:.3} % of 4 B a voxel: {:?}",
        total as f64 / mvoxels / 4e4,
        volume.resident_parts()
    );
    Ok(())
}

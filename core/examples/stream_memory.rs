//! Peak memory and CPU time of compressing a file that is streamed in slabs, on all processors.
//!
//! `stream_memory RAW X Y Z LAYERS [LIMIT]`: RAW holds X·Y·Z little-endian u32 labels, x fastest; LAYERS of them are a block; LIMIT is
//! a memory limit in bytes.

use std::io::Read;

use pumice_core::*;

struct RawFile {
    info: VolumeInfo,
    file: std::fs::File,
    layers: u32,
    z: u32,
}

impl BlockSource for RawFile {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        let [x, y, z] = self.info.dims;
        let layers = self.layers.min(z - self.z);
        if layers == 0 {
            return Ok(None);
        }
        let mut labels = vec![0u32; x as usize * y as usize * layers as usize];
        self.file
            .read_exact(bytemuck::cast_slice_mut(&mut labels))
            .map_err(|source| Error::Io { path: "RAW".into(), source })?;
        let block = LabelBlock::x_fastest([0, 0, self.z], [x, y, layers], LabelBuffer::U32(labels));
        self.z += layers;
        Ok(Some(block))
    }
}

/// A line of the kernel's status of this process, in KiB.
fn status_kib(key: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with(key)).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|v| v.parse().ok()).unwrap_or(0)
}

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let a: Vec<String> = std::env::args().skip(1).collect();
    let [path, x, y, z, layers, rest @ ..] = a.as_slice() else {
        return Err("usage: stream_memory RAW X Y Z LAYERS [LIMIT]".into());
    };
    let info = VolumeInfo::new([x.parse()?, y.parse()?, z.parse()?], LabelType::U32);
    let mut source = RawFile { info, file: std::fs::File::open(path)?, layers: layers.parse()?, z: 0 };
    let memory_limit_bytes = rest.first().map(|l| l.parse()).transpose()?;
    let options = CompressOptions { memory_limit_bytes, ..Default::default() };
    let volume = compress(&mut source, &options, &Job::new())?;
    println!(
        "peak {} KiB, now {} KiB, {} boxes, hash {:032x}",
        status_kib("VmHWM"),
        status_kib("VmRSS"),
        volume.boxes().len(),
        volume.content_hash()
    );
    Ok(())
}

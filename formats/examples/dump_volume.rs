//! Prints a volume's header as JSON and writes its voxels as little-endian u64, x fastest, to a file, for comparisons with other readers.
//!
//! `dump_volume FILE VOXELS.bin [--layer N] [--time N] [--channel N] [--array NAME] [--zyx] [--axes ORDER] [--raw X,Y,Z,TYPE] [--scale LEVEL] [--roi REGION]
//! [--label NAME] [--dataset PATH] [--missing-chunks MEANING] [--relabel TABLE]`. It keeps the whole volume in memory, which the library
//! never does. With `-` instead of VOXELS.bin it reads the blocks and drops them.

use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;

use pumice_formats::{ArrayAxes, OpenOptions, RawLayout, open, probe};
use serde_json::json;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}

/// Parses a raw layout such as `64,64,64,u64`; the voxels are little-endian.
fn raw_layout(text: &str) -> Result<RawLayout, Box<dyn std::error::Error>> {
    let words: Vec<&str> = text.split(',').collect();
    let [x, y, z, label_type] = words.as_slice() else { return Err("--raw X,Y,Z,TYPE".into()) };
    let label_type = serde_json::from_value(json!(label_type))?;
    Ok(RawLayout { dims: [x.parse()?, y.parse()?, z.parse()?], label_type, big_endian: false, offset: 0 })
}

fn run(arguments: &[String]) -> Result<(), Box<dyn std::error::Error>> {
    let [input, output, rest @ ..] = arguments else {
        return Err("dump_volume FILE VOXELS.bin [options]".into());
    };
    let mut options = OpenOptions::default();
    let mut rest = rest.iter();
    while let Some(name) = rest.next() {
        if name == "--zyx" {
            options.axes = Some(ArrayAxes::Zyx);
            continue;
        }
        let value = rest.next().ok_or("expected a value after each option but --zyx, got none")?;
        match name.as_str() {
            "--layer" => options.layer = Some(value.parse()?),
            "--time" => options.time = Some(value.parse()?),
            "--channel" => options.channel = Some(value.parse()?),
            "--raw" => options.raw = Some(raw_layout(value)?),
            "--array" => options.array = Some(value.clone()),
            "--scale" => options.scale = Some(value.parse()?),
            "--roi" => options.roi = Some(value.parse()?),
            "--label" => options.label = Some(value.clone()),
            "--dataset" => options.dataset = Some(value.clone()),
            "--missing-chunks" => options.missing_chunks = Some(value.parse()?),
            "--axes" => options.axes = Some(ArrayAxes::of_name(value).ok_or("an unknown order of axes")?),
            "--relabel" => options.relabel = Some(value.into()),
            _ => return Err(format!("unknown option {name}").into()),
        }
    }

    let header = probe(Path::new(input), &options)?;
    let mut source = open(Path::new(input), &options)?;
    let dims = source.info().dims.map(|d| d as usize);
    let keep = output != "-";
    let mut voxels = vec![0u64; if keep { dims.iter().product() } else { 0 }];
    let (mut count, mut largest_block) = (0u64, 0usize);
    while let Some(block) = source.next_block()? {
        count += block.dims.iter().map(|&d| u64::from(d)).product::<u64>();
        largest_block = largest_block.max(block.labels.len());
        if !keep {
            continue;
        }
        for z in 0..block.dims[2] {
            for y in 0..block.dims[1] {
                for x in 0..block.dims[0] {
                    let at = [0, 1, 2].map(|a| (block.origin[a] + [x, y, z][a]) as usize);
                    voxels[at[0] + dims[0] * (at[1] + dims[1] * at[2])] = block.get([x, y, z]);
                }
            }
        }
    }
    if keep {
        let mut file = std::io::BufWriter::new(std::fs::File::create(output)?);
        for voxel in &voxels {
            file.write_all(&voxel.to_le_bytes())?;
        }
        file.flush()?;
    }

    let info = source.info();
    let m = info.world_from_centre();
    let rows: Vec<[f64; 4]> = (0..3)
        .map(|r| [m.matrix3.x_axis[r], m.matrix3.y_axis[r], m.matrix3.z_axis[r], m.translation[r]])
        .collect();
    println!(
        "{}",
        json!({
            "format": header.format,
            "encoding": header.encoding,
            "dims": info.dims,
            "label_type": info.label_type,
            "world_from_centre": rows,
            "spacing": info.spacing(),
            "unit": info.unit,
            "frame": info.frame,
            "notes": info.notes,
            "layers": header.layers.iter().map(|l| json!({"index": l.index, "segments": l.segments})).collect::<Vec<_>>(),
            "warnings": options.warnings.list(),
            "voxels": count,
            "largest_block": largest_block,
        })
    );
    Ok(())
}

//! `convert_volume IN OUT` reads a small volume and writes it in the format of OUT's ending, for comparisons with other readers. It keeps
//! the whole volume in memory, which the library never does.

use std::path::Path;
use std::process::ExitCode;

use pumice_formats::{OpenOptions, open, write::write_volume};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output] = arguments.as_slice() else {
        eprintln!("convert_volume IN OUT");
        return ExitCode::from(2);
    };
    match convert(Path::new(input), Path::new(output)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}

fn convert(input: &Path, output: &Path) -> pumice_core::Result<()> {
    let mut source = open(input, &OpenOptions::default())?;
    let info = source.info().clone();
    let dims = info.dims.map(|d| d as usize);
    let mut ids = vec![0u64; dims.iter().product()];
    while let Some(block) = source.next_block()? {
        for z in 0..block.dims[2] {
            for y in 0..block.dims[1] {
                for x in 0..block.dims[0] {
                    let at = [0, 1, 2].map(|a| (block.origin[a] + [x, y, z][a]) as usize);
                    ids[at[0] + dims[0] * (at[1] + dims[1] * at[2])] = block.get([x, y, z]);
                }
            }
        }
    }
    write_volume(output, &info, &mut |origin, size| {
        let mut block = Vec::new();
        for z in 0..size[2] {
            for y in 0..size[1] {
                let row = (origin[1] + y) as usize + dims[1] * (origin[2] + z) as usize;
                let from = origin[0] as usize + dims[0] * row;
                block.extend_from_slice(&ids[from..from + size[0] as usize]);
            }
        }
        Ok(block)
    })
}

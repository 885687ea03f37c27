//! Compares two pictures given as raw little-endian f32, three channels per pixel, rows from the top:
//! `compare_raw WIDTH HEIGHT A B [VARIANCE_A VARIANCE_B DEGREES_OF_FREEDOM] [--map OUT]`. Prints the comparison as JSON;
//! `--map` writes FLIP of every pixel as raw f64. Tests use it to check the metrics against other implementations.
#![forbid(unsafe_code)]

use std::error::Error;

use pumice_picture::image::Image;
use pumice_picture::metrics::display::display_from_linear;
use pumice_picture::metrics::flip::flip_map;
use pumice_picture::metrics::{Variance, compare};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let map_to = args.iter().position(|a| a == "--map").map(|i| {
        args.remove(i);
        args.remove(i)
    });
    let [width, height] = [&args[0], &args[1]].map(|a| a.parse::<usize>());
    let (width, height) = (width?, height?);
    let pictures: Vec<Image> =
        args[2..].iter().take(4).map(|path| read(path, width, height)).collect::<Result<_, _>>()?;

    let variances = match pictures.get(2..4) {
        Some([a, b]) => {
            let degrees_of_freedom: f64 = args[6].parse()?;
            Some((Variance { of_mean: a, degrees_of_freedom }, Variance { of_mean: b, degrees_of_freedom }))
        }
        _ => None,
    };
    let comparison = compare(&pictures[0], &pictures[1], variances, &|| false)?;
    println!("{}", serde_json::to_string(&comparison)?);
    if let Some(path) = map_to {
        let map = flip_map(&display_from_linear(&pictures[0]), &display_from_linear(&pictures[1]));
        std::fs::write(path, map.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())?;
    }
    Ok(())
}

fn read(path: &str, width: usize, height: usize) -> Result<Image, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let values: Vec<f32> =
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let pixels: Vec<[f32; 3]> = values.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    if pixels.len() != width * height || bytes.len() != width * height * 12 {
        return Err(format!("{path}: {} bytes, expected {width}×{height}×12", bytes.len()).into());
    }
    Ok(Image::new(width, height, pixels))
}

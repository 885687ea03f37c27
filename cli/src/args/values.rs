//! Parsers of flag values. Each error says which form was expected. The parsers of sizes and bytes are in `pumice_session::values`.

use std::path::PathBuf;

use clap::builder::RangedI64ValueParser;

use pumice_session::LabelTableFormat;
use pumice_session::values::numbers;

/// Voxels along x, y and z: `512,512,128`.
pub(super) fn dims(text: &str) -> Result<[u64; 3], String> {
    numbers(text, ',').ok_or_else(|| "expected three whole numbers, e.g. 512,512,128".into())
}

/// Lowest voxel and the one beyond the highest, along x, y and z: `0,0,0,256,256,128`.
pub(super) fn region(text: &str) -> Result<[[u32; 3]; 2], String> {
    let [x0, y0, z0, x1, y1, z1] =
        numbers(text, ',').ok_or("expected six whole numbers X0,Y0,Z0,X1,Y1,Z1, e.g. 0,0,0,256,256,128")?;
    Ok([[x0, y0, z0], [x1, y1, z1]])
}

/// Voxel size along x, y and z: `16,16,40`.
pub(super) fn spacing(text: &str) -> Result<[f64; 3], String> {
    numbers(text, ',')
        .filter(|s: &[f64; 3]| s.iter().all(|v| v.is_finite() && *v > 0.0))
        .ok_or_else(|| "expected three numbers above 0, e.g. 16,16,40".into())
}

/// A pixel, counted from the upper left: `412,230`.
pub(super) fn pixel(text: &str) -> Result<[u32; 2], String> {
    numbers(text, ',').ok_or_else(|| "expected a pixel X,Y, counted from the upper left, e.g. 412,230".into())
}

/// A layer and the path of its copy: `neurons=cortex.pumice`.
pub(super) fn layer_file(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, path)) if !name.is_empty() && !path.is_empty() => Ok((name.into(), path.into())),
        _ => Err("expected NAME=PATH, e.g. neurons=cortex.pumice".into()),
    }
}

/// Most threads that are accepted: more than any machine has, because each is started.
const MOST_THREADS: i64 = 1024;

/// A number of threads.
pub(super) fn threads() -> RangedI64ValueParser<u16> {
    clap::value_parser!(u16).range(1..=MOST_THREADS)
}

/// A number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|v: &f64| v.is_finite() && *v > 0.0)
        .ok_or_else(|| "expected a number above 0".into())
}

/// A relative value above 0, as a fraction or in per cent: `0.03` or `3%`.
pub(super) fn relative(text: &str) -> Result<f64, String> {
    let (number, factor) = text.strip_suffix('%').map_or((text, 1.0), |t| (t, 0.01));
    positive(number).map(|v| v * factor).map_err(|_| "expected a number above 0, e.g. 0.03 or 3%".into())
}

/// A format of label tables by name: `itk-snap`.
pub(super) fn table_format(text: &str) -> Result<LabelTableFormat, String> {
    LabelTableFormat::of_name(text).ok_or_else(|| {
        format!("expected one of {}", LabelTableFormat::ALL.map(LabelTableFormat::name).join(" "))
    })
}

/// A parser of one of these values, by its name.
pub(super) fn by_name<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static {
    move |text| {
        all.iter().copied().find(|&value| name(value) == text).ok_or_else(|| {
            let names: Vec<&str> = all.iter().map(|&value| name(value)).collect();
            format!("expected one of {}", names.join(" "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_or_refused() {
        assert_eq!(relative("3%"), Ok(0.03));
        assert_eq!(region("1,2,3,4,5,6"), Ok([[1, 2, 3], [4, 5, 6]]));
        for bad in ["1,2,3", "-1,0,0,4,4,4", "0,0,0,1.5,4,4"] {
            assert!(region(bad).is_err(), "{bad}");
        }
        assert_eq!(spacing("16,16,40"), Ok([16.0, 16.0, 40.0]));
        for bad in ["NaN,1,1", "0,1,1", "1,1", "inf,1,1"] {
            assert!(spacing(bad).is_err(), "{bad}");
        }
        assert_eq!(pixel("412,230"), Ok([412, 230]));
        for bad in ["412", "412,230,1", "-1,0", "1.5,2", "", "4294967296,0"] {
            assert!(pixel(bad).is_err(), "{bad}");
        }
        for bad in ["0", "-0.1", "nan", "x%"] {
            assert!(relative(bad).is_err(), "{bad}");
        }
    }
}

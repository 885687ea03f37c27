//! Parsers of flag values: sizes in pixels, amounts of bytes, types of numbers.

use pumice_core::LabelType;

/// Parses `N` numbers separated by `separator`; `None` if there are more or fewer, or one is not a number.
pub fn numbers<T: std::str::FromStr, const N: usize>(text: &str, separator: char) -> Option<[T; N]> {
    let parts: Vec<T> = text.split(separator).map(|p| p.trim().parse().ok()).collect::<Option<_>>()?;
    parts.try_into().ok()
}

/// Parses width and height of a picture in pixels: `960x540`.
///
/// # Errors
/// The expected form, if `text` has another.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    numbers(text, 'x')
        .filter(|s: &[u32; 2]| s.iter().all(|&n| (1..=65_536).contains(&n)))
        .ok_or_else(|| "expected WIDTHxHEIGHT in pixels, each 1 to 65536, e.g. 960x540".into())
}

/// Parses the name of a label type: `u32`.
///
/// # Errors
/// The names that there are, if `text` is none of them.
pub fn label_type(text: &str) -> Result<LabelType, String> {
    serde_json::from_value(serde_json::Value::String(text.to_lowercase()))
        .map_err(|_| "expected one of u8 u16 u32 u64 i8 i16 i32 i64 f32 f64".into())
}

/// Parses a whole number of at least 1.
///
/// # Errors
/// The expected form, if `text` has another.
pub fn whole_from_1(text: &str) -> Result<u32, String> {
    text.parse()
        .ok()
        .filter(|&n: &u32| n > 0)
        .ok_or_else(|| format!("expected a whole number from 1 to {}, got {text}", u32::MAX))
}

/// Parses an amount of bytes: `268435456`, `256M` or `256MiB`, with K, M and G for 2¹⁰, 2²⁰ and 2³⁰.
///
/// # Errors
/// The expected form, if `text` has another.
pub fn bytes(text: &str) -> Result<u64, String> {
    let number = text.strip_suffix("iB").filter(|rest| rest.ends_with(['K', 'M', 'G'])).unwrap_or(text);
    let (number, shift) = match number.chars().last() {
        Some('K' | 'k') => (&number[..number.len() - 1], 10),
        Some('M' | 'm') => (&number[..number.len() - 1], 20),
        Some('G' | 'g') => (&number[..number.len() - 1], 30),
        _ => (number, 0),
    };
    number
        .parse::<u64>()
        .ok()
        .and_then(|n| n.checked_mul(1 << shift))
        .filter(|&n| n > 0)
        .ok_or_else(|| "expected a number of bytes above 0, e.g. 268435456 or 256M".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_or_refused() {
        assert_eq!((label_type("u16"), label_type("F32")), (Ok(LabelType::U16), Ok(LabelType::F32)));
        assert!(label_type("u17").is_err() && label_type("").is_err());
        assert_eq!(size("960x540"), Ok([960, 540]));
        assert_eq!(bytes("256M"), Ok(256 << 20));
        assert_eq!(
            (bytes("3KiB"), bytes("256MiB"), bytes("1GiB")),
            (Ok(3 << 10), Ok(256 << 20), Ok(1 << 30))
        );
        for bad in ["0x5", "960", "-1x3", "960x540x2", "99999999x1"] {
            assert!(size(bad).is_err(), "{bad}");
        }
        for bad in ["", "0", "-5", "18446744073709551615G", "M", "MiB", "5iB", "5B", "5MB"] {
            assert!(bytes(bad).is_err(), "{bad}");
        }
    }
}

//! The order of names with numbers in them.

use std::cmp::Ordering;

/// Orders `slice9 < slice10`: runs of digits compare as numbers, everything else as text.
pub(crate) fn natural(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    loop {
        let digits = |s: &str| s.bytes().take_while(u8::is_ascii_digit).count();
        let (n, m) = (digits(a_rest), digits(b_rest));
        if n > 0 && m > 0 {
            let (x, y) = (a_rest[..n].trim_start_matches('0'), b_rest[..m].trim_start_matches('0'));
            // Without leading zeros, the longer number is greater.
            let order = x.len().cmp(&y.len()).then_with(|| x.cmp(y));
            if order != Ordering::Equal {
                return order;
            }
            (a_rest, b_rest) = (&a_rest[n..], &b_rest[m..]);
            continue;
        }
        match (a_rest.chars().next(), b_rest.chars().next()) {
            (Some(x), Some(y)) if x == y => {
                (a_rest, b_rest) = (&a_rest[x.len_utf8()..], &b_rest[y.len_utf8()..]);
            }
            // The names differ in leading zeros only, so any fixed order will do.
            (None, None) => return a.cmp(b),
            (x, y) => return x.cmp(&y),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_sort_as_numbers() {
        let mut names = ["s10", "s9", "s010b", "s1", "t2", "s2x3", "s2x20", "s"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(names, ["s", "s1", "s2x3", "s2x20", "s9", "s10", "s010b", "t2"]);
    }
}

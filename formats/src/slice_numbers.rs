//! The numbers in the names of slices, which show where a slice is missing.
//!
//! ```text
//! s0016.tif  s0017.tif  s0019.tif     names differ in one number, which grows by 1: 18 is missing
//! s0.tif  s10.tif  s20.tif            it grows by 10: nothing is missing
//! s3.tif  s7.tif  s12.tif             it grows unevenly, or several numbers or letters differ: the names say nothing
//! ```

/// Numbers that are missing between the names of a folder.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Gap<'a> {
    /// The first number that is missing.
    pub(crate) missing: u64,
    /// How many are.
    pub(crate) count: u64,
    /// The name before the first.
    pub(crate) before: &'a str,
    /// The name after it.
    pub(crate) after: &'a str,
}

/// The numbers that are missing in names, which come in the order of their numbers; `None` where the names show no gap.
pub(crate) fn gap<'a>(names: &[&'a str]) -> Option<Gap<'a>> {
    let parts: Vec<Vec<&str>> = names.iter().map(|name| parts(name)).collect();
    let first = parts.first()?;
    if parts.iter().any(|other| other.len() != first.len()) {
        return None;
    }
    // The place in which the names differ must be one, and a number everywhere.
    let differs = |place: &usize| parts.iter().any(|other| other[*place] != first[*place]);
    let mut places = (0..first.len()).filter(differs);
    let (Some(place), None) = (places.next(), places.next()) else { return None };
    let numbers: Vec<u64> =
        parts.iter().map(|parts| parts[place].parse().ok()).collect::<Option<Vec<u64>>>()?;
    let steps: Vec<u64> =
        numbers.windows(2).map(|two| two[1].checked_sub(two[0])).collect::<Option<Vec<u64>>>()?;
    let step = steps.iter().copied().min().filter(|&step| step > 0)?;
    if steps.iter().any(|s| s % step != 0) {
        return None;
    }
    let at = steps.iter().position(|&s| s > step)?;
    Some(Gap {
        missing: numbers[at] + step,
        count: steps.iter().map(|s| s / step - 1).sum(),
        before: names[at],
        after: names[at + 1],
    })
}

/// A name cut into runs of digits and of everything else.
fn parts(name: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let digits = first.is_ascii_digit();
        let end = rest.find(|c: char| c.is_ascii_digit() != digits).unwrap_or(rest.len());
        parts.push(&rest[..end]);
        rest = &rest[end..];
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_number_is_found() {
        let found = gap(&["s0016.tif", "s0017.tif", "s0019.tif", "s0022.tif"]).unwrap();
        let expected = Gap { missing: 18, count: 3, before: "s0017.tif", after: "s0019.tif" };
        assert_eq!(found, expected);
        assert_eq!(gap(&["0.tif", "10.tif", "30.tif"]).unwrap().missing, 20);
        assert_eq!(gap(&["v2_z9.tif", "v2_z10.tif", "v2_z12.tif"]).unwrap().missing, 11);
    }

    #[test]
    fn names_that_say_nothing_have_no_gap() {
        for names in [
            &["s1.tif", "s2.tif", "s3.tif"][..],
            &["s0.tif", "s10.tif", "s20.tif"],
            &["s3.tif", "s7.tif", "s12.tif"],
            &["s1.tif", "s5.tif"],
            &["a1.tif", "b2.tif", "b9.tif"],
            &["a1x1.tif", "a2x2.tif", "a4x4.tif"],
            &["s1.tif", "s2.tif", "s4.tiff"],
            &["s1.tif", "s01.tif", "s4.tif"],
            &["99999999999999999999999.tif", "s.tif"],
            &["one.tif"],
            &[],
        ] {
            assert_eq!(gap(names), None, "{names:?}");
        }
    }
}

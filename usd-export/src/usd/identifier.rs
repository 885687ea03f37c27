//! Names of prims from names of anything: USD takes letters, digits and underscores alone.

/// A name for a prim, from which the text can be had again: letters and digits stay, every other character, an underscore, and a digit
/// at the beginning become `_` with the character's number in hexadecimal and another `_`. An empty text becomes `_`.
///
/// ```
/// assert_eq!(pumice_export::usd::identifier("axon"), "axon");
/// assert_eq!(pumice_export::usd::identifier("3 µm"), "_33__20__b5_m");
/// ```
pub fn identifier(text: &str) -> String {
    let mut name = String::new();
    for (i, c) in text.chars().enumerate() {
        if c.is_ascii_alphabetic() || (c.is_ascii_digit() && i > 0) {
            name.push(c);
        } else {
            name.push_str(&format!("_{:x}_", c as u32));
        }
    }
    if name.is_empty() { "_".into() } else { name }
}

/// The text from which [`identifier`] made a name; none where it made it of no text.
pub fn text_of_identifier(name: &str) -> Option<String> {
    if name == "_" {
        return Some(String::new());
    }
    let (mut text, mut rest) = (String::new(), name);
    while let Some(c) = rest.chars().next() {
        if c == '_' {
            let (number, after) = rest[1..].split_once('_')?;
            text.push(char::from_u32(u32::from_str_radix(number, 16).ok()?)?);
            rest = after;
        } else {
            text.push(c);
            rest = &rest[c.len_utf8()..];
        }
    }
    (identifier(&text) == name).then_some(text)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_text_has_a_name_and_every_name_its_text() {
        let texts = [
            "",
            "axon",
            "3",
            "a3",
            "_",
            "__",
            "a_b",
            "a b",
            "µm",
            "日本",
            "a\"b\\c\n",
            "_33_",
            "{}<>:/.",
            "😀",
        ];
        let mut seen = HashSet::new();
        for text in texts {
            let name = identifier(text);
            assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'), "{name}");
            assert!(!name.starts_with(|c: char| c.is_ascii_digit()), "{name}");
            assert_eq!(text_of_identifier(&name).as_deref(), Some(text), "{name}");
            assert!(seen.insert(name), "{text} has the name of another");
        }
        for name in ["_3", "a__", "_110000_", "_61_", "3"] {
            assert_eq!(text_of_identifier(name), None, "{name}");
        }
    }
}

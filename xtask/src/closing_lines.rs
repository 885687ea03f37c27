//! Parses the summary lines of test runners.

/// Numbers of passed and failed tests, summed over runners.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) passed: u64,
    pub(crate) failed: u64,
}

impl Counts {
    /// Adds the counts in `line` if it is a summary line of cargo test (`test result: ok. 3 passed; 0 failed; …`) or of pytest
    /// (`2 failed, 24 passed in 2.91s`, with or without equals signs around it). An `error` counts as a failed test.
    pub(crate) fn read(&mut self, line: &str) {
        let line = line.trim_matches(|c: char| c == '=' || c.is_whitespace());
        let cargo = line.strip_prefix("test result: ");
        let pytest =
            (line.starts_with(|c: char| c.is_ascii_digit()) && line.contains(" in ")).then_some(line);
        let Some(text) = cargo.or(pytest) else { return };
        let words: Vec<&str> = text.split([' ', ',', ';', '.']).filter(|w| !w.is_empty()).collect();
        for pair in words.windows(2) {
            let Ok(number) = pair[0].parse::<u64>() else { continue };
            match pair[1] {
                "passed" => self.passed += number,
                "failed" | "error" | "errors" => self.failed += number,
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closing_lines_of_both_runners_and_nothing_else() {
        let mut counts = Counts::default();
        for line in [
            "test result: ok. 15 passed; 1 failed; 2 ignored; 0 measured; 0 filtered out; finished in 0.09s",
            "24 passed in 2.91s",
            "==== 2 failed, 3 passed, 7 deselected, 1 error in 0.10s ====",
            "test some::test ... ok",
            "12 passed the river",
            "no tests ran in 0.01s",
        ] {
            counts.read(line);
        }
        assert_eq!(counts, Counts { passed: 42, failed: 4 });
    }
}

//! A selector: a [query line](pumice_core::LabelQuery) that must choose at least one label, so that a mistyped name does not go unnoticed.

use pumice_core::error::one_line;
use pumice_core::{CompressedVolume, LabelQuery};

use crate::label_rows::LabelRows;

/// Labels by id, name, type or numbers, as a flag names them.
#[derive(Clone, Debug, PartialEq)]
pub struct Selector {
    text: String,
    chooses: Chooses,
}

#[derive(Clone, Debug, PartialEq)]
enum Chooses {
    /// One id: looked up without a walk over the table.
    Id(u64),
    Query(LabelQuery),
}

impl Selector {
    /// Parses a query line.
    ///
    /// # Errors
    /// The place in the line that cannot be understood; also for a line without a condition.
    pub fn parse(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if text.is_empty() {
            return Err("expected an id, a name or a query such as type:axon, got nothing".into());
        }
        let chooses = match text.parse() {
            Ok(id) if text.starts_with(|c: char| c.is_ascii_digit()) => Chooses::Id(id),
            _ => Chooses::Query(LabelQuery::parse(text).map_err(|e| e.to_string())?),
        };
        Ok(Self { text: text.to_owned(), chooses })
    }

    /// Parses selectors that are separated by commas. Commas in quotes separate nothing.
    ///
    /// # Errors
    /// As [`Selector::parse`].
    pub fn parse_list(text: &str) -> Result<Vec<Self>, String> {
        let (mut is_quoted, mut is_escaped) = (false, false);
        text.split(|c: char| {
            let was_escaped = is_escaped;
            is_escaped = is_quoted && c == '\\' && !was_escaped;
            is_quoted ^= c == '"' && !was_escaped;
            c == ',' && !is_quoted
        })
        .map(Self::parse)
        .collect()
    }

    /// The id, if the selector is nothing else.
    pub fn id(&self) -> Option<u64> {
        match self.chooses {
            Chooses::Id(id) => Some(id),
            Chooses::Query(_) => None,
        }
    }

    /// Dense indices of the labels of the volume's table that it chooses, rising; they may be none.
    ///
    /// # Errors
    /// A column that the table lacks.
    pub fn matches(&self, volume: &CompressedVolume) -> Result<Vec<u32>, String> {
        match &self.chooses {
            Chooses::Id(id) => Ok(volume.labels().index_of(*id).into_iter().collect()),
            Chooses::Query(query) => {
                let chosen = LabelRows::for_query(volume, query).matches(query).map_err(|e| e.to_string())?;
                Ok((0..).zip(chosen).filter_map(|(label, is_chosen)| is_chosen.then_some(label)).collect())
            }
        }
    }

    /// As [`Selector::matches`], but at least one.
    ///
    /// # Errors
    /// Also when no label matches.
    pub fn labels_in(&self, volume: &CompressedVolume) -> Result<Vec<u32>, String> {
        let labels = self.matches(volume)?;
        if labels.is_empty() { Err(self.matches_nothing("the volume")) } else { Ok(labels) }
    }

    /// The error about a selector that chooses only labels that are not shown.
    pub(super) fn is_not_shown(&self) -> String {
        match &self.chooses {
            Chooses::Id(id) => format!("label {id} is not shown"),
            Chooses::Query(_) => one_line(&format!("no label that matches {} is shown", self.text)),
        }
    }

    /// The error about a selector that chooses nothing of `what`.
    pub fn matches_nothing(&self, what: &str) -> String {
        match &self.chooses {
            Chooses::Id(id) => format!("{what} has no label {id}"),
            Chooses::Query(_) => one_line(&format!(
                "no label of {what} matches {}; a word is part of a name, type:axon asks for a type",
                self.text
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::samples::named;

    fn ids(text: &str) -> Result<Vec<u64>, String> {
        let volume = named();
        let labels = Selector::parse(text)?.labels_in(&volume)?;
        Ok(labels.into_iter().map(|label| volume.labels().ids()[label as usize]).collect())
    }

    #[test]
    fn ids_names_and_numbers_choose_labels() {
        assert_eq!(ids("7"), Ok(vec![7]));
        assert_eq!(ids("axon"), Ok(vec![3, 9]));
        assert_eq!(ids("name=\"Axon, thick\""), Ok(vec![9]));
        assert_eq!(ids("voxels>1"), Ok(vec![7]));
        assert_eq!(ids(" 3-8 "), Ok(vec![3, 7]));
    }

    #[test]
    fn what_chooses_nothing_is_named() {
        assert_eq!(ids("8").unwrap_err(), "the volume has no label 8");
        assert!(ids("axn").unwrap_err().starts_with("no label of the volume matches axn;"));
        assert!(ids(" ").unwrap_err().ends_with("got nothing"));
        assert!(ids("size>3").unwrap_err().contains("expected a column of numbers"));
        assert!(ids("99999999999999999999").unwrap_err().contains("expected an id up to"));
    }

    #[test]
    fn commas_in_quotes_separate_nothing() {
        let texts = |line| -> Vec<String> {
            Selector::parse_list(line).unwrap().into_iter().map(|selector| selector.text).collect()
        };
        assert_eq!(texts("7, axon ,name:\"a,b\""), ["7", "axon", "name:\"a,b\""]);
        assert_eq!(texts(r#"name:"a\",b",3"#), [r#"name:"a\",b""#, "3"]);
        for bad in ["", "7,", ",7", "7,,9"] {
            assert!(Selector::parse_list(bad).is_err(), "{bad}");
        }
    }
}

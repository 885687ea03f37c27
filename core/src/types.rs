//! Types of labels: a grouping (dendrite, axon, vessel…) that the user gives as a table.
//!
//! ```text
//! id,type             the header line is optional
//! 3,axon
//! 98340797,dendrite   labels that are not in the table have no type
//! ```

use std::collections::BTreeMap;

use crate::label_table::NO_TYPE;
use crate::{Error, LabelTable, Result};

/// Types of labels by id.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TypeTable {
    names: Vec<String>,
    type_of_id: BTreeMap<u64, u16>,
}

impl TypeTable {
    /// Parses a table with one `id,type` a line; the module documentation has an example.
    ///
    /// # Errors
    /// [`Error::Caller`] that gives the line.
    pub fn parse_csv(text: &str) -> Result<Self> {
        let wrong =
            |line: usize, what: String| Error::Caller(format!("type table, line {}: {what}", line + 1));
        let mut named: BTreeMap<u64, &str> = BTreeMap::new();
        for (number, line) in text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty()) {
            let Some((id, name)) = line.split_once(',') else {
                return Err(wrong(number, format!("expected `id,type`, got `{line}`")));
            };
            let (id, name) = (id.trim(), name.trim());
            let is_quoted = name.len() > 1 && name.starts_with('"') && name.ends_with('"');
            if name.contains(',') && !is_quoted {
                let what = "expected two columns, `id,type`, got more; a table with names, colours or numbers is given as --table";
                return Err(wrong(number, what.into()));
            }
            let name = name.trim_matches('"');
            if number == 0 && id.trim_matches('"').eq_ignore_ascii_case("id") {
                continue;
            }
            let id: u64 =
                id.parse().map_err(|_| wrong(number, format!("expected a label id, got `{id}`")))?;
            if name.is_empty() {
                return Err(wrong(number, format!("label {id}: expected a type, got an empty one")));
            }
            if named.insert(id, name).is_some_and(|before| before != name) {
                return Err(wrong(
                    number,
                    format!("label {id}: expected one type, got another than in an earlier line"),
                ));
            }
        }
        // Types are numbered by name, so that the order of lines does not matter.
        let names = numbered(named.values().map(|&n| n.to_owned()).collect())?;
        let number = |name: &str| names.partition_point(|n| n.as_str() < name) as u16;
        let type_of_id = named.iter().map(|(&id, name)| (id, number(name))).collect();
        Ok(Self { names, type_of_id })
    }

    /// Sets the types of the labels in a table.
    pub(crate) fn apply(&self, table: &mut LabelTable) {
        table.type_names = self.names.clone();
        table.types =
            table.ids.iter().map(|id| self.type_of_id.get(id).copied().unwrap_or(NO_TYPE)).collect();
    }
}

/// Names of types by number: sorted, each once.
///
/// # Errors
/// [`Error::Limit`] for more types than there are numbers.
pub(crate) fn numbered(mut names: Vec<String>) -> Result<Vec<String>> {
    names.sort_unstable();
    names.dedup();
    let (limit, got) = (u64::from(NO_TYPE) - 1, names.len() as u64);
    if got > limit {
        return Err(Error::Limit { what: "types".into(), limit, got });
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_read_and_mistakes_named() {
        let table =
            TypeTable::parse_csv("id,type\n5,soma\n 9 , axon\n3,\"a, b\"\n\n18446744073709551615,soma\n")
                .unwrap();
        let mut labels = LabelTable { ids: vec![5, 7, 9], ..LabelTable::default() };
        table.apply(&mut labels);
        assert_eq!(labels.type_names(), ["a, b", "axon", "soma"]);
        assert_eq!([0, 1, 2].map(|l| labels.type_of(l)), [Some(2), None, Some(1)]);
        for (text, line) in [
            ("1,a\n1,b", 2),
            ("x,a\n", 1),
            ("1,a\n2", 2),
            ("1,", 1),
            ("id,name,type\n", 1),
            ("1,a\n2,b,c", 2),
        ] {
            let error = TypeTable::parse_csv(text).unwrap_err().to_string();
            assert!(error.contains(&format!("line {line}")), "{error}");
        }
    }
}

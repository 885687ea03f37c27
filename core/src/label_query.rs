//! The query line: chooses labels of a table by id, name, type and numbers.
//!
//! ```text
//! line       = { condition }                    all conditions must hold; an empty line and * hold for every label
//! condition  = [ "-" | "!" ] test               - or ! in front: the test must not hold
//! test       = ID | ID "-" ID                   one of the ids and ranges of the line (17 42 100-199); each by itself after -
//!            | TEXT                             the name contains the text
//!            | ("name" | "type") ":" TEXT       the name or type contains the text
//!            | ("name" | "type") ("=" | "!=") TEXT               is, or is not, the text
//!            | COLUMN ("<" | "<=" | ">" | ">=" | "=" | "!=") NUMBER
//! ```
//! A text or a column's name is a word, or anything in quotes: `"two words"`, `"17"`, with `\"` and `\\` for a quote and a backslash.
//! Capital letters equal small ones. A label without a number in a column meets no comparison with it, neither `=` nor `!=`.
//!
//! [`LabelQuery::parse`] needs no table; [`LabelQuery::matches`] looks the columns up. Ids and columns of whole numbers are compared
//! exactly, also beyond 2⁵³.

mod parse;
mod words;

use std::cmp::Ordering;

use crate::error::one_line;

/// Columns of a table of labels. Each has as many rows as `ids`, or is empty where no label has any.
#[derive(Clone, Copy, Debug, Default)]
pub struct LabelColumns<'a> {
    /// Ids of the labels, in any order.
    pub ids: &'a [u64],
    /// Names; empty where a label has none.
    pub names: &'a [&'a str],
    /// Types; empty where a label has none.
    pub types: &'a [&'a str],
    /// Columns of numbers by name. The column `id` is always there.
    pub numbers: &'a [(&'a str, Numbers<'a>)],
}

/// A column of numbers.
#[derive(Clone, Copy, Debug)]
pub enum Numbers<'a> {
    /// Whole numbers, compared exactly.
    Whole(&'a [u64]),
    /// Other numbers; NaN where a label has none.
    Real(&'a [f64]),
}

/// Why a query cannot be understood or answered.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("query, column {column}: {what}")]
pub struct QueryError {
    /// Place in the line where the fault begins, in characters from 1.
    pub column: usize,
    /// What is wrong: expected and got.
    pub what: String,
}

/// A parsed query line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelQuery {
    /// Ids from the first to the last, of which one must hold; empty where the line names none.
    ids: Vec<(u64, u64)>,
    conditions: Vec<Condition>,
}

#[derive(Clone, Debug, PartialEq)]
struct Condition {
    /// Whether the test must hold.
    wanted: bool,
    test: Test,
}

#[derive(Clone, Debug, PartialEq)]
enum Test {
    Ids(u64, u64),
    /// The text is in small letters.
    Text {
        of: Texts,
        how: TextIs,
        text: String,
    },
    Number {
        name: String,
        column: usize,
        how: Compare,
        value: Value,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Texts {
    Names,
    Types,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TextIs {
    Containing,
    Equal,
    Unequal,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Compare {
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    Unequal,
}

impl Compare {
    /// Whether numbers of this order meet the comparison.
    fn holds(self, order: Ordering) -> bool {
        match self {
            Self::Less => order.is_lt(),
            Self::LessOrEqual => order.is_le(),
            Self::Greater => order.is_gt(),
            Self::GreaterOrEqual => order.is_ge(),
            Self::Equal => order.is_eq(),
            Self::Unequal => order.is_ne(),
        }
    }
}

/// The number of a comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Value {
    real: f64,
    /// The number itself, where it is written as a whole one; `real` may be rounded then.
    whole: Option<u64>,
}

impl Value {
    /// Order of a whole number and this one.
    fn order_of_whole(self, number: u64) -> Ordering {
        if let Some(whole) = self.whole {
            return number.cmp(&whole);
        }
        if self.real < 0.0 {
            return Ordering::Greater;
        }
        // 2⁶⁴ is the least f64 beyond all whole numbers; below it the cast is exact.
        if self.real >= 18_446_744_073_709_551_616.0 {
            return Ordering::Less;
        }
        let below = self.real.floor();
        number.cmp(&(below as u64)).then(if below < self.real { Ordering::Less } else { Ordering::Equal })
    }
}

impl LabelQuery {
    /// Parses a query line; the module documentation has the grammar.
    ///
    /// # Errors
    /// [`QueryError`] at the first word that cannot be understood.
    pub fn parse(line: &str) -> Result<Self, QueryError> {
        parse::parse(line)
    }

    /// The ids that the line names one by one, in its order; ids of ranges and behind a `-` are not among them.
    pub fn named_ids(&self) -> impl Iterator<Item = u64> {
        self.ids.iter().filter(|(first, last)| first == last).map(|(id, _)| *id)
    }

    /// Names of the columns of numbers that the query compares, as the line has them.
    pub fn column_names(&self) -> impl Iterator<Item = &str> {
        self.conditions.iter().filter_map(|condition| match &condition.test {
            Test::Number { name, .. } => Some(name.as_str()),
            Test::Ids(..) | Test::Text { .. } => None,
        })
    }

    /// Whether the query holds, for each row of a table.
    ///
    /// # Errors
    /// [`QueryError`] for a column that the table lacks.
    ///
    /// # Panics
    /// When a column has neither as many rows as `ids` nor none.
    pub fn matches(&self, table: &LabelColumns<'_>) -> Result<Vec<bool>, QueryError> {
        let rows = table.ids.len();
        let mut chosen = vec![true; rows];
        if !self.ids.is_empty() {
            let any = |id: u64| self.ids.iter().any(|&(first, last)| (first..=last).contains(&id));
            narrow(&mut chosen, true, |row| any(table.ids[row]));
        }
        for Condition { wanted, test } in &self.conditions {
            match test {
                Test::Ids(first, last) => {
                    narrow(&mut chosen, *wanted, |row| (*first..=*last).contains(&table.ids[row]));
                }
                Test::Text { of, how, text } => {
                    let texts = match of {
                        Texts::Names => table.names,
                        Texts::Types => table.types,
                    };
                    assert!(texts.is_empty() || texts.len() == rows, "a text for each of {rows} rows");
                    let mut small = String::new();
                    narrow(&mut chosen, *wanted, |row| {
                        small_letters(texts.get(row).copied().unwrap_or_default(), &mut small);
                        match how {
                            TextIs::Containing => small.contains(text),
                            TextIs::Equal => small == *text,
                            TextIs::Unequal => small != *text,
                        }
                    });
                }
                Test::Number { name, column, how, value } => match find(table, name, *column)? {
                    Numbers::Whole(numbers) => {
                        assert_eq!(numbers.len(), rows, "a number of {name} for each row");
                        narrow(&mut chosen, *wanted, |row| how.holds(value.order_of_whole(numbers[row])));
                    }
                    Numbers::Real(numbers) => {
                        assert_eq!(numbers.len(), rows, "a number of {name} for each row");
                        narrow(&mut chosen, *wanted, |row| {
                            numbers[row].partial_cmp(&value.real).is_some_and(|order| how.holds(order))
                        });
                    }
                },
            }
        }
        Ok(chosen)
    }
}

/// Drops the chosen rows for which `holds` does not give what is wanted.
fn narrow(chosen: &mut [bool], wanted: bool, mut holds: impl FnMut(usize) -> bool) {
    for (row, chosen) in chosen.iter_mut().enumerate().filter(|(_, chosen)| **chosen) {
        *chosen = holds(row) == wanted;
    }
}

/// Writes `text` in small letters to `small`. Texts of ASCII, which most names are, need no tables of letters.
fn small_letters(text: &str, small: &mut String) {
    small.clear();
    if text.is_ascii() {
        small.push_str(text);
        small.make_ascii_lowercase();
    } else {
        small.extend(text.chars().flat_map(char::to_lowercase));
    }
}

/// The column of this name; where there is none, the one that differs in capital letters alone.
fn find<'a>(table: &LabelColumns<'a>, name: &str, column: usize) -> Result<Numbers<'a>, QueryError> {
    let exact = table.numbers.iter().find(|(known, _)| *known == name);
    let alike = || table.numbers.iter().find(|(known, _)| known.eq_ignore_ascii_case(name));
    if let Some(&(_, numbers)) = exact.or_else(alike) {
        return Ok(numbers);
    }
    if name.eq_ignore_ascii_case("id") {
        return Ok(Numbers::Whole(table.ids));
    }
    let known: Vec<&str> =
        std::iter::once("id").chain(table.numbers.iter().map(|(known, _)| *known)).collect();
    let what = format!("expected a column of numbers ({}), got {name}", known.join(", "));
    Err(QueryError { column, what: one_line(&what) })
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDS: [u64; 6] = [3, 17, 18, 42, (1 << 53) + 1, u64::MAX];
    const NAMES: [&str; 6] = ["Glia 1", "PV basket", "glia 17", "", "ÄSTROGLIA", "he said \"no\""];
    const TYPES: [&str; 6] = ["glia", "axon", "axon initial segment", "", "glia", "dendrite"];
    const DEPTHS: [f64; 6] = [1.5, -3.0, f64::NAN, 0.0, 1e3, 7.0];

    /// Numbers of the rows that a query chooses.
    fn rows(line: &str) -> Vec<usize> {
        let table = LabelColumns {
            ids: &IDS,
            names: &NAMES,
            types: &TYPES,
            numbers: &[
                ("voxels", Numbers::Whole(&[10, 2000, 30, 4000, 1 << 60, 60])),
                ("soma depth", Numbers::Real(&DEPTHS)),
            ],
        };
        let chosen = LabelQuery::parse(line).unwrap().matches(&table).unwrap();
        (0..IDS.len()).filter(|&row| chosen[row]).collect()
    }

    #[test]
    fn each_condition_means_what_its_words_say() {
        let all: Vec<usize> = (0..6).collect();
        for (line, expected) in [
            ("", &all[..]),
            ("  \t ", &all),
            ("*", &all),
            ("17 42", &[1, 3]),
            ("17-42", &[1, 2, 3]),
            ("3 18-42 18446744073709551615", &[0, 2, 3, 5]),
            ("9007199254740992", &[]),
            ("-17", &[0, 2, 3, 4, 5]),
            ("17-42 !18", &[1, 3]),
            ("-17 -42", &[0, 2, 4, 5]),
            ("glia", &[0, 2, 4]),
            ("GLIA 17", &[]),
            ("\"glia 17\"", &[2]),
            ("\"17\"", &[2]),
            ("ästro", &[4]),
            ("glia voxels>1000", &[4]),
            ("-glia", &[1, 3, 5]),
            ("name:\"pv b\"", &[1]),
            ("name:\"\\\"NO\\\"\"", &[5]),
            ("name=\"glia 1\"", &[0]),
            ("name=\"\"", &[3]),
            ("name!=\"\" -glia", &[1, 5]),
            ("type:axon", &[1, 2]),
            ("type=axon", &[1]),
            ("!type:axon", &[0, 3, 4, 5]),
            ("type!=axon", &[0, 2, 3, 4, 5]),
            ("voxels>=2000", &[1, 3, 4]),
            ("Voxels > 2000", &[3, 4]),
            ("voxels=30", &[2]),
            ("voxels<30.5 voxels>9.5", &[0, 2]),
            ("voxels>1e300", &[]),
            ("voxels>-1", &all),
            ("id>9007199254740992", &[4, 5]),
            ("id>9007199254740993", &[5]),
            ("\"soma depth\"<=0", &[1, 3]),
            ("\"soma depth\">-3", &[0, 3, 4, 5]),
            ("\"soma depth\"!=7", &[0, 1, 3, 4]),
            ("-\"soma depth\"!=7", &[2, 5]),
        ] {
            assert_eq!(rows(line), expected, "{line}");
        }
    }

    #[test]
    fn a_fault_is_named_with_its_column() {
        let table =
            LabelColumns { ids: &[1], numbers: &[("voxels", Numbers::Whole(&[1]))], ..Default::default() };
        for (line, column, what) in [
            ("glia \"open", 6, "expected a closing quote"),
            ("voxels>", 8, "expected a number, got the end of the line"),
            ("voxels>many", 8, "expected a number, got many"),
            ("voxels>1_000", 8, "expected a number, got 1_000"),
            ("voxels>nan", 8, "expected a number, got nan"),
            ("ä 42-17", 3, "expected a range from a lower id to a higher one, got 42-17"),
            ("17-", 1, "expected an id or a range of ids, got 17-; a name goes in quotes"),
            ("1 18446744073709551616", 3, "expected an id up to 18446744073709551615"),
            ("size:big", 1, "expected name: or type: before a text, got size:"),
            ("name>3", 5, "expected :, = or != after name, got >"),
            ("name:", 6, "expected a text, got the end of the line"),
            (">3", 1, "expected a column's name before >"),
            ("-", 1, "expected a condition after -"),
            ("- glia", 1, "expected a condition after -"),
            ("a depth>3", 3, "expected a column of numbers (id, voxels), got depth"),
            ("-*", 1, "expected a condition after -, got *"),
        ] {
            let error = LabelQuery::parse(line).and_then(|q| q.matches(&table)).unwrap_err();
            assert!(error.column == column && error.what.contains(what), "{line}: {error}");
            assert!(!error.to_string().contains('\n'));
        }
    }

    #[test]
    fn columns_that_are_compared_are_named() {
        let query = LabelQuery::parse("glia 17 voxels>3 -\"soma depth\"<1 type:axon").unwrap();
        assert_eq!(query.column_names().collect::<Vec<_>>(), ["voxels", "soma depth"]);
    }
}

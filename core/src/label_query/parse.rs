//! Turns the words of a query line into its conditions.

use super::words::{Kind, Word, words};
use super::{Compare, Condition, LabelQuery, QueryError, Test, TextIs, Texts, Value};
use crate::error::one_line;

/// Parses a line; the module [`super`] has the grammar.
pub(super) fn parse(line: &str) -> Result<LabelQuery, QueryError> {
    let words = words(line)?;
    let mut rest = Words { words: &words, end: line.chars().count() + 1 };
    let mut query = LabelQuery::default();
    while let Some(word) = rest.next() {
        // `-` and `!` belong to the condition that they touch.
        let (wanted, word) = match word.kind {
            Kind::Not(sign) => (false, rest.negated(word, sign)?),
            _ => (true, word),
        };
        match (test(word, &mut rest)?, wanted) {
            (None, true) => {}
            (None, false) => return Err(fault(word.column - 1, "expected a condition after -, got *")),
            (Some(Test::Ids(first, last)), true) => query.ids.push((first, last)),
            (Some(test), _) => query.conditions.push(Condition { wanted, test }),
        }
    }
    Ok(query)
}

/// The words that are not parsed yet.
struct Words<'a> {
    words: &'a [Word],
    /// Column behind the last character.
    end: usize,
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a Word> {
        let (first, rest) = self.words.split_first()?;
        self.words = rest;
        Some(first)
    }

    /// The word that follows a sign without a space.
    fn negated(&mut self, sign: &Word, written: char) -> Result<&'a Word, QueryError> {
        match self.words.first() {
            Some(word) if word.is_joined && !matches!(word.kind, Kind::Not(_)) => {
                self.words = &self.words[1..];
                Ok(word)
            }
            _ => Err(fault(sign.column, format!("expected a condition after {written}"))),
        }
    }

    /// The operator that comes next, if it is one.
    fn operator(&mut self) -> Option<(&'static str, usize)> {
        match self.words.first() {
            Some(Word { kind: Kind::Operator(operator), column, .. }) => {
                self.words = &self.words[1..];
                Some((operator, *column))
            }
            _ => None,
        }
    }

    /// The text or number behind an operator.
    fn value(&mut self, expected: &str) -> Result<(&'a str, usize), QueryError> {
        match self.next() {
            Some(Word { kind: Kind::Plain(text) | Kind::Quoted(text), column, .. }) => Ok((text, *column)),
            Some(Word { kind: Kind::Operator(operator), column, .. }) => {
                Err(fault(*column, format!("{expected}, got {operator}")))
            }
            Some(Word { kind: Kind::Not(sign), column, .. }) => {
                Err(fault(*column, format!("{expected}, got {sign}")))
            }
            None => Err(fault(self.end, format!("{expected}, got the end of the line"))),
        }
    }
}

fn fault(column: usize, what: impl AsRef<str>) -> QueryError {
    QueryError { column, what: one_line(what.as_ref()) }
}

/// The test that begins with `word`; `None` for `*`, which holds always.
fn test(word: &Word, rest: &mut Words<'_>) -> Result<Option<Test>, QueryError> {
    let column = word.column;
    let (text, is_quoted) = match &word.kind {
        Kind::Plain(text) => (text.as_str(), false),
        Kind::Quoted(text) => (text.as_str(), true),
        Kind::Operator(operator) => {
            return Err(fault(column, format!("expected a column's name before {operator}")));
        }
        Kind::Not(sign) => return Err(fault(column, format!("expected a condition after {sign}"))),
    };
    if let Some((operator, at)) = rest.operator() {
        let of = match text.to_ascii_lowercase().as_str() {
            "name" if !is_quoted => Some(Texts::Names),
            "type" if !is_quoted => Some(Texts::Types),
            _ => None,
        };
        return match of {
            Some(of) => text_test(of, text, operator, at, rest),
            None => number_test(text, column, operator, rest),
        }
        .map(Some);
    }
    if is_quoted {
        return Ok(Some(contains(Texts::Names, text)));
    }
    if text == "*" {
        return Ok(None);
    }
    Ok(Some(match ids(text, column)? {
        Some((first, last)) => Test::Ids(first, last),
        None => contains(Texts::Names, text),
    }))
}

fn contains(of: Texts, text: &str) -> Test {
    Test::Text { of, how: TextIs::Containing, text: text.to_lowercase() }
}

/// An id or a range of ids; `None` for a word that is a text.
fn ids(text: &str, column: usize) -> Result<Option<(u64, u64)>, QueryError> {
    if !text.starts_with(|c: char| c.is_ascii_digit())
        || !text.chars().all(|c| c.is_ascii_digit() || c == '-')
    {
        return Ok(None);
    }
    let is_id = |digits: &str| !digits.is_empty() && digits.chars().all(|c| c.is_ascii_digit());
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    if !is_id(first) || !is_id(last) {
        let what = format!("expected an id or a range of ids, got {text}; a name goes in quotes");
        return Err(fault(column, what));
    }
    let id = |digits: &str| {
        digits
            .parse::<u64>()
            .map_err(|_| fault(column, format!("expected an id up to {}, got {digits}", u64::MAX)))
    };
    let (low, high) = (id(first)?, id(last)?);
    if low > high {
        let what = format!("expected a range from a lower id to a higher one, got {text}");
        return Err(fault(column, what));
    }
    Ok(Some((low, high)))
}

fn text_test(
    of: Texts,
    name: &str,
    operator: &str,
    at: usize,
    rest: &mut Words<'_>,
) -> Result<Test, QueryError> {
    let how = match operator {
        ":" => TextIs::Containing,
        "=" => TextIs::Equal,
        "!=" => TextIs::Unequal,
        _ => return Err(fault(at, format!("expected :, = or != after {name}, got {operator}"))),
    };
    let (text, _) = rest.value("expected a text")?;
    Ok(Test::Text { of, how, text: text.to_lowercase() })
}

fn number_test(name: &str, column: usize, operator: &str, rest: &mut Words<'_>) -> Result<Test, QueryError> {
    let how = match operator {
        "<" => Compare::Less,
        "<=" => Compare::LessOrEqual,
        ">" => Compare::Greater,
        ">=" => Compare::GreaterOrEqual,
        "=" => Compare::Equal,
        "!=" => Compare::Unequal,
        _ => {
            return Err(fault(
                column,
                format!("expected name: or type: before a text, got {name}{operator}"),
            ));
        }
    };
    let (text, at) = rest.value("expected a number")?;
    // Rust reads `inf` and `nan` as numbers too; no label has them.
    match text.parse::<f64>() {
        Ok(real) if real.is_finite() => {
            let value = Value { real, whole: text.parse().ok() };
            Ok(Test::Number { name: name.to_owned(), column, how, value })
        }
        _ => Err(fault(at, format!("expected a number, got {text}"))),
    }
}

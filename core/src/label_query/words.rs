//! The words of a query line.
//!
//! ```text
//! -type:"two words" voxels >= 10     -   type   :   "two words"   voxels   >=   10
//! ```
//! White space ends a word, and so does each character of `:<>=!"`. A `-` or `!` is a sign where a word begins with it and the word is no
//! value behind an operator; elsewhere it belongs to its word (`17-42`, `wild-type`).

use super::QueryError;

/// What a word is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A word as it stands in the line.
    Plain(String),
    /// What stood in quotes.
    Quoted(String),
    /// `:`, `<`, `<=`, `>`, `>=`, `=` or `!=`.
    Operator(&'static str),
    /// `-` or `!` in front of a condition.
    Not(char),
}

/// A word and its place in the line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Word {
    pub(super) kind: Kind,
    /// First character, from 1.
    pub(super) column: usize,
    /// Whether it follows the word before it without a space.
    pub(super) is_joined: bool,
}

/// The operators, those first that begin with another one.
const OPERATORS: [&str; 7] = ["<=", ">=", "!=", ":", "<", ">", "="];

/// Divides a line into words.
pub(super) fn words(line: &str) -> Result<Vec<Word>, QueryError> {
    let characters: Vec<char> = line.chars().collect();
    let mut words: Vec<Word> = Vec::new();
    let (mut at, mut end_of_last) = (0, None);
    while at < characters.len() {
        if characters[at].is_whitespace() {
            at += 1;
            continue;
        }
        let from = at;
        let after_operator = matches!(words.last(), Some(Word { kind: Kind::Operator(_), .. }));
        let kind = match characters[at] {
            '"' => {
                let (text, end) = quoted(&characters, at)?;
                at = end;
                Kind::Quoted(text)
            }
            c => match OPERATORS
                .into_iter()
                .find(|o| o.chars().eq(characters[at..].iter().copied().take(o.len())))
            {
                Some(operator) => {
                    at += operator.len();
                    Kind::Operator(operator)
                }
                None if c == '!' || (c == '-' && !after_operator) => {
                    at += 1;
                    Kind::Not(c)
                }
                None => {
                    let ends = |c: &char| c.is_whitespace() || ":<>=!\"".contains(*c);
                    at += characters[at..].iter().position(ends).unwrap_or(characters.len() - at);
                    Kind::Plain(characters[from..at].iter().collect())
                }
            },
        };
        words.push(Word { kind, column: from + 1, is_joined: end_of_last == Some(from) });
        end_of_last = Some(at);
    }
    Ok(words)
}

/// The text in the quotes that begin at `from`, and the place behind them.
fn quoted(characters: &[char], from: usize) -> Result<(String, usize), QueryError> {
    let mut text = String::new();
    let mut rest = characters.iter().copied().enumerate().skip(from + 1);
    while let Some((at, c)) = rest.next() {
        match c {
            '"' => return Ok((text, at + 1)),
            '\\' => text.extend(rest.next().map(|(_, escaped)| escaped)),
            _ => text.push(c),
        }
    }
    let what = "expected a closing quote, got the end of the line".into();
    Err(QueryError { column: from + 1, what })
}

//! Makes texts from outside fit to be shown: one line of bounded length that steers no terminal.
//!
//! Names of files and labels, and what parsers quote, come from whoever made a file. Without this they could send control sequences to
//! the user's terminal, turn the direction of what is read, or fill the screen.

use std::fmt::Write as _;

/// Most characters of a line about something: what a path of some depth, a cause and a way out take many times over.
const MOST_CHARS: usize = 1000;

/// Makes a text printable in one line. Control characters become escapes, and from a text of more than 1,000 characters the middle is
/// left out, which the line says with the text's length.
pub fn one_line(text: &str) -> String {
    excerpt(text, MOST_CHARS)
}

/// As [`one_line`], for a text of at most `most_chars` characters.
pub fn excerpt(text: &str, most_chars: usize) -> String {
    let count = text.chars().count();
    let mut line = String::with_capacity(text.len().min(4 * most_chars));
    if count <= most_chars {
        escape(text.chars(), &mut line);
        return line;
    }
    // The subject stands at the beginning, and what is wrong with it at the end.
    let end = most_chars / 3;
    escape(text.chars().take(most_chars - end), &mut line);
    // Writing to a string cannot fail.
    let _ = write!(line, " … ({count} characters) … ");
    escape(text.chars().skip(count - end), &mut line);
    line
}

fn escape(text: impl Iterator<Item = char>, line: &mut String) {
    for c in text {
        if c.is_control() {
            line.extend(c.escape_debug());
        } else if breaks_or_turns_lines(c) {
            line.extend(c.escape_unicode());
        } else {
            line.push(c);
        }
    }
}

/// Whether a character that is no control character breaks lines, or changes the direction of what follows (Unicode Standard Annex 9 §2;
/// Boucher and Anderson 2021, *Trojan Source*, on what that hides).
fn breaks_or_turns_lines(c: char) -> bool {
    matches!(
        c,
        '\u{2028}' | '\u{2029}' | '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}'
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_not_broken_and_terminals_not_steered() {
        assert_eq!(one_line("a\nb\r\u{1b}[2Jc\u{85}\u{2028}d"), "a\\nb\\r\\u{1b}[2Jc\\u{85}\\u{2028}d");
        assert_eq!(one_line("gpj\u{202e}exe.\u{2066}"), "gpj\\u{202e}exe.\\u{2066}");
        let harmless = "ungültig „x\" 'y' 脑 می\u{200c}خواهم";
        assert_eq!(one_line(harmless), harmless);
    }

    #[test]
    fn long_texts_keep_their_ends_and_say_how_long_they_are() {
        let whole = "µ".repeat(MOST_CHARS);
        assert_eq!(one_line(&whole), whole);
        let line = one_line(&format!("begin{}end", "\n".repeat(5000)));
        assert!(line.starts_with("begin\\n") && line.ends_with("\\nend"), "{line}");
        assert!(line.contains(" … (5008 characters) … ") && line.chars().count() < 2 * MOST_CHARS + 40);
        assert_eq!(excerpt("abcdefgh", 6), "abcd … (8 characters) … gh");
    }
}

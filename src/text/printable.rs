//! Makes text from outside safe for a terminal.
//!
//! Scenes, manifests, arguments, file names, environment variables and drivers may contain characters that move the
//! cursor, colour or hide text, or reverse its direction. They are escaped before they reach a terminal.

use std::borrow::Cow;

/// Whether a terminal shows a character as itself: it is no control character (C0, DEL, C1), no line or paragraph
/// separator, and does not change the direction of text.
pub fn is_printable(c: char) -> bool {
    let turns =
        matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    !(c.is_control() || turns || matches!(c, '\u{2028}' | '\u{2029}'))
}

/// Escapes all unprintable characters, including line feeds, as in Rust: `\u{1b}`.
pub fn line(text: &str) -> Cow<'_, str> {
    escaped(text, is_printable)
}

/// Escapes all unprintable characters except line feeds.
pub fn lines(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c == '\n' || is_printable(c))
}

fn escaped(text: &str, stays: impl Fn(char) -> bool) -> Cow<'_, str> {
    if text.chars().all(&stays) {
        return Cow::Borrowed(text);
    }
    let mut excerpt = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if stays(c) {
            excerpt.push(c);
        } else {
            excerpt.extend(c.escape_default());
        }
    }
    Cow::Owned(excerpt)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_unprintable_characters_are_escaped() {
        let plain = "e = 0.5, \u{3c9} \u{2192} 12 \"quoted\" \\ caf\u{e9} \u{1f600}";
        assert!(matches!(line(plain), Cow::Borrowed(same) if same == plain));
        assert_eq!(line("a\u{1b}[31m\u{7f}\u{9b}2J\r\tz"), "a\\u{1b}[31m\\u{7f}\\u{9b}2J\\r\\tz");
        assert_eq!(line("x\u{202e}y\u{2066}\u{200f}"), "x\\u{202e}y\\u{2066}\\u{200f}");
        assert_eq!((&*line("a\nb\u{7}"), &*lines("a\nb\u{7}")), ("a\\nb\\u{7}", "a\nb\\u{7}"));
        let all = (0..=0x1f).chain(0x7f..=0x9f).filter_map(char::from_u32);
        assert!(all.clone().count() == 65 && all.into_iter().all(|c| !is_printable(c)));
    }
}

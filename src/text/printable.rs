//! Text from outside, made fit for a terminal.
//!
//! Scenes, manifests, arguments, file names, environment variables and drivers may hold characters that move the
//! cursor, colour or hide text, or turn its direction round. None of them reaches a terminal as it is.

use std::borrow::Cow;

/// Whether a terminal shows a character as itself: no control (C0, DEL, C1), no break of lines or paragraphs, nothing
/// that changes the direction of text.
pub fn is_printable(c: char) -> bool {
    let turns =
        matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    !(c.is_control() || turns || matches!(c, '\u{2028}' | '\u{2029}'))
}

/// One line: what is not printable, line feeds included, is written as Rust does, `\u{1b}`.
pub fn line(text: &str) -> Cow<'_, str> {
    escaped(text, is_printable)
}

/// Lines: line feeds stay, what is not printable otherwise is written as Rust does.
pub fn lines(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c == '\n' || is_printable(c))
}

fn escaped(text: &str, stays: impl Fn(char) -> bool) -> Cow<'_, str> {
    if text.chars().all(&stays) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if stays(c) {
            shown.push(c);
        } else {
            shown.extend(c.escape_default());
        }
    }
    Cow::Owned(shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_are_escaped_and_everything_else_stays() {
        let plain = "e = 0.5, \u{3c9} \u{2192} 12 \"quoted\" \\ caf\u{e9} \u{1f600}";
        assert!(matches!(line(plain), Cow::Borrowed(same) if same == plain));
        assert_eq!(line("a\u{1b}[31m\u{7f}\u{9b}2J\r\tz"), "a\\u{1b}[31m\\u{7f}\\u{9b}2J\\r\\tz");
        assert_eq!(line("x\u{202e}y\u{2066}\u{200f}"), "x\\u{202e}y\\u{2066}\\u{200f}");
        assert_eq!((&*line("a\nb\u{7}"), &*lines("a\nb\u{7}")), ("a\\nb\\u{7}", "a\nb\\u{7}"));
        let all = (0..=0x1f).chain(0x7f..=0x9f).filter_map(char::from_u32);
        assert!(all.clone().count() == 65 && all.into_iter().all(|c| !is_printable(c)));
    }
}

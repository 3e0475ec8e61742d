//! Rust source as tokens, without comments, strings and characters: enough to follow paths.

/// A name or `::`, or one sign of another kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Token<'a> {
    Name(&'a str),
    PathSeparator,
    Sign(char),
}

/// Every token, with its line.
pub(super) fn tokens(text: &str) -> Vec<(Token<'_>, usize)> {
    let mut found = Vec::new();
    let (mut rest, mut line) = (text, 1);
    while let Some(first) = rest.chars().next() {
        let (token, length) = if let Some(length) = passed_over(rest) {
            line += rest[..length].matches('\n').count();
            (None, length)
        } else if first.is_alphabetic() || first == '_' {
            let length = name_length(rest);
            (Some(Token::Name(&rest[..length])), length)
        } else if rest.starts_with("::") {
            (Some(Token::PathSeparator), 2)
        } else {
            (Some(Token::Sign(first)), first.len_utf8())
        };
        found.extend(token.map(|token| (token, line)));
        rest = &rest[length..];
    }
    found
}

fn name_length(text: &str) -> usize {
    text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len())
}

/// How many bytes of white space, comment, number or literal come first; none if it is something else.
fn passed_over(rest: &str) -> Option<usize> {
    let first = rest.chars().next()?;
    if first.is_whitespace() {
        return Some(first.len_utf8());
    }
    if first.is_ascii_digit() {
        return Some(name_length(rest));
    }
    if rest.starts_with("//") {
        return Some(rest.find('\n').unwrap_or(rest.len()));
    }
    if rest.starts_with("/*") {
        return Some(block_comment(rest));
    }
    let unprefixed = rest.trim_start_matches(['b', 'c', 'r']);
    let prefix = rest.len() - unprefixed.len();
    let hashes = unprefixed.len() - unprefixed.trim_start_matches('#').len();
    if rest[..prefix].ends_with('r') && unprefixed[hashes..].starts_with('"') {
        let closing = format!("\"{}", &unprefixed[..hashes]);
        let opened = prefix + hashes + 1;
        return Some(rest[opened..].find(&closing).map_or(rest.len(), |at| opened + at + closing.len()));
    }
    if prefix <= 1 && unprefixed.starts_with('"') {
        return Some(prefix + quoted(unprefixed, '"'));
    }
    if prefix <= 1 && unprefixed.starts_with('\'') {
        let mut letters = unprefixed.chars().skip(1);
        let is_escape = letters.next() == Some('\\');
        // Else it begins a lifetime.
        return (is_escape || letters.next() == Some('\'')).then(|| prefix + quoted(unprefixed, '\''));
    }
    None
}

/// Bytes of a block comment; comments may lie within.
fn block_comment(text: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < text.len() {
        let rest = &text[at..];
        let step = match rest {
            _ if rest.starts_with("/*") => 1,
            _ if rest.starts_with("*/") => -1,
            _ => 0,
        };
        depth += step;
        at += if step == 0 { rest.chars().next().map_or(1, char::len_utf8) } else { 2 };
        if depth == 0 {
            break;
        }
    }
    at
}

/// Bytes of a literal that begins with `quote`, up to its end.
fn quoted(text: &str, quote: char) -> usize {
    let mut is_escaped = false;
    for (at, letter) in text.char_indices().skip(1) {
        match letter {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            _ if letter == quote => return at + 1,
            _ => {}
        }
    }
    text.len()
}

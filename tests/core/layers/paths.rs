//! Which modules of its own crate does a source name?

use super::code::{Token, tokens};

/// The first module below the crate's root that a path leads to, and the line of the path.
///
/// `*` stands for all of them: `use crate::*`, or the root under another name.
pub(super) type Named = (String, usize);

/// Every module below the root that paths in `text` lead to; `module` is where the text lies.
///
/// Paths begin with `crate` or with as many `super` as lead to the root. Those in macros count, for tokens are read.
pub(super) fn named(text: &str, module: &[String]) -> Vec<Named> {
    let tokens = tokens(text);
    let mut found = Vec::new();
    // Modules that are written out in the text, with the depth of braces at which they end.
    let (mut inner, mut depth) = (Vec::new(), 0);
    let mut at = 0;
    while at < tokens.len() {
        let before = at.checked_sub(1).map(|i| tokens[i].0);
        match tokens[at].0 {
            Token::Sign('{') => depth += 1,
            Token::Sign('}') => {
                depth -= 1;
                if inner.last() == Some(&depth) {
                    inner.pop();
                }
            }
            Token::Name("mod") if matches!(tokens.get(at + 2), Some((Token::Sign('{'), _))) => {
                inner.push(depth);
            }
            Token::Name("crate") => {
                let after = tokens.get(at + 1).map(|(token, _)| *token);
                if after == Some(Token::PathSeparator) {
                    heads(&tokens, at + 2, &mut found);
                } else if after == Some(Token::Name("as")) {
                    found.push(("*".to_owned(), tokens[at].1));
                }
            }
            Token::Name("super") if before != Some(Token::PathSeparator) => {
                let mut supers = 1;
                while matches!(tokens.get(at + 1), Some((Token::PathSeparator, _)))
                    && matches!(tokens.get(at + 2), Some((Token::Name("super"), _)))
                {
                    (supers, at) = (supers + 1, at + 2);
                }
                if supers >= module.len() + inner.len()
                    && matches!(tokens.get(at + 1), Some((Token::PathSeparator, _)))
                {
                    heads(&tokens, at + 2, &mut found);
                }
            }
            _ => {}
        }
        at += 1;
    }
    found
}

/// The names that a path goes on with: one, or one for each branch of its braces.
fn heads(tokens: &[(Token<'_>, usize)], at: usize, found: &mut Vec<Named>) {
    match tokens.get(at) {
        Some((Token::Name(name), line)) => found.push(((*name).to_owned(), *line)),
        Some((Token::Sign('*'), line)) => found.push(("*".to_owned(), *line)),
        Some((Token::Sign('{'), _)) => {
            let (mut depth, mut is_head) = (0, false);
            for (token, line) in &tokens[at..] {
                match token {
                    Token::Sign('{') => (depth, is_head) = (depth + 1, depth == 0),
                    Token::Sign('}') if depth == 1 => break,
                    Token::Sign('}') => depth -= 1,
                    Token::Sign(',') => is_head = depth == 1,
                    Token::Sign('*') if is_head => found.push(("*".to_owned(), *line)),
                    // `self as root` is the root under another name.
                    Token::Name("self") if is_head => found.push(("*".to_owned(), *line)),
                    Token::Name(name) if is_head => {
                        found.push(((*name).to_owned(), *line));
                        is_head = false;
                    }
                    _ => {}
                }
            }
        }
        _ => {}
    }
}

//! Quoting of arguments in commands that users paste into a shell.

use super::printable::is_printable;

/// Quotes a word for a POSIX shell. Plain words stay as they are, others are put in apostrophes. Words with unprintable
/// characters are written as a call of `printf`.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    if !word.chars().all(is_printable) {
        // `printf` builds unprintable characters from octal numbers.
        let spelled = word.bytes().map(|byte| match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'_' | b'=' | b'.' | b'/' => {
                char::from(byte).to_string()
            }
            _ => format!("\\{byte:03o}"),
        });
        return format!("\"$(printf '{}')\"", spelled.collect::<String>());
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_read_them() {
        for plain in ["s.toml", "e=-0.5", "out/a-b_c", "title=a:b,c"] {
            assert_eq!(quoted(plain), plain);
        }
        assert_eq!(quoted("title=it's <b>"), r"'title=it'\''s <b>'");
        assert_eq!(quoted("outputs.files=[\"csv\"]"), "'outputs.files=[\"csv\"]'");
        assert_eq!(quoted(""), "''");
    }

    #[cfg(unix)]
    #[test]
    fn a_shell_reads_the_word_back() {
        for word in ["it's", "'", "a b", "$HOME `ls` \\n", "~/x", "a;b|c&d", "#x", "!!", "*?[a]"] {
            let shell = std::process::Command::new("sh")
                .args(["-c", &format!("printf %s {}", quoted(word))])
                .output();
            assert_eq!(String::from_utf8(shell.unwrap().stdout).unwrap(), word);
        }
        for word in ["x\ny", "\u{1b}[31m 100%d 'a' \\n", "title=\u{202e}caf\u{e9} \"b\" 1"] {
            assert!(quoted(word).chars().all(is_printable), "{}", quoted(word));
            let shell = std::process::Command::new("sh")
                .args(["-c", &format!("printf %s {}", quoted(word))])
                .output();
            assert_eq!(String::from_utf8(shell.unwrap().stdout).unwrap(), word);
        }
    }
}

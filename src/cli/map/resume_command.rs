//! The command that goes on with a run, to be pasted into a shell.

use clap::ValueEnum;

use crate::cli::arguments::{EngineChoice, Map};

/// Asks for the same again, and for what is there already.
pub(super) fn resume_command(ask: &Map) -> String {
    let mut words = vec!["rattlemap map".to_owned(), quoted(&ask.run.scene.display().to_string())];
    if let Some(out) = &ask.run.out {
        words.push(format!("--out {}", quoted(&out.display().to_string())));
    }
    if let Some(engine) =
        ask.engine.engine.to_possible_value().filter(|_| ask.engine.engine != EngineChoice::Auto)
    {
        words.push(format!("--engine {}", engine.get_name()));
    }
    words.extend(ask.engine.precision.map(|precision| format!("--precision {}", precision.name())));
    words.extend(ask.run.set.iter().map(|set| format!("--set {}", quoted(set))));
    words.push("--resume".to_owned());
    words.join(" ")
}

/// A word as a POSIX shell takes it: plain where it means itself, else in apostrophes, within
/// which only the apostrophe means anything.
pub(crate) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
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
        for word in ["it's", "'", "a b", "$HOME `ls` \\n", "~/x", "a;b|c&d", "#x", "!!", "x\ny", "*?[a]"] {
            let shell = std::process::Command::new("sh")
                .args(["-c", &format!("printf %s {}", quoted(word))])
                .output();
            assert_eq!(String::from_utf8(shell.unwrap().stdout).unwrap(), word);
        }
    }
}

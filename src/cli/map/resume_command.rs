//! The command that goes on with a run, or begins it anew, to be pasted into a shell.

use clap::ValueEnum;

use crate::cli::arguments::{EngineChoice, EngineOptions, Map};
use crate::map::printable::is_printable;

/// Asks for the same again, and for what is there already.
pub(super) fn resume_command(ask: &Map) -> String {
    command(ask, &ask.engine, "--resume")
}

/// Asks for the same again, in the place of what is there.
pub(super) fn same_command(ask: &Map) -> String {
    command(ask, &ask.engine, "--force")
}

/// Asks for the same map of the CPU engine, in the place of what is there: it does not go on with another's records.
pub(super) fn cpu_command(ask: &Map) -> String {
    command(ask, &EngineOptions { engine: EngineChoice::Cpu, precision: None, adapter: None }, "--force")
}

fn command(ask: &Map, engine: &EngineOptions, last: &str) -> String {
    let mut words = vec!["rattlemap map".to_owned(), quoted(&ask.run.scene.display().to_string())];
    if let Some(out) = &ask.run.out {
        words.push(format!("--out {}", quoted(&out.display().to_string())));
    }
    if let Some(named) = engine.engine.to_possible_value().filter(|_| engine.engine != EngineChoice::Auto) {
        words.push(format!("--engine {}", named.get_name()));
    }
    words.extend(engine.precision.map(|precision| format!("--precision {}", precision.name())));
    let adapter = engine.adapter.as_ref();
    words.extend(adapter.map(|adapter| format!("--adapter {}", quoted(&adapter.to_string()))));
    words.extend(ask.run.set.iter().map(|set| format!("--set {}", quoted(set))));
    words.extend(ask.json.then(|| "--json".to_owned()));
    words.push(last.to_owned());
    words.join(" ")
}

/// A word as a POSIX shell takes it: plain where it means itself, else in apostrophes, within
/// which only the apostrophe means anything; by `printf` where a terminal would not show it as it is.
pub(crate) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    if !word.chars().all(is_printable) {
        // What no terminal shows is spelled out byte by byte, for `printf` to make it again.
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

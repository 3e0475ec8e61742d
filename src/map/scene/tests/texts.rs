//! Long texts, many errors, and unprintable characters.

use super::*;
use crate::text::printable::is_printable;
use std::time::Instant;

#[test]
fn long_titles_are_refused() {
    let titled = |count: usize| GOOD.replacen("A scene", &"\u{e9}".repeat(count), 1);
    assert_eq!(parse(&titled(200), &[]).unwrap().title().chars().count(), 200);
    let message = parse(&titled(201), &[]).unwrap_err().to_string();
    assert_says(&message, &["s.toml:1:9: `title = ", "at most 200 characters long; it has 201, shorten it"]);
    assert!(message.len() < 300, "{message}");
    let set = format!("title={}", "x".repeat(10_000));
    let message = parse(GOOD, &[&set]).unwrap_err().to_string();
    assert_says(&message, &["--set title=xxx", "at most 200 characters long; it has 10000"]);
    assert!(message.len() < 400, "{message}");
    let scene = Scene::builder(GearPair::paper(0.5)).axis("omega", 1.0..=2.0, 2).title(&"x".repeat(300));
    let built = scene.build_for(Purpose::Bifurcation).unwrap_err().to_string();
    assert_says(&built, &["`title = ", "it has 300"]);
}

/// Places in a text with long lines and characters of several bytes.
#[test]
fn errors_show_line_and_column() {
    let mut text = String::from("# \u{3c9} and \u{1f600}\r\n\n[parameters]\n");
    for k in 0..300 {
        let gap = ["", "\n", " # caf\u{e9} \u{2192}\n\n", "\n# \u{1f600}\n"][k % 4];
        text += &format!(
            "x{k} = {{ '\u{e9}' = {k}, b = ['\u{3c9}', {k}] }}{}{gap}",
            if gap.contains('\n') { "" } else { "\n" }
        );
    }
    let document = document::read(&text, "s").unwrap();
    let lines: Vec<&str> = text.split('\n').collect();
    fn walk(node: &Node, lines: &[&str], count: &mut usize) {
        let children: Vec<(Option<&str>, &Node)> = match &node.value {
            document::Value::Table(table) => table.iter().map(|(name, node)| (Some(&**name), node)).collect(),
            document::Value::List(items) => items.iter().map(|node| (None, node)).collect(),
            _ => return,
        };
        for (name, child) in children {
            for (place, text) in [
                (&child.name_place, name),
                (&child.place, Some(&*child.excerpt).filter(|excerpt| *excerpt != "{ ... }")),
            ] {
                let Some(text) = text else { continue };
                let Place::Text { line, column, .. } = place else { panic!("{place:?}") };
                let rest: String = lines[line - 1].chars().skip(column - 1).collect();
                assert!(
                    rest.trim_start_matches('\'').starts_with(text.trim_start_matches('\'')),
                    "{place}: {text} {rest}"
                );
                *count += 1;
            }
            walk(child, lines, count);
        }
    }
    let mut count = 0;
    walk(&document, &lines, &mut count);
    assert!(count > 2000, "{count}");
}

/// The message names one of many unknown fields and counts the others, in a single pass over the text.
#[test]
fn thousands_of_unknown_fields_give_one_message() {
    let many: String = (0..20_000).map(|k| format!("unknown{k} = [{k}, 'x']\n")).collect();
    let inline: Vec<String> = (0..20_000).map(|k| format!("unknown{k} = {k}")).collect();
    let clock = Instant::now();
    let message = parse(&format!("{many}{GOOD}"), &[]).unwrap_err().to_string();
    assert_says(
        &message,
        &["s.toml:1:1: unknown field `unknown0 = [0, 'x']`; valid names: title", "; 19999 more fields"],
    );
    // All fields on one line.
    let table = format!(
        "parameters = {{ {} }}
",
        inline.join(", ")
    );
    let message = parse(
        &(table
            + &GOOD.replacen(
                "[parameters]
F = 50.0
",
                "",
                1,
            )),
        &[],
    )
    .unwrap_err()
    .to_string();
    assert_says(&message, &["s.toml:1:16: unknown field `parameters.unknown0 = 0`", "; 19999 more fields"]);
    assert!(clock.elapsed().as_secs() < 4, "{:?}", clock.elapsed());
    let message = refusal("F = 50.0", "f = 1\nG = 2");
    assert_says(&message, &["`parameters.G = 2`", "; 1 more field is unknown"]);
}

/// A name of a million letters is shortened in the message and compared with no known name.
#[test]
fn very_long_names_are_shortened() {
    let name = "omega".repeat(200_000);
    for message in [refusal("F = 50.0", &format!("{name} = 1")), refusal("\"e\"", &format!("'{name}'"))] {
        assert_says(&message, &["omegaomega", "...", "valid names: m1"]);
        // The message also contains the meanings of the parameters, in parentheses.
        let parameters = rattlemap_dynamics::model::GearPair::PARAMETERS.iter();
        let meanings: usize = parameters.map(|parameter| parameter.meaning.len() + 3).sum();
        assert!(message.len() - meanings < 500, "{}", message.len());
    }
    let message = parse(GOOD, &[&format!("{name}.x=1")]).unwrap_err().to_string();
    assert!(message.len() < 500 && message.contains("..."), "{}", message.len());
    // A path with too many names for recursion.
    let message = parse(GOOD, &[&format!("{}=1", vec!["a"; 50_000].join("."))]).unwrap_err().to_string();
    assert_says(&message, &["no setting has so many names", "axis.0.count"]);
    assert!(message.len() < 500, "{}", message.len());
}

/// Unprintable characters are escaped in names, values, syntax errors, arguments and the file's name.
#[test]
fn messages_are_one_line_that_a_terminal_shows_as_it_is() {
    let evil = "\u{1b}]0;x\u{7}\u{9b}31m\u{202e}\u{7f}";
    let in_toml: String = evil.chars().map(|c| format!("\\u{:04X}", u32::from(c))).collect();
    let sets = |set: String| parse(GOOD, &[&set]).unwrap_err();
    let all = [
        parse(&GOOD.replacen("F = ", &format!("\"{in_toml}\\nF\" = "), 1), &[]).unwrap_err(),
        parse(&GOOD.replacen("\"e\"", &format!("\"{in_toml}\""), 1), &[]).unwrap_err(),
        parse(&GOOD.replacen("\"e\"", "\"\u{9b}31m\u{202e}\"", 1), &[]).unwrap_err(),
        parse(&GOOD.replacen("F = 50.0", &format!("F = {evil}"), 1), &[]).unwrap_err(),
        parse(&format!("{evil} ="), &[]).unwrap_err(),
        sets(format!("{evil}\nx=1")),
        sets(format!("F={evil}")),
        sets(format!("axis.{evil}.count=1")),
        sets(format!("title.{evil}=1")),
        sets(evil.to_owned()),
        Scene::parse("", &format!("a{evil}\nb.toml"), &[], Purpose::Map).unwrap_err(),
    ];
    for error in all {
        let message = error.to_string();
        assert!(message.chars().all(is_printable), "{message:?}");
        assert!(
            ["\\u{", "\\u0", "invalid"].iter().any(|part| message.to_lowercase().contains(part)),
            "{message}"
        );
    }
}

//! Checks of the documents: links have targets, tables agree with the code, and named tests exist.

use std::fs;
use std::path::{Path, PathBuf};

/// Returns the Markdown files of the repository.
fn texts() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = [
        "",
        "docs",
        "docs/decisions",
        "results",
        "results/gallery",
        "results/h200",
        "results/reliability",
        "benches",
        "benches/peers",
        "fuzz",
    ];
    let mut texts = Vec::new();
    for folder in folders.map(|folder| root.join(folder)) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "md") {
                texts.push(path);
            }
        }
    }
    assert!(texts.len() >= 9, "{texts:?}");
    texts
}

/// Returns the targets of `[text](target)` in a text, without code blocks.
fn links(text: &str) -> Vec<&str> {
    let prose = text.split("\n```").step_by(2);
    let starts = prose.flat_map(|part| part.split("](").skip(1));
    starts.filter_map(|rest| rest.split_once(')')).map(|(target, _)| target).collect()
}

/// Returns the anchor of a heading: lower case, spaces as hyphens, without punctuation.
fn anchor(heading: &str) -> String {
    let characters = heading.trim_start_matches('#').trim().chars();
    let characters = characters.filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    characters.map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect()
}

#[test]
fn links_have_targets() {
    let mut checked = 0;
    for path in texts() {
        let text = fs::read_to_string(&path).unwrap();
        for link in links(&text).into_iter().filter(|link| !link.starts_with("https://")) {
            let (file, fragment) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { path.clone() } else { path.parent().unwrap().join(file) };
            assert!(target.exists(), "{}: nothing at {link}", path.display());
            if !fragment.is_empty() {
                let there = fs::read_to_string(&target).unwrap();
                let has = there.lines().any(|line| line.starts_with('#') && anchor(line) == fragment);
                assert!(has, "{}: no heading for {link}", path.display());
            }
            checked += 1;
        }
    }
    assert!(checked > 50, "{checked} links");
}

/// Code spans that begin with a folder of the repository are paths of it.
#[test]
fn paths_in_documents_for_developers_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let is_for_developers = |path: &PathBuf| {
        path.ends_with("ARCHITECTURE.md")
            || path.ends_with("CONTRIBUTING.md")
            || path.parent().is_some_and(|folder| folder.ends_with("docs/decisions"))
    };
    let mut found = 0;
    for document in texts().into_iter().filter(is_for_developers) {
        let text = fs::read_to_string(&document).unwrap();
        for span in text.split('`').skip(1).step_by(2).filter(|span| !span.contains([' ', '\n'])) {
            let is_path = span.split_once('/').is_some_and(|(folder, _)| root.join(folder).is_dir());
            if is_path {
                assert!(root.join(span).exists(), "{}: no {span}", document.display());
                found += 1;
            }
        }
    }
    assert!(found > 80, "{found} paths");
}

#[test]
fn readme_and_architecture_are_short() {
    for (name, limit) in [("README.md", 900), ("ARCHITECTURE.md", 1300)] {
        let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap();
        let words = text.split_whitespace().count();
        assert!(words <= limit, "{name} has {words} words; the limit is {limit}");
    }
}

/// Times that README states are those whose commands docs/conformance.md names.
#[test]
fn readme_states_the_times_of_conformance() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let [readme, conformance] =
        ["README.md", "docs/conformance.md"].map(|name| fs::read_to_string(root.join(name)).unwrap());
    let stated = ["fifteen seconds on two cores", "a thousand values in one second"];
    let claimed = [
        "the main map takes fifteen seconds on two cores",
        "a diagram of a thousand values takes one second",
    ];
    for (stated, claimed) in stated.iter().zip(claimed) {
        assert!(readme.contains(stated) && conformance.contains(claimed), "{stated}");
    }
    assert_eq!(readme.matches(" second").count(), stated.len(), "README states another time");
}

/// Descriptions of the whole program state the largest number of coordinates.
#[test]
fn descriptions_state_the_most_coordinates() {
    assert_eq!(rattlemap_dynamics::model::MOST_COORDINATES, 8, "the texts below say eight");
    for name in ["README.md", "CITATION.cff", "docs/python.ipynb", "docs/models.md"] {
        let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap();
        let says = ["eight coordinates", "eight degrees of freedom"].iter().any(|words| text.contains(words));
        assert!(says, "{name}");
    }
}

/// The website has all documents for users and all pages of results.
#[test]
fn the_website_has_every_document() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let summary = fs::read_to_string(root.join("site/SUMMARY.md")).unwrap();
    for path in texts() {
        let name = path.strip_prefix(root).unwrap().to_str().unwrap();
        let is_of_site = (name.starts_with("docs/") && !name.starts_with("docs/decisions/"))
            || name.starts_with("results/") && name.ends_with("README.md");
        assert!(!is_of_site || summary.contains(&format!("({name})")), "site/SUMMARY.md has no {name}");
    }
}

/// Each row of docs/conformance.md names a test or a command. Each test exists, those marked *long* are the ignored ones, and each row
/// has a command or a test of the default run.
#[test]
fn tests_that_conformance_names_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("docs/conformance.md")).unwrap();
    let mut tests = 0;
    for row in text.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| claim")) {
        let Some((_, shown_by)) = row.trim_end_matches(" |").rsplit_once(" | ") else { continue };
        if shown_by == "---" {
            continue;
        }
        let spans: Vec<&str> = shown_by.split('`').skip(1).step_by(2).collect();
        assert!(!spans.is_empty(), "no test or command in: {row}");
        let mut is_shown = spans.iter().any(|span| !span.contains(": "));
        for (file, name) in spans.iter().filter_map(|span| span.split_once(": ")) {
            let source = fs::read_to_string(root.join(file))
                .unwrap_or_else(|error| panic!("{file}: {error}; row: {row}"));
            let has = |keyword| source.contains(&format!("{keyword} {name}("));
            assert!(has("fn") || has("def"), "{file} has no test {name}; row: {row}");
            let before = source.split(&format!("fn {name}(")).next().unwrap();
            let is_ignored =
                before.trim_end().lines().next_back().is_some_and(|line| line.starts_with("#[ignore"));
            let marked = row.split(&format!("{name}`")).nth(1).is_some_and(|rest| rest.starts_with(" (long"));
            assert_eq!(is_ignored, marked, "{file}: {name}: ignored, and marked as long in the row: {row}");
            is_shown |= !is_ignored;
            tests += 1;
        }
        assert!(is_shown, "only long tests in: {row}");
    }
    assert!(tests > 40, "{tests} tests");
}

#[test]
fn anchors_and_links_are_parsed() {
    assert_eq!(
        anchor("## Where the attractor changes, omega = 5.6"),
        "where-the-attractor-changes-omega--56"
    );
    assert_eq!(links("[a](b) c\n```\n[d](e)\n```\n[f](g#h)"), ["b", "g#h"]);
}

/// The program contains fonts, whose licences NOTICE must contain.
#[test]
fn every_font_in_the_program_has_its_notice() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let notice = fs::read_to_string(root.join("NOTICE")).unwrap();
    let mut used = Vec::new();
    for folder in ["src", "benches/src"] {
        for source in super::layers::sources(&root.join(folder)) {
            let text = fs::read_to_string(&source).unwrap();
            let names = text.split("epaint_default_fonts::").skip(1);
            used.extend(names.map(|rest| {
                rest.split(|c: char| !c.is_ascii_uppercase() && c != '_').next().unwrap().to_owned()
            }));
        }
    }
    used.dedup();
    assert_eq!(used, ["UBUNTU_LIGHT"], "a font without its notice");
    for part in [
        "Ubuntu-Light.ttf",
        "Copyright 2011 Canonical Ltd.",
        "UBUNTU FONT LICENCE Version 1.0",
        "PERMISSION & CONDITIONS",
    ] {
        assert!(notice.contains(part), "{part}");
    }
}

/// docs/model.md lists the parameters, classes and statuses of the code.
#[test]
fn model_page_agrees_with_the_code() {
    use rattlemap::model::GearPair;
    use rattlemap_dynamics::orbit::{Class, Status};
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("docs/model.md")).unwrap();
    // Rows of the table with this head.
    let rows = |head: &str| -> Vec<String> {
        let table = text.split_once(&format!("\n| {head} |")).unwrap_or_else(|| panic!("no table {head}")).1;
        table.lines().skip(2).take_while(|line| line.starts_with('|')).map(str::to_owned).collect()
    };
    let parameters = GearPair::PARAMETERS.iter().map(|p| {
        let default = p.default.map_or("-".to_owned(), |value| value.to_string());
        format!("| {} | {default} | {} | {} |", p.name, p.range.requirement(), p.meaning)
    });
    assert_eq!(
        rows("symbol | default"),
        parameters.collect::<Vec<_>>(),
        "docs/model.md differs from the code; replace its rows with the lines on the right"
    );
    let firsts = |head| -> Vec<String> {
        rows(head).iter().map(|row| row.split('|').nth(1).unwrap().trim().to_owned()).collect()
    };
    assert_eq!(firsts("class | meaning"), Class::NAMES);
    assert_eq!(firsts("status | meaning"), Status::ALL.map(|status| status.name().to_owned()));
}

/// docs/scenes.md lists the parser's table of keys. With REGENERATE set, the test writes the list.
#[test]
fn the_keys_of_scenes_are_those_of_the_parser() {
    use rattlemap::map::scene::KEYS;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/scenes.md");
    let text = fs::read_to_string(&path).unwrap();
    let head = "| table | key | default | range | meaning |\n| --- | --- | --- | --- | --- |\n";
    let (before, rest) = text.split_once(head).expect("the table of keys");
    let end = rest.find("\n\n").expect("the end of the table of keys") + 1;
    let row = |key: &rattlemap::map::scene::Key| {
        let table = match key.table {
            "" => String::new(),
            "axis" => "`[[axis]]`".to_owned(),
            table => format!("`[{table}]`"),
        };
        let (default, range) = (key.default.in_words(), key.takes.in_words());
        format!("| {table} | {} | {default} | {range} | {} |\n", key.name, key.meaning)
    };
    let expected: String = KEYS.iter().map(row).collect();
    if std::env::var_os("REGENERATE").is_some() {
        fs::write(&path, format!("{before}{head}{expected}{}", &rest[end..])).unwrap();
    } else {
        assert_eq!(
            &rest[..end],
            expected,
            "docs/scenes.md differs from src/map/scene/keys.rs; \
             `REGENERATE=1 cargo test --test library the_keys_of_scenes` writes it again"
        );
    }
}

//! Random scenes: mutated ones and arbitrary text. None makes the reader panic; accepted scenes are valid, and errors
//! have a place, a cause and a remedy.

use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use rattlemap::map::scene::{Axis, FileText, Place, Problem, Purpose, Scene, SceneError, Steps};
use rattlemap::text::printable::line;
use rattlemap_dynamics::model::{GearPair, Parameter};

const SCENES: [&str; 5] = [
    include_str!("../../scenes/e_omega.toml"),
    include_str!("../../scenes/paper_fig5.toml"),
    include_str!("../../scenes/smoke.toml"),
    include_str!("../../scenes/adaptive.toml"),
    include_str!("../../scenes/k_F.toml"),
];

/// Values of every type, most of them invalid.
#[rustfmt::skip]
const VALUES: [&str; 36] = [
    "0", "-0.0", "1", "2", "64", "0.5", "1e-300", "1e308", "-1e308", "1e400", "inf", "-inf", "nan",
    "1_000_000_000", "9223372036854775807", "99999999999999999999", "0x7f", "true", "false", "\"auto\"",
    "\"e\"", "\"omega\"", "'state'", "[]", "[1, 2, 3, 4]", "[0.25, 0.5]", "[0.5, 1e400, nan]", "\"log\"",
    "\"0.5*k1\"", "\"-2^k^(r - \"", "\"min(m1, 1/m2)\"", "\"k2\"", "\"points.csv\"", "{ a = 1 }",
    "1979-05-27", "\"\u{fffd}\\u0000\"",
];

/// Known names, and some unknown ones.
fn names() -> Vec<&'static str> {
    let fields = "title model parameters axis integration start refine outputs parameter min max count \
                  steps_per_period transient_periods observed_periods early_stop undecided_periods confirm_chaos max_period policy \
                  state scale values derived cells file derived.k2 derived.e axis.0.values axis.1.scale cells.file \
                  minimum_grid rounds max_error audit word continuous quantities files axis.0.min axis.1.count \
                  axis.9.min integration.max_period K Omega eps \u{3c9} a.b.c";
    fields.split_whitespace().chain(GearPair::PARAMETERS.iter().map(|p: &Parameter| &*p.name)).collect()
}

#[derive(Clone, Debug)]
enum Mutation {
    Drop(prop::sample::Index),
    Repeat(prop::sample::Index),
    Swap(prop::sample::Index, prop::sample::Index),
    Value(prop::sample::Index, &'static str),
    Name(prop::sample::Index, &'static str),
    Insert(prop::sample::Index, String),
    Character(prop::sample::Index, char),
    Cut(prop::sample::Index),
}

fn mutations() -> impl Strategy<Value = Vec<Mutation>> {
    let at = any::<prop::sample::Index>;
    let value = prop::sample::select(VALUES.to_vec());
    let name = prop::sample::select(names());
    let one = prop_oneof![
        1 => at().prop_map(Mutation::Drop),
        1 => at().prop_map(Mutation::Repeat),
        1 => (at(), at()).prop_map(|(a, b)| Mutation::Swap(a, b)),
        4 => (at(), value.clone()).prop_map(|(a, v)| Mutation::Value(a, v)),
        2 => (at(), name.clone()).prop_map(|(a, n)| Mutation::Name(a, n)),
        2 => (at(), name, value).prop_map(|(a, n, v)| Mutation::Insert(a, format!("{n} = {v}"))),
        1 => (at(), any::<char>()).prop_map(|(a, c)| Mutation::Character(a, c)),
        1 => at().prop_map(Mutation::Cut),
    ];
    prop::collection::vec(one, 1..4)
}

fn mutated(scene: &str, mutations: &[Mutation]) -> String {
    let mut lines: Vec<String> = scene.lines().map(str::to_owned).collect();
    for mutation in mutations {
        if lines.is_empty() {
            break;
        }
        let count = lines.len();
        let at = |index: &prop::sample::Index| index.index(count);
        match mutation {
            Mutation::Drop(i) => drop(lines.remove(at(i))),
            Mutation::Repeat(i) => lines.insert(at(i), lines[at(i)].clone()),
            Mutation::Swap(i, j) => lines.swap(at(i), at(j)),
            Mutation::Value(i, value) => {
                if let Some((name, _)) = lines[at(i)].split_once('=') {
                    lines[at(i)] = format!("{name}= {value}");
                }
            }
            Mutation::Name(i, name) => {
                if let Some((_, value)) = lines[at(i)].split_once('=') {
                    lines[at(i)] = format!("{name} ={value}");
                }
            }
            Mutation::Insert(i, line) => lines.insert(at(i), line.clone()),
            Mutation::Character(i, c) => {
                let place = lines[at(i)].char_indices().nth(at(i)).map_or(0, |(place, _)| place);
                lines[at(i)].insert(place, *c);
            }
            Mutation::Cut(i) => lines.truncate(at(i)),
        }
    }
    lines.join("\n")
}

/// Checks an accepted scene.
fn check_scene(scene: &Scene, purpose: Purpose) -> Result<(), TestCaseError> {
    let axes = scene.axes();
    if let Some(list) = scene.list() {
        prop_assert!(axes.is_empty() && purpose == Purpose::Map && list.len() == 2);
        prop_assert!((0..2).all(|i| scene.cell(&[i]).oscillator().is_ok()));
        return Ok(());
    }
    prop_assert_eq!(axes.len(), if purpose == Purpose::Map { 2 } else { 1 });
    for ends in 0..1usize << axes.len() {
        let index = |(i, axis): (usize, &Axis)| if ends >> i & 1 == 0 { 0 } else { axis.count() - 1 };
        let pair = scene.cell(&axes.iter().enumerate().map(index).collect::<Vec<_>>());
        prop_assert!(pair.oscillator().is_ok(), "{:?}", pair);
        for (i, axis) in axes.iter().enumerate() {
            prop_assert!(axis.min() < axis.max() && axis.count() >= 2);
            let end = if ends >> i & 1 == 0 { axis.min() } else { axis.max() };
            prop_assert_eq!(pair.get(&axis.parameter().name).unwrap(), end);
        }
    }
    for axis in axes {
        let values: Vec<f64> = axis.values().take(100).collect();
        prop_assert!(
            values.is_sorted() && values.iter().all(|value| axis.parameter().range.contains(*value))
        );
    }
    let integration = scene.integration();
    prop_assert!(integration.transient_periods >= 1 && integration.max_period >= 1);
    prop_assert!(2 * u64::from(integration.max_period) <= u64::from(integration.observed_periods));
    if let Steps::PerPeriod(steps) = integration.steps_per_period {
        prop_assert!(steps >= 1);
    }
    Ok(())
}

/// Random tables of cells: none makes the reader panic, and errors have a place.
#[test]
fn any_table_is_valid_or_has_an_error_with_a_place() {
    let scene = "[parameters]\ne = 0.5\n[cells]\nfile = \"t\"\n[derived]\nk2 = \"2*k1\"\n";
    let field = prop_oneof![
        3 => "[0-9]{1,3}(\\.[0-9]{1,2})?(e[0-9])?",
        2 => prop::sample::select(names()).prop_map(str::to_owned),
        1 => "\\PC{0,6}",
    ];
    let row = prop::collection::vec(field, 1..4).prop_map(|fields| fields.join(","));
    let header = prop::sample::select(vec!["omega,k1", "F", "r,r1,r2", "e", "x,y", ""]);
    let table = (header, prop::collection::vec(row, 0..4))
        .prop_map(|(header, rows)| format!("{header}\n{}", rows.join("\n")));
    torture(&table, |table| {
        let find = |_, _: &str| Ok(FileText { name: LIST.0.to_owned(), text: table.clone() });
        match Scene::parse_with_files(scene, "scene.toml", &[], Purpose::Map, None, &find) {
            Ok(scene) => {
                let list = scene.list().unwrap();
                prop_assert!(!list.is_empty() && scene.cell_count() == list.len() as u64);
                let again = list.to_csv();
                let find = |_, _: &str| Ok(FileText { name: LIST.0.to_owned(), text: again.clone() });
                let again =
                    Scene::parse_with_files(scene.text(), "s", &[], Purpose::Map, None, &find).unwrap();
                prop_assert_eq!(again.identity(), scene.identity());
            }
            Err(error) => {
                let message = error.to_string();
                prop_assert!(!message.contains('\n') && message.len() > 20, "{:?}", message);
                if let Place::Text { line, column, file } = &error.place
                    && &**file == LIST.0
                {
                    prop_assert!(
                        *line >= 1 && *line <= table.lines().count().max(1) && *column >= 1,
                        "{}",
                        message
                    );
                }
            }
        }
        Ok(())
    });
}

/// Checks that an error is one line, has a place in the text or names its argument, and has a remedy.
fn check_refusal(error: &SceneError, text: &str, sets: &[String]) -> Result<(), TestCaseError> {
    let message = error.to_string();
    prop_assert!(!message.contains('\n'), "more than a line: {message:?}");
    match &error.place {
        Place::Text { line, column, file } if &**file == LIST.0 => {
            prop_assert!(*line <= LIST.1.lines().count() && *column >= 1, "{}", message);
        }
        Place::Text { line, column, .. } => {
            prop_assert!(*line >= 1 && *line <= text.lines().count().max(1) + 1, "{}", message);
            prop_assert!(*column >= 1, "{}", message);
        }
        Place::Set { argument } => prop_assert!(sets.iter().any(|set| **set == **argument), "{}", message),
        Place::Option { .. } => {
            return Err(TestCaseError::fail(format!("no such option was given: {message}")));
        }
        Place::Builder => return Err(TestCaseError::fail(format!("nothing was built: {message}"))),
        Place::File { .. } => return Err(TestCaseError::fail(format!("no file was read: {message}"))),
    }
    let remedy = match &error.problem {
        Problem::Syntax { message, .. } => message,
        Problem::NoMotion { reason, .. } => &reason.to_string(),
        Problem::NotAnAssignment => return Ok(()),
        Problem::Value { detail, .. } => detail,
        Problem::Table { message } => message,
        Problem::Missing { remedy, .. } => remedy,
        Problem::Unreadable { .. } => {
            return Err(TestCaseError::fail(format!("no file was read: {message}")));
        }
    };
    // Messages escape control characters of the input.
    prop_assert!(remedy.len() > 3 && message.contains(&*line(remedy)), "no remedy: {message:?}");
    Ok(())
}

/// Name and contents of every file of cells.
const LIST: (&str, &str) = ("points.csv", "omega,k\n5.6,900\n7,1e4\n");

fn parse(text: &str, sets: &[String], purpose: Purpose) -> Result<Scene, SceneError> {
    let find = |_, _: &str| Ok(FileText { name: LIST.0.to_owned(), text: LIST.1.to_owned() });
    Scene::parse_with_files(text, "scene.toml", sets, purpose, None, &find)
}

fn check(text: &str, sets: &[String]) -> Result<(), TestCaseError> {
    for purpose in [Purpose::Map, Purpose::Bifurcation] {
        match parse(text, sets, purpose) {
            Ok(scene) => check_scene(&scene, purpose)?,
            Err(error) => check_refusal(&error, text, sets)?,
        }
    }
    Ok(())
}

/// Some `NAME=VALUE` arguments, and some other texts.
fn arguments() -> impl Strategy<Value = Vec<String>> {
    let known = (prop::sample::select(names()), prop::sample::select(VALUES.to_vec()));
    let one = prop_oneof![6 => known.prop_map(|(name, value)| format!("{name}={value}")), 1 => "\\PC{0,12}".boxed()];
    prop::collection::vec(one, 0..2)
}

/// Tests values of a strategy: 20,000, or the number in the environment variable `RATTLEMAP_TORTURE`. Prints a line
/// that scripts read.
fn torture<S: Strategy>(strategy: &S, test: impl Fn(S::Value) -> Result<(), TestCaseError>) {
    let requested = std::env::var("RATTLEMAP_TORTURE").ok().and_then(|count| count.parse().ok());
    let config = ProptestConfig {
        cases: requested.unwrap_or(20_000),
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    let cases = config.cases;
    let ended = TestRunner::new(config).run(strategy, test);
    println!("torture: scenes {cases}, faults {}", u32::from(ended.is_err()));
    if let Err(fault) = ended {
        panic!("{fault}");
    }
}

#[test]
fn mutated_scenes_are_valid_or_have_an_error_with_a_remedy() {
    let scene = prop::sample::select(SCENES.to_vec());
    torture(&(scene, mutations(), arguments()), |(scene, mutations, sets)| {
        check(&mutated(scene, &mutations), &sets)
    });
}

#[test]
fn any_text_has_an_error_with_a_remedy() {
    torture(&"\\PC{0,80}(\\n\\PC{0,40}){0,6}", |text| check(&text, &[]));
}

/// Many mutated scenes are accepted, and all kinds of errors occur.
#[test]
fn mutated_scenes_reach_all_kinds_of_errors() {
    use proptest::strategy::ValueTree;
    let mut runner = TestRunner::deterministic();
    let (mut accepted, mut kinds) = (0, std::collections::BTreeSet::new());
    let strategy = (prop::sample::select(SCENES.to_vec()), mutations(), arguments());
    for _ in 0..15_000 {
        let (scene, mutations, sets) = strategy.new_tree(&mut runner).unwrap().current();
        match parse(&mutated(scene, &mutations), &sets, Purpose::Map) {
            Ok(_) => accepted += 1,
            Err(error) => {
                kinds.insert(match &error.problem {
                    Problem::Value { fault, .. } => format!("{fault:?}"),
                    problem => format!("{problem:?}").split([' ', '{']).next().unwrap_or_default().to_owned(),
                });
            }
        }
    }
    println!("{accepted} accepted, refused: {kinds:?}");
    assert!(accepted > 300, "{accepted}");
    assert_eq!(kinds.len(), 11, "{kinds:?}");
}

//! Reading of model files: the values of valid files, and every kind of error.

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::model::{
    self, Contact, Domain, Drive, DryFriction, Forces, GapRow, Harmonic, Model, Pair, Range, Restitution,
    Shapes, Side, Spring, Timing,
};

use super::*;
use crate::text::test_cases;

const ONE_DEGREE: &str = r#"name = "stop"
title = "One stop"
source = "a book"

[parameters]
omega = { default = 2.0, min = 0.0, open = true, meaning = "excitation frequency" }
zeta = { default = 0.25, min = 0, meaning = "damping ratio" }
F = 1.5
s = { default = 0.2, min = -1.0, max = 1.0 }
e = { default = 0.8, min = 0.0, max = 1.0, required = true }
k = 1000

[motion]
coordinates = ["x"]
mass = [["1"]]
damping = [["2*zeta"]]
stiffness = [[1]]
force = ["F*omega^2"]
load = ["-0.5"]
frequency = "omega"
gap = [1]

[[contact]]
side = "right"
at = "s"
law = "impact"
restitution = "e"
"#;

const TWO_DEGREES: &str = r#"name = "two"

[parameters]
m = 2.0
k = 3.0
c = 0.5
d = 0.25

[motion]
coordinates = ["a", "b"]
velocities = ["va", "vb"]
bodies = ["rotor", "stator"]
mass = [["m", "0.5"], ["0.5", "1"]]
damping = [["c", "-c"], ["-c", "c + d"]]
stiffness = [["k", "-k"], ["-k", "k+1"]]
frequency = "1.5"
gap = ["1", "-2"]
force = [0, 0]
[[contact]]
side = "left"
at = "-d"
law = "elastic"
stiffness = "10*k"
damping = "c"

[[contact]]
side = "right"
at = "d"
law = "impact"
restitution = 0.5
mesh_speed = "c/10"
stiffness = "100"
"#;

fn read(text: &str) -> FileModel {
    FileModel::parse(text, "m.toml").unwrap_or_else(|error| panic!("{error}"))
}

/// Checks the messages for `text` with changes, from lines of the form `old | new | part of the message`.
#[track_caller]
fn check_refusals(text: &str, cases: &str) {
    for [old, new, expected] in test_cases(cases) {
        assert!(text.contains(&old), "{old:?} is not in the model");
        check_refusal(&text.replacen(&old, &new, 1), &expected);
    }
}

/// Checks that the message for a text contains a part.
#[track_caller]
fn check_refusal(text: &str, expected: &str) {
    let message = FileModel::parse(text, "m.toml").expect_err(expected).to_string();
    assert!(message.contains(expected), "expected {expected:?} in: {message}");
}

#[test]
fn all_fields_of_a_file_are_read() {
    let model = read(ONE_DEGREE);
    assert_eq!((model.name(), model.title(), model.source()), ("stop", "One stop", Some("a book")));
    assert_eq!((model.state_names(), model.bodies()), (vec!["x", "v"], vec!["x"]));
    let names: Vec<&str> = model.parameters().iter().map(|p| &*p.name).collect();
    assert_eq!(names, ["omega", "zeta", "F", "s", "e", "k"]);
    let of = |name: &str| &model.parameters()[model.index(name).unwrap()];
    assert_eq!(of("omega").meaning, "excitation frequency");
    assert_eq!((of("F").meaning.as_ref(), of("F").default, of("F").range), ("F", Some(1.5), Range::Finite));
    assert_eq!(of("s").range, Range::new(-1.0, 1.0, false));
    assert_eq!((of("e").default, model.get("e"), of("e").range), (None, Ok(0.8), Range::Unit));
    let shapes: Vec<Shapes> = model.parameters().iter().map(|p| p.shapes).collect();
    let [oscillator, law, neither] = [Shapes::Oscillator, Shapes::Law, Shapes::Neither];
    assert_eq!(shapes, [oscillator, oscillator, oscillator, oscillator, law, neither]);
    assert_eq!(model.frequency(), [0]);
    let oscillator = pair(&model);
    assert_eq!((oscillator.degrees, oscillator.gap, oscillator.omega), (1, [1.0, 0.0], 2.0));
    assert_eq!(oscillator.mass, [[1.0, 0.0], [0.0, 1.0]]);
    assert_eq!(oscillator.force, [6.0, 0.0]);
    assert_eq!(oscillator.walls, [0.2, f64::NEG_INFINITY]);
    assert_eq!(oscillator.contacts[0], Contact::Rigid);
    let free =
        Domain { damping: [[0.5, 0.0], [0.0; 2]], stiffness: [[1.0, 0.0], [0.0; 2]], load: [-0.5, 0.0] };
    assert_eq!(oscillator.free, free);
    assert_eq!(model.law(), Law { restitution: [0.8, 0.0], mesh_speed: [0.0; 2] });
    let mut other = model.clone();
    other.set("e", 0.5).unwrap();
    assert_ne!(model, other);
    assert_eq!(other.law().restitution[0], 0.5);
}

#[test]
fn two_degrees_of_freedom_and_walls_of_different_laws() {
    let model = read(TWO_DEGREES);
    assert_eq!((model.title(), model.source()), ("two", None));
    assert_eq!((model.state_names(), model.bodies()), (vec!["a", "va", "b", "vb"], vec!["rotor", "stator"]));
    let oscillator = pair(&model);
    assert_eq!(oscillator.mass, [[2.0, 0.5], [0.5, 1.0]]);
    assert_eq!(oscillator.contacts, [Contact::Impact, Contact::Elastic]);
    assert_eq!(oscillator.walls, [0.25, -0.25]);
    assert_eq!(oscillator.free.damping, [[0.5, -0.5], [-0.5, 0.75]]);
    let [right, left] = oscillator.meshing;
    // The spring adds k g g' to the stiffness and k at g to the load.
    assert_eq!(right.stiffness, [[103.0, -203.0], [-203.0, 404.0]]);
    assert_eq!((right.damping, right.load), (oscillator.free.damping, [25.0, -50.0]));
    assert_eq!(left.stiffness, [[33.0, -63.0], [-63.0, 124.0]]);
    assert_eq!(left.damping, [[1.0, -1.5], [-1.5, 2.75]]);
    assert_eq!(left.load, [-7.5, 15.0]);
    assert_eq!(model.law(), Law { restitution: [0.5, 0.0], mesh_speed: [0.05, 0.0] });
    let both = &model.parameters()[model.index("c").unwrap()];
    assert_eq!(both.shapes, Shapes::Both);
    assert!(!model.definition().walls[0][1].is_empty());
}

#[test]
fn errors_name_the_field_and_the_limit() {
    check_refusals(
        ONE_DEGREE,
        r#"
["x"] | ["a", "b", "c", "d", "f", "g", "h", "q", "l"] | is out of range: it must be 1 to 8 names: a model has at most 8 degrees of freedom
["x"] | [] | m.toml:14:15: `motion.coordinates = []` is out of range: it must be 1 to 8 names: a model has at most 8 degrees of freedom
gap = [1] | gap = [1]\nforce2 = ["F"] | m.toml:22:1: unknown field `motion.force2 = ["F"]`; did you mean `force`?
gap = [1] | gap = [1]\nharmonics = 2 | a model has one to eight coordinates and up to six gap rows; further harmonics of the force are tables, [[harmonic]]
"omega"\ngap | ["omega", "2*omega"]\ngap | m.toml:20:13: `motion.frequency = ["omega", "2*omega"]` has the wrong type: it must be one entry, the frequency of the first harmonic, force cos(frequency t) + force_sin sin(frequency t); write multiples of it as [[harmonic]]
gap = [1] | gap = [[1], [2]] | m.toml:21:7: `motion.gap = [[1], [2]]` is out of range: it must be one gap row: a list of one entry; several rows have names, such as gap = { a = [1, -1, 0], b = [0, 1, -1] }
[[contact]] | [[contact]]\nside = "left"\nat = -1\nlaw = "impact"\nrestitution = 1\n[[contact]]\nside = "left"\nat = -1\nlaw = "impact"\nrestitution = 1\n[[contact]] | `contact.1.side = "left"` does not fit: the wall before it on this side has impacts
[[contact]] | [[contact]]\nside = "right"\nat = 1\nlaw = "impact"\nrestitution = 1\n[[contact]] | m.toml:29:8: `contact.1.side = "right"` does not fit: the wall before it on this side has impacts, so that no motion reaches this one; write the walls of a side from the inside to the outside
"impact" | "elastic" | m.toml:27:15: `contact.0.restitution = "e"` does not fit: it needs law = "impact"
"impact"\nrestitution = "e" | "elastic" | `contact.0.stiffness` is missing; an elastic wall needs
restitution = "e" | | m.toml:23:1: `contact.0.restitution` is missing
"impact" | "sticky" | `contact.0.law = "sticky"` is not known; valid names: impact, elastic
"2*zeta" | "2*zta" | m.toml:16:13: `motion.damping.0.0 = "2*zta"` has an unknown name, `zta`: did you mean `zeta`?
"2*zeta" | "2*y" | has an unknown name, `y`
"2*zeta" | "x^2" | m.toml:16:13: `motion.damping.0.0 = "x^2"` does not fit: `x` is a coordinate, and entries are constants of a cell; time enters only through `frequency`, `stages` and `phase`, coordinates do not enter; write the factor of x in `stiffness`
"2*zeta" | "zeta*v" | `v` is a velocity, and entries are constants of a cell
"F*omega^2" | "F*cos(omega*t)" | m.toml:18:10: `motion.force.0 = "F*cos(omega*t)"` does not fit: `t` is the time, and entries are constants of a cell; time enters only through `frequency`, `stages` and `phase`, coordinates do not enter; write the amplitude of the harmonic force in `force`, and a stiffness that changes with time with `phase` or in `stages`
"F*omega^2" | "time" | `time` is the time
at = "s" | at = "s + x" | m.toml:25:6: `contact.0.at = "s + x"` does not fit: `x` is a coordinate
"2*zeta" | "2*" | m.toml:16:13: `motion.damping.0.0 = "2*"` cannot be read to its end
"2*zeta" | true | must be an expression in quotes
[["1"]] | [["F-1.5"]] | m.toml:15:8: `motion.mass = [["F-1.5"]]` does not fit: at the defaults of stop, mass = 0
gap = [1] | gap = ["F-1.5"] | m.toml:21:7: `motion.gap = ["F-1.5"]` does not fit: at the defaults of stop, the largest entry of the gap row = 0
"impact"\nrestitution = "e"\n | "elastic"\nstiffness = -0.5\n | m.toml:27:13: `contact.0.stiffness = -0.5` does not fit: at the defaults of stop, stiffness of right wall 1 = -0.5: it must be finite and at least 0
[["1"]] | [["1", "0"]] | `motion.mass.0 = ["1", "0"]` is out of range
at = "s" | at = "1/0" | m.toml:25:6: `contact.0.at = "1/0"` does not fit: at the defaults of stop, position of right wall 1 = inf
"e"\n | "2*e"\n | m.toml:27:15: `contact.0.restitution = "2*e"` does not fit: at the defaults of stop, restitution of right wall 1 = 1.6
"e"\n | "e"\nstiffness = "-k"\n | m.toml:28:13: `contact.0.stiffness = "-k"` does not fit
F = 1.5 | t = 1.5 | m.toml:8:5: `parameters.t = 1.5` does not fit: `t` is the time and cannot be used
F = 1.5 | pi = 1.5 | `pi` is a number and cannot be used
F = 1.5 | sqrt = 1.5 | `sqrt` is a function and cannot be used
F = 1.5 | class = 1.5 | `class` is a column of tables and cannot be used; choose another name, and none of i, j, t, phase, class
F = 1.5 | F = { default = 1, unit = "a very very long unit" } | `parameters.F.unit = "a very very long unit"` is out of range: it must be at most 20 characters long
["x"] | ["x"]\nunits = ["mm", "mm"] | `motion.units = ["mm", "mm"]` is out of range: it must be a list of units, one for each coordinate
"omega"\ngap | "-omega"\ngap | m.toml:20:13: `motion.frequency = "-omega"` does not fit: at the defaults of stop, excitation frequency = -2: it must be
[motion] | [[axis]]\n[movement] | m.toml:13:3: `axis = [[axis]]` does not fit: this file is a scene, but a model is needed
F = 1.5 | "F 1" = 1.5 | a name begins with a letter
F = 1.5 | F = inf | m.toml:8:5: `parameters.F = inf` is out of range: it must be a finite number
F = 1.5 | F = "2" | `parameters.F = "2"` has the wrong type: it must be a number, its default, or a table
F = 1.5 | F = { min = 0.0 } | `parameters.F.default` is missing; a parameter needs a default
F = 1.5 | F = { default = -1, min = 0 } | `parameters.F.default = -1` is out of range: it must be finite and at least 0
F = 1.5 | F = { default = 1, min = 2, max = 1 } | `parameters.F.max = 1` is out of range: it must be greater than min = 2
F = 1.5 | F = { default = 1, open = true } | `parameters.F.open = true` does not fit
F = 1.5 | F = { default = 1, meaning = "a\u000Ab" } | one line of text, without control characters
F = 1.5 | F = { default = 1, maximum = 2 } | unknown field `parameters.F.maximum = 2`
F = 1.5 | x = 1.5\nF = 1.5 | `x` is already the name of
"stop" | "a b" | m.toml:1:8: `name = "a b"` is out of range
name = "stop" | | m.toml:1:1: `name` is missing
[motion] | [movement] | unknown field `movement = { ... }`; valid names: name, title
frequency = "omega"\n | | `motion.frequency` is missing; name it, such as frequency = "omega"
gap = [1] | gap = [1]\ntime_scale = 2 | `motion.time_scale = 2` does not fit: with a force or stages, the forcing period is the clock; remove it
mass = [["1"]]\n | | m.toml:13:2: `motion.mass` is missing
"#,
    );
    check_refusals(
        TWO_DEGREES,
        r#"
"-k"], ["-k" | "-k"], ["k" | m.toml:15:13: `motion.stiffness = [["k", "-k"], ["k", "k+1"]]` does not fit: at the defaults of two, difference of opposite entries of stiffness = 6: it must be 0: the matrix must be symmetric
"0.5"], ["0.5" | "5"], ["5" | m.toml:13:8: `motion.mass = [["m", "5"], ["5", "1"]]` does not fit: at the defaults of two, lowest eigenvalue of the mass matrix = 
at = "-d" | at = "2*d" | `contact.0.at = "2*d"` does not fit: at the defaults of two, walls at 0.25 and 0.5
["va", "vb"] | ["va"] | `motion.velocities = ["va"]` is out of range: it must be a list of names, one for each coordinate
["va", "vb"] | ["va", "a"] | `a` is already the name of
"10*k" | "10*k*log(0)" | m.toml:23:13: `contact.0.stiffness = "10*k*log(0)"` does not fit
"#,
    );
    let (motion, _) = ONE_DEGREE.split_once("[[contact]]").unwrap();
    check_refusal(motion, "`contact` is missing; write [[contact]]");
}

#[test]
fn common_names_are_free_and_the_gap_gets_another_name() {
    let renamed =
        ONE_DEGREE.replace("\"x\"", "\"z\"").replace("F = 1.5", "w = 1.5\nn = 2").replace("F*", "w*n*");
    let model = read(&renamed);
    assert_eq!((model.state_names(), gap_names(&model)), (vec!["z", "v"], ["gap", "gap_rate"]));
    assert_eq!(model.equations()[2..4], ["gap   gap = z", "rate  gap_rate = v"]);
    assert_eq!(gap_names(&read(ONE_DEGREE)), ["z", "w"]);
}

#[test]
fn reserved_names_are_documented() {
    let page = include_str!("../../docs/models.md");
    let (_, section) = page.split_once("## Names\n").unwrap();
    let (section, _) = section.split_once("\n## ").unwrap();
    let listed = section.lines().filter(|line| line.starts_with("    ")).flat_map(str::split_whitespace);
    assert_eq!(listed.collect::<Vec<_>>(), parameters::COLUMNS);
}

#[test]
fn a_side_may_have_several_walls() {
    let wall = |at: &str, rest: &str| format!("[[contact]]\nside = 'right'\nat = '{at}'\n{rest}\n");
    let elastic = "law = 'elastic'\nstiffness = 'k'\ndamping = 'c'";
    let (motion, last) = TWO_DEGREES.split_once("[[contact]]\nside = \"right\"").unwrap();
    let with = |walls: &[String]| format!("{motion}{}", walls.concat());
    let last = format!("[[contact]]\nside = 'right'{}", last.replace("at = \"d\"", "at = '3*d'"));
    let model = read(&with(&[wall("d", elastic), wall("2*d", elastic), last.clone()]));
    let o = model.oscillator().unwrap();
    assert_eq!(o.needs_machine(), Some("several walls on a side"));
    let [right, left] = &o.gaps[0].walls;
    let found = right.iter().chain(left).map(|wall| (wall.at, wall.contact, wall.springs[0].stiffness));
    let expected = [
        (0.25, Contact::Elastic, 3.0),
        (0.5, Contact::Elastic, 3.0),
        (0.75, Contact::Impact, 100.0),
        (-0.25, Contact::Elastic, 30.0),
    ];
    assert_eq!(found.collect::<Vec<_>>(), expected);
    // The laws of a machine are those of its walls.
    assert_eq!((right[2].restitution.at(0.0)[0], right[2].mesh_speed), (0.5, 0.05));
    assert_eq!(model.law(), Law { restitution: [0.0; 2], mesh_speed: [0.0; 2] });
    let row = ["right 2", "2*d", "elastic", "", "", "k (z - d) + c w + k (z - 2*d) + c w"];
    assert_eq!(model.contacts()[1], row);
    let inner = with(&[wall("d", elastic), wall("d/2", elastic), last]);
    check_refusal(&inner, "contact.2.at = 'd/2'");
    check_refusal(&inner, "right wall 2 = 0.125: it must be farther out");
    check_refusal(&with(&vec![wall("d", elastic); 9]), "it must be 1 to 8 tables, [[contact]]");
    let five: Vec<String> = (1..6).map(|n| wall(&format!("{n}*d"), elastic)).collect();
    check_refusal(&with(&five), "there are already 4 walls on this side");
}

#[test]
fn a_wall_may_only_push_and_have_a_preload() {
    let wall = |side: &str, rest: &str| {
        format!(
            "[[contact]]\nside = '{side}'\nat = 'd'\nlaw = 'elastic'\nstiffness = 'k'\ndamping = 'c'\n{rest}\n"
        )
    };
    let (motion, _) = TWO_DEGREES.split_once("[[contact]]").unwrap();
    let with = |walls: &[String]| format!("{motion}{}", walls.concat());
    let model = read(&with(&[
        wall("right", "pull = false\npreload = 'c'"),
        wall("left", "preload = 0.25").replace("'d'", "'-d'"),
    ]));
    let o = model.oscillator().unwrap();
    let found = o.gaps[0].walls.iter().flatten().map(|wall| (wall.contact, wall.springs[0].preload));
    let c = o.gaps[0].walls[0][0].springs[0].damping;
    assert!(found.eq([(Contact::Pushing, Some(c)), (Contact::Elastic, Some(0.25))]), "{o:?}");
    let right = ["right", "d", "elastic, only pushes", "", "", "max(0, k (z - d) + c w + c)"];
    let left = ["left", "-d", "elastic", "", "", "k (z + d) + c w - 0.25"];
    assert_eq!(model.contacts(), [right, left]);
    let engine = |rest: &str| read(&with(&[wall("right", rest)])).oscillator().unwrap().needs_machine();
    assert_eq!(engine("pull = false"), Some("walls that only push"));
    assert_eq!(engine("preload = '0*c'"), Some("preloads"));
    // A spring alone never pulls.
    let spring = with(&[wall("right", "pull = false").replace("damping = 'c'\n", "")]);
    assert_eq!(pair(&read(&spring)).contacts[0], Contact::Elastic);
    let refused = |walls: &[String], expected: &str| check_refusal(&with(walls), expected);
    refused(
        &[wall("right", "pull = false"), wall("right", "").replace("'d'", "'2*d'")],
        "`contact.1.side = 'right'` does not fit: the wall before it on this side has `pull = false`",
    );
    let hard = "[[contact]]\nside = 'right'\nat = 'd'\nlaw = 'impact'\nrestitution = 0.5\n".to_owned();
    for entry in ["pull = false", "preload = 1"] {
        let expected = format!("`contact.0.{entry}` does not fit: it needs law = \"elastic\"");
        refused(&[format!("{hard}{entry}\n")], &expected);
    }
    let number = "`contact.0.pull = 1` has the wrong type: it must be true or false";
    refused(&[wall("right", "pull = 1")], number);
}

#[test]
fn velocities_and_the_gap_have_the_units_of_coordinates_and_time() {
    let units = |of_coordinates: &str, gap: &str| {
        let with = TWO_DEGREES.replace("[motion]", &format!("[motion]\n{of_coordinates}"));
        read(&with.replace(r#"["1", "-2"]"#, gap)).units()
    };
    let same = units("units = ['mm', 'mm']\ntime_unit = 's'", r#"["1", "-2"]"#);
    let components: Vec<_> = (0..4).filter_map(|i| same.component(i)).collect();
    assert_eq!(components, ["mm", "mm/s", "mm", "mm/s"]);
    assert_eq!((same.gap.as_deref(), same.gap_velocity().as_deref()), (Some("mm"), Some("mm/s")));
    assert_eq!(units("units = ['mm', 'mm']", "[1, -1]").component(1), None);
    // A factor with a unit, or coordinates of different units, leave the gap's unit open.
    assert_eq!(units("units = ['rad', 'rad']", r#"["m", "-2"]"#).gap, None);
    assert_eq!(units("units = ['mm', 'rad']", "[1, -1]").gap, None);
    assert_eq!(units("units = ['mm', 'rad']", "[1, 0]").gap.as_deref(), Some("mm"));
    assert_eq!(units("units = ['mm', 'rad']\ngap_unit = 'um'", "[1, -1]").gap.as_deref(), Some("um"));
    assert_eq!(read(TWO_DEGREES).units().component(0), None);
}

#[test]
fn every_built_in_model_can_be_read() {
    for (name, text) in BUILT_IN {
        let model = FileModel::parse(text, name).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(model.name(), *name);
        assert!(model.definition().summary.is_some() && model.source().is_some(), "{name}");
        assert!(model.is_built_in());
        for parameter in model.parameters() {
            assert!(parameter.meaning != parameter.name, "{name}: {} has no meaning", parameter.name);
            assert!(parameter.shapes != Shapes::Neither, "{name}: {} is used nowhere", parameter.name);
        }
    }
    assert_eq!(FileModel::all_built_in().len(), BUILT_IN.len());
}

#[test]
fn equations_are_written_in_usual_notation() {
    assert_eq!(
        FileModel::built_in("gear-pair").unwrap().equations(),
        [
            "M x'' + C x' + K x + g N = F(t), with the contact force N along the row g of the gap",
            "x = (x1, x2), 2 coordinates: gear 1, gear 2",
            "gap   z = x1 - x2",
            "rate  w = v1 - v2",
            "m1 x1'' + r1 x1' + k1 x1 + N = F cos(omega t)",
            "m2 x2'' + r2 x2' + k2 x2 - N = 0",
        ]
    );
    assert_eq!(
        read(ONE_DEGREE).equations()[1..],
        [
            "x = (x), 1 coordinate",
            "gap   z = x",
            "rate  w = v",
            "x'' + 2*zeta x' + x + N = F*omega^2 cos(omega t) - 0.5",
        ]
    );
    let unforced = FileModel::built_in("meissner").unwrap().equations();
    assert!(unforced[0].starts_with("M x'' + C x' + K(t) x + g N = 0, with"), "{unforced:?}");
    let friction = FileModel::built_in("friction-oscillator").unwrap().equations();
    assert_eq!(friction[..2], ["M x'' + C x' + K x + friction = F(t)", "x = (x), 1 coordinate"]);
    assert_eq!(read(ONE_DEGREE).contacts()[0][5], "keeps z = s while pressed");
    assert_eq!(read(TWO_DEGREES).contacts()[0][5], "100 (z - d)");
    assert_eq!(
        read(TWO_DEGREES).equations()[4..],
        [
            "m a'' + 0.5 b'' + c a' - c b' + k a - k b + N = 0",
            "0.5 a'' + b'' - c a' + (c + d) b' - k a + (k+1) b - 2 N = 0",
        ]
    );
}

#[test]
fn a_force_has_a_cosine_and_a_sine() {
    let force = "force = [\"F*omega^2\"]";
    let mut model = read(&ONE_DEGREE.replace(force, &format!("{force}\nforce_sin = [\"-2*F\"]")));
    let at_zero = pair(&model);
    assert_eq!((at_zero.force, at_zero.force_sin), ([6.0, 0.0], [-3.0, 0.0]));
    let [.., free] = &model.equations()[..] else { panic!("{:?}", model.equations()) };
    assert!(free.ends_with("= F*omega^2 cos(omega t) - 2*F sin(omega t) - 0.5"), "{free}");
    assert!(model.parameters()[model.index("F").unwrap()].shapes.oscillator());
    // A quarter turn later the cosine has become the negative sine.
    let before = model.clone();
    assert!(model.set_start_phase(std::f64::consts::FRAC_PI_2));
    let later = pair(&model);
    assert!((later.force[0] + 3.0).abs() < 1e-15 && (later.force_sin[0] + 6.0).abs() < 1e-15, "{later:?}");
    assert_eq!((later.force[1], later.force_sin[1]), (0.0, 0.0));
    assert_ne!(model, before);
    check_refusals(
        ONE_DEGREE,
        "gap = [1] | force_sin = [1, 2]\\ngap = [1] | a list of one entry, one for each coordinate",
    );
}

/// Tables and keys that a model of one degree of freedom gets.
const HARMONICS: &str = r#"
[[harmonic]]
order = 4
cos = ["F/s"]
sin = [-1]

[[harmonic]]
order = 2
sin = ["-2*F"]
"#;

#[test]
fn harmonics_are_read_in_the_order_of_their_frequencies() {
    let mut model = read(&format!("{ONE_DEGREE}{HARMONICS}"));
    let oscillator = pair(&model);
    let [second, fourth] = &oscillator.harmonics[..] else { panic!("{oscillator:?}") };
    assert_eq!(*second, Harmonic { order: 2, cos: [0.0; 2], sin: [-3.0, 0.0] });
    assert_eq!(*fourth, Harmonic { order: 4, cos: [7.5, 0.0], sin: [-1.0, 0.0] });
    let line = "x'' + 2*zeta x' + x + N = F*omega^2 cos(omega t) - 2*F sin(2 omega t) + F/s cos(4 omega t) - sin(4 omega t) - 0.5";
    assert_eq!(model.equations()[4], line);
    // Half a turn later odd harmonics have the other sign.
    assert!(model.set_start_phase(std::f64::consts::PI));
    let later = pair(&model);
    assert_eq!((later.force, &later.harmonics), ([-6.0, 0.0], &oscillator.harmonics));
    let text = ONE_DEGREE.replace("e = {", "a = 1\ne = {") + &HARMONICS.replace("-2*F", "a");
    let model = read(&text);
    assert!(model.parameters()[model.index("a").unwrap()].shapes.oscillator());
}

#[test]
fn frequencies_of_harmonics_are_written_in_usual_notation() {
    let at = |frequency: &str| {
        let text = ONE_DEGREE.replace("\"omega\"\ngap", &format!("\"{frequency}\"\ngap")) + HARMONICS;
        let line = read(&text).equations()[4].clone();
        line.split_once("2*F sin(").unwrap().1.split_once(')').unwrap().0.to_owned()
    };
    assert_eq!(
        ["omega", "1.5", "omega*s", "omega/2"].map(at),
        ["2 omega t", "3 t", "2*omega*s t", "2*omega/2 t"]
    );
}

#[test]
fn errors_in_harmonics_name_the_field() {
    check_refusals(
        &format!("{ONE_DEGREE}{HARMONICS}"),
        r#"
order = 2 | order = 1 | m.toml:35:9: `harmonic.1.order = 1` does not fit: order 1 is `force` and `force_sin` in [motion]
order = 2 | order = 65 | `harmonic.1.order = 65` is out of range: it must be a whole number from 2 to 64
order = 2 | order = 1.5 | m.toml:35:9: `harmonic.1.order = 1.5` does not fit: an order is a whole number; for half orders, halve `frequency` and double all orders: order 1, `force`, becomes order 2
order = 2 | order = "2" | `harmonic.1.order = "2"` has the wrong type: it must be a whole number from 2 to 64
order = 2 | order = 4 | `harmonic.1.order = 4` does not fit: there is already a harmonic of this order
order = 2 | | `harmonic.1.order` is missing; write order = 2 for twice the frequency
sin = ["-2*F"] | | `harmonic.1.cos` is missing; a harmonic needs cos, sin or both
sin = ["-2*F"] | tan = [1] | unknown field `harmonic.1.tan = [1]`; valid names: order, cos, sin
sin = ["-2*F"] | sin = [1, 2] | `harmonic.1.sin = [1, 2]` is out of range
sin = ["-2*F"] | sin = [[1, 2]] | `harmonic.1.sin.0 = [1, 2]` has the wrong type: it must be one number or expression; a list with one value for each stage belongs to stiffness, damping, load and preload
sin = ["-2*F"] | sin = ["sin(2*t)"] | `t` is the time
sin = ["-2*F"] | sin = ["1/0"] | m.toml:36:7: `harmonic.1.sin = ["1/0"]` does not fit: at the defaults of stop, sine of harmonic 2 = inf
cos = ["F/s"] | cos = ["log(-1)"] | m.toml:31:7: `harmonic.0.cos = ["log(-1)"]` does not fit: at the defaults of stop, cosine of harmonic 4 = NaN
gap = [1] | gap = [1]\nharmonic = 2 | unknown field `motion.harmonic = 2`
"#,
    );
    let many: String = (2..18).map(|order| format!("[[harmonic]]\norder = {order}\ncos = [1]\n")).collect();
    check_refusals(
        ONE_DEGREE,
        &format!(
            "[motion] | {}[motion] | `harmonic = 16 tables` is out of range: it must be at most 15 tables",
            many.replace('\n', "\\n")
        ),
    );
    check_refusals(
        ONE_DEGREE,
        "[motion] | [harmonic]\\norder = 2\\n[motion] | `harmonic = { ... }` has the wrong type: it must be at most 15 tables, [[harmonic]]",
    );
}

const STAGES: &str = r#"name = "mesh"

[parameters]
eps = { default = 1.5, min = 1.0, max = 2.0 }
k1 = 4.0
k2 = 3.0
c = 0.5
F = 0.25

[motion]
coordinates = ["x", "y"]
mass = [[1, 0], [0, 2]]
damping = [[["c", "2*c"], 0], [0, 1]]
stiffness = [[["k1", "k2"], -1], [-1, 5]]
load = [0, ["F", "-F"]]
frequency = 2
gap = [1, -1]
stages = [0, "eps - 1"]

[[contact]]
side = "right"
at = 0.5
law = "elastic"
stiffness = ["10*k1", "10*k2"]
damping = [1, "c"]

[[contact]]
side = "left"
at = "-1"
law = "impact"
restitution = 0.5
stiffness = 20
"#;

#[test]
fn stages_have_their_own_domains() {
    let model = read(STAGES);
    let oscillator = pair(&model);
    assert_eq!(oscillator.schedule, [(0.0, 0), (0.5, 1)]);
    let [second] = &oscillator.stages[..] else { panic!("{oscillator:?}") };
    let domain = |damping: f64, stiffness: f64, load: f64| Domain {
        damping: [[damping, 0.0], [0.0, 1.0]],
        stiffness: [[stiffness, -1.0], [-1.0, 5.0]],
        load: [0.0, load],
    };
    assert_eq!([oscillator.free, second.free], [domain(0.5, 4.0, 0.25), domain(1.0, 3.0, -0.25)]);
    // The spring adds k g g' to the stiffness and k at g to the load.
    let [before, after] = [oscillator.meshing[0], second.meshing[0]];
    assert_eq!((before.stiffness, before.load), ([[44.0, -41.0], [-41.0, 45.0]], [20.0, -19.75]));
    assert_eq!((after.stiffness, after.load), ([[33.0, -31.0], [-31.0, 35.0]], [15.0, -15.25]));
    assert_eq!((before.damping, after.damping), ([[1.5, -1.0], [-1.0, 2.0]], [[1.5, -0.5], [-0.5, 1.5]]));
    assert_eq!(second.meshing[1].stiffness, [[23.0, -21.0], [-21.0, 25.0]]);
    for name in ["eps", "k1", "k2", "c", "F"] {
        assert_eq!(model.parameters()[model.index(name).unwrap()].shapes, Shapes::Oscillator, "{name}");
    }
    let repeated = read(&STAGES.replace("stages = [0", "repeat = 4\nstages = [0.25"));
    let phases =
        [(0.0625, 0), (0.125, 1), (0.3125, 0), (0.375, 1), (0.5625, 0), (0.625, 1), (0.8125, 0), (0.875, 1)];
    assert_eq!(repeated.oscillator().unwrap().schedule, phases);
    assert_eq!(
        model.equations()[4..],
        [
            "stages  1 from phase 0, 2 from phase eps - 1 of each forcing period",
            "        [stage 1 | stage 2] lists the values of an entry that changes",
            "x'' + [c | 2*c] x' + [k1 | k2] x - y + N = 0",
            "2 y'' + y' - x + 5 y - N = [F | -F]",
        ]
    );
    assert_eq!(model.contacts()[0][5], "[10*k1 | 10*k2] (z - 0.5) + [1 | c] w");
    let line = &repeated.equations()[4];
    assert_eq!(line, "stages  1 from phase 0.25, 2 from phase eps - 1 of each 1/4 of the forcing period");
}

#[test]
fn equal_stages_have_the_domains_of_a_model_without_stages() {
    let plain = STAGES.replace("[\"c\", \"2*c\"]", "\"c\"").replace("[\"k1\", \"k2\"]", "\"k1\"");
    let plain = plain.replace("[\"F\", \"-F\"]", "\"F\"").replace("[\"10*k1\", \"10*k2\"]", "\"k1\"");
    let plain = plain.replace("[1, \"c\"]", "\"c\"");
    let lists = ["c", "k1", "F"].into_iter().fold(plain.clone(), |text, name| {
        let (head, rest) = text.split_once("[motion]").unwrap();
        let quoted = format!("\"{name}\"");
        format!("{head}[motion]{}", rest.replace(&quoted, &format!("[{quoted}, {quoted}]")))
    });
    let without = read(&plain.replace("stages = [0, \"eps - 1\"]", "force = [0, 0]"));
    let with = read(&lists);
    let (a, b) = (pair(&without), pair(&with));
    assert!(lists.contains(r#"["k1", "k1"]"#) && a.stages.is_empty() && a.schedule.is_empty());
    assert_eq!(format!("{a:?}"), format!("{:?}", b.in_stage(0)), "to the bit");
    assert_eq!(format!("{a:?}"), format!("{:?}", b.in_stage(1)));
    assert_eq!(without.equations()[4..], with.equations()[6..]);
}

#[test]
fn errors_in_stages_name_the_field_and_the_stage() {
    check_refusals(
        STAGES,
        r#"
stages = [0, "eps - 1"] | | m.toml:13:13: `motion.damping.0.0 = ["c", "2*c"]` does not fit: a list has one value for each stage, but the model has no stages; write `stages` in [motion], or one value
stages = [0, "eps - 1"] | stages = [0, 0.2, 0.5] | m.toml:13:13: `motion.damping.0.0 = ["c", "2*c"]` is out of range: it must be one value, or a list of 3 values, one for each stage
stages = [0, "eps - 1"] | stages = ["0"] | `motion.stages = ["0"]` is out of range: it must be a list of 2 to 64 phases at which stages begin
stages = [0, "eps - 1"] | stages = "eps" | `motion.stages = "eps"` has the wrong type: it must be a list of 2 to 64 phases
stages = [0, "eps - 1"] | stages = [0, "x"] | `x` is a coordinate
stages = [0, "eps - 1"] | stages = [0, "eps"] | m.toml:18:10: `motion.stages = [0, "eps"]` does not fit: at the defaults of mesh, phase at which stage 2 begins = 1.5: it must be at least 0, less than 1, and greater than the phase before it
stages = [0, "eps - 1"] | repeat = 20\nstages = [0, "eps"] | phase at which stage 2 begins = 1.5: it must be
stages = [0, "eps - 1"] | stages = ["-0.1", 0] | phase at which stage 1 begins = -0.1
stages = [0, "eps - 1"] | stages = [0.5, "eps - 1"] | phase at which stage 2 begins = 0.5
gap = [1, -1] | gap = [1, -1]\nrepeat = 0 | `motion.repeat = 0` is out of range: it must be a whole number from 1 to 512
gap = [1, -1] | gap = [1, -1]\nrepeat = 2.5 | `motion.repeat = 2.5` has the wrong type: it must be a whole number
[0, ["F", "-F"]] | [["F", "-F"]] | `motion.load = [["F", "-F"]]` is out of range: it must be amplitudes of one harmonic, or constant loads: a list of two entries, one for each coordinate; an entry may be a list with one value for each stage
[[1, 0], [0, 2]] | [[[1, 2], 0], [0, 2]] | m.toml:12:10: `motion.mass.0.0 = [1, 2]` has the wrong type: it must be one number or expression; a list with one value for each stage belongs to stiffness, damping, load and preload
at = 0.5 | at = [0.5, 1] | `contact.0.at = [0.5, 1]` has the wrong type: it must be one number or expression; a list
restitution = 0.5 | restitution = [0.5, 1] | `contact.1.restitution = [0.5, 1]` has the wrong type: it must be one number or expression; a list
"10*k2"] | "10*k2", 1] | m.toml:24:13: `contact.0.stiffness = ["10*k1", "10*k2", 1]` is out of range: it must be one value, or a list of 2 values
["10*k1", "10*k2"] | ["10*k1", ["k2"]] | `contact.0.stiffness.1 = ["k2"]` has the wrong type
"10*k2" | "-k2" | m.toml:24:13: `contact.0.stiffness = ["10*k1", "-k2"]` does not fit: at the defaults of mesh, stiffness of right wall 1 = -3: it must be finite and at least 0
-1], [-1, | [0, 1]], [[0, 2], | `motion.stiffness = [[["k1", "k2"], [0, 1]], [[0, 2], 5]]` does not fit: at the defaults of mesh, difference of opposite entries of stiffness = 1: it must be 0: the matrix must be symmetric
"#,
    );
}

#[test]
fn phases_out_of_order_are_found_for_later_values() {
    let mut model = read(STAGES);
    model.set("eps", 2.0).unwrap();
    let error = model.oscillator().unwrap_err().to_string();
    assert!(
        error.starts_with("phase at which stage 2 begins = 1: it must be at least 0, less than 1"),
        "{error}"
    );
}

/// The mesh of [`STAGES`] with entries that depend on the phase.
fn by_phase() -> String {
    let plain = STAGES.replace("[\"10*k1\", \"10*k2\"]", "\"10*k1*(1 + 0.2*cos(phase))\"");
    let plain =
        plain.replace("[\"c\", \"2*c\"]", "\"c\"").replace("[\"k1\", \"k2\"]", "\"k1 + 2*sin(2*phase)\"");
    plain
        .replace("[\"F\", \"-F\"]", "\"F\"")
        .replace("[1, \"c\"]", "\"c\"")
        .replace("stages = [0, \"eps - 1\"]", "tolerance = 0.01")
}

#[test]
fn stages_have_the_means_of_entries_with_the_phase() {
    let mut model = read(&by_phase());
    let oscillator = model.oscillator().unwrap();
    let count = oscillator.stages.len();
    // The integral of 2 sin(2 phase) differs most: by up to 2 pi^2 / count^2, and by half of this on average, for a largest value of 6.
    assert_eq!((count, oscillator.schedule[1]), (14, (1.0 / 14.0, 1)));
    for (stage, (forces, spring)) in
        oscillator.stages.iter().zip(&oscillator.gaps[0].walls[0][0].springs).enumerate()
    {
        let [from, to] = [stage, stage + 1].map(|end| std::f64::consts::TAU * end as f64 / count as f64);
        let mean = |integral: fn(f64) -> f64| (integral(to) - integral(from)) / (to - from);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-8, "stage {stage}: {a} {b}");
        near(forces.stiffness[(0, 0)], 4.0 + mean(|phase| -(2.0 * phase).cos()));
        near(spring.stiffness, 40.0 + 8.0 * mean(f64::sin));
        assert_eq!((spring.damping, forces.load[1]), (0.5, 0.25));
        // Half a period later, the stiffness of free motion is equal to the bit.
        assert_eq!(forces.stiffness, oscillator.stages[(stage + count / 2) % count].stiffness);
    }
    assert_eq!(
        model.equations()[4..],
        [
            "stages  14 of equal length in each forcing period, with the mean of each entry that contains the phase",
            "        their error is 8.5e-3 of the largest value, within tolerance = 0.01; it falls with the square of their number",
            "x'' + c x' + (k1 + 2*sin(2*phase)) x - y + N = 0",
            "2 y'' + y' - x + 5 y - N = F",
        ]
    );
    assert!(model.equations()[0].starts_with("M x'' + C x' + K(t) x"), "{:?}", model.equations());
    assert_eq!(model.contacts()[0][5], "10*k1*(1 + 0.2*cos(phase)) (z - 0.5) + c w");
    assert!(!crate::model_file::is_unforced(&model));
    // The stages follow the values.
    model.set("k1", 40.0).unwrap();
    assert_eq!(model.oscillator().unwrap().stages.len(), 8);
    let repeated = read(&by_phase().replace("tolerance", "repeat = 3\ntolerance")).oscillator().unwrap();
    assert_eq!((repeated.stages.len(), repeated.schedule.len()), (14, 42));
}

#[test]
fn errors_in_entries_with_the_phase_name_the_field_and_the_remedy() {
    check_refusals(
        &by_phase(),
        r#"
tolerance = 0.01 | tolerance = 1e-5 | m.toml:18:13: `motion.tolerance = 1e-5` does not fit: at the defaults of mesh, number of stages for a tolerance of 0.00001 = 412: it must be at most 64, and `repeat` times it at most 1024; write a larger `tolerance`
tolerance = 0.01 | tolerance = 0.01\nrepeat = 100 | number of stages for a tolerance of 0.01 = 14: it must be at most 64, and `repeat` times it
tolerance = 0.01 | tolerance = 0 | `motion.tolerance = 0` is out of range: it must be above 0 and below 1
tolerance = 0.01 | stages = [0, 0.5] | m.toml:14:15: `motion.stiffness.0.0 = "k1 + 2*sin(2*phase)"` does not fit: the program chooses the stages of an entry with `phase`, and the model has `stages`; remove `stages`
frequency = 2 | | `motion.frequency` is missing; name it
frequency = 2 | time_scale = 2 | `motion.time_scale = 2` does not fit: with an entry that contains the phase, the forcing period is the clock
[1, -1] | ["phase", -1] | `phase` is the phase of the forcing, and entries are constants of a cell; time enters only through `frequency`, `stages` and `phase`, coordinates do not enter; only a whole entry of stiffness, damping, load or preload may contain it
at = 0.5 | at = "phase" | `contact.0.at = "phase"` does not fit: `phase` is the phase of the forcing
"10*k1*(1 + 0.2*cos(phase))" | "k1*cos(phase)" | does not fit: at the defaults of mesh, stiffness of right wall 1 = -
"k1 + 2*sin(2*phase)" | "log(phase - 1)" | stiffness in stage 1 = NaN: it must be a finite number
"#,
    );
    check_refusal(
        &ONE_DEGREE.replace("[motion]", "[motion]\nrepeat = 2"),
        "`motion.repeat = 2` does not fit: it repeats the stages, but the model has none",
    );
    check_refusal(
        &STAGES.replace("stages =", "tolerance = 0.1\nstages ="),
        "`motion.tolerance = 0.1` does not fit: it is that of entries with `phase`, but the model has none",
    );
}

/// A signal for a model of two degrees of freedom.
const SIGNAL: &str = r#"
[[signal]]
name = "seat"
displacement = ["c/d", -1]
acceleration = [1, 0]
constant = "k"
cos = "-c"
unit = "m/s^2"
"#;

#[test]
fn signals_are_read_and_written_in_usual_notation() {
    let model = read(&(TWO_DEGREES.to_owned() + SIGNAL));
    let row = |entries: [f64; 2]| DVector::from_row_slice(&entries);
    let signal = model::Signal {
        displacement: row([2.0, -1.0]),
        velocity: row([0.0, 0.0]),
        acceleration: row([1.0, 0.0]),
        constant: 3.0,
        waves: [-0.5, 0.0],
    };
    let oscillator = model.oscillator().unwrap();
    assert_eq!(oscillator.signals, [signal]);
    assert_eq!(oscillator.needs_machine(), Some("signals"));
    let lines = model.equations();
    let line = lines.iter().find(|line| line.starts_with("signal")).unwrap();
    assert_eq!(line, "signal  seat = c/d a - b + a'' - c cos(1.5 t) + k");
    assert_eq!(subjects(&model).signals, ["seat"]);
    assert_eq!(model.units().signals, [Some("m/s^2".to_owned())]);
    let unforced =
        TWO_DEGREES.lines().filter(|line| !line.starts_with("force")).collect::<Vec<_>>().join("\n");
    let drives = |text: &str| read(&(unforced.clone() + text)).oscillator().unwrap().drives.len();
    assert_eq!((drives(SIGNAL), drives(&SIGNAL.replace("cos = \"-c\"", ""))), (1, 0));
}

#[test]
fn errors_in_signals_name_the_field() {
    check_refusals(
        &(TWO_DEGREES.to_owned() + SIGNAL),
        r#"
name = "seat" | | `signal.0.name` is missing
name = "seat" | name = "a" | `signal.0.name = "a"` does not fit: `a` is already the name of a parameter, a coordinate, a velocity, a gap or a signal
name = "seat" | name = "gap" | `signal = [[signal]]` does not fit: two columns of a table would have the name `amplitude_gap`
name = "seat" | name = "contact_force" | `signal = [[signal]]` does not fit: two columns of a table would have the name `contact_force`
name = "seat" | name = "rms_gap" | `signal.0.name = "rms_gap"` does not fit: `rms_gap` is a column of tables
["c/d", -1] | [1] | `signal.0.displacement = [1]` is out of range: it must be a row of the signal: a list of two entries
displacement | shift | unknown field `signal.0.shift
constant = "k" | constant = "1/0" | `signal.0.name = "seat"` does not fit: at the defaults of
"#,
    );
    let rows = SIGNAL.lines().filter(|line| !line.contains('[') || line.contains("[[")).collect::<Vec<_>>();
    check_refusal(&(TWO_DEGREES.to_owned() + &rows.join("\n")), "`signal.0.displacement` is missing");
    let five: String = (0..5).map(|i| SIGNAL.replace("seat", &format!("s{i}"))).collect();
    check_refusal(&(TWO_DEGREES.to_owned() + &five), "at most 4 tables, [[signal]]");
}

/// Friction for a model of two degrees of freedom.
const FRICTION: &str = r#"
[[friction]]
row = ["c/d", -1]
force = "mu*k"
speed = "u"

[[friction]]
row = [1, 0]
force = 0.5
"#;

fn with_friction() -> String {
    TWO_DEGREES.replace("d = 0.25\n", "d = 0.25\nmu = 0.2\nu = -0.75\n") + FRICTION
}

#[test]
fn friction_is_read_in_the_order_of_the_file() {
    let model = read(&with_friction());
    let bare = read(TWO_DEGREES).oscillator().unwrap();
    let element =
        |row: [f64; 2], force: f64, speed: f64| DryFriction::new(DVector::from_row_slice(&row), force, speed);
    let friction = vec![element([2.0, -1.0], 0.2 * 3.0, -0.75), element([1.0, 0.0], 0.5, 0.0)];
    assert_eq!(model.oscillator().unwrap(), Oscillator { friction, ..bare });
    for name in ["mu", "u"] {
        assert_eq!(model.parameters()[model.index(name).unwrap()].shapes, Shapes::Oscillator, "{name}");
    }
    let mut later = model.clone();
    assert!(later.set_start_phase(1.0));
    assert_eq!(later.oscillator().unwrap().friction, model.oscillator().unwrap().friction);
    let stages = STAGES.to_owned() + "[[friction]]\nrow = [1, -1]\nforce = \"c\"\n";
    let friction = [element([1.0, -1.0], 0.5, 0.0)];
    assert_eq!(read(&stages).oscillator().unwrap().friction, friction);
}

#[test]
fn a_model_with_friction_needs_no_walls_and_no_row_for_one_coordinate() {
    let (motion, _) = ONE_DEGREE.split_once("[[contact]]").unwrap();
    let model = read(&format!("{motion}[[friction]]\nforce = \"F\"\n"));
    let (row, matrix) = (|x: f64| DVector::from_element(1, x), |x: f64| DMatrix::from_element(1, 1, x));
    let by_hand = Oscillator {
        omega: 2.0,
        mass: matrix(1.0),
        stages: vec![Forces { damping: matrix(0.5), stiffness: matrix(1.0), load: row(-0.5) }],
        schedule: Vec::new(),
        drives: vec![Drive { order: 1, cos: row(6.0), sin: row(0.0) }],
        gaps: vec![GapRow { row: row(1.0), walls: [vec![], vec![]] }],
        friction: vec![DryFriction::new(row(1.0), 1.5, 0.0)],
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    };
    assert_eq!(model.oscillator().unwrap(), by_hand);
    assert_eq!(
        model.equations()[2..],
        [
            "gap   z = x",
            "rate  w = v",
            "friction  sticks at x' = 0 while |friction force| <= F",
            "x'' + 2*zeta x' + x + F sgn(x') = F*omega^2 cos(omega t) - 0.5",
        ]
    );
}

#[test]
fn friction_is_written_in_usual_notation() {
    assert_eq!(
        read(&with_friction()).equations()[4..],
        [
            "friction  sticks at c/d a' - b' - u = 0 while |friction force| <= mu*k",
            "friction  sticks at a' = 0 while |friction force| <= 0.5",
            "m a'' + 0.5 b'' + c a' - c b' + k a - k b + c/d*mu*k sgn(c/d a' - b' - u) + 0.5 sgn(a') + N = 0",
            "0.5 a'' + b'' - c a' + (c + d) b' - k a + (k+1) b - mu*k sgn(c/d a' - b' - u) - 2 N = 0",
        ]
    );
    let written = |row: &str, force: &str, speed: &str| {
        let table = format!("[[friction]]\nrow = [{row}, 0]\nforce = {force}\nspeed = {speed}\n");
        let line = read(&format!("{TWO_DEGREES}{table}")).equations()[5].clone();
        line.split_once("- k b ").map_or(line.clone(), |(_, rest)| rest.to_owned())
    };
    assert_eq!(written("1", "\"k + c\"", "1.5"), "+ (k + c) sgn(a' - 1.5) + N = 0");
    assert_eq!(written("-2", "2", "\"-c\""), "- 2*2 sgn(-2 a' + c) + N = 0");
    assert_eq!(written("-1", "\"-(-c)\"", "\"c - k\""), "+ (-c) sgn(-a' - (c - k)) + N = 0");
    // A force that is the number 0 is left out.
    let none = read(&format!("{TWO_DEGREES}[[friction]]\nrow = [1, 0]\nforce = 0\n"));
    assert_eq!(none.equations(), read(TWO_DEGREES).equations());
}

#[test]
fn errors_in_friction_name_the_field() {
    check_refusals(
        &with_friction(),
        r#"
speed = "u" | slip = "u" | m.toml:39:1: unknown field `friction.0.slip = "u"`; valid names: row, force, static, force_at_speed, speed
row = [1, 0] | row = [1] | m.toml:42:7: `friction.1.row = [1]` is out of range: it must be the row of the sliding rate, row . v - speed: a list of two entries, one for each coordinate
row = [1, 0] | row = { a = 1, q = -1 } | m.toml:42:7: `friction.1.row = { ... }` has the wrong type: it must be the row of the sliding rate, row . v - speed: a list of two entries, one for each coordinate
row = [1, 0] | row = ["va", 0] | m.toml:42:8: `friction.1.row.0 = "va"` does not fit: `va` is a velocity, and entries are constants of a cell
row = [1, 0] | row = ["q", 0] | m.toml:42:8: `friction.1.row.0 = "q"` has an unknown name, `q`
row = [1, 0] | | m.toml:41:1: `friction.1.row` is missing; write the factors of the velocities in the sliding rate, such as row = [1, -1]
row = [1, 0] | row = ["k-3", 0] | m.toml:42:7: `friction.1.row = ["k-3", 0]` does not fit: at the defaults of two, independence of the rows of friction 1 to 2 = 0: it must be above 1e-12
row = [1, 0] | row = ["1/0", 0] | m.toml:42:7: `friction.1.row = ["1/0", 0]` does not fit: at the defaults of two, row of friction 2 = inf: it must be a finite number
row = [1, 0] | row = [-4, 2] | m.toml:42:7: `friction.1.row = [-4, 2]` does not fit: at the defaults of two, independence of the rows of friction 1 to 2 = 0: it must be above 1e-12: no row may be 0 or a multiple of the other; one element with the sum of both forces describes friction along equal rows
force = "mu*k" | | m.toml:36:1: `friction.0.force` is missing; write the friction force of sliding, such as force = "f"
force = "mu*k" | force = "-mu" | m.toml:38:9: `friction.0.force = "-mu"` does not fit: at the defaults of two, force of friction 1 = -0.2: it must be finite and at least 0
force = "mu*k" | force = "mu*a" | m.toml:38:9: `friction.0.force = "mu*a"` does not fit: `a` is a coordinate
force = "mu*k" | force = ["mu", "k"] | m.toml:38:9: `friction.0.force = ["mu", "k"]` has the wrong type: it must be one number or expression; a list with one value for each stage belongs to stiffness, damping, load and preload
force = 0.5 | force = "1/0" | m.toml:43:9: `friction.1.force = "1/0"` does not fit: at the defaults of two, force of friction 2 = inf: it must be finite and at least 0
speed = "u" | speed = "log(-1)" | m.toml:39:9: `friction.0.speed = "log(-1)"` does not fit: at the defaults of two, speed of friction 1 = NaN: it must be a finite number
[motion] | [[friction]]\nrow = [0, 1]\nforce = 1\n[motion] | `friction = 3 tables` is out of range: it must be at most 2 tables, [[friction]], each with row and force
"#,
    );
    check_refusals(
        ONE_DEGREE,
        r#"
[motion] | [[friction]]\nforce = 1\n[[friction]]\nforce = 2\n[motion] | `friction = 2 tables` is out of range: it must be at most 1 table, [[friction]], for one coordinate: friction forces on it add to one
[motion] | [friction]\nforce = 1\n[motion] | `friction = { ... }` has the wrong type: it must be at most 1 table, [[friction]]
gap = [1] | gap = [1]\nfriction = 1 | unknown field `motion.friction = 1`
"#,
    );
    let (motion, _) = ONE_DEGREE.split_once("[[contact]]").unwrap();
    let end = "`contact` is missing; write [[contact]] with side, at and law; only a model with [[friction]] or [[spring]] may have no wall";
    check_refusal(motion, end);
}

/// Returns the text of a built-in model.
fn text_of(name: &str) -> String {
    FileModel::built_in(name).unwrap().definition().text.clone()
}

#[test]
fn force_laws_are_refused_with_a_remedy() {
    check_refusals(
        &text_of("duffing"),
        r#"
range = "reach" | | m.toml:26:1: `spring.0.range` is missing; write the range of the elongation, such as range = 2 for -2 to 2
range = "reach" | range = [1, 2] | `spring.0.range = [1, 2]` does not fit: at the defaults of duffing, range of nonlinear spring 1 = 1: it must be a range of finite length that contains 0
tolerance = "tol" | tolerance = 1e-7 | `spring.0.tolerance = 1e-7` does not fit: at the defaults of duffing, tolerance, at least 2.6e-4 for this range, of nonlinear spring 1 = 1e-7: it must be larger, or the range shorter: the force would need more than 32 linear pieces on a side
tolerance = "tol" | tolerance = 2.4e-4 | tolerance, at least 2.6e-4 for this range, of nonlinear spring 1 = 0.00024: it must be larger
force = "k*x + a*x^3" | force = "x^0.5" | tolerance of nonlinear spring
force = "k*x + a*x^3" | force = "1 + x" | `spring.0.force = "1 + x"` does not fit: at the defaults of duffing, force at 0 of nonlinear spring 1 = 1: it must be 0; write a constant force in `load`
[[spring]] | [[spring]]\nrow = [0] | `spring.0.row = [0]` does not fit: at the defaults of duffing, row of nonlinear spring 1 = 0: it must be not 0
"#,
    );
    let least = text_of("duffing").replace("tolerance = \"tol\"", "tolerance = 2.6e-4");
    assert!(FileModel::parse(&least, "m.toml").is_ok());
    check_refusals(
        &text_of("hertz-ball"),
        r#"
force = "k*depth^1.5" | stiffness = 3 | `contact.0.stiffness = 3` does not fit: it does not belong to law = "curve", whose force is given by `force`; remove it
law = "curve" | law = "elastic"\nstiffness = 1 | `contact.0.force = "k*depth^1.5"` does not fit: it needs law = "curve"; remove it, or change the law
"#,
    );
    check_refusals(
        &text_of("belt-oscillator"),
        r#"
static = "fs" | static = 0.1 | `friction.0.static = 0.1` does not fit: at the defaults of belt-oscillator, static of friction 1 = 0.1: it must be finite and at least the force while sliding begins
[[0, "f0"], ["w", "fd"]] | [[1, "f0"]] | `friction.0.force_at_speed = [[1, "f0"]]` does not fit: the first pair must have the sliding rate 0
[[0, "f0"], ["w", "fd"]] | [[0, "f0"], [1, -2]] | `friction.0.force_at_speed = [[0, "f0"], [1, -2]]` does not fit: at the defaults of belt-oscillator, force of friction 1 = -2: it must be finite and at least 0
static = "fs" | force = 1 | `friction.0.force_at_speed = [[0, "f0"], ["w", "fd"]]` does not fit: it says what `force` says; remove one of them
"#,
    );
}

#[test]
fn equations_show_force_laws() {
    let of = |name: &str| FileModel::built_in(name).unwrap().equations();
    let springs = of("duffing");
    assert_eq!(springs[0], "M x'' + C x' + springs = F(t)");
    let spring = "spring  S = k*x + a*x^3 at the elongation x = x, from -(reach) to reach: 34 linear pieces, error 8.9e-4 of the largest force";
    assert_eq!(springs[4..], [spring, "x'' + r x' + S = F cos(omega t)"]);
    let friction = "friction  sticks at x' - u = 0 while |friction force| <= fs; f(r) = f0 at r = 0, fd at w, linear between, constant beyond";
    assert_eq!(of("belt-oscillator")[4], friction);
    let [row] = &FileModel::built_in("hertz-ball").unwrap().contacts()[..] else { panic!("one wall") };
    assert_eq!(row[2], "curve, only pushes");
}

/// Three discs on a shaft, with stops between them and a mesh stiffness that changes.
const THREE: &str = r#"name = "three"

[parameters]
m = 2.0
k = 3.0
c = 0.5
d = 0.25
F = 1.5
e = { default = 0.8, min = 0.0, max = 1.0 }
mu = 0.2

[motion]
coordinates = ["x", "y", "q"]
mass = [["m", 0, 0], [0, 1, 0.25], [0, 0.25, 1]]
damping = [["c", "-c", 0], ["-c", "c", "0"], [0, 0, ["c", 1]]]
stiffness = [[["k", "2*k"], 0, 0], [0, 5, -1], [0, -1, 4]]
load = [0, ["F", "-F"], 0]
force = [0, 0, "F"]
frequency = 1.5
gap = { left = [1, -1, 0], right = [0, 1, "-c"] }
stages = [0.25, 0.5]

[[harmonic]]
order = 3
sin = [0, 1, 0]

[[contact]]
gap = "right"
side = "right"
at = "d"
law = "elastic"
stiffness = ["k", "k/2"]
preload = 0.125

[[contact]]
gap = "left"
side = "left"
at = "-d"
law = "impact"
restitution = "e - c*speed^0.2"
mesh_speed = "mu"

[[contact]]
gap = "right"
side = "right"
at = "2*d"
law = "impact"
restitution = 0.5
damping = "c"

[[friction]]
row = [0, 0, "m"]
force = "mu*k"
speed = "e"
"#;

/// Returns the oscillator of a machine.
fn machine(model: &FileModel) -> Oscillator {
    let oscillator = model.oscillator().unwrap();
    assert!(oscillator.needs_machine().is_some());
    oscillator
}

/// Returns the pair of a model that has one.
fn pair(model: &FileModel) -> Pair {
    Pair::of(&model.oscillator().unwrap()).expect("a pair")
}

#[test]
fn a_model_of_three_coordinates_and_two_gaps_is_a_machine() {
    let model = read(THREE);
    let forces = |c: f64, k: f64, load: f64| Forces {
        damping: DMatrix::from_row_slice(3, 3, &[0.5, -0.5, 0.0, -0.5, 0.5, 0.0, 0.0, 0.0, c]),
        stiffness: DMatrix::from_row_slice(3, 3, &[k, 0.0, 0.0, 0.0, 5.0, -1.0, 0.0, -1.0, 4.0]),
        load: DVector::from_row_slice(&[0.0, load, 0.0]),
    };
    let row = |entries: [f64; 3]| DVector::from_row_slice(&entries);
    let left = model::Wall {
        at: -0.25,
        contact: Contact::Rigid,
        restitution: Restitution::BySpeed { constant: 0.8, factor: -0.5, power: 0.2 },
        mesh_speed: 0.2,
        springs: vec![Spring::default(); 2],
    };
    let elastic = model::Wall {
        at: 0.25,
        contact: Contact::Elastic,
        restitution: Restitution::Constant(0.0),
        mesh_speed: 0.0,
        springs: [3.0, 1.5].map(|stiffness| Spring { stiffness, damping: 0.0, preload: Some(0.125) }).into(),
    };
    let impact = model::Wall {
        at: 0.5,
        contact: Contact::Impact,
        restitution: Restitution::Constant(0.5),
        mesh_speed: 0.0,
        springs: vec![Spring { stiffness: 0.0, damping: 0.5, preload: None }; 2],
    };
    let by_hand = Oscillator {
        omega: 1.5,
        mass: DMatrix::from_row_slice(3, 3, &[2.0, 0.0, 0.0, 0.0, 1.0, 0.25, 0.0, 0.25, 1.0]),
        stages: vec![forces(0.5, 3.0, 1.5), forces(1.0, 6.0, -1.5)],
        schedule: vec![(0.25, 0), (0.5, 1)],
        drives: vec![
            Drive { order: 1, cos: row([0.0, 0.0, 1.5]), sin: row([0.0; 3]) },
            Drive { order: 3, cos: row([0.0; 3]), sin: row([0.0, 1.0, 0.0]) },
        ],
        gaps: vec![
            GapRow { row: row([1.0, -1.0, 0.0]), walls: [vec![], vec![left]] },
            GapRow { row: row([0.0, 1.0, -0.5]), walls: [vec![elastic, impact], vec![]] },
        ],
        friction: vec![DryFriction::new(row([0.0, 0.0, 2.0]), 0.2 * 3.0, 0.8)],
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    };
    assert_eq!(machine(&model), by_hand);
    assert_eq!((by_hand.degrees(), by_hand.omega), (3, 1.5));
    assert_eq!(model.state_names(), ["x", "v1", "y", "v2", "q", "v3"]);
    // A machine has its own laws: everything shapes the oscillator.
    assert_eq!(model.law(), Law::both(0.0, 0.0));
    assert!(model.parameters().iter().all(|parameter| parameter.shapes == Shapes::Oscillator));
    // Half a turn later odd harmonics have the other sign, and stages begin elsewhere.
    let mut later = model.clone();
    assert!(later.set_start_phase(std::f64::consts::PI));
    let turned = Oscillator {
        schedule: vec![(0.0, 1), (0.75, 0)],
        drives: vec![
            Drive { order: 1, cos: row([0.0, 0.0, -1.5]), sin: row([0.0; 3]) },
            Drive { order: 3, cos: row([0.0; 3]), sin: row([0.0, -1.0, 0.0]) },
        ],
        ..by_hand.clone()
    };
    assert_eq!(machine(&later), turned);
    // Without a force there is no first harmonic.
    let mut unforced = model.clone();
    unforced.set("F", 0.0).unwrap();
    assert_eq!(machine(&unforced).highest_order(), 3);
    assert_eq!(machine(&unforced).drives.len(), 1);
}

#[test]
fn eight_coordinates_are_read() {
    let rows = |diagonal: &str| {
        let row = |i: usize| {
            let entries = (0..8).map(|j| if i == j { diagonal } else { "0" });
            format!("[{}]", entries.collect::<Vec<_>>().join(", "))
        };
        format!("[{}]", (0..8).map(row).collect::<Vec<_>>().join(", "))
    };
    let names: Vec<String> = (1..9).map(|i| format!("'x{i}'")).collect();
    let text = format!(
        "name = 'eight'\n[motion]\ncoordinates = [{}]\nmass = {}\nstiffness = {}\nfrequency = 1\ngap = [0, 0, 0, 0, 0, 0, 1, -1]\n\
         [[contact]]\nside = 'left'\nat = -1\nlaw = 'impact'\nrestitution = 0.5\n",
        names.join(", "),
        rows("2"),
        rows("3"),
    );
    let model = read(&text);
    let found = machine(&model);
    assert_eq!((found.degrees(), found.gaps.len(), found.stages.len()), (8, 1, 1));
    assert_eq!((found.mass.trace(), found.stages[0].stiffness.sum()), (16.0, 24.0));
    assert!(found.drives.is_empty() && found.schedule.is_empty());
    assert_eq!(model.state_names()[14..], ["x8", "v8"]);
    assert_eq!(
        model.equations()[2..6],
        ["gap   z = x7 - x8", "rate  w = v7 - v8", "2 x1'' + 3 x1 = 0", "2 x2'' + 3 x2 = 0"]
    );
    let short = text.replace("[0, 0, 0, 0, 0, 0, 1, -1]", "[1, -1]");
    check_refusal(&short, "one gap row: a list of eight entries, one for each coordinate");
    let long = text.replace("stiffness = [", "stiffness = [[1], ");
    check_refusal(&long, "a matrix of eight rows with eight entries each");
}

#[test]
fn one_row_with_a_name_is_the_row_without_one() {
    let named = TWO_DEGREES.replace(r#"gap = ["1", "-2"]"#, r#"gap = { teeth = ["1", "-2"] }"#);
    let named = read(&named.replace("[[contact]]", "[[contact]]\ngap = \"teeth\""));
    let plain = read(TWO_DEGREES);
    let written = |model: &FileModel| format!("{:?} {:?}", model.oscillator().unwrap(), model.law());
    assert_eq!(written(&named), written(&plain), "to the bit");
    assert!(plain.oscillator().unwrap().needs_machine().is_none());
    assert_eq!((named.equations(), named.parameters()), (plain.equations(), plain.parameters()));
    assert_eq!(named.units(), plain.units());
    // With friction a named gap needs no wall, either.
    let (motion, _) = TWO_DEGREES.split_once("[[contact]]").unwrap();
    let motion = motion.replace(r#"gap = ["1", "-2"]"#, r#"gap = { teeth = ["1", "-2"] }"#);
    let free = read(&format!("{motion}[[friction]]\nrow = [1, 0]\nforce = 1\n"));
    assert!(free.oscillator().unwrap().gaps[0].walls[Side::Right.index()].is_empty());
}

#[test]
fn gaps_have_the_unit_that_all_of_them_share() {
    let gap = |units: &str| {
        let with = THREE.replace("[motion]", &format!("[motion]\ntime_unit = 's'\nunits = {units}"));
        read(&with.replace("\"-c\"]", "-0.5]")).units().gap
    };
    assert_eq!(gap("['mm', 'mm', 'mm']").as_deref(), Some("mm"));
    assert_eq!(gap("['rad', 'rad', 'mm']"), None);
}

#[test]
fn restitution_may_depend_on_the_approach_speed() {
    let with = |restitution: &str| {
        let text = ONE_DEGREE.replace("restitution = \"e\"", &format!("restitution = {restitution}"));
        FileModel::parse(&text, "m.toml")
    };
    let at = |text: &str| {
        let found = machine(&with(text).unwrap());
        found.gaps[0].walls[0][0].restitution.terms()
    };
    assert_eq!(at("\"e - 0.05*speed\""), [0.8, -0.05, 1.0]);
    assert_eq!(at("\"0.9 - 0.1*speed^0.2\""), [0.9, -0.1, 0.2]);
    assert_eq!(at("\"e*(1 - s*(speed/2)^s)\""), [0.8, 0.8 * (-0.2 * libm::pow(0.5, 0.2)), 0.2]);
    let model = with("\"e - 0.05*speed^s\"").unwrap();
    let shapes = |name: &str| model.parameters()[model.index(name).unwrap()].shapes;
    assert_eq!(
        [shapes("e"), shapes("s"), shapes("k")],
        [Shapes::Oscillator, Shapes::Oscillator, Shapes::Neither]
    );
    assert_eq!(model.law(), Law::both(0.0, 0.0));
    let found = machine(&model);
    assert_eq!((found.degrees(), &found.gaps[0].row), (1, &DVector::from_row_slice(&[1.0])));
    assert_eq!(model.equations(), read(ONE_DEGREE).equations());
    // The form may be lost for other values.
    let mut lost = with("\"e - 0.1*speed - 0.1*speed^(5*s)\"").unwrap();
    lost.set("s", 0.5).unwrap();
    let error = lost.oscillator().unwrap_err().to_string();
    assert!(
        error.starts_with("restitution of right wall 1 = NaN: it must be c + f*speed^p, where"),
        "{error}"
    );
    check_refusals(
        ONE_DEGREE,
        r#"
"e"\n | "exp(-speed)"\n | m.toml:27:15: `contact.0.restitution = "exp(-speed)"` does not fit: a restitution that depends on the approach speed has the form c + f*speed^p, where c, f and p do not contain `speed`, such as "0.9 - 0.1*speed^0.2"; values below 0 and above 1 count as 0 and 1
"e"\n | "e - speed - speed^2"\n | has the form c + f*speed^p
"e"\n | "e - speed^(-s)"\n | m.toml:27:15: `contact.0.restitution = "e - speed^(-s)"` does not fit: at the defaults of stop, exponent of restitution of right wall 1 = -0.2: it must be greater than 0
"e"\n | "e - 2*speed/0"\n | restitution of right wall 1 = NaN: it must be between 0 and 1
"e"\n | "e - 0.1*sped"\n | has an unknown name, `sped`: did you mean `speed`?
at = "s" | at = "speed" | `contact.0.at = "speed"` has an unknown name, `speed`
"#,
    );
    check_refusals(
        &ONE_DEGREE.replace("k = 1000", "speed = 1000"),
        r#"
"e"\n | "e - 1e-4*speed"\n | `contact.0.restitution = "e - 1e-4*speed"` does not fit: in a restitution `speed` is the approach speed, and the model has a parameter, a coordinate or a velocity of this name; rename it
"#,
    );
    check_refusals(
        &ONE_DEGREE.replace("gap = [1]", "gap = [1]\nvelocities = [\"speed\"]"),
        r#"
"e"\n | "e - 0.1*speed"\n | in a restitution `speed` is the approach speed
"#,
    );
    // A parameter of this name is an ordinary one elsewhere.
    let other = ONE_DEGREE.replace("k = 1000", "speed = 1000").replace("[[1]]", "[[\"speed\"]]");
    assert!(read(&other).oscillator().unwrap().needs_machine().is_none());
}

#[test]
fn gap_rows_may_depend_on_each_other() {
    let text = r#"
name = "two-masses"
[motion]
coordinates = ["x1", "x2"]
mass = [[1, 0], [0, 2]]
frequency = 1
gap = { left = [1, 0], middle = [-1, 1], right = [0, 1] }
[[contact]]
gap = "left"
side = "left"
at = 0
law = "impact"
restitution = 0.5
[[contact]]
gap = "middle"
side = "left"
at = 0
law = "impact"
restitution = 0.5
[[contact]]
gap = "right"
side = "right"
at = 10
law = "impact"
restitution = 0.5
"#;
    let oscillator = read(text).oscillator().unwrap();
    assert_eq!((oscillator.gaps.len(), oscillator.leading_gaps()), (3, vec![0, 1]));
}

#[test]
fn errors_in_gaps_name_the_field() {
    check_refusals(
        THREE,
        r#"
gap = { left = [1, -1, 0], right = [0, 1, "-c"] } | gap = [1, -1, 0] | m.toml:28:7: `contact.0.gap = "right"` does not fit: the gap row in [motion] has no name; remove it, or name the rows, such as gap = { a = [1, -1] }
gap = { left = [1, -1, 0], right = [0, 1, "-c"] } | gap = {} | `motion.gap = 0 rows` is out of range: it must be 1 to 6 rows with names, such as gap = { a = [1, -1, 0], b = [0, 1, -1] }
left = [1, -1, 0], | left = [1, -1, 0], c1 = [1, 0, 0], c2 = [0, 0, 1], c3 = [1, 0, 0], c4 = [1, 0, 1], c5 = [1, 1, 1], | `motion.gap = 7 rows` is out of range: it must be 1 to 6 rows
left = [1, -1, 0], | left = [1, -1, 0], low = [1, 0, 0], | m.toml:20:34: `motion.gap.low = [1, 0, 0]` does not fit: no wall limits this gap; write a [[contact]] with gap = "low", or remove the row
left = [1, -1, 0], | left = [1, -1], | m.toml:20:16: `motion.gap.left = [1, -1]` is out of range: it must be one gap row: a list of three entries, one for each coordinate
left = [1, -1, 0], | k = [1, -1, 0], | m.toml:20:13: `motion.gap.k = [1, -1, 0]` does not fit: `k` is already the name of a parameter, a coordinate or a velocity; rename the gap or the other
left = [1, -1, 0], | v2 = [1, -1, 0], | `v2` is already the name of a parameter
left = [1, -1, 0], | side = [1, -1, 0], | `side` is a column of tables
left = [1, -1, 0], | left = ["1/0", -1, 0], | m.toml:20:16: `motion.gap.left = ["1/0", -1, 0]` does not fit: at the defaults of three, row of gap 1 = inf: it must be a finite number
left = [1, -1, 0], | left = [0, -2, 1.0000001], | m.toml:20:7: `motion.gap = { ... }` does not fit: at the defaults of three, independence of the rows of the gaps 1 to 2
left = [1, -1, 0], | left = [0, 0, 0], | m.toml:20:16: `motion.gap.left = [0, 0, 0]` does not fit: at the defaults of three, the largest entry of the gap row of gap 1 = 0: it must be different from 0
gap = "right"\n | gap = "middle"\n | m.toml:28:7: `contact.0.gap = "middle"` is not known; valid names: left, right
gap = "right"\n | | m.toml:27:1: `contact.0.gap` is missing; the gaps in [motion] have names: write gap = "left" or gap = "right"
gap = "right"\n | gap = 1\n | `contact.0.gap = 1` has the wrong type: it must be one of left, right
at = "-d" | at = "1/0" | m.toml:38:6: `contact.1.at = "1/0"` does not fit: at the defaults of three, position of left wall 1 of gap 1 = inf: it must be a finite number
at = "2*d" | at = "d/2" | m.toml:46:6: `contact.2.at = "d/2"` does not fit: at the defaults of three, position of right wall 2 of gap 2 = 0.125: it must be farther out than the wall before it
["k", "k/2"] | ["k", "-k"] | m.toml:32:13: `contact.0.stiffness = ["k", "-k"]` does not fit: at the defaults of three, stiffness of right wall 1 of gap 2 = -3: it must be finite and at least 0
preload = 0.125 | preload = "1/0" | m.toml:33:11: `contact.0.preload = "1/0"` does not fit: at the defaults of three, preload of right wall 1 of gap 2 = inf
mesh_speed = "mu" | mesh_speed = "-mu" | m.toml:41:14: `contact.1.mesh_speed = "-mu"` does not fit: at the defaults of three, mesh_speed of left wall 1 of gap 1 = -0.2: it must be finite and at least 0
restitution = 0.5 | restitution = 1.5 | m.toml:48:15: `contact.2.restitution = 1.5` does not fit: at the defaults of three, restitution of right wall 2 of gap 2 = 1.5: it must be between 0 and 1
damping = "c" | damping = "-c" | m.toml:49:11: `contact.2.damping = "-c"` does not fit: at the defaults of three, damping of right wall 2 of gap 2 = -0.5
[[contact]]\ngap = "left" | [[contact]]\ngap = "left"\nside = "right"\nat = -1\nlaw = "elastic"\nstiffness = 1\n[[contact]]\ngap = "left" | m.toml:38:6: `contact.1.at = -1` does not fit: at the defaults of three, walls at -1 and -0.25: the right one must lie above the left one
"left"\nside = "left" | "right"\nside = "right" | m.toml:45:8: `contact.2.side = "right"` does not fit: the wall before it on this side has impacts
[0, 0, "m"] | [0, "m"] | `friction.0.row = [0, "m"]` is out of range: it must be the row of the sliding rate, row . v - speed: a list of three entries, one for each coordinate
[0, 0, "m"] | ["1/0", 0, 0] | m.toml:52:7: `friction.0.row = ["1/0", 0, 0]` does not fit: at the defaults of three, row of friction 1 = inf: it must be a finite number
[0, 0, "m"] | [0, 0, 0] | m.toml:52:7: `friction.0.row = [0, 0, 0]` does not fit: at the defaults of three, independence of the rows of friction 1 to 1 = 0: it must be above 1e-12
force = "mu*k" | force = "-mu" | m.toml:53:9: `friction.0.force = "-mu"` does not fit: at the defaults of three, force of friction 1 = -0.2: it must be finite and at least 0
["m", 0, 0] | ["-m", 0, 0] | m.toml:14:8: `motion.mass = [["-m", 0, 0], [0, 1, 0.25], [0, 0.25, 1]]` does not fit: at the defaults of three, lowest eigenvalue of the mass matrix = -2: it must be greater than 0
["m", 0, 0] | ["m", 1, 0] | `motion.mass = [["m", 1, 0], [0, 1, 0.25], [0, 0.25, 1]]` does not fit: at the defaults of three, difference of opposite entries of mass = 1: it must be 0: the matrix must be symmetric
[0, 5, -1] | [0, 5, 1] | difference of opposite entries of stiffness = 2: it must be 0: the matrix must be symmetric
["c", 1] | ["c", "1/0"] | `motion.damping = [["c", "-c", 0], ["-c", "c", "0"], [0, 0, ["c", "1/0"]]]` does not fit: at the defaults of three, damping in stage 2 = inf: it must be a finite number
force = [0, 0, "F"] | force = [0, 0, "F/0"] | m.toml:18:9: `motion.force = [0, 0, "F/0"]` does not fit: at the defaults of three, cosine of harmonic 1 = inf
frequency = 1.5 | frequency = 0 | m.toml:19:13: `motion.frequency = 0` does not fit: at the defaults of three, excitation frequency = 0
"#,
    );
    let (motion, _) = THREE.split_once("[[contact]]").unwrap();
    check_refusal(motion, "`contact` is missing; write [[contact]]");
    // Each of several gaps needs a wall, with friction, too.
    let friction = format!("{motion}[[friction]]\nrow = [1, 0, 0]\nforce = 1\n");
    check_refusal(&friction, "`contact` is missing");
}

#[test]
fn each_side_of_each_gap_may_have_four_walls() {
    let (motion, _) = THREE.split_once("[[contact]]").unwrap();
    let wall = |gap: &str, side: &str, nth: usize| {
        let sign = if side == "left" { "-" } else { "" };
        format!(
            "[[contact]]\ngap = '{gap}'\nside = '{side}'\nat = '{sign}{nth}*d'\nlaw = 'elastic'\nstiffness = 'k'\n"
        )
    };
    let walls = |count: usize| {
        let all = ["left", "right"].into_iter().flat_map(|gap| ["left", "right"].map(|side| (gap, side)));
        all.flat_map(|(gap, side)| (1..=count).map(move |nth| wall(gap, side, nth))).collect::<String>()
    };
    let model = read(&format!("{motion}{}", walls(4)));
    assert!(machine(&model).gaps.iter().flat_map(|gap| &gap.walls).all(|side| side.len() == 4));
    let many = "it must be 1 to 16 tables, [[contact]]: a gap has up to 4 walls on each side";
    check_refusal(&format!("{motion}{}", walls(5)), many);
    let five: String = (1..6).map(|nth| wall("left", "right", nth)).collect();
    let expected = "there are already 4 walls on this side; a gap has up to 4 on each side";
    check_refusal(&format!("{motion}{five}"), expected);
}

#[test]
fn equations_of_several_gaps_have_one_contact_force_for_each() {
    assert_eq!(
        read(THREE).equations(),
        [
            "M x'' + C(t) x' + K(t) x + friction + g_left N_left + g_right N_right = F(t) + load(t), with the contact force N \
             along the row g of each gap",
            "x = (x, y, q), 3 coordinates",
            "gap   left = x - y",
            "rate  left' = v1 - v2",
            "gap   right = y - c q",
            "rate  right' = v2 - c v3",
            "stages  1 from phase 0.25, 2 from phase 0.5 of each forcing period",
            "        [stage 1 | stage 2] lists the values of an entry that changes",
            "friction  sticks at m q' - e = 0 while |friction force| <= mu*k",
            "m x'' + c x' - c y' + [k | 2*k] x + N_left = 0",
            "y'' + 0.25 q'' - c x' + c y' + 5 y - q - N_left + N_right = sin(4.5 t) + [F | -F]",
            "0.25 y'' + q'' + [c | 1] q' - y + 4 q + m*mu*k sgn(m q' - e) - c N_right = F cos(1.5 t)",
        ]
    );
    let contacts = read(THREE).contacts();
    let of =
        |columns: [usize; 2]| contacts.iter().map(|row| columns.map(|i| row[i].as_str())).collect::<Vec<_>>();
    let force = "[k | k/2] (right - d) + 0.125";
    assert_eq!(
        of([0, 5]),
        [
            ["left of left", "keeps left = -d while pressed"],
            ["right 1 of right", force],
            ["right 2 of right", &format!("{force} + c right'")],
        ]
    );
}

#[test]
fn a_machine_starts_at_the_same_phase_as_an_oscillator() {
    let text = ONE_DEGREE.replace("gap = [1]", "gap = [1]\nforce_sin = [0.75]") + HARMONICS;
    let mut plain = read(&text);
    let mut by_speed = read(&text.replace("restitution = \"e\"", "restitution = \"e - 0.1*speed\""));
    assert!(plain.set_start_phase(1.0) && by_speed.set_start_phase(1.0));
    let (oscillator, machine) = (plain.oscillator().unwrap(), machine(&by_speed));
    assert_eq!(machine.drives.len(), 3);
    assert_eq!(machine.drives, oscillator.drives);
}

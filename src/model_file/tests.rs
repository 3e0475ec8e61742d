//! Reading of model files: the values of valid files, and every kind of error.

use rattlemap_dynamics::model::{Contact, Domain, Harmonic, Model, Range, Shapes, Side};

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
        let message = FileModel::parse(&text.replacen(&old, &new, 1), "m.toml").expect_err(&new).to_string();
        assert!(message.contains(&expected), "{new}: expected {expected:?} in: {message}");
    }
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
    let oscillator = model.oscillator().unwrap();
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
    let oscillator = model.oscillator().unwrap();
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
    assert!(model.definition().wall(Side::Left).is_some());
}

#[test]
fn errors_name_the_field_and_the_limit() {
    check_refusals(
        ONE_DEGREE,
        r#"
["x"] | ["x", "y", "q"] | m.toml:14:15: `motion.coordinates = ["x", "y", "q"]` is out of range: it must be one or two names: a model has at most two degrees of freedom
["x"] | [] | at most two degrees of freedom
gap = [1] | gap = [1]\nforce2 = ["F"] | m.toml:22:1: unknown field `motion.force2 = ["F"]`; did you mean `force`?
gap = [1] | gap = [1]\nharmonics = 2 | a model has one or two coordinates and one gap row
"omega"\ngap | ["omega", "2*omega"]\ngap | m.toml:20:13: `motion.frequency = ["omega", "2*omega"]` has the wrong type: it must be one entry, the frequency of the forcing period; write further harmonics of the force as [[harmonic]]
gap = [1] | gap = [1]\nrepeat = 2 | m.toml:22:10: `motion.repeat = 2` does not fit: it repeats stages, but the model has none
gap = [1] | gap = [1]\nstages = [0] | `motion.stages = 1 phases` is out of range: it must be a list of 2 to 8 phases in [0, 1)
gap = [1] | gap = [1]\nstages = [0, 0.5]\nrepeat = 513 | `motion.repeat = 513` is out of range: it must be a whole number from 1 to 512
gap = [1] | gap = [1]\nstages = [0.5, 0.2] | m.toml:22:10: `motion.stages = [0.5, 0.2]` does not fit: at the defaults of stop, phase of a stage = 0.2: it must be in [0, 1) and above those before it
gap = [1] | gap = [1]\nstages = [0, "s + 1"] | phase of a stage = 1.2: it must be in [0, 1)
"2*zeta" | [1, 2] | `motion.damping.0.0 = [1, 2]` does not fit: a list has one value per stage, but the model has no stages; write `motion.stages`
["-0.5"]\nfrequency = "omega"\n | [[1, 2, 3]]\nfrequency = "omega"\nstages = [0, 0.5]\n | `motion.load.0 = 3 entries` is out of range: it must be one entry, or a list of 2, one for each stage
[["1"]] | [[[1, 2]]] | `motion.mass.0.0 = [1, 2]` has the wrong type: it must be an expression in quotes
frequency = "omega"\ngap = [1] | frequency = "omega"\nstages = [0, 0.5]\ngap = [[1, 2]] | `motion.gap.0 = [1, 2]` has the wrong type
at = "s" | at = [1, 2] | `contact.0.at = [1, 2]` has the wrong type
restitution = "e" | restitution = [0.1, 0.2]\n[[harmonic]]\norder = 2\ncos = [1] | `contact.0.restitution = [0.1, 0.2]` has the wrong type
[[contact]] | [[harmonic]]\norder = 1\ncos = [1]\n[[contact]] | `harmonic.0.order = 1` is out of range: it must be a whole number from 2 to 64
[[contact]] | [[harmonic]]\ncos = [1]\n[[contact]] | `harmonic.0.order` is missing
[[contact]] | [[harmonic]]\norder = 3\n[[contact]] | `harmonic.0.cos` is missing; write the amplitudes of the cosine, or of the sine as `sin`
[[contact]] | [[harmonic]]\norder = 3\ncos = [1, 2]\n[[contact]] | `harmonic.0.cos = [1, 2]` is out of range: it must be amplitudes of one harmonic: a list of one entry
[[contact]] | [[harmonic]]\norder = 3\ncos = [1]\n[[harmonic]]\norder = 3\nsin = [1]\n[[contact]] | `harmonic.1.order = 3` does not fit: there is already a harmonic of this order
gap = [1] | gap = [[1], [2]] | m.toml:21:7: `motion.gap = [[1], [2]]` is out of range: it must be one gap row: a list of one entry
[[contact]] | [[contact]]\nside = "left"\nat = -1\nlaw = "impact"\nrestitution = 1\n[[contact]]\nside = "left"\nat = -1\nlaw = "impact"\nrestitution = 1\n[[contact]] | `contact = 3 tables` is out of range: it must be one or two tables, [[contact]]: a model has at most two walls
[[contact]] | [[contact]]\nside = "right"\nat = 1\nlaw = "impact"\nrestitution = 1\n[[contact]] | m.toml:29:8: `contact.1.side = "right"` does not fit: there is already a wall on this side
"impact" | "elastic" | m.toml:27:15: `contact.0.restitution = "e"` does not fit: it needs law = "impact"
"impact"\nrestitution = "e" | "elastic" | `contact.0.stiffness` is missing; an elastic wall needs
restitution = "e" | | m.toml:23:1: `contact.0.restitution` is missing
"impact" | "sticky" | `contact.0.law = "sticky"` is not known; valid names: impact, elastic
"2*zeta" | "2*zta" | m.toml:16:13: `motion.damping.0.0 = "2*zta"` has an unknown name, `zta`: did you mean `zeta`?
"2*zeta" | "2*y" | has an unknown name, `y`
"2*zeta" | "x^2" | m.toml:16:13: `motion.damping.0.0 = "x^2"` does not fit: `x` is a coordinate, and entries are constants of a cell; time enters only through `frequency`, coordinates do not enter; write the factor of x in `stiffness`
"2*zeta" | "zeta*v" | `v` is a velocity, and entries are constants of a cell
"F*omega^2" | "F*cos(omega*t)" | m.toml:18:10: `motion.force.0 = "F*cos(omega*t)"` does not fit: `t` is the time, and entries are constants of a cell
"F*omega^2" | "time" | `time` is the time
at = "s" | at = "s + x" | m.toml:25:6: `contact.0.at = "s + x"` does not fit: `x` is a coordinate
"2*zeta" | "2*" | m.toml:16:13: `motion.damping.0.0 = "2*"` cannot be read to its end
"2*zeta" | true | must be an expression in quotes
[["1"]] | [["F-1.5"]] | m.toml:15:8: `motion.mass = [["F-1.5"]]` does not fit: at the defaults of stop, mass = 0
gap = [1] | gap = ["F-1.5"] | m.toml:21:7: `motion.gap = ["F-1.5"]` does not fit: at the defaults of stop, the largest entry of the gap row = 0
"impact"\nrestitution = "e"\n | "elastic"\nstiffness = -0.5\n | m.toml:27:13: `contact.0.stiffness = -0.5` does not fit: at the defaults of stop, stiffness added in contact with the right wall = -0.5: it must be at least 0
[["1"]] | [["1", "0"]] | `motion.mass.0 = ["1", "0"]` is out of range
at = "s" | at = "1/0" | m.toml:25:6: `contact.0.at = "1/0"` does not fit: at the defaults of stop, position of the right wall = inf
"e"\n | "2*e"\n | m.toml:27:15: `contact.0.restitution = "2*e"` does not fit: at the defaults of stop, restitution = 1.6
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
frequency = "omega"\n | | `motion.frequency` is missing; name it, such as frequency = "omega"; without a force any value works
mass = [["1"]]\n | | m.toml:13:2: `motion.mass` is missing
"#,
    );
    check_refusals(
        TWO_DEGREES,
        r#"
"-k"], ["-k" | "-k"], ["k" | m.toml:15:13: `motion.stiffness = [["k", "-k"], ["k", "k+1"]]` does not fit: at the defaults of two, stiffness in free motion = [[3, -3], [3, 4]]: the matrix must be symmetric
"0.5"], ["0.5" | "5"], ["5" | m.toml:13:8: `motion.mass = [["m", "5"], ["5", "1"]]` does not fit: at the defaults of two, mass = [[2, 5], [5, 1]]: the matrix must be positive definite
at = "-d" | at = "2*d" | `contact.0.at = "2*d"` does not fit: at the defaults of two, walls at 0.25 and 0.5
["va", "vb"] | ["va"] | `motion.velocities = ["va"]` is out of range: it must be a list of names, one for each coordinate
["va", "vb"] | ["va", "a"] | `a` is already the name of
"10*k" | "10*k*log(0)" | m.toml:23:13: `contact.0.stiffness = "10*k*log(0)"` does not fit
"#,
    );
    let none = FileModel::parse(&ONE_DEGREE[..ONE_DEGREE.find("[[contact]]").unwrap()], "m.toml")
        .unwrap_err()
        .to_string();
    assert!(none.contains("`contact` is missing; write [[contact]]"), "{none}");
}

#[test]
fn common_names_are_free_and_the_gap_gets_another_name() {
    let renamed =
        ONE_DEGREE.replace("\"x\"", "\"z\"").replace("F = 1.5", "w = 1.5\nn = 2").replace("F*", "w*n*");
    let model = read(&renamed);
    assert_eq!((model.state_names(), gap_names(&model)), (vec!["z", "v"], ["gap", "gap_rate"]));
    assert_eq!(model.equations()[..3], ["gap   gap = z", "rate  gap_rate = v", "free, gap < s"]);
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
            "gap   z = x1 - x2",
            "rate  w = v1 - v2",
            "free, -b < z < b",
            "    m1 x1'' + r1 x1' + k1 x1 = F cos(omega t)",
            "    m2 x2'' + r2 x2' + k2 x2 = 0",
            "behind the right wall, with N = k (z - b) + r w",
            "    m1 x1'' + r1 x1' + k1 x1 + N = F cos(omega t)",
            "    m2 x2'' + r2 x2' + k2 x2 - N = 0",
            "behind the left wall, with N = k (z + b) + r w",
            "    m1 x1'' + r1 x1' + k1 x1 + N = F cos(omega t)",
            "    m2 x2'' + r2 x2' + k2 x2 - N = 0",
        ]
    );
    assert_eq!(
        read(ONE_DEGREE).equations(),
        [
            "gap   z = x",
            "rate  w = v",
            "free, z < s",
            "    x'' + 2*zeta x' + x = F*omega^2 cos(omega t) - 0.5",
            "on the right wall: z stays s, as long as it is pressed",
        ]
    );
    assert_eq!(
        read(TWO_DEGREES).equations()[3..8],
        [
            "    m a'' + 0.5 b'' + c a' - c b' + k a - k b = 0",
            "    0.5 a'' + b'' - c a' + (c + d) b' - k a + (k+1) b = 0",
            "behind the right wall, with N = 100 (z - d)",
            "    m a'' + 0.5 b'' + c a' - c b' + k a - k b + N = 0",
            "    0.5 a'' + b'' - c a' + (c + d) b' - k a + (k+1) b - 2 N = 0",
        ]
    );
}

#[test]
fn a_force_has_a_cosine_and_a_sine() {
    let force = "force = [\"F*omega^2\"]";
    let mut model = read(&ONE_DEGREE.replace(force, &format!("{force}\nforce_sin = [\"-2*F\"]")));
    let at_zero = model.oscillator().unwrap();
    assert_eq!((at_zero.force, at_zero.force_sin), ([6.0, 0.0], [-3.0, 0.0]));
    let [_, _, _, free, ..] = &model.equations()[..] else { panic!("{:?}", model.equations()) };
    assert!(free.ends_with("= F*omega^2 cos(omega t) - 2*F sin(omega t) - 0.5"), "{free}");
    assert!(model.parameters()[model.index("F").unwrap()].shapes.oscillator());
    // A quarter turn later the cosine has become the negative sine.
    let before = model.clone();
    assert!(model.set_start_phase(std::f64::consts::FRAC_PI_2));
    let later = model.oscillator().unwrap();
    assert!((later.force[0] + 3.0).abs() < 1e-15 && (later.force_sin[0] + 6.0).abs() < 1e-15, "{later:?}");
    assert_eq!((later.force[1], later.force_sin[1]), (0.0, 0.0));
    assert_ne!(model, before);
    check_refusals(
        ONE_DEGREE,
        "gap = [1] | force_sin = [1, 2]\\ngap = [1] | a list of one entry, one for each coordinate",
    );
}

#[test]
fn harmonics_are_sorted_and_stages_are_repeated() {
    let text = ONE_DEGREE
        .replace("gap = [1]", "gap = [1]\nstages = [\"s\", \"0.6\"]\nrepeat = 2")
        .replace("[[\"2*zeta\"]]", "[[[\"zeta\", \"2*zeta\"]]]")
        .replace(
            "[[contact]]",
            "[[harmonic]]\norder = 5\nsin = [\"2*F\"]\n[[harmonic]]\norder = 2\ncos = [\"e\"]\n[[contact]]",
        )
        .replace("restitution = \"e\"", "restitution = \"e\"\nstiffness = [10, \"k\"]");
    let model = read(&text);
    let oscillator = model.oscillator().unwrap();
    let harmonic = |order, cos, sin| Harmonic { order, cos: [cos, 0.0], sin: [sin, 0.0] };
    assert_eq!(oscillator.harmonics, [harmonic(2, 0.8, 0.0), harmonic(5, 0.0, 3.0)]);
    assert_eq!(oscillator.schedule, [(0.1, 0), (0.3, 1), (0.6, 0), (0.8, 1)]);
    let [second] = &oscillator.stages[..] else { panic!("{:?}", oscillator.stages) };
    assert_eq!((oscillator.free.damping[0][0], second.free.damping[0][0]), (0.25, 0.5));
    let k = model.get("k").unwrap();
    assert_eq!(oscillator.meshing[0].stiffness[0][0], 11.0);
    assert_eq!((second.meshing[0].stiffness[0][0], second.meshing[0].load[0]), (1.0 + k, k * 0.2 - 0.5));
    let shapes = |name: &str| model.parameters()[model.index(name).unwrap()].shapes;
    assert_eq!(
        (shapes("s"), shapes("e"), shapes("k")),
        (Shapes::Oscillator, Shapes::Both, Shapes::Oscillator)
    );
    let lines = model.equations();
    assert!(lines.contains(
        &"stages of 1/2 of a period: 1 from s, 2 from 0.6; [a | b] is a in the first stage, b in the second".to_owned()
    ));
    let free = &lines[4];
    assert!(
        free.contains("[zeta | 2*zeta] x'") && free.contains("e cos(2 omega t) + 2*F sin(5 omega t)"),
        "{free}"
    );
}

/// Equal values in all stages give the motion of a model without stages.
#[test]
fn a_list_of_equal_values_is_one_value() {
    let staged = ONE_DEGREE
        .replace("gap = [1]", "gap = [1]\nstages = [0, 0.6]")
        .replace("[[\"2*zeta\"]]", "[[[\"2*zeta\", \"2*zeta\"]]]");
    let [plain, staged] = [ONE_DEGREE, &staged].map(|text| read(text).oscillator().unwrap());
    assert_eq!((staged.free, staged.meshing), (plain.free, plain.meshing));
    assert_eq!((staged.stages[0].free, staged.stages[0].meshing), (plain.free, plain.meshing));
}

//! `--along`: a diagram along one of two axes.

use super::*;
use crate::map::scene::Along;
use rattlemap_dynamics::model::state;

const PLANE: &str = "parameters = { F = 40.0 }
[[axis]]
parameter = \"e\"
min = 0.1
max = 0.9
count = 5
[[axis]]
parameter = \"omega\"
min = 1.0
max = 12.0
count = 3
";

fn along(text: &str, sets: &[&str], parameter: &str, at: &[&str]) -> Result<Scene, SceneError> {
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    let along = Along { parameter: parameter.to_owned(), at: at.iter().map(ToString::to_string).collect() };
    let find: FindFile<'_> = &|_, file| Err(format!("{file} is not here"));
    Scene::parse_with_files(text, "s.toml", &sets, Purpose::Bifurcation, Some(&along), find)
}

#[test]
fn the_other_axis_gets_exactly_the_given_value() {
    for (parameter, at, other, value) in
        [("e", "omega = 5.6", "omega", 5.6), ("omega", "e=0.3333333333333333", "e", 0.3333333333333333)]
    {
        let scene = along(PLANE, &["axis.0.count=4"], parameter, &[at]).unwrap();
        let [axis] = scene.axes() else { panic!("{} axes", scene.axes().len()) };
        assert_eq!(
            (&*axis.parameter().name, axis.count()),
            (parameter, if parameter == "e" { 4 } else { 3 })
        );
        for (on_axis, model) in scene.line() {
            assert_eq!([parameter, other, "F"].map(|name| model.get(name).unwrap()), [on_axis, value, 40.0]);
        }
    }
    // A scene with one axis may be named, too. A value may be outside of the axis, but not of the parameter's range.
    let one = PLANE.split("[[axis]]").take(2).collect::<Vec<_>>().join("[[axis]]");
    assert_eq!(along(&one, &[], "e", &[]).unwrap().axes().len(), 1);
    assert!(along(PLANE, &[], "e", &["omega=20"]).is_ok());
}

#[test]
fn names_that_do_not_fit_the_axes_are_refused() {
    for [parameter, at, expected] in test_cases(
        r#"
F | | --along F:  && the scene does not sweep it; its axes: e, omega
e | | --along e:  && `--at omega=VALUE` is missing && give the value of omega on the line
e | k=800 | --at k=800:  && no axis to fix; its axes: e, omega && --set k=800
e | e=0.5 | --at e=0.5:  && --along sweeps it
e | omega=5 omega=6 | --at omega=6:  && names it twice
e | omega | --at omega:  && expected NAME=VALUE
e | omega=fast | --at omega=fast:  && has the wrong type: it must be a number
e | omega=-1 | --at omega=-1: `parameters.omega = -1` is out of range
omega | e=nan | --at e=nan:  && between 0 and 1
"#,
    ) {
        let at: Vec<&str> = at.split_whitespace().collect();
        assert_says(&along(PLANE, &[], &parameter, &at).unwrap_err().to_string(), &parts(&expected));
    }
    let message = along(PLANE, &["omega=6"], "e", &["omega=5"]).unwrap_err().to_string();
    assert_says(&message, &["--set omega=6: ", "--at gives `omega` its value"]);
    // The text sets the parameter of the other axis.
    let both = PLANE.replace("F = 40.0", "F = 40.0, omega = 6.0");
    let message = along(&both, &[], "e", &["omega=5"]).unwrap_err().to_string();
    assert_says(&message, &["s.toml:1:34: `parameters.omega = 6.0`", "--at gives `omega` its value"]);
    // The other axis is checked, too.
    let bad = PLANE.replace("max = 12.0", "max = 0.5");
    assert_says(&along(&bad, &[], "e", &["omega=5"]).unwrap_err().to_string(), &["`axis.1.max = 0.5`"]);
}

#[test]
fn the_error_for_a_plane_shows_the_option_along() {
    let message = Scene::parse(PLANE, "s.toml", &[], Purpose::Bifurcation).unwrap_err().to_string();
    assert_says(
        &message,
        &["s.toml:7:1: ", "`axis = 2 tables`", "one table for `bifurcation`", "--along e --at omega=VALUE"],
    );
}

#[test]
fn settings_of_maps_are_ignored_in_the_text_and_refused_in_arguments() {
    let of_a_map = format!(
        "{PLANE}[start]\npolicy = 'state'\nstate = [0.1, 0, 0, 0]\ncount = 8\nseed = 3\n[refine]\nmax_error = 0.01\n\
         [outputs]\nfiles = ['npy', 'png', 'html']\nquantities = ['word']\n[integration]\ntransient_periods = 77\n"
    );
    let scene = along(&of_a_map, &[], "e", &["omega=5"]).unwrap();
    assert_eq!(scene.outputs().files, [Format::Png]);
    assert_eq!((scene.start(), scene.draw(), scene.refine()), (Start::State(state(&[0.1])), None, None));
    assert_eq!(scene.integration().transient_periods, 77);
    let none = of_a_map.replace("'npy', 'png', 'html'", "'html'");
    assert_eq!(along(&none, &[], "e", &["omega=5"]).unwrap().outputs().files, [Format::Csv, Format::Png]);
    for (set, part) in [
        ("outputs.files=[\"html\"]", "remove \"html\""),
        ("start.count=4", "follows one motion per column"),
        ("refine.max_error=0.1", "remove [refine]"),
    ] {
        assert_says(&along(&of_a_map, &[set], "e", &["omega=5"]).unwrap_err().to_string(), &[part]);
    }
}

#[test]
fn an_axis_named_by_an_argument_overrides_the_text() {
    let scene = along(PLANE, &["axis.1.parameter=F"], "e", &["F=55"]).unwrap();
    assert_eq!(scene.line()[0].1.get("F").unwrap(), 55.0);
}

#[test]
fn scale_and_derived_parameters_are_preserved() {
    let text =
        PLANE.replace("min = 1.0", "scale = 'log'\nmin = 1.0") + "[derived]\nmesh_speed = \"1e-3 * e\"\n";
    let scene = along(&text, &[], "omega", &["e=0.25"]).unwrap();
    assert_eq!(scene.axes()[0].scale(), crate::map::scene::Scale::Log);
    assert!(scene.line().iter().all(|(_, model)| model.get("mesh_speed").unwrap() == 0.25e-3));
}

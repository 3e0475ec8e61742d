//! Components of the start as axes and as columns.

use super::*;
use crate::map::plan::Plan;
use crate::map::scene::{CompanionFile, FileText};
use rattlemap_dynamics::model::Stops;
use rattlemap_dynamics::model::state;

const START_PLANE: &str = "[parameters]\ne = 0.5\n\n[[axis]]\nstart = 'v1'\nmin = -2\nmax = 2\ncount = 5\n\n\
                     [[axis]]\nstart = 'x2'\nvalues = [-0.5, 0.25]\n";

fn map(text: &str, sets: &[&str]) -> Result<Scene, SceneError> {
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    Scene::parse(text, "s.toml", &sets, Purpose::Map)
}

fn refused(sets: &[&str]) -> String {
    map(START_PLANE, sets).expect_err(&sets.join(" ")).to_string()
}

#[test]
fn cells_have_different_starts_and_share_one_flow() {
    for (sets, others) in [
        (&[][..], [0.0; 4]),
        (&["start.policy=state", "start.state=[0.1, 7, 8, -0.25]"][..], [0.1, 7.0, 8.0, -0.25]),
    ] {
        let scene = map(START_PLANE, sets).unwrap();
        assert!(scene.is_basin() && scene.sweeps_start());
        let plan = Plan::new(&scene);
        assert_eq!((plan.flow_count(), plan.law_count(), plan.is_basin()), (1, 1, true));
        for id in 0..10 {
            let [v1, x2] = [-2.0 + f64::from(id % 5), [-0.5, 0.25][id as usize / 5]];
            let start = state(&[others[0], v1, x2, others[3]]);
            assert_eq!((plan.cell(id).start, plan.start(id, &[])), (start, start));
            assert_eq!(plan.points().values(id as usize), [v1, x2]);
        }
    }
}

#[test]
fn one_axis_may_be_a_parameter() {
    let scene = map(START_PLANE, &["axis.1.parameter=omega", "axis.1.values=[2,4]"]).unwrap();
    let plan = Plan::new(&scene);
    assert_eq!((plan.flow_count(), plan.law_count()), (2, 1));
    assert_eq!(plan.cell(9).start, state(&[0.0, 2.0]));
    assert_eq!(plan.model(9).get("omega"), Ok(4.0));
    assert!(scene.is_basin());
    assert!(scene.fixed().all(|(parameter, _)| parameter.name != "omega"));
    // An argument can also replace a parameter by a component of the start.
    let text =
        START_PLANE.replace("start = 'x2'\nvalues = [-0.5, 0.25]", "parameter = 'omega'\nvalues = [2, 4]");
    assert_eq!(map(&text, &["axis.1.start=v2"]).unwrap().axes()[1].target(), Target::Start(3));
}

#[test]
fn settings_that_contradict_axes_of_the_start_are_refused() {
    for [sets, expected] in test_cases(
        r#"
axis.0.start=w1 | --set axis.0.start=w1: `axis.0.start = w1` is not known && x1, v1, x2, v2
axis.1.start=v1 | `axis.1.start = v1` && axis 0 sweeps it already; name another component
axis.0.min=nan | `axis.0.min = nan` is out of range: it must be a finite number, as `v1` is
start.policy=up | `start.policy = up` && give each cell its start && use "rest" or "state"
start.policy=down | `start.policy = down` && give each cell its start
start.policy=both | `start.policy = both`
start.count=3 | `start.count = 3` && give each cell its start; remove the count
axis.0.start=v1 axis.0.parameter=e | `axis.0.start = v1` && `axis.0.parameter` is given, too
axis.1.parameter=omega axis.1.values=[2,4] refine.rounds=2 | `refine && can be matched only after all cells are known && or remove [refine]
"#,
    ) {
        assert_says(&refused(&sets.split(' ').collect::<Vec<_>>()), &parts(&expected));
    }
    let both = START_PLANE.replacen("start = 'v1'", "start = 'v1'\nparameter = 'omega'", 1);
    assert_says(&map(&both, &[]).unwrap_err().to_string(), &["s.toml:5:9:", "remove one of the two"]);
    let neither = START_PLANE.replacen("start = 'v1'\n", "", 1);
    assert_says(
        &map(&neither, &[]).unwrap_err().to_string(),
        &["`axis.0.parameter` is missing", "or a component of the start with `start`"],
    );
    let line = "[[axis]]\nstart = 'v1'\nmin = 0\nmax = 1\ncount = 2\n";
    let message = parse(&format!("[parameters]\ne = 0.5\n{line}"), &[]).unwrap_err().to_string();
    assert_says(&message, &["`axis.0.start = 'v1'`", "`bifurcation` follows one motion"]);
    let along = Along { parameter: "e".to_owned(), at: vec!["v1=1".to_owned()] };
    let plane = format!("{line}[[axis]]\nparameter = 'e'\nmin = 0\nmax = 1\ncount = 2\n");
    let find: FindFile<'_> = &|_, _| unreachable!();
    let read = Scene::parse_with_files(&plane, "s.toml", &[], Purpose::Bifurcation, Some(&along), find);
    assert_says(&read.unwrap_err().to_string(), &["`axis.0.start = 'v1'`", "(`map`) can sweep the start"]);
}

#[test]
fn a_list_may_have_columns_of_the_start() {
    let text = "[parameters]\nF = 40.0\nomega = 4.0\n\n[cells]\nfile = 'p.csv'\n";
    let read = |table: &str, sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        let find = |_: CompanionFile, _: &str| {
            Ok::<_, String>(FileText { name: "p.csv".to_owned(), text: table.to_owned() })
        };
        Scene::parse_with_files(text, "s.toml", &sets, Purpose::Map, None, &find)
    };
    let scene = read("v2,e\n1,0.5\n-2,0.5\n3,0.25\n", &[]).unwrap();
    let plan = Plan::new(&scene);
    assert_eq!((plan.flow_count(), plan.law_count(), plan.is_basin()), (1, 2, false));
    let starts = [0, 1, 2].map(|id| plan.cell(id).start[3]);
    assert_eq!((starts, plan.law(plan.cell(2).law)), ([1.0, -2.0, 3.0], scene.cell(&[2]).law()));
    assert_eq!(scene.list().unwrap().to_csv(), "v2,e\n1.0,0.5\n-2.0,0.5\n3.0,0.25\n");
    let refused = |table: &str, sets: &[&str]| read(table, sets).unwrap_err().to_string();
    assert_says(
        &refused("v2,v3\n1,0.5\n", &[]),
        &["p.csv:1:2: `column 2 = v3` is not known", "components of the start: x1"],
    );
    assert_says(&refused("v2,v2\n1,0.5\n", &[]), &["another column sets it"]);
    assert_says(&refused("v2,e\n1,0.5\n", &["start.count=2"]), &["remove the count"]);
}

#[test]
fn a_built_scene_has_axes_of_the_start() {
    let scene = Scene::builder(Stops::with_restitution(0.8))
        .start_axis("x", -0.5..=0.5, 3)
        .start_axis("v", 0.0..=2.0, 5)
        .build();
    let scene = scene.unwrap();
    assert_eq!(Plan::new(&scene).cell(14).start, state(&[0.5, 2.0]));
    assert_eq!(scene.title().matches("at the start").count(), 2, "{}", scene.title());
    let identity = scene.identity();
    assert!(identity.contains(&("axis.0.start".to_owned(), "x".to_owned())), "{identity:?}");
    let wrong = Scene::builder(Stops::with_restitution(0.8)).start_axis("x2", 0.0..=1.0, 2);
    assert_says(
        &wrong.axis("F", 0.0..=1.0, 2).build().unwrap_err().to_string(),
        &["`axis.0.start = \"x2\"`"],
    );
}

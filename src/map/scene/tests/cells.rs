//! Lists of cells.

use super::*;
use crate::map::plan::Plan;
use crate::map::scene::FileText;
use rattlemap_dynamics::model::Form;

const SCENE: &str = "[parameters]\nF = 40.0\n\n[cells]\nfile = \"points.csv\"\n";
const TABLE: &str = "e,omega\n0.5,5.6\n0.25,4\n\n 0.5 , 5.6e0 \n0.5,7\n";

fn read(scene: &str, table: &str, sets: &[&str]) -> Result<Scene, SceneError> {
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    let find = |_, file: &str| {
        assert_eq!(file, "points.csv");
        Ok(FileText { name: "dir/points.csv".to_owned(), text: table.to_owned() })
    };
    Scene::parse_with_files(scene, "s.toml", &sets, Purpose::Map, None, &find)
}

fn refused(scene: &str, table: &str, sets: &[&str]) -> String {
    read(scene, table, sets).expect_err(table).to_string()
}

#[test]
fn a_list_defines_the_cells() {
    let scene = read(SCENE, TABLE, &[]).unwrap();
    let list = scene.list().unwrap();
    let names: Vec<&str> = list.parameters().map(|parameter| &*parameter.name).collect();
    assert_eq!((names, list.len(), list.file()), (vec!["e", "omega"], 4, "points.csv"));
    assert_eq!((scene.axes().len(), scene.cell_count()), (0, 4));
    assert_eq!(pair(&*scene.cell(&[1])), GearPair { force: 40.0, omega: 4.0, ..GearPair::paper(0.25) });
    assert_eq!(scene.outputs().files, [Format::Csv, Format::Npy]);
    assert_eq!(scene.title(), "Gear pair: the cells of points.csv");
    assert!(scene.fixed().all(|(parameter, _)| parameter.name != "e" && parameter.name != "omega"));
    // The list is stored in this form in the folder of a map.
    let text = list.to_csv();
    assert_eq!(text, "e,omega\n0.5,5.6\n0.25,4.0\n0.5,5.6\n0.5,7.0\n");
    let again = read(SCENE, &text, &[]).unwrap();
    assert_eq!(again.identity(), scene.identity());
    assert_eq!(again.identity(), read(SCENE, &format!("\u{feff}{TABLE}"), &[]).unwrap().identity());
    let other = read(SCENE, &TABLE.replace("7", "8"), &[]).unwrap();
    let (one, two) = (scene.identity(), other.identity());
    let differing: Vec<&str> =
        one.iter().zip(&two).filter(|(a, b)| a != b).map(|(a, _)| a.0.as_str()).collect();
    assert_eq!(differing, ["cells.hash"]);
}

/// Cells with equal parameters of the oscillator share a flow, at any place of the list.
#[test]
fn cells_of_a_list_share_flows_and_laws() {
    let scene = read(&format!("{SCENE}[derived]\nk2 = \"4*omega\"\n"), TABLE, &[]).unwrap();
    let plan = Plan::new(&scene);
    assert_eq!((plan.cell_count(), plan.flow_count(), plan.law_count()), (4, 3, 2));
    assert_eq!(plan.check(), Ok(()));
    assert_eq!(plan.order(), [0, 1, 2, 3]);
    for id in 0..4 {
        let (cell, model) = (plan.cell(id), plan.model(id));
        assert_eq!(model.get("k2").unwrap(), 4.0 * model.get("omega").unwrap());
        assert_eq!(plan.form(cell.flow), Form::from(&model.oscillator().unwrap()));
        assert_eq!(plan.law(cell.law), model.law());
    }
    let bad = Plan::new(&read(&format!("{SCENE}[derived]\nk2 = \"omega - 5\"\n"), TABLE, &[]).unwrap());
    assert_says(
        &bad.check().unwrap_err().to_string(),
        &["at e = 0.25, omega = 4: `k2 = -1` is out of range"],
    );
}

#[test]
fn errors_in_tables_name_line_and_field() {
    for [table, expected] in test_cases(
        r#"
e,omgea\n | dir/points.csv:1:2: `column 2 = omgea` is not known; did you mean `omega`?
e;omega\n0.5;1\n | dir/points.csv:1:1: `column 1 = e;omega` is not known
e,e\n0.5,0.5\n | dir/points.csv:1:2: `column 2 = e` does not fit: another column sets it
e,omega\n0.5,5.6\n0.5,x\n | dir/points.csv:3:2: `omega = x` has the wrong type: it must be a number
e,omega\n0.5,\n | dir/points.csv:2:2: `omega = ` has the wrong type
e,omega\n1.5,2\n | dir/points.csv:2:1: `e = 1.5` is out of range: it must be between 0 and 1
e,omega\n0.5,nan\n | dir/points.csv:2:2: `omega = nan` is out of range
e,omega\n0.5,1,2\n | dir/points.csv:2:1: the line has 3 fields and the first line 2
e,omega\n | dir/points.csv:1:1: it has no cells
 | dir/points.csv:1:1: it is empty; write a line with parameter names
"#,
    ) {
        assert_says(&refused(SCENE, &table, &[]), &[&expected]);
    }
}

#[test]
fn settings_that_contradict_a_list_are_refused() {
    for [more, sets, expected] in test_cases(
        r#"
[[axis]]\nparameter = "k"\nmin = 1.0\nmax = 2.0\ncount = 2\n | | s.toml:6:1: `axis = [[axis]]` && does not fit: [cells] lists the cells instead of axes
[refine]\n | | `refine = { ... }` does not fit: cells of a list have no neighbours
[start]\npolicy = "up"\n | | s.toml:7:10: `start.policy =  && no neighbours to start from
[start]\npolicy = "down"\n | | s.toml:7:10: `start.policy =  && no neighbours to start from
[outputs]\nfiles = ["csv", "png"]\n | | a list of cells has no figures && remove "png"
[outputs]\nfiles = ["csv", "html"]\n | | a list of cells has no figures && remove "html"
 | e=0.5 | --set e=0.5: `parameters.e = 0.5` does not fit: a column of `points.csv`
[derived]\nomega = "e"\n | | `derived.omega = "e"` does not fit: it is also swept
"#,
    ) {
        let sets: Vec<&str> = sets.split_whitespace().collect();
        assert_says(&refused(&format!("{SCENE}{more}"), TABLE, &sets), &parts(&expected));
    }
    assert_says(&refused(SCENE, "omega\n5.6\n", &[]), &["`parameters.e` is missing"]);
    assert_says(&refused("[cells]\n", TABLE, &[]), &["s.toml:1:2: `cells.file` is missing; name a table"]);
    assert_says(
        &parse(SCENE, &[]).unwrap_err().to_string(),
        &["s.toml:4:1: `cells = { ... }` does not fit: `bifurcation` needs an axis"],
    );
    let nowhere = Scene::parse(SCENE, "s.toml", &[], Purpose::Map).unwrap_err().to_string();
    assert_says(
        &nowhere,
        &["s.toml:5:8: `cells.file = \"points.csv\"` names a file, and no files are read here"],
    );
}

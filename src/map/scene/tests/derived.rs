//! Derived parameters.

use super::*;
use crate::map::plan::Plan;
use rattlemap_dynamics::model::Form;

/// Reads a map over the force and the stiffness of the first support, with derived parameters.
fn coupled(derived: &str, sets: &[&str]) -> Result<Scene, SceneError> {
    let text = format!(
        "[parameters]\ne = 0.5\n[derived]\n{derived}\n[[axis]]\nparameter = \"F\"\nmin = 10.0\nmax = 50.0\ncount = 5\n\
         [[axis]]\nparameter = \"k1\"\nmin = 10.0\nmax = 40.0\ncount = 4\n"
    );
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    Scene::parse(&text, "s.toml", &sets, Purpose::Map)
}

fn refused(derived: &str, sets: &[&str]) -> String {
    coupled(derived, sets).expect_err(derived).to_string()
}

#[test]
fn derived_parameters_follow_the_cell() {
    let scene = coupled("k2 = \"0.5*k1\"\nr2 = \"2*r1 + k2/100\"\nm2 = 1.5", &[]).unwrap();
    for (i, j) in [(0, 0), (3, 2), (4, 3)] {
        let model = scene.cell(&[i, j]);
        let k1 = scene.axes()[1].value(j);
        assert_eq!((model.get("k1"), model.get("k2")), (Ok(k1), Ok(0.5 * k1)));
        assert_eq!(model.get("r2"), Ok(2.0 * 0.6 + 0.5 * k1 / 100.0));
        assert_eq!(model.get("m2"), Ok(1.5));
    }
    assert_eq!(scene.base().get("k2"), Ok(5.0));
    let fixed: Vec<&str> = scene.fixed().map(|(parameter, _)| &*parameter.name).collect();
    assert_eq!(fixed, ["m1", "r1", "r", "k", "omega", "b", "e", "mesh_speed"]);
    let derived: Vec<(&str, &str)> = scene.derived().map(|(p, text)| (&*p.name, text)).collect();
    // Each rule comes after those that it needs.
    assert_eq!(derived, [("k2", "0.5*k1"), ("m2", "1.5"), ("r2", "2*r1 + k2/100")]);
    let by_argument = coupled("m2 = 1.5", &["derived.k2=0.25*k1"]).unwrap();
    assert_eq!(by_argument.cell(&[0, 3]).get("k2"), Ok(10.0));
    assert_ne!(scene.identity(), by_argument.identity());
}

/// Cells share a flow if all its parameters are equal, including derived ones.
#[test]
fn cells_with_different_derived_parameters_have_different_flows() {
    let scene = |derived: &str| {
        let text = format!(
            "[parameters]\n[derived]\n{derived}\n[[axis]]\nparameter = \"e\"\nmin = 0.25\nmax = 0.75\ncount = 3\n\
             [[axis]]\nparameter = \"k\"\nmin = 100.0\nmax = 400.0\ncount = 4\nscale = \"log\"\n"
        );
        Scene::parse(&text, "s.toml", &[], Purpose::Map).unwrap()
    };
    for (derived, flows, laws) in [
        ("", 4, 3),
        ("F = \"20*e\"", 12, 3),
        ("mesh_speed = \"k/10000\"", 4, 12),
        ("k1 = \"10 + r1\"\nr1 = \"e\"", 12, 3),
        ("k1 = 20", 4, 3),
    ] {
        let scene = scene(derived);
        let plan = Plan::new(&scene);
        assert_eq!((plan.flow_count(), plan.law_count()), (flows, laws), "{derived}");
        assert_eq!(plan.check(), Ok(()));
        for id in 0..12 {
            let (cell, model) = (plan.cell(id), plan.model(id));
            let form = Form::from(&model.oscillator().unwrap());
            assert_eq!(plan.form(cell.flow), form, "{derived}: {id}");
            assert_eq!(plan.law(cell.law), model.law(), "{derived}: {id}");
        }
    }
}

#[test]
fn errors_in_expressions_name_the_field() {
    for [derived, expected] in test_cases(
        r#"
K2 = "k1" | s.toml:4:1: unknown field `derived.K2 = "k1"`; did you mean `k2`?
k2 = "0.5*K1" | s.toml:4:6: `derived.k2 = "0.5*K1"` has an unknown name, `K1`: did you mean `k1`?
k2 = "0.5 k1" | `derived.k2 = "0.5 k1"` cannot be read from `k1` on; an expression has numbers
k2 = "0.5*" | `derived.k2 = "0.5*"` cannot be read to its end
k2 = "sqrt(k1, 2)" | `sqrt` takes one argument
k2 = true | `derived.k2 = true` has the wrong type: it must be an expression in quotes
F = "k1" | s.toml:4:5: `derived.F = "k1"` does not fit: it is also swept
e = "0.5" | s.toml:2:5: `parameters.e = 0.5` does not fit: `derived.e` derives it; remove one of the two
k2 = "r2"\nr2 = "2*m2"\nm2 = "k2" | does not fit: it depends on itself: k2 <- r2 <- m2 <- k2
k2 = "m2"\nm2 = "m2 + k1" | `derived.m2 = "m2 + k1"` does not fit: it depends on itself: m2 <- m2
"#,
    ) {
        assert_says(&refused(&derived, &[]), &[&expected]);
    }
    let long = format!("k2 = \"{}\"", "1+".repeat(300));
    assert_says(&refused(&long, &[]), &["it has 600 characters, and may have 500"]);
    assert_says(
        &refused("k2 = \"k1\"", &["k2=3"]),
        &["--set k2=3: `parameters.k2 = 3` does not fit: `derived.k2`"],
    );
    // An expression in an argument overrides a value in the text.
    let text = "k2 = \"k1\"";
    assert!(coupled(text, &["derived.e=k1/100"]).is_ok());
    assert_says(
        &refused(text, &["derived.e=k1/10"]),
        &["--set derived.e=k1/10: at F = 10, k1 = 40: `e = 4`"],
    );
}

/// Derived values out of range are found before the computation: at corners by the scene, elsewhere by the plan.
#[test]
fn values_out_of_range_are_named_with_their_cell() {
    let message = refused("k2 = \"k1 - 20\"", &[]);
    assert_says(
        &message,
        &["s.toml:4:6: at F = 10, k1 = 10: `k2 = -10` is out of range: it must be finite and"],
    );
    assert_says(&refused("m2 = \"1/(k1-10)\"", &[]), &["`m2 = inf` is out of range"]);
    let inside = Plan::new(&coupled("k2 = \"(k1 - 15)*(k1 - 35)\"", &[]).unwrap()).check().unwrap_err();
    assert_says(
        &inside.to_string(),
        &["at F = 10, k1 = 20: `k2 = -75` is out of range: it must be finite and at least 0"],
    );
}

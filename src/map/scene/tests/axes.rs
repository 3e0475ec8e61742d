//! Logarithmic axes and listed values.

use super::*;

const LOG: [&str; 4] = ["e=0.5", "axis.0.parameter=k", "axis.0.min=100", "axis.0.max=10000"];

fn log(count: &str) -> Scene {
    let count = format!("axis.0.count={count}");
    parse(GOOD, &[&LOG[..], &["axis.0.scale=log", &count]].concat()).unwrap()
}

#[test]
fn logarithmic_values_have_equal_ratios_and_exact_ends() {
    let values = |scene: &Scene| scene.axes()[0].values().collect::<Vec<_>>();
    assert_eq!(values(&log("3")), [100.0, 1000.0, 10000.0]);
    // The formula with the functions of libm.
    let from_to = |i: f64| libm::exp10((libm::log10(100.0) * (5.0 - i) + libm::log10(10000.0) * i) / 5.0);
    assert_eq!(values(&log("6"))[1..5], [1.0, 2.0, 3.0, 4.0].map(from_to));
    assert_eq!(values(&log("6"))[1], 251.188_643_150_957_92, "not the same on every machine");
    let scene = log("1000");
    assert_eq!(
        (scene.axes()[0].scale(), scene.axes()[0].min(), scene.axes()[0].max()),
        (Scale::Log, 100.0, 1e4)
    );
    let many = values(&scene);
    let ratio = 100f64.powf(1.0 / 999.0);
    assert!(many.windows(2).all(|pair| (pair[1] / pair[0] / ratio - 1.0).abs() < 1e-14));
    assert_eq!([many[0], many[999]], [100.0, 1e4]);
    assert_eq!(scene.cell(&[999]).get("k"), Ok(1e4));
    // Distant ends do not overflow.
    let wide = parse(
        GOOD,
        &["e=0.5", "axis.0.parameter=k", "axis.0.min=1e-300", "axis.0.max=1e300", "axis.0.scale=log"],
    );
    assert_eq!(values(&wide.unwrap()), [1e-300, 1e-100, 1e100, 1e300]);
}

#[test]
fn impossible_logarithmic_axes_are_refused() {
    let refused = |sets: &[&str]| parse(GOOD, sets).unwrap_err().to_string();
    assert_says(
        &refusal("min = 0.1", "min = 0.0\nscale = \"log\""),
        &[
            "s.toml:9:7: `axis.0.min = 0.0` is out of range: it must be greater than 0 where `scale = \"log\"`",
        ],
    );
    assert_says(&refused(&["axis.0.scale=lgo"]), &["`axis.0.scale = lgo` is not known; did you mean `log`?"]);
    let close =
        [&LOG[..3], &["axis.0.max=100.00000000000003", "axis.0.count=50", "axis.0.scale=log"]].concat();
    assert_says(
        &refused(&close),
        &["`axis.0.count = 50` is out of range: it must be so small that neighbouring values"],
    );
    // There is one number between the ends of this linear axis.
    let ends = ["axis.0.min=0.5", "axis.0.max=0.5000000000000002"];
    let few = |count| [&ends[..], &[count]].concat();
    assert_says(
        &refused(&few("axis.0.count=4")),
        &["`axis.0.count = 4` is out of range: it must be so small"],
    );
    assert!(parse(GOOD, &few("axis.0.count=3")).is_ok());
}

#[test]
fn listed_values_are_used_unchanged() {
    let range = "min = 0.1\nmax = 1\ncount = 4\n";
    let text = GOOD.replace(range, "values = [0.1, 0.25, 0.3, 1]\n");
    let scene = parse(&text, &[]).unwrap();
    let axis = &scene.axes()[0];
    assert_eq!(axis.values().collect::<Vec<_>>(), [0.1, 0.25, 0.3, 1.0]);
    assert_eq!((axis.scale(), axis.count(), axis.min(), axis.max()), (Scale::Values, 4, 0.1, 1.0));
    assert_eq!(scene.cell(&[2]).get("e"), Ok(0.3));
    // An argument overrides the text, for values and for a range.
    let by = |text: &str, sets: &[&str]| {
        let scene = parse(text, sets).unwrap();
        scene.axes()[0].values().collect::<Vec<_>>()
    };
    assert_eq!(by(GOOD, &["axis.0.values=[0.5,0.75]"]), [0.5, 0.75]);
    assert_eq!(by(&text, &["axis.0.min=0", "axis.0.max=1", "axis.0.count=2"]), [0.0, 1.0]);
}

#[test]
fn invalid_values_are_refused_by_index() {
    for [values, expected] in test_cases(
        r#"
[0.1] | `axis.0.values = [0.1]` is out of range: it must be a list of 2 to 1000000 numbers
0.1 | `axis.0.values = 0.1` has the wrong type: it must be a list of 2
[0.1, 0.3, 0.2] | s.toml:9:21: `axis.0.values.2 = 0.2` is out of range: it must be greater than the value before it, 0.3
[0.1, 0.1] | `axis.0.values.1 = 0.1` is out of range: it must be greater than the value before it, 0.1
[0.1, 1.5] | `axis.0.values.1 = 1.5` is out of range: it must be between 0 and 1, as `e` is
[nan, 0.5] | `axis.0.values.0 = nan` is out of range
[0.1, "x"] | `axis.0.values.1 = "x"` has the wrong type: it must be a number
"#,
    ) {
        let range = "min = 0.1\nmax = 1\ncount = 4\n";
        assert_says(&refusal(range, &format!("values = {values}\n")), &[&expected, "s.toml:9:"]);
    }
    assert_says(
        &refusal("count = 4", "values = [0.1, 0.2]"),
        &[
            "s.toml:11:10: `axis.0.values = [0.1, 0.2]` does not fit",
            "`axis.0.min` is given, too; remove one of the two",
        ],
    );
    let message = parse(GOOD, &["axis.0.values=[0.1,0.2]", "axis.0.scale=log"]).unwrap_err().to_string();
    assert_says(&message, &["--set axis.0.values=[0.1,0.2]:", "`axis.0.scale` is given, too"]);
    let message = parse(GOOD, &["axis.0.values=[0.2,0.1]"]).unwrap_err().to_string();
    assert_says(&message, &["--set axis.0.values=[0.2,0.1]: `axis.0.values.1 = 0.1` is out of range"]);
}

/// The identity contains scale and values; many values are replaced by their hash.
#[test]
fn the_identity_contains_scale_and_values() {
    let of = |sets: &[&str]| parse(GOOD, sets).unwrap().identity();
    let value_of = |list: &[(String, String)], name: &str| {
        list.iter().find(|(known, _)| known == name).map(|(_, value)| value.clone())
    };
    assert_eq!(value_of(&of(&[]), "axis.0.scale"), None);
    assert_eq!(value_of(&of(&["axis.0.scale=log"]), "axis.0.scale").as_deref(), Some("log"));
    assert_eq!(value_of(&of(&["axis.0.values=[0.1,0.2]"]), "axis.0.values").as_deref(), Some("0.1 0.2"));
    let many = |last: &str| {
        let values: Vec<String> = (0..99).map(|i| format!("0.{i:02}1")).collect();
        value_of(&of(&[&format!("axis.0.values=[{},{last}]", values.join(","))]), "axis.0.values").unwrap()
    };
    assert!(many("1").starts_with("100 with the hash ") && many("1").len() < 100, "{}", many("1"));
    assert_ne!(many("1"), many("0.9999"));
}

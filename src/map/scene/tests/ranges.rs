//! Values of a wrong type or out of range.

use super::*;

#[test]
fn wrong_types_are_refused_with_the_expected_type() {
    check_refusals(
        r#"
"A scene" | 7 | s.toml:1:9: `title = 7` has the wrong type: it must be text in quotes
50.0 | "fifty" | s.toml:5:5: `parameters.F = "fifty"` has the wrong type: it must be a number
50.0 | 1979-05-27 | `parameters.F = 1979-05-27` has the wrong type
"e" | 1 | `axis.0.parameter = 1` has the wrong type
min = 0.1 | min = true | s.toml:9:7: `axis.0.min = true` has the wrong type: it must be a number
count = 4 | count = 4.0 | `axis.0.count = 4.0` has the wrong type: it must be a whole number from 2
[[axis]] | [axis] | s.toml:7:1: `axis = { ... }` has the wrong type: it must be a list of tables, [[axis]]
false | "no" | `integration.early_stop = "no"` has the wrong type: it must be true or false
["csv"] | "csv" | `outputs.files = "csv"` has the wrong type: it must be a list of csv, npy
\n[start]\npolicy | \nstart | `integration.start
"#,
    );
}

#[test]
fn values_out_of_range() {
    check_refusals(
        r#"
F = 50.0 | F = nan | s.toml:5:5: `parameters.F = nan` is out of range: it must be a finite number
F = 50.0 | F = inf | `parameters.F = inf` is out of range
F = 50.0 | m1 = 0 | `parameters.m1 = 0` is out of range: it must be finite and greater than 0
min = 0.1 | min = -0.1 | s.toml:9:7: `axis.0.min = -0.1` is out of range: it must be between 0 and 1
min = 0.1 | min = nan | `axis.0.min = nan` is out of range
max = 1 | max = 1.5 | s.toml:10:7: `axis.0.max = 1.5` is out of range: it must be between 0 and 1
max = 1 | max = inf | `axis.0.max = inf` is out of range
max = 1 | max = 0.1 | `axis.0.max = 0.1` is out of range: it must be greater than `axis.0.min = 0.1`
count = 4 | count = 1 | s.toml:11:9: `axis.0.count = 1` is out of range: it must be a whole number from 2
count = 4 | count = -4 | `axis.0.count = -4` is out of range
"auto" | 0 | `integration.steps_per_period = 0` is out of range
s = 10 | s = 0 | s.toml:15:21: `integration.transient_periods = 0` is out of range
s = 20 | s = 1 | `integration.observed_periods = 1` is out of range: it must be a whole number from 2
d = 4 | d = 65 | s.toml:18:14: `integration.max_period = 65` is out of range: it must be a whole number from 1 to 64
d = 4 | d = 0 | `integration.max_period = 0` is out of range
["csv"] | [] | s.toml:25:9: `outputs.files = []` is out of range: it must be at least one of csv
"#,
    );
}

#[test]
fn axes_too_wide_for_their_values() {
    let wide = GOOD.replacen("F = 50.0", "e = 0.5", 1).replacen("\"e\"", "\"F\"", 1);
    let message = parse(&wide, &["axis.0.min=-1.7e308", "axis.0.max=1.7e308"]).unwrap_err().to_string();
    assert_says(&message, &["--set axis.0.max=1.7e308: `axis.0.max = 1.7e308` is out of range"]);
}

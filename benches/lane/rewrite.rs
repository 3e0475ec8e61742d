//! Forms of the lane that exist for measurements alone, made from the shader's text.

/// Turns the shader into another form of itself.
pub(crate) type Rewrite = fn(String) -> String;

/// Every loop pays for its trips; counting them function by function counts the work.
pub(crate) const LOOPS: [(&str, &str); 4] =
    [("scan", "scan steps"), ("careful", "careful passes"), ("first_event", "looks"), ("root", "root trips")];

/// Forms that must give the same results; the first is the shader as it is.
pub(crate) const CHECKS: [(&str, Rewrite); 2] = [("phased", |source| source), ("naive", naive)];

/// Reports the loop trips of a function in place of impacts.
pub(crate) fn counting(function: &str) -> Rewrite {
    match function {
        "scan" => |source| count_trips(&source, "scan"),
        "careful" => |source| count_trips(&source, "careful"),
        "first_event" => |source| count_trips(&source, "first_event"),
        _ => |source| count_trips(&source, "root"),
    }
}

fn count_trips(source: &str, function: &str) -> String {
    let silent = replace(source, "tally.impacts += 1u;", "");
    let start = silent.find(&format!("fn {function}(")).expect("the shader has the function");
    let (before, after) = silent.split_at(start);
    let end = after.find("\n}\n").expect("a function ends");
    let (body, rest) = after.split_at(end);
    format!("{before}{}{rest}", replace(body, "trips += 1u;", "trips += 1u; tally.impacts += 1u;"))
}

/// One scan step, then what it asks for: event code inside the step loop.
fn naive(source: String) -> String {
    replace(
        &source,
        "if trips >= settings.trips {\n            verdict",
        "if taken > 0u {\n            verdict",
    )
}

fn replace(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the shader has no {from}");
    text.replace(from, to)
}

//! Forms of the lane that exist for measurements alone, made from the shader's text.

/// Turns the shader into another form of itself.
pub(crate) type Rewrite = fn(String) -> String;

/// Every loop pays for its trips; counting them function by function counts the work.
pub(crate) const LOOPS: [(&str, &str); 4] =
    [("scan", "scan steps"), ("careful", "careful passes"), ("first_event", "looks"), ("root", "root trips")];

/// Forms that must give the same results: the shader as it is, scan and events in one loop,
/// constants left in storage.
pub(crate) const CHECKS: [(&str, Rewrite); 3] =
    [("as it is", |source| source), ("naive", naive), ("stored", stored)];

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
    let (body, rest) = after.split_at(after.find("\n}\n").expect("a function ends"));
    let paid = if body.contains("trips += price;") { "trips += price;" } else { "trips += 1u;" };
    format!("{before}{}{rest}", replace(body, paid, &format!("{paid} tally.impacts += 1u;")))
}

/// Every step looks for what it asks for: event code inside the step loop.
fn naive(source: String) -> String {
    let steps_once = replace(
        &source,
        "        if trips >= settings.trips {\n            verdict = SCAN_BUDGET;",
        "        if taken > 0u {\n            verdict = 2u;\n            break;\n        }\n        \
         if trips >= settings.trips {\n            verdict = SCAN_BUDGET;",
    );
    replace(
        &steps_once,
        "        if scan() == SCAN_BUDGET {\n            break;\n        }\n",
        "        let verdict = scan();\n        if verdict == SCAN_BUDGET {\n            break;\n        }\n        \
         if verdict == 2u {\n            continue;\n        }\n",
    )
}

/// Constants in storage: nothing is copied to the lane.
fn stored(source: String) -> String {
    replace(&source, "const KEEP: bool = true;", "const KEEP: bool = false;")
}

fn replace(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the shader has no {from}");
    text.replace(from, to)
}

//! Forms of the lane that exist for measurements alone, made from the shader's text.

/// Turns the shader into another form of itself.
pub(crate) type Rewrite = fn(String) -> String;

/// Forms that must give the same results: the shader as it is, scan and events in one loop,
/// constants left in storage.
pub(crate) const CHECKS: [(&str, Rewrite); 3] =
    [("as it is", |source| source), ("naive", naive), ("stored", stored)];

/// Every step searches for events itself: event code inside the step loop.
fn naive(source: String) -> String {
    let steps_once = replace(
        &source,
        "        if iterations >= settings.iterations {\n            verdict = SCAN_BUDGET;",
        "        if taken > 0u {\n            verdict = 2u;\n            break;\n        }\n        \
         if iterations >= settings.iterations {\n            verdict = SCAN_BUDGET;",
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

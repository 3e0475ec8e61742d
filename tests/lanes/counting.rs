//! Variants of the lane's shader that count loop iterations, made by editing its text.

/// Functions with loops, and what one iteration of each is.
pub(crate) const LOOPS: [(&str, &str); 5] = [
    ("scan", "scan steps"),
    ("careful", "careful passes"),
    ("first_event", "checks of a stretch"),
    ("root", "root iterations"),
    ("follow_chatter", "short flights"),
];

/// Returns an edit of the shader that reports the loop iterations of a function in place of impacts.
pub(crate) fn counting(function: &str) -> fn(String) -> String {
    match function {
        "scan" => |source| count_iterations(&source, "scan"),
        "careful" => |source| count_iterations(&source, "careful"),
        "first_event" => |source| count_iterations(&source, "first_event"),
        "root" => |source| count_iterations(&source, "root"),
        _ => |source| count_iterations(&source, "follow_chatter"),
    }
}

fn count_iterations(source: &str, function: &str) -> String {
    let silent = replace(source, "tally.impacts += 1u;", "");
    let start = silent.find(&format!("fn {function}(")).expect("the shader has the function");
    let (before, after) = silent.split_at(start);
    let (body, rest) = after.split_at(after.find("\n}\n").expect("a function ends"));
    let [paid, count] = match function {
        "scan" => ["iterations += count * price;", "count"],
        _ => ["iterations += 1u;", "1u"],
    };
    format!("{before}{}{rest}", replace(body, paid, &format!("{paid} tally.impacts += {count};")))
}

fn replace(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the shader has no {from}");
    text.replace(from, to)
}

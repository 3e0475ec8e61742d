//! Unrolling of the shaders' series.
//!
//! Drivers keep an array in registers only if every index is a constant. They do not unroll loops with a variable bound. Loops over Taylor
//! terms are therefore written with a marker,
//!
//! ```text
//! //% for k in FIRST..LAST      (or LAST-1 down to FIRST: "for k in FIRST..LAST down")
//! ... $k ... $(k+1) ... $(k-1) ...
//! //% end
//! ```
//!
//! and are copied once per term before compilation. A loop with a name can be repeated over other terms in a function that uses the same
//! variable names:
//!
//! ```text
//! //% for k in FIRST..LAST: NAME
//! ...
//! //% end
//! //% again NAME for k in FIRST..LAST
//! ```

use std::collections::HashMap;

/// Returns the source with every marked loop unrolled. The bounds of loops may contain the constants in `names`.
pub(super) fn unroll(source: &str, names: &[(&str, u32)]) -> String {
    let mut out = String::with_capacity(4 * source.len());
    let copies = |body: &[&str], range: &str| -> String {
        indices(range, names)
            .into_iter()
            .flat_map(|k| body.iter().map(move |line| with_index(line, k) + "\n"))
            .collect()
    };
    let mut known: HashMap<&str, Vec<&str>> = HashMap::new();
    let mut lines = source.lines();
    while let Some(line) = lines.next() {
        match Marker::of(line) {
            None => {
                out.push_str(line);
                out.push('\n');
            }
            Some(Marker::Loop { range, name }) => {
                let body: Vec<&str> = lines.by_ref().take_while(|line| line.trim() != "//% end").collect();
                out.push_str(&copies(&body, range));
                known.extend(name.map(|name| (name, body)));
            }
            Some(Marker::Again { range, name }) => out.push_str(&copies(&known[name], range)),
        }
    }
    out
}

/// A line that starts or repeats a marked loop.
enum Marker<'a> {
    Loop { range: &'a str, name: Option<&'a str> },
    Again { range: &'a str, name: &'a str },
}

impl Marker<'_> {
    fn of(line: &str) -> Option<Marker<'_>> {
        let marker = line.trim().strip_prefix("//% ")?;
        let (again, header) = marker.split_once("for k in ").expect("a marker runs over k");
        match again.strip_prefix("again ") {
            Some(name) => Some(Marker::Again { range: header, name: name.trim() }),
            None => {
                let named = header.split_once(": ");
                let (range, name) = named.map_or((header, None), |(range, name)| (range, Some(name)));
                Some(Marker::Loop { range, name })
            }
        }
    }
}

/// Returns the indices of a loop header.
fn indices(header: &str, names: &[(&str, u32)]) -> Vec<u32> {
    let (range, down) = header.strip_suffix(" down").map_or((header, false), |range| (range, true));
    let number = |text: &str| text.parse::<u32>().expect("a marker's bound is a number or a known name");
    let bound = |text: &str| {
        let (head, less) = text.split_once('-').map_or((text, 0), |(head, less)| (head, number(less)));
        names.iter().find(|(name, _)| *name == head).map_or_else(|| number(head), |&(_, value)| value) - less
    };
    let (first, last) = range.split_once("..").expect("a marker names a range");
    let all = bound(first)..bound(last);
    if down { all.rev().collect() } else { all.collect() }
}

fn with_index(line: &str, k: u32) -> String {
    line.replace("$(k+2)", &(k + 2).to_string())
        .replace("$(k+1)", &(k + 1).to_string())
        .replace("$(k-1)", &k.wrapping_sub(1).to_string())
        .replace("$k", &k.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marked_loops_are_copied_once_per_index() {
        let source = "a\n  //% for k in 1..TERMS-1 down\n  t[$(k+1)] = t[$k] + t[$(k-1)];\n  //% end\nb\n";
        let four = [("TERMS", 4)];
        assert_eq!(unroll(source, &four), "a\n  t[3] = t[2] + t[1];\n  t[2] = t[1] + t[0];\nb\n");
        let named = "//% for k in 1..3: sum\ns += $k;\n//% end\nt\n//% again sum for k in 5..6\n";
        assert_eq!(unroll(named, &four), "s += 1;\ns += 2;\nt\ns += 5;\n");
        assert_eq!(unroll("//% for k in 0..TERMS\n$k.0\n//% end", &[("TERMS", 2)]), "0.0\n1.0\n");
    }
}

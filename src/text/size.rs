//! Sizes in words.

/// Formats a number of bytes, such as `1.2 GB`.
pub(crate) fn bytes(count: u64) -> String {
    let (unit, name) =
        [(1e9, "GB"), (1e6, "MB")].into_iter().find(|&(unit, _)| count as f64 >= unit).unwrap_or((1e3, "kB"));
    format!("{:.1} {name}", count as f64 / unit)
}

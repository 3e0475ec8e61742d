//! Lines on a map, by marching squares: the zeros of a function of the two axes, and contours of numbers of cells.

use std::collections::HashMap;

use crate::show::drawing::Point;
use crate::show::drawing::axis::Axis;

/// Number of squares along each axis.
const SQUARES: usize = 256;
/// Number of bisections of an edge: to the last digit of a number.
const BISECTIONS: usize = 60;

/// An edge of a square: its first corner, and whether it extends upwards.
type Edge = ([usize; 2], bool);

/// Returns the lines on which `function` is zero, as values of both axes. On each edge of the squares its sign is known to
/// change at one point; that point is exact.
pub(crate) fn zeros([x, y]: [&Axis; 2], function: impl Fn([f64; 2]) -> f64) -> Vec<Vec<Point>> {
    let place = |axis: &Axis, at: f64| axis.low + at / SQUARES as f64 * (axis.high - axis.low);
    let point = |at: [f64; 2]| [x.value(place(x, at[0])), y.value(place(y, at[1]))];
    let corner = |i: usize, j: usize| function(point([i as f64, j as f64]));
    let values: Vec<f64> =
        (0..=SQUARES).flat_map(|j| (0..=SQUARES).map(move |i| [i, j])).map(|[i, j]| corner(i, j)).collect();
    let value = |[i, j]: [usize; 2]| values[j * (SQUARES + 1) + i];
    joined([SQUARES; 2], |edge| {
        let ([i, j], end) = ends(edge);
        let (a, b) = (value([i, j]), value(end));
        if !(a.is_finite() && b.is_finite()) || (a < 0.0) == (b < 0.0) {
            return None;
        }
        let at = |share: f64| {
            let along = |from: usize, to: usize| from as f64 + share * (to as f64 - from as f64);
            point([along(i, end[0]), along(j, end[1])])
        };
        let [mut low, mut high] = [0.0, 1.0];
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if (function(at(middle)) < 0.0) == (a < 0.0) { low = middle } else { high = middle }
        }
        let [x, y] = at(high);
        // At a pole the sign changes, too.
        (function([x, y]).abs() <= a.abs().max(b.abs())).then_some((x, y))
    })
}

/// Returns the lines on which numbers at the centres of cells have a value, in columns and rows from the first centre. Beside cells
/// without a number, and where neighbours differ by `jump` or more, lines end.
pub(crate) fn contours(
    [columns, rows]: [usize; 2],
    numbers: &[f32],
    value: f64,
    jump: f64,
) -> Vec<Vec<Point>> {
    let above = |[i, j]: [usize; 2]| f64::from(numbers[j * columns + i]) - f64::from(value as f32);
    joined([columns - 1, rows - 1], |edge| {
        let (start, end) = ends(edge);
        let (a, b) = (above(start), above(end));
        let along = |k: usize| start[k] as f64 + a / (a - b) * (end[k] as f64 - start[k] as f64);
        ((a < 0.0) != (b < 0.0) && (a - b).abs() < jump).then(|| (along(0), along(1)))
    })
}

/// Returns both corners of an edge.
fn ends(([i, j], is_upwards): Edge) -> ([usize; 2], [usize; 2]) {
    ([i, j], if is_upwards { [i, j + 1] } else { [i + 1, j] })
}

/// Joins the points at which edges of squares are crossed to lines.
fn joined([columns, rows]: [usize; 2], crossing: impl Fn(Edge) -> Option<Point>) -> Vec<Vec<Point>> {
    let mut points: HashMap<Edge, Point> = HashMap::new();
    let mut next: HashMap<Edge, Vec<Edge>> = HashMap::new();
    for [i, j] in (0..rows).flat_map(|j| (0..columns).map(move |i| [i, j])) {
        // Counterclockwise, so that consecutive crossings belong together.
        let edges = [([i, j], false), ([i + 1, j], true), ([i, j + 1], false), ([i, j], true)];
        let crossed: Vec<Edge> = edges
            .into_iter()
            .filter(|&edge| match points.contains_key(&edge) {
                true => true,
                false => crossing(edge).map(|point| points.insert(edge, point)).is_some(),
            })
            .collect();
        for pair in crossed.chunks_exact(2) {
            next.entry(pair[0]).or_default().push(pair[1]);
            next.entry(pair[1]).or_default().push(pair[0]);
        }
    }
    // Open lines first, from one of their ends.
    let mut starts: Vec<Edge> = next.keys().copied().collect();
    starts.sort_unstable_by_key(|edge| (next[edge].len(), *edge));
    let mut lines = Vec::new();
    for start in starts {
        let mut line = vec![points[&start]];
        let mut at = start;
        while let Some(to) = next.get_mut(&at).and_then(Vec::pop) {
            if let Some(back) = next.get_mut(&to) {
                back.iter().position(|edge| *edge == at).map(|position| back.swap_remove(position));
            }
            line.push(points[&to]);
            at = to;
        }
        if line.len() > 1 {
            lines.push(line);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> [Axis; 2] {
        [Axis::exact("", 0.0, 2.0), Axis::logarithmic("", [0.1, 10.0], 0.0)]
    }

    #[test]
    fn a_line_lies_where_the_function_is_zero_and_crosses_the_whole_map() {
        let [x, y] = axes();
        let lines = zeros([&x, &y], |[x, y]| 3.0 * y - x - 0.5);
        assert_eq!(lines.len(), 1);
        assert!(lines[0].iter().all(|(x, y)| (y - (x + 0.5) / 3.0).abs() < 1e-12), "{lines:?}");
        let ends = [lines[0][0].0, lines[0][lines[0].len() - 1].0];
        assert_eq!([ends[0].min(ends[1]), ends[0].max(ends[1])], [0.0, 2.0]);
    }

    #[test]
    fn a_closed_line_ends_where_it_begins() {
        let [x, y] = axes();
        let lines = zeros([&x, &y], |[x, y]| (x - 1.0).hypot(y.log10()) - 0.5);
        let [line] = &lines[..] else { panic!("{} lines", lines.len()) };
        assert_eq!(line[0], line[line.len() - 1]);
        assert!(line.iter().all(|(x, y)| ((x - 1.0).hypot(y.log10()) - 0.5).abs() < 1e-12));
    }

    #[test]
    fn contours_are_interpolated_and_end_beside_cells_without_a_number() {
        let numbers: Vec<f32> = (0..30).map(|id| (id % 6 * 2 + id / 6) as f32).collect();
        let [line] = &contours([6, 5], &numbers, 5.0, f64::INFINITY)[..] else { panic!() };
        assert!(line.iter().all(|(x, y)| (2.0 * x + y - 5.0).abs() < 1e-12), "{line:?}");
        assert_eq!([line[0], line[line.len() - 1]].map(|(_, y)| y), [4.0, 0.0]);
        let mut broken = numbers.clone();
        broken[2 * 6 + 1] = f32::NAN;
        let parts = contours([6, 5], &broken, 5.0, f64::INFINITY);
        let is_near = |(x, y): &Point| (x - 1.0).abs() < 1.0 && (y - 2.0).abs() < 1.0;
        assert_eq!(parts.iter().flatten().filter(|&point| is_near(point)).count(), 0, "{parts:?}");
        assert!(contours([6, 5], &numbers, 5.0, 1.0).is_empty(), "an angle that jumps");
    }

    #[test]
    fn poles_and_functions_that_are_not_finite_give_no_line() {
        let [x, y] = axes();
        assert!(zeros([&x, &y], |[x, _]| 1.0 / (x - 1.001)).is_empty());
        assert!(zeros([&x, &y], |_| f64::NAN).is_empty());
        let half = zeros([&x, &y], |[x, y]| if x < 1.0 { f64::NAN } else { y - 1.0 });
        assert!(half.iter().flatten().all(|(x, y)| *x >= 1.0 && (y - 1.0).abs() < 1e-12), "{half:?}");
    }
}

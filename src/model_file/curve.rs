//! Forces that are functions of one variable: nonlinear springs, `[[spring]]`, and walls with `law = "curve"`. Linear pieces replace them.

use nalgebra::DVector;
use rattlemap_dynamics::model::{MOST_SPRINGS, NonlinearSpring, OscillatorError, Side};

use super::entry::Names;
use crate::text::document::Value;
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::{Field, Section};

/// Keys of `[[spring]]`.
const SPRING_KEYS: [&str; 4] = ["row", "force", "range", "tolerance"];

/// Name of the elongation in the force of a spring, and of the depth in that of a wall.
const ELONGATION: &str = "x";
const DEPTH: &str = "depth";

/// Largest number of pieces on each side of 0.
const MOST_ON_A_SIDE: usize = 32;

/// Number of intervals on each side of 0 in which a force is sampled.
const SAMPLES: usize = 2048;

/// Default of `tolerance`.
const TOLERANCE: f64 = 1e-3;

/// A force as a function of one variable.
#[derive(Clone, Debug)]
pub struct ForceLaw {
    /// The force. Its variable has the index after those of all parameters.
    pub force: Expression,
    /// The ends of the range.
    pub range: [Expression; 2],
    /// Largest error, relative to the largest force at the ends of the range.
    pub tolerance: Expression,
}

/// A nonlinear spring along a row of displacements.
#[derive(Clone, Debug)]
pub struct BentSpring {
    /// Factors of the displacements in the elongation.
    pub row: Vec<Expression>,
    /// Its force.
    pub law: ForceLaw,
}

/// Linear pieces that replace a force.
#[derive(Clone, Debug)]
pub struct Pieces {
    /// Arguments and forces at the ends of the pieces.
    pub points: Vec<[f64; 2]>,
    /// Largest error, relative to the largest force at the ends of the range.
    pub error: f64,
}

impl ForceLaw {
    /// Reads the force of a wall or a spring, whose variable has this name.
    pub(super) fn read(
        section: &Section<'_>,
        names: Names<'_>,
        variable: &str,
        range: [Expression; 2],
    ) -> Result<ForceLaw, SceneError> {
        let field = section.require(
            "force",
            &format!("write the force, such as force = \"k*{variable} + a*{variable}^3\""),
        )?;
        if names.parameters.contains(&variable) {
            return Err(field.conflict(format!(
                "in this force `{variable}` is the variable, and the model has a parameter of this name; rename the parameter"
            )));
        }
        let known: Vec<&str> = names.parameters.iter().copied().chain([variable]).collect();
        let force = Names { parameters: &known, ..names }.entry(&field)?;
        let tolerance = section.get("tolerance").map(|field| names.entry(&field)).transpose()?;
        Ok(ForceLaw { force, range, tolerance: tolerance.unwrap_or_else(|| Expression::number(TOLERANCE)) })
    }

    /// Reads the force of a wall, as a function of the depth from 0 to `depth_max`.
    pub(super) fn of_wall(section: &Section<'_>, names: Names<'_>) -> Result<ForceLaw, SceneError> {
        let most = section.require("depth_max", "write the depth up to which the force is needed")?;
        ForceLaw::read(section, names, DEPTH, [Expression::number(0.0), names.entry(&most)?])
    }

    /// Returns all entries.
    pub(super) fn entries(&self) -> impl Iterator<Item = &Expression> {
        self.range.iter().chain([&self.force, &self.tolerance])
    }

    /// Returns the number of linear pieces and their error in words, for values of the parameters.
    pub(super) fn described(&self, values: &[f64]) -> String {
        let Ok(Pieces { points, error }) = self.pieces(values, "") else { return String::new() };
        let count = points.len() - 1;
        let pieces = if count == 1 { "piece" } else { "pieces" };
        format!(": {count} linear {pieces}, error {error:.1e} of the largest force")
    }

    /// Returns the linear pieces for values of the parameters. `place` names the force in messages.
    pub(super) fn pieces(&self, values: &[f64], place: &str) -> Result<Pieces, OscillatorError> {
        let of = |entry: &Expression, variable: f64| {
            entry.evaluate(&|index| values.get(index).copied().unwrap_or(variable))
        };
        let refuse = |what: &str, value: f64, requirement: &'static str| {
            Err(OscillatorError::OutOfRange { quantity: format!("{what} of {place}"), value, requirement })
        };
        let [low, high] = self.range.each_ref().map(|end| of(end, 0.0));
        if !(low <= 0.0 && high >= 0.0 && low < high && (high - low).is_finite()) {
            return refuse("range", high - low, "a range of finite length that contains 0");
        }
        let tolerance = of(&self.tolerance, 0.0);
        if !(tolerance > 0.0 && tolerance < 1.0) {
            return refuse("tolerance", tolerance, "above 0 and below 1");
        }
        let force = |x: f64| of(&self.force, x);
        let start = force(0.0);
        let largest = force(low).abs().max(force(high).abs());
        if start.abs() > 1e-12 * largest {
            return refuse("force at 0", start, "0; write a constant force in `load`");
        }
        let mut pieces = Pieces { points: vec![[0.0, 0.0]], error: 0.0 };
        let ends = || [low, high].into_iter().filter(|end| *end != 0.0);
        for end in ends() {
            let mut side = side_pieces(&force, end);
            let Some((points, error)) = side.find(|(_, error)| *error <= tolerance * largest) else {
                let requirement =
                    "larger, or the range shorter: the force would need more than 32 linear pieces on a side";
                let errors = |end| side_pieces(&force, end).map(|(_, error)| error / largest);
                let least = ends().map(|end| errors(end).fold(f64::INFINITY, f64::min)).fold(0.0, f64::max);
                // The printed number is not below the least one. A force that is not finite has none.
                let hint = Some(1.05 * least).filter(|least| *least < 1.0);
                let hint =
                    hint.map_or(String::new(), |least| format!(", at least {least:.1e} for this range,"));
                return refuse(&format!("tolerance{hint}"), tolerance, requirement);
            };
            pieces.error = pieces.error.max(error / largest);
            if end < 0.0 {
                pieces.points.splice(0..0, points.into_iter().rev());
            } else {
                pieces.points.extend(points);
            }
        }
        Ok(pieces)
    }
}

/// Returns the ends of 1, 2 ... pieces from 0 to `end`, with the largest error. The square root of the second derivative is shared evenly,
/// so that all pieces have about the same error.
fn side_pieces(force: &impl Fn(f64) -> f64, end: f64) -> impl Iterator<Item = (Vec<[f64; 2]>, f64)> {
    let at = move |i: usize| end * i as f64 / SAMPLES as f64;
    let values: Vec<f64> = (0..=SAMPLES).map(|i| if i == 0 { 0.0 } else { force(at(i)) }).collect();
    let mut bends = vec![0.0];
    for i in 1..=SAMPLES {
        let inner = i.clamp(1, SAMPLES - 1);
        let bend = (values[inner + 1] - 2.0 * values[inner] + values[inner - 1]).abs().sqrt();
        bends.push(bends[i - 1] + bend);
    }
    (1..=MOST_ON_A_SIDE).map(move |count| {
        let nearest = |part: usize| {
            let sum = bends[SAMPLES] * part as f64 / count as f64;
            bends.partition_point(|bend| *bend < sum).clamp(part, SAMPLES)
        };
        let mut ends: Vec<usize> = (1..count).map(nearest).chain([SAMPLES]).collect();
        ends.dedup();
        let mut points: Vec<(usize, f64)> = [0].into_iter().chain(ends).map(|i| (i, values[i])).collect();
        // Lines between points of a curve lie on one side of it. A shift of the points takes the mean error away, but for that beside 0.
        let means: Vec<f64> = excesses(&points, &values).map(|(sum, _, count)| sum / count as f64).collect();
        for (i, point) in points.iter_mut().enumerate().skip(1) {
            point.1 -= 0.5 * (means[i - 1] + means.get(i).unwrap_or(&means[i - 1]));
        }
        let error = excesses(&points, &values).fold(0.0, |error: f64, (_, largest, _)| error.max(largest));
        // A force that is not finite has no error.
        let error = if values.iter().all(|value| value.is_finite()) { error } else { f64::INFINITY };
        (points[1..].iter().map(|&(i, value)| [at(i), value]).collect(), error)
    })
}

/// Returns for each line between two points, which are numbers of samples and values, by how much it exceeds the samples: the sum, the
/// largest modulus, and the number of samples.
fn excesses<'a>(
    points: &'a [(usize, f64)],
    values: &'a [f64],
) -> impl Iterator<Item = (f64, f64, usize)> + 'a {
    points.windows(2).map(|ends| {
        let [(from, first), (to, last)] = [ends[0], ends[1]];
        let slope = (last - first) / (to - from) as f64;
        let excess = |i: usize| first + slope * (i - from) as f64 - values[i];
        let sum = |(sum, largest): (f64, f64), i: usize| (sum + excess(i), largest.max(excess(i).abs()));
        let (sum, largest) = (from..=to).fold((0.0, 0.0), sum);
        (sum, largest, to - from + 1)
    })
}

impl BentSpring {
    /// Returns all entries.
    pub(super) fn entries(&self) -> impl Iterator<Item = &Expression> {
        self.row.iter().chain(self.law.entries())
    }

    /// Returns the spring for values of the parameters. `nth` counts from 1.
    pub(super) fn evaluated(&self, values: &[f64], nth: usize) -> Result<NonlinearSpring, OscillatorError> {
        let of = |entry: &Expression| entry.evaluate(&|index| values[index]);
        let points = self.law.pieces(values, &format!("nonlinear spring {nth}"))?.points;
        Ok(NonlinearSpring {
            row: DVector::from_iterator(self.row.len(), self.row.iter().map(of)),
            points,
            wall: None,
        })
    }
}

/// Returns the spring of a wall at a position, along the row of its gap.
pub(super) fn wall_spring(
    row: &DVector<f64>,
    (gap, side): (usize, Side),
    at: f64,
    pieces: Pieces,
) -> NonlinearSpring {
    let (sign, points) = (side.sign(), pieces.points.into_iter());
    NonlinearSpring {
        row: row * sign,
        points: points.map(|[depth, force]| [sign * at + depth, force]).collect(),
        wall: Some((gap, side)),
    }
}

/// Reads the nonlinear springs of a model with `count` coordinates, in the order of the file.
pub(super) fn read(
    root: &Section<'_>,
    names: Names<'_>,
    count: usize,
) -> Result<Vec<BentSpring>, SceneError> {
    let Some(field) = root.get("spring") else { return Ok(Vec::new()) };
    let tables = format!("at most {MOST_SPRINGS} tables, [[spring]], each with row, force and range");
    let read_one = |item: &Field<'_>| {
        let section = Section::open(item.node, &item.path, &SPRING_KEYS)?;
        let row = match section.get("row") {
            Some(field) => {
                names.vector(&field, count, "the row of the elongation, x = row . displacements")?
            }
            None if count == 1 => vec![Expression::number(1.0)],
            None => {
                let remedy =
                    "write the factors of the displacements in the elongation, such as row = [1, -1]";
                return Err(section.missing("row", remedy));
            }
        };
        let range =
            section.require("range", "write the range of the elongation, such as range = 2 for -2 to 2")?;
        let range = match &range.node.value {
            Value::List(_) => match &range.list_with(2, "two ends, such as range = [-1, 2]")?[..] {
                [low, high] => [names.entry(low)?, names.entry(high)?],
                _ => unreachable!("the list has two entries"),
            },
            _ => {
                let high = names.entry(&range)?;
                let low = Expression::parse(&format!("-({})", high.text()), names.parameters);
                [low.expect("the negative of an expression is one"), high]
            }
        };
        Ok(BentSpring { row, law: ForceLaw::read(&section, names, ELONGATION, range)? })
    };
    field.list_of(0..=MOST_SPRINGS, "tables", &tables)?.iter().map(read_one).collect()
}

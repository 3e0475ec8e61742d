//! Derivatives of a cycle by a parameter.
//!
//! The derivatives of states and times of events follow from the linearised equations of the cycle. Those of multipliers and of measured
//! quantities are differences of sixth order between cycles at nearby values of the parameter. Each of these cycles solves the equations to
//! rounding.

use super::family::{slope_at_zero, stencil};
use super::{Cycle, CycleError, Free, own, placed};
use crate::model::Model;
use crate::number::significant;

/// Lengths of steps, relative to the scale of the parameter, and the number of steps on each side.
const STEPS: [f64; 6] = [3e-3, 3e-4, 3e-5, 3e-6, 3e-7, 3e-8];
const SIDE: usize = 3;

/// Largest difference between the derivatives from two lengths of the step. It is relative to the derivative, or to the size of the number
/// divided by the scale of the parameter if that is larger.
const AGREES: f64 = 1e-6;

/// Largest difference between the slopes on both sides, relative to the same.
const SAME_SIDES: f64 = 1e-4;

/// Derivative of a number of a cycle, or why there is none.
pub type Slope = Result<f64, Kink>;

/// The number is no smooth function of the parameter.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("it has no derivative here; its slopes below and above this value are about {} and {}", significant(sides[0]), significant(sides[1]))]
pub struct Kink {
    /// Slopes below and above the value of the parameter.
    pub sides: [f64; 2],
}

/// Numbers of a cycle of a model; none where it has no such number.
pub type Numbers<'a> = &'a dyn Fn(&dyn Model, &Cycle) -> Vec<Option<f64>>;

/// Derivatives of a cycle by a parameter.
#[derive(Clone, Debug)]
pub struct Derivatives {
    /// Those of the state at phase 0: `(x1, v1, ...)`.
    pub state: Vec<f64>,
    /// Those of the times of events since phase 0, in forcing periods.
    pub event_times: Vec<f64>,
    /// Those of the Floquet multipliers, in their order: real and imaginary part.
    pub multipliers: Vec<[Slope; 2]>,
    /// Those of other numbers. None where the cycle has no such number.
    pub numbers: Vec<Option<Slope>>,
}

impl Cycle {
    /// Returns the derivatives of the cycle, and of `numbers` of it, by a parameter. At an end of the parameter's range they are one-sided.
    /// `kinds`: for each number an index. Numbers with the same index have the same unit, so their rounding errors are of about the same
    /// size.
    ///
    /// # Errors
    /// [`CycleError`] if the cycle has other flights at all nearby values, for example at a graze, or it is at a fold.
    pub fn derivatives(
        &self,
        model: &dyn Model,
        parameter: usize,
        (numbers, kinds): (Numbers<'_>, &[usize]),
    ) -> Result<Derivatives, CycleError> {
        let [state, turns] = self.itinerary.derivatives(model, &self.solution, &[parameter])?;
        let ends = self.itinerary.passages.iter().zip(turns.iter());
        let n = state.len() / 2;
        let in_pairs = (0..2 * n).map(|i| state[if i % 2 == 0 { i / 2 } else { n + i / 2 }]);
        let count = self.multipliers.len();
        let of = |cycle: &Cycle, model: &dyn Model| -> Vec<f64> {
            let here = placed(model, &own(model).unwrap_or_default(), &cycle.solution.values);
            let ordered = self.in_own_order(&cycle.multipliers).into_iter().flatten();
            ordered.chain(numbers(&*here, cycle).into_iter().map(|x| x.unwrap_or(f64::NAN))).collect()
        };
        let free = Free::Parameter(parameter);
        let value = model.value(parameter);
        let (range, scale) = (model.parameters()[parameter].range.ends(), free.scale(model, value));
        let here = of(self, model);
        let mut all = Vec::new();
        for step in STEPS {
            let h = step * scale;
            let offsets = stencil(value, range, (h, SIDE));
            let Some(rows) = offsets
                .iter()
                .map(|offset| {
                    self.beside(model, parameter, value + offset).map(|(model, cycle)| of(&cycle, &*model))
                })
                .collect::<Option<Vec<_>>>()
            else {
                continue;
            };
            all.push((h, offsets, rows));
        }
        // One length of the step alone cannot show its error.
        let Some((_, nearest, _)) = all.last().filter(|_| all.len() > 1) else {
            return Err(CycleError::Changes(STEPS[STEPS.len() - 1] * scale * SIDE as f64));
        };
        let is_central = nearest[0] < 0.0 && nearest[2 * SIDE] > 0.0;
        let slope = |i: usize| -> Slope {
            let is_alike = |k: &usize| i >= 2 * count && kinds[k - 2 * count] == kinds[i - 2 * count];
            let alike = (2 * count..here.len()).filter(is_alike).map(|k| here[k].abs());
            let size = alike.fold(if i < 2 * count { 1.0 } else { 0.0 }, f64::max) / scale;
            let at = |offsets: &[f64], rows: &[Vec<f64>], places: std::ops::RangeInclusive<usize>| -> f64 {
                let offsets = &offsets[places.clone()];
                places.enumerate().map(|(k, row)| slope_at_zero(offsets, k) * rows[row][i]).sum()
            };
            let whole: Vec<f64> =
                all.iter().map(|(_, offsets, rows)| at(offsets, rows, 0..=2 * SIDE)).collect();
            // For a smooth function, the slopes on both sides agree better if the steps are shorter.
            let sides = all
                .iter()
                .map(|(_, offsets, rows)| [at(offsets, rows, 0..=SIDE), at(offsets, rows, SIDE..=2 * SIDE)])
                .min_by(|a, b| (a[1] - a[0]).abs().total_cmp(&(b[1] - b[0]).abs()))
                .expect("there is a step");
            let pairs = whole.windows(2).map(|pair| ((pair[1] - pair[0]).abs(), pair[0]));
            let (apart, best) = pairs.min_by(|a, b| a.0.total_cmp(&b.0)).expect("there are two steps");
            let (largest, gap) = (best.abs().max(size), (sides[1] - sides[0]).abs());
            let is_smooth = apart <= AGREES * largest && (!is_central || gap <= SAME_SIDES * largest);
            if is_smooth { Ok(best) } else { Err(Kink { sides }) }
        };
        Ok(Derivatives {
            state: in_pairs.collect(),
            event_times: ends.filter(|(end, _)| end.is_event()).map(|(_, slope)| *slope).collect(),
            multipliers: (0..count).map(|k| [slope(2 * k), slope(2 * k + 1)]).collect(),
            numbers: (2 * count..here.len()).map(|i| (!here[i].is_nan()).then(|| slope(i))).collect(),
        })
    }

    /// Returns the model and the cycle with the same flights at another value of a parameter; none if there is no such cycle.
    fn beside(&self, model: &dyn Model, parameter: usize, value: f64) -> Option<(Box<dyn Model>, Cycle)> {
        let mut moved = model.clone_model();
        moved.assign(parameter, value);
        let solution = self.itinerary.solve(&*moved, &self.solution).ok()?;
        let cycle = Cycle::of(&*moved, self.itinerary.clone(), solution, self.periods).ok()??;
        Some((moved, cycle))
    }

    /// Returns the multipliers of a nearby cycle in the order of those that are nearest here.
    fn in_own_order(&self, multipliers: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let mut rest = multipliers.to_vec();
        let mut take = |[re, im]: &[f64; 2]| {
            let apart = |other: &[f64; 2]| (other[0] - re).hypot(other[1] - im);
            let place = (0..rest.len()).min_by(|a, b| apart(&rest[*a]).total_cmp(&apart(&rest[*b])));
            place.map_or([f64::NAN; 2], |place| rest.remove(place))
        };
        self.multipliers.iter().map(&mut take).collect()
    }
}

//! The laws of a model as functions of its parameters.

use std::ops::{Add, Mul, Sub};
use std::rc::Rc;

use crate::machine::System;
use crate::model::{Model, ModelError};

/// How exact derivatives by parameters are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slopes {
    /// To about `1e-10`, which is enough for the matrices of Newton's method.
    Fast,
    /// To about `1e-13`.
    Exact,
}

impl Slopes {
    /// Step of differences, relative to the value of the parameter, and the number of steps on either side. Coefficients of models are smooth
    /// functions of parameters between kinks.
    fn stencil(self) -> (f64, usize) {
        match self {
            Slopes::Fast => (1e-5, 1),
            Slopes::Exact => (3e-3, 3),
        }
    }
}

/// A number that the laws of a cycle depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Free {
    /// The parameter with this index.
    Parameter(usize),
    /// The time of a cycle without force.
    CycleTime,
}

impl Free {
    /// Sets the number to a value, which may be out of range.
    pub(super) fn place(self, model: &mut dyn Model, value: f64) {
        match self {
            Free::Parameter(index) => model.assign(index, value),
            Free::CycleTime => model.set_cycle_time(value),
        }
    }

    /// Returns the scale of changes: the smaller one of the sizes of the value and of the parameter's default.
    pub(super) fn scale(self, model: &dyn Model, value: f64) -> f64 {
        let default = match self {
            Free::Parameter(index) => model.parameters()[index].default.unwrap_or(0.0),
            Free::CycleTime => 0.0,
        };
        [value.abs(), default.abs()].into_iter().filter(|size| *size > 0.0).reduce(f64::min).unwrap_or(1.0)
    }
}

/// The laws of a model with given values, and near them.
#[derive(Clone, Debug)]
pub(super) struct Laws {
    pub(super) system: Rc<System>,
    stencil: Rc<Stencil>,
}

/// What derivatives are taken from.
#[derive(Debug)]
struct Stencil {
    centre: Rc<System>,
    /// For each free number, systems at other values of it, with their weights in the derivative.
    nearby: Vec<Vec<(f64, System)>>,
}

impl Laws {
    /// Computes the laws of a model, and their derivatives by `free`.
    pub(super) fn new(model: &dyn Model, free: &[Free], slopes: Slopes) -> Result<Laws, ModelError> {
        let system = Rc::new(System::new(&model.oscillator()?));
        let nearby =
            free.iter().map(|&free| nearby(model, &system, free, slopes)).collect::<Result<_, _>>()?;
        Ok(Laws { stencil: Rc::new(Stencil { centre: Rc::clone(&system), nearby }), system })
    }

    /// Computes the laws of a model with almost the same values. Their derivatives are those of the laws here.
    pub(super) fn beside(&self, model: &dyn Model) -> Result<Laws, ModelError> {
        Ok(Laws { system: Rc::new(System::new(&model.oscillator()?)), stencil: Rc::clone(&self.stencil) })
    }

    /// Returns the number of free numbers.
    pub(super) fn free(&self) -> usize {
        self.stencil.nearby.len()
    }

    /// Returns a function of the laws, and its derivatives by the free numbers. What does not depend on a number has the derivative 0 exactly.
    pub(super) fn slopes<T>(&self, of: impl Fn(&System) -> T) -> (T, Vec<T>)
    where
        T: Clone + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
    {
        let here = of(&self.system);
        let is_centre = Rc::ptr_eq(&self.system, &self.stencil.centre);
        let centre = if is_centre { here.clone() } else { of(&self.stencil.centre) };
        let slope = |nearby: &Vec<(f64, System)>| {
            let terms = nearby.iter().map(|(weight, system)| (of(system) - centre.clone()) * *weight);
            terms.reduce(Add::add).expect("a stencil has places")
        };
        let slopes = self.stencil.nearby.iter().map(slope).collect();
        (here, slopes)
    }
}

/// Returns the systems of a stencil around the value of a free number. At an end of the parameter's range all lie on one side.
fn nearby(
    model: &dyn Model,
    system: &System,
    free: Free,
    slopes: Slopes,
) -> Result<Vec<(f64, System)>, ModelError> {
    let (value, range) = match free {
        Free::CycleTime => (system.period(), [0.0, f64::INFINITY]),
        Free::Parameter(index) => (model.value(index), model.parameters()[index].range.ends()),
    };
    let (step, side) = slopes.stencil();
    let offsets = stencil(value, range, (step * free.scale(model, value), side));
    let mut systems = Vec::new();
    for (k, offset) in offsets.iter().enumerate() {
        let weight = slope_at_zero(&offsets, k);
        if weight == 0.0 {
            continue;
        }
        let mut moved = model.clone_model();
        free.place(&mut *moved, value + offset);
        systems.push((weight, System::new(&moved.oscillator()?)));
    }
    Ok(systems)
}

/// Returns the places of a stencil around a value: `side` steps of length `h` on either side, or twice as many on one side at an end of the range.
pub(super) fn stencil(value: f64, [least, most]: [f64; 2], (h, side): (f64, usize)) -> Vec<f64> {
    let reach = side as f64 * h;
    let first = if value - reach < least {
        0.0
    } else if value + reach > most {
        -2.0 * reach
    } else {
        -reach
    };
    (0..=2 * side).map(|k| first + k as f64 * h).collect()
}

/// Returns the derivative at 0 of the polynomial that is 1 at one place and 0 at the others.
pub(super) fn slope_at_zero(places: &[f64], one: usize) -> f64 {
    let others = || (0..places.len()).filter(|&k| k != one);
    let term = |left_out: usize| {
        let factor = |k: usize| -places[k] / (places[one] - places[k]);
        others().filter(|&k| k != left_out).map(factor).product::<f64>() / (places[one] - places[left_out])
    };
    others().map(term).sum()
}

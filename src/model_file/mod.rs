//! Model files: names, parameters and matrices in TOML, read into a [`Model`]. Pure.
//!
//! A file defines `M x'' + C x' + K x = force cos(frequency t) + force_sin sin(frequency t) + load` in one to eight
//! coordinates, up to six gaps `z = g . x`, and up to four walls on each side of a gap. The force may have further harmonics. `C`, `K`
//! and `load` may change at given phases of the period, and dry friction may act. Entries are numbers or [expressions](crate::text::expression) in the parameters, computed in
//! f64. `docs/models.md` describes each key.

mod builtin;
mod contact;
mod curve;
mod definition;
mod entry;
mod equations;
mod friction;
mod harmonic;
mod motion;
mod parameters;
mod signal;
mod steps;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use rattlemap_dynamics::model::{Law, Model, ModelError, Oscillator, Parameter, Side, Units};
use rattlemap_dynamics::orbit::DISPLACEMENTS;

pub use builtin::{BUILT_IN, DEFAULT, MODEL_FILE};
pub use contact::{Wall, WallLaw, WallSpring};
pub use curve::{BentSpring, ForceLaw, Pieces};
pub use definition::Definition;
pub use entry::Staged;
pub use friction::DryFriction;
pub use harmonic::HarmonicForce;
pub use motion::Clock;
pub use signal::Signal;

use crate::record::measures::{self, Subjects};
use crate::text::error::SceneError;

/// A model from a file, with values of its parameters and a start phase. Clones share everything else.
#[derive(Clone, Debug)]
pub struct FileModel {
    definition: Arc<Definition>,
    values: Vec<f64>,
    start_phase: f64,
    cycle_time: Option<f64>,
}

impl FileModel {
    /// Reads a model and sets its parameters to their defaults. Messages call the text `file`.
    ///
    /// # Errors
    /// [`SceneError`] for the first error.
    pub fn parse(text: &str, file: &str) -> Result<FileModel, SceneError> {
        definition::read(text, file)
    }

    /// Returns a built-in model; none if there is none with this name.
    pub fn built_in(name: &str) -> Option<FileModel> {
        builtin::find(name).cloned()
    }

    /// Returns all built-in models.
    pub fn all_built_in() -> Vec<FileModel> {
        BUILT_IN.iter().filter_map(|(name, _)| FileModel::built_in(name)).collect()
    }

    /// Whether the model is equal to the built-in model with its name.
    pub fn is_built_in(&self) -> bool {
        builtin::find(self.name()).is_some_and(|own| own.definition == self.definition)
    }

    /// Returns the contents of the file.
    pub fn definition(&self) -> &Definition {
        &self.definition
    }

    /// Returns the places of displacements, gaps and signals that a rigid-body mode shifts, whatever the values of the parameters are.
    /// Slightly changed values tell this, because values that happen to be 0 are no property of the model.
    fn drifts(&self) -> Vec<usize> {
        let change = |(i, value): (usize, &f64)| match *value {
            0.0 => 0.7 + 0.01 * i as f64,
            value => value * (1.0 + 1e-3 * (i as f64 + 1.0).sin()),
        };
        let values: Vec<f64> = self.values.iter().enumerate().map(change).collect();
        let Ok(oscillator) = self.definition.oscillator(&values).or_else(|_| self.oscillator()) else {
            return Vec::new();
        };
        let modes = oscillator.rigid_modes().modes;
        let is_shifted =
            |place: &usize| modes.iter().any(|mode| mode.along(*place, &oscillator.signals) != 0.0);
        (0..DISPLACEMENTS).filter(is_shifted).collect()
    }

    /// Writes the equations of motion as lines, with a contact force for each gap that has walls.
    pub fn equations(&self) -> Vec<String> {
        equations::lines(&self.definition, &self.values, &self.gap_symbols())
    }

    /// Writes a row for each wall: name, position, law, restitution, largest rate at which contact is sustained, contact force.
    pub fn contacts(&self) -> Vec<[String; 6]> {
        equations::contacts(&self.definition, &self.gap_symbols())
    }

    /// Returns the symbols of each gap and its velocity in equations: those of [`gap_names`] for one gap, else its name, and its name with
    /// a prime.
    pub fn gap_symbols(&self) -> Vec<[String; 2]> {
        match &self.definition.motion.gaps[..] {
            [_] => vec![gap_names(self).map(str::to_owned)],
            gaps => {
                let names = gaps.iter().filter_map(|gap| gap.name.as_ref());
                names.map(|name| [name.clone(), format!("{name}'")]).collect()
            }
        }
    }

    fn new(definition: Definition) -> FileModel {
        FileModel {
            values: definition.defaults.clone(),
            definition: Arc::new(definition),
            start_phase: 0.0,
            cycle_time: None,
        }
    }
}

/// Returns the name of a side in model files and in texts.
pub fn side(side: Side) -> &'static str {
    match side {
        Side::Right => "right",
        Side::Left => "left",
    }
}

/// Returns the names of the gap and its velocity in texts and tables: `z` and `w`, or `gap` and `gap_rate` if the model
/// has a parameter, a coordinate or a velocity called `z` or `w`.
pub fn gap_names(model: &dyn Model) -> [&'static str; 2] {
    let states = model.state_names();
    let parameters = model.parameters().iter().map(|parameter| &*parameter.name);
    match parameters.chain(states).any(|name| ["z", "w"].contains(&name)) {
        true => ["gap", "gap_rate"],
        false => ["z", "w"],
    }
}

/// Returns the names of the columns of each gap and its velocity: those of [`gap_names`] for one gap, else its name, and its name with
/// `_rate`. A rate has a further underscore where a parameter, a coordinate or a velocity has its name.
pub fn gap_columns(model: &dyn Model) -> Vec<[String; 2]> {
    let Some(names) = several_gaps(model) else {
        return vec![gap_names(model).map(str::to_owned)];
    };
    let is_taken = |name: &String| {
        let mut parameters = model.parameters().iter().map(|parameter| &*parameter.name);
        parameters.any(|other| other == name) || model.state_names().contains(&&**name)
    };
    let rate = |name: &String| {
        let mut rate = format!("{name}_rate");
        while is_taken(&rate) || names.contains(&rate) {
            rate.push('_');
        }
        rate
    };
    names.iter().map(|name| [name.clone(), rate(name)]).collect()
}

/// Explains the letters in words, if the model has several gaps.
pub fn letters_in_words(model: &dyn Model) -> Option<String> {
    letters(model)
        .map(|letters| format!("in words, the letter before a symbol is that of its gap: {letters}"))
}

/// Returns the letter that each gap has in words, and its name, if the model has several gaps.
pub fn letters(model: &dyn Model) -> Option<String> {
    let names = several_gaps(model)?;
    let letters = ('a'..).zip(names).map(|(letter, name)| format!("{letter} = {name}"));
    Some(letters.collect::<Vec<_>>().join(", "))
}

/// Returns the names of what measured numbers of a model describe.
pub fn subjects(model: &dyn Model) -> Subjects {
    let signals = model.downcast_ref::<FileModel>().map(|model| &model.definition.signals[..]);
    Subjects {
        states: model.state_names().into_iter().map(str::to_owned).collect(),
        gaps: several_gaps(model).unwrap_or_default(),
        signals: signals.unwrap_or_default().iter().map(|signal| signal.name.clone()).collect(),
        drifts: model.downcast_ref::<FileModel>().map_or(Vec::new(), FileModel::drifts),
    }
}

/// Returns a name that two columns of `cells.csv` or of `trajectory.csv` would have. A scene checks the parameters that it sweeps.
fn repeated_column(model: &FileModel) -> Option<String> {
    let names = subjects(model);
    let numbers = measures::all().chain(measures::of_gaps()).filter(|measure| measure.is_of(&names));
    let cells = names.states.iter().cloned().chain(numbers.map(|measure| measure.name(&names)));
    let own = |column: &str| match &names.gaps[..] {
        [] => vec![column.to_owned()],
        gaps => gaps.iter().map(|gap| format!("{column}_{gap}")).collect(),
    };
    let fixed = ["t", "phase", "event", "side", "moment", "element", "friction_force"].map(str::to_owned);
    let several = (1..).zip(&model.definition.friction).map(|(i, _)| format!("friction_force_{i}"));
    let gaps = gap_columns(model).concat().into_iter().chain(own("domain")).chain(own("contact_force"));
    let place = (!names.gaps.is_empty()).then(|| "gap".to_owned());
    let of_gaps = fixed.into_iter().chain(several).chain(gaps).chain(place);
    let trajectory = of_gaps.chain(names.states.clone()).chain(names.signals.clone());
    let repeated = |columns: Vec<String>| {
        let is_repeated = |i: &usize| columns[..*i].contains(&columns[*i]);
        (0..columns.len()).find(is_repeated).map(|i| columns[i].clone())
    };
    repeated(cells.collect()).or_else(|| repeated(trajectory.collect()))
}

/// Returns the names of a model's gaps, if it has several.
pub fn several_gaps(model: &dyn Model) -> Option<Vec<String>> {
    let symbols = model.downcast_ref::<FileModel>()?.gap_symbols();
    (symbols.len() > 1).then(|| symbols.into_iter().map(|[gap, _]| gap).collect())
}

/// Whether a model's file states no force, harmonics or stages, so that cycles have periods of their own.
pub fn is_unforced(model: &dyn Model) -> bool {
    model.downcast_ref::<FileModel>().is_some_and(|model| model.definition.is_unforced())
}

/// Models are equal if their texts, values, start phases and cycle times are.
impl PartialEq for FileModel {
    fn eq(&self, other: &FileModel) -> bool {
        self.values == other.values
            && self.start_phase == other.start_phase
            && self.cycle_time == other.cycle_time
            && self.definition == other.definition
    }
}

impl Model for FileModel {
    fn name(&self) -> &str {
        &self.definition.name
    }

    fn title(&self) -> &str {
        &self.definition.title
    }

    fn source(&self) -> Option<&str> {
        self.definition.source.as_deref()
    }

    fn frequency(&self) -> Vec<usize> {
        self.definition.motion.clock.entry().map_or(Vec::new(), |entry| entry.uses().to_vec())
    }

    fn parameters(&self) -> &[Parameter] {
        &self.definition.parameters
    }

    fn value(&self, index: usize) -> f64 {
        self.values[index]
    }

    fn assign(&mut self, index: usize, value: f64) {
        self.values[index] = value;
    }

    fn oscillator(&self) -> Result<Oscillator, ModelError> {
        self.check()?;
        let oscillator = self.definition.oscillator(&self.values)?.at_phase(self.start_phase);
        let oscillator = oscillator.on_cycle(self.cycle_time);
        oscillator.validate()?;
        Ok(oscillator)
    }

    fn law(&self) -> Law {
        self.definition.law(&self.values)
    }

    fn start_phase(&self) -> f64 {
        self.start_phase
    }

    fn set_cycle_time(&mut self, time: f64) {
        self.cycle_time = self.definition.is_unforced().then_some(time);
    }

    fn set_start_phase(&mut self, phase: f64) -> bool {
        self.start_phase = phase;
        true
    }

    fn state_names(&self) -> Vec<&str> {
        self.definition.motion.state_names().collect()
    }

    fn units(&self) -> Units {
        let signals = self.definition.signals.iter().map(|signal| signal.unit.clone()).collect();
        Units { signals, ..self.definition.motion.units.clone() }
    }

    fn bodies(&self) -> Vec<&str> {
        self.definition.motion.bodies.iter().map(String::as_str).collect()
    }
}

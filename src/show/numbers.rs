//! Numbers that a scene requests besides exponent, impacts and meshing: names, headings and values.

use crate::map::bifurcation::Column;
use crate::map::scene::Quantity;
use crate::model_file::subjects;
use crate::record::measures::{self, Dimension, MEASURES, Measure, Measured, Subjects};
use crate::show::cells::{Cells, Row};
use crate::show::symbols::{symbol, with_unit};
use rattlemap_dynamics::model::{Model, State, Units};
use rattlemap_dynamics::orbit::Orbit;

/// A number of a motion, as a column of tables, a layer of maps, a panel of diagrams, and a variable in Python.
#[derive(Clone, Debug)]
pub struct Number {
    /// Name in tables, of layers, and in Python.
    pub name: String,
    /// Heading in plain text.
    pub title: String,
    /// Heading with mathematical symbols and unit, for figures.
    pub label: String,
    /// Name of the displacement or state component, or the word that distinguishes it from other numbers of its quantity;
    /// else empty.
    pub subject: String,
    /// Physical dimension.
    pub dimension: Dimension,
    /// Unit, if the model gives one.
    pub unit: Option<String>,
    /// Quantity that the scene must request.
    pub quantity: Quantity,
    /// Index of the state component that the number describes, if it describes one.
    pub component: Option<usize>,
    source: Source,
}

#[derive(Clone, Copy, Debug)]
enum Source {
    Measure(Measure),
    ImpactRate,
    State(usize),
}

impl Number {
    /// Returns the numbers of some quantities of a model, in the order of the quantities.
    pub fn of(model: &dyn Model, quantities: &[Quantity]) -> Vec<Number> {
        let mut quantities = quantities.to_vec();
        quantities.sort_unstable();
        let (names, units) = (subjects(model), model.units());
        // Numbers of each gap come last, because scripts may know the columns by their places.
        let whole = quantities.iter().flat_map(|&quantity| of_quantity(quantity, &names));
        let each = quantities.iter().flat_map(|&quantity| of_gaps(quantity, &names));
        let mut numbers: Vec<Number> = whole.chain(each).collect();
        for number in &mut numbers {
            number.unit = unit(number, &units);
            number.label = with_unit(&number.label, number.unit.as_deref());
        }
        numbers
    }

    /// Whether the number is an angle, so that minus pi and pi are equal.
    pub fn is_angle(&self) -> bool {
        self.dimension == Dimension::Angle
    }

    /// Whether the mirror image of a motion has the opposite value.
    pub(crate) fn is_odd(&self) -> bool {
        matches!(self.source, Source::Measure(measure) if measure.is_odd())
    }

    /// Returns the number of a cell.
    pub(crate) fn of_cell(&self, cells: &Cells<'_>, id: usize, row: &Row) -> Option<f64> {
        self.read(&row.measures, || cells.impact_rate(id), row.state)
    }

    /// Returns the number of an orbit.
    pub fn of_orbit(&self, orbit: &Orbit) -> Option<f64> {
        let rate = || Some(orbit.impacts_per_period / orbit.forcing_period);
        self.read(&Measured::from(orbit).numbers(), rate, Some(orbit.strobe))
    }

    /// Returns the number of a column of a bifurcation diagram.
    pub fn of_column(&self, column: &Column) -> Option<f64> {
        self.read(&column.measures, || Some(column.impact_rate), column.state)
    }

    fn read(
        &self,
        measures: &[Option<f64>; MEASURES],
        rate: impl FnOnce() -> Option<f64>,
        state: Option<State>,
    ) -> Option<f64> {
        match self.source {
            Source::Measure(measure) => measures[measure.place],
            Source::ImpactRate => rate(),
            Source::State(component) => state.map(|state| state[component]),
        }
        .filter(|value| value.is_finite())
    }
}

/// Returns the unit of a number.
fn unit(number: &Number, units: &Units) -> Option<String> {
    let signal = match number.source {
        Source::Measure(measure) => measure.signal(),
        _ => None,
    };
    match (number.dimension, number.component) {
        (Dimension::Length, None) if signal.is_some() => units.signals.get(signal?)?.clone(),
        (Dimension::Length | Dimension::Speed, Some(component)) => units.component(component),
        (Dimension::Length, None) => units.gap.clone(),
        (Dimension::Speed, None) => units.gap_velocity(),
        (Dimension::Time, _) => units.time.clone(),
        (Dimension::Rate, _) => units.rate("1"),
        (Dimension::Angle, _) => Some("rad".to_owned()),
        (Dimension::Force, _) => units.force.clone(),
        (Dimension::Power, _) => units.power(),
        (Dimension::None, _) => None,
    }
}

fn of_quantity(quantity: Quantity, names: &Subjects) -> Vec<Number> {
    match quantity {
        Quantity::ImpactRate => vec![Number {
            name: "impact_rate".to_owned(),
            title: "impacts per unit time".to_owned(),
            label: "impacts per unit time".to_owned(),
            subject: String::new(),
            dimension: Dimension::Rate,
            unit: None,
            quantity,
            component: None,
            source: Source::ImpactRate,
        }],
        Quantity::State => {
            let of = |(i, name): (usize, &String)| Number {
                name: format!("state_{name}"),
                title: format!("final state, {name}"),
                label: format!("final state, {}", symbol(name)),
                subject: name.clone(),
                dimension: if i % 2 == 0 { Dimension::Length } else { Dimension::Speed },
                unit: None,
                quantity,
                component: Some(i),
                source: Source::State(i),
            };
            names.states.iter().enumerate().map(of).collect()
        }
        _ => {
            let all = quantity.group().into_iter().flat_map(|group| group.measures());
            all.filter_map(|measure| of_measure(measure, quantity, names)).collect()
        }
    }
}

/// Returns the numbers of each of several gaps. One gap has the numbers of the whole motion.
fn of_gaps(quantity: Quantity, names: &Subjects) -> Vec<Number> {
    let own = measures::of_gaps().filter(|m| !names.gaps.is_empty() && m.group.name == quantity.name());
    own.filter_map(|measure| of_measure(measure, quantity, names)).collect()
}

fn of_measure(measure: Measure, quantity: Quantity, names: &Subjects) -> Option<Number> {
    let subject = measure.subject(names).filter(|_| measure.is_of(names))?;
    let is_rate = measure.dimension() == Dimension::Speed;
    Some(Number {
        name: measure.name(names),
        title: measure.title(subject),
        label: measure.title(&symbol(subject)),
        subject: [&measure.part().replace('_', " "), subject].join(" ").trim().to_owned(),
        dimension: measure.dimension(),
        unit: None,
        quantity,
        component: measure.coordinate().map(|i| 2 * i + usize::from(is_rate)),
        source: Source::Measure(measure),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model_file::FileModel;

    #[test]
    fn numbers_have_the_units_of_their_displacement_and_of_time() {
        let text = FileModel::built_in("impact-oscillator").unwrap().definition().text.clone();
        let with = |units: &str| {
            let text = text.replace("[motion]\n", &format!("[motion]\n{units}\n"));
            FileModel::parse(&text, "m.toml").unwrap()
        };
        let units = |model: &FileModel, quantity| -> Vec<String> {
            let numbers = Number::of(model, &[quantity]).into_iter();
            numbers.map(|number| number.unit.unwrap_or_default()).collect()
        };
        let model = with("units = ['mm']\ntime_unit = 's'");
        let of = |quantity| units(&model, quantity);
        assert_eq!(of(Quantity::State), ["mm", "mm/s"]);
        assert_eq!(of(Quantity::Harmonic)[..2], ["mm", "rad"]);
        assert_eq!(
            (of(Quantity::ImpactRate), of(Quantity::Dissipated)),
            (vec!["1/s".to_owned()], vec![String::new()])
        );
        let power = |text: &str| units(&with(&format!("time_unit = 's'\n{text}")), Quantity::ImpactEnergy);
        assert_eq!(power("units = ['m']\nforce_unit = 'N'"), ["W"]);
        assert_eq!(power("units = ['rad']\nforce_unit = 'N m'"), ["W"]);
        assert_eq!(power("units = ['mm']\nforce_unit = 'N'"), ["N mm/s"]);
        assert_eq!(power("force_unit = 'N'"), [""]);
        let force = with("force_unit = 'kN'");
        assert!(units(&force, Quantity::ContactForceMax).iter().all(|unit| unit == "kN"));
        assert_eq!(Number::of(&model, &[Quantity::Rms])[0].label, "root mean square of x [mm]");
        let gears = FileModel::built_in("two-loose-gears").unwrap();
        let labels: Vec<String> = Number::of(&gears, &[Quantity::Rms]).into_iter().map(|n| n.label).collect();
        let names = ["s", "x\u{2081}", "x\u{2082}", "a", "b"];
        assert_eq!(labels, names.map(|name| format!("root mean square of {name} [m]")));
    }
}

//! Table of the measured quantities of a motion. Columns, layers, names in Python, and tolerances are made from it.

use super::distance::{apart, farther};
use super::{Record, valid};
use rattlemap_dynamics::model::{MOST_COORDINATES, MOST_GAPS, MOST_SIGNALS, State};
use rattlemap_dynamics::orbit::{
    Measurement, Orbit, Quantities, place_of_displacement, place_of_gap, place_of_signal,
};

/// Number of numbers in [`Record::measures`].
pub const MEASURES: usize = OF_DRIFTS + DRIFTS.len() * (MOST_COORDINATES + MOST_SIGNALS);

/// First of the numbers of further displacements and gaps in [`Record::measures`].
pub(crate) const FURTHER: usize = places_before(GROUPS.len());

/// First of the numbers of each gap in [`Record::measures`], which only models with several gaps have.
pub(crate) const OF_GAPS: usize = FURTHER + FURTHER_DISPLACEMENTS * numbers_before(GROUPS.len());

/// First of the numbers of each signal in [`Record::measures`].
pub(crate) const OF_SIGNALS: usize = OF_GAPS + MOST_GAPS * GAP_GROUPS.len();

/// First of the drifts of displacements and signals in [`Record::measures`]; their errors follow.
pub(crate) const OF_DRIFTS: usize = OF_SIGNALS + MOST_SIGNALS * numbers_before(GROUPS.len());

/// The mean rate of a displacement or a signal that a rigid-body mode shifts, and its standard error. They are requested with the amplitude.
static DRIFTS: [Number; 2] = [
    number("drift", "drift of {}", Dimension::Speed, |of, i| of.quantities?.displacements[i].drift),
    number("drift_error", "standard error of the drift of {}", Dimension::Speed, |of, i| {
        of.quantities?.displacements[i].drift_error
    }),
];

/// Numbers of each gap of a model with several gaps. They have the validity bits of the quantities for all gaps together, and are NaN if
/// a gap does not have the number.
#[rustfmt::skip]
pub(crate) const GAP_GROUPS: [Group; 5] = [
    group("impacts", 2, false, &[number("impacts_per_period", "impacts per forcing period of {}", Dimension::None,
        |of, gap| Some(of.quantities?.gaps?[gap].impacts_per_period))]),
    group("mesh", 3, false, &[number("mesh_fraction", "fraction of time in meshing of {}", Dimension::None,
        |of, gap| Some(of.quantities?.gaps?[gap].mesh_fraction))]),
    group("impact_energy", 11, false, &[number("impact_energy", "energy lost in impacts of {} per unit time", Dimension::Power,
        |of, gap| Some(of.quantities?.gaps?[gap].impact_energy))]),
    group("contact_force_max", 12, false, &[number("contact_force_max", "largest contact force of {}", Dimension::Force,
        |of, gap| Some(of.quantities?.gaps?[gap].contact_force?[0]))]),
    group("contact_force_rms", 13, false, &[number("contact_force_rms", "rms contact force of {}", Dimension::Force,
        |of, gap| Some(of.quantities?.gaps?[gap].contact_force?[1]))]),
];

/// Quantities that a scene requests by one name, in the order of their places in a record.
#[rustfmt::skip]
pub const GROUPS: [Group; 14] = [
    group("impact_speed", 9, false, &[number("impact_speed", "mean approach speed of impacts", Dimension::Speed,
        |of, _| of.impacts()?.approaches.get(2).map(|both| both.mean))]),
    group("impact_speed_max", 10, false, &[number("impact_speed_max", "largest approach speed of impacts", Dimension::Speed,
        |of, _| of.impacts()?.approaches.get(2).map(|both| both.largest))]),
    group("impact_energy", 11, false, &[number("impact_energy", "energy lost in impacts per unit time", Dimension::Power,
        |of, _| Some(of.quantities?.impact_energy))]),
    group("contact_force_max", 12, false, &[number("contact_force_max", "largest contact force", Dimension::Force,
        |of, _| Some(of.quantities?.contact_force?[0]))]),
    group("contact_force_rms", 13, false, &[number("contact_force_rms", "rms contact force", Dimension::Force,
        |of, _| Some(of.quantities?.contact_force?[1]))]),
    group("dissipated", 14, false, &[number("dissipated", "energy that dampers take per unit time", Dimension::Power,
        |of, _| Some(of.quantities?.dissipated))]),
    group("amplitude", 15, true, &[
        number("amplitude", "amplitude of {}", Dimension::Length, |of, i| Some(of.quantities?.displacements[i].amplitude)),
        number("mean", "mean of {}", Dimension::Length, |of, i| Some(of.quantities?.displacements[i].mean))]),
    group("rms", 16, true, &[number("rms", "root mean square of {}", Dimension::Length,
        |of, i| Some(of.quantities?.displacements[i].rms))]),
    group("harmonic", 17, true, &[
        number("harmonic", "first harmonic of {}", Dimension::Length, |of, i| Some(of.quantities?.displacements[i].harmonic[0])),
        number("harmonic_phase", "phase of the first harmonic of {}", Dimension::Angle,
            |of, i| Some(of.quantities?.displacements[i].harmonic[1]))]),
    group("multiplier", 18, false, &[
        number("multiplier", "modulus of the largest multiplier", Dimension::None, |of, _| Some(of.multiplier?[0])),
        number("multiplier_argument", "argument of the largest multiplier", Dimension::Angle, |of, _| Some(of.multiplier?[1].abs()))]),
    group("stick_fraction", 19, false, &[number("stick_fraction", "share of the time in which dry friction sticks", Dimension::None,
        |of, _| Some(of.quantities?.friction?.sticking))]),
    group("friction_energy", 20, false, &[number("friction_energy", "energy that dry friction takes per unit time", Dimension::Power,
        |of, _| Some(of.quantities?.friction?.dissipated))]),
    group("release_energy", 22, false, &[number("release_energy", "energy that walls with `pull = false` still hold when contact ends, per unit time",
        Dimension::Power, |of, _| of.quantities?.release_energy)]),
    group("cycle_time", 23, false, &[number("cycle_time", "time of a cycle", Dimension::Time, |of, _| of.cycle_time)]),
];

/// Physical dimension of a number, from which its unit follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// Dimension of a displacement or of the gap.
    Length,
    /// Length per time.
    Speed,
    /// Force.
    Force,
    /// Energy per time.
    Power,
    /// Time.
    Time,
    /// One per time.
    Rate,
    /// Angle in radians, from minus pi to pi.
    Angle,
    /// None.
    None,
}

/// A quantity that a scene requests by one name. Its numbers have one validity bit.
#[derive(Debug)]
pub struct Group {
    /// Name in scenes.
    pub name: &'static str,
    /// Bit of [`valid`] of its numbers.
    pub bit: u32,
    /// Whether it has the numbers for each displacement and for the gap.
    of_displacements: bool,
    numbers: &'static [Number],
}

/// A number of a quantity.
#[derive(Debug)]
struct Number {
    name: &'static str,
    title: &'static str,
    dimension: Dimension,
    /// Returns the number of a motion, and of one of its [displacements](Quantities::displacements).
    read: fn(&Measured<'_>, usize) -> Option<f64>,
}

const fn group(name: &'static str, bit: u32, of_displacements: bool, numbers: &'static [Number]) -> Group {
    Group { name, bit: 1 << bit, of_displacements, numbers }
}

const fn number(
    name: &'static str,
    title: &'static str,
    dimension: Dimension,
    read: fn(&Measured<'_>, usize) -> Option<f64>,
) -> Number {
    Number { name, title, dimension, read }
}

/// Returns the validity bits of all groups.
pub fn bits() -> u32 {
    GROUPS.iter().fold(0, |bits, group| bits | group.bit)
}

/// Returns the number of places of the groups before one of them.
pub(crate) const fn places_before(group: usize) -> usize {
    let (mut i, mut places) = (0, 0);
    while i < group {
        places += GROUPS[i].places();
        i += 1;
    }
    places
}

/// Share of the largest number of a quantity below which numbers of a cycle count as small. Rounding errors of lanes are
/// below 1e-6 of the largest number.
pub const SMALL: f64 = 0.01;

fn relative(distance: f64, scale: f64) -> f64 {
    if distance == 0.0 { 0.0 } else { distance / scale }
}

/// Returns the numbers of each displacement in the groups before one of them.
const fn numbers_before(group: usize) -> usize {
    let (mut i, mut numbers) = (0, 0);
    while i < group {
        if GROUPS[i].of_displacements {
            numbers += GROUPS[i].numbers.len();
        }
        i += 1;
    }
    numbers
}

/// Number of displacements and gaps with places in their group: the first two displacements and the first gap. The numbers of all others
/// follow behind those of all groups.
const FIRST_DISPLACEMENTS: usize = 3;
const FURTHER_DISPLACEMENTS: usize = MOST_COORDINATES + MOST_GAPS - FIRST_DISPLACEMENTS;

/// A displacement, a gap or a signal.
#[derive(Clone, Copy, Debug)]
enum Subject {
    Displacement(usize),
    Gap(usize),
    Signal(usize),
    /// A gap whose contacts are counted apart.
    OneOfSeveral(usize),
}

impl Subject {
    /// Returns all, in the order of columns in tables.
    fn all() -> impl Iterator<Item = Subject> {
        let displacements = (0..MOST_COORDINATES).map(Subject::Displacement);
        displacements.chain((0..MOST_GAPS).map(Subject::Gap)).chain((0..MOST_SIGNALS).map(Subject::Signal))
    }

    /// Returns the place in [`Quantities::displacements`], or in [`Quantities::gaps`].
    fn place(self) -> usize {
        match self {
            Subject::Displacement(i) => place_of_displacement(i),
            Subject::Gap(i) => place_of_gap(i),
            Subject::Signal(i) => place_of_signal(i),
            Subject::OneOfSeveral(i) => i,
        }
    }
}

impl Group {
    pub(crate) const fn places(&self) -> usize {
        self.numbers.len() * if self.of_displacements { FIRST_DISPLACEMENTS } else { 1 }
    }

    /// Returns the group of a name.
    pub fn named(name: &str) -> Option<&'static Group> {
        GROUPS.iter().find(|group| group.name == name)
    }

    /// Returns the largest distance of the numbers of two records up to mirror image, relative to the second one plus
    /// `share` of its record's largest number. A displacement at rest has rounding errors of the others' size, and the
    /// average of an aperiodic motion the statistical error of its amplitude. Amplitude and phase are compared as a
    /// complex number.
    pub fn distance(&self, a: &Record, b: &Record, share: f64) -> f64 {
        let (drifts, measures): (Vec<_>, Vec<_>) = self.measures().partition(Measure::is_drift);
        let largest = |measures: &[Measure]| {
            let sizes = measures.iter().filter(|m| !m.is_angle()).map(|m| b.measures[m.place].abs());
            sizes.fold(0.0, f64::max)
        };
        let of_displacements: Vec<Measure> =
            measures.iter().filter(|measure| measure.signal().is_none()).copied().collect();
        let size_of_displacements = largest(&of_displacements);
        let of_subject = |measures: &[Measure]| {
            // A signal has a unit of its own.
            let is_signal = measures.iter().any(|measure| measure.signal().is_some());
            let added = share * if is_signal { largest(measures) } else { size_of_displacements };
            let places: Vec<usize> = measures.iter().map(|measure| measure.place).collect();
            let [a, b] =
                [a, b].map(|record| places.iter().map(|&place| record.measures[place]).collect::<Vec<_>>());
            let has_phase = self.numbers.last().is_some_and(|number| number.dimension == Dimension::Angle);
            if has_phase {
                let [x, y] = [0, 1].map(|i| {
                    let part = |of: &[f64]| of[0] * if i == 0 { of[1].cos() } else { of[1].sin() };
                    apart(part(&a), part(&b))
                });
                return relative(x.hypot(y), b[0].abs() + added);
            }
            // The mean of the mirror image has the other sign.
            let distances = a.iter().zip(&b).map(|(a, b)| relative(apart(a.abs(), b.abs()), b.abs() + added));
            distances.fold(0.0, farther)
        };
        let own = measures.chunks(self.numbers.len()).map(of_subject).fold(0.0, farther);
        // A drift is a rate, so it is compared with the largest drift alone. Its error is not compared.
        let added = share * largest(&drifts);
        let of_drift = |measure: &Measure| {
            let [a, b] = [a, b].map(|record| record.measures[measure.place].abs());
            relative(apart(a, b), b + added)
        };
        drifts.iter().filter(|measure| measure.is_odd()).map(of_drift).fold(own, farther)
    }

    /// Returns the numbers of the group.
    pub fn measures(&self) -> impl Iterator<Item = Measure> {
        all().filter(|measure| measure.group.bit == self.bit)
    }
}

/// A number in [`Record::measures`].
#[derive(Clone, Copy, Debug)]
pub struct Measure {
    /// Its index in [`Record::measures`].
    pub place: usize,
    /// Its quantity.
    pub group: &'static Group,
    /// The displacement or gap that it describes.
    subject: Option<Subject>,
    number: &'static Number,
}

/// Returns all numbers of a record, in the order of columns in tables.
pub fn all() -> impl Iterator<Item = Measure> {
    let of_group = |(index, group): (usize, &'static Group)| {
        let subjects: Vec<Option<Subject>> = match group.of_displacements {
            true => Subject::all().map(Some).collect(),
            false => vec![None],
        };
        subjects.into_iter().flat_map(move |subject| {
            let numbers = group.numbers.len();
            let first = match (subject, subject.map_or(0, Subject::place)) {
                (Some(Subject::Signal(nth)), _) => {
                    OF_SIGNALS + MOST_SIGNALS * numbers_before(index) + nth * numbers
                }
                (_, nth) if nth < FIRST_DISPLACEMENTS => places_before(index) + nth * numbers,
                (_, nth) => {
                    let nth = nth - FIRST_DISPLACEMENTS;
                    FURTHER + FURTHER_DISPLACEMENTS * numbers_before(index) + nth * numbers
                }
            };
            group.numbers.iter().enumerate().map(move |(i, number)| Measure {
                place: first + i,
                group,
                subject,
                number,
            })
        })
    };
    GROUPS.iter().enumerate().flat_map(of_group).chain(of_drifts())
}

/// Returns the drifts of displacements and signals.
fn of_drifts() -> impl Iterator<Item = Measure> {
    let group = Group::named("amplitude").expect("a group has this name");
    let displacements = (0..MOST_COORDINATES).map(Subject::Displacement);
    let subjects = displacements.chain((0..MOST_SIGNALS).map(Subject::Signal));
    let of_number = move |number| subjects.clone().map(move |subject| (number, subject));
    (OF_DRIFTS..).zip(DRIFTS.iter().flat_map(of_number)).map(move |(place, (number, subject))| Measure {
        place,
        group,
        subject: Some(subject),
        number,
    })
}

/// Returns the numbers of each gap, in the order of columns in tables.
pub(crate) fn of_gaps() -> impl Iterator<Item = Measure> {
    GAP_GROUPS.iter().enumerate().flat_map(|(index, group)| {
        (0..MOST_GAPS).map(move |gap| Measure {
            place: OF_GAPS + gap * GAP_GROUPS.len() + index,
            group,
            subject: Some(Subject::OneOfSeveral(gap)),
            number: &group.numbers[0],
        })
    })
}

/// Returns the places of the impacts per forcing period of each gap.
pub(crate) fn impacts_of_gaps() -> impl Iterator<Item = usize> {
    of_gaps().filter(|measure| measure.group.bit == GAP_GROUPS[0].bit).map(|measure| measure.place)
}

/// Returns the impacts per forcing period and the mesh fraction of one of several gaps, if they were measured.
pub(crate) fn contacts_of_gap(record: &Record, gap: usize) -> Option<[f64; 2]> {
    let first = OF_GAPS + gap * GAP_GROUPS.len();
    let bits = GAP_GROUPS[0].bit | GAP_GROUPS[1].bit | valid::GAPS;
    (record.valid & bits == bits).then(|| [0, 1].map(|number| record.measures[first + number]))
}

/// Names of what the numbers of a record describe.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Subjects {
    /// Components of the state: displacement and velocity of each coordinate.
    pub states: Vec<String>,
    /// Gaps, if there are several.
    pub gaps: Vec<String>,
    /// Signals.
    pub signals: Vec<String>,
    /// Places of displacements, gaps and signals that drift, for all values of the parameters, in [`Quantities::displacements`].
    pub drifts: Vec<usize>,
}

impl Subjects {
    /// Returns the names of a model with one gap and without signals.
    pub fn of_states(states: &[&str]) -> Subjects {
        Subjects { states: states.iter().map(ToString::to_string).collect(), ..Subjects::default() }
    }
}

impl Measure {
    /// Whether a motion with these names has the number.
    pub fn is_of(&self, names: &Subjects) -> bool {
        let drifts = self.subject.is_some_and(|subject| names.drifts.contains(&subject.place()));
        let is_there = if self.is_drift() { drifts } else { !(self.is_odd() && drifts) };
        is_there && self.subject(names).is_some()
    }

    /// Returns the name of the displacement, gap or signal, or an empty text if the number describes the whole motion; none if the model
    /// has none.
    pub fn subject<'n>(&self, names: &'n Subjects) -> Option<&'n str> {
        let found = match self.subject {
            None => return Some(""),
            Some(Subject::Gap(0)) if names.gaps.is_empty() => return Some("gap"),
            Some(Subject::Gap(i) | Subject::OneOfSeveral(i)) => names.gaps.get(i),
            Some(Subject::Displacement(i)) => names.states.get(2 * i),
            Some(Subject::Signal(i)) => names.signals.get(i),
        };
        found.map(String::as_str)
    }

    /// Returns the index of the signal that the number describes, if it describes one.
    pub fn signal(&self) -> Option<usize> {
        match self.subject {
            Some(Subject::Signal(i)) => Some(i),
            _ => None,
        }
    }

    /// Returns the index of the displacement that the number describes; none for a gap, a signal and the whole motion.
    pub fn coordinate(&self) -> Option<usize> {
        match self.subject {
            Some(Subject::Displacement(i)) => Some(i),
            _ => None,
        }
    }

    /// Whether it describes one of several gaps.
    fn is_of_one_gap(&self) -> bool {
        matches!(self.subject, Some(Subject::OneOfSeveral(_)))
    }

    /// Returns the name in tables, layers and Python for a model with these names.
    pub fn name(&self, names: &Subjects) -> String {
        match self.subject(names) {
            Some(subject) if !subject.is_empty() => format!("{}_{subject}", self.number.name),
            _ => self.number.name.to_owned(),
        }
    }

    /// Returns what the number's name adds to that of its quantity, such as `mean` or `argument`.
    pub fn part(&self) -> &'static str {
        if self.is_of_one_gap() {
            return "";
        }
        self.number.name.strip_prefix(self.group.name).unwrap_or(self.number.name).trim_start_matches('_')
    }

    /// Returns the heading, with this symbol of the displacement.
    pub fn title(&self, symbol: &str) -> String {
        self.number.title.replace("{}", symbol)
    }

    /// Returns the physical dimension.
    pub fn dimension(&self) -> Dimension {
        self.number.dimension
    }

    /// Whether it is the drift of a displacement or a signal, or its error.
    fn is_drift(&self) -> bool {
        DRIFTS.iter().any(|number| number.name == self.number.name)
    }

    /// Whether the mirror image of a motion has the opposite value.
    pub fn is_odd(&self) -> bool {
        ["mean", "drift"].contains(&self.number.name)
    }

    /// Whether the number is an angle, so that minus pi and pi are equal.
    pub fn is_angle(&self) -> bool {
        self.number.dimension == Dimension::Angle
    }

    /// Returns the number of a record, if it has the quantity.
    pub fn of(&self, record: &Record) -> Option<f64> {
        let bits = self.group.bit | if self.is_of_one_gap() { valid::GAPS } else { 0 };
        let value = (record.valid & bits == bits).then(|| record.measures[self.place]);
        // A gap may not have the number, that of a signal may be too large, and the drift of a cycle has no error.
        value.filter(|value| !(value.is_nan() || *value == 0.0 && self.number.name == DRIFTS[1].name))
    }

    /// Returns the number of a motion.
    pub fn read(&self, motion: &Measured<'_>) -> Option<f64> {
        (self.number.read)(motion, self.subject.map_or(0, Subject::place)).filter(|value| value.is_finite())
    }

    /// Returns the difference of two values: of angles, the shorter way round.
    pub fn difference(&self, a: f64, b: f64) -> f64 {
        let difference = a - b;
        if self.is_angle() { difference.sin().atan2(difference.cos()) } else { difference }
    }

    /// Returns the average of values with weights of sum 1. Values of different signs, as those of mirror images, have no
    /// average: the result is the value with the largest weight. Angles are averaged the shorter way round.
    pub fn average(&self, weighted: &[(f64, f64)]) -> f64 {
        let &(nearest, _) = weighted.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or(&(0.0, 0.0));
        let differ = weighted.iter().any(|(value, weight)| *weight > 0.0 && value * nearest < 0.0);
        if differ && !self.is_angle() {
            return nearest;
        }
        let sum =
            weighted.iter().map(|(value, weight)| weight * self.difference(*value, nearest)).sum::<f64>();
        self.difference(nearest + sum, 0.0)
    }
}

/// The measured motion from which numbers are read.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// Measured quantities.
    pub quantities: Option<&'a Quantities>,
    /// Modulus and argument of the largest multiplier.
    pub multiplier: Option<[f64; 2]>,
    /// Time of a cycle without force.
    pub cycle_time: Option<f64>,
}

impl<'a> Measured<'a> {
    /// Returns all numbers by their places in a record.
    pub fn numbers(&self) -> [Option<f64>; MEASURES] {
        let mut numbers = [None; MEASURES];
        all().chain(of_gaps()).for_each(|measure| numbers[measure.place] = measure.read(self));
        numbers
    }

    /// Returns the quantities if there are impacts.
    fn impacts(&self) -> Option<&'a Quantities> {
        self.quantities.filter(|quantities| quantities.approaches[2].count > 0)
    }
}

impl<'a> From<&'a Measurement> for Measured<'a> {
    fn from(measurement: &'a Measurement) -> Self {
        let Measurement { multiplier, cycle_time, .. } = *measurement;
        Measured { quantities: measurement.quantities.as_ref(), multiplier, cycle_time }
    }
}

impl<'a> From<&'a Orbit> for Measured<'a> {
    fn from(orbit: &'a Orbit) -> Self {
        let polar = |&[re, im]: &[f64; 2]| [re.hypot(im), im.atan2(re)];
        let largest = orbit.floquet.as_ref().and_then(|multipliers| multipliers.first());
        let (multiplier, cycle_time) = (largest.map(polar), orbit.cycle_time);
        Measured { quantities: orbit.quantities.as_ref(), multiplier, cycle_time }
    }
}

impl Record {
    /// Stores the numbers of a motion, and the validity bits of the quantities that it has.
    pub fn set_measures(&mut self, motion: &Measured<'_>) {
        self.valid |= bits();
        for measure in all() {
            match measure.read(motion) {
                // The sum turns minus zero into zero, so that columns of zeros take no memory.
                Some(value) => self.measures.set(measure.place, value + 0.0),
                None if measure.is_drift() => self.measures.set(measure.place, 0.0),
                // A signal that is too large takes no other number away.
                None if measure.signal().is_some() => self.measures.set(measure.place, f64::NAN),
                None => self.valid &= !measure.group.bit,
            }
        }
        let present = self.valid;
        self.clear_measures(|group| present & group.bit == 0);
        let has_gaps = motion.quantities.is_some_and(|quantities| quantities.gaps.is_some());
        self.valid = present & !valid::GAPS | if has_gaps { valid::GAPS } else { 0 };
        for measure in of_gaps() {
            let value = || measure.read(motion).map_or(f64::NAN, |value| value + 0.0);
            let is_set = has_gaps && present & measure.group.bit != 0;
            self.measures.set(measure.place, if is_set { value() } else { 0.0 });
        }
    }

    /// Sets all measured quantities but the multiplier and the time of a cycle.
    pub fn set_quantities(&mut self, quantities: Option<&Quantities>) {
        let mut parts = all().filter(|measure| measure.group.name == "multiplier").map(|part| part.of(self));
        let multiplier = parts.next().flatten().zip(parts.next().flatten()).map(<[f64; 2]>::from);
        self.set_measures(&Measured { quantities, multiplier, cycle_time: self.cycle_time() });
    }

    /// Returns the time of a cycle without force.
    pub fn cycle_time(&self) -> Option<f64> {
        all().find(|measure| measure.group.name == "cycle_time").and_then(|measure| measure.of(self))
    }

    /// Removes the numbers of some quantities. Those of gaps are removed with their quantity.
    pub fn clear_measures(&mut self, is_cleared: impl Fn(&Group) -> bool) {
        if GAP_GROUPS.iter().all(&is_cleared) {
            self.valid &= !valid::GAPS;
        }
        for measure in
            of_gaps().filter(|measure| self.valid & measure.group.bit == 0 || is_cleared(measure.group))
        {
            self.measures.set(measure.place, 0.0);
        }
        for measure in all().filter(|measure| is_cleared(measure.group)) {
            self.valid &= !measure.group.bit;
            self.measures.set(measure.place, 0.0);
        }
    }

    /// Returns the last strobe state, if the record has it.
    pub fn state(&self) -> Option<State> {
        (self.valid & valid::STROBE != 0).then(|| self.strobe())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_number_has_a_place_and_each_quantity_a_bit_of_its_own() {
        let mut places: Vec<usize> = all().chain(of_gaps()).map(|measure| measure.place).collect();
        places.sort_unstable();
        assert_eq!(places, (0..MEASURES).collect::<Vec<_>>());
        let bits = GROUPS.iter().fold(valid::PATTERN * 2 - 1, |bits, group| {
            assert_eq!(bits & group.bit, 0, "{}", group.name);
            bits | group.bit
        });
        assert_eq!(bits.count_ones() as usize, 9 + GROUPS.len());
    }

    #[test]
    fn names_contain_those_of_the_models_displacements() {
        let of = |states: &[&str], gaps: &[&str], signals: &[&str]| -> Vec<String> {
            let [states, gaps, signals] =
                [states, gaps, signals].map(|names| names.iter().map(ToString::to_string).collect());
            let names = Subjects { states, gaps, signals, drifts: Vec::new() };
            let own = |group: &Group| group.measures().filter(|m| m.is_of(&names)).collect::<Vec<_>>();
            let groups = ["amplitude", "harmonic", "multiplier"].map(|name| own(Group::named(name).unwrap()));
            groups.concat().iter().map(|measure| measure.name(&names)).collect()
        };
        let names = |states: &[&str]| of(states, &[], &[]);
        let one = "amplitude_y mean_y amplitude_gap mean_gap harmonic_y harmonic_phase_y harmonic_gap \
                   harmonic_phase_gap multiplier multiplier_argument";
        assert_eq!(names(&["y", "vy"]).join(" "), one);
        assert_eq!(names(&["x1", "v1", "x2", "v2"]).len(), 14);
        let three = of(&["s", "vs", "x", "vx", "y", "vy"], &["a", "b"], &["seat"]);
        let amplitudes = "amplitude_s mean_s amplitude_x mean_x amplitude_y mean_y amplitude_a mean_a amplitude_b mean_b \
                          amplitude_seat mean_seat";
        assert_eq!(three[..12].join(" "), amplitudes);
    }

    #[test]
    fn a_quantity_that_the_motion_does_not_have_is_cleared() {
        let quantities = Quantities { impact_energy: -0.0, dissipated: 2.0, ..Quantities::default() };
        let mut record =
            Record { measures: [7.0; MEASURES].into(), valid: valid::PERIOD, ..Record::default() };
        record.set_measures(&Measured {
            quantities: Some(&quantities),
            multiplier: Some([0.5, f64::NAN]),
            cycle_time: None,
        });
        let value = |name: &str| Group::named(name).unwrap().measures().next().unwrap().of(&record);
        let absent = ["impact_speed", "impact_speed_max", "contact_force_max", "multiplier"];
        assert_eq!(absent.map(value), [None; 4]);
        assert_eq!((value("dissipated"), value("rms")), (Some(2.0), Some(0.0)));
        assert_eq!(record.measures.iter().filter(|value| value.to_bits() != 0).count(), 1);
    }

    #[test]
    fn numbers_are_compared_relative_to_the_motion_and_up_to_mirror_image() {
        let distance = |name: &str, change: fn(&mut Record, usize)| {
            let group = Group::named(name).unwrap();
            let first = group.measures().next().unwrap().place;
            let record = Record { measures: [0.5; MEASURES].into(), ..Record::default() };
            let mut other = record.clone();
            change(&mut other, first);
            group.distance(&other, &record, 0.0)
        };
        assert_eq!(distance("amplitude", |record, first| record.measures[first + 1] *= -1.0), 0.0);
        assert!(
            (distance("amplitude", |record, first| record.measures[first + 1] = 0.0) - 1.0).abs() < 1e-12
        );
        assert_eq!(distance("rms", |record, first| record.measures[first] = f64::NAN), f64::INFINITY);
        let turned =
            distance("harmonic", |record, first| record.measures[first + 1] += std::f64::consts::TAU + 1e-3);
        assert!((turned - 1e-3).abs() < 1e-6, "{turned}");
        assert!(distance("rms", |record, first| record.measures[first + 2] = 0.6) > 0.19, "the gap");
        let last_gap = |record: &mut Record, _| {
            let is_last = |measure: &Measure| matches!(measure.subject, Some(Subject::Gap(gap)) if gap + 1 == MOST_GAPS);
            let place = Group::named("rms").unwrap().measures().find(is_last).unwrap().place;
            record.measures[place] = 0.6;
        };
        assert!(distance("rms", last_gap) > 0.19, "the last gap");
    }

    /// An amplitude that is a thousand times smaller than the mean.
    #[test]
    fn a_wrong_small_number_is_seen_beside_a_large_one() {
        let group = Group::named("amplitude").unwrap();
        let first = group.measures().next().unwrap().place;
        let mut right = Record { measures: [1.0; MEASURES].into(), ..Record::default() };
        right.measures[first] = 1e-3;
        let mut wrong = right.clone();
        wrong.measures[first] = 2e-3;
        assert!(group.distance(&wrong, &right, SMALL) > 0.09);
        assert!(group.distance(&wrong, &right, 1.0) < 1.1e-3);
    }

    #[test]
    fn averages_of_angles_and_of_mirror_images_stay_between_their_values() {
        let named = |name: &str| {
            all().find(|measure| measure.name(&Subjects::of_states(&["x", "v"])) == name).unwrap()
        };
        let phase = named("harmonic_phase_x").average(&[(3.0, 0.75), (-3.0, 0.25)]);
        assert!((phase - (3.0 + 0.25 * (std::f64::consts::TAU - 6.0))).abs() < 1e-12, "{phase}");
        assert_eq!(named("mean_x").average(&[(0.25, 0.75), (-0.25, 0.25)]), 0.25);
        assert_eq!(named("rms_x").average(&[(1.0, 0.75), (2.0, 0.25)]), 1.25);
    }

    #[test]
    fn differences_of_angles_take_the_shorter_way() {
        let phase = all().find(|measure| measure.is_angle()).unwrap();
        assert!((phase.difference(3.0, -3.0) - (6.0 - std::f64::consts::TAU)).abs() < 1e-12);
    }
}

//! Measured quantities of a motion: impacts, contact forces, amplitudes, harmonics, dissipated energy.
//!
//! A [`Meter`] receives the events of a trajectory, whose engine measures the flights between them.

use crate::model::{Law, MOST_COORDINATES, MOST_GAPS, NonImpacting, State};
use crate::motion::{
    Allowance, Contacts, DISPLACEMENTS, EventKind, Flights, Flow, GapEvent, GapSums, Moments, Observer,
    States, Stop, Sums, Trajectory, share,
};
use crate::stability::standard_error;

/// Quantities of one motion over a whole number of forcing periods, in the units of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quantities {
    /// Approach speeds at the right and the left wall, and at both.
    pub approaches: [Approaches; 3],
    /// Energy lost in contacts per unit time: `(1 - e^2) w^2 / (2 g M^-1 g)` in each impact, and the energy of a contact
    /// spring that is released before it relaxes.
    pub impact_energy: f64,
    /// Energy that walls that only push hold when their contact ends, without what they hold when it begins, per unit time. Negative with a
    /// damper and a preload that pulls. None without such walls.
    pub release_energy: Option<f64>,
    /// Largest and root mean square force of compliant contacts, positive if it presses; none without such contact.
    pub contact_force: Option<[f64; 2]>,
    /// The first two displacements, the first gap, the other displacements, the other gaps and the signals; unused entries are 0.
    pub displacements: [Displacement; DISPLACEMENTS],
    /// Energy that all dampers dissipate per unit time.
    pub dissipated: f64,
    /// Dry friction; none without it.
    pub friction: Option<FrictionQuantities>,
    /// Each gap; none with one gap. Unused entries are 0.
    pub gaps: Option<[GapQuantities; MOST_GAPS]>,
}

impl Quantities {
    /// Returns the quantities without what is left of the motion that has come to rest.
    pub(super) fn at_rest(mut self) -> Quantities {
        for displacement in &mut self.displacements {
            (displacement.amplitude, displacement.harmonic) = (0.0, [0.0; 2]);
            displacement.rms = if displacement.drift.is_some() { 0.0 } else { displacement.mean.abs() };
        }
        if self.displacements.iter().all(|displacement| displacement.drift.is_none()) {
            self.dissipated = 0.0;
            self.friction.iter_mut().for_each(|friction| friction.dissipated = 0.0);
        }
        self
    }
}

/// Contacts of one gap.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GapQuantities {
    /// Impacts per forcing period, without starts of lasting contact.
    pub impacts_per_period: f64,
    /// Fraction of the time in lasting contact.
    pub mesh_fraction: f64,
    /// Energy lost at its walls per unit time.
    pub impact_energy: f64,
    /// Largest and root mean square force of its compliant contacts, positive if it presses; none without such contact.
    pub contact_force: Option<[f64; 2]>,
}

/// Quantities of dry friction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionQuantities {
    /// Share of the time during which an element sticks, 0 to 1.
    pub sticking: f64,
    /// Energy that friction turns into heat per unit time, `force |rate|` of all elements.
    pub dissipated: f64,
}

/// Approach speeds of the contacts to which the law of restitution applies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Approaches {
    /// Number of contacts.
    pub count: u64,
    /// Mean approach speed; 0 without contacts.
    pub mean: f64,
    /// Largest approach speed; 0 without contacts.
    pub largest: f64,
}

impl Approaches {
    fn of(contacts: Contacts) -> Approaches {
        let mean = if contacts.count > 0 { contacts.sum / contacts.count as f64 } else { 0.0 };
        Approaches { count: contacts.count, mean, largest: contacts.largest }
    }
}

/// Averages and extremes of a displacement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Displacement {
    /// Half the difference of maximum and minimum.
    pub amplitude: f64,
    /// Average over time; 0 for a displacement that drifts.
    pub mean: f64,
    /// Mean rate, if a [rigid-body mode](crate::model::RigidMode) shifts the displacement. All other numbers are then those of the
    /// displacement without drift and mean.
    pub drift: Option<f64>,
    /// [Standard error](crate::stability::standard_error) of the drift of aperiodic motion.
    pub drift_error: Option<f64>,
    /// Root mean square.
    pub rms: f64,
    /// Amplitude `a > 0` and phase `phi` in `(-pi, pi]` of the component `a cos(omega t + phi)`.
    pub harmonic: [f64; 2],
}

impl Displacement {
    /// Returns the averages over a time; 0 for a displacement that the oscillator does not have.
    fn of(moments: &Moments, time: f64) -> Displacement {
        if moments.high < moments.low {
            return Displacement::default();
        }
        let [cos, sin] = [moments.cos, moments.sin].map(|x| 2.0 * x / time);
        Displacement {
            amplitude: 0.5 * (moments.high - moments.low),
            mean: moments.value / time,
            drift: None,
            drift_error: None,
            rms: (moments.square / time).sqrt(),
            harmonic: [cos.hypot(sin), (-sin).atan2(cos)],
        }
    }
}

/// Measures the motion that continues from a strobe state: over one cycle of `period` forcing periods, or over `observed` periods if `period`
/// is 0. The motion first follows its cycle once, so that `strobe` may be rounded. Motion without further contact is measured in its steady
/// state.
///
/// Returns `None` if the motion cannot be continued.
pub fn quantities_after(
    flow: &Flow,
    law: Law,
    strobe: State,
    [period, observed]: [u32; 2],
    allowance: Allowance<'_>,
) -> Option<Quantities> {
    let mut motion = Trajectory::new(flow, law, strobe).allowing(allowance);
    let is_certain = |free: &&NonImpacting| motion.is_free() && free.is_certain(strobe);
    if let Some(free) = flow.non_impacting().filter(is_certain) {
        return Meter::measure_steady(flow, law, free).ok();
    }
    for _ in 0..period {
        motion.advance_period(&mut ()).ok()?;
    }
    Meter::measure(&mut motion, if period > 0 { period } else { observed.max(1) }).ok()
}

/// Measures one cycle of `period` forcing periods from its state at phase 0. The cycle may be unstable.
///
/// Returns `None` if the motion cannot be continued.
pub fn quantities_on(flow: &Flow, law: Law, strobe: State, period: u32) -> Option<Quantities> {
    Meter::measure(&mut Trajectory::new(flow, law, strobe), period).ok()
}

/// Measures a trajectory from its events.
#[derive(Clone, Debug)]
pub(super) struct Meter<'f> {
    flow: &'f Flow,
    first_period: u64,
    flights: Flights<'f>,
    sums: Sums,
}

impl<'f> Meter<'f> {
    /// Begins at phase 0, at the present state of a trajectory, and finds the drift over the following `periods` if there are rigid-body
    /// modes.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    pub(super) fn new(trajectory: &Trajectory<'f>, periods: u32) -> Result<Meter<'f>, Stop> {
        let (flow, mut sums) = (trajectory.flow(), Sums::NONE);
        if !flow.rigid_modes.modes.is_empty() {
            let mut ahead = trajectory.clone();
            (0..periods).try_for_each(|_| ahead.advance_period(&mut ()))?;
            let rates = drift_rates(flow, [trajectory, &ahead], periods);
            sums.drifts.iter_mut().zip(rates).for_each(|(drift, rate)| drift.rate = rate);
        }
        Ok(Meter { flow, first_period: trajectory.period(), flights: trajectory.flights(), sums })
    }

    /// Advances a trajectory by `periods` forcing periods and measures it.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    pub(super) fn measure(trajectory: &mut Trajectory<'f>, periods: u32) -> Result<Quantities, Stop> {
        let mut meter = Meter::new(trajectory, periods)?;
        for _ in 0..periods {
            trajectory.advance_period(&mut meter)?;
        }
        Ok(meter.finish(trajectory.period()))
    }

    /// As [`Meter::measure`], for aperiodic motion, whose drift has a standard error.
    ///
    /// # Errors
    /// As for [`Meter::measure`].
    pub(super) fn measure_aperiodic(
        trajectory: &mut Trajectory<'f>,
        periods: u32,
    ) -> Result<Quantities, Stop> {
        let (flow, mut before) = (trajectory.flow(), trajectory.clone());
        let mut quantities = Meter::measure(trajectory, periods)?;
        if !flow.rigid_modes.modes.is_empty() {
            let mut of_periods = Vec::new();
            for _ in 0..periods {
                let from = before.clone();
                before.advance_period(&mut ())?;
                of_periods.push(drift_rates(flow, [&from, &before], 1));
            }
            for (place, displacement) in quantities.displacements.iter_mut().enumerate() {
                let drifts: Vec<f64> =
                    of_periods.iter().filter_map(|rates| flow.drift(place, rates)).collect();
                displacement.drift_error = displacement.drift.map(|_| standard_error(&drifts));
            }
        }
        Ok(quantities)
    }

    /// Measures a period of contact-free motion in its steady state.
    ///
    /// # Errors
    /// As for [`Meter::measure`].
    pub(super) fn measure_steady(
        flow: &'f Flow,
        law: Law,
        motion: &NonImpacting,
    ) -> Result<Quantities, Stop> {
        Meter::measure(&mut Trajectory::new(flow, law, motion.steady()), 1)
    }

    /// Returns the quantities from the beginning to phase 0 of `period`.
    pub(super) fn finish(mut self, period: u64) -> Quantities {
        self.flights.complete_periods(period, &mut self.sums);
        let (sums, time) = (self.sums, (period - self.first_period) as f64 * self.flow.period);
        let [right, left] = sums.contacts;
        let of_gap = |gap: GapSums| GapQuantities {
            impacts_per_period: gap.impacts as f64 / (period - self.first_period) as f64,
            mesh_fraction: share(gap.contact_time, time),
            impact_energy: gap.lost.sum() / time,
            contact_force: (gap.force_time > 0.0)
                .then(|| [gap.force.high, (gap.force.square / gap.force_time).sqrt()]),
        };
        Quantities {
            approaches: [right, left, right.and(left)].map(Approaches::of),
            impact_energy: sums.lost.sum() / time,
            release_energy: self.flow.has_pushing_walls().then_some(sums.released.sum() / time),
            contact_force: (sums.contact_time > 0.0)
                .then(|| [sums.force.high, (sums.force.square / sums.contact_time).sqrt()]),
            displacements: std::array::from_fn(|place| {
                let of = Displacement::of(&sums.displacements[place], time);
                let drift = self.flow.drift(place, &sums.drifts.map(|drift| drift.rate));
                // The position along a rigid-body mode is arbitrary, so the mean is removed.
                let without_mean = || (of.rms.powi(2) - of.mean.powi(2)).max(0.0).sqrt();
                let [mean, rms] = drift.map_or([of.mean, of.rms], |_| [0.0, without_mean()]);
                Displacement { mean, drift, rms, ..of }
            }),
            dissipated: sums.dissipated / time,
            friction: self.flow.has_friction().then(|| FrictionQuantities {
                sticking: share(sums.sticking_time, time),
                dissipated: sums.heat / time,
            }),
            gaps: (self.flow.gap_count() > 1).then(|| sums.gaps.map(of_gap)),
        }
    }
}

/// Returns the mean rates along all rigid-body modes from one point of a trajectory to another, which is `periods` later.
fn drift_rates(flow: &Flow, ends: [&Trajectory<'_>; 2], periods: u32) -> [f64; MOST_COORDINATES] {
    let [from, to] = ends.map(Trajectory::travelled);
    std::array::from_fn(|nth| (to[nth] - from[nth]) / (f64::from(periods) * flow.period))
}

impl Observer for Meter<'_> {
    fn event(&mut self, event: &GapEvent, _: States<'_>) {
        self.sums.gaps[event.gap].impacts += u64::from(event.kind == EventKind::Impact);
        self.flights.event(event, &mut self.sums);
    }

    fn sums(&mut self) -> Option<&mut Sums> {
        Some(&mut self.sums)
    }
}

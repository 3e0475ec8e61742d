//! A machine and a cache of its domains.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use super::domain::{DomainKey, LinearDomain};
use super::frame::Frame;
use super::modes::{AtRest, GapMode, Modes};
use super::{PhasePoint, ROUNDING};
use crate::model::Oscillator;
use crate::motion::Slip;

/// A machine, prepared for its motions. All motions share its domains, which are built on first use.
#[derive(Clone, Debug)]
pub struct System {
    frame: Frame,
    /// One list of domains for each stage.
    domains: Arc<[Domains]>,
}

/// A linked list of domains that grows at its end. A search takes no lock.
type Domains = OnceLock<Box<Met>>;

#[derive(Debug)]
struct Met {
    key: DomainKey,
    domain: LinearDomain,
    next: Domains,
}

impl Deref for System {
    type Target = Frame;

    fn deref(&self) -> &Frame {
        &self.frame
    }
}

impl System {
    /// Prepares a machine that [`Oscillator::validate`] accepts.
    pub fn new(machine: &Oscillator) -> System {
        let domains = machine.stages.iter().map(|_| Domains::default()).collect();
        System { frame: Frame::new(machine), domains }
    }

    /// Returns the domain of a combination of modes, and builds it on first use.
    pub(super) fn domain(&self, modes: &Modes) -> &LinearDomain {
        self.domain_at(modes.key(self))
    }

    pub(super) fn domain_at(&self, key: DomainKey) -> &LinearDomain {
        let mut place = &self.domains[key.stage];
        loop {
            let build = || Box::new(Met { key, domain: LinearDomain::new(self, key), next: OnceLock::new() });
            let met = place.get_or_init(build);
            if met.key == key {
                return &met.domain;
            }
            place = &met.next;
        }
    }

    /// Whether the modes of the elements at rest are consistent with the forces at a point. If `may_yield`, a friction force may be at its
    /// limit while other elements keep the rate 0.
    pub(super) fn is_consistent(
        &self,
        modes: &Modes,
        at_rest: &AtRest,
        point: &PhasePoint,
        may_yield: bool,
    ) -> bool {
        if *at_rest == AtRest::default() {
            return true;
        }
        let domain = self.domain(modes);
        let gaps = (0..self.gaps()).all(|gap| {
            let Some(side) = at_rest.gaps[gap] else { return true };
            match &domain.pushes[gap] {
                Some(push) => domain.first_derivative(push, point, 0).1 > 0.0,
                // The gap leaves the wall, or friction holds it there.
                None => side.sign() * domain.departure(gap, point).1 <= 0.0,
            }
        });
        gaps && (0..self.elements.len()).filter(|&i| at_rest.elements[i]).all(|i| match modes.slips[i] {
            Slip::Stick => domain.holds[i].as_ref().is_none_or(|hold| {
                let [value, size] = hold.value_and_size(point);
                value.abs() <= self.elements[i].static_force + ROUNDING * size
            }),
            _ if domain.is_driven[i] => may_yield,
            slip => slip.sign() * domain.first_derivative(&self.rate_row(i), point, 1).1 > 0.0,
        })
    }

    /// Returns the first consistent combination of modes. Present modes of gaps and sticking elements are tried first. If rows depend on
    /// each other, the later ones bear no force at first. If no combination is consistent then, friction forces at their limits are tried,
    /// too: if friction is the same at rest and while sliding, all combinations that are consistent give the same accelerations.
    pub(super) fn consistent(&self, modes: &Modes, at_rest: &AtRest, point: &PhasePoint) -> Option<Modes> {
        let gaps = || (0..self.gaps()).filter_map(|gap| Some((gap, at_rest.gaps[gap]?)));
        let elements = || (0..self.elements.len()).filter(|&i| at_rest.elements[i]);
        let combinations = Slip::ALL.len().pow(elements().count() as u32) << gaps().count();
        let all = || {
            (0..combinations).map(|mut number| {
                let mut tried = *modes;
                for i in elements().rev() {
                    (tried.slips[i], tried.pieces[i]) = (Slip::ALL[number % Slip::ALL.len()], 0);
                    number /= Slip::ALL.len();
                }
                for (gap, side) in gaps() {
                    let is_held = (number % 2 == 0) == modes.gaps[gap].rest().is_some();
                    let free = self.before_last(gap, side);
                    tried.gaps[gap] = if is_held { GapMode::Stuck(side) } else { free };
                    number /= 2;
                }
                tried
            })
        };
        let fits = |may_yield| all().find(|tried| self.is_consistent(tried, at_rest, point, may_yield));
        fits(false).or_else(|| fits(true))
    }
}

//! The effect of rounding at every step, measured on perturbed motions of the reference.
//!
//! A lane rounds its state once per step. A motion of the reference whose state is moved by as much at the same times may
//! end where the lane ends. A few motions with random moves show how far rounding may separate them, and whether it may add
//! or remove an impact where chatter ends. The sensitivity to the start does not show this: a motion forgets its start, but
//! not its latest roundings.

use super::cells::{EngineName, state_distance};
use super::lanes::Start;
use rattlemap::map::random::Random;
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{Stop, Trajectory};

/// Results of the perturbed motions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Perturbed {
    /// Largest distance of a perturbed end from the exact one.
    pub(super) distance: f64,
    /// Fewest and most impacts, including the unperturbed motion.
    pub(super) impacts: [u64; 2],
}

/// Computes `runs` motions for some periods. At each of `steps` equidistant times of a period, each component of the state
/// moves by a uniform random number of at most one unit roundoff of the engine.
pub(super) fn perturbed(
    flow: &Flow,
    (pair, start): &Start,
    periods: u32,
    steps: u32,
    engine: EngineName,
    runs: u64,
) -> Result<Perturbed, Stop> {
    let law = pair.law();
    let mut exact = Trajectory::new(flow, law, *start);
    (0..periods).try_for_each(|_| exact.advance_period(&mut ()))?;
    let mut found = Perturbed { distance: 0.0, impacts: [exact.work().impacts; 2] };
    let unit = engine.unit_roundoff();
    for run in 0..runs {
        let mut random = Random::new((run << 32) + u64::from(steps));
        let mut moved = Trajectory::new(flow, law, *start);
        for _ in 0..periods {
            for step in 1..steps {
                moved.advance_to(flow.period * (f64::from(step) / f64::from(steps)), &mut ())?;
                moved.perturb(|| unit * (2.0 * random.unit() - 1.0));
            }
            moved.advance_period(&mut ())?;
        }
        let impacts = moved.work().impacts;
        found.distance = found.distance.max(state_distance(&moved.state(), &exact.state()));
        found.impacts = [found.impacts[0].min(impacts), found.impacts[1].max(impacts)];
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::super::cells::{REST, flow_of, paper};
    use super::*;

    /// Errors of a random walk grow with the square root of its steps, and with the unit roundoff.
    #[test]
    fn perturbed_motions_scatter_like_a_random_walk() {
        let cell = (paper(0.9, 11.0), REST);
        let flow = flow_of(&cell.0);
        let distance = |steps: u32, engine: EngineName| {
            let found = perturbed(&flow, &cell, 4, steps, engine, 8).unwrap();
            assert_eq!(found.impacts, [0, 0]);
            found.distance
        };
        let [few, many] = [64, 4096].map(|steps| distance(steps, EngineName::LanesF32));
        assert!((2.0..32.0).contains(&(many / few)), "{few:e} {many:e}");
        let double = distance(4096, EngineName::LanesF64);
        assert!((0.05..20.0).contains(&(many / double / 2f64.powi(29))), "{many:e} {double:e}");
    }

    /// Where chatter ends in meshing, rounding may add a short flight.
    #[test]
    fn rounding_may_add_an_impact_at_the_end_of_chatter() {
        let cell = (paper(0.72, 1.5), REST);
        let found = perturbed(&flow_of(&cell.0), &cell, 4, 18_000, EngineName::LanesF32, 8).unwrap();
        assert!(found.impacts[0] <= 150 && found.impacts[1] > 150, "{found:?}");
    }
}

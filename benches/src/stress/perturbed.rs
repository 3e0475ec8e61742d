//! What rounding at every step may do to a motion: the reference, perturbed.
//!
//! A lane rounds its state once per step. A motion whose state is moved by as much at the same
//! instants ends where the lane may end. A few such motions, each moved at random, show how far
//! apart rounding may take them, and whether it may add or remove an impact where chatter ends.
//! Sensitivity to the start does not show that: a motion forgets its start, but not what was
//! rounded a moment ago.

use super::cells::{EngineName, apart};
use super::lanes::Start;
use rattlemap::map::random::Random;
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::reference::{Stop, Trajectory};

/// What was seen of the perturbed motions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Perturbed {
    /// How far the farthest ends from the motion itself; infinite if one does not end.
    pub(super) distance: f64,
    /// Fewest and most impacts, the motion's own among them.
    pub(super) impacts: [u64; 2],
}

/// Follows `runs` motions for some periods, moving each number of the state at each of `steps`
/// even instants of a period by up to a unit roundoff of the engine, evenly distributed.
pub(super) fn perturbed(
    flow: &Flow,
    (pair, start): &Start,
    periods: u32,
    steps: u32,
    engine: EngineName,
    runs: u64,
) -> Result<Perturbed, Stop> {
    let law = pair.law();
    let mut still = Trajectory::new(flow, law, *start);
    (0..periods).try_for_each(|_| still.advance_period(&mut ()))?;
    let mut seen = Perturbed { distance: 0.0, impacts: [still.work().impacts; 2] };
    let unit = engine.unit_roundoff();
    for run in 0..runs {
        let mut random = Random::new((run << 32) + u64::from(steps));
        let mut moved = Trajectory::new(flow, law, *start);
        for _ in 0..periods {
            for step in 1..steps {
                moved.advance_to(flow.period * (f64::from(step) / f64::from(steps)), &mut ())?;
                moved.perturb(std::array::from_fn(|_| unit * (2.0 * random.unit() - 1.0)));
            }
            moved.advance_period(&mut ())?;
        }
        let impacts = moved.work().impacts;
        seen.distance = seen.distance.max(apart(&moved.state(), &still.state()));
        seen.impacts = [seen.impacts[0].min(impacts), seen.impacts[1].max(impacts)];
    }
    Ok(seen)
}

#[cfg(test)]
mod tests {
    use super::super::cells::{REST, flow_of, paper};
    use super::*;

    /// Errors of a walk grow with the root of its steps, and with the unit roundoff.
    #[test]
    fn motions_scatter_like_a_walk() {
        let cell = (paper(0.9, 11.0), REST);
        let flow = flow_of(&cell.0);
        let distance = |steps: u32, engine: EngineName| {
            let seen = perturbed(&flow, &cell, 4, steps, engine, 8).unwrap();
            assert_eq!(seen.impacts, [0, 0]);
            seen.distance
        };
        let [few, many] = [64, 4096].map(|steps| distance(steps, EngineName::LanesF32));
        assert!((2.0..32.0).contains(&(many / few)), "{few:e} {many:e}");
        let double = distance(4096, EngineName::LanesF64);
        assert!((0.05..20.0).contains(&(many / double / 2f64.powi(29))), "{many:e} {double:e}");
    }

    /// Where chatter ends in meshing, a short flight may be one more.
    #[test]
    fn rounding_decides_how_chatter_ends() {
        let cell = (paper(0.72, 1.5), REST);
        let seen = perturbed(&flow_of(&cell.0), &cell, 4, 18_000, EngineName::LanesF32, 8).unwrap();
        assert!(seen.impacts[0] <= 150 && seen.impacts[1] > 150, "{seen:?}");
    }
}

//! Gaps whose rows depend on each other: masses between walls, gears in a ring, and rest on several walls; and friction whose force the
//! state alone does not determine.

use std::sync::atomic::AtomicBool;

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::model::{
    Contact, DryFriction, Forces, GapRow, Oscillator, Restitution, Side, Spring, State, Timing, Wall, state,
};

use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::state_at;

use crate::common::near;
use crate::independent::random::Random;

fn wall(at: f64, e: f64) -> Wall {
    let restitution = Restitution::Constant(e);
    Wall { at, contact: Contact::Rigid, restitution, mesh_speed: 0.0, springs: vec![Spring::default()] }
}

/// Returns masses without springs.
fn machine(masses: &[f64], rows: &[(&[f64], [Option<f64>; 2])], e: f64) -> Oscillator {
    let n = masses.len();
    let none = DMatrix::zeros(n, n);
    let gap = |&(row, walls): &(&[f64], [Option<f64>; 2])| GapRow {
        row: DVector::from_row_slice(row),
        walls: walls.map(|at| at.into_iter().map(|at| wall(at, e)).collect()),
    };
    Oscillator {
        omega: 1.0,
        mass: DMatrix::from_diagonal(&DVector::from_row_slice(masses)),
        stages: vec![Forces { damping: none.clone(), stiffness: none, load: DVector::zeros(n) }],
        schedule: Vec::new(),
        drives: Vec::new(),
        gaps: rows.iter().map(gap).collect(),
        friction: Vec::new(),
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    }
}

/// Returns masses in a row between walls at 0 and at a distance. The row of the last gap is the sum of the others.
fn row_of_masses(masses: &[f64], length: f64, e: f64) -> Oscillator {
    let n = masses.len();
    let row = |i: usize| -> Vec<f64> {
        (0..n).map(|j| f64::from(u8::from(j == i)) - f64::from(u8::from(j + 1 == i))).collect()
    };
    let rows: Vec<Vec<f64>> =
        (0..n).map(row).chain([(0..n).map(|j| if j + 1 == n { 1.0 } else { 0.0 }).collect()]).collect();
    let walls = |i: usize| if i == n { [Some(length), None] } else { [None, Some(0.0)] };
    let rows: Vec<(&[f64], _)> = rows.iter().enumerate().map(|(i, row)| (&row[..], walls(i))).collect();
    machine(masses, &rows, e)
}

/// Returns three gears of which each meshes with both others, with clearances.
fn ring(masses: &[f64; 3], e: f64) -> Oscillator {
    let walls = |clearance: f64| [Some(clearance), Some(-clearance)];
    let rows: [(&[f64], _); 3] =
        [(&[1.0, -1.0, 0.0], walls(1.0)), (&[0.0, 1.0, -1.0], walls(0.7)), (&[-1.0, 0.0, 1.0], walls(0.9))];
    machine(masses, &rows, e)
}

/// Follows free masses from impact to impact, in their own coordinates. Returns the state after a time, and the number of impacts.
fn billiard(machine: &Oscillator, start: &[f64], time: f64) -> (Vec<f64>, usize) {
    let (mut state, mut left, mut impacts, mut last) = (start.to_vec(), time, 0, None);
    loop {
        let mut first: Option<(f64, usize, usize)> = None;
        for (i, gap) in machine.gaps.iter().enumerate() {
            let of = |at: usize| gap.row.iter().enumerate().map(|(j, x)| x * state[2 * j + at]).sum::<f64>();
            for side in Side::BOTH {
                let walls = &gap.walls[side.index()];
                let (z, w) = (of(0), of(1));
                if walls.is_empty() || side.sign() * w <= 0.0 || last == Some((i, side.index())) {
                    continue;
                }
                let after = ((walls[0].at - z) / w).max(0.0);
                if first.is_none_or(|first| after < first.0) {
                    first = Some((after, i, side.index()));
                }
            }
        }
        let (after, i, side) = first.unwrap_or((f64::INFINITY, 0, 0));
        state.chunks_mut(2).for_each(|x| x[0] += x[1] * after.min(left));
        left -= after;
        if left <= 0.0 {
            return (state, impacts);
        }
        let (gap, inverse) = (&machine.gaps[i], machine.mass.clone().try_inverse().unwrap());
        let rate: f64 = gap.row.iter().enumerate().map(|(j, x)| x * state[2 * j + 1]).sum();
        let moves = &inverse * &gap.row;
        let e = gap.walls[side][0].restitution.at(0.0)[0];
        let by = &moves * (-(1.0 + e) * rate / gap.row.dot(&moves));
        by.iter().enumerate().for_each(|(j, by)| state[2 * j + 1] += by);
        (impacts, last) = (impacts + 1, Some((i, side)));
    }
}

fn after(machine: &Oscillator, start: &[f64], time: f64) -> State {
    machine.validate().unwrap();
    let (flow, goes_on) = (Flow::new(machine), AtomicBool::new(false));
    state_at(&flow, machine.law(), state(start), time, &goes_on).unwrap().unwrap()
}

fn energy(machine: &Oscillator, state: &[f64]) -> f64 {
    (0..machine.degrees()).map(|i| 0.5 * machine.mass[(i, i)] * state[2 * i + 1].powi(2)).sum()
}

fn momentum(machine: &Oscillator, state: &[f64]) -> f64 {
    (0..machine.degrees()).map(|i| machine.mass[(i, i)] * state[2 * i + 1]).sum()
}

fn assert_near(found: &[f64], exact: &[f64], within: f64, what: &str) {
    assert!(found.iter().zip(exact).all(|(a, b)| near(*a, *b, within)), "{what}: {found:?} but {exact:?}");
}

/// By hand: two masses in a row between two walls.
#[test]
fn two_masses_between_two_walls() {
    let start = [2.0, 1.0, 6.0, -0.5];
    let of = |e: f64| after(&row_of_masses(&[1.0, 2.0], 10.0, e), &start, 20.0);
    assert_near(&of(1.0)[..4], &[14.0 / 3.0, -1.0, 28.0 / 3.0, -0.5], 1e-12, "e = 1");
    assert_near(&of(0.9)[..4], &[7.230_666_666_666_7, -0.729, 9.084_666_666_666_7, 0.3645], 1e-12, "e = 0.9");
}

/// With at most five impacts per unit time, an error of 1e-16 grows to less than 1e-9.
#[test]
fn free_masses_move_straight_from_impact_to_impact() {
    let random = &mut Random(7);
    let mut all = 0;
    for nth in 0..24 {
        let count = 2 + nth % 4;
        let masses: Vec<f64> = (0..count).map(|_| random.logarithmic(0.5, 2.0)).collect();
        let e = if nth % 2 == 0 { 1.0 } else { random.between(0.9, 1.0) };
        let speeds: Vec<f64> = (0..count).map(|_| random.even(1.0)).collect();
        let place = |i: usize| (i as f64 + 0.7) * if nth % 3 == 0 { 1.0 } else { 1.3 };
        let row = row_of_masses(&masses, 1.4 * count as f64, e);
        let gears = ring(&[masses[0], masses[1], 0.8], e);
        let in_row: Vec<f64> = (0..count).flat_map(|i| [place(i), speeds[i]]).collect();
        let in_ring = [0.1, speeds[0], 0.2, speeds[1], -0.1, 0.4];
        for (machine, start) in [(&row, &in_row[..]), (&gears, &in_ring)] {
            let (exact, impacts) = billiard(machine, start, 20.0);
            let found = after(machine, start, 20.0);
            assert_near(&found[..exact.len()], &exact, 1e-8, &format!("{nth}: {impacts} impacts"));
            if e == 1.0 {
                assert!(near(energy(machine, &found), energy(machine, start), 1e-13), "{nth}: energy");
            }
            all += impacts;
        }
        let found = after(&gears, &in_ring, 60.0);
        assert!(near(momentum(&gears, &found), momentum(&gears, &in_ring), 1e-13), "{nth}: momentum");
    }
    assert!(all > 500, "{all} impacts");
}

/// Equal balls in a row, with and without room between them: the speed leaves at the other end.
#[test]
fn a_cradle_passes_the_impulse_on() {
    for count in 2..=6 {
        for room in [0.01, 0.0] {
            let row = |i: usize| -> Vec<f64> {
                (0..count).map(|j| f64::from(i8::from(j == i) - i8::from(j == i + 1))).collect()
            };
            let rows: Vec<Vec<f64>> = (0..count - 1).map(row).collect();
            let rows: Vec<(&[f64], _)> = rows.iter().map(|row| (&row[..], [Some(room), None])).collect();
            let machine = machine(&vec![1.0; count], &rows, 1.0);
            let start: Vec<f64> = (0..count)
                .flat_map(|i| if i == 0 { [-1.0, 1.0] } else { [room * (i - 1) as f64, 0.0] })
                .collect();
            let speeds: Vec<f64> = after(&machine, &start, 3.0).into_iter().skip(1).step_by(2).collect();
            let exact: Vec<f64> = (0..count).map(|i| f64::from(u8::from(i + 1 == count))).collect();
            assert_near(&speeds[..count], &exact, 1e-13, &format!("{count} balls, room {room}"));
        }
    }
}

/// Three gaps that are all closed at rest: the walls share the load in a way that rest does not determine.
#[test]
fn masses_without_room_stay() {
    for load in [[1.0, 2.0], [-1.0, 0.5], [0.0, 0.0], [-2.0, -1.0], [3.0, -3.0]] {
        let mut squeezed = row_of_masses(&[1.0, 2.0], 0.0, 0.5);
        squeezed.stages[0].load = DVector::from_row_slice(&load);
        assert_near(&after(&squeezed, &[0.0; 4], 20.0)[..4], &[0.0; 4], 1e-14, &format!("{load:?}"));
    }
}

/// Two gaps with equal rows are one gap.
#[test]
fn walls_of_equal_rows_are_those_of_one_gap() {
    let one = machine(&[1.5], &[(&[1.0], [Some(1.0), Some(-0.5)])], 0.8);
    let two = machine(&[1.5], &[(&[1.0], [Some(1.0), None]), (&[-2.0], [Some(1.0), None])], 0.8);
    let [one, two] = [one, two].map(|mut machine| {
        machine.stages[0].stiffness[(0, 0)] = 0.3;
        machine.stages[0].load[0] = 0.4;
        after(&machine, &[0.2, 1.0], 30.0)
    });
    assert_near(&two, &one, 1e-12, "after 30");
}

/// A start beyond several rigid walls is put on them, although moving one gap moves those that depend on it.
#[test]
fn a_start_beyond_walls_is_put_on_them() {
    let row = row_of_masses(&[1.0, 2.0], 10.0, 0.5);
    for start in [[-1.0, 12.0], [12.0, -3.0], [11.0, 15.0], [-5.0, -3.0], [4.0, 2.0], [3.0, 5.0]] {
        let placed = row.put_on_walls(&[start[0], 0.0, start[1], 0.0]);
        let [x1, x2] = [placed[0], placed[2]];
        assert!(x1 >= 0.0 && x2 >= x1 && x2 <= 10.0, "{start:?}: {x1} {x2}");
    }
}

/// The impulse of a wall is known although the rates do not determine those of all walls.
#[test]
fn impulses_of_dependent_gaps_are_those_of_the_walls_that_push() {
    let row = row_of_masses(&[1.0, 2.0], 10.0, 0.5);
    let [before, after] = [[4.0, 1.0, 4.0, -1.0], [4.0, -1.0, 4.0, 0.0]].map(|y| state(&y));
    assert!(near(row.gap_impulse(1, [&before, &after]), 2.0, 1e-13));
    // The first mass rests on the wall, which takes the whole impulse.
    let [before, after] = [[0.0, 0.0, 0.0, -1.0], [0.0, 0.0, 0.0, 0.5]].map(|y| state(&y));
    for gap in [0, 1] {
        assert!(near(row.gap_impulse(gap, [&before, &after]), 3.0, 1e-13), "gap {gap}");
    }
}

/// A mass on a belt hits a rigid wall, with another mass on a belt (HAL hal-01716912).
#[test]
fn two_masses_on_belts_and_a_rigid_wall() {
    let mut belts = machine(&[1.0, 1.0], &[(&[0.0, 1.0], [Some(0.6), None])], 1.0);
    belts.stages[0].stiffness = DMatrix::from_row_slice(2, 2, &[2.0, -1.0, -1.0, 1.0]);
    let rows = [[1.0, 0.0], [0.0, 1.0]].map(|row| DVector::from_row_slice(&row));
    belts.friction = rows.map(|row| DryFriction::new(row, 0.5, 0.3)).to_vec();
    let exact = [0.395_925_28, 0.242_009_61, 0.519_691_63, 0.011_938_68];
    assert_near(&after(&belts, &[0.0; 4], 15.0)[..4], &exact, 1e-8, "t = 15");
}

/// Two masses rest on friction and together on a wall: `x1 + x2 <= 0`. They stay while some forces within the limits hold them, so for a
/// load of `l1` and `l2` while `|l1 - l2| <= 2` and a push `N >= 0` with `|l1 - N| <= 1` and `|l2 - N| <= 1` exists.
#[test]
fn friction_and_a_wall_hold_what_some_of_their_forces_can_hold() {
    let rows = [[1.0, 0.0], [0.0, 1.0]].map(|row| DVector::from_row_slice(&row));
    for (load, stays) in [
        ([3.0, 1.5], true),
        ([1.5, 3.0], true),
        ([3.0, 3.0], true),
        ([0.9, -0.9], true),
        ([3.0, 0.9], false),
        ([-1.2, 0.0], false),
        ([-0.9, 1.2], false),
    ] {
        let mut machine = machine(&[1.0, 1.0], &[(&[1.0, 1.0], [Some(0.0), None])], 0.5);
        machine.stages[0].load = DVector::from_row_slice(&load);
        machine.friction = rows.clone().map(|row| DryFriction::new(row, 1.0, 0.0)).to_vec();
        let found = after(&machine, &[0.0; 4], 3.0);
        assert_eq!(found[..4].iter().all(|x| x.abs() < 1e-12), stays, "{load:?}: {found:?}");
        // The load on the first mass grows and shrinks again.
        machine.drives = vec![rattlemap_dynamics::model::Drive {
            order: 1,
            cos: DVector::from_row_slice(&[0.4, 0.0]),
            sin: DVector::zeros(2),
        }];
        let keeps = stays && load != [0.9, -0.9];
        let found = after(&machine, &[0.0; 4], 40.0);
        assert_eq!(found[..4].iter().all(|x| x.abs() < 1e-12), keeps, "{load:?} and a force: {found:?}");
    }
}

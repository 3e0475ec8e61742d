//! Machines: two loose gears on a heavy shaft, a chain between impacts in closed form, harmonics and their phase, restitution that depends
//! on the speed, and the balance of energy.

use crate::common::built_in;
use crate::common::pairs::AsPair;
use nalgebra::{Complex, DMatrix, DVector, Matrix2, RowVector2};
use rattlemap_dynamics::model::Form;

use rattlemap_dynamics::machine::{MachineMotion, System};
use rattlemap_dynamics::model::{
    Contact, Drive, DryFriction, Forces, GapRow, Law, Model, Oscillator, REST, Restitution, Side, Spring,
    State, Timing, Wall, state,
};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{EventKind, GapEvent, Observer, SlipEvent, States};
use rattlemap_dynamics::orbit::{Class, Orbit, Settings, analyse_flow};

use crate::common::apart;
use crate::common::closed_form::{self, Linear, Walled, first_time};
use crate::gallery::ball::{self, bounce};
use crate::gallery::cycle::{eigenvalues, off_the_judge};
use crate::gallery::pieces;

/// Returns the machine of a model in `models/`.
fn machine(name: &str, values: &[(&str, f64)]) -> Oscillator {
    built_in(name, values).oscillator().unwrap()
}

/// An event at a wall, and the states before and after it.
#[derive(Clone, Copy, Debug)]
struct AtWall {
    event: GapEvent,
    before: State,
    after: State,
}

impl std::ops::Deref for AtWall {
    type Target = GapEvent;

    fn deref(&self) -> &GapEvent {
        &self.event
    }
}

/// Events of a machine.
#[derive(Default)]
struct Log {
    events: Vec<AtWall>,
    slips: Vec<SlipEvent>,
}

impl Observer for Log {
    fn event(&mut self, event: &GapEvent, states: States<'_>) {
        let [before, after] = states();
        self.events.push(AtWall { event: *event, before, after });
    }

    fn slip(&mut self, event: &SlipEvent) {
        self.slips.push(*event);
    }
}

/// Two gears with drag on a shaft that hangs on a spring. Their shaft is moved by `-S cos(omega t)`, as long as it does not feel the gears.
struct Gears {
    omega: f64,
    /// Amplitude of the shaft.
    swing: f64,
    oil: f64,
    e: f64,
    mass: [f64; 2],
    drag: [f64; 2],
    backlash: [f64; 2],
}

/// Gap, rate and events (time, kind and side) of a gear alone.
type Alone = ([f64; 2], Vec<(f64, EventKind, usize)>);

/// Square of the natural frequency of the shaft.
const STIFFNESS: f64 = 2e5;

const GEARS: Gears = Gears {
    omega: 190.0,
    swing: 5e-4,
    oil: 1.0,
    e: 0.6,
    mass: [0.3, 0.2],
    drag: [2.0, 1.5],
    backlash: [6e-4, 8e-4],
};

impl Gears {
    /// Returns the whole machine, with a shaft of a given mass.
    fn together(&self, shaft: f64) -> Oscillator {
        let drive = self.swing * (STIFFNESS - self.omega * self.omega) / STIFFNESS;
        // The drive of the file is A sin(omega t).
        self.with(shaft, &[("A", drive), ("c", 0.0)]).at_phase(1.5 * std::f64::consts::PI)
    }

    /// Returns the machine with a shaft of a given mass, and further values.
    fn with(&self, shaft: f64, values: &[(&str, f64)]) -> Oscillator {
        let [m1, m2] = self.mass;
        let [drag1, drag2] = self.drag;
        let [b1, b2] = self.backlash;
        let own = [
            ("omega", self.omega),
            ("M", shaft),
            ("k", STIFFNESS * shaft),
            ("m1", m1),
            ("m2", m2),
            ("drag1", drag1),
            ("drag2", drag2),
            ("oil", self.oil),
            ("b1", b1),
            ("b2", b2),
            ("e", self.e),
        ];
        machine("two-loose-gears", &[&own[..], values].concat())
    }

    /// Returns one gear alone, in closed form.
    fn alone(&self, gear: usize) -> Walled {
        let free = Linear {
            m: self.mass[gear],
            c: self.oil,
            k: 0.0,
            force: self.mass[gear] * self.swing * self.omega * self.omega,
            omega: self.omega,
            load: self.drag[gear],
        };
        let rigid = |at: f64| Some(closed_form::Wall::Rigid { at, e: self.e });
        Walled { free, walls: [rigid(0.0), rigid(-self.backlash[gear])] }
    }

    /// Returns the motions of each gear alone after 1, 2, ... periods, from the state of its gap.
    fn each_alone(&self, periods: u32) -> [Vec<Alone>; 2] {
        [0, 1].map(|gear| (1..=periods).map(|n| self.alone(gear).run(self.starts()[gear], n)).collect())
    }

    /// Returns the gaps and their rates at the start.
    fn starts(&self) -> [[f64; 2]; 2] {
        self.backlash.map(|backlash| [-0.5 * backlash, 0.1 * self.swing * self.omega])
    }
}

/// A stable cycle of a machine, of one forcing period.
pub(crate) struct Cycle {
    pub(crate) what: String,
    pub(crate) machine: Oscillator,
    pub(crate) strobe: State,
    /// Modulus of the largest multiplier.
    pub(crate) radius: f64,
    pub(crate) impacts: f64,
}

/// Mass of a shaft that does not feel the gears, within rounding.
const HEAVY: f64 = 1e16;

/// Returns cycles: each of two loose gears on a heavy shaft that is driven through a spring and a damper, and bounces of a viscoelastic
/// ball.
pub(crate) fn cycles() -> Vec<Cycle> {
    let mut list = Vec::new();
    let cases = [(5e-4, 0.8, [2e-3, 5e-3]), (5e-4, 0.6, [1e-3, 1e-3]), (7e-4, 0.6, [5e-3, 5e-3])];
    for (swing, e, backlash) in cases {
        let gears = Gears { swing, e, backlash, ..GEARS };
        // The shaft moves by -S cos(omega t) where the drive A sin(omega t) has this phase at t = 0.
        let (omega, damping) = (gears.omega, 200.0);
        let drive = Complex::new(STIFFNESS, damping * omega);
        let gain = drive / (drive - omega * omega);
        let phase = 1.5 * std::f64::consts::PI - gain.arg();
        let values = [("c", damping * HEAVY), ("A", swing / gain.norm())];
        let machine = gears.with(HEAVY, &values).at_phase(phase.rem_euclid(std::f64::consts::TAU));
        let mut strobe = state(&[-swing, 0.0]);
        let (mut radius, mut impacts) = ((-0.5 * damping * machine.period()).exp(), 0.0);
        for gear in [0, 1] {
            let walled = gears.alone(gear);
            let walls = [[0.0, e], [-backlash[gear], e]];
            let pieces = pieces::between(&[walled.free.into()], &[0.0], walls);
            let what = format!("gear {gear} at S = {swing}");
            let (oscillator, law) = walled.oscillator();
            let ([z, w], period, end) = pieces.settled(&what, &oscillator, law, gears.starts()[gear]);
            assert_eq!(period, 1, "{what}");
            (strobe[2 * gear + 2], strobe[2 * gear + 3]) = (-swing - z, -w);
            impacts += f64::from(end.impacts);
            radius = radius.max(eigenvalues(end.tangent.transpose().into())[0].norm());
        }
        let what = format!("two loose gears, S = {swing}, e = {e}");
        list.push(Cycle { what, machine, strobe, radius, impacts });
    }
    for (loss, share) in [(0.2, 0.3), (0.3, 0.5), (0.4, 0.9)] {
        let Bounce { shaking, strobe, product, sum, .. } = Bounce::of(loss, share);
        let radius = eigenvalues([[0.0, -product], [1.0, sum]])[0].norm();
        let machine = machine("viscoelastic-ball", &[("A", shaking), ("B", loss)]);
        list.push(Cycle {
            what: format!("viscoelastic ball, B = {loss}"),
            machine,
            strobe,
            radius,
            impacts: 1.0,
        });
    }
    list
}

/// A shaft of finite mass feels the gears, and deviates from its motion in proportion to the inverse of its mass. Times are compared
/// relative to the period, states relative to the backlash and to the speed of the shaft.
#[test]
fn gears_on_a_heavy_shaft_move_as_each_of_them_alone() {
    const PERIODS: usize = 4;
    let alone = GEARS.each_alone(PERIODS as u32);
    let off = |shaft: f64| {
        let system = System::new(&GEARS.together(shaft));
        let ([[z1, w1], [z2, w2]], at) = (GEARS.starts(), -GEARS.swing);
        let mut motion = MachineMotion::new(&system, &[at, 0.0, at - z1, -w1, at - z2, -w2]);
        let (mut log, mut worst) = (Log::default(), [0.0f64; 2]);
        let [first, second] = &alone;
        for alone in first.iter().zip(second) {
            motion.advance_period(&mut log).expect("an ordinary motion");
            let [s, v, x1, v1, x2, v2, ..] = motion.state();
            let ours = [[s - x1, v - v1], [s - x2, v - v2]];
            for (gear, (ours, theirs)) in ours.into_iter().zip([alone.0.0, alone.1.0]).enumerate() {
                let off = (ours[0] - theirs[0]).abs() / GEARS.backlash[gear];
                worst[1] = worst[1].max(off).max((ours[1] - theirs[1]).abs() / (GEARS.swing * GEARS.omega));
            }
        }
        for (gear, alone) in alone.iter().enumerate() {
            let ours: Vec<_> = log.events.iter().filter(|event| event.gap == gear).collect();
            let theirs = &alone[PERIODS - 1].1;
            assert!(ours.len() > 4 && ours.len() == theirs.len(), "{} {}", ours.len(), theirs.len());
            for (ours, theirs) in ours.into_iter().zip(theirs) {
                assert_eq!((ours.kind, ours.side.index()), (theirs.1, theirs.2));
                let t = ours.period as f64 * system.period() + ours.t;
                worst[0] = worst[0].max((t - theirs.0).abs() / system.period());
            }
        }
        worst
    };
    let shafts = [1e4, 1e6, 1e8, 1e10, 1e12];
    let found = shafts.map(off);
    println!("times and states: {found:?}");
    for pair in found.windows(2) {
        for (before, now) in pair[0].into_iter().zip(pair[1]) {
            assert!((before / now / 100.0 - 1.0).abs() < 0.01, "{before:e} {now:e}");
        }
    }
    assert!(found[4][0].max(found[4][1]) < 1e-10);
}

/// While both gears move with the shaft, the mass on its spring is that of all three. The gear with the larger ratio of mass to drag leaves
/// its flank first, where its inertia `m omega^2 S` exceeds its drag.
#[test]
fn the_first_gear_leaves_its_flank_where_its_inertia_exceeds_its_drag() {
    let (k, c, m1, m2, drag): (f64, f64, f64, f64, f64) = (4e5, 200.0, 0.3, 0.2, 2.0);
    for omega in [120.0, 190.0, 310.0] {
        let gain = k.hypot(c * omega) / (k - (2.0 + m1 + m2) * omega * omega).hypot(c * omega);
        let border = drag / (m1 * omega * omega * gain);
        for (share, leaves) in [(1.0 - 1e-9, false), (1.0 + 1e-9, true)] {
            let system = System::new(&machine("two-loose-gears", &[("omega", omega), ("A", share * border)]));
            // The steady motion: the real part of A k / (...) in phase with the drive.
            let re = k - (2.0 + m1 + m2) * omega * omega;
            let drive = nalgebra::Complex::new(c * omega, -k) * (share * border);
            let [at, rate] = {
                let steady = drive / nalgebra::Complex::new(re, c * omega);
                [steady.re, -omega * steady.im]
            };
            let mut motion = MachineMotion::new(&system, &[at, rate, at, rate, at, rate]);
            let mut log = Log::default();
            (0..3).for_each(|_| motion.advance_period(&mut log).unwrap());
            let left = log.events.iter().any(|event| event.kind == EventKind::MeshEnd);
            assert_eq!(left, leaves, "omega = {omega}, A = {share} times {border}: {:?}", log.events.len());
        }
    }
}

/// A chain of masses in its normal modes, and a free ball.
struct Chain {
    /// Normal modes as columns, and the squares of their frequencies.
    modes: DMatrix<f64>,
    squares: DVector<f64>,
    mass: f64,
    /// Damping over stiffness.
    damping: f64,
    force: f64,
    omega: f64,
}

/// Masses of the chain.
const LINKS: usize = 7;

const CHAIN: [(&str, f64); 7] =
    [("m", 1.3), ("k", 0.9), ("c", 0.018), ("mb", 0.2), ("F", 0.05), ("omega", 0.2), ("d", 1.0)];

impl Chain {
    fn new() -> Chain {
        let [mass, k, c, _, force, omega, _] = CHAIN.map(|(_, value)| value);
        let stiffness = DMatrix::from_fn(LINKS, LINKS, |i, j| match i.abs_diff(j) {
            0 if i == LINKS - 1 => k,
            0 => 2.0 * k,
            1 => -k,
            _ => 0.0,
        });
        let eigen = (stiffness / mass).symmetric_eigen();
        Chain { modes: eigen.eigenvectors, squares: eigen.eigenvalues, mass, damping: c / k, force, omega }
    }

    /// Returns the state a time `tau` after the state `y` at time `t`, without impacts.
    fn after(&self, t: f64, y: &State, tau: f64) -> State {
        let [x, v] = [0, 1].map(|part| DVector::from_fn(LINKS, |i, _| y[2 * i + part]));
        let [mut p, mut q] = [&x, &v].map(|vector| self.modes.transpose() * vector);
        for j in 0..LINKS {
            let square = self.squares[j];
            let mode = Linear {
                m: 1.0,
                c: self.damping * square,
                k: square,
                force: self.modes[(0, j)] * self.force / self.mass,
                omega: self.omega,
                load: 0.0,
            };
            [p[j], q[j]] = mode.after(t, [p[j], q[j]], tau);
        }
        let (x, v) = (&self.modes * p, &self.modes * q);
        let mut end = *y;
        for i in 0..LINKS {
            (end[2 * i], end[2 * i + 1]) = (x[i], v[i]);
        }
        end[2 * LINKS] += tau * y[2 * LINKS + 1];
        end
    }

    /// Follows the motion from phase 0 over so many periods. Returns the last state and the number of impacts.
    fn run(&self, start: &State, periods: u32) -> (State, u32) {
        let (period, ball, e) = (std::f64::consts::TAU / self.omega, 0.2, 0.7);
        let h = period / PLACES as f64;
        let gap = |y: &State| y[2 * LINKS] - y[2 * LINKS - 2];
        let is_outside = |y: &State| gap(y).abs() > 0.5;
        let (mut y, mut impacts) = (*start, 0);
        for _ in 0..periods {
            let mut t = 0.0;
            loop {
                let hits = |tau: f64| is_outside(&self.after(t, &y, tau));
                let Some(flown) = first_time(h, period - t, hits) else {
                    y = self.after(t, &y, period - t);
                    break;
                };
                y = self.after(t, &y, flown);
                t += flown;
                y[2 * LINKS] = y[2 * LINKS - 2] + gap(&y).clamp(-0.5, 0.5);
                let rate = y[2 * LINKS + 1] - y[2 * LINKS - 1];
                let impulse = -(1.0 + e) * rate / (1.0 / self.mass + 1.0 / ball);
                y[2 * LINKS - 1] -= impulse / self.mass;
                y[2 * LINKS + 1] += impulse / ball;
                impacts += 1;
            }
        }
        (y, impacts)
    }
}

/// Instants per period at which the chain's gap is compared with its walls.
const PLACES: usize = 4000;

/// Returns a chain, the state at the start, and state and number of impacts after so many periods.
pub(crate) fn chain(periods: u32) -> (Oscillator, State, State, u32) {
    let start = std::array::from_fn(|i| 0.1 * (1.0 + 3.7 * i as f64).sin() * if i < 14 { 1.0 } else { 0.01 });
    let (end, impacts) = Chain::new().run(&start, periods);
    (machine("absorber-chain", &CHAIN), start, end, impacts)
}

#[test]
fn a_chain_moves_in_its_normal_modes_until_the_ball_hits_it() {
    let (machine_of_chain, start, end, _) = chain(8);
    let (chain, system) = (Chain::new(), System::new(&machine_of_chain));
    let free = System::new(&{
        let mut wide = machine("absorber-chain", &CHAIN);
        wide.gaps[0].walls.iter_mut().flatten().for_each(|wall| wall.at *= 100.0);
        wide
    });
    let mut motion = MachineMotion::new(&free, &start);
    let mut log = Log::default();
    motion.advance_period(&mut log).unwrap();
    let off = apart(motion.state(), chain.after(0.0, &start, free.period()));
    println!("one period without impacts: {off:.1e}");
    assert!(log.events.is_empty() && off < 1e-12, "{off:e}");

    let (m, mb, e) = (1.3, 0.2, 0.7);
    let reduced = m * mb / (m + mb);
    let mut motion = MachineMotion::new(&system, &start);
    motion.set_tangents(MachineMotion::unit_tangents(&system));
    let (mut from, mut at) = ((0u64, 0.0), start);
    let (mut worst, mut impacts) = ([0.0f64; 4], 0);
    for period in 0..40u64 {
        let mut log = Log::default();
        motion.advance_period(&mut log).unwrap();
        for event in log.events {
            let flown = (event.period - from.0) as f64 * system.period() + event.t - from.1;
            worst[0] = worst[0].max(apart(event.before, chain.after(from.1, &at, flown)));
            // The ball stays in the slot.
            for share in 1..20 {
                let y = chain.after(from.1, &at, flown * f64::from(share) / 20.0);
                assert!((y[14] - y[12]).abs() <= 0.5 + 1e-12, "{event:?}");
            }
            assert!((event.before[14] - event.before[12]).abs() - 0.5 < 1e-14);
            let [[v, b], [v_after, b_after]] = [event.before, event.after].map(|y| [y[13], y[15]]);
            let others =
                (0..16).filter(|i| ![13, 15].contains(i)).map(|i| (event.before[i] - event.after[i]).abs());
            worst[1] = others.fold(worst[1], f64::max);
            let momentum = m * (v_after - v) + mb * (b_after - b);
            worst[2] = worst[2].max(momentum.abs() / (mb * (b_after - b)).abs());
            let lost = 0.5 * (m * (v * v - v_after * v_after) + mb * (b * b - b_after * b_after));
            let expected = 0.5 * (1.0 - e * e) * reduced * (v - b).powi(2);
            let size = 0.5 * (m * v * v + mb * b * b);
            worst[3] = worst[3].max((lost - expected).abs() / size);
            impacts += 1;
            (from, at) = ((event.period, event.t), event.after);
        }
        // Restart at phase 0, so that no time is long.
        let flown = (period + 1 - from.0) as f64 * system.period() - from.1;
        worst[0] = worst[0].max(apart(motion.state(), chain.after(from.1, &at, flown)));
        (from, at) = ((period + 1, 0.0), motion.state());
        if period == 7 {
            // Impacts amplify rounding errors of the ball's position.
            let (off, amplification) = (apart(at, end), motion.derivative().amax());
            assert!(
                off < 1e-13 * amplification,
                "after 8 periods: {off:e}, amplified {amplification:e} times"
            );
        }
    }
    println!("{impacts} impacts: flights, other velocities, momentum, energy {worst:?}");
    assert!(impacts > 20 && worst.into_iter().all(|off| off < 1e-12), "{impacts} {worst:?}");
}

/// The turbine gears, flight by flight, against an integrator that shares no code with the engine.
#[test]
fn turbine_gears_with_three_harmonics_agree_with_the_integrator() {
    for (omega, load) in [(2e4, 3800.0), (4e4, 800.0), (6e4, 300.0), (9e4, 100.0)] {
        let model = built_in("turbine-gears", &[("omega", omega), ("T", load)]);
        let (oscillator, law) = (model.pair(), model.law());
        // In units of the half backlash and of the time, as the tolerances of the integrator are.
        let start = state(&[1.2e-4, 0.0]);
        let off = off_the_judge(&oscillator, law, start, 3);
        println!("omega = {omega}, T = {load}: {off:.1e}");
        assert!(off < 1e-9, "{off:e}");
    }
}

/// Three masses in a row with a stop, three harmonics with cosine and sine, and two stages. `phase` is the phase of the force at the start.
fn row_of_three(phase: f64) -> Oscillator {
    let matrix = |entries: [f64; 9]| DMatrix::from_row_slice(3, 3, &entries);
    let stage = |k: f64| Forces {
        damping: matrix([0.1, -0.05, 0.0, -0.05, 0.1, -0.05, 0.0, -0.05, 0.1]),
        stiffness: matrix([1.0 + k, -k, 0.0, -k, 2.0 * k, -k, 0.0, -k, k + 0.3]),
        load: DVector::from_vec(vec![0.1, 0.0, 0.05]),
    };
    let harmonic = |order: u32, [a, b]: [f64; 2], [c, d]: [f64; 2]| {
        // a cos(n (w t + phase)) + b sin(n (w t + phase)) on the first mass, and c and d on the third one.
        let (sin, cos) = (f64::from(order) * phase).sin_cos();
        Drive {
            order,
            cos: DVector::from_vec(vec![a * cos + b * sin, 0.0, c * cos + d * sin]),
            sin: DVector::from_vec(vec![b * cos - a * sin, 0.0, d * cos - c * sin]),
        }
    };
    // Stage 1 from phase 0.2 to phase 0.7.
    let turns = phase / std::f64::consts::TAU;
    let mut schedule =
        [(0.2, 1), (0.7, 0)].map(|(at, stage): (f64, usize)| ((at - turns).rem_euclid(1.0), stage));
    schedule.sort_by(|a, b| a.0.total_cmp(&b.0));
    let wall = |at: f64, e: f64| Wall {
        at,
        contact: Contact::Rigid,
        restitution: Restitution::Constant(e),
        mesh_speed: 0.0,
        springs: vec![Spring::default(); 2],
    };
    let gap = |row: [f64; 3], right: f64| GapRow {
        row: DVector::from_row_slice(&row),
        walls: [vec![wall(right, 0.6)], vec![wall(-0.4, 0.5)]],
    };
    Oscillator {
        omega: 1.3,
        mass: DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 0.5, 0.8])),
        stages: vec![stage(1.0), stage(0.6)],
        schedule: schedule.to_vec(),
        drives: vec![
            harmonic(1, [0.7, 0.4], [0.0, 0.2]),
            harmonic(2, [-0.2, 0.3], [0.1, 0.0]),
            harmonic(5, [0.1, -0.15], [0.2, 0.25]),
        ],
        gaps: vec![gap([1.0, -1.0, 0.0], 0.3), gap([0.0, 1.0, -1.0], 0.5)],
        friction: Vec::new(),
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    }
}

/// Cosine and sine of several harmonics turn by multiples of the phase. The motion is the same, from another instant on.
#[test]
fn another_phase_of_all_harmonics_is_another_instant_of_the_same_motion() {
    let system = System::new(&row_of_three(0.0));
    for phase in [0.7, 1.9, 4.4] {
        let by_hand = row_of_three(phase);
        let turned = row_of_three(0.0).at_phase(phase);
        for (ours, theirs) in turned.drives.iter().zip(&by_hand.drives) {
            assert!((&ours.cos - &theirs.cos).amax().max((&ours.sin - &theirs.sin).amax()) < 1e-15);
        }
        let time = phase / row_of_three(0.0).omega;
        let mut motion = MachineMotion::new(&system, &REST);
        motion.set_tangents(MachineMotion::unit_tangents(&system));
        let mut log = Log::default();
        motion.advance_to(time, &mut log).unwrap();
        let later = motion.state();
        for shifted in [by_hand, turned] {
            let shifted = System::new(&shifted);
            let (mut whole, mut other) = (motion.clone(), MachineMotion::new(&shifted, &later));
            whole.set_tangents(MachineMotion::unit_tangents(&system));
            other.set_tangents(MachineMotion::unit_tangents(&shifted));
            let [mut ours, mut theirs] = [Log::default(), Log::default()];
            for _ in 0..3 {
                whole.advance_period(&mut ours).unwrap();
                whole.advance_to(time, &mut ours).unwrap();
                other.advance_period(&mut theirs).unwrap();
            }
            let kinds = |log: &Log| log.events.iter().map(|e| (e.gap, e.kind, e.side)).collect::<Vec<_>>();
            assert!(ours.events.len() > 10 && kinds(&ours) == kinds(&theirs), "{:?}", kinds(&ours));
            let off = apart(whole.state(), other.state());
            let (a, b) = (whole.derivative(), other.derivative());
            let derivative = (&a - &b).amax() / a.amax();
            println!(
                "phase {phase}: {} events, states {off:.1e}, tangents {derivative:.1e}",
                ours.events.len()
            );
            assert!(off < 1e-12 && derivative < 1e-11, "{off:e} {derivative:e}");
        }
    }
}

/// Multipliers of the cycle do not depend on the phase at which it is cut.
#[test]
fn cycles_have_the_same_multipliers_at_every_phase() {
    let orbit = |machine: Oscillator, start: State| -> Orbit {
        let flow = Flow::new(Form::Machine(machine));
        analyse_flow(&flow, Law::both(0.0, 0.0), start, &Settings::default(), 8)
    };
    let at = |phase: f64| Oscillator { omega: 2.1, ..row_of_three(phase) };
    let first = orbit(at(0.0), REST);
    let Class::Periodic { period } = first.class else { panic!("{:?} {:?}", first.class, first.status) };
    let phase = 1.9;
    let other = orbit(at(phase), first.strobe);
    assert_eq!(other.class, first.class);
    let system = System::new(&at(0.0));
    let mut motion = MachineMotion::new(&system, &first.strobe);
    let off = (0..period).map(|_| {
        let mut later = motion.clone();
        later.advance_to(phase / 2.1, &mut ()).unwrap();
        motion.advance_period(&mut ()).unwrap();
        apart(later.state(), other.strobe)
    });
    let off = off.fold(f64::INFINITY, f64::min);
    let size =
        |orbit: &Orbit| orbit.floquet.as_ref().unwrap().iter().map(|m| m[0].hypot(m[1])).collect::<Vec<_>>();
    let (ours, theirs) = (size(&first), size(&other));
    println!(
        "period {period}: {} events, states {off:.1e}, multipliers {ours:.3?} {theirs:.3?}",
        first.events.len()
    );
    assert!(off < 1e-11, "{off:e}");
    assert!(ours.iter().zip(&theirs).all(|(a, b)| (a - b).abs() < 1e-10), "{ours:?} {theirs:?}");
}

/// Gravity of the balls below.
const GRAVITY: f64 = 9.81;

/// A ball over a floor at 0.
fn dropped(restitution: Restitution) -> Oscillator {
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    let wall = Wall {
        at: 0.0,
        contact: Contact::Rigid,
        restitution,
        mesh_speed: 0.0,
        springs: vec![Spring::default()],
    };
    Oscillator {
        omega: 1.0,
        mass: one(0.7),
        stages: vec![Forces {
            damping: one(0.0),
            stiffness: one(0.0),
            load: DVector::from_element(1, -0.7 * GRAVITY),
        }],
        schedule: Vec::new(),
        drives: Vec::new(),
        gaps: vec![GapRow { row: DVector::from_element(1, 1.0), walls: [Vec::new(), vec![wall]] }],
        friction: Vec::new(),
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    }
}

/// Each impact speed is `e(u) u` of the one before, and its derivative is `e + e' u`. Both follow from the start in closed form: the ball
/// that leaves at `t` with `u` is at `u (T - t) - g (T - t)^2/2` at the end T.
#[test]
fn impact_speeds_follow_the_law_of_restitution() {
    let laws = [(0.9, -0.05, 1.0), (1.0, -0.1, 0.2), (0.5, 0.08, 0.5), (0.95, -0.01, 1.7), (0.8, 0.0, 1.0)];
    for (constant, factor, power) in laws {
        let system = System::new(&dropped(Restitution::BySpeed { constant, factor, power }));
        let e = |u: f64| constant + factor * u.powf(power);
        let slope = |u: f64| e(u) + factor * power * u.powf(power);
        for start in [[2.0, 0.0], [0.3, 1.5], [5.0, -3.0]] {
            let mut motion = MachineMotion::new(&system, &start);
            motion.set_tangents(MachineMotion::unit_tangents(&system));
            let [x, v] = start;
            let mut u = v.hypot((2.0 * GRAVITY * x).sqrt());
            let mut t = (v + u) / GRAVITY;
            // Derivatives of u and t by the start.
            let mut du = RowVector2::new(GRAVITY / u, v / u);
            let mut dt = (RowVector2::new(0.0, 1.0) + du) / GRAVITY;
            // In the middle of the flight after four impacts.
            let mut speeds = [u; 5];
            (1..5).for_each(|n| speeds[n] = e(speeds[n - 1]) * speeds[n - 1]);
            let end = t + (2.0 * speeds[1..4].iter().sum::<f64>() + speeds[4]) / GRAVITY;
            let mut log = Log::default();
            motion.advance_to(end, &mut log).unwrap();
            assert_eq!(log.events.len(), 4);
            for event in &log.events {
                assert_eq!(event.kind, EventKind::Impact);
                assert!(
                    (event.event.before[1].abs() / u - 1.0).abs() < 1e-12
                        && (event.t - t).abs() < 1e-12 * end
                );
                du *= slope(u);
                u *= e(u);
                assert!((event.event.after[1] / u - 1.0).abs() < 1e-12, "{event:?}");
                // At the next impact.
                dt += du * (2.0 / GRAVITY);
                t += 2.0 * u / GRAVITY;
            }
            // Back to the last impact.
            t -= 2.0 * u / GRAVITY;
            dt -= du * (2.0 / GRAVITY);
            let s = end - t;
            let now = [u * s - 0.5 * GRAVITY * s * s, u - GRAVITY * s];
            let off = apart(motion.state(), state(&now));
            let of_x = du * s - dt * now[1];
            let of_v = du + dt * GRAVITY;
            let expected = Matrix2::from_rows(&[of_x, of_v]);
            let tangents = motion.derivative();
            let apart = Matrix2::from_fn(|i, j| tangents[(i, j)] - expected[(i, j)]).amax() / expected.amax();
            println!("{constant} {factor} {power}: state {off:.1e}, tangents {apart:.1e}");
            assert!(off < 1e-11 && apart < 1e-11, "{off:e} {apart:e}");
        }
    }
}

/// The coefficient is limited to `[0, 1]`.
#[test]
fn restitution_by_speed_is_limited() {
    // Above 1: no energy is gained. Below 0: the ball stays on the floor.
    for (constant, factor, keeps) in [(0.9, 0.5, true), (0.5, -0.2, false)] {
        let system = System::new(&dropped(Restitution::BySpeed { constant, factor, power: 1.0 }));
        let mut motion = MachineMotion::new(&system, &[2.0, 0.0]);
        motion.set_tangents(MachineMotion::unit_tangents(&system));
        let u = (4.0 * GRAVITY).sqrt();
        let mut log = Log::default();
        motion.advance_to(1.2 * u / GRAVITY, &mut log).unwrap();
        let [x, v, ..] = motion.state();
        if keeps {
            assert_eq!(log.events.len(), 1);
            let energy = 0.5 * v * v + GRAVITY * x;
            assert!((energy / (2.0 * GRAVITY) - 1.0).abs() < 1e-13, "{energy}");
            // The speed after the impact grows like the one before it.
            let gradient = RowVector2::new(GRAVITY, v) * Matrix2::from_fn(|i, j| motion.derivative()[(i, j)]);
            assert!((gradient - RowVector2::new(GRAVITY, 0.0)).amax() < 1e-11, "{gradient}");
        } else {
            assert_eq!([x, v], [0.0; 2]);
            assert_eq!(motion.contact(0), Some(Side::Left));
            assert!(motion.derivative().amax() == 0.0);
        }
    }
}

/// The orbit of one bounce per period needs the approach speed `w = T/(1 + e(w))`. Its multipliers have the product `e s` and the sum
/// `-(e + s) - (1 + e)(1 + s)(G cos(phi) - 1)`, with the derivative `s = e + e' w` of the leaving speed. Without dependence on the speed
/// this is the sum in `ball.rs`.
struct Bounce {
    /// Acceleration of the table in units of gravity.
    shaking: f64,
    strobe: State,
    approach: f64,
    /// Product and sum of the multipliers.
    product: f64,
    sum: f64,
}

impl Bounce {
    /// Returns the orbit for a loss `1 - e(1)`, at a share of the range of accelerations in which it is stable with constant restitution.
    fn of(loss: f64, share: f64) -> Bounce {
        let e = |w: f64| 1.0 - loss * w.powf(0.2);
        let w = (0..200).fold(4.0, |w, _| 0.5 * (w + std::f64::consts::TAU / (1.0 + e(w))));
        let (e, slope) = (e(w), e(w) - 0.2 * loss * w.powf(0.2));
        let [fold, doubles] = ball::window(e);
        let shaking = fold + share * (doubles - fold);
        // The phase of the impact has a negative sine.
        let downwards = shaking * (1.0 - (fold / shaking).powi(2)).sqrt() - 1.0;
        let sum = -(e + slope) - (1.0 + e) * (1.0 + slope) * downwards;
        Bounce { shaking, strobe: bounce(shaking, e).0, approach: w, product: e * slope, sum }
    }
}

#[test]
fn a_viscoelastic_ball_bounces_once_per_period_in_closed_form() {
    for (loss, share) in [(0.2, 0.3), (0.3, 0.5), (0.4, 0.5), (0.4, 0.9), (0.5, 0.2)] {
        let Bounce { shaking, strobe, approach, product, sum } = Bounce::of(loss, share);
        let system = System::new(&machine("viscoelastic-ball", &[("A", shaking), ("B", loss)]));
        let mut motion = MachineMotion::new(&system, &strobe);
        motion.set_tangents(MachineMotion::unit_tangents(&system));
        let mut log = Log::default();
        motion.advance_period(&mut log).unwrap();
        let [event] = log.events[..] else { panic!("{:?}", log.events) };
        let off = apart(motion.state(), strobe);
        let matrix = motion.derivative();
        let (trace, det) = (matrix.trace() - sum, matrix.determinant() - product);
        println!("B = {loss}: state {off:.1e}, multipliers {:.1e}", trace.abs().max(det.abs()));
        assert!(off < 1e-12 && trace.abs().max(det.abs()) < 1e-12, "{off:e} {trace:e} {det:e}");
        assert!((event.event.before[1] + approach).abs() < 1e-12);
    }
}

/// Nodes in `(0, 1)` and weights of the Gauss-Legendre quadrature with six nodes on `[-1, 1]`; the other half is symmetric.
const GAUSS: [(f64, f64); 3] = [
    (0.238_619_186_083_196_9, 0.467_913_934_572_691),
    (0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (0.932_469_514_203_152, 0.171_324_492_379_170_36),
];

/// The shaft reaches its cycle after few periods.
const SHORT: Settings = Settings { transient_periods: 100, observed_periods: 32, max_period: 8 };

/// Pieces per period in which the power of the force is integrated.
const PIECES: usize = 60;

/// The force does the work that dampers, friction and contacts take. Its power is integrated here, between the instants at which velocity
/// or acceleration jump.
#[test]
fn the_work_of_the_force_is_what_dampers_friction_and_impacts_take() {
    let mut seen = [0; 3];
    for (omega, swing, friction) in
        [(190.0, 4e-4, 0.5), (150.0, 4e-4, 1.0), (250.0, 3e-4, 0.3), (120.0, 6e-4, 2.0)]
    {
        let mut machine = machine("two-loose-gears", &[("omega", omega), ("A", swing), ("e", 0.6)]);
        machine.friction = vec![DryFriction::new(DVector::from_vec(vec![0.0, 1.0, 0.0]), friction, 0.0)];
        let flow = Flow::new(Form::Machine(machine.clone()));
        let orbit = analyse_flow(&flow, Law::both(0.0, 0.0), REST, &SHORT, 8);
        let Class::Periodic { period } = orbit.class else { panic!("{:?} {:?}", orbit.class, orbit.status) };
        let of = orbit.quantities.expect("measured");
        let taken = [of.dissipated, of.impact_energy, of.friction.unwrap().dissipated];
        let system = System::new(&machine);
        let mut motion = MachineMotion::new(&system, &orbit.strobe);
        let mut work = 0.0;
        for _ in 0..period {
            let mut log = Log::default();
            let mut sampled = motion.clone();
            motion.advance_period(&mut log).unwrap();
            let even = (0..=PIECES).map(|i| i as f64 / PIECES as f64 * system.period());
            let events = log.events.iter().map(|event| event.t).chain(log.slips.iter().map(|slip| slip.t));
            let mut ends: Vec<f64> = even.chain(events).collect();
            ends.sort_by(f64::total_cmp);
            for piece in ends.windows(2).filter(|piece| piece[1] > piece[0]) {
                let (middle, half) = (0.5 * (piece[0] + piece[1]), 0.5 * (piece[1] - piece[0]));
                let left = GAUSS.iter().rev().map(|&(node, weight)| (-node, weight));
                for (node, weight) in left.chain(GAUSS) {
                    let t = middle + half * node;
                    sampled.advance_to(t.max(sampled.time_in_period()), &mut ()).unwrap();
                    let drive = &machine.drives[0];
                    let (sin, cos) = (omega * t).sin_cos();
                    let y = sampled.state();
                    work += weight
                        * half
                        * (0..3)
                            .map(|i| (drive.cos[i] * cos + drive.sin[i] * sin) * y[2 * i + 1])
                            .sum::<f64>();
                }
            }
        }
        let power = work / (f64::from(period) * system.period());
        let off = (power - taken.iter().sum::<f64>()).abs() / power;
        println!(
            "{omega}: period {period}, {} events, {power:.6} = {taken:.6?} to {off:.1e}",
            orbit.events.len()
        );
        assert!(off < 1e-8, "{off:e}");
        (0..3).filter(|&i| taken[i] > 0.01 * power).for_each(|i| seen[i] += 1);
    }
    assert!(seen.iter().all(|&count| count > 1), "{seen:?}");
}

//! scratch
use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::*;
use rattlemap_dynamics::reference::Trajectory;
use rattlemap_dynamics::reference::machine::{Motion, System};
use std::time::Instant;

fn chain(n: usize, gaps: usize, harmonics: u32, stages: usize, omega: f64, e: f64) -> Machine {
    let mass = DMatrix::identity(n, n);
    let mut k = DMatrix::zeros(n, n);
    for i in 0..n {
        k[(i, i)] += 1.0;
        if i + 1 < n {
            k[(i, i)] += 1.0;
            k[(i + 1, i + 1)] += 1.0;
            k[(i, i + 1)] -= 1.0;
            k[(i + 1, i)] -= 1.0;
        }
    }
    let c = &k * 0.05;
    let forces = |s: f64| Forces { damping: c.clone(), stiffness: &k * s, load: DVector::zeros(n) };
    let wall = |at: f64| Wall {
        at,
        contact: Contact::Rigid,
        restitution: Restitution::constant(e),
        springs: vec![Spring::default(); stages],
        mesh_speed: 0.0,
    };
    Machine {
        mass,
        stages: (0..stages).map(|s| forces(1.0 + 0.2 * s as f64)).collect(),
        schedule: if stages > 1 {
            (0..stages).map(|s| (s as f64 / stages as f64, s)).collect()
        } else {
            vec![]
        },
        omega,
        drives: (1..=harmonics)
            .map(|order| Drive {
                order,
                cos: DVector::from_element(n, 0.5 / f64::from(order * order)),
                sin: DVector::zeros(n),
            })
            .collect(),
        gaps: (0..gaps)
            .map(|g| GapRow {
                row: DVector::from_fn(n, |i, _| f64::from(u8::from(i == g * (n / gaps)))),
                walls: [vec![wall(0.4)], vec![wall(-0.4)]],
            })
            .collect(),
        friction: vec![],
    }
}

fn time(name: &str, machines: &[Machine], tangents: bool) {
    if std::env::args().nth(1).is_some_and(|only| only != name) {
        return;
    }
    let systems: Vec<System> = machines.iter().map(System::new).collect();
    let mut best = f64::INFINITY;
    let mut events = 0;
    let mut steps = 0;
    let mut sum = 0.0;
    let mut periods = 0;
    for _ in 0..3 {
        events = 0;
        steps = 0;
        sum = 0.0;
        periods = 0;
        let start = Instant::now();
        for system in &systems {
            let mut m = Motion::new(system, &[0.0; 16]);
            if tangents {
                m.set_tangents(Motion::unit_tangents(system));
            }
            for _ in 0..200 {
                if m.advance_period(&mut ()).is_err() {
                    break;
                }
                periods += 1;
            }
            events += m.work().events;
            steps += m.work().steps;
            sum += m.state().iter().sum::<f64>();
        }
        best = best.min(start.elapsed().as_secs_f64());
    }
    println!(
        "{name:<40} {:8.2} us/period {:6.2} events {:6.2} steps per period, {:6.2} us/step  sum {sum:.12}",
        1e6 * best / periods as f64,
        events as f64 / periods as f64,
        steps as f64 / periods as f64,
        1e6 * best / steps as f64
    );
}

fn main() {
    if std::env::args().nth(1).as_deref() == Some("friction") {
        return friction();
    }
    let only = std::env::args().nth(1);
    let grid: Vec<(f64, f64)> =
        (0..25).map(|i| (4.5 + 7.5 * f64::from(i % 5) / 4.0, 0.2 + 0.7 * f64::from(i / 5) / 4.0)).collect();
    let pairs: Vec<(Oscillator, Law)> = grid
        .iter()
        .map(|&(omega, e)| {
            let p = GearPair { omega, ..GearPair::paper(e) };
            (p.oscillator().unwrap(), p.law())
        })
        .collect();
    let start = Instant::now();
    let mut sum = 0.0;
    for (o, law) in &pairs {
        let flow = Flow::new(o);
        let mut t: Trajectory<'_, 0> = Trajectory::new(&flow, *law, REST);
        for _ in 0..200 {
            t.advance_period(&mut ()).unwrap();
        }
        sum += t.state().iter().sum::<f64>();
    }
    println!("tuned {:.2} us/period sum {sum:.9}", start.elapsed().as_secs_f64() * 1e6 / 5000.0);
    let machines: Vec<Machine> = pairs.iter().map(|(o, l)| Machine::of(o, *l)).collect();
    for tangents in [false, true] {
        time(if tangents { "gear pair, tangents" } else { "gear pair" }, &machines, tangents);
        for (n, g, h, s) in [(2, 1, 1, 1), (4, 2, 2, 1), (4, 2, 4, 2), (8, 3, 4, 2)] {
            let ms: Vec<Machine> = grid.iter().map(|&(omega, e)| chain(n, g, h, s, omega / 6.0, e)).collect();
            time(
                &format!(
                    "{n} coordinates {g} gaps {h} harm {s} stages{}",
                    if tangents { ", tangents" } else { "" }
                ),
                &ms,
                tangents,
            );
        }
    }
}
#[allow(dead_code)]
fn friction() {
    let grid: Vec<(f64, f64)> =
        (0..25).map(|i| (0.3 + 1.2 * f64::from(i % 5) / 4.0, 0.1 + 0.7 * f64::from(i / 5) / 4.0)).collect();
    for walls in [false, true] {
        let pairs: Vec<(Oscillator, Law)> = grid
            .iter()
            .map(|&(omega, f)| {
                let mut o = GearPair { omega, ..GearPair::paper(0.5) }.oscillator().unwrap();
                o.degrees = 1;
                o.mass = [[1.0, 0.0], [0.0, 1.0]];
                o.gap = [1.0, 0.0];
                o.free.damping = [[0.0; 2]; 2];
                o.free.stiffness = [[1.0, 0.0], [0.0, 1.0]];
                o.free.load = [0.0; 2];
                o.force = [1.0, 0.0];
                o.walls = if walls { [1.5, -1.0] } else { [1e300, -1e300] };
                if !walls {
                    o.walls = [f64::INFINITY, f64::NEG_INFINITY];
                }
                o.contacts = [Contact::Rigid; 2];
                o.meshing = [o.free; 2];
                o.friction = vec![Friction { row: [1.0, 0.0], force: f, speed: 0.0 }];
                (o, Law::both(0.5, 0.0))
            })
            .collect();
        let time = |flows: &[(Flow, Law)]| {
            let mut best = f64::INFINITY;
            let mut w = (0, 0);
            let mut sum = 0.0;
            for _ in 0..3 {
                let start = Instant::now();
                sum = 0.0;
                w = (0, 0);
                for (flow, law) in flows {
                    let mut t: Trajectory<'_, 0> = Trajectory::new(flow, *law, state(&[0.1]));
                    for _ in 0..200 {
                        let _ = t.advance_period(&mut ());
                    }
                    w.0 += t.work().events;
                    w.1 += t.work().steps;
                    sum += t.state().iter().sum::<f64>();
                }
                best = best.min(start.elapsed().as_secs_f64());
            }
            println!(
                "{:.3} us/period {:.2} events {:.2} steps sum {sum:.10}",
                best * 1e6 / 5000.0,
                w.0 as f64 / 5000.0,
                w.1 as f64 / 5000.0
            );
        };
        let flows: Vec<(Flow, Law)> = pairs.iter().map(|(o, l)| (Flow::new(o), *l)).collect();
        let machines: Vec<(Flow, Law)> =
            pairs.iter().map(|(o, l)| (Flow::new(&Oscillator::of_machine(Machine::of(o, *l))), *l)).collect();
        for _ in 0..2 {
            time(&flows);
            time(&machines);
        }
    }
}

//! Signals and forces along a motion: equations of motion, identities between averages, and the balance of energy.

use rattlemap::model_file::FileModel;
use rattlemap::store::in_memory::trajectory;
use rattlemap_dynamics::model::{MOST_SIGNALS, Model, Oscillator, REST};
use rattlemap_dynamics::orbit::{
    Class, Orbit, Quantities, Settings, analyse, place_of_displacement, place_of_gap, place_of_signal,
};

const QUARTER_CAR: &str = include_str!("data/quarter_car.toml");

/// Returns a model with further lines at its end.
fn with(text: &str, lines: &str) -> FileModel {
    FileModel::parse(&format!("{text}\n{lines}"), "model.toml").unwrap()
}

/// Returns a `[[signal]]` for the acceleration of each of the first coordinates.
fn accelerations(oscillator: &Oscillator) -> String {
    let unit =
        |i: usize| (0..oscillator.degrees()).map(|j| i32::from(i == j).to_string()).collect::<Vec<_>>();
    let one = |i: usize| {
        format!("[[signal]]\nname = 'acceleration_{i}'\nacceleration = [{}]\n", unit(i).join(", "))
    };
    (0..oscillator.degrees().min(MOST_SIGNALS)).map(one).collect()
}

fn orbit(model: &dyn Model) -> Orbit {
    let settings = Settings { transient_periods: 200, observed_periods: 64, max_period: 16 };
    analyse(model, REST, &settings).unwrap()
}

fn is_periodic(orbit: &Orbit) -> bool {
    matches!(orbit.class, Class::Periodic { .. })
}

/// The rows of `trajectory.csv`, read by the names of columns.
struct Rows {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Rows {
    fn of(model: &dyn Model, orbit: &Orbit) -> Rows {
        let text = trajectory(model, orbit, 50).unwrap();
        let mut table = csv::Reader::from_reader(text.as_bytes());
        let own = |record: &csv::StringRecord| record.iter().map(str::to_owned).collect::<Vec<_>>();
        let names = own(table.headers().unwrap());
        Rows { names, rows: table.records().map(|record| own(&record.unwrap())).collect() }
    }

    fn text(&self, row: usize, name: &str) -> &str {
        &self.rows[row][self.names.iter().position(|own| own == name).unwrap_or_else(|| panic!("{name}"))]
    }

    fn number(&self, row: usize, name: &str) -> f64 {
        self.text(row, name).parse().unwrap()
    }
}

/// Returns the largest residual of `M x'' + C x' + K x = load + force + contact and friction forces`, relative to its terms, and the number
/// of rows with a contact force.
fn residual(model: &FileModel) -> (f64, usize) {
    let (oscillator, orbit) = (model.oscillator().unwrap(), orbit(model));
    let (rows, states) = (Rows::of(model, &orbit), model.state_names());
    let names = |one: &str, many: &str, count: usize| -> Vec<String> {
        let name = |i: usize| format!("{many}{}", i + 1);
        if count == 1 { vec![one.to_owned()] } else { (0..count).map(name).collect() }
    };
    let gaps: Vec<[String; 2]> = match &oscillator.gaps[..] {
        [_] => vec![["contact_force".to_owned(), "domain".to_owned()]],
        _ => {
            let names = model.gap_symbols().into_iter();
            names.map(|[gap, _]| [format!("contact_force_{gap}"), format!("domain_{gap}")]).collect()
        }
    };
    let elements = names("friction_force", "friction_force_", oscillator.friction.len());
    let (mut worst, mut pushed) = (0.0f64, 0);
    for row in 0..rows.rows.len() {
        let phase = rows.number(row, "phase");
        if oscillator.schedule.iter().any(|change| (change.0 - phase).abs() < 1e-9 || phase == 0.0) {
            // Both stages meet here.
            continue;
        }
        let begun = oscillator.schedule.iter().rev().find(|change| change.0 <= phase);
        let stage = &oscillator.stages[begun.or(oscillator.schedule.last()).map_or(0, |change| change.1)];
        for i in 0..oscillator.degrees().min(MOST_SIGNALS) {
            let mut terms = vec![-stage.load[i]];
            for j in 0..oscillator.degrees() {
                // The mass matrix has no entries beyond the coordinates whose accelerations are known.
                if oscillator.mass[(i, j)] != 0.0 {
                    terms.push(oscillator.mass[(i, j)] * rows.number(row, &format!("acceleration_{j}")));
                }
                let (x, v) = (rows.number(row, states[2 * j]), rows.number(row, states[2 * j + 1]));
                terms.extend([stage.stiffness[(i, j)] * x, stage.damping[(i, j)] * v]);
            }
            for drive in &oscillator.drives {
                let (sin, cos) = (f64::from(drive.order) * std::f64::consts::TAU * phase).sin_cos();
                terms.extend([-drive.cos[i] * cos, -drive.sin[i] * sin]);
            }
            for (gap, [force, domain]) in oscillator.gaps.iter().zip(&gaps) {
                let side = if rows.text(row, domain) == "meshing_left" { -1.0 } else { 1.0 };
                let force = rows.number(row, force);
                pushed += usize::from(force != 0.0);
                terms.push(side * force * gap.row[i]);
            }
            for spring in oscillator.springs.iter().filter(|spring| spring.wall.is_none()) {
                let of = |(factor, name): (&f64, &&str)| factor * rows.number(row, name);
                let elongation = spring.row.iter().zip(states.iter().step_by(2)).map(of).sum();
                terms.push(spring.row[i] * spring.curve().at(elongation));
            }
            for (element, force) in oscillator.friction.iter().zip(&elements) {
                terms.push(rows.number(row, force) * element.row[i]);
            }
            let size: f64 = terms.iter().map(|term| term.abs()).sum();
            worst = worst.max(terms.iter().sum::<f64>().abs() / size.max(f64::MIN_POSITIVE));
        }
    }
    (worst, pushed)
}

/// Every built-in model and the quarter car: one gap and several, rigid, elastic and pushing walls, friction, stages, harmonics.
#[test]
fn forces_and_accelerations_satisfy_the_equations_of_motion() {
    let mut texts: Vec<String> =
        FileModel::all_built_in().iter().map(|model| model.definition().text.clone()).collect();
    texts.push(QUARTER_CAR.to_owned());
    let mut with_force = 0;
    for text in texts {
        let plain = with(&text, "");
        let model = with(&text, &accelerations(&plain.oscillator().unwrap()));
        let (worst, pushed) = residual(&model);
        assert!(worst < 1e-9, "{}: {worst}", model.name());
        with_force += usize::from(pushed > 0);
    }
    assert!(with_force > 8, "{with_force}");
}

/// A pair and the same model as a machine, which a signal makes it.
#[test]
fn contact_forces_of_both_engines_agree() {
    for name in ["gear-pair", "bilinear", "backlash", "shaking-table", "mesh-stiffness", "meissner"] {
        let plain = FileModel::built_in(name).unwrap();
        let text = &plain.definition().text;
        let machine = with(text, &accelerations(&plain.oscillator().unwrap()));
        let [a, b] = [&plain, &machine].map(|model| orbit(model));
        assert_eq!(a.class, b.class, "{name}");
        if !is_periodic(&a) {
            continue;
        }
        let [a, b] = [(&plain, &a), (&machine, &b)].map(|(model, orbit)| Rows::of(model, orbit));
        let forces = |rows: &Rows| -> Vec<f64> {
            let samples = (0..rows.rows.len()).filter(|&row| rows.text(row, "event").is_empty());
            samples.map(|row| rows.number(row, "contact_force")).collect()
        };
        let (a, b) = (forces(&a), forces(&b));
        assert_eq!(a.len(), b.len(), "{name}");
        let largest = a.iter().fold(0.0f64, |largest, force| largest.max(force.abs()));
        let apart = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart <= 1e-6 * largest, "{name}: {apart} of {largest}");
    }
}

/// Returns the largest distance of the mean acceleration of two neighbouring samples from the difference quotient of the velocity, relative to
/// the largest acceleration. Accelerations also come from forces whose modes are wrong; velocities do not.
fn distance_from_quotients(model: &FileModel) -> f64 {
    let (orbit, states) = (orbit(model), model.state_names());
    let rows = Rows::of(model, &orbit);
    let (mut apart, mut largest) = (0.0f64, 0.0f64);
    for row in 1..rows.rows.len() {
        let is_smooth = !(rows.text(row - 1, "moment") == "before" && rows.text(row, "moment") == "after");
        let time = rows.number(row, "t") - rows.number(row - 1, "t");
        for i in (0..states.len() / 2).take(MOST_SIGNALS) {
            let name = format!("acceleration_{i}");
            let [from, to] = [row - 1, row].map(|row| rows.number(row, &name));
            largest = largest.max(to.abs());
            // A shorter time may be the rest of a series of impacts.
            if is_smooth && time > 3e-5 * orbit.forcing_period {
                let change = rows.number(row, states[2 * i + 1]) - rows.number(row - 1, states[2 * i + 1]);
                apart = apart.max((change / time - 0.5 * (from + to)).abs());
            }
        }
    }
    apart / largest
}

/// Friction along an oblique row that always sticks: its rate is never exactly 0.
const STUCK: &str = "name = 'stuck'\nparameters = { omega = 0.8 }\nfriction = [{ row = [0.3, -0.7, 0.45], force = 50 }]\n\
    [motion]\ncoordinates = ['x', 'y', 'z']\nmass = [[1, 0, 0], [0, 2, 0], [0, 0, 1]]\n\
    damping = [[0.2, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]\nstiffness = [[1, -0.5, 0], [-0.5, 2, -0.2], [0, -0.2, 1]]\n\
    force = [1, 0.3, 0]\nfrequency = 'omega'\ngap = [1, 0, 0]\n";

#[test]
fn accelerations_are_derivatives_of_velocities() {
    let own = ["friction-oscillator", "relief-valve", "impact-oscillator", "bilinear", "two-masses"];
    let texts = own.map(|name| FileModel::built_in(name).unwrap().definition().text.clone());
    for text in texts.iter().map(String::as_str).chain([STUCK]) {
        let model = with(text, &accelerations(&with(text, "").oscillator().unwrap()));
        let apart = distance_from_quotients(&model);
        assert!(apart < 0.02, "{}: {apart}", model.name());
    }
}

/// Without a mesh speed, a series of impacts ends by its limit. Both engines count its impacts down to the same speed.
#[test]
fn both_engines_close_series_of_impacts_alike() {
    let text = FileModel::built_in("gear-pair").unwrap().definition().text.clone();
    for (e, omega) in [(0.06, 3.0), (0.06, 5.6), (0.2, 3.0), (0.3, 3.0), (0.4, 3.0), (0.5, 3.0)] {
        let of = |signal: &str| {
            let mut model = with(&text, signal);
            for (name, value) in [("e", e), ("omega", omega), ("mesh_speed", 0.0)] {
                model.set(name, value).unwrap();
            }
            orbit(&model)
        };
        let [pair, machine] = ["", "[[signal]]\nname = 'rate'\nvelocity = [1, 0]\n"].map(of);
        assert!(
            is_periodic(&pair) && pair.class == machine.class && pair.mesh_fraction > 0.0,
            "{e}, {omega}"
        );
        let apart = pair.strobe.iter().zip(machine.strobe).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let [a, b] = [&pair, &machine].map(|orbit| orbit.floquet.as_ref().unwrap()[0]);
        let multipliers = (a[0] - b[0]).hypot(a[1] - b[1]) / a[0].hypot(a[1]);
        assert!(
            apart < 1e-11 && multipliers < 1e-7,
            "{e}, {omega}: states {apart:e}, multipliers {multipliers:e}"
        );
        assert_eq!(
            (pair.impacts_per_period, &pair.word),
            (machine.impacts_per_period, &machine.word),
            "{e}, {omega}"
        );
    }
}

fn quantities(model: &FileModel) -> (Quantities, f64) {
    let orbit = orbit(model);
    assert!(is_periodic(&orbit), "{}", model.name());
    (orbit.quantities.unwrap(), std::f64::consts::TAU / orbit.forcing_period)
}

/// The quarter car at a speed at which its stops are hit, the tyre leaves the road and friction sticks.
fn quarter_car(lines: &str) -> FileModel {
    let mut model = with(QUARTER_CAR, lines);
    model.set("v", 23.5).unwrap();
    model.set("A", 0.065).unwrap();
    model
}

#[test]
fn averages_of_signals_follow_from_those_of_displacements() {
    let model = quarter_car(
        "[[signal]]\nname = 'travel'\ndisplacement = [0, 1, -1]\n\
         [[signal]]\nname = 'rate'\nvelocity = [0, 0, 1]\n\
         [[signal]]\nname = 'shifted'\ndisplacement = [0, 0, 1]\nconstant = 'A'\ncos = 'A'\nsin = '-2*A'\n\
         [[signal]]\nname = 'push'\nacceleration = [1, 0, 0]\n",
    );
    let (of, omega) = quantities(&model);
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * b.abs().max(1e-3), "{a} {b}");
    let signal = |i: usize| of.displacements[place_of_signal(i)];
    let [travel, rate, shifted, push] = [0, 1, 2, 3].map(signal);
    let (gap, wheel) = (of.displacements[place_of_gap(0)], of.displacements[place_of_displacement(2)]);
    near(travel.amplitude, gap.amplitude);
    near(travel.rms, gap.rms);
    near(travel.mean, gap.mean);
    // The wave of a rate is that of its displacement times i omega.
    near(rate.harmonic[0], omega * wheel.harmonic[0]);
    near(
        (rate.harmonic[1] - wheel.harmonic[1]).rem_euclid(std::f64::consts::TAU),
        0.5 * std::f64::consts::PI,
    );
    near(rate.mean, 0.0);
    near(push.mean, 0.0);
    near(shifted.mean, wheel.mean + 0.065);
    let wave = |[amplitude, phase]: [f64; 2]| [amplitude * phase.cos(), -amplitude * phase.sin()];
    let ([cos, sin], [own_cos, own_sin]) = (wave(wheel.harmonic), wave(shifted.harmonic));
    near(own_cos, cos + 0.065);
    near(own_sin, sin - 2.0 * 0.065);
}

/// The damper of one coordinate takes `c` times the mean square of the velocity, and the velocity jumps by as much as its rate adds.
#[test]
fn averages_of_velocities_hold_across_impacts() {
    let text = &FileModel::built_in("impact-oscillator").unwrap().definition().text.clone();
    let plain = with(text, "");
    let model = with(
        text,
        "[[signal]]\nname = 'rate'\nvelocity = [1]\n[[signal]]\nname = 'push'\nacceleration = [1]\n",
    );
    let (of, omega) = quantities(&model);
    let [rate, push] = [0, 1].map(|i| of.displacements[place_of_signal(i)]);
    assert!(of.approaches[2].count > 0);
    let damping = plain.oscillator().unwrap().stages[0].damping[(0, 0)];
    assert!((damping * rate.rms * rate.rms - of.dissipated).abs() < 1e-12 * of.dissipated);
    let orbit = orbit(&model);
    let jumps: f64 = orbit.events.iter().map(|event| event.after[1] - event.before[1]).sum();
    let time = f64::from(orbit.cycle_periods) * orbit.forcing_period;
    assert!((push.mean * time + jumps).abs() < 1e-9 * jumps.abs(), "{} {jumps} {omega}", push.mean);
    assert!(rate.mean.abs() < 1e-12);
}

/// Work of the force = heat of dampers and friction + energy lost in impacts + energy that walls release. The load does no work over a cycle.
#[test]
fn released_energy_closes_the_balance() {
    let model = quarter_car("");
    let (of, omega) = quantities(&model);
    let force = &model.oscillator().unwrap().drives[0].cos;
    let power: f64 = (0..3)
        .map(|i| {
            let [amplitude, phase] = of.displacements[place_of_displacement(i)].harmonic;
            -0.5 * force[i] * omega * amplitude * phase.sin()
        })
        .sum();
    let released = of.release_energy.unwrap();
    assert!(released > 1e-4 * power && of.impact_energy.abs() < 1e-12 * power);
    let spent = of.dissipated + of.friction.unwrap().dissipated + of.impact_energy + released;
    assert!((power - spent).abs() < 1e-10 * power, "{power} {spent}");
}

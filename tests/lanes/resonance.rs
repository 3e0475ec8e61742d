//! An undamped oscillator that is forced at its own frequency, against a wall: its impacts lie at phase 0. In closed form
//! the orbit with one impact has period 1, the word 2 and multipliers of modulus e.

use std::f64::consts::{PI, TAU};

use crate::common::gpu;
use rattlemap::gpu::Precision;
use rattlemap::map::engine::{Cpu, Engine};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{FileText, Purpose, Scene};
use rattlemap::record::Record;
use rattlemap::record::classify::{classify, status};
use rattlemap::validate::independent;
use rattlemap_dynamics::orbit::{Class, Status};

/// 25 walls, 11 coefficients of restitution.
const SCENE: &str = "model = 'resonance.toml'
axis = [
    { parameter = 'at', min = -0.2, max = 1.0, count = 25 },
    { parameter = 'e', min = 0.3, max = 0.8, count = 11 },
]
[outputs]
quantities = ['class', 'lyapunov', 'impacts', 'word', 'harmonic']
";

fn plan() -> Plan {
    let model = |_, _: &str| Ok(FileText { name: "r".into(), text: include_str!("resonance.toml").into() });
    Plan::new(&Scene::parse_with_files(SCENE, "scene", &[], Purpose::Map, None, &model).unwrap())
}

/// Returns position of the wall and restitution of a cell.
fn case(id: usize) -> [f64; 2] {
    [-0.2 + 0.05 * (id % 25) as f64, 0.3 + 0.05 * (id / 25) as f64]
}

/// Whether the orbit with one impact keeps off the wall between its impacts.
fn exists([at, e]: [f64; 2]) -> bool {
    let x = |t: f64| at * t.cos() + (0.5 * t - e * PI / (1.0 + e)) * t.sin();
    (1..400).all(|i| x(f64::from(i) * TAU / 400.0) < at)
}

/// Checks all cells: no event stays at phase 0, and nearly all cells in which the orbit exists show it.
fn check(records: &[Record], within: f64) {
    let mut shown = 0;
    let orbits: Vec<usize> = (0..records.len()).filter(|&id| exists(case(id))).collect();
    for &id in &orbits {
        let ([at, e], record) = (case(id), &records[id]);
        assert_ne!(status(record), Status::StrobeOnEvent, "at {at}, e {e}: {record:?}");
        assert_eq!(classify(record), Class::Periodic { period: 1 }, "at {at}, e {e}: {record:?}");
        if record.word().is_some_and(|word| word.to_string() == "2") {
            let [x, v, ..] = record.strobe();
            assert!((record.lyapunov - e.ln() / TAU).abs() < within, "at {at}, e {e}: {}", record.lyapunov);
            assert!((x - at).abs() < within && (v + e * PI / (1.0 + e)).abs() < within, "{at} {e}: {x} {v}");
            shown += 1;
        }
    }
    assert!(orbits.len() > 200 && shown + 5 > orbits.len(), "{shown} of {}", orbits.len());
}

#[test]
fn an_impact_at_phase_0_does_not_change_cells_of_the_reference() {
    let plan = plan();
    let records = gpu::all_records(&plan, &mut Engine::Cpu(Cpu::new(&plan)));
    check(&records, 1e-7);
    // The program that judges maps of the reference has its own answer.
    for id in (0..records.len()).filter(|&id| exists(case(id))).step_by(40) {
        let judged = independent::record(&plan, id as u32, &records).unwrap();
        assert_eq!((judged.period, judged.word()), (1, records[id].word()), "{:?}", case(id));
        assert!((judged.strobe[1] - records[id].strobe[1]).abs() < 1e-5, "{:?}: {judged:?}", case(id));
    }
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn an_impact_at_phase_0_does_not_change_cells_of_lanes() {
    for (precision, within) in [(Precision::F32, 2e-3), (Precision::F64, 1e-6)] {
        let plan = plan();
        let reference = gpu::all_records(&plan, &mut Engine::Cpu(Cpu::new(&plan)));
        let records = gpu::map(&plan, &mut gpu::open(precision));
        check(&records, within);
        let phase = rattlemap::record::measures::all()
            .find(|measure| {
                measure.name(&rattlemap::record::measures::Subjects::of_states(&["x", "v"]))
                    == "harmonic_phase_x"
            })
            .unwrap();
        for id in (0..records.len()).filter(|&id| exists(case(id))) {
            let [ours, right] = [&records[id], &reference[id]].map(|record| phase.of(record).unwrap());
            assert!((ours - right).abs() < within, "{:?}: {ours} {right}", case(id));
        }
    }
}

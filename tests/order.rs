//! Convergence: baselines by their orders down to rounding, lanes not at all.

use rattlemap::bench::work_precision::cells::{Kind, Subject, VARIANTS, subjects};
use rattlemap::bench::work_precision::fixed_step::{Scheme, integrate};
use rattlemap::bench::work_precision::lanes::{Device, Form};
use rattlemap::bench::work_precision::outcome::Outcome;
use rattlemap::bench::work_precision::{adaptive, outcome::Error};
use rattlemap::gpu::Precision;

fn error(subject: &Subject, outcome: &Outcome) -> Error {
    outcome.error(&subject.truth, subject.oscillator.period())
}

#[test]
#[ignore]
fn probe() {
    let all = subjects(5);
    for s in all.iter().step_by(VARIANTS as usize) {
        print!(
            "{:8} e {:.4} w {:.2} F {:.4} amp {:8.1e} |",
            s.kind.name(),
            s.pair.e,
            s.pair.omega,
            s.pair.force,
            s.amplification
        );
        for n in [64, 256, 1024, 4096] {
            let e = error(s, &integrate(Scheme::RungeKutta, s, n));
            print!(" {:.1e}/{:.1e}", e.state, e.event.unwrap_or(-1.0));
        }
        print!(" E {:.1e}", error(s, &integrate(Scheme::SemiImplicitEuler, s, 4096)).state);
        for t in [1e-6, 1e-12] {
            let e = error(s, &adaptive::integrate(s, t));
            print!(" D {:.1e}/{:.1e}", e.state, e.event.unwrap_or(-1.0));
        }
        println!();
    }
    for precision in Precision::ALL {
        for form in [Form::Exact, Form::RungeKutta] {
            let mut device = Device::open(precision, form, &all, 1).unwrap();
            for n in [64, 1024] {
                let tables = device.load(n).unwrap();
                let (_, out) = device.run(&tables).unwrap();
                println!("{precision:?} {form:?} {n}");
                for (s, o) in all.iter().zip(&out).step_by(VARIANTS as usize) {
                    let e = error(s, o);
                    print!(" {}{:.1e}/{:.1e}", &s.kind.name()[..2], e.state, e.event.unwrap_or(-1.0));
                }
                println!();
            }
        }
    }
    let _ = Kind::ALL;
}

//! The files in `models/` define the models of the closed forms.

use crate::common::built_in;
use crate::common::closed_form::Walled;
use crate::common::pairs::AsPair;
use crate::gallery::ball::ball;
use crate::gallery::clearance;
use crate::gallery::elastic::{backlash, bilinear, soft};
use crate::gallery::loose_gear;
use crate::gallery::single_impact::{COCO, STOP};
use rattlemap::model_file::FileModel;
use rattlemap_dynamics::model::{Contact, Domain, Law, Model, Pair};

fn numbers(domain: &Domain) -> Vec<f64> {
    [domain.damping.as_flattened(), domain.stiffness.as_flattened(), &domain.load].concat()
}

fn is_near(ours: &[f64], theirs: &[f64]) -> bool {
    let near = |(a, b): (&f64, &f64)| a == b || (a - b).abs() <= 4.0 * f64::EPSILON * a.abs();
    ours.len() == theirs.len() && ours.iter().zip(theirs).all(near)
}

fn agrees(name: &str, sets: &[(&str, f64)], (ours, law): (Pair, Law)) {
    let model = built_in(name, sets);
    let theirs = model.pair();
    let flat = |o: &Pair| {
        [o.mass.as_flattened(), &o.gap, &o.walls, &[o.omega], &o.force, &numbers(&o.free)].concat()
    };
    assert!(is_near(&flat(&ours), &flat(&theirs)), "{name}: {ours:#?} {theirs:#?}");
    assert_eq!(ours.degrees, theirs.degrees, "{name}");
    for i in (0..2).filter(|&i| ours.walls[i].is_finite()) {
        assert_eq!(ours.contacts[i], theirs.contacts[i], "{name}");
        match ours.contacts[i] {
            Contact::Elastic => {
                assert!(is_near(&numbers(&ours.meshing[i]), &numbers(&theirs.meshing[i])), "{name}");
            }
            _ => assert_eq!(
                (law.restitution[i], law.mesh_speed[i]),
                (model.law().restitution[i], model.law().mesh_speed[i]),
                "{name}"
            ),
        }
    }
}

#[test]
fn model_files_define_the_models_of_the_closed_forms() {
    let walled = |walled: Walled| walled.oscillator();
    agrees("impact-oscillator", &[], walled(STOP.walled()));
    agrees("coco-impact", &[], walled(COCO.walled()));
    agrees("bilinear", &[("omega", 1.7), ("k", 3.0)], walled(bilinear(1.7, 1.0)));
    agrees("soft-impact", &[("omega", 0.85)], walled(soft(0.85, 0.7)));
    agrees("kahraman-singh", &[("omega", 0.9)], walled(backlash(0.9)));
    agrees("shaking-table", &[("A", 1.2), ("e", 0.3)], walled(ball(1.2, 0.3)));
    agrees("two-masses", &[("omega", 0.8)], clearance::pair(0.8));
    agrees("shaken-container", &[("d", 1.2), ("e", 0.3)], clearance::container(1.2, 0.3));
    agrees(
        "impact-damper",
        &[("d", 0.06)],
        clearance::Damper { clearance: 0.06, ..clearance::DAMPER }.pair(),
    );
    agrees("energy-sink", &[("d", 0.08)], clearance::Damper { clearance: 0.16, ..clearance::SINK }.pair());
    let sets = [("swing", loose_gear::swing(1.5)), ("backlash", 2e-4), ("e", 0.3)];
    agrees("loose-gear", &sets, walled(loose_gear::gear(1.5, 2e-4, 0.3)));
    // The others are the gear pair, which is compared with the paper, four models with stages, six with dry friction,
    // nonlinear springs or force laws, two whose closed forms use the model file, clutch and backlash, and three machines.
    assert_eq!(FileModel::all_built_in().len(), 27);
}

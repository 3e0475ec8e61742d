//! Any text as a scene: it is refused with a remedy, or what it says is valid.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rattlemap::map::scene::{Purpose, Scene};

fuzz_target!(|text: &str| {
    // Lines that look like `--set` arguments are some: values reach scenes in both ways.
    let (sets, text): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with("--set "));
    let sets: Vec<String> = sets.iter().map(|line| line["--set ".len()..].to_owned()).collect();
    let text = text.join("\n");
    for purpose in [Purpose::Map, Purpose::Bifurcation] {
        match Scene::parse(&text, "fuzz", &sets, purpose) {
            Ok(scene) => {
                // Corner cells: ranges are convex.
                let [first, last] = [0, 1].map(|end| {
                    let index = |axis: &rattlemap::map::scene::Axis| end * (axis.count() - 1);
                    scene.cell(&scene.axes().iter().map(index).collect::<Vec<_>>())
                });
                assert!(first.validate().is_ok() && last.validate().is_ok());
            }
            Err(error) => {
                let said = error.to_string();
                assert!(!said.contains('\n'), "more than a line: {said}");
            }
        }
    }
});

//! Parses any text as a scene. It must be refused with a message of one line, or be valid.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rattlemap::map::scene::{Purpose, Scene};

fuzz_target!(|text: &str| {
    // Lines that begin with `--set ` become arguments, because values reach scenes in both ways.
    let (sets, text): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with("--set "));
    let sets: Vec<String> = sets.iter().map(|line| line["--set ".len()..].to_owned()).collect();
    let text = text.join("\n");
    for purpose in [Purpose::Map, Purpose::Bifurcation] {
        match Scene::parse(&text, "fuzz", &sets, purpose) {
            Ok(scene) => {
                // Ranges are convex, so valid corner cells imply valid cells.
                let [first, last] = [0, 1].map(|end| {
                    let index = |axis: &rattlemap::map::scene::Axis| end * (axis.count() - 1);
                    scene.cell(&scene.axes().iter().map(index).collect::<Vec<_>>())
                });
                assert!(first.validate().is_ok() && last.validate().is_ok());
            }
            Err(error) => {
                let message = error.to_string();
                assert!(!message.contains('\n'), "the message has several lines: {message}");
            }
        }
    }
});

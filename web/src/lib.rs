//! The engine of reports: computes motions and parts of maps in the browser.
//!
//! `scripts/wasm.sh` compiles this crate to WebAssembly. `rattlemap::show::report` puts it into `report.html`, where a worker
//! calls [`orbit()`] with the command that replays the selected cell.

#[cfg(test)]
mod committed;
#[cfg(target_arch = "wasm32")]
mod lanes;
mod window;

use std::sync::atomic::AtomicBool;

use rattlemap::map::scene::{FigureStyle, Scale, single_cell};
use rattlemap::model_file::{DEFAULT, FileModel};
use rattlemap::show::drawing::svg;
use rattlemap::show::figure::orbit::{OrbitFigure, OrbitPlot};
use rattlemap::show::orbit_spectrum::samples_per_period;
use rattlemap::show::orbit_summary::summary;
use rattlemap::show::report;
use rattlemap_dynamics::model::{Model, REST, State};
use rattlemap_dynamics::orbit::{self, Class, Settings};
use serde_json::{Map, Value, json};
use wasm_bindgen::prelude::wasm_bindgen;

#[cfg(target_arch = "wasm32")]
pub use lanes::Lanes;
pub use window::Window;

/// Width in points of gap and phase planes, which stand beside the map. The time history stands below the map and has the
/// default width.
const ASIDE: f64 = 250.0;

/// Computes the motion of a `rattlemap orbit` command, and draws it.
///
/// `command` is the text that a report shows for a cell. `model` is the text of the map's own model file; it is empty for a
/// built-in model. Returns a JSON object: `summary`, the text that the command prints, `class`, `period` (null if not periodic),
/// `periods_run`, and `figures`, SVG images, keyed by the figure's name; or `error`, a message.
#[wasm_bindgen]
pub fn orbit(command: &str, model: &str) -> String {
    let object = computed(command, model).unwrap_or_else(|error| json!({ "error": error }));
    object.to_string()
}

/// Chooses ticks, as JSON: see [`report::ticks`]. `scale` is the scale's name in a scene.
#[wasm_bindgen]
pub fn ticks(scale: &str, ends: &[f64], listed: &[f64], length: f64, spacing: f64) -> String {
    let scale = Scale::named(scale).unwrap_or(Scale::Linear);
    report::ticks(scale, [ends[0], ends[1]], listed, length, spacing).to_string()
}

fn computed(command: &str, text: &str) -> Result<Value, String> {
    let message = |error: &dyn std::error::Error| error.to_string();
    let Request { model, sets, start: (start, components), settings } = Request::parse(command)?;
    let model = match FileModel::built_in(model) {
        Some(model) => model,
        None if text.is_empty() => return Err(format!("the report has no file of the model {model}")),
        None => FileModel::parse(text, model).map_err(|error| message(&error))?,
    };
    if components.is_some_and(|count| count != model.state_names().len())
        || !start.iter().all(|x| x.is_finite())
    {
        return Err(format!(
            "--start: it must be finite numbers, the model's {}",
            model.state_names().join(", ")
        ));
    }
    let cell = single_cell(&model, &sets).map_err(|error| message(&error))?;
    let (never, silent) = (AtomicBool::new(false), |_, _| ());
    let analysed = orbit::analyse_until(
        &*cell,
        start,
        &settings,
        orbit::LONGEST_WINDOW,
        orbit::EVENT_PERIODS,
        &never,
        &silent,
    );
    let Some(motion) = analysed.map_err(|error| message(&error))? else {
        return Err("the analysis was stopped".to_owned());
    };
    let cell = cell.on_cycle(motion.cycle_time);
    let mut figures = Map::new();
    if motion.class != Class::Failed {
        let samples = samples_per_period(&cell.oscillator().map_err(|error| message(&error))?);
        let trace = orbit::trace(&*cell, motion.strobe, motion.strobe_meshing, motion.cycle_periods, samples)
            .map_err(|error| message(&error))?;
        let plot = OrbitPlot::new(&*cell, &motion, &trace).map_err(|error| message(&error))?;
        let wide = FigureStyle::default();
        let narrow =
            FigureStyle { width: Some(ASIDE), title: Some(String::new()), legend: false, ..wide.clone() };
        for figure in OrbitFigure::ALL {
            let style = if figure == OrbitFigure::TimeHistory { &wide } else { &narrow };
            figures.insert(figure.name().to_owned(), json!(svg(&figure.draw(style, &plot))));
        }
    }
    let period = match motion.class {
        Class::Periodic { period } => Some(period),
        _ => None,
    };
    Ok(json!({
        "summary": summary(&*cell, &motion, None),
        "class": motion.class.name(),
        "period": period,
        "periods_run": motion.periods_run,
        "figures": figures,
    }))
}

/// The arguments of a command.
struct Request<'c> {
    /// Name of a built-in model, or of the map's own model file.
    model: &'c str,
    sets: Vec<String>,
    /// The start, and the number of components that the command gives.
    start: (State, Option<usize>),
    settings: Settings,
}

impl<'c> Request<'c> {
    /// Reads a command that a report shows. If an option other than `--set` is repeated, the last one counts.
    fn parse(command: &'c str) -> Result<Request<'c>, String> {
        let mut request =
            Request { model: DEFAULT, sets: Vec::new(), start: (REST, None), settings: Settings::default() };
        let arguments = command.trim().strip_prefix("rattlemap orbit");
        let arguments = arguments.filter(|rest| rest.is_empty() || rest.starts_with(' '));
        let arguments = arguments.ok_or("not a command of an orbit")?;
        for argument in arguments.split(" --").map(str::trim).filter(|argument| !argument.is_empty()) {
            let wrong = || format!("--{argument} cannot be read");
            match argument.split_once(' ').ok_or_else(wrong)? {
                ("set", value) => request.sets.push(value.to_owned()),
                ("model", value) => request.model = value,
                ("transient", value) => {
                    request.settings.transient_periods = value.parse().map_err(|_| wrong())?
                }
                ("start", value) => {
                    let mut state = REST;
                    for (n, number) in value.split(',').enumerate() {
                        *state.get_mut(n).ok_or_else(wrong)? = number.parse().map_err(|_| wrong())?;
                    }
                    request.start = (state, Some(value.split(',').count()));
                }
                _ => return Err(wrong()),
            }
        }
        Ok(request)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(command: &str, model: &str) -> Value {
        serde_json::from_str(&orbit(command, model)).unwrap()
    }

    #[test]
    fn a_command_gives_the_summary_and_the_figures_of_its_motion() {
        let found = result("rattlemap orbit --set e=0.06 --transient 500 --start 0.1,0,-0.25,1", "");
        let summary = found["summary"].as_str().unwrap();
        assert!(summary.contains("\nclass                 periodic, period 1\n"), "{summary}");
        assert!(summary.contains("\npattern               135462\n"), "{summary}");
        assert_eq!((&found["class"], &found["period"]), (&json!("periodic"), &json!(1)));
        for name in ["phase_plane", "time_history", "gap"] {
            assert!(found["figures"][name].as_str().unwrap().starts_with("<svg "), "{name}");
        }
    }

    #[test]
    fn ticks_are_values_with_labels() {
        let found = |scale, ends: [f64; 2], listed: &[f64]| -> Value {
            serde_json::from_str(&ticks(scale, &ends, listed, 500.0, 90.0)).unwrap()
        };
        let linear = found("linear", [0.5, 0.6], &[]);
        assert_eq!((&linear["marks"][1][1], &linear["factor"]), (&"0.52".into(), &"".into()));
        assert_eq!(found("linear", [0.0, 2e-7], &[])["factor"], ", in 10\u{207b}\u{2077}");
        // From 0.1 to 10, with minor ticks.
        assert_eq!(found("log", [-1.0, 1.0], &[])["marks"].as_array().map(Vec::len), Some(19));
        let listed = found("values", [-0.5, 2.5], &[2.0, 3.0, 5.5]);
        assert_eq!(listed["marks"], json!([[2.0, "2"], [3.0, "3"], [5.5, "5.5"]]));
    }

    #[test]
    fn the_text_of_a_models_own_file_is_read() {
        let text = include_str!("../../models/two_masses.toml").replace("two-masses", "mine");
        let found = result("rattlemap orbit --set omega=1.2 --model model.toml", &text);
        assert_eq!(
            found["summary"],
            result("rattlemap orbit --set omega=1.2 --model two-masses", "")["summary"]
        );
    }

    #[test]
    fn wrong_commands_are_errors() {
        for (command, expected) in [
            ("rattlemap map s.toml", "not a command of an orbit"),
            ("rattlemap orbit --set e=2", "e"),
            ("rattlemap orbit --start 1,2,3,4,5", "--start: it must be finite numbers"),
            ("rattlemap orbit --json", "--json cannot be read"),
            ("rattlemap orbit --start 1,2", "x1, v1, x2, v2"),
            ("rattlemap orbit --model model.toml", "no file of the model model.toml"),
        ] {
            let found = result(command, "");
            assert!(
                found["error"].as_str().is_some_and(|error| error.contains(expected)),
                "{command}: {found}"
            );
        }
    }
}

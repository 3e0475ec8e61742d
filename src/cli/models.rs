//! `rattlemap models`: what can be swept, and one model on a page.

use std::fmt::Write;

use rattlemap_dynamics::model::{Contact, Model, Parameter, Side};
use rattlemap_dynamics::orbit::Status;

use crate::cli::arguments::Models;
use crate::cli::stdout::print;
use crate::job::error::Failure;
use crate::job::model_choice;
use crate::model_file::{BUILT_IN, FileModel, Wall, WallLaw, factor};

/// Prints the list of models, or one of them on a page.
pub(crate) fn run(ask: &Models) -> Result<(), Failure> {
    let Some(name) = &ask.name else {
        let width = BUILT_IN.iter().map(|(name, _)| name.len()).max().unwrap_or_default();
        for model in FileModel::all_built_in() {
            let summary = model.definition().summary.as_deref().unwrap_or(model.title());
            print(&format!("{:<width$}  {summary}", model.name()))?;
        }
        return Ok(());
    };
    let model = model_choice::find(name)?;
    let text = if ask.file { model.definition().text.clone() } else { page(&model) };
    Ok(print(&text)?)
}

fn page(model: &FileModel) -> String {
    let definition = model.definition();
    let mut text = format!("{} ({})\n", model.title(), model.name());
    if let Some(notes) = &definition.notes {
        let _ = writeln!(text, "\n{}", notes.trim());
    }
    let _ = writeln!(text, "\nMotion\n");
    model.equations().iter().for_each(|line| text += &format!("    {line}\n"));
    let _ = writeln!(
        text,
        "\n    The state is {}; the forcing period is 2 pi over {}.",
        model.state_names().join(", "),
        definition.motion.frequency.text()
    );
    let _ = writeln!(text, "\nContact\n");
    for side in Side::BOTH {
        if let Some(wall) = definition.wall(side) {
            text += &contact(side, wall);
        }
    }
    let _ = writeln!(text, "\nParameters\n");
    text += &format!("    {:<11} {:<9} {:<25} {}\n", "symbol", "default", "range", "meaning");
    for parameter in model.parameters() {
        text += &line(parameter);
    }
    text += &format!(
        "\n{}\n{CLASSES}\n\nStatus: how the integration of a cell ended\n\n",
        words(definition.walls.each_ref().map(Option::is_some))
    );
    for status in Status::ALL {
        let _ = writeln!(text, "    {:<17} {}", status.name(), meaning(status));
    }
    let source = model.source().map_or("not told".to_owned(), |title| format!("\"{title}\""));
    text + &format!("\n{ERRORS}\n\nSource\n\n    {source}\n")
}

/// What happens at a wall, in words.
fn contact(side: Side, wall: &Wall) -> String {
    let (name, at) = (if side == Side::Right { "right" } else { "left" }, wall.at.text());
    let mut text = format!("    The {name} wall is at z = {at}. ");
    match &wall.law {
        WallLaw::Elastic => {
            text += "There is no impact: motion goes on behind it at once, until z comes back.\n";
        }
        WallLaw::Impact { restitution, mesh_speed } => {
            let lasts = match mesh_speed.as_number() {
                Some(0.0) => "it has come to rest".to_owned(),
                _ => format!("it leaves at a speed of at most {}", mesh_speed.text()),
            };
            let _ = writeln!(
                text,
                "First the law of impact: the rate after is -{} times the\n    rate before, by an impulse along the gap \
                 row. A contact lasts if {lasts}\n    and the load presses the gap to the wall; otherwise it was an \
                 impact, and motion stays free. w = 0 with the load\n    pulling away is grazing: nothing happens.",
                factor(restitution)
            );
            text += match wall.contact() {
                Contact::Rigid => {
                    "    A contact that lasts rests on the wall, z and w fixed, until the load pulls it off.\n"
                }
                _ => {
                    "    A contact that lasts goes on behind the wall and ends where z comes back to it, its state \
                     continuous.\n"
                }
            };
        }
    }
    text
}

/// Symbols of words, of the walls that there are: right, left.
fn words([right, left]: [bool; 2]) -> String {
    let mut text = "Words\n\n    One symbol per flight, between two events:\n".to_owned();
    let symbols = [
        (right, "1  contact that lasts, on the right"),
        (right, "2  free, from the right to the right"),
        (left && right, "3  free, from the right to the left"),
        (left, "4  contact that lasts, on the left"),
        (left, "5  free, from the left to the left"),
        (left && right, "6  free, from the left to the right"),
    ];
    symbols
        .into_iter()
        .filter(|(is_there, _)| *is_there)
        .for_each(|(_, line)| text += &format!("        {line}\n"));
    text + READING
}

fn line(parameter: &Parameter) -> String {
    let default = parameter.default.map_or("-".to_owned(), |value| value.to_string());
    let Parameter { name, meaning, range, .. } = parameter;
    format!("    {name:<11} {default:<9} {:<25} {meaning}\n", range.requirement())
}

/// A status in words.
fn meaning(status: Status) -> &'static str {
    match status {
        Status::Ok => "nothing to remark",
        Status::Slow => "slow convergence: the class rests on Newton's method, or is undecided",
        Status::NearGrazing => "a contact so near to grazing that multipliers and exponent mean little",
        Status::StrobeOnEvent => "an event lies on phase 0, where the cycle is compared with itself",
        Status::CapEvents => "failed: more events in one period than the engine takes",
        Status::CapRoot => "failed: more steps or root iterations than the engine takes",
        Status::TooStiff => "failed: too stiff for the engine",
        Status::NonFinite => "failed: the state left the range of finite numbers",
        Status::BelowResolution => {
            "points of the cycle lie closer than the engine can tell apart: its period may be a divisor"
        }
    }
}

const READING: &str = "    A word is the cyclic sequence of a cycle's flights in order of time, in its smallest rotation: 13554622.
    The literature composes maps from right to left, with powers: P_{1 2^2 6 4 5^2 3} is the same cycle.
    Its pattern, 135462, counts each run of one symbol once: how often a contact bounces before it lasts is left out.
";

const CLASSES: &str = "\
Class

    periodic    a stable cycle was confirmed; the period counts forcing periods
    chaotic     no cycle, and the Lyapunov exponent exceeds 0 by six standard errors
    undecided   neither within the budget: long transients, near bifurcations, tori
    failed      the integration could not be continued; the status says why";

const ERRORS: &str = "\
Errors

    lyapunov_error is the standard error of an exponent that is an average of blocks. That of a cycle comes from its
    multipliers and has none.";

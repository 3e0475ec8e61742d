//! Lists the built-in models, and describes a model on a page.

use std::fmt::Write;

use rattlemap_dynamics::model::{Contact, Model, Parameter, Side};
use rattlemap_dynamics::orbit::Status;
use rattlemap_dynamics::word::Word;

use crate::job::model_engine;
use crate::model_file::{FileModel, Wall, WallLaw, factor, wall_name};
use crate::show::symbols::with_unit;

/// Returns the name and a summary of every built-in model.
pub fn list() -> Vec<(String, String)> {
    let summary =
        |model: &FileModel| model.definition().summary.clone().unwrap_or_else(|| model.title().to_owned());
    FileModel::all_built_in().iter().map(|model| (model.name().to_owned(), summary(model))).collect()
}

/// Describes a model: equations, contact laws, parameters, words, classes, statuses and source.
pub fn page(model: &FileModel) -> String {
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
        components(model).join(", "),
        definition.motion.frequency.text()
    );
    if let Ok(oscillator) = model.oscillator() {
        let _ = writeln!(text, "    Engine: {}.", model_engine::described(&oscillator));
    }
    let _ = writeln!(text, "\nContact\n");
    let has_several = definition.walls.len() > 1;
    for (gap, [z, w]) in definition.walls.iter().zip(model.gap_symbols()) {
        let of_gap = if has_several { format!(" of gap {z}") } else { String::new() };
        for (side, walls) in Side::BOTH.into_iter().zip(gap) {
            for (nth, wall) in (1..).zip(walls) {
                let name = wall_name(side, nth, walls.len()) + &of_gap;
                text += &contact(&name, wall, [&z, &w]);
            }
        }
    }
    let walls = || definition.walls.iter().flatten().flatten();
    if walls().any(Wall::is_by_speed) {
        text += SPEED;
    }
    if walls().next().is_none() {
        text += "    The model has no walls.\n";
    }
    let has_friction = !definition.friction.is_empty();
    if has_friction {
        let _ = writeln!(text, "\n{FRICTION}");
    }
    let _ = writeln!(text, "\nParameters\n");
    let units = model.parameters().iter().filter_map(|parameter| parameter.unit.as_ref());
    // Without units there is no such column.
    let width = units.map(|unit| unit.chars().count().max("unit".len()) + 2).max().unwrap_or(0);
    let unit = |text: &str| format!("{:<width$}", if width > 0 { text } else { "" });
    text += &format!("    {:<11} {:<9} {}{:<25} {}\n", "symbol", "default", unit("unit"), "range", "meaning");
    for parameter in model.parameters() {
        text += &line(parameter, &unit(parameter.unit.as_deref().unwrap_or_default()));
    }
    text += &format!(
        "\n{}\n{CLASSES}\n\nStatus: how the integration of a cell ended\n\n",
        words(
            [0, 1].map(|side| definition.walls.iter().any(|gap| !gap[side].is_empty())),
            has_friction,
            has_several
        )
    );
    for status in Status::ALL {
        let _ = writeln!(text, "    {:<17} {}", status.name(), meaning(status));
    }
    let source = model.source().map_or("not given".to_owned(), |title| format!("\"{title}\""));
    text + &format!("\n{ERRORS}\n\nSource\n\n    {source}\n")
}

/// Describes a wall and its contact law.
fn contact(name: &str, wall: &Wall, [z, w]: [&str; 2]) -> String {
    let at = wall.at.text();
    let mut text = format!("    {name} is at {z} = {at}. ");
    if let Some(first) = text.get_mut(4..5) {
        first.make_ascii_uppercase();
    }
    match &wall.law {
        WallLaw::Elastic { pulls } => {
            let end = match pulls {
                true => format!(" until {z} returns."),
                false => ".\n    The wall only pushes: contact is open while spring, damper and preload would pull.".to_owned(),
            };
            let _ = writeln!(text, "There is no impact: the motion continues behind the wall{end}");
        }
        WallLaw::Impact { restitution, mesh_speed, .. } => {
            let lasts = match mesh_speed.as_number() {
                Some(0.0) => "its rate is zero".to_owned(),
                _ => format!("it separates at a rate of at most {}", mesh_speed.text()),
            };
            let _ = writeln!(
                text,
                "An impact multiplies the rate {w} by -{}, with an\n    impulse along the gap row. After the impact the contact is sustained if {lasts}\n    and the load \
                 presses the gap to the wall; otherwise the motion is free again. A contact at\n    {w} = 0 is \
                 grazing if the load pulls the gap off the wall: nothing happens.",
                factor(restitution)
            );
            text += match wall.contact() {
                Contact::Rigid => format!(
                    "    In a sustained contact {z} and {w} are fixed until the load pulls the gap off the wall.\n"
                ),
                _ => format!(
                    "    In a sustained contact the motion continues behind the wall until {z} returns to it; the \
                     state stays continuous.\n"
                ),
            }
            .as_str();
        }
    }
    text
}

/// Explains the symbols of words that a model can have. `right` and `left` say whether any gap has these walls.
fn words([right, left]: [bool; 2], has_friction: bool, has_several_gaps: bool) -> String {
    let mut text = "Words\n\n".to_owned();
    let has_walls = right || left;
    if has_several_gaps {
        text += "    One symbol per flight of each gap, between two of its events:\n";
    } else if has_walls {
        text += "    One symbol per flight, between two events:\n";
    }
    let symbols = [
        (right, "1  sustained contact on the right"),
        (right, "2  free, from the right to the right"),
        (left && right, "3  free, from the right to the left"),
        (left, "4  sustained contact on the left"),
        (left, "5  free, from the left to the left"),
        (left && right, "6  free, from the left to the right"),
    ];
    symbols
        .into_iter()
        .filter(|(is_there, _)| *is_there)
        .for_each(|(_, line)| text += &format!("        {line}\n"));
    if has_friction {
        let others = if has_walls { ", in order of time with the others" } else { "" };
        text += &format!(
            "    One symbol per event of sliding{others}:\n        7  sticking ends\n        0  sliding reverses without sticking\n"
        );
    }
    if has_several_gaps {
        return text
            + "    A word is the cyclic sequence of a cycle's symbols in order of time, with those of all gaps.\n    \
               Its pattern writes repeated symbols once.\n";
    }
    if !has_walls {
        return text
            + "    A word is the cyclic sequence of a cycle's symbols in order of time, rotated to the smallest number: 0077.\n    \
               Its pattern, 07, writes repeated symbols once.\n";
    }
    let example = Word::cyclic(match (left, right) {
        (true, true) => b"13554622",
        (false, _) => b"1222",
        (true, false) => b"4555",
    });
    let (word, literature) = (example.time_order(), example.paper_notation());
    let pattern = example.pattern().time_order();
    let bounces = match has_friction {
        // At the turning point of a bounce the sliding reverses.
        true => ".",
        false => ": it leaves out the number of bounces before a sustained contact.",
    };
    text += &format!(
        "    A word is the cyclic sequence of a cycle's symbols in order of time, rotated to the smallest number: {word}.\n    \
         The literature composes maps from right to left, with powers: {literature} is the same cycle.\n    \
         Its pattern, {pattern}, writes repeated symbols once{bounces}\n"
    );
    text
}

/// Returns the components of the state with their units.
fn components(model: &FileModel) -> Vec<String> {
    let units = model.units();
    let names = model.state_names().into_iter().enumerate();
    names.map(|(i, name)| with_unit(name, units.component(i).as_deref())).collect()
}

fn line(parameter: &Parameter, unit: &str) -> String {
    let default = parameter.default.map_or("-".to_owned(), |value| value.to_string());
    let Parameter { name, meaning, range, .. } = parameter;
    format!("    {name:<11} {default:<9} {unit}{:<25} {meaning}\n", range.requirement())
}

/// Explains a status.
fn meaning(status: Status) -> &'static str {
    match status {
        Status::Ok => "no remark",
        Status::Slow => "the motion converges slowly: the class rests on Newton's method, or is undecided",
        Status::NearGrazing => "a contact is nearly grazing: multipliers and exponent are inaccurate",
        Status::StrobeOnEvent => "an event coincides with phase 0, at which states are compared",
        Status::CapEvents => "failed: more events in one period than the engine allows",
        Status::CapRoot => "failed: more steps or root iterations than the engine allows",
        Status::TooStiff => "failed: too stiff for the engine",
        Status::NonFinite => "failed: the state became infinite or not a number",
        Status::BelowResolution => {
            "rounding decides the period: errors grow to the distance between points of the cycle"
        }
        Status::Neutral => {
            "a multiplier has modulus 1 within its error: perturbations neither decay nor grow"
        }
        Status::Escape => "failed: the motion grows without bound",
    }
}

const SPEED: &str = "    In the coefficient of restitution, speed is the size of the rate before the impact. The coefficient is limited to the
    range from 0 to 1.
";

const FRICTION: &str = "\
Friction

    Where the argument of sgn is not 0, the surfaces slide, and friction opposes the sliding. Where it is 0, they stick as
    long as no larger force than that of sliding is needed. Friction has no part in impacts.";

const CLASSES: &str = "\
Class

    periodic        a stable or neutral cycle; the period is its number of forcing periods
    chaotic         no cycle, and the Lyapunov exponent exceeds 0 by three standard errors
    quasi-periodic  no cycle, the Lyapunov exponent is 0 within its error, and the states at phase 0 lie on a torus
    undecided       none of these was found within the budget: long transients, bifurcations near by
    failed          the integration stopped; the status gives the reason";

const ERRORS: &str = "\
Errors

    lyapunov_error is the standard error of an exponent that is an average of blocks. The exponent of
    a cycle comes from its multipliers and has no error.";

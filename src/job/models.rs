//! Lists the built-in models, and describes a model on a page.

use rattlemap_dynamics::model::Model;

use crate::job::model_engine;
use crate::model_file::{Clock, FileModel, Wall, letters_in_words};
use crate::show::symbols::with_unit;

/// Returns the name and a summary of every built-in model.
pub fn list() -> Vec<(String, String)> {
    let summary =
        |model: &FileModel| model.definition().summary.clone().unwrap_or_else(|| model.title().to_owned());
    FileModel::all_built_in().iter().map(|model| (model.name().to_owned(), summary(model))).collect()
}

/// Describes a model: equations, a table of walls, parameters and source.
pub fn page(model: &FileModel) -> String {
    let definition = model.definition();
    let mut text = format!("{} ({})\n", model.title(), model.name());
    if let Some(notes) = &definition.notes {
        text += &format!("\n{}\n", notes.trim());
    }
    text += "\nMotion\n\n";
    model.equations().iter().for_each(|line| text += &format!("    {line}\n"));
    let units = model.units();
    let state = model.state_names().into_iter().enumerate();
    let state: Vec<String> = state.map(|(i, name)| with_unit(name, units.component(i).as_deref())).collect();
    let clock = match &definition.motion.clock {
        Clock::Frequency(frequency) if definition.motion.is_unforced => {
            format!("no force; the clock of budgets has the period 2 pi over {}", frequency.text())
        }
        Clock::Frequency(frequency) => format!("forcing period 2 pi over {}", frequency.text()),
        Clock::TimeScale(time) => format!("no force; the clock of budgets has the period {}", time.text()),
        Clock::Natural => "no force; the clock of budgets has the slowest natural period".to_owned(),
    };
    text += &format!("    state {}; {clock}\n", state.join(", "));
    if let Some(letters) = letters_in_words(model) {
        text += &format!("    {letters}\n");
    }
    if let Ok(oscillator) = model.oscillator() {
        text += &format!("    Engine: {}.\n", model_engine::described(&oscillator));
        let stages = oscillator.schedule.len();
        if stages > 0 {
            text += &format!("    Stages: {stages} in a forcing period, at about 0.3 us each.\n");
        }
    }
    text += "\nWalls\n\n";
    match &model.contacts()[..] {
        [] => text += "    none\n",
        rows => {
            let header = ["wall", "at", "law", "restitution", "sustained up to", "contact force"];
            text += &table([header.map(str::to_owned)].iter().chain(rows));
        }
    }
    if definition.walls.iter().flatten().flatten().any(Wall::is_by_speed) {
        text += "    speed: size of the rate before the impact; restitution is limited to the range from 0 to 1\n";
    }
    text += "\nParameters\n\n";
    let header = ["symbol", "default", "unit", "range", "meaning"].map(str::to_owned);
    let parameters = model.parameters().iter().map(|parameter| {
        let default = parameter.default.map_or("-".to_owned(), |value| value.to_string());
        let (unit, range) = (parameter.unit.as_deref().unwrap_or_default(), parameter.range.requirement());
        [
            parameter.name.to_string(),
            default,
            unit.to_owned(),
            range.into_owned(),
            parameter.meaning.to_string(),
        ]
    });
    let rows: Vec<_> = [header].into_iter().chain(parameters).collect();
    text += &if rows.len() == 1 { "    none\n".to_owned() } else { table(&rows) };
    let source = model.source().map_or("not given".to_owned(), |title| format!("\"{title}\""));
    text + &format!("\nSource\n\n    {source}\n\nWords, classes and statuses: docs/model.md\n")
}

/// Aligns the columns of a table whose first row is its header. Columns without a value are left out.
fn table<'r, const N: usize>(rows: impl IntoIterator<Item = &'r [String; N]>) -> String {
    let rows: Vec<&[String; N]> = rows.into_iter().collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let is_used = |column: &usize| rows.iter().skip(1).any(|row| !row[*column].is_empty());
    let widths: Vec<(usize, usize)> = (0..N).filter(is_used).map(|column| (column, width(column))).collect();
    let line = |row: &&[String; N]| {
        let cells = widths.iter().map(|&(column, width)| format!("{:<width$}", row[column]));
        format!("    {}\n", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

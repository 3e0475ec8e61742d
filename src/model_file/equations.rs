//! Writes the equations of motion of a model.

use rattlemap_dynamics::model::{Contact, Side};

use super::contact::{Wall, WallLaw};
use super::definition::Definition;
use super::entry::{Entry, Staged};
use super::friction::DryFriction;
use super::motion::MotionTable;
use super::signal::Signal;
use super::steps::Steps;
use crate::text::expression::Expression;

/// Returns the equations as lines: the equation of all coordinates, gaps, stages, friction, and one equation per coordinate with a
/// contact force for each gap that has walls. `values` are those of the parameters, and `names` those of each gap and its velocity.
pub(super) fn lines(definition: &Definition, values: &[f64], names: &[[String; 2]]) -> Vec<String> {
    let motion = &definition.motion;
    let has_walls = |index: usize| definition.walls[index].iter().any(|walls| !walls.is_empty());
    let suffixes = names.iter().map(|[z, _]| if names.len() == 1 { String::new() } else { format!("_{z}") });
    let suffixes: Vec<_> = suffixes.enumerate().map(|(i, suffix)| has_walls(i).then_some(suffix)).collect();
    let mut lines = matrices(definition, &suffixes);
    for (gap, [z, w]) in motion.gaps.iter().zip(names) {
        lines.push(format!("gap   {}", row(&gap.row, &motion.coordinates, z)));
        lines.push(format!("rate  {}", row(&gap.row, &motion.velocities, w)));
    }
    lines.extend(stages(motion));
    lines.extend(steps(definition, values));
    lines.extend(acting(definition).map(|friction| {
        let rate = sliding_rate(friction, motion);
        let limit = text(friction.static_force.as_ref().unwrap_or(&friction.force));
        let point = |[rate, force]: &[Expression; 2]| format!(", {} at {}", text(force), text(rate));
        let further: String = friction.at_speed.iter().map(point).collect();
        let force = match further.is_empty() {
            true => String::new(),
            false => format!(
                "; f(r) = {} at r = 0{further}, linear between, constant beyond",
                text(&friction.force)
            ),
        };
        format!("friction  sticks at {rate} = 0 while |friction force| <= {limit}{force}")
    }));
    lines.extend(definition.springs.iter().enumerate().map(|(i, spring)| {
        let (of, [low, high]) = (row(&spring.row, &motion.coordinates, "x"), &spring.law.range);
        let (name, pieces) = (spring_name(definition, i), spring.law.described(&definition.defaults));
        let force = text(&spring.law.force);
        format!(
            "spring  {name} = {force} at the elongation {of}, from {} to {}{pieces}",
            text(low),
            text(high)
        )
    }));
    lines.extend(definition.signals.iter().map(|signal| signal_line(signal, motion)));
    let forces: Vec<_> = suffixes.iter().map(|suffix| Some(format!("N{}", suffix.as_ref()?))).collect();
    lines.extend(equations(definition, &forces));
    lines
}

/// Returns the equation of all coordinates with its matrices, and what their vector is. Terms that are 0 are left out, and `(t)` marks
/// those that change from stage to stage. `suffixes` are those of the gaps that have walls.
fn matrices(definition: &Definition, suffixes: &[Option<String>]) -> Vec<String> {
    let motion = &definition.motion;
    let term = |name: &str, rows: &[Vec<Staged>], factor: &str| {
        let mut entries = rows.iter().flatten();
        let changes = |entry: &Staged| same(entry).is_none() || entry.by_phase().is_some();
        let time = if entries.clone().any(changes) { "(t)" } else { "" };
        entries.any(|entry| constant(entry).is_some()).then(|| format!("{name}{time}{factor}"))
    };
    let friction = acting(definition).next().map(|_| "friction".to_owned());
    let contact = suffixes.iter().map(|suffix| suffix.as_ref().map(|gap| format!("g{gap} N{gap}")));
    let left = [
        Some("M x''".to_owned()),
        term("C", &motion.damping, " x'"),
        term("K", &motion.stiffness, " x"),
        friction,
        (!definition.springs.is_empty()).then(|| "springs".to_owned()),
    ];
    let further = motion.harmonics.iter().flat_map(|harmonic| [&harmonic.cos, &harmonic.sin]);
    let is_forced =
        further.chain([&motion.force, &motion.force_sin]).flatten().any(|entry| constant(entry).is_some());
    let force = is_forced.then(|| "F(t)".to_owned());
    let count = motion.degrees();
    let mut names = format!(
        "x = ({}), {count} coordinate{}",
        motion.coordinates.join(", "),
        if count == 1 { "" } else { "s" }
    );
    if motion.bodies != motion.coordinates {
        names += &format!(": {}", motion.bodies.join(", "));
    }
    let with = match suffixes.iter().flatten().count() {
        0 => "",
        1 => ", with the contact force N along the row g of the gap",
        _ => ", with the contact force N along the row g of each gap",
    };
    let right = sum([force, term("load", std::slice::from_ref(&motion.load), "")]);
    let equation = format!("{} = {right}{with}", sum(left.into_iter().chain(contact)));
    vec![equation, names]
}

/// Returns a row for each wall: its name, position and law, restitution, the largest rate at which contact is sustained, and the
/// contact force behind it. What a law does not have is empty.
pub(super) fn contacts(definition: &Definition, names: &[[String; 2]]) -> Vec<[String; 6]> {
    let mut rows = Vec::new();
    for (gap, [z, w]) in definition.walls.iter().zip(names) {
        for (side, walls) in Side::BOTH.into_iter().zip(gap) {
            let mut forces = Vec::new();
            for (nth, wall) in (1..).zip(walls) {
                let of_gap = if names.len() > 1 { format!(" of {z}") } else { String::new() };
                let nth = if walls.len() > 1 { format!(" {nth}") } else { String::new() };
                let (law, [restitution, mesh_speed]) = match &wall.law {
                    WallLaw::Impact { restitution, mesh_speed, .. } => {
                        ("impact", [restitution, mesh_speed].map(text))
                    }
                    WallLaw::Elastic { pulls } => (elastic_law(wall, *pulls), Default::default()),
                };
                let force = match &wall.spring {
                    None => format!("keeps {z} = {} while pressed", text(&wall.at)),
                    Some(spring) => {
                        let preload = spring.preload.as_ref().and_then(constant);
                        let depth = minus(z, &wall.at);
                        let curve = wall.curve.as_ref().map(|law| {
                            let force = format!("({})", text(&law.force));
                            if side == Side::Right { force } else { negative(force) }
                        });
                        let own = [
                            curve.or_else(|| product(&spring.stiffness, &format!("({depth})"))),
                            product(&spring.damping, w),
                            if side == Side::Right { preload } else { preload.map(negative) },
                        ];
                        if wall.contact() == Contact::Pushing {
                            let larger = if side == Side::Right { "max" } else { "min" };
                            forces.push(Some(format!("{larger}(0, {})", sum(own))));
                        } else {
                            forces.extend(own);
                        }
                        let pieces = wall.curve.as_ref().map(|law| law.described(&definition.defaults));
                        sum(forces.clone()) + &pieces.unwrap_or_default()
                    }
                };
                let name = format!("{}{nth}{of_gap}", super::side(side));
                rows.push([name, text(&wall.at), law.to_owned(), restitution, mesh_speed, force]);
            }
        }
    }
    rows
}

fn elastic_law(wall: &Wall, pulls: bool) -> &'static str {
    match (wall.curve.is_some(), pulls) {
        (false, true) => "elastic",
        (false, false) => "elastic, only pushes",
        (true, true) => "curve",
        (true, false) => "curve, only pushes",
    }
}

/// Returns the name of a nonlinear spring's force.
fn spring_name(definition: &Definition, i: usize) -> String {
    if definition.springs.len() == 1 { "S".to_owned() } else { format!("S{}", i + 1) }
}

fn row(entries: &[Expression], names: &[String], result: &str) -> String {
    format!("{result} = {}", sum(entries.iter().zip(names).map(|(entry, name)| product(entry, name))))
}

/// Returns when each stage begins, and how entries that change are written; nothing without stages.
fn stages(motion: &MotionTable) -> Vec<String> {
    if motion.stages.is_empty() {
        return Vec::new();
    }
    let count = motion.stages.len();
    let begins = (1..=count).zip(&motion.stages).map(|(i, phase)| format!("{i} from phase {}", text(phase)));
    let begins = begins.collect::<Vec<_>>().join(", ");
    let span = span(motion.repeat);
    let stages = (1..=count).map(|i| format!("stage {i}")).collect::<Vec<_>>().join(" | ");
    vec![
        format!("stages  {begins} of {span}"),
        format!("        [{stages}] lists the values of an entry that changes"),
    ]
}

/// Returns the number and the error of the stages that replace entries with the phase; nothing without them.
fn steps(definition: &Definition, values: &[f64]) -> Vec<String> {
    let Ok(Steps { count: count @ 1.., error, .. }) = definition.steps(values) else { return Vec::new() };
    let MotionTable { repeat, tolerance, .. } = &definition.motion;
    vec![
        format!(
            "stages  {count} of equal length in {}, with the mean of each entry that contains the phase",
            span(*repeat)
        ),
        format!(
            "        their error is {error:.1e} of the largest value, within tolerance = {tolerance}; it falls with the square of their number"
        ),
    ]
}

/// Names the part of the forcing period in which all stages occur.
fn span(repeat: u32) -> String {
    match repeat {
        1 => "each forcing period".to_owned(),
        repeat => format!("each 1/{repeat} of the forcing period"),
    }
}

/// Returns the definition of a signal, such as `signal  seat = x'' - A*omega^2 cos(omega t)`.
fn signal_line(signal: &Signal, motion: &MotionTable) -> String {
    let rows = signal.rows.iter().zip(rates(motion)).flat_map(|(row, names)| terms(row, &names));
    let [own, cos, sin] = &signal.constants;
    let waves = waves(motion, 1, [cos, sin]).into_iter().chain([constant(own)]);
    format!("signal  {} = {}", signal.name, sum(rows.chain(waves)))
}

/// Returns the friction whose force is not the number 0.
fn acting(definition: &Definition) -> impl Iterator<Item = &DryFriction> {
    definition
        .friction
        .iter()
        .filter(|friction| friction.entries_of_force().any(|one| one.as_number() != Some(0.0)))
}

/// Returns the sliding rate, such as `x1' - x2' - speed`.
fn sliding_rate(friction: &DryFriction, motion: &MotionTable) -> String {
    let rates = friction.row.iter().zip(&motion.coordinates);
    minus(&sum(rates.map(|(entry, name)| product(entry, &format!("{name}'")))), &friction.speed)
}

/// Returns the friction force on the `i`-th coordinate; none if there is none.
fn friction_force(friction: &DryFriction, motion: &MotionTable, i: usize) -> Option<String> {
    let rate = sliding_rate(friction, motion);
    let sign = format!("sgn({rate})");
    let (row, force) = (&friction.row[i], &friction.force);
    if !friction.at_speed.is_empty() {
        return product(row, &format!("f(|{rate}|) {sign}"));
    }
    match row.as_number() {
        Some(0.0) => None,
        Some(1.0) => product(force, &sign),
        Some(-1.0) => {
            let term = product(force, &sign)?;
            Some(term.strip_prefix('-').map_or_else(|| format!("-{term}"), str::to_owned))
        }
        _ => Some(format!("{}*{} {sign}", factor(row), factor(force))),
    }
}

/// Returns one equation per coordinate, with an optional force along the row of each gap.
fn equations(definition: &Definition, forces: &[Option<String>]) -> impl Iterator<Item = String> {
    let motion = &definition.motion;
    let [displacements, rates, accelerations] = rates(motion);
    (0..motion.degrees()).map(move |i| {
        let along = motion.gaps.iter().zip(forces);
        let along = along.map(|(gap, force)| product(&gap.row[i], force.as_deref()?)).collect();
        let left = [
            terms(&motion.mass[i], &accelerations),
            terms(&motion.damping[i], &rates),
            terms(&motion.stiffness[i], &displacements),
            acting(definition).map(|friction| friction_force(friction, motion, i)).collect(),
            (definition.springs.iter().enumerate())
                .map(|(nth, spring)| product(&spring.row[i], &spring_name(definition, nth)))
                .collect(),
            along,
        ];
        let further = motion.harmonics.iter().flat_map(|h| waves(motion, h.order, [&h.cos[i], &h.sin[i]]));
        let force = waves(motion, 1, [&motion.force[i], &motion.force_sin[i]]).into_iter().chain(further);
        format!("{} = {}", sum(left.into_iter().flatten()), sum(force.chain([constant(&motion.load[i])])))
    })
}

/// Returns the names of the displacements, of their rates and of their accelerations.
fn rates(motion: &MotionTable) -> [Vec<String>; 3] {
    let rate = |suffix: &str| motion.coordinates.iter().map(|name| format!("{name}{suffix}")).collect();
    ["", "'", "''"].map(rate)
}

/// Returns the cosine and the sine of a harmonic with these factors.
fn waves(motion: &MotionTable, order: u32, [cos, sin]: [&Expression; 2]) -> [Option<String>; 2] {
    let Some(frequency) = motion.clock.entry() else { return [None, None] };
    let phase = phase(frequency, order);
    [product(cos, &format!("cos({phase})")), product(sin, &format!("sin({phase})"))]
}

fn terms(entries: &[impl Entry], names: &[String]) -> Vec<Option<String>> {
    entries.iter().zip(names).map(|(entry, name)| product(entry, name)).collect()
}

/// Returns the phase of a harmonic at the time `t`, such as `2 omega t`.
fn phase(frequency: &Expression, order: u32) -> String {
    let multiple = match (order, frequency.as_number()) {
        (1, _) => return product(frequency, "t").unwrap_or_else(|| "0".to_owned()),
        (_, Some(number)) => (f64::from(order) * number).to_string(),
        _ => {
            let factor = factor(frequency);
            let times = if factor.contains(['*', '/', '^']) { "*" } else { " " };
            format!("{order}{times}{factor}")
        }
    };
    format!("{multiple} t")
}

/// Joins terms with their signs; `0` without terms.
fn sum(terms: impl IntoIterator<Item = Option<String>>) -> String {
    let mut sum = String::new();
    for term in terms.into_iter().flatten() {
        match (sum.is_empty(), term.strip_prefix('-')) {
            (true, _) => sum = term,
            (false, Some(positive)) => sum += &format!(" - {positive}"),
            (false, None) => sum += &format!(" + {term}"),
        }
    }
    if sum.is_empty() { "0".to_owned() } else { sum }
}

/// Returns `coefficient name`; none if the coefficient is 0.
fn product(coefficient: &impl Entry, name: &str) -> Option<String> {
    let factor = match same(coefficient) {
        Some(one) => match one.as_number() {
            Some(0.0) => return None,
            Some(1.0) => return Some(name.to_owned()),
            Some(-1.0) => return Some(format!("-{name}")),
            _ => factor(one),
        },
        None => list(coefficient),
    };
    Some(format!("{factor} {name}"))
}

fn constant(load: &impl Entry) -> Option<String> {
    match same(load) {
        Some(one) => (one.as_number() != Some(0.0)).then(|| text(one)),
        None => Some(list(load)),
    }
}

/// Returns the negative of a term.
fn negative(term: String) -> String {
    match term.strip_prefix('-') {
        Some(positive) if is_product(positive) => positive.to_owned(),
        None if is_product(&term) => format!("-{term}"),
        _ => format!("-({term})"),
    }
}

/// Returns the value of an entry if it is the same in all stages.
fn same(entry: &impl Entry) -> Option<&Expression> {
    let (first, others) = entry.values().split_first()?;
    others.iter().all(|other| text(other) == text(first)).then_some(first)
}

/// Writes the values of an entry in all stages.
fn list(entry: &impl Entry) -> String {
    format!("[{}]", entry.values().iter().map(text).collect::<Vec<_>>().join(" | "))
}

/// Returns `name - entry`.
fn minus(name: &str, entry: &Expression) -> String {
    let entry_text = text(entry);
    match entry_text.strip_prefix('-').filter(|positive| is_product(positive)) {
        _ if entry.as_number() == Some(0.0) => name.to_owned(),
        Some(positive) => format!("{name} + {positive}"),
        None => format!("{name} - {}", factor(entry)),
    }
}

/// Returns an entry as a factor, in parentheses if it is a sum.
fn factor(entry: &Expression) -> String {
    let text = text(entry);
    match is_product(text.strip_prefix('-').unwrap_or(&text)) {
        true => text,
        false => format!("({text})"),
    }
}

/// Whether a text has no sum outside of parentheses. The sign of an exponent looks like a sum, which only adds
/// parentheses.
fn is_product(text: &str) -> bool {
    let mut depth = 0;
    text.chars().all(|c| {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        depth > 0 || !matches!(c, '+' | '-')
    })
}

/// Returns an entry as written; a number in its shortest form.
fn text(entry: &Expression) -> String {
    match entry.as_number() {
        Some(number) => number.to_string(),
        None => entry.text().to_owned(),
    }
}

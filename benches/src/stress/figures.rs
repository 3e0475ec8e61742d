//! Figures of `stress`: errors that may or may not grow, contacts that may or
//! may not be missed.

use std::io::Write;

use super::{EngineName, grazing, grid, long_runs, stiffness};
use rattlemap::map::scene::Format;
use rattlemap::show::drawing::axis::Axis;
use rattlemap::show::drawing::frame::Frame;
use rattlemap::show::drawing::legend::{Entry, Key, draw_head};
use rattlemap::show::drawing::{Canvas, Color, DARK, FAINT, Marker, Shape, write_figure};
use rattlemap::show::error::WriteError;

const SIZE: (u32, u32) = (1500, 1150);
const LEFT: f64 = 160.0;
/// Errors of nothing at all are drawn here, on the axis.
const LEAST_ERROR: f64 = 1e-17;

/// A figure, but for its curves.
struct Figure<'a> {
    title: &'a str,
    subtitle: &'a str,
    labels: [&'a str; 2],
}

/// Curves of one kind: one entry in the legend.
struct Group {
    label: String,
    color: Color,
    style: Style,
    curves: Vec<Vec<(f64, f64)>>,
}

#[derive(Clone, Copy)]
enum Style {
    Points(Shape),
    Dashes,
}

impl Group {
    fn key(&self) -> Key {
        match self.style {
            Style::Points(shape) => {
                Key::Marker(Marker { shape, color: self.color, radius: 6.0, hollow: false })
            }
            Style::Dashes => Key::Dashes { color: self.color },
        }
    }
}

fn color(engine: EngineName) -> Color {
    match engine {
        EngineName::LanesF32 => [0xd5, 0x5e, 0x00],
        EngineName::LanesF64 => [0x00, 0x72, 0xb2],
        EngineName::Reference => DARK,
    }
}

fn shape(engine: EngineName) -> Shape {
    match engine {
        EngineName::LanesF32 => Shape::Circle,
        EngineName::LanesF64 => Shape::Triangle,
        EngineName::Reference => Shape::Square,
    }
}

fn save(out: impl Write, figure: &Figure<'_>, groups: &[Group]) -> Result<(), WriteError> {
    write_figure(out, Format::Png, SIZE, |canvas| draw(canvas, figure, groups))
}

fn draw(canvas: &Canvas, figure: &Figure<'_>, groups: &[Group]) {
    let entries: Vec<Entry> = groups.iter().map(|group| Entry::new(group.key(), &group.label)).collect();
    let top = draw_head(canvas, figure.title, figure.subtitle, &entries) + 10.0;
    let points = || groups.iter().flat_map(|group| group.curves.iter().flatten());
    let frame = Frame {
        rect: canvas.panel(LEFT, top),
        x: Axis::decades(figure.labels[0], points().map(|point| point.0)),
        y: Axis::decades(figure.labels[1], points().map(|point| point.1)),
    };
    frame.draw_grid(canvas);
    for group in groups {
        for curve in &group.curves {
            let path: Vec<_> = curve.iter().map(|&(x, y)| frame.at(x, y)).collect();
            match group.style {
                Style::Dashes => {
                    path.windows(2).for_each(|two| canvas.dashes(two[0], two[1], 2.0, group.color));
                }
                Style::Points(shape) => {
                    canvas.stroke(&path, 1.5, group.color);
                    let marker = Marker { shape, color: group.color, radius: 5.0, hollow: false };
                    path.iter().for_each(|&at| canvas.marker(at, marker));
                }
            }
        }
    }
    frame.draw_axes(canvas, true);
}

/// Error against forcing periods, a curve per cell and engine.
pub(super) fn long_runs(out: impl Write, device: &str, rows: &[long_runs::Row]) -> Result<(), WriteError> {
    let mut cells: Vec<(f64, f64)> = rows.iter().map(|row| (row.e, row.omega)).collect();
    cells.dedup();
    cells.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    cells.dedup();
    let curve = |engine: EngineName, cell: (f64, f64)| {
        let here = rows.iter().filter(|row| row.engine == engine && (row.e, row.omega) == cell);
        here.map(|row| (f64::from(row.periods), row.error.max(LEAST_ERROR))).collect()
    };
    let group = |engine: EngineName| Group {
        label: engine.name().to_owned(),
        color: color(engine),
        style: Style::Points(shape(engine)),
        curves: cells.iter().map(|&cell| curve(engine, cell)).collect(),
    };
    let figure = Figure {
        title: "Error on stable cycles after many forcing periods: level curves are good, lower is better",
        subtitle: &format!(
            "{} cells, the worst of eight starts each; points on the lower edge: no error at all; {device}",
            cells.len()
        ),
        labels: ["forcing periods since the start", "largest error of the state"],
    };
    save(out, &figure, &EngineName::ALL.map(group))
}

/// Error of the speed of contact against distance from grazing, and what conditioning allows.
pub(super) fn grazing(out: impl Write, device: &str, rows: &[grazing::Row]) -> Result<(), WriteError> {
    let beyond = |engine: EngineName| {
        rows.iter().filter(move |row| row.engine == engine && row.distance > 0.0 && row.contacts == row.cells)
    };
    let measured = |engine: EngineName| Group {
        label: engine.name().to_owned(),
        color: color(engine),
        style: Style::Points(shape(engine)),
        curves: vec![beyond(engine).map(|row| (row.distance, row.speed_error.max(LEAST_ERROR))).collect()],
    };
    let law = |engine: EngineName, name: &str, color: Color| Group {
        label: format!("law for {} roundings of {name}", grazing::ROUNDINGS),
        color,
        style: Style::Dashes,
        curves: vec![beyond(engine).map(|row| (row.distance, row.law)).collect()],
    };
    let mut groups: Vec<Group> = EngineName::ALL.map(measured).into();
    groups.push(law(EngineName::LanesF32, "f32", color(EngineName::LanesF32)));
    groups.push(law(EngineName::Reference, "f64", FAINT));
    let figure = Figure {
        title: "Error of the contact speed near grazing: no curve may rise above its square-root law",
        subtitle: &format!("swings that reach a wall by a hair; lower is better; {device}"),
        labels: [
            "distance from grazing: how far the swing reaches beyond the wall, over half the backlash",
            "largest error of the contact speed, over omega b",
        ],
    };
    save(out, &figure, &groups)
}

/// Error against meshing stiffness, the worst motion of each.
pub(super) fn stiffness(out: impl Write, device: &str, rows: &[stiffness::Row]) -> Result<(), WriteError> {
    let worst = |engine: EngineName, of: fn(&stiffness::Row) -> Option<f64>| {
        let mut curve: Vec<(f64, f64)> = Vec::new();
        for row in rows.iter().filter(|row| row.engine == engine) {
            let Some(value) = of(row) else { continue };
            match curve.iter_mut().find(|(k, _)| *k == row.k) {
                Some((_, worst)) => *worst = worst.max(value),
                None => curve.push((row.k, value.max(LEAST_ERROR))),
            }
        }
        curve
    };
    let errors = |engine: EngineName| Group {
        label: format!("{} against the reference", engine.name()),
        color: color(engine),
        style: Style::Points(shape(engine)),
        curves: vec![worst(engine, |row| row.error)],
    };
    let rounding = |engine: EngineName| Group {
        label: format!("four roundings of all that is given, {}", engine.name()),
        color: color(engine),
        style: Style::Dashes,
        curves: vec![worst(engine, |row| Some(row.conditioning))],
    };
    let spread = Group {
        label: "lanes f64 against twice their steps".to_owned(),
        color: [0x00, 0x9e, 0x73],
        style: Style::Points(Shape::Circle),
        curves: vec![worst(EngineName::LanesF64, |row| row.spread)],
    };
    let scatter = Group {
        label: "scatter of the reference itself".to_owned(),
        color: DARK,
        style: Style::Points(Shape::Square),
        curves: vec![worst(EngineName::Reference, |row| Some(row.scatter))],
    };
    let lanes = [EngineName::LanesF32, EngineName::LanesF64];
    let groups: Vec<Group> =
        lanes.map(errors).into_iter().chain([spread, scatter]).chain(lanes.map(rounding)).collect();
    let figure = Figure {
        title: "Error against meshing stiffness, 8 forcing periods from rest: level is good, lower is better",
        subtitle: &format!("the worst of four motions that mesh; the supports' stiffness is 30; {device}"),
        labels: ["meshing stiffness k", "largest difference of states"],
    };
    save(out, &figure, &groups)
}

/// Share of the contacts that are missed against steps per period.
pub(super) fn grid(out: impl Write, device: &str, rows: &[grid::Swings]) -> Result<(), WriteError> {
    const DEPTH_COLORS: [Color; 5] =
        [[0x00, 0x9e, 0x73], [0x56, 0xb4, 0xe9], [0xe6, 0x9f, 0x00], [0xcc, 0x79, 0xa7], [0x60, 0x60, 0x60]];
    let mut depths: Vec<f64> = rows.iter().map(|row| row.depth).collect();
    depths.sort_by(|a, b| b.total_cmp(a));
    depths.dedup();
    // A whole decade below a single contact: the lower edge.
    let swings = rows.iter().map(|row| row.swings).max().unwrap_or(1);
    let least = 10f64.powf((0.5 / swings as f64).log10().floor());
    let share = |count: usize, row: &grid::Swings| (count as f64 / row.swings as f64).max(least);
    let first = rows.first().map(|row| row.engine);
    let by_ends = depths.iter().zip(DEPTH_COLORS).map(|(&depth, color)| {
        let here = rows.iter().filter(|row| Some(row.engine) == first && row.depth == depth);
        Group {
            label: format!("ends of steps alone, {depth:e} deep"),
            color,
            style: Style::Points(Shape::Square),
            curves: vec![
                here.map(|row| (f64::from(row.steps_asked), share(row.missed_by_ends, row))).collect(),
            ],
        }
    });
    let missed: usize = rows.iter().map(|row| row.missed).sum();
    let lanes = Group {
        label: format!("lanes, f32 and f64, every depth: {missed} missed"),
        color: color(EngineName::LanesF32),
        style: Style::Points(Shape::Circle),
        curves: vec![
            rows.iter()
                .filter(|row| Some(row.engine) == first && row.depth == depths[0])
                .map(|row| {
                    let all = rows.iter().filter(|other| other.steps_asked == row.steps_asked);
                    (f64::from(row.steps_asked), share(all.map(|other| other.missed).sum(), row))
                })
                .collect(),
        ],
    };
    let groups: Vec<Group> = by_ends.chain([lanes]).collect();
    let figure = Figure {
        title: "Contacts missed by a coarse grid: lower is better, points on the lower edge mean none",
        subtitle: &format!("swings that reach into a wall, depth over half the backlash; {device}"),
        labels: ["steps per forcing period asked for", "share of the contacts that is missed"],
    };
    save(out, &figure, &groups)
}

//! Figures of `stress`: errors over time, near grazing and against stiffness, and missed contacts.

use std::io::Write;

use super::EngineName::{LanesF32, LanesF64, Reference};
use super::{EngineName, grazing, grid, long_runs, stiffness};
use rattlemap::map::scene::{FigureStyle, Format};
use rattlemap::show::drawing::axis::Axis;
use rattlemap::show::drawing::frame::single;
use rattlemap::show::drawing::legend::{Entry, Key, draw_head};
use rattlemap::show::drawing::{Canvas, Color, DARK, FAINT, Marker, Shape, write_figure};
use rattlemap::show::error::WriteError;

const WIDTH: f64 = 1500.0;
const HEIGHT: f64 = 1150.0;
const LEFT: f64 = 160.0;
/// Smaller errors, and errors of zero, are drawn here, on the axis.
const LEAST_ERROR: f64 = 1e-17;

/// The texts of a figure.
struct Figure<'a> {
    title: &'a str,
    subtitle: &'a str,
    labels: [&'a str; 2],
}

type Curve = Vec<(f64, f64)>;

/// Curves with one entry in the legend: markers of this shape, or else dashes.
struct Group {
    label: String,
    color: Color,
    shape: Option<Shape>,
    curves: Vec<Curve>,
}

impl Group {
    fn dashes(label: String, color: Color, curve: Curve) -> Group {
        Group { label, color, shape: None, curves: vec![curve] }
    }

    fn points(label: impl Into<String>, color: Color, shape: Shape, curves: Vec<Curve>) -> Group {
        Group { label: label.into(), color, shape: Some(shape), curves }
    }

    fn of_engine(engine: EngineName, label: String, curves: Vec<Curve>) -> Group {
        let (color, shape) = match engine {
            LanesF32 => (color(engine), Shape::Circle),
            LanesF64 => (color(engine), Shape::Triangle),
            Reference => (color(engine), Shape::Square),
        };
        Group::points(label, color, shape, curves)
    }

    fn marker(&self, radius: f64) -> Option<Marker> {
        self.shape.map(|shape| Marker { shape, color: self.color, radius, hollow: false })
    }
}

fn color(engine: EngineName) -> Color {
    match engine {
        LanesF32 => [0xd5, 0x5e, 0x00],
        LanesF64 => [0x00, 0x72, 0xb2],
        Reference => DARK,
    }
}

fn save(out: impl Write, figure: &Figure<'_>, groups: &[Group]) -> Result<(), WriteError> {
    let canvas = Canvas::new(&FigureStyle::default(), WIDTH);
    draw(&canvas, figure, groups);
    write_figure(out, Format::Png, &canvas)
}

fn draw(canvas: &Canvas, figure: &Figure<'_>, groups: &[Group]) {
    let key = |group: &Group| group.marker(6.0).map_or(Key::Dashes { color: group.color }, Key::Marker);
    let entries: Vec<Entry> = groups.iter().map(|group| Entry::new(key(group), &group.label)).collect();
    let top = draw_head(canvas, figure.title, figure.subtitle, &entries) + 10.0;
    let points = || groups.iter().flat_map(|group| group.curves.iter().flatten());
    let x = Axis::decades(figure.labels[0], points().map(|point| point.0));
    let y = Axis::decades(figure.labels[1], points().map(|point| point.1));
    let frame = single(canvas, top, HEIGHT, [x, y], LEFT);
    frame.draw_grid(canvas);
    for group in groups {
        for curve in &group.curves {
            let path: Vec<_> = curve.iter().map(|&(x, y)| frame.at(x, y)).collect();
            match group.marker(5.0) {
                None => path.windows(2).for_each(|two| canvas.dashes(two[0], two[1], 2.0, group.color)),
                Some(marker) => {
                    canvas.stroke(&path, 1.5, group.color);
                    path.iter().for_each(|&at| canvas.marker(at, marker));
                }
            }
        }
    }
    frame.draw_axes(canvas, true);
}

/// Draws the error against forcing periods, with one curve per cell and engine.
pub(super) fn long_runs(out: impl Write, device: &str, rows: &[long_runs::Row]) -> Result<(), WriteError> {
    let mut cells: Vec<(f64, f64)> = rows.iter().map(|row| (row.e, row.omega)).collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    cells.dedup();
    let curve = |engine: EngineName, cell: (f64, f64)| {
        let here = rows.iter().filter(|row| row.engine == engine && (row.e, row.omega) == cell);
        here.map(|row| (f64::from(row.periods), row.error.max(LEAST_ERROR))).collect()
    };
    let group = |engine: EngineName| {
        let curves = cells.iter().map(|&cell| curve(engine, cell)).collect();
        Group::of_engine(engine, engine.name().to_owned(), curves)
    };
    let figure = Figure {
        title: "Error on stable cycles after many forcing periods: level curves are good, lower is better",
        subtitle: &format!(
            "{} cells, largest error of eight starts each; points on the lower edge: no error; {device}",
            cells.len()
        ),
        labels: ["forcing periods since the start", "largest error of the state"],
    };
    save(out, &figure, &EngineName::ALL.map(group))
}

/// Draws the error of the contact speed against the distance from grazing, and the square-root law.
pub(super) fn grazing(out: impl Write, device: &str, rows: &[grazing::Row]) -> Result<(), WriteError> {
    let curve = |engine: EngineName, of: fn(&grazing::Row) -> f64| -> Curve {
        let of_engine = rows.iter().filter(|row| row.engine == engine);
        let beyond = of_engine.filter(|row| row.distance > 0.0 && row.contacts == row.cells);
        beyond.map(|row| (row.distance, of(row))).collect()
    };
    let errors = |engine: EngineName| {
        let curve = curve(engine, |row| row.speed_error.max(LEAST_ERROR));
        Group::of_engine(engine, engine.name().to_owned(), vec![curve])
    };
    let law = |engine: EngineName, name: &str, color: Color| {
        let label = format!("law for {} roundings of {name}", grazing::ROUNDINGS);
        Group::dashes(label, color, curve(engine, |row| row.law))
    };
    let laws = [law(LanesF32, "f32", color(LanesF32)), law(Reference, "f64", FAINT)];
    let groups: Vec<Group> = EngineName::ALL.map(errors).into_iter().chain(laws).collect();
    let figure = Figure {
        title: "Error of the contact speed near grazing: no curve may rise above its square-root law",
        subtitle: &format!("swings that just reach a wall; lower is better; {device}"),
        labels: [
            "distance from grazing: how far the swing reaches behind the wall, over half the backlash",
            "largest error of the contact speed, over omega b",
        ],
    };
    save(out, &figure, &groups)
}

/// Draws the largest error of the motions against meshing stiffness.
pub(super) fn stiffness(out: impl Write, device: &str, rows: &[stiffness::Row]) -> Result<(), WriteError> {
    let worst = |engine: EngineName, of: fn(&stiffness::Row) -> Option<f64>| {
        let mut curve = Curve::new();
        for row in rows.iter().filter(|row| row.engine == engine) {
            let Some(value) = of(row) else { continue };
            match curve.iter_mut().find(|(k, _)| *k == row.k) {
                Some((_, worst)) => *worst = worst.max(value),
                None => curve.push((row.k, value.max(LEAST_ERROR))),
            }
        }
        curve
    };
    let errors = |engine: EngineName| {
        let label = format!("{} against the reference", engine.name());
        Group::of_engine(engine, label, vec![worst(engine, |row| row.error)])
    };
    let rounding = |engine: EngineName| {
        let label = format!("four roundings of start and parameters, {}", engine.name());
        Group::dashes(label, color(engine), worst(engine, |row| Some(row.conditioning)))
    };
    let spread = Group::points(
        "lanes f64 against lanes with twice the steps",
        [0x00, 0x9e, 0x73],
        Shape::Circle,
        vec![worst(LanesF64, |row| row.spread)],
    );
    let scatter = worst(Reference, |row| Some(row.scatter));
    let scatter = Group::of_engine(Reference, "scatter of the reference".to_owned(), vec![scatter]);
    let lanes = [LanesF32, LanesF64];
    let groups: Vec<Group> =
        lanes.map(errors).into_iter().chain([spread, scatter]).chain(lanes.map(rounding)).collect();
    let figure = Figure {
        title: "Error against meshing stiffness, 8 forcing periods from rest: level is good, lower is better",
        subtitle: &format!(
            "largest error of four motions with meshing; stiffness of the supports 30; {device}"
        ),
        labels: ["meshing stiffness k", "largest difference of states"],
    };
    save(out, &figure, &groups)
}

/// Draws the fraction of missed contacts against steps per period.
pub(super) fn grid(out: impl Write, device: &str, rows: &[grid::Swings]) -> Result<(), WriteError> {
    const DEPTH_COLORS: [Color; 5] =
        [[0x00, 0x9e, 0x73], [0x56, 0xb4, 0xe9], [0xe6, 0x9f, 0x00], [0xcc, 0x79, 0xa7], [0x60, 0x60, 0x60]];
    let mut depths: Vec<f64> = rows.iter().map(|row| row.depth).collect();
    depths.sort_by(|a, b| b.total_cmp(a));
    depths.dedup();
    // The lower edge is at least a decade below the fraction of a single contact.
    let swings = rows.iter().map(|row| row.swings).max().unwrap_or(1);
    let least = 10f64.powf((0.5 / swings as f64).log10().floor());
    let first = rows.first().map(|row| row.engine);
    let curve = |depth: f64, missed: &dyn Fn(&grid::Swings) -> usize| -> Curve {
        let here = rows.iter().filter(|row| Some(row.engine) == first && row.depth == depth);
        let fraction = |row: &grid::Swings| (missed(row) as f64 / row.swings as f64).max(least);
        here.map(|row| (f64::from(row.steps_asked), fraction(row))).collect()
    };
    let by_ends = depths.iter().zip(DEPTH_COLORS).map(|(&depth, color)| {
        let label = format!("checks at ends of steps only, depth {depth:e}");
        Group::points(label, color, Shape::Square, vec![curve(depth, &|row| row.missed_by_ends)])
    });
    let missed: usize = rows.iter().map(|row| row.missed).sum();
    let of_steps = |row: &grid::Swings| {
        rows.iter().filter(|other| other.steps_asked == row.steps_asked).map(|other| other.missed).sum()
    };
    let label = format!("lanes, f32 and f64, every depth: {missed} missed");
    let lanes = Group::of_engine(LanesF32, label, vec![curve(depths[0], &of_steps)]);
    let groups: Vec<Group> = by_ends.chain([lanes]).collect();
    let figure = Figure {
        title: "Contacts missed by a coarse grid: lower is better, points on the lower edge mean none",
        subtitle: &format!("swings that reach behind a wall, depth over half the backlash; {device}"),
        labels: ["requested steps per forcing period", "fraction of missed contacts"],
    };
    save(out, &figure, &groups)
}

//! Figures of a run-up: the motion and its impacts against time, and the amplitudes of the orders against the parameter.

use crate::map::scene::FigureStyle;
use crate::show::caption;
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::{Frame, column, stacked};
use crate::show::drawing::legend::{Entry, Key, draw_head};
use crate::show::drawing::{Canvas, Color, DARK, Marker, Shape, wall_color};
use crate::show::figure::orbit::gaps::PlotGap;
use crate::show::layers::colors::linear;
use crate::show::names;
use crate::show::run_up::{HIGHEST_ORDER, Orders, Quantity, RunUp, Series};
use crate::show::symbols::{axis_label, number, symbol, with_unit};
use rattlemap_dynamics::model::{Model, ModelError, Side};
use rattlemap_dynamics::orbit::{Event, EventKind};

/// Name of the file of the figure of the motion without its extension.
pub const RUN_UP: &str = "run_up";
/// Name of the file of the Campbell diagram without its extension.
pub const CAMPBELL: &str = "campbell";

/// Width, least distance of panels from the left edge, height of head and foot, and height of a panel.
const WIDTH: f64 = 1600.0;
const LEFT: f64 = 130.0;
const HEAD_AND_FOOT: f64 = 330.0;
const PANEL: f64 = 420.0;
/// Height of the panel of the parameter, in panels.
const LOW: f64 = 0.55;
/// Largest number of points of a line. A longer motion is drawn by its extremes.
const POINTS: usize = 20_000;
/// Decades of amplitudes below the largest one that have colours of their own, and columns of the picture.
const DECADES: f64 = 3.0;
const COLUMNS: usize = 800;

fn title(model: &dyn Model, run: &RunUp) -> [String; 2] {
    let title = format!(
        "{}: {}",
        model.title(),
        caption::parameters(model, |parameter| *parameter.name == *run.ramp.name)
    );
    let parameter = model.parameters().iter().find(|parameter| *parameter.name == *run.ramp.name);
    let unit = |unit: Option<&str>| unit.map_or(String::new(), |unit| format!(" {unit}"));
    let [from, to, time] = [run.ramp.from, run.ramp.to, run.ramp.time].map(number);
    [
        title,
        format!(
            "{} from {from} to {to}{} in the time {time}{}, constant within each period",
            symbol(&run.ramp.name),
            unit(parameter.and_then(|parameter| parameter.unit.as_deref())),
            unit(model.units().time.as_deref()),
        ),
    ]
}

fn parameter_label(model: &dyn Model, run: &RunUp) -> String {
    let found = model.parameters().iter().find(|parameter| *parameter.name == *run.ramp.name);
    found.map_or(String::new(), axis_label)
}

/// Draws the gaps, displacements and signals, the approach speeds of contacts, and the parameter against time.
///
/// # Errors
/// [`ModelError`] if the model is not valid.
pub(crate) fn draw(
    style: &FigureStyle,
    model: &dyn Model,
    run: &RunUp,
    series: &Series,
) -> Result<Canvas, ModelError> {
    let canvas = Canvas::new(style, WIDTH);
    let contacts: Vec<(f64, &Event, f64)> = contacts(model, run)?;
    let kinds = [EventKind::Impact, EventKind::MeshStart].into_iter();
    let kinds = kinds.filter(|kind| contacts.iter().any(|(_, event, _)| event.kind == *kind));
    let mut legend: Vec<Entry> = kinds
        .map(|kind| {
            let text = if kind == EventKind::Impact { "impact" } else { "contact begins" };
            Entry::new(Key::Marker(Marker { shape: Shape::of(kind), ..Marker::dot(DARK, 6.0) }), text)
        })
        .collect();
    let sides =
        Side::BOTH.into_iter().filter(|side| contacts.iter().any(|(_, event, _)| event.side == *side));
    legend.extend(sides.map(|side| {
        Entry::new(
            Key::Patch { color: wall_color(side), opacity: 1.0 },
            &format!("{} wall", names::side(side)),
        )
    }));
    let [heading, subtitle] = title(model, run);
    let top = draw_head(&canvas, &heading, &subtitle, &legend) + 14.0;
    let shown: Vec<&Quantity> = series.quantities.iter().filter(|quantity| !quantity.is_repeated).collect();
    let around = |label: &str, values: &mut dyn Iterator<Item = f64>| {
        let values: Vec<f64> = values.collect();
        let largest = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        Axis::around(label, values.into_iter(), (1e-6 * largest).max(1e-300))
    };
    let mut axes: Vec<Axis> =
        shown.iter().map(|quantity| around(&quantity.label, &mut quantity.values.iter().copied())).collect();
    if !contacts.is_empty() {
        let label = with_unit("approach speed", model.units().gap_velocity().as_deref());
        let axis = around(&label, &mut contacts.iter().map(|(.., speed)| *speed));
        axes.push(Axis::exact(&label, 0.0, axis.high));
    }
    axes.push(around(&parameter_label(model, run), &mut series.at.iter().map(|at| at[1])));
    let mut shares = vec![1.0; axes.len()];
    shares[axes.len() - 1] = LOW;
    let edges = stacked(&canvas, top, HEAD_AND_FOOT + PANEL * shares.iter().sum::<f64>(), &shares);
    let end = run.parts.last().and_then(|(_, history)| history.samples.last()).map_or(1.0, |last| last.t);
    let time = Axis::exact(&with_unit("time, t", model.units().time.as_deref()), 0.0, end);
    let frames = column(&canvas, edges.into_iter().zip(axes).collect(), &time, LEFT, 0.0);
    let gaps = PlotGap::all(model, &model.oscillator()?);
    for (frame, quantity) in frames.iter().zip(&shown) {
        frame.draw_grid(&canvas);
        let at = |i: usize| frame.at(series.at[i][0], quantity.values[i]);
        let line: Vec<_> = extremes(&quantity.values).into_iter().map(at).collect();
        canvas.stroke(&line, 1.2, DARK);
        if let Some(gap) = quantity.gap {
            draw_walls(&canvas, frame, &gaps[gap]);
            let own = contacts.iter().filter(|(_, event, _)| event.gap == gap);
            let places = own.map(|(t, event, _)| (frame.at(*t, gaps[gap].wall(event.side)), *event));
            places.for_each(|(at, event)| canvas.marker(at, marker(event)));
        }
    }
    let rest = &frames[shown.len()..];
    if let [speeds, _] = rest {
        speeds.draw_grid(&canvas);
        contacts.iter().for_each(|(t, event, speed)| canvas.marker(speeds.at(*t, *speed), marker(event)));
    }
    if let Some(frame) = rest.last() {
        frame.draw_grid(&canvas);
        let steps: Vec<_> = series.at.iter().map(|[t, value]| frame.at(*t, *value)).collect();
        canvas.stroke(&steps, 2.2, DARK);
    }
    for (n, frame) in frames.iter().enumerate() {
        frame.draw_axes(&canvas, n + 1 == frames.len());
    }
    Ok(canvas)
}

/// Returns time, event and approach speed of each impact and each beginning of a contact.
fn contacts<'r>(model: &dyn Model, run: &'r RunUp) -> Result<Vec<(f64, &'r Event, f64)>, ModelError> {
    let oscillator = model.oscillator()?;
    let events = run.parts.iter().flat_map(|(_, history)| &history.events);
    let begins = events.filter(|event| event.kind != EventKind::MeshEnd);
    Ok(begins
        .map(|event| (event.t, event, oscillator.gap_value(event.gap, &event.before, 1).abs()))
        .collect())
}

fn marker(event: &Event) -> Marker {
    Marker { shape: Shape::of(event.kind), ..Marker::dot(wall_color(event.side), 3.0) }
}

/// Draws the walls of a gap, as far as they are within the panel.
fn draw_walls(canvas: &Canvas, frame: &Frame, gap: &PlotGap) {
    for side in Side::BOTH {
        for (at, width) in gap.wall_lines(side).filter(|(at, _)| (frame.y.low..=frame.y.high).contains(at)) {
            canvas.stroke(&[frame.at(frame.x.low, at), frame.at(frame.x.high, at)], width, wall_color(side));
        }
    }
}

/// Returns the places of all values, or of the smallest and the largest one in each of many equal parts.
fn extremes(values: &[f64]) -> Vec<usize> {
    let part = values.len().div_ceil(POINTS / 2);
    if part <= 2 {
        return (0..values.len()).collect();
    }
    let both = (0..values.len()).step_by(part).flat_map(|start| {
        let places = || start..(start + part).min(values.len());
        let by_value = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
        let [low, high] =
            [places().min_by(by_value), places().max_by(by_value)].map(Option::unwrap_or_default);
        [low.min(high), low.max(high)]
    });
    both.collect()
}

/// Draws the amplitudes of the orders of each gap, displacement and signal against the parameter; against time if it does not change.
pub(crate) fn draw_campbell(
    style: &FigureStyle,
    model: &dyn Model,
    run: &RunUp,
    series: &Series,
    orders: &Orders,
) -> Canvas {
    let canvas = Canvas::new(style, WIDTH);
    let [heading, subtitle] = title(model, run);
    let patch =
        |(share, text): (f64, &str)| Entry::new(Key::Patch { color: linear(share), opacity: 1.0 }, text);
    let legend = [
        (0.0, "1/1000 of the largest amplitude of a panel, or less"),
        (1.0 / DECADES, "1/100"),
        (2.0 / DECADES, "1/10"),
        (1.0, "largest amplitude"),
    ];
    let top = draw_head(&canvas, &heading, &subtitle, &legend.map(patch)) + 14.0;
    let which = usize::from(run.ramp.from != run.ramp.to);
    let along = |at: &[f64; 2]| at[which];
    let label = [with_unit("time, t", model.units().time.as_deref()), parameter_label(model, run)];
    let ends = orders.windows.iter().map(|(at, _)| along(at));
    let (low, high) =
        ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
    let x = Axis::exact(&label[which], low, high);
    let shown: Vec<usize> =
        (0..series.quantities.len()).filter(|&i| !series.quantities[i].is_repeated).collect();
    let of = |i: usize| orders.windows.iter().map(move |(_, amplitudes)| &amplitudes[i][1..]);
    let largest = |i: usize| of(i).flatten().fold(0.0, |most: f64, amplitude| most.max(*amplitude));
    let axis = |&i: &usize| {
        let least = largest(i) * 10f64.powf(-DECADES);
        let highest = of(i).filter_map(|lines| lines.iter().rposition(|amplitude| *amplitude > least)).max();
        let highest =
            highest.map_or(0.0, |line| Orders::order(line + 1)).ceil().clamp(4.0, HIGHEST_ORDER as f64);
        let name = series.quantities[i].label.split(" [").next().unwrap_or_default();
        Axis::exact(&format!("order of {name}"), 0.0, highest)
    };
    let shares = vec![1.0; shown.len()];
    let edges = stacked(&canvas, top, HEAD_AND_FOOT + PANEL * shares.len() as f64, &shares);
    let panels = edges.into_iter().zip(shown.iter().map(axis)).collect();
    let frames = column(&canvas, panels, &x, LEFT, 0.0);
    for (n, (frame, &i)) in frames.iter().zip(&shown).enumerate() {
        let most = largest(i);
        let color = |amplitude: f64| -> Color { linear(1.0 + (amplitude / most).log10() / DECADES) };
        let nearest = |column: usize| {
            let at = x.low + (column as f64 + 0.5) / COLUMNS as f64 * (x.high - x.low);
            let distance = |window: &&([f64; 2], Vec<Vec<f64>>)| (along(&window.0) - at).abs();
            orders.windows.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
        };
        let columns: Vec<_> = (0..COLUMNS).map(nearest).collect();
        let rows = (frame.y.high / Orders::order(1)).round() as usize;
        // The middle of a row is the order of its line; the mean, line 0, is left out.
        canvas.raster(frame.rect, [COLUMNS, 2 * rows], |[column, row]| {
            let line = row.div_ceil(2).max(1);
            color(columns[column].map_or(0.0, |(_, amplitudes)| amplitudes[i][line]))
        });
        frame.draw_axes(&canvas, n + 1 == frames.len());
    }
    canvas
}

//! A sketch of a model: its coordinates with the springs and dampers between them, and a row for each gap, for friction and for stages.

use rattlemap_dynamics::model::{Model, Side};

use crate::map::scene::FigureStyle;
use crate::model_file::{FileModel, Staged};
use crate::show::drawing::{Align, Canvas, DARK, FAINT, GRID, Marker, Point, Rect, SMALL, wall_color};
use crate::show::names;
use crate::show::symbols::symbol;
use crate::text::expression::Expression;

/// Width of the sketch, heights of a line of text, of a box and of the sign of a spring, and place of the ground.
const WIDTH: f64 = 480.0;
const LINE: f64 = 28.0;
const BOX: f64 = 56.0;
const HIGH: f64 = 14.0;
const GROUND: f64 = 20.0;

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Mass,
    Spring,
    Damper,
}

/// Draws the sketch.
pub(crate) fn draw(model: &FileModel) -> Canvas {
    let definition = model.definition();
    let canvas = Canvas::new(&FigureStyle::default(), WIDTH);
    // Writes a text and returns the place below it. Browsers may replace the typeface by a wider one.
    let write = |text: &str, at: Point, color| {
        let lines = canvas.lines(text, SMALL, 0.85 * (WIDTH - at.0));
        let places = (0..).map(|nth| at.1 + LINE * f64::from(nth));
        lines.lines.iter().zip(places).fold(at.1, |_, (line, y)| {
            canvas.text(line, (at.0, y), lines.size, Align::Left, color);
            y + LINE
        })
    };
    let equations = model.equations();
    let lines_of = |kind: &'static str| equations.iter().filter_map(move |line| line.strip_prefix(kind));
    let (mut y, mut contacts) = (coordinates(&canvas, model), model.contacts().into_iter());
    for ((gap, walls), equation) in ('a'..).zip(&definition.walls).zip(lines_of("gap   ")) {
        if walls.iter().all(Vec::is_empty) {
            continue;
        }
        let letter = if definition.walls.len() > 1 { format!("gap {gap}:  ") } else { "gap ".to_owned() };
        let (middle, x) = (write(&(letter + equation), (0.0, y), DARK) + 8.0, WIDTH / 2.0);
        canvas.stroke(&[(x - 40.0, middle), (x + 40.0, middle)], 1.5, FAINT);
        canvas.marker((x, middle), Marker::dot(DARK, 7.0));
        y = middle + 1.4 * LINE;
        for (side, walls) in Side::BOTH.into_iter().zip(walls) {
            for (nth, wall) in (0..).zip(walls) {
                let [_, at, law, restitution, ..] = contacts.next().unwrap_or_default();
                let (out, color) = (if side == Side::Right { 1.0 } else { -1.0 }, wall_color(side));
                let (near, has_spring) = (x + out * (72.0 + 44.0 * f64::from(nth)), wall.spring.is_some());
                let far = near + if has_spring { 28.0 * out } else { 0.0 };
                let [top, bottom] = [middle - 18.0, middle + 18.0];
                hatch(&canvas, [(far, top), (far, bottom)], (8.0 * out, 8.0));
                canvas.stroke(
                    &[(near, top), (near, bottom)],
                    if restitution.is_empty() { 2.5 } else { 6.0 },
                    color,
                );
                if has_spring {
                    sign(&canvas, Kind::Spring, [near, far], middle);
                }
                let law = match (restitution.is_empty(), has_spring) {
                    (true, _) => law,
                    (false, true) => format!("impact, restitution {restitution}, then elastic"),
                    (false, false) => format!("rigid, restitution {restitution}"),
                };
                y = write(&format!("{} at {at}: {law}", names::side(side)), (0.0, y), color);
            }
        }
        y += 0.4 * LINE;
    }
    for text in lines_of("friction  ") {
        canvas.outline(Rect { left: 14.0, top: y - 14.0, right: 54.0, bottom: y + 10.0 }, 2.0);
        hatch(&canvas, [(8.0, y + 12.0), (60.0, y + 12.0)], (-8.0, 8.0));
        y = write(&format!("dry friction {text}"), (72.0, y), DARK) + 0.4 * LINE;
    }
    for text in lines_of("spring  ") {
        sign(&canvas, Kind::Spring, [8.0, 60.0], y);
        y = write(&format!("nonlinear spring {text}"), (72.0, y), DARK) + 0.4 * LINE;
    }
    let phases: Vec<f64> =
        definition.motion.stages.iter().map(|phase| phase.evaluate(&|i| model.value(i))).collect();
    if !phases.is_empty() {
        write("stages", (0.0, y), DARK);
        let place = |phase: f64| 90.0 + (WIDTH - 120.0) * phase;
        let (begins, ends) = ([0.0].iter().chain(&phases), phases.iter().chain([&1.0]));
        for (nth, (&from, &to)) in begins.zip(ends).enumerate().filter(|(_, (from, to))| to > from) {
            canvas
                .outline(Rect { left: place(from), top: y - 12.0, right: place(to), bottom: y + 12.0 }, 1.5);
            // Before the first phase the last stage lasts.
            let stage = if nth == 0 { phases.len() } else { nth };
            canvas.text(&stage.to_string(), (place((from + to) / 2.0), y), SMALL, Align::Center, DARK);
        }
        y += LINE;
        let repeat = definition.motion.repeat;
        let end = if repeat == 1 { "T".to_owned() } else { format!("T/{repeat}") };
        for (phase, text) in [(0.0, "0"), (1.0, &end)] {
            canvas.text(text, (place(phase), y), SMALL, Align::Center, DARK);
        }
        y += LINE;
    }
    canvas.set_height(y);
    canvas
}

/// Draws the coordinates in a row with their links and forces. Links between neighbours are beside the boxes, all others below. Returns
/// the place below them.
fn coordinates(canvas: &Canvas, model: &FileModel) -> f64 {
    let motion = &model.definition().motion;
    let pitch = ((WIDTH - GROUND - 8.0) / motion.degrees() as f64).min(170.0);
    let half = (0.26 * pitch).min(40.0);
    let center = |node: usize| if node == 0 { GROUND } else { GROUND + pitch * node as f64 - half };
    let (top, bottom) = (1.8 * LINE, 1.8 * LINE + BOX);
    // The right end of the last link in each lane below the boxes.
    let mut lanes: Vec<usize> = Vec::new();
    let links = links(model);
    for &(a, b, kind) in &links {
        if b == a + 1 {
            let beside: Vec<_> = links.iter().filter(|link| (link.0, link.1) == (a, b)).collect();
            let nth = beside.iter().take_while(|link| link.2 != kind).count() as f64;
            let from = if a == 0 { GROUND } else { center(a) + half };
            sign(
                canvas,
                kind,
                [from, center(b) - half],
                top + BOX * (nth + 1.0) / (beside.len() as f64 + 1.0),
            );
            continue;
        }
        let lane = lanes.iter().position(|&end| end <= a).unwrap_or(lanes.len());
        lanes.resize(lanes.len().max(lane + 1), b);
        lanes[lane] = b;
        let y = bottom + 22.0 * (lane as f64 + 0.9);
        for node in [a, b].into_iter().filter(|&node| node > 0) {
            canvas.stroke(&[(center(node), bottom), (center(node), y)], 1.5, DARK);
        }
        sign(canvas, kind, [a, b].map(center), y);
    }
    let end = bottom + 22.0 * (lanes.len() as f64 + 0.4);
    if links.iter().any(|link| link.0 == 0) {
        hatch(canvas, [(GROUND, top - 6.0), (GROUND, end)], (-8.0, 8.0));
    }
    for (i, name) in motion.coordinates.iter().enumerate() {
        let (x, y) = (center(i + 1), top + BOX / 2.0);
        canvas.fill(Rect::around((x, y), (half, BOX / 2.0)), GRID, 1.0);
        canvas.outline(Rect::around((x, y), (half, BOX / 2.0)), 2.0);
        canvas.text(&canvas.fitted(&symbol(name), SMALL, 1.8 * half), (x, y), SMALL, Align::Center, DARK);
        let further = motion.harmonics.iter().flat_map(|harmonic| [&harmonic.cos[i], &harmonic.sin[i]]);
        let mut forces = further.chain([&motion.force[i], &motion.force_sin[i]]);
        if forces.any(|entry| entry.as_number() != Some(0.0)) {
            canvas.text("F(t)", (x, 0.5 * LINE), SMALL, Align::Center, DARK);
            let (y, tip) = (1.3 * LINE, x + 18.0);
            canvas.stroke(&[(x - 18.0, y), (tip, y)], 2.0, DARK);
            canvas.polygon(&[(tip + 4.0, y), (tip - 6.0, y - 5.0), (tip - 6.0, y + 5.0)], DARK);
        }
    }
    end + 0.9 * LINE
}

/// Returns pairs of coordinates, counted from 1, that the matrices couple, and those that springs and dampers connect to the ground, 0.
///
/// A coordinate has a spring to the ground if the couplings do not add up to its own stiffness. Numbers tell this: the values of the
/// parameters, slightly changed, because parameters that happen to be equal or 0 are no property of the model.
fn links(model: &FileModel) -> Vec<(usize, usize, Kind)> {
    let motion = &model.definition().motion;
    // The name after those of all parameters is the phase.
    let changed = |i: usize| match model.parameters().get(i).map_or(0.0, |_| model.value(i)) {
        0.0 => 0.7 + 0.01 * i as f64,
        value => value * (1.0 + 0.003 * (i as f64 + 1.0).sin()),
    };
    let number = |entry: &Expression| entry.evaluate(&changed);
    let in_stages = 0..motion.stages.len().max(1);
    // Stages have slightly different weights, so that values of opposite signs do not cancel.
    let staged = |entry: &Staged| {
        in_stages.clone().map(|stage| (1.0 + 0.1 * stage as f64) * number(entry.in_stage(stage))).sum()
    };
    let of_stages = |rows: &[Vec<Staged>]| rows.iter().map(|row| row.iter().map(staged).collect()).collect();
    let mut links = Vec::new();
    let mut stiffness: Vec<Vec<f64>> = of_stages(&motion.stiffness);
    for spring in &model.definition().springs {
        let row: Vec<f64> = spring.row.iter().map(number).collect();
        let add = |(entries, factor): (&mut Vec<f64>, &f64)| {
            entries.iter_mut().zip(&row).for_each(|(entry, other)| *entry += factor * other);
        };
        stiffness.iter_mut().zip(&row).for_each(add);
    }
    for (kind, matrix) in [
        (Kind::Mass, motion.mass.iter().map(|row| row.iter().map(number).collect()).collect()),
        (Kind::Spring, stiffness),
        (Kind::Damper, of_stages(&motion.damping)),
    ] {
        let matrix: Vec<Vec<f64>> = matrix;
        let scale = matrix.iter().flatten().fold(0.0, |most: f64, entry| most.max(entry.abs()));
        let is_something = |value: f64| value.abs() > 1e-9 * scale;
        // A skew-symmetric part does no work: it is no damper.
        let coupling = |i: usize, j: usize| (matrix[i][j] + matrix[j][i]) / 2.0;
        let pairs = (0..matrix.len()).flat_map(|i| (0..i).map(move |j| (j, i)));
        let pairs: Vec<_> = pairs.filter(|&(i, j)| is_something(coupling(i, j))).collect();
        let is_coupled = |i: usize| pairs.iter().any(|&(a, b)| a == i || b == i);
        let others = |i: usize| (0..matrix.len()).filter(move |&j| j != i).map(move |j| coupling(i, j).abs());
        let rests: Vec<f64> = (0..matrix.len()).map(|i| matrix[i][i] - others(i).sum::<f64>()).collect();
        // With a negative rest the coordinates are coupled in ratios, and the rests say nothing about the ground.
        let is_chain = (0..matrix.len()).all(|i| rests[i] > -1e-9 * scale || !is_coupled(i));
        let to_ground =
            (0..matrix.len()).filter(|&i| kind != Kind::Mass && is_chain && is_something(rests[i]));
        links.extend(to_ground.map(|i| (0, i + 1, kind)));
        links.extend(pairs.iter().map(|&(i, j)| (i + 1, j + 1, kind)));
    }
    links.sort_by_key(|&(a, b, kind)| (a, b, kind as u8));
    links
}

/// Draws the sign of a link on a level line.
fn sign(canvas: &Canvas, kind: Kind, [from, to]: [f64; 2], y: f64) {
    let (middle, half) = ((from + to) / 2.0, 14.0_f64.min(0.4 * (to - from).abs()) * (to - from).signum());
    let draw = |path: &[[f64; 2]], width| {
        let points = path.iter().map(|&[along, up]| (middle + half * along, y + HIGH / 2.0 * up));
        let path: Vec<Point> = points.collect();
        canvas.stroke(&path, width, DARK);
    };
    let [start, end] = [from, to].map(|x| [(x - middle) / half, 0.0]);
    let (zigzag, third) = ([-1.0, 1.0].repeat(3), 1.0 / 3.0);
    match kind {
        Kind::Mass => draw(&[start, end], 6.0),
        Kind::Spring => {
            let turns = (0..6).zip(zigzag).map(|(k, up)| [third * (f64::from(k) - 2.5), up]);
            let path: Vec<_> =
                [start, [-1.0, 0.0]].into_iter().chain(turns).chain([[1.0, 0.0], end]).collect();
            draw(&path, 1.5);
        }
        Kind::Damper => {
            draw(&[[1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]], 1.5);
            draw(&[start, [-1.0, 0.0]], 1.5);
            draw(&[[0.0, -0.6], [0.0, 0.6]], 2.5);
            draw(&[[0.0, 0.0], end], 1.5);
        }
    }
}

/// Draws a fixed surface, hatched in a direction.
fn hatch(canvas: &Canvas, [from, to]: [Point; 2], (dx, dy): Point) {
    canvas.stroke(&[from, to], 1.5, DARK);
    let count = ((to.0 - from.0).hypot(to.1 - from.1) / 9.0) as usize;
    for share in (0..count).map(|k| k as f64 / count as f64) {
        let at = (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1));
        canvas.stroke(&[at, (at.0 + dx, at.1 + dy)], 1.0, DARK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three coordinates with gear ratios, a gyroscopic moment, a common mass and a negative stiffness.
    const RATIOS: &str = r#"
        name = "ratios"
        parameters = { k = 2, R = 1.5, r = 1, c = 0, G = 0.3 }
        friction = [{ row = [0, 0, 1], force = "c" }]
        [motion]
        coordinates = ["phi", "theta", "a_long_name_of_a_body"]
        mass = [[1, 0, 0], [0, 2, 0.5], [0, 0.5, 1]]
        damping = [[0, "G", 0], ["-G", "c", "-c"], [0, "-c", "c"]]
        stiffness = [["k*R^2", "-k*R*r", 0], ["-k*R*r", "k*r^2", 0], [0, 0, 0]]
        frequency = 1
        stages = ["0.25", "0.5"]
        repeat = 20
        gap = [1, -1, 0]
    "#;

    fn described(model: &FileModel) -> String {
        let kind = |kind| ["mass", "spring", "damper"][kind as usize];
        links(model).iter().map(|&(a, b, of)| format!("{a}-{b} {}", kind(of))).collect::<Vec<_>>().join(", ")
    }

    #[test]
    fn springs_and_dampers_are_those_of_the_matrices() {
        let built_in = |name| described(&FileModel::built_in(name).unwrap());
        assert_eq!(built_in("gear-pair"), "0-1 spring, 0-1 damper, 0-2 spring, 0-2 damper");
        assert_eq!(built_in("two-loose-gears"), "0-1 spring, 0-1 damper, 1-2 damper, 1-3 damper");
        assert_eq!(built_in("meissner"), "0-1 spring, 0-1 damper");
        assert_eq!(built_in("shaken-container"), "");
        let chain = built_in("absorber-chain");
        assert!(
            chain.starts_with("0-1 spring, 0-1 damper, 1-2 spring") && chain.ends_with("6-7 damper"),
            "{chain}"
        );
        let ratios = FileModel::parse(RATIOS, "ratios.toml").unwrap();
        assert_eq!(described(&ratios), "1-2 spring, 2-3 mass, 2-3 damper");
    }

    #[test]
    fn every_model_has_a_sketch_inside_its_page() {
        let models = FileModel::all_built_in().into_iter().chain(FileModel::parse(RATIOS, "ratios.toml"));
        for model in models {
            let (canvas, definition) = (draw(&model), model.definition());
            let (width, height) = canvas.size();
            let texts = canvas.texts();
            let places = texts.iter().map(|(_, place, _)| *place).chain(canvas.extents());
            for Rect { left, top, right, bottom } in places {
                let is_inside = left >= -1.0 && top >= 0.0 && right <= width && bottom <= height;
                assert!(is_inside, "{}: {left} {top} {right} {bottom}", model.name());
            }
            let count = |part: &str| texts.iter().filter(|(text, ..)| text.contains(part)).count();
            let walls = definition.walls.iter().flatten().flatten().count();
            assert_eq!(count("left at") + count("right at"), walls, "{texts:?}");
            assert_eq!(
                (count("stages"), count("dry friction")),
                (usize::from(!definition.motion.stages.is_empty()), definition.friction.len())
            );
        }
    }
}

//! Tests of every kind of figure at the width of a column: nothing leaves the page, overlaps or is too small.

use super::{bifurcation, compare, map};
use crate::findings::compare::{Comparison, Side as MapRecords, compare as compared};
use crate::map::bifurcation::{self as diagram, Column};
use crate::map::plan::Plan;
use crate::map::scene::{DiagramStyle, FigureStyle, Format, Purpose, Quantity, Scale, Scene, Start};
use crate::model_file::FileModel;
use crate::record::{Record, valid};
use crate::show::cells::{Cells, Survey};
use crate::show::drawing::{Canvas, Rect, write_figure};
use crate::show::figure::bifurcation::Panels;
use crate::show::figure::orbit::{OrbitFigure, OrbitPlot, spectrum};
use crate::show::map_pair::{MapPair, MapSide};
use crate::show::numbers::Number;
use crate::show::orbit_spectrum::Spectrum;
use crate::show::provenance::Provenance;
use crate::show::{layers, words};
use rattlemap_dynamics::model::{GearPair, Model, REST};
use rattlemap_dynamics::orbit::{self, Settings};

const POINTS_PER_MM: f64 = 72.0 / 25.4;
/// Widest empty band of a page, in millimetres, and smallest type, in points.
const LARGEST_BAND: f64 = 8.0;
const SMALLEST_TYPE: f64 = 7.0;

fn style() -> FigureStyle {
    FigureStyle { width: Some(85.0 * POINTS_PER_MM), ..FigureStyle::default() }
}

/// Returns the number of millimetres per unit of a figure.
fn millimetres(canvas: &Canvas) -> f64 {
    25.4 / canvas.per_inch
}

fn overlap(a: &Rect, b: &Rect) -> bool {
    a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom
}

/// Returns the width of the widest interval of `0..end` that no interval covers.
fn widest_gap(mut covered: Vec<[f64; 2]>, end: f64) -> f64 {
    covered.push([end, end]);
    covered.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut reached: f64 = 0.0;
    let mut widest: f64 = 0.0;
    for [from, to] in covered {
        widest = widest.max(from - reached);
        reached = reached.max(to);
    }
    widest
}

/// Checks a page. `has_texts_inside` says that texts may lie inside a panel.
#[track_caller]
fn check(name: &str, canvas: &Canvas, has_texts_inside: bool) {
    let (width, height) = canvas.size();
    let texts = canvas.texts();
    let panels = canvas.outlines();
    assert!(texts.len() > 5 && !panels.is_empty(), "{name}");
    for (i, (text, place, em)) in texts.iter().enumerate() {
        let points = em / canvas.per_inch * 72.0;
        assert!(points >= SMALLEST_TYPE, "{name}: {text:?} has {points} points");
        assert!(
            place.left >= 0.0 && place.top >= 0.0 && place.right <= width && place.bottom <= height,
            "{name}: {text:?} leaves the page of {width} x {height}: {place:?}"
        );
        assert!(!text.contains('\u{2026}'), "{name}: {text:?} is cut");
        for (other, with, _) in &texts[i + 1..] {
            assert!(!overlap(place, with), "{name}: {text:?} covers {other:?}");
        }
        for panel in &panels {
            let is_inside = place.left > panel.left
                && place.right < panel.right
                && place.top > panel.top
                && place.bottom < panel.bottom;
            let is_allowed = is_inside && has_texts_inside;
            assert!(
                is_allowed || !overlap(place, panel),
                "{name}: {text:?} lies on a panel: {place:?} {panel:?}"
            );
        }
    }
    let boxes = || texts.iter().map(|(_, place, _)| *place).chain(canvas.extents());
    let across = widest_gap(boxes().map(|place| [place.left, place.right]).collect(), width);
    let down = widest_gap(boxes().map(|place| [place.top, place.bottom]).collect(), height);
    for (direction, gap) in [("wide", across), ("high", down)] {
        let band = gap * millimetres(canvas);
        assert!(band <= LARGEST_BAND, "{name}: an empty band is {band} mm {direction}");
    }
    if canvas.style == style() {
        check_files(name, canvas);
    }
}

/// Checks the size of the page in all formats.
fn check_files(name: &str, canvas: &Canvas) {
    let Some(points) = canvas.style.width else { return };
    let file = |format| {
        let mut bytes = Vec::new();
        write_figure(&mut bytes, format, canvas).unwrap();
        bytes
    };
    let png = image::load_from_memory(&file(Format::Png)).unwrap();
    assert!((f64::from(png.width()) - points / 72.0 * 600.0).abs() < 1.0, "{name}: {}", png.width());
    let svg = String::from_utf8(file(Format::Svg)).unwrap();
    let inches: f64 = svg.split('"').nth(3).unwrap().trim_end_matches("in").parse().unwrap();
    assert!((inches * 72.0 - points).abs() < 0.01, "{name}: {inches}");
    let pdf = file(Format::Pdf);
    let text = String::from_utf8_lossy(&pdf);
    let sheet = text.split("/MediaBox [").nth(1).unwrap().split(']').next().unwrap();
    let right: f64 = sheet.split_whitespace().nth(2).unwrap().parse().unwrap();
    assert!((right - points).abs() < 0.01, "{name}: {sheet}");
}

/// Styles in which every figure is checked.
fn styles() -> [FigureStyle; 5] {
    let other =
        |width: f64, font_size| FigureStyle { width: Some(width * POINTS_PER_MM), font_size, ..style() };
    [
        style(),
        other(85.0, Some(8.0)),
        other(180.0, Some(9.0)),
        FigureStyle { title: Some(String::new()), legend: false, ..style() },
        FigureStyle { title: Some("A heading of one's own".to_owned()), ..other(120.0, None) },
    ]
}

const PLANE: &str = "title = 'Gear rattle: restitution x excitation frequency'\n\
    [[axis]]\nparameter = 'e'\nmin = 0.0\nmax = 1.0\ncount = 30\n\
    [[axis]]\nparameter = 'omega'\nmin = 1.0\nmax = 12.0\ncount = 40\n\
    [outputs]\nquantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word', 'pattern']\n\
    [figure]\nlines = { 'rattle threshold' = 'omega - 2 - 8*e' }\n\
    contours = { impacts = [3e-7, 8.5e-7], mesh = [0.5] }\n";

/// Returns records with many periods, words and chaos, none of them computed.
fn records(plan: &Plan) -> Vec<Record> {
    let record = |id: usize| {
        let (period, length) = ([1, 1, 1, 2, 3, 4, 5, 8, 12, 31, 0][id % 11], 2 + id as u32 % 9);
        Record {
            period,
            lyapunov: if period == 0 { 0.02 * (id % 90) as f64 } else { -0.3 },
            impacts_per_period: f64::from(length) * 1e-7,
            mesh_fraction: 0.1 * f64::from(length),
            symmetric: (id % 2) as u32,
            word: [0o12345 + id as u64 % 40, 0, 0, 0],
            word_length: length,
            pattern: [0o123, 0, 0, 0],
            pattern_length: 3,
            valid: valid::PERIOD
                | valid::LYAPUNOV
                | valid::IMPACTS
                | valid::MESH
                | valid::SYMMETRIC
                | valid::WORD
                | valid::PATTERN,
            ..Record::default()
        }
    };
    (0..plan.run_count()).map(record).collect()
}

fn scene(text: &str, sets: &[&str], style: &FigureStyle) -> Scene {
    let mut sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    sets.extend(style.width.map(|width| format!("figure.width=\"{width:?}pt\"")));
    sets.extend(style.font_size.map(|size| format!("figure.font_size={size:?}")));
    sets.extend(style.title.as_ref().map(|title| format!("figure.title=\"{title}\"")));
    sets.push(format!("figure.legend={}", style.legend));
    Scene::parse(text, "s", &sets, Purpose::Map).unwrap()
}

#[test]
fn maps_fit_a_page() {
    for style in styles() {
        let scene = scene(PLANE, &[], &style);
        let plan = Plan::new(&scene);
        let records = records(&plan);
        let cells = Cells::new(&scene, &plan, &records);
        let layers = layers::of(&cells, &words::read(&cells));
        assert_eq!(layers.len(), 6);
        for layer in &layers {
            let canvas = map::draw(&cells, &layers, layer);
            check(&format!("{} {style:?}", layer.name), &canvas, true);
            let values = canvas.texts().iter().filter(|(text, ..)| text.parse() == Ok(8.5e-7)).count();
            assert_eq!(values, usize::from(["map", "impacts"].contains(&layer.name())), "{}", layer.name);
        }
    }
}

#[test]
fn basins_fit_a_page_and_mark_their_attractors() {
    const BASINS: &str = "model = 'impact-oscillator'\n[parameters]\nomega = 2.8\nsigma = 0.2\n\
        [[axis]]\nstart = 'x'\nmin = -1.0\nmax = 0.2\ncount = 12\n\
        [[axis]]\nstart = 'v'\nmin = -1.0\nmax = 1.0\ncount = 12\n";
    for style in styles() {
        let scene = scene(BASINS, &[], &style);
        let plan = Plan::new(&scene);
        let orbit = orbit::analyse(scene.base(), REST, &Settings::default()).unwrap();
        let orbit::Class::Periodic { period } = orbit.class else { panic!("{:?}", orbit.class) };
        let record =
            Record { period, strobe: orbit.strobe.into(), valid: valid::PERIOD, ..Record::default() };
        let records = vec![record; plan.run_count()];
        let survey = Survey::of(&plan, &records[..], None);
        let cells = Cells::new(&scene, &plan, &records).surveyed(&survey);
        assert_eq!(map::attractors(&cells).len(), period as usize);
        let [x, v] = [0, 1].map(|i| orbit.strobe[i]);
        let is_there = |(a, b): &(f64, f64)| (a - x).hypot(b - v) < 1e-9;
        assert!(map::attractors(&cells).iter().any(is_there), "{x} {v}");
        for layer in layers::of(&cells, &words::read(&cells)) {
            check(&format!("basins {} {style:?}", layer.name), &map::draw(&cells, &[], &layer), false);
        }
    }
}

#[test]
fn comparisons_fit_a_page() {
    for style in styles() {
        let [a, b] = ["parameters.k=900", "parameters.k=800"].map(|set| scene(PLANE, &[set], &style));
        let plans = [Plan::new(&a), Plan::new(&b)];
        let first = records(&plans[0]);
        let second: Vec<Record> = first.iter().cycle().skip(3).take(first.len()).cloned().collect();
        let comparison: Comparison = compared(
            first.len(),
            MapRecords { records: &first, attractors: None, has_exponents: true },
            MapRecords { records: &second, attractors: None, has_exponents: true },
        );
        let cells = [Cells::new(&a, &plans[0], &first), Cells::new(&b, &plans[1], &second)];
        let provenance =
            |engine| Provenance { engine, precision: "f64", device: "a processor", commit: "0123456" };
        let side = |name, cells, engine| MapSide {
            name,
            cells,
            provenance: provenance(engine),
            crate_version: "0.1.0",
        };
        let sides = [side("upward", &cells[0], "cpu"), side("downward", &cells[1], "gpu")];
        let pair = MapPair { sides, comparison: &comparison };
        check(&format!("compare {style:?}"), &compare::draw(&style, &pair), false);
    }
}

#[test]
fn diagrams_fit_a_page() {
    let model = |e: f64| -> (f64, Box<dyn Model>) { (e, Box::new(GearPair::paper(e))) };
    let line: Vec<_> = (1..20).map(|i| model(0.05 * f64::from(i))).collect();
    let settings = Settings { transient_periods: 50, observed_periods: 64, max_period: 16 };
    for start in [Start::Rest, Start::Both] {
        let columns: Vec<Column> =
            diagram::run_until(&line, start, &settings, &|_| (), &Default::default()).unwrap().unwrap();
        for style in styles() {
            let numbers = Number::of(&*line[0].1, &[Quantity::Amplitude, Quantity::Harmonic]);
            let panels = Panels::of(&*line[0].1, diagram::fixed(&line), &numbers);
            let texts =
                ["Gear rattle, along e at \u{3c9} = 5.6", "k = 900; all other parameters at their defaults"];
            let axis = ("coefficient of restitution, e", Scale::Linear);
            for is_divided in [false, true] {
                let diagram = DiagramStyle { is_divided, ..DiagramStyle::default() };
                let figures = panels.clone().figures(&style, &diagram);
                assert_eq!(figures.len(), if is_divided { 15 } else { figures.len() });
                for (nth, panels) in figures.iter().enumerate() {
                    let canvas = bifurcation::draw(&style, texts, axis, panels, (&columns, None));
                    check(&format!("{start:?} {nth} {is_divided} {style:?}"), &canvas, false);
                    let (_, height) = canvas.size();
                    assert!(canvas.is_default() || height * millimetres(&canvas) < 290.0, "{height}");
                }
            }
        }
    }
}

#[test]
fn orbits_fit_a_page() {
    let built_in = |name: &str| -> Box<dyn Model> { Box::new(FileModel::built_in(name).unwrap()) };
    let pair: Box<dyn Model> = Box::new(GearPair::paper(0.06));
    let chaotic: Box<dyn Model> = Box::new(GearPair::paper(0.65));
    for model in
        [pair, chaotic, built_in("two-masses"), built_in("shaking-table"), built_in("kahraman-singh")]
    {
        let orbit = orbit::analyse(&*model, REST, &Settings::default()).unwrap();
        let trace =
            orbit::trace(&*model, orbit.strobe, orbit.strobe_meshing, orbit.cycle_periods, 400).unwrap();
        let plot = OrbitPlot::new(&*model, &orbit, &trace).unwrap();
        let spectrum = Spectrum::of(&*model, &orbit).unwrap().unwrap();
        for style in styles() {
            for figure in OrbitFigure::ALL {
                let name = format!("{} {figure:?} {style:?}", model.name());
                check(&name, &figure.draw(&style, &plot), figure == OrbitFigure::Gap);
            }
            let canvas = spectrum::draw(&style, &*model, &orbit, &spectrum);
            check(&format!("{} spectrum {style:?}", model.name()), &canvas, false);
        }
    }
}

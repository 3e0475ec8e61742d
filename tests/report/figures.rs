//! Figures of orbits and bifurcation diagrams: what they show, and that they accept incomplete data.

use crate::common::built_in;
use std::f64::consts::TAU;
use std::io::Read;

use image::RgbImage;
use rattlemap::map::bifurcation::{Column, Direction, SectionPoint};
use rattlemap::map::scene::{FigureStyle, Format, Scale};
use rattlemap::show::drawing::write_figure;
use rattlemap::show::figure::bifurcation::{self, Panels};
use rattlemap::show::figure::orbit::{OrbitFigure, OrbitPlot};
use rattlemap_dynamics::model::{self, GearPair, Model, REST, Side, State};
use rattlemap_dynamics::orbit::{self, Class, Event, EventKind, Orbit, Sample, Settings, Status};

/// Label and scale of an axis.
const E: (&str, Scale) = ("coefficient of restitution, e", Scale::Linear);
const RIGHT: [u8; 3] = [0xd5, 0x5e, 0x00];
const LEFT: [u8; 3] = [0x00, 0x72, 0xb2];
const MESHING: [u8; 3] = [0x00, 0x9e, 0x73];
const PERIOD: f64 = TAU / 5.6;

/// Returns a diagram of the gear pair.
fn diagram(format: Format, title: [&str; 2], axis: (&str, Scale), columns: &[Column]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let panels = Panels::of(&GearPair::paper(0.5), None, &[]);
    let style = FigureStyle::default();
    let figure = bifurcation::draw(&style, title, axis, &panels, (columns, None));
    write_figure(&mut bytes, format, &figure).unwrap();
    bytes
}

/// Returns a diagram without title as pixels.
fn pixels(columns: &[Column]) -> RgbImage {
    read(&diagram(Format::Png, [""; 2], E, columns))
}

/// Returns a diagram as SVG.
fn svg(title: [&str; 2], axis: (&str, Scale), columns: &[Column]) -> String {
    String::from_utf8(diagram(Format::Svg, title, axis, columns)).unwrap()
}

/// Returns phase plane, time history and gap of an orbit.
fn orbit_figures(model: &dyn Model, orbit: &Orbit, trace: &[Sample], format: Format) -> [Vec<u8>; 3] {
    let plot = OrbitPlot::new(model, orbit, trace).unwrap();
    OrbitFigure::ALL.map(|figure| {
        let mut bytes = Vec::new();
        write_figure(&mut bytes, format, &figure.draw(&FigureStyle::default(), &plot)).unwrap();
        bytes
    })
}

/// Two sinusoids whose gap touches the right wall and penetrates the left one.
fn state(turns: f64) -> State {
    let common = |phase: f64| 0.9 * phase.cos() + 0.1 * (3.0 * phase).sin();
    let common_speed = |phase: f64| 5.6 * (-0.9 * phase.sin() + 0.3 * (3.0 * phase).cos());
    let phase = TAU * turns;
    let (z, w) = (0.5 * (1.025 * phase.sin() - 0.025), 0.5 * 5.6 * 1.025 * phase.cos());
    let (x, v) = (common(phase), common_speed(phase));
    model::state(&[x + z / 2.0, v + w / 2.0, x - z / 2.0, v - w / 2.0])
}

/// Phases at which that gap passes the left wall, in turns.
fn meshing() -> [f64; 2] {
    let angle = (0.975f64 / 1.025).asin() / TAU;
    [0.5 + angle, 1.0 - angle]
}

fn orbit(events: Vec<Event>) -> Orbit {
    let orbit = orbit::analyse(&GearPair::paper(0.605), REST, &Settings::default()).unwrap();
    Orbit {
        class: Class::Periodic { period: 1 },
        strobe: state(0.0),
        events,
        forcing_period: PERIOD,
        ..orbit
    }
}

fn meshing_orbit() -> (Orbit, Vec<Sample>) {
    let event = |kind, side, turns: f64, kick: f64| {
        let before = state(turns);
        let after = model::state(&[before[0], before[1] - kick, before[2], before[3] + 2.0 * kick]);
        let meshing = (kind == EventKind::MeshStart).then_some(side);
        Event { kind, side, t: turns * PERIOD, t_mod_period: turns * PERIOD, before, after, meshing, gap: 0 }
    };
    let [start, end] = meshing();
    let events = vec![
        event(EventKind::Impact, Side::Right, 0.25, 1.5),
        event(EventKind::MeshStart, Side::Left, start, 0.0),
        event(EventKind::MeshEnd, Side::Left, end, 0.0),
    ];
    let sample = |turns: f64| Sample {
        t: turns * PERIOD,
        state: state(turns),
        meshing: (start..end).contains(&turns).then_some(Side::Left),
    };
    (orbit(events), (0..=400).map(|i| sample(f64::from(i) / 400.0)).collect())
}

fn read(png: &[u8]) -> RgbImage {
    image::load_from_memory(png).unwrap().to_rgb8()
}

fn count(picture: &RgbImage, color: [u8; 3]) -> usize {
    picture.pixels().filter(|pixel| pixel.0 == color).count()
}

/// Counts the pixels in the inner half of the picture that are darker than the grid.
fn ink(picture: &RgbImage) -> usize {
    let (w, h) = picture.dimensions();
    let inner = |(x, y, _): &(u32, u32, &image::Rgb<u8>)| {
        (w / 4..3 * w / 4).contains(x) && (h / 4..3 * h / 4).contains(y)
    };
    let dark = |p: &image::Rgb<u8>| p.0.iter().map(|c| u32::from(*c)).sum::<u32>() < 600;
    picture.enumerate_pixels().filter(inner).filter(|(_, _, pixel)| dark(pixel)).count()
}

fn distinct_colors(picture: &RgbImage) -> usize {
    picture.pixels().map(|pixel| pixel.0).collect::<std::collections::HashSet<_>>().len()
}

#[test]
fn orbit_figures_show_motion_meshing_and_events() {
    let (orbit, trace) = meshing_orbit();
    let pictures = orbit_figures(&GearPair::paper(0.06), &orbit, &trace, Format::Png);
    for (figure, picture) in OrbitFigure::ALL.iter().zip(pictures.map(|png| read(&png))) {
        assert_eq!(picture.width(), 1600, "{figure:?}");
        assert!(distinct_colors(&picture) > 100, "{figure:?}");
        assert!(ink(&picture) > 2000, "{figure:?}: {}", ink(&picture));
        for wall in [RIGHT, LEFT] {
            // The legend's patch alone has 38 by 18 pixels.
            assert!(count(&picture, wall) > 38 * 18 + 50, "{figure:?}: {}", count(&picture, wall));
        }
        let has_meshing = *figure != OrbitFigure::TimeHistory;
        assert!(!has_meshing || count(&picture, MESHING) > 300, "{figure:?}");
    }
}

#[test]
fn orbits_without_contact_without_samples_or_with_infinite_numbers_are_drawn() {
    let rest = |t: f64| Sample {
        t,
        state: model::state(&[0.3 * (5.6 * t).cos(), -1.68 * (5.6 * t).sin()]),
        meshing: None,
    };
    let free: Vec<Sample> = (0..=300).map(|i| rest(f64::from(i) / 300.0 * PERIOD)).collect();
    let blown_up = [
        rest(0.0),
        Sample { state: model::state(&[f64::NAN, f64::INFINITY, 0.0, 1e308]), ..rest(0.1) },
        Sample { state: model::state(&[-1e308, 1e308]), ..rest(0.2) },
    ];
    for (trace, class) in [
        (&free[..], Class::Periodic { period: 1 }),
        (&[], Class::Undecided),
        (&free[..1], Class::Chaotic),
        (&blown_up, Class::Failed),
    ] {
        let orbit = Orbit { class, lyapunov: f64::NAN, ..orbit(vec![]) };
        for picture in orbit_figures(&GearPair::paper(0.5), &orbit, trace, Format::Png) {
            assert!(distinct_colors(&read(&picture)) > 10, "{class:?}");
        }
    }
}

/// Returns phase plane, time history and gap of the attractor of a built-in model from rest, as SVG.
fn attractor_figures(name: &str, values: &[(&str, f64)]) -> [String; 3] {
    let model = built_in(name, values);
    let orbit = orbit::analyse(&model, REST, &Settings::default()).unwrap();
    assert!(matches!(orbit.class, Class::Periodic { .. }), "{name} {values:?}: {:?}", orbit.class);
    let trace = orbit::trace(&model, orbit.strobe, orbit.strobe_meshing, orbit.cycle_periods, 100).unwrap();
    let figures =
        orbit_figures(&model, &orbit, &trace, Format::Svg).map(|svg| String::from_utf8(svg).unwrap());
    assert!(figures.iter().all(|svg| !svg.contains("NaN") && !svg.contains("inf")), "{name}");
    figures
}

fn has(svg: &str, text: &str) -> bool {
    svg.contains(&format!(">{text}</text>"))
}

/// Counts the lines of a wall's colour.
fn wall_lines(svg: &str, color: &str) -> usize {
    let of_wall = |line: &&str| line.starts_with("<polyline") && line.contains(color);
    svg.lines().filter(of_wall).count()
}

#[test]
fn orbits_of_any_model_are_drawn_with_the_walls_of_the_model() {
    const RIGHT: &str = "#d55e00";
    const LEFT: &str = "#0072b2";
    let stop = "impact-oscillator";
    // One rigid wall with impacts.
    let [plane, time, gap] = attractor_figures(stop, &[("sigma", 0.2)]);
    assert!(has(&plane, "displacement, x") && has(&plane, "velocity, v") && has(&time, "displacement, x"));
    assert!(has(&gap, "displacement, x") && has(&gap, "x = \u{3c3}") && has(&gap, "right wall"));
    assert_eq!([&plane, &gap].map(|svg| [RIGHT, LEFT].map(|color| wall_lines(svg, color))), [[1, 0]; 2]);
    for svg in [&plane, &time, &gap] {
        assert!(!svg.contains("left wall") && !svg.contains("z =") && !svg.contains("meshing"));
    }
    // A wall out of reach must not make the motion a flat line.
    let [plane, _, gap] = attractor_figures(stop, &[("sigma", 50.0)]);
    assert!(has(&gap, "(above)") && has(&gap, "x = \u{3c3}") && has(&gap, "\u{2212}0.3"));
    assert!(!has(&gap, "\u{2212}0.5"), "{gap:.3000}");
    assert_eq!([&plane, &gap].map(|svg| wall_lines(svg, RIGHT)), [0, 0]);
    // A wall at which a slow motion stays in contact has no depth.
    let [_, time, gap] = attractor_figures(stop, &[("sigma", 0.0), ("omega", 0.3), ("e", 0.3)]);
    assert!(has(&time, "contact, right wall") && has(&gap, "contact starts") && has(&gap, "contact ends"));
    assert!(!gap.contains("depth"));
    // Elastic walls have no velocity jumps, and their depth is visible in the gap.
    let [plane, _, gap] = attractor_figures("kahraman-singh", &[("omega", 1.0)]);
    assert!(has(&gap, "x = +b") && has(&gap, "x = \u{2212}b") && !gap.contains("depth"));
    assert!(has(&plane, "contact starts") && !plane.contains("jump"));
    // Two walls of two masses.
    let [plane, _, gap] = attractor_figures("two-masses", &[]);
    assert!(has(&plane, "displacement of first mass, x\u{2081}"));
    assert!(has(&gap, "gap, z = x\u{2081} \u{2212} x\u{2082}"));
    assert!(has(&gap, "z = \u{3b4}\u{2082}") && has(&gap, "z = \u{2212}\u{3b4}\u{2081}"));
}

/// Returns the stream of a PDF that follows a text.
fn stream(pdf: &[u8], after: &str) -> Vec<u8> {
    let find =
        |from: usize, mark: &[u8]| from + pdf[from..].windows(mark.len()).position(|w| w == mark).unwrap();
    let begin = find(find(0, after.as_bytes()), b"stream\n") + 7;
    let mut bytes = Vec::new();
    flate2::read::ZlibDecoder::new(&pdf[begin..]).read_to_end(&mut bytes).unwrap();
    bytes
}

#[test]
fn figures_in_svg_and_pdf_have_lines_and_text_and_are_reproducible() {
    let (orbit, trace) = meshing_orbit();
    let figures = |format| orbit_figures(&GearPair::paper(0.06), &orbit, &trace, format);
    let [svgs, pdfs] = [Format::Svg, Format::Pdf].map(figures);
    assert_eq!([Format::Svg, Format::Pdf].map(figures), [svgs.clone(), pdfs.clone()]);
    for (svg, pdf) in svgs.iter().zip(&pdfs) {
        let svg = std::str::from_utf8(svg).unwrap();
        assert!(svg.starts_with("<svg xmlns") && svg.ends_with("</svg>\n") && !svg.contains("<image"));
        let title = "Gear pair: e = 0.06, \u{3c9} = 5.6; all other parameters at their defaults";
        for part in [&format!(">{title}</text>"), ">meshing starts</text>", "stroke=\"#262626\"", "<polyline"]
        {
            assert!(svg.contains(part), "{part}");
        }
        assert!(!svg.contains("omega") && !svg.contains("NaN") && !svg.contains("inf"));
        assert!(pdf.starts_with(b"%PDF-1.") && pdf.ends_with(b"%%EOF"));
        let text = String::from_utf8_lossy(pdf);
        assert!(text.contains("+Ubuntu-Light") && text.contains("/FontFile2") && !text.contains("Date"));
        // Text can be searched: the map from glyphs to characters contains m, 006D, of the legend. There is no heading.
        let map = String::from_utf8(stream(pdf, "/Type /CMap")).unwrap();
        assert!(map.to_uppercase().contains("<006D>"), "{map}");
    }
    assert!(svgs[0].len() < 150_000, "a line of few pixels has few points: {}", svgs[0].len());
}

#[test]
fn titles_are_escaped_in_svg() {
    let title = "a < b && \"c\" </text><script>\u{7}\u{2028}10\u{207b}\u{b2}";
    let svg = svg([title, "second\nthird"], E, &columns(9, 3));
    let expected = "a &lt; b &amp;&amp; \"c\" &lt;/text&gt;&lt;script&gt; \u{2028}10<tspan dy=";
    assert!(svg.contains(expected) && !svg.contains("<script"), "{svg:.600}");
    assert!(
        svg.contains(">\u{2212}2</tspan>") && svg.contains(">second</text>") && svg.contains(">third</text>")
    );
    assert_eq!(svg.matches("<image").count(), 2, "an image of points for each gear");
}

/// Unknown characters share one glyph.
#[test]
fn unknown_characters_are_not_mapped_to_others_in_pdf() {
    let pdf = diagram(Format::Pdf, ["\u{65e5}\u{672c}", "second"], E, &columns(9, 3));
    let map = String::from_utf8(stream(&pdf, "/Type /CMap")).unwrap().to_uppercase();
    assert!(map.contains("<0073>") && !map.contains("<65E5>") && !map.contains("<672C>"), "{map}");
}

fn columns(count: u32, points: u32) -> Vec<Column> {
    let column = |i: u32| {
        let value = f64::from(i) / f64::from(count);
        let class = if i % 50 == 7 { Class::Undecided } else { Class::Chaotic };
        let point = |j: u32| {
            let side = Side::BOTH[(j % 2) as usize];
            // Golden-section points fill a band that widens with the axis.
            let spread = (f64::from(j) * 0.618_034).fract() * value;
            let at = model::state(&[
                -side.sign() * (1.0 - 0.4 * spread),
                0.0,
                -side.sign() * (1.4 - 0.4 * spread),
            ]);
            SectionPoint { gap: 0, side, kind: EventKind::Impact, t_mod_period: 0.0, before: at, after: at }
        };
        let points = if class == Class::Chaotic { (0..points).map(point).collect() } else { vec![] };
        Column {
            value,
            direction: None,
            class,
            status: Status::Ok,
            lyapunov: 0.3 * value,
            lyapunov_error: Some(0.1),
            impacts_per_period: 1.0,
            mesh_fraction: 0.0,
            impact_rate: 0.0,
            measures: [None; rattlemap::record::measures::MEASURES],
            state: None,
            symmetric: None,
            word: None,
            periods_run: 100,
            points,
            strobes: vec![],
        }
    };
    (0..count).map(column).collect()
}

/// Returns the panel of exponents: the part of the picture below the section points.
fn lower_panel(picture: &RgbImage) -> RgbImage {
    let (w, h) = picture.dimensions();
    image::imageops::crop_imm(picture, 140, h * 3 / 4, w - 210, h * 3 / 16).to_image()
}

#[test]
fn bifurcation_figure_shows_both_walls() {
    let picture = pixels(&columns(1000, 200));
    assert_eq!(picture.dimensions(), (1600, 1750));
    assert!(ink(&picture) > 5000, "{}", ink(&picture));
    // Single dots are not opaque, so the test counts hues and not exact colours.
    let warm = picture.pixels().filter(|p| p.0[0] > p.0[2].saturating_add(60)).count();
    let cold = picture.pixels().filter(|p| p.0[2] > p.0[0].saturating_add(60)).count();
    assert!(warm > 20_000 && cold > 20_000, "{warm} {cold}");
}

#[test]
fn exponents_have_the_colours_of_classes_and_a_band_of_the_standard_error() {
    const CHAOS: [u8; 3] = [0x26, 0x26, 0x26];
    let panel = |columns: &[Column]| lower_panel(&pixels(columns));
    let chaos = columns(40, 2);
    let cycle = |column: &Column| Column {
        class: Class::Periodic { period: 1 },
        lyapunov: -0.2,
        lyapunov_error: None,
        ..column.clone()
    };
    let cycles: Vec<Column> = chaos.iter().map(cycle).collect();
    let [chaotic, periodic] = [&chaos, &cycles].map(|columns| panel(columns));
    assert!(count(&chaotic, CHAOS) > 300 && count(&chaotic, MESHING) == 0, "{}", count(&chaotic, CHAOS));
    assert!(count(&periodic, MESHING) > 300, "{}", count(&periodic, MESHING));
    // The panel always contains the zero line.
    let lines = |picture: &RgbImage| {
        let dark = |y| (0..picture.width()).filter(|&x| picture.get_pixel(x, y).0[0] < 0xb0).count();
        (0..picture.height()).filter(|&y| dark(y) > picture.width() as usize * 9 / 10).count()
    };
    assert!(lines(&periodic) >= 1, "no line at zero");
    let narrow: Vec<Column> =
        chaos.iter().map(|column| Column { lyapunov_error: Some(0.0), ..column.clone() }).collect();
    let pale =
        |picture: &RgbImage| picture.pixels().filter(|pixel| (0xb0..0xd8).contains(&pixel.0[0])).count();
    assert!(pale(&chaotic) > 20 * pale(&panel(&narrow)).max(100), "no band of the standard error");
}

#[test]
fn two_passes_have_different_colours_and_are_grey_where_they_agree() {
    let pass = |direction, lyapunov| {
        let of = move |column: Column| Column { direction: Some(direction), lyapunov, ..column };
        columns(40, 8).into_iter().map(of)
    };
    let both = |lyapunov| pass(Direction::Up, 0.3).chain(pass(Direction::Down, lyapunov));
    let [apart, same] = [0.1, 0.3].map(|lyapunov| pixels(&both(lyapunov).collect::<Vec<_>>()));
    for hue in [RIGHT, LEFT] {
        assert!(count(&lower_panel(&apart), hue) > 300, "{}", count(&lower_panel(&apart), hue));
        assert_eq!(count(&lower_panel(&same), hue), 0);
        // Only the legend has the colours of the directions.
        assert!(count(&same, hue) < 200, "{}", count(&same, hue));
    }
}

#[test]
fn a_logarithmic_axis_has_its_decades() {
    let decades: Vec<Column> = columns(5, 2)
        .into_iter()
        .enumerate()
        .map(|(i, column)| Column { value: 10f64.powi(i as i32), ..column })
        .collect();
    let ticks = |scale| {
        let svg = svg([""; 2], ("k", scale), &decades);
        // A linear axis up to 10,000 also has a tick at 1000.
        ["10", "100"].map(|label| svg.contains(&format!(">{label}</text>")))
    };
    assert_eq!(ticks(Scale::Log), [true; 2]);
    assert_eq!(ticks(Scale::Linear), [false; 2]);
}

#[test]
fn the_axis_of_a_constant_has_short_labels_and_its_name_is_not_cut() {
    let still = |value: f64| {
        let point = |column: &mut Column, x: f64| {
            column.points.iter_mut().for_each(|point| point.before = model::state(&[x, 0.0, x]));
        };
        let mut columns = columns(9, 2);
        columns.iter_mut().for_each(|column| point(column, value));
        svg([""; 2], E, &columns)
    };
    for (value, label) in [(0.2, "0.20"), (0.0, "0.0"), (3e-8, "3.0"), (4e7, "4.0")] {
        let svg = still(value);
        let upright = svg.lines().filter(|line| line.contains("rotate(-90"));
        let left = upright.map(|line| line.split('"').nth(1).unwrap().parse::<f64>().unwrap());
        assert!(left.fold(f64::MAX, f64::min) >= 14.0, "{value}");
        assert!(svg.contains(&format!(">{label}")), "{value}: {svg:.3000}");
    }
}

#[test]
fn diagrams_without_columns_without_points_or_with_infinite_numbers_are_drawn() {
    let mut wild = columns(3, 4);
    wild[0].value = f64::NAN;
    wild[1].points[0].before = model::state(&[f64::INFINITY, 0.0, f64::NAN]);
    (wild[0].lyapunov, wild[1].lyapunov, wild[2].lyapunov_error) =
        (f64::NAN, f64::NEG_INFINITY, Some(f64::INFINITY));
    let long = "a title that no figure has room for, ".repeat(12);
    for (title, columns) in
        [("", vec![]), ("one column", columns(1, 1)), ("no points", columns(9, 0)), (&long, wild)]
    {
        assert_eq!(read(&diagram(Format::Png, [title, ""], E, &columns)).width(), 1600);
    }
}

//! `report.html`: one page that needs nothing else, not even a network.
//!
//! The page's own code is in `report/`. Its data are JSON; arrays over the cells are little
//! endian numbers, compressed with gzip (browsers unpack that themselves) and written in
//! base64.
//!
//! The page runs its own script and style and nothing else, which its policy says: what gets into a page from a scene or a
//! manifest is text, and would stay text if it were written as a script.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use bytemuck::NoUninit;
use flate2::Compression;
use flate2::write::GzEncoder;
use rayon::prelude::*;
use serde::{Serialize, Serializer};
use sha2::{Digest, Sha256};

use crate::map::scene::{Quantity, Rule, Scale, Scene, Target};
use crate::show::cells::{Cells, Row, SOURCES};
use crate::show::error::WriteError;
use crate::show::figure::map::subtitle;
use crate::show::layers::{Color, Layer};
use crate::show::symbols::symbol;
use crate::show::table::attractors_csv::named;
use crate::show::words::{Spelled, Words};
use crate::show::{caption, names, replay};
use crate::store::manifest::map::RefinementObject;
use rattlemap_dynamics::orbit::Status;

const PAGE: &str = include_str!("report/page.html");
const STYLE: &str = include_str!("report/page.css");
const SCRIPT: &str = include_str!("report/page.js");

#[derive(Serialize)]
struct Data<'a> {
    title: String,
    subtitle: String,
    /// Every parameter that no axis sweeps, with its value or what it follows; and what the model is taken from.
    fixed: String,
    source: Option<String>,
    axes: Vec<AxisData>,
    derived: Vec<DerivedData>,
    /// What follows the `--set` of swept and derived parameters in the command that replays a cell.
    replay: String,
    /// Where cells start that follow their neighbours: four numbers per cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    starts: Option<Packed>,
    /// The first cell's start, where axes sweep components of it.
    start: Option<Vec<f64>>,
    /// Components of a state.
    components: usize,
    layers: Vec<LayerData>,
    values: Values,
    classes: [&'static str; 4],
    statuses: Vec<&'static str>,
    sources: Vec<&'static str>,
    words: Vec<String>,
    patterns: Vec<String>,
    /// By label.
    attractors: Vec<String>,
    /// What became of an adaptive map.
    refinement: Option<RefinementObject>,
    validation: Option<&'a serde_json::Value>,
}

#[derive(Serialize)]
struct AxisData {
    parameter: String,
    symbol: String,
    meaning: String,
    min: f64,
    max: f64,
    count: usize,
    scale: &'static str,
    /// The place of the component, where it sweeps the start.
    #[serde(skip_serializing_if = "Option::is_none")]
    start: Option<usize>,
    /// Of an axis that is not linear.
    #[serde(skip_serializing_if = "Option::is_none")]
    values: Option<Vec<f64>>,
}

/// A parameter that follows others: its values over the cells, along the axes on which they depend alone.
#[derive(Serialize)]
struct DerivedData {
    parameter: String,
    along: [bool; 2],
    #[serde(flatten)]
    values: Packed,
}

#[derive(Serialize)]
struct LayerData {
    name: &'static str,
    short: &'static str,
    title: &'static str,
    palette: Vec<String>,
    entries: Vec<EntryData>,
    bar: Option<BarData>,
    #[serde(flatten)]
    indices: Packed,
}

#[derive(Serialize)]
struct EntryData {
    color: String,
    text: String,
    cells: usize,
}

#[derive(Serialize)]
struct BarData {
    label: &'static str,
    colors: Vec<String>,
    low: f64,
    high: f64,
    /// Sentences on what lies beyond its ends.
    left_out: Vec<String>,
}

/// An array over the cells.
#[derive(Serialize)]
struct Packed {
    #[serde(rename = "type")]
    kind: &'static str,
    data: String,
}

/// What the page reads out for a cell, by name.
struct Values(Vec<(&'static str, Packed)>);

impl Serialize for Values {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, values)| (name, values)))
    }
}

/// Writes the page, with the section on validation if there is one.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write(
    path: &Path,
    cells: &Cells<'_>,
    layers: &[Layer],
    spelled: &Spelled,
    validation: Option<&serde_json::Value>,
) -> Result<(), WriteError> {
    let scene = cells.scene();
    let data = Data {
        title: scene.title().to_owned(),
        subtitle: subtitle(scene),
        fixed: caption::all_fixed(scene),
        source: scene.base().source().map(str::to_owned),
        axes: scene.axes().iter().map(AxisData::from).collect(),
        derived: derived(scene),
        replay: replay::arguments(scene),
        starts: starts(cells),
        components: scene.base().state_names().len(),
        start: scene.sweeps_start().then(|| cells.start(0)[..scene.base().state_names().len()].to_vec()),
        layers: layers.par_iter().map(LayerData::from).collect(),
        values: values(cells, spelled),
        classes: names::CLASSES,
        statuses: Status::ALL.iter().map(|&status| names::status(status)).collect(),
        sources: SOURCES.iter().map(|&source| names::source(source)).collect(),
        words: texts(spelled.words.as_ref()),
        patterns: texts(spelled.patterns.as_ref()),
        attractors: cells.basins().map_or(Vec::new(), |basins| {
            basins.attractors().iter().enumerate().map(|(label, attractor)| named(label, attractor)).collect()
        }),
        refinement: cells.refinement().map(RefinementObject::from),
        validation,
    };
    let [style, script] = [STYLE, SCRIPT].map(inline);
    let policy = policy(&style, &script);
    let title = scene.title().replace('&', "&amp;").replace('<', "&lt;");
    // One pass: data must not be searched for marks. Nor are they held twice: of a large map they are long.
    let mut page = BufWriter::new(File::create(path)?);
    let mut rest = PAGE;
    for (mark, text) in [
        ("@POLICY@", Some(policy.as_str())),
        ("@TITLE@", Some(&title)),
        ("@STYLE@", Some(&style)),
        ("@DATA@", None),
        ("@SCRIPT@", Some(&script)),
    ] {
        let Some((before, after)) = rest.split_once(mark) else { unreachable!("the page has {mark}") };
        page.write_all(before.as_bytes())?;
        match text {
            Some(text) => page.write_all(text.as_bytes())?,
            None => serde_json::to_writer(InScript(&mut page), &data)?,
        }
        rest = after;
    }
    page.write_all(rest.as_bytes())?;
    Ok(page.flush()?)
}

/// JSON inside of a script, which `<` could end: it is escaped.
struct InScript<W>(W);

impl<W: Write> Write for InScript<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for (nth, part) in bytes.split(|&byte| byte == b'<').enumerate() {
            if nth > 0 {
                self.0.write_all(b"\\u003c")?;
            }
            self.0.write_all(part)?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// An inline part as it stands between its tags. Browsers hash what they have parsed, in which lines end in line feeds.
fn inline(source: &str) -> String {
    format!("\n{}\n", source.replace("\r\n", "\n").trim_end())
}

/// What a browser may load and run: these two inline parts, by their hashes.
fn policy(style: &str, script: &str) -> String {
    let [style, script] =
        [style, script].map(|part| format!("'sha256-{}'", STANDARD.encode(Sha256::digest(part))));
    format!("default-src 'none'; script-src {script}; style-src {style}; base-uri 'none'; form-action 'none'")
}

/// Derived parameters in the order of the scene's.
fn derived(scene: &Scene) -> Vec<DerivedData> {
    let points = scene.points();
    let [columns, rows] = points.counts();
    let of = |rule: &Rule| {
        let along = [0, 1].map(|i| {
            scene
                .axes()
                .get(i)
                .and_then(|axis| axis.target().parameter())
                .is_some_and(|index| rule.follows(index))
        });
        let counts = [if along[0] { columns } else { 1 }, if along[1] { rows } else { 1 }];
        let cells = (0..counts[1]).flat_map(|j| (0..counts[0]).map(move |i| j * columns + i));
        let values: Vec<f64> = cells.map(|cell| points.model(cell).value(rule.index())).collect();
        let parameter = rule.parameter().name.to_string();
        DerivedData { parameter, along, values: packed("f64", &values) }
    };
    points.derived().rules().iter().map(of).collect()
}

/// Starts that a cell's record does not tell, in full: the command that replays it needs them.
fn starts(cells: &Cells<'_>) -> Option<Packed> {
    let [columns, rows] = cells.counts();
    let all = || (0..columns * rows).map(|id| cells.start(id)).collect::<Vec<[f64; 4]>>();
    cells.scene().start().follows().then(|| packed("f64", &all()))
}

/// What the page reads out for a cell, one array per quantity that the scene asks for.
fn values(cells: &Cells<'_>, spelled: &Spelled) -> Values {
    let [columns, rows] = cells.counts();
    let all = || (0..columns * rows).into_par_iter().map(|id| cells.row(id));
    let floats = |field: fn(&Row) -> Option<f64>| {
        packed("f32", &all().map(|row| field(&row).unwrap_or(f64::NAN) as f32).collect::<Vec<_>>())
    };
    let integers = |field: fn(&Row) -> u32| packed("u32", &all().map(|row| field(&row)).collect::<Vec<_>>());
    let bytes = |field: fn(&Row) -> u8| packed("u8", &all().map(|row| field(&row)).collect::<Vec<_>>());
    let mut list = vec![
        ("status", bytes(|row| row.status.code() as u8)),
        ("periods_run", integers(|row| row.periods_run)),
    ];
    if cells.asks(Quantity::Class) {
        list.push(("class", bytes(|row| row.class.map_or(u8::MAX, |class| names::class_code(class) as u8))));
        list.push(("period", bytes(|row| row.period.unwrap_or(0) as u8)));
    }
    if cells.asks(Quantity::Lyapunov) {
        list.push(("lyapunov", floats(|row| row.lyapunov)));
        list.push(("lyapunov_error", floats(|row| row.lyapunov_error)));
    }
    if cells.asks(Quantity::Impacts) {
        list.push(("impacts_per_period", floats(|row| row.impacts_per_period)));
    }
    if cells.asks(Quantity::Mesh) {
        list.push(("mesh_fraction", floats(|row| row.mesh_fraction)));
    }
    if cells.asks(Quantity::Symmetric) {
        list.push(("symmetric", bytes(|row| row.symmetric.map_or(u8::MAX, u8::from))));
    }
    if cells.refinement().is_some() {
        list.push(("source", bytes(|row| row.source as u8)));
    }
    if let Some(basins) = cells.basins() {
        let labels: Vec<u32> = basins.labels().iter().map(|&label| label.into()).collect();
        list.push(("attractor", packed("u32", &labels)));
    }
    if let Some(counts) = cells.attractors() {
        list.push(("attractors", packed("u8", counts)));
    }
    for (name, words) in [("word", &spelled.words), ("pattern", &spelled.patterns)] {
        list.extend(words.as_ref().map(|words| (name, packed("u32", &words.numbers))));
    }
    Values(list)
}

fn texts(words: Option<&Words>) -> Vec<String> {
    words.map_or(Vec::new(), |words| words.list.iter().map(|(spelling, _)| spelling.text()).collect())
}

fn packed<T: NoUninit>(kind: &'static str, values: &[T]) -> Packed {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    // Memory takes whatever is written to it.
    let bytes = encoder.write_all(bytemuck::cast_slice(values)).and_then(|()| encoder.finish());
    Packed { kind, data: STANDARD.encode(bytes.unwrap_or_default()) }
}

impl From<&crate::map::scene::Axis> for AxisData {
    fn from(axis: &crate::map::scene::Axis) -> Self {
        let parameter = axis.parameter();
        AxisData {
            parameter: parameter.name.to_string(),
            symbol: symbol(&parameter.name),
            meaning: parameter.meaning.to_string(),
            min: axis.min(),
            max: axis.max(),
            count: axis.count(),
            scale: axis.scale().name(),
            start: match axis.target() {
                Target::Start(place) => Some(place),
                Target::Parameter(_) => None,
            },
            values: (axis.scale() != Scale::Linear).then(|| axis.values().collect()),
        }
    }
}

impl From<&Layer> for LayerData {
    fn from(layer: &Layer) -> Self {
        let entry = |entry: &crate::show::layers::Entry| EntryData {
            color: hex(&entry.color),
            text: entry.text.clone(),
            cells: entry.cells,
        };
        LayerData {
            name: layer.name,
            short: layer.short,
            title: layer.title,
            palette: layer.palette.iter().map(hex).collect(),
            entries: layer.entries.iter().map(entry).collect(),
            bar: layer.bar.as_ref().map(|bar| BarData {
                label: bar.label,
                colors: bar.colors.iter().step_by(6).map(hex).collect(),
                low: bar.low,
                high: bar.high,
                left_out: bar.left_out(layer.indices.len()),
            }),
            indices: packed("u8", &layer.indices),
        }
    }
}

fn hex([r, g, b]: &Color) -> String {
    format!("{r:02x}{g:02x}{b:02x}")
}

//! `report.html`: one page that needs no other file and no network.
//!
//! The page's own code is in `report/`. Its data are JSON. Arrays over the cells are little endian numbers, compressed with
//! gzip and encoded in base64.
//!
//! The page's security policy allows only its own script and style. Texts from a scene or a manifest are never executed.

use std::io::{self, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use bytemuck::NoUninit;
use flate2::Compression;
use flate2::write::GzEncoder;
use rayon::prelude::*;
use serde::{Serialize, Serializer};
use sha2::{Digest, Sha256};

use crate::map::scene::{Axis, Quantity, Rule, Scale, Scene, Target};
use crate::show::cells::{Cells, Row, Source};
use crate::show::color::Color;
use crate::show::error::WriteError;
use crate::show::layers::{Layer, NamedColor};
use crate::show::refinement::RefinementObject;
use crate::show::symbols::symbol;
use crate::show::table::attractors_csv::attractor_name;
use crate::show::words::{MapWords, WordIndex};
use crate::show::{caption, replay};
use rattlemap_dynamics::orbit::{Class, Status};

const PAGE: &str = include_str!("report/page.html");
const STYLE: &str = include_str!("report/page.css");
const SCRIPT: &str = include_str!("report/page.js");

#[derive(Serialize)]
struct PageData<'a> {
    title: String,
    subtitle: String,
    /// Fixed and derived parameters.
    fixed: String,
    /// Literature source of the model.
    source: Option<String>,
    axes: Vec<AxisData>,
    derived: Vec<DerivedData>,
    /// Arguments of the replay command that are the same for all cells.
    replay: String,
    /// Start states of cells that follow their neighbours: four numbers per cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    starts: Option<Packed>,
    /// Start state of the first cell, if axes sweep components of it.
    start: Option<Vec<f64>>,
    /// Number of components of a state.
    components: usize,
    layers: Vec<LayerData<'a>>,
    values: CellValues,
    classes: [&'static str; 4],
    statuses: Vec<&'static str>,
    sources: [&'static str; 2],
    words: Vec<String>,
    patterns: Vec<String>,
    /// Names of attractors by label.
    attractors: Vec<String>,
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
    /// Index of the component of the start that the axis sweeps.
    #[serde(skip_serializing_if = "Option::is_none")]
    start: Option<usize>,
    /// Values of an axis that is not linear.
    #[serde(skip_serializing_if = "Option::is_none")]
    values: Option<Vec<f64>>,
}

/// Values of a derived parameter, along the axes that it depends on.
#[derive(Serialize)]
struct DerivedData {
    parameter: String,
    along: [bool; 2],
    #[serde(flatten)]
    values: Packed,
}

#[derive(Serialize)]
struct LayerData<'a> {
    name: &'static str,
    short: &'static str,
    title: &'static str,
    palette: Vec<String>,
    entries: Vec<EntryData<'a>>,
    bar: Option<BarData>,
    #[serde(flatten)]
    indices: Packed,
}

#[derive(Serialize)]
struct EntryData<'a> {
    color: String,
    text: &'a str,
    cells: usize,
}

#[derive(Serialize)]
struct BarData {
    label: &'static str,
    colors: Vec<String>,
    low: f64,
    high: f64,
    /// Sentences about values beyond the ends.
    left_out: Vec<String>,
}

/// A compressed array.
#[derive(Serialize)]
struct Packed {
    #[serde(rename = "type")]
    kind: &'static str,
    data: String,
}

/// Arrays of the values that the page shows for a cell, by name.
struct CellValues(Vec<(&'static str, Packed)>);

impl Serialize for CellValues {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, values)| (name, values)))
    }
}

/// Writes the page, with a section on the validation if there was one.
///
/// # Errors
/// [`WriteError`] if it cannot be written.
pub(crate) fn write(
    mut page: impl Write,
    cells: &Cells<'_>,
    layers: &[Layer],
    words: &MapWords,
    validation: Option<&serde_json::Value>,
) -> Result<(), WriteError> {
    let scene = cells.scene();
    let components = scene.base().state_names().len();
    let attractors = cells.basins().into_iter().flat_map(|basins| basins.attractors().iter().enumerate());
    let data = PageData {
        title: scene.title().to_owned(),
        subtitle: caption::integration(scene),
        fixed: caption::all_fixed(scene),
        source: scene.base().source().map(str::to_owned),
        axes: scene.axes().iter().map(AxisData::from).collect(),
        derived: derived(scene),
        replay: replay::arguments(scene),
        starts: scene
            .start()
            .follows()
            .then(|| packed("f64", &(0..cells.count()).map(|id| cells.start(id)).collect::<Vec<[f64; 4]>>())),
        components,
        start: scene.sweeps_start().then(|| cells.start(0)[..components].to_vec()),
        layers: layers.par_iter().map(LayerData::from).collect(),
        values: values(cells, words),
        classes: Class::NAMES,
        statuses: Status::ALL.iter().map(|status| status.name()).collect(),
        sources: Source::ALL.map(Source::name),
        words: words.words.as_ref().map_or(Vec::new(), WordIndex::spellings),
        patterns: words.patterns.as_ref().map_or(Vec::new(), WordIndex::spellings),
        attractors: attractors.map(|(label, attractor)| attractor_name(label, attractor)).collect(),
        refinement: cells.refinement().map(RefinementObject::from),
        validation,
    };
    let [style, script] = [STYLE, SCRIPT].map(inline);
    let policy = policy(&style, &script);
    let title = scene.title().replace('&', "&amp;").replace('<', "&lt;");
    // The data are long, so they are neither searched for marks nor copied.
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

/// Writes JSON inside a script element. `<` is escaped, because it could end the element.
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

/// Returns the content of a script or style element. Browsers compute its hash after converting line ends to line feeds.
fn inline(source: &str) -> String {
    format!("\n{}\n", source.replace("\r\n", "\n").trim_end())
}

/// Returns the security policy: a browser may run the page's script and style, identified by their hashes, and nothing else.
fn policy(style: &str, script: &str) -> String {
    let [style, script] =
        [style, script].map(|part| format!("'sha256-{}'", STANDARD.encode(Sha256::digest(part))));
    format!("default-src 'none'; script-src {script}; style-src {style}; base-uri 'none'; form-action 'none'")
}

/// Returns the derived parameters in the order of the scene.
fn derived(scene: &Scene) -> Vec<DerivedData> {
    let points = scene.points();
    let [columns, rows] = points.counts();
    let data = |rule: &Rule| {
        let follows = |axis: &Axis| axis.target().parameter().is_some_and(|index| rule.follows(index));
        let along = [0, 1].map(|i| scene.axes().get(i).is_some_and(follows));
        let counts = [if along[0] { columns } else { 1 }, if along[1] { rows } else { 1 }];
        let cells = (0..counts[1]).flat_map(|j| (0..counts[0]).map(move |i| j * columns + i));
        let values: Vec<f64> = cells.map(|cell| points.model(cell).value(rule.index())).collect();
        let parameter = rule.parameter().name.to_string();
        DerivedData { parameter, along, values: packed("f64", &values) }
    };
    points.derived().rules().iter().map(data).collect()
}

/// A function that reads one value of a cell, by its type in the page.
enum PageValue {
    U8(fn(&Row) -> u8),
    U32(fn(&Row) -> u32),
    F32(fn(&Row) -> Option<f64>),
}

/// Values of a cell and the quantities that the scene must request for them.
const VALUES: [(&str, Option<Quantity>, PageValue); 9] = [
    ("status", None, PageValue::U8(|row| row.status.code() as u8)),
    ("periods_run", None, PageValue::U32(|row| row.periods_run)),
    (
        "class",
        Some(Quantity::Class),
        PageValue::U8(|row| row.class.map_or(u8::MAX, |class| class.index() as u8)),
    ),
    ("period", Some(Quantity::Class), PageValue::U8(|row| row.period.unwrap_or(0) as u8)),
    ("lyapunov", Some(Quantity::Lyapunov), PageValue::F32(|row| row.lyapunov)),
    ("lyapunov_error", Some(Quantity::Lyapunov), PageValue::F32(|row| row.lyapunov_error)),
    ("impacts_per_period", Some(Quantity::Impacts), PageValue::F32(|row| row.impacts_per_period)),
    ("mesh_fraction", Some(Quantity::Mesh), PageValue::F32(|row| row.mesh_fraction)),
    ("symmetric", Some(Quantity::Symmetric), PageValue::U8(|row| row.symmetric.map_or(u8::MAX, u8::from))),
];

/// Returns the values that the page shows for a cell.
fn values(cells: &Cells<'_>, words: &MapWords) -> CellValues {
    let rows = || cells.ids().map(|id| cells.row(id));
    let pack = |value: &PageValue| match *value {
        PageValue::U8(value) => packed("u8", &rows().map(|row| value(&row)).collect::<Vec<_>>()),
        PageValue::U32(value) => packed("u32", &rows().map(|row| value(&row)).collect::<Vec<_>>()),
        PageValue::F32(value) => {
            packed("f32", &rows().map(|row| value(&row).unwrap_or(f64::NAN) as f32).collect::<Vec<_>>())
        }
    };
    let requested = VALUES.iter().filter(|(_, quantity, _)| quantity.is_none_or(|it| cells.has(it)));
    let mut list: Vec<(&str, Packed)> = requested.map(|(name, _, value)| (*name, pack(value))).collect();
    if cells.refinement().is_some() {
        list.push(("source", pack(&PageValue::U8(|row| row.source as u8))));
    }
    if let Some(basins) = cells.basins() {
        let labels: Vec<u32> = basins.labels().iter().map(|&label| label.into()).collect();
        list.push(("attractor", packed("u32", &labels)));
    }
    if let Some(counts) = cells.attractors() {
        list.push(("attractors", packed("u8", counts)));
    }
    for (name, index) in [("word", &words.words), ("pattern", &words.patterns)] {
        list.extend(index.as_ref().map(|index| (name, packed("u32", &index.numbers))));
    }
    CellValues(list)
}

fn packed<T: NoUninit>(kind: &'static str, values: &[T]) -> Packed {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    // Writing to memory cannot fail.
    let bytes = encoder.write_all(bytemuck::cast_slice(values)).and_then(|()| encoder.finish());
    Packed { kind, data: STANDARD.encode(bytes.unwrap_or_default()) }
}

impl From<&Axis> for AxisData {
    fn from(axis: &Axis) -> Self {
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

impl<'a> From<&'a Layer> for LayerData<'a> {
    fn from(layer: &'a Layer) -> Self {
        let entry = |entry: &'a NamedColor| EntryData {
            color: hex(&entry.color),
            text: &entry.text,
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
                left_out: bar.remarks(layer.indices.len()),
            }),
            indices: packed("u8", &layer.indices),
        }
    }
}

fn hex([r, g, b]: &Color) -> String {
    format!("{r:02x}{g:02x}{b:02x}")
}

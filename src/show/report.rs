//! `report.html`: one page that needs no other file and no network.
//!
//! The page's own code is in `report/`. Its data are JSON. Arrays over the cells are little endian numbers, compressed with
//! gzip and encoded in base64.
//!
//! The page can compute: it contains the crate `web/` as WebAssembly. A click on a cell computes its motion. Zooming computes
//! finer cells of the visible part, and sliders change the parameters of all cells.
//!
//! The page's security policy allows only its own script and style, and what the script makes. Texts from a scene or a manifest are never executed.

use std::io::{self, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use bytemuck::NoUninit;
use flate2::Compression;
use flate2::write::GzEncoder;
use rayon::prelude::*;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::map::curves::{Curves, cell_place};
use crate::map::scene::{Axis, Quantity, Rule, Scale, Scene, Target};
use crate::map::schedule::{Audit, Refined};
use crate::model_file::{FileModel, letters_in_words};
use crate::record::{Record, Spelling};
use crate::show::cells::{Cells, Finished, Row, Source};
use crate::show::color::{Color, hex};
use crate::show::error::WriteError;
use crate::show::layers::{Bar, Layer, NamedColor, share};
use crate::show::provenance::Provenance;
use crate::show::symbols::{axis_label, symbol};
use crate::show::table::attractors_csv::attractor_names;
use crate::show::words::{MapWords, WordIndex};
use crate::show::{caption, drawing, figure, refinement, replay, sketch};
use rattlemap_dynamics::model::Parameter;
use rattlemap_dynamics::orbit::{Class, Status};

const PAGE: &str = include_str!("report/page.html");
const STYLE: &str = include_str!("report/page.css");
const SCRIPT: &str = concat!(
    include_str!("report/data.js"),
    include_str!("report/ticks.js"),
    include_str!("report/drawing.js"),
    include_str!("report/colors.js"),
    include_str!("report/values.js"),
    include_str!("report/input.js"),
    include_str!("report/orbit.js"),
    include_str!("report/live.js"),
    include_str!("report/lanes.js"),
    include_str!("report/second.js"),
    include_str!("report/checks.js"),
    include_str!("report/start.js"),
);

/// The engine that computes orbits in the page, compressed WebAssembly, and the script of its worker. `scripts/wasm.sh` makes
/// `engine.wasm.gz` and `engine.js` from `web/`.
#[cfg(not(target_arch = "wasm32"))]
const ENGINE: &[u8] = include_bytes!("report/engine.wasm.gz");
#[cfg(not(target_arch = "wasm32"))]
const WORKER: &str = concat!(include_str!("report/engine.js"), include_str!("report/worker.js"));
// The engine is built from this library, before it exists.
#[cfg(target_arch = "wasm32")]
const ENGINE: &[u8] = &[];
#[cfg(target_arch = "wasm32")]
const WORKER: &str = "";

/// Returns the data of the page with a sketch of the model. The page's engine, which only computes views, calls [`data`].
pub fn sketched(
    cells: &Cells<'_>,
    made: &Provenance<'_>,
    layers: &[Layer],
    words: &MapWords,
    validation: Option<&Value>,
) -> Value {
    let mut data = data(cells, made, layers, words, validation);
    let model = cells.scene().base().downcast_ref::<FileModel>();
    data["sketch"] = model.map(|model| packed("u8", drawing::svg(&sketch::draw(model)).as_bytes())).into();
    data
}

/// Returns the data of the page, with those of the validation if there was one.
pub fn data(
    cells: &Cells<'_>,
    made: &Provenance<'_>,
    layers: &[Layer],
    words: &MapWords,
    validation: Option<&Value>,
) -> Value {
    let scene = cells.scene();
    let components = scene.base().state_names().len();
    let attractors = cells.basins().map_or(&[][..], |basins| basins.attractors());
    let spellings = |index: &Option<WordIndex>| index.as_ref().map_or(Vec::new(), WordIndex::spellings);
    let mut data = json!({
        "title": scene.title(),
        "subtitle": caption::integration(scene),
        "fixed": caption::all_fixed(scene),
        "parameters": scene.fixed().map(parameter).collect::<Vec<_>>(),
        "made": {
            "engine": made.engine,
            "precision": made.precision,
            "device": made.device,
            "version": env!("CARGO_PKG_VERSION"),
            "commit": made.commit,
        },
        "model": scene.base().title(),
        "source": scene.base().source(),
        "equations": scene.base().downcast_ref::<FileModel>().map(FileModel::equations),
        "letters": letters_in_words(scene.base()),
        // The scene without its axes, to which the page adds those of the view, and the command that computes it.
        "scene": scene.settings(),
        "compute": compute(made),
        "axes": scene.axes().iter().map(axis).collect::<Vec<_>>(),
        "derived": derived(scene),
        // Arguments of the replay command that are the same for all cells.
        "replay": replay::arguments(scene),
        // Text of the map's own model file; empty for a built-in model, absent for a model that is not a file.
        "model_file": scene.base().downcast_ref::<FileModel>().map(own_text),
        "components": components,
        "live": live(cells),
        // Start state of the first cell, if axes sweep components of it.
        "start": scene.sweeps_start().then(|| cells.start(0)[..components].to_vec()),
        "layers": layers.par_iter().map(layer).collect::<Vec<_>>(),
        "values": values(cells, words),
        "classes": Class::NAMES,
        "statuses": Status::ALL.iter().map(|status| status.name()).collect::<Vec<_>>(),
        "sources": Source::ALL.map(Source::name),
        "finishers": Finished::ALL.map(Finished::name),
        "words": spellings(&words.words),
        "patterns": spellings(&words.patterns),
        "attractors": attractor_names(attractors, &scene.base().state_names()),
        // Values of both axes at the strobe states of attractors.
        "marks": figure::map::attractors(cells),
        "refinement": cells.refinement().map(|refined| audits(cells, refined)),
        "validation": validation,
    });
    // Start states of cells that follow their neighbours, four numbers per cell or more if states have more.
    if scene.start().follows() {
        let count = components.max(4);
        let starts: Vec<f64> = (0..cells.count()).flat_map(|id| cells.start(id)[..count].to_vec()).collect();
        data["starts"] = packed("f64", &starts);
    }
    data
}

/// Returns the position of a value on an axis, in cells. Cell i spans i to i + 1.
fn place(axis: &Axis, value: f64) -> f64 {
    let share = (value / axis.min()).ln() / (axis.max() / axis.min()).ln();
    0.5 + match axis.scale() {
        Scale::Log => share * (axis.count() - 1) as f64,
        _ => cell_place(axis, value),
    }
}

/// Adds bifurcation curves to the data of the page: what each curve is, and the points of all curves in one array, in cells.
pub fn add_curves(data: &mut Value, scene: &Scene, found: &Curves) {
    let (mut list, mut places, mut stable) = (Vec::new(), Vec::<f32>::new(), Vec::<u8>::new());
    for curve in &found.curves {
        let line = curve.line();
        let pieces = (line.len() - 1) / (curve.points.len() - 1).max(1);
        list.push(json!({
            "kind": curve.kind.name().replace('_', " "),
            "color": hex(figure::map::curve_color(curve.kind)),
            "period": curve.period,
            "word": Spelling::new(&curve.word).text(),
            "count": line.len(),
        }));
        for (nth, values) in line.iter().enumerate() {
            places.extend([0, 1].map(|i| place(&scene.axes()[i], values[i]) as f32));
            stable.push(curve.points[nth.div_ceil(pieces.max(1))].stable.into());
        }
    }
    data["curves"] =
        json!({ "list": list, "places": packed("f32", &places), "stable": packed("u8", &stable) });
}

/// Writes the page.
///
/// # Errors
/// If a write fails.
pub fn write(mut page: impl Write, data: &Value) -> Result<(), WriteError> {
    // The script contains that of the worker, so that the policy's hash covers both.
    let worker = packed("u8", WORKER.as_bytes());
    let script = format!("{}const WORKER = {worker};\n", without_comments(SCRIPT));
    let [style, script] = [STYLE, &script].map(inline);
    let engine = STANDARD.encode(ENGINE);
    let policy = policy(&style, &script);
    let title = data["title"].as_str().unwrap_or_default().replace('&', "&amp;").replace('<', "&lt;");
    // The data are long, so they are neither searched for marks nor copied.
    let mut rest = PAGE;
    for (mark, text) in [
        ("@POLICY@", Some(policy.as_str())),
        ("@TITLE@", Some(&title)),
        ("@STYLE@", Some(&style)),
        ("@ENGINE@", Some(&engine)),
        ("@DATA@", None),
        ("@SCRIPT@", Some(&script)),
    ] {
        let Some((before, after)) = rest.split_once(mark) else { unreachable!("the page has {mark}") };
        page.write_all(before.as_bytes())?;
        match text {
            Some(text) => page.write_all(text.as_bytes())?,
            None => serde_json::to_writer(InScript(&mut page), data)?,
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

/// Removes the lines that are comments. They are a fifth of the scripts.
fn without_comments(script: &str) -> String {
    let is_comment = |line: &str| line.starts_with("//") || (line.starts_with("/**") && line.ends_with("*/"));
    script.lines().filter(|line| !is_comment(line.trim_start())).flat_map(|line| [line, "\n"]).collect()
}

/// Returns the content of a script or style element. Browsers compute its hash after converting line ends to line feeds.
fn inline(source: &str) -> String {
    format!("\n{}\n", source.replace("\r\n", "\n").trim_end())
}

/// Returns the text of a model's file; none for a built-in model.
fn own_text(model: &FileModel) -> &str {
    if model.is_built_in() { "" } else { &model.definition().text }
}

/// Returns the security policy. A browser may use the page's script and style, which their hashes identify. The script may start
/// workers, compile WebAssembly and show images that it makes itself.
fn policy(style: &str, script: &str) -> String {
    let [style, script] =
        [style, script].map(|part| format!("'sha256-{}'", STANDARD.encode(Sha256::digest(part))));
    format!(
        "default-src 'none'; script-src {script} 'wasm-unsafe-eval'; worker-src blob:; img-src blob:; frame-src blob:; style-src {style}; \
         base-uri 'none'; form-action 'none'"
    )
}

/// Returns what an adaptive map reports, and the numbers of wrong cells of all its audits.
fn audits(cells: &Cells<'_>, refined: &Refined) -> Value {
    let audit = |audit: &Audit| json!({ "sampled": audit.sampled, "wrong": audit.wrong });
    json!({ "lines": refinement::lines(cells), "audits": refined.audits.iter().map(audit).collect::<Vec<_>>() })
}

/// Ticks of a part of an axis, as JSON: `marks`, each a value and its label, which is empty for a minor tick, and `factor`, which
/// follows the name of the axis if all labels have a common factor.
///
/// `ends` are values on a linear axis, decimal logarithms on a logarithmic one, and indices of `listed` values. The part is
/// `length` long, and labels are `spacing` apart where possible.
pub fn ticks(scale: Scale, ends: [f64; 2], listed: &[f64], length: f64, spacing: f64) -> Value {
    let ([low, high], listed) = (ends, listed.to_vec());
    ticks_of(&drawing::axis::Axis { label: String::new(), low, high, scale, listed }, length, spacing)
}

fn ticks_of(axis: &drawing::axis::Axis, length: f64, spacing: f64) -> Value {
    let ticks = drawing::ticks::ticks(axis, length, spacing);
    let marks: Vec<Value> = ticks.list.iter().map(|tick| json!([axis.value(tick.at), tick.label])).collect();
    json!({ "marks": marks, "factor": ticks.factor() })
}

/// Returns the derived parameters in the order of the scene. Values are stored along the axes that they depend on.
fn derived(scene: &Scene) -> Vec<Value> {
    let points = scene.points();
    let [columns, rows] = points.counts();
    let object = |rule: &Rule| {
        let follows = |axis: &Axis| axis.target().parameter().is_some_and(|index| rule.follows(index));
        let along = [0, 1].map(|i| scene.axes().get(i).is_some_and(follows));
        let counts = [if along[0] { columns } else { 1 }, if along[1] { rows } else { 1 }];
        let cells = (0..counts[1]).flat_map(|j| (0..counts[0]).map(move |i| j * columns + i));
        let values: Vec<f64> = cells.map(|cell| points.model(cell).value(rule.index())).collect();
        let mut object = packed("f64", &values);
        object["parameter"] = rule.parameter().name.as_ref().into();
        object["along"] = json!(along);
        object
    };
    points.derived().rules().iter().map(object).collect()
}

/// Returns the command that computes a saved view as the map was computed.
fn compute(made: &Provenance<'_>) -> String {
    let precision =
        if made.engine == "gpu" { format!(" --precision {}", made.precision) } else { String::new() };
    format!("rattlemap map view.toml --engine {}{precision}", made.engine)
}

/// Returns the arrays of values that the page shows for a cell, by name, in addition to the numbers of layers.
fn values(cells: &Cells<'_>, words: &MapWords) -> Value {
    let rows = || cells.ids().map(|id| cells.row(id));
    let bytes = |value: fn(&Row) -> u8| packed("u8", &rows().map(|row| value(&row)).collect::<Vec<_>>());
    let mut object = json!({
        "status": bytes(|row| row.status.code() as u8),
        "periods_run": packed("u32", &rows().map(|row| row.periods_run).collect::<Vec<_>>()),
    });
    if cells.has(Quantity::Class) {
        object["class"] = bytes(|row| row.class.map_or(u8::MAX, |class| class.index() as u8));
        object["period"] = bytes(|row| row.period.unwrap_or(0) as u8);
    }
    if cells.has(Quantity::Lyapunov) {
        // The page shows NAME_error beside the number of the layer NAME.
        let errors: Vec<f32> = rows().map(|row| row.lyapunov_error.unwrap_or(f64::NAN) as f32).collect();
        object["lyapunov_error"] = packed("f32", &errors);
    }
    if cells.has(Quantity::Symmetric) {
        object["symmetric"] = bytes(|row| row.symmetric.map_or(u8::MAX, u8::from));
    }
    if cells.refinement().is_some() {
        object["source"] = bytes(|row| row.source as u8);
    }
    if cells.are_of_lanes() {
        object["finished"] = bytes(|row| row.finished.map_or(u8::MAX, |finished| finished as u8));
    }
    if let Some(basins) = cells.basins() {
        let labels: Vec<u32> = basins.labels().iter().map(|&label| label.into()).collect();
        object["attractor"] = packed("u32", &labels);
    }
    if let Some(counts) = cells.attractors() {
        object["attractors"] = packed("u8", counts);
    }
    for (name, index) in [("word", &words.words), ("pattern", &words.patterns)] {
        index.iter().for_each(|index| object[name] = packed("u32", &index.numbers));
    }
    object
}

/// Returns a compressed array.
fn packed<T: NoUninit>(kind: &'static str, values: &[T]) -> Value {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    // Writing to memory cannot fail.
    let bytes = encoder.write_all(bytemuck::cast_slice(values)).and_then(|()| encoder.finish());
    json!({ "type": kind, "data": STANDARD.encode(bytes.unwrap_or_default()) })
}

/// Returns what workers of the page need to compute parts of the map: the number of runs per cell and the size of a record.
/// Null if they cannot compute parts: the scene lists its cells, cells start from their neighbours' final states, or the model
/// has no file.
fn live(cells: &Cells<'_>) -> Option<Value> {
    let scene = cells.scene();
    let can = scene.list().is_none()
        && !scene.start().follows()
        && scene.base().downcast_ref::<FileModel>().is_some();
    can.then(
        || json!({ "starts": cells.runs() / cells.count(), "record_bytes": Record::BYTES, "at_once": false }),
    )
}

/// Returns a parameter that the page can change. `min` or `max` is null if the range has no limit on that side.
fn parameter((parameter, value): (&Parameter, f64)) -> Value {
    let [min, max] = parameter.range.ends();
    json!({
        "name": parameter.name,
        "symbol": symbol(&parameter.name),
        "label": axis_label(parameter),
        "value": value,
        "min": min,
        "max": max,
    })
}

fn axis(axis: &Axis) -> Value {
    let parameter = axis.parameter();
    let mut object = json!({
        "parameter": parameter.name,
        "symbol": symbol(&parameter.name),
        "label": axis_label(parameter),
        "min": axis.min(),
        "max": axis.max(),
        "count": axis.count(),
        "scale": axis.scale().name(),
        // The page's engine replaces them when the view changes.
        "ticks": ticks_of(&figure::map_layout::axis(axis), 10.0, 1.0),
    });
    // Index of the component of the start that the axis sweeps.
    if let Target::Start(component) = axis.target() {
        object["start"] = component.into();
    }
    if axis.scale() != Scale::Linear {
        object["values"] = axis.values().collect();
    }
    object
}

/// Returns, for each colour of the palette, the number of the legend's entry that includes it, if there is one.
///
/// A colour without an entry belongs to the entry of the nearest earlier colour that has one. All shades of a bar belong to one
/// entry.
fn entries_of(layer: &Layer) -> Vec<Option<usize>> {
    let position = |color: &Color| layer.entries.iter().position(|entry| entry.color == *color);
    let shades = layer.bar.as_ref().filter(|_| layer.numbers.is_none()).map_or(0, |bar| bar.colors.len());
    let (named, shades) = layer.palette.split_at(layer.palette.len() - shades);
    let of_shades = shades.iter().find_map(position);
    let following = named.iter().scan(None, |last, color| {
        *last = position(color).or(*last);
        Some(*last)
    });
    following.chain(shades.iter().map(|_| of_shades)).collect()
}

fn layer(layer: &Layer) -> Value {
    let count = layer.indices.len();
    let entry = |entry: &NamedColor| json!({ "color": hex(entry.color), "text": entry.text, "share": share(entry.cells, count) });
    let bar = |bar: &Bar| {
        json!({
            "label": bar.label,
            "colors": bar.colors.iter().step_by(6).copied().map(hex).collect::<Vec<_>>(),
            "low": bar.low,
            "high": bar.high,
            "left_out": bar.remarks(count),
            "anchors": bar.anchors(),
            "is_fixed": bar.is_fixed,
            "ticks": ticks_of(&bar.axis(), 6.0, 1.0),
        })
    };
    let mut object = json!({
        "name": layer.name,
        "short": layer.short,
        "title": layer.title,
        "palette": layer.palette.iter().copied().map(hex).collect::<Vec<_>>(),
        "entries": layer.entries.iter().map(entry).collect::<Vec<_>>(),
        "entry_of": entries_of(layer),
        "bar": layer.bar.as_ref().map(bar),
    });
    // The page gives numbers their colours, because their range follows the view.
    match &layer.numbers {
        Some(numbers) => object["values"] = packed("f32", numbers),
        None => object["indices"] = packed("u8", &layer.indices),
    }
    object
}

//! `[figure]`: width, type size, heading and legend of all figures, and lines on maps.

use super::axis::{Axis, meanings, names};
use super::error::SceneError;
use super::keys;
use super::limits::MOST_LINES;
use super::section::{Field, Section};
use super::settings::read_title;
use super::{Points, Quantity};
use crate::model_file::{several_gaps, subjects};
use crate::text::document::Value;
use crate::text::expression::Expression;
use rattlemap_dynamics::model::Model;

/// Units of a width, in points.
const UNITS: [(&str, f64); 4] = [("mm", 72.0 / 25.4), ("cm", 720.0 / 25.4), ("in", 72.0), ("pt", 1.0)];
/// Smallest and largest width, in millimetres.
const WIDTHS: [f64; 2] = [60.0, 300.0];
/// Smallest and largest type size, in points.
const FONT_SIZES: [f64; 2] = [7.0, 24.0];
/// A figure is at least this many times as wide as its type size: room for a panel with its labels.
const LEAST_WIDTH: f64 = 21.0;

/// Appearance of all figures of a command.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureStyle {
    /// Width in points. None: each figure has its default width.
    pub width: Option<f64>,
    /// Type size of tick labels and legends, in points. None: 7.4.
    pub font_size: Option<f64>,
    /// Replaces the title. Empty: no heading at all.
    pub title: Option<String>,
    /// Whether there is a legend.
    pub legend: bool,
}

impl Default for FigureStyle {
    fn default() -> Self {
        FigureStyle { width: None, font_size: None, title: None, legend: true }
    }
}

impl FigureStyle {
    /// Reads a width such as `85mm`, in points.
    ///
    /// # Errors
    /// A text that says what is required.
    pub fn width(text: &str) -> Result<f64, String> {
        let [least, most] = WIDTHS;
        let requirement = || {
            format!(
                "a length from {least} mm to {most} mm with its unit (mm, cm, in or pt), such as \"85mm\""
            )
        };
        let unit = UNITS.iter().find_map(|(unit, points)| Some((text.trim().strip_suffix(unit)?, points)));
        let length = unit.and_then(|(number, points)| Some(number.trim().parse::<f64>().ok()? * points));
        let (_, millimetre) = UNITS[0];
        let is_allowed = |points: &f64| (least - 1e-9..=most + 1e-9).contains(&(points / millimetre));
        length.filter(is_allowed).ok_or_else(requirement)
    }

    /// Reads a type size in points.
    ///
    /// # Errors
    /// A text that says what is required.
    pub fn font_size(size: f64) -> Result<f64, String> {
        let [least, most] = FONT_SIZES;
        let requirement = || format!("a type size from {least} to {most} points");
        Some(size).filter(|size| (least..=most).contains(size)).ok_or_else(requirement)
    }

    /// Checks that the width has room for the type size.
    ///
    /// # Errors
    /// A text that says what is required of the type size.
    pub fn check(&self) -> Result<(), String> {
        let (Some(width), Some(size)) = (self.width, self.font_size) else { return Ok(()) };
        let most = width / LEAST_WIDTH;
        let requirement = || {
            let most = (10.0 * most).floor() / 10.0;
            format!(
                "a type size of at most {most} points at this width; choose a smaller type or a larger width"
            )
        };
        if size <= most { Ok(()) } else { Err(requirement()) }
    }
}

/// Name of the panels of section points of a diagram.
pub const SECTION: &str = "section";

/// Panels of a diagram and their files.
#[derive(Clone, Debug, Default)]
pub struct DiagramStyle {
    /// Names of the panels; none: all.
    pub panels: Option<Vec<&'static str>>,
    /// Whether each panel has a file of its own.
    pub is_divided: bool,
}

/// Scale of the colours of a layer: the factor of the decimal logarithm, none if linear, and the ends of the numbers.
pub(crate) type LayerScale = (Option<f64>, Option<[f64; 2]>);

/// Returns the place of a number on a scale; not finite if it has none.
pub(crate) fn place(factor: Option<f64>, number: f64) -> f64 {
    factor.map_or(number, |factor| factor * number.log10())
}

/// A line on maps: the zeros of an expression in the parameters of the model.
#[derive(Clone, Debug)]
pub struct MapLine {
    /// Name in the legend.
    pub name: String,
    expression: Expression,
}

impl MapLine {
    /// Returns the expression at any values of the two axes. It may be infinite or NaN.
    pub(crate) fn function<'a>(&'a self, points: &'a Points) -> impl Fn([f64; 2]) -> f64 + 'a {
        move |values| {
            let model = points.model_at(values);
            self.expression.evaluate(&|index| model.value(index))
        }
    }
}

/// The table `[figure]`.
#[derive(Clone, Debug, Default)]
pub(super) struct Figure {
    pub(super) style: FigureStyle,
    pub(super) lines: Vec<MapLine>,
    pub(super) diagram: DiagramStyle,
    /// Scales of layers by name.
    pub(super) scales: Vec<(String, LayerScale)>,
    /// Numbers at which layers have contours, by name.
    pub(super) contours: Vec<(String, Vec<f64>)>,
    /// Index of the gap whose contact the class map shows, if the scene names one of several.
    pub(super) gap: Option<usize>,
}

/// Reads `[figure]`.
pub(super) fn read(
    root: &Section<'_>,
    points: &Points,
    quantities: &[Quantity],
) -> Result<Figure, SceneError> {
    let section = root.section("figure", &keys::names("figure"))?;
    let mut style = FigureStyle::default();
    if let Some(field) = section.get("width") {
        style.width = Some(FigureStyle::width(field.text()?).map_err(|text| field.out_of_range(&text))?);
    }
    style.title = section.get("title").map(|field| read_title(&field)).transpose()?;
    if let Some(field) = section.get("legend") {
        style.legend = field.flag()?;
    }
    if let Some(field) = section.get("font_size") {
        style.font_size =
            Some(FigureStyle::font_size(field.number()?).map_err(|text| field.out_of_range(&text))?);
        style.check().map_err(|text| field.out_of_range(&text))?;
    }
    let lines = section.get("lines").map(|field| read_lines(&field, points)).transpose()?;
    let mut diagram = DiagramStyle::default();
    if let Some(field) = section.get("panels") {
        let measured = Quantity::measured().into_iter().filter(|quantity| quantities.contains(quantity));
        let measured = measured.map(|quantity| quantity.name());
        let known: Vec<&'static str> =
            [SECTION, Quantity::Lyapunov.name()].into_iter().chain(measured).collect();
        diagram.panels = Some(field.choices(&known.iter().map(|name| (*name, *name)).collect::<Vec<_>>())?);
    }
    if let Some(field) = section.get("files") {
        diagram.is_divided = field.choice(&[("pages", false), ("panels", true)])?;
    }
    let gaps = several_gaps(points.base()).unwrap_or_default();
    let mut gap = None;
    if let Some(field) = section.get("gap") {
        let known: Vec<(&str, usize)> = gaps.iter().map(String::as_str).zip(0..).collect();
        if known.is_empty() {
            return Err(field.conflict("the model has one gap; remove this key"));
        }
        gap = Some(field.choice(&known)?);
    }
    let names = subjects(points.base());
    let numbers = quantities.iter().flat_map(|quantity| quantity.columns(&names));
    let fixed = [Quantity::Lyapunov, Quantity::Impacts, Quantity::Mesh];
    let scales = read_layers(&section, "scale", numbers.clone(), fixed, |_, field| read_scale(field))?;
    let requested = fixed.into_iter().filter(|quantity| quantities.contains(quantity));
    let contours = read_layers(&section, "contours", numbers, requested, |name, field| {
        let scale = scales.iter().find(|(layer, _)| layer == name);
        read_contours(field, scale.and_then(|(_, (factor, _))| *factor))
    })?;
    Ok(Figure { style, lines: lines.unwrap_or_default(), diagram, scales, contours, gap })
}

/// Reads a table whose keys are the names of layers of numbers.
fn read_layers<T>(
    section: &Section<'_>,
    key: &str,
    numbers: impl Iterator<Item = String>,
    fixed: impl IntoIterator<Item = Quantity>,
    read: impl Fn(&str, &Field<'_>) -> Result<T, SceneError>,
) -> Result<Vec<(String, T)>, SceneError> {
    let Some(field) = section.get(key) else { return Ok(Vec::new()) };
    let layers: Vec<String> =
        numbers.chain(fixed.into_iter().map(|quantity| quantity.name().to_owned())).collect();
    let known: Vec<&str> = layers.iter().map(String::as_str).collect();
    let all = format!("{}; request more in `outputs.quantities`", known.join(", "));
    let table = Section::open_among(field.node, &field.path, &known, &all)?;
    table.fields().map(|(name, field)| Ok((name.to_owned(), read(name, &field)?))).collect()
}

/// Reads the numbers at which a layer has contours. They have a place on its scale.
fn read_contours(field: &Field<'_>, factor: Option<f64>) -> Result<Vec<f64>, SceneError> {
    let items = field.list("a list of numbers, such as [1e-3, 1e-2]")?;
    if !(1..=MOST_LINES).contains(&items.len()) {
        return Err(field.wrong_count(items.len(), "numbers", &format!("1 to {MOST_LINES} numbers")));
    }
    let number = |item: &Field<'_>| match item.number()? {
        number if place(factor, number).is_finite() => Ok(number),
        _ => Err(item.out_of_range("finite, and above 0 on a scale that is not linear")),
    };
    let mut numbers: Vec<f64> = Vec::new();
    for item in &items {
        let number = number(item)?;
        if numbers.contains(&number) {
            return Err(item.conflict("it stands in the list twice; remove one"));
        }
        numbers.push(number);
    }
    Ok(numbers)
}

/// Reads the scale of a layer and the ends of its numbers.
fn read_scale(field: &Field<'_>) -> Result<LayerScale, SceneError> {
    let known = [("linear", None), ("log", Some(1.0)), ("dB", Some(20.0))];
    let Value::List(_) = field.node.value else { return Ok((field.choice(&known)?, None)) };
    let requirement = "two ends [low, high], or a scale and two ends, such as [\"log\", 1e-6, 1]";
    let (factor, ends) = match &field.list(requirement)?[..] {
        [low, high] => (None, [low.number()?, high.number()?]),
        [scale, low, high] => (scale.choice(&known)?, [low.number()?, high.number()?]),
        _ => return Err(field.wrong_type(requirement)),
    };
    match ends.map(|end| place(factor, end)) {
        [low, high] if low.is_finite() && high.is_finite() && low < high => Ok((factor, Some(ends))),
        _ => Err(field.out_of_range("ascending ends, above 0 unless the scale is linear")),
    }
}

fn read_lines(field: &Field<'_>, points: &Points) -> Result<Vec<MapLine>, SceneError> {
    let model: &dyn Model = points.base();
    if !matches!(field.node.value, Value::Table(_)) {
        return Err(field.wrong_type("names and expressions, such as { \"threshold\" = \"k1 - 2*k2\" }"));
    }
    let Some(lines) = Section::open_any(field.node, &field.path) else { return Ok(Vec::new()) };
    let fields = lines.fields_as_written();
    if fields.len() > MOST_LINES {
        return Err(field.wrong_count(fields.len(), "lines", &format!("at most {MOST_LINES} lines")));
    }
    let line = |(name, field): (&str, Field<'_>)| {
        let expression = field.expression(&names(model), &meanings(model), "\"k1 - 2*k2\"")?;
        let is_swept =
            |axis: &Axis| axis.target().parameter().is_some_and(|swept| points.follows(&expression, swept));
        if points.axes().len() == 2 && !points.axes().iter().any(is_swept) {
            return Err(field.conflict("it has the same value in all cells; use a parameter of an axis"));
        }
        Ok(MapLine { name: name.to_owned(), expression })
    };
    fields.into_iter().map(line).collect()
}

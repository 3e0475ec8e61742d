//! The type of a layer.

use std::borrow::Cow;

use crate::show::color::Color;
use crate::show::layers::bar::Bar;

/// One view of a map.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Name of its figure's file.
    pub(crate) name: Cow<'static, str>,
    /// Label of its button in the report.
    pub(crate) short: Cow<'static, str>,
    /// Heading.
    pub(crate) title: Cow<'static, str>,
    /// Index into the palette of each cell, by id.
    pub(crate) indices: Vec<u8>,
    /// Numbers that the colours represent, by id, in a layer of a continuous quantity. NaN where there is none.
    pub(crate) numbers: Option<Vec<f32>>,
    /// Colours.
    pub(crate) palette: Vec<Color>,
    /// Named colours, in the order of the legend.
    pub(crate) entries: Vec<NamedColor>,
    /// Colours that represent numbers.
    pub(crate) bar: Option<Bar>,
}

impl Layer {
    /// Returns the name of the layer's figures.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// A colour with a name.
#[derive(Clone, Debug)]
pub struct NamedColor {
    pub(crate) color: Color,
    pub(crate) text: String,
    /// Number of cells with this colour.
    pub(crate) cells: usize,
}

/// Returns a legend without colours that no cell has.
pub(crate) fn legend(entries: impl IntoIterator<Item = NamedColor>) -> Vec<NamedColor> {
    entries.into_iter().filter(|entry| entry.cells > 0).collect()
}

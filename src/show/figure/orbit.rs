//! Figures of an orbit like Figs 6 to 9 of the paper: phase planes, time history, gap, spectrum.

mod flights;
mod gap;
pub(crate) mod gaps;
mod heading;
mod motion;
mod phase_planes;
mod plot;
pub mod spectrum;
mod time_history;

use std::io::Write;

use crate::map::scene::{FigureStyle, Format};
use crate::show::drawing::{Canvas, svg, write_figure};
use crate::show::error::WriteError;
use plot::ORBIT_WIDTH;
pub use plot::OrbitPlot;

/// Name of the file of [`write_history`] without its extension.
pub const HISTORY: &str = "history";

/// Draws the gap and the displacements of a motion from the start against time, and writes the figure.
pub fn write_history(
    out: impl Write,
    format: Format,
    style: &FigureStyle,
    plot: &OrbitPlot<'_>,
) -> Result<(), WriteError> {
    write_figure(out, format, &draw_history(style, plot))
}

pub(super) fn draw_history(style: &FigureStyle, plot: &OrbitPlot<'_>) -> Canvas {
    let canvas = Canvas::new(style, ORBIT_WIDTH);
    plot.draw_history(&canvas);
    canvas
}

/// A figure of an orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrbitFigure {
    /// Phase planes.
    PhasePlane,
    /// Displacements and velocities against time.
    TimeHistory,
    /// The gap against time.
    Gap,
}

impl OrbitFigure {
    /// All figures.
    pub const ALL: [OrbitFigure; 3] = [OrbitFigure::PhasePlane, OrbitFigure::TimeHistory, OrbitFigure::Gap];

    /// Returns the name of the figure's file without its extension.
    pub fn name(self) -> &'static str {
        match self {
            OrbitFigure::PhasePlane => "phase_plane",
            OrbitFigure::TimeHistory => "time_history",
            OrbitFigure::Gap => "gap",
        }
    }

    /// Draws the figure of an orbit and writes it.
    pub fn write(
        self,
        out: impl Write,
        format: Format,
        style: &FigureStyle,
        plot: &OrbitPlot<'_>,
    ) -> Result<(), WriteError> {
        write_figure(out, format, &self.draw(style, plot))
    }

    /// Draws the figure of an orbit and returns it as SVG. WebAssembly calls this, because [`OrbitFigure::write`] would add the
    /// writers of PNG and PDF to it.
    pub fn svg(self, style: &FigureStyle, plot: &OrbitPlot<'_>) -> String {
        svg(&self.draw(style, plot))
    }

    pub(super) fn draw(self, style: &FigureStyle, plot: &OrbitPlot<'_>) -> Canvas {
        let canvas = Canvas::new(style, ORBIT_WIDTH);
        match self {
            OrbitFigure::PhasePlane => plot.draw_phase_planes(&canvas),
            OrbitFigure::TimeHistory => plot.draw_time_history(&canvas),
            OrbitFigure::Gap => plot.draw_gap(&canvas),
        }
        canvas
    }
}

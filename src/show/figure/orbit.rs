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

use crate::map::scene::FigureStyle;
use crate::show::drawing::Canvas;
use plot::ORBIT_WIDTH;
pub use plot::OrbitPlot;
use rattlemap_dynamics::named;

/// Name of the file of [`draw_history`] without its extension.
pub const HISTORY: &str = "history";

/// Draws the gap and the displacements of a motion from the start against time.
pub fn draw_history(style: &FigureStyle, plot: &OrbitPlot<'_>) -> Canvas {
    let canvas = Canvas::new(style, ORBIT_WIDTH);
    plot.draw_history(&canvas);
    canvas
}

named! {
    /// A figure of an orbit.
    pub enum OrbitFigure {
        /// Phase planes.
        PhasePlane = "phase_plane",
        /// Displacements and velocities against time.
        TimeHistory = "time_history",
        /// The gap against time.
        Gap = "gap",
    }
}

impl OrbitFigure {
    /// Draws the figure of an orbit.
    pub fn draw(self, style: &FigureStyle, plot: &OrbitPlot<'_>) -> Canvas {
        let canvas = Canvas::new(style, ORBIT_WIDTH);
        match self {
            OrbitFigure::PhasePlane => plot.draw_phase_planes(&canvas),
            OrbitFigure::TimeHistory => plot.draw_time_history(&canvas),
            OrbitFigure::Gap => plot.draw_gap(&canvas),
        }
        canvas
    }
}

//! Results, written down.

pub mod bifurcation_figure;
pub mod orbit_figures;
mod plot_style;

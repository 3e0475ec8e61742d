//! Draws the chart of README.md: time of one forcing period on one core, from the tables of docs/evidence.md.
//!
//!     cargo run -p rattlemap-bench --example speed_chart -- results/work_precision/speed.png

use std::fs::File;

use rattlemap::map::scene::{FigureStyle, Format};
use rattlemap::show::drawing::{Align, Canvas, Color, DARK, MEDIUM, Rect, SMALL, write_figure};

/// Methods and times in microseconds, on an Intel Xeon. Those of Runge-Kutta and DOP853 are multiples of the reference's time at a
/// worst error of 1e-5, that of the batch is the middle of its range.
const TIMES: [(&str, f64); 6] = [
    ("rattlemap, reference, with contacts", 1.65),
    ("heyoka, best batch, without contacts", 9.5),
    ("heyoka, same steps, without contacts", 25.0),
    ("heyoka, with contacts", 59.0),
    ("DOP853, with contacts", 45.0 * 1.65),
    ("Runge-Kutta in Rust or numba, with contacts", 60.0 * 1.65),
];

const OWN: Color = [0xd5, 0x5e, 0x00];
const OTHER: Color = [0x8a, 0x9a, 0xa8];
/// Sizes in pixels: the picture, the column of labels, a bar, a row, and the heading.
const WIDTH: f64 = 1600.0;
const LABELS: f64 = 620.0;
const BAR: f64 = 40.0;
const ROW: f64 = 62.0;
const TOP: f64 = 90.0;

fn main() -> anyhow::Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "speed.png".to_owned());
    let canvas = Canvas::new(&FigureStyle::default(), WIDTH);
    canvas.text(
        "Time of one forcing period on one core, in microseconds",
        (WIDTH / 2.0, 40.0),
        MEDIUM,
        Align::Center,
        DARK,
    );
    let longest = TIMES.iter().map(|(_, time)| *time).fold(0.0, f64::max);
    for (row, (method, time)) in TIMES.into_iter().enumerate() {
        let y = TOP + (row as f64 + 0.5) * ROW;
        let right = LABELS + (WIDTH - LABELS - 120.0) * time / longest;
        canvas.text(method, (LABELS - 16.0, y), SMALL, Align::Right, DARK);
        let bar = Rect { left: LABELS, top: y - BAR / 2.0, right, bottom: y + BAR / 2.0 };
        canvas.fill(bar, if row == 0 { OWN } else { OTHER }, 1.0);
        let text = if time < 10.0 { format!("{time}") } else { format!("{time:.0}") };
        canvas.text(&text, (right + 12.0, y), SMALL, Align::Left, DARK);
    }
    canvas.set_height(TOP + ROW * TIMES.len() as f64 + 20.0);
    Ok(write_figure(File::create(path)?, Format::Png, &canvas)?)
}

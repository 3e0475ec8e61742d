//! Pictures as SVG. Text stays text; maps are embedded with one pixel per cell.

use std::io::{self, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::show::color::{Color, hex};
use crate::show::drawing::canvas::{Canvas, Item, Outline};
use crate::show::drawing::png;
use crate::show::drawing::shapes::{Align, Point, Rect};
use crate::show::drawing::style::{DASH, PER_INCH};
use crate::show::drawing::typeface::runs;
use crate::show::error::WriteError;

/// The typeface that determines the layout, then common typefaces of about the same width.
const FAMILIES: &str = "Ubuntu, 'Ubuntu Sans', 'Open Sans', 'Helvetica Neue', Arial, sans-serif";

/// Writes the picture.
pub(crate) fn write(svg: &mut impl Write, canvas: &Canvas) -> Result<(), WriteError> {
    let (width, height) = canvas.size();
    let page = Rect { left: 0.0, top: 0.0, right: width, bottom: height };
    writeln!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}in\" height=\"{}in\" viewBox=\"0 0 {} {}\" \
         font-family=\"{FAMILIES}\" font-weight=\"300\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n\
         <rect{} fill=\"#ffffff\"/>",
        inches(width / canvas.per_inch),
        inches(height / canvas.per_inch),
        rounded(width),
        rounded(height),
        place(page),
    )?;
    for item in canvas.items.borrow().iter() {
        draw(svg, item)?;
    }
    Ok(writeln!(svg, "</svg>")?)
}

fn draw(svg: &mut impl Write, item: &Item) -> Result<(), WriteError> {
    match item {
        Item::Area { outline, color, opacity } => {
            match outline {
                Outline::Rect(rect) => write!(svg, "<rect{}", place(*rect))?,
                Outline::Circle { center, radius } => {
                    let [x, y, r] = [center.0, center.1, *radius].map(rounded);
                    write!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\"")?;
                }
                Outline::Polygon(corners) => write!(svg, "<polygon points=\"{}\"", points(corners))?,
            }
            let opacity = match *opacity {
                opacity if opacity < 1.0 => format!(" fill-opacity=\"{}\"", rounded(opacity)),
                _ => String::new(),
            };
            writeln!(svg, " fill=\"#{}\"{opacity}/>", hex(*color))?;
        }
        Item::Line { path, width, color, is_dashed } => {
            let dashes = match is_dashed {
                true => format!(" stroke-dasharray=\"{}\"", rounded(DASH)),
                false => String::new(),
            };
            let (points, color, width) = (points(path), hex(*color), rounded(*width));
            writeln!(
                svg,
                "<polyline points=\"{points}\" fill=\"none\" stroke=\"#{color}\" stroke-width=\"{width}\"{dashes}/>"
            )?;
        }
        Item::Text { text, at, em, align, color } => write_text(svg, text, (*at, *em, *align), *color)?,
        Item::Image { rect, bitmap } => {
            let rendering = if bitmap.is_smooth {
                ""
            } else {
                " image-rendering=\"optimizeSpeed\" style=\"image-rendering:pixelated\""
            };
            let (place, data) = (place(*rect), STANDARD.encode(png::bitmap(bitmap, PER_INCH)?));
            writeln!(
                svg,
                "<image{place} preserveAspectRatio=\"none\"{rendering} href=\"data:image/png;base64,{data}\"/>"
            )?;
        }
    }
    Ok(())
}

fn write_text(
    svg: &mut impl Write,
    text: &str,
    (at, em, align): (Point, f64, Align),
    color: Color,
) -> io::Result<()> {
    let [x, y] = [at.0, at.1].map(rounded);
    let anchor = match align {
        Align::Left => String::new(),
        Align::Center => " text-anchor=\"middle\"".to_owned(),
        Align::Right => " text-anchor=\"end\"".to_owned(),
        Align::Upwards => format!(" text-anchor=\"middle\" transform=\"rotate(-90 {x} {y})\""),
    };
    let (size, color) = (rounded(em), hex(color));
    write!(
        svg,
        "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" fill=\"#{color}\"{anchor} xml:space=\"preserve\">"
    )?;
    let mut height = 0.0;
    for run in runs(text) {
        let (scale, raise) = run.place();
        let text = escaped(&run.text);
        // The shift is relative to the previous run.
        if scale == 1.0 && height == 0.0 {
            write!(svg, "{text}")?;
        } else {
            let (shift, size) = (rounded((height - raise) * em), rounded(scale * em));
            write!(svg, "<tspan dy=\"{shift}\" font-size=\"{size}\">{text}</tspan>")?;
        }
        height = raise;
    }
    writeln!(svg, "</text>")
}

/// Rounds to two decimals. Zero becomes positive, because a negative zero would have a sign.
fn rounded(value: f64) -> f64 {
    (value * 100.0).round() / 100.0 + 0.0
}

/// Rounds to a ten-thousandth.
fn inches(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

fn points(points: &[Point]) -> String {
    let texts: Vec<String> = points.iter().map(|(x, y)| format!("{},{}", rounded(*x), rounded(*y))).collect();
    texts.join(" ")
}

/// Returns the attributes of a rectangle.
fn place(Rect { left, top, right, bottom }: Rect) -> String {
    let [x, y, width, height] = [left, top, right - left, bottom - top].map(rounded);
    format!(" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"")
}

/// Escapes text between tags. Control characters, which XML does not allow, become spaces.
fn escaped(text: &str) -> String {
    let is_allowed = |sign: char| !sign.is_control() && !matches!(sign, '\u{fffe}' | '\u{ffff}');
    let text: String = text.chars().map(|sign| if is_allowed(sign) { sign } else { ' ' }).collect();
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

//! Pictures as SVG. Text stays text; maps are embedded with one pixel per cell.

use std::fmt::{self, Write as _};
use std::io::{self, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::show::color::Color;
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
    let [inches_wide, inches_high] = [width, height].map(|side| Number(side / PER_INCH));
    let page = Rect { left: 0.0, top: 0.0, right: width, bottom: height };
    write!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{inches_wide}in\" height=\"{inches_high}in\" \
         viewBox=\"0 0 {} {}\" font-family=\"{FAMILIES}\" font-weight=\"300\" stroke-linecap=\"round\" \
         stroke-linejoin=\"round\">\n<rect{} fill=\"#ffffff\"/>\n",
        Number(width),
        Number(height),
        Place(page),
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
                Outline::Rect(rect) => write!(svg, "<rect{}", Place(*rect))?,
                Outline::Circle { center, radius } => {
                    let [x, y, r] = [center.0, center.1, *radius].map(Number);
                    write!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\"")?;
                }
                Outline::Polygon(corners) => write!(svg, "<polygon points=\"{}\"", Points(corners))?,
            }
            write!(svg, " fill=\"{}\"", Hex(*color))?;
            if *opacity < 1.0 {
                write!(svg, " fill-opacity=\"{}\"", Number(*opacity))?;
            }
            writeln!(svg, "/>")?;
        }
        Item::Line { path, width, color, is_dashed } => {
            let (points, color, width) = (Points(path), Hex(*color), Number(*width));
            write!(
                svg,
                "<polyline points=\"{points}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\""
            )?;
            if *is_dashed {
                write!(svg, " stroke-dasharray=\"{}\"", Number(DASH))?;
            }
            writeln!(svg, "/>")?;
        }
        Item::Text { text, at, em, align, color } => write_text(svg, text, (*at, *em, *align), *color)?,
        Item::Image { rect, bitmap } => {
            let rendering = if bitmap.is_smooth {
                ""
            } else {
                " image-rendering=\"optimizeSpeed\" style=\"image-rendering:pixelated\""
            };
            let data = STANDARD.encode(png::bitmap(bitmap)?);
            let place = Place(*rect);
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
    let [x, y] = [at.0, at.1].map(Number);
    write!(svg, "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" fill=\"{}\"", Number(em), Hex(color))?;
    match align {
        Align::Left => {}
        Align::Center => write!(svg, " text-anchor=\"middle\"")?,
        Align::Right => write!(svg, " text-anchor=\"end\"")?,
        Align::Upwards => write!(svg, " text-anchor=\"middle\" transform=\"rotate(-90 {x} {y})\"")?,
    }
    write!(svg, " xml:space=\"preserve\">")?;
    let mut height = 0.0;
    for run in runs(text) {
        let (scale, raise) = run.place();
        let text = Escaped(&run.text);
        // The shift is relative to the previous run.
        if scale == 1.0 && height == 0.0 {
            write!(svg, "{text}")?;
        } else {
            let (shift, size) = (Number((height - raise) * em), Number(scale * em));
            write!(svg, "<tspan dy=\"{shift}\" font-size=\"{size}\">{text}</tspan>")?;
        }
        height = raise;
    }
    writeln!(svg, "</text>")
}

/// A number with at most two decimals.
struct Number(f64);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rounded = (self.0 * 100.0).round() / 100.0;
        // A negative zero would have a sign.
        write!(f, "{}", if rounded == 0.0 { 0.0 } else { rounded })
    }
}

/// A colour.
struct Hex(Color);

impl fmt::Display for Hex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.0;
        write!(f, "#{r:02x}{g:02x}{b:02x}")
    }
}

/// A list of points.
struct Points<'p>(&'p [Point]);

impl fmt::Display for Points<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, (x, y)) in self.0.iter().enumerate() {
            let before = if i == 0 { "" } else { " " };
            write!(f, "{before}{},{}", Number(*x), Number(*y))?;
        }
        Ok(())
    }
}

/// The attributes of a rectangle.
struct Place(Rect);

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Rect { left, top, right, bottom } = self.0;
        let [x, y, width, height] = [left, top, right - left, bottom - top].map(Number);
        write!(f, " x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"")
    }
}

/// Text between tags. Control characters, which XML does not allow, become spaces.
struct Escaped<'t>(&'t str);

impl fmt::Display for Escaped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for sign in self.0.chars() {
            match sign {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                _ if sign.is_control() || matches!(sign, '\u{fffe}' | '\u{ffff}') => f.write_char(' ')?,
                _ => f.write_char(sign)?,
            }
        }
        Ok(())
    }
}

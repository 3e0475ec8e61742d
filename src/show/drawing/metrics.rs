//! The part of the typeface's file with characters and widths. Figures of a web page contain text as text, so they need no
//! outlines.

use epaint_default_fonts::UBUNTU_LIGHT;

/// Bytes of the header of a file, and of each entry of the directory of tables that follows: tag, checksum, offset, length.
const HEADER: usize = 12;
const ENTRY: usize = 16;

/// The tables with characters and widths.
const METRICS: [&[u8; 4]; 6] = [b"OS/2", b"cmap", b"head", b"hhea", b"hmtx", b"maxp"];

/// Returns the big-endian number at an offset of the file.
const fn number(at: usize) -> usize {
    let file = UBUNTU_LIGHT;
    u32::from_be_bytes([file[at], file[at + 1], file[at + 2], file[at + 3]]) as usize
}

/// Returns the offset of a table's entry in the directory.
const fn entry(tag: &[u8; 4]) -> usize {
    let mut at = HEADER;
    while number(at) != u32::from_be_bytes(*tag) as usize {
        at += ENTRY;
    }
    at
}

/// Returns the size of a file with the tables [`METRICS`] alone.
pub(crate) const fn size() -> usize {
    let (mut total, mut n) = (HEADER + METRICS.len() * ENTRY, 0);
    while n < METRICS.len() {
        total += number(entry(METRICS[n]) + 12).next_multiple_of(4);
        n += 1;
    }
    total
}

/// Returns a file with the tables [`METRICS`] alone.
pub(crate) const fn file<const SIZE: usize>() -> [u8; SIZE] {
    const fn copy(file: &mut [u8], to: usize, from: &[u8]) {
        file.split_at_mut(to).1.split_at_mut(from.len()).0.copy_from_slice(from);
    }
    let mut made = [0; SIZE];
    copy(&mut made, 0, UBUNTU_LIGHT.split_at(HEADER).0);
    made[5] = METRICS.len() as u8;
    let (mut at, mut n) = (HEADER + METRICS.len() * ENTRY, 0);
    while n < METRICS.len() {
        let entry = entry(METRICS[n]);
        let length = number(entry + 12);
        copy(&mut made, HEADER + n * ENTRY, UBUNTU_LIGHT.split_at(entry).1.split_at(ENTRY).0);
        copy(&mut made, HEADER + n * ENTRY + 8, &(at as u32).to_be_bytes());
        copy(&mut made, at, UBUNTU_LIGHT.split_at(number(entry + 8)).1.split_at(length).0);
        at += length.next_multiple_of(4);
        n += 1;
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;
    use ttf_parser::{Face, GlyphId};

    #[test]
    fn the_metrics_give_every_text_its_width() {
        let metrics = file::<{ size() }>();
        assert!(metrics.len() < 32_000, "{} bytes", metrics.len());
        let face = Face::parse(&metrics, 0).unwrap();
        let whole = Face::parse(UBUNTU_LIGHT, 0).unwrap();
        assert_eq!(face.number_of_glyphs(), whole.number_of_glyphs());
        for id in (0..face.number_of_glyphs()).map(GlyphId) {
            assert_eq!(face.glyph_hor_advance(id), whole.glyph_hor_advance(id));
        }
        assert!(('\0'..'\u{ffff}').all(|sign| face.glyph_index(sign) == whole.glyph_index(sign)));
        let heights =
            |face: &Face<'_>| (face.ascender(), face.descender(), face.capital_height(), face.units_per_em());
        assert_eq!(heights(&face), heights(&whole));
    }
}

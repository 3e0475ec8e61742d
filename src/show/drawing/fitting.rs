//! How much room a text takes, and how much of it there is room for.

use crate::show::drawing::Canvas;
use crate::show::error::DrawError;

impl Canvas<'_> {
    /// Width of a text.
    pub fn text_width(&self, text: &str, size: f64) -> Result<f64, DrawError> {
        Ok(self.typeface.set(text, self.typeface.em(size)).1)
    }

    /// The beginning of a text that is not wider than `room`, with an ellipsis if that is not all.
    pub fn fitted(&self, text: &str, size: f64, room: f64) -> Result<String, DrawError> {
        // Where each character begins: measuring takes time, so the longest beginning that fits is halved for.
        let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
        if ends.len() <= 2 || self.text_width(text, size)? <= room {
            return Ok(text.to_owned());
        }
        let cut = |count: usize| format!("{}\u{2026}", &text[..ends[count]]);
        // One character is kept whatever the room; an ellipsis in the last one's place would save nothing.
        let (mut fits, mut too_long) = (1, ends.len() - 1);
        while too_long - fits > 1 {
            let middle = (fits + too_long) / 2;
            if self.text_width(&cut(middle), size)? <= room {
                fits = middle;
            } else {
                too_long = middle;
            }
        }
        Ok(cut(fits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::show::drawing::save_figure;
    use std::time::Instant;

    /// What is done on a canvas.
    fn on_canvas(draw: impl FnOnce(&Canvas<'_>)) {
        let folder = tempfile::tempdir().unwrap();
        save_figure(&folder.path().join("canvas.png"), (200, 100), |canvas| {
            draw(canvas);
            Ok(())
        })
        .unwrap();
    }

    #[test]
    fn as_much_of_a_text_is_kept_as_fits() {
        on_canvas(|canvas| {
            let text = "Gear rattle: restitution \u{d7} excitation frequency";
            let count = text.chars().count();
            let width = |text: &str| canvas.text_width(text, 20.0).unwrap();
            for room in [0.0, 10.0, 40.0, 111.0, 200.0, 300.0, width(text) - 1.0] {
                let fitted = canvas.fitted(text, 20.0, room).unwrap();
                let kept = fitted.chars().count() - 1;
                assert!(fitted.ends_with('\u{2026}') && kept <= count - 2, "{fitted}");
                assert!(text.starts_with(fitted.trim_end_matches('\u{2026}')), "{fitted}");
                assert!(width(&fitted) <= room || kept == 1, "{room}: {fitted}");
                let longer: String = text.chars().take(kept + 1).chain(['\u{2026}']).collect();
                assert!(width(&longer) > room || kept == count - 2, "{room}: {fitted}");
            }
            assert_eq!(canvas.fitted(text, 20.0, width(text)).unwrap(), text);
            assert_eq!(canvas.fitted("ab", 20.0, 0.0).unwrap(), "ab");
        });
    }

    /// One measurement less per character took half a minute.
    #[test]
    fn a_long_text_is_cut_at_once() {
        on_canvas(|canvas| {
            let (text, clock) = ("W".repeat(10_000), Instant::now());
            let kept = canvas.fitted(&text, 20.0, 500.0).unwrap().chars().count();
            assert!((10..100).contains(&kept) && clock.elapsed().as_secs() < 5, "{:?}", clock.elapsed());
        });
    }
}

//! Layers of continuous quantities: exponent, impacts, time in meshing, measured quantities.

use std::borrow::Cow;
use std::f64::consts::PI;

use rayon::prelude::*;

use crate::map::scene::{Quantity, place};
use crate::show::cells::{Cells, Row};
use crate::show::color::Color;
use crate::show::layers::bar::{Bar, LARGEST_SHARE_BEYOND, count_beyond, round_bound};
use crate::show::layers::colors::{NO_VALUE, cyclic, diverging, linear, sequential, signed};
use crate::show::layers::layer::{Layer, NamedColor, legend};
use crate::show::numbers::Number;

/// Returns the value of a cell by its id and its row.
type Value<'c> = dyn Fn(usize, &Row) -> Option<f64> + Sync + 'c;

/// A continuous quantity and its colours.
struct Continuous<'c> {
    name: Cow<'static, str>,
    short: Cow<'static, str>,
    title: Cow<'static, str>,
    value: Box<Value<'c>>,
    colors: Colors,
}

/// Kinds of colour scales.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Colors {
    /// Numbers from zero on.
    Sequential,
    /// Exponents, with more colours for small positive ones.
    Exponents,
    /// Numbers of both signs, or numbers from zero on if none is negative.
    Signed,
    /// Angles from minus pi to pi, whose ends have one colour.
    Cyclic,
}

impl Colors {
    /// Returns the colour of a value: a share of the largest, or of the smallest if it is negative.
    fn of(self, share: f64, has_negative: bool) -> Color {
        match self {
            Colors::Exponents => diverging(share),
            Colors::Signed if has_negative => signed(share),
            Colors::Sequential | Colors::Signed => sequential(share),
            Colors::Cyclic => cyclic(share),
        }
    }
}

/// Short name, title, colours and value of the quantities that every row has.
type Fixed = (Quantity, &'static str, &'static str, Colors, fn(&Row) -> Option<f64>);

#[rustfmt::skip]
const FIXED: [Fixed; 3] = [
    (Quantity::Lyapunov, "exponent", "largest Lyapunov exponent, \u{3bb}", Colors::Exponents, |row| row.lyapunov),
    (Quantity::Impacts, "impacts", "impacts per forcing period", Colors::Sequential, |row| row.impacts_per_period),
    (Quantity::Mesh, "meshing", "fraction of time in meshing", Colors::Sequential, |row| row.mesh_fraction),
];

/// Number of colours. The next index is for cells without a value.
const LEVELS: u8 = 255;

/// Returns the layers of the continuous quantities that the scene requests.
pub(crate) fn layers<'c>(cells: &'c Cells<'c>) -> impl Iterator<Item = Layer> + 'c {
    let fixed = FIXED.into_iter().filter(|(quantity, ..)| cells.has(*quantity));
    let fixed = fixed.map(|(quantity, short, title, colors, value)| Continuous {
        name: quantity.name().into(),
        short: short.into(),
        title: title.into(),
        value: Box::new(move |_, row| value(row)),
        colors,
    });
    let measured = cells.numbers().into_iter().map(|number| measured(cells, number));
    fixed.chain(measured).map(|continuous| continuous.layer(cells))
}

fn measured<'c>(cells: &'c Cells<'c>, number: Number) -> Continuous<'c> {
    Continuous {
        name: number.name.clone().into(),
        short: number.name.replace('_', " ").into(),
        title: number.label.clone().into(),
        colors: if number.is_angle() { Colors::Cyclic } else { Colors::Signed },
        value: Box::new(move |id, row| number.of_cell(cells, id, row)),
    }
}

impl Continuous<'_> {
    fn layer(self, cells: &Cells<'_>) -> Layer {
        let (factor, ends) = cells.scene().layer_scale(&self.name);
        let value = |id| place(factor, (self.value)(id, &cells.row(id)).unwrap_or(f64::NAN));
        let values: Vec<f64> = cells.ids().map(value).collect();
        let numbers = || values.iter().copied().filter(|value| !value.is_nan());
        let sizes = |sign: f64| numbers().map(move |value| sign * value).filter(|size| *size > 0.0);
        let has_negative = sizes(-1.0).next().is_some();
        let [low, high] = match (ends, factor, self.colors) {
            (Some(ends), ..) => ends.map(|end| place(factor, end)),
            (_, Some(factor), _) => whole(numbers(), factor.min(10.0)),
            (.., Colors::Cyclic) => [-PI, PI],
            _ => [
                if has_negative { -round_bound(sizes(-1.0)) } else { 0.0 },
                if has_negative && numbers().all(|value| value < 0.0) {
                    0.0
                } else {
                    round_bound(sizes(1.0))
                },
            ],
        };
        let level = |value: f64| {
            let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
            (share * f64::from(LEVELS - 1)).round() as u8
        };
        let color = |level: u8| {
            let value = low + f64::from(level) / f64::from(LEVELS - 1) * (high - low);
            // Each side uses all its colours: values are relative to the end of their side.
            let share = match value {
                value if factor.is_some() => return linear((value - low) / (high - low)),
                value if low > 0.0 => (value - low) / (high - low),
                negative if negative < 0.0 => negative / -low,
                positive if high > 0.0 => positive / high,
                _ => 0.0,
            };
            self.colors.of(share, has_negative)
        };
        let colors: Vec<Color> = (0..LEVELS).map(color).collect();
        let absent = values.iter().filter(|value| value.is_nan()).count();
        let index = |&value: &f64| if value.is_nan() { LEVELS } else { level(value) };
        let label = match factor {
            None => self.title.clone(),
            Some(1.0) => format!("log\u{2081}\u{2080} of {}", self.title).into(),
            Some(_) => format!("{}, in dB", self.title).into(),
        };
        Layer {
            name: self.name,
            short: self.short,
            title: self.title,
            indices: values.par_iter().map(index).collect(),
            numbers: Some(values.iter().map(|&value| value as f32).collect()),
            palette: colors.iter().copied().chain([NO_VALUE]).collect(),
            entries: legend([NamedColor { color: NO_VALUE, text: "no value".to_owned(), cells: absent }]),
            bar: Some(Bar {
                label,
                colors,
                low,
                high,
                is_fixed: self.colors == Colors::Cyclic || ends.is_some(),
                beyond: count_beyond(numbers(), low, high),
            }),
        }
    }
}

/// Returns multiples of `step` between which nearly all places lie.
fn whole(places: impl Iterator<Item = f64>, step: f64) -> [f64; 2] {
    let mut places: Vec<f64> = places.filter(|place| place.is_finite()).collect();
    places.sort_by(f64::total_cmp);
    let beyond = (LARGEST_SHARE_BEYOND * places.len() as f64) as usize;
    let [low, high] =
        [beyond, places.len().saturating_sub(1 + beyond)].map(|i| places.get(i).copied().unwrap_or(0.0));
    let low = (low / step).floor() * step;
    [low, ((high / step).ceil() * step).max(low + step)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::plan::Plan;
    use crate::map::scene::{Purpose, Scene};
    use crate::record::{Record, measures, valid};

    /// Returns the layer of exponents of a map of 400 cells.
    fn exponents(value: impl Fn(usize) -> f64) -> Layer {
        let axis = |name: &str| format!("[[axis]]\nparameter = '{name}'\nmin = 0.1\nmax = 1.0\ncount = 20\n");
        let scene = Scene::parse(&(axis("e") + &axis("omega")), "s", &[], Purpose::Map).unwrap();
        let plan = Plan::new(&scene);
        let record = |id| Record {
            lyapunov: value(id),
            period: 1,
            valid: valid::LYAPUNOV | valid::PERIOD,
            ..Record::default()
        };
        let records: Vec<Record> = (0..plan.run_count()).map(record).collect();
        let cells = Cells::new(&scene, &plan, &records);
        layers(&cells).find(|layer| layer.name == "lyapunov").unwrap()
    }

    #[test]
    fn a_bar_extends_only_to_signs_that_occur() {
        let ends = |layer: &Layer| layer.bar.as_ref().map(|bar| (bar.low, bar.high)).unwrap();
        let negative = exponents(|id| -0.001 * (id + 1) as f64);
        assert_eq!(ends(&negative), (-0.4, 0.0));
        assert_eq!(negative.palette[254], diverging(0.0), "its upper end is white");
        assert!(exponents(|_| -0.1).palette.contains(&diverging(-1.0)));
        assert_eq!(ends(&exponents(|id| if id < 200 { -0.2 } else { 1.9 })), (-0.2, 2.0));
        assert_eq!(ends(&exponents(|_| 0.0)), (0.0, 1.0));
        let mixed = exponents(|id| if id < 200 { -1.0 } else { 1.0 }).bar.unwrap();
        assert_eq!(mixed.anchors(), [(-1.0, 0.0), (0.0, 127.0), (1.0, 254.0)]);
        assert_eq!(mixed.colors[127], diverging(0.0), "zero is white");
    }

    #[test]
    fn values_beyond_the_ends_of_a_bar_are_counted() {
        let layer = exponents(|id| if id == 7 { -5.0 } else { -0.2 });
        let bar = layer.bar.unwrap();
        assert_eq!((bar.low, bar.beyond), (-0.2, [1, 0]));
        assert_eq!(bar.remarks(2000), ["values below \u{2212}0.2: 1 cell"]);
        assert_eq!(bar.remarks(100), ["values below \u{2212}0.2: 1.0 %"]);
    }

    #[test]
    fn measured_quantities_have_a_scale_that_suits_their_signs() {
        let axis = |name: &str| format!("[[axis]]\nparameter = '{name}'\nmin = 0.1\nmax = 1.0\ncount = 5\n");
        let quantities = "[outputs]\nquantities = ['amplitude', 'harmonic']\n";
        let scene = Scene::parse(&(axis("e") + &axis("omega") + quantities), "s", &[], Purpose::Map).unwrap();
        let plan = Plan::new(&scene);
        let record = |id: usize| {
            let mut record = Record { valid: measures::bits() | valid::PERIOD, ..Record::default() };
            for measure in measures::all() {
                record.measures[measure.place] = 0.1 * id as f64 - if measure.is_odd() { 1.0 } else { 0.0 };
            }
            record
        };
        let records: Vec<Record> = (0..plan.run_count()).map(record).collect();
        let layers: Vec<Layer> = layers(&Cells::new(&scene, &plan, &records)).collect();
        assert_eq!(layers.len(), 12);
        let ends = |name: &str| {
            let layer = layers.iter().find(|layer| layer.name == name).unwrap();
            let bar = layer.bar.as_ref().unwrap();
            (bar.low, bar.high, bar.colors[0], bar.colors[254])
        };
        assert_eq!(ends("amplitude_x1"), (0.0, 2.5, sequential(0.0), sequential(1.0)));
        assert_eq!(ends("mean_gap"), (-1.0, 1.5, signed(-1.0), signed(1.0)));
        let (low, high, first, last) = ends("harmonic_phase_x2");
        assert!((low, high) == (-PI, PI) && first == last, "one colour at both ends");
    }
}

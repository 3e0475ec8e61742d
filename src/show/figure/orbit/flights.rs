//! Symbols of the word and the times of their flights.

use rattlemap_dynamics::model::Side;
use rattlemap_dynamics::orbit::Event;

/// Figures of more events have no symbols.
const MOST_EVENTS: usize = 40;

/// Returns the time of the middle of every flight between two events, in forcing periods, and its symbol.
///
/// `cycle` is the length of a periodic motion. The symbol of the flight across its end lies in the longer of its two parts.
/// Without a cycle, the parts before the first event and after the last one have no symbol.
pub(crate) fn symbols(events: &[(f64, Event)], cycle: Option<f64>) -> Vec<(f64, char)> {
    if events.len() > MOST_EVENTS {
        return Vec::new();
    }
    let inner = events.windows(2).map(|pair| (0.5 * (pair[0].0 + pair[1].0), symbol(&pair[0].1, &pair[1].1)));
    let mut symbols: Vec<(f64, char)> = inner.collect();
    // A single event is both the first and the last one.
    if let (Some(end), Some((first, to)), Some((last, from))) = (cycle, events.first(), events.last()) {
        let middle = if end - last >= *first { 0.5 * (last + end) } else { 0.5 * first };
        symbols.push((middle, symbol(from, to)));
    }
    symbols
}

/// Returns the symbol of the flight between two events, by equations (18) to (23) of the paper.
fn symbol(from: &Event, to: &Event) -> char {
    match (from.meshing, from.side, to.side) {
        (Some(Side::Right), ..) => '1',
        (Some(Side::Left), ..) => '4',
        (None, Side::Right, Side::Right) => '2',
        (None, Side::Left, Side::Left) => '5',
        (None, Side::Right, Side::Left) => '3',
        (None, Side::Left, Side::Right) => '6',
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model_file::FileModel;
    use rattlemap_dynamics::model::{GearPair, REST};
    use rattlemap_dynamics::orbit::{self, Orbit, Settings};
    use rattlemap_dynamics::word::Word;

    fn orbit(e: f64) -> Orbit {
        orbit::analyse(&GearPair::paper(e), REST, &Settings::default()).unwrap()
    }

    fn flights(orbit: &Orbit, cycle: Option<f64>) -> Vec<(f64, char)> {
        let events: Vec<_> = orbit.events.iter().map(|e| (e.t / orbit.forcing_period, *e)).collect();
        symbols(&events, cycle)
    }

    #[test]
    fn the_symbols_of_a_cycle_form_its_word() {
        for (e, length) in [(0.06, 8), (0.0997, 4), (0.605, 2)] {
            let orbit = orbit(e);
            let flights = flights(&orbit, Some(f64::from(orbit.cycle_periods)));
            assert_eq!(flights.len(), length);
            let letters: Vec<u8> = flights.iter().map(|&(_, symbol)| symbol as u8).collect();
            assert_eq!(Word::cyclic(&letters), orbit.word, "e = {e}");
            assert!(flights.iter().all(|(t, _)| (0.0..=1.0).contains(t)), "{flights:?}");
        }
    }

    #[test]
    fn flights_between_walls_of_a_side_are_contact() {
        let wall = |side: &str, at: f64, k: f64| {
            format!("[[contact]]\nside = '{side}'\nat = {at:?}\nlaw = 'elastic'\nstiffness = {k:?}\n")
        };
        let motion = "name = 'm'\n[motion]\ncoordinates = ['x']\nmass = [[1]]\ndamping = [[0.1]]\nforce = [3]\nfrequency = 2\n\
                      gap = [1]\n";
        let walls = [("right", 0.2, 1.0), ("right", 1.0, 6.0), ("left", -0.2, 1.0), ("left", -0.8, 6.0)];
        let text = motion.to_owned() + &walls.map(|(side, at, k)| wall(side, at, k)).concat();
        let model = FileModel::parse(&text, "m.toml").unwrap();
        let orbit = orbit::analyse(&model, REST, &Settings::default()).unwrap();
        let flights = flights(&orbit, Some(f64::from(orbit.cycle_periods)));
        let letters: Vec<u8> = flights.iter().map(|&(_, symbol)| symbol as u8).collect();
        assert_eq!((Word::cyclic(&letters), letters.len()), (orbit.word, 8), "{letters:?}");
    }

    #[test]
    fn flights_before_the_first_and_after_the_last_event_have_no_symbol() {
        assert_eq!(flights(&orbit(0.06), None).len(), 7);
        assert!(symbols(&[], Some(1.0)).is_empty());
        let orbit = orbit(0.605);
        let alone = [(0.25, orbit.events[0])];
        let symbol = if orbit.events[0].side == Side::Right { '2' } else { '5' };
        assert_eq!(symbols(&alone, Some(1.0)), [(0.625, symbol)]);
    }
}

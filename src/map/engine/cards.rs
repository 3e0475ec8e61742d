//! Several equal cards as one engine: one thread per card, one queue for all.
//!
//! A card takes cells when it has room. Its share of all cells that are queued or under way is proportional to the rate
//! at which it has computed so far, so that all cards are busy for about the same time. While there are more cells than
//! the cards need to be busy, a quarter of them stays in the queue for the card that ends first. The last cells are all
//! under way at once. So a slow card gets few of them, and no card idles while another has a queue. The cells of a lost
//! card go to the others.
//!
//! A record does not depend on which card computed it.

use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::{CardReport, Device, Engine, EngineError, Loss};
use crate::gpu::AdapterId;
use crate::map::plan::Cell;
use crate::record::Record;

/// Longest time that records wait for further records while cells are queued.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// Longest time that records wait for those of other cards without a queue. It is short, because the next cells may
/// depend on these records. [`GRACE_SHARE`] of the time until the first record is added.
const GRACE: Duration = Duration::from_millis(2);
/// Part of the time until the first record that is added to [`GRACE`].
const GRACE_SHARE: f64 = 0.25;

/// Interval at which threads poll flags that have no wake-up signal.
const TICK: Duration = Duration::from_millis(50);

/// Longest time to wait for cards to stop.
const STOP_TIMEOUT: Duration = Duration::from_secs(2);

/// Part of its share that a card takes at once, if that is enough to keep it busy.
const AT_ONCE: f64 = 0.75;

/// Weight of earlier rates relative to the last one.
const RATE_MEMORY: f64 = 0.5;

/// Equal cards that compute one plan together.
pub struct Cards {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    /// Flag that stops the computation.
    halt: Arc<AtomicBool>,
    /// Called for each lost card.
    listener: Option<Listener>,
    name: &'static str,
    precision: &'static str,
    device: String,
    device_bytes: Option<u64>,
    steps_per_period: Option<[u32; 2]>,
}

/// Callback for losses of cards.
type Listener = Box<dyn Fn(&Loss) + Send>;

#[derive(Default)]
struct Shared {
    state: Mutex<PoolState>,
    /// Signals that there are cells to take, or that no more will come.
    work: Condvar,
    /// Signals that there are records, or that a card is lost.
    news: Condvar,
    /// Flag that stops the cards' engines.
    stop: Arc<AtomicBool>,
}

#[derive(Default)]
struct PoolState {
    queue: VecDeque<Cell>,
    ended: Vec<(u32, Record)>,
    cards: Vec<Card>,
    losses: Vec<Loss>,
    is_closed: bool,
}

struct Card {
    adapter: AdapterId,
    under_way: HashMap<u32, Cell>,
    /// Largest number of cells under way.
    most: usize,
    /// Smallest number of cells that keeps the card busy.
    least: usize,
    /// Cells per second while the card was busy; none if unknown.
    rate: Option<f64>,
    cells: usize,
    steps: Option<u64>,
    is_at_work: bool,
    lost: Option<EngineError>,
}

impl Card {
    fn new(adapter: AdapterId, most: usize, least: usize) -> Card {
        let under_way = HashMap::new();
        Card {
            adapter,
            under_way,
            most,
            least,
            rate: None,
            cells: 0,
            steps: None,
            is_at_work: false,
            lost: None,
        }
    }
}

impl Cards {
    /// Combines engines of one plan, each on a card of its own.
    ///
    /// # Panics
    /// Without engines.
    pub fn new(engines: Vec<(AdapterId, Engine<'static>)>) -> Cards {
        let (_, first) = engines.first().expect("one card at least");
        let card = |(adapter, engine): &(AdapterId, Engine<'static>)| Card {
            steps: engine.lane_steps(),
            ..Card::new(adapter.clone(), engine.room(), engine.least_batch())
        };
        let state = PoolState { cards: engines.iter().map(card).collect(), ..PoolState::default() };
        let shared = Arc::new(Shared { state: Mutex::new(state), ..Shared::default() });
        let (name, precision, device) = (first.name(), first.precision(), first.device());
        let steps_per_period = first.steps_per_period();
        let bytes = engines.iter().map(|(_, engine)| engine.device_bytes());
        let device_bytes = bytes.reduce(|a, b| Some(a?.saturating_add(b?))).flatten();
        let spawn = |(nth, (_, engine)): (usize, (AdapterId, Engine<'static>))| {
            let device = engine.device();
            let own = Arc::clone(&shared);
            let thread = thread::Builder::new().spawn(move || work(nth, engine, &own));
            let reason = |error| format!("cannot start a thread: {error}");
            thread.map_err(|error| shared.lose(nth, EngineError::Lost { device, reason: reason(error) })).ok()
        };
        let threads = engines.into_iter().enumerate().filter_map(spawn).collect();
        let (halt, listener) = (Arc::default(), None);
        Cards { shared, threads, halt, listener, name, precision, device, device_bytes, steps_per_period }
    }

    pub(super) fn count(&self) -> usize {
        self.threads.len()
    }

    pub(super) fn listen(&mut self, listener: Listener) {
        self.listener = Some(listener);
    }

    /// Reports the work of each card so far.
    pub(super) fn reports(&self) -> Vec<CardReport> {
        let report = |card: &Card| CardReport {
            adapter: card.adapter.clone(),
            cells: card.cells,
            lost: card.lost.as_ref().map(EngineError::reason),
        };
        self.shared.lock().cards.iter().map(report).collect()
    }

    pub(super) fn begin(&mut self, cells: &[Cell]) -> Result<(), EngineError> {
        let mut state = self.shared.lock();
        if let Some(error) = state.last_loss() {
            return Err(error);
        }
        state.queue.extend(cells);
        drop(state);
        self.shared.work.notify_all();
        Ok(())
    }

    /// Waits until at most `until` cells are left, or until records have waited long enough. Returns the records.
    pub(super) fn advance(&mut self, until: usize) -> Result<Vec<(u32, Record)>, EngineError> {
        let clock = Instant::now();
        let (mut halted_at, mut first_at) = (None, None);
        loop {
            let is_halted = self.halt.load(Ordering::Relaxed);
            self.shared.stop.store(is_halted, Ordering::Relaxed);
            let mut state = self.shared.lock();
            let losses = std::mem::take(&mut state.losses);
            let is_over = if is_halted {
                let halted_at = *halted_at.get_or_insert_with(Instant::now);
                let is_idle = state.cards.iter().all(|card| !card.is_at_work);
                is_idle || halted_at.elapsed() >= STOP_TIMEOUT
            } else {
                let left = state.left();
                if !state.ended.is_empty() {
                    first_at.get_or_insert_with(|| clock.elapsed());
                }
                let is_patient = |first: Duration| match state.queue.is_empty() {
                    true => clock.elapsed() < first.mul_f64(1.0 + GRACE_SHARE) + GRACE,
                    false => clock.elapsed() < LONGEST_WAIT,
                };
                left == 0
                    || state.last_loss().is_some()
                    || first_at.is_some_and(|first| left <= until || !is_patient(first))
            };
            if is_over {
                let ended = std::mem::take(&mut state.ended);
                let gone = state.last_loss().filter(|_| ended.is_empty() && state.left() > 0);
                if gone.is_some() {
                    state.queue.clear();
                }
                drop(state);
                self.report(&losses);
                return gone.map_or(Ok(ended), Err);
            }
            if losses.is_empty() {
                let longest = if first_at.is_some() { GRACE } else { TICK };
                let waited = self.shared.news.wait_timeout(state, longest);
                drop(waited.unwrap_or_else(PoisonError::into_inner));
            } else {
                drop(state);
                self.report(&losses);
            }
        }
    }

    fn report(&self, losses: &[Loss]) {
        if let Some(listener) = &self.listener {
            losses.iter().for_each(listener);
        }
    }
}

impl Device for Cards {
    fn name(&self) -> &'static str {
        self.name
    }

    fn precision(&self) -> &'static str {
        self.precision
    }

    fn device(&self) -> String {
        self.device.clone()
    }

    fn device_bytes(&self) -> Option<u64> {
        self.device_bytes
    }

    fn steps_per_period(&self) -> Option<[u32; 2]> {
        self.steps_per_period
    }

    fn least_batch(&self) -> usize {
        let state = self.shared.lock();
        state.working().map(|card| card.least).fold(0, usize::saturating_add).max(1)
    }

    fn lane_steps(&self) -> Option<u64> {
        self.shared.lock().cards.iter().map(|card| card.steps).sum()
    }

    fn room(&self) -> usize {
        let state = self.shared.lock();
        state.working().map(|card| card.most).fold(0, usize::saturating_add).saturating_sub(state.left())
    }

    fn stop_on(&mut self, halt: &Arc<AtomicBool>) {
        self.halt = Arc::clone(halt);
    }
}

impl Drop for Cards {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.shared.lock().is_closed = true;
        self.shared.work.notify_all();
        for thread in self.threads.drain(..) {
            // A panic of the thread was reported as a loss.
            let _ = thread.join();
        }
    }
}

impl Shared {
    /// Locks the state. A poisoned lock is usable, because every single change leaves the state consistent.
    fn lock(&self) -> MutexGuard<'_, PoolState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts the next cells of a card into `cells`; none if it continues with cells under way. Waits if there are
    /// neither. Returns false if no more cells will come.
    fn next(&self, nth: usize, cells: &mut Vec<Cell>) -> bool {
        let mut state = self.lock();
        loop {
            if state.is_closed {
                return false;
            }
            if !self.stop.load(Ordering::Relaxed) {
                let count = state.share(nth);
                cells.extend(state.queue.drain(..count));
                let card = &mut state.cards[nth];
                card.under_way.extend(cells.iter().map(|cell| (cell.id, *cell)));
                card.is_at_work = !card.under_way.is_empty();
                if card.is_at_work {
                    return true;
                }
            }
            let waited = self.work.wait_timeout(state, TICK);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Accepts the records that a card has computed within `seconds`.
    fn accept(&self, nth: usize, ended: Vec<(u32, Record)>, seconds: f64, steps: Option<u64>) {
        let mut state = self.lock();
        let card = &mut state.cards[nth];
        let under_way = card.under_way.len();
        for (id, _) in &ended {
            card.under_way.remove(id);
        }
        card.cells += ended.len();
        card.steps = steps;
        card.is_at_work = false;
        // Small batches take as long as larger ones, and the last cells of a batch are few: neither measures the rate.
        if under_way >= card.least && 4 * ended.len() >= under_way {
            let now = ended.len() as f64 / seconds.max(1e-6);
            card.rate =
                Some(card.rate.map_or(now, |before| RATE_MEMORY * before + (1.0 - RATE_MEMORY) * now));
        }
        state.ended.extend(ended);
        drop(state);
        self.news.notify_all();
    }

    /// Puts back cells for which a card has no memory. Returns false if it has no memory for a single cell.
    fn put_back(&self, nth: usize, cells: &[Cell]) -> bool {
        let mut state = self.lock();
        let card = &mut state.cards[nth];
        let tried = card.under_way.len();
        for cell in cells {
            card.under_way.remove(&cell.id);
        }
        card.most = tried / 2;
        let goes_on = card.most > 0 || !card.under_way.is_empty();
        cells.iter().rev().for_each(|cell| state.queue.push_front(*cell));
        drop(state);
        self.work.notify_all();
        goes_on
    }

    /// Marks a card as lost and puts its cells back.
    fn lose(&self, nth: usize, error: EngineError) {
        let mut state = self.lock();
        let card = &mut state.cards[nth];
        let mut cells: Vec<Cell> = card.under_way.drain().map(|(_, cell)| cell).collect();
        cells.sort_unstable_by_key(|cell| cell.id);
        let loss = Loss { adapter: card.adapter.clone(), cells: cells.len(), reason: error.reason() };
        card.is_at_work = false;
        card.lost = Some(error);
        cells.iter().rev().for_each(|cell| state.queue.push_front(*cell));
        state.losses.push(loss);
        drop(state);
        self.work.notify_all();
        self.news.notify_all();
    }
}

impl PoolState {
    /// Returns the cards that are not lost.
    fn working(&self) -> impl Iterator<Item = &Card> {
        self.cards.iter().filter(|card| card.lost.is_none())
    }

    /// Returns the number of cells that have not ended.
    fn left(&self) -> usize {
        self.queue.len() + self.cards.iter().map(|card| card.under_way.len()).sum::<usize>()
    }

    /// Returns the error of the last lost card if no card is left.
    fn last_loss(&self) -> Option<EngineError> {
        if self.working().next().is_some() {
            return None;
        }
        self.cards.iter().rev().find_map(|card| card.lost.clone())
    }

    /// Returns the number of cells that a card takes now.
    fn share(&self, nth: usize) -> usize {
        let card = &self.cards[nth];
        let rates = || self.working().filter_map(|card| card.rate);
        // A card without a rate is assumed to have the mean rate.
        let mean = rates().sum::<f64>() / rates().count().max(1) as f64;
        let rate = |card: &Card| card.rate.unwrap_or(if mean > 0.0 { mean } else { 1.0 });
        let weight = rate(card) / self.working().map(rate).sum::<f64>();
        let part = (self.left() as f64 * weight).ceil() as usize;
        let at_once = ((part as f64 * AT_ONCE).ceil() as usize).max(card.least.min(part));
        at_once.min(card.most).saturating_sub(card.under_way.len()).min(self.queue.len())
    }
}

/// Reports a card as lost if its thread panics.
struct PanicGuard<'s> {
    nth: usize,
    shared: &'s Shared,
    device: String,
}

impl Drop for PanicGuard<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            let (device, reason) = (self.device.clone(), "its thread panicked".to_owned());
            self.shared.lose(self.nth, EngineError::Lost { device, reason });
        }
    }
}

/// Runs the thread of a card: computes cells until no more will come, or the card is lost.
fn work(nth: usize, mut engine: Engine<'static>, shared: &Shared) {
    let guard = PanicGuard { nth, shared, device: engine.device() };
    engine.stop_on(&shared.stop);
    let mut cells = Vec::new();
    while shared.next(nth, &mut cells) {
        let clock = Instant::now();
        match pollster::block_on(engine.begin(&cells)) {
            Ok(()) => {}
            Err(EngineError::OutOfMemory { .. }) if shared.put_back(nth, &cells) => {
                cells.clear();
                continue;
            }
            Err(error) => return shared.lose(nth, error),
        }
        cells.clear();
        let half = shared.lock().cards[nth].under_way.len() / 2;
        match pollster::block_on(engine.advance(half)) {
            Ok(ended) => shared.accept(nth, ended, clock.elapsed().as_secs_f64(), engine.lane_steps()),
            Err(error) => return shared.lose(nth, error),
        }
    }
    drop(guard);
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU64;

    use super::super::Fake;
    use super::*;
    use rattlemap_dynamics::model::state;

    fn adapter(number: usize) -> AdapterId {
        AdapterId { number, name: "fake".to_owned(), pci: None }
    }

    fn cards(fakes: Vec<Fake>) -> Cards {
        let named = fakes.into_iter().enumerate();
        Cards::new(named.map(|(n, fake)| (adapter(n), Engine::Fake(fake))).collect())
    }

    fn cells(count: u32) -> Vec<Cell> {
        (0..count).map(|id| Cell { id, flow: 0, law: 0, start: state(&[f64::from(id); 4]) }).collect()
    }

    /// Computes a record from the start, which a cell must keep when it changes cards.
    fn rule(cell: &Cell) -> Record {
        Record { period: cell.start[0] as u32 + 1, ..Record::default() }
    }

    fn slow(cell: &Cell) -> Record {
        thread::sleep(Duration::from_millis(2));
        rule(cell)
    }

    /// Runs cells as a sweep does, at most `at_a_time` under way. Returns the cells that ended, and the error if there
    /// was one.
    fn run(cards: &mut Cards, cells: &[Cell], at_a_time: usize) -> (Vec<u32>, Option<EngineError>) {
        let (mut left, mut under_way, mut ended_ids) = (cells, 0, Vec::new());
        while under_way > 0 || !left.is_empty() {
            let (next, later) = left.split_at(left.len().min(at_a_time - under_way).min(cards.room()));
            left = later;
            under_way += next.len();
            match cards.begin(next).and_then(|()| cards.advance(under_way / 2)) {
                Ok(ended) => {
                    under_way -= ended.len();
                    for (id, record) in ended {
                        assert_eq!(record, rule(&cells[id as usize]), "cell {id}");
                        ended_ids.push(id);
                    }
                }
                Err(error) => return (ended_ids, Some(error)),
            }
        }
        (ended_ids, None)
    }

    fn all_of(mut ended_ids: Vec<u32>, count: u32) {
        ended_ids.sort_unstable();
        assert_eq!(ended_ids, (0..count).collect::<Vec<_>>());
    }

    #[test]
    fn every_cell_comes_once_and_the_cards_share_them() {
        let mut cards = cards(vec![Fake::new(slow), Fake::new(slow), Fake::new(slow)]);
        let (ended_ids, error) = run(&mut cards, &cells(600), 200);
        assert_eq!(error, None);
        all_of(ended_ids, 600);
        let counts: Vec<usize> = cards.reports().iter().map(|card| card.cells).collect();
        assert_eq!(counts.iter().sum::<usize>(), 600);
        assert!(counts.iter().all(|&count| count > 100), "{counts:?}");
    }

    #[test]
    fn a_slow_card_gets_few_of_the_last_cells() {
        static MICROSECONDS: AtomicU64 = AtomicU64::new(0);
        fn slower(cell: &Cell) -> Record {
            let clock = Instant::now();
            thread::sleep(Duration::from_millis(8));
            let record = slow(cell);
            MICROSECONDS.fetch_add(clock.elapsed().as_micros() as u64, Ordering::Relaxed);
            record
        }
        let mut cards = cards(vec![Fake::new(slow), Fake::new(slower)]);
        let clock = Instant::now();
        let (ended_ids, _) = run(&mut cards, &cells(600), 120);
        let took = clock.elapsed().as_secs_f64();
        all_of(ended_ids, 600);
        let counts: Vec<usize> = cards.reports().iter().map(|card| card.cells).collect();
        assert!(counts[1] < 200 && counts[1] > 30, "{counts:?}");
        // With half of all cells, the slow card would take three times as long as both together.
        let each = 1e-6 * MICROSECONDS.load(Ordering::Relaxed) as f64 / counts[1] as f64;
        assert!(took < 0.6 * 300.0 * each, "{took} s, {each} s per cell");
    }

    #[test]
    fn records_do_not_wait_for_the_slowest_card() {
        fn slow_for_one(cell: &Cell) -> Record {
            thread::sleep(Duration::from_millis(if cell.id == 1 { 1500 } else { 1 }));
            rule(cell)
        }
        let mut cards = cards(vec![Fake::new(slow_for_one), Fake::new(slow_for_one)]);
        cards.begin(&cells(2)).unwrap();
        let clock = Instant::now();
        let ended = cards.advance(0).unwrap();
        assert!(ended.len() == 1 && clock.elapsed() < Duration::from_millis(700), "{:?}", clock.elapsed());
        assert_eq!(cards.advance(0).unwrap().len(), 1);
    }

    #[test]
    fn a_lost_card_leaves_its_cells_to_the_others() {
        let reported = Arc::new(Mutex::new(Vec::new()));
        let sink = Arc::clone(&reported);
        let mut cards = cards(vec![Fake::new(slow), Fake::lost_after(2, slow)]);
        cards.listen(Box::new(move |loss| sink.lock().unwrap().push(loss.clone())));
        let (ended_ids, error) = run(&mut cards, &cells(400), 100);
        assert_eq!(error, None);
        all_of(ended_ids, 400);
        let reports = cards.reports();
        assert_eq!(reports[0].cells + reports[1].cells, 400);
        assert_eq!((&reports[0].lost, &reports[1].lost), (&None, &Some("by request of the test".to_owned())));
        let reported = reported.lock().unwrap();
        assert!(
            reported.len() == 1 && reported[0].cells > 0 && reported[0].adapter.number == 1,
            "{reported:?}"
        );
    }

    #[test]
    fn records_of_the_last_card_are_returned_when_it_is_lost() {
        let mut cards = cards(vec![Fake::lost_after(1, slow), Fake::lost_after(3, slow)]);
        let (ended_ids, error) = run(&mut cards, &cells(400), 100);
        assert!(matches!(error, Some(EngineError::Lost { .. })), "{error:?}");
        let done: usize = cards.reports().iter().map(|card| card.cells).sum();
        assert!(ended_ids.len() == done && done > 0 && done < 400, "{done} {}", ended_ids.len());
        assert!(cards.begin(&cells(1)).is_err());
    }

    #[test]
    fn a_card_without_memory_takes_fewer_cells() {
        let mut cards = cards(vec![Fake::new(slow), Fake::with_memory(5, slow)]);
        let (ended_ids, error) = run(&mut cards, &cells(200), 100);
        assert_eq!(error, None);
        all_of(ended_ids, 200);
        let reports = cards.reports();
        assert!(reports[1].cells > 0 && reports[1].lost.is_none(), "{reports:?}");
        // A card without any memory is lost.
        let mut cards = self::cards(vec![Fake::new(slow), Fake::with_memory(0, slow)]);
        let (ended_ids, error) = run(&mut cards, &cells(50), 50);
        assert_eq!(error, None);
        all_of(ended_ids, 50);
        assert!(cards.reports()[1].lost.is_some());
    }

    #[test]
    fn cards_stop_and_continue_with_the_flag() {
        let mut cards = cards(vec![Fake::slow(|cell| cell.id, slow), Fake::slow(|cell| cell.id, slow)]);
        let halt = Arc::new(AtomicBool::new(false));
        cards.stop_on(&halt);
        let cells = cells(200);
        cards.begin(&cells).unwrap();
        halt.store(true, Ordering::Relaxed);
        let clock = Instant::now();
        let mut ended_ids = cards.advance(0).unwrap();
        assert!(clock.elapsed() < Duration::from_secs(1) && ended_ids.len() < 200);
        halt.store(false, Ordering::Relaxed);
        while ended_ids.len() < 200 {
            ended_ids.extend(cards.advance(0).unwrap());
        }
        all_of(ended_ids.iter().map(|&(id, _)| id).collect(), 200);
        assert_eq!(cards.advance(0), Ok(Vec::new()));
    }

    #[test]
    fn a_card_that_panics_is_lost() {
        fn panics(cell: &Cell) -> Record {
            assert!(cell.id > 3, "not this one");
            slow(cell)
        }
        let mut cards = cards(vec![Fake::new(panics), Fake::new(panics)]);
        cards.begin(&cells(2)).unwrap();
        let error = cards.advance(0).unwrap_err();
        assert!(error.to_string().contains("its thread panicked"), "{error}");
    }

    #[test]
    fn shares_follow_rates_and_leave_a_quarter_in_the_queue() {
        let card = |least, rate| Card { rate, ..Card::new(adapter(0), 1000, least) };
        let shares = |cards: Vec<Card>, queued: u32| {
            let count = cards.len();
            let state = PoolState { queue: cells(queued).into(), cards, ..PoolState::default() };
            (0..count).map(|nth| state.share(nth)).collect::<Vec<_>>()
        };
        // More cells than needed: a quarter waits.
        assert_eq!(shares(vec![card(16, None), card(16, None)], 400), [150, 150]);
        // Too few cells to keep the cards busy: all are taken at once.
        assert_eq!(shares(vec![card(256, None), card(256, None)], 400), [200, 200]);
        assert_eq!(shares(vec![card(256, Some(30.0)), card(256, Some(10.0))], 100), [75, 25]);
        assert_eq!(shares(vec![card(256, Some(30.0)), card(256, None)], 100), [50, 50]);
        assert_eq!(shares(vec![card(16, None), card(16, None)], 1), [1, 1]);
        assert_eq!(shares(vec![card(16, None), card(16, None)], 4000), [1000, 1000]);
    }
}

//! What a validation says in sentences. The console, `validation.json` and the report show the same ones.

use crate::show::provenance::Provenance;
use crate::validate::{ChaosEnds, HORIZON, HalfMesh, Judge, Kind, StratumResult, Validation};
use rattlemap_dynamics::orbit::Class;

/// A validation with the devices that took part.
#[derive(Clone, Copy, Debug)]
pub struct Validated<'a> {
    /// The result.
    pub validation: &'a Validation,
    /// How the map was computed.
    pub made: Provenance<'a>,
    /// The processor of the machine that computed the map, and that of this machine.
    pub processors: [&'a str; 2],
    /// The device that ran the map's own lanes again. None for a map of the processor, and if no device could be opened.
    pub own_lanes: Option<&'a str>,
    /// Why the map's own device did not run its lanes again.
    pub not_own: Option<&'a str>,
    /// The device that ran lanes in f64 for comparison.
    pub double_lanes: Option<&'a str>,
}

impl Validated<'_> {
    fn is_gpu(&self) -> bool {
        self.made.engine == "gpu"
    }

    /// Returns where the map's own engine computed the sample again: a device or a processor.
    pub fn again_on(&self) -> Option<&str> {
        if self.is_gpu() { self.own_lanes } else { Some(self.processors[1]) }
    }

    /// Whether this is where the map was computed.
    pub fn is_same_device(&self) -> bool {
        let made_on = if self.is_gpu() { self.made.device } else { self.processors[0] };
        self.again_on().is_none_or(|again| again == made_on)
    }

    /// Returns the conclusion: whether the map stands, and the rate of wrong cells.
    pub fn verdict(&self) -> String {
        let validation = self.validation;
        let faults = validation.faults();
        if !faults.is_empty() {
            return format!("Do not trust this map: {}.", faults.join("; "));
        }
        let Some((random, difficult)) = validation.strata.split_first() else { return String::new() };
        let is_doubtful = random.rate(Kind::Unexplained).count > 0;
        let stands = if is_doubtful { "The map stands with a reservation" } else { "The map stands" };
        let mut sentences = vec![format!("{stands}: {}.", validation.wrong(random))];
        let is_whole = random.sampled >= random.runs;
        if is_doubtful && is_whole {
            sentences.push("Its computations are in validation.json.".to_owned());
        } else if is_doubtful {
            sentences.push(
                "This sample is too small to tell whether more than one in 10,000 is wrong: validate again with ten times as \
                 many samples."
                    .to_owned(),
            );
        }
        sentences.extend(
            reasons(random)
                .map(|(count, kinds)| format!("{count} {} for a known reason ({kinds}).", differ(count))),
        );
        let drawn: usize = difficult.iter().map(|stratum| stratum.sampled).sum();
        if drawn > 0 {
            let count = |kind: fn(&StratumResult) -> usize| difficult.iter().map(kind).sum::<usize>();
            let wrong = count(|stratum| stratum.rate(Kind::Unexplained).count);
            let known = count(|stratum| stratum.differing().count) - wrong;
            sentences.push(format!(
                "Difficult {} were chosen on purpose: {wrong} of {drawn} {} wrong, and {known} {} for a known reason.",
                validation.counted(),
                are(wrong),
                differ(known),
            ));
        }
        sentences.join(" ")
    }

    /// Returns one line per stratum with its rates.
    pub fn rates(&self) -> Vec<String> {
        let drawn = self.validation.strata.iter().filter(|stratum| stratum.sampled > 0);
        drawn.map(|stratum| rates(stratum, self.validation.counted())).collect()
    }

    /// Returns one sentence or more on each other result.
    pub fn remarks(&self) -> Vec<String> {
        let validation = self.validation;
        let mut remarks = vec![format!(
            "A record differs if it disagrees with the judge. It is wrong if no computation explains why. Brackets contain \
             rates with 95 % intervals. Only random {0} give rates of the whole map; the other {0} are difficult and were chosen \
             on purpose.",
            validation.counted()
        )];
        remarks.extend(self.fewer());
        remarks.push(self.judge());
        remarks.push(self.again());
        remarks.extend(validation.states.as_ref().map(|states| {
            let [median, worst] = states.distances;
            let (off, compared) = (states.off.len(), states.compared);
            format!(
                "States of {compared} lanes after {HORIZON} periods: {off} {} wrong ({}). The distance of the others from the \
                 reference, relative to the size of the motion, has the median {median:.0e} and the maximum {worst:.0e}, \
                 which rounding explains.",
                are(off),
                states.rate().text()
            )
        }));
        remarks.extend(validation.chaos_ends.as_ref().map(|ends| chaos_ends(ends, validation.counted())));
        remarks.extend(validation.half_mesh.as_ref().map(|half| half_mesh(half, validation.counted())));
        if validation.filled > 0 {
            let (filled, runs, counted) = (validation.filled, validation.runs, validation.counted());
            remarks.push(format!(
                "{filled} of {runs} {counted} were filled from their neighbours, not integrated. The audit checks them, not this \
                 validation."
            ));
        }
        remarks
    }

    /// Explains why fewer cells were checked than requested.
    fn fewer(&self) -> Option<String> {
        let Validation { requested, replayed, runs, filled, .. } = *self.validation;
        let (integrated, counted) = (runs - filled, self.validation.counted());
        let drawn: usize = self.validation.strata.iter().map(|stratum| stratum.sampled).sum();
        (replayed < requested).then(|| match drawn - replayed {
            0 => format!(
                "{requested} {counted} were requested. The map has {integrated} integrated ones, and all were checked."
            ),
            twice => format!(
                "{requested} {counted} were requested, and {replayed} different ones were checked: groups are drawn \
                 independently, and {twice} {} drawn a second time by another group.",
                if twice == 1 { "was" } else { "were" }
            ),
        })
    }

    /// Names the engines that judged the sample.
    fn judge(&self) -> String {
        let reference = "the event-driven reference, without early stops";
        let Some(double) = self.double_lanes else {
            return match (self.validation.judge, self.is_gpu()) {
                (Judge::Independent, _) => format!(
                    "Judges: {reference}, and DOP853, an ODE program with event location that shares no code with it."
                ),
                (_, true) => format!("Judge: {reference}, on the processor."),
                (_, false) => format!(
                    "Judge: {reference}. It is the map's own engine, and no second one was available: errors that it repeats \
                     are not found."
                ),
            };
        };
        match self.is_gpu() {
            true => format!(
                "Judge: {reference}, on the processor. Lanes in f64 on {double} show which differences are rounding."
            ),
            false => format!("Judges: {reference}, and lanes in f64 on {double}, which are another engine."),
        }
    }

    /// Says where the map's own engine computed the sample again, and how many records are equal.
    fn again(&self) -> String {
        let [same, count] = self.validation.again;
        let equal = format!("{same} of {count} records are the same to the bit");
        let may_differ = match (self.is_gpu(), self.validation.is_exact) {
            (false, false) => {
                " Another build of the program computed the map, so records may differ by rounding."
            }
            _ => "",
        };
        match (self.is_gpu(), self.again_on(), self.is_same_device()) {
            (true, Some(device), true) => {
                format!("Lanes ran again on the map's own device, {device}: {equal}.")
            }
            (true, Some(device), false) => {
                let why = self.not_own.map_or(String::new(), |why| format!(" ({why})"));
                format!(
                    "Lanes ran again on {device}, not on the map's own device, {}{why}: {equal}. Devices may round differently.",
                    self.made.device
                )
            }
            (true, None, _) => {
                let why = self.not_own.map_or(String::new(), |why| format!(": {why}"));
                format!("Lanes did not run again, so no record was compared to the bit{why}.")
            }
            (false, _, true) => {
                format!(
                    "The map's engine, the reference, ran again on the same kind of processor, {}: {equal}.{may_differ}",
                    self.processors[1]
                )
            }
            (false, _, false) => format!(
                "The map's engine, the reference, ran again on {}; the map was computed on {}: {equal}.{may_differ}",
                self.processors[1], self.processors[0]
            ),
        }
    }
}

fn are(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

fn differ(count: usize) -> &'static str {
    if count == 1 { "differs" } else { "differ" }
}

/// Counts the cells that differ for a known reason, and lists the reasons; none if there are none.
fn reasons(stratum: &StratumResult) -> Option<(usize, String)> {
    let known = Kind::ALL.into_iter().filter(|&kind| kind != Kind::Unexplained);
    let counts = known.map(|kind| (kind, stratum.rate(kind).count)).filter(|(_, count)| *count > 0);
    let counts: Vec<(Kind, usize)> = counts.collect();
    let kinds = counts.iter().map(|(kind, count)| format!("{count} {}", kind.name().replace('_', " ")));
    let kinds = kinds.collect::<Vec<_>>().join(", ");
    (!counts.is_empty()).then(|| (counts.iter().map(|(_, count)| count).sum(), kinds))
}

/// Returns the rates of a stratum: wrong cells, and cells that differ for a known reason.
fn rates(stratum: &StratumResult, counted: &str) -> String {
    let cells = stratum.stratum.describe(counted);
    let (wrong, differing) = (stratum.rate(Kind::Unexplained), stratum.differing());
    let kinds = reasons(stratum).map_or(String::new(), |(_, kinds)| format!("; {kinds}"));
    format!(
        "{} of {} {cells}: {} {} ({}{kinds}), {} wrong ({})",
        stratum.sampled,
        stratum.runs,
        differing.count,
        differ(differing.count),
        differing.text(),
        wrong.count,
        wrong.text()
    )
}

/// Largest number of cells that a sentence names.
const NAMED_CELLS: usize = 8;

/// Says in how many cells chaos ends, in which, and how to find all of them.
fn chaos_ends(ends: &ChaosEnds, counted: &str) -> String {
    let ChaosEnds { periods, runs, rate, ended } = ends;
    if rate.among == 0 {
        return format!("No {counted} are chaotic, so none was followed to see whether chaos ends.");
    }
    let followed = format!(
        "Chaos was followed in {} of {runs} chaotic {counted} for {periods} further periods: it ends in {} ({})",
        rate.among,
        rate.count,
        rate.text()
    );
    if ended.is_empty() {
        return followed + ".";
    }
    let periodic = ended.iter().filter(|end| matches!(end.class, Class::Periodic { .. })).count();
    let named = ended.iter().take(NAMED_CELLS).map(|end| format!("({}, {})", end.indices[0], end.indices[1]));
    let more = if ended.len() > NAMED_CELLS { ", ..." } else { "" };
    format!(
        "{followed}; {periodic} of these become periodic. They are {}{more}. Set integration.confirm_chaos = {periods} to continue all \
         chaotic {counted} of the map.",
        named.collect::<Vec<_>>().join(", ")
    )
}

/// Says what half the meshing speed changes, what this means, and which meshing speed to use.
fn half_mesh(half: &HalfMesh, counted: &str) -> String {
    let HalfMesh { classes, periods, words, patterns, .. } = half;
    let among = |rate: &crate::validate::Rate| match rate.count {
        0 => format!("0 of {}", rate.among),
        count => format!("{count} of {} ({})", rate.among, rate.text()),
    };
    let result = format!(
        "With half the mesh_speed, {} meshing {counted} change their class. Among those that stay periodic, {} change their \
         period, {} their pattern and {} their word.",
        among(classes),
        among(periods),
        among(patterns),
        among(words)
    );
    let [now, halved] = match half.mesh_speed {
        Some(speed) => [format!("mesh_speed = {speed}"), format!("mesh_speed = {}", 0.5 * speed)],
        None => ["the mesh_speed of the map".to_owned(), "half the mesh_speed".to_owned()],
    };
    let meaning = match half.matters() {
        true => format!(
            "mesh_speed is the leaving speed at which bouncing ends, and these {counted} depend on it: their class, period or pattern \
             is a result of this choice as well as of the model. If you know the speed at which your contacts stop bouncing, use \
             it. Otherwise compute the map with {halved} and validate it; halve again until these numbers no longer fall."
        ),
        false => format!(
            "In this sample, class, period and pattern do not depend on the choice of mesh_speed: keep {now}. Words count each bounce before \
             meshing; compare patterns instead."
        ),
    };
    format!("{result} {meaning}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::{Rate, Stratum};

    const CARD: &str = "Some card";
    const OTHER: &str = "llvmpipe";

    fn validation(judge: Judge) -> Validation {
        let stratum = |stratum, sampled, kinds| StratumResult { stratum, runs: 4900, sampled, kinds };
        Validation {
            seed: 1,
            requested: 400,
            runs: 4900,
            filled: 0,
            has_starts: false,
            judge,
            strata: vec![
                stratum(Stratum::Uniform, 200, [0; 5]),
                stratum(Stratum::Border, 100, [1, 2, 0, 0, 0]),
                stratum(Stratum::Status, 100, [0; 5]),
            ],
            replayed: 397,
            again: [397, 397],
            is_exact: false,
            agreement: Vec::new(),
            chaos: Vec::new(),
            chaos_ends: None,
            half_mesh: None,
            states: None,
            mismatches: Vec::new(),
            not_finite: Vec::new(),
        }
    }

    fn text(
        engine: &str,
        own_lanes: Option<&str>,
        double_lanes: Option<&str>,
        judge: Judge,
        here: &str,
    ) -> String {
        let (validation, precision) = (validation(judge), if engine == "gpu" { "f32" } else { "f64" });
        let device = if engine == "gpu" { CARD } else { "event-driven reference" };
        let made = Provenance { engine, precision, device, commit: "c" };
        let not_own = (own_lanes != Some(CARD)).then_some("no such adapter");
        let processors = ["AMD, 2 cores", here];
        Validated { validation: &validation, made, processors, own_lanes, not_own, double_lanes }
            .remarks()
            .join("\n")
    }

    #[test]
    fn each_engine_of_map_and_judge_is_named_with_its_own_device() {
        use Judge::{Independent, Lanes, Reference};
        let same = "AMD, 2 cores";
        for (engine, own, double, judge, here, parts) in [
            (
                "cpu",
                None,
                Some(OTHER),
                Lanes,
                same,
                [
                    "the reference, ran again on the same kind of processor, AMD, 2 cores: 397 of 397",
                    "lanes in f64 on llvmpipe, which are another engine",
                ],
            ),
            (
                "cpu",
                None,
                Some(OTHER),
                Lanes,
                "Intel",
                ["ran again on Intel; the map was computed on AMD, 2 cores", "lanes in f64 on llvmpipe"],
            ),
            ("cpu", None, None, Independent, same, ["same kind of processor", "and DOP853, an ODE program"]),
            ("cpu", None, None, Reference, same, ["same kind of processor", "no second one was available"]),
            (
                "gpu",
                Some(CARD),
                None,
                Reference,
                same,
                ["again on the map's own device, Some card", "without early stops, on the processor."],
            ),
            (
                "gpu",
                Some(CARD),
                Some(OTHER),
                Reference,
                same,
                ["again on the map's own device, Some card", "Lanes in f64 on llvmpipe show"],
            ),
            (
                "gpu",
                Some(OTHER),
                Some(OTHER),
                Reference,
                same,
                [
                    "again on llvmpipe, not on the map's own device, Some card (no such adapter)",
                    "Lanes in f64 on llvmpipe show",
                ],
            ),
            (
                "gpu",
                None,
                None,
                Reference,
                same,
                [
                    "did not run again, so no record was compared to the bit: no such adapter",
                    "on the processor",
                ],
            ),
        ] {
            let text = text(engine, own, double, judge, here);
            parts.iter().for_each(|part| assert!(text.contains(part), "{part}: {text}"));
            assert_eq!(
                text.contains("not on the map's own device"),
                engine == "gpu" && own == Some(OTHER),
                "{text}"
            );
        }
    }

    #[test]
    fn the_verdict_states_the_rate_of_wrong_random_cells() {
        let verdict = |random: [usize; 5], status: usize| {
            let mut validation = validation(Judge::Reference);
            validation.strata[0].kinds = random;
            validation.strata[2].kinds[Kind::Unexplained as usize] = status;
            let made = Provenance { engine: "cpu", precision: "f64", device: "d", commit: "c" };
            let [own_lanes, not_own, double_lanes] = [None; 3];
            let processors = ["p"; 2];
            Validated { validation: &validation, made, processors, own_lanes, not_own, double_lanes }
                .verdict()
        };
        assert_eq!(
            verdict([0; 5], 0),
            "The map stands: 0 of 200 random cells are wrong (below 1.5 %). Difficult cells were chosen on purpose: 0 of 200 are \
             wrong, and 3 differ for a known reason."
        );
        assert!(verdict([0, 0, 1, 0, 0], 0).contains(" 1 differs for a known reason (1 budget too short). "));
        let doubt = verdict([0, 0, 0, 0, 1], 0);
        assert!(
            doubt.starts_with("The map stands with a reservation: 1 of 200 random cells is wrong (0.5 %, ")
                && doubt.contains("ten times as many"),
            "{doubt}"
        );
        assert_eq!(
            verdict([0, 0, 0, 0, 9], 7),
            "Do not trust this map: 9 of 200 random cells are wrong (4.5 %, 2.1 to 8.4); 7 of 100 cells with a status other than ok \
             are wrong (7 %, 2.9 to 14)."
        );
    }

    #[test]
    fn fewer_cells_than_requested_have_a_reason() {
        let text = text("cpu", None, None, Judge::Independent, "");
        assert!(text.contains("400 cells were requested, and 397 different ones were checked"), "{text}");
        assert!(text.contains("3 were drawn a second time by another group"), "{text}");
    }

    #[test]
    fn half_the_meshing_speed_has_a_meaning_and_an_advice() {
        let half = |classes, patterns, mesh_speed| {
            let [periods, words] = [Rate::new(0, 69), Rate::new(40, 69)];
            let [classes, patterns] = [Rate::new(classes, 85), Rate::new(patterns, 69)];
            half_mesh(&HalfMesh { mesh_speed, classes, periods, words, patterns }, "cells")
        };
        let text = half(4, 12, Some(0.01));
        assert!(text.contains("4 of 85 (4.7 %, ") && text.contains("12 of 69 (17 %, "), "{text}");
        assert!(
            text.contains("depend on it") && text.contains("compute the map with mesh_speed = 0.005"),
            "{text}"
        );
        assert!(half(0, 1, None).contains("compute the map with half the mesh_speed"));
        let text = half(0, 0, Some(0.01));
        assert!(
            text.contains("do not depend on the choice") && text.contains("keep mesh_speed = 0.01"),
            "{text}"
        );
    }
}

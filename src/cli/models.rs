//! `rattlemap models`: what can be swept, and one model on a page.

use std::fmt::Write;

use anyhow::anyhow;
use rattlemap_dynamics::model::{GearPair, Model, Parameter};
use rattlemap_dynamics::orbit::Status;

use crate::cli::arguments::{DEFAULT_RESTITUTION, Models};
use crate::cli::error::Failure;
use crate::cli::say;
use crate::output::print;

/// A model as this command knows it.
struct Page {
    model: Box<dyn Model>,
    /// One line for the list.
    summary: &'static str,
    /// Equations and contact law, above the parameters.
    equations: &'static str,
}

fn pages() -> Vec<Page> {
    vec![Page {
        model: Box::new(GearPair::paper(DEFAULT_RESTITUTION)),
        summary: "two gears on elastic supports that mesh through a backlash; a harmonic force on gear 1",
        equations: GEAR_PAIR,
    }]
}

/// Prints the list of models, or one of them on a page.
pub(crate) fn run(ask: &Models) -> Result<(), Failure> {
    let pages = pages();
    let Some(name) = &ask.name else {
        for page in &pages {
            print(&format!("{:<12} {}", page.model.name(), page.summary))?;
        }
        return Ok(());
    };
    match pages.iter().find(|page| page.model.name() == name) {
        Some(page) => Ok(print(&page.text())?),
        None => {
            let names: Vec<&str> = pages.iter().map(|page| page.model.name()).collect();
            let name = say::quoted(name);
            Err(Failure::Usage(anyhow!("no model is called `{name}`; there is {}", names.join(", "))))
        }
    }
}

impl Page {
    fn text(&self) -> String {
        let mut text =
            format!("{} ({})\n\n{}\n\nParameters\n\n", self.model.title(), self.model.name(), self.equations);
        text += &format!("    {:<11} {:<9} {:<25} {}\n", "symbol", "default", "range", "meaning");
        for parameter in self.model.parameters() {
            text += &line(parameter);
        }
        text += &format!("\n{READING}\n\nStatus: how the integration of a cell ended\n\n");
        for status in Status::ALL {
            let _ = writeln!(text, "    {:<17} {}", status.name(), meaning(status));
        }
        let source = self
            .model
            .source()
            .map_or(String::new(), |title| format!("\"{title}\"; numbers in brackets are its equations"));
        text + &format!("\n{ERRORS}\n\nSource\n\n    {source}\n")
    }
}

fn line(parameter: &Parameter) -> String {
    let default = parameter.default.map_or("-".to_owned(), |value| value.to_string());
    let Parameter { name, meaning, range, .. } = parameter;
    format!("    {name:<11} {default:<9} {:<25} {meaning}\n", range.requirement())
}

/// A status in words.
fn meaning(status: Status) -> &'static str {
    match status {
        Status::Ok => "nothing to remark",
        Status::Slow => "slow convergence: the class rests on Newton's method, or is undecided",
        Status::NearGrazing => "a contact so near to grazing that multipliers and exponent mean little",
        Status::StrobeOnEvent => "an event lies on phase 0, where the cycle is compared with itself",
        Status::CapEvents => "failed: more events in one period than the engine takes",
        Status::CapRoot => "failed: more steps or root iterations than the engine takes",
        Status::TooStiff => "failed: too stiff for the engine",
        Status::NonFinite => "failed: the state left the range of finite numbers",
        Status::BelowResolution => {
            "points of the cycle lie closer than the engine can tell apart: its period may be a divisor"
        }
    }
}

const GEAR_PAIR: &str = "\
Everything is dimensionless. The state is x1, v1, x2, v2; the gap z = x1 - x2, its rate w = v1 - v2.
The right wall, s = +1, is at z = +b, the left one, s = -1, at z = -b. The forcing period is T = 2 pi / omega.

Motion

    free, |z| < b (11)
        m1 x1'' + r1 x1' + k1 x1 = F cos(omega t)
        m2 x2'' + r2 x2' + k2 x2 = 0
    meshing on the right, s = +1 (12), and on the left, s = -1 (13)
        m1 x1'' + r1 x1' + k1 x1 + [r w + k (z - s b)] = F cos(omega t)
        m2 x2'' + r2 x2' + k2 x2 - [r w + k (z - s b)] = 0

Contact

    Free motion reaches wall s, with s w >= 0. First the law of impact: momentum is kept, w becomes -e w (5), (6), (22).
    Meshing starts if then e |w| <= mesh_speed and the load presses the gap to the wall (37); otherwise it was an impact.
    w = 0 with the load pulling away is grazing: nothing happens.
    Meshing ends where the gap comes back to its wall from behind (38), or where pressing ceases before it is there.
    The state is continuous at the end of meshing.
    mesh_speed is a choice: the source does not say at which speed bouncing ends. Half of it changes most words of cells
    that mesh, and few of their patterns; `rattlemap validate` counts how many.";

const READING: &str = "\
Words

    One symbol per flight, between two events:
        1  meshing on the right                4  meshing on the left
        2  free, from the right to the right   5  free, from the left to the left
        3  free, from the right to the left    6  free, from the left to the right
    A word is the cyclic sequence of a cycle's flights in order of time, in its smallest rotation: 13554622.
    The literature composes maps from right to left, with powers: P_{1 2^2 6 4 5^2 3} is the same cycle.
    Its pattern, 135462, counts each run of one symbol once: how often teeth bounce before they mesh is left out.

Class

    periodic    a stable cycle was confirmed; the period counts forcing periods
    chaotic     no cycle, and the Lyapunov exponent exceeds 0 by six standard errors
    undecided   neither within the budget: long transients, near bifurcations, tori
    failed      the integration could not be continued; the status says why";

const ERRORS: &str = "\
Errors

    lyapunov_error is the standard error of an exponent that is an average of blocks. That of a cycle comes from its
    multipliers and has none.";

//! The command line: what can be asked, and its help.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::cli::say;
use crate::gpu::Precision;
use crate::job::engine_choice::{Ask, Wanted, Who};
use crate::map::printable::is_printable;
use crate::map::scene::{Along, Format};
use crate::map::shard::Shard;
use crate::model_file::DEFAULT as DEFAULT_MODEL;
use crate::text::shell::quoted;
use crate::validate::DEFAULT_SAMPLES;
use clap::error::ContextValue;
use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use rattlemap_dynamics::model::{REST, State};
use rattlemap_dynamics::orbit::Settings;

/// Version and commit, as `--version` prints them.
const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("RATTLEMAP_COMMIT"), ")");

/// Motion of a gear pair with backlash: flights between the tooth surfaces in closed form, every
/// contact located, cycles named by their word, and the Lyapunov exponent of each.
///
/// All quantities are dimensionless. Exit code 0: done; 1: the run or a validation failed; 2: bad usage or scene,
/// and nothing was computed; 130: interrupted by Ctrl-C, 143: by SIGTERM.
#[derive(Debug, Parser)]
#[command(version = VERSION, bin_name = "rattlemap", arg_required_else_help = true)]
#[command(after_help = "Examples:\n  \
    rattlemap map scenes/e_omega.toml                periods and chaos over restitution and frequency\n  \
    rattlemap orbit --set e=0.06                     the paper's motion with meshing on both sides\n  \
    rattlemap bifurcation scenes/paper_fig5.toml     section points against restitution")]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What the process was asked for; else the exit code, once help, version or what is wrong has been told.
///
/// # Errors
/// The exit code.
pub fn parsed<P: Parser>() -> Result<P, ExitCode> {
    parsed_from(std::env::args_os()).map_err(ExitCode::from)
}

/// The same of these arguments, the program's name first.
///
/// # Errors
/// The exit code.
pub(crate) fn parsed_from<P: Parser>(arguments: impl IntoIterator<Item = OsString>) -> Result<P, u8> {
    P::try_parse_from(arguments).map_err(|mut error| {
        if error.use_stderr() {
            quote(&mut error);
            // Plain: what it quotes must not pass for colours.
            say::notes(error.render().to_string().trim_end());
        } else {
            // A closed stdout has no reader.
            let _ = error.print();
        }
        error.exit_code() as u8
    })
}

/// Makes arguments that an error quotes fit for one line of a terminal.
fn quote(error: &mut clap::Error) {
    let context: Vec<_> = error.context().map(|(kind, value)| (kind, value.clone())).collect();
    for (kind, value) in context {
        let value = match value {
            ContextValue::String(text) => ContextValue::String(say::quoted(text)),
            ContextValue::Strings(list) => ContextValue::Strings(list.iter().map(say::quoted).collect()),
            // Advice that cannot be shown as it would have to be typed is none.
            ContextValue::StyledStrs(list)
                if !list.iter().all(|text| text.to_string().chars().all(is_printable)) =>
            {
                ContextValue::None
            }
            _ => continue,
        };
        error.insert(kind, value);
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Map(Map),
    Merge(Merge),
    Orbit(Orbit),
    Bifurcation(Bifurcation),
    Models(Models),
    /// What there is to compute on: adapters, precisions, limits, and what `--engine auto` takes
    ///
    /// A map is tried for a moment on each engine where nothing else decides. WGPU_ADAPTER_NAME (part of
    /// a name) and WGPU_BACKEND (vulkan, metal, dx12) in the environment narrow the adapters down.
    Devices,
    Validate(Validate),
    Compare(Compare),
    Check(Check),
    Completions(Completions),
    /// Measurements: how fast are maps on this machine's engines?
    ///
    /// Writes tables (CSV), figures (PNG) and manifest.json to a folder of its own.
    #[command(subcommand)]
    Bench(Bench),
}

/// What is measured.
#[derive(Debug, Subcommand)]
pub(crate) enum Bench {
    Engines(Engines),
}

/// The same scene on every engine: same answers, and where the time goes
#[derive(Debug, Args)]
#[command(after_help = "Lanes of the map scenes/e_omega.toml, from 10^3 to 10^7 as far as time and memory \
    allow: on the CPU with 1 to all threads, and on every adapter in every precision. What is better: more periods \
    per second. The answers are compared with each other and a sample of them with the reference; the exit code is 1 \
    if more differs without a reason than one cell in 10,000 allows.")]
pub(crate) struct Engines {
    #[command(flatten)]
    pub(crate) run: BenchOptions,

    /// Seconds that all of it may take
    #[arg(long, value_name = "SECONDS", default_value_t = 480, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) budget: u32,

    /// Measure no graphics adapter but this: its number in `rattlemap devices`, or part of its name, driver or PCI address
    /// that no other has. One of several equal cards is measured unless another is named
    #[arg(long, value_name = "N|NAME", value_parser = adapter)]
    pub(crate) adapter: Option<Wanted>,
}

/// Where measurements go, and how thorough they are.
#[derive(Debug, Args)]
pub(crate) struct BenchOptions {
    /// Where to write [default: out/bench/<what is measured>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Replace the files of an earlier run; without it a folder that is not empty is refused
    #[arg(long)]
    pub(crate) force: bool,

    /// Tiny sizes: does everything work? The figures mean nothing
    #[arg(long)]
    pub(crate) quick: bool,

    /// Say nothing unless something is wrong
    #[arg(long)]
    pub(crate) quiet: bool,
}

impl BenchOptions {
    /// The folder to write to.
    pub(crate) fn out(&self, what: &str) -> PathBuf {
        self.out.clone().unwrap_or_else(|| Path::new("out/bench").join(what))
    }
}

/// A map over two parameters: what every cell's motion is
///
/// Integrates each cell of the scene's two axes and writes tables (cells.csv, cells.npy), figures
/// (map.png and others), an interactive page (report.html) and manifest.json. Records go to
/// records.bin as they are computed: after Ctrl-C (exit code 130) or a crash, --resume goes on from
/// there, and every table and figure comes out byte for byte as if nothing had happened.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example, the main map with fewer cells:\n  \
    rattlemap map scenes/e_omega.toml --set axis.0.count=128 --set axis.1.count=128\n\n\
    The first of four shards of it, for one of four machines:\n  \
    rattlemap map scenes/e_omega.toml --engine cpu --shard 1/4")]
pub(crate) struct Map {
    #[command(flatten)]
    pub(crate) run: SceneOptions,

    #[command(flatten)]
    pub(crate) engine: EngineOptions,

    /// Go on with an interrupted run of the same scene; where nothing was kept yet, begin. A shard that is finished is left
    /// as it is
    #[arg(long, conflicts_with = "force")]
    pub(crate) resume: bool,

    /// Compute a part of the map alone, for one of N machines: shard I of N, counted from 1, into a folder of its own
    /// (out/<scene's name>.shard-I-of-N) with its records and no tables. `rattlemap merge` makes the map of all N. The
    /// engine must be named, the same for all. Shards are spread over the map and cost about the same; adaptive maps
    /// have none
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,

    /// Say what the map would take and write nothing: cells, engine, memory, disk, and the time that it would
    /// take, from some of its cells that are computed and thrown away
    #[arg(long)]
    pub(crate) dry_run: bool,

    /// Also print one JSON object on stdout when the map is done: folder, files, engine, device, classes, statuses,
    /// seconds, and what was resumed. With --dry-run, what is foreseen as one object
    #[arg(long)]
    pub(crate) json: bool,
}

impl Map {
    /// The folder to write to: a shard has one beside the map's.
    pub(crate) fn out(&self) -> PathBuf {
        let Some(shard) = self.shard.filter(|_| self.run.out.is_none()) else { return self.run.out() };
        let mut name = self.run.scene.file_stem().unwrap_or_default().to_owned();
        name.push(format!(".shard-{}-of-{}", shard.index(), shard.count()));
        Path::new("out").join(name)
    }
}

/// The map of all its shards: as one run would have made it
///
/// Reads the folders that `rattlemap map SCENE --shard I/N` has made, in any order and from any machine, and writes the
/// map: records, tables, figures, report and manifest, the same as of one run but for times and devices. Shards must be
/// of one run: the same scene, engine, precision and version, on graphics cards of one model and driver. What is missing or
/// unfinished is named, with the command that makes it. No scene file is needed. Shards are only read, and can be deleted
/// once the map is there.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example, a map in two shards:\n  \
    rattlemap map scenes/e_omega.toml --engine cpu --shard 1/2\n  \
    rattlemap map scenes/e_omega.toml --engine cpu --shard 2/2\n  \
    rattlemap merge out/e_omega out/e_omega.shard-*-of-2")]
pub(crate) struct Merge {
    /// The folder to write the map to
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,

    /// The folders of all shards
    #[arg(value_name = "PART", required = true)]
    pub(crate) parts: Vec<PathBuf>,

    /// Replace the files of an earlier run in OUT; without it a folder that is not empty is refused
    #[arg(long)]
    pub(crate) force: bool,

    /// Also print one JSON object on stdout when the map is done, as `map --json` does
    #[arg(long)]
    pub(crate) json: bool,

    /// Say nothing unless something is wrong
    #[arg(long)]
    pub(crate) quiet: bool,
}

impl Merge {
    /// The command that does it again.
    pub(crate) fn again(&self) -> String {
        let parts = [&self.out].into_iter().chain(&self.parts);
        let words: Vec<String> = parts.map(|path| quoted(&path.display().to_string())).collect();
        format!("rattlemap merge {} --force", words.join(" "))
    }
}

/// A scene, where its results go, and what to change about it.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneOptions {
    /// The scene: a TOML file
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,

    /// Where to write [default: out/<scene's name>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    /// Replace the files of an earlier run; without it a folder that is not empty is refused
    #[arg(long)]
    pub(crate) force: bool,

    /// Override the scene: a parameter by name (k=800), anything else by its path
    /// (integration.max_period=32, axis.0.count=200). An axis named here (axis.0.parameter=F)
    /// replaces the scene's own value of that parameter. May be repeated
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    pub(crate) set: Vec<String>,

    /// Formats of figures, instead of the scene's (outputs.files): some of png, svg, pdf
    #[arg(long, value_name = "FORMAT,...", value_enum, value_delimiter = ',')]
    pub(crate) format: Vec<FigureFormat>,

    /// Say nothing unless something is wrong
    #[arg(long)]
    pub(crate) quiet: bool,
}

impl SceneOptions {
    /// The folder to write to.
    pub(crate) fn out(&self) -> PathBuf {
        let default = || Path::new("out").join(self.scene.file_stem().unwrap_or_default());
        self.out.clone().unwrap_or_else(default)
    }
}

/// Formats of figures by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FigureFormat {
    /// Pixels
    Png,
    /// Lines and text for browsers and editors; maps as pixels, one per cell
    Svg,
    /// The same for papers
    Pdf,
}

impl FigureFormat {
    /// As scenes name them, each once.
    pub(crate) fn scene(formats: &[FigureFormat]) -> Vec<Format> {
        let [png, svg, pdf] = Format::FIGURES;
        let all = [(FigureFormat::Png, png), (FigureFormat::Svg, svg), (FigureFormat::Pdf, pdf)];
        all.into_iter().filter(|(named, _)| formats.contains(named)).map(|(_, format)| format).collect()
    }
}

/// Who computes, and how precisely.
#[derive(Clone, Debug, Args)]
pub(crate) struct EngineOptions {
    /// Who computes
    #[arg(long, value_enum, default_value_t = EngineChoice::Auto)]
    pub(crate) engine: EngineChoice,

    /// Precision of the motion: f32 or f64. A GPU takes f32 unless told otherwise, and f64 only
    /// where it has double precision; the CPU is f64
    #[arg(long, value_name = "PRECISION", value_parser = precision)]
    pub(crate) precision: Option<Precision>,

    /// The graphics adapter: its number in `rattlemap devices`, or part of its name, driver or PCI address that no other
    /// has. all takes every card that has the model and driver of the first one, with the same records; others are named
    /// and left out. It goes before WGPU_ADAPTER_NAME
    #[arg(long, value_name = "N|NAME|all", value_parser = adapter)]
    pub(crate) adapter: Option<Wanted>,
}

impl EngineOptions {
    /// The same for the library.
    pub(crate) fn ask(&self) -> Ask {
        let engine = match self.engine {
            EngineChoice::Auto => Who::Auto,
            EngineChoice::Gpu => Who::Gpu,
            EngineChoice::Cpu => Who::Cpu,
        };
        Ask { engine, precision: self.precision, adapter: self.adapter.clone() }
    }
}

fn precision(text: &str) -> Result<Precision, String> {
    let named = Precision::ALL.into_iter().find(|precision| precision.name() == text);
    named.ok_or_else(|| "it must be f32 or f64".to_owned())
}

fn adapter(text: &str) -> Result<Wanted, String> {
    let wanted = (!text.trim().is_empty()).then(|| text.parse().ok()).flatten();
    wanted.ok_or_else(|| {
        "it must be a number or part of a name that `rattlemap devices` lists, or all".to_owned()
    })
}

/// Engines by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum EngineChoice {
    /// A hardware GPU if there is one, else the CPU; a software GPU where that is faster on long maps
    Auto,
    /// Lanes on a graphics device
    Gpu,
    /// The event-driven reference on all processor cores, f64
    Cpu,
}

/// One motion: its class, word, exponent, multipliers and every event on the cycle
///
/// Starts at phase 0, lets the transient pass and reads what the motion settles on. A periodic
/// motion is shown over one cycle, any other over its last 8 forcing periods.
#[derive(Debug, Args)]
#[command(after_help = "Example, the paper's meshing motion with its figures:\n  \
    rattlemap orbit --set e=0.06 --out out/meshing\n\n\
    And a motion of another model:\n  \
    rattlemap orbit --model impact-oscillator --set omega=2.8")]
pub(crate) struct Orbit {
    /// The model: a name that `rattlemap models` lists, or a file
    #[arg(long, value_name = "NAME|FILE", default_value = DEFAULT_MODEL)]
    pub(crate) model: String,

    /// Set a parameter of the model; the others have its defaults. For the gear pair these are the paper's Table 1,
    /// and e = 0.605: any of m1 m2 r1 r2 k1 k2 r k F omega b e mesh_speed. May be repeated
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    pub(crate) set: Vec<String>,

    /// State at phase 0 to start from; at rest unless given. Of a model of one coordinate: X,V
    #[arg(long, value_name = "X1,V1,X2,V2", allow_hyphen_values = true, value_parser = state)]
    pub(crate) start: Option<Given>,

    /// Forcing periods of the first check of the motion, 2 or more. No limit: while it is undecided, checks of
    /// twice the length follow, up to 32768 periods or this many, each after up to 50 periods in which a
    /// tangent vector turns. Cycles of up to half as many are found (at most 64)
    #[arg(long, value_name = "N", default_value_t = Settings::default().observed_periods,
          value_parser = clap::value_parser!(u32).range(2..=10_000_000))]
    pub(crate) periods: u32,

    /// Forcing periods to let pass before the first check, 1 or more. All of them are integrated, and what
    /// is undecided after the first check goes on
    #[arg(long, value_name = "N", default_value_t = Settings::default().transient_periods,
          value_parser = clap::value_parser!(u32).range(1..=1_000_000_000))]
    pub(crate) transient: u32,

    /// Also tell the state at the time T since the start, which is at time 0 and phase 0: exact to
    /// rounding. Chaos makes much of rounding after some time
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = time)]
    pub(crate) time: Option<f64>,

    /// Print one JSON object instead of a summary
    #[arg(long)]
    pub(crate) json: bool,

    /// Also write to this folder: orbit.json, the motion as a table (trajectory.csv), its spectrum, phase portraits and
    /// time histories
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    /// Formats of figures: some of png, svg, pdf
    #[arg(
        long,
        value_name = "FORMAT,...",
        value_enum,
        value_delimiter = ',',
        default_value = "png",
        requires = "out"
    )]
    pub(crate) format: Vec<FigureFormat>,

    /// Write even if the folder is not empty
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
}

/// A state as it was given: its model says how many numbers it should have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Given {
    state: State,
    pub(crate) count: usize,
}

/// A state as `--start` takes it.
fn state(text: &str) -> Result<Given, String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
    match numbers.as_deref() {
        Some(&[x, v]) => Ok(Given { state: [x, v, 0.0, 0.0], count: 2 }),
        Some(&[x1, v1, x2, v2]) => Ok(Given { state: [x1, v1, x2, v2], count: 4 }),
        _ => Err(
            "it must be four finite numbers, such as 0.1,0,-0.2,1.5, or two for a model of one coordinate"
                .to_owned(),
        ),
    }
}

/// A time as `--time` takes it.
fn time(text: &str) -> Result<f64, String> {
    let time = text.trim().parse().ok().filter(|time: &f64| time.is_finite() && *time >= 0.0);
    // Zero has one sign.
    time.map(f64::abs).ok_or_else(|| "it must be a finite number, 0 or more: time since the start".to_owned())
}

impl Orbit {
    /// The state to start from.
    pub(crate) fn start(&self) -> State {
        self.start.map_or(REST, |given| given.state)
    }

    /// How long to integrate: a cycle counts once it has come round twice.
    pub(crate) fn settings(&self) -> Settings {
        Settings {
            transient_periods: self.transient,
            observed_periods: self.periods,
            max_period: Settings::default().max_period.min(self.periods / 2),
        }
    }
}

/// Every contact and end of meshing against one parameter, as in the paper's Fig. 5
///
/// Integrates each value of the scene's one axis on the event-driven reference and writes
/// bifurcation.csv (one row per event), bifurcation_columns.csv (one row per value: class, period, word, pattern,
/// exponent and its error), bifurcation.png and manifest.json; of a model whose walls fix a displacement
/// bifurcation_strobe.csv, too (states at phase 0). Each value is
/// integrated until it is decided; steps_per_period, early_stop and quantities are for maps.
/// With start.policy=both the attractor is followed upwards and downwards, and where class, period or
/// pattern differ is told.
#[derive(Debug, Args)]
#[command(after_help = "Example, the paper's Fig. 5 with fewer columns:\n  \
    rattlemap bifurcation scenes/paper_fig5.toml --set axis.0.count=200\n\n\
    And with hysteresis, up and down in one figure:\n  \
    rattlemap bifurcation scenes/paper_fig5.toml --set start.policy=both\n\n\
    One line of a map's plane:\n  \
    rattlemap bifurcation scenes/e_omega.toml --along e --at omega=5.6")]
pub(crate) struct Bifurcation {
    #[command(flatten)]
    pub(crate) run: SceneOptions,

    /// The axis to run along, of a scene of two. What the scene asks of a map alone is left out ([refine],
    /// start.count, html, npy). Writes to out/<scene's name>.NAME.OTHER=VALUE unless told
    #[arg(long, value_name = "NAME")]
    along: Option<String>,

    /// Where the other axis stays: any value that the parameter may have, on the grid or not
    #[arg(long, value_name = "NAME=VALUE", requires = "along", allow_hyphen_values = true)]
    at: Vec<String>,
}

impl Bifurcation {
    /// The line of a plane, if one was asked for.
    pub(crate) fn along(&self) -> Option<Along> {
        self.along.clone().map(|parameter| Along { parameter, at: self.at.clone() })
    }

    /// The folder to write to: a line of a map's scene has one beside the map's own.
    pub(crate) fn out(&self) -> PathBuf {
        let Some(along) = self.along.as_ref().filter(|_| self.run.out.is_none()) else {
            return self.run.out();
        };
        let at: String =
            self.at.iter().map(|at| format!(".{}", at.replace(char::is_whitespace, ""))).collect();
        let mut name = self.run.scene.file_stem().unwrap_or_default().to_owned();
        name.push(format!(".{along}{at}"));
        Path::new("out").join(name)
    }
}

/// What can be asked: the models, or one of them on a page
///
/// Without a name: every model that is built in, in one line. With one, or with the file of a model of your own:
/// equations, what happens at the walls, parameters with defaults and ranges, symbols of words, classes and statuses,
/// the source.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    rattlemap models gear-pair\n  \
    rattlemap models my-model.toml\n  \
    rattlemap models bilinear --file > my-model.toml")]
pub(crate) struct Models {
    /// The model
    #[arg(value_name = "NAME|FILE")]
    pub(crate) name: Option<String>,

    /// Print the model's file itself, to begin one's own with
    #[arg(long, requires = "name")]
    pub(crate) file: bool,
}

/// How right a finished map is: a sample of its cells, judged by what did not make them
///
/// Half of the sample is drawn from all integrated cells, a quarter at borders of classes, a quarter by
/// status; rates come from the first. What a cell's start reaches is computed by the event-driven reference
/// over the whole budget, without early stops; maps of the reference itself are judged by lanes in f64 too,
/// or where no adapter has them by DOP853 with event location. A cell that differs is of one of five kinds:
/// another attractor, a border within rounding, a budget too short, an engine's cap, or unexplained. Averages
/// over chaos are compared as distributions, and states of many lanes after a few periods. The exit code is 1
/// where more is unexplained than one cell in 10,000 allows. Writes validation.json and a section of
/// report.html.
#[derive(Debug, Args)]
#[command(after_help = "Example, a thousand cells of the main map:\n  \
    rattlemap validate out/e_omega --samples 1000")]
pub(crate) struct Validate {
    /// The folder of a finished map
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,

    /// Cells to replay, all if the map has fewer
    #[arg(long, value_name = "N", default_value_t = DEFAULT_SAMPLES as u32,
          value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) samples: u32,

    /// Decides which cells: the same seed, the same sample
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(crate) seed: u64,

    /// Say nothing unless something is wrong
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Where two finished maps of one grid differ: by class, by period, by pattern
///
/// For hysteresis (start.policy up against down), engine against engine, version against version. Other parameters may
/// differ, and are named; the axes must have the same values. Writes compare.csv (one row per differing cell),
/// compare.png and manifest.json. Cells differ by class or by period; those that agree in both and differ by pattern
/// (by word where a map has no patterns) are listed and drawn, too, and counted apart. Of cells of one period it says
/// in how many symmetry, words and patterns differ (an orbit and its mirror image have one word), and by how much
/// exponents do at most. Filled cells count as any other.
#[derive(Debug, Args)]
#[command(after_help = "Example, the hysteresis of a plane:\n  \
    rattlemap map scenes/e_omega.toml --set start.policy=up --out out/up\n  \
    rattlemap map scenes/e_omega.toml --set start.policy=down --out out/down\n  \
    rattlemap compare out/up out/down")]
pub(crate) struct Compare {
    /// The folder of a finished map
    #[arg(value_name = "A")]
    pub(crate) a: PathBuf,

    /// The folder of another one
    #[arg(value_name = "B")]
    pub(crate) b: PathBuf,

    /// Exit with code 1 if any cell differs by class or period; other patterns, words and exponents do not count
    #[arg(long)]
    pub(crate) fail: bool,

    /// Where to write [default: out/compare/<A's name>-<B's name>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    /// Formats of the figure: some of png, svg, pdf
    #[arg(long, value_name = "FORMAT,...", value_enum, value_delimiter = ',', default_value = "png")]
    pub(crate) format: Vec<FigureFormat>,

    /// Replace the files of an earlier comparison; without it a folder that is not empty is refused
    #[arg(long)]
    pub(crate) force: bool,

    /// Also print one JSON object on stdout: who made the maps, what their scenes ask differently, and all counts
    #[arg(long)]
    pub(crate) json: bool,

    /// Say nothing unless something is wrong
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Whether the files of a folder are what they were
///
/// Compares every file with the size and the hash (SHA-256) in manifest.json. What is damaged or missing is named, and the
/// exit code is 1; files that it does not list are named, too. Nothing is written unless --repair is given: it makes tables, figures and report of a
/// map anew from records.bin. No scene file is needed.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    rattlemap check out/e_omega --repair")]
pub(crate) struct Check {
    /// The folder of a finished map, diagram or orbit
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,

    /// Make damaged and missing files of a map anew from its records
    #[arg(long)]
    pub(crate) repair: bool,

    /// Say nothing unless something is wrong
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// What a shell needs to complete this command line, or its page for man, on stdout
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    rattlemap completions bash > ~/.local/share/bash-completion/completions/rattlemap\n  \
    rattlemap completions man > ~/.local/share/man/man1/rattlemap.1")]
pub(crate) struct Completions {
    /// The shell, or man
    #[arg(value_name = "SHELL")]
    pub(crate) target: CompletionTarget,
}

/// Who wants to know of the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CompletionTarget {
    Bash,
    Elvish,
    Fish,
    #[value(name = "powershell")]
    PowerShell,
    Zsh,
    /// A page for man
    Man,
}

impl CompletionTarget {
    /// The shell; none for man.
    pub(crate) fn shell(self) -> Option<Shell> {
        match self {
            CompletionTarget::Bash => Some(Shell::Bash),
            CompletionTarget::Elvish => Some(Shell::Elvish),
            CompletionTarget::Fish => Some(Shell::Fish),
            CompletionTarget::PowerShell => Some(Shell::PowerShell),
            CompletionTarget::Zsh => Some(Shell::Zsh),
            CompletionTarget::Man => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model_file::FileModel;
    use clap::CommandFactory;
    use rattlemap_dynamics::model::Model;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn help_names_the_defaults_in_use() {
        let help = Cli::command().find_subcommand_mut("orbit").unwrap().render_long_help().to_string();
        let restitution = FileModel::built_in(DEFAULT_MODEL).unwrap().get("e").unwrap();
        assert!(help.contains(&format!("e = {restitution}")), "{help}");
        for parameter in rattlemap_dynamics::model::GearPair::PARAMETERS {
            assert!(help.contains(&*parameter.name), "{} is not in the help", parameter.name);
        }
    }
}

//! Arguments of all commands, and their help texts.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::cli::failure::Failure;
use crate::cli::say;
use crate::findings::compare::TOLERANCE;
use crate::gpu::Precision;
use crate::job::engine_choice::{AdapterRequest, EngineKind, EngineRequest};
use crate::job::refined_cycle::RefineRequest;
use crate::map::curves::Kind;
use crate::map::scene::{Along, FigureStyle, Format, MAX_PERIODS, toml};
use crate::map::shard::Shard;
use crate::model_file::{DEFAULT as DEFAULT_MODEL, FileModel};
use crate::record::Spelling;
use crate::show::run_up::Ramp;
use crate::store::inventory::figure_formats;
use crate::store::orbit::{HistoryRequest, TABLED};
use crate::text::printable::is_printable;
use crate::text::shell::quoted;
use crate::validate::{CHAOS_PERIODS, DEFAULT_SAMPLES};
use anyhow::anyhow;
use clap::builder::PossibleValue;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, FromArgMatches, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use rattlemap_dynamics::model::{self, Model, REST, STATE, State};
use rattlemap_dynamics::orbit::{LONGEST_WINDOW, Settings};
use rattlemap_dynamics::word::Word;

/// Version and commit, as `--version` prints them.
const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("RATTLEMAP_COMMIT"), ")");

/// Computes maps of vibro-impact oscillators: period, chaos and sequence of impacts over two parameters.
///
/// Between contacts the motion follows the exact solution, and every contact is located to rounding error. Each motion is
/// described by its class, period, word (the sequence of its flights) and Lyapunov exponent.
///
/// Quantities have the units of the model; those of the gear pair are dimensionless.
///
/// Exit codes: 0 done; 1 the run or a validation failed; 2 wrong usage or scene, nothing was computed; 130 interrupted by
/// Ctrl-C; 143 by SIGTERM.
#[derive(Debug, Parser)]
#[command(version = VERSION, bin_name = "rattlemap", arg_required_else_help = true)]
#[command(after_help = "Examples:\n  \
    rattlemap map scenes/e_omega.toml                a map over restitution and frequency\n  \
    rattlemap orbit --set e=0.06                     one motion of the gear pair\n  \
    rattlemap bifurcation scenes/paper_fig5.toml     a bifurcation diagram against restitution")]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Parses the arguments of the process. Prints help, version or an error.
///
/// # Errors
/// The exit code, if the process should end.
pub fn parsed<P: Parser>() -> Result<P, ExitCode> {
    parsed_from(std::env::args_os()).map_err(ExitCode::from)
}

/// Parses arguments that begin with the program's name. Prints help, version or an error.
///
/// # Errors
/// The exit code, if the program should end.
pub(crate) fn parsed_from<P: Parser>(arguments: impl IntoIterator<Item = OsString>) -> Result<P, u8> {
    let arguments = joined(arguments);
    P::try_parse_from(&arguments).map_err(|mut error| {
        if error.use_stderr() {
            advise_set(&mut error, &arguments);
            quote(&mut error);
            // Colours are removed, because a quoted argument could contain some.
            say::notes(error.render().to_string().trim_end());
        } else {
            // An error means that stdout is closed.
            let _ = error.print();
        }
        error.exit_code() as u8
    })
}

/// Turns `compare --fail quantities` into `compare --fail=quantities`. Other arguments after `--fail` are folders, because its value is
/// optional.
fn joined(arguments: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let mut all: Vec<OsString> = Vec::new();
    for argument in arguments {
        match all.last_mut() {
            Some(last)
                if last == "--fail" && argument == "quantities" && !Path::new("quantities").exists() =>
            {
                last.push("=quantities");
            }
            _ => all.push(argument),
        }
    }
    all
}

/// Adds advice to the error for an argument `NAME=VALUE` without `--set`, and for a parameter as an option: `--NAME VALUE`.
fn advise_set(error: &mut clap::Error, arguments: &[OsString]) {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        Some(ContextValue::StyledStr(text)) => Some(text.to_string()),
        _ => None,
    };
    let (argument, usage) = (text(ContextKind::InvalidArg), text(ContextKind::Usage));
    let sets = ["map", "bifurcation", "orbit"].map(|command| format!("rattlemap {command} "));
    let takes_sets = usage.is_some_and(|usage| sets.iter().any(|command| usage.contains(command)));
    let assignment = |argument: String| match argument.strip_prefix('-') {
        None => Some(argument).filter(|argument| argument.contains('=')),
        Some(name) => {
            let name = name.trim_start_matches('-');
            let given = arguments.iter().map(|given| given.to_string_lossy());
            let mut given = given.skip_while(|given| given.split('=').next() != Some(&argument));
            let value =
                given.next().and_then(|option| option.split_once('=').map(|(_, value)| value.to_owned()));
            let value = value.or_else(|| Some(given.next()?.into_owned())).unwrap_or("VALUE".to_owned());
            parameters().contains(name).then(|| format!("{name}={value}"))
        }
    };
    if let (ErrorKind::UnknownArgument, Some(argument), true) =
        (error.kind(), argument.and_then(assignment), takes_sets)
    {
        error.remove(ContextKind::SuggestedArg);
        let advice = format!("a parameter is set by an option: --set {argument}");
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![advice.into()]));
    }
}

/// Names of the parameters of all built-in models.
pub(crate) fn parameters() -> BTreeSet<String> {
    let models = FileModel::all_built_in();
    models
        .iter()
        .flat_map(|model| model.parameters().iter().map(|parameter| parameter.name.to_string()))
        .collect()
}

/// Escapes arguments that an error quotes.
fn quote(error: &mut clap::Error) {
    let context: Vec<_> = error.context().map(|(kind, value)| (kind, value.clone())).collect();
    for (kind, value) in context {
        let value = match value {
            ContextValue::String(text) => ContextValue::String(say::quoted(text)),
            ContextValue::Strings(list) => ContextValue::Strings(list.iter().map(say::quoted).collect()),
            // Drops advice with characters that must be escaped: it could not be typed.
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
    Orbit(Box<Orbit>),
    Bifurcation(Bifurcation),
    Explore(Explore),
    Models(Models),
    /// List the processor and the graphics adapters, and the engine that `--engine auto` chooses
    ///
    /// For each adapter: kind, interface, precisions, number for --adapter, largest buffer and batch. The environment
    /// variables WGPU_ADAPTER_NAME (part of a name) and WGPU_BACKEND (vulkan, metal, dx12) exclude other adapters.
    Devices,
    Validate(Validate),
    Compare(Compare),
    Curves(Curves),
    Check(Check),
    Completions(Completions),
    /// Measure how fast this machine computes maps
    ///
    /// Writes tables (CSV), figures (PNG) and manifest.json to a folder of its own.
    #[command(subcommand)]
    Bench(Bench),
}

/// Measurements.
#[derive(Debug, Subcommand)]
pub(crate) enum Bench {
    Engines(Engines),
}

/// Compute one map on every engine, to measure speed and agreement
#[derive(Debug, Args)]
#[command(
    after_help = "Computes the map scenes/e_omega.toml with 10^3 to 10^7 cells, as far as time and memory allow, on the \
    processor and on every graphics adapter in every precision. The speed is forcing periods per second. The answers are \
    compared with each other, and a sample of them with the reference; the exit code is 1 if significantly more than \
    one cell in 10,000 differs without an explanation.\n\n\
    Example, two minutes on the first adapter:\n  \
    rattlemap bench engines --budget 120 --adapter 0"
)]
pub(crate) struct Engines {
    #[command(flatten)]
    pub(crate) run: BenchOptions,

    /// Time limit for all measurements, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 480, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) budget: u32,

    /// Measure this graphics adapter only: its number in `rattlemap devices`, or a unique part of its name, driver or PCI
    /// address [default: all adapters; only the first of several equal cards]
    #[arg(long, value_name = "N|NAME")]
    pub(crate) adapter: Option<AdapterRequest>,
}

/// Output folder and thoroughness of measurements.
#[derive(Debug, Args)]
pub(crate) struct BenchOptions {
    /// Folder to write to [default: out/bench/<name of the measurement>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Replace the files of an earlier run in the folder. Without this option the folder must be empty
    #[arg(long)]
    pub(crate) force: bool,

    #[command(flatten)]
    pub(crate) figure: FigureOptions,

    /// Use tiny maps, to check that everything works. The measured speeds are meaningless
    #[arg(long)]
    pub(crate) quick: bool,

    /// Print only errors and warnings
    #[arg(long)]
    pub(crate) quiet: bool,
}

impl BenchOptions {
    /// The folder to write to.
    pub(crate) fn out(&self, measurement: &str) -> PathBuf {
        self.out.clone().unwrap_or_else(|| Path::new("out/bench").join(measurement))
    }
}

/// Compute a map: the motion in every cell of a plane of two parameters
///
/// Writes tables (cells.csv, cells.npy), figures (map.png and others), an interactive page (report.html) and manifest.json.
/// While the map is computed, the records of finished cells are stored in records.bin. After Ctrl-C or a crash, --resume
/// continues from these records. Tables, figures and page are byte for byte those of an uninterrupted run; records.bin has the
/// same records, in another order.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n\n\
    The main map with fewer cells:\n  \
    rattlemap map scenes/e_omega.toml --set axis.0.count=128 --set axis.1.count=128\n\n\
    The first of four shards, on one of four machines:\n  \
    rattlemap map scenes/e_omega.toml --engine cpu --shard 1/4")]
pub(crate) struct Map {
    #[command(flatten)]
    pub(crate) run: SceneOptions,

    #[command(flatten)]
    pub(crate) engine: EngineOptions,

    /// Continue an interrupted run of the same scene. Without stored records the map starts from its first cell. A finished
    /// map is not computed again: its files are written again, in the formats of the scene and those that the folder has,
    /// and validation.json stays. A finished shard is not computed again
    #[arg(long, conflicts_with = "force")]
    pub(crate) resume: bool,

    /// Compute only shard I of N, counted from 1, for instance 1/4. It writes records and a manifest, but no tables, to
    /// out/<scene's name>.shard-I-of-N; `rattlemap merge` combines all shards into the map. All shards take about the
    /// same time. Requires --engine, with the same value for all shards. Adaptive maps cannot be divided into shards
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,

    /// Print the number of cells, the engine, and the memory, disk space and time that the map needs. The time is predicted
    /// from a few seconds of computation. Nothing is written
    #[arg(long)]
    pub(crate) dry_run: bool,

    /// Also print a JSON object on stdout when the map is done: folder, files, engine, device, numbers of cells by class and
    /// status, and times. With --dry-run, print the estimate as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

impl Map {
    /// The arguments of a map that is computed, or completed, in its default folder.
    pub(crate) fn of_scene(scene: &Path, quiet: bool) -> Map {
        let quiet = quiet.then_some("--quiet").map(OsStr::new);
        let given = [OsStr::new("map"), OsStr::new("--resume")].into_iter().chain(quiet);
        let given = given.chain([OsStr::new("--"), scene.as_os_str()]);
        let command = Map::augment_args(clap::Command::new("map"));
        let matches = command.get_matches_from(given);
        Map::from_arg_matches(&matches).expect("the arguments are those of the command")
    }

    /// The folder to write to.
    pub(crate) fn out(&self) -> PathBuf {
        let Some(shard) = self.shard.filter(|_| self.run.out.is_none()) else { return self.run.out() };
        let mut name = self.run.stem().to_owned();
        name.push(format!(".shard-{}-of-{}", shard.index(), shard.count()));
        Path::new("out").join(name)
    }
}

/// Combine the shards of a map
///
/// Reads the folders of all shards, in any order and from any machines, and writes the map: records, tables, figures, report
/// and manifest are those of a single run, apart from times and devices. All shards must come from the same scene, engine,
/// precision and program version, and from graphics cards of one model and driver. An error names missing and unfinished
/// shards, with the command that computes each. The scene file is not needed. The shards' folders are not changed, and can
/// be deleted afterwards.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example, a map in two shards:\n  \
    rattlemap map scenes/e_omega.toml --engine cpu --shard 1/2\n  \
    rattlemap map scenes/e_omega.toml --engine cpu --shard 2/2\n  \
    rattlemap merge out/e_omega out/e_omega.shard-*-of-2")]
pub(crate) struct Merge {
    /// Folder to write the map to
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,

    /// Folders of all shards
    #[arg(value_name = "PART", required = true)]
    pub(crate) parts: Vec<PathBuf>,

    /// Replace the files of an earlier run in OUT. Without this option the folder must be empty
    #[arg(long)]
    pub(crate) force: bool,

    /// Also print a JSON object on stdout when the map is done, as `map --json` does
    #[arg(long)]
    pub(crate) json: bool,

    /// Print only errors and warnings
    #[arg(long)]
    pub(crate) quiet: bool,
}

impl Merge {
    /// The command that merges the same shards again.
    pub(crate) fn again(&self) -> String {
        let parts = [&self.out].into_iter().chain(&self.parts);
        let words: Vec<String> = parts.map(|path| quoted(&path.display().to_string())).collect();
        format!("rattlemap merge {} --force", words.join(" "))
    }
}

/// A scene, its output folder, and changes to it.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneOptions {
    /// The scene, a TOML file; docs/scenes.md describes all keys
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,

    /// Folder to write to [default: out/<scene's name>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    /// Replace the files of an earlier run in the folder, of this or another command; files that are not written again are
    /// removed and named. Without this option the folder must be empty
    #[arg(long)]
    pub(crate) force: bool,

    /// Override the scene: a parameter by its name (k=800), any other value by its path (integration.max_period=32,
    /// axis.0.count=200). A parameter that becomes an axis (axis.0.parameter=F) needs no value of its own. May be repeated
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    pub(crate) set: Vec<String>,

    /// Formats of figures, instead of those in the scene (outputs.files): png, svg, pdf. Figures of other formats that the
    /// folder has are drawn again, too. Example: --format png,pdf
    #[arg(long, value_name = "FORMAT,...", value_enum, value_delimiter = ',')]
    pub(crate) format: Vec<Format>,

    #[command(flatten)]
    pub(crate) figure: FigureOptions,

    /// Print only errors and warnings
    #[arg(long)]
    pub(crate) quiet: bool,
}

impl SceneOptions {
    /// The folder to write to.
    pub(crate) fn out(&self) -> PathBuf {
        self.out.clone().unwrap_or_else(|| Path::new("out").join(self.stem()))
    }

    /// The scene's name without its extension. A name that leaves `.` or `..`, which are folders, keeps its extension.
    fn stem(&self) -> &OsStr {
        let stem = self.scene.file_stem().filter(|stem| *stem != "." && *stem != "..");
        stem.or(self.scene.file_name()).unwrap_or_default()
    }
}

/// Appearance of figures.
#[derive(Clone, Debug, Args)]
pub(crate) struct FigureOptions {
    /// Width of figures, 60mm to 300mm, in mm, cm, in or pt. All type then has at least 7.4 points, or the size of --font-size.
    /// PNG files have 600 dots per inch. Example: --width 85mm
    #[arg(long, value_name = "LENGTH", value_parser = width, allow_hyphen_values = true)]
    width: Option<String>,

    /// Size of tick labels and legends in points, 7 to 24; the width must be at least 21 times as large
    #[arg(long, value_name = "POINTS", value_parser = font_size, allow_hyphen_values = true)]
    font_size: Option<f64>,

    /// Title of figures, instead of their own; --title "" removes the heading
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,

    /// Draw figures without legends and colour bars
    #[arg(long)]
    no_legend: bool,
}

fn width(text: &str) -> Result<String, String> {
    FigureStyle::width(text).map(|_| text.trim().to_owned()).map_err(|reason| format!("it must be {reason}"))
}

fn font_size(text: &str) -> Result<f64, String> {
    let size = text.trim().parse().unwrap_or(f64::NAN);
    FigureStyle::font_size(size).map_err(|reason| format!("it must be {reason}"))
}

impl FigureOptions {
    /// The `--set` arguments with the same effect.
    pub(crate) fn sets(&self) -> Vec<String> {
        let width = self.width.as_ref().map(|width| format!("figure.width={}", toml(width)));
        let font_size = self.font_size.map(|size| format!("figure.font_size={size:?}"));
        let title = self.title.as_ref().map(|title| format!("figure.title={}", toml(title)));
        let legend = self.no_legend.then(|| "figure.legend=false".to_owned());
        [width, font_size, title, legend].into_iter().flatten().collect()
    }

    /// The style of the figures.
    ///
    /// # Errors
    /// A text that names the option and the remedy.
    pub(crate) fn style(&self) -> Result<FigureStyle, Failure> {
        let style = FigureStyle {
            width: self.width.as_deref().and_then(|text| FigureStyle::width(text).ok()),
            font_size: self.font_size,
            title: self.title.clone(),
            legend: !self.no_legend,
        };
        match style.check() {
            Ok(()) => Ok(style),
            Err(reason) => Err(Failure::Usage(anyhow!("--font-size: it must be {reason}"))),
        }
    }
}

/// The formats of figures.
impl ValueEnum for Format {
    fn value_variants<'a>() -> &'a [Format] {
        &Format::FIGURES
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            Format::Svg => "Vector graphics for browsers and editors; a map has one pixel per cell",
            Format::Pdf => "Vector graphics for papers; a map has one pixel per cell",
            _ => "Pixels",
        };
        Some(PossibleValue::new(self.name()).help(help))
    }
}

/// The requested formats of figures, each once.
pub(crate) fn figures(formats: &[Format]) -> Vec<Format> {
    Format::FIGURES.into_iter().filter(|format| formats.contains(format)).collect()
}

/// The formats of a command without a scene: the requested ones and those that the command has written into its folder before.
/// Without a request, png.
pub(crate) fn figures_and_added(formats: &[Format], folder: &Path, command: &str) -> Vec<Format> {
    if formats.is_empty() {
        return vec![Format::Png];
    }
    [figures(formats), figure_formats(folder, command)].concat()
}

/// The engine and its precision.
#[derive(Clone, Debug, Args)]
pub(crate) struct EngineOptions {
    /// Engine that computes the map
    #[arg(long, value_enum, default_value_t = EngineKind::Auto)]
    pub(crate) engine: EngineKind,

    /// Precision of the motion: f32 or f64 [default: f32 on a GPU, f64 on the processor]. The CPU engine computes in f64.
    /// Some GPUs do not support f64
    #[arg(long, value_name = "PRECISION", value_parser = precision)]
    pub(crate) precision: Option<Precision>,

    /// Graphics adapter: its number in `rattlemap devices`, or a unique part of its name, driver or PCI address.
    /// This option overrides WGPU_ADAPTER_NAME. Example: --adapter 1
    #[arg(long, value_name = "N|NAME")]
    pub(crate) adapter: Option<AdapterRequest>,
}

impl EngineOptions {
    /// The engine that these options request.
    pub(crate) fn request(&self) -> EngineRequest {
        EngineRequest { kind: self.engine, precision: self.precision, adapter: self.adapter.clone() }
    }
}

fn precision(text: &str) -> Result<Precision, String> {
    Precision::named(text).ok_or_else(|| "it must be f32 or f64".to_owned())
}

impl ValueEnum for EngineKind {
    fn value_variants<'a>() -> &'a [EngineKind] {
        &EngineKind::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            EngineKind::Auto => "A hardware GPU if the map has enough cells, else the processor",
            EngineKind::Gpu => "A graphics device",
            EngineKind::Cpu => "All processor cores, in f64",
        };
        Some(PossibleValue::new(self.name()).help(help))
    }
}

/// Compute one motion: class, word, Lyapunov exponent, Floquet multipliers and events
///
/// Starts at phase 0, integrates the transient, and describes the motion after it: one cycle if the motion is periodic,
/// otherwise its last 8 forcing periods.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n\n\
    The gear pair with meshing on both sides, with figures:\n  \
    rattlemap orbit --set e=0.06 --out out/meshing\n\n\
    A motion of another model:\n  \
    rattlemap orbit --model impact-oscillator --set omega=2.8\n\n\
    The first 20 forcing periods, from a given state:\n  \
    rattlemap orbit --start 0.1,0,-0.2,1.5 --from-start 20 --out out/first")]
pub(crate) struct Orbit {
    /// Model: a name that `rattlemap models` lists, or the path of a model's file; - reads it from standard input
    #[arg(long, value_name = "NAME|FILE", default_value = DEFAULT_MODEL, allow_hyphen_values = true)]
    pub(crate) model: PathBuf,

    /// Set a parameter of the model; the others keep the model's defaults. The gear pair has the parameters m1 m2 r1 r2 k1 k2
    /// r k F omega b e mesh_speed, with the values of the paper's Table 1 and e = 0.605. start.phase=P starts at the phase P of
    /// the force, in radians, instead of 0; this is then phase 0. May be repeated
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    pub(crate) set: Vec<String>,

    /// Initial state at phase 0 [default: at rest]. For models with one coordinate: X,V. Example: --start 0.1,0,-0.2,1.5
    #[arg(long, value_name = "X1,V1,X2,V2", allow_hyphen_values = true, value_parser = state)]
    pub(crate) start: Option<StartState>,

    /// Number of forcing periods to analyse after the transient, at least 2. Cycles of up to N/2 periods, at most 64, are
    /// found. If the class is not decided then, the motion is undecided [default: 128; while the class is undecided, the
    /// analysis is repeated with twice as many periods, up to 4096]. Example: --periods 256
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=10_000_000))]
    pub(crate) periods: Option<u32>,

    /// Length of the transient, in forcing periods, at least 1. All of it is integrated. Example: --transient 1000
    #[arg(long, value_name = "N", default_value_t = Settings::default().transient_periods,
          value_parser = clap::value_parser!(u32).range(1..=1_000_000_000))]
    pub(crate) transient: u32,

    /// Also print the state at time T; the motion starts at time 0 and phase 0. At the time of an event it is the state after
    /// the event. The state is exact to rounding, but rounding errors grow with time if the motion is chaotic. With --run-up it is the
    /// time of the run-up, and no state is printed. Example: --time 10
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = time)]
    pub(crate) time: Option<f64>,

    /// Show the motion from its start instead of the motion after its transient: N forcing periods, the first ones unless
    /// --to-period is given. With --out writes trajectory.csv, events.csv and the figure history. Example: --from-start 20
    #[arg(long, value_name = "N", conflicts_with_all = ["periods", "transient"],
          value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) from_start: Option<u32>,

    /// Number of the last forcing period that --from-start shows, counted from 1. Example: --from-start 5 --to-period 100 shows
    /// periods 96 to 100 [default: N]
    #[arg(long, value_name = "M", requires = "from_start", value_parser = clap::value_parser!(u64).range(1..=30_000_000))]
    pub(crate) to_period: Option<u64>,

    /// Change a parameter during the motion, linearly over the time --time. Its value is constant within a forcing period and changes
    /// at phase 0. Writes trajectory.csv, events.csv, orders.csv and the figures run_up and campbell. Example:
    /// --run-up omega=0.5:1.5 --time 3000 --out out/run-up
    #[arg(long, value_name = "NAME=FROM:TO", allow_hyphen_values = true, requires_all = ["time", "out"],
          conflicts_with_all = ["periods", "transient", "from_start", "json"])]
    pub(crate) run_up: Option<String>,

    /// Also solve the equations of the cycle that the motion reaches: state, times of events and multipliers to rounding. With --period
    /// or --word it is the cycle of this kind that is nearest to the start, stable or not. Example: --refine --period 1
    #[arg(long, conflicts_with_all = ["from_start", "run_up"])]
    pub(crate) refine: bool,

    /// Length of the cycle for --refine, in forcing periods [default: 1 with --word]
    #[arg(long, value_name = "N", requires = "refine", value_parser = clap::value_parser!(u32).range(1..=64))]
    pub(crate) period: Option<u32>,

    /// Word of the cycle for --refine
    #[arg(long, value_name = "WORD", requires = "refine")]
    pub(crate) word: Option<Word>,

    /// With --refine: also the derivatives of the cycle by this parameter: of its state, times, multipliers and all quantities. Example:
    /// --refine --by e
    #[arg(long, value_name = "NAME", requires = "refine")]
    pub(crate) by: Option<String>,

    /// Print a JSON object instead of a summary
    #[arg(long)]
    pub(crate) json: bool,

    /// Folder to write to: orbit.json, trajectory.csv, spectrum, phase portraits and time histories [default: write nothing]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    /// Formats of figures: png, svg, pdf [default: png]. Figures of other formats that the folder has are drawn again, too.
    /// Example: --format png,pdf
    #[arg(long, value_name = "FORMAT,...", value_enum, value_delimiter = ',', requires = "out")]
    pub(crate) format: Vec<Format>,

    #[command(flatten)]
    pub(crate) figure: FigureOptions,

    /// Replace the files of an earlier run in the folder. Without this option the folder must be empty
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
}

/// A state of two numbers for each coordinate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StartState {
    state: State,
    pub(crate) count: usize,
}

fn state(text: &str) -> Result<StartState, String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
    match numbers.as_deref() {
        Some(numbers) if numbers.len().is_multiple_of(2) && (2..=STATE).contains(&numbers.len()) => {
            Ok(StartState { state: model::state(numbers), count: numbers.len() })
        }
        _ => Err(
            "it must be finite numbers: two, such as 0.1,0, for a model of one coordinate; four, such as \
             0.1,0,-0.2,1.5, for a model of two; and so on"
                .to_owned(),
        ),
    }
}

fn time(text: &str) -> Result<f64, String> {
    let time = text.trim().parse().ok().filter(|time: &f64| time.is_finite() && *time >= 0.0);
    // -0.0 becomes 0.0.
    time.map(f64::abs)
        .ok_or_else(|| "it must be a finite number, 0 or more, the time since the start".to_owned())
}

impl Orbit {
    /// The state to start from.
    pub(crate) fn start(&self) -> State {
        self.start.map_or(REST, |start| start.state)
    }

    /// The requested motion from the start.
    ///
    /// # Errors
    /// If the last period comes before the number of periods is complete.
    pub(crate) fn history(&self) -> Result<Option<HistoryRequest>, String> {
        let Some(periods) = self.from_start else { return Ok(None) };
        let last = self.to_period.unwrap_or(periods.into());
        let skipped = last.checked_sub(periods.into()).ok_or_else(|| {
            format!("--to-period {last}: {periods} periods end at period {periods} or later; give --from-start {last} or less")
        })?;
        Ok(Some(HistoryRequest { start: self.start(), skipped, periods, samples: TABLED }))
    }

    /// The cycle that --refine requests.
    pub(crate) fn refined(&self) -> RefineRequest {
        RefineRequest { period: self.period, word: self.word.clone(), by: self.by.clone() }
    }

    /// The requested run-up.
    ///
    /// # Errors
    /// If it is not `NAME=FROM:TO` with finite numbers, or if the time is 0.
    pub(crate) fn ramp(&self) -> Result<Option<Ramp>, String> {
        let Some((text, time)) = self.run_up.as_ref().zip(self.time) else { return Ok(None) };
        let number = |text: &str| text.trim().parse().ok().filter(|x: &f64| x.is_finite());
        let read = || {
            let (name, range) = text.split_once('=')?;
            let (from, to) = range.split_once(':')?;
            Some(Ramp { name: name.trim().to_owned(), from: number(from)?, to: number(to)?, time })
        };
        match read() {
            None => Err(format!(
                "--run-up {text}: it must be NAME=FROM:TO with two numbers, such as omega=0.5:1.5"
            )),
            Some(_) if time == 0.0 => Err("--time 0: the time of a --run-up must be above 0".to_owned()),
            ramp => Ok(ramp),
        }
    }

    /// The integration settings. The longest period is half the observed periods, because a cycle must be observed twice.
    pub(crate) fn settings(&self) -> Settings {
        let Settings { observed_periods, max_period, .. } = Settings::default();
        let observed_periods = self.periods.unwrap_or(observed_periods);
        let max_period = max_period.min(observed_periods / 2);
        Settings { transient_periods: self.transient, observed_periods, max_period }
    }

    /// Forcing periods of the longest analysis of an undecided motion.
    pub(crate) fn longest_window(&self) -> u32 {
        self.periods.unwrap_or(LONGEST_WINDOW)
    }
}

/// Compute a bifurcation diagram: contacts and ends of meshing against one parameter
///
/// Integrates the motion at each value of the scene's axis with the event-driven reference, until its class is decided.
/// Writes bifurcation.csv (one row per event), bifurcation_columns.csv (one row per value: class, period, word, pattern,
/// exponent and its error), bifurcation.png and manifest.json; for models whose walls fix a displacement also
/// bifurcation_strobe.csv (states at phase 0). Each measured quantity that the scene requests has a column and a panel of
/// the figure. The scene's steps_per_period and early_stop are ignored. With start.policy=both the motion is followed in
/// both directions of the axis, and a message lists where class, period or pattern differ.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n\n\
    The paper's Fig. 5 with fewer columns:\n  \
    rattlemap bifurcation scenes/paper_fig5.toml --set axis.0.count=200\n\n\
    Hysteresis, upwards and downwards in one figure:\n  \
    rattlemap bifurcation scenes/paper_fig5.toml --set start.policy=both\n\n\
    A line through the plane of a map:\n  \
    rattlemap bifurcation scenes/e_omega.toml --along e --at omega=5.6")]
pub(crate) struct Bifurcation {
    #[command(flatten)]
    pub(crate) run: SceneOptions,

    /// Parameter to vary, one of the axes of a map's scene. Settings that only maps have ([refine], start.count, html,
    /// npy) are ignored. The default folder is out/<scene's name>.NAME.OTHER=VALUE
    #[arg(long, value_name = "NAME")]
    along: Option<String>,

    /// Value of the other axis: any value that the parameter allows, also between grid points. Example: --at omega=5.6
    #[arg(long, value_name = "NAME=VALUE", requires = "along", allow_hyphen_values = true)]
    at: Vec<String>,

    /// Follow the branch of every cycle that the diagram finds, through folds, with its unstable parts. Writes branches.csv and
    /// special_points.csv (folds, flips, grazings, other changes of the sequence of flights), and draws the branches in panels of
    /// quantities: unstable parts are dashed
    #[arg(long)]
    pub(crate) branches: bool,
}

impl Bifurcation {
    /// The requested line through a plane.
    pub(crate) fn along(&self) -> Option<Along> {
        self.along.clone().map(|parameter| Along { parameter, at: self.at.clone() })
    }

    /// The folder to write to. The default differs from that of the scene's map.
    pub(crate) fn out(&self) -> PathBuf {
        let Some(along) = self.along.as_ref().filter(|_| self.run.out.is_none()) else {
            return self.run.out();
        };
        let at: String =
            self.at.iter().map(|at| format!(".{}", at.replace(char::is_whitespace, ""))).collect();
        let mut name = self.run.stem().to_owned();
        name.push(format!(".{along}{at}"));
        Path::new("out").join(name)
    }
}

/// Open a page that computes a map: zoom for finer cells, move sliders to change parameters
///
/// For a scene, computes a map of at most 65 x 65 cells and writes one page. The page needs no other file and no network. It
/// computes finer cells of the visible part: in f64 on the processor's cores, or in f32 on the graphics device if the browser
/// offers it. A click on a cell shows its motion. The page's address stores the view, the selected cell and the parameters. For the folder of a finished map, opens
/// its report.html, which computes in the same way.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    rattlemap explore scenes/e_omega.toml\n  \
    rattlemap explore scenes/e_omega.toml --set F=40 --out f40.html\n  \
    rattlemap explore out/e_omega")]
pub(crate) struct Explore {
    /// Scene of a map, or folder of a finished map
    #[arg(value_name = "SCENE|DIR")]
    pub(crate) what: PathBuf,

    /// Set a parameter or a setting of the scene, as in `rattlemap map`. May be repeated. Example: --set F=45
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    pub(crate) set: Vec<String>,

    /// File to write the page to [default: the scene's name with the extension .explore.html, in the current folder; an
    /// existing file is overwritten]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,

    /// Replace the file that --out names
    #[arg(long, requires = "out")]
    pub(crate) force: bool,

    /// Write the page without opening a browser
    #[arg(long)]
    pub(crate) no_open: bool,

    /// Print only errors and warnings
    #[arg(long)]
    pub(crate) quiet: bool,
}

impl Explore {
    /// The file of a scene's page.
    pub(crate) fn out(&self) -> PathBuf {
        self.out.clone().unwrap_or_else(|| {
            let mut name = self.what.file_stem().unwrap_or_default().to_os_string();
            name.push(".explore.html");
            name.into()
        })
    }
}

/// List the models, or describe one of them
///
/// Without a name: one line per built-in model. With a name or a file: equations, walls and their contact laws,
/// parameters with defaults and ranges, source.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    rattlemap models gear-pair\n  \
    rattlemap models my-model.toml\n  \
    rattlemap models bilinear --file > my-model.toml")]
pub(crate) struct Models {
    /// Name of a built-in model, or path of a model's file; - reads it from standard input
    #[arg(value_name = "NAME|FILE")]
    pub(crate) name: Option<PathBuf>,

    /// Print the model's file, for instance as a template for your own model
    #[arg(long, requires = "name")]
    pub(crate) file: bool,
}

/// Check a finished map: compute a sample of its cells with a different engine
///
/// Half of the sample is drawn from all integrated cells, a quarter from cells at borders between classes, a quarter from
/// cells whose status is not ok. The rates of differing cells come from the first half. The event-driven reference
/// computes each cell over the whole budget, without early stops. Maps that the reference computed are compared with
/// lanes in f64, or with the ODE solver DOP853 if no hardware adapter has f64. Each difference is of one of five kinds: another
/// attractor, a border within rounding, a budget too short, a limit of the engine, or unexplained. Averages over chaotic
/// motions are compared as distributions. Chaotic cells, one per five cells of the sample, are followed on the reference for
/// further periods; the result says in how many of them chaos ends, and where. The exit code is 1 if significantly more than one cell in 10,000 is unexplained.
/// Writes validation.json and a section of report.html.
#[derive(Debug, Args)]
#[command(after_help = "Example, a thousand cells of the main map:\n  \
    rattlemap validate out/e_omega --samples 1000")]
pub(crate) struct Validate {
    /// Folder of a finished map
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,

    /// Number of cells in the sample; all cells if the map has fewer
    #[arg(long, value_name = "N", default_value_t = DEFAULT_SAMPLES as u32,
          value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) samples: u32,

    /// Seed of the sample. The same seed draws the same cells
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(crate) seed: u64,

    /// Further periods for which chaotic cells are followed; 0 follows none
    #[arg(long, value_name = "N", default_value_t = CHAOS_PERIODS,
          value_parser = clap::value_parser!(u32).range(..=i64::from(MAX_PERIODS)))]
    pub(crate) chaos_periods: u32,

    /// Engine that checks the reference: f64 lanes, even on a software driver, or an ODE solver with event location. The
    /// solver checks only cells that the reference computed or finished [default: lanes if lanes computed the map or there is
    /// a hardware GPU, else the solver]
    #[arg(long, value_name = "JUDGE", value_enum)]
    pub(crate) judge: Option<JudgeChoice>,

    /// Print only errors and warnings
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Second judge of a validation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum JudgeChoice {
    /// Lanes in f64.
    Lanes,
    /// The ODE solver.
    Solver,
}

/// Reads a share between 0 and 1.
fn parse_share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share| *share > 0.0 && *share < 1.0);
    share.ok_or_else(|| "a number above 0 and below 1 is needed, such as 0.05".to_owned())
}

/// What makes `compare --fail` fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FailOn {
    /// Class or period.
    Class,
    /// Everything that compare.csv lists.
    Quantities,
}

/// Compare two finished maps of the same cells: by class, period, pattern, motion and quantities
///
/// Use it to compare starts (start.policy up and down), engines or versions. The axes must have the same values;
/// differences of other parameters are listed. Writes compare.csv (one row per differing cell), compare.png and
/// manifest.json. A cell differs if its class or period differs. Cells that differ only by pattern (by word if a map has
/// no patterns), by motion (if both maps store states) or by a quantity are listed, drawn and counted separately. Motions
/// are compared up to mirror image, within 3 % of their size; quantities by --tolerance, if at least one motion is
/// periodic. For cells of equal period the summary also counts differences in symmetry and words, and gives the largest
/// difference of exponents. Filled cells of adaptive maps are compared like the others.
#[derive(Debug, Args)]
#[command(after_help = "Example, hysteresis:\n  \
    rattlemap map scenes/e_omega.toml --set start.policy=up --out out/up\n  \
    rattlemap map scenes/e_omega.toml --set start.policy=down --out out/down\n  \
    rattlemap compare out/up out/down")]
pub(crate) struct Compare {
    /// Folder of a finished map
    #[arg(value_name = "A")]
    pub(crate) a: PathBuf,

    /// Folder of another finished map
    #[arg(value_name = "B")]
    pub(crate) b: PathBuf,

    /// Exit with code 1 if any cell differs by class or period; with `--fail quantities`, if any cell is listed in
    /// compare.csv
    #[arg(long, value_name = "quantities", hide_possible_values = true, num_args = 0..=1, require_equals = true, default_missing_value = "class")]
    pub(crate) fail: Option<FailOn>,

    /// Difference of a quantity that counts, relative to the larger of both values; of angles, in radians. Differences
    /// below a thousandth of this share of the largest value in both maps are ignored
    #[arg(long, value_name = "SHARE", default_value_t = TOLERANCE, value_parser = parse_share)]
    pub(crate) tolerance: f64,

    /// Folder to write to [default: out/compare/<A's name>-<B's name>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    /// Formats of the figure: png, svg, pdf [default: png]. Figures of other formats that the folder has are drawn again, too.
    /// Example: --format png,pdf
    #[arg(long, value_name = "FORMAT,...", value_enum, value_delimiter = ',')]
    pub(crate) format: Vec<Format>,

    #[command(flatten)]
    pub(crate) figure: FigureOptions,

    /// Replace the files of an earlier run in the folder. Without this option the folder must be empty
    #[arg(long)]
    pub(crate) force: bool,

    /// Also print a JSON object on stdout: engines and versions of the maps, differences of their scenes, all counts
    #[arg(long)]
    pub(crate) json: bool,

    /// Print only errors and warnings
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Follow the borders between the regions of a map: bifurcation curves
///
/// Where neighbouring cells have different motions, the cycle of one cell is followed to the other one. A fold, a flip (period
/// doubling), a pitchfork (loss of symmetry) or a graze on the way is the first point of a curve, which is then followed over
/// both axes. Each point solves the equations of the cycle to rounding, and its motion was run again: it has the same events.
/// docs/curves.md explains the kinds. Writes curves.csv (one row per point), curve_points.csv (where two conditions meet),
/// unexplained.csv (pairs of neighbours without a curve), curves.png (the map with its curves), report.html (the page of the map
/// with its curves) and manifest.json. Ctrl-C keeps the curves that are found, and --resume goes on.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    rattlemap curves scenes/e_omega.toml\n  \
    rattlemap curves out/e_omega --kind fold,flip --word 13554622")]
pub(crate) struct Curves {
    /// Folders of finished maps over two parameters, or scenes. The map of a scene is computed first, in out/<scene's name>, if it is not there
    #[arg(value_name = "DIR|SCENE", required = true)]
    pub(crate) maps: Vec<PathBuf>,

    /// Kinds of curves: fold, flip, pitchfork, grazing, meshing_grazing, meshing_border, contact_end, sticking, condition [default: all]
    #[arg(long, value_name = "KIND,...", value_delimiter = ',', value_parser = parse_kind)]
    pub(crate) kind: Vec<Kind>,

    /// Follow only cycles with this word, the order of their contacts. `rattlemap orbit` prints the word of a motion
    #[arg(long, value_name = "WORD")]
    pub(crate) word: Option<Spelling>,

    /// Also follow each cycle after it becomes unstable, up to the end of the axis. Also follow the curves that the unstable cycle meets
    #[arg(long)]
    pub(crate) unstable: bool,

    /// Also follow the curves on which a quantity of the map has this value. Example: --condition impact_speed_max=2
    #[arg(long, value_name = "QUANTITY=VALUE")]
    pub(crate) condition: Option<String>,

    /// Locate the points of curves at these values of an axis, and list them in curve_points.csv. Example: --through omega=5.5,omega=6
    #[arg(long, value_name = "NAME=VALUE,...")]
    pub(crate) through: Option<String>,

    /// Begin at the cycle that the map's start reaches at these values, instead of at all cells. The first curve in each direction along
    /// both axes is followed. Example: --from e=0.55,omega=5.6
    #[arg(long, value_name = "NAME=VALUE,NAME=VALUE")]
    pub(crate) from: Option<String>,

    /// Longest cycles that are followed, in forcing periods
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub(crate) longest: u32,

    /// Largest number of curves
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) most_curves: u32,

    /// Largest number of points of each part of a curve. A new part begins where an event passes phase 0
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(2..))]
    pub(crate) most_points: u32,

    /// Folder to write to [default: out/curves/<name of the map or scene>]. With several maps, each has a folder of its name in this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    /// Formats of the figure: png, svg, pdf [default: png]. Figures of other formats that the folder has are drawn again, too.
    /// Example: --format png,pdf
    #[arg(long, value_name = "FORMAT,...", value_enum, value_delimiter = ',')]
    pub(crate) format: Vec<Format>,

    /// Go on with a search that was interrupted, with the same options
    #[arg(long, conflicts_with = "force")]
    pub(crate) resume: bool,

    /// Replace the files of an earlier run in the folder. Without this option the folder must be empty
    #[arg(long)]
    pub(crate) force: bool,

    /// Print only errors and warnings
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Reads the kind of a curve.
fn parse_kind(text: &str) -> Result<Kind, String> {
    Kind::named(text)
        .ok_or_else(|| format!("there is no such kind; the kinds are {}", Kind::NAMES.join(", ")))
}

/// Check the files of a folder against its manifest, and repair them
///
/// Compares size and SHA-256 hash of every file with manifest.json. Names damaged, missing and unknown files; if any is
/// damaged or missing, the exit code is 1. --repair recreates tables, figures and report of a map from records.bin,
/// without the scene file. Without --repair nothing is written.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    rattlemap check out/e_omega --repair")]
pub(crate) struct Check {
    /// Folder of a finished map, diagram, orbit or comparison
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,

    /// Recreate damaged and missing files of a map from its records
    #[arg(long)]
    pub(crate) repair: bool,

    /// Print only errors and warnings
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Print a completion script for a shell, or the man page
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    rattlemap completions bash > ~/.local/share/bash-completion/completions/rattlemap\n  \
    rattlemap completions man > ~/.local/share/man/man1/rattlemap.1")]
pub(crate) struct Completions {
    /// Name of a shell, or man
    #[arg(value_name = "SHELL")]
    pub(crate) target: CompletionTarget,
}

/// Target of `completions`: a shell, or none for the man page.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompletionTarget(pub(crate) Option<Shell>);

impl ValueEnum for CompletionTarget {
    fn value_variants<'a>() -> &'a [CompletionTarget] {
        const fn of(shell: Shell) -> CompletionTarget {
            CompletionTarget(Some(shell))
        }
        use Shell::{Bash, Elvish, Fish, PowerShell, Zsh};
        const { &[of(Bash), of(Elvish), of(Fish), of(PowerShell), of(Zsh), CompletionTarget(None)] }
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        match self.0 {
            Some(shell) => shell.to_possible_value(),
            None => Some(PossibleValue::new("man").help("The man page")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn help_lists_parameters_and_the_default_restitution() {
        let help = Cli::command().find_subcommand_mut("orbit").unwrap().render_long_help().to_string();
        let restitution = FileModel::built_in(DEFAULT_MODEL).unwrap().get("e").unwrap();
        assert!(help.contains(&format!("e = {restitution}")), "{help}");
        for parameter in rattlemap_dynamics::model::GearPair::PARAMETERS {
            assert!(help.contains(&*parameter.name), "{} is not in the help", parameter.name);
        }
    }
}

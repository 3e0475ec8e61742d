//! The report: its data, its security policy, and its behaviour in a browser. Without Chromium the tests in a browser are
//! skipped, with a message on stderr.

use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use assert_cmd::Command as Cargo;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::read::GzDecoder;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

use crate::report::devtools::Browser;

const COLUMNS: usize = 24;
const ROWS: usize = 19;

/// The cell under the pointer.
const CELL: [usize; 2] = [6, 8];

const LAYERS: [&str; 6] = ["period and chaos", "exponent", "impacts", "meshing", "pattern", "word"];

const SCENE: &str = r#"title = "Evil </script><b>title</b> & more"
axis = [
    { parameter = "e", min = 0.0, max = 1.0, count = 24 },
    { parameter = "omega", min = 2.0, max = 11.0, count = 19 },
]

[parameters]
F = 45.0

[start]
policy = "state"
state = [0.1, 0, -0.25, 1]

[outputs]
quantities = ["class", "lyapunov", "impacts", "mesh", "symmetric", "word", "pattern"]
files = ["csv", "html"]
"#;

/// Functions for scripts that wait for workers. The browser's virtual time does not wait for them, so each step takes some
/// real time.
const WAITING: &str = r##"
const said = {};
const text = (id) => document.getElementById(id).textContent;
const fact = (name) => [...document.querySelectorAll("#readout tr")]
  .find((row) => row.cells[0].textContent === name)?.cells[1].textContent;
const until = (ready) => new Promise((resolve) => {
  const look = () => {
    for (let n = 0, sum = 0; n < 5e6; n++) sum += Math.sqrt(n);
    if (ready()) resolve();
    else setTimeout(look, 20);
  };
  look();
});
const isComputed = () => live?.isWhole && live.columns >= 65 && covers(live.made, view);
function sayWindow() {
  said.scene = text("scene");
  said.counts = [live.columns, live.rows];
  said.classes = [...live.values.class].map((index) => map.classes[index]);
  said.periods = [...live.values.period];
}
const motion = () => until(() => !document.getElementById("motion").hidden && !text("computing").includes("computing"));
function finish() {
  const result = document.createElement("pre");
  result.id = "said";
  result.textContent = btoa(unescape(encodeURIComponent(JSON.stringify(said))));
  document.body.append(result);
}
"##;

/// A script that uses the page like a reader and collects the texts that it shows.
const VISIT: &str = r##"
function point(type, x, y) {
  const at = canvas.getBoundingClientRect();
  canvas.dispatchEvent(new PointerEvent(type, { pointerId: 1, clientX: at.left + x, clientY: at.top + y, bubbles: true }));
}
canvas.setPointerCapture = () => {};
async function visit() {
  await until(() => !document.getElementById("wait"));
  said.title = text("title");
  said.layers = [...document.querySelectorAll("#layers button")].map((button) => button.textContent);
  const [x, y] = pixel(6.5, 8.5);
  point("pointermove", x, y);
  said.readout = ["cell", "e", "\u03c9", "class", "exponent", "word", "periods run", "pattern"].map(fact);
  point("pointerdown", x, y);
  point("pointerup", x, y);
  said.command = text("command");
  await until(() => !text("computing").includes("computing"));
  said.motion = text("computing");
  said.summary = text("summary");
  said.figures = ["gap", "phase_plane", "time_history"].map((id) => document.getElementById(id).naturalWidth > 100);
  const { left, top } = canvas.getBoundingClientRect();
  canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -600, clientX: left + x, clientY: top + y, cancelable: true }));
  said.zoomed = view.width < 12 && view.left > 0;
  point("pointermove", x, y);
  said.stays = fact("cell");
  const before = view.left;
  point("pointerdown", x, y);
  point("pointermove", x - 60, y);
  point("pointerup", x - 60, y);
  said.panned = view.left > before;
  document.querySelectorAll("#layers button")[1].click();
  said.legend = text("legend-title");
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
  said.moved = fact("cell");
  showAll();
  said.all = view.width === columns && view.left === 0;
  const drawn = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  said.colors = new Set(new Uint32Array(drawn.buffer)).size;
  finish();
}
visit().catch((error) => { said.error = String(error.stack); finish(); });
"##;

pub(crate) fn chromium() -> Option<&'static str> {
    ["chromium", "chromium-browser", "google-chrome"].into_iter().find(|name| {
        let version =
            Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        version.is_ok_and(|status| status.success())
    })
}

/// Flags of a browser that does not use the graphics device.
pub(crate) const WITHOUT_GRAPHICS: [&str; 1] = ["--disable-gpu"];

/// Opens a page in a browser and returns the texts that the script has collected.
///
/// `query` is added to the page's address, and `flags` to the browser's arguments. `patience` is the browser's virtual time in
/// ms after which the script must have finished.
pub(crate) fn visit(browser: &str, page: &Path, query: &str, flags: &[&str], patience: u32) -> Value {
    let url = format!("file://{}{query}", page.display());
    let run = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--window-size=1300,850"])
        .args(flags)
        .args([&format!("--virtual-time-budget={patience}"), "--dump-dom", &url])
        .stderr(Stdio::null())
        .output()
        .unwrap();
    let dom = String::from_utf8(run.stdout).unwrap();
    let said = dom.split_once("<pre id=\"said\">").and_then(|(_, rest)| rest.split_once("</pre>"));
    let (said, _) = said.unwrap_or_else(|| panic!("the script did not finish: {dom:.2000}"));
    serde_json::from_slice(&STANDARD.decode(said).unwrap()).unwrap()
}

/// Joins the rows of a summary that the program breaks for terminals.
pub(crate) fn unbroken(printed: &str) -> String {
    printed.replace(&format!("\n{:21} ", ""), " ")
}

pub(crate) fn skipped() {
    // The test harness captures `eprintln!` of passing tests, but not this.
    let mut stderr = io::stderr();
    writeln!(stderr, "SKIPPED: no Chromium to open the report with").unwrap();
}

/// A map and its report.
struct Report {
    folder: TempDir,
}

impl Report {
    fn new() -> Report {
        Report::of(SCENE)
    }

    fn of(scene: &str) -> Report {
        let report = Report { folder: tempfile::tempdir().unwrap() };
        fs::write(report.folder.path().join("s.toml"), scene).unwrap();
        report.run(&["map", "s.toml", "--quiet", "--out", "o"]);
        report
    }

    fn validated() -> Report {
        let report = Report::new();
        report.run(&["validate", "o", "--samples", "60", "--quiet"]);
        report
    }

    fn run(&self, arguments: &[&str]) {
        let mut program = Cargo::cargo_bin("rattlemap").unwrap();
        program.current_dir(self.folder.path()).args(arguments).assert().success();
    }

    /// Runs a command and returns what it prints.
    fn printed(&self, command: &str) -> String {
        let arguments = command.split(' ').skip(1);
        let output = Cargo::cargo_bin("rattlemap").unwrap().args(arguments).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join("o").join(name)
    }

    fn page(&self) -> String {
        fs::read_to_string(self.file("report.html")).unwrap()
    }

    /// Returns the data of the page.
    fn data(&self) -> Value {
        let page = self.page();
        let (_, rest) = page.split_once("<script id=\"map\" type=\"application/json\">").unwrap();
        serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
    }

    /// Returns the rows of `cells.csv`.
    fn table(&self) -> Vec<Vec<String>> {
        let mut reader = csv::Reader::from_path(self.file("cells.csv")).unwrap();
        reader.records().map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect()
    }

    /// Returns the row of the cell under the pointer.
    fn row(&self) -> Vec<String> {
        self.table().swap_remove(CELL[1] * COLUMNS + CELL[0])
    }

    /// Opens the page in a browser and returns the collected texts; none without a browser. `also` is a script that collects
    /// more.
    fn visited(&self, also: &str) -> Option<Value> {
        let Some(browser) = chromium() else {
            skipped();
            return None;
        };
        let script = VISIT.replacen("finish();", &format!("{also} finish();"), 1);
        let visited = with_script(&self.file("report.html"), &script);
        Some(visit(browser, &visited, "", &WITHOUT_GRAPHICS, 10_000))
    }
}

/// Writes a copy of a page with a script, whose hash the copy's policy allows. Returns its path.
pub(crate) fn with_script(page: &Path, script: &str) -> PathBuf {
    let text = fs::read_to_string(page).unwrap();
    let whole = format!("<script>{WAITING}{script}</script></body>");
    let own = between(&whole, "<script>", "</script>");
    let text = text.replacen("script-src ", &format!("script-src {} ", hashed(own)), 1);
    let copy = page.with_extension("visited.html");
    fs::write(&copy, text.replacen("</body>", &whole, 1)).unwrap();
    copy
}

/// Returns the text between the first occurrences of two marks.
pub(crate) fn between<'t>(text: &'t str, from: &str, to: &str) -> &'t str {
    let (_, rest) = text.split_once(from).unwrap_or_else(|| panic!("no {from}"));
    rest.split_once(to).unwrap_or_else(|| panic!("no {to}")).0
}

/// Returns the hash of a part as it is written in a policy.
pub(crate) fn hashed(part: &str) -> String {
    format!("'sha256-{}'", STANDARD.encode(Sha256::digest(part)))
}

/// Returns the expected command that replays a cell.
fn command(row: &[String]) -> String {
    let omega = row[3].trim_end_matches(".0");
    format!("rattlemap orbit --set e={} --set omega={omega} --set F=45.0 --start 0.1,0.0,-0.25,1.0", row[2])
}

/// Unpacks an array of the page.
fn unpacked(array: &Value) -> Vec<u8> {
    let packed = STANDARD.decode(array["data"].as_str().unwrap()).unwrap();
    let mut bytes = Vec::new();
    GzDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
    bytes
}

/// Event handlers and styles in attributes would need a wider policy.
#[test]
fn the_policy_allows_only_the_script_and_style_of_the_page() {
    let page = Report::validated().page();
    let policy = between(&page, "<meta http-equiv=\"Content-Security-Policy\" content=\"", "\">");
    let style = hashed(between(&page, "<style>", "</style>"));
    let script = hashed(between(&page, "<script>", "</script>"));
    let expected = format!(
        "default-src 'none'; script-src {script} 'wasm-unsafe-eval'; worker-src blob:; img-src blob:; frame-src blob:; style-src {style}; \
         base-uri 'none'; form-action 'none'"
    );
    assert_eq!(policy, expected);
    let at = |part: &str| page.find(part).unwrap();
    assert!(at("Content-Security-Policy") < at("<title>") && at("<title>") < at("<style>"), "too late");
    assert_eq!((page.matches("<script").count(), page.matches("<style").count()), (3, 1));
    let data = between(&page, "<script id=\"map\" type=\"application/json\">", "</script>");
    let script = between(&page, "<script>", "</script>");
    let engine = between(&page, "<script id=\"engine\" type=\"text/plain\">", "</script>");
    let markup = [data, script, engine].iter().fold(page.clone(), |page, part| page.replace(part, ""));
    let handles = |tag: &&str| {
        let name = |attribute: &str| attribute.split('=').next().unwrap().to_ascii_lowercase();
        tag.split_whitespace().skip(1).map(name).any(|name| name == "style" || name.starts_with("on"))
    };
    let tags: Vec<&str> = markup.split('<').skip(1).filter_map(|rest| rest.split('>').next()).collect();
    assert!(tags.len() > 40, "{}", tags.len());
    assert_eq!(tags.into_iter().find(handles), None);
    let unsafe_calls = ["setAttribute(\"style\"", "setAttribute(\"on", "innerHTML", "insertAdjacentHTML"];
    for call in unsafe_calls.into_iter().chain(["document.write", "eval("]) {
        assert!(!script.contains(call), "{call}");
    }
}

/// A pointer on a curve reads what the curve is, and a click keeps the text. Curves belong to the parameters of the map.
#[test]
fn the_page_of_curves_names_the_curve_under_the_pointer() {
    let scene = "[[axis]]\nparameter = \"e\"\nmin = 0.5\nmax = 0.6\ncount = 6\n\
                 [[axis]]\nparameter = \"omega\"\nmin = 5.0\nmax = 6.5\ncount = 6\n\
                 [outputs]\nquantities = [\"class\", \"symmetric\"]\nfiles = [\"html\"]\n";
    let report = Report::of(scene);
    report.run(&["curves", "o", "--kind", "pitchfork", "--out", "c", "--quiet"]);
    let Some(browser) = chromium() else { return skipped() };
    let script = r##"
canvas.setPointerCapture = () => {};
async function look() {
  await until(() => !document.getElementById("wait"));
  const at = canvas.getBoundingClientRect();
  const point = (type, [x, y]) => canvas.dispatchEvent(
    new PointerEvent(type, { pointerId: 1, clientX: at.left + x, clientY: at.top + y, bubbles: true }));
  const { places, list } = map.curves;
  const k = Math.floor(list[0].count / 2);
  const on = pixel(places[2 * k], places[2 * k + 1]), off = pixel(0.2, 0.2);
  point("pointermove", off);
  said.off = text("curve");
  point("pointermove", on);
  said.on = text("curve");
  point("pointerdown", on);
  point("pointerup", on);
  point("pointermove", off);
  said.kept = text("curve");
  said.legend = [...document.querySelectorAll("#legend .line + span")].map((span) => span.textContent);
  changes = { F: 51 };
  said.changed = showsCurves();
  finish();
}
look().catch((error) => { said.error = String(error.stack); finish(); });
"##;
    let said = visit(
        browser,
        &with_script(&report.folder.path().join("c/report.html"), script),
        "",
        &WITHOUT_GRAPHICS,
        10_000,
    );
    let on = said["on"].as_str().unwrap_or_else(|| panic!("{said}"));
    assert!(on.starts_with("Curve: pitchfork, cycles of period 1, word 36, at e = 0.5"), "{on}");
    assert_eq!([&said["off"], &said["kept"]], [&json!(""), &json!(on)]);
    assert_eq!([&said["legend"], &said["changed"]], [&json!(["pitchfork"]), &json!(false)]);
}

#[test]
fn a_browser_refuses_foreign_scripts() {
    let report = Report::new();
    let Some(browser) = chromium() else { return skipped() };
    let foreign = report.file("foreign.html");
    let intruders = "<script>document.title = \"run\"</script>\
                     <img src=\"data:image/gif,x\" onerror='document.title = \"run\"'></body>";
    let opened = |page: String| {
        fs::write(&foreign, page).unwrap();
        let url = format!("file://{}", foreign.display());
        let run = Command::new(browser)
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0"])
            .args(["--virtual-time-budget=5000", "--dump-dom", &url])
            .output()
            .unwrap();
        let [dom, log] = [run.stdout, run.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
        let title = between(&dom, "<title>", "</title>").to_owned();
        let refused = log.lines().filter(|line| line.contains("Content Security Policy")).count();
        assert!(
            dom.contains("aria-checked=\"true\""),
            "the page's own script did not run: {dom:.2000} {log}"
        );
        (title, refused)
    };
    let page = report.page();
    let (title, refused) = opened(page.clone());
    assert!(title != "run" && refused == 0, "{title}: the browser refused {refused} parts of the page");
    let (title, refused) = opened(page.replace("</body>", intruders));
    assert!(title != "run" && refused >= 2, "{title}, {refused} refused");
    let without = page.replacen("http-equiv=\"Content-Security-Policy\"", "name=\"none\"", 1);
    assert_eq!(opened(without.replace("</body>", intruders)).0, "run", "without the policy they run");
}

#[test]
fn logarithmic_and_listed_axes_have_ticks_and_commands_at_their_values() {
    let forces: Vec<String> = (0..ROWS).map(|j| format!("{:.1}", 2.0 + (j * j) as f64)).collect();
    let scene = format!(
        "[parameters]\ne = 0.5\n[derived]\nk2 = \"2/3*k1\"\n\
         [[axis]]\nparameter = \"k1\"\nmin = 10.0\nmax = 1000.0\ncount = {COLUMNS}\nscale = \"log\"\n\
         [[axis]]\nparameter = \"F\"\nvalues = [{}]\n[outputs]\nfiles = [\"csv\", \"html\"]\n",
        forces.join(", ")
    );
    let report = Report::of(&scene);
    let (data, row) = (report.data(), report.row());
    let k1 = &data["axes"][0];
    assert_eq!((&k1["scale"], k1["values"][CELL[0]].to_string()), (&json!("log"), row[2].clone()));
    assert_eq!(data["axes"][1]["values"][CELL[1]].to_string(), row[3]);
    let derived = &data["derived"][0];
    assert_eq!((&derived["parameter"], &derived["along"]), (&json!("k2"), &json!([true, false])));
    let eight: [u8; 8] = unpacked(derived)[8 * CELL[0]..8 * CELL[0] + 8].try_into().unwrap();
    let k2 = f64::from_le_bytes(eight);
    assert_eq!(k2, 2.0 / 3.0 * row[2].parse::<f64>().unwrap());
    let also = "said.ticks = [0, 1].map((k) => axisTicks(k, 0, map.axes[k].count, 500).marks);";
    let Some(said) = report.visited(also) else { return };
    let force = row[3].trim_end_matches(".0");
    assert_eq!(
        said["command"],
        format!("rattlemap orbit --set k1={} --set F={force} --set k2={k2} --set e=0.5", row[2])
    );
    let labelled = |k: usize| -> Vec<(f64, String)> {
        let ticks = said["ticks"][k].as_array().unwrap().iter();
        let ticks = ticks.map(|tick| (tick[0].as_f64().unwrap(), tick[1].as_str().unwrap().to_owned()));
        ticks.filter(|(_, label)| !label.is_empty()).collect()
    };
    let hundred = labelled(0).into_iter().find(|(_, label)| label == "100").unwrap();
    assert!((hundred.0 - COLUMNS as f64 / 2.0).abs() < 1e-9, "100 is at {}", hundred.0);
    // Listed values are marked in the middle of their cells.
    for (place, label) in labelled(1) {
        assert_eq!(label.parse::<f64>(), Ok(2.0 + (place - 0.5) * (place - 0.5)));
    }
}

#[test]
fn the_report_is_one_page_with_all_cells() {
    let report = Report::new();
    let page = report.page();
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("src="));
    assert_eq!(page.matches("</script>").count(), 3, "the title ended a script");
    let script = between(&page, "<script>", "const WORKER");
    let comments = script.lines().filter(|line| line.trim_start().starts_with("//") || line.ends_with("*/"));
    assert_eq!((comments.count(), script.contains("\nlet view = {")), (0, true));
    let (data, table) = (report.data(), report.table());
    assert_eq!(data["title"], "Evil </script><b>title</b> & more");
    assert_eq!((table.len(), &data["validation"]), (COLUMNS * ROWS, &Value::Null));
    let layers = data["layers"].as_array().unwrap();
    assert_eq!(layers.len(), LAYERS.len());
    for layer in layers {
        // Layers of numbers have these, other layers have indices into their colours.
        let (array, kind, bytes) = match &layer["values"] {
            Value::Null => (&layer["indices"], "u8", 1),
            numbers => (numbers, "f32", 4),
        };
        let size = unpacked(array).len();
        assert_eq!((&array["type"], size), (&json!(kind), bytes * COLUMNS * ROWS), "{}", layer["name"]);
    }
    let values = &data["values"];
    let bytes = |name: &str| unpacked(&values[name]);
    let words = |name: &str| -> Vec<[u8; 4]> {
        bytes(name).chunks_exact(4).map(|four| four.try_into().unwrap()).collect()
    };
    let [periods, words, patterns] = ["periods_run", "word", "pattern"].map(words);
    let exponents: Vec<[u8; 4]> =
        unpacked(&layers[1]["values"]).chunks_exact(4).map(|four| four.try_into().unwrap()).collect();
    for (id, row) in table.iter().enumerate() {
        assert_eq!(data["classes"][usize::from(bytes("class")[id])], row[4], "cell {id}");
        assert_eq!(u32::from_le_bytes(periods[id]).to_string(), row[14], "cell {id}");
        let exponent: f64 = row[6].parse().unwrap();
        assert_eq!(f32::from_le_bytes(exponents[id]), exponent as f32, "cell {id}");
        for (list, number, column) in [("words", words[id], 11), ("patterns", patterns[id], 12)] {
            let text = data[list][u32::from_le_bytes(number) as usize].as_str();
            assert_eq!(text.map_or(String::new(), |text| format!("w{text}")), row[column], "cell {id}");
        }
    }
}

#[test]
fn the_command_of_a_cell_gives_its_class_period_word_and_pattern() {
    let report = Report::new();
    let row = report.row();
    let command = command(&row);
    let arguments = command.split(' ').skip(1);
    let run = Cargo::cargo_bin("rattlemap").unwrap().args(arguments).arg("--json").assert();
    let orbit: Value = serde_json::from_slice(&run.success().get_output().stdout).unwrap();
    assert_eq!(orbit["class"], json!(row[4]));
    for (name, column) in [("word", 11), ("pattern", 12)] {
        assert_eq!(format!("w{}", orbit[name].as_str().unwrap()), row[column], "{name}");
    }
    assert_eq!(orbit["period"].to_string(), row[5]);
    assert!(command.ends_with(report.data()["replay"].as_str().unwrap()), "{command}");
}

#[test]
fn a_validated_report_contains_the_validation_and_works_in_a_browser() {
    let report = Report::validated();
    assert_eq!(report.page().matches("</script>").count(), 3, "the validation ended its script");
    let found = &report.data()["validation"];
    let uniform = &found["strata"][0];
    let numbers = [&found["seed"], &found["cells"], &uniform["kinds"]["unexplained"]["count"]];
    assert_eq!((json!(numbers), &found["faults"]), (json!([1, COLUMNS * ROWS, 0]), &json!([])), "{found}");
    let read = "said.validation = text(\"validation\"); said.verdict = text(\"verdict\");";
    let Some(said) = report.visited(read) else { return };
    let row = report.row();
    assert_eq!(said["title"], "Evil </script><b>title</b> & more");
    assert_eq!(said["layers"], json!(LAYERS));
    assert_eq!((&*row[0], &*row[1]), ("6", "8"));
    let readout: Vec<&str> = said["readout"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert_eq!(readout[..3], ["6, 8", &row[2], row[3].trim_end_matches(".0")]);
    assert!(readout[3].starts_with(&format!("period {}", row[5])), "{}", readout[3]);
    assert_eq!(readout[6], &*row[14]);
    // The page shows words without the prefix that tables have.
    assert_eq!([readout[5], readout[7]].map(|text| format!("w{text}")), [&*row[11], &*row[12]]);
    let (rounded, exact): (f64, f64) = (readout[4].parse().unwrap(), row[6].parse().unwrap());
    assert!((rounded - exact).abs() < 1e-4 * exact.abs(), "{rounded} {exact}");
    assert_eq!(said["command"], command(&row));
    // The page computes the motion by the same code as the program, which uses FMA where the processor has it.
    let motion = said["motion"].as_str().unwrap();
    assert!(motion.starts_with("computed in this page in "), "{motion}");
    assert_eq!(said["figures"], json!([true, true, true]));
    let printed = report.printed(&command(&row));
    let first = |text: &str| text.lines().take(7).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(first(said["summary"].as_str().unwrap()), first(&unbroken(&printed)));
    for fact in ["zoomed", "panned", "all"] {
        assert_eq!(said[fact], true, "{fact}: {said}");
    }
    assert_eq!((&said["stays"], &said["moved"]), (&json!("6, 8"), &json!("7, 8")));
    assert_eq!(said["legend"], "largest Lyapunov exponent, \u{3bb}");
    assert!(said["colors"].as_u64().unwrap() > 20, "{said}");
    let verdict = said["verdict"].as_str().unwrap();
    assert_eq!(verdict, found["verdict"].as_str().unwrap());
    let section = said["validation"].as_str().unwrap();
    let sentences =
        ["cells next to another class or period", "without early stops", "seed 1", "half the mesh_speed"];
    for part in sentences.into_iter().chain([verdict]) {
        assert!(section.contains(part), "{part}: {section}");
    }
}

/// Settings of an adaptive map in which chaos is filled, too.
const ADAPTIVE: [&str; 5] = [
    "axis.0.count=81",
    "axis.1.count=65",
    "refine.minimum_grid=8",
    "refine.max_error=0.05",
    "refine.rounds=2",
];

/// A script that selects a filled and an integrated cell of chaos and collects the texts shown for each.
const SELECT: &str = r#"pointerCell = null;
  for (const [code, name] of map.sources.entries()) {
    const id = base.values.source.findIndex((source, id) => source === code && map.classes[base.values.class[id]] === "chaotic");
    choose({ i: id % columns, j: Math.floor(id / columns) });
    said[name] = ["source", "periods run", "exponent", "impacts", "meshing"]
      .map((label) => fact(label).replace("\u00b1", "+-").replace("\u2013", "none"));
  }"#;

#[test]
fn values_of_filled_cells_are_marked_as_interpolated() {
    let report = Report::new();
    assert_eq!(report.data()["values"]["source"], Value::Null, "every cell was integrated");
    let sets = ADAPTIVE.map(|set| ["--set", set]).concat();
    report.run(&[&["map", "s.toml", "--quiet", "--out", "o", "--force"], &sets[..]].concat());
    let (data, table) = (report.data(), report.table());
    let sources = unpacked(&data["values"]["source"]);
    assert!(sources.iter().zip(&table).all(|(&code, row)| data["sources"][usize::from(code)] == row[15]));
    let Some(said) = report.visited(SELECT) else { return };
    let facts = |source: &str| -> [String; 5] { serde_json::from_value(said[source].clone()).unwrap() };
    let [filled, integrated] = ["filled", "integrated"].map(facts);
    assert_eq!(filled[..2], ["filled", "0"]);
    assert_eq!(integrated[0], "integrated");
    assert!(filled[2..].iter().all(|fact| fact.ends_with(", interpolated")), "{said}");
    assert!(integrated[2..].iter().all(|fact| !fact.contains("interpolated")), "{said}");
    assert!(integrated[2].contains("+-") && !filled[2].contains("+-"), "{said}");
}

/// A map of which only class and impacts were requested, through an argument.
fn impacts_alone() -> Report {
    let report = Report::new();
    let quantities = "outputs.quantities=[\"class\", \"impacts\"]";
    report
        .run(&["map", "s.toml", "--quiet", "--out", "o", "--force", "--engine", "cpu", "--set", quantities]);
    report
}

#[test]
fn the_page_lists_what_was_computed_and_how() {
    let read = "said.names = [...document.querySelectorAll(\"#readout th\")].map((head) => head.textContent); \
                said.fixed = text(\"fixed\"); said.made = text(\"made\"); said.equations = text(\"equations\");";
    let Some(said) = impacts_alone().visited(read) else { return };
    let expected = ["e", "\u{3c9}", "class", "impacts", "status", "periods run", "cell"];
    assert_eq!(said["names"], json!(expected));
    let fixed = said["fixed"].as_str().unwrap();
    assert!(fixed.contains("Model: Gear pair. Source: Study on the Nonlinear"), "{fixed}");
    let equations = said["equations"].as_str().unwrap();
    assert!(equations.starts_with("M x'' + C x' + K x + g N = F(t), "), "{equations}");
    let made = said["made"].as_str().unwrap();
    let version = env!("CARGO_PKG_VERSION");
    let start = format!("Computed by rattlemap {version} (commit ");
    assert!(
        made.starts_with(&start) && made.contains("with the engine cpu in f64: event-driven reference."),
        "{made}"
    );
}

#[test]
fn the_page_explains_the_letters_of_gaps() {
    let report = Report::of(
        "model = \"two-loose-gears\"\n[[axis]]\nparameter = \"omega\"\nmin = 150\nmax = 230\ncount = 3\n[[axis]]\nparameter = \"e\"\n\
         min = 0.3\nmax = 0.7\ncount = 2\n[outputs]\nquantities = [\"class\", \"word\"]\nfiles = [\"html\"]\n",
    );
    let letters = "in words, the letter before a symbol is that of its gap: a = a, b = b";
    assert_eq!(report.data()["letters"], letters);
    let Some(mut page) = Browser::open(&report.file("report.html")) else { return };
    let shown = page.value("showLayer(1); [document.getElementById('letters'), document.querySelector('#legend .beyond')].map((note) => note.textContent)");
    assert_eq!(shown, json!([letters, letters]));
    page.until("document.getElementById('sketch').naturalWidth > 200");
}

/// Presses keys without a pointer, then follows the link to the page.
const KEYS: &str = r#"pointerCell = null;
  const press = (key) => canvas.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  view = { left: 3, bottom: 2, width: 6, height: 5 };
  choose(null);
  press("ArrowUp");
  said.first = fact("cell");
  for (let n = 0; n < 5; n++) press("ArrowRight");
  said.last = fact("cell");
  said.view = [view.left, view.width];
  showLayer(2);
  said.link = location.hash;
  showAll();
  showLayer(0);
  choose(null);
  location.hash = said.link;
  readAddress();
  said.again = [location.hash, map.layers[layer].name, fact("cell"), view.left, view.width];"#;

#[test]
fn arrow_keys_choose_a_first_cell_and_the_link_has_layer_cell_and_view() {
    let Some(said) = Report::new().visited(KEYS) else { return };
    // The first key chooses the cell in the middle of the view, and the view follows the cell.
    assert_eq!((&said["first"], &said["last"]), (&json!("6, 4"), &json!("11, 4")));
    assert_eq!(said["view"], json!([6, 6]));
    let link = "#v=1&layer=impacts&cell=11,4&view=6,2,6,5";
    assert_eq!(said["link"], link);
    assert_eq!(said["again"], json!([link, "impacts", "11, 4", 6, 6]));
}

/// Shows a part of the layer of impacts and collects the ends of its colours and the numbers of its cells.
const COLORS: &str = r#"showLayer(map.layers.findIndex(({ name }) => name === "impacts"));
  const shown = () => {
    fitColors();
    showScene();
    const { range, values: numbers, bar } = map.layers[layer];
    const cells = [2, 3, 4, 5].flatMap((j) => [14, 15, 16, 17].map((i) => numbers[j * columns + i]));
    return { range, full: [bar.low, bar.high], least: Math.min(...cells), most: Math.max(...cells),
      levels: [range[0], range[1]].map(levels(map.layers[layer])) };
  };
  showAll();
  said.all = shown();
  view = { left: 14, bottom: 2, width: 4, height: 4 };
  said.part = shown();
  said.scene = text("scene");
  said.compute = text("compute");
  spansMap = true;
  said.whole = shown();"#;

#[test]
fn colors_fit_the_view_and_its_scene_computes_it() {
    let report = impacts_alone();
    let Some(said) = report.visited(&COLORS.replace("said.all =", "said.complete =")) else { return };
    let (complete, part, whole) = (&said["complete"], &said["part"], &said["whole"]);
    assert_eq!(complete["range"], complete["full"]);
    assert_eq!((&part["range"][0], &part["range"][1]), (&part["least"], &part["most"]));
    assert!(part["range"][1].as_f64().unwrap() < part["full"][1].as_f64().unwrap(), "{part}");
    assert_eq!(part["levels"], json!([0, 254]), "the view uses all colours");
    assert_eq!(whole["range"], whole["full"]);
    // The scene has the argument, the other settings, and the visible part at full resolution.
    let folder = report.folder.path().join("o");
    fs::write(folder.join("view.toml"), said["scene"].as_str().unwrap()).unwrap();
    let compute = said["compute"].as_str().unwrap();
    assert_eq!(compute, "rattlemap map view.toml --engine cpu");
    let arguments = compute.split(' ').skip(1).chain(["--quiet", "--out", "view"]);
    Cargo::cargo_bin("rattlemap").unwrap().current_dir(&folder).args(arguments).assert().success();
    let manifest: Value =
        serde_json::from_slice(&fs::read(folder.join("view/manifest.json")).unwrap()).unwrap();
    let table = report.table();
    for (k, [first, last], count) in [(0, [14, 17], COLUMNS), (1, [2 * COLUMNS, 5 * COLUMNS], ROWS)] {
        let axis = &manifest["axes"][k];
        let ends = [first, last].map(|id| table[id][2 + k].parse::<f64>().unwrap());
        assert_eq!(
            (&axis["min"], &axis["max"], &axis["count"]),
            (&json!(ends[0]), &json!(ends[1]), &json!(count))
        );
    }
    assert_eq!(manifest["quantities"], json!(["class", "impacts"]));
    assert_eq!(manifest["parameters"]["F"], json!(45.0));
    assert_eq!(manifest["start"]["state"], json!([0.1, 0.0, -0.25, 1.0]));
}

/// The whole view as a scene gives the same map.
#[test]
fn the_scene_of_a_whole_map_gives_equal_records() {
    let report = Report::of(
        "[derived]\nk2 = \"2/3*k1\"\n[parameters]\ne = 0.5\n[[axis]]\nparameter = \"k1\"\nmin = 10\nmax = 1000\ncount = 24\n\
         scale = \"log\"\n[[axis]]\nparameter = \"F\"\nvalues = [2, 3, 5.5, 9]\n[outputs]\nfiles = [\"csv\", \"html\"]\n",
    );
    let Some(said) = report.visited("showAll(); showScene(); said.scene = text(\"scene\");") else { return };
    fs::write(report.folder.path().join("s.toml"), said["scene"].as_str().unwrap()).unwrap();
    let before = report.table();
    report.run(&["map", "s.toml", "--quiet", "--out", "o", "--force"]);
    assert_eq!(report.table(), before);
}

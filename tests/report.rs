//! The report in a real browser: it unpacks, zooms, reads out, switches layers and replays.
//!
//! Needs Chromium; where there is none the test says so and checks the text alone.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use assert_cmd::Command as Cargo;

const SCENE: &str = r#"title = "Evil </script><b>title</b> & more"

[parameters]
F = 45.0

[[axis]]
parameter = "e"
min = 0.0
max = 1.0
count = 24

[[axis]]
parameter = "omega"
min = 2.0
max = 11.0
count = 19

[start]
policy = "state"
state = [0.1, 0, -0.25, 1]

[outputs]
quantities = ["class", "lyapunov", "impacts", "mesh", "symmetric", "word"]
files = ["csv", "html"]
"#;

/// Does what a reader does and writes down what the page then says.
const VISIT: &str = r##"<script>
const said = {};
const text = (id) => document.getElementById(id).textContent;
const fact = (name) => [...document.querySelectorAll("#readout tr")]
  .find((row) => row.cells[0].textContent === name)?.cells[1].textContent;
function point(type, x, y) {
  const at = canvas.getBoundingClientRect();
  canvas.dispatchEvent(new PointerEvent(type, { pointerId: 1, clientX: at.left + x, clientY: at.top + y, bubbles: true }));
}
canvas.setPointerCapture = () => {};
function visit() {
  if (document.getElementById("wait")) return setTimeout(visit, 20);
  said.title = text("title");
  said.layers = [...document.querySelectorAll("#layers button")].map((button) => button.textContent);
  const [x, y] = pixel(6.5, 8.5);
  point("pointermove", x, y);
  said.hovered = ["cell", "e", "omega", "class", "exponent", "word", "periods run"].map(fact);
  point("pointerdown", x, y);
  point("pointerup", x, y);
  said.command = text("command");
  canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -600, clientX: canvas.getBoundingClientRect().left + x,
    clientY: canvas.getBoundingClientRect().top + y, cancelable: true }));
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
  document.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
  said.moved = fact("cell");
  showAll();
  said.all = view.width === columns && view.left === 0;
  const drawn = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  said.colors = new Set(new Uint32Array(drawn.buffer)).size;
  const result = document.createElement("pre");
  result.id = "said";
  result.textContent = btoa(JSON.stringify(said));
  document.body.append(result);
}
visit();
</script></body>"##;

fn chromium() -> Option<&'static str> {
    ["chromium", "chromium-browser", "google-chrome"].into_iter().find(|name| {
        let version =
            Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        version.is_ok_and(|status| status.success())
    })
}

/// The page's own account of a visit.
fn visit(browser: &str, page: &Path) -> serde_json::Value {
    let url = format!("file://{}", page.display());
    let run = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--window-size=1300,850"])
        .args(["--virtual-time-budget=10000", "--dump-dom", &url])
        .stderr(Stdio::null())
        .output()
        .unwrap();
    let dom = String::from_utf8(run.stdout).unwrap();
    let said = dom.split_once("<pre id=\"said\">").and_then(|(_, rest)| rest.split_once("</pre>"));
    let (said, _) = said.unwrap_or_else(|| panic!("the visit did not come to its end: {dom:.2000}"));
    use base64::Engine;
    let json = base64::engine::general_purpose::STANDARD.decode(said).unwrap();
    serde_json::from_slice(&json).unwrap()
}

#[test]
fn the_report_is_one_page_that_works() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), SCENE).unwrap();
    Cargo::cargo_bin("rattlemap")
        .unwrap()
        .current_dir(folder.path())
        .args(["map", "s.toml", "--quiet", "--out", "o"])
        .assert()
        .success();
    let out = folder.path().join("o");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("src="), "not alone");
    assert_eq!(page.matches("</script>").count(), 2, "the title got out of its script");
    let Some(browser) = chromium() else {
        println!("skipped: no Chromium to open the report with");
        return;
    };
    let visited = out.join("visited.html");
    fs::write(&visited, page.replace("</body>", VISIT)).unwrap();
    let said = visit(browser, &visited);
    let table = fs::read_to_string(out.join("cells.csv")).unwrap();
    let row: Vec<&str> = table.lines().nth(1 + 8 * 24 + 6).unwrap().split(',').collect();
    assert_eq!(said["title"], "Evil </script><b>title</b> & more");
    assert_eq!(
        said["layers"],
        serde_json::json!(["period and chaos", "exponent", "impacts", "meshing", "word"])
    );
    assert_eq!((row[0], row[1]), ("6", "8"));
    let hovered: Vec<&str> = said["hovered"].as_array().unwrap().iter().filter_map(|v| v.as_str()).collect();
    assert_eq!((hovered[0], hovered[1], hovered[2]), ("6, 8", row[2], row[3].trim_end_matches(".0")));
    assert_eq!((hovered[3], hovered[5], hovered[6]), (&*format!("period {}", row[5]), row[11], row[13]));
    let (shown, exact): (f64, f64) = (hovered[4].parse().unwrap(), row[6].parse().unwrap());
    assert!((shown - exact).abs() < 1e-4 * exact.abs(), "{shown} {exact}");
    let command = format!("rattlemap orbit --set e={} --set omega={}", row[2], row[3].trim_end_matches(".0"));
    assert_eq!(said["command"], command + " --set F=45.0 --start 0.1,0.0,-0.25,1.0");
    for fact in ["zoomed", "panned", "all"] {
        assert_eq!(said[fact], true, "{fact}: {said}");
    }
    assert_eq!((&said["stays"], &said["moved"]), (&"6, 8".into(), &"7, 8".into()));
    assert_eq!(said["legend"], "largest Lyapunov exponent");
    assert!(said["colors"].as_u64().unwrap() > 20, "{said}");
    replay(said["command"].as_str().unwrap(), &row);
    validated(browser, folder.path(), &out);
}

/// Once the map has been validated, the page says so and works as before.
fn validated(browser: &str, folder: &Path, out: &Path) {
    let validate = ["validate", "o", "--samples", "60", "--quiet"];
    Cargo::cargo_bin("rattlemap").unwrap().current_dir(folder).args(validate).assert().success();
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(page.matches("</script>").count(), 2, "the validation got out of its script");
    let visited = out.join("visited.html");
    let read = "said.validation = text(\"validation\"); said.verdict = text(\"verdict\"); const result";
    fs::write(&visited, page.replace("</body>", &VISIT.replacen("const result", read, 1))).unwrap();
    let said = visit(browser, &visited);
    assert_eq!(said["verdict"], "60 cells replayed on the reference: all agree.");
    let section = said["validation"].as_str().unwrap();
    for part in [
        "60 of 60 replayed cells agree with the reference; none differs.",
        "at a border of classes",
        "seed 1",
    ] {
        assert!(section.contains(part), "{part}: {section}");
    }
    assert_eq!((&said["stays"], &said["zoomed"]), (&"6, 8".into(), &true.into()));
}

/// The command that the page shows gives the cell's class and word.
fn replay(command: &str, row: &[&str]) {
    let run = Cargo::cargo_bin("rattlemap").unwrap().args(command.split(' ').skip(1)).arg("--json").assert();
    let orbit: serde_json::Value = serde_json::from_slice(&run.success().get_output().stdout).unwrap();
    assert_eq!((&orbit["class"], &orbit["word"]), (&row[4].into(), &row[11].into()));
    assert_eq!(orbit["period"].to_string(), row[5]);
}

/// Looks at a filled cell and at an integrated one.
const LOOK: &str = r##"<script>
function look() {
  if (document.getElementById("wait")) return setTimeout(look, 20);
  const said = {};
  for (const [code, name] of map.sources.entries()) {
    const id = values.source.findIndex((source, id) => source === code && map.classes[values.class[id]] === "chaotic");
    choose({ i: id % columns, j: Math.floor(id / columns) });
    said[name] = Object.fromEntries([...document.querySelectorAll("#readout tr")]
      .map((row) => [...row.cells].map((cell) => cell.textContent)));
  }
  const result = document.createElement("pre");
  result.id = "said";
  result.textContent = btoa(unescape(encodeURIComponent(JSON.stringify(said))));
  document.body.append(result);
}
look();
</script></body>"##;

#[test]
fn filled_cells_say_so() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), SCENE).unwrap();
    let run = |arguments: &[&str]| {
        let arguments = [&["map", "s.toml", "--engine", "cpu", "--quiet"], arguments].concat();
        Cargo::cargo_bin("rattlemap").unwrap().current_dir(folder.path()).args(arguments).assert().success();
        fs::read_to_string(folder.path().join("out/s/report.html")).unwrap()
    };
    // Every cell of this one is integrated, and the page need not say so.
    assert!(!run(&[]).contains("\"source\":{"));
    let sets = [
        "axis.0.count=81",
        "axis.1.count=65",
        "refine.minimum_grid=8",
        "refine.max_error=0.05",
        "refine.rounds=2",
    ];
    let page = run(&[&["--force"], &sets.map(|set| ["--set", set]).concat()[..]].concat());
    assert!(page.contains("\"source\":{"));
    let Some(browser) = chromium() else {
        println!("skipped: no Chromium to open the report with");
        return;
    };
    let visited = folder.path().join("visited.html");
    fs::write(&visited, page.replace("</body>", LOOK)).unwrap();
    let said = visit(browser, &visited);
    let (filled, integrated) = (&said["filled"], &said["integrated"]);
    assert_eq!((&filled["source"], &filled["periods run"]), (&"filled".into(), &"0".into()), "{said}");
    assert_eq!(integrated["source"], "integrated", "{said}");
    for name in ["exponent", "impacts per period", "meshing"] {
        let text = |cell: &serde_json::Value| cell[name].as_str().unwrap().to_owned();
        assert!(text(filled).ends_with(", interpolated"), "{said}");
        assert!(!text(integrated).contains("interpolated"), "{said}");
        assert!(!text(filled).contains('\u{b1}'), "{said}");
    }
    assert!(integrated["exponent"].as_str().unwrap().contains('\u{b1}'), "{said}");
}

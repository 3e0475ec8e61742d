//! A walk through a page in a browser: the page computes the same cells as the program. Skipped without Chromium, with a message
//! on stderr. With the environment variable `RECORD_PAGE`, the walk writes the pictures in results/page.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use assert_cmd::Command;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;
use tempfile::TempDir;

use crate::report::page::{WITHOUT_GRAPHICS, chromium, skipped, unbroken, visit, with_script};

/// Zooms to a pitchfork, clicks on both sides of it, moves the slider of F, and opens the link to what is shown.
const WALK: &str = r##"
async function walk() {
  await until(() => !document.getElementById("wait"));
  said.opened = text("title");
  const [e, omega] = map.axes;
  const at = ({ min, max, count }, value) => 0.5 + ((value - min) / (max - min)) * (count - 1);
  const [left, bottom] = [at(e, 0.5), at(omega, 5.4)];
  showView({ left, bottom, width: at(e, 0.6) - left, height: at(omega, 5.8) - bottom });
  await until(isComputed);
  clearTimeout(resting);
  sayWindow();
  await until(() => !asked.some((request) => request));
  said.ticks = map.axes.map(({ ticks }) => ticks.marks.map(([, label]) => label));
  const sheet = live;
  // Cells of the middle row, far from the pitchfork on both sides.
  const sides = [8, 56].map((part) => Math.floor(sheet.rows / 2) * sheet.columns + Math.floor((part / 65) * sheet.columns));
  said.sides = [];
  said.links = [];
  for (const id of sides) {
    choose({ sheet, i: id % sheet.columns, j: Math.floor(id / sheet.columns) });
    await motion();
    said.sides.push([text("command"), text("summary")]);
    said.links.push(location.hash);
  }
  document.getElementById("parameters").open = true;
  const slider = [...document.querySelectorAll("#sliders label")].find((row) => row.firstChild.textContent === "F").children[1];
  slider.value = 47;
  slider.dispatchEvent(new Event("input"));
  await until(() => live.data.fixed.includes("F = 47") && isComputed());
  await motion();
  said.fixed = text("fixed");
  said.command = text("command");
  said.link = location.hash;
  document.getElementById("restore").click();
  showAll();
  choose(null);
  await until(() => text("fixed").includes("F = 50"));
  location.hash = said.link;
  readAddress();
  await until(() => live && live.data.fixed.includes("F = 47") && isComputed() && selectedCell);
  said.again = [location.hash, text("command")];
  finish();
}
walk().catch((error) => { said.error = String(error.stack); finish(); });
"##;

/// Keeps records of a finer picture back, looks at a cell without a record, and lets the records arrive.
const PARTIAL: &str = r##"
const lines = () => ["\u03c9", "class", "exponent", "periods run"].map(fact);
async function partial() {
  await until(() => !document.getElementById("wait"));
  const [give, held] = [receive, []];
  let isBegun = false;
  receive = (member, answer) => {
    if (!answer.records || job?.level !== 2 || job.view.width !== 24) give(member, answer);
    else if (isBegun) held.push([member, answer]);
    else {
      isBegun = true;
      job.redrawn = -Infinity;
      give(member, answer);
    }
  };
  showView({ left: 20, bottom: 10, width: 24, height: 24 });
  await until(() => live?.pending && held.length);
  const [known, missing] = [0, 1].map((flag) => live.pending.lastIndexOf(flag));
  const picture = layerOf(live).picture.getContext("2d").getImageData(0, 0, live.columns, live.rows).data;
  const color = (id) => [...picture].slice(4 * ((live.rows - 1 - Math.floor(id / live.columns)) * live.columns + (id % live.columns))).slice(0, 3);
  const layerColors = layerOf(live);
  said.colors = [known, missing].map((id) => [color(id), parseInt(layerColors.palette[layerColors.indices[id]], 16)]);
  const cell = (sheet, id) => ({ sheet, i: id % sheet.columns, j: Math.floor(id / sheet.columns) });
  choose(cell(live, missing));
  said.selected = lines();
  const [u, v] = centreOf(selectedCell);
  choose(null);
  hover(pixel(u, v));
  said.hovered = lines();
  choose(cell(live, missing));
  hover(null);
  pause();
  said.paused = [text("live"), text("stop")];
  receive = give;
  document.getElementById("stop").click();
  await until(() => selectedCell.sheet.isWhole);
  const { sheet } = selectedCell;
  const id = selectedCell.j * sheet.columns + selectedCell.i;
  said.renewed = lines();
  said.own = [map.classes[sheet.values.class[id]], String(sheet.values.periods_run[id])];
  newWorker(await compiled(), ({ labels }) => { said.labels = [map.classes[labels[0]], labels[1]]; }, () => {})
    .postMessage({ task: "labels", key: "again", scene: sceneOver(map.scene, sheet.ranges), model: map.model_file, sets: "", runs: Uint32Array.of(id) });
  await until(() => said.labels);
  finish();
}
partial().catch((error) => { said.error = String(error.stack); finish(); });
"##;

/// Changes what the map says of a cell, and selects it; then zooms, goes back, uses keys, plays a slider, and saves pictures.
const TOOLS: &str = r##"
async function tools() {
  const byName = (id) => document.getElementById(id);
  await until(() => !byName("wait"));
  const id = base.values.period.findIndex((period, id) => period === 1 && id > 2000);
  const [i, j] = [id % columns, Math.floor(id / columns)];
  choose({ i, j });
  await motion();
  said.same = text("differs");
  base.values.period[id] = 3;
  choose({ i, j });
  await motion();
  said.differs = text("differs");
  base.values.period[id] = 1;
  const settle = async (width) => until(() => Math.abs(view.width - width) < 1 && location.hash.includes("view=") === width < 60);
  showView({ left: 10, bottom: 10, width: 30, height: 30 });
  await settle(30);
  byName("back").click();
  await settle(65);
  said.back = [view.width, byName("back").disabled];
  const press = (target, key) => target.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  press(byName("home"), "ArrowRight");
  said.elsewhere = selectedCell.i - i;
  press(canvas, "ArrowRight");
  said.canvas = centreOf(selectedCell)[0] - i - 0.5;
  said.spoken = text("spoken");
  press(byName("layers"), "ArrowRight");
  said.layer = [layer, document.activeElement.textContent];
  showLayer(0);
  const row = [...document.querySelectorAll("#sliders label")].find(({ firstChild }) => firstChild.textContent === "F");
  row.children[3].click();
  await until(() => changes.F > 52.5);
  row.children[3].click();
  document.getElementById("restore").click();
  await until(() => job?.ended === job?.total && !byName("save-svg").hidden);
  const files = [];
  save = (blob, name) => files.push([blob, name]);
  const white = async (blob) => {
    const image = await createImageBitmap(blob);
    const brush = Object.assign(element("canvas"), { width: image.width, height: image.height }).getContext("2d");
    brush.drawImage(image, 0, 0);
    return [image.width > 600, ...brush.getImageData(1, 1, 1, 1).data];
  };
  byName("save-png").click();
  await until(() => files.length);
  titledPicture().toBlob((blob) => save(blob, "canvas"));
  await until(() => files.length > 1);
  said.files = [files[0][1], await white(files[0][0]), await white(files[1][0])];
  finish();
}
tools().catch((error) => { said.error = String(error.stack); finish(); });
"##;

/// Waits for the shaders, and computes a part of the map with lanes.
const LANES: &str = r##"
async function computeOnLanes() {
  await until(() => !document.getElementById("wait"));
  await until(() => triedLanes && (!lanes || lanes.isReady));
  said.has_lanes = lanes !== null;
  if (lanes) {
    showView({ left: 8, bottom: 8, width: 12, height: 12 });
    // While the shaders were compiled, the other workers may have computed the whole map, which covers the view.
    await until(() => live?.isWhole && live.columns >= 33 && live.made.width === view.width);
    clearTimeout(resting);
    said.by_lanes = job.by_lanes;
    sayWindow();
  }
  finish();
}
computeOnLanes().catch((error) => { said.error = String(error.stack); finish(); });
"##;

/// Computes 33 x 33 cells of the map in a worker.
const RECORDS: &str = r##"
async function records() {
  await until(() => !document.getElementById("wait"));
  said.scene = sceneOver(map.scene, map.axes.map(({ min, max }) => ({ min, max, count: 33 })));
  newWorker(await compiled(), ({ records, error }) => {
    said.error = error;
    said.records = records && btoa([...records].map((byte) => String.fromCharCode(byte)).join(""));
    finish();
  }, (error) => { said.error = error; finish(); }).postMessage({ task: "compute", key: "all", scene: said.scene,
    model: map.model_file, sets: "", runs: Uint32Array.from({ length: 33 * 33 }, (_, run) => run) });
  await until(() => document.getElementById("said"));
}
records().catch((error) => { said.error = String(error.stack); finish(); });
"##;

/// Flags of a browser that offers a device without hardware.
const SOFTWARE_DEVICE: [&str; 2] = ["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"];

/// Returns what a script collects in a page.
fn visited(browser: &str, page: &Path, script: &str, query: &str, flags: &[&str]) -> Value {
    let said = visit(browser, &with_script(page, script), query, flags, 400_000);
    assert_eq!(said["error"], Value::Null, "{said}");
    said
}

fn side_link(said: &Value, side: usize) -> &str {
    said["links"][side].as_str().unwrap()
}

/// Writes results/page/NAME.png: what the page shows for a link, when all its cells are computed.
fn photograph(browser: &str, page: &Path, name: &str, link: &str) {
    let script = "until(() => /computed in this page/.test(text(\"live\")) && (!selectedCell || \
                  !text(\"computing\").includes(\"computing\")));";
    let copy = with_script(page, script);
    let picture = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("results/page/{name}.png"));
    let status = std::process::Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--window-size=1400,900"])
        .args(["--virtual-time-budget=400000", &format!("--screenshot={}", picture.display())])
        .arg(format!("file://{}{link}", copy.display()))
        .stderr(std::process::Stdio::null())
        .status();
    assert!(status.unwrap().success(), "{name}");
}

fn rattlemap(folder: &TempDir) -> Command {
    let mut program = Command::cargo_bin("rattlemap").unwrap();
    program.current_dir(folder.path());
    program
}

/// Writes the page of a scene of this repository. The arguments are the scene's name and options.
pub(crate) fn explored(folder: &TempDir, arguments: &[&str]) -> PathBuf {
    rattlemap(folder)
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes"))
        .args(["explore", "--no-open", "--quiet", "--out"])
        .arg(folder.path().join("page.html"))
        .args(arguments)
        .assert()
        .success();
    folder.path().join("page.html")
}

/// Requires that the program computes the same classes and periods for the scene of a page's window, but for a share of cells.
fn assert_same_map(folder: &TempDir, said: &Value, engine: &[&str], share: f64) {
    fs::write(folder.path().join("view.toml"), said["scene"].as_str().unwrap()).unwrap();
    rattlemap(folder)
        .args(["map", "view.toml", "--quiet", "--out", "view", "--set", "outputs.files=[\"csv\"]"])
        .args(engine)
        .assert()
        .success();
    let mut reader = csv::Reader::from_path(folder.path().join("view/cells.csv")).unwrap();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len() as u64, said["counts"][0].as_u64().unwrap() * said["counts"][1].as_u64().unwrap());
    let differs = |(id, row): &(usize, &csv::StringRecord)| {
        let period = said["periods"][*id].to_string();
        row[4] != *said["classes"][*id].as_str().unwrap() || (!row[5].is_empty() && row[5] != period)
    };
    let differing = rows.iter().enumerate().filter(differs).count();
    assert!(differing as f64 <= share * rows.len() as f64, "{differing} of {}", rows.len());
}

#[test]
fn a_walk_through_the_page_shows_what_the_program_computes() {
    let Some(browser) = chromium() else { return skipped() };
    let folder = tempfile::tempdir().unwrap();
    let said = visited(browser, &explored(&folder, &["e_omega.toml"]), WALK, "", &WITHOUT_GRAPHICS);
    // The worker has chosen ticks for the view.
    for (axis, label) in [(0, "0.56"), (1, "5.60")] {
        let labels = said["ticks"][axis].as_array().unwrap();
        assert!(labels.len() >= 4 && labels.contains(&label.into()), "{labels:?}");
    }
    // The program uses FMA, the browser does not: cells with long transients may differ.
    assert_same_map(&folder, &said, &["--engine", "cpu"], 0.005);
    for side in said["sides"].as_array().unwrap() {
        let [command, summary] = [0, 1].map(|k| side[k].as_str().unwrap());
        let printed = rattlemap(&folder).args(command.split(' ').skip(1)).output().unwrap();
        let first = |text: &str| text.lines().take(4).map(str::to_owned).collect::<Vec<_>>();
        let printed = unbroken(&String::from_utf8(printed.stdout).unwrap());
        assert_eq!(first(summary), first(&printed), "{command}");
    }
    let symmetric = [0, 1]
        .map(|k| said["sides"][k][1].as_str().unwrap().lines().find(|line| line.starts_with("symmetric")));
    assert_ne!(symmetric[0], symmetric[1], "{said}");
    let command = said["command"].as_str().unwrap();
    assert!(command.contains(" --set F=47.0"), "{command}");
    assert_eq!(said["again"], serde_json::json!([said["link"], command]));
    if std::env::var_os("RECORD_PAGE").is_some() {
        let page = folder.path().join("page.html");
        let pictures = [("map", ""), ("pitchfork", side_link(&said, 0)), ("other_side", side_link(&said, 1))];
        for (name, link) in pictures.into_iter().chain([("slider", said["link"].as_str().unwrap())]) {
            photograph(browser, &page, name, link);
        }
    }
}

#[test]
fn cells_without_a_record_are_pale_and_show_no_numbers_until_it_arrives() {
    let Some(browser) = chromium() else { return skipped() };
    let folder = tempfile::tempdir().unwrap();
    let said = visited(browser, &explored(&folder, &["e_omega.toml"]), PARTIAL, "", &WITHOUT_GRAPHICS);
    let nothing = "\u{2013}";
    for shown in ["selected", "hovered"] {
        assert_eq!(
            said[shown].as_array().unwrap()[1..],
            ["being computed", nothing, nothing],
            "{shown}: {said}"
        );
    }
    for (nth, depth) in [(0, 1.0), (1, 0.4)] {
        let full = said["colors"][nth][1].as_u64().unwrap();
        for (channel, shift) in [16, 8, 0].into_iter().enumerate() {
            let expected = 255.0 - depth * (255 - (full >> shift & 255)) as f64;
            assert_eq!(said["colors"][nth][0][channel], expected.round() as u64, "{said}");
        }
    }
    let [live, button] = [0, 1].map(|k| said["paused"][k].as_str().unwrap());
    assert!(live.starts_with("stopped: ") && live.ends_with(" cells of this picture are left"), "{said}");
    assert_eq!(button, "Continue");
    let (renewed, class) = (&said["renewed"], said["labels"][0].as_str().unwrap());
    assert_eq!(renewed[0], said["selected"][0], "the selection moved: {said}");
    let period = format!("period {}", said["labels"][1]);
    let expected = if class == "periodic" { &period } else { class };
    assert!(renewed[1].as_str().unwrap().starts_with(expected), "{said}");
    assert_eq!((&said["own"][0], &said["own"][1]), (&class.into(), &renewed[3]));
}

#[test]
fn the_page_compares_goes_back_plays_and_saves() {
    let Some(browser) = chromium() else { return skipped() };
    let folder = tempfile::tempdir().unwrap();
    let page = explored(&folder, &["e_omega.toml"]);
    let said = visited(browser, &page, TOOLS, "", &["--disable-gpu", "--force-dark-mode"]);
    assert_eq!(said["same"], "");
    assert_eq!(
        said["differs"],
        "The map: period 3, which the program gives; from the same start this page reaches period 1, a coexisting motion."
    );
    assert_eq!(said["back"], serde_json::json!([65, true]));
    assert_eq!((&said["elsewhere"], &said["canvas"]), (&0.into(), &1.into()));
    let spoken = said["spoken"].as_str().unwrap();
    assert!(spoken.starts_with("e 0.") && spoken.contains(", class "), "{spoken}");
    assert_eq!(said["layer"], serde_json::json!([1, "exponent"]));
    let white = serde_json::json!([true, 255, 255, 255, 255]);
    assert_eq!(said["files"], serde_json::json!(["map.png", white, white]));
}

/// The browser's own software device computes the page's shaders.
#[test]
#[ignore = "compiles shaders in a browser; scripts/test.sh --all"]
fn lanes_of_the_page_are_those_of_the_program() {
    let Some(browser) = chromium() else { return skipped() };
    let folder = tempfile::tempdir().unwrap();
    let page = explored(&folder, &["e_omega.toml", "--set", "outputs.quantities=[\"class\"]"]);
    let said = visited(browser, &page, LANES, "?lanes=software", &SOFTWARE_DEVICE);
    assert_eq!(said["has_lanes"], true, "{said}");
    assert_eq!(said["by_lanes"], 33 * 33);
    assert_same_map(&folder, &said, &["--engine", "gpu", "--precision", "f32"], 0.005);
}

/// Without fused multiplication and addition, and with the same mathematical functions, the program computes the page's records.
#[test]
#[ignore = "compiles the library again, without FMA; takes minutes"]
fn records_of_the_page_have_the_bits_of_a_program_without_fma() {
    let Some(browser) = chromium() else { return skipped() };
    for scene in ["e_omega.toml", "gallery/soft_impact.toml", "gallery/two_masses.toml"] {
        let folder = tempfile::tempdir().unwrap();
        let said = visited(browser, &explored(&folder, &[scene]), RECORDS, "", &WITHOUT_GRAPHICS);
        let page = STANDARD.decode(said["records"].as_str().unwrap()).unwrap();
        let example = "run --quiet --package rattlemap-web --example records --target-dir target/no-fma";
        let program = Command::new(env!("CARGO"))
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .args(example.split(' '))
            .env("RUSTFLAGS", "")
            .write_stdin(said["scene"].as_str().unwrap())
            .timeout(Duration::from_secs(900))
            .output()
            .unwrap();
        assert!(program.status.success(), "{}", String::from_utf8_lossy(&program.stderr));
        let size = page.len() / (33 * 33);
        let differing = page.chunks(size).zip(program.stdout.chunks(size)).filter(|(a, b)| a != b).count();
        assert_eq!((page.len(), differing), (program.stdout.len(), 0), "{scene}");
    }
}

"use strict";
const map = JSON.parse(document.getElementById("map").textContent);
const [columns, rows] = map.axes.map((axis) => axis.count);
const byId = (id) => document.getElementById(id);
const canvas = byId("canvas");
const pen = canvas.getContext("2d");
const MARGIN = { left: 78, right: 28, top: 10, bottom: 58 };

let values = {};
// Start states of cells that follow their neighbours: four numbers per cell.
let starts = null;
let layer = 0;
// The visible part of the map, in cells: its lower left corner and its extent.
let view = { left: 0, bottom: 0, width: columns, height: rows };
let pointerCell = null;
let selectedCell = null;

async function unpack({ data, type }) {
  const packed = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  const types = { u8: Uint8Array, i8: Int8Array, u32: Uint32Array, f32: Float32Array, f64: Float64Array };
  return new types[type](buffer);
}

// ---- axes and cells

const axisValue = ({ min, max, count, values }, i) =>
  values ? values[i] : i >= count - 1 ? max : Math.min(min + ((max - min) * i) / (count - 1), max);
// Names and values of the derived parameters in a cell. Each is stored along the axes that it depends on.
const derivedValues = ({ i, j }) => map.derived.map(({ parameter, along, values: list }) =>
  [parameter, list?.[(along[1] ? j : 0) * (along[0] ? columns : 1) + (along[0] ? i : 0)]]);
const panel = () => {
  const { width, height } = canvas.getBoundingClientRect();
  return { x: MARGIN.left, y: MARGIN.top, width: width - MARGIN.left - MARGIN.right,
    height: height - MARGIN.top - MARGIN.bottom };
};

function cellAt(x, y) {
  const p = panel();
  const i = Math.floor(view.left + ((x - p.x) / p.width) * view.width);
  const j = Math.floor(view.bottom + ((p.y + p.height - y) / p.height) * view.height);
  const inside = x >= p.x && x <= p.x + p.width && y >= p.y && y <= p.y + p.height;
  return inside && i >= 0 && i < columns && j >= 0 && j < rows ? { i, j } : null;
}

// Returns the pixel of a position in cells. Cell i spans i to i + 1.
function pixel(i, j) {
  const p = panel();
  return [p.x + ((i - view.left) / view.width) * p.width,
    p.y + p.height - ((j - view.bottom) / view.height) * p.height];
}

function ticks(low, high, most) {
  const rough = (high - low) / Math.max(most, 1);
  const decade = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * decade).find((s) => s >= rough * (1 - 1e-9));
  const digits = Math.min(12, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)));
  const list = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n++) {
    list.push([n * step, (n * step).toFixed(digits).replace(/^-(?=0\.?0*$)/, "").replace("-", "\u2212")]);
  }
  return list;
}

// Returns positions (in cells) and labels of the ticks of an axis. Cell i has its value at i + 0.5.
function marks(axis, from, extent, most) {
  const { min, max, count, scale, values } = axis;
  if (scale === "linear") {
    const step = (max - min) / (count - 1);
    const value = (place) => min + (place - 0.5) * step;
    return ticks(value(from), value(from + extent), most).map(([at, text]) => [(at - min) / step + 0.5, text]);
  }
  const label = (value) => String(Number(value.toPrecision(4))).replaceAll("-", "\u2212");
  const list = [];
  if (scale === "log") {
    const step = Math.log10(max / min) / (count - 1);
    const place = (value) => Math.log10(value / min) / step + 0.5;
    const [low, high] = [from, from + extent].map((at) => Math.log10(min) + (at - 0.5) * step);
    const parts = most / (high - low) > 4 ? [1, 2, 5] : [1];
    const every = Math.ceil((high - low) / most);
    for (let power = Math.floor(low); power <= Math.ceil(high); power++) {
      if (power % every) continue;
      for (const part of parts) {
        const at = place(part * 10 ** power);
        if (at >= from && at <= from + extent) list.push([at, label(part * 10 ** power)]);
      }
    }
    if (list.length > 1) return list;
  }
  // Listed values, or a part of a logarithmic axis without round values.
  const every = Math.max(1, Math.ceil(extent / most));
  const first = Math.max(0, Math.ceil(from - 0.5));
  const cells = [];
  for (let i = Math.ceil(first / every) * every; i < count && i + 0.5 <= from + extent; i += every) {
    cells.push([i + 0.5, label(values[i])]);
  }
  return cells;
}

// ---- drawing

function paint(layer) {
  const picture = document.createElement("canvas");
  [picture.width, picture.height] = [columns, rows];
  const brush = picture.getContext("2d");
  const image = brush.createImageData(columns, rows);
  const pixels = new Uint32Array(image.data.buffer);
  const palette = Uint32Array.from(layer.palette, (c) => {
    const rgb = parseInt(c, 16);
    return (0xff000000 | ((rgb & 0xff) << 16) | (rgb & 0xff00) | (rgb >> 16)) >>> 0;
  });
  for (let j = 0; j < rows; j++) {
    const [from, to] = [j * columns, (rows - 1 - j) * columns];
    for (let i = 0; i < columns; i++) pixels[to + i] = palette[layer.indices[from + i]];
  }
  brush.putImageData(image, 0, 0);
  return picture;
}

function draw() {
  const ratio = window.devicePixelRatio || 1;
  const { width, height } = canvas.getBoundingClientRect();
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
  }
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const p = panel();
  const current = map.layers[layer];
  if (!current.indices) return;
  current.picture ??= paint(current);
  pen.save();
  pen.beginPath();
  pen.rect(p.x, p.y, p.width, p.height);
  pen.clip();
  // Averaging cells would produce colours that represent something else.
  pen.imageSmoothingEnabled = false;
  const [x, y] = pixel(0, rows);
  const [right, bottom] = pixel(columns, 0);
  pen.drawImage(current.picture, x, y, right - x, bottom - y);
  for (const [cell, color] of [[pointerCell, "#0008"], [selectedCell, "#000"]]) if (cell) frame(cell, color);
  pen.restore();
  drawAxes(p);
}

function frame({ i, j }, color) {
  const [x, y] = pixel(i, j + 1);
  const [right, bottom] = pixel(i + 1, j);
  // The frame of a small cell is larger than the cell.
  const grow = Math.max(0, (8 - (right - x)) / 2);
  const box = [x - grow, y - grow, right - x + 2 * grow, bottom - y + 2 * grow];
  pen.lineWidth = 3.5;
  pen.strokeStyle = "#fff";
  pen.strokeRect(...box);
  pen.lineWidth = 1.5;
  pen.strokeStyle = color;
  pen.strokeRect(...box);
}

function drawAxes(p) {
  pen.strokeStyle = pen.fillStyle = "#262626";
  pen.lineWidth = 1;
  pen.strokeRect(p.x + 0.5, p.y + 0.5, p.width - 1, p.height - 1);
  pen.font = "13px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "top";
  for (const [place, text] of marks(map.axes[0], view.left, view.width, p.width / 90)) {
    const [x] = pixel(place, 0);
    pen.fillRect(Math.round(x), p.y + p.height, 1, 6);
    // The last label must not exceed the edge.
    const half = pen.measureText(text).width / 2;
    pen.fillText(text, Math.min(x, p.x + p.width + MARGIN.right - half), p.y + p.height + 9);
  }
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (const [place, text] of marks(map.axes[1], view.bottom, view.height, p.height / 55)) {
    const [, y] = pixel(0, place);
    pen.fillRect(p.x - 6, Math.round(y), 6, 1);
    pen.fillText(text, p.x - 9, y);
  }
  pen.font = "14px system-ui, sans-serif";
  pen.textAlign = "center";
  // A parameter without a description has its name as meaning.
  const name = ({ parameter, meaning, symbol }) => (meaning === parameter ? symbol : `${meaning}, ${symbol}`);
  pen.fillText(name(map.axes[0]), p.x + p.width / 2, p.y + p.height + 44, p.width + 60);
  pen.save();
  pen.translate(14, p.y + p.height / 2);
  pen.rotate(-Math.PI / 2);
  pen.fillText(name(map.axes[1]), 0, 0, p.height + 40);
  pen.restore();
}

// ---- the panel beside the map

const element = (tag, text, className) => {
  const node = document.createElement(tag);
  if (text !== undefined) node.append(text);
  if (className) node.className = className;
  return node;
};

function facts({ i, j }) {
  const id = j * columns + i;
  const at = (name) => values[name]?.[id];
  const number = (name) => {
    const value = at(name);
    return value === undefined || Number.isNaN(value) ? undefined : Number(value.toPrecision(5)).toString();
  };
  const [a, b] = [axisValue(map.axes[0], i), axisValue(map.axes[1], j)];
  const kind = map.classes[at("class")];
  const error = number("lyapunov_error");
  const exponent = number("lyapunov");
  const symmetric = { 0: "no", 1: "yes" }[at("symmetric")];
  const [word, pattern] = [map.words?.[at("word")], map.patterns?.[at("pattern")]]
    .map((text) => (text === "" ? "no events" : text));
  const source = map.sources[at("source")];
  // The values of filled cells are not measured.
  const between = (text) => (text !== undefined && source === "filled" ? `${text}, interpolated` : text);
  return [
    [map.axes[0].symbol, a], [map.axes[1].symbol, b], ...derivedValues({ i, j }),
    ["class", kind === "periodic" ? `period ${at("period")}` : kind],
    ["exponent", between(error && exponent ? `${exponent} \u00b1 ${error}` : exponent)],
    ["impacts per period", between(number("impacts_per_period"))],
    ["meshing", between(number("mesh_fraction"))],
    ...map.numbers.map(([name, title]) => [title, between(number(name))]),
    ["symmetric", symmetric],
    ...(values.pattern ? [["pattern", pattern]] : []),
    ["word", word],
    ...(values.attractors ? [["attractors found", at("attractors")]] : []),
    ...(values.attractor ? [["attractor", map.attractors[at("attractor")]]] : []),
    ["status", map.statuses[at("status")]],
    ...(values.source ? [["source", source]] : []),
    ["periods run", at("periods_run")],
    ["cell", `${i}, ${j}`],
  ];
}

function updateReadout() {
  const cell = pointerCell ?? selectedCell;
  byId("which").textContent = !pointerCell && selectedCell ? "Selected cell" : "Under the pointer";
  const lines = facts(cell ?? { i: 0, j: 0 }).map(([name, value]) => {
    const row = element("tr");
    row.append(element("th", name), element("td", cell ? String(value ?? "\u2013") : "\u2013"));
    return row;
  });
  byId("readout").replaceChildren(...lines);
}

function choose(cell) {
  selectedCell = cell;
  byId("replay").hidden = !cell;
  if (cell) {
    const [a, b] = [axisValue(map.axes[0], cell.i), axisValue(map.axes[1], cell.j)];
    const place = 4 * (cell.j * columns + cell.i);
    const own = (map.start ?? starts?.subarray(place, place + 4))?.slice(0, map.components);
    const start = own ? ` --start ${[...own].map((x, k) => [a, b][map.axes.findIndex((axis) => axis.start === k)] ?? x).join(",")}` : "";
    const sets = map.axes.map((axis, k) => (axis.start === undefined ? ` --set ${axis.parameter}=${[a, b][k]}` : "")).join("");
    const derived = derivedValues(cell).map(([name, value]) => ` --set ${name}=${value}`).join("");
    const words = `rattlemap orbit${sets}${derived}${map.replay}${start}`.split(" --");
    // Lines break only between arguments.
    byId("command").replaceChildren(...words.flatMap((word, k) =>
      k === 0 ? [element("span", word)] : [" ", element("span", `--${word}`)]));
    history.replaceState(null, "", `#${cell.i},${cell.j},${map.layers[layer].name}`);
  }
  updateReadout();
  draw();
}

function showLayer(index) {
  layer = index;
  const current = map.layers[layer];
  [...byId("layers").children].forEach((button, k) => button.setAttribute("aria-checked", k === layer));
  byId("legend-title").textContent = current.title;
  byId("bar").replaceChildren();
  if (current.bar) {
    const ramp = element("div", undefined, "ramp");
    ramp.style.background = `linear-gradient(to right, ${current.bar.colors.map((c) => `#${c}`).join(",")})`;
    const scale = element("div", undefined, "ticks");
    const { low, high, label, left_out: leftOut } = current.bar;
    for (const [value, text] of ticks(low, high, 6)) {
      const tick = element("span", text);
      tick.style.left = `${(100 * (value - low)) / (high - low)}%`;
      scale.append(tick);
    }
    byId("bar").append(...(label === current.title ? [] : [element("div", label)]), ramp, scale,
      ...leftOut.map((text) => element("div", text, "beyond")));
  }
  byId("legend").replaceChildren(...current.entries.map(({ color, text, cells }) => {
    const patch = element("span", undefined, "patch");
    patch.style.background = `#${color}`;
    const share = (100 * cells) / (columns * rows);
    const item = element("li");
    const name = element("span", text);
    name.title = text;
    const few = cells === 1 ? "1 cell" : `${cells} cells`;
    item.append(patch, name, element("span", share < 0.1 ? few : `${share.toFixed(1)} %`));
    return item;
  }));
  draw();
}

// ---- zooming, panning, choosing

function zoom(factor, x, y) {
  const p = panel();
  const [u, v] = [(x - p.x) / p.width, (p.y + p.height - y) / p.height];
  const width = Math.min(columns, Math.max(4, view.width * factor));
  const height = Math.min(rows, Math.max(4, view.height * factor));
  view = { left: view.left + u * (view.width - width), bottom: view.bottom + v * (view.height - height), width, height };
  keepInside();
}

function keepInside() {
  view.left = Math.min(Math.max(view.left, 0), columns - view.width);
  view.bottom = Math.min(Math.max(view.bottom, 0), rows - view.height);
  draw();
}

const pointers = new Map();
let moved = 0;

canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(0.0015 * event.deltaY), event.offsetX, event.offsetY);
}, { passive: false });

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
  moved = 0;
});

canvas.addEventListener("pointermove", (event) => {
  const here = [event.offsetX, event.offsetY];
  const before = pointers.get(event.pointerId);
  if (!before) {
    pointerCell = cellAt(...here);
    updateReadout();
    draw();
    return;
  }
  const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
  pointers.set(event.pointerId, here);
  moved += Math.hypot(here[0] - before[0], here[1] - before[1]);
  if (moved < 4) return;
  canvas.classList.add("dragging");
  const p = panel();
  if (others.length === 1) {
    const apart = (at) => Math.max(Math.hypot(at[0] - others[0][0], at[1] - others[0][1]), 1);
    zoom(apart(before) / apart(here), (here[0] + others[0][0]) / 2, (here[1] + others[0][1]) / 2);
  } else {
    view.left -= ((here[0] - before[0]) / p.width) * view.width;
    view.bottom += ((here[1] - before[1]) / p.height) * view.height;
    keepInside();
  }
});

canvas.addEventListener("pointerup", (event) => {
  pointers.delete(event.pointerId);
  canvas.classList.remove("dragging");
  const cell = cellAt(event.offsetX, event.offsetY);
  if (moved < 4 && cell) choose(cell);
});
canvas.addEventListener("pointercancel", (event) => pointers.delete(event.pointerId));
canvas.addEventListener("pointerleave", () => {
  pointerCell = null;
  updateReadout();
  draw();
});

function showAll() {
  view = { left: 0, bottom: 0, width: columns, height: rows };
  draw();
}
canvas.addEventListener("dblclick", showAll);

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const p = panel();
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  const number = Number(event.key);
  if (event.key === "+" || event.key === "=") zoom(0.7, p.x + p.width / 2, p.y + p.height / 2);
  else if (event.key === "-") zoom(1 / 0.7, p.x + p.width / 2, p.y + p.height / 2);
  else if (event.key === "0") showAll();
  else if (number >= 1 && number <= map.layers.length) showLayer(number - 1);
  else if (steps[event.key] && selectedCell) {
    event.preventDefault();
    pointerCell = null;
    const [di, dj] = steps[event.key];
    choose({ i: Math.min(Math.max(selectedCell.i + di, 0), columns - 1), j: Math.min(Math.max(selectedCell.j + dj, 0), rows - 1) });
  }
});

byId("copy").addEventListener("click", async () => {
  const command = byId("command");
  try {
    await navigator.clipboard.writeText(command.textContent);
    byId("copy").textContent = "Copied";
  } catch {
    // A page opened from a disk cannot always write to the clipboard.
    getSelection().selectAllChildren(command);
    byId("copy").textContent = "Selected: press Ctrl-C";
  }
  setTimeout(() => { byId("copy").textContent = "Copy"; }, 1500);
});

// ---- adaptive maps

const percent = (rate) => `${Number((100 * rate).toPrecision(2))} %`;
const interval = (rate, [low, high]) => `${percent(rate)} (95 % interval: ${percent(low)} to ${percent(high)})`;

// Shows how many cells were integrated, and the audit of the filled cells.
function showRefinement({ integrated, filled, rounds, audits }) {
  byId("refined").hidden = false;
  const last = audits.at(-1);
  const share = (100 * integrated / (integrated + filled)).toFixed(1);
  const wrong = (some, wrong, what) => (some ? ` Of ${count(some, `filled ${what}`)} in the sample, ${wrong} were wrong.` : "");
  byId("audit").textContent = `${share} % of the cells were integrated in ${count(rounds, "round")}. `
    + "The others were filled from their neighbours. " + (last
    ? `A random sample of ${count(last.sampled, "filled cell")} was integrated; ${last.wrong} of them were wrong: `
      + `${interval(last.rate, last.interval)}.`
      + wrong(last.words, last.wrong_words, "word") + wrong(last.patterns, last.wrong_patterns, "pattern")
    : "The scene requests no audit.");
  if (last) byId("audit-errors").append(...["lyapunov", "impacts_per_period", "mesh_fraction", ...map.numbers.map(([name]) => name)]
    .filter((name) => last.errors[name])
    .map((name) => element("li", errorText(FIELDS[name] ?? new Map(map.numbers).get(name), last.errors[name]))));
  if (audits.length > 1) {
    byId("audits").append(...audits.map((audit, k) => {
      const row = element("tr");
      row.append(element("td", `audit ${k + 1}`), element("td", `${audit.wrong} of ${audit.sampled} wrong`, "number"));
      return row;
    }));
  }
}

// Describes the errors of one quantity of the sampled cells.
function errorText(name, error) {
  return `${name}: ${count(error.compared, "filled cell")} compared`
    + (error.empty ? `, ${error.empty} without a value` : "")
    + `; median error ${short(error.median)}, 95th percentile ${short(error.p95)}, largest ${short(error.worst)}`
    + (error.off_by_one_interval
      ? `; 1 or more in ${error.off_by_one}: ${interval(error.off_by_one_rate, error.off_by_one_interval)}.` : ".");
}

// ---- validation

const count = (n, one, many = `${one}s`) => `${n} ${n === 1 ? one : many}`;
const short = (value) => (typeof value === "number" ? Number(value.toPrecision(4)).toString() : String(value ?? "\u2013"));

// Returns a table with a caption. `numbers` are the indices of columns of numbers.
function table(caption, heads, lines, numbers = []) {
  const row = (tag, cells, bad) => {
    const node = element("tr", undefined, bad ? "bad" : undefined);
    node.append(...cells.map((text, k) => element(tag, text, numbers.includes(k) ? "number" : undefined)));
    return node;
  };
  const body = element("table");
  body.append(row("th", heads), ...lines.map(({ cells, bad }) => row("td", cells, bad)));
  const box = element("div");
  box.append(element("h3", caption), body);
  return box;
}

const STRATA = { uniform: "uniform sample", border: "sample at borders between classes", status: "sample by status" };
const FIELDS = { class: "class", period: "period", word: "word, up to mirror image",
  pattern: "pattern, up to mirror image", symmetric: "symmetry",
  lyapunov: "exponent", impacts_per_period: "impacts per period", mesh_fraction: "time in meshing", status: "status",
  attractor: "attractor of the start", periods_run: "periods integrated", finite: "numbers are finite", again: "record computed again" };
const JUDGES = { reference: "the event-driven reference, without early stops",
  lanes_f64: "lanes in f64 and by the reference without early stops",
  dop853: "DOP853, an adaptive ODE library, with event location, and by the reference without early stops" };

const rateText = ({ count, text }, among) => `${count} of ${among} (${text})`;

// Returns the table of the cells that differ.
function differing(found) {
  const difference = ({ field, map, judge }) => `${FIELDS[field] ?? field}: ${short(map)}, judge ${short(judge)}`;
  const parameters = map.axes.map((axis) => axis.parameter);
  const line = ({ i, j, values, differences, kind, replay }) => {
    const go = element("button", `${i}, ${j}`);
    go.type = "button";
    go.title = "show this cell on the map";
    go.addEventListener("click", () => { choose({ i, j }); scrollTo({ top: 0, behavior: "smooth" }); });
    const why = element("span", kind.replaceAll("_", " "));
    why.title = found.kinds[kind];
    return { bad: kind === "unexplained",
      cells: [go, ...parameters.map((name) => short(values[name])), differences.map(difference).join("; "), why, element("code", replay)] };
  };
  const worstFirst = [...found.mismatches].sort((a, b) => (b.kind === "unexplained") - (a.kind === "unexplained"));
  return table("Cells that differ", ["cell", ...parameters, "what differs", "kind", "replay"], worstFirst.map(line));
}

function showValidation(found) {
  const section = byId("validation");
  document.body.classList.add("validated");
  section.hidden = false;
  const [uniform] = found.strata;
  const verdict = `${rateText(uniform.differing, uniform.sampled)} ${found.counted} differ; `
    + `unexplained ${rateText(uniform.kinds.unexplained, uniform.sampled)}.`;
  byId("validated").hidden = false;
  byId("verdict").textContent = found.faults.length ? `Do not trust this map: ${found.faults.join("; ")}.` : verdict;
  byId("details").addEventListener("click", () => section.scrollIntoView({ behavior: "smooth" }));
  const tables = element("div");
  tables.id = "tables";
  const kinds = Object.keys(found.kinds);
  const strata = found.strata.filter(({ sampled }) => sampled > 0);
  tables.append(
    table("Rates, with their 95 % intervals", ["", "replayed", "in the map", "differ", ...kinds.map((kind) => kind.replaceAll("_", " "))],
      strata.map(({ name, sampled, runs, differing: all, kinds: of }) =>
        ({ cells: [STRATA[name], sampled, runs, ...[all, ...kinds.map((kind) => of[kind])].map(({ count, text }) => `${count} (${text})`)] })), [1, 2]),
    table("Agreement", ["", "compared", "agree"], Object.keys(FIELDS).filter((name) => found.agreement[name]?.compared)
      .map((name) => ({ cells: [FIELDS[name], found.agreement[name].compared, found.agreement[name].agreeing] })), [1, 2]),
    table("Kinds", ["", ""], kinds.map((kind) => ({ cells: [kind.replaceAll("_", " "), found.kinds[kind]] }))),
  );
  if (found.chaos.some(({ cells }) => cells)) {
    tables.append(table("Distributions of averages over chaos", ["", found.counted, "distance", "limit"],
      found.chaos.map(({ name, cells, distance, bar, fails }) =>
        ({ bad: fails, cells: [FIELDS[name] ?? "the exponent's error", cells, short(distance), bar ? short(bar) : "too few"] })), [1, 2, 3]));
  }
  section.append(
    element("h2", "Validation"),
    element("p", verdict, "verdict"),
    ...found.faults.map((fault) => element("p", `Do not trust this map: ${fault}.`, "verdict bad")),
    element("p", `A sample of ${found.samples} of ${found.integrated} integrated ${found.counted} (seed ${found.seed}) was judged by `
      + `${JUDGES[found.judge]}, over the full number of periods. The engine of the map is ${found.engine} in ${found.precision} on `
      + `${found.device}.` + (found.filled ? ` The other ${found.filled} were filled from their neighbours; the audit covers them.` : "")));
  if (found.computed_again) {
    section.append(element("p", `The same engine computed ${found.computed_again} of them again${
      found.same_device ? "" : ` on another device, ${found.again_on}`}: ${found.identical} are identical to the bit.`));
  }
  if (found.half_mesh_speed) {
    const { class: kinds, period, word, pattern } = found.half_mesh_speed;
    const changed = ({ changed, compared, text }) => (compared ? `${changed} of ${compared} (${text})` : "none compared");
    section.append(element("p", `Changes of meshing cells with half the mesh_speed: class ${changed(kinds)}. Changes of periodic ones: `
      + `period ${changed(period)}, word ${changed(word)}, pattern ${changed(pattern)}. They depend on the definition of the end of `
      + "bouncing, not on the motion."));
  }
  if (found.states) {
    section.append(element("p", `States of ${found.states.compared} lanes ${found.states.horizon_periods} periods after their start: `
      + `${rateText(found.states.off, found.states.compared)} differ by more than rounding explains.`));
  }
  section.append(tables);
  if (found.mismatches.length) section.append(differing(found));
}

// ---- start

async function start() {
  byId("title").textContent = map.title;
  byId("subtitle").textContent = map.subtitle;
  byId("fixed").textContent = (map.fixed ? `Other parameters: ${map.fixed}. ` : "") + (map.source ? `Model: \u201c${map.source}\u201d.` : "");
  byId("layers").append(...map.layers.map(({ short }, k) => {
    const button = element("button", short);
    button.type = "button";
    button.setAttribute("role", "radio");
    button.addEventListener("click", () => showLayer(k));
    return button;
  }));
  if (map.refinement) showRefinement(map.refinement);
  if (map.validation) showValidation(map.validation);
  const names = Object.keys(map.values);
  const unpacked = await Promise.all(names.map((name) => unpack(map.values[name])));
  values = Object.fromEntries(names.map((name, k) => [name, unpacked[k]]));
  if (map.starts) starts = await unpack(map.starts);
  for (const derived of map.derived) derived.values = await unpack(derived);
  await Promise.all(map.layers.map(async (packed) => { packed.indices = await unpack(packed); }));
  byId("wait").remove();
  // A link may name a cell and a layer.
  const [i, j, name] = location.hash.slice(1).split(",");
  showLayer(Math.max(map.layers.findIndex((candidate) => candidate.name === name), 0));
  choose(i < columns && j < rows ? { i: Number(i), j: Number(j) } : null);
}
new ResizeObserver(draw).observe(canvas);
start().catch((error) => { byId("wait").textContent = `The map cannot be shown: ${error}`; });

// Computes the visible part of the map in workers: coarse cells first, and always what is visible now.

// Number of cells along an axis in the first and in the last picture. Each picture contains all cells of the previous one.
const COARSEST = 17;
const FINEST = 257;
// Largest size of the records of a picture, in bytes.
const MOST_BYTES = 128e6;
// Time in ms that a request to a worker should take, and time between two pictures of unfinished cells.
const SPELL = 40;
const REDRAW = 1000;

// The part of the map that workers compute now, with its view, scene and progress; null if the program's
// map is fine enough. Most functions run only while there is a job, so the type does not say null.
/** @type {any} */ const NO_JOB = null;
/** @type {Job} */ let job = NO_JOB;
// Workers, each with the job and the runs of its request.
/** @type {any[]} */ let pool = [];
// Whether the reader has stopped the job.
let isPaused = false;

// Returns the values that a window needs along an axis, and the part of the axis that they cover, in cells.
/** @type {(axis: Axis, from: number, extent: number) => Along} */
function windowAlong(axis, from, extent) {
  if (axis.scale === "values") {
    const [first, last] = visible(axis.count, from, extent);
    const values = axis.values.slice(first, last + 1);
    return { values, cover: () => [first, values.length] };
  }
  const [first, last] = [Math.max(0, from - 0.5), Math.min(axis.count - 1, from + extent - 0.5)];
  /** @type {(count: number) => [number, number]} */
  const cover = (count) => {
    const cell = (last - first) / (count - 1);
    return [first + 0.5 - cell / 2, count * cell];
  };
  return { min: axisValue(axis, first), max: axisValue(axis, last), cover };
}

// Returns the extents of a view in cells; 0 along an axis whose values are listed.
/** @type {(place: Place) => number[]} */
const extentsOf = ({ width, height }) => map.axes.map((axis, k) => (axis.scale === "values" ? 0 : [width, height][k]));

// Begins the window that the view needs, unless it is there or under way.
function wish() {
  const extents = extentsOf(view);
  const isFine = extents.every((extent) => extent === 0) || extents.some((extent) => extent >= FINEST);
  const suffices = !isChanged() && (isFine || !byId("refine").checked || (showsAll() && !map.live?.at_once));
  if (!map.live || suffices) {
    stopJob();
    if (awaited) choose(cellOf(base, ...awaited));
    return;
  }
  const along = [windowAlong(map.axes[0], view.left, view.width), windowAlong(map.axes[1], view.bottom, view.height)];
  if (along.some(({ values, min, max }) => (values ? values.length < 2 : !(min < max)))) return;
  const key = JSON.stringify([along, changes]);
  if (job?.key === key) return;
  // A job without a picture is kept for up to a second. Otherwise a moving slider would restart it without end.
  if (job && !job.drawn && performance.now() - job.begun < REDRAW) {
    job.next = true;
    return;
  }
  isPaused = false;
  job = /** @type {Job} */ ({ key, along, view: { ...view }, begun: performance.now(), changes: { ...changes }, level: firstLevel() - 1, by_lanes: 0, drawn: false, next: false });
  // A figure, which the user asked for, is waited for.
  pool.filter(({ request }) => request && request.task !== "figure" && performance.now() - request.begun > PATIENCE).forEach(stop);
  nextLevel();
}

// Number of cells along an axis at a level.
/** @type {(level: number) => number} */
const countAt = (level) => (COARSEST - 1) * 2 ** level + 1;

// Returns the first level that is not coarser than what the program's map shows.
function firstLevel() {
  if (isChanged()) return 0;
  const most = Math.max(...extentsOf(view));
  let level = 0;
  while (countAt(level) < most && countAt(level + 1) <= FINEST) level += 1;
  return level;
}

function stopJob() {
  job = NO_JOB;
  isPaused = false;
  showWork();
  byId("live").textContent = "";
  byId("save-svg").hidden = true;
  if (live) showMap();
}

// Shows the program's map alone.
function showMap() {
  live = null;
  showFixed(map);
  fitColors();
  showScene();
  hover();
  if (selectedCell && selectedCell.sheet.data.fixed !== map.fixed) choose(cellOf(base, ...centreOf(selectedCell)));
}

// Begins the next finer picture; the last one ends the job.
function nextLevel() {
  job.level += 1;
  job.onLanes = lanes?.isReady ?? false;
  // A fast device begins with the finest picture that it computes at once.
  while (job.onLanes && !job.records && countAt(job.level + 1) <= FINEST
    && countAt(job.level + 1) ** 2 * map.live.starts < lanes.per_ms * SPELL) job.level += 1;
  byId("save-svg").hidden = true;
  const count = countAt(job.level);
  const grown = job.along.some(({ values }) => !values) ? count : COARSEST;
  const { starts, record_bytes: size } = map.live;
  const counts = job.along.map(({ values }) => values?.length ?? count);
  const isTooLarge = counts[0] * counts[1] * starts * size > MOST_BYTES;
  if (isTooLarge && !job.records) {
    failJob("the cells of this view need too much memory");
    return;
  }
  if (isTooLarge || grown > FINEST || (job.records && grown === COARSEST)) {
    checkProgram();
    if (job.by_lanes) checkLanes();
    byId("save-svg").hidden = false;
    awaited = null;
    job.isDone = true;
    showWork();
    byId("live").textContent = byId("spoken").textContent = `${job.counts.join(" \u00d7 ")} cells, computed in this page in ${((performance.now() - job.begun) / 1000).toFixed(1)} s`
      + (job.by_lanes ? `, ${job.by_lanes} of them on the graphics device` : "");
    return;
  }
  const earlier = job.records && { records: job.records, counts: job.counts };
  job.counts = counts;
  job.ranges = job.along.map(({ values, min, max }, k) => (values ? { values } : { min, max, count: job.counts[k] }));
  job.scene = sceneOver(map.scene, job.ranges);
  job.id = `${job.key} ${job.level}`;
  const [across, up] = counts;
  job.records = new Uint8Array(across * up * starts * size);
  job.todo = [];
  // A 1 for each run whose record is missing or a copy.
  job.pending = new Uint8Array(across * up * starts);
  // A cell that the coarser picture lacks shows the record of a neighbour until its own is computed.
  const parts = job.along.map(({ values }) => (values || !earlier ? 1 : 2));
  const [words, target, source] = [size / 4, new Uint32Array(job.records.buffer), earlier && new Uint32Array(earlier.records.buffer)];
  for (let line = 0; line < up * starts; line++) {
    const [j, start] = [line % up, Math.floor(line / up)];
    const isCopy = earlier && j % parts[1] > 0;
    if (isCopy) target.copyWithin(line * across * words, (line - 1) * across * words, line * across * words);
    for (let i = 0; i < across; i++) {
      const run = line * across + i;
      if (earlier && !isCopy) {
        const from = (start * earlier.counts[1] + j / parts[1]) * earlier.counts[0] + Math.floor(i / parts[0]);
        target.set(source.subarray(from * words, (from + 1) * words), run * words);
      }
      if (!earlier || isCopy || i % parts[0]) job.todo.push(run);
    }
  }
  for (const run of job.todo) job.pending[run] = 1;
  job.next_run = job.ended = 0;
  job.total = job.todo.length;
  job.redrawn = performance.now();
  job.wants_data = job.awaits_data = false;
  employ().catch(failJob);
}

// Gives work to idle workers.
async function employ() {
  const module = await compiled();
  showWork();
  if (!job) return;
  const most = within(navigator.hardwareConcurrency || 2, 1, 16);
  while (pool.length < most) {
    /** @type {Member} */
    const member = { worker: null, request: null, per_ms: 0.2 };
    member.worker = newWorker(module, (answer) => receive(member, answer), failJob);
    pool.push(member);
  }
  openLanes(module);
  for (const member of [...pool, ...(lanes ? [lanes] : [])]) if (!member.request) assign(member);
}

// Shows whether there is work to stop or to continue.
function showWork() {
  byId("stop").disabled = !request && (!job || job.isDone);
  byId("stop").textContent = isPaused ? "Continue" : "Stop";
}

// Stops all workers. The cells that they compute now are computed again when the reader continues.
function pause() {
  for (const member of pool.filter((each) => each.request)) {
    const { job: of, runs, task, layer: drawn, ending } = member.request;
    if (of === job && runs) job.todo.push(...runs);
    if (of === job && task === "data") [job.wants_data, job.awaits_data] = [true, false];
    if (of === job && task === "figure") job.wants_figure = { layer: drawn, ending };
    stop(member);
  }
  if (request) fail("stopped");
  isPaused = job !== null && !job.isDone;
  if (isPaused) byId("live").textContent = `stopped: ${job.total - job.ended} cells of this picture are left`;
  showWork();
}

byId("stop").addEventListener("click", () => {
  if (!isPaused) pause();
  else isPaused = false;
  employ().catch(failJob);
});
// A hidden page gives its workers nothing to do.
document.addEventListener("visibilitychange", () => employ().catch(failJob));

/** @type {(member: Member) => void} */
function assign(member) {
  if (!job || isPaused || document.hidden) return;
  const isLanes = member === lanes;
  if (!isLanes && samples.length) {
    const sample = samples.shift();
    member.request = { task: "labels", sample, begun: performance.now() };
    member.worker.postMessage({ task: "labels", key: "sample", ...sample.window, runs: Uint32Array.from(sample.cells) });
    return;
  }
  const common = { key: job.id, ...windowOf(job) };
  /** @type {(task: string, own: any) => void} */
  const send = (task, own) => {
    member.request = { job, id: job.id, task, begun: performance.now(), ...own };
    member.worker.postMessage({ task, ...common, ...own });
  };
  /** @type {(task: string, count: number) => void} */
  const compute = (task, count) => {
    const runs = job.todo.slice(job.next_run, job.next_run + count);
    job.next_run += runs.length;
    send(task, { runs: Uint32Array.from(runs) });
  };
  const isLeft = job.next_run < job.todo.length;
  if (isLanes) {
    if (!lanes.isReady) send("prepare", {});
    else if (isLeft && job.onLanes) compute("lanes", lanesAtOnce());
  } else if (job.wants_figure) {
    send("figure", { records: job.records, ...job.wants_figure });
    job.wants_figure = null;
  } else if (job.wants_data && !job.awaits_data) {
    job.wants_data = false;
    job.awaits_data = true;
    const isWhole = job.ended === job.total;
    send("data", { records: job.records, whole: isWhole });
    const [across, up] = job.counts;
    // A cell is pending while one of its runs is.
    if (!isWhole) member.request.pending = Uint8Array.from({ length: across * up }, (_, id) => {
      for (let run = id; run < job.pending.length; run += across * up) if (job.pending[run]) return 1;
      return 0;
    });
  } else if (isLeft && !job.onLanes) {
    compute("compute", within(Math.round(member.per_ms * SPELL), 4, 2048));
  }
}

// What a worker needs to know to compute the cells of a job.
/** @type {(part: { scene: string, changes: Record<string, number> }) => any} */
const windowOf = ({ scene, changes: changed }) => ({ scene, model: map.model_file,
  sets: Object.entries(changed).map(([name, value]) => `parameters.${name}=${value}`).join("\n") });

/** @type {(member: Member, answer: any) => void} */
function receive(member, { records, data, figure, labels, opened, prepared, error, broken }) {
  const { request } = member;
  const isLanes = member === lanes;
  if (isLanes && (error || opened === false)) {
    closeLanes();
    return;
  }
  member.request = null;
  if (prepared) member.isReady = true;
  if (broken) stop(member);
  if (error && request.task === "figure") {
    byId("live").textContent = `no figure: ${error}`;
  } else if (error && request.job === job) {
    failJob(error);
    return;
  }
  if (labels) {
    request.sample.tell(labels);
  } else if (figure) {
    const drawn = new Blob([figure], { type: "image/svg+xml" });
    if (request.ending === "svg") save(drawn, `${request.layer}.svg`);
    else saveAsPicture(drawn).catch(failJob);
  } else if (records) {
    const { record_bytes: size } = map.live;
    member.per_ms = request.runs.length / Math.max(performance.now() - request.begun, 1);
    if (isLanes && request.runs.length >= FEWEST_LANES) dropSlowLanes();
    if (job && request.job === job && request.id === job.id) {
      request.runs.forEach((/** @type {number} */ run, /** @type {number} */ k) => {
        job.records.set(records.subarray(k * size, (k + 1) * size), run * size);
        job.pending[run] = 0;
      });
      job.ended += request.runs.length;
      if (isLanes) job.by_lanes += request.runs.length;
      const isWhole = job.ended === job.total;
      // Cells of a first picture have no coarser neighbours whose records they could show.
      job.wants_data ||= isWhole || (job.drawn && performance.now() - job.redrawn > REDRAW);
      if (job.wants_data) job.redrawn = performance.now();
      const speed = (job.onLanes ? [lanes] : pool).reduce((sum, { per_ms: each }) => sum + each, 0);
      byId("live").textContent = `computing ${job.counts.join(" \u00d7 ")} cells: ${Math.floor((100 * job.ended) / job.total)} %, `
        + `${Math.ceil((job.total - job.ended) / speed / 1000)} s left`;
    }
  } else if (data && request.job === job && request.id === job.id) {
    job.awaits_data = false;
    showWindow(JSON.parse(data), request).catch(failJob);
  }
  employ().catch(failJob);
}

// Number of cells in a sample.
const SAMPLED = 64;
// Samples that workers have yet to compute in f64.
/** @type {any[]} */
const samples = [];
let checkedProgram = false;

// Draws some of a sheet's cells, and has a worker compute their class and period again. Calls `tell` with the number of cells
// and of those that have the same class and period.
/** @type {(sheet: Sheet, candidates: number[] | null, window: any, tell: (all: number, same: number) => void) => void} */
function drawSample({ values: { class: classes, period: periods, source } }, candidates, window, tell) {
  if (!classes) return;
  const integrated = (candidates ?? Array.from(classes, (_, id) => id)).filter((id) => id < classes.length && (!source || source[id] === 0));
  const cells = Array.from({ length: Math.min(SAMPLED, integrated.length) }, () => integrated[Math.floor(Math.random() * integrated.length)]);
  /** @type {(labels: Uint8Array) => (id: number, k: number) => boolean} */
  const isSame = (labels) => (id, k) => labels[2 * k] === classes[id] && labels[2 * k + 1] === periods[id];
  samples.push({ cells, window, tell: (/** @type {Uint8Array} */ labels) => tell(cells.length, cells.filter(isSame(labels)).length) });
  employ().catch(failJob);
}

// Compares the program's map with this page, once.
function checkProgram() {
  if (checkedProgram) return;
  checkedProgram = true;
  const scene = sceneOver(map.scene, map.axes.map(({ scale, values, min, max, count }) => (scale === "values" ? { values } : { min, max, count })));
  drawSample(base, null, windowOf({ scene, changes: {} }), (all, same) => {
    byId("sample").textContent = `The page computed ${all} random cells of the program's map again: ${same} have the same class and period.`
      + (same === all ? ""
        : map.made.engine === "cpu" ? " Unlike the program, browsers round each product before they add it, so a long transient may end on another motion."
          : ` The map was computed by the engine ${map.made.engine} in ${map.made.precision}, the page computes in f64.`);
  });
}

// Compares the cells of the graphics device with those of the other workers.
function checkLanes() {
  if (live) drawSample(live, job.onLanes ? job.todo : null, windowOf(job), (all, same) => {
    byId("lanes").textContent = `The graphics device computes in f32. The page computed ${all} of its random cells again in f64: ${same} have the same class and period.`;
  });
}

// Shows the cells of a job, and begins its next level if all of them are there.
/** @type {(data: MapData, request: any) => Promise<void>} */
async function showWindow(data, { job: of, id, whole: isWhole, pending }) {
  const [[left, width], [bottom, height]] = /** @type {Along[]} */ (of.along).map(({ cover }, k) => cover(data.axes[k].count));
  const sheet = await fill(sheetOf(data, { left, bottom, width, height }));
  if (of !== job || id !== job.id) return;
  Object.assign(sheet, { job: of, made: of.view, ranges: of.ranges, isWhole, pending });
  live = sheet;
  of.drawn = true;
  showFixed(data);
  fitColors();
  showScene();
  if (isWhole) chooseIn(sheet);
  renewSelection(sheet);
  hover();
  if (of.next) {
    of.next = false;
    wish();
  }
  if (of === job && isWhole) nextLevel();
}

// Selects the cell that the link names. After a change of parameters, selects the cell at the same place again. Each finer
// picture selects the cell that contains this place.
/** @type {(sheet: Sheet) => void} */
function chooseIn(sheet) {
  if (!awaited && selectedCell && selectedCell.sheet.data.fixed !== sheet.data.fixed) awaited = centreOf(selectedCell);
  const place = awaited;
  const cell = place && cellOf(sheet, ...place);
  if (!cell) return;
  choose(cell);
  awaited = place;
  updateLink();
}

// Gives a selected cell that this page computed the records of a newer picture, if that has a cell with the same values.
/** @type {(sheet: Sheet) => void} */
function renewSelection(sheet) {
  if (!selectedCell || selectedCell.sheet === base || selectedCell.sheet.data.fixed !== sheet.data.fixed) return;
  const cell = cellOf(sheet, ...centreOf(selectedCell));
  if (cell && String(valuesAt(cell)) === String(valuesAt(selectedCell))) selectedCell = cell;
}

/** @type {(member: Member) => void} */
function stop(member) {
  member.worker.terminate();
  if (member.request?.sample) samples.push(member.request.sample);
  pool = pool.filter((other) => other !== member);
}

/** @type {(error: any) => void} */
function failJob(error) {
  byId("live").textContent = `not computed: ${error.message ?? error}`;
  byId("save-svg").hidden = true;
  const isOutdated = job?.next;
  job = NO_JOB;
  showWork();
  if (isOutdated) wish();
}

// Removes cells with other parameters once the parameters are those of the map again.
function dropStale() {
  if (!isChanged() && live && live.data.fixed !== map.fixed) showMap();
}

// Number of steps in which a slider is played, and time between two of them in ms.
const PLAYED = 40;
const BEAT = 250;
/** @type {any} */ let played = null;

// Calls `step` again and again, each time after the picture of the previous step; not if its button is pressed already.
/** @type {(button: any, step?: () => void) => void} */
function play(button, step) {
  const isSame = played?.button === button;
  if (played) clearInterval(played.timer);
  played?.button.setAttribute("aria-pressed", "false");
  played = null;
  if (!step || isSame) return;
  button.setAttribute("aria-pressed", "true");
  played = { button, timer: setInterval(() => document.hidden || isPaused || (job && !job.drawn) || step(), BEAT) };
}

// Lists the parameters of the map, each with a slider, a field and a button that plays the slider.
function showParameters() {
  byId("parameters").hidden = byId("compare").hidden = !map.live;
  play(null);
  byId("sliders").replaceChildren(...map.parameters.map(({ name, symbol, label, value, min, max }) => {
    const [slider, field] = ["range", "number"].map((type) => Object.assign(element("input"), { type, step: "any" }));
    for (const input of [slider, field]) input.setAttribute("aria-label", label);
    const now = changes[name] ?? value;
    const span = Math.abs(value) || 1;
    slider.min = Math.max(min ?? -Infinity, value < 0 || min === null ? value - span : 0);
    slider.max = Math.min(max ?? Infinity, value + span);
    [slider.value, field.value] = [now, now];
    /** @type {(text: string) => void} */
    const change = (text) => {
      const number = Number(text);
      if (text === "" || !Number.isFinite(number)) return;
      if (number === value) delete changes[name];
      else changes[name] = number;
      [slider.value, field.value] = [number, number];
      dropStale();
      updateLink();
      draw();
      wish();
    };
    slider.addEventListener("input", () => change(String(Number(Number(slider.value).toPrecision(4)))));
    field.addEventListener("change", () => change(field.value));
    const row = element("label");
    const text = element("span", symbol);
    text.title = label;
    const [low, high] = [slider.min, slider.max].map(Number);
    const button = newButton("\u25b6", `play ${label}`, () => play(button, () => {
      const next = Number((Number(slider.value) + (high - low) / PLAYED).toPrecision(4));
      change(String(next > high ? low : next));
    }));
    button.setAttribute("aria-label", button.title);
    button.setAttribute("aria-pressed", "false");
    row.append(text, slider, field, button);
    return row;
  }));
}

byId("refine").addEventListener("change", wish);
byId("restore").addEventListener("click", () => {
  changes = {};
  showParameters();
  dropStale();
  updateLink();
  wish();
});

// Offers a file for download.
/** @type {(blob: Blob | null, name: string) => void} */
function save(blob, name) {
  if (!blob) return;
  const link = Object.assign(element("a"), { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
/** @type {(ending: string) => string} */
const fileName = (ending) => `${map.layers[layer].name}.${ending}`;

// Saves a drawing, twice as large, on a white ground.
/** @type {(drawn: Blob) => Promise<void>} */
async function saveAsPicture(drawn) {
  const image = Object.assign(new Image(), { src: URL.createObjectURL(drawn) });
  await image.decode();
  const picture = Object.assign(element("canvas"), { width: 2 * image.naturalWidth, height: 2 * image.naturalHeight });
  const brush = picture.getContext("2d");
  brush.fillStyle = "#fff";
  brush.fillRect(0, 0, picture.width, picture.height);
  brush.drawImage(image, 0, 0, picture.width, picture.height);
  URL.revokeObjectURL(image.src);
  picture.toBlob((/** @type {Blob | null} */ blob) => save(blob, fileName("png")));
}

// Draws the map in black ink, for paper.
/** @type {(color: string) => void} */
function ink(color) {
  canvas.style.color = color;
  draw();
}
addEventListener("beforeprint", () => ink("#000"));
addEventListener("afterprint", () => ink(""));

// Returns what the canvas shows with title and legend on a white ground. The engine draws a figure only of what it computed.
function titledPicture() {
  const { entries: own, title } = layerOf(uppermost());
  const entries = [...own, ...curveKinds()];
  const { fixed } = uppermost().data;
  const { clientWidth: width, clientHeight: height } = canvas;
  const [ratio, top, across] = [canvas.width / width, 52, Math.max(1, Math.floor(width / 260))];
  const bar = shownBar ? 62 : 0;
  const picture = element("canvas");
  [picture.width, picture.height] = [canvas.width, ratio * (top + height + bar + 22 * Math.ceil(entries.length / across) + 12)];
  const brush = picture.getContext("2d");
  brush.scale(ratio, ratio);
  /** @type {(text: string, x: number, y: number, font?: string) => void} */
  const write = (text, x, y, font = "13px system-ui, sans-serif") => {
    brush.fillStyle = "#000";
    brush.font = font;
    brush.fillText(text, x, y, width - x);
  };
  brush.fillStyle = "#fff";
  brush.fillRect(0, 0, width, picture.height);
  write(`${map.title}: ${title}`, 14, 22, "600 16px system-ui, sans-serif");
  if (fixed) write(`Other parameters: ${fixed}`, 14, 42);
  ink("#000");
  brush.drawImage(canvas, 0, top, width, height);
  ink("");
  const below = top + height + 16;
  if (shownBar) {
    const { colors, places, heading } = shownBar;
    const ramp = brush.createLinearGradient(14, 0, 414, 0);
    colors.forEach((/** @type {string} */ color, /** @type {number} */ k) => ramp.addColorStop(k / (colors.length - 1), `#${color}`));
    write(heading, 14, below);
    brush.fillStyle = ramp;
    brush.fillRect(14, below + 6, 400, 14);
    for (const { share, text } of places) write(text, 10 + 400 * share, below + 34);
  }
  /** @type {Entry[]} */ (entries).forEach(({ color, text, share }, k) => {
    const [x, y] = [14 + 260 * (k % across), below + bar + 22 * Math.floor(k / across)];
    brush.fillStyle = `#${color}`;
    brush.fillRect(x, y - 11, 24, 13);
    brush.strokeRect(x, y - 11, 24, 13);
    write(`${text}  ${share}`, x + 32, y);
  });
  return picture;
}

// Has a worker draw the figure of a computed view.
/** @type {(ending: string) => void} */
function wantFigure(ending) {
  job.wants_figure = { layer: map.layers[layer].name, ending };
  employ().catch(failJob);
}
byId("save-png").addEventListener("click", () => {
  // The engine's figures have no curves.
  if (job && !byId("save-svg").hidden && !showsCurves()) wantFigure("png");
  else titledPicture().toBlob((/** @type {Blob | null} */ blob) => save(blob, fileName("png")));
});
byId("save-model").hidden = !map.model_file;
byId("save-model").addEventListener("click", () => save(new Blob([map.model_file ?? ""]), "model.toml"));
byId("save-svg").addEventListener("click", () => job && wantFigure("svg"));

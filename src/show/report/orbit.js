// The motion of the selected cell. A worker computes it with the code of `rattlemap orbit`.

const FIGURES = ["gap", "phase_plane", "time_history"];
// Time in ms after which a newer selection stops a computation.
const PATIENCE = 300;

// The compiled engine, a promise; none before the first selection. With it the script of its workers is unpacked.
/** @type {any} */ let engine = null;
/** @type {any} */ let workerScript = null;
// The worker that is computing or idle; none before the first selection, and after a failure.
/** @type {any} */ let worker = null;
// The selected cell whose motion is shown or wanted.
/** @type {any} */ let wanted = null;
// The request that the worker computes, with the time at which it began; none if the worker is idle.
/** @type {any} */ let request = null;
// Class, period and number of periods of the motion that is shown; none while it is computed.
/** @type {any} */ let reached = null;

// Compiles the engine once.
function compiled() {
  engine ??= Promise.all([{ data: byId("engine").textContent, type: "u8" }, WORKER].map(unpack)).then(([bytes, script]) => {
    workerScript = script;
    return WebAssembly.compile(bytes);
  });
  return engine;
}

// Shows the motion of a cell; none hides it.
/** @type {(cell: Cell | null) => void} */
function showOrbit(cell) {
  wanted = cell;
  byId("motion").hidden = byId("orbit").hidden = !cell || map.model_file === null;
  if (!cell || byId("motion").hidden) return;
  byId("which-motion").textContent = byId("which-orbit").textContent = `Motion at ${nameOf(cell)}`;
  // Tells a notebook that shows this page in a frame.
  if (parent !== window && !isSecond) parent.postMessage({ kind: "rattlemap", command: byId("command").textContent }, "*");
  byId("computing").textContent = "computing\u2026";
  reached = null;
  for (const id of ["motion", "orbit"]) byId(id).setAttribute("aria-busy", "true");
  if (request && performance.now() - request.begun > PATIENCE) stopWorker();
  if (!request) compute().catch(fail);
}

// Names a cell by the values of its axes.
/** @type {(cell: Cell) => string} */
const nameOf = (cell) => valuesAt(cell).map((value, k) => `${map.axes[k].symbol} = ${Number(value.toPrecision(8))}`).join(", ");

// Says what the map and the motion of the selected cell are if they differ, and which of them the program gives.
function compareMotion() {
  byId("differs").textContent = "";
  if (!reached?.class || !selectedCell || isPending(selectedCell)) return;
  const { sheet: { data, values, columns: across }, i, j } = selectedCell;
  const id = j * across + i;
  const ofMap = data.classes[values.class?.[id]];
  const [theirs, ours] = [[ofMap, values.period?.[id]], [reached.class, reached.period]].map(([name, n]) => (name === "periodic" ? `period ${n}` : name));
  if (!ofMap || theirs === ours) return;
  const by = selectedCell.sheet !== base ? "computed in this page, as the motion is, and not by the program"
    : data.sources[values.source?.[id]] === "filled" ? "which the program filled in" : "which the program gives";
  const how = ofMap === "periodic" && reached.period ? "a coexisting motion"
    : `after ${count(reached.periods_run, "period")} instead of ${values.periods_run[id]}`;
  byId("differs").textContent = `The map: ${theirs}, ${by}; from the same start this page reaches ${ours}, ${how}.`;
}

async function compute() {
  const own = { task: "orbit", command: byId("command").textContent, model: map.model_file };
  request = { ...own, begun: performance.now() };
  showWork();
  const mine = request;
  const module = await compiled();
  // A newer selection may have stopped this request.
  if (request !== mine) return;
  if (!worker) startWorker(module);
  worker.postMessage(own);
}

// Starts a worker with the engine. Calls `answer` with each message, and `failed` with a text if the worker cannot run.
/** @type {(module: WebAssembly.Module, answer: (data: any) => void, failed: (error: any) => void) => Worker} */
function newWorker(module, answer, failed) {
  const script = URL.createObjectURL(new Blob([workerScript], { type: "text/javascript" }));
  const started = new Worker(script);
  started.addEventListener("message", ({ data }) => {
    URL.revokeObjectURL(script);
    answer(data);
  });
  started.addEventListener("error", (event) => failed(event.message || "this browser cannot start a worker"));
  started.postMessage({ module });
  return started;
}

/** @type {(module: WebAssembly.Module) => void} */
function startWorker(module) {
  worker = newWorker(module, ({ command, result, broken }) => {
    const took = performance.now() - request.begun;
    request = null;
    showWork();
    // After a fault the engine's memory may be damaged.
    if (broken) stopWorker();
    if (wanted && command === byId("command").textContent) showMotion(JSON.parse(result), took);
    else if (wanted) compute().catch(fail);
  }, fail);
}

// Starts the worker before the first selection.
async function prepareWorker() {
  const module = await compiled();
  if (!worker) startWorker(module);
}

function stopWorker() {
  worker?.terminate();
  worker = request = null;
}

// Reports a failure. The next selection tries again.
/** @type {(error: any) => void} */
function fail(error) {
  stopWorker();
  engine = null;
  showMotion({ error: error === "stopped" ? error : `the engine cannot run: ${error}` });
}

function showMotion({ summary = null, figures = null, error = null, ...motion }, took = 0) {
  reached = motion;
  compareMotion();
  for (const id of ["motion", "orbit"]) byId(id).removeAttribute("aria-busy");
  byId("computing").textContent = error ? `Not computed: ${error}`
    : `computed in this page in ${Math.round(took)} ms`;
  byId("summary").textContent = summary ?? "";
  for (const name of FIGURES) {
    const image = byId(name);
    URL.revokeObjectURL(image.src);
    image.hidden = !figures?.[name];
    if (figures?.[name]) image.src = URL.createObjectURL(new Blob([figures[name]], { type: "image/svg+xml" }));
  }
}

byId("numbers").addEventListener("click", () => {
  byId("summary").focus({ preventScroll: true });
  byId("orbit").scrollIntoView({ behavior: "smooth" });
});

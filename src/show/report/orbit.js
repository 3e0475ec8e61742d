// The motion of the selected cell, computed in a worker by the same code as `rattlemap orbit`.

const FIGURES = ["gap", "phase_plane", "time_history"];
let orbitWorker = null;
// The cell whose motion was asked for last, whether the worker is busy, and the cell that it computes.
let wantedCell = null;
let isBusy = false;
let begun = 0;

// Starts the worker when the first cell is selected: the engine is unpacked only then.
async function startWorker() {
  const script = new Blob([byId("worker").textContent], { type: "text/javascript" });
  orbitWorker = new Worker(URL.createObjectURL(script));
  orbitWorker.addEventListener("message", ({ data }) => {
    isBusy = false;
    if (data.cell === cellName(wantedCell)) showMotion(JSON.parse(data.result));
    else askWorker();
  });
  orbitWorker.addEventListener("error", ({ message }) => showMotion({ error: `the engine cannot run here: ${message}` }));
  const wasm = await unpack({ data: byId("engine").textContent, type: "u8" });
  orbitWorker.postMessage({ wasm });
}

const cellName = (cell) => (cell ? `${cell.i},${cell.j}` : "");

// Asks for the motion of a cell. Only the newest of several cells is computed.
function showOrbit(cell) {
  wantedCell = cell;
  byId("motion").hidden = byId("orbit").hidden = !cell || map.model_file === null;
  if (byId("motion").hidden) return;
  byId("computing").textContent = "computing\u2026";
  if (!isBusy) askWorker();
}

function askWorker() {
  if (!wantedCell) return;
  isBusy = true;
  begun = performance.now();
  const request = { cell: cellName(wantedCell), command: byId("command").textContent, model: map.model_file };
  const send = () => orbitWorker.postMessage(request);
  if (orbitWorker) send();
  else startWorker().then(send, (error) => showMotion({ error: String(error) }));
}

function showMotion({ summary, figures, error }) {
  byId("computing").textContent = error ? `Not computed: ${error}`
    : `computed in this page in ${Math.round(performance.now() - begun)} ms; the last digits may differ from the program's`;
  byId("summary").textContent = summary ?? "";
  for (const name of FIGURES) {
    const image = byId(name);
    URL.revokeObjectURL(image.src);
    image.hidden = !figures?.[name];
    if (!image.hidden) image.src = URL.createObjectURL(new Blob([figures[name]], { type: "image/svg+xml" }));
  }
}

byId("numbers").addEventListener("click", () => byId("orbit").scrollIntoView({ behavior: "smooth" }));

// Lanes on the browser's graphics device, in a worker of their own. Until their shaders are compiled, and without a device,
// the other workers compute all cells.

// Fewest and most cells of a request, and the time in ms that it should take.
const FEWEST_LANES = 1024;
const MOST_LANES = 65536;
const LANES_SPELL = 250;

// The worker of lanes. None before it is opened, without a device, and after a failure.
/** @type {any} */ let lanes = null;
let triedLanes = false;

// A program on the processor that acts as a device is slower than the other workers. It is used only if the address asks for it.
const software = new URLSearchParams(location.search).get("lanes") === "software";

// Opens the device, once.
/** @type {(module: WebAssembly.Module) => void} */
function openLanes(module) {
  if (triedLanes || !navigator.gpu) return;
  triedLanes = true;
  lanes = { request: { task: "open" }, isReady: false, per_ms: FEWEST_LANES / LANES_SPELL };
  const member = lanes;
  lanes.worker = newWorker(module, (answer) => receive(member, answer), () => closeLanes());
  lanes.worker.postMessage({ task: "open", software });
}

// Leaves the cells of lanes to the other workers.
function closeLanes() {
  const request = lanes?.request;
  lanes?.worker.terminate();
  lanes = null;
  if (!job) return;
  job.onLanes = false;
  if (request?.id === job.id) for (const run of request.runs ?? []) job.todo.push(run);
  employ().catch(failJob);
}

// Returns the number of cells that the next request should have.
const lanesAtOnce = () => within(Math.round(lanes.per_ms * LANES_SPELL), FEWEST_LANES, MOST_LANES);

// Leaves all further cells to the other workers if they are faster together.
function dropSlowLanes() {
  const others = pool.reduce((sum, { per_ms: each }) => sum + each, 0);
  if (lanes.per_ms < others && !software) closeLanes();
}

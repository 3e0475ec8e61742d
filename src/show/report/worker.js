
// Runs in a worker, after the code that wasm-bindgen made. It first receives the engine, then requests.

// The part of a map that was computed last, and the text that identifies it.
let opened = { key: null, window: null };

function windowOf({ key, scene, model, sets }) {
  if (opened.key !== key) {
    opened.window?.free();
    opened = { key: null, window: null };
    opened = { key, window: new wasm_bindgen.Window(scene, model, sets) };
  }
  return opened.window;
}

// The browser's graphics device, and the window that it is prepared for.
let lanes = null;
let prepared = null;

async function preparedFor(request) {
  const window = windowOf(request);
  if (prepared !== window) {
    prepared = null;
    await lanes.prepare(window);
    prepared = window;
  }
  return window;
}

const answers = {
  orbit: ({ command, model }) => ({ command, result: wasm_bindgen.orbit(command, model) }),
  ticks: ({ id, scale, ends, listed, length, spacing }) =>
    ({ id, ticks: wasm_bindgen.ticks(scale, Float64Array.from(ends), Float64Array.from(listed), length, spacing) }),
  compute: (request) => ({ records: windowOf(request).compute(request.runs) }),
  labels: (request) => ({ labels: windowOf(request).labels(request.runs) }),
  data: (request) => ({ data: windowOf(request).data(request.records) }),
  open: async ({ software }) => {
    lanes = await wasm_bindgen.Lanes.open();
    return { opened: software || lanes.is_hardware() };
  },
  prepare: async (request) => ({ prepared: (await preparedFor(request)) !== null }),
  lanes: async (request) => ({ records: await lanes.compute(await preparedFor(request), request.runs) }),
  figure: (request) => ({ figure: windowOf(request).figure(request.records, request.layer) }),
};

onmessage = async ({ data: request }) => {
  if (request.module) {
    wasm_bindgen.initSync({ module: request.module });
    return;
  }
  try {
    const answer = await answers[request.task](request);
    postMessage(answer, answer.records ? [answer.records.buffer] : []);
  } catch (error) {
    // An error that is a string means a wrong request. Any other error may have damaged the engine's memory.
    const broken = typeof error !== "string";
    const text = broken ? `the engine stopped (${error}); run the command of this cell in a terminal` : error;
    postMessage({ command: request.command, broken, error: text, result: JSON.stringify({ error: text }) });
  }
};

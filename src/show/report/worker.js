
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

const answers = {
  orbit: ({ command, model }) => ({ command, result: wasm_bindgen.orbit(command, model) }),
  compute: (request) => ({ records: windowOf(request).compute(request.runs) }),
  labels: (request) => ({ labels: windowOf(request).labels(request.runs) }),
  data: (request) => ({ data: windowOf(request).data(request.records) }),
  figure: (request) => ({ figure: windowOf(request).figure(request.records, request.layer) }),
};

onmessage = ({ data: request }) => {
  if (request.module) {
    wasm_bindgen.initSync({ module: request.module });
    return;
  }
  try {
    const answer = answers[request.task](request);
    postMessage(answer, answer.records ? [answer.records.buffer] : []);
  } catch (error) {
    // An error that is a string means a wrong request. Any other error may have damaged the engine's memory.
    const broken = typeof error !== "string";
    const text = broken ? `the engine stopped (${error}); run the command of this cell in a terminal` : error;
    postMessage({ command: request.command, broken, error: text, result: JSON.stringify({ error: text }) });
  }
};


// Runs in the worker: first receives the engine, then commands.
let ready = null;
onmessage = async ({ data }) => {
  if (data.wasm) {
    ready = wasm_bindgen({ module_or_path: data.wasm });
    return;
  }
  try {
    await ready;
    postMessage({ cell: data.cell, result: wasm_bindgen.orbit(data.command, data.model) });
  } catch (error) {
    postMessage({ cell: data.cell, result: JSON.stringify({ error: String(error) }) });
  }
};

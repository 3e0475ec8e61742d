
// Runs in the worker, after the code that wasm-bindgen made. It first receives the engine, then commands.
onmessage = ({ data }) => {
  if (data.module) {
    wasm_bindgen.initSync({ module: data.module });
    return;
  }
  const { cell, command, model } = data;
  try {
    postMessage({ cell, result: wasm_bindgen.orbit(command, model) });
  } catch (error) {
    postMessage({ cell, broken: true, result: JSON.stringify({ error: `the engine stopped (${error}); try the command` }) });
  }
};

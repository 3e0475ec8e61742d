// Fills the page and shows what the link names.

/** @type {(data: MapData) => void} */
function showFixed({ fixed, model, source }) {
  byId("fixed").textContent = (fixed ? `Other parameters: ${fixed}. ` : "") + `Model: ${model}.` + (source ? ` Source: ${source}.` : "");
}

async function start() {
  byId("title").textContent = map.title;
  byId("subtitle").textContent = map.subtitle;
  showFixed(map);
  const { engine, precision, device, version, commit } = map.made;
  byId("made").textContent = `Computed by rattlemap ${version} (commit ${commit}) with the engine ${engine} in ${precision}: ${device}.`;
  byId("compute").textContent = map.compute;
  byId("equations").hidden = !map.equations?.length;
  byId("equations").textContent = (map.equations ?? []).join("\n");
  byId("sketch").hidden = !map.sketch;
  if (map.sketch) byId("sketch").src = URL.createObjectURL(new Blob([await unpack(map.sketch)], { type: "image/svg+xml" }));
  if (map.values.word || map.values.pattern) byId("letters").textContent = map.letters ?? "";
  byId("layers").append(...map.layers.map(({ short }, k) => {
    const button = newButton(short, "", () => showLayer(k));
    button.setAttribute("role", "radio");
    return button;
  }));
  byId("layers").addEventListener("keydown", (/** @type {KeyboardEvent} */ { key }) => {
    /** @type {Record<string, number>} */
    const steps = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 };
    const step = steps[key];
    if (!step) return;
    showLayer((layer + step + map.layers.length) % map.layers.length);
    byId("layers").children[layer].focus();
  });
  // A map's folder has the model's own file; the page of `explore` has no folder.
  if (map.model_file) byId("where").textContent = map.live?.at_once ? "First save the model beside it: Other files of this view." : "Run it in the map's folder.";
  if (map.refinement) showRefinement(map.refinement);
  if (map.validation) showValidation(map.validation);
  await Promise.all([fill(base), fillCurves()]);
  byId("curves").hidden = !map.curves;
  byId("show-curves").addEventListener("change", () => {
    fitColors();
    hover();
  });
  byId("wait").remove();
  readAddress();
  if (isSecond) parent.postMessage({ panel: "ready" }, "*");
  // Starts the worker early, so that the first selection does not wait for it.
  if (map.model_file !== null) setTimeout(() => prepareWorker().catch(() => {}), 300);
}
new ResizeObserver(draw).observe(canvas);
start().catch((error) => { byId("wait").textContent = `The map cannot be shown: ${error}`; });

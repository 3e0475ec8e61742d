// Fills the page and shows what the link names.

async function start() {
  byId("title").textContent = map.title;
  byId("subtitle").textContent = map.subtitle;
  byId("fixed").textContent = (map.fixed ? `Other parameters: ${map.fixed}. ` : "") + `Model: ${map.model}.` + (map.source ? ` Source: ${map.source}.` : "");
  const { engine, precision, device, version, commit } = map.made;
  byId("made").textContent = `Computed by rattlemap ${version} (commit ${commit}) with the engine ${engine} in ${precision}: ${device}.`;
  byId("compute").textContent = map.compute;
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
  await Promise.all(map.layers.map(async (packed) => {
    if (packed.values) packed.values = await unpack(packed.values);
    else packed.indices = await unpack(packed.indices);
    packed.ready = true;
  }));
  byId("wait").remove();
  readLink();
}
new ResizeObserver(draw).observe(canvas);
start().catch((error) => { byId("wait").textContent = `The map cannot be shown: ${error}`; });

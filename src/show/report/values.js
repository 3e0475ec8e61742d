// Beside the map: values of a cell, and the commands that compute a cell or the view again.

// Returns names and values of what was computed for a cell.
/** @type {(cell: Cell) => any[][]} */
function facts(cell) {
  const { sheet: { data, values, columns: across }, i, j } = cell;
  const id = j * across + i;
  /** @type {(name: string) => any} */
  const at = (name) => values[name]?.[id];
  /** @type {(value: number) => string | undefined} */
  const round = (value) => (Number.isNaN(value) ? undefined : Number(value.toPrecision(5)).toString());
  const source = data.sources[at("source")];
  // The values of filled cells are not measured.
  /** @type {(text?: string) => string | undefined} */
  const between = (text) => (text !== undefined && source === "filled" ? `${text}, interpolated` : text);
  const measured = data.layers.filter((of) => of.values).map(({ name, short, title, values: numbers }) => {
    const [number, error] = [round(numbers[id]), round(at(`${name}_error`) ?? NaN)];
    return [short, between(number && error ? `${number} \u00b1 ${error}` : number), title];
  });
  /** @type {(array: string, name: string, text: (index: number) => any) => any[][]} */
  const computed = (array, name, text) => (values[array] ? [[name, text(at(array))]] : []);
  /** @type {(list: string[]) => (index: number) => string} */
  const spelled = (list) => (index) => (list[index] === "" ? "no events" : list[index]);
  const found = [
    ...computed("class", "class", (index) => (data.classes[index] === "periodic" ? period(cell.sheet, id) : data.classes[index])),
    ...measured,
    ...computed("symmetric", "symmetric", (flag) => ["no", "yes"][flag]),
    ...computed("pattern", "pattern", spelled(data.patterns)),
    ...computed("word", "word", spelled(data.words)),
    ...computed("attractors", "attractors found", (count) => count),
    ...computed("attractor", "attractor", (label) => data.attractors[label]),
    ["status", data.statuses[at("status")]],
    ...computed("source", "source", () => source),
    ...computed("finished", "finished by", (index) => data.finishers[index] ?? "no engine: filled in"),
    ["periods run", at("periods_run")],
  ];
  const text = cell.sheet.job === job ? "being computed" : "not computed";
  const missing = found.map(([name], k) => [name, k ? undefined : text]);
  return [...valuesAt(cell).map((value, k) => [data.axes[k].symbol, value, data.axes[k].label]), ...derivedValues(cell),
    ...(isPending(cell) ? missing : found), ["cell", `${i}, ${j}`]];
}

// Returns the period of a cell; a legend can say more about it, as in "period 1, no contact".
/** @type {(sheet: Sheet, id: number) => string} */
function period({ data, values }, id) {
  const text = `period ${values.period[id]}`;
  const entries = data.layers.filter((of) => of.indices).map(({ entries, palette, indices }) =>
    entries.find(({ color }) => color === palette[indices[id]])?.text);
  return entries.find((entry) => entry?.startsWith(`${text},`)) ?? text;
}

function updateReadout() {
  const cell = pointerCell ?? selectedCell;
  byId("which").textContent = !pointerCell && selectedCell ? "Selected cell" : "Under the pointer";
  const lines = facts(cell ?? { sheet: base, i: 0, j: 0 }).map(([name, value, meaning]) => {
    const row = element("tr");
    const head = element("th", name);
    if (meaning) head.title = meaning;
    row.append(head, element("td", cell ? String(value ?? "\u2013") : "\u2013"));
    return row;
  });
  byId("readout").replaceChildren(...lines);
  compareMotion();
}

// Selects a cell of a sheet, by default of the program's map, and shows the command that replays it. `curve`: what the curve there is.
/** @type {(cell: { sheet?: Sheet, i: number, j: number } | null, curve?: string) => void} */
function choose(cell, curve = "") {
  chosenCurve = byId("curve").textContent = curve;
  selectedCell = cell && { sheet: base, ...cell };
  awaited = null;
  byId("replay").hidden = !cell;
  if (selectedCell) {
    const { sheet: { data, starts, columns: across }, i, j } = selectedCell;
    const [a, b] = valuesAt(selectedCell);
    const width = Math.max(data.components, 4), place = width * (j * across + i);
    const own = (data.start ?? starts?.subarray(place, place + width))?.slice(0, data.components);
    const start = own ? ` --start ${[...own].map((x, k) => [a, b][data.axes.findIndex((axis) => axis.start === k)] ?? x).join(",")}` : "";
    const sets = data.axes.map((axis, k) => (axis.start === undefined ? ` --set ${axis.parameter}=${[a, b][k]}` : "")).join("");
    const derived = derivedValues(selectedCell).map(([name, value]) => ` --set ${name}=${value}`).join("");
    const words = `rattlemap orbit${sets}${derived}${data.replay}${start}`.split(" --");
    // Lines break only between arguments.
    byId("command").replaceChildren(...words.flatMap((word, k) =>
      k === 0 ? [element("span", word)] : [" ", element("span", `--${word}`)]));
  }
  showOrbit(selectedCell);
  updateReadout();
  if (selectedCell) byId("spoken").textContent = [curve, ...facts(selectedCell).filter(([, value]) => value !== undefined).map(([name, value]) => `${name} ${value}`)].filter(Boolean).join(", ");
  updateLink();
  draw();
}

// Returns a scene over two axes, each with the least and greatest value and the number of cells, or with its values.
/** @type {(settings: string, ranges: Span[]) => string} */
function sceneOver(settings, ranges) {
  /** @type {(axis: Axis, span: Span) => string} */
  const lines = ({ parameter, start, scale }, { min, max, count, values }) => {
    const head = `[[axis]]\n${start === undefined ? "parameter" : "start"} = ${JSON.stringify(parameter)}\n`;
    if (values) return `${head}values = [${values.join(", ")}]\n`;
    return `${head}min = ${min}\nmax = ${max}\ncount = ${count}\n${scale === "linear" ? "" : `scale = "${scale}"\n`}`;
  };
  return [settings, ...map.axes.map((axis, k) => lines(axis, ranges[k]))].join("\n");
}

// Shows the scene of the visible cells, with the resolution of the whole map, and the command that computes it.
function showScene() {
  /** @type {(axis: Axis, from: number, extent: number) => Span} */
  const range = (axis, from, extent) => {
    const [first, last] = visible(axis.count, from, extent);
    if (axis.scale === "values") return { values: axis.values.slice(first, last + 1) };
    return { min: axisValue(axis, first), max: axisValue(axis, last), count: axis.count };
  };
  const [a, b] = map.axes;
  byId("scene").textContent = uppermost() === live ? sceneOver(live.data.scene, live.ranges ?? [])
    : sceneOver(map.scene, [range(a, view.left, view.width), range(b, view.bottom, view.height)]);
}

// Copies the text of an element when its button is pressed.
/** @type {(button: HTMLElement, text: HTMLElement) => void} */
function copies(button, text) {
  const label = button.textContent;
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(text.textContent);
      button.textContent = "Copied";
    } catch {
      // A page opened from a disk cannot always write to the clipboard.
      getSelection()?.selectAllChildren(text);
      button.textContent = "Selected: press Ctrl-C";
    }
    setTimeout(() => { button.textContent = label; }, 1500);
  });
}
for (const name of ["command", "scene", "compute"]) copies(byId(`copy-${name}`), byId(name));

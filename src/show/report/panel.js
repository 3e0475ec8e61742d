// The panel beside the map: values of a cell, and the commands that compute a cell or the view again.

// Returns names and values of what was computed for a cell.
function facts({ i, j }) {
  const id = j * columns + i;
  const at = (name) => values[name]?.[id];
  const round = (value) => (Number.isNaN(value) ? undefined : Number(value.toPrecision(5)).toString());
  const source = map.sources[at("source")];
  // The values of filled cells are not measured.
  const between = (text) => (text !== undefined && source === "filled" ? `${text}, interpolated` : text);
  const measured = map.layers.filter((of) => of.values).map(({ name, short, title, values: numbers }) => {
    const [number, error] = [round(numbers[id]), round(at(`${name}_error`) ?? NaN)];
    return [short, between(number && error ? `${number} \u00b1 ${error}` : number), title];
  });
  const computed = (array, name, text) => (values[array] ? [[name, text(at(array))]] : []);
  const spelled = (list) => (index) => (list[index] === "" ? "no events" : list[index]);
  return [
    ...map.axes.map((axis, k) => [axis.symbol, axisValue(axis, [i, j][k]), axis.label]), ...derivedValues({ i, j }),
    ...computed("class", "class", (index) => (map.classes[index] === "periodic" ? period(id) : map.classes[index])),
    ...measured,
    ...computed("symmetric", "symmetric", (flag) => ["no", "yes"][flag]),
    ...computed("pattern", "pattern", spelled(map.patterns)),
    ...computed("word", "word", spelled(map.words)),
    ...computed("attractors", "attractors found", (count) => count),
    ...computed("attractor", "attractor", (label) => map.attractors[label]),
    ["status", map.statuses[at("status")]],
    ...computed("source", "source", () => source),
    ["periods run", at("periods_run")],
    ["cell", `${i}, ${j}`],
  ];
}

// Returns the period of a cell; a legend can say more about it, as in "period 1, no contact".
function period(id) {
  const text = `period ${values.period[id]}`;
  const entries = map.layers.filter((of) => of.indices).map(({ entries, palette, indices }) =>
    entries.find(({ color }) => color === palette[indices[id]])?.text);
  return entries.find((entry) => entry?.startsWith(`${text},`)) ?? text;
}

function updateReadout() {
  const cell = pointerCell ?? selectedCell;
  byId("which").textContent = !pointerCell && selectedCell ? "Selected cell" : "Under the pointer";
  const lines = facts(cell ?? { i: 0, j: 0 }).map(([name, value, meaning]) => {
    const row = element("tr");
    const head = element("th", name);
    if (meaning) head.title = meaning;
    row.append(head, element("td", cell ? String(value ?? "\u2013") : "\u2013"));
    return row;
  });
  byId("readout").replaceChildren(...lines);
}

function choose(cell) {
  selectedCell = cell;
  byId("replay").hidden = !cell;
  if (cell) {
    const [a, b] = [axisValue(map.axes[0], cell.i), axisValue(map.axes[1], cell.j)];
    const place = 4 * (cell.j * columns + cell.i);
    const own = (map.start ?? starts?.subarray(place, place + 4))?.slice(0, map.components);
    const start = own ? ` --start ${[...own].map((x, k) => [a, b][map.axes.findIndex((axis) => axis.start === k)] ?? x).join(",")}` : "";
    const sets = map.axes.map((axis, k) => (axis.start === undefined ? ` --set ${axis.parameter}=${[a, b][k]}` : "")).join("");
    const derived = derivedValues(cell).map(([name, value]) => ` --set ${name}=${value}`).join("");
    const words = `rattlemap orbit${sets}${derived}${map.replay}${start}`.split(" --");
    // Lines break only between arguments.
    byId("command").replaceChildren(...words.flatMap((word, k) =>
      k === 0 ? [element("span", word)] : [" ", element("span", `--${word}`)]));
  }
  showOrbit(cell);
  updateReadout();
  updateLink();
  draw();
}

// Shows the scene of the visible cells, with the resolution of the whole map, and the command that computes it.
function showScene() {
  const lines = (axis, [first, last]) => {
    const name = JSON.stringify(axis.parameter);
    const head = `[[axis]]\n${axis.start === undefined ? "parameter" : "start"} = ${name}\n`;
    if (axis.scale === "values") return `${head}values = [${axis.values.slice(first, last + 1).join(", ")}]\n`;
    return `${head}min = ${axisValue(axis, first)}\nmax = ${axisValue(axis, last)}\ncount = ${axis.count}\n`
      + (axis.scale === "linear" ? "" : `scale = "${axis.scale}"\n`);
  };
  const [a, b] = map.axes;
  byId("scene").textContent = [map.scene, lines(a, visible(a, view.left, view.width)), lines(b, visible(b, view.bottom, view.height))].join("\n");
}

// Copies the text of an element when its button is pressed.
function copies(button, text) {
  const label = button.textContent;
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(text.textContent);
      button.textContent = "Copied";
    } catch {
      // A page opened from a disk cannot always write to the clipboard.
      getSelection().selectAllChildren(text);
      button.textContent = "Selected: press Ctrl-C";
    }
    setTimeout(() => { button.textContent = label; }, 1500);
  });
}
for (const name of ["command", "scene", "compute"]) copies(byId(`copy-${name}`), byId(name));

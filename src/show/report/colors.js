// The colours of a layer: its range of numbers, which fits the visible cells, and its legend.

// Text of the only legend entry whose cells are shown; null shows all cells.
/** @type {any} */ let isolated = null;
// Colour of the cells that are not shown.
const HIDDEN = "b8b8b8";

// Returns the palette of a layer. If an entry is isolated, all other colours are replaced.
/** @type {(layer: Layer) => string[]} */
function isolatedPalette({ palette, entries, entry_of: of }) {
  const entry = entries.findIndex(({ text }) => text === isolated);
  return entry < 0 ? palette : palette.map((color, index) => (of[index] === entry ? color : HIDDEN));
}

// Whether the colours span the numbers of the whole map.
let spansMap = false;

// Largest share of the visible numbers beyond an end of the range, and largest number of cells that are inspected.
const BEYOND = 0.005;
const INSPECTED = 200000;

// Returns the ends of the numbers in the visible cells; those of the whole map if all cells are visible or none has a number.
/** @type {(sheet: Sheet, layer: Layer) => number[]} */
function visibleRange({ place, columns: across, rows: up }, { bar: { low, high, anchors, is_fixed: isFixed }, values: numbers }) {
  if (spansMap || isFixed || showsAll()) return [low, high];
  const [width, height] = [place.width / across, place.height / up];
  const [i0, i1] = visible(across, (view.left - place.left) / width, view.width / width);
  const [j0, j1] = visible(up, (view.bottom - place.bottom) / height, view.height / height);
  const step = Math.max(1, Math.ceil(Math.sqrt(((i1 - i0 + 1) * (j1 - j0 + 1)) / INSPECTED)));
  const found = [];
  for (let j = j0; j <= j1; j += step) {
    for (let i = i0; i <= i1; i += step) {
      const number = numbers[j * across + i];
      if (Number.isFinite(number)) found.push(number);
    }
  }
  const sorted = Float64Array.from(found).sort();
  const last = sorted.length - 1;
  let [from, to] = [sorted[Math.floor(BEYOND * last)], sorted[Math.ceil((1 - BEYOND) * last)]];
  // The colour of zero separates signs, so it keeps its place.
  for (const [zero] of anchors.slice(1, -1)) [from, to] = [Math.min(from, zero), Math.max(to, zero)];
  return from < to ? [from, to] : [low, high];
}

// Returns a function from a number to the index of its colour, which is linear between the anchors. The ends of the range
// replace the outer anchors. The last index is for cells without a number.
/** @type {(layer: any) => (number: number) => number} */
function levels({ bar: { anchors }, range: [from, to], palette }) {
  const numbers = [from, ...anchors.slice(1, -1).map((/** @type {[number, number]} */ [number]) => number), to];
  return (number) => {
    if (Number.isNaN(number)) return palette.length - 1;
    const k = numbers.length > 2 && number > numbers[1] ? 1 : 0;
    const [x0, x1, y0, y1] = [numbers[k], numbers[k + 1], anchors[k][1], anchors[k + 1][1]];
    if (number <= x0 && number < x1) return Math.round(y0);
    return number >= x1 ? Math.round(y1) : Math.round(y0 + ((y1 - y0) * (number - x0)) / (x1 - x0));
  };
}

// Fits the colours of the current layer to the visible cells.
function fitColors() {
  const sheet = uppermost();
  const current = layerOf(sheet);
  if (!current.ready) return;
  const scale = scaleLayer();
  if (scale.values) scale.range = visibleRange(scale === current ? sheet : base, scale);
  showBar(scale.values ? scale : current);
  showLegend(current);
  draw();
}

// Colours, ticks and heading of the bar that is shown; none if the layer has no bar.
/** @type {any} */ let shownBar = null;

// The kinds of the bifurcation curves that are shown, as entries of the legend.
const curveKinds = () => (showsCurves() ? [...new Map((map.curves?.list ?? []).map(({ kind, color }) => [kind, color]))] : [])
  .map(([text, color]) => ({ text, color, share: "" }));

/** @type {(layer: Layer) => void} */
function showBar(current) {
  shownBar = null;
  byId("bar").replaceChildren();
  byId("span").hidden = !current.values;
  if (!current.bar) return;
  const { low: least, high: most, label, left_out: beyond, colors: all } = current.bar;
  const [low, high] = current.range ?? [least, most];
  const level = current.values && levels({ ...current, range: [low, high] });
  const colors = level ? Array.from({ length: 44 }, (_, k) => current.palette[level(low + ((high - low) * k) / 43)]) : all;
  const ramp = element("div", undefined, "ramp");
  ramp.style.background = `linear-gradient(to right, ${colors.map((/** @type {string} */ c) => `#${c}`).join(",")})`;
  const scale = element("div", undefined, "ticks");
  const { marks, factor } = barTicks(current.bar, low, high);
  const places = marks.map(([value, text]) => ({ share: (value - low) / (high - low), text }));
  for (const { share, text } of places) {
    const tick = element("span", text);
    tick.style.left = `${100 * share}%`;
    // Labels are centred; near the ends of the bar they stay inside it.
    tick.style.transform = `translateX(${-50 * (within(share / 0.06, 0, 1) + within((share - 0.94) / 0.06, 0, 1))}%)`;
    scale.append(tick);
  }
  const isWhole = low === least && high === most;
  const fits = current.values || current.bar.is_fixed ? [] : ["The greys fit this picture: another view has a scale of its own."];
  const remarks = isWhole ? [...fits, ...beyond] : [`The colours fit the visible cells; at most ${100 * BEYOND}\u00a0% of these lie beyond each end.`];
  const heading = label === current.title ? factor.replace(/^, /, "") : label + factor;
  shownBar = { colors, places, heading };
  byId("bar").append(...(heading ? [element("div", heading)] : []), ramp, scale,
    ...remarks.map((text) => element("div", text, "beyond")));
}

/** @type {(index: number) => void} */
function showLayer(index) {
  if (layer !== index) isolated = null;
  layer = index;
  [...byId("layers").children].forEach((button, k) => {
    button.setAttribute("aria-checked", k === layer);
    button.tabIndex = k === layer ? 0 : -1;
  });
  const list = byId("layers");
  const { offsetTop: top, offsetHeight: height } = list.children[layer];
  list.scrollTop = within(list.scrollTop, top + height - list.offsetTop - list.clientHeight, top - list.offsetTop);
  fitColors();
  updateLink();
  share();
}

// Lists the named colours with their shares of the cells. An entry of a layer without numbers can be shown alone.
/** @type {(layer: Layer) => void} */
function showLegend(current) {
  byId("legend-title").textContent = current.title;
  const focused = document.activeElement?.closest("#legend button")?.children[1].textContent;
  byId("legend").replaceChildren(...current.entries.map(({ color, text, share }) => {
    const patch = element("span", undefined, "patch");
    patch.style.background = `#${color}`;
    const name = element("span", text);
    name.title = text;
    const parts = [patch, name, element("span", share)];
    const item = element("li");
    if (current.values) {
      item.append(...parts);
      return item;
    }
    const button = newButton(parts, "show these cells alone", () => {
      isolated = text === isolated ? null : text;
      fitColors();
    });
    button.setAttribute("aria-pressed", text === isolated);
    item.append(button);
    return item;
  }));
  byId("legend").append(...curveKinds().map(({ text, color }) => {
    const line = element("span", undefined, "patch line");
    line.style.background = `#${color}`;
    const item = element("li");
    item.append(line, element("span", text), element("span", ""));
    return item;
  }));
  // New records make the list anew. The focus stays on its row.
  if (focused) [...byId("legend").querySelectorAll("button")].find(({ children }) => children[1].textContent === focused)?.focus();
  if (["word", "pattern"].includes(current.name) && map.letters) byId("legend").append(element("li", map.letters, "beyond"));
}

byId("whole").addEventListener("change", (/** @type {any} */ event) => {
  spansMap = event.target.checked;
  fitColors();
  updateLink();
});

// The colours of a layer: its range of numbers, which fits the visible cells, and its legend.

// Text of the only legend entry whose cells are shown; null shows all cells.
let isolated = null;
// Colour of the cells that are not shown.
const HIDDEN = "b8b8b8";

// Returns the palette of a layer. If an entry is isolated, all other colours are replaced.
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
function visibleRange({ place, columns: across, rows: up }, { bar: { low, high }, values: numbers }) {
  if (spansMap || showsAll()) return [low, high];
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
  if (low < 0) [from, to] = [Math.min(from, 0), Math.max(to, 0)];
  return from < to ? [from, to] : [low, high];
}

// Returns the index of a number's colour. The last index is for cells without a number.
function level({ bar: { low, high }, range: [from, to], palette }, number) {
  const last = palette.length - 2;
  if (Number.isNaN(number)) return last + 1;
  let share;
  if (low >= 0) share = (number - from) / (to - from);
  // Each side of zero uses all its colours.
  else share = ((number < 0 ? low * Math.min(number / from, 1) : to > 0 ? high * Math.min(number / to, 1) : 0) - low) / (high - low);
  return Math.round(last * within(share, 0, 1));
}

// Fits the colours of the current layer to the visible cells.
function fitColors() {
  const sheet = uppermost();
  const current = layerOf(sheet);
  if (!current.ready) return;
  const scale = scaleLayer();
  if (scale.values) scale.range = visibleRange(scale === current ? sheet : base, scale);
  showBar(scale.values ? scale : current);
  showLegend(sheet, current);
  draw();
}

function showBar(current) {
  byId("bar").replaceChildren();
  byId("span").hidden = !current.values;
  if (!current.bar) return;
  const { low: least, high: most, label, left_out: beyond, colors: all } = current.bar;
  const [low, high] = current.range ?? [least, most];
  const colors = current.values
    ? Array.from({ length: 44 }, (_, k) => current.palette[level(current, low + ((high - low) * k) / 43)]) : all;
  const ramp = element("div", undefined, "ramp");
  ramp.style.background = `linear-gradient(to right, ${colors.map((c) => `#${c}`).join(",")})`;
  const scale = element("div", undefined, "ticks");
  for (const [value, text] of ticks(low, high, 6)) {
    const tick = element("span", text);
    const share = (value - low) / (high - low);
    tick.style.left = `${100 * share}%`;
    // Labels are centred; near the ends of the bar they stay inside it.
    tick.style.transform = `translateX(${-50 * (within(share / 0.06, 0, 1) + within((share - 0.94) / 0.06, 0, 1))}%)`;
    scale.append(tick);
  }
  const isWhole = low === least && high === most;
  const remarks = isWhole ? beyond : [`The colours fit the visible cells; at most ${100 * BEYOND}\u00a0% of these lie beyond each end.`];
  byId("bar").append(...(label === current.title ? [] : [element("div", label)]), ramp, scale,
    ...remarks.map((text) => element("div", text, "beyond")));
}

function showLayer(index) {
  if (layer !== index) isolated = null;
  layer = index;
  [...byId("layers").children].forEach((button, k) => button.setAttribute("aria-checked", k === layer));
  fitColors();
  updateLink();
  share();
}

// Lists the named colours with their shares of the cells. An entry of a layer without numbers can be shown alone.
function showLegend({ columns: across, rows: up }, current) {
  byId("legend-title").textContent = current.title;
  byId("legend").replaceChildren(...current.entries.map(({ color, text, cells }) => {
    const patch = element("span", undefined, "patch");
    patch.style.background = `#${color}`;
    const share = (100 * cells) / (across * up);
    const few = cells === 1 ? "1 cell" : `${cells} cells`;
    const name = element("span", text);
    name.title = text;
    const parts = [patch, name, element("span", share < 0.1 ? few : `${share.toFixed(1)} %`)];
    const item = element("li");
    if (current.values) {
      item.append(...parts);
      return item;
    }
    const button = element("button");
    button.type = "button";
    button.title = "show these cells alone";
    button.setAttribute("aria-pressed", text === isolated);
    button.append(...parts);
    button.addEventListener("click", () => {
      isolated = text === isolated ? null : text;
      fitColors();
    });
    item.append(button);
    return item;
  }));
}

byId("whole").addEventListener("change", (event) => {
  spansMap = event.target.checked;
  fitColors();
  updateLink();
});

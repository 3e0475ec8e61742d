// The colours of a layer: its range of numbers, which fits the visible cells, and its legend.

// Whether the colours span the numbers of the whole map.
let spansMap = false;

// Largest share of the visible numbers beyond an end of the range, and largest number of cells that are inspected.
const BEYOND = 0.005;
const INSPECTED = 200000;

// Returns the ends of the numbers in the visible cells; those of the whole map if all cells are visible or none has a number.
function visibleRange({ bar: { low, high }, values: numbers }) {
  if (spansMap || showsAll()) return [low, high];
  const [i0, i1] = visible(map.axes[0], view.left, view.width);
  const [j0, j1] = visible(map.axes[1], view.bottom, view.height);
  const step = Math.max(1, Math.ceil(Math.sqrt(((i1 - i0 + 1) * (j1 - j0 + 1)) / INSPECTED)));
  const found = [];
  for (let j = j0; j <= j1; j += step) {
    for (let i = i0; i <= i1; i += step) {
      const number = numbers[j * columns + i];
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
  const top = palette.length - 2;
  if (Number.isNaN(number)) return top + 1;
  let share;
  if (low >= 0) share = (number - from) / (to - from);
  // Each side of zero uses all its colours.
  else share = ((number < 0 ? low * Math.min(number / from, 1) : to > 0 ? high * Math.min(number / to, 1) : 0) - low) / (high - low);
  return Math.round(top * within(share, 0, 1));
}

// Fits the colours of the current layer to the visible cells.
function fitColors() {
  const current = map.layers[layer];
  if (!current.ready) return;
  if (current.values) {
    const range = visibleRange(current);
    if (!current.range || range.some((end, k) => end !== current.range[k])) {
      current.range = range;
      current.picture = null;
    }
  }
  showBar(current);
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
  layer = index;
  const current = map.layers[layer];
  [...byId("layers").children].forEach((button, k) => button.setAttribute("aria-checked", k === layer));
  byId("legend-title").textContent = current.title;
  byId("legend").replaceChildren(...current.entries.map(({ color, text, cells }) => {
    const patch = element("span", undefined, "patch");
    patch.style.background = `#${color}`;
    const share = (100 * cells) / (columns * rows);
    const item = element("li");
    const name = element("span", text);
    name.title = text;
    const few = cells === 1 ? "1 cell" : `${cells} cells`;
    item.append(patch, name, element("span", share < 0.1 ? few : `${share.toFixed(1)} %`));
    return item;
  }));
  fitColors();
  updateLink();
}

byId("whole").addEventListener("change", (event) => {
  spansMap = event.target.checked;
  fitColors();
  updateLink();
});

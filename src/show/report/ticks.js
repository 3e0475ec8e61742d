// Ticks of the axes and of the colour bar. A worker chooses them with the code of the program's figures. Until it answers, the
// ticks that are known move with the view.

// Least distance of labels in pixels, along both axes.
const SPACING = [90, 55];

// The worker, a promise; none before the first request.
/** @type {any} */ let chooser = null;
// What the worker chooses ticks for, by the number of the request.
/** @type {any[]} */
const asked = [];

// Starts the worker. Without it the page keeps the ticks of the program's map.
async function startChooser() {
  const module = await compiled();
  return newWorker(module, ({ id, ticks }) => {
    if (!ticks) return;
    const { owner, use } = asked[id];
    delete asked[id];
    owner.ticks = JSON.parse(ticks);
    use();
  }, () => {});
}

// Returns the ticks of an axis or a bar, and requests them if they are those of another range. The arguments are those of
// `report::ticks`. Calls `use` when the ticks are there.
/** @type {(owner: Axis | Bar, request: any, use: () => void) => Ticks} */
function ticksOf(owner, request, use) {
  const text = JSON.stringify(request);
  if (owner.asked !== text) {
    owner.asked = text;
    const id = asked.push({ owner, use }) - 1;
    chooser ??= startChooser();
    chooser.then((/** @type {Worker} */ worker) => worker.postMessage({ task: "ticks", id, ...request })).catch(() => {});
  }
  return owner.ticks;
}

// Returns the position on the scale of an axis: a value, a decimal logarithm, or an index of the listed values.
/** @type {(axis: Axis, place: number) => number} */
function onScale({ min, max, count, scale }, place) {
  if (scale === "values") return place - 0.5;
  const [from, to] = scale === "log" ? [Math.log10(min), Math.log10(max)] : [min, max];
  return from + ((place - 0.5) * (to - from)) / (count - 1);
}

// Returns the visible ticks of an axis, at their positions in cells, and the common factor of their labels.
/** @type {(k: number, from: number, extent: number, length: number) => Ticks} */
function axisTicks(k, from, extent, length) {
  const axis = map.axes[k];
  const { scale, values = [] } = axis;
  const ends = [from, from + extent].map((place) => onScale(axis, place));
  const listed = scale === "values" ? values : [];
  const { marks, factor } = ticksOf(axis, { scale, ends, listed, length, spacing: SPACING[k] }, draw);
  /** @type {(mark: [number, string]) => boolean} */
  const isVisible = ([place]) => place >= from && place <= from + extent;
  const placed = marks.map(([value, text]) => /** @type {[number, string]} */ ([placeOf(axis, value), text]));
  return { marks: placed.filter(isVisible), factor };
}

// Returns the visible ticks of a colour bar, with the common factor.
/** @type {(bar: Bar, low: number, high: number) => Ticks} */
function barTicks(bar, low, high) {
  const { marks, factor } = ticksOf(bar, { scale: "linear", ends: [low, high], listed: [], length: 6, spacing: 1 }, fitColors);
  return { marks: marks.filter(([value]) => value >= low && value <= high), factor };
}

// Zooming, panning, choosing a cell with pointer or keys, and the link to what is shown.

// Smallest width or height of a view, in cells: four if the page cannot compute finer cells, else almost zero.
/** @type {(axis: Axis) => number} */
const leastExtent = (axis) => (map.live && axis.scale !== "values" ? 1e-9 * axis.count : Math.min(4, axis.count));

// Returns the nearest width and height that a view may have.
/** @type {(width: number, height: number) => number[]} */
const allowed = (width, height) =>
  [within(width, leastExtent(map.axes[0]), columns), within(height, leastExtent(map.axes[1]), rows)];

/** @type {(factor: number, x: number, y: number) => void} */
function zoom(factor, x, y) {
  const p = plotArea();
  const [u, v] = [(x - p.x) / p.width, (p.y + p.height - y) / p.height];
  const [width, height] = allowed(view.width * factor, view.height * factor);
  view = { left: view.left + u * (view.width - width), bottom: view.bottom + v * (view.height - height), width, height };
  keepInside();
}

function keepInside() {
  view.left = within(view.left, 0, columns - view.width);
  view.bottom = within(view.bottom, 0, rows - view.height);
  hover();
  settle();
  share();
}

// Updates colours, scene, link and computed cells 150 ms after the last change of the view.
let resting = 0;
function settle() {
  clearTimeout(resting);
  resting = setTimeout(() => {
    fitColors();
    showScene();
    updateLink();
    wish();
  }, 150);
}

const pointers = new Map();
let moved = 0;
// The rectangle that is being drawn with the shift key, and the position where it began.
/** @type {any} */ let drawnRectangle = null;
/** @type {any} */ let corner = null;
// What the curve is on which the last click was.
let chosenCurve = "";
// The pixel under the pointer; none outside the canvas.
/** @type {[number, number] | null} */ let hovered = null;

canvas.addEventListener("wheel", (/** @type {WheelEvent} */ event) => {
  event.preventDefault();
  zoom(Math.exp(0.0015 * event.deltaY), event.offsetX, event.offsetY);
}, { passive: false });

canvas.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
  moved = 0;
  corner = event.shiftKey || isPressed("draw-rectangle") ? position(event.offsetX, event.offsetY) : null;
});

canvas.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => {
  /** @type {[number, number]} */
  const here = [event.offsetX, event.offsetY];
  const before = pointers.get(event.pointerId);
  if (!before) {
    hover(here);
    return;
  }
  hovered = here;
  const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
  pointers.set(event.pointerId, here);
  moved += Math.hypot(here[0] - before[0], here[1] - before[1]);
  if (moved < 4) return;
  if (corner) {
    const [u, v] = position(...here);
    drawnRectangle = { left: Math.min(u, corner[0]), bottom: Math.min(v, corner[1]),
      width: Math.abs(u - corner[0]), height: Math.abs(v - corner[1]) };
    draw();
    return;
  }
  canvas.classList.add("dragging");
  const p = plotArea();
  if (others.length === 1) {
    /** @type {(at: number[]) => number} */
    const apart = (at) => Math.max(Math.hypot(at[0] - others[0][0], at[1] - others[0][1]), 1);
    zoom(apart(before) / apart(here), (here[0] + others[0][0]) / 2, (here[1] + others[0][1]) / 2);
  } else {
    view.left -= ((here[0] - before[0]) / p.width) * view.width;
    view.bottom += ((here[1] - before[1]) / p.height) * view.height;
    keepInside();
  }
});

canvas.addEventListener("pointerup", (/** @type {PointerEvent} */ event) => {
  pointers.delete(event.pointerId);
  canvas.classList.remove("dragging");
  if (drawnRectangle) {
    showView(drawnRectangle);
    drawnRectangle = null;
    press("draw-rectangle", false);
    return;
  }
  const cell = cellAt(event.offsetX, event.offsetY);
  if (moved < 4 && cell) {
    choose(cell, curveAt(event.offsetX, event.offsetY));
  }
});
canvas.addEventListener("pointercancel", (/** @type {PointerEvent} */ event) => pointers.delete(event.pointerId));
canvas.addEventListener("pointerleave", () => hover(null));

// Finds the cell under the pointer again after the pointer, the view or the sheets have changed.
function hover(at = hovered) {
  hovered = at;
  pointerCell = at && cellAt(...at);
  byId("curve").textContent = (pointerCell && at && curveAt(...at)) || (showsCurves() ? chosenCurve : "");
  updateReadout();
  draw();
}

// Shows a rectangle, in cells. One that is too small or outside the map is enlarged or moved.
/** @type {(place: Place) => void} */
function showView({ left, bottom, width, height }) {
  const [across, up] = allowed(width, height);
  view = { left, bottom, width: across, height: up };
  keepInside();
}
const showAll = () => showView(everything);
canvas.addEventListener("dblclick", () => showAll());
byId("home").addEventListener("click", () => showAll());
byId("back").addEventListener("click", () => history.back());

/** @type {(id: string) => boolean} */
const isPressed = (id) => byId(id).getAttribute("aria-pressed") === "true";
/** @type {(id: string, isOn: boolean) => void} */
const press = (id, isOn) => byId(id).setAttribute("aria-pressed", isOn);
byId("draw-rectangle").addEventListener("click", () => press("draw-rectangle", !isPressed("draw-rectangle")));

document.addEventListener("keydown", (event) => {
  // Keys typed into a field do not control the map.
  if (event.ctrlKey || event.metaKey || event.altKey || event.target instanceof HTMLInputElement) return;
  const p = plotArea();
  /** @type {Record<string, number[]>} */
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  const number = Number(event.key);
  if (event.key === "+" || event.key === "=") zoom(0.7, p.x + p.width / 2, p.y + p.height / 2);
  else if (event.key === "-") zoom(1 / 0.7, p.x + p.width / 2, p.y + p.height / 2);
  else if (event.key === "0") showAll();
  else if (number >= 1 && number <= map.layers.length) showLayer(number - 1);
  else if (steps[event.key] && event.target === canvas) {
    event.preventDefault();
    const sheet = uppermost();
    const { width, height } = rectangle({ sheet, i: 0, j: 0 });
    let [u, v] = [view.left + view.width / 2, view.bottom + view.height / 2];
    const from = selectedCell ?? pointerCell;
    if (from) {
      const [di, dj] = steps[event.key];
      [u, v] = centreOf(from);
      [u, v] = [u + di * width, v + dj * height];
    }
    hovered = pointerCell = null;
    const { place } = sheet;
    choose(cellOf(sheet, within(u, place.left + width / 2, place.left + place.width - width / 2),
      within(v, place.bottom + height / 2, place.bottom + place.height - height / 2)));
    follow(selectedCell);
  }
});

// Moves the view so that it contains a cell.
/** @type {(cell: any) => void} */
function follow(cell) {
  const { left: i, bottom: j, width, height } = rectangle({ sheet: base, ...cell });
  const [left, bottom] = [within(view.left, i + width - view.width, i), within(view.bottom, j + height - view.height, j)];
  if (left === view.left && bottom === view.bottom) return;
  view = { ...view, left, bottom };
  keepInside();
}

// What the page shows, without a second panel, and the view that the address names.
let link = "";
let addressed = "";

// Writes layer, parameters, cell, view and choice of colours into the link. The browser's Back undoes a change of the view.
function updateLink() {
  const parts = ["v=1", `layer=${encodeURIComponent(map.layers[layer].name)}`];
  for (const [name, value] of Object.entries(changes)) parts.push(`set=${encodeURIComponent(name)}:${value}`);
  // The link stores the centre minus 0.5: the index of a cell of the program's map.
  const centre = awaited ?? (selectedCell && centreOf(selectedCell));
  if (centre) parts.push(`cell=${centre.map((/** @type {number} */ x) => Number((x - 0.5).toPrecision(12))).join(",")}`);
  if (!showsAll()) parts.push(`view=${[view.left, view.bottom, view.width, view.height].join(",")}`);
  if (spansMap) parts.push("colors=map");
  link = parts.join("&");
  if (isSecond) {
    shareLink();
    return;
  }
  try {
    const now = JSON.stringify(view);
    const address = `#${link}${second ? `&beside=${encodeURIComponent(second.link)}` : ""}`;
    if (addressed && addressed !== now) history.pushState({ isOwn: true }, "", address);
    else history.replaceState(history.state, "", address);
    addressed = now;
    byId("back").disabled = !history.state?.isOwn;
  } catch {
    // A page in a frame of a notebook has no address of its own.
  }
}

// Position of a cell that the link names and that has yet to be computed.
/** @type {[number, number] | null} */ let awaited = null;

// Shows what a link names; it may name nothing.
/** @type {(text: string) => void} */
function readLink(text) {
  const named = new URLSearchParams(text);
  /** @type {(name: string) => number[]} */
  const numbers = (name) => (named.get(name) ?? "").split(",").map((text) => (text === "" ? NaN : Number(text)));
  spansMap = byId("whole").checked = named.get("colors") === "map";
  const sets = named.getAll("set").map((text) => text.split(":")).map(([name, value]) => [name, Number(value)]);
  changes = Object.fromEntries(sets.filter(([name, value]) => Number.isFinite(value) && map.parameters.some((own) => own.name === name)));
  addressed = "";
  showParameters();
  dropStale();
  const [left, bottom, width, height] = numbers("view");
  view = { ...everything };
  if ([left, bottom, width, height].every(Number.isFinite)) {
    const [across, up] = allowed(width, height);
    view = { left, bottom, width: across, height: up };
  }
  const [i, j] = numbers("cell");
  /** @type {(index: number, count: number) => boolean} */
  const exists = (index, count) => index > -0.5 && index < count - 0.5;
  const isNamed = exists(i, columns) && exists(j, rows);
  const isOwn = isNamed && !isChanged() && Number.isInteger(i) && Number.isInteger(j);
  showLayer(Math.max(map.layers.findIndex(({ name }) => name === named.get("layer")), 0));
  choose(isOwn ? { i, j } : null);
  awaited = isNamed && !isOwn ? [i + 0.5, j + 0.5] : null;
  const beside = named.get("beside");
  if (beside !== null) openSecond(beside);
  else if (second) closeSecond();
  keepInside();
  updateLink();
}
const readAddress = () => readLink(location.hash.slice(1));
addEventListener("hashchange", readAddress);

// Zooming, panning, choosing a cell with pointer or keys, and the link to what is shown.

function zoom(factor, x, y) {
  const p = panel();
  const [u, v] = [(x - p.x) / p.width, (p.y + p.height - y) / p.height];
  const width = Math.min(columns, Math.max(4, view.width * factor));
  const height = Math.min(rows, Math.max(4, view.height * factor));
  view = { left: view.left + u * (view.width - width), bottom: view.bottom + v * (view.height - height), width, height };
  keepInside();
}

function keepInside() {
  view.left = within(view.left, 0, columns - view.width);
  view.bottom = within(view.bottom, 0, rows - view.height);
  draw();
  settle();
}

// Fits colours, scene and link to the view, once it rests.
let resting = 0;
function settle() {
  clearTimeout(resting);
  resting = setTimeout(() => {
    fitColors();
    showScene();
    updateLink();
  }, 150);
}

const pointers = new Map();
let moved = 0;

canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(0.0015 * event.deltaY), event.offsetX, event.offsetY);
}, { passive: false });

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
  moved = 0;
});

canvas.addEventListener("pointermove", (event) => {
  const here = [event.offsetX, event.offsetY];
  const before = pointers.get(event.pointerId);
  if (!before) {
    pointerCell = cellAt(...here);
    updateReadout();
    draw();
    return;
  }
  const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
  pointers.set(event.pointerId, here);
  moved += Math.hypot(here[0] - before[0], here[1] - before[1]);
  if (moved < 4) return;
  canvas.classList.add("dragging");
  const p = panel();
  if (others.length === 1) {
    const apart = (at) => Math.max(Math.hypot(at[0] - others[0][0], at[1] - others[0][1]), 1);
    zoom(apart(before) / apart(here), (here[0] + others[0][0]) / 2, (here[1] + others[0][1]) / 2);
  } else {
    view.left -= ((here[0] - before[0]) / p.width) * view.width;
    view.bottom += ((here[1] - before[1]) / p.height) * view.height;
    keepInside();
  }
});

canvas.addEventListener("pointerup", (event) => {
  pointers.delete(event.pointerId);
  canvas.classList.remove("dragging");
  const cell = cellAt(event.offsetX, event.offsetY);
  if (moved < 4 && cell) choose(cell);
});
canvas.addEventListener("pointercancel", (event) => pointers.delete(event.pointerId));
canvas.addEventListener("pointerleave", () => {
  pointerCell = null;
  updateReadout();
  draw();
});

function showAll() {
  view = { ...everything };
  keepInside();
}
canvas.addEventListener("dblclick", showAll);

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const p = panel();
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  const number = Number(event.key);
  if (event.key === "+" || event.key === "=") zoom(0.7, p.x + p.width / 2, p.y + p.height / 2);
  else if (event.key === "-") zoom(1 / 0.7, p.x + p.width / 2, p.y + p.height / 2);
  else if (event.key === "0") showAll();
  else if (number >= 1 && number <= map.layers.length) showLayer(number - 1);
  else if (steps[event.key]) {
    event.preventDefault();
    const [di, dj] = steps[event.key];
    const middle = { i: Math.floor(view.left + view.width / 2), j: Math.floor(view.bottom + view.height / 2) };
    const from = selectedCell ?? pointerCell;
    pointerCell = null;
    choose(from ? { i: within(from.i + di, 0, columns - 1), j: within(from.j + dj, 0, rows - 1) } : middle);
    follow(selectedCell);
  }
});

// Moves the view so that it contains a cell.
function follow({ i, j }) {
  const [left, bottom] = [within(view.left, i + 1 - view.width, i), within(view.bottom, j + 1 - view.height, j)];
  if (left === view.left && bottom === view.bottom) return;
  view = { ...view, left, bottom };
  keepInside();
}

// Writes layer, cell, view and choice of colours into the link.
function updateLink() {
  const parts = [`layer=${encodeURIComponent(map.layers[layer].name)}`];
  if (selectedCell) parts.push(`cell=${selectedCell.i},${selectedCell.j}`);
  if (!showsAll()) parts.push(`view=${[view.left, view.bottom, view.width, view.height].map((x) => Number(x.toFixed(2))).join(",")}`);
  if (spansMap) parts.push("colors=map");
  history.replaceState(null, "", `#${parts.join("&")}`);
}

// Shows what the link names; a link may name nothing.
function readLink() {
  const link = new URLSearchParams(location.hash.slice(1));
  const numbers = (name) => (link.get(name) ?? "").split(",").map((text) => (text === "" ? NaN : Number(text)));
  spansMap = byId("whole").checked = link.get("colors") === "map";
  const [left, bottom, width, height] = numbers("view");
  view = { ...everything };
  if ([left, bottom, width, height].every(Number.isFinite)) {
    view = { left, bottom, width: within(width, Math.min(4, columns), columns), height: within(height, Math.min(4, rows), rows) };
  }
  const [i, j] = numbers("cell");
  const exists = (index, count) => Number.isInteger(index) && index >= 0 && index < count;
  selectedCell = exists(i, columns) && exists(j, rows) ? { i, j } : null;
  showLayer(Math.max(map.layers.findIndex(({ name }) => name === link.get("layer")), 0));
  choose(selectedCell);
  keepInside();
}
addEventListener("hashchange", readLink);

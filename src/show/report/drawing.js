// Draws the visible part of the map, its axes, and frames around cells.
const canvas = byId("canvas");
const pen = canvas.getContext("2d");
const MARGIN = { left: 78, right: 28, top: 10, bottom: 58 };

const plotArea = () => {
  const { width, height } = canvas.getBoundingClientRect();
  return { x: MARGIN.left, y: MARGIN.top, width: width - MARGIN.left - MARGIN.right,
    height: height - MARGIN.top - MARGIN.bottom };
};

// Returns the position of a pixel, in cells of the program's map.
/** @type {(x: number, y: number) => [number, number]} */
function position(x, y) {
  const p = plotArea();
  return [view.left + ((x - p.x) / p.width) * view.width, view.bottom + ((p.y + p.height - y) / p.height) * view.height];
}

// Returns the uppermost cell at a pixel, or null.
/** @type {(x: number, y: number) => Cell | null} */
function cellAt(x, y) {
  const p = plotArea();
  if (x < p.x || x > p.x + p.width || y < p.y || y > p.y + p.height) return null;
  const sheets = shown().reverse();
  return sheets.map((sheet) => cellOf(sheet, ...position(x, y))).find((cell) => cell) ?? null;
}

// Returns the pixel of a position in cells. Cell i spans i to i + 1.
/** @type {(i: number, j: number) => [number, number]} */
function pixel(i, j) {
  const p = plotArea();
  return [p.x + ((i - view.left) / view.width) * p.width,
    p.y + p.height - ((j - view.bottom) / view.height) * p.height];
}

// Returns the position of a value of an axis, in cells.
/** @type {(axis: Axis, value: number) => number} */
function placeOf({ min, max, count, scale, values }, value) {
  if (scale === "values") return values.indexOf(value) + 0.5;
  const share = scale === "log" ? Math.log(value / min) / Math.log(max / min) : (value - min) / (max - min);
  return share * (count - 1) + 0.5;
}

// Share of the colour that a cell has while its record is a copy of a coarser one.
const PALE = 0.4;

// Draws a sheet into an image with one pixel per cell. Numbers get the colours of the layer `scale`.
/** @type {(sheet: Sheet, own: Layer, scale: any) => any} */
function paint(sheet, own, scale) {
  const { columns: across, rows: up } = sheet;
  const picture = document.createElement("canvas");
  [picture.width, picture.height] = [across, up];
  const brush = /** @type {any} */ (picture.getContext("2d"));
  const image = brush.createImageData(across, up);
  const pixels = new Uint32Array(image.data.buffer);
  const palettes = [1, PALE].map((depth) => Uint32Array.from(own.values ? scale.palette : isolatedPalette(own), (text) => {
    const [red, green, blue] = [0, 2, 4].map((at) => Math.round(255 - depth * (255 - parseInt(text.slice(at, at + 2), 16))));
    return (0xff000000 | (blue << 16) | (green << 8) | red) >>> 0;
  }));
  const level = own.values && levels(scale);
  /** @type {(id: number) => number} */
  const index = own.values ? (id) => level(own.values[id]) : (id) => own.indices[id];
  for (let j = 0; j < up; j++) {
    const [from, to] = [j * across, (up - 1 - j) * across];
    for (let i = 0; i < across; i++) pixels[to + i] = palettes[sheet.pending?.[from + i] ?? 0][index(from + i)];
  }
  brush.putImageData(image, 0, 0);
  return picture;
}

// Fits the canvas to its element, and returns the element's size.
function fitCanvas() {
  const ratio = window.devicePixelRatio || 1;
  const { width, height } = canvas.getBoundingClientRect();
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
  }
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  return [width, height];
}

function draw() {
  pen.clearRect(0, 0, ...fitCanvas());
  const p = plotArea();
  const scale = scaleLayer();
  if (!scale?.ready) return;
  if (scale.values) scale.range ??= visibleRange(uppermost(), scale);
  pen.save();
  pen.beginPath();
  pen.rect(p.x, p.y, p.width, p.height);
  pen.clip();
  // Averaging cells would produce colours that represent something else.
  pen.imageSmoothingEnabled = false;
  const sheets = isRanked(scale) && shown().length ? [uppermost()] : shown();
  // After a change of parameters, the program's map is drawn faintly until the first new picture is computed.
  pen.globalAlpha = sheets.length ? 1 : 0.3;
  for (const sheet of sheets.length ? sheets : [base]) {
    const own = layerOf(sheet);
    const key = JSON.stringify([own.values ? [scale.range, scale.bar.low, scale.bar.high] : isolated]);
    if (own.key !== key) [own.key, own.picture] = [key, paint(sheet, own, scale)];
    box(sheet.place, (...at) => pen.drawImage(own.picture, ...at));
  }
  pen.globalAlpha = 1;
  drawCurves();
  if (pointerCell) frame(rectangle(pointerCell), "#0008", 8);
  if (selectedCell) frame(rectangle(selectedCell), "#000", 8);
  for (const [a, b] of uppermost().data.marks) mark(placeOf(map.axes[0], a), placeOf(map.axes[1], b));
  if (drawnRectangle) frame(drawnRectangle, "#000", 0);
  pen.restore();
  drawAxes(p);
}

// Calls a function with the pixels of a rectangle: x, y, width, height.
/** @type {(place: Place, use: (x: number, y: number, width: number, height: number) => void) => void} */
function box({ left, bottom, width, height }, use) {
  const [x, y] = pixel(left, bottom + height);
  const [right, below] = pixel(left + width, bottom);
  use(x, y, right - x, below - y);
}

// Draws a frame around a rectangle, at least as wide as `least` pixels.
/** @type {(around: Place, color: string, least: number) => void} */
function frame(around, color, least) {
  box(around, (x, y, width, height) => {
    const grow = Math.max(0, (least - width) / 2);
    const at = [x - grow, y - grow, width + 2 * grow, height + 2 * grow];
    pen.lineWidth = 3.5;
    pen.strokeStyle = "#fff";
    pen.strokeRect(...at);
    pen.lineWidth = 1.5;
    pen.strokeStyle = color;
    pen.strokeRect(...at);
  });
}

// Whether the bifurcation curves are drawn: they belong to the parameters of the program's map.
const showsCurves = () => Boolean(map.curves?.ready) && byId("show-curves").checked && !isChanged();

// Returns the parts of curves that can be visible, and functions from their places to pixels.
/** @type {() => { visible: any[], across: (k: number) => number, up: (k: number) => number }} */
function visibleCurves() {
  const curves = map.curves;
  const p = plotArea();
  const [a, b] = [p.width / view.width, p.height / view.height];
  const [left, bottom] = [p.x - view.left * a, p.y + p.height + view.bottom * b];
  const isVisible = (/** @type {Place} */ box) => box.left <= view.left + view.width && box.left + box.width >= view.left
    && box.bottom <= view.bottom + view.height && box.bottom + box.height >= view.bottom;
  return {
    visible: curves && showsCurves() ? curves.list.filter(({ box }) => isVisible(box)) : [],
    across: (k) => left + curves?.places[2 * k] * a,
    up: (k) => bottom - curves?.places[2 * k + 1] * b,
  };
}

// Draws the bifurcation curves, each with a white rim. Parts of unstable cycles are dashed.
function drawCurves() {
  const { visible, across, up } = visibleCurves();
  const stable = map.curves?.stable;
  /** @type {(from: number, to: number, width: number, color: string) => void} */
  const stroke = (from, to, width, color) => {
    pen.beginPath();
    for (let k = from; k < to; k++) pen.lineTo(across(k), up(k));
    pen.lineWidth = width;
    pen.strokeStyle = color;
    pen.stroke();
  };
  pen.lineJoin = "round";
  for (const { first, count } of visible) stroke(first, first + count, 3, "#fff");
  for (const { first, count, color } of visible) {
    for (let from = first, to = first; from < first + count; from = to) {
      while (to < first + count && stable[to] === stable[from]) to++;
      pen.setLineDash(stable[from] ? [] : [4, 3]);
      stroke(Math.max(from - 1, first), to, 1.5, `#${color}`);
    }
  }
  pen.setLineDash([]);
}

// Largest distance of the pointer from a curve that it names, in pixels.
const NEAR = 5;

// Says what the nearest curve at a pixel is; nothing if no curve is near.
/** @type {(x: number, y: number) => string} */
function curveAt(x, y) {
  const { visible, across, up } = visibleCurves();
  const places = map.curves?.places;
  let [least, text] = [NEAR, ""];
  for (const { first, count, kind, period, word } of visible) {
    for (let k = first + 1; k < first + count; k++) {
      const [a, b, c, d] = [across(k - 1), up(k - 1), across(k), up(k)];
      const share = within(((x - a) * (c - a) + (y - b) * (d - b)) / ((c - a) ** 2 + (d - b) ** 2) || 0, 0, 1);
      const apart = Math.hypot(a + share * (c - a) - x, b + share * (d - b) - y);
      if (apart >= least) continue;
      const at = [0, 1].map((i) => places[2 * k - 2 + i] + share * (places[2 * k + i] - places[2 * k - 2 + i]) - 0.5);
      const values = map.axes.map((axis, i) => `${axis.symbol} = ${Number(valueAt(axis, at[i]).toPrecision(6))}`);
      least = apart;
      text = `Curve: ${kind}, cycles of period ${period}, ${word ? `word ${word}` : "no events"}, at ${values.join(", ")}`;
    }
  }
  return text;
}

// Returns the value of an axis at a place between cells, also between the values of a list.
/** @type {(axis: Axis, i: number) => number} */
function valueAt(axis, i) {
  if (axis.scale !== "values") return axisValue(axis, i);
  const [low, share] = [Math.floor(i), i - Math.floor(i)];
  return axis.values[low] + share * ((axis.values[low + 1] ?? axis.values[low]) - axis.values[low]);
}

// Draws a circle at a position, for a strobe state of an attractor.
/** @type {(u: number, v: number) => void} */
function mark(u, v) {
  const [x, y] = pixel(u, v);
  for (const [width, color] of [[4, "#fff"], [1.8, "#262626"]]) {
    pen.beginPath();
    pen.arc(x, y, 5, 0, 2 * Math.PI);
    pen.lineWidth = width;
    pen.strokeStyle = color;
    pen.stroke();
  }
}

/** @type {(area: { x: number, y: number, width: number, height: number }) => void} */
function drawAxes(p) {
  pen.strokeStyle = pen.fillStyle = getComputedStyle(canvas).color;
  pen.lineWidth = 1;
  pen.strokeRect(p.x + 0.5, p.y + 0.5, p.width - 1, p.height - 1);
  pen.font = "13px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "top";
  const [across, up] = [axisTicks(0, view.left, view.width, p.width), axisTicks(1, view.bottom, view.height, p.height)];
  for (const [place, text] of across.marks) {
    const [x] = pixel(place, 0);
    pen.fillRect(Math.round(x), p.y + p.height, 1, text ? 6 : 3);
    // The last label must not exceed the edge.
    const half = pen.measureText(text).width / 2;
    pen.fillText(text, Math.min(x, p.x + p.width + MARGIN.right - half), p.y + p.height + 9);
  }
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (const [place, text] of up.marks) {
    const [, y] = pixel(0, place);
    const length = text ? 6 : 3;
    pen.fillRect(p.x - length, Math.round(y), length, 1);
    pen.fillText(text, p.x - 9, y);
  }
  pen.font = "14px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.fillText(map.axes[0].label + across.factor, p.x + p.width / 2, p.y + p.height + 44, p.width + 60);
  pen.save();
  pen.translate(14, p.y + p.height / 2);
  pen.rotate(-Math.PI / 2);
  pen.fillText(map.axes[1].label + up.factor, 0, 0, p.height + 40);
  pen.restore();
}

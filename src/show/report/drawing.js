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

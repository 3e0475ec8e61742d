// Draws the visible part of the map, its axes, and frames around cells.
const canvas = byId("canvas");
const pen = canvas.getContext("2d");
const MARGIN = { left: 78, right: 28, top: 10, bottom: 58 };

const panel = () => {
  const { width, height } = canvas.getBoundingClientRect();
  return { x: MARGIN.left, y: MARGIN.top, width: width - MARGIN.left - MARGIN.right,
    height: height - MARGIN.top - MARGIN.bottom };
};

function cellAt(x, y) {
  const p = panel();
  const i = Math.floor(view.left + ((x - p.x) / p.width) * view.width);
  const j = Math.floor(view.bottom + ((p.y + p.height - y) / p.height) * view.height);
  const inside = x >= p.x && x <= p.x + p.width && y >= p.y && y <= p.y + p.height;
  return inside && i >= 0 && i < columns && j >= 0 && j < rows ? { i, j } : null;
}

// Returns the pixel of a position in cells. Cell i spans i to i + 1.
function pixel(i, j) {
  const p = panel();
  return [p.x + ((i - view.left) / view.width) * p.width,
    p.y + p.height - ((j - view.bottom) / view.height) * p.height];
}

function ticks(low, high, most) {
  const rough = (high - low) / Math.max(most, 1);
  const decade = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * decade).find((s) => s >= rough * (1 - 1e-9));
  const digits = Math.min(12, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)));
  // Very small and very large numbers have a power of ten.
  const isPlain = digits < 6 && Math.max(Math.abs(low), Math.abs(high)) < 1e7;
  const text = (value) => (isPlain || value === 0 ? value.toFixed(isPlain ? digits : 0) : Number(value.toPrecision(6)).toExponential());
  const list = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n++) {
    list.push([n * step, text(n * step).replace(/^-(?=0\.?0*$)/, "").replaceAll("-", "\u2212")]);
  }
  return list;
}

// Returns positions (in cells) and labels of the ticks of an axis. Cell i has its value at i + 0.5.
function marks(axis, from, extent, most) {
  const { min, max, count, scale, values } = axis;
  if (scale === "linear") {
    const step = (max - min) / (count - 1);
    const value = (place) => min + (place - 0.5) * step;
    return ticks(value(from), value(from + extent), most).map(([at, text]) => [(at - min) / step + 0.5, text]);
  }
  const label = (value) => String(Number(value.toPrecision(4))).replaceAll("-", "\u2212");
  const list = [];
  if (scale === "log") {
    const step = Math.log10(max / min) / (count - 1);
    const place = (value) => Math.log10(value / min) / step + 0.5;
    const [low, high] = [from, from + extent].map((at) => Math.log10(min) + (at - 0.5) * step);
    const parts = most / (high - low) > 4 ? [1, 2, 5] : [1];
    const every = Math.ceil((high - low) / most);
    for (let power = Math.floor(low); power <= Math.ceil(high); power++) {
      if (power % every) continue;
      for (const part of parts) {
        const at = place(part * 10 ** power);
        if (at >= from && at <= from + extent) list.push([at, label(part * 10 ** power)]);
      }
    }
    if (list.length > 1) return list;
  }
  // Listed values, or a part of a logarithmic axis without round values.
  const every = Math.max(1, Math.ceil(extent / most));
  const first = Math.max(0, Math.ceil(from - 0.5));
  const cells = [];
  for (let i = Math.ceil(first / every) * every; i < count && i + 0.5 <= from + extent; i += every) {
    cells.push([i + 0.5, label(values[i])]);
  }
  return cells;
}

function paint(layer) {
  const picture = document.createElement("canvas");
  [picture.width, picture.height] = [columns, rows];
  const brush = picture.getContext("2d");
  const image = brush.createImageData(columns, rows);
  const pixels = new Uint32Array(image.data.buffer);
  const palette = Uint32Array.from(layer.palette, (c) => {
    const rgb = parseInt(c, 16);
    return (0xff000000 | ((rgb & 0xff) << 16) | (rgb & 0xff00) | (rgb >> 16)) >>> 0;
  });
  const index = layer.values ? (id) => level(layer, layer.values[id]) : (id) => layer.indices[id];
  for (let j = 0; j < rows; j++) {
    const [from, to] = [j * columns, (rows - 1 - j) * columns];
    for (let i = 0; i < columns; i++) pixels[to + i] = palette[index(from + i)];
  }
  brush.putImageData(image, 0, 0);
  return picture;
}

function draw() {
  const ratio = window.devicePixelRatio || 1;
  const { width, height } = canvas.getBoundingClientRect();
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
  }
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const p = panel();
  const current = map.layers[layer];
  if (!current.ready) return;
  current.picture ??= paint(current);
  pen.save();
  pen.beginPath();
  pen.rect(p.x, p.y, p.width, p.height);
  pen.clip();
  // Averaging cells would produce colours that represent something else.
  pen.imageSmoothingEnabled = false;
  const [x, y] = pixel(0, rows);
  const [right, bottom] = pixel(columns, 0);
  pen.drawImage(current.picture, x, y, right - x, bottom - y);
  for (const [cell, color] of [[pointerCell, "#0008"], [selectedCell, "#000"]]) if (cell) frame(cell, color);
  pen.restore();
  drawAxes(p);
}

function frame({ i, j }, color) {
  const [x, y] = pixel(i, j + 1);
  const [right, bottom] = pixel(i + 1, j);
  // The frame of a small cell is larger than the cell.
  const grow = Math.max(0, (8 - (right - x)) / 2);
  const box = [x - grow, y - grow, right - x + 2 * grow, bottom - y + 2 * grow];
  pen.lineWidth = 3.5;
  pen.strokeStyle = "#fff";
  pen.strokeRect(...box);
  pen.lineWidth = 1.5;
  pen.strokeStyle = color;
  pen.strokeRect(...box);
}

function drawAxes(p) {
  pen.strokeStyle = pen.fillStyle = "#262626";
  pen.lineWidth = 1;
  pen.strokeRect(p.x + 0.5, p.y + 0.5, p.width - 1, p.height - 1);
  pen.font = "13px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "top";
  for (const [place, text] of marks(map.axes[0], view.left, view.width, p.width / 90)) {
    const [x] = pixel(place, 0);
    pen.fillRect(Math.round(x), p.y + p.height, 1, 6);
    // The last label must not exceed the edge.
    const half = pen.measureText(text).width / 2;
    pen.fillText(text, Math.min(x, p.x + p.width + MARGIN.right - half), p.y + p.height + 9);
  }
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (const [place, text] of marks(map.axes[1], view.bottom, view.height, p.height / 55)) {
    const [, y] = pixel(0, place);
    pen.fillRect(p.x - 6, Math.round(y), 6, 1);
    pen.fillText(text, p.x - 9, y);
  }
  pen.font = "14px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.fillText(map.axes[0].label, p.x + p.width / 2, p.y + p.height + 44, p.width + 60);
  pen.save();
  pen.translate(14, p.y + p.height / 2);
  pen.rotate(-Math.PI / 2);
  pen.fillText(map.axes[1].label, 0, 0, p.height + 40);
  pen.restore();
}

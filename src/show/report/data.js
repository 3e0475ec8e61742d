"use strict";
// The document before this script changes it.
/** @type {any} */
const pristine = document.documentElement.cloneNode(true);
/** @type {(id: string) => any} */
const byId = (id) => document.getElementById(id);
// The data of the map, and what the page shows now.
/** @type {MapData} */
const map = JSON.parse(byId("map").textContent);
const [columns, rows] = map.axes.map((axis) => axis.count);

let layer = 0;
// The visible part of the map, in cells of the program's map: its lower left corner and its extent. Cell i spans i to i + 1.
const everything = { left: 0, bottom: 0, width: columns, height: rows };
let view = { ...everything };
// A cell is an object with a sheet and two indices.
/** @type {Cell | null} */
let pointerCell = null;
/** @type {Cell | null} */
let selectedCell = null;

// A sheet is a map to draw: its data, its unpacked arrays, and the rectangle that it covers, in cells of the program's map.
/** @type {(data: MapData, place: Place) => Sheet} */
const sheetOf = (data, place) => ({ data, place, values: {}, starts: null, columns: data.axes[0].count, rows: data.axes[1].count });
// The map that the program computed, and the part of it that this page computed again with finer cells or other parameters.
const base = sheetOf(map, everything);
/** @type {Sheet | null} */
let live = null;
// Parameters that differ from those of the program's map, by name.
/** @type {Record<string, number>} */
let changes = {};
const isChanged = () => Object.keys(changes).length > 0;

// The sheets to draw, from bottom to top. After a change of parameters, the program's map is left out.
const shown = () => [...(isChanged() ? [] : [base]), ...(live ? [live] : [])];
// The sheet to which colours and legend belong: the one that this page computed, while it covers the view.
const uppermost = () => (live && (isChanged() || covers(live.made ?? live.place, view)) ? live : base);
/** @type {(sheet: Sheet) => any} */
const layerOf = (sheet) => sheet.data.layers.find(({ name }) => name === map.layers[layer].name);
// The layer whose colours stand for numbers: that of the uppermost sheet, or of the program's map.
const scaleLayer = () => layerOf(spansMap && !isChanged() ? base : uppermost());
// Whether colours belong to ranks, such as the most common word, which each sheet has for itself.
/** @type {(layer: Layer) => boolean} */
const isRanked = ({ name }) => ["word", "pattern"].includes(name) || (name === "map" && map.attractors.length > 0);
/** @type {(outer: Place, inner: Place) => boolean} */
const covers = (outer, { left, bottom, width, height }) => {
  const slack = 1e-6 * Math.max(outer.width, outer.height);
  return left >= outer.left - slack && bottom >= outer.bottom - slack
    && left + width <= outer.left + outer.width + slack && bottom + height <= outer.bottom + outer.height + slack;
};
const showsAll = () => view.width >= columns && view.height >= rows;
/** @type {(x: number, low: number, high: number) => number} */
const within = (x, low, high) => Math.min(Math.max(x, low), high);

/** @type {(packed: Packed) => Promise<any>} */
async function unpack({ data, type }) {
  const text = atob(data);
  const packed = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) packed[k] = text.charCodeAt(k);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  /** @type {Record<string, any>} */
  const types = { u8: Uint8Array, i8: Int8Array, u32: Uint32Array, f32: Float32Array, f64: Float64Array };
  return new types[type](buffer);
}

// Unpacks the arrays of a sheet.
/** @type {(sheet: Sheet) => Promise<Sheet>} */
async function fill(sheet) {
  const { data } = sheet;
  const names = Object.keys(data.values);
  const unpacked = await Promise.all(names.map((name) => unpack(data.values[name])));
  sheet.values = Object.fromEntries(names.map((name, k) => [name, unpacked[k]]));
  if (data.starts) sheet.starts = await unpack(data.starts);
  for (const derived of data.derived) derived.values = await unpack(derived);
  await Promise.all(data.layers.map(async (packed) => {
    if (packed.values) packed.values = await unpack(packed.values);
    else packed.indices = await unpack(packed.indices);
    packed.ready = true;
  }));
  return sheet;
}

// Unpacks the bifurcation curves: each gets the place of its first point among all points, and the rectangle around it.
async function fillCurves() {
  if (!map.curves) return;
  const { list, places, stable } = map.curves;
  [map.curves.places, map.curves.stable] = await Promise.all([unpack(places), unpack(stable)]);
  let first = 0;
  for (const curve of list) {
    [curve.first, first] = [first, first + curve.count];
    const [u, v] = [0, 1].map((i) => Array.from({ length: curve.count }, (_, k) => map.curves?.places[2 * (curve.first + k) + i]));
    const ends = [u, v].map((all) => all.reduce(([low, high], x) => [Math.min(low, x), Math.max(high, x)], [Infinity, -Infinity]));
    const [[left, right], [bottom, top]] = ends;
    curve.box = { left, bottom, width: right - left, height: top - bottom };
  }
  map.curves.ready = true;
}

// Returns the value of an axis at an index, which may lie between two cells of a linear or logarithmic axis.
/** @type {(axis: Axis, i: number) => number} */
function axisValue({ min, max, count, scale, values }, i) {
  if (i >= count - 1) return max;
  if (values && Number.isInteger(i)) return values[i];
  if (scale === "log") return Math.min(min * (max / min) ** (i / (count - 1)), max);
  return values ? values[Math.round(i)] : Math.min(min + ((max - min) * i) / (count - 1), max);
}
// Names and values of the derived parameters in a cell. Each is stored along the axes that it depends on.
/** @type {(cell: Cell) => [string, number][]} */
const derivedValues = ({ sheet, i, j }) => sheet.data.derived.map(({ parameter, along, values: list }) =>
  [parameter, list?.[(along[1] ? j : 0) * (along[0] ? sheet.columns : 1) + (along[0] ? i : 0)]]);
// Returns the rectangle of a cell, in cells of the program's map.
/** @type {(cell: Cell) => Place} */
function rectangle({ sheet: { place, columns: across, rows: up }, i, j }) {
  const [width, height] = [place.width / across, place.height / up];
  return { left: place.left + i * width, bottom: place.bottom + j * height, width, height };
}
/** @type {(cell: Cell) => [number, number]} */
function centreOf(cell) {
  const { left, bottom, width, height } = rectangle(cell);
  return [left + width / 2, bottom + height / 2];
}
// Returns the values of the axes in a cell.
/** @type {(cell: Cell) => number[]} */
const valuesAt = ({ sheet: { data }, i, j }) => data.axes.map((axis, k) => axisValue(axis, [i, j][k]));
// Whether a cell shows a copy of a coarser cell's record, because its own is not there.
/** @type {(cell: Cell) => boolean} */
const isPending = ({ sheet, i, j }) => Boolean(sheet.pending?.[j * sheet.columns + i]);
// Returns the cell of a sheet at a position, or null outside it.
/** @type {(sheet: Sheet, u: number, v: number) => Cell | null} */
function cellOf(sheet, u, v) {
  const { place, columns: across, rows: up } = sheet;
  const i = Math.floor(((u - place.left) / place.width) * across);
  const j = Math.floor(((v - place.bottom) / place.height) * up);
  return i >= 0 && i < across && j >= 0 && j < up ? { sheet, i, j } : null;
}
// Indices of the first and last of `count` cells whose centre is visible.
/** @type {(count: number, from: number, extent: number) => number[]} */
const visible = (count, from, extent) =>
  [Math.max(0, Math.ceil(from - 0.5)), Math.min(count - 1, Math.floor(from + extent - 0.5))];

/** @type {(tag: string, content?: any, className?: string) => any} */
const element = (tag, text, className) => {
  const node = document.createElement(tag);
  if (text !== undefined) node.append(text);
  if (className) node.className = className;
  return node;
};
/** @type {(content: any, title: string, act: () => void) => any} */
const newButton = (content, title, act) => {
  const button = Object.assign(element("button"), { type: "button", title });
  button.append(...[content].flat());
  button.addEventListener("click", act);
  return button;
};

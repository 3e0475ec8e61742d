"use strict";
// The data of the map, and what the page shows now.
const map = JSON.parse(document.getElementById("map").textContent);
const [columns, rows] = map.axes.map((axis) => axis.count);
const byId = (id) => document.getElementById(id);

let values = {};
// Start states of cells that follow their neighbours: four numbers per cell.
let starts = null;
let layer = 0;
// The visible part of the map, in cells: its lower left corner and its extent.
const everything = { left: 0, bottom: 0, width: columns, height: rows };
let view = { ...everything };
let pointerCell = null;
let selectedCell = null;

const showsAll = () => view.width >= columns && view.height >= rows;
const within = (x, low, high) => Math.min(Math.max(x, low), high);

async function unpack({ data, type }) {
  const packed = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  const types = { u8: Uint8Array, i8: Int8Array, u32: Uint32Array, f32: Float32Array, f64: Float64Array };
  return new types[type](buffer);
}

const axisValue = ({ min, max, count, values }, i) =>
  values ? values[i] : i >= count - 1 ? max : Math.min(min + ((max - min) * i) / (count - 1), max);
// Names and values of the derived parameters in a cell. Each is stored along the axes that it depends on.
const derivedValues = ({ i, j }) => map.derived.map(({ parameter, along, values: list }) =>
  [parameter, list?.[(along[1] ? j : 0) * (along[0] ? columns : 1) + (along[0] ? i : 0)]]);
// Indices of the first and last cell of an axis whose centre is visible.
const visible = (axis, from, extent) =>
  [Math.max(0, Math.ceil(from - 0.5)), Math.min(axis.count - 1, Math.floor(from + extent - 0.5))];

const element = (tag, text, className) => {
  const node = document.createElement(tag);
  if (text !== undefined) node.append(text);
  if (className) node.className = className;
  return node;
};

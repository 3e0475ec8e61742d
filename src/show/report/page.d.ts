// Types of the page's scripts. `scripts/test.sh --all` checks them with the TypeScript compiler.

// The script of a worker, compressed.
declare const WORKER: { data: string, type: string };

// A rectangle, in cells of the program's map.
type Place = { left: number, bottom: number, width: number, height: number };

// The object of src/show/report.rs, after `fill` has unpacked its arrays.
interface MapData {
  title: string;
  subtitle: string;
  fixed: string;
  parameters: Parameter[];
  made: { engine: string, precision: string, device: string, version: string, commit: string };
  model: string;
  source: string | null;
  equations: string[] | null;
  // SVG.
  sketch?: Packed | null;
  letters: string | null;
  scene: string;
  compute: string;
  axes: Axis[];
  derived: Derived[];
  replay: string;
  model_file: string | null;
  components: number;
  // Runs per cell, bytes of a record, and whether the page computes before the first zoom; null if it cannot compute.
  live: any;
  start: number[] | null;
  starts?: Packed;
  layers: Layer[];
  values: Record<string, Packed>;
  classes: string[];
  statuses: string[];
  sources: string[];
  finishers: string[];
  words: string[];
  patterns: string[];
  attractors: string[];
  marks: [number, number][];
  refinement: Refinement | null;
  validation: Validation | null;
  // Present if the program has followed the map's curves.
  curves?: CurveLayer;
}

// Bifurcation curves. Points of all curves are in one array, in cells of the program's map. `first` is the place of a curve's first point, `box` the rectangle around it.
type CurveLayer = {
  list: { kind: string, color: string, period: number, word: string, count: number, first: number, box: Place }[],
  places: any,
  // Whether the cycle of each point is stable.
  stable: any,
  ready?: boolean,
};

type Packed = { type: string, data: string };

type Parameter = { name: string, symbol: string, label: string, value: number, min: number | null, max: number | null };

// Positions on a scale with their labels, and the common factor of these. `asked` is the request that they answer.
type Ticks = { marks: [number, string][], factor: string };

interface Axis {
  parameter: string;
  symbol: string;
  label: string;
  min: number;
  max: number;
  count: number;
  scale: string;
  start?: number;
  // Absent on linear axes.
  values?: any;
  ticks: Ticks;
  asked?: string;
}

// The values of an axis of a view: its ends and their number, or a list.
type Span = { min?: any, max?: any, count?: number, values?: number[] };

type Derived = Packed & { parameter: string, along: boolean[], values?: any };

type Entry = { color: string, text: string, share: string };

interface Bar {
  label: string;
  colors: string[];
  low: number;
  high: number;
  left_out: string[];
  // Numbers with the indices of their colours.
  anchors: [number, number][];
  is_fixed: boolean;
  ticks: Ticks;
  asked?: string;
}

interface Layer {
  name: string;
  short: string;
  title: string;
  palette: string[];
  entries: Entry[];
  entry_of: (number | null)[];
  bar: any;
  // Numbers of the cells, or indices of their colours.
  values?: any;
  indices?: any;
  ready?: boolean;
  range?: number[];
  // The drawn layer, and what it was drawn for.
  picture?: any;
  key?: string;
}

type Refinement = { lines: string[], audits: { sampled: number, wrong: number }[] };

// The object of src/show/validation.rs.
interface Validation {
  verdict: string;
  kinds: Record<string, string>;
  strata: { name: string, text?: string, sampled: number, runs: number, differing: Share, kinds: Record<string, Share> }[];
  agreement: Record<string, { compared: number, agreeing: number }>;
  chaos: { name: string, cells: number, distance: number, bar: number | null, fails: boolean }[];
  chaos_ends?: ChaosEnds;
  counted: string;
  faults: string[];
  samples: number;
  integrated: number;
  seed: number;
  remarks?: string[];
  mismatches: (JudgedCell & { kind: string, differences: { field: string, map: any, judge: any }[] })[];
}

type Share = { count: number, text: string };

type JudgedCell = { i: number, j: number, values: Record<string, number>, replay: string };

interface ChaosEnds {
  cells: (JudgedCell & { class: string, period: number | null, periods_run: number })[];
  further_periods: number;
  followed: number;
  ended: Share;
}

// A row of a table, marked if it is bad.
type Row = { cells: any[], bad?: boolean };

// The values that a window needs along an axis, and the part of the axis that a number of cells covers.
type Along = Span & { cover: (count: number) => [number, number] };

// The part of the map that workers compute.
interface Job {
  key: string;
  id: string;
  along: Along[];
  view: Place;
  begun: number;
  changes: Record<string, number>;
  level: number;
  by_lanes: number;
  drawn: boolean;
  next: boolean;
  onLanes: boolean;
  isDone: boolean;
  scene: string;
  counts: number[];
  ranges: Span[];
  // The bytes of all records, the runs to compute, and a 1 for each run whose record is missing or a copy.
  records: Uint8Array;
  todo: number[];
  pending: Uint8Array;
  next_run: number;
  ended: number;
  total: number;
  redrawn: number;
  wants_data: boolean;
  awaits_data: boolean;
  wants_figure: { layer: string, ending: string } | null;
}

// A worker, and its request, the number of cells that it computes per ms, and whether its shaders are compiled.
type Member = { worker: any, request: any, per_ms: number, isReady?: boolean };

// A map to draw.
interface Sheet {
  data: MapData;
  place: Place;
  // Arrays by name.
  values: any;
  starts: Uint8Array | null;
  columns: number;
  rows: number;
  // The view and the axes for which the page computed the sheet, and whether all of its cells are computed.
  made?: Place;
  ranges?: Span[];
  isWhole?: boolean;
  // The part of the map to which the sheet belongs, and a 1 for each cell whose record is a copy.
  job?: any;
  pending?: Uint8Array;
}

// A cell of a sheet.
type Cell = { sheet: Sheet, i: number, j: number };

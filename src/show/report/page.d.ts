// Types of the page's scripts. `scripts/test.sh --all` checks them with the TypeScript compiler.

// The script of a worker, compressed.
declare const WORKER: { data: string, type: string };

// A rectangle, in cells of the program's map.
interface Place {
  left: number;
  bottom: number;
  width: number;
  height: number;
}

// A map to draw.
interface Sheet {
  // The object of src/show/report/data.rs.
  data: any;
  place: Place;
  // Arrays by name.
  values: any;
  starts: Uint8Array | null;
  columns: number;
  rows: number;
  // The view and the axes for which the page computed the sheet, and whether all of its cells are computed.
  made?: Place;
  ranges?: any[];
  isWhole?: boolean;
  // The part of the map to which the sheet belongs, and a 1 for each cell whose record is a copy.
  job?: any;
  pending?: Uint8Array;
}

// A cell of a sheet.
interface Cell {
  sheet: Sheet;
  i: number;
  j: number;
}

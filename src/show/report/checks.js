// Tables below and beside the map: the audit of filled cells, and the validation.

/** @type {(n: number, one: string, many?: string) => string} */
const count = (n, one, many = `${one}s`) => `${n} ${n === 1 ? one : many}`;
/** @type {(value: any) => string} */
const short = (value) => (typeof value === "number" ? Number(value.toPrecision(4)).toString() : String(value ?? "\u2013"));
/** @type {(name: string) => string} */
const spaced = (name) => name.replaceAll("_", " ");

// Shows what an adaptive map reports, and how each audit of the filled cells ended.
/** @type {(refinement: Refinement) => void} */
function showRefinement({ lines: [first, ...errors], audits }) {
  byId("refined").hidden = false;
  byId("audit").textContent = first;
  byId("audit-errors").append(...errors.map((line) => element("li", line)));
  if (audits.length > 1) {
    byId("audits").append(...audits.map((audit, k) => {
      const row = element("tr");
      row.append(element("td", `audit ${k + 1}`), element("td", `${audit.wrong} of ${audit.sampled} wrong`, "number"));
      return row;
    }));
  }
}

// Returns a table with a caption. `numbers` are the indices of columns of numbers.
/** @type {(caption: string, heads: string[], lines: Row[], numbers?: number[]) => any} */
function table(caption, heads, lines, numbers = []) {
  /** @type {(tag: string, cells: any[], bad?: boolean) => any} */
  const row = (tag, cells, bad) => {
    const node = element("tr", undefined, bad ? "bad" : undefined);
    node.append(...cells.map((text, k) => element(tag, text, numbers.includes(k) ? "number" : undefined)));
    return node;
  };
  const body = element("table");
  body.append(row("th", heads), ...lines.map(({ cells, bad }) => row("td", cells, bad)));
  const box = element("div");
  box.append(element("h3", caption), body);
  return box;
}

// Fields whose names need an explanation.
/** @type {Record<string, string>} */
const FIELDS = { word: "word, up to mirror image", pattern: "pattern, up to mirror image", attractor: "attractor of the start",
  finite: "numbers are finite", again: "record computed again" };
/** @type {(name: string) => string} */
const fieldName = (name) => FIELDS[name] ?? spaced(name);

// Returns the first columns of a cell: a button that shows it on the map, and the values of its parameters.
/** @param {any} cell */
function place({ i, j, values }) {
  const go = newButton(`${i}, ${j}`, "show this cell on the map", () => {
    choose({ i, j });
    follow({ i, j });
    scrollTo({ top: 0, behavior: "smooth" });
  });
  return [go, ...map.axes.map(({ parameter }) => short(values[parameter]))];
}

// Returns the table of the chaotic cells whose chaos ends.
/** @type {(found: ChaosEnds) => any} */
function ended({ cells, further_periods: periods, followed, ended: { count: ends, text } }) {
  /** @type {(cell: any) => Row} */
  const line = ({ class: name, period, periods_run: after, replay, ...cell }) =>
    ({ cells: [...place(cell), period ? `period ${period}` : name, after, element("code", replay)] });
  return table(`Chaos that ends within ${periods} further periods: ${ends} of ${followed} cells (${text})`,
    ["cell", ...map.axes.map((axis) => axis.parameter), "becomes", "after periods", "replay"], cells.map(line));
}

// Returns the table of the cells that differ, grouped by kind. Cells without an explanation come first.
/** @type {(found: Validation) => any} */
function differing({ kinds, mismatches }) {
  /** @type {(difference: { field: string, map: any, judge: any }) => string} */
  const difference = ({ field, map, judge }) => `${fieldName(field)}: ${short(map)}, judge ${short(judge)}`;
  const parameters = map.axes.map((axis) => axis.parameter);
  /** @type {(cell: any) => Row} */
  const line = ({ differences, kind, replay, ...cell }) => ({ bad: kind === "unexplained",
    cells: [...place(cell), differences.map(difference).join("; "), element("code", replay)] });
  const order = Object.keys(kinds).sort((a, b) => Number(b === "unexplained") - Number(a === "unexplained"));
  const groups = order.map((kind) => ({ kind, list: mismatches.filter((mismatch) => mismatch.kind === kind) }));
  const box = element("div");
  box.append(element("h3", "Cells that differ, by kind"));
  for (const { kind, list } of groups.filter(({ list }) => list.length)) {
    const group = table(`${spaced(kind)}: ${count(list.length, "cell")}`, ["cell", ...parameters, "what differs", "replay"], list.map(line));
    group.firstChild.after(element("p", kinds[kind], "note"));
    box.append(group);
  }
  return box;
}

// Shows a validation. One that an earlier program stored may lack texts.
/** @type {(found: Validation) => void} */
function showValidation(found) {
  const section = byId("validation");
  section.hidden = byId("validated").hidden = false;
  byId("verdict").textContent = found.verdict;
  byId("details").addEventListener("click", () => section.scrollIntoView({ behavior: "smooth" }));
  const tables = element("div");
  tables.id = "tables";
  const kinds = Object.keys(found.kinds);
  const strata = found.strata.filter(({ sampled }) => sampled > 0);
  tables.append(
    table("Rates, with their 95 % intervals", ["", "checked", "in the map", "differ", ...kinds.map(spaced)],
      strata.map(({ name, text = name, sampled, runs, differing: all, kinds: of }) =>
        ({ cells: [text, sampled, runs, ...[all, ...kinds.map((kind) => of[kind])].map(({ count, text }) => `${count} (${text})`)] })), [1, 2]),
    table("Agreement", ["", "compared", "agree"], Object.entries(found.agreement).filter(([, { compared }]) => compared)
      .map(([name, { compared, agreeing }]) => ({ cells: [fieldName(name), compared, agreeing] })), [1, 2]),
  );
  if (found.chaos.some(({ cells }) => cells)) {
    const chaos = table("Averages over chaos, as distributions", ["", found.counted, "distance", "limit"],
      found.chaos.map(({ name, cells, distance, bar, fails }) =>
        ({ bad: fails, cells: [spaced(name), cells, short(distance), bar ? short(bar) : "too few"] })), [1, 2, 3]);
    chaos.append(element("p", "Distance: the largest difference of two distribution functions, from 0 (equal) to 1 (apart). "
      + "One is that of the map, the other that of a second computation; chance exceeds the limit once in 10,000 tests.", "note"));
    tables.append(chaos);
  }
  if (found.chaos_ends?.cells.length) tables.append(ended(found.chaos_ends));
  section.append(
    element("h2", "Validation"),
    element("p", found.verdict, found.faults.length ? "verdict bad" : "verdict"),
    element("p", `${found.samples} of ${found.integrated} integrated ${found.counted} were checked, drawn with the seed ${found.seed}.`),
    ...(found.remarks ?? []).map((remark) => element("p", remark)), tables);
  if (found.mismatches.length) section.append(differing(found));
}

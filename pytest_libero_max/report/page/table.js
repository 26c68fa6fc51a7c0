// The table of cases: what is shown of it, in which order, and the fragment of the address that says so.
// Columns are arrays: labels by their place in a list of names, numbers as they are, null where there is none.

const PAGE_ROWS = 50;
const PREFIX = "#cases?";

function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value === true ? "" : String(value));
  }
  made.append(...children); // strings become text, never markup
  return made;
}

function emptyView() {
  return { chosen: {}, least: {}, most: {}, words: "", sort: "", page: 1, open: "" };
}

class Table {
  constructor(data) {
    this.items = data.items;
    this.columns = data.columns;
    this.byKey = Object.fromEntries(data.columns.map((column) => [column.key, column]));
    this.data = data;
  }

  // The words of each row, made when somebody looks for some.
  get haystack() {
    const labels = this.columns.filter((column) => column.labels);
    const { case_ids: ids, instructions } = this.data;
    return (this.words ??= this.items.map((item, row) =>
      [item, ids[row], instructions?.[row], ...labels.map((column) => this.text(column, row))].join(" ").toLowerCase(),
    ));
  }

  text(column, row) {
    if (column.labels) return column.titles?.[column.at[row]] ?? column.labels[column.at[row]];
    return column.values[row] === null ? "" : String(column.values[row]);
  }

  // The text of a cell: nothing where a case is as most are.
  cell(column, row) {
    return column.cells?.[column.at[row]] ?? this.text(column, row);
  }

  // Whether a case was lost, in any run of a comparison.
  lost(row) {
    return this.columns.some((column) => column.outcome && column.labels[column.at[row]] === "regression");
  }

  // The tests of a view by the key of what they test, so that a list of choices can leave its own out.
  tests(view) {
    const tests = new Map();
    for (const [key, value] of Object.entries(view.chosen)) {
      const column = this.byKey[key];
      const place = column.labels.indexOf(value);
      tests.set(key, (row) => column.at[row] === place);
    }
    for (const key of new Set([...Object.keys(view.least), ...Object.keys(view.most)])) {
      const values = this.byKey[key].values;
      const least = view.least[key] ?? -Infinity;
      const most = view.most[key] ?? Infinity;
      tests.set(key, (row) => values[row] !== null && values[row] >= least && values[row] <= most);
    }
    const words = view.words.toLowerCase().split(/\s+/).filter(Boolean);
    if (words.length) tests.set("", (row) => words.every((word) => this.haystack[row].includes(word)));
    return tests;
  }

  rows(view, without = null) {
    const tests = [...this.tests(view)].filter(([key]) => key !== without).map(([, test]) => test);
    const found = [];
    for (let row = 0; row < this.items.length; row++) if (tests.every((test) => test(row))) found.push(row);
    return found;
  }

  sorted(rows, sort) {
    const downward = sort.startsWith("-");
    const column = this.byKey[sort.replace(/^-/, "")];
    const ordered = [...rows];
    if (!column) { // by name, or as the page has them: those to look at first
      if (sort) ordered.sort((one, other) => (this.items[one] < this.items[other] ? -1 : 1));
      return downward ? ordered.reverse() : ordered;
    }
    const values = column.labels ? column.at : column.values;
    return ordered.sort((one, other) => {
      const [a, b] = [values[one], values[other]];
      if (a === b) return one - other;
      if (a === null || b === null) return a === null ? 1 : -1; // what has no value comes last
      return downward ? b - a : a - b;
    });
  }

  // How many rows each label would leave, the other conditions as they are.
  counts(view, key) {
    const column = this.byKey[key];
    const counts = new Array(column.labels.length).fill(0);
    for (const row of this.rows(view, key)) counts[column.at[row]]++;
    return counts;
  }

  fragment(view) {
    const parts = new URLSearchParams();
    for (const column of this.columns) {
      if (column.key in view.chosen) parts.set(column.key, view.chosen[column.key]);
      if (column.key in view.least) parts.set(`${column.key}_from`, view.least[column.key]);
      if (column.key in view.most) parts.set(`${column.key}_to`, view.most[column.key]);
    }
    if (view.words) parts.set("q", view.words);
    if (view.sort) parts.set("sort", view.sort);
    if (view.page > 1) parts.set("page", view.page);
    if (view.open) parts.set("case", view.open);
    return PREFIX + parts;
  }

  // What a fragment asks for; what this table does not know is left out.
  view(fragment) {
    const view = emptyView();
    const parts = new URLSearchParams(fragment.slice(PREFIX.length));
    for (const column of this.columns) {
      if (column.labels) {
        if (column.labels.includes(parts.get(column.key))) view.chosen[column.key] = parts.get(column.key);
        continue;
      }
      for (const [end, bounds] of [["_from", view.least], ["_to", view.most]]) {
        const asked = parts.get(column.key + end);
        if (asked !== null && asked.trim() !== "" && Number.isFinite(Number(asked))) bounds[column.key] = Number(asked);
      }
    }
    view.words = parts.get("q") ?? "";
    const sort = parts.get("sort") ?? "";
    if (["item", ...this.columns.map((column) => column.key)].includes(sort.replace(/^-/, ""))) view.sort = sort;
    view.page = Math.max(1, Math.floor(Number(parts.get("page"))) || 1);
    if (this.items.includes(parts.get("case"))) view.open = parts.get("case");
    return view;
  }
}

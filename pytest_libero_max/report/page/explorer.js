// Draws the controls and the table of cases, and keeps the fragment of the address in step with what is shown.

class Explorer {
  constructor(data, place) {
    this.data = data;
    this.table = new Table(data);
    this.shown = data.columns.filter((column) => column.shown && (column.labels || column.values.some((value) => value !== null)));
    this.start = { ...emptyView(), chosen: data.start ?? {} };
    this.place = place;
    this.inputs = new Map();
    this.parts = [];
    this.status = element("p", { role: "status" });
    this.steps = !data.items.some((_, row) => this.table.lost(row)) ? [] : [
      ["Previous regression", "p", -1],
      ["Next regression", "n", 1],
    ].map(([title, key, by]) => element("button", { type: "button", "aria-keyshortcuts": key, onclick: () => this.step(by) }, title, element("kbd", {}, key)));
    this.head = element("tr");
    this.body = element("tbody");
    this.pages = element("div", { class: "pages" });
    const caption = element("caption", {}, "Choose a name to see the case; Esc closes it.");
    place.append(
      this.controls(),
      element("div", { class: "steps" }, this.status, ...this.steps),
      element("table", { class: "cases" }, caption, element("thead", {}, this.head), this.body),
      this.pages,
    );
    window.addEventListener("hashchange", () => {
      if (location.hash.startsWith(PREFIX)) this.read(); // a part of the page leaves the view as it is
    });
    document.addEventListener("keydown", (event) => this.pressed(event));
    this.read();
  }

  // Keys, but for those that a control takes itself.
  pressed(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input, select, textarea")) return;
    if (event.key === "n") this.step(1);
    if (event.key === "p") this.step(-1);
    if (event.key === "Escape" && this.view.open) this.toggle(this.view.open);
  }

  // Opens the next regression of the view, or the previous one.
  step(by) {
    const rows = this.table.sorted(this.table.rows(this.view), this.view.sort);
    const open = rows.indexOf(this.table.items.indexOf(this.view.open));
    const [after, before] = [rows.slice(open + 1), rows.slice(0, open < 0 ? rows.length : open)];
    const row = by > 0 ? after.find((one) => this.table.lost(one)) : before.findLast((one) => this.table.lost(one));
    if (row === undefined) return;
    const item = this.table.items[row];
    this.change({ open: item, page: this.pageOf(item) });
    this.focus(item);
    this.drawn.then(() => this.body.querySelector(".open")?.scrollIntoView());
  }

  focus(item) {
    for (const button of this.body.querySelectorAll("th button")) if (button.textContent === item) button.focus();
  }

  // The view that the address asks for.
  read() {
    this.view = location.hash.startsWith(PREFIX) ? this.table.view(location.hash) : { ...this.start };
    if (this.view.open) this.view.page = this.pageOf(this.view.open);
    this.draw();
    if (!location.hash.startsWith(PREFIX)) return;
    const show = () => (this.body.querySelector(".open") ?? this.place).scrollIntoView();
    this.view.open ? this.drawn.then(show) : show();
  }

  change(changes) {
    this.view = { ...this.view, page: 1, open: "", ...changes };
    this.draw();
    try {
      history.replaceState(null, "", this.table.fragment(this.view));
    } catch {
      // Some browsers limit how often the address may change; the next change catches up.
    }
  }

  pageOf(item) {
    const row = this.table.items.indexOf(item);
    const place = this.table.sorted(this.table.rows(this.view), this.view.sort).indexOf(row);
    return Math.floor(Math.max(place, 0) / PAGE_ROWS) + 1;
  }

  controls() {
    const text = element("input", { type: "search", placeholder: "name, instruction, …" });
    text.addEventListener("input", () => this.change({ words: text.value }));
    this.inputs.set("q", text);
    const control = (column) => (column.filter === "choice" ? this.choice(column) : this.range(column));
    const filtered = this.data.columns.filter((column) => column.filter);
    const more = filtered.filter((column) => column.more);
    const orders = [["", "Regressions first"], ["item", "Name"]];
    for (const { key, title } of this.data.columns) orders.push([key, `${title} ↑`], [`-${key}`, `${title} ↓`]);
    const order = element("select", {}, ...orders.map(([value, title]) => element("option", { value }, title)));
    order.addEventListener("change", () => this.change({ sort: order.value }));
    this.inputs.set("sort", order);
    const reset = element("button", { type: "button" }, "Show all");
    reset.addEventListener("click", () => this.change(emptyView()));
    this.more = element("details", {}, element("summary", {}, "More filters"), element("div", {}, ...more.map(control)));
    return element(
      "div",
      { class: "filters", role: "search", "aria-label": "Cases" },
      labelled("Text", text, "search"),
      ...filtered.filter((column) => column.chips).map((column) => this.chips(column)),
      ...filtered.filter((column) => !column.more && !column.chips).map(control),
      labelled("Order", order),
      reset,
      ...(more.length ? [this.more] : []),
    );
  }

  // A button for every name that the table shows, pressed where it is chosen.
  chips(column) {
    const place = element("div", { class: "chips" });
    this.inputs.set(column.key, place);
    return element("fieldset", { class: "control" }, element("legend", {}, column.title), place);
  }

  chip(column, place, count) {
    const label = column.labels[place];
    const pressed = this.view.chosen[column.key] === label;
    const title = column.titles?.[place] ?? label;
    const mark = column.outcome ? [element("span", { class: `outcome ${label}` })] : [];
    const properties = { type: "button", "data-label": label, "aria-pressed": String(pressed), disabled: !count && !pressed };
    const button = element("button", properties, ...mark, `${title} ${count}`);
    button.addEventListener("click", () => {
      const { [column.key]: _, ...others } = this.view.chosen;
      this.change({ chosen: pressed ? others : { ...others, [column.key]: label } });
    });
    return button;
  }

  fillChips(column, counts) {
    const place = this.inputs.get(column.key);
    const focused = place.contains(document.activeElement) ? document.activeElement.dataset.label : null;
    const chips = column.labels.map((_, number) => (column.cells?.[number] === "" ? [] : [this.chip(column, number, counts[number])]));
    place.replaceChildren(...chips.flat());
    if (focused) place.querySelector(`[data-label="${CSS.escape(focused)}"]`)?.focus();
  }

  choice(column) {
    const select = element("select");
    select.addEventListener("change", () => {
      const chosen = { ...this.view.chosen };
      if (select.value) chosen[column.key] = select.value;
      else delete chosen[column.key];
      this.change({ chosen });
    });
    this.inputs.set(column.key, select);
    return labelled(column.title, select);
  }

  range(column) {
    const bound = (end, word) => {
      const input = element("input", { type: "number", step: "any", "aria-label": `${column.title}, ${word}` });
      input.addEventListener("input", () => {
        const bounds = { ...this.view[end] };
        if (input.value === "") delete bounds[column.key];
        else bounds[column.key] = Number(input.value);
        this.change({ [end]: bounds });
      });
      this.inputs.set(`${column.key} ${end}`, input);
      return input;
    };
    const legend = element("legend", {}, column.title);
    return element("fieldset", {}, legend, bound("least", "at least"), " to ", bound("most", "at most"));
  }

  fillControls() {
    const set = (input, value) => {
      if (input !== document.activeElement || input.value === "") input.value = value;
    };
    set(this.inputs.get("q"), this.view.words);
    this.inputs.get("sort").value = this.view.sort;
    for (const column of this.data.columns) {
      const { key } = column;
      const used = key in this.view.chosen || key in this.view.least || key in this.view.most;
      if (column.more && used) this.more.open = true;
      if (column.filter === "range") {
        for (const end of ["least", "most"]) set(this.inputs.get(`${column.key} ${end}`), this.view[end][column.key] ?? "");
      }
      if (column.filter !== "choice") continue;
      const counts = this.table.counts(this.view, column.key);
      if (column.chips) {
        this.fillChips(column, counts);
        continue;
      }
      const options = column.labels.map((label, place) =>
        element("option", { value: label }, `${column.titles?.[place] ?? label} (${counts[place]})`),
      );
      const select = this.inputs.get(column.key);
      select.replaceChildren(element("option", { value: "" }, "all"), ...options);
      select.value = this.view.chosen[column.key] ?? "";
    }
  }

  draw() {
    const rows = this.table.sorted(this.table.rows(this.view), this.view.sort);
    const last = Math.max(1, Math.ceil(rows.length / PAGE_ROWS));
    this.view.page = Math.min(this.view.page, last);
    const from = (this.view.page - 1) * PAGE_ROWS;
    const page = rows.slice(from, from + PAGE_ROWS);
    this.status.textContent = rows.length
      ? `${rows.length} of ${this.table.items.length} cases; ${from + 1} to ${from + page.length} are shown.`
      : `None of ${this.table.items.length} cases is like that.`;
    this.fillControls();
    this.drawHead();
    this.body.replaceChildren(...page.flatMap((row) => this.row(row)));
    this.drawPages(last);
  }

  drawHead() {
    const focused = this.head.contains(document.activeElement) ? document.activeElement.dataset.key : null;
    const column = (key, title, kind) => {
      const [up, down] = [this.view.sort === key, this.view.sort === `-${key}`];
      const next = up ? `-${key}` : key;
      const button = element("button", { type: "button", "data-key": key }, ...breakable(title + (up ? " ↑" : down ? " ↓" : "")));
      button.addEventListener("click", () => this.change({ sort: next }));
      const sort = up ? "ascending" : down ? "descending" : null;
      return element("th", { scope: "col", class: kind, "aria-sort": sort }, button);
    };
    this.head.replaceChildren(column("item", "Case", null), ...this.shown.map((shown) => column(shown.key, shown.title, this.kind(shown))));
    if (focused) this.head.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
  }

  kind(column) {
    return [column.labels ? "" : "number", column.secondary ? "secondary" : ""].filter(Boolean).join(" ") || null;
  }

  row(row) {
    const item = this.table.items[row];
    const open = this.view.open === item;
    const button = element("button", { type: "button", "aria-expanded": String(open) }, ...breakable(item));
    button.addEventListener("click", () => this.toggle(item));
    const cells = this.shown.map((column) => {
      const text = this.table.cell(column, row);
      const label = column.labels?.[column.at[row]];
      const named = column.outcome || column.cells || !text ? null : column.title;
      return element("td", { class: this.kind(column), "data-title": named }, column.outcome ? element("span", { class: `outcome ${label}` }, text) : element("span", {}, ...breakable(text)));
    });
    const shown = element("tr", { class: open ? "open" : null }, element("th", { scope: "row" }, button), ...cells);
    if (!open) return [shown];
    const place = element("td", { colspan: cells.length + 1 });
    this.drawn = this.details(row).then((values) => place.append(detail(this.data, this.table, row, values)));
    return [shown, element("tr", { class: "opened" }, place)];
  }

  // The details of a case, from the part of them that holds it.
  async details(row) {
    const size = this.data.part;
    const number = Math.floor(row / size);
    this.parts[number] ??= unpack(document.getElementsByClassName("details-data")[number]);
    return (await this.parts[number])[row % size];
  }

  toggle(item) {
    this.change({ page: this.view.page, open: this.view.open === item ? "" : item });
    this.focus(item);
  }

  drawPages(last) {
    const step = (title, page) => {
      const button = element("button", { type: "button", disabled: page < 1 || page > last }, title);
      button.addEventListener("click", () => (this.change({ page }), this.place.scrollIntoView()));
      return button;
    };
    const now = this.view.page;
    const text = element("span", {}, `Page ${now} of ${last}`);
    this.pages.replaceChildren(...(last > 1 ? [step("Previous", now - 1), text, step("Next", now + 1)] : []));
  }
}

let controls = 0;

function labelled(title, control, kind = null) {
  control.id = `control-${++controls}`;
  return element("div", { class: `control ${kind ?? ""}` }, element("label", { for: control.id }, title), control);
}

// A name that may go on in the next line after each part.
function breakable(name) {
  return name.split(/(?<=[_-])/).flatMap((part, place) => (place ? [element("wbr"), part] : [part]));
}

// Names in the static tables become links to the cases that they count.
function linkViews() {
  for (const place of document.querySelectorAll("[data-view]")) {
    const link = element("a", { href: PREFIX + place.dataset.view }, ...place.childNodes);
    place.append(link);
  }
}

// What the page holds as gzip in base64: JSON.
function unpack(script) {
  const bytes = Uint8Array.from(atob(script.textContent), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).json();
}

// A part of the page that the address names is unfolded.
function unfold() {
  const part = location.hash.startsWith(PREFIX) ? null : document.getElementById(location.hash.slice(1));
  if (part instanceof HTMLDetailsElement) part.open = true;
  part?.scrollIntoView();
}

// Buttons that copy a command.
function copyCommands() {
  for (const button of document.querySelectorAll("[data-copy]")) button.addEventListener("click", () => copyText(button.dataset.copy, button));
}

// Films on the first screen play while they are pointed at.
function playPosters() {
  for (const poster of document.querySelectorAll(".poster")) {
    const video = poster.querySelector("video");
    poster.addEventListener("mouseenter", () => video?.play());
    poster.addEventListener("mouseleave", () => video?.pause());
  }
}

// Waits until the first screen is drawn; a page in the background draws nothing.
function painted() {
  return document.hidden ? null : new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
}

async function start() {
  playPosters();
  await painted();
  const data = await unpack(document.getElementById("cases-data"));
  const shown = document.documentElement.classList;
  shown.add("scripted"); // shows what needs the script, hides what it replaces
  try {
    linkViews();
    copyCommands();
    new Explorer(data, document.getElementById("cases"));
  } catch (error) {
    shown.remove("scripted");
    throw error;
  }
  if (location.hash) unfold();
  window.addEventListener("hashchange", unfold);
}

start();

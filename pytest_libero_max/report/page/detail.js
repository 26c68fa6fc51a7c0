// What is shown of one case: its sentence, its films, its numbers, and commands to copy.

function words(value) {
  if (value === null || value === undefined) return "–";
  if (value === true) return "yes";
  if (value === false) return "no";
  if (typeof value === "number") return String(Number.isInteger(value) ? value : Number(value.toPrecision(4)));
  if (Array.isArray(value)) return value.length ? value.map(words).join(", ") : "none";
  if (typeof value === "object") return Object.entries(value).map(([key, part]) => `${key} ${words(part)}`).join(", ");
  return String(value);
}

// A table of names and values; where every value is an object, their keys are the columns.
function valueTable(values) {
  const entries = Object.entries(values);
  const nested = entries.every(([, value]) => value !== null && typeof value === "object" && !Array.isArray(value));
  const columns = nested ? [...new Set(entries.flatMap(([, value]) => Object.keys(value)))] : [];
  const head = element("thead", {}, element("tr", {}, element("td"), ...columns.map((name) => element("th", { scope: "col" }, name))));
  const rows = entries.map(([name, value]) =>
    element(
      "tr",
      {},
      element("th", { scope: "row" }, name),
      ...(nested ? columns.map((key) => element("td", {}, words(value[key]))) : [element("td", {}, words(value))]),
    ),
  );
  const table = element("table", {}, ...(nested ? [head] : []), element("tbody", {}, ...rows));
  return element("div", { class: "words" }, table);
}

function film(caption, path) {
  const moving = /\.webp$/i.test(path)
    ? element("img", { src: path, alt: caption, loading: "lazy" })
    : element("video", { src: path, preload: "auto", muted: true, playsinline: true });
  return element("figure", {}, moving, element("figcaption", {}, element("a", { href: path }, caption)));
}

function picturesOf(pictures) {
  const figures = pictures.map(([caption, path]) =>
    element("figure", {}, element("img", { src: path, alt: caption, loading: "lazy" }), element("figcaption", {}, caption)),
  );
  return element("section", {}, element("h3", {}, "Before and after the event"), element("div", { class: "pictures" }, ...figures));
}

function pictured() {
  return element("p", { class: "muted" }, "A WebP cannot be stepped through. With pip install -e '.[film]' in the clone films are MP4.");
}

// The films, and what moves through them.
function filmsOf(films, timeline, hz) {
  const place = element("div", { class: "films" }, ...films.map(([caption, path]) => film(caption, path)));
  const videos = [...place.querySelectorAll("video")];
  if (!timeline) videos.forEach((video) => (video.controls = true));
  const hint = timeline && !videos.length ? [pictured()] : [];
  const parts = !timeline ? [] : videos.length ? player(videos, timeline, hz) : [drawn(timeline), legend(timeline)];
  return [place, element("section", {}, ...parts, ...hint)];
}

async function copyText(text, button) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = element("textarea", { readonly: true });
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  const title = button.textContent;
  button.textContent = "Copied";
  setTimeout(() => (button.textContent = title), 1500);
}

function command(caption, text) {
  const copy = element("button", { type: "button" }, "Copy");
  copy.addEventListener("click", () => copyText(text, copy));
  return element("div", {}, element("div", {}, caption), element("div", { class: "command" }, element("code", {}, text), copy));
}

// A picture of the event, drawn once in the page's list of events.
function eventPicture(name) {
  const shown = document.querySelector(`#event-${CSS.escape(name)} img`);
  if (!shown) return [];
  const picture = element("img", { src: shown.src, alt: shown.alt, width: shown.width, height: shown.height });
  return [element("section", {}, element("h3", {}, "Such an event, on another case"), picture)];
}

// The commands that make sense for what there is of a case.
function commandsOf(data, row) {
  const has = new Set(data.has?.[row]);
  return data.commands
    .filter(({ needs, unless }) => needs.every((name) => has.has(name)) && !unless.some((name) => has.has(name)))
    .map(({ caption, before, after }) =>
      before ? command(caption, [before, data.items[row], after].filter(Boolean).join(" ")) : element("div", {}, caption),
    );
}

function tablesOf(tables) {
  return Object.entries(tables).map(([title, part]) => element("section", {}, element("h3", {}, title), valueTable(part)));
}

function detail(data, table, row, values) {
  const item = data.items[row];
  const pictures = data.pictures?.[row] ?? [];
  const columns = data.columns.filter((column) => column.labels && !column.outcome);
  const labels = Object.fromEntries(columns.map((column) => [column.title, table.text(column, row)]));
  const more = { ...values.more, Case: { "Case id": data.case_ids[row], ...labels, ...values.more?.Case } };
  const [event, variant] = ["event", "variant"].map((key) => table.text(table.byKey[key], row));
  const said = (values.says ?? []).map(([arm, cause, sentence]) =>
    element("p", { class: "said" }, element("b", {}, `${arm}: ${cause.replaceAll("_", " ")}. `), sentence),
  );
  const links = (data.pages ?? []).map(([caption, path]) =>
    element("li", {}, element("a", { href: `${path}${PREFIX}${new URLSearchParams({ q: item, case: item })}` }, caption)),
  );
  const [films, moments] = data.films[row] ? filmsOf(data.films[row], values.timeline, data.hz) : [];
  return element(
    "div",
    { class: "detail" },
    ...said,
    element(
      "div",
      { class: films ? "beside" : null },
      ...(films ? [films] : []),
      element(
        "div",
        { class: "facts" },
        ...(moments ? [moments] : []),
        ...(pictures.length ? [picturesOf(pictures)] : []),
        element("section", {}, element("h3", {}, "Commands"), ...commandsOf(data, row)),
        ...tablesOf(values.tables),
        ...(pictures.length || films ? [] : eventPicture(`${event}-v${variant}`)),
        ...(links.length ? [element("section", {}, element("h3", {}, "In the reports of the runs"), element("ul", {}, ...links))] : []),
      ),
    ),
    element("details", {}, element("summary", {}, "Case, parameters and evidence"), element("div", { class: "facts columns" }, ...tablesOf(more))),
  );
}

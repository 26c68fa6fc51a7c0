// What is shown of one case: its films, pictures of its event, its numbers, and commands to copy.

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
  return element("div", { class: "wide words" }, table);
}

function film(caption, path) {
  const moving = /\.mp4$/i.test(path)
    ? element("video", { src: path, controls: true, preload: "metadata", muted: true, loop: true, playsinline: true })
    : element("img", { src: path, alt: caption, loading: "lazy" });
  const link = element("a", { href: path }, caption);
  return element("figure", {}, moving, element("figcaption", {}, link));
}

function picturesOf(pictures) {
  const figures = pictures.map(([caption, path]) => film(caption, path));
  return element("section", {}, element("h4", {}, "Before and after the event"), element("div", { class: "films" }, ...figures));
}

function filmsOf(films) {
  const figures = films.map(([caption, path]) => film(caption, path));
  const section = element("section", {}, element("h4", {}, "Films"), element("div", { class: "films" }, ...figures));
  const videos = figures.map((figure) => figure.querySelector("video")).filter(Boolean);
  if (videos.length > 1) {
    const playAll = () => videos.forEach((video) => ((video.currentTime = 0), video.play()));
    section.append(element("button", { type: "button", onclick: playAll }, "Play all from the start"));
  }
  return section;
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
  button.textContent = "Copied";
  setTimeout(() => (button.textContent = "Copy"), 1500);
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
  return [element("section", {}, element("h4", {}, "Such an event, on another case"), picture)];
}

function detail(data, table, row) {
  const item = data.items[row];
  const values = data.details[row];
  const films = data.films[row] ?? [];
  const pictures = data.pictures?.[row] ?? [];
  const columns = data.columns.filter((column) => column.labels && !column.outcome);
  const labels = Object.fromEntries(columns.map((column) => [column.title, table.text(column, row)]));
  const tables = { ...values, Case: { "Case id": data.case_ids[row], ...labels, ...values.Case } };
  const [event, variant] = ["event", "variant"].map((key) => table.text(table.byKey[key], row));
  const commands = data.commands.map(([caption, before, after]) => command(caption, [before, item, after].filter(Boolean).join(" ")));
  const sections = Object.entries(tables).map(([title, part]) => element("section", {}, element("h4", {}, title), valueTable(part)));
  const links = (data.pages ?? []).map(([caption, path]) =>
    element("li", {}, element("a", { href: `${path}${PREFIX}${new URLSearchParams({ q: item, case: item })}` }, caption)),
  );
  return element(
    "div",
    { class: "detail" },
    ...(films.length ? [filmsOf(films)] : []),
    ...(pictures.length ? [picturesOf(pictures)] : []),
    element("section", {}, element("h4", {}, "Commands"), ...commands),
    element("div", { class: "facts" }, ...sections),
    ...(pictures.length ? [] : eventPicture(`${event}-v${variant}`)),
    ...(links.length ? [element("section", {}, element("h4", {}, "In the reports of the runs"), element("ul", {}, ...links))] : []),
  );
}

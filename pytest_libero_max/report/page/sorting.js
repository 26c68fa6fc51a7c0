// Headings of tables that sort their rows: a click sorts upwards, the next one downwards.

for (const table of document.querySelectorAll(".sorted")) {
  const [body] = table.tBodies;
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, place) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const up = head.ariaSort !== "ascending";
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const order = (row) => row.cells[place].dataset.order;
      const compare = (a, b) => (a === b ? 0 : a === "" ? -1 : b === "" ? 1 : isNaN(a - b) ? a.localeCompare(b) : a - b);
      const rows = [...body.rows].sort((one, other) => compare(order(one), order(other)));
      body.append(...(up ? rows : rows.reverse()));
    });
  });
}

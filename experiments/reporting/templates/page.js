"use strict";
const all = (what, where = document) => [...where.querySelectorAll(what)];
const root = document.documentElement;

// The page follows the system's dark mode until the button is pressed.
const night = matchMedia("(prefers-color-scheme: dark)");
const theme = document.getElementById("theme");
const dark = () => (root.dataset.theme || (night.matches ? "dark" : "light")) === "dark";
const named = () => { theme.textContent = dark() ? "Light" : "Dark"; };
theme.onclick = () => {
  root.dataset.theme = dark() ? "light" : "dark";
  named();
};
night.onchange = named;
named();

// A click on a chip hides its estimator in all figures and tables; hovering highlights it.
for (const chip of all("button.who")) {
  const own = `.${CSS.escape(chip.dataset.estimator)}`;
  chip.onclick = () => {
    const shown = chip.getAttribute("aria-pressed") !== "true";
    chip.setAttribute("aria-pressed", shown);
    for (const part of all(own)) part.classList.toggle("gone", !shown);
  };
  const lit = (on) => {
    for (const svg of all("main svg:not(.swatch)")) svg.classList.toggle("lit", on);
    for (const part of all(own)) part.classList.toggle("near", on);
  };
  chip.onpointerenter = chip.onfocus = () => lit(true);
  chip.onpointerleave = chip.onblur = () => lit(false);
}

const value = (row, column) => row.cells[column].dataset.value ?? row.cells[column].textContent;

// A click on a column head sorts the table; cells without a value come last.
for (const button of all("button.sort")) {
  button.onclick = () => {
    const head = button.closest("th");
    const body = head.closest("table").tBodies[0];
    const up = head.getAttribute("aria-sort") !== "ascending";
    const key = (row) => value(row, head.cellIndex).trim();
    const order = (a, b) => {
      if (!key(a) || !key(b)) return !key(a) - !key(b);
      const [x, y] = [Number(key(a)), Number(key(b))];
      const sign = Number.isNaN(x - y) ? key(a).localeCompare(key(b), "en") : x - y;
      return up ? sign : -sign;
    };
    for (const other of all("th[aria-sort]", head.parentNode)) {
      other.setAttribute("aria-sort", "none");
    }
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    body.append(...[...body.rows].sort(order));
  };
}

const press = (text, act) => {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "copy";
  button.textContent = text;
  button.onclick = () => act(button);
  return button;
};
const copy = async (button, text) => {
  const before = button.textContent;
  try {
    await navigator.clipboard.writeText(text);
    button.textContent = "Copied";
  } catch {
    button.textContent = "Not allowed here";
  }
  setTimeout(() => { button.textContent = before; }, 1500);
};

// Commands have a button to copy them; tables have buttons to copy them and to save them as CSV.
for (const command of all("pre.command")) {
  command.after(press("Copy", (button) => copy(button, command.textContent)));
}
const rows = (table) => {
  const heads = all("thead th", table).map((head) => head.dataset.name);
  const shown = all("tbody tr:not(.gone)", table);
  return [heads, ...shown.map((row) => heads.map((_, column) => value(row, column)))];
};
const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
for (const table of all("table[data-name]")) {
  const tools = document.createElement("div");
  tools.className = "tools";
  tools.append(
    press("Copy", (button) => copy(button, rows(table).map((r) => r.join("\t")).join("\n"))),
    press("Save CSV", () => {
      const text = rows(table).map((row) => row.map(quoted).join(",")).join("\n");
      const link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
      link.download = `${table.dataset.name}.csv`;
      link.click();
    }),
  );
  table.parentNode.before(tools);
}

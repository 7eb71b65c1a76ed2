// Tables as files: CSV and JSON, of what is shown or of all.

/** A table as heads and rows of values; `all` takes what is hidden too. */
function contentOf(live, all) {
  const open = live.table.classList.contains("all");
  const wanted = [...live.head.cells].map(
    (cell) => all || (isShown(cell) && (open || !cell.classList.contains("more"))),
  );
  const sides = [...live.head.cells].map((_, i) => sidesOf(live.rows.map((row) => row.cells[i])));
  const heads = [...live.head.cells].flatMap((cell, i) =>
    wanted[i] ? ["", ...sides[i]].map((side) => sided(headText(cell), side)) : [],
  );
  const values = (row) => [...row.cells].flatMap((cell, i) =>
    wanted[i] ? [valueOf(cell), ...sides[i].map((side) => partsOf(cell)[side] ?? null)] : [],
  );
  const order = [...live.rows].sort((a, b) => a.compareDocumentPosition(b) & 4 ? -1 : 1);
  const rows = order.filter((row) => all || isShown(row)).map(values);
  return { heads: distinct(heads), rows };
}

const END = "[-+−]?(?:[\\d.]+(?:e[-+−]?\\d+)?|∞)";
const WITHIN = new RegExp(`(${END}|never) … (${END}|never)`);

/** What a cell says besides its value: the ends of its interval, and a mark such as ≥. */
function partsOf(cell) {
  const { low, high, mark } = cell?.dataset ?? {};
  const read = low === undefined ? WITHIN.exec(cell?.querySelector(".ci")?.textContent ?? "") : ["", low, high];
  const end = (text) => (text === "never" ? Infinity : asValue(text));
  return { ...(read ? { low: end(read[1]), high: end(read[2]) } : {}), ...(mark ? { mark } : {}) };
}

/** Which of them the cells of a column have. */
function sidesOf(cells) {
  const found = new Set(cells.flatMap((cell) => Object.keys(partsOf(cell))));
  return ["low", "high", "mark"].filter((side) => found.has(side));
}

/** The name of a column with a side, before the unit: "lag low [s]"; a mark has no unit. */
function sided(name, side) {
  const [, words, unit] = /^(.*?)( \[[^\]]*\])?$/.exec(name);
  return side ? `${words} ${side}${side === "mark" ? "" : (unit ?? "")}` : name;
}

/** The words of a head: as given for files, else as it reads. */
function headText(cell) {
  return cell.dataset.name ?? cell.textContent.trim().replace(/\s+/g, " ");
}

/** Names that differ, for JSON has each only once. */
function distinct(names) {
  const seen = new Map();
  return names.map((name) => {
    const count = (seen.get(name) ?? 0) + 1;
    seen.set(name, count);
    return count > 1 ? `${name} (${count})` : name;
  });
}

const HARMLESS = new RegExp(`^${END}(?: ?%)?(?: ?[…±] ?${END}(?: ?%)?)*$`); // a number, or a range

/** Rows as text with a mark between; text that a spreadsheet would run as a formula is quoted. */
function separated({ heads, rows }, mark) {
  const cell = (value) => {
    if (value === null) return "";
    const runs = typeof value === "string" && /^[-=+@\t\r]/.test(value) && !HARMLESS.test(value);
    const text = runs ? `'${value}` : String(value);
    return new RegExp(`["\\r\\n${mark}]`).test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  return [heads, ...rows].map((row) => row.map(cell).join(mark)).join("\r\n") + "\r\n";
}

function asJson({ heads, rows }) {
  const finite = (v) => (typeof v === "number" && !Number.isFinite(v) ? String(v) : v);
  const objects = rows.map((row) => Object.fromEntries(row.map((v, i) => [heads[i], finite(v)])));
  return JSON.stringify(objects, null, 1);
}

/** A menu of ways to take a table along. */
function saveMenu(live) {
  const name = slug(live.name);
  const csv = (all) => () => download(`${name}.csv`, separated(contentOf(live, all), ","), "text/csv");
  const json = (all) => () => download(`${name}.json`, asJson(contentOf(live, all)), "application/json");
  const item = (text, act) => el("button", { type: "button", class: "small", text, onclick: act });
  return menu(
    "Save",
    `Save table ${live.name}`,
    item("CSV, as shown", csv(false)),
    item("CSV, all", csv(true)),
    item("JSON, as shown", json(false)),
    item("JSON, all", json(true)),
    copyButton("Copy as shown", () => separated(contentOf(live, false), "\t")),
  );
}

/** What opens below a button, and closes by Escape or a click elsewhere. */
function menu(text, label, ...children) {
  const details = el(
    "details",
    { class: "menu" },
    el("summary", { text, "aria-label": label }),
    el("div", { class: "sheet" }, ...children),
  );
  details.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !details.open) return;
    event.preventDefault(); // a dialog around it stays
    event.stopPropagation();
    details.open = false;
    details.querySelector("summary").focus();
  });
  return details;
}

function closeMenus(event) {
  for (const open of document.querySelectorAll("details.menu[open]"))
    if (!open.contains(event.target)) open.open = false;
}

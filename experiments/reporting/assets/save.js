// Tables as files: CSV and JSON, of what is shown or of all.

/** A table as heads and rows of values; `all` takes what is hidden too. */
function contentOf(live, all) {
  const open = live.table.classList.contains("all");
  const wanted = [...live.head.cells].map(
    (cell) => all || (isShown(cell) && (open || !cell.classList.contains("more"))),
  );
  const pick = (row) => [...row.cells].filter((_, i) => wanted[i]);
  const order = [...live.rows].sort((a, b) => a.compareDocumentPosition(b) & 4 ? -1 : 1);
  const rows = order.filter((row) => all || isShown(row)).map((row) => pick(row).map(valueOf));
  return { heads: distinct(pick(live.head).map(headText)), rows };
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

/** Rows as text with a mark between; text that a spreadsheet would run as a formula is quoted. */
function separated({ heads, rows }, mark) {
  const cell = (value) => {
    if (value === null) return "";
    const text = typeof value === "string" && /^[=+@\t\r]/.test(value) ? `'${value}` : String(value);
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

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

/** Rows as text with a mark between. */
function separated({ heads, rows }, mark) {
  const cell = (value) => {
    if (value === null) return "";
    const text = String(value);
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

// What the style sheet says of a part of a chart, and an SVG alone would not know.
const STYLES = ["fill", "stroke", "stroke-width", "stroke-dasharray", "vector-effect", "opacity", "font-size", "font-family", "font-style", "text-anchor"];
const MARGIN = { left: 62, right: 14, top: 22, between: 26, bottom: 40 }; // of panels, as the style sheet has it

/** A menu to take a chart along. */
function chartMenu(figure) {
  const item = (text, act) => el("button", { type: "button", class: "small", text, onclick: act });
  return menu(
    "Save", `Save chart ${figure.place.dataset.title}`,
    item("CSV of the curves", () => download(`${figure.name}.csv`, separated(valuesOf(figure), ","), "text/csv")),
    item("SVG, as shown", () => savePictures(figure)),
  );
}

/** All values of a chart as they are drawn, a row a point; of two views the whole one. */
function valuesOf(figure) {
  const view = figure.views[figure.views.length - 1];
  const heads = ["panel", "quantity", "estimator", "curve", view.label, "y", "low", "high", "x_low", "x_high"];
  const rows = view.panels.flatMap((panel) => panel.lines.flatMap((line) => {
    const about = [panel.title, panel.label, line.who, line.said === line.who ? "" : line.said];
    const values = line.values ?? line.curve.filter(([x]) => Number.isFinite(x)).map(([x, y]) => [x, y, ...(line.sides ?? []).map((side) => heightAt(side, x))]
      .map((share, i) => (i ? panel.y : view.x).value(share)));
    return values.map((row) => [...about, ...Array.from({ length: 6 }, (_, i) => number(row[i]))]);
  }));
  return { heads, rows };
}

/** A number to six digits, as the page has it; what is none is nothing. */
const number = (v) => (v === undefined || v === null || Number.isNaN(v) ? null : Number(v.toPrecision(6)));

function savePictures(figure) {
  figure.views.forEach((view, i) => {
    const name = figure.views.length > 1 ? `${figure.name}-${i + 1}.svg` : `${figure.name}.svg`;
    download(name, new XMLSerializer().serializeToString(alone(view)), "image/svg+xml");
  });
}

/** A view as an SVG of its own: its panels below one another, with the styles that the page gives them. */
function alone(view) {
  const width = view.panels[0].svg.getBoundingClientRect().width;
  let top = MARGIN.top;
  const parts = view.panels.map((panel) => {
    const high = Number(panel.svg.getAttribute("height"));
    const part = dressed(panel.svg);
    for (const [key, value] of Object.entries({ x: MARGIN.left, y: top, width, height: high, overflow: "visible" })) part.setAttribute(key, value);
    top += high + MARGIN.between;
    return part;
  });
  const height = top - MARGIN.between + MARGIN.bottom;
  const whole = svg("svg", { xmlns: SVG_NS, width: width + MARGIN.left + MARGIN.right, height }, dressed(document.getElementById("marks")), ...parts);
  whole.style.background = getComputedStyle(document.body).backgroundColor;
  return whole;
}

/** A copy of a part with its style written into it. */
function dressed(part) {
  const copy = part.cloneNode(true);
  const those = part.querySelectorAll("*");
  copy.querySelectorAll("*").forEach((each, i) => {
    const style = getComputedStyle(those[i]);
    for (const name of STYLES) each.setAttribute(name, style.getPropertyValue(name));
    if (style.display === "none") each.setAttribute("display", "none");
    each.removeAttribute("class");
  });
  copy.removeAttribute("class");
  return copy;
}

// Reading values off a chart, and zooming: by pointer and by keyboard alike.

const HELP =
  "Left and right read off values, up and down choose a curve, plus and minus zoom, " +
  "Enter opens the chosen curve where it can be opened, Escape goes back.";

/** Wrap a view so that it can be read: pointer, touch, keys. */
function readable(figure, view) {
  const tip = el("div", { class: "tip", hidden: true });
  const label = `${described(figure.chart, view.range)} ${HELP}`;
  const box = el("div", { class: "view", tabindex: "0", role: "group", "aria-label": label }, view.svg, tip);
  const reader = {
    figure, view, box, tip, cursor: null, line: figure.chosen ?? 0, drag: null,
    rule: svg("path", { class: "rule" }), brush: svg("rect", { class: "brush" }),
  };
  view.svg.append(reader.brush, reader.rule);
  box.addEventListener("pointermove", (event) => onMove(reader, event));
  box.addEventListener("pointerleave", () => leave(reader));
  box.addEventListener("pointerdown", (event) => onDown(reader, event));
  box.addEventListener("pointerup", (event) => onUp(reader, event));
  box.addEventListener("dblclick", () => zoomTo(reader.figure, null));
  box.addEventListener("keydown", (event) => onKey(reader, event));
  box.addEventListener("blur", () => leave(reader));
  return box;
}

/** Where the pointer is, in units of the picture. */
function placeOf(reader, event) {
  const box = reader.view.svg.getBoundingClientRect();
  const k = reader.view.width / box.width;
  return [(event.clientX - box.left) * k, (event.clientY - box.top) * k];
}

function onMove(reader, event) {
  const [px, py] = placeOf(reader, event);
  if (reader.drag !== null) return showBrush(reader, px);
  const hit = nearest(reader.view, px, py);
  hit ? showTip(reader, hit) : leave(reader);
}

function onDown(reader, event) {
  if (event.button === 0 && event.pointerType !== "touch") reader.drag = placeOf(reader, event)[0];
}

function onUp(reader, event) {
  const [px, py] = placeOf(reader, event);
  const from = reader.drag;
  reader.drag = null;
  reader.brush.setAttribute("width", 0);
  if (from !== null && Math.abs(px - from) > 6) return zoomBetween(reader, from, px);
  const hit = nearest(reader.view, px, py);
  if (hit && hit.line.pick && hit.distance < 14) openPick(hit.line.pick);
  else if (hit) showTip(reader, hit); // a finger does not hover
}

function showBrush(reader, px) {
  const { x, panels } = reader.view;
  const [a, b] = [reader.drag, px].sort((p, q) => p - q).map((p) => Math.min(Math.max(p, x.begin), x.end));
  const [top, bottom] = [panels[0].top, panels[panels.length - 1].bottom];
  for (const [key, value] of Object.entries({ x: a, width: b - a, y: top, height: bottom - top }))
    reader.brush.setAttribute(key, value);
}

function zoomBetween(reader, a, b) {
  const { x } = reader.view;
  const ends = [a, b].map((p) => x.from(Math.min(Math.max(p, x.begin), x.end))).sort((p, q) => p - q);
  if (ends[1] > ends[0]) zoomTo(reader.figure, ends);
}

/** Show a range of x of a chart, or none: as at first. */
function zoomTo(figure, ends) {
  const text = ends && ends.map((v) => Number(v.toPrecision(5))).join("~");
  State.set({ [`win.${figure.name}`]: text });
}

/** The index of the value of x next to one; x need not be sorted. */
function nearestIndex(x, target) {
  let best = -1;
  for (let i = 0; i < x.length; i++)
    if (Number.isFinite(x[i]) && (best < 0 || Math.abs(x[i] - target) < Math.abs(x[best] - target))) best = i;
  return best;
}

/** What is drawn next to a place: { panel, line, index, px, py, distance }, or null. */
function nearest(view, px, py) {
  const panel = view.panels.find((p) => py >= p.top - 13 && py <= p.bottom + 13);
  if (!panel || px < view.x.begin - 8 || px > view.x.end + 8) return null;
  let best = null;
  for (const line of panel.lines) {
    const hit = nearestOf(panel, line, px, py);
    if (hit && (!best || hit.distance < best.distance)) best = hit;
  }
  return best;
}

function nearestOf(panel, line, px, py) {
  const isLine = line.kind !== "points" && line.kind !== "both";
  if (isLine) return hitAt(panel, line, indexAt(line, panel.x.from(px)), px, py, true);
  let best = null;
  for (let i = 0; i < line.x.length; i++) {
    const hit = hitAt(panel, line, i, px, py, false);
    if (hit && (!best || hit.distance < best.distance)) best = hit;
  }
  return best;
}

/** Of steps the value that holds there, else the nearest. */
function indexAt(line, value) {
  const i = nearestIndex(line.x, value);
  return line.kind === "steps" && line.x[i] > value && i > 0 ? i - 1 : i;
}

function hitAt(panel, line, index, px, py, vertical) {
  if (index < 0 || !Number.isFinite(line.y[index])) return null;
  const [ax, ay] = [panel.x.to(line.x[index]), panel.y.to(line.y[index])];
  const distance = vertical ? Math.abs(ay - py) : Math.hypot(ax - px, ay - py);
  return { panel, line, index, px: ax, py: ay, distance };
}

/** Say what there is at a place: all curves at this x, the chosen one first in weight. */
function showTip(reader, hit) {
  const { view, tip } = reader;
  highlight(reader.figure, hit.line.who);
  reader.rule.setAttribute("d", `M${hit.px},${view.panels[0].top}V${view.panels[view.panels.length - 1].bottom}`);
  tip.replaceChildren(...tipRows(reader.figure.chart, hit));
  tip.hidden = false;
  const k = reader.box.clientWidth / view.width;
  const right = hit.px > view.width / 2;
  tip.style.left = right ? "" : `${hit.px * k + 12}px`;
  tip.style.right = right ? `${(view.width - hit.px) * k + 12}px` : "";
  tip.style.top = `${Math.max(0, (hit.panel.top + 4) * k)}px`;
}

function tipRows(chart, hit) {
  const at = hit.line.x[hit.index];
  const rows = alike(hit).map(([line, i]) =>
    el("div", { class: line === hit.line ? "chosen" : null }, swatch(line),
      el("span", { symbols: line.label || line.who || line.role || "" }),
      el("b", { text: digits(line.y[i]) }), el("small", { text: ends(line, i) })),
  );
  const more = hit.line.pick ? [el("small", { text: "click to open" })] : [];
  return [el("div", { class: "where", symbols: `${chart.x}: ${sayX(chart, at)}` }), ...rows, ...more];
}

const ends = (line, i) => (line.low ? ` ${digits(line.low[i], 3)} … ${digits(line.high[i], 3)}` : "");

/** The curves that have a value at the same x: for points only the point itself. */
function alike(hit) {
  if (hit.line.kind === "points" || hit.line.kind === "both") return [[hit.line, hit.index]];
  const at = hit.line.x[hit.index];
  return hit.panel.lines
    .map((line) => [line, indexAt(line, at)])
    .filter(([line, i]) => line.kind !== "points" && i >= 0 && Number.isFinite(line.y[i]))
    .slice(0, 14);
}

function leave(reader) {
  reader.tip.hidden = true;
  reader.rule.setAttribute("d", "");
  highlight(reader.figure, "");
}

const KEYS = {
  ArrowLeft: (reader) => step(reader, -1),
  ArrowRight: (reader) => step(reader, 1),
  ArrowUp: (reader) => choose(reader, -1),
  ArrowDown: (reader) => choose(reader, 1),
  "+": (reader) => zoomAround(reader, 0.5),
  "-": (reader) => zoomAround(reader, 2),
  Escape: (reader) => (leave(reader), zoomTo(reader.figure, null)),
  Enter: (reader) => reader.cursor?.line.pick && openPick(reader.cursor.line.pick),
};

function onKey(reader, event) {
  const act = KEYS[event.key];
  if (event.key === "Escape" && reader.box.closest("dialog")) return; // it closes the dialog
  if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  act(reader);
}

/** Every curve of a view that can be read, panel by panel. */
const curves = (view) => view.panels.flatMap((panel) => panel.lines.map((line) => ({ panel, line })));

function step(reader, way) {
  const all = curves(reader.view);
  const { line } = reader.cursor ?? all[Math.min(reader.line, all.length - 1)] ?? {};
  if (!line) return;
  const { x } = reader.view;
  const count = line.x.length;
  const wide = line.kind === "points" || line.kind === "both" ? 1 : Math.max(1, Math.round(shownOf(line, x) / 60));
  let index = reader.cursor ? reader.cursor.index + way * wide : firstShown(line, x);
  while (index > 0 && index < count - 1 && !Number.isFinite(line.y[index])) index += way;
  setCursor(reader, Math.min(Math.max(index, 0), count - 1));
}

const shownOf = (line, x) => line.x.reduce((n, v) => n + (v >= x.low && v <= x.high), 0);
const firstShown = (line, x) => Math.max(0, line.x.findIndex((v) => v >= x.low));

function choose(reader, way) {
  const all = curves(reader.view);
  if (!all.length) return;
  reader.line = (reader.line + (reader.cursor ? way : 0) + all.length) % all.length;
  const at = reader.cursor ? reader.cursor.line.x[reader.cursor.index] : reader.view.x.low;
  reader.cursor = null;
  setCursor(reader, Math.max(0, indexAt(all[reader.line].line, at)));
}

function setCursor(reader, index) {
  const all = curves(reader.view);
  reader.line = Math.min(reader.line, all.length - 1);
  const { panel, line } = all[reader.line];
  reader.cursor = { line, index };
  reader.figure.chosen = reader.line; // drawn anew, the same curve is read on
  const hit = hitAt(panel, line, index, 0, 0, false);
  if (hit) showTip(reader, hit);
  const name = line.label || line.who || line.role;
  say(`${name}, ${panel.panel.y}: ${digits(line.y[index])}${ends(line, index)} at ${sayX(reader.figure.chart, line.x[index])}`);
}

function zoomAround(reader, factor) {
  const { x } = reader.view;
  const at = reader.cursor ? x.to(reader.cursor.line.x[reader.cursor.index]) : (x.begin + x.end) / 2;
  const half = ((x.end - x.begin) * factor) / 2;
  const ends = [x.from(at - half), x.from(at + half)];
  if (ends.every(Number.isFinite)) zoomTo(reader.figure, ends);
}

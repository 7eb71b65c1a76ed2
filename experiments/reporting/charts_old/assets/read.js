// Reading values off a chart, and zooming: by pointer and by keyboard alike.

const HELP =
  "Left and right read off values, up and down choose a curve, plus and minus zoom, " +
  "Enter opens the chosen curve where it can be opened, Escape goes back.";

/** Let a view be read: pointer, touch, keys. */
function readable(figure, view) {
  const { box } = view;
  const tip = el("div", { class: "tip", hidden: true });
  const reader = { figure, view, box, tip, chosen: 0, cursor: null, drag: null };
  box.setAttribute("tabindex", "0");
  box.setAttribute("aria-label", `${box.getAttribute("aria-label")} ${HELP}`);
  box.append(tip);
  box.addEventListener("pointermove", (event) => onMove(reader, event));
  box.addEventListener("pointerleave", () => leave(reader));
  box.addEventListener("pointerdown", (event) => onDown(reader, event));
  box.addEventListener("pointerup", (event) => onUp(reader, event));
  box.addEventListener("dblclick", () => zoomTo(view, null));
  box.addEventListener("keydown", (event) => onKey(reader, event));
  box.addEventListener("blur", () => leave(reader));
}

/** Which panel lies under the pointer, and where in it: pixels, and the share of the whole axis. */
function placeOf({ view }, event) {
  const panel = view.panels.find(({ svg }) => {
    const { top, bottom } = svg.getBoundingClientRect();
    return event.clientY >= top - 13 && event.clientY <= bottom + 13;
  });
  const { left, top, width, height } = (panel ?? view.panels[0]).svg.getBoundingClientRect();
  const [px, py] = [event.clientX - left, event.clientY - top];
  const [a, b] = view.shown;
  return { panel, px, py, width, height, share: a + (Math.min(Math.max(px / width, 0), 1)) * (b - a) };
}

function onMove(reader, event) {
  const place = placeOf(reader, event);
  if (reader.drag !== null) return showBrush(reader, place.share);
  const hit = nearest(reader.view, place);
  hit ? showTip(reader, hit) : leave(reader);
}

function onDown(reader, event) {
  if (event.button === 0 && event.pointerType !== "touch") reader.drag = placeOf(reader, event).share;
}

function onUp(reader, event) {
  const place = placeOf(reader, event);
  const { view, drag } = reader;
  reader.drag = null;
  view.box.querySelectorAll(".brush").forEach((brush) => brush.remove());
  const [a, b] = view.shown;
  if (drag !== null && Math.abs(place.share - drag) > (6 / place.width) * (b - a)) return zoomBetween(view, drag, place.share);
  const hit = nearest(view, place);
  if (hit && hit.line.pick && hit.distance < 14) openPick(hit.line.pick);
  else if (hit) showTip(reader, hit); // a finger does not hover
}

function showBrush({ view, drag }, share) {
  const [a, b] = [drag, share].sort((p, q) => p - q);
  for (const { area } of view.panels) {
    const brush = area.querySelector(".brush") ?? area.appendChild(svg("rect", { class: "brush", height: UNITS }));
    brush.setAttribute("x", UNITS * a);
    brush.setAttribute("width", UNITS * (b - a));
  }
}

function zoomBetween(view, a, b) {
  const ends = [a, b].map((share) => view.x.value(share)).sort((p, q) => p - q);
  if (ends[1] > ends[0]) zoomTo(view, ends);
}

/** Show a range of x of a view, or none: as at first. */
function zoomTo(view, ends) {
  State.set({ [`win.${view.id}`]: ends && ends.map((v) => Number(v.toPrecision(5))).join("~") });
}

/** What is drawn next to a place: { panel, line, index, x, y, distance }, or null; x and y shares. */
function nearest(view, place) {
  if (!place.panel || place.px < -8 || place.px > place.width + 8) return null;
  const hits = shownLines(place.panel).flatMap((line) => (line.marked ? pointHits(view, place, line) : curveHit(place, line)));
  return hits.reduce((best, hit) => (!best || hit.distance < best.distance ? hit : best), null);
}

const shownLines = (panel) => panel.lines.filter((line) => !hidden(line.who));

function curveHit({ panel, share, py, height }, line) {
  const y = heightAt(line.curve, share);
  return Number.isFinite(y) ? [{ panel, line, x: share, y, distance: Math.abs((1 - y) * height - py) }] : [];
}

function pointHits(view, { panel, px, py, width, height }, line) {
  const [a, b] = view.shown;
  return line.values.map((row, index) => {
    const [x, y] = [view.x.share(row[0]), panel.y.share(row[1])];
    const distance = Math.hypot(((x - a) / (b - a)) * width - px, (1 - y) * height - py);
    return { panel, line, index, x, y, distance };
  }).filter((hit) => Number.isFinite(hit.distance));
}

/** Say what there is at a place: all curves at this x, the chosen one first in weight. */
function showTip(reader, hit) {
  const { view, tip, box } = reader;
  leave(reader);
  highlight(reader.figure.place, hit.line.who);
  const [a, b] = view.shown;
  const at = (hit.x - a) / (b - a);
  for (const { svg: panel } of view.panels)
    panel.append(svg("line", { class: "rule", x1: `${100 * at}%`, x2: `${100 * at}%`, y2: panel.getAttribute("height") }));
  tip.replaceChildren(...tipRows(view, hit));
  tip.hidden = false;
  const [panel, whole] = [hit.panel.svg.getBoundingClientRect(), box.getBoundingClientRect()];
  const px = panel.left - whole.left + at * panel.width;
  tip.style.left = at > 0.5 ? "" : `${px + 12}px`;
  tip.style.right = at > 0.5 ? `${whole.width - px + 12}px` : "";
  tip.style.top = `${panel.top - whole.top + 4}px`;
}

function tipRows(view, hit) {
  const rows = alike(hit).map((each) =>
    el("div", { class: each.line === hit.line ? "chosen" : null }, swatchOf(each.line), el("span", { symbols: each.line.said }),
      el("b", { text: digits(valueOfHit(each), each.line.marked ? 4 : 3) }), el("small", { text: endsOf(each) })),
  );
  const more = hit.line.pick ? [el("small", { text: "click to open" })] : [];
  return [el("div", { class: "where", symbols: `${view.label}: ${sayX(view, xOfHit(view, hit))}` }), ...rows, ...more];
}

function swatchOf(line) {
  return el("i", { class: `key ${line.group.getAttribute("class")}` });
}

/** The curves that have a value at the same x: for points only the point itself. */
function alike(hit) {
  if (hit.line.marked) return [hit];
  const { panel, x } = hit;
  const found = shownLines(panel).filter((line) => !line.marked).map((line) => ({ panel, line, x, y: heightAt(line.curve, x) }));
  return found.filter(({ y }) => Number.isFinite(y)).slice(0, 14);
}

const xOfHit = (view, { line, index, x }) => (line.marked ? line.values[index][0] : view.x.value(x));
const valueOfHit = ({ panel, line, index, y }) => (line.marked ? line.values[index][1] : panel.y.value(y));

function endsOf({ panel, line, index, x }) {
  const ends = line.marked ? line.values[index].slice(2, 4) : (line.sides ?? []).map((side) => panel.y.value(heightAt(side, x)));
  return ends.length && ends.every(Number.isFinite) ? ` ${digits(ends[0], 3)} … ${digits(ends[1], 3)}` : "";
}

function leave(reader) {
  reader.tip.hidden = true;
  reader.box.querySelectorAll("line.rule").forEach((rule) => rule.remove());
  highlight(reader.figure.place, "");
}

const KEYS = {
  ArrowLeft: (reader) => step(reader, -1),
  ArrowRight: (reader) => step(reader, 1),
  ArrowUp: (reader) => choose(reader, -1),
  ArrowDown: (reader) => choose(reader, 1),
  "+": (reader) => zoomAround(reader, 0.5),
  "-": (reader) => zoomAround(reader, 2),
  Escape: (reader) => (leave(reader), zoomTo(reader.view, null)),
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
const curvesOf = (view) => view.panels.flatMap((panel) => shownLines(panel).map((line) => ({ panel, line })));

/** Go on along the chosen curve: to its next point, or by a sixtieth of the view. */
function step(reader, way) {
  const { panel, line } = curvesOf(reader.view)[reader.chosen] ?? {};
  if (!line) return;
  const [a, b] = reader.view.shown;
  const { cursor } = reader;
  if (line.marked) {
    const index = cursor ? cursor.index + way : 0;
    return setCursor(reader, pointAt(reader.view, panel, line, Math.min(Math.max(index, 0), line.values.length - 1)));
  }
  const x = cursor ? Math.min(Math.max(cursor.x + (way * (b - a)) / 60, a), b) : a;
  setCursor(reader, { panel, line, x, y: heightAt(line.curve, x) });
}

const pointAt = (view, panel, line, index) =>
  ({ panel, line, index, x: view.x.share(line.values[index][0]), y: panel.y.share(line.values[index][1]) });

/** Read the curve above or below on, at the same x. */
function choose(reader, way) {
  const all = curvesOf(reader.view);
  if (!all.length) return;
  reader.chosen = (reader.chosen + (reader.cursor ? way : 0) + all.length) % all.length;
  const { panel, line } = all[reader.chosen];
  const x = reader.cursor?.x ?? reader.view.shown[0];
  if (!line.marked) return setCursor(reader, { panel, line, x, y: heightAt(line.curve, x) });
  const far = line.values.map((row) => Math.abs(reader.view.x.share(row[0]) - x));
  setCursor(reader, pointAt(reader.view, panel, line, far.indexOf(Math.min(...far))));
}

function setCursor(reader, hit) {
  reader.cursor = hit;
  showTip(reader, hit);
  const value = Number.isFinite(hit.y) ? `${digits(valueOfHit(hit), hit.line.marked ? 4 : 3)}${endsOf(hit)}` : "–";
  say(`${hit.line.said}, ${hit.panel.label}: ${value} at ${sayX(reader.view, xOfHit(reader.view, hit))}`);
}

function zoomAround({ view, cursor }, factor) {
  const [a, b] = view.shown;
  const [at, half] = [cursor?.x ?? (a + b) / 2, ((b - a) * factor) / 2];
  zoomTo(view, half >= 0.5 ? null : [at - half, at + half].map((share) => view.x.value(share)));
}

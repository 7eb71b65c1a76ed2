// A chart stands in the page as it was drawn; here it is measured, and shown over another range.

const Figures = new Map(); // by id: { name, place, views }
const UNITS = 10000; // of the inner picture, as `reporting/drawing.py` has it

/** Make a figure of the page one that can be read, zoomed and saved. */
function setUpFigure(place) {
  const boxes = [...place.querySelectorAll(".view")];
  const figure = { name: place.id, place, views: boxes.map((box, i) => viewOf(place, box, i)) };
  Figures.set(place.id, figure);
  place.querySelector(".legend").append(chartMenu(figure));
  for (const view of figure.views) {
    readable(figure, view);
    zoomed(view);
  }
}

/** A view: its axes in values, the share of it that is shown, and its panels. */
function viewOf(place, box, i) {
  const { from, to, log, origin } = box.dataset;
  const view = { box, id: i ? `${place.id}.${i + 1}` : place.id, x: axisOf(from, to, log), origin };
  view.label = place.dataset.x;
  view.shown = [0, 1];
  view.panels = [...box.querySelectorAll("svg.panel")].map((svg) => panelOf(svg));
  return view;
}

/** An axis: from a share of its length to a value, and back. */
function axisOf(from, to, log) {
  const [low, high] = [Number(from), Number(to)];
  const [f, back] = log ? [Math.log, Math.exp] : [(v) => v, (v) => v];
  const [a, span] = [f(low), f(high) - f(low) || 1];
  return { log: Boolean(log), share: (value) => (f(value) - a) / span, value: (share) => back(a + share * span) };
}

/** A panel with its curves, which are measured when they are first asked for. */
function panelOf(svg) {
  const { y, from, to, log } = svg.dataset;
  const area = svg.querySelector(".area");
  let lines = null;
  return {
    svg, area, label: y, y: axisOf(from, to, log), title: svg.querySelector(".panel-title")?.textContent ?? "",
    below: svg.querySelector(".below"), texts: [...(svg.querySelector(".below")?.childNodes ?? [])],
    grid: area.querySelector(".grid.x"), lattice: area.querySelector(".grid.x").getAttribute("d"),
    get lines() {
      lines ??= [...area.querySelectorAll("g.line")].map((group) => lineOf(area, group));
      return lines;
    },
  };
}

/** A line: its points as shares of the panel, and the values of those that are marked. */
function lineOf(area, group) {
  const { who, said, pick, points } = group.dataset;
  const line = { who, said, pick, group, marked: points !== undefined };
  if (line.marked) line.values = points.split(";").map((row) => row.split(",").map((v) => (v === "" ? NaN : Number(v))));
  else line.curve = pointsOf(group.querySelector(".curve"));
  const band = who && [...area.querySelectorAll("path.band")].find((path) => path.dataset.who === who);
  if (band && !line.marked) line.sides = sidesOfBand(band);
  return line;
}

/** The points of a path, as shares to the right and upwards; a gap between two parts. */
function pointsOf(path) {
  const found = [];
  let x = 0, y = 0;
  for (const [, kind, text] of (path?.getAttribute("d") ?? "").matchAll(/([MLl])([^MLlhZ]*)/g)) {
    if (kind === "M" && found.length) found.push([NaN, NaN]);
    const [dx, dy] = text.split(",").map(Number);
    [x, y] = kind === "l" ? [x + dx, y + dy] : [dx, dy];
    found.push([x / UNITS, 1 - y / UNITS]);
  }
  return found;
}

/** The upper and the lower side of a band: it is drawn there and back. */
function sidesOfBand(path) {
  const upper = [], lower = [];
  for (const part of path.getAttribute("d").split("Z").filter(Boolean)) {
    const [there, back] = [part.slice(0, part.indexOf("L")), part.slice(part.indexOf("L"))];
    const side = (d) => pointsOf({ getAttribute: () => d });
    upper.push(...(upper.length ? [[NaN, NaN]] : []), ...side(there));
    lower.push(...(lower.length ? [[NaN, NaN]] : []), ...side(back).reverse());
  }
  return [lower, upper];
}

/** How high a curve is at a share of the width; NaN where it is not. */
function heightAt(curve, share) {
  for (let i = 1; i < curve.length; i++) {
    const [[a, p], [b, q]] = [curve[i - 1], curve[i]];
    if (a <= share && share <= b) return b > a ? p + ((share - a) / (b - a)) * (q - p) : q;
  }
  return NaN;
}

/** Show of a view what the state says: all of it, or a range. */
function zoomed(view) {
  const ends = /^(-?[\d.e+-]+)~(-?[\d.e+-]+)$/.exec(State.get(`win.${view.id}`));
  const shares = ends ? [ends[1], ends[2]].map((v) => view.x.share(Number(v))) : [0, 1];
  const [a, b] = shares[1] > shares[0] ? shares : [0, 1];
  if (a === view.shown[0] && b === view.shown[1]) return;
  view.shown = [a, b];
  for (const panel of view.panels) showRange(view, panel, a, b);
  view.box.classList.toggle("zoomed", a !== 0 || b !== 1);
}

function showRange(view, panel, a, b) {
  panel.area.setAttribute("viewBox", `${UNITS * a} 0 ${UNITS * (b - a)} ${UNITS}`);
  for (const part of panel.svg.querySelectorAll("use, text.remark")) {
    part.dataset.at ??= parseFloat(part.getAttribute("x")) / 100;
    const at = (Number(part.dataset.at) - a) / (b - a);
    part.setAttribute("x", `${(100 * at).toFixed(2)}%`);
    part.classList.toggle("gone", part.tagName === "text" && !(at >= 0 && at <= 1));
  }
  const whole = a === 0 && b === 1;
  const values = whole ? [] : roundValues(view.x.value(a), view.x.value(b), view.x.log);
  const share = (value) => view.x.share(value);
  panel.grid.setAttribute("d", whole ? panel.lattice : values.map((v) => `M${Math.round(UNITS * share(v))},0V${UNITS}`).join(""));
  panel.below?.replaceChildren(...(whole ? panel.texts : values.map((v) =>
    svg("text", { x: `${(100 * (share(v) - a)) / (b - a)}%`, text: sayX(view, v) }))));
}

/** Round values of a range, some six. */
function roundValues(low, high, log) {
  if (log && high > 5 * low) {
    const powers = Array.from({ length: 40 }, (_, i) => i - 20);
    const all = powers.flatMap((p) => [1, 2, 5].map((digit) => Number(`${digit}e${p}`)));
    return all.filter((value) => value >= low && value <= high);
  }
  const raw = (high - low) / 6;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, i) => Number(((first + i) * step).toPrecision(12)));
}

/** A value of x in words: a number, or when it was. */
function sayX(view, value) {
  if (!view.origin) return digits(value);
  const zero = Date.parse(view.origin + (view.origin.includes("T") ? "Z" : "T00:00Z"));
  const text = new Date(zero + value * 86400000).toISOString();
  return text.slice(11, 16) === "00:00" ? text.slice(0, 10) : text.slice(0, 16).replace("T", " ");
}

/** Make the curves of one estimator stand out; of none, all as before. */
function highlight(place, who) {
  for (const part of place.querySelectorAll(".views :is(.line, .band)")) {
    part.classList.toggle("far", Boolean(who && part.dataset.who) && part.dataset.who !== who);
    part.classList.toggle("near", Boolean(who) && part.dataset.who === who);
  }
}

/** A piece of the line of an estimator, for the list of them: as the legends have it. */
function swatch(who) {
  const there = document.querySelector(`[data-toggle="${CSS.escape(who)}"] > .swatch, [data-who="${CSS.escape(who)}"] .swatch`);
  return there ? there.cloneNode(true) : null;
}

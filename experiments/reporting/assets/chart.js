// A chart in the page: legend, windows, one view or two side by side.

const SIDE_BY_SIDE = 1000; // pixels of a figure from which two views stand beside each other
const Figures = new Map(); // by name: { place, chart, views }

/** Make the frame of a chart, and draw it when it comes near the screen. */
function setUpFigure(place, chart) {
  const name = place.dataset.chart ?? place.id;
  const figure = { name, place, chart, views: [], frame: el("div", { class: "views" }) };
  figure.legend = el("div", { class: "legend", role: "group", "aria-label": "Curves: press to hide everywhere" });
  figure.switch = el("div", { class: "windows", role: "group", "aria-label": "Range shown" });
  const skip = el("button", { type: "button", class: "skip small", text: "To the chart" });
  skip.addEventListener("click", () => (drawNow(place), figure.frame.querySelector(".view")?.focus()));
  numberBounds(chart);
  place.classList.add("chart");
  const above = el("div", { class: "above" }, figure.switch, chartMenu(figure));
  place.replaceChildren(skip, figure.legend, above, figure.frame);
  const expected = 62 + (chart.panels.length > 1 ? 191 * chart.panels.length : 330);
  figure.frame.style.minHeight = `${expected}px`;
  figure.draw = () => drawFigure(figure);
  Figures.set(name, figure);
  whenNear(place, figure.draw);
  return figure;
}

const waiting = new Map();
const watcher = new IntersectionObserver(
  (entries) => entries.filter((e) => e.isIntersecting).forEach((e) => drawNow(e.target)),
  { rootMargin: "700px" },
);

function whenNear(place, draw) {
  waiting.set(place, draw);
  watcher.observe(place);
}

function drawNow(place) {
  const draw = waiting.get(place);
  waiting.delete(place);
  watcher.unobserve(place);
  draw?.();
}

/** Draw all again, each when it comes near: a long page has a hundred. */
function redrawFigures() {
  for (const figure of Figures.values()) {
    watcher.unobserve(figure.place); // who is near already is told so again
    whenNear(figure.place, figure.draw);
  }
}

function drawFigure(figure) {
  if (figure.chart.xs) return drawHeat(figure);
  drawLegend(figure);
  const ranges = rangesOf(figure);
  drawSwitch(figure, ranges);
  const room = figure.frame.clientWidth || figure.place.clientWidth || 900;
  const shown = room >= SIDE_BY_SIDE ? ranges.slice(0, 2) : ranges.slice(0, 1);
  const width = Math.max(300, Math.floor((room - 16 * (shown.length - 1)) / shown.length));
  figure.views = shown.map((range, i) =>
    drawView(figure.chart, range.ends, width, `${figure.name}-${i}`),
  );
  replaceKeepingFocus(figure.frame, figure.views.map((view) => readable(figure, view)));
  figure.frame.style.minHeight = "";
}

/** The ranges to show: what is chosen or zoomed, then the last window where that is another. */
function rangesOf(figure) {
  const { chart, name } = figure;
  const windows = windowsOf(chart);
  const chosen = State.get(`win.${name}`);
  const zoom = /^(-?[\d.e+-]+)~(-?[\d.e+-]+)$/.exec(chosen);
  const first = zoom
    ? { name: "zoom", ends: [Number(zoom[1]), Number(zoom[2])] }
    : (windows.find((w) => w.name === chosen) ?? windows[0]);
  const last = windows[windows.length - 1];
  return first === last ? [first] : [first, last];
}

function windowsOf(chart) {
  const given = (chart.windows ?? []).map(([name, from, to]) => ({ name, ends: [from, to] }));
  return given.length ? given : [{ name: "all", ends: xRange(chart) }];
}

function drawSwitch(figure, [first]) {
  const windows = windowsOf(figure.chart);
  const key = `win.${figure.name}`;
  const buttons = windows.map((w, i) => {
    const pressed = String(first.name === w.name);
    const choose = () => State.set({ [key]: i ? w.name : null });
    return el("button", { type: "button", class: "small", "aria-pressed": pressed, onclick: choose, text: w.name });
  });
  const zoomed = first.name === "zoom";
  const back = el("button", {
    type: "button", class: "small", text: "Zoom out", onclick: () => State.set({ [key]: null }),
  });
  const wanted = (windows.length > 1 ? buttons : []).concat(zoomed ? [back] : []);
  replaceKeepingFocus(figure.switch, wanted);
}

/** The legend: a button an estimator hides it in the whole page; the rest is words. */
function drawLegend(figure) {
  const found = new Map();
  for (const panel of figure.chart.panels)
    for (const line of panel.lines) {
      const key = line.role && line.role !== "estimate" && line.label ? line.label : line.who || line.label;
      if (key && !found.has(key)) found.set(key, line);
    }
  const items = [...found].map(([text, line]) =>
    line.who && text === line.who ? whoButton(figure, line) : roleItem(line, text),
  );
  replaceKeepingFocus(figure.legend, items);
}

function whoButton(figure, line) {
  const shown = !hidden(line.who);
  const light = (on) => () => highlight(figure, on ? line.who : "");
  return el(
    "button",
    {
      type: "button", class: "who", "aria-pressed": String(shown), "data-toggle": line.who,
      title: shown ? "hide everywhere" : "show everywhere",
      onclick: () => State.toggle("hide", line.who, shown),
      onmouseenter: light(true), onmouseleave: light(false), onfocus: light(true), onblur: light(false),
    },
    swatch(line),
    el("span", { text: line.pick && line.kind === "points" ? line.who : line.label || line.who }),
  );
}

const roleItem = (line, text) =>
  el("span", { class: "role" }, swatch(line), el("span", { symbols: text }));

/** Make the curves of one estimator stand out; of none, all as before. */
function highlight(figure, who) {
  for (const part of figure.frame.querySelectorAll(".line, .band")) {
    part.classList.toggle("far", Boolean(who && part.dataset.who) && part.dataset.who !== who);
    part.classList.toggle("near", Boolean(who) && part.dataset.who === who);
  }
}

/** Replace buttons by new ones, and keep the keyboard where it was. */
function replaceKeepingFocus(place, children) {
  const at = [...place.children].indexOf(document.activeElement);
  place.replaceChildren(...children);
  if (at >= 0) place.children[Math.min(at, children.length - 1)]?.focus({ preventScroll: true });
}

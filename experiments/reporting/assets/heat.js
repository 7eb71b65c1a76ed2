// Maps of cells, one an estimator, on one scale of colour.

// After cividis (Nuñez, Anderton and Renslow, 2018): reads the same to the colour-blind.
const STOPS = [[0, 34, 78], [61, 78, 107], [124, 123, 120], [187, 173, 108], [254, 232, 56]];

function drawHeat(figure) {
  const { chart } = figure;
  const shown = chart.panels.filter((panel) => !hidden(panel.who));
  const range = heatRange(chart);
  const tone = toneOf(chart, range);
  const room = figure.frame.clientWidth || figure.place.clientWidth || 900;
  const columns = Math.max(1, Math.min(shown.length, Math.floor(room / 340)));
  const width = Math.min(620, Math.floor((room - 12 * (columns - 1)) / columns));
  drawHeatLegend(figure, range);
  figure.views = [];
  figure.frame.replaceChildren(...shown.map((panel) => heatBox(figure, panel, tone, width)));
  figure.frame.style.minHeight = "";
}

function heatRange(chart) {
  const all = chart.panels.flatMap((panel) => panel.values.flatMap((row) => [...row]));
  const fine = all.filter((v) => v !== null && Number.isFinite(v) && !(chart.log && v <= 0));
  return fine.length ? [least(fine), most(fine)] : [0, 1];
}

/** A function from a value to its share of the scale, 0 … 1. */
function toneOf(chart, [low, high]) {
  const f = chart.log ? Math.log : (v) => v;
  return (value) => (f(value) - f(low)) / (f(high) - f(low) || 1);
}

function shade(share) {
  const at = Math.min(Math.max(share, 0), 1) * (STOPS.length - 1);
  const i = Math.min(Math.floor(at), STOPS.length - 2);
  const mixed = STOPS[i].map((c, k) => Math.round(c + (at - i) * (STOPS[i + 1][k] - c)));
  return `rgb(${mixed.join(" ")})`;
}

function drawHeatLegend(figure, [low, high]) {
  const steps = Array.from({ length: 24 }, (_, i) =>
    svg("rect", { x: 5 * i, y: 0, width: 5.3, height: 12, fill: shade(i / 23) }),
  );
  const whos = figure.chart.panels.filter((panel) => panel.who);
  replaceKeepingFocus(figure.legend, [
    el("span", { class: "role" }, digits(low, 3), svg("svg", { width: 120, height: 12, "aria-hidden": "true" }, ...steps),
      `${digits(high, 3)} ${figure.chart.unit ?? ""}`),
    ...(whos.length > 1 ? whos.map((panel) => whoButton(figure, panel)) : []),
  ]);
}

function heatBox(figure, panel, tone, width) {
  const { chart } = figure;
  const tip = el("div", { class: "tip", hidden: true });
  const title = panel.title || panel.who || "";
  const picture = svg("svg", { class: "plot", role: "img", "aria-label": `${chart.title} ${title}` });
  const longest = most(chart.ys.map((y) => nameOf(y).length));
  const left = Math.min(150, 30 + 6.6 * longest);
  const cell = { w: (width - left - 8) / chart.xs.length, h: Math.max(16, Math.min(30, 240 / chart.ys.length)) };
  const height = 24 + cell.h * chart.ys.length + 44;
  for (const [key, value] of Object.entries({ viewBox: `0 0 ${width} ${height}`, width, height }))
    picture.setAttribute(key, value);
  picture.append(svg("text", { x: left, y: 14, class: "panel-title", symbols: title }));
  panel.values.forEach((row, j) => [...row].forEach((value, i) => {
    if (value === null || !Number.isFinite(value)) return;
    picture.append(...cellAt(left + i * cell.w, 22 + (chart.ys.length - 1 - j) * cell.h, cell, value, tone(value)));
  }));
  heatAxes(picture, chart, { left, cell, width, height });
  const label = `${chart.title}, ${title}: ${chart.unit ?? ""} over ${chart.x} and ${chart.y}. Arrow keys read off cells.`;
  const box = el("div", { class: "view heat", tabindex: "0", role: "group", "aria-label": label }, picture, tip);
  const reader = { chart, panel, picture, tip, left, cell, width, i: 0, j: -1 };
  box.addEventListener("pointermove", (event) => readCell(reader, event));
  box.addEventListener("pointerleave", () => (tip.hidden = true));
  box.addEventListener("blur", () => (tip.hidden = true));
  box.addEventListener("keydown", (event) => moveCell(reader, event));
  return box;
}

const nameOf = (value) => (typeof value === "number" ? digits(value, 3) : value);

function cellAt(x, y, cell, value, share) {
  const text = digits(value, 2);
  const rect = svg("rect", { x: x.toFixed(1), y: y.toFixed(1), width: cell.w.toFixed(2), height: cell.h.toFixed(2), fill: shade(share) });
  if (cell.w < 7 * text.length) return [rect];
  return [rect, svg("text", {
    x: x + cell.w / 2, y: y + cell.h / 2, dy: "0.33em", "text-anchor": "middle", class: "cell",
    fill: share > 0.5 ? "#111" : "#fff", text,
  })];
}

function heatAxes(picture, chart, { left, cell, width, height }) {
  chart.ys.forEach((y, j) => picture.append(svg("text", {
    x: left - 5, y: 22 + (chart.ys.length - 0.5 - j) * cell.h, dy: "0.33em", "text-anchor": "end", symbols: nameOf(y),
  })));
  const every = Math.ceil((7 * most(chart.xs.map((x) => nameOf(x).length)) + 6) / cell.w);
  chart.xs.forEach((x, i) => i % every === 0 && picture.append(svg("text", {
    x: left + (i + 0.5) * cell.w, y: height - 28, "text-anchor": "middle", symbols: nameOf(x),
  })));
  picture.append(
    svg("text", { x: (left + width) / 2, y: height - 8, "text-anchor": "middle", class: "label", symbols: chart.x }),
    svg("text", { transform: `translate(12,${height / 2 - 10}) rotate(-90)`, "text-anchor": "middle", class: "label", symbols: chart.y }),
  );
}

/** Read off the cell below the pointer. */
function readCell(reader, event) {
  const { chart, picture, left, cell, width } = reader;
  const box = picture.getBoundingClientRect();
  const k = width / box.width;
  reader.i = Math.floor(((event.clientX - box.left) * k - left) / cell.w);
  reader.j = chart.ys.length - 1 - Math.floor(((event.clientY - box.top) * k - 22) / cell.h);
  showCell(reader);
}

const MOVES = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** Go to the next cell by keyboard, and say what is there. */
function moveCell(reader, event) {
  const move = MOVES[event.key];
  if (!move) return;
  event.preventDefault();
  const { chart } = reader;
  const first = reader.j < 0;
  reader.i = first ? 0 : Math.min(Math.max(reader.i + move[0], 0), chart.xs.length - 1);
  reader.j = first ? 0 : Math.min(Math.max(reader.j + move[1], 0), chart.ys.length - 1);
  showCell(reader);
  say([...reader.tip.children].map((line) => line.textContent).join(", "));
}

function showCell({ chart, panel, picture, tip, left, cell, width, i, j }) {
  const value = panel.values[j]?.[i];
  tip.hidden = value === undefined || i < 0;
  if (tip.hidden) return;
  tip.replaceChildren(
    el("div", { symbols: `${chart.x}: ${nameOf(chart.xs[i])}` }), el("div", { symbols: `${chart.y}: ${nameOf(chart.ys[j])}` }),
    el("b", { text: `${digits(value)} ${chart.unit ?? ""}` }),
  );
  const k = picture.getBoundingClientRect().width / width;
  tip.style.left = `${Math.max(0, Math.min((left + (i + 0.6) * cell.w) * k, width * k - 170))}px`;
  tip.style.top = `${(26 + (chart.ys.length - j) * cell.h) * k}px`;
}

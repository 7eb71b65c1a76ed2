// One view of a chart as SVG: panels below one another over a common range of x.

const FONT = 12;
const PANEL = { alone: 330, several: 165, gap: 26 };
const MANY_POINTS = 150; // from which on markers would be a blot, and are dots
const EDGE = { top: 22, right: 14, bottom: 40, left: 62 };

/**
 * Draw a chart over a range of x.
 * Returns { svg, panels: [{ x, y, lines, top, bottom }], range } for reading off.
 */
function drawView(chart, range, width, name) {
  const height = chart.panels.length > 1 ? PANEL.several : Math.min(PANEL.alone, 0.75 * width);
  const total = EDGE.top + chart.panels.length * (height + PANEL.gap) - PANEL.gap + EDGE.bottom;
  const picture = svg("svg", {
    class: "plot", viewBox: `0 0 ${width} ${total}`, width, height: total,
    role: "img", "aria-label": described(chart, range),
  });
  const x = scale(range, [EDGE.left, width - EDGE.right], chart.x_log);
  if (chart.x_from) x.ticks = datedTicks(chart, x);
  const panels = chart.panels.map((panel, i) => {
    const top = EDGE.top + i * (height + PANEL.gap);
    return drawPanel(picture, { chart, panel, x, top, bottom: top + height, id: `${name}-${i}` });
  });
  const last = panels[panels.length - 1];
  drawXAxis(picture, chart, x, last.bottom);
  return { svg: picture, panels, range, x, width, height: total };
}

const described = (chart, [from, to]) =>
  `${chart.title}: ${chart.panels.map((p) => p.y).join(", ")} over ${chart.x}, ` +
  `curves ${namesIn(chart).join(", ")}, ` +
  `${sayX(chart, from)} to ${sayX(chart, to)}. The same values stand in the tables and can be saved.`;

/** Whom a chart shows, each once. */
const namesIn = (chart) => [
  ...new Set(chart.panels.flatMap((p) => p.lines.filter((l) => !hidden(l.who)).map((l) => l.label || l.who || l.role))),
].filter(Boolean);

function drawPanel(picture, { chart, panel, x, top, bottom, id }) {
  const lines = panel.lines.filter((line) => !hidden(line.who));
  const y = scale(yRange(panel, lines, [x.low, x.high]), [bottom, top], panel.y_log);
  const clip = svg("clipPath", { id }, svg("rect", {
    x: x.begin, y: top, width: x.end - x.begin, height: bottom - top,
  }));
  const inside = svg("g", { "clip-path": `url(#${id})` });
  drawSpans(inside, chart, x, top, bottom);
  drawGrid(picture, panel, y, x, top, bottom);
  for (const line of byRole(lines)) drawBand(inside, line, x, y);
  for (const line of byRole(lines)) drawLine(inside, line, x, y);
  picture.append(clip, inside);
  if (top === EDGE.top) drawMarks(picture, chart, x, top);
  if (panel.title)
    picture.append(svg("text", { x: x.begin, y: top - 7, class: "panel-title", symbols: panel.title }));
  return { panel, lines, x, y, top, bottom };
}

/** Estimates first, so that truth and bounds are seen upon them. */
const byRole = (lines) => [...lines].sort((a, b) => order(a) - order(b));
const order = (line) => ["data", "estimate", "bound", "truth"].indexOf(line.role ?? "estimate");

function drawGrid(picture, panel, y, x, top, bottom) {
  for (const tick of y.ticks) {
    const at = y.to(tick.value).toFixed(1);
    picture.append(
      svg("path", { class: "grid", d: `M${x.begin},${at}H${x.end}` }),
      svg("text", { x: x.begin - 6, y: at, dy: "0.32em", "text-anchor": "end", text: tick.text }),
    );
  }
  picture.append(
    svg("path", { class: "axis", d: `M${x.begin},${top}V${bottom}H${x.end}` }),
    svg("text", {
      transform: `translate(13,${(top + bottom) / 2}) rotate(-90)`, "text-anchor": "middle",
      class: "label", symbols: panel.y,
    }),
  );
  for (const tick of x.ticks) {
    const at = x.to(tick.value).toFixed(1);
    picture.append(svg("path", { class: "grid", d: `M${at},${top}V${bottom}` }));
  }
}

function drawXAxis(picture, chart, x, bottom) {
  for (const tick of x.ticks)
    picture.append(svg("text", {
      x: x.to(tick.value).toFixed(1), y: bottom + 16, "text-anchor": "middle", text: tick.text,
    }));
  picture.append(svg("text", {
    x: (x.begin + x.end) / 2, y: bottom + 34, "text-anchor": "middle", class: "label", symbols: chart.x,
  }));
}

function drawSpans(inside, chart, x, top, bottom) {
  for (const [from, to] of chart.spans ?? []) {
    const a = Math.max(x.to(Math.max(from, x.low)), x.begin);
    const b = Math.min(x.to(Math.min(to, x.high)), x.end);
    if (b > a)
      inside.append(svg("rect", { class: "span", x: a, y: top, width: b - a, height: bottom - top }));
  }
  for (const [at] of chart.marks ?? [])
    if (at >= x.low && at <= x.high)
      inside.append(svg("path", { class: "mark", d: `M${x.to(at).toFixed(1)},${top}V${bottom}` }));
}

/** What happens where, in words above the first panel: no two upon each other. */
function drawMarks(picture, chart, x, top) {
  const spans = (chart.spans ?? []).map(([from, to, words]) => [Math.max(from, x.low), words, to]);
  const marks = (chart.marks ?? []).map(([at, words]) => [at, words, at]);
  let free = x.begin;
  for (const [at, words, end] of [...spans, ...marks].sort((a, b) => a[0] - b[0])) {
    if (!words || end < x.low || at > x.high) continue;
    const wide = words.length * FONT * 0.5;
    const place = Math.min(Math.max(x.to(at), free), x.end - wide);
    if (place < free - 1) continue;
    picture.append(svg("text", { x: place, y: top - 6, class: "remark", symbols: words }));
    free = place + wide + 8;
  }
}

function drawBand(inside, line, x, y) {
  if (!line.low || line.kind === "points") return;
  const look = lookOf(line);
  const parts = runs(line, x, (i) => Number.isFinite(line.low[i]) && Number.isFinite(line.high[i]));
  for (const run of parts) {
    const up = run.map((i) => [line.x[i], line.high[i]]);
    const down = run.map((i) => [line.x[i], line.low[i]]).reverse();
    inside.append(svg("path", {
      class: "band", "data-who": line.who || null, fill: look.colour, d: path([...up, ...down], x, y) + "Z",
    }));
  }
}

function drawLine(inside, line, x, y) {
  const look = lookOf(line);
  const group = svg("g", { class: "line", "data-who": line.who || null, "data-pick": line.pick || null });
  if (line.kind !== "points")
    for (const run of runs(line, x, (i) => Number.isFinite(line.y[i])))
      group.append(svg("path", {
        d: path(run.map((i) => [line.x[i], line.y[i]]), x, y, line.kind === "steps"),
        stroke: look.colour, "stroke-width": look.width, "stroke-dasharray": look.dash || null,
        fill: "none",
      }));
  if (line.kind === "points" || line.kind === "both") drawPoints(group, line, look, x, y);
  else if (looks[line.who]) drawMarkers(group, line, look, x, y);
  inside.append(group);
}

/** A few markers along a line tell it from others where colours do not. */
function drawMarkers(group, line, look, x, y) {
  const phase = ((looks[line.who].place * 7) % 9) / 9;
  for (let n = 0; n < 4; n++) {
    const target = x.from(x.begin + ((n + phase) / 4) * (x.end - x.begin));
    const at = y.to(valueAt(line, target));
    if (Number.isFinite(at)) group.append(markerAt(look, x.to(target), at, { class: "sparse" }));
  }
}

/** What a line has at a value of x between its points; NaN beyond them. */
function valueAt(line, x) {
  let i = 0;
  while (i < line.x.length && !(line.x[i] > x)) i++;
  if (i === 0 || i === line.x.length) return NaN;
  if (line.kind === "steps") return line.y[i - 1];
  const share = (x - line.x[i - 1]) / (line.x[i] - line.x[i - 1]);
  return line.y[i - 1] + share * (line.y[i] - line.y[i - 1]);
}

function drawPoints(group, line, look, x, y) {
  const finite = (...values) => values.every((v) => v !== undefined && Number.isFinite(v));
  const whiskers = [], shown = [];
  for (let i = 0; i < line.x.length; i++) {
    const [px, py] = [x.to(line.x[i]), y.to(line.y[i])];
    if (!finite(px, py)) continue;
    shown.push([px, py]);
    if (finite(line.low?.[i], line.high?.[i])) whiskers.push([px, y.to(line.low[i]), px, y.to(line.high[i])]);
    if (finite(line.x_low?.[i], line.x_high?.[i])) whiskers.push([x.to(line.x_low[i]), py, x.to(line.x_high[i]), py]);
  }
  const many = shown.length > MANY_POINTS;
  if (whiskers.length) group.append(svg("path", {
    class: "whisker", stroke: look.colour, opacity: many ? 0.4 : null,
    d: whiskers.map((w) => w.map((v) => v.toFixed(1))).map(([a, b, c, d]) => `M${a},${b}L${c},${d}`).join(""),
  }));
  if (many) group.append(svg("path", {
    stroke: look.colour, "stroke-width": 3, "stroke-linecap": "round",
    d: shown.map(([px, py]) => `M${px.toFixed(1)},${py.toFixed(1)}h0`).join(""),
  }));
  else group.append(...shown.map(([px, py]) => markerAt(look, px, py)));
}

/** Indices of consecutive points that are there, with one beyond each end of the view. */
function runs(line, x, there) {
  const found = [];
  let run = [];
  for (let i = 0; i < line.x.length; i++) {
    const around = [line.x[i - 1] ?? line.x[i], line.x[i], line.x[i + 1] ?? line.x[i]];
    const near = most(around) >= x.low && least(around) <= x.high;
    if (near && Number.isFinite(line.x[i]) && there(i)) run.push(i);
    else if (run.length) found.push(run), (run = []);
  }
  if (run.length) found.push(run);
  return found;
}

/** The path through points; of steps, each value until the next. */
function path(points, x, y, steps = false) {
  const far = 1e5; // what lies beyond is clipped anyway, and browsers have limits
  const at = points.map(([a, b]) => [x.to(a), Math.max(-far, Math.min(far, y.to(b)))]);
  return at
    .map(([a, b], i) => {
      const place = `${a.toFixed(1)},${b.toFixed(1)}`;
      return i && steps ? `H${a.toFixed(1)}V${b.toFixed(1)}` : (i ? "L" : "M") + place;
    })
    .join("");
}
